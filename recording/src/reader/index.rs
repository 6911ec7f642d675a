//! What the index of a finished recording says: the messages of each topic, their bytes, and the
//! last message of a topic, without a pass over the file.
//!
//! The sizes of messages follow from their offsets in the lists behind each chunk. A chunk in which
//! a channel comes for the first time is read instead, because its schema and channel records lie
//! between messages.
//!
//! Invariant: what comes of the index is what a pass over an undamaged file gives; where that is
//! not certain, the index is refused with a reason.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::Arc;

use crc32fast::Hasher;
use mcap::records::{ChunkIndex, MessageHeader, Record, Statistics, op};

use super::records::{Frame, Frames};
use super::source::{Source, WINDOW_BYTES};
use super::{DOCUMENTS, KnownChannels, Message, Messages, RecordingError};
use crate::recorder;
use system::input_file;

/// Bytes of the frame of a record: kind and length.
const FRAME_BYTES: u64 = 9;

/// Bytes of a message record before its data: frame and header.
const MESSAGE_HEADER_BYTES: u64 = FRAME_BYTES + 22;

/// Bytes of the end of the data: frame and checksum.
const DATA_END_BYTES: u64 = FRAME_BYTES + 4;

/// Bytes of the footer before its checksum: frame and two offsets.
const FOOTER_CHECKED_BYTES: u64 = FRAME_BYTES + 16;

/// Bytes from the footer to the end of the file.
const FOOTER_BYTES: u64 = FOOTER_CHECKED_BYTES + 4 + mcap::MAGIC.len() as u64;

/// A recording as its index describes it.
pub struct IndexedRecording {
    source: Source,
    known: KnownChannels,
    statistics: Statistics,
    /// In file order.
    chunks: Vec<ChunkIndex>,
    attachments: BTreeMap<String, Vec<u8>>,
}

/// Why an index is not used.
enum Unusable {
    Unreadable(std::io::Error),
    Refused(&'static str),
}

impl From<&'static str> for Unusable {
    fn from(reason: &'static str) -> Self {
        Self::Refused(reason)
    }
}

/// The reason where the index contradicts itself or the file.
const CONTRADICTION: &str = "its index does not fit it";

