//! The reader of recordings, up to their end or to damage.
//!
//! Invariants: no message of or behind a damaged chunk is returned, because a chunk's checksum is
//! verified before its first message; a recording without an end yields all messages up to its last
//! whole chunk; a file that is no recording of this simulator is refused when opened. No content of
//! a file causes a panic or exhausts memory.
//!
//! This module returns messages without interpreting them, except that commands of earlier builds,
//! which have no stage, come in the present form. [`Follower`] reads a recording while it is
//! written.

mod follower;

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt;
use std::path::Path;
use std::sync::Arc;

use mcap::records::{Record, op};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use msgs::cdr::{self, CdrError};
use msgs::ids::{AgentId, Tick};
use msgs::maes_msgs::Command;
use msgs::message::Message as _;
use msgs::topics;
use serde::de::DeserializeOwned;
use thiserror::Error;

use crate::input_file::{self, RECORDING_BYTES_MAX};
pub use follower::Follower;

/// Name of the attachment with the scenario.
pub const SCENARIO_ATTACHMENT: &str = "scenario.toml";

/// Name of the attachment with the true map.
pub const MAP_ATTACHMENT: &str = "map.m3dm";

/// Name of the attachment with the true map in recordings of earlier builds.
pub const TEXT_MAP_ATTACHMENT: &str = "map.txt";

/// Maximum bytes of a record, unless the file is longer: a damaged length must not exhaust memory.
const RECORD_BYTES_MAX: usize = 1 << 26;

/// Why a file cannot be read as a recording.
#[derive(Debug, Error)]
pub enum RecordingError {
    /// The file cannot be read.
    #[error("{file}: {source}")]
    Read { file: String, source: std::io::Error },
    /// The file is no MCAP file.
    #[error("{file}: no MCAP recording: {source}")]
    NoMcap { file: String, source: mcap::McapError },
    /// The file is another MCAP file.
    #[error("{file}: not a recording of this simulator: it has no attachment {SCENARIO_ATTACHMENT}")]
    OtherRecording { file: String },
}

/// Name of the compression in a chunk: length and text.
const ZSTD: &[u8] = b"\x04\0\0\0zstd";

/// Its offset in a chunk: behind times, length and checksum.
const COMPRESSION_AT: usize = 28;

/// A recording in memory.
#[derive(Debug, Clone)]
pub struct Recording {
    file: String,
    bytes: Vec<u8>,
    attachments: BTreeMap<String, Vec<u8>>,
}

/// A topic of a recording.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Channel {
    pub topic: String,
    /// Its type, such as `maes_msgs/msg/Command`.
    pub type_name: String,
    /// Offered QoS profiles, as rosbag2 writes them.
    pub offered_qos: String,
    /// Whether its messages are commands of an earlier build, which end before the stage: they are
    /// returned with the stage [`Command::SAME`].
    pub lacks_stage: bool,
}

/// A message of a recording.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Message {
    pub channel: Arc<Channel>,
    /// Sim time, ns.
    pub time_ns: u64,
    /// CDR with its encapsulation header.
    pub data: Vec<u8>,
}

impl Message {
    /// Decodes the message.
    ///
    /// # Errors
    /// If it is not of this type.
    pub fn decode<M: DeserializeOwned>(&self) -> Result<M, CdrError> {
        cdr::decode(&self.data)
    }

    /// The tick of its stamp.
    #[must_use]
    pub fn tick(&self) -> Tick {
        Tick(self.time_ns / Tick(1).time_ns())
    }

    /// Agent and remaining name, of a topic of an agent.
    #[must_use]
    pub fn of_agent(&self) -> Option<(AgentId, &str)> {
        topics::split(&self.channel.topic)
    }
}

/// Where the messages of a recording end.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum End {
    /// At the end record.
    Whole,
    /// Without an end record: the server was killed, or is still recording.
    Missing,
    /// In the middle of a record: the file is truncated.
    CutOff { bytes: usize },
    /// At damage.
    Damage {
        /// The damage lies before this byte.
        before_byte: usize,
        reason: String,
    },
}

impl fmt::Display for End {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Whole => f.write_str("whole"),
            Self::Missing => f.write_str("without an end: its server was killed, or is still at work"),
            Self::CutOff { bytes } => write!(f, "cut off behind byte {bytes}"),
            Self::Damage { before_byte, reason } => {
                write!(f, "damaged before byte {before_byte}: {reason}")
            }
        }
    }
}

impl Recording {
    /// Reads a file.
    ///
    /// # Errors
    /// If it cannot be read or is no recording of this simulator.
    pub fn open(file: &Path) -> Result<Self, RecordingError> {
        let name = file.display().to_string();
        let bytes = input_file::read(file, RECORDING_BYTES_MAX)
            .map_err(|source| RecordingError::Read { file: name.clone(), source })?;
        Self::from_bytes(name, bytes)
    }

