//! Files that are too large for memory, read a piece at a time.

use std::fmt;
use std::io;
use std::sync::Arc;

/// What reads a file from any place in it.
pub trait PieceReader: fmt::Debug + Send + Sync {
    /// Length of the file, bytes.
    fn length(&self) -> u64;

    /// Fills `piece` with the bytes from byte `at` of the file on.
    ///
    /// # Errors
    /// If the file cannot be read there, or ends before.
    fn read(&self, at: u64, piece: &mut [u8]) -> io::Result<()>;
}

/// A file that is read a piece at a time; equal if it is the same open file.
#[derive(Debug, Clone)]
pub struct Pieces(Arc<dyn PieceReader>);

impl Pieces {
    /// The pieces of a file.
    pub fn new(reader: impl PieceReader + 'static) -> Self {
        Self(Arc::new(reader))
    }

    pub(super) fn length(&self) -> u64 {
        self.0.length()
    }

    pub(super) fn read(&self, at: u64, piece: &mut [u8]) -> io::Result<()> {
        self.0.read(at, piece)
    }
}

impl PartialEq for Pieces {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}
