//! The records of an MCAP file (<https://mcap.dev/spec>): their frames at the top level, and those
//! in chunks of every compression of the specification.
//!
//! Invariants: the memory that is taken for a record is bounded by its file; a chunk's checksum and
//! decompression are checked before its first record is passed on, also where the chunk is too
//! large to be kept in memory.
//!
//! Records with kinds from 0x80 on are private to other programs and are skipped. Every other kind
//! has its place, and elsewhere is damage: a chunk with a wrong kind would be missing silently.

use std::io;

use crc32fast::Hasher;
use mcap::McapError;
use mcap::records::{Record, op};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};

use super::source::{Source, WINDOW_BYTES, Window};

/// Kind and length.
const FRAME_BYTES: u64 = 9;

/// First kind of records that the specification leaves to programs.
const PRIVATE: u8 = 0x80;

/// Decompressed bytes of a chunk that is kept in memory; a larger one is decompressed twice.
const KEPT_CHUNK_BYTES: u64 = 32 << 20;

/// Bytes of a record that are allowed whatever the length of the file.
const RECORD_BYTES: u64 = 64 << 20;

/// Bytes of a record that no length of the file allows.
const RECORD_BYTES_MAX: u64 = 1 << 30;

/// Why reading stops.
#[derive(Debug)]
pub(super) enum Flaw {
    /// The file ends within a record.
    CutOff,
    Damage {
        before_byte: u64,
        reason: String,
    },
}

/// The frame of a record at the top level.
#[derive(Debug, Clone, Copy)]
pub(super) struct Frame {
    pub(super) at: u64,
    pub(super) kind: u8,
    /// Bytes of its content.
    pub(super) length: u64,
}

impl Frame {
    pub(super) fn content_at(&self) -> u64 {
        self.at + FRAME_BYTES
    }

    pub(super) fn end(&self) -> u64 {
        self.content_at().saturating_add(self.length)
    }

    /// Damage of the record.
    pub(super) fn damage(&self, reason: impl Into<String>) -> Flaw {
        Flaw::Damage { before_byte: self.end(), reason: reason.into() }
    }
}

/// The records at the top level, one after the other.
pub(super) struct Frames<'a> {
    pub(super) window: Window<'a>,
    next_at: u64,
    /// Kind of the record before.
    previous: u8,
    /// Whether the data section lies behind.
    is_in_summary: bool,
    /// A reader between two chunks, with the memory that it has taken for earlier ones.
    spare: Option<LinearReader>,
}

impl<'a> Frames<'a> {
    /// From an offset on; `step` are the bytes that are read at once.
    pub(super) fn new(source: &'a Source, at: u64, step: usize) -> Self {
        Self { window: Window::new(source, step), next_at: at, previous: op::CHUNK, is_in_summary: false, spare: None }
    }

    /// The end of the record that was returned last.
    pub(super) fn position(&self) -> u64 {
        self.next_at
    }

    /// The next frame, whose content is there; `None` at the end of the file.
    pub(super) fn next(&mut self) -> Option<Result<Frame, Flaw>> {
        self.read().transpose()
    }

    fn read(&mut self) -> Result<Option<Frame>, Flaw> {
        let (at, length) = (self.next_at, self.window.source.length());
        if at >= length {
            return Ok(None);
        }
        let bytes = self.window.bytes(at, FRAME_BYTES as usize).map_err(|error| unreadable(at, &error))?;
        let kind = bytes[0];
        if !is_in_place(kind, at, self.previous, self.is_in_summary) {
            let reason = format!("a record of kind {kind:#04x} that no recording has at this place");
            return Err(Flaw::Damage { before_byte: at + 1, reason });
        }
        let Some(&content) = bytes[1..].first_chunk() else { return Err(Flaw::CutOff) };
        let frame = Frame { at, kind, length: u64::from_le_bytes(content) };
        if frame.end() > length {
            return Err(Flaw::CutOff);
        }
        (self.next_at, self.previous) = (frame.end(), kind);
        self.is_in_summary |= kind == op::DATA_END;
        Ok(Some(frame))
    }

