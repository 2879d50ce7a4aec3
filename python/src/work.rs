//! Long calls: without the interpreter's lock, to be stopped by Ctrl-C, with progress.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use metalith::{Error, Progress, Result};
use pyo3::prelude::*;

use crate::MetalithError;

/// Time between two looks for Ctrl-C: no person feels it, and no call waits for it.
const LOOK: Duration = Duration::from_millis(100);

/// Progress of the work, for the caller's thread to read.
#[derive(Default)]
struct Watched {
    what: Mutex<String>,
    steps: AtomicU64,
    done: AtomicU64,
    stop: AtomicBool,
}

impl Progress for Watched {
    fn begin(&self, what: &str, steps: u64) {
        what.clone_into(&mut self.what.lock().unwrap_or_else(PoisonError::into_inner));
        self.steps.store(steps, Ordering::Relaxed);
        self.done.store(0, Ordering::Relaxed);
    }

    fn advance(&self, steps: u64) {
        self.done.fetch_add(steps, Ordering::Relaxed);
    }

    fn stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }
}

/// Run `f` on a separate thread. `progress` is called with what is done, the steps that are done and all of them.
///
/// # Errors
/// As [`MetalithError`]; `KeyboardInterrupt`, or what the callback raised, once the work has stopped.
pub fn work<T: Send>(
    py: Python<'_>,
    progress: Option<Py<PyAny>>,
    f: impl FnOnce(&dyn Progress) -> Result<T> + Send,
) -> PyResult<T> {
    let watched = Watched::default();
    let (tell, told) = mpsc::channel();
    // A receiver alone may not be lent to where the lock is not held.
    let told = Mutex::new(told);
    std::thread::scope(|scope| {
        let watched = &watched;
        scope.spawn(move || {
            // Whoever waits may have gone.
            let _ = tell.send(f(watched));
        });
        let mut raised: Option<PyErr> = None;
        loop {
            let answer = py.detach(|| {
                let told = told.lock().unwrap_or_else(PoisonError::into_inner);
                told.recv_timeout(LOOK)
            });
            match answer {
                Ok(answer) => return raised.map_or_else(|| answer.map_err(error), Err),
                Err(RecvTimeoutError::Disconnected) => {
                    return Err(MetalithError::new_err(
                        "the work ended without an answer; report this as a bug",
                    ));
                }
                Err(RecvTimeoutError::Timeout) if raised.is_some() => {}
                Err(RecvTimeoutError::Timeout) => {
                    if let Err(found) = look(py, progress.as_ref(), watched) {
                        raised = Some(found);
                        watched.stop.store(true, Ordering::Relaxed);
                    }
                }
            }
        }
    })
}

fn look(py: Python<'_>, progress: Option<&Py<PyAny>>, watched: &Watched) -> PyResult<()> {
    py.check_signals()?;
    if let Some(callback) = progress {
        let what = watched.what.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let (done, steps) = (
            watched.done.load(Ordering::Relaxed),
            watched.steps.load(Ordering::Relaxed),
        );
        callback.call1(py, (what, done.min(steps), steps))?;
    }
    Ok(())
}

/// An error with the words of the program.
pub fn error(error: Error) -> PyErr {
    MetalithError::new_err(error.to_string())
}
