//! A file that grows by whole chunks.
//!
//! The MCAP writer fills in lengths after the fact, so what it writes is kept in memory until it flushes, and goes to the file
//! in one piece: a process that is killed leaves whole chunks behind. Beyond the end of the file, a provisional chunk may lie
//! that the next flush overwrites.
//!
//! Invariant: once something could not be written, the file is cut off behind the last flush and never touched again, so that
//! nothing stands behind a gap; the MCAP writer, which writes an end when it is dropped, then writes it to memory alone.
//!
//! This module knows nothing of MCAP.

use std::cell::RefCell;
use std::fs::File;
use std::io::{self, Cursor, Seek, SeekFrom, Write};
use std::os::unix::fs::FileExt;
use std::rc::Rc;

/// What a sink needs of a file.
pub(super) trait Store {
    fn write_all_at(&self, bytes: &[u8], at: u64) -> io::Result<()>;
    fn set_len(&self, length: u64) -> io::Result<()>;
    fn sync(&self) -> io::Result<()>;
}

impl Store for File {
    fn write_all_at(&self, bytes: &[u8], at: u64) -> io::Result<()> {
        FileExt::write_all_at(self, bytes, at)
    }

    fn set_len(&self, length: u64) -> io::Result<()> {
        self.set_len(length)
    }

    fn sync(&self) -> io::Result<()> {
        self.sync_all()
    }
}

/// A file with its last, unflushed part in memory; clones share it.
#[derive(Clone)]
pub(super) struct Sink(Rc<RefCell<Tail>>);

struct Tail {
    store: Box<dyn Store>,
    /// Length of what has been flushed.
    flushed: u64,
    /// What comes behind it.
    unflushed: Cursor<Vec<u8>>,
    /// Where the provisional bytes in the file end.
    provisional_end: u64,
    /// Nothing goes to the file any more.
    is_sealed: bool,
}

impl Tail {
    /// Puts bytes behind everything that was flushed, as the end of the file.
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
            // What matters is why it could not be written.
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

    /// Leaves the file as it is from now on.
    pub(super) fn seal(&self) {
        self.0.borrow_mut().is_sealed = true;
    }

    /// Puts bytes behind everything that was flushed; the next flush overwrites them.
    pub(super) fn write_provisionally(&self, bytes: &[u8]) -> io::Result<()> {
        self.0.borrow_mut().put(bytes)
    }

    /// Brings everything to the disk.
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
            // The writer's positions stay true, so that it can come to its end in memory.
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
