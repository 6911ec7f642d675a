//! How the C library provides the memory of this process.
//!
//! A run in memory has a map of the whole world for each agent, and most cells of a large one are
//! never explored. Blocks above a threshold come from the system as pages of zeros, which cost
//! nothing until they are written. But glibc raises the threshold to the size of each block that is
//! freed; then it takes maps from memory that it clears itself, all of it. A threshold that is set
//! stays.

/// Has large blocks always provided page by page.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
pub(crate) fn keep_large_blocks_in_pages() {
    /// Below the maps of 128^3 cells, above what is allocated often.
    const THRESHOLD_BYTES: libc::c_int = 1 << 20;
    #[expect(unsafe_code, reason = "there is no safe interface")]
    // SAFETY: glibc takes its lock, and changes nothing but how it allocates from now on.
    unsafe {
        libc::mallopt(libc::M_MMAP_THRESHOLD, THRESHOLD_BYTES);
    }
}

/// Other C libraries have no such threshold.
#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
pub(crate) fn keep_large_blocks_in_pages() {}
