//! The lock on a file that keeps out other processes.
//!
//! Invariant: a lock that is dropped is free at once. Closing the file would release it only with
//! its last copy, and a process that another thread is starting has one until it executes its
//! program.

use std::fs::{File, TryLockError};

/// A lock, until it is dropped. Programs that this process starts do not inherit it.
#[derive(Debug)]
pub struct FileLock {
    file: File,
}

impl FileLock {
    /// Takes the lock for this value alone.
    ///
    /// # Errors
    /// If another has it, or the file system has no locks.
    pub fn exclusive(file: File) -> Result<Self, TryLockError> {
        file.try_lock().map(|()| Self { file })
    }

    /// Takes the lock beside others that share it.
    ///
    /// # Errors
    /// If another has it alone, or the file system has no locks.
    pub fn shared(file: File) -> Result<Self, TryLockError> {
        file.try_lock_shared().map(|()| Self { file })
    }
}

impl Drop for FileLock {
    fn drop(&mut self) {
        // If this fails, the lock is released with the last copy of the file.
        let _ = self.file.unlock();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn released_lock_is_free_though_a_process_that_starts_has_a_copy_of_its_file() {
        let place = tempfile::tempdir().unwrap();
        let open = || File::create(place.path().join("lock")).unwrap();
        let file = open();
        let _copy = file.try_clone().unwrap();
        let lock = FileLock::exclusive(file).unwrap();
        assert!(matches!(FileLock::shared(open()), Err(TryLockError::WouldBlock)));
        drop(lock);
        let file = open();
        let _copy = file.try_clone().unwrap();
        let shared = [FileLock::shared(file), FileLock::shared(open())].map(Result::unwrap);
        assert!(matches!(FileLock::exclusive(open()), Err(TryLockError::WouldBlock)));
        drop(shared);
        FileLock::exclusive(open()).unwrap();
    }
}
