//! Progress of long work: it reports how far it is, and learns that it should stop.

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
