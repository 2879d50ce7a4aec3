//! What the program shows while it works: progress bars on a terminal, nothing in a pipe.

use std::io::IsTerminal;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

use indicatif::{ProgressBar, ProgressStyle};
use metalith::Progress;

/// Set by Ctrl-C in commands that can stop between two steps.
static STOP: AtomicBool = AtomicBool::new(false);

/// The user's terminal.
pub struct Terminal {
    quiet: bool,
    bar: Mutex<Option<ProgressBar>>,
}

impl Terminal {
    /// A terminal that shows progress unless `quiet` is set or standard error is not a terminal.
    pub fn new(quiet: bool) -> Self {
        Self {
            quiet,
            bar: Mutex::new(None),
        }
    }

    /// Print a line for a person, unless `--quiet`. Goes to standard error: standard output is for answers.
    pub fn say(&self, line: &str) {
        if self.quiet {
            return;
        }
        match &*self.bar.lock().unwrap_or_else(std::sync::PoisonError::into_inner) {
            Some(bar) => bar.suspend(|| eprintln!("{line}")),
            None => eprintln!("{line}"),
        }
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
        if let Some(bar) = self
            .bar
            .lock()
            .unwrap_or_else(std::sync::PoisonError::into_inner)
            .take()
        {
            bar.finish_and_clear();
        }
    }
}

impl Progress for Terminal {
    fn begin(&self, what: &str, steps: u64) {
        self.clear();
        if self.quiet || !std::io::stderr().is_terminal() {
            return;
        }
        let style = ProgressStyle::with_template("{msg:28} {wide_bar} {percent:>3} %  {eta:>4} left {prefix}")
            .expect("the template is a constant");
        let bar = ProgressBar::new(steps.max(1))
            .with_style(style)
            .with_message(what.to_owned());
        *self.bar.lock().unwrap_or_else(std::sync::PoisonError::into_inner) = Some(bar);
    }

    fn advance(&self, steps: u64) {
        if let Some(bar) = &*self.bar.lock().unwrap_or_else(std::sync::PoisonError::into_inner) {
            bar.inc(steps);
        }
    }

    fn note(&self, text: &str) {
        if let Some(bar) = &*self.bar.lock().unwrap_or_else(std::sync::PoisonError::into_inner) {
            bar.set_prefix(text.to_owned());
        }
    }

    fn stopped(&self) -> bool {
        STOP.load(Ordering::SeqCst)
    }
}
