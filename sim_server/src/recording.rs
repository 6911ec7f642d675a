//! Reading a recording, from its first record to its last or to where it is damaged.
//!
//! Invariants: nothing of a damaged chunk and nothing behind it is given out, because the sum of a chunk is checked before its first
//! message; a recording without its end gives out every message up to its last whole chunk; a file that is no recording of this
//! simulator is refused when it is opened. No content of a file makes this panic or fill the memory.
//!
//! This module says what stands in a file, and not what it means.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt;
use std::path::Path;
use std::sync::Arc;

use mcap::records::{Record, op};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use msgs::cdr::{self, CdrError};
use msgs::ids::{AgentId, Tick};
use msgs::topics;
use serde::de::DeserializeOwned;
use thiserror::Error;

/// Name of the attachment with the scenario.
pub const SCENARIO_ATTACHMENT: &str = "scenario.toml";

/// Name of the attachment with the true map.
pub const MAP_ATTACHMENT: &str = "map.m3dm";

/// Name of the attachment with the true map in recordings of earlier builds.
pub const TEXT_MAP_ATTACHMENT: &str = "map.txt";

/// Longest record that is read, bytes, unless the file is longer: a damaged length must not fill the memory.
const RECORD_BYTES_MAX: usize = 1 << 26;

/// Why a file cannot be read as a recording.
#[derive(Debug, Error)]
pub enum RecordingError {
    /// The file cannot be read.
    #[error("{file}: {source}")]
    Read {
        /// The file.
        file: String,
        /// What the system says.
        source: std::io::Error,
    },
    /// The file is no MCAP file.
    #[error("{file}: no MCAP recording: {source}")]
    NoMcap {
        /// The file.
        file: String,
        /// What the reader says.
        source: mcap::McapError,
    },
    /// The file is an MCAP file of something else.
    #[error("{file}: not a recording of this simulator: it has no attachment {SCENARIO_ATTACHMENT}")]
    OtherRecording {
        /// The file.
        file: String,
    },
}

/// How the compression of a chunk is named in it: the length of the name, and the name.
const ZSTD: &[u8] = b"\x04\0\0\0zstd";

/// Where that stands in a chunk: behind its times, its length and its sum.
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
    /// Its name.
    pub topic: String,
    /// Its type, such as `maes_msgs/msg/Command`.
    pub type_name: String,
    /// How it was offered, as rosbag2 writes it.
    pub offered_qos: String,
}

/// A message of a recording.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Message {
    /// Where it was said.
    pub channel: Arc<Channel>,
    /// When, sim time.
    pub time_ns: u64,
    /// CDR with its encapsulation header.
    pub data: Vec<u8>,
}

impl Message {
    /// The message, if it is one of this type.
    ///
    /// # Errors
    /// If it is not.
    pub fn decode<M: DeserializeOwned>(&self) -> Result<M, CdrError> {
        cdr::decode(&self.data)
    }

    /// The tick in which it was said.
    #[must_use]
    pub fn tick(&self) -> Tick {
        Tick(self.time_ns / Tick(1).time_ns())
    }

    /// The agent and the rest of the topic, of a topic of an agent.
    #[must_use]
    pub fn of_agent(&self) -> Option<(AgentId, &str)> {
        topics::split(&self.channel.topic)
    }
}

