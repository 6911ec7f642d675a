//! A file that grows by whole chunks.
//!
//! The MCAP writer fills in lengths after the fact, so what it writes is kept in memory until it flushes, and goes to the file
//! in one piece: a process that is killed leaves whole chunks behind. Beyond the end of the file, a provisional chunk may lie
//! that the next flush overwrites.
//!
//! This module knows nothing of MCAP.

use std::cell::RefCell;
use std::fs::File;
use std::io::{self, Cursor, Seek, SeekFrom, Write};
use std::os::unix::fs::FileExt;
use std::rc::Rc;

/// A file with its last, unflushed part in memory; clones share it.
#[derive(Debug, Clone)]
pub(super) struct Sink(Rc<RefCell<Tail>>);

#[derive(Debug)]
struct Tail {
    file: File,
    /// Length of what has been flushed.
    flushed: u64,
    /// What comes behind it.
    unflushed: Cursor<Vec<u8>>,
    /// Where the provisional bytes in the file end.
    provisional_end: u64,
}

impl Sink {
    pub(super) fn new(file: File) -> Self {
        Self(Rc::new(RefCell::new(Tail { file, flushed: 0, unflushed: Cursor::default(), provisional_end: 0 })))
    }

    /// Puts bytes behind everything that was flushed; the next flush overwrites them.
    pub(super) fn write_provisionally(&self, bytes: &[u8]) -> io::Result<()> {
        let tail = &mut *self.0.borrow_mut();
        tail.file.write_all_at(bytes, tail.flushed)?;
        let end = tail.flushed + bytes.len() as u64;
        if end < tail.provisional_end {
            tail.file.set_len(end)?;
        }
        tail.provisional_end = end;
        Ok(())
    }

    /// Brings everything to the disk.
    pub(super) fn sync(&self) -> io::Result<()> {
        self.0.borrow().file.sync_all()
    }
}

impl Write for Sink {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.borrow_mut().unflushed.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        let tail = &mut *self.0.borrow_mut();
        let bytes = std::mem::take(&mut tail.unflushed).into_inner();
        tail.file.write_all_at(&bytes, tail.flushed)?;
        tail.flushed += bytes.len() as u64;
        if tail.flushed < tail.provisional_end {
            tail.file.set_len(tail.flushed)?;
        }
        tail.provisional_end = tail.flushed;
        Ok(())
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
