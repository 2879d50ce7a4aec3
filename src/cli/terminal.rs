//! Progress that the program shows while it works: bars on a terminal, a line now and then where there is none.

use std::collections::BTreeSet;
use std::io::IsTerminal;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};
use metalith::report::counted;
use metalith::text::printable;
use metalith::{FolderLock, Progress, Warning};

use super::output;

/// Time when Ctrl-C was first pressed in commands that can stop between two steps.
static ASKED: OnceLock<Instant> = OnceLock::new();

/// Signals within this time are one wish to stop: a shell, `timeout` and a group of processes each send their own.
const ONE_WISH: Duration = Duration::from_secs(1);

/// Time between two lines of progress where there is no terminal: a log of an hour has a page of them, and a run that ends
/// within it none.
const BETWEEN_LINES: Duration = Duration::from_secs(30);

/// Warnings that are printed in full, two lines each.
const MOST_WARNINGS: usize = 3;

/// The user's terminal, or the log that standard error goes to.
pub struct Terminal {
    quiet: bool,
    strict: AtomicBool,
    bar: Mutex<Option<ProgressBar>>,
    log: Mutex<Log>,
    /// Warnings that were printed: a layout may be opened more than once.
    warned: Mutex<BTreeSet<String>>,
}

/// Log of the progress of work.
struct Log {
    work: Option<Work>,
    /// The last word on the state of the work, and whether a line has held it.
    note: Option<(String, bool)>,
    /// Time when the last line was written.
    told: Instant,
}

/// Work of which a log is told.
struct Work {
    what: String,
    steps: u64,
    done: u64,
    begun: Instant,
}

impl Log {
    fn new(now: Instant) -> Self {
        Self {
            work: None,
            note: None,
            told: now,
        }
    }

    fn begin(&mut self, what: &str, steps: u64, now: Instant) {
        // Short pieces of work follow one another: what was said of the last one waits for the next line.
        self.note = self.note.take().filter(|(_, told)| !told);
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

    /// The line to tell, if it is time for one.
    fn advance(&mut self, steps: u64, now: Instant) -> Option<String> {
        self.work.as_mut()?.done += steps;
        self.line(now)
    }

    /// Line after a word on the state of the work; outside of any work, the word itself.
    fn note(&mut self, text: &str, now: Instant) -> Option<String> {
        if self.work.is_none() {
            return Some(text.to_owned());
        }
        self.note = Some((text.to_owned(), false));
        self.line(now)
    }

    fn line(&mut self, now: Instant) -> Option<String> {
        let work = self.work.as_ref()?;
        if now.duration_since(self.told) < BETWEEN_LINES {
            return None;
        }
        self.told = now;
        let share = (work.done as f64 / work.steps.max(1) as f64).min(1.0);
        let seconds = now.duration_since(work.begun).as_secs_f64();
        let left = if share > 0.0 {
            format!(", about {:.0} s left", seconds * (1.0 - share) / share)
        } else {
            String::new()
        };
        let note = self.note.as_mut().map_or_else(String::new, |(text, told)| {
            *told = true;
            format!("; {text}")
        });
        Some(format!(
            "{}: {:.0} % after {seconds:.0} s{left}{note}",
            work.what,
            share * 100.0
        ))
    }
}

/// True if a wish to stop ends the process at once, `since` the first one.
fn ends_at_once(since: Duration) -> bool {
    since >= ONE_WISH
}

impl Terminal {
    /// A terminal that shows progress unless `quiet` is set.
    pub fn new(quiet: bool) -> Self {
        Self {
            quiet,
            strict: AtomicBool::new(false),
            bar: Mutex::new(None),
            log: Mutex::new(Log::new(Instant::now())),
            warned: Mutex::new(BTreeSet::new()),
        }
    }

    /// Print a line for a person, unless `--quiet`. Goes to standard error: standard output is for answers.
    pub fn say(&self, line: &str) {
        if self.quiet {
            return;
        }
        let tell = || output::tell(&format!("{line}\n"));
        match &*self.bar() {
            Some(bar) => bar.suspend(tell),
            None => tell(),
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

    fn bar(&self) -> MutexGuard<'_, Option<ProgressBar>> {
        self.bar.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn log(&self) -> MutexGuard<'_, Log> {
        self.log.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn clear_bar(&self) {
        if let Some(bar) = self.bar().take() {
            bar.finish_and_clear();
        }
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
        self.log().end();
        self.clear_bar();
    }
}

impl Progress for Terminal {
    fn begin(&self, what: &str, steps: u64) {
        self.clear_bar();
        if self.quiet {
            return;
        }
        if !std::io::stderr().is_terminal() {
            self.log().begin(what, steps, Instant::now());
            return;
        }
        let style = ProgressStyle::with_template("{msg:28} {wide_bar} {percent:>3} %  {eta:>4} left {prefix}")
            .expect("the template is a constant");
        let bar = ProgressBar::new(steps.max(1))
            .with_style(style)
            .with_message(printable(what).into_owned());
        *self.bar() = Some(bar);
    }

    fn advance(&self, steps: u64) {
        if let Some(bar) = &*self.bar() {
            bar.inc(steps);
        }
        let line = self.log().advance(steps, Instant::now());
        if let Some(line) = line {
            self.say(&line);
        }
    }

    fn note(&self, text: &str) {
        if let Some(bar) = &*self.bar() {
            bar.set_prefix(printable(text).into_owned());
            return;
        }
        let line = self.log().note(text, Instant::now());
        if let Some(line) = line {
            self.say(&line);
        }
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
        let mut log = Log::new(begun);
        log.begin("solving", 200, begun);
        assert_eq!(log.advance(10, after(29)), None);
        let line = log.advance(40, after(30)).unwrap();
        assert_eq!(line, "solving: 25 % after 30 s, about 90 s left");
        assert_eq!(log.advance(10, after(31)), None);
        let line = log.advance(500, after(90)).unwrap();
        assert_eq!(line, "solving: 100 % after 90 s, about 0 s left");
    }

    /// Words on the state of the work stand in its lines, and those on short work in the line that comes after it.
    #[test]
    fn lines_of_a_log_hold_the_last_word() {
        let begun = Instant::now();
        let after = |seconds| begun + Duration::from_secs(seconds);
        let mut log = Log::new(begun);
        assert_eq!(log.note("alone", begun).as_deref(), Some("alone"));
        log.begin("learning", 100, begun);
        assert_eq!(log.note("loss 3", after(1)), None);
        assert_eq!(log.note("loss 2", after(2)), None);
        let line = log.advance(10, after(30)).unwrap();
        assert_eq!(line, "learning: 10 % after 30 s, about 270 s left; loss 2");
        let line = log.advance(40, after(60)).unwrap();
        assert_eq!(line, "learning: 50 % after 60 s, about 60 s left; loss 2");
        log.begin("restoring", 10, after(61));
        assert_eq!(log.note("20 dB", after(62)), None);
        log.begin("restoring", 10, after(85));
        let line = log.advance(5, after(95)).unwrap();
        assert_eq!(line, "restoring: 50 % after 10 s, about 10 s left; 20 dB");
        log.begin("restoring", 10, after(120));
        let line = log.advance(5, after(130)).unwrap();
        assert_eq!(line, "restoring: 50 % after 10 s, about 10 s left");
    }

    #[test]
    fn one_press_is_one_wish() {
        assert!(!ends_at_once(Duration::ZERO) && !ends_at_once(Duration::from_millis(900)));
        assert!(ends_at_once(Duration::from_millis(1100)));
    }
}