    /// The content of a record.
    ///
    /// # Errors
    /// If it is too long, or cannot be read.
    pub(super) fn content(&mut self, frame: &Frame) -> Result<&[u8], Flaw> {
        let bytes_max = record_bytes_max(self.window.source);
        if frame.length > bytes_max {
            return Err(frame.damage(format!("a record of {} bytes, allowed are {bytes_max}", frame.length)));
        }
        let content = self.window.bytes(frame.content_at(), frame.length as usize);
        content.map_err(|error| unreadable(frame.end(), &error))
    }

    /// The first bytes of the content of a record, fewer if it is shorter.
    fn beginning(&mut self, frame: &Frame, count: u64) -> Result<&[u8], Flaw> {
        let count = count.min(frame.length) as usize;
        self.window.bytes(frame.content_at(), count).map_err(|error| unreadable(frame.end(), &error))
    }

    /// Adds a record to a checksum.
    ///
    /// # Errors
    /// If it cannot be read.
    pub(super) fn hash(&mut self, frame: &Frame, hasher: &mut Hasher) -> Result<(), Flaw> {
        let mut at = frame.at;
        while at < frame.end() {
            let count = (frame.end() - at).min(WINDOW_BYTES as u64) as usize;
            let bytes = self.window.bytes(at, count).map_err(|error| unreadable(frame.end(), &error))?;
            hasher.update(bytes);
            at += count as u64;
        }
        Ok(())
    }

    /// Name and data of an attachment that `wanted` names; `None` for another one.
    ///
    /// # Errors
    /// If it is damaged.
    pub(super) fn attachment(&mut self, frame: &Frame, wanted: &[&str]) -> Result<Option<(String, Vec<u8>)>, Flaw> {
        const TIMES_AND_LENGTH: u64 = 20;
        let fixed = self.beginning(frame, TIMES_AND_LENGTH)?;
        let length = fixed.last_chunk().filter(|_| fixed.len() as u64 == TIMES_AND_LENGTH);
        let Some(&length) = length else { return Err(frame.damage("an attachment without a name")) };
        let length = u64::from(u32::from_le_bytes(length));
        let longest = wanted.iter().map(|name| name.len() as u64).max().unwrap_or_default();
        if length > longest {
            return Ok(None);
        }
        let name = self.beginning(frame, TIMES_AND_LENGTH + length)?;
        if !wanted.iter().any(|wanted| name.ends_with(wanted.as_bytes()) && wanted.len() as u64 == length) {
            return Ok(None);
        }
        let content = self.content(frame)?;
        if !is_attachment(content) {
            return Err(frame.damage("an attachment whose length does not match its fields"));
        }
        match mcap::parse_record(op::ATTACHMENT, content) {
            Ok(Record::Attachment { header, data, .. }) => Ok(Some((header.name, data.into_owned()))),
            Ok(_) => Ok(None),
            Err(error) => Err(frame.damage(error.to_string())),
        }
    }

    /// Whether a list of the messages of a chunk has the length that it names.
    ///
    /// # Errors
    /// If it cannot be read.
    pub(super) fn check_index(&mut self, frame: &Frame) -> Result<(), Flaw> {
        const CHANNEL_AND_LENGTH: u64 = 6;
        let list = self.beginning(frame, CHANNEL_AND_LENGTH)?.get(2..).and_then(<[u8]>::first_chunk);
        if list.is_some_and(|&length| u64::from(u32::from_le_bytes(length)) + CHANNEL_AND_LENGTH == frame.length) {
            return Ok(());
        }
        Err(frame.damage("a message index whose length does not match its fields"))
    }