impl IndexedRecording {
    /// Reads the index of a file; the inner error says why it has none that can be used.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn open(file: &Path) -> Result<Result<Self, &'static str>, RecordingError> {
        let read_error = |source| RecordingError::Read { file: file.display().to_string(), source };
        let source = input_file::open(file).and_then(|file| Source::of_file(Arc::new(file))).map_err(read_error)?;
        match Self::of_source(source) {
            Ok(indexed) => Ok(Ok(indexed)),
            Err(Unusable::Refused(reason)) => Ok(Err(reason)),
            Err(Unusable::Unreadable(error)) => Err(read_error(error)),
        }
    }

    fn of_source(source: Source) -> Result<Self, Unusable> {
        let summary_at = summary_at(&source)?;
        let mut frames = Frames::new(&source, mcap::MAGIC.len() as u64, WINDOW_BYTES);
        let header = frames.next().and_then(Result::ok).ok_or("it has no header")?;
        let header = parsed(&mut frames, &header)?;
        if !matches!(header, Record::Header(header) if header.library.starts_with(recorder::LIBRARY)) {
            return Err("another program has written it".into());
        }
        let (mut known, mut statistics, mut chunks) = (KnownChannels::default(), None, Vec::new());
        let mut indexed_attachments = Vec::new();
        let mut frames = Frames::new(&source, summary_at - DATA_END_BYTES, WINDOW_BYTES);
        while let Some(Ok(frame)) = frames.next() {
            match frame.kind {
                op::SCHEMA | op::CHANNEL => {
                    let content = frames.content(&frame).map_err(|_| CONTRADICTION)?;
                    known.read(frame.kind, content).map_err(|_| CONTRADICTION)?;
                }
                op::STATISTICS | op::CHUNK_INDEX | op::ATTACHMENT_INDEX => match parsed(&mut frames, &frame)? {
                    Record::Statistics(read) => statistics = Some(read),
                    Record::ChunkIndex(chunk) => chunks.push(chunk),
                    Record::AttachmentIndex(attachment) => indexed_attachments.push(attachment),
                    _ => {}
                },
                op::FOOTER => break,
                _ => {}
            }
        }
        let statistics: Statistics = statistics.ok_or("it has no statistics")?;
        if chunks.len() != statistics.chunk_count as usize
            || indexed_attachments.len() != statistics.attachment_count as usize
        {
            return Err("its index is incomplete".into());
        }
        chunks.sort_by_key(|chunk: &ChunkIndex| chunk.chunk_start_offset);
        let mut attachments = BTreeMap::new();
        for indexed in indexed_attachments {
            let mut frames = Frames::new(&source, indexed.offset, WINDOW_BYTES);
            let frame = frames.next().and_then(Result::ok).filter(|frame| frame.kind == op::ATTACHMENT);
            let read = frames.attachment(&frame.ok_or(CONTRADICTION)?, &DOCUMENTS).map_err(|_| CONTRADICTION)?;
            attachments.extend(read);
        }
        Ok(Self { source, known, statistics, chunks, attachments })
    }

    /// An attachment.
    #[must_use]
    pub fn attachment(&self, name: &str) -> Option<&[u8]> {
        self.attachments.get(name).map(Vec::as_slice)
    }

    /// Number and bytes of the messages of each topic that has some.
    ///
    /// # Errors
    /// With a reason, if the index does not fit the file.
    pub fn traffic(&self) -> Result<BTreeMap<String, (u64, u64)>, &'static str> {
        let mut of_channel: BTreeMap<u16, (u64, u64)> = BTreeMap::new();
        let mut met = BTreeSet::new();
        for chunk in &self.chunks {
            let mut has_new = false;
            for &channel in chunk.message_index_offsets.keys() {
                has_new |= met.insert(channel);
            }
            let sizes = if has_new { self.read_sizes(chunk) } else { self.listed_sizes(chunk) };
            for (channel, bytes) in sizes.ok_or(CONTRADICTION)? {
                let traffic = of_channel.entry(channel).or_default();
                *traffic = (traffic.0 + 1, traffic.1 + bytes);
            }
        }
        let listed = self.statistics.channel_message_counts.iter().filter(|(_, count)| **count > 0);
        if !listed.eq(of_channel.iter().map(|(channel, (count, _))| (channel, count))) {
            return Err(CONTRADICTION);
        }
        let mut traffic: BTreeMap<String, (u64, u64)> = BTreeMap::new();
        for (channel, (count, bytes)) in of_channel {
            let topic = self.known.channels.get(&channel).ok_or(CONTRADICTION)?.channel.topic.clone();
            let of_topic = traffic.entry(topic).or_default();
            *of_topic = (of_topic.0 + count, of_topic.1 + bytes);
        }
        Ok(traffic)
    }

    /// Channel and bytes of each message of a chunk, by the lists behind it.
    fn listed_sizes(&self, chunk: &ChunkIndex) -> Option<Vec<(u16, u64)>> {
        let mut offsets: Vec<(u64, u16)> = Vec::new();
        let lists_at = chunk.chunk_start_offset.checked_add(chunk.chunk_length)?;
        let lists_end = lists_at.checked_add(chunk.message_index_length)?;
        let step = usize::try_from(chunk.message_index_length).ok()?.min(WINDOW_BYTES);
        let mut frames = Frames::new(&self.source, lists_at, step);
        while frames.position() < lists_end {
            let frame = frames.next()?.ok().filter(|frame| frame.kind == op::MESSAGE_INDEX)?;
            let Ok(Record::MessageIndex(list)) = parsed(&mut frames, &frame) else { return None };
            offsets.extend(list.records.iter().map(|entry| (entry.offset, list.channel_id)));
        }
        offsets.sort_unstable();
        let ends = offsets.iter().skip(1).map(|&(offset, _)| offset).chain([chunk.uncompressed_size]);
        let sizes = offsets.iter().zip(ends).map(|(&(offset, channel), end)| {
            Some((channel, end.checked_sub(offset)?.checked_sub(MESSAGE_HEADER_BYTES)?))
        });
        sizes.collect()
    }

    /// Channel and bytes of each message of a chunk that is read.
    fn read_sizes(&self, chunk: &ChunkIndex) -> Option<Vec<(u16, u64)>> {
        let mut frames = Frames::new(&self.source, chunk.chunk_start_offset, WINDOW_BYTES);
        let frame = frames.next()?.ok().filter(|frame| frame.kind == op::CHUNK)?;
        let mut records = frames.chunk(&frame, &mut None).ok()?;
        let mut sizes = Vec::new();
        let read = records.next(&self.source, &mut None, |kind, content| {
            if kind == op::MESSAGE {
                let Ok(Record::Message { header: MessageHeader { channel_id, .. }, data }) =
                    mcap::parse_record(kind, content)
                else {
                    return Err(CONTRADICTION.to_owned());
                };
                sizes.push((channel_id, data.len() as u64));
            }
            Ok(None::<()>)
        });
        read.is_none().then_some(sizes)
    }

    /// The last message of a topic.
    ///
    /// # Errors
    /// With a reason, if its chunk cannot be read.
    pub fn last(&self, topic: &str) -> Result<Option<Message>, &'static str> {
        let is_of_topic =
            |channel: &u16| self.known.channels.get(channel).is_some_and(|known| known.channel.topic == topic);
        let with_topic = |chunk: &&ChunkIndex| chunk.message_index_offsets.keys().any(is_of_topic);
        let Some(chunk) = self.chunks.iter().rev().find(with_topic) else { return Ok(None) };
        let at = chunk.chunk_start_offset;
        let mut messages = Messages::of_part(&self.source, at, self.known.clone());
        let mut last = None;
        while let Some(message) = messages.next().filter(|_| messages.last_chunk.is_some_and(|(chunk, _)| chunk == at))
        {
            if message.channel.topic == topic {
                last = Some(message);
            }
        }
        last.map(Some).ok_or(CONTRADICTION)
    }
}

