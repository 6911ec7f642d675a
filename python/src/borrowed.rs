//! The one place with `unsafe`: lends a context to Python for the duration of a call.
//!
//! Invariants: [`Loan::lend`] ends the loan before it returns, also when it unwinds; a borrower is
//! on the thread that lends, and borrows one at a time, so that no two references exist; no Python
//! code runs within [`Loan::with`], since it has no `Python` token.

use std::ptr::NonNull;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread::{self, ThreadId};

use agent_node::controllers::Ctx;
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

struct Pointer(NonNull<Ctx<'static>>);

// SAFETY: it is only followed on the thread that has lent it, see `Loan::with`.
#[expect(unsafe_code, reason = "a context cannot outlive a decision, and Python objects have no lifetimes")]
unsafe impl Send for Pointer {}

/// A context that may be lent at the moment.
#[derive(Default)]
pub(crate) struct Loan(Mutex<Option<(ThreadId, Pointer)>>);

/// Ends a loan.
struct End<'a>(&'a Loan);

impl Drop for End<'_> {
    fn drop(&mut self) {
        *self.0.lock() = None;
    }
}

impl Loan {
    fn lock(&self) -> MutexGuard<'_, Option<(ThreadId, Pointer)>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Lends a context while `use_it` runs.
    pub(crate) fn lend<T>(&self, ctx: &mut Ctx<'_>, use_it: impl FnOnce() -> T) -> T {
        let pointer = Pointer(NonNull::from(ctx).cast());
        *self.lock() = Some((thread::current().id(), pointer));
        let _end = End(self);
        use_it()
    }

    /// Borrows the context.
    ///
    /// # Errors
    /// If it is not lent, or another thread asks.
    pub(crate) fn with<T>(&self, use_it: impl FnOnce(&mut Ctx<'_>) -> T) -> PyResult<T> {
        let mut lent = self.lock();
        match &*lent {
            Some((thread, _)) if *thread != thread::current().id() => {
                return Err(PyRuntimeError::new_err(
                    "ctx is used in another thread: expected the thread in which `decide` was called",
                ));
            }
            _ => {}
        }
        let Some((thread, Pointer(mut pointer))) = lent.take() else {
            return Err(PyRuntimeError::new_err(
                "ctx is used after `decide` has returned: keep what you need of it, not ctx itself",
            ));
        };
        drop(lent);
        // SAFETY: `lend` has not returned, because this is its thread and it has lent the pointer;
        // the loan is empty meanwhile, so that this is the only reference.
        #[expect(unsafe_code, reason = "see above")]
        let done = use_it(unsafe { pointer.as_mut() });
        *self.lock() = Some((thread, Pointer(pointer)));
        Ok(done)
    }
}
