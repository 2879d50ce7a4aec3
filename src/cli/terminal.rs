//! What the program shows while it works: progress bars on a terminal, a line now and then where there is none.

use std::io::IsTerminal;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};
use metalith::{FolderTurn, Progress};

use super::output;

/// Set by Ctrl-C in commands that can stop between two steps.
static STOP: AtomicBool = AtomicBool::new(false);

/// Time between two lines of progress where there is no terminal: a log of an hour has a page of them, and what is done
/// within it none.
const BETWEEN_LINES: Duration = Duration::from_secs(30);

/// The user's terminal, or the log that standard error goes to.
pub struct Terminal {
    quiet: bool,
    bar: Mutex<Option<ProgressBar>>,
    log: Mutex<Option<Log>>,
}

/// Work of which a log is told.
struct Log {
    what: String,
    steps: u64,
    done: u64,
    begun: Instant,
    told: Instant,
}

impl Log {
    /// The line to tell, if it is time for one.
    fn advance(&mut self, steps: u64, now: Instant) -> Option<String> {
        self.done += steps;
        if now.duration_since(self.told) < BETWEEN_LINES {
            return None;
        }
        self.told = now;
        let share = (self.done as f64 / self.steps.max(1) as f64).min(1.0);
        let seconds = now.duration_since(self.begun).as_secs_f64();
        let left = if share > 0.0 {
            format!(", about {:.0} s left", seconds * (1.0 - share) / share)
        } else {
            String::new()
        };
        Some(format!(
            "{}: {:.0} % after {seconds:.0} s{left}",
            self.what,
            share * 100.0
        ))
    }
}

impl Terminal {
    /// A terminal that shows progress unless `quiet` is set.
    pub fn new(quiet: bool) -> Self {
        Self {
            quiet,
            bar: Mutex::new(None),
            log: Mutex::new(None),
        }
    }

    /// Print a line for a person, unless `--quiet`. Goes to standard error: standard output is for answers.
    pub fn say(&self, line: &str) {
        if self.quiet {
            return;
        }
        let tell = || output::tell(&format!("{line}\n"));
        match &*self.bar.lock().unwrap_or_else(PoisonError::into_inner) {
            Some(bar) => bar.suspend(tell),
            None => tell(),
        }
    }

    /// Wait until no other process writes the files of a folder, which are made together.
    pub fn turn_at(&self, folder: &Path) -> metalith::Result<FolderTurn> {
        FolderTurn::wait(folder, self, || {
            self.say(&format!(
                "another process writes into {}: waiting for it",
                folder.display()
            ));
        })
    }

    /// Let Ctrl-C ask for a stop between two steps instead of ending the process; a second one ends it.
    pub fn stop_on_interrupt(&self) {
        let _ = ctrlc::set_handler(|| {
            if STOP.swap(true, Ordering::SeqCst) {
                std::process::exit(130);
            }
        });
    }

    /// Take the progress bar off the screen.
    pub fn clear(&self) {
        *self.log.lock().unwrap_or_else(PoisonError::into_inner) = None;
        if let Some(bar) = self.bar.lock().unwrap_or_else(PoisonError::into_inner).take() {
            bar.finish_and_clear();
        }
    }
}

impl Progress for Terminal {
    fn begin(&self, what: &str, steps: u64) {
        self.clear();
        if self.quiet {
            return;
        }
        if !std::io::stderr().is_terminal() {
            let now = Instant::now();
            let log = Log {
                what: what.to_owned(),
                steps,
                done: 0,
                begun: now,
                told: now,
            };
            *self.log.lock().unwrap_or_else(PoisonError::into_inner) = Some(log);
            return;
        }
        let style = ProgressStyle::with_template("{msg:28} {wide_bar} {percent:>3} %  {eta:>4} left {prefix}")
            .expect("the template is a constant");
        let bar = ProgressBar::new(steps.max(1))
            .with_style(style)
            .with_message(what.to_owned());
        *self.bar.lock().unwrap_or_else(PoisonError::into_inner) = Some(bar);
    }

    fn advance(&self, steps: u64) {
        if let Some(bar) = &*self.bar.lock().unwrap_or_else(PoisonError::into_inner) {
            bar.inc(steps);
        }
        let mut log = self.log.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(line) = log.as_mut().and_then(|log| log.advance(steps, Instant::now())) {
            output::tell(&format!("{line}\n"));
        }
    }

    fn note(&self, text: &str) {
        if let Some(bar) = &*self.bar.lock().unwrap_or_else(PoisonError::into_inner) {
            bar.set_prefix(text.to_owned());
        }
    }

    fn stopped(&self) -> bool {
        STOP.load(Ordering::SeqCst)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_log_gets_a_line_now_and_then() {
        let begun = Instant::now();
        let mut log = Log {
            what: "solving".into(),
            steps: 200,
            done: 0,
            begun,
            told: begun,
        };
        assert_eq!(log.advance(10, begun + Duration::from_secs(29)), None);
        let line = log.advance(40, begun + Duration::from_secs(30)).unwrap();
        assert_eq!(line, "solving: 25 % after 30 s, about 90 s left");
        assert_eq!(log.advance(10, begun + Duration::from_secs(31)), None);
        let line = log.advance(500, begun + Duration::from_secs(90)).unwrap();
        assert_eq!(line, "solving: 100 % after 90 s, about 0 s left");
    }
}