    /// The records of a chunk. Its bytes are added to the checksum as they are read.
    ///
    /// # Errors
    /// If the chunk is damaged.
    pub(super) fn chunk(&mut self, frame: &Frame, hasher: &mut Option<Hasher>) -> Result<ChunkRecords, Flaw> {
        let header = ChunkHeader::read(self, frame)?;
        let source = self.window.source;
        let reader = |is_kept, checks| {
            LinearReader::new_with_options(
                LinearReaderOptions::default()
                    .with_skip_start_magic(true)
                    .with_skip_end_magic(true)
                    .with_prevalidate_chunk_crcs(is_kept)
                    .with_validate_chunk_crcs(checks)
                    .with_record_length_limit(record_bytes_max(source) as usize),
            )
        };
        let records = |reader, is_hashed, is_reusable| ChunkRecords {
            reader,
            frame: *frame,
            position: frame.at,
            is_hashed,
            is_reusable,
        };
        if header.has_checksum && header.bytes.max(frame.length) <= KEPT_CHUNK_BYTES {
            let spare = self.spare.take().filter(|_| header.is_compressed);
            return Ok(records(spare.unwrap_or_else(|| reader(true, false)), true, header.is_compressed));
        }
        let mut first_pass = records(reader(false, true), true, false);
        while let Some(read) = first_pass.next(source, hasher, |_, _| Ok(Some(()))) {
            read?;
        }
        Ok(records(reader(false, false), false, false))
    }

    /// Takes back what [`Frames::chunk`] has returned, once it has no more records, for the next
    /// chunk.
    pub(super) fn reuse(&mut self, records: ChunkRecords) {
        if records.is_reusable && records.position == records.frame.end() {
            self.spare = Some(records.reader);
        }
    }
}

fn unreadable(before_byte: u64, error: &io::Error) -> Flaw {
    Flaw::Damage { before_byte, reason: error.to_string() }
}

/// Largest record, bytes.
fn record_bytes_max(source: &Source) -> u64 {
    source.length().clamp(RECORD_BYTES, RECORD_BYTES_MAX)
}

/// Whether a record of this kind may lie here.
fn is_in_place(kind: u8, at: u64, previous: u8, is_in_summary: bool) -> bool {
    if at == mcap::MAGIC.len() as u64 {
        return kind == op::HEADER;
    }
    match kind {
        op::SCHEMA | op::CHANNEL => true,
        op::MESSAGE | op::CHUNK | op::ATTACHMENT | op::METADATA | op::DATA_END => !is_in_summary,
        // It belongs to the chunk before it.
        op::MESSAGE_INDEX => matches!(previous, op::CHUNK | op::MESSAGE_INDEX),
        op::CHUNK_INDEX
        | op::ATTACHMENT_INDEX
        | op::STATISTICS
        | op::METADATA_INDEX
        | op::SUMMARY_OFFSET
        | op::FOOTER => is_in_summary,
        kind => kind >= PRIVATE,
    }
}

/// Whether an attachment's length matches its fields: two times, two strings, data length, data and
/// checksum.
fn is_attachment(content: &[u8]) -> bool {
    fn after_string(bytes: &[u8]) -> Option<&[u8]> {
        let (length, rest) = bytes.split_first_chunk()?;
        rest.get(u32::from_le_bytes(*length) as usize..)
    }
    let after_strings = content.get(2 * size_of::<u64>()..).and_then(after_string).and_then(after_string);
    after_strings.and_then(<[u8]>::split_first_chunk).is_some_and(|(length, rest)| {
        u64::from_le_bytes(*length).checked_add(size_of::<u32>() as u64) == Some(rest.len() as u64)
    })
}

/// What decides how a chunk is read.
struct ChunkHeader {
    /// Decompressed.
    bytes: u64,
    has_checksum: bool,
    is_compressed: bool,
}

