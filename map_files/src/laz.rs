//! The points of compressed files (LAZ), of all point formats.
//!
//! The crate `laz` decodes; this module reads what surrounds the codes. Files are hostile: a few
//! bytes may claim billions of points, or layers of gigabytes. So points and steps are bounded, the
//! description of a point must be that of its format, and a chunk with layers goes to the decoder
//! only after the sizes of its layers have been compared with the bytes that there are; of these
//! layers it gets those of coordinates, classes, flags and times. The table of the chunks is
//! neither needed nor read.
//!
//! Not read: points in chunks of varying size before point format 6, which would need that table.

use std::io::Cursor;
use std::panic::{AssertUnwindSafe, catch_unwind};

use laz::record::{LayeredPointRecordDecompressor, RecordDecompressor, SequentialPointRecordDecompressor};
use laz::{LazItem, LazItemType, LazVlr};

use super::FormatError;
use super::bytes::Bytes;
use super::work_budget::WorkBudget;

/// Length of the header of a variable length record.
const RECORD_HEADER: usize = 54;

/// The record that describes the compression: who defines it, its number, and its least length.
const USER: &[u8] = b"laszip encoded\0\0";
const RECORD_ID: u16 = 22204;
const RECORD_MIN: usize = 34;

/// Most points for each byte of a file: a point takes 24 bytes of memory, and compressed it may
/// take next to none.
const POINTS_PER_BYTE_MAX: u64 = 8;

/// Most bytes that a producer may have added to each point; the decoder takes 10 kB for each.
const ADDED_BYTES_MAX: usize = 192;

/// Steps that a point takes.
const STEPS: usize = 4;

/// The compressor without chunks, whose points begin at once.
const POINT_WISE: u16 = 1;

/// Place of the table of chunks, before the first chunk.
const TABLE_PLACE: usize = 8;

/// Layers of the part of a point that has the coordinates: of these, of classes, flags, and five
/// that are not needed, before the times.
const LAYERS: usize = 9;
const WANTED_LAYERS: usize = 4;

/// The bytes of that part.
const LAYERED_POINT: usize = 30;

/// Compressed points of a file.
pub(super) struct Compressed<'a> {
    /// The file.
    pub(super) bytes: &'a [u8],
    /// Length of its header.
    pub(super) header: usize,
    /// Number of its variable length records.
    pub(super) records: u32,
    /// Offset of the points.
    pub(super) start: usize,
    /// Length of a point.
    pub(super) length: usize,
    /// Number of points.
    pub(super) count: u64,
}

/// What the record says about the compression.
struct Description {
    items: Vec<LazItem>,
    /// Points of a chunk, all but the last; `None` if they vary.
    chunk_points: Option<u64>,
    is_in_chunks: bool,
    is_layered: bool,
}

