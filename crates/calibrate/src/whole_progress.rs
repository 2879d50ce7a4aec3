//! One progress for a whole calibration: steps done of steps to do, and the effects that are tried.

use std::sync::{Mutex, PoisonError};

use metalith_core::Progress;

/// Steps of a table of cells, which takes as long as so many simulations.
const STEPS_OF_TABLE: f64 = 10.0;

/// Steps that are reported; the last one is the end.
const REPORTED: f64 = 1000.0;

/// Progress of pieces of work as one.
pub(crate) struct WholeProgress<'p> {
    inner: &'p dyn Progress,
    state: Mutex<Progressed>,
}

/// What is done.
struct Progressed {
    steps: f64,
    done: f64,
    /// Steps of a part of the present piece of work.
    of_part: f64,
    /// Thousandths that were told.
    told: u64,
    /// The effects that are tried.
    trying: String,
}

impl<'p> WholeProgress<'p> {
    /// Begin work of about so many simulations and tables of cells.
    pub(crate) fn new(inner: &'p dyn Progress, simulations: usize, tables: usize) -> Self {
        inner.begin("calibration", REPORTED as u64);
        Self {
            inner,
            state: Mutex::new(Progressed {
                steps: simulations as f64 + STEPS_OF_TABLE * tables as f64,
                done: 0.0,
                of_part: 1.0,
                told: 0,
                trying: String::new(),
            }),
        }
    }

    fn with(&self, of: impl FnOnce(&mut Progressed)) {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        of(&mut state);
        // What takes longer than expected stays just below the end.
        let share = (state.done / state.steps).min(1.0 - 1.0 / REPORTED);
        let now = (share * REPORTED) as u64;
        let (more, note) = (now.saturating_sub(state.told), state.text());
        state.told = state.told.max(now);
        drop(state);
        self.inner.note(&note);
        self.inner.advance(more);
    }
}

impl Progressed {
    fn text(&self) -> String {
        let steps = format!("{:.0} of about {:.0} steps", self.done, self.steps.max(self.done));
        if self.trying.is_empty() {
            steps
        } else {
            format!("{steps}; {}", self.trying)
        }
    }
}

impl Progress for WholeProgress<'_> {
    fn begin(&self, what: &str, steps: u64) {
        let of_part = if what == super::cells::TABLE {
            STEPS_OF_TABLE / steps.max(1) as f64
        } else {
            1.0
        };
        self.with(|state| state.of_part = of_part);
    }

    fn advance(&self, steps: u64) {
        self.with(|state| state.done += state.of_part * steps as f64);
    }

    fn note(&self, text: &str) {
        self.with(|state| text.clone_into(&mut state.trying));
    }

    fn warn(&self, text: &str) {
        self.inner.warn(text);
    }

    fn stopped(&self) -> bool {
        self.inner.stopped()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Record of all reports.
    #[derive(Default)]
    struct Told {
        begun: Mutex<Vec<String>>,
        done: Mutex<u64>,
        note: Mutex<String>,
    }

    impl Progress for Told {
        fn begin(&self, what: &str, _: u64) {
            self.begun.lock().unwrap().push(what.to_owned());
        }

        fn advance(&self, steps: u64) {
            *self.done.lock().unwrap() += steps;
        }

        fn note(&self, text: &str) {
            text.clone_into(&mut self.note.lock().unwrap());
        }
    }

    #[test]
    fn pieces_of_work_are_one_that_never_starts_over() {
        let told = Told::default();
        let whole = WholeProgress::new(&told, 10, 1);
        whole.begin(super::super::cells::TABLE, 4);
        (0..4).for_each(|_| whole.advance(1));
        assert_eq!(*told.done.lock().unwrap(), 500);
        whole.note("trying cd_bias");
        whole.begin("measurements as they should be", 5);
        whole.advance(5);
        assert_eq!(*told.done.lock().unwrap(), 750);
        assert_eq!(*told.note.lock().unwrap(), "15 of about 20 steps; trying cd_bias");
        whole.advance(50);
        assert_eq!(*told.done.lock().unwrap(), 999);
        assert_eq!(told.begun.lock().unwrap().len(), 1);
    }
}
