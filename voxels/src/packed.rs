//! Packed M3DM: run-length coded maps of up to 1024 cells along an axis.
//!
//! Every cell is predicted as the majority of the three cells before it, at x - 1, y - 1 and z - 1;
//! the outside is wall. Wrong predictions are rare where the three agree and common where they
//! differ, so the two kinds of cells are coded separately. A run is the number of cells of a kind
//! between two wrong predictions. Plain runs of free and wall cells would take two to three times
//! the size, because a cave has surfaces along every axis.
//!
//! All numbers are little-endian. The first byte of a plain M3DM file is at least 2 (its first
//! seven bits are a size of at least 1), so no plain file begins with the mark, whose first byte is
//! 0.
//!
//! | bytes | content |
//! |---|---|
//! | 0 to 7 | mark: 0, then `M3DMRLE` |
//! | 8 | version, 1 |
//! | 9, 10 | order k of the codes of agreeing and of differing cells, 0 to 24 |
//! | 11 | 0 |
//! | 12 to 23 | cells along x, y, z, three `u32` |
//! | 24 to 31 | length of a cell's edge in metres, `f64` |
//! | 32 to 39 | number of runs, of agreeing and of differing cells, two `u32` |
//! | 40 to 47 | bytes of the codes, likewise |
//! | 48 to 51 | CRC-32 of all other bytes |
//! | 52 to the end | the codes of agreeing cells, then those of differing cells |
//!
//! A run is an exponential Golomb code of order k: with n bits in `(run >> k) + 1`, n - 1 zeros,
//! these n bits, then the low k bits of the run; the most significant bit of each byte first, the
//! last byte filled up with zeros. After its last run, a kind has no wrong predictions.
//!
//! Memory for cells is allocated only after the lengths and the checksum have been verified. Maps
//! are not repaired here.

use thiserror::Error;

use crate::{Extent, ExtentError, Grid, Terrain};

mod bits;

use bits::{BitReader, BitWriter, code_bits};

/// The first bytes of a packed file.
const MARK: [u8; 8] = *b"\0M3DMRLE";

/// The version that is written and read.
const VERSION: u8 = 1;

/// Length of the header, bytes.
const HEADER: usize = 52;

/// The bytes of the checksum.
const SUM: std::ops::Range<usize> = 48..HEADER;

/// The largest order of codes.
const ORDER_MAX: u8 = 24;

/// Cells whose three neighbours agree, and those whose neighbours differ.
const KINDS: usize = 2;

/// Cells that are compared at once.
const AT_ONCE: usize = 32;

/// The reason why bytes are not a packed map.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum PackedError {
    /// The file ends early.
    #[error("byte {got}: the file ends here, expected length {} {length} bytes", if *.at_least { "at least" } else { "" })]
    Truncated {
        /// Length of the file.
        got: usize,
        /// The expected length, bytes.
        length: u64,
        /// Whether the file may be longer.
        at_least: bool,
    },
    /// Bytes follow the last code.
    #[error("byte {length}: {surplus} bytes follow the last run, expected length {length} bytes")]
    Trailing {
        /// The length of the file that the header requires, bytes.
        length: u64,
        /// Number of bytes too many.
        surplus: u64,
    },
    /// A field of the header has an illegal value.
    #[error("byte {byte}: {name} is {value}, allowed is {allowed}")]
    Field {
        /// Offset of the field, bytes.
        byte: usize,
        /// The field, in words.
        name: &'static str,
        /// Its value.
        value: u64,
        /// The allowed values.
        allowed: String,
    },
    /// The size or the cell length is illegal.
    #[error("byte {byte}: {reason}")]
    Extent {
        /// Offset of the field, bytes.
        byte: usize,
        /// The fault.
        reason: ExtentError,
    },
    /// The checksum does not match: the file is damaged.
    #[error("byte 48: the checksum is {stored:#010x}, that of the file is {computed:#010x}: the file is damaged")]
    Sum {
        /// According to the header.
        stored: u32,
        /// Computed from the bytes.
        computed: u32,
    },
    /// The map has more cells than the caller allows.
    #[error("byte 12: the map has {cells} cells, allowed are {cells_max}")]
    TooLarge {
        /// According to the header.
        cells: usize,
        /// The limit of the caller.
        cells_max: usize,
    },
    /// A code is malformed, or extends beyond the end.
    #[error("byte {byte}: run {run} is not a code of order {order} that ends within its {length} bytes")]
    Code {
        /// Offset of the codes of its kind, bytes.
        byte: usize,
        /// Index of the run, from 0.
        run: u32,
        /// Order of the codes.
        order: u8,
        /// Length of the codes, bytes.
        length: usize,
    },
    /// The runs cover more cells than the map has.
    #[error("byte {byte}: the runs do not end with the map, {left} of {runs} are left after its last cell")]
    Runs {
        /// Offset of the codes of their kind, bytes.
        byte: usize,
        /// Runs behind the last cell.
        left: u32,
        /// Number of runs of their kind.
        runs: u32,
    },
    /// The padding of the last byte is not zero.
    #[error("byte {byte}: the codes do not fill their {length} bytes, or the bits behind them are not 0")]
    Padding {
        /// Offset of the codes of the kind, bytes.
        byte: usize,
        /// Length of the codes, bytes.
        length: usize,
    },
    /// The system has not enough memory.
    #[error("a map of {0} cells takes more memory than can be had")]
    Memory(usize),
}