impl ChunkHeader {
    fn read(frames: &mut Frames<'_>, frame: &Frame) -> Result<Self, Flaw> {
        const BYTES_AT: usize = 16;
        const CHECKSUM_AT: usize = 24;
        const NAME_AT: usize = 32;
        const NAME_MAX: usize = 64;
        let content = frames.beginning(frame, (NAME_AT + NAME_MAX) as u64)?;
        let short = || frame.damage("a chunk that ends within its header");
        let number =
            |at: usize| content.get(at..).and_then(<[u8]>::first_chunk).map(|&bytes| u32::from_le_bytes(bytes));
        let long = |at: usize| content.get(at..).and_then(<[u8]>::first_chunk).map(|&bytes| u64::from_le_bytes(bytes));
        let bytes = long(BYTES_AT).ok_or_else(short)?;
        let has_checksum = number(CHECKSUM_AT).ok_or_else(short)? != 0;
        let name_length = number(NAME_AT - size_of::<u32>()).ok_or_else(short)? as usize;
        let data_at = NAME_AT.saturating_add(name_length).saturating_add(size_of::<u64>());
        let name = content.get(NAME_AT..NAME_AT.saturating_add(name_length)).ok_or_else(short)?;
        if ![&b""[..], b"zstd", b"lz4"].contains(&name) {
            let name = String::from_utf8_lossy(name);
            return Err(frame.damage(format!("a chunk of compression {name:?}; expected zstd, lz4 or none")));
        }
        let data_bytes = long(data_at - size_of::<u64>()).ok_or_else(short)?;
        if data_bytes.checked_add(data_at as u64) != Some(frame.length) || name.is_empty() && bytes != data_bytes {
            return Err(frame.damage("a chunk whose length does not match its header"));
        }
        let is_compressed = !name.is_empty();
        Ok(Self { bytes, has_checksum, is_compressed })
    }
}

/// The records of one chunk.
pub(super) struct ChunkRecords {
    reader: LinearReader,
    frame: Frame,
    position: u64,
    /// Whether the bytes are added to the checksum of the file as they are read.
    is_hashed: bool,
    /// Whether the reader can go on with another chunk. Of a compressed chunk it asks for no more
    /// bytes than there are, but of others it does if their last record is too long.
    is_reusable: bool,
}

impl ChunkRecords {
    /// Passes kind and content of the records to `take` until it returns something; `None` at the
    /// end of the chunk.
    pub(super) fn next<T>(
        &mut self,
        source: &Source,
        hasher: &mut Option<Hasher>,
        mut take: impl FnMut(u8, &[u8]) -> Result<Option<T>, String>,
    ) -> Option<Result<T, Flaw>> {
        let frame = self.frame;
        loop {
            let wanted = match self.reader.next_event()? {
                Ok(LinearReadEvent::ReadRequest(wanted)) => wanted,
                Ok(LinearReadEvent::Record { data, opcode }) => match take(opcode, data) {
                    Ok(None) => continue,
                    Ok(Some(taken)) => return Some(Ok(taken)),
                    Err(reason) => return Some(Err(frame.damage(reason))),
                },
                Err(McapError::UnexpectedEof) => return Some(Err(frame.damage("a chunk that ends within a record"))),
                Err(error) => return Some(Err(frame.damage(error.to_string()))),
            };
            if self.is_reusable && self.position == frame.end() {
                return None;
            }
            let left = usize::try_from(frame.end() - self.position).unwrap_or(usize::MAX);
            let count = wanted.min(left).min(WINDOW_BYTES);
            let bytes = self.reader.insert(count);
            let read = match source.read_at(self.position, &mut bytes[..count]) {
                Ok(read) => read,
                Err(error) => return Some(Err(unreadable(frame.end(), &error))),
            };
            if let Some(hasher) = hasher.as_mut().filter(|_| self.is_hashed) {
                hasher.update(&bytes[..read]);
            }
            self.reader.notify_read(read);
            self.position += read as u64;
        }
    }
}
