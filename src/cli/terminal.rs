//! Progress that the program shows while it works: bars on a terminal, a line now and then where there is none.

use std::collections::BTreeSet;
use std::io::IsTerminal;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};
use metalith::report::counted;
use metalith::text::printable;
use metalith::{FolderLock, Progress, Warning};

use super::course::{Course, CoursePlace, left};
use super::output;

/// Time when Ctrl-C was first pressed in commands that can stop between two steps.
static ASKED: OnceLock<Instant> = OnceLock::new();

/// Signals within this time are one wish to stop: a shell, `timeout` and a group of processes each send their own.
const ONE_WISH: Duration = Duration::from_secs(1);

/// Time between two lines of progress where there is no terminal: a log of an hour has a page of them, and a run that ends
/// within it none.
const BETWEEN_LINES: Duration = Duration::from_secs(30);

/// Time between two drawings of a bar.
const BETWEEN_BARS: Duration = Duration::from_millis(100);

/// Time between two looks at work that reports nothing.
const BETWEEN_TICKS: Duration = Duration::from_secs(1);

/// Parts of a bar.
const BAR_LENGTH: u64 = 1000;

/// Warnings that are printed in full, two lines each.
const MOST_WARNINGS: usize = 3;

/// The user's terminal, or the log that standard error goes to.
pub struct Terminal {
    quiet: bool,
    strict: AtomicBool,
    shown: Arc<Shown>,
    /// Set once a thread tells the time while a step lasts.
    ticking: OnceLock<()>,
    /// Warnings that were printed: a layout may be opened more than once.
    warned: Mutex<BTreeSet<String>>,
}

/// Display of the progress, shared by all threads.
struct Shown {
    bar: Mutex<Option<ProgressBar>>,
    told: Mutex<Told>,
}

/// State of the progress, and the time of the last report.
struct Told {
    course: Course,
    work: Option<Work>,
    /// The last word on the state of the work, and whether a line has held it.
    note: Option<(String, bool)>,
    /// Time when the last line was written.
    at: Instant,
    /// True once the wish to stop was answered.
    is_stopping: bool,
}

/// Work that is at hand.
struct Work {
    what: String,
    steps: u64,
    done: u64,
    begun: Instant,
}

impl Told {
    fn new(now: Instant) -> Self {
        Self {
            course: Course::default(),
            work: None,
            note: None,
            at: now,
            is_stopping: false,
        }
    }

    fn begin(&mut self, what: &str, steps: u64, now: Instant) {
        // Short pieces of work follow one another: what was said of the last one waits for the next line.
        self.note = self.note.take().filter(|(_, told)| !told);
        self.course.begin(what, now);
        self.work = Some(Work {
            what: what.to_owned(),
            steps,
            done: 0,
            begun: now,
        });
    }

    fn end(&mut self) {
        self.work = None;
        self.note = None;
    }

    /// True if it is time to tell again, which is then taken for done.
    fn is_due(&mut self, now: Instant, between: Duration) -> bool {
        let is_due = now.duration_since(self.at) >= between;
        if is_due {
            self.at = now;
        }
        is_due
    }

    /// Place of the work at hand.
    fn place(&self, now: Instant) -> Option<(&Work, CoursePlace)> {
        let work = self.work.as_ref()?;
        let share = work.done as f64 / work.steps.max(1) as f64;
        Some((work, self.course.place(share, now.duration_since(work.begun))))
    }

    /// Line of a log on the work at hand.
    fn line(&mut self, now: Instant) -> Option<String> {
        let (work, place) = self.place(now)?;
        let step = place
            .step
            .map_or_else(String::new, |[number, of]| format!(" ({number} of {of})"));
        let of_all = if place.step.is_some() { " of all" } else { "" };
        let seconds = now.duration_since(work.begun).as_secs_f64();
        let left = place
            .left_s
            .map_or_else(String::new, |s| format!(", about {}", left(s)));
        let head = format!(
            "{}{step}: {:.0} %{of_all} after {seconds:.0} s{left}",
            work.what,
            place.share * 100.0
        );
        let note = self.note.as_mut().map_or_else(String::new, |(text, told)| {
            *told = true;
            format!("; {text}")
        });
        Some(head + &note)
    }

