//! Progress of long work: it reports how far it is, and learns that it should stop.

use std::sync::{Mutex, PoisonError};

use crate::{Error, Result};

/// Observer of a long piece of work. The library prints nothing itself.
pub trait Progress: Sync {
    /// A piece of work of `steps` equal steps begins; it ends where the next one begins.
    fn begin(&self, what: &str, steps: u64);

    /// Reports that so many steps more are done. Called from any thread.
    fn advance(&self, steps: u64);

    /// A word on the state of the work, such as the best merit so far.
    fn note(&self, _text: &str) {}

    /// Something that whoever waits should know even when the next piece of work has begun, such as a result that could not be
    /// kept.
    fn warn(&self, text: &str) {
        self.note(text);
    }

    /// True if departures from a file format that a reader can read over are errors, not warnings.
    fn strict(&self) -> bool {
        false
    }

    /// True if the user asked to stop; long work asks between steps and then returns
    /// [`Error::Interrupted`], or the best result so far where that is of use.
    fn stopped(&self) -> bool {
        false
    }

    /// Ends long work between two steps if the user asked to stop.
    ///
    /// # Errors
    /// [`Error::Interrupted`], if the user asked to stop.
    fn check_stopped(&self) -> Result<()> {
        if self.stopped() {
            Err(Error::Interrupted)
        } else {
            Ok(())
        }
    }
}

/// Nobody watches.
#[derive(Clone, Copy, Debug, Default)]
pub struct Silent;

impl Progress for Silent {
    fn begin(&self, _what: &str, _steps: u64) {}

    fn advance(&self, _steps: u64) {}
}

/// Work that has another name for whoever waits: one of several passes over a file.
pub struct Named<'a>(pub &'a dyn Progress, pub &'a str);

impl Progress for Named<'_> {
    fn begin(&self, _what: &str, steps: u64) {
        self.0.begin(self.1, steps);
    }

    fn advance(&self, steps: u64) {
        self.0.advance(steps);
    }

    fn note(&self, text: &str) {
        self.0.note(text);
    }

    fn warn(&self, text: &str) {
        self.0.warn(text);
    }

    fn strict(&self) -> bool {
        self.0.strict()
    }

    fn stopped(&self) -> bool {
        self.0.stopped()
    }
}

/// Steps of one piece of work. Work that begins within a step moves the piece by a part of that step, and does not take its place.
pub struct Steps<'p> {
    progress: &'p dyn Progress,
    present: Mutex<PresentStep>,
}

/// Resolution of the progress within a step: reported units of each step.
const PARTS: u64 = 1000;

/// Share of the remaining step that nested work advances: more nested work may follow.
const WITHIN: f64 = 0.9;

/// Progress of the present step of [`Steps`], in units of [`PARTS`].
#[derive(Default)]
struct PresentStep {
    told: u64,
    /// Parts before the work within it, and the steps of that work: done, and all.
    before: u64,
    done: u64,
    steps: u64,
}

impl<'p> Steps<'p> {
    /// A piece of work of `steps` equal steps begins.
    pub fn begin(progress: &'p dyn Progress, what: &str, steps: u64) -> Self {
        progress.begin(what, steps.saturating_mul(PARTS));
        Self {
            progress,
            present: Mutex::default(),
        }
    }

    /// The present step is done.
    pub fn done(&self) {
        self.tell(|present| {
            let rest = PARTS - present.told;
            *present = PresentStep::default();
            rest
        });
    }

    fn tell(&self, change: impl FnOnce(&mut PresentStep) -> u64) {
        let parts = change(&mut self.present.lock().unwrap_or_else(PoisonError::into_inner));
        self.progress.advance(parts);
    }
}

impl Progress for Steps<'_> {
    fn begin(&self, _what: &str, steps: u64) {
        self.tell(|present| {
            (present.before, present.done, present.steps) = (present.told, 0, steps.max(1));
            0
        });
    }

    fn advance(&self, steps: u64) {
        self.tell(|present| {
            present.done += steps;
            let share = (present.done as f64 / present.steps.max(1) as f64).min(1.0);
            let told = present.before + (WITHIN * share * (PARTS - present.before) as f64) as u64;
            let more = told.saturating_sub(present.told);
            present.told += more;
            more
        });
    }

    fn note(&self, text: &str) {
        self.progress.note(text);
    }

    fn warn(&self, text: &str) {
        self.progress.warn(text);
    }

    fn strict(&self) -> bool {
        self.progress.strict()
    }

    fn stopped(&self) -> bool {
        self.progress.stopped()
    }
}

/// Hears that the user wants to stop, and shows nothing: the work is a step of something else.
pub struct Quiet<'a>(pub &'a dyn Progress);

impl Progress for Quiet<'_> {
    fn begin(&self, _what: &str, _steps: u64) {}

    fn advance(&self, _steps: u64) {}

    fn strict(&self) -> bool {
        self.0.strict()
    }

    fn stopped(&self) -> bool {
        self.0.stopped()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Begun pieces of work, and steps that were told.
    #[derive(Default)]
    struct Heard(Mutex<(Vec<(String, u64)>, u64)>);

    impl Progress for Heard {
        fn begin(&self, what: &str, steps: u64) {
            self.0.lock().unwrap().0.push((what.to_owned(), steps));
        }

        fn advance(&self, steps: u64) {
            self.0.lock().unwrap().1 += steps;
        }
    }

    #[test]
    fn work_within_a_step_moves_the_whole() {
        let heard = Heard::default();
        let told = || heard.0.lock().unwrap().1;
        let steps = Steps::begin(&heard, "simulating", 2);
        steps.begin("cells", 10);
        steps.advance(5);
        assert_eq!(told(), 450);
        // More than was expected.
        steps.advance(15);
        assert_eq!(told(), 900);
        steps.begin("more cells", 1);
        steps.advance(1);
        assert_eq!(told(), 990);
        steps.done();
        assert_eq!(told(), 1000);
        steps.done();
        assert_eq!(told(), 2000);
        assert_eq!(heard.0.lock().unwrap().0, [("simulating".to_owned(), 2000)]);
    }
}