/// Whether bytes are a packed map rather than a plain one, by their first bytes.
pub fn is_packed(bytes: &[u8]) -> bool {
    // A file truncated within the mark is a damaged packed map.
    !bytes.is_empty() && bytes.iter().zip(MARK).all(|(&byte, mark)| byte == mark)
}

/// The header of a packed map.
struct Header {
    extent: Extent,
    orders: [u8; KINDS],
    runs: [u32; KINDS],
    lengths: [usize; KINDS],
}

/// The extent of a packed map, after its lengths and its checksum have been verified.
///
/// # Errors
/// If the header, a length or the checksum is wrong.
pub fn extent(bytes: &[u8]) -> Result<Extent, PackedError> {
    Ok(header(bytes)?.extent)
}

/// Reads a packed map of at most `cells_max` cells.
///
/// # Errors
/// If a field, a length, the checksum or a run is wrong (with its offset), or if the map is larger
/// than allowed.
///
/// # Panics
/// Never: there is a value for each cell.
pub fn read(bytes: &[u8], cells_max: usize) -> Result<Grid<Terrain>, PackedError> {
    let Header { extent, orders, runs, lengths } = header(bytes)?;
    let cells = extent.volume();
    if cells > cells_max {
        return Err(PackedError::TooLarge { cells, cells_max });
    }
    let starts = [HEADER, HEADER + lengths[0]];
    let mut kinds = [0, 1].map(|kind| {
        let codes = &bytes[starts[kind]..starts[kind] + lengths[kind]];
        Runs { codes: BitReader::new(codes), order: orders[kind], runs: runs[kind], taken: 0, left: 0, wrong: false }
    });
    let code_error = |kind: usize, run: u32| PackedError::Code {
        byte: starts[kind],
        run,
        order: orders[kind],
        length: lengths[kind],
    };
    for (kind, runs) in kinds.iter_mut().enumerate() {
        runs.next().map_err(|run| code_error(kind, run))?;
    }

    let mut walls = Vec::new();
    // Reserved memory is not used yet, and a refused reservation is an error here.
    walls.try_reserve_exact(cells).map_err(|_| PackedError::Memory(cells))?;
    walls.resize(cells, Terrain::Wall);
    let [size_x, size_y, _] = extent.size().map(|cells| cells as usize);
    let outside = vec![Terrain::Wall; size_x];
    for number in 0..cells / size_x {
        let (before, rest) = walls.split_at_mut(number * size_x);
        let row = &mut rest[..size_x];
        let [beside, below] = rows_before(before, &outside, number, size_y);
        let mut last = Terrain::Wall;
        let mut x = 0;
        while x < size_x {
            // Cells whose neighbours all are as the last cell continue it up to a wrong prediction.
            let same = same_ahead(&beside[x..], &below[x..], last).min(kinds[0].before_wrong());
            row[x..x + same].fill(last);
            kinds[0].pass(same);
            x += same;
            if x < size_x {
                let (predicted, kind) = prediction(last, beside[x], below[x]);
                let is_wrong = kinds[kind].step().map_err(|run| code_error(kind, run))?;
                last = if is_wrong { opposite(predicted) } else { predicted };
                row[x] = last;
                x += 1;
            }
        }
    }
    for (kind, runs) in kinds.iter().enumerate() {
        runs.check_end(starts[kind], lengths[kind])?;
    }
    Ok(Grid::from_vec(extent, walls).expect("one value was pushed for each cell"))
}