/// Where the messages of a recording ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum End {
    /// At its end.
    Whole,
    /// Without an end: its server was killed, or is still at work.
    Missing,
    /// In the middle of a record: it was written or copied in part.
    CutOff {
        /// Bytes that are there.
        bytes: usize,
    },
    /// Where it cannot be read any further.
    Damage {
        /// Bytes from the start of the file before which the damage lies.
        before_byte: usize,
        /// What the reader says.
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
        let bytes = std::fs::read(file).map_err(|source| RecordingError::Read { file: name.clone(), source })?;
        Self::from_bytes(name, bytes)
    }

    /// The same of bytes in memory; `file` is what errors call them.
    ///
    /// # Errors
    /// If they are no recording of this simulator.
    pub fn from_bytes(file: String, bytes: Vec<u8>) -> Result<Self, RecordingError> {
        let mut records = Records::new(&bytes);
        let mut attachments = BTreeMap::new();
        // The documents come before everything that is said.
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

    /// What errors call it.
    #[must_use]
    pub fn file(&self) -> &str {
        &self.file
    }

    /// The scenario, as text.
    #[must_use]
    pub fn scenario(&self) -> Cow<'_, str> {
        String::from_utf8_lossy(&self.attachments[SCENARIO_ATTACHMENT])
    }

    /// The whole file.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// All documents of it, by name.
    #[must_use]
    pub fn attachments(&self) -> &BTreeMap<String, Vec<u8>> {
        &self.attachments
    }

    /// A document of it.
    #[must_use]
    pub fn attachment(&self, name: &str) -> Option<&[u8]> {
        self.attachments.get(name).map(Vec::as_slice)
    }

    /// All messages, in the order in which they stand there.
    #[must_use]
    pub fn messages(&self) -> Messages<'_> {
        Messages { records: Records::new(&self.bytes), schemas: BTreeMap::new(), channels: BTreeMap::new(), end: None }
    }
}

/// The messages of a recording, up to its end or to its damage.
pub struct Messages<'a> {
    records: Records<'a>,
    schemas: BTreeMap<u16, String>,
    channels: BTreeMap<u16, Arc<Channel>>,
    end: Option<End>,
}

impl Messages<'_> {
    /// Where they ended, once they have.
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
                Some(Ok(Record::Schema { header, .. })) => {
                    self.schemas.insert(header.id, header.name);
                }
                Some(Ok(Record::Channel(channel))) => {
                    let type_name = self.schemas.get(&channel.schema_id).cloned().unwrap_or_default();
                    let offered_qos = channel.metadata.get("offered_qos_profiles").cloned().unwrap_or_default();
                    let known = Arc::new(Channel { topic: channel.topic, type_name, offered_qos });
                    self.channels.insert(channel.id, known);
                }
                Some(Ok(Record::Message { header, data })) => {
                    if let Some(channel) = self.channels.get(&header.channel_id) {
                        let channel = Arc::clone(channel);
                        return Some(Message { channel, time_ns: header.log_time, data: data.into_owned() });
                    }
                }
                // What comes behind is a summary.
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
    /// Up to the first byte of a record that a recording does not have.
    bytes: &'a [u8],
    /// The kind of that record.
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

/// Where the first record begins that the recorder does not write like that, if there is one.
///
/// The reader of the library passes over what it does not know, so a chunk whose kind is damaged would be missing without a word;
/// in a chunk without compression it reads on behind the chunk's end, and it takes the length of the data of an attachment on trust.
fn first_unexpected_record(bytes: &[u8]) -> Option<usize> {
    let mut at = mcap::MAGIC.len();
    while let Some((&kind, rest)) = bytes.get(at..).and_then(<[u8]>::split_first)
        && let Some((&length, rest)) = rest.split_first_chunk()
    {
        let length = usize::try_from(u64::from_le_bytes(length)).unwrap_or(usize::MAX);
        // Of a record that is cut off the reader says so.
        let whole = rest.get(..length);
        let is_known = match kind {
            op::HEADER => at == mcap::MAGIC.len(),
            op::ATTACHMENT => whole.is_none_or(is_attachment),
            op::CHUNK => whole.unwrap_or(rest).get(COMPRESSION_AT..).is_none_or(|named| {
                let length = named.len().min(ZSTD.len());
                named[..length] == ZSTD[..length]
            }),
            // A channel, the bytes of the list, and the list.
            op::MESSAGE_INDEX => whole.is_none_or(|content| {
                let list = content.get(2..).and_then(<[u8]>::split_first_chunk);
                list.is_some_and(|(&bytes, list)| u32::from_le_bytes(bytes) as usize == list.len())
            }),
            // What comes behind is a summary.
            op::DATA_END => return None,
            _ => false,
        };
        if !is_known {
            return Some(at);
        }
        at = at.saturating_add(1 + size_of::<u64>()).saturating_add(length);
    }
    None
}

/// Whether an attachment is as long as its parts: two times, two texts, the length of the data, the data, and its sum.
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