    /// Draw a bar of the work at hand.
    fn draw(&self, bar: &ProgressBar, now: Instant) {
        let Some((work, place)) = self.place(now) else { return };
        let step = place
            .step
            .map_or_else(String::new, |[number, of]| format!("{number}/{of} "));
        let left = place.left_s.map_or_else(String::new, left);
        let note = self
            .note
            .as_ref()
            .map_or_else(String::new, |(text, _)| format!("; {text}"));
        bar.set_message(step + &printable(&work.what));
        bar.set_prefix(printable(&format!("{left}{note}")).into_owned());
        bar.set_position((place.share * BAR_LENGTH as f64) as u64);
    }
}

/// True if a wish to stop ends the process at once, `since` the first one.
fn ends_at_once(since: Duration) -> bool {
    since >= ONE_WISH
}

impl Shown {
    fn bar(&self) -> MutexGuard<'_, Option<ProgressBar>> {
        self.bar.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn told(&self) -> MutexGuard<'_, Told> {
        self.told.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn say(&self, line: &str) {
        let tell = || output::tell(&format!("{line}\n"));
        match &*self.bar() {
            Some(bar) => bar.suspend(tell),
            None => tell(),
        }
    }

    /// Draw the bar, or write a line of a log, if it is time for that.
    fn tell(&self, change: impl FnOnce(&mut Told)) {
        let (now, bar) = (Instant::now(), self.bar());
        let mut told = self.told();
        change(&mut told);
        if let Some(bar) = &*bar {
            if told.is_due(now, BETWEEN_BARS) {
                told.draw(bar, now);
            }
            return;
        }
        // Lines go past the bar, which takes its lock.
        drop(bar);
        let line = (told.work.is_some() && told.is_due(now, BETWEEN_LINES))
            .then(|| told.line(now))
            .flatten();
        drop(told);
        if let Some(line) = line {
            self.say(&line);
        }
    }
}

impl Terminal {
    /// A terminal that shows progress unless `quiet` is set.
    pub fn new(quiet: bool) -> Self {
        Self {
            quiet,
            strict: AtomicBool::new(false),
            shown: Arc::new(Shown {
                bar: Mutex::new(None),
                told: Mutex::new(Told::new(Instant::now())),
            }),
            ticking: OnceLock::new(),
            warned: Mutex::new(BTreeSet::new()),
        }
    }

    /// Print a line for a person, unless `--quiet`. Goes to standard error: standard output is for answers.
    pub fn say(&self, line: &str) {
        if !self.quiet {
            self.shown.say(line);
        }
    }

    /// Print warnings about an input, unless `--quiet`; of many the first in full and the others by their identities, so that the
    /// first screen holds what came out.
    pub fn warnings(&self, warnings: &[Warning]) {
        let full = match warnings.len() {
            0..=MOST_WARNINGS => warnings.len(),
            _ => MOST_WARNINGS - 1,
        };
        let (full, others) = warnings.split_at(full);
        full.iter().for_each(|warning| self.say(&warning.to_string()));
        if !others.is_empty() {
            let others: Vec<String> = others.iter().map(|warning| format!("[{}]", warning.id)).collect();
            let more = counted(others.len(), "more warning");
            self.say(&format!("and {more}: {}", others.join(" ")));
        }
    }

    /// Refuse layouts that depart from their format.
    pub fn set_strict(&self, strict: bool) {
        self.strict.store(strict, Ordering::Relaxed);
    }

    /// True if nothing but errors and requested output is printed.
    pub fn is_quiet(&self) -> bool {
        self.quiet
    }

    /// Tell progress as that of a course, which begins now.
    pub(crate) fn follow(&self, course: Course) {
        self.shown.told().course = course;
    }

    /// Tell the time while a step lasts, from a thread that ends with the terminal.
    fn tick(&self) {
        self.ticking.get_or_init(|| {
            let shown = Arc::downgrade(&self.shown);
            std::thread::spawn(move || {
                loop {
                    std::thread::sleep(BETWEEN_TICKS);
                    let Some(shown) = shown.upgrade() else { return };
                    shown.tell(|_| ());
                    if ASKED.get().is_some() && !std::mem::replace(&mut shown.told().is_stopping, true) {
                        shown.say("stopping after the present step");
                    }
                }
            });
        });
    }