/// Writes a map, including the length of its cells.
pub fn write(terrain: &Grid<Terrain>) -> Vec<u8> {
    let extent = terrain.extent();
    let [size_x, size_y, _] = extent.size().map(|cells| cells as usize);
    let mut runs: [Vec<u32>; KINDS] = [Vec::new(), Vec::new()];
    let mut open = [0u32; KINDS];
    let cells = terrain.as_slice();
    let outside = vec![Terrain::Wall; size_x];
    for (number, row) in cells.chunks_exact(size_x).enumerate() {
        let [beside, below] = rows_before(cells, &outside, number, size_y);
        let mut last = Terrain::Wall;
        for (&cell, (&y, &z)) in row.iter().zip(beside.iter().zip(below)) {
            let (predicted, kind) = prediction(last, y, z);
            if cell == predicted {
                open[kind] += 1;
            } else {
                runs[kind].push(open[kind]);
                open[kind] = 0;
            }
            last = cell;
        }
    }
    let orders = runs.each_ref().map(|runs| best_order(runs));
    let codes = [0, 1].map(|kind| {
        let mut codes = BitWriter::default();
        for &run in &runs[kind] {
            codes.code(run, orders[kind]);
        }
        codes.into_bytes()
    });

    let mut bytes = MARK.to_vec();
    bytes.extend([VERSION, orders[0], orders[1], 0]);
    extent.size().iter().for_each(|cells| bytes.extend(cells.to_le_bytes()));
    bytes.extend(extent.cell_m().to_le_bytes());
    runs.iter().for_each(|runs| bytes.extend((runs.len() as u32).to_le_bytes()));
    codes.iter().for_each(|codes| bytes.extend((codes.len() as u32).to_le_bytes()));
    bytes.extend([0; 4]);
    codes.iter().for_each(|codes| bytes.extend(codes));
    let sum = sum_of(&bytes);
    bytes[SUM].copy_from_slice(&sum.to_le_bytes());
    bytes
}

fn header(bytes: &[u8]) -> Result<Header, PackedError> {
    let got = bytes.len();
    if got < HEADER {
        return Err(PackedError::Truncated { got, length: HEADER as u64, at_least: true });
    }
    let field = |byte: usize, name: &'static str, value: u64, allowed: String| {
        Err(PackedError::Field { byte, name, value, allowed })
    };
    if bytes[8] != VERSION {
        return field(8, "the version", bytes[8].into(), VERSION.to_string());
    }
    for byte in [9, 10] {
        if bytes[byte] > ORDER_MAX {
            return field(byte, "the order of the codes", bytes[byte].into(), format!("0 to {ORDER_MAX}"));
        }
    }
    if bytes[11] != 0 {
        return field(11, "the reserved byte", bytes[11].into(), "0".to_owned());
    }
    let u32_at = |byte: usize| u32::from_le_bytes([0, 1, 2, 3].map(|at| bytes[byte + at]));
    let cell_m = f64::from_le_bytes([0, 1, 2, 3, 4, 5, 6, 7].map(|at| bytes[24 + at]));
    let extent = Extent::new([12, 16, 20].map(u32_at), cell_m).map_err(|reason| {
        let byte = if matches!(reason, ExtentError::Size { .. }) { 12 } else { 24 };
        PackedError::Extent { byte, reason }
    })?;
    let (runs, lengths) = ([32, 36].map(u32_at), [40, 44].map(u32_at));
    let length = HEADER as u64 + lengths.iter().map(|&length| u64::from(length)).sum::<u64>();
    if (got as u64) < length {
        return Err(PackedError::Truncated { got, length, at_least: false });
    }
    if got as u64 > length {
        return Err(PackedError::Trailing { length, surplus: got as u64 - length });
    }
    let (stored, computed) = (u32_at(SUM.start), sum_of(bytes));
    if stored != computed {
        return Err(PackedError::Sum { stored, computed });
    }
    let cells = extent.volume() as u64;
    if let Some(kind) = (0..KINDS).find(|&kind| u64::from(runs[kind]) > cells) {
        let allowed = format!("0 to {cells}, the number of cells");
        return field(32 + 4 * kind, "the number of runs", runs[kind].into(), allowed);
    }
    Ok(Header { extent, orders: [bytes[9], bytes[10]], runs, lengths: lengths.map(|length| length as usize) })
}

