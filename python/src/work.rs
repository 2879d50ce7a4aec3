//! Work: on threads of this process, without the interpreter's lock, to be stopped by Ctrl-C, with progress.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use metalith::{Error, Progress, Result};
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::MetalithError;

/// Time between two looks for Ctrl-C: no person feels it, and no call waits for it.
const LOOK: Duration = Duration::from_millis(100);

/// Threads that the last call left idle, with the process that they are in: a forked child has the memory of its parent, and
/// none of its threads.
static IDLE: Mutex<Option<(u32, ThreadPool)>> = Mutex::new(None);

/// Put threads aside, or none; what was there, if this process can use it. The lock is never waited for: whoever holds it may
/// have stayed in the parent.
fn put_aside(threads: Option<ThreadPool>) -> Option<ThreadPool> {
    let process = std::process::id();
    let mut idle = IDLE.try_lock().ok()?;
    match std::mem::replace(&mut *idle, threads.map(|threads| (process, threads))) {
        Some((own, threads)) if own == process => Some(threads),
        others => {
            // To end the threads of the parent would be to wait for them.
            std::mem::forget(others);
            None
        }
    }
}

/// Threads for one call, as many as `RAYON_NUM_THREADS` or the cores. No two calls share them: a thread that waits takes up
/// other work of its pool, and a call would wait for a lock that it holds itself. The global pool of the process is never used,
/// since nothing starts its threads again in a forked child.
fn threads() -> PyResult<ThreadPool> {
    put_aside(None).map_or_else(
        || {
            let new = ThreadPoolBuilder::new().thread_name(|k| format!("metalith {k}"));
            new.build().map_err(|e| {
                error(Error::refused(
                    "threads/not-started",
                    format!("the threads of a call cannot be started: {e}"),
                    "ask for fewer by the environment variable RAYON_NUM_THREADS",
                ))
            })
        },
        Ok,
    )
}

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

/// Run `f`, and all that it divides among threads, on threads of this process. `progress` is called with what is done, the steps
/// that are done and all of them. Every function of the module that may use several threads, or takes longer than a moment,
/// does it here.
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
    let threads = threads()?;
    let answer = threads.in_place_scope(|scope| {
        let watched = &watched;
        scope.spawn(move |_| {
            // Whoever waits may have gone; of a panic they hear that there is no answer.
            let _ = catch_unwind(AssertUnwindSafe(|| tell.send(f(watched))));
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
    });
    put_aside(Some(threads));
    answer
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
