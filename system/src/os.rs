//! What operating systems name differently: flags of opening, positions in files, links between
//! names and files, and a process that becomes another program.
//!
//! Invariant: each function promises the same on every system, as far as the system has the thing:
//! Windows has neither FIFOs nor devices among its files, nor a mode, and its folders cannot be
//! synced.

#[cfg(unix)]
mod unix;
#[cfg(windows)]
mod windows;

#[cfg(unix)]
pub use unix::*;
#[cfg(windows)]
pub use windows::*;

/// What opening a name does if that is a symbolic link.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Links {
    /// The file that it leads to is opened.
    Followed,
    /// On Unix opening fails; on Windows the link itself is opened, which is no regular file.
    Refused,
}