    /// Reads bytes in memory; errors call them `file`.
    ///
    /// # Errors
    /// If they are no recording of this simulator.
    pub fn from_bytes(file: String, bytes: Vec<u8>) -> Result<Self, RecordingError> {
        let mut records = Records::new(&bytes);
        let mut attachments = BTreeMap::new();
        // Attachments precede all messages.
        loop {
            match records.next() {
                Some(Ok(Record::Attachment { header, data, .. })) => {
                    attachments.insert(header.name, data.into_owned());
                }
                Some(Ok(Record::Message { .. } | Record::DataEnd(_))) | None => break,
                Some(Ok(_)) => {}
                Some(Err(source)) if attachments.is_empty() => return Err(RecordingError::NoMcap { file, source }),
                Some(Err(_)) => break,
            }
        }
        if !attachments.contains_key(SCENARIO_ATTACHMENT) {
            return Err(RecordingError::OtherRecording { file });
        }
        Ok(Self { file, bytes, attachments })
    }

    /// The name for error messages.
    #[must_use]
    pub fn file(&self) -> &str {
        &self.file
    }

    /// The scenario as TOML.
    #[must_use]
    pub fn scenario(&self) -> Cow<'_, str> {
        String::from_utf8_lossy(&self.attachments[SCENARIO_ATTACHMENT])
    }

    /// The whole file.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Whether the file is closed: its summary is written, too.
    #[must_use]
    pub fn is_closed(&self) -> bool {
        self.bytes.ends_with(mcap::MAGIC)
    }

    /// Attachments by name.
    #[must_use]
    pub fn attachments(&self) -> &BTreeMap<String, Vec<u8>> {
        &self.attachments
    }

    /// An attachment.
    #[must_use]
    pub fn attachment(&self, name: &str) -> Option<&[u8]> {
        self.attachments.get(name).map(Vec::as_slice)
    }

    /// All messages, in file order.
    #[must_use]
    pub fn messages(&self) -> Messages<'_> {
        Messages::with_known(&self.bytes, KnownChannels::default())
    }
}

/// Iterator over the messages of a recording, up to its end or damage.
pub struct Messages<'a> {
    records: Records<'a>,
    known: KnownChannels,
    end: Option<End>,
}

/// What the messages of a file refer to, by id.
#[derive(Debug, Clone, Default)]
struct KnownChannels {
    schemas: BTreeMap<u16, KnownSchema>,
    channels: BTreeMap<u16, Arc<Channel>>,
}

/// A type of messages.
#[derive(Debug, Clone, Default)]
struct KnownSchema {
    name: String,
    lacks_stage: bool,
}

impl KnownSchema {
    fn new(name: String, definition: &[u8]) -> Self {
        let has_stage = || {
            // The definitions of the types that it contains follow behind a rule.
            let mut own = definition.split(|&byte| byte == b'\n').take_while(|line| !line.starts_with(b"==="));
            own.any(|line| line.starts_with(b"uint8 stage"))
        };
        let lacks_stage = name == Command::TYPE.to_string() && !has_stage();
        Self { name, lacks_stage }
    }
}

impl<'a> Messages<'a> {
    /// Of a part of a file behind the first bytes of every file; `known` is from the parts before.
    fn with_known(bytes: &'a [u8], known: KnownChannels) -> Self {
        Self { records: Records::new(bytes), known, end: None }
    }
}

impl Messages<'_> {
    /// Where they ended, once the iterator is exhausted.
    #[must_use]
    pub fn end(&self) -> Option<&End> {
        self.end.as_ref()
    }
}

impl Iterator for Messages<'_> {
    type Item = Message;

    fn next(&mut self) -> Option<Message> {
        while self.end.is_none() {
            match self.records.next() {
                Some(Ok(Record::Schema { header, data })) => {
                    self.known.schemas.insert(header.id, KnownSchema::new(header.name, &data));
                }
                Some(Ok(Record::Channel(channel))) => {
                    let schema = self.known.schemas.get(&channel.schema_id).cloned().unwrap_or_default();
                    let KnownSchema { name: type_name, lacks_stage } = schema;
                    let offered_qos = channel.metadata.get("offered_qos_profiles").cloned().unwrap_or_default();
                    let known = Arc::new(Channel { topic: channel.topic, type_name, offered_qos, lacks_stage });
                    self.known.channels.insert(channel.id, known);
                }
                Some(Ok(Record::Message { header, data })) => {
                    if let Some(channel) = self.known.channels.get(&header.channel_id) {
                        let channel = Arc::clone(channel);
                        let mut data = data.into_owned();
                        if channel.lacks_stage {
                            data.extend([Command::SAME; Command::UNDIGESTED_BYTES]);
                        }
                        return Some(Message { channel, time_ns: header.log_time, data });
                    }
                }
                // A summary follows.
                Some(Ok(Record::DataEnd(_))) => self.end = Some(End::Whole),
                Some(Ok(_)) => {}
                None => self.end = Some(End::Missing),
                Some(Err(mcap::McapError::UnexpectedEof)) => {
                    self.end = Some(End::CutOff { bytes: self.records.bytes.len() });
                }
                Some(Err(source)) => {
                    let before_byte = self.records.position;
                    let reason = match self.records.unexpected {
                        Some(kind) if before_byte == self.records.bytes.len() => {
                            format!("a record of kind {kind:#04x} that no recording has at this place or in this form")
                        }
                        _ => source.to_string(),
                    };
                    self.end = Some(End::Damage { before_byte, reason });
                }
            }
        }
        None
    }
}