    /// Wait until no other process writes the files of a folder, which are made together. They replace none of the `inputs`.
    ///
    /// # Errors
    /// As [`FolderLock::wait`].
    pub fn turn_at<'p>(
        &self,
        folder: &Path,
        inputs: impl IntoIterator<Item = &'p Path>,
    ) -> metalith::Result<FolderLock> {
        let turn = FolderLock::wait(folder, self, || {
            self.say(&format!(
                "another process writes into {}: waiting for it",
                folder.display()
            ));
        });
        Ok(turn?.keeping(inputs))
    }

    /// Let Ctrl-C ask for a stop between two steps instead of ending the process; one more, a second later or more, ends it.
    pub fn stop_on_interrupt(&self) {
        let _ = ctrlc::set_handler(|| {
            if ends_at_once(ASKED.get_or_init(Instant::now).elapsed()) {
                std::process::exit(130);
            }
        });
    }

    /// Take the progress bar off the screen.
    pub fn clear(&self) {
        self.shown.told().end();
        if let Some(bar) = self.shown.bar().take() {
            bar.finish_and_clear();
        }
    }
}

impl Progress for Terminal {
    fn begin(&self, what: &str, steps: u64) {
        if self.quiet {
            return;
        }
        let now = Instant::now();
        self.shown.told().begin(what, steps, now);
        self.tick();
        if !std::io::stderr().is_terminal() {
            return;
        }
        let mut bar = self.shown.bar();
        let bar = bar.get_or_insert_with(|| {
            let style = ProgressStyle::with_template("{msg:30} {wide_bar} {percent:>3} %  {prefix}")
                .expect("the template is a constant");
            ProgressBar::new(BAR_LENGTH).with_style(style)
        });
        self.shown.told().draw(bar, now);
    }

    fn advance(&self, steps: u64) {
        self.shown.tell(|told| {
            if let Some(work) = &mut told.work {
                work.done += steps;
            }
        });
    }

    fn note(&self, text: &str) {
        if self.shown.told().work.is_none() {
            self.say(text);
            return;
        }
        self.shown.tell(|told| told.note = Some((text.to_owned(), false)));
    }

    fn warn(&self, text: &str) {
        let mut warned = self.warned.lock().unwrap_or_else(PoisonError::into_inner);
        if warned.insert(text.to_owned()) {
            self.say(text);
        }
    }

    fn strict(&self) -> bool {
        self.strict.load(Ordering::Relaxed)
    }

    fn stopped(&self) -> bool {
        ASKED.get().is_some()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_log_gets_a_line_now_and_then() {
        let begun = Instant::now();
        let after = |seconds| begun + Duration::from_secs(seconds);
        let mut told = Told::new(begun);
        told.begin("solving", 200, begun);
        assert!(!told.is_due(after(29), BETWEEN_LINES));
        told.work.as_mut().unwrap().done = 50;
        assert!(told.is_due(after(30), BETWEEN_LINES));
        let line = told.line(after(30)).unwrap();
        assert_eq!(line, "solving: 25 % after 30 s, about 90 s left");
        assert!(!told.is_due(after(31), BETWEEN_LINES));
        told.work.as_mut().unwrap().done = 500;
        assert!(told.is_due(after(90), BETWEEN_LINES));
        let line = told.line(after(90)).unwrap();
        assert_eq!(line, "solving: 100 % after 90 s, about 0 s left");
    }

    /// Words on the state of the work stand in its lines, and those on short work in the line that comes after it.
    #[test]
    fn lines_of_a_log_hold_the_last_word() {
        let begun = Instant::now();
        let after = |seconds| begun + Duration::from_secs(seconds);
        let mut told = Told::new(begun);
        let (learning, restoring) = (("learning", 100), ("restoring", 10));
        told.begin(learning.0, learning.1, begun);
        told.note = Some(("loss 2".into(), false));
        told.work.as_mut().unwrap().done = 10;
        let line = told.line(after(30)).unwrap();
        assert_eq!(line, "learning: 10 % after 30 s, about 4 min left; loss 2");
        told.begin(restoring.0, restoring.1, after(61));
        told.note = Some(("20 dB".into(), false));
        told.begin(restoring.0, restoring.1, after(85));
        told.work.as_mut().unwrap().done = 5;
        let line = told.line(after(95)).unwrap();
        assert_eq!(line, "restoring: 50 % after 10 s, about 10 s left; 20 dB");
        told.begin(restoring.0, restoring.1, after(120));
        told.work.as_mut().unwrap().done = 5;
        let line = told.line(after(130)).unwrap();
        assert_eq!(line, "restoring: 50 % after 10 s, about 10 s left");
    }

    #[test]
    fn one_press_is_one_wish() {
        assert!(!ends_at_once(Duration::ZERO) && !ends_at_once(Duration::from_millis(900)));
        assert!(ends_at_once(Duration::from_millis(1100)));
    }
}
