//! A file that grows by whole chunks.
//!
//! The MCAP writer fills in lengths after the fact, so its output is buffered in memory until it
//! flushes and then written at once: a killed process leaves whole chunks behind. A provisional
//! chunk may follow the end of the file, which the next flush overwrites.
//!
//! Invariant: after a failed write, the file is truncated to the last flush and never written
//! again, so that nothing follows a gap; the end record that the MCAP writer writes when dropped
//! goes to memory alone.
//!
//! This module knows nothing of MCAP.

use std::cell::RefCell;
use std::fs::File;
use std::io::{self, Cursor, Seek, SeekFrom, Write};
use std::rc::Rc;

use system::os;

/// The file operations of a recorder: a file of the system, or one on a simulated disk.
pub trait Store {
    /// Writes bytes at an offset, which is at most the length of the file.
    ///
    /// # Errors
    /// If they cannot be written; a part of them may have been.
    fn write_all_at(&self, bytes: &[u8], at: u64) -> io::Result<()>;
    /// Truncates the file.
    ///
    /// # Errors
    /// If it cannot be truncated.
    fn set_len(&self, length: u64) -> io::Result<()>;
    /// Returns once everything written so far would survive a power failure.
    ///
    /// # Errors
    /// If it may not survive.
    fn sync(&self) -> io::Result<()>;
    /// Gives the file its final name; the recorder renames files of the system itself.
    ///
    /// # Errors
    /// If it cannot be renamed.
    fn publish(&self) -> io::Result<()> {
        Ok(())
    }
}

impl Store for File {
    fn write_all_at(&self, bytes: &[u8], at: u64) -> io::Result<()> {
        os::write_all_at(self, bytes, at)
    }

    fn set_len(&self, length: u64) -> io::Result<()> {
        self.set_len(length)
    }

    fn sync(&self) -> io::Result<()> {
        if os::is_deleted(self)? {
            return Err(io::Error::other("it was deleted while it was written"));
        }
        self.sync_all()
    }
}

/// A file with its unflushed tail in memory; clones share it.
#[derive(Clone)]
pub(super) struct Sink(Rc<RefCell<Tail>>);

struct Tail {
    store: Box<dyn Store>,
    /// Flushed bytes.
    flushed: u64,
    /// Bytes behind them.
    unflushed: Cursor<Vec<u8>>,
    /// End of the provisional bytes in the file.
    provisional_end: u64,
    /// No more writes to the file.
    is_sealed: bool,
}

impl Tail {
    /// Writes bytes behind everything flushed, as the end of the file.
    fn put(&mut self, bytes: &[u8]) -> io::Result<()> {
        if self.is_sealed {
            return Err(io::Error::other("an earlier write has failed"));
        }
        let end = self.flushed + bytes.len() as u64;
        let mut written = self.store.write_all_at(bytes, self.flushed);
        if written.is_ok() && end < self.provisional_end {
            written = self.store.set_len(end);
        }
        if written.is_err() {
            self.is_sealed = true;
            // The first error is the one to report.
            let _ = self.store.set_len(self.flushed);
        }
        self.provisional_end = end;
        written
    }
}

impl Sink {
    pub(super) fn new(store: impl Store + 'static) -> Self {
        Self(Rc::new(RefCell::new(Tail {
            store: Box::new(store),
            flushed: 0,
            unflushed: Cursor::default(),
            provisional_end: 0,
            is_sealed: false,
        })))
    }

    /// Stops all writes to the file.
    pub(super) fn seal(&self) {
        self.0.borrow_mut().is_sealed = true;
    }

    /// Writes bytes behind everything flushed; the next flush overwrites them.
    pub(super) fn write_provisionally(&self, bytes: &[u8]) -> io::Result<()> {
        self.0.borrow_mut().put(bytes)
    }

    /// See [`Store::publish`].
    pub(super) fn publish(&self) -> io::Result<()> {
        self.0.borrow().store.publish()
    }

    /// Syncs the file to disk.
    pub(super) fn sync(&self) -> io::Result<()> {
        self.0.borrow().store.sync()
    }
}

impl Write for Sink {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.borrow_mut().unflushed.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        let tail = &mut *self.0.borrow_mut();
        let unflushed = std::mem::take(&mut tail.unflushed);
        let written = tail.put(unflushed.get_ref());
        match written {
            Ok(()) => tail.flushed += unflushed.get_ref().len() as u64,
            // Keeps the writer's positions valid, so that it can finish in memory.
            Err(_) => tail.unflushed = unflushed,
        }
        written
    }
}

impl Seek for Sink {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let tail = &mut *self.0.borrow_mut();
        let to = match to {
            SeekFrom::Start(position) => {
                SeekFrom::Start(position.checked_sub(tail.flushed).ok_or(io::ErrorKind::InvalidInput)?)
            }
            relative => relative,
        };
        Ok(tail.flushed + tail.unflushed.seek(to)?)
    }
}