/// The rows before a row, at y - 1 and z - 1; outside the map all is wall.
fn rows_before<'a>(before: &'a [Terrain], outside: &'a [Terrain], number: usize, size_y: usize) -> [&'a [Terrain]; 2] {
    let size_x = outside.len();
    let row = |distance: usize| &before[(number - distance) * size_x..][..size_x];
    [if number.is_multiple_of(size_y) { outside } else { row(1) }, if number < size_y { outside } else { row(size_y) }]
}

/// The number of cells at the beginning of both rows that are of a kind.
fn same_ahead(beside: &[Terrain], below: &[Terrain], kind: Terrain) -> usize {
    let is_same = |(&one, &other): (&Terrain, &Terrain)| (one == kind) & (other == kind);
    let mut same = 0;
    for (one, other) in beside.chunks(AT_ONCE).zip(below.chunks(AT_ONCE)) {
        // Without an early end this is a few comparisons of whole vectors.
        if !one.iter().zip(other).fold(true, |all, pair| all & is_same(pair)) {
            return same + one.iter().zip(other).take_while(|&pair| is_same(pair)).count();
        }
        same += one.len();
    }
    same
}

/// The prediction of a cell from the cells before it along x, y and z, and its kind.
fn prediction(x: Terrain, y: Terrain, z: Terrain) -> (Terrain, usize) {
    if x == y { (x, usize::from(x != z)) } else { (z, 1) }
}

fn opposite(terrain: Terrain) -> Terrain {
    match terrain {
        Terrain::Free => Terrain::Wall,
        Terrain::Wall => Terrain::Free,
    }
}

/// The order with the shortest codes of these runs; of several the lowest.
fn best_order(runs: &[u32]) -> u8 {
    let bits = |order: u8| runs.iter().map(|&run| u64::from(code_bits(run, order))).sum::<u64>();
    (0..=ORDER_MAX).min_by_key(|&order| bits(order)).unwrap_or_default()
}

fn sum_of(bytes: &[u8]) -> u32 {
    let mut crc = crc32fast::Hasher::new();
    crc.update(&bytes[..SUM.start]);
    crc.update(&bytes[SUM.end..]);
    crc.finalize()
}

/// A decoder of the runs of one kind of cells.
struct Runs<'a> {
    codes: BitReader<'a>,
    order: u8,
    /// Number of runs.
    runs: u32,
    /// Number of runs that have been read.
    taken: u32,
    /// Cells before the next wrong prediction.
    left: u32,
    /// Whether there is a next wrong prediction.
    wrong: bool,
}

impl Runs<'_> {
    /// Reads the next run, if there is one; an error is its number.
    fn next(&mut self) -> Result<(), u32> {
        self.wrong = self.taken < self.runs;
        if self.wrong {
            self.left = self.codes.code(self.order).ok_or(self.taken)?;
            self.taken += 1;
        }
        Ok(())
    }

    /// Number of cells before the next wrong prediction.
    fn before_wrong(&self) -> usize {
        if self.wrong { self.left as usize } else { usize::MAX }
    }

    /// Advances by this many cells, of which no prediction is wrong.
    fn pass(&mut self, cells: usize) {
        if self.wrong {
            self.left -= cells as u32;
        }
    }

    /// Advances by one cell; returns whether its prediction is wrong.
    fn step(&mut self) -> Result<bool, u32> {
        if !self.wrong {
            return Ok(false);
        }
        if self.left > 0 {
            self.left -= 1;
            return Ok(false);
        }
        self.next()?;
        Ok(true)
    }

    /// Checks that the cells have consumed all runs, and the runs all bits.
    fn check_end(&self, byte: usize, length: usize) -> Result<(), PackedError> {
        if self.wrong {
            let left = self.runs - self.taken + 1;
            return Err(PackedError::Runs { byte, left, runs: self.runs });
        }
        if !self.codes.is_at_end() {
            return Err(PackedError::Padding { byte, length });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
