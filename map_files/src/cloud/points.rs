//! The points of a file: held in memory, or read again from its records in every pass over them.
//!
//! A file of a hundred million points is larger than the memory that an import should take, so its
//! records are decoded a piece at a time and never kept. A file that cannot be read any more while
//! this happens ends the points; [`Points::check`] says so.

use std::cell::RefCell;

use super::super::{FormatError, ImportSpec};

/// Most records that are decoded once and held, in 96 MiB: passes over them are faster.
const HELD_MAX: usize = 1 << 22;

/// Bytes that are read and decoded at once.
const PIECE_BYTES: usize = 1 << 16;

/// The point of a record; `None` if the record is left out.
type Decode<'a> = Box<dyn Fn(&[u8]) -> Option<[f64; 3]> + 'a>;

/// Points in the coordinates of the file.
pub(in super::super) enum Points<'a> {
    /// In memory.
    Held(Vec<[f64; 3]>),
    /// Decoded in each pass.
    Records(Records<'a>),
}

/// Records of one length, each of at most one point.
pub(in super::super) struct Records<'a> {
    spec: &'a ImportSpec,
    start: u64,
    stride: usize,
    count: usize,
    decode: Decode<'a>,
    /// Why the records could not be read to their end.
    failed: RefCell<Option<String>>,
}

impl Default for Points<'_> {
    fn default() -> Self {
        Self::Held(Vec::new())
    }
}

impl From<Vec<[f64; 3]>> for Points<'_> {
    fn from(points: Vec<[f64; 3]>) -> Self {
        Self::Held(points)
    }
}

impl<'a> Records<'a> {
    /// `count` records of `stride` bytes from byte `start` of a file on.
    ///
    /// # Errors
    /// If the file ends before.
    pub(in super::super) fn new(
        spec: &'a ImportSpec,
        start: usize,
        stride: usize,
        count: usize,
        decode: impl Fn(&[u8]) -> Option<[f64; 3]> + 'a,
    ) -> Result<Self, FormatError> {
        let (needed, left) = (count.saturating_mul(stride), spec.length().saturating_sub(start as u64));
        if needed as u64 > left {
            let reason = format!("the file ends here, data of {count} points takes {needed} bytes and {left} are left");
            return Err(FormatError::byte(start, reason));
        }
        Ok(Self { spec, start: start as u64, stride, count, decode: Box::new(decode), failed: RefCell::new(None) })
    }

    /// Calls `each` with all records in their order.
    pub(in super::super) fn each(&self, mut each: impl FnMut(&[u8])) {
        let mut pieces = Pieces::new(self);
        while let Some(piece) = pieces.next() {
            piece.chunks_exact(self.stride).for_each(&mut each);
        }
    }
}

impl Points<'_> {
    /// The same points, in memory if they are few.
    ///
    /// # Errors
    /// Why the file could not be read.
    pub(super) fn held_if_few(self) -> Result<Self, FormatError> {
        match &self {
            Self::Records(records) if records.count <= HELD_MAX => {
                let mut points = Vec::with_capacity(records.count);
                Decoded::new(records).for_each(|point| points.push(point));
                self.check()?;
                Ok(Self::Held(points))
            }
            _ => Ok(self),
        }
    }

    /// All of them, in their order.
    pub(super) fn iter(&self) -> impl Iterator<Item = [f64; 3]> {
        let (held, records) = match self {
            Self::Held(points) => (points.as_slice(), None),
            Self::Records(records) => ([].as_slice(), Some(Decoded::new(records))),
        };
        held.iter().copied().chain(records.into_iter().flatten())
    }

    /// Most points that there can be.
    pub(super) fn most(&self) -> usize {
        match self {
            Self::Held(points) => points.len(),
            Self::Records(records) => records.count,
        }
    }

    /// Whether all passes have seen all points.
    ///
    /// # Errors
    /// Why the file could not be read.
    pub(super) fn check(&self) -> Result<(), FormatError> {
        let Self::Records(records) = self else { return Ok(()) };
        match records.failed.borrow_mut().take() {
            None => Ok(()),
            Some(reason) => Err(FormatError::Entry { place: "the points".to_owned(), reason }),
        }
    }
}

/// The bytes of records, in pieces of whole records.
struct Pieces<'p, 'a> {
    records: &'p Records<'a>,
    bytes: Vec<u8>,
    next: usize,
}

impl<'p, 'a> Pieces<'p, 'a> {
    fn new(records: &'p Records<'a>) -> Self {
        Self { records, bytes: Vec::new(), next: 0 }
    }

    fn next(&mut self) -> Option<&[u8]> {
        let Records { spec, start, stride, count, failed, .. } = self.records;
        let records = (count - self.next).min((PIECE_BYTES / stride).max(1));
        if records == 0 {
            return None;
        }
        let at = start + self.next as u64 * *stride as u64;
        self.next += records;
        let Some(pieces) = &spec.pieces else {
            let at = usize::try_from(at).ok()?;
            return spec.bytes.get(at..at + records * stride);
        };
        self.bytes.resize(records * stride, 0);
        if let Err(error) = pieces.read(at, &mut self.bytes) {
            *failed.borrow_mut() = Some(format!("byte {at}: {error}"));
            self.next = *count;
            return None;
        }
        Some(&self.bytes)
    }
}

/// The points of records.
struct Decoded<'p, 'a> {
    pieces: Pieces<'p, 'a>,
    points: Vec<[f64; 3]>,
    next: usize,
}

impl<'p, 'a> Decoded<'p, 'a> {
    fn new(records: &'p Records<'a>) -> Self {
        Self { pieces: Pieces::new(records), points: Vec::new(), next: 0 }
    }

    fn refill(&mut self) -> bool {
        let Records { stride, decode, .. } = self.pieces.records;
        let Some(piece) = self.pieces.next() else { return false };
        self.points.clear();
        self.points.extend(piece.chunks_exact(*stride).filter_map(decode));
        self.next = 0;
        true
    }
}

impl Iterator for Decoded<'_, '_> {
    type Item = [f64; 3];

    fn next(&mut self) -> Option<[f64; 3]> {
        loop {
            if let Some(point) = self.points.get(self.next) {
                self.next += 1;
                return Some(*point);
            }
            if !self.refill() {
                return None;
            }
        }
    }

    /// As one loop for each piece.
    fn fold<B, F: FnMut(B, [f64; 3]) -> B>(mut self, init: B, mut each: F) -> B {
        let mut state = init;
        loop {
            for &point in &self.points[self.next..] {
                state = each(state, point);
            }
            if !self.refill() {
                return state;
            }
        }
    }
}