impl Compressed<'_> {
    /// Calls `found` with each point, of a layered one with its first part.
    ///
    /// # Errors
    /// If the file is malformed, or has more points than its length or its steps allow.
    pub(super) fn points(&self, work: &mut WorkBudget, mut found: impl FnMut(&[u8])) -> Result<(), FormatError> {
        let (bytes, count) = (self.bytes.len(), self.count);
        if count > POINTS_PER_BYTE_MAX.saturating_mul(bytes as u64) {
            let reason = format!("the file ends here, allowed are {POINTS_PER_BYTE_MAX} points for each of its bytes");
            return Err(FormatError::byte(bytes, format!("{reason}, and it has {count}")));
        }
        let description = self.description()?;
        let mut at = self.start + if description.is_in_chunks { TABLE_PLACE } else { 0 };
        let mut left = count;
        while left > 0 {
            let rest = self.bytes.get(at..).unwrap_or_default();
            let most = left.min(description.chunk_points.unwrap_or(u64::MAX));
            let damaged = |reason| FormatError::byte(at, format!("the chunk that begins here is damaged: {reason}"));
            // The decoder indexes its tables with what it has decoded, and some damaged codes lead
            // beyond them.
            let mut decode = || {
                if description.is_layered {
                    layered(rest, self.length, &description.items, most, work, &mut found)
                } else {
                    sequential(rest, self.length, &description.items, most, work, &mut found)
                }
            };
            let decoded = catch_unwind(AssertUnwindSafe(&mut decode));
            let (points, length) = match decoded {
                Ok(decoded) => decoded.map_err(|error| match error {
                    ChunkError::Damaged(reason) => damaged(reason),
                    ChunkError::WorkBudget(error) => error,
                })?,
                Err(_) => return Err(damaged("its codes have no meaning".to_owned())),
            };
            at += length;
            left -= points;
        }
        Ok(())
    }

    /// The record of the compression.
    fn description(&self) -> Result<Description, FormatError> {
        let mut file = Bytes::new(self.bytes);
        file.take(self.header, "the header")?;
        for _ in 0..self.records {
            let record = file.take(RECORD_HEADER, "the header of a variable length record")?;
            let u16_at = |at: usize| u16::from_le_bytes([record[at], record[at + 1]]);
            let (user, id, length) = (&record[2..18], u16_at(18), usize::from(u16_at(20)));
            let at = file.at();
            let data = file.take(length, "a variable length record")?;
            if user == USER && id == RECORD_ID {
                return self.describe(at, data);
            }
        }
        Err(FormatError::byte(file.at(), "the file has no record of the compression of its points"))
    }

    /// Checks that the items of a record are those of a point of this length.
    fn describe(&self, at: usize, data: &[u8]) -> Result<Description, FormatError> {
        let refuse = |reason: &str| FormatError::byte(at, format!("the record of the compression {reason}"));
        if data.len() < RECORD_MIN {
            return Err(refuse(&format!("has {} bytes, expected {RECORD_MIN} or more", data.len())));
        }
        let record = LazVlr::read_from(data).map_err(|error| refuse(&format!("is malformed: {error}")))?;
        let items = record.items().clone();
        let length: usize = items.iter().map(|item| usize::from(item.size())).sum();
        let is_right = |item: &LazItem| length_of(item) == item.size();
        let is_layered = match items.first().map(|item| (item.item_type(), item.version())) {
            Some((LazItemType::Point10, 1 | 2)) => false,
            Some((LazItemType::Point14, 3 | 4)) => true,
            _ => return Err(refuse("begins with no point that is known")),
        };
        if length != self.length || !items.iter().all(is_right) {
            return Err(refuse(&format!("describes points of {length} bytes, the header of {}", self.length)));
        }
        let is_added = |item: &&LazItem| matches!(item.item_type(), LazItemType::Byte(_) | LazItemType::Byte14(_));
        let added: usize = items.iter().filter(is_added).map(|item| usize::from(item.size())).sum();
        if added > ADDED_BYTES_MAX {
            return Err(refuse(&format!("adds {added} bytes to each point, allowed are {ADDED_BYTES_MAX}")));
        }
        let is_in_chunks = u16::from_le_bytes([data[0], data[1]]) != POINT_WISE;
        let chunk_points = (!record.uses_variable_size_chunks()).then(|| record.chunk_size().into());
        if is_in_chunks && !is_layered && chunk_points.is_none() {
            return Err(refuse("has chunks of varying size; write the file again with chunks of one size"));
        }
        let chunk_points = if is_in_chunks { chunk_points } else { None };
        Ok(Description { items, chunk_points, is_in_chunks, is_layered })
    }
}

/// The length of an item.
fn length_of(item: &LazItem) -> u16 {
    match item.item_type() {
        LazItemType::Byte(length) | LazItemType::Byte14(length) => length,
        LazItemType::Point10 => 20,
        LazItemType::GpsTime | LazItemType::RGBNIR14 => 8,
        LazItemType::RGB12 | LazItemType::RGB14 => 6,
        LazItemType::WavePacket13 | LazItemType::WavePacket14 => 29,
        LazItemType::Point14 => LAYERED_POINT as u16,
    }
}