/// Where the summary begins, if the end of the file is whole.
fn summary_at(source: &Source) -> Result<u64, Unusable> {
    const NO_END: &str = "it has no end, so no index";
    let length = source.length();
    let footer_at = length.checked_sub(FOOTER_BYTES).ok_or(NO_END)?;
    let mut end = [0; FOOTER_BYTES as usize];
    source.read_at(footer_at, &mut end).map_err(Unusable::Unreadable)?;
    if end[0] != op::FOOTER || !end.ends_with(mcap::MAGIC) {
        return Err(NO_END.into());
    }
    let footer = &end[FRAME_BYTES as usize..end.len() - mcap::MAGIC.len()];
    let Ok(Record::Footer(footer)) = mcap::parse_record(op::FOOTER, footer) else { return Err(NO_END.into()) };
    if !(DATA_END_BYTES..footer_at).contains(&footer.summary_start) {
        return Err("it has no index".into());
    }
    let mut hasher = Hasher::new();
    let mut at = footer.summary_start;
    let checked_end = footer_at + FOOTER_CHECKED_BYTES;
    let mut bytes = vec![0; WINDOW_BYTES];
    while at < checked_end {
        let count = (checked_end - at).min(WINDOW_BYTES as u64) as usize;
        source.read_at(at, &mut bytes[..count]).map_err(Unusable::Unreadable)?;
        hasher.update(&bytes[..count]);
        at += count as u64;
    }
    if footer.summary_crc != hasher.finalize() {
        return Err("its index does not match its checksum".into());
    }
    Ok(footer.summary_start)
}

fn parsed(frames: &mut Frames<'_>, frame: &Frame) -> Result<Record<'static>, &'static str> {
    let content = frames.content(frame).map_err(|_| CONTRADICTION)?;
    mcap::parse_record(frame.kind, content).map(Record::into_owned).map_err(|_| CONTRADICTION)
}
