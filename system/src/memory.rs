//! Memory that the system refuses: a process that cannot go on without it says so, and ends with
//! the exit code of a system failure, where it would be aborted.
//!
//! Code that asks whether there is room (`try_reserve`) still gets its answer: refusals are noted
//! by the allocator, and reported only when the process is aborted.

use std::io;

/// Has an abort for lack of memory reported, with exit code 1.
///
/// # Errors
/// If the handler cannot be installed.
#[cfg(unix)]
pub fn report_lack() -> io::Result<()> {
    noting::report_lack()
}

/// Other systems end the process in their own way.
///
/// # Errors
/// Never.
#[cfg(not(unix))]
pub fn report_lack() -> io::Result<()> {
    Ok(())
}

#[cfg(unix)]
mod noting {
    use std::alloc::{GlobalAlloc, Layout, System};
    use std::io::{self, Write};
    use std::sync::atomic::{AtomicUsize, Ordering};

    use crate::exit_code;

    /// Bytes of the last block that was refused; 0 if none was.
    static REFUSED_BYTES: AtomicUsize = AtomicUsize::new(0);

    #[global_allocator]
    static ALLOCATOR: Noting = Noting;

    /// The allocator of the system, which notes what it refuses.
    struct Noting;

    impl Noting {
        fn noted(block: *mut u8, bytes: usize) -> *mut u8 {
            if block.is_null() {
                REFUSED_BYTES.store(bytes, Ordering::Relaxed);
            }
            block
        }
    }

    #[expect(unsafe_code, reason = "the interface of allocators is unsafe")]
    // SAFETY: all calls go to the allocator of the system as they come.
    unsafe impl GlobalAlloc for Noting {
        unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
            // SAFETY: the caller keeps to the same contract.
            Self::noted(unsafe { System.alloc(layout) }, layout.size())
        }

        unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
            // SAFETY: the caller keeps to the same contract.
            Self::noted(unsafe { System.alloc_zeroed(layout) }, layout.size())
        }

        unsafe fn realloc(&self, block: *mut u8, layout: Layout, bytes: usize) -> *mut u8 {
            // SAFETY: the caller keeps to the same contract.
            Self::noted(unsafe { System.realloc(block, layout, bytes) }, bytes)
        }

        unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
            // SAFETY: the caller keeps to the same contract.
            unsafe { System.dealloc(block, layout) }
        }
    }

    pub(super) fn report_lack() -> io::Result<()> {
        let handler = || {
            let bytes = REFUSED_BYTES.load(Ordering::Relaxed);
            if bytes > 0 {
                // Neither takes memory.
                let _ = writeln!(
                    io::stderr(),
                    "error: out of memory: the system refuses {bytes} bytes more; take a smaller map, fewer agents or \
                     a higher limit (ulimit -v)"
                );
                signal_hook::low_level::exit(exit_code::FAILED.into());
            }
        };
        #[expect(unsafe_code, reason = "handlers of signals may do little")]
        // SAFETY: it reads an atomic, writes to a stream whose lock the same thread may hold, and
        // ends the process.
        unsafe { signal_hook::low_level::register(signal_hook::consts::SIGABRT, handler) }.map(drop)
    }
}
