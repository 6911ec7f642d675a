//! Processes, ROS domains, recordings and in-memory runs for the end-to-end tests.
//!
//! Invariants: no process outlives the test that started it; no two tests share a ROS domain; at
//! most [`SLOTS`] runs are under way at a time, because the processes of fewer leave the two cores
//! of the smallest machine idle now and then; a wait that takes longer than [`HANG`] is a failure.

pub(crate) mod binaries;
pub(crate) mod domains;
pub(crate) mod foxglove;
pub(crate) mod interceptor;
pub(crate) mod memory;
pub(crate) mod processes;
pub(crate) mod python;
pub(crate) mod recordings;
pub(crate) mod rtps;
pub(crate) mod runs;

use std::path::Path;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::Duration;

/// Wall time after which a wait has failed: long enough for a machine with ten times as much to do
/// as it has cores.
pub(crate) const HANG: Duration = Duration::from_secs(600);

/// The root of the workspace.
pub(crate) fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("this package is a folder of the workspace")
}

/// Most runs under way at a time.
const SLOTS: u32 = 5;

/// Permission to have a run under way, or several of them.
#[derive(Debug)]
pub(crate) struct Slot(u32);

static SLOTS_FREE: Mutex<u32> = Mutex::new(SLOTS);
static SLOT_FREED: Condvar = Condvar::new();

impl Slot {
    /// Waits for a free slot. A thread that holds one must not wait for another.
    pub(crate) fn take() -> Self {
        Self::take_some(1)
    }

    /// Waits for several free slots: for work that is more than a run.
    pub(crate) fn take_some(count: u32) -> Self {
        let mut free =
            SLOT_FREED.wait_while(lock(&SLOTS_FREE), |free| *free < count).unwrap_or_else(PoisonError::into_inner);
        *free -= count;
        Self(count)
    }
}

impl Drop for Slot {
    fn drop(&mut self) {
        *lock(&SLOTS_FREE) += self.0;
        SLOT_FREED.notify_all();
    }
}

/// Locks a mutex, even if a test that failed has poisoned it.
pub(crate) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The result of `work`, which takes a slot, or a failure if it hangs. The wait for the slot has no
/// limit.
#[track_caller]
pub(crate) fn bounded<T: Send + 'static>(what: &str, work: impl FnOnce() -> T + Send + 'static) -> T {
    let slot = Slot::take();
    let (done, result) = channel();
    let worker = thread::spawn(move || {
        let _slot = slot;
        // The receiver is gone if the work took too long.
        let _ = done.send(work());
    });
    match result.recv_timeout(HANG) {
        Ok(result) => result,
        Err(RecvTimeoutError::Timeout) => panic!("{what} hangs"),
        Err(RecvTimeoutError::Disconnected) => match worker.join() {
            Err(panic) => std::panic::resume_unwind(panic),
            Ok(()) => unreachable!("a worker that ends without a result has panicked"),
        },
    }
}