/// The records of an MCAP file.
struct Records<'a> {
    /// Truncated behind the first byte of an unexpected record.
    bytes: &'a [u8],
    /// Kind of that record.
    unexpected: Option<u8>,
    reader: LinearReader,
    position: usize,
}

impl<'a> Records<'a> {
    fn new(bytes: &'a [u8]) -> Self {
        let unexpected = first_unexpected_record(bytes);
        let bytes = unexpected.map_or(bytes, |at| &bytes[..=at]);
        let options = LinearReaderOptions::default()
            .with_skip_end_magic(true)
            .with_prevalidate_chunk_crcs(true)
            .with_record_length_limit(bytes.len().max(RECORD_BYTES_MAX));
        let reader = LinearReader::new_with_options(options);
        Self { bytes, unexpected: unexpected.map(|at| bytes[at]), reader, position: 0 }
    }

    fn next(&mut self) -> Option<mcap::McapResult<Record<'static>>> {
        loop {
            match self.reader.next_event() {
                Some(Ok(LinearReadEvent::ReadRequest(wanted))) => {
                    let end = self.bytes.len().min(self.position + wanted);
                    let part = &self.bytes[self.position..end];
                    self.reader.insert(part.len()).copy_from_slice(part);
                    self.reader.notify_read(part.len());
                    self.position = end;
                }
                Some(Ok(LinearReadEvent::Record { data, opcode })) => {
                    return Some(mcap::parse_record(opcode, data).map(Record::into_owned));
                }
                Some(Err(error)) => return Some(Err(error)),
                None => return None,
            }
        }
    }
}

/// Offset of the first record that the recorder never writes in this form.
///
/// The library's reader skips unknown records, so a chunk with a damaged kind would be missing
/// silently; in an uncompressed chunk it reads beyond the chunk's end, and it trusts the data
/// length of an attachment.
fn first_unexpected_record(bytes: &[u8]) -> Option<usize> {
    for TopLevelRecord { at, kind, content, is_whole } in top_level_records(bytes) {
        // The reader reports a truncated record.
        let is_known = match kind {
            op::HEADER => at == mcap::MAGIC.len(),
            op::ATTACHMENT => !is_whole || is_attachment(content),
            op::CHUNK => content.get(COMPRESSION_AT..).is_none_or(|named| {
                let length = named.len().min(ZSTD.len());
                named[..length] == ZSTD[..length]
            }),
            // Channel, byte length of the list, and the list.
            op::MESSAGE_INDEX => {
                let list = content.get(2..).and_then(<[u8]>::split_first_chunk);
                !is_whole || list.is_some_and(|(&bytes, list)| u32::from_le_bytes(bytes) as usize == list.len())
            }
            // A summary follows.
            op::DATA_END => return None,
            _ => false,
        };
        if !is_known {
            return Some(at);
        }
    }
    None
}

/// A record that is in no other one.
struct TopLevelRecord<'a> {
    at: usize,
    kind: u8,
    /// Up to the end of the bytes if that comes first.
    content: &'a [u8],
    is_whole: bool,
}

/// The records behind the first bytes of a file, by their lengths alone.
fn top_level_records(bytes: &[u8]) -> impl Iterator<Item = TopLevelRecord<'_>> {
    let mut at = mcap::MAGIC.len();
    std::iter::from_fn(move || {
        let (&kind, rest) = bytes.get(at..)?.split_first()?;
        let (&length, rest) = rest.split_first_chunk()?;
        let length = usize::try_from(u64::from_le_bytes(length)).unwrap_or(usize::MAX);
        let whole = rest.get(..length);
        let record = TopLevelRecord { at, kind, content: whole.unwrap_or(rest), is_whole: whole.is_some() };
        at = at.saturating_add(1 + size_of::<u64>()).saturating_add(length);
        Some(record)
    })
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