/// Why a chunk cannot be decoded.
enum ChunkError {
    Damaged(String),
    WorkBudget(FormatError),
}

impl<E: std::error::Error> From<E> for ChunkError {
    fn from(error: E) -> Self {
        Self::Damaged(error.to_string())
    }
}

/// Decodes at most `most` points of a chunk without layers. Returns how many, and its bytes.
fn sequential(
    chunk: &[u8],
    length: usize,
    items: &Vec<LazItem>,
    most: u64,
    work: &mut WorkBudget,
    found: &mut impl FnMut(&[u8]),
) -> Result<(u64, usize), ChunkError> {
    let mut rest = chunk;
    let mut point = vec![0; length];
    let mut decoder = SequentialPointRecordDecompressor::new(&mut rest);
    decoder.set_fields_from(items)?;
    for _ in 0..most {
        work.spend(STEPS).map_err(ChunkError::WorkBudget)?;
        decoder.decompress_next(&mut point)?;
        found(&point);
    }
    drop(decoder);
    Ok((most, chunk.len() - rest.len()))
}

/// Decodes at most `most` points of a chunk with layers. Returns how many, and its bytes.
fn layered(
    chunk: &[u8],
    length: usize,
    items: &[LazItem],
    most: u64,
    work: &mut WorkBudget,
    found: &mut impl FnMut(&[u8]),
) -> Result<(u64, usize), ChunkError> {
    let ends = || ChunkError::Damaged("the file ends within it".to_owned());
    let u32_at = |at: usize| {
        let bytes = chunk.get(at..at + 4).ok_or_else(ends)?;
        Ok::<_, ChunkError>(u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]))
    };
    // The first point, the number of points, the sizes of all layers, and then the layers.
    let sizes_at = length + 4;
    let points = most.min(u32_at(length)?.into());
    if points == 0 {
        return Err(ChunkError::Damaged("it has no point".to_owned()));
    }
    let layers = LAYERS + items[1..].iter().map(layers_of).sum::<usize>();
    let sizes = (0..layers).map(|layer| u32_at(sizes_at + 4 * layer)).collect::<Result<Vec<u32>, _>>()?;
    let layers_at = sizes_at + 4 * layers;
    let end = sizes.iter().try_fold(layers_at, |end, &size| end.checked_add(size as usize)).ok_or_else(ends)?;
    let bytes_of = |layers: &[u32]| layers.iter().map(|&size| size as usize).sum::<usize>();
    let (first, last) = (bytes_of(&sizes[..WANTED_LAYERS]), bytes_of(&sizes[..LAYERS - 1]));
    let data = chunk.get(layers_at..end).ok_or_else(ends)?;
    // A chunk of the first item alone, whose other layers are empty: nothing of them changes.
    let mut part = chunk[..LAYERED_POINT].to_vec();
    part.extend_from_slice(&chunk[length..sizes_at + 4 * WANTED_LAYERS]);
    part.resize(part.len() + 4 * (LAYERS - 1 - WANTED_LAYERS), 0);
    part.extend_from_slice(&sizes[LAYERS - 1].to_le_bytes());
    part.extend_from_slice(&data[..first]);
    part.extend_from_slice(&data[last..last + sizes[LAYERS - 1] as usize]);
    let mut decoder = LayeredPointRecordDecompressor::new(Cursor::new(part));
    decoder.set_fields_from(&items[..1].to_vec())?;
    let mut point = [0; LAYERED_POINT];
    for _ in 0..points {
        work.spend(STEPS).map_err(ChunkError::WorkBudget)?;
        decoder.decompress_next(&mut point)?;
        found(&point);
    }
    Ok((points, end))
}

/// The layers of an item beside that of the coordinates.
fn layers_of(item: &LazItem) -> usize {
    match item.item_type() {
        LazItemType::RGBNIR14 => 2,
        LazItemType::Byte14(length) => length.into(),
        _ => 1,
    }
}
