//! Calls that can be interrupted: work on a thread of its own, while the calling thread, without
//! the GIL, looks for signals.
//!
//! Ctrl-C sets the stop flag of the work, and raises `KeyboardInterrupt` in every Python controller
//! that is deciding at that moment, so that an endless loop in one ends, too.

use std::any::Any;
use std::collections::BTreeSet;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

/// Wall time between two looks for signals.
const PERIOD: Duration = Duration::from_millis(20);

/// Python's ids of the threads in which a controller is deciding.
static DECIDING: Mutex<BTreeSet<u64>> = Mutex::new(BTreeSet::new());

/// Marks a thread as one in which a controller is deciding.
pub(crate) struct Deciding(u64);

impl Deciding {
    pub(crate) fn here(py: Python<'_>) -> PyResult<Self> {
        let ident: u64 = py.import("threading")?.call_method0("get_ident")?.extract()?;
        DECIDING.lock().unwrap_or_else(PoisonError::into_inner).insert(ident);
        Ok(Self(ident))
    }
}

impl Drop for Deciding {
    fn drop(&mut self) {
        DECIDING.lock().unwrap_or_else(PoisonError::into_inner).remove(&self.0);
    }
}

/// Raises `KeyboardInterrupt` in the threads that are deciding.
pub(crate) fn interrupt_controllers(py: Python<'_>) -> PyResult<()> {
    let threads: Vec<u64> = DECIDING.lock().unwrap_or_else(PoisonError::into_inner).iter().copied().collect();
    if !threads.is_empty() {
        py.import("maes._interrupt")?.call_method1("interrupt", (threads,))?;
    }
    Ok(())
}

/// Does work with a stop flag, without the GIL.
///
/// # Errors
/// What a signal handler raises, `KeyboardInterrupt` as a rule, once the work has ended; a panic of
/// the work, as `RuntimeError`.
pub(crate) fn interruptible<T: Send>(py: Python<'_>, work: impl FnOnce(&AtomicBool) -> T + Send) -> PyResult<T> {
    let stop = AtomicBool::new(false);
    py.detach(|| {
        thread::scope(|scope| {
            let (sender, ended) = channel();
            let stop = &stop;
            let worker = scope.spawn(move || {
                let done = work(stop);
                // The receiver waits for this or for the end of the thread.
                let _ = sender.send(());
                done
            });
            let mut raised = None;
            while let Err(RecvTimeoutError::Timeout) = ended.recv_timeout(PERIOD) {
                let signalled = Python::attach(|py| {
                    let Err(error) = py.check_signals() else { return None };
                    stop.store(true, Ordering::Relaxed);
                    Some(interrupt_controllers(py).err().unwrap_or(error))
                });
                raised = raised.or(signalled);
            }
            let done = worker.join().map_err(|panic| internal(panic.as_ref()))?;
            raised.map_or(Ok(done), Err)
        })
    })
}

/// The exception for a panic, which is a mistake in this package.
pub(crate) fn internal(panic: &(dyn Any + Send)) -> PyErr {
    let text = panic.downcast_ref::<String>().map(String::as_str).or(panic.downcast_ref::<&str>().copied());
    PyRuntimeError::new_err(format!("internal error of maes, please report it: {}", text.unwrap_or("a panic")))
}
