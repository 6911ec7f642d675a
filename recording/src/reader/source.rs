//! The bytes of a recording: in memory, or in a file of any length.
//!
//! Invariant: every pass reads the same bytes. Whole chunks of a file never change; its last chunk,
//! which a running server overwrites, is copied when the file is opened.

use std::fs::File;
use std::io;
use std::sync::Arc;

use system::os;

/// Bytes with a length that is known.
#[derive(Debug, Clone)]
pub(super) struct Source {
    /// What lies before the tail.
    file: Option<Arc<File>>,
    tail_at: u64,
    tail: Arc<[u8]>,
}

impl Source {
    pub(super) fn of_bytes(bytes: Vec<u8>) -> Self {
        Self { file: None, tail_at: 0, tail: bytes.into() }
    }

    /// A file up to its present length.
    ///
    /// # Errors
    /// If the length cannot be read.
    pub(super) fn of_file(file: Arc<File>) -> io::Result<Self> {
        let length = file.metadata()?.len();
        Ok(Self { file: Some(file), tail_at: length, tail: Arc::default() })
    }

    /// Copies what lies behind `at`, so that later changes of the file have no effect.
    ///
    /// # Errors
    /// If it cannot be read.
    pub(super) fn copy_tail(&mut self, at: u64) -> io::Result<()> {
        if self.file.is_none() {
            return Ok(());
        }
        let mut tail = vec![0; usize::try_from(self.length().saturating_sub(at)).unwrap_or(usize::MAX)];
        let read = self.read_at(at, &mut tail)?;
        tail.truncate(read);
        (self.tail_at, self.tail) = (at, tail.into());
        Ok(())
    }

    pub(super) fn length(&self) -> u64 {
        self.tail_at + self.tail.len() as u64
    }

    /// Reads the bytes from `at` on, fewer at the end; their number.
    ///
    /// # Errors
    /// If the file cannot be read, or has become shorter.
    pub(super) fn read_at(&self, at: u64, bytes: &mut [u8]) -> io::Result<usize> {
        let left = usize::try_from(self.length().saturating_sub(at)).unwrap_or(usize::MAX);
        let count = bytes.len().min(left);
        let of_file = usize::try_from(self.tail_at.saturating_sub(at)).map_or(count, |before| before.min(count));
        let (of_file, of_tail) = bytes[..count].split_at_mut(of_file);
        if !of_file.is_empty()
            && let Some(file) = &self.file
        {
            os::read_exact_at(file, of_file, at)?;
        }
        if !of_tail.is_empty() {
            let begin = (at + of_file.len() as u64 - self.tail_at) as usize;
            of_tail.copy_from_slice(&self.tail[begin..begin + of_tail.len()]);
        }
        Ok(count)
    }

    /// Whether two sources have the same bytes.
    ///
    /// # Errors
    /// If one cannot be read.
    pub(super) fn is_same(&self, other: &Self) -> io::Result<bool> {
        if self.length() != other.length() {
            return Ok(false);
        }
        let (mut one, mut two) = (vec![0; WINDOW_BYTES], vec![0; WINDOW_BYTES]);
        let mut at = 0;
        while at < self.length() {
            let count = self.read_at(at, &mut one)?;
            other.read_at(at, &mut two)?;
            if one[..count] != two[..count] {
                return Ok(false);
            }
            at += count as u64;
        }
        Ok(true)
    }
}

/// Bytes that are read at once.
pub(super) const WINDOW_BYTES: usize = 1 << 16;

/// A buffered part of a source.
pub(super) struct Window<'a> {
    pub(super) source: &'a Source,
    at: u64,
    bytes: Vec<u8>,
    /// Bytes that are read at once, at least.
    step: usize,
}

impl<'a> Window<'a> {
    pub(super) fn new(source: &'a Source, step: usize) -> Self {
        Self { source, at: 0, bytes: Vec::new(), step }
    }

    /// The bytes from `at` on, fewer at the end.
    ///
    /// # Errors
    /// If they cannot be read.
    pub(super) fn bytes(&mut self, at: u64, count: usize) -> io::Result<&[u8]> {
        let end = at.saturating_add(count as u64).min(self.source.length());
        if at < self.at || end > self.at + self.bytes.len() as u64 {
            self.bytes.resize(count.max(self.step), 0);
            let read = self.source.read_at(at, &mut self.bytes)?;
            self.bytes.truncate(read);
            self.at = at;
        }
        let begin = usize::try_from(at - self.at).unwrap_or(usize::MAX).min(self.bytes.len());
        Ok(&self.bytes[begin..self.bytes.len().min(begin + count)])
    }
}
