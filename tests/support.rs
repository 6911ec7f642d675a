//! What the tests share.
//!
//! Invariants: no process outlives the test that started it; no two tests share a ROS domain; at most two runs are under way
//! at a time, because two cores are what there is; a wait that takes longer than [`HANG`] is a failure.

pub(crate) mod binaries;
pub(crate) mod domains;
pub(crate) mod foxglove;
pub(crate) mod memory;
pub(crate) mod processes;
pub(crate) mod python;
pub(crate) mod recordings;
pub(crate) mod runs;

use std::path::Path;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::Duration;

/// Wall time after which something that has not happened is not going to.
pub(crate) const HANG: Duration = Duration::from_secs(180);

/// The workspace.
pub(crate) fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("this package is a folder of the workspace")
}

/// How many runs may be under way at a time.
const SLOTS: u32 = 2;

/// A place among the runs that may be under way at a time, or all of them.
#[derive(Debug)]
pub(crate) struct Slot(u32);

static SLOTS_FREE: Mutex<u32> = Mutex::new(SLOTS);
static SLOT_FREED: Condvar = Condvar::new();

impl Slot {
    /// Waits for a place. Nobody who has one may wait for another.
    pub(crate) fn take() -> Self {
        Self::take_some(1)
    }

    /// Waits until nothing else is under way: for what needs all cores.
    pub(crate) fn take_all() -> Self {
        Self::take_some(SLOTS)
    }

    fn take_some(places: u32) -> Self {
        let mut free =
            SLOT_FREED.wait_while(lock(&SLOTS_FREE), |free| *free < places).unwrap_or_else(PoisonError::into_inner);
        *free -= places;
        Self(places)
    }
}

impl Drop for Slot {
    fn drop(&mut self) {
        *lock(&SLOTS_FREE) += self.0;
        SLOT_FREED.notify_all();
    }
}

/// Locks, whatever became of the test that held the lock before.
pub(crate) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The result of `work`, which takes a slot, or a failure if it hangs.
#[track_caller]
pub(crate) fn bounded<T: Send + 'static>(what: &str, work: impl FnOnce() -> T + Send + 'static) -> T {
    let (done, result) = channel();
    let worker = thread::spawn(move || {
        let _slot = Slot::take();
        // Nobody waits any more if this took too long.
        let _ = done.send(work());
    });
    // The slots of other tests come first.
    match result.recv_timeout(HANG * 2) {
        Ok(result) => result,
        Err(RecvTimeoutError::Timeout) => panic!("{what} hangs"),
        Err(RecvTimeoutError::Disconnected) => match worker.join() {
            Err(panic) => std::panic::resume_unwind(panic),
            Ok(()) => unreachable!("a worker that ends without a result has panicked"),
        },
    }
}
