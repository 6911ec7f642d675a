//! The reader of recordings, up to their end or to damage.
//!
//! A recording is read as a stream, chunk by chunk, so that its length costs no memory. Whatever a
//! tool has rewritten as MCAP is read: chunks of every compression or none, indexes, statistics,
//! metadata and attachments anywhere, other numbers of channels.
//!
//! Invariants: no message of or behind a damaged chunk is returned, because a chunk is checked
//! before its first message; a recording without an end yields all messages up to its last whole
//! chunk; a file that is no recording of this simulator is refused when opened. No content of a
//! file causes a panic or exhausts memory.
//!
//! This module returns messages without interpreting them, except that commands of earlier builds,
//! which have no stage, come in the present form. [`Follower`] reads a recording while it is
//! written.

mod channels;
mod follower;
pub mod index;
mod records;
pub mod recovery;
mod source;

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt;
use std::path::Path;
use std::sync::Arc;

use crc32fast::Hasher;
use mcap::records::{Record, op};
use msgs::cdr::{self, CdrError};
use msgs::ids::{AgentId, Tick};
use msgs::topics;
use serde::de::DeserializeOwned;
use thiserror::Error;

use channels::KnownChannels;
pub use follower::Follower;
use records::{ChunkRecords, Flaw, Frame, Frames};
use source::{Source, WINDOW_BYTES};
use system::input_file;

/// Name of the attachment with the scenario.
pub const SCENARIO_ATTACHMENT: &str = "scenario.toml";

/// Name of the attachment with the true map.
pub const MAP_ATTACHMENT: &str = "map.m3dm";

/// Name of the attachment with the true map in recordings of earlier builds.
pub const TEXT_MAP_ATTACHMENT: &str = "map.txt";

/// The attachments that a run writes; those of other programs are skipped.
const DOCUMENTS: [&str; 3] = [SCENARIO_ATTACHMENT, MAP_ATTACHMENT, TEXT_MAP_ATTACHMENT];

/// Messages of a file without attachments that are inspected for what has written it. Every tick
/// has some of the run, and topics of tools come between them.
const MESSAGES_INSPECTED_MAX: usize = 10_000;

/// Bytes that are read at once where most records are skipped.
const SKIPPING_BYTES: usize = 1 << 12;

/// Why a file cannot be read as a recording.
#[derive(Debug, Error)]
pub enum RecordingError {
    /// The file cannot be read.
    #[error("{file}: {source}")]
    Read { file: String, source: std::io::Error },
    /// The file is no MCAP file.
    #[error("{file}: no MCAP recording: {reason}")]
    NoMcap { file: String, reason: String },
    /// The file is another MCAP file.
    #[error("{file}: not a recording of this simulator: it has neither its attachments nor messages of maes_msgs")]
    OtherRecording { file: String },
    /// The file has messages of a run, but not what the run was made of.
    #[error(
        "{file}: {missing}: another program has written this recording again; take the file that `maes run` has \
         written; `maes replay` plays the topics of this one, and `maes info` lists them"
    )]
    NoAttachments { file: String, missing: String },
    /// The file holds several recordings.
    #[error("{file}: two attachments {name}: expected the recording of one run; merged ones cannot be read")]
    Merged { file: String, name: String },
}

/// A recording, which is read from its file again for every pass.
#[derive(Debug, Clone)]
pub struct Recording {
    file: String,
    source: Source,
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
    /// Hash of the type (REP-2016); empty in recordings of earlier builds.
    pub type_hash: String,
    /// Whether its messages are commands of an earlier build, which end before the stage: they are
    /// returned with the stage [`SAME`](msgs::maes_msgs::Command::SAME).
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
    CutOff { bytes: u64 },
    /// At damage.
    Damage {
        /// The damage lies before this byte.
        before_byte: u64,
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
    /// Opens a file, of any length.
    ///
    /// # Errors
    /// If it cannot be read, is no recording of this simulator, or has lost its attachments.
    pub fn open(file: &Path) -> Result<Self, RecordingError> {
        Self::open_messages(file)?.with_attachments()
    }

    /// Opens a file for its messages alone: it may have lost its attachments.
    ///
    /// # Errors
    /// If it cannot be read or is no recording of this simulator.
    pub fn open_messages(file: &Path) -> Result<Self, RecordingError> {
        let name = file.display().to_string();
        let source = input_file::open(file).and_then(|file| Source::of_file(Arc::new(file)));
        let source = source.map_err(|source| RecordingError::Read { file: name.clone(), source })?;
        Self::of_source(name, source)
    }

    /// Reads bytes in memory; errors call them `file`.
    ///
    /// # Errors
    /// If they are no recording of this simulator.
    pub fn from_bytes(file: String, bytes: Vec<u8>) -> Result<Self, RecordingError> {
        Self::of_source(file, Source::of_bytes(bytes))?.with_attachments()
    }

    fn with_attachments(self) -> Result<Self, RecordingError> {
        if self.attachments.contains_key(SCENARIO_ATTACHMENT) {
            return Ok(self);
        }
        let missing = match self.map_attachment().is_some() {
            true => format!("its attachment {SCENARIO_ATTACHMENT} is missing"),
            false => format!("its attachments {SCENARIO_ATTACHMENT} and {MAP_ATTACHMENT} are missing"),
        };
        Err(RecordingError::NoAttachments { file: self.file, missing })
    }

    fn of_source(file: String, mut source: Source) -> Result<Self, RecordingError> {
        let mut magic = [0; mcap::MAGIC.len()];
        let read = source.read_at(0, &mut magic);
        let read = read.map_err(|source| RecordingError::Read { file: file.clone(), source })?;
        if magic[..read] != *mcap::MAGIC {
            return Err(no_mcap(&file, "it does not begin as MCAP does"));
        }
        let mut attachments: BTreeMap<String, Vec<u8>> = BTreeMap::new();
        let mut last_chunk = None;
        let mut frames = Frames::new(&source, mcap::MAGIC.len() as u64, SKIPPING_BYTES);
        let mut flaw = None;
        loop {
            let attachment = match frames.next() {
                Some(Ok(frame)) if frame.kind == op::ATTACHMENT => frames.attachment(&frame, &DOCUMENTS),
                Some(Ok(frame)) if frame.kind == op::CHUNK => {
                    last_chunk = Some(frame.at);
                    Ok(None)
                }
                Some(Ok(frame)) if frame.kind == op::DATA_END => {
                    last_chunk = None;
                    break;
                }
                Some(Ok(_)) => Ok(None),
                Some(Err(flaw)) => Err(flaw),
                None => break,
            };
            match attachment {
                Ok(None) => {}
                Ok(Some((name, data))) => {
                    if attachments.contains_key(&name) {
                        return Err(RecordingError::Merged { file, name });
                    }
                    attachments.insert(name, data);
                }
                Err(other) => {
                    flaw = Some(other);
                    break;
                }
            }
        }
        if !attachments.contains_key(SCENARIO_ATTACHMENT) && !has_messages_of_a_run(&source) {
            return Err(match flaw {
                Some(flaw) => no_mcap(&file, &End::of(flaw, source.length()).to_string()),
                None => RecordingError::OtherRecording { file },
            });
        }
        if let Some(at) = last_chunk {
            source.copy_tail(at).map_err(|source| RecordingError::Read { file: file.clone(), source })?;
        }
        Ok(Self { file, source, attachments })
    }

    /// The name for error messages.
    #[must_use]
    pub fn file(&self) -> &str {
        &self.file
    }

    /// The scenario as TOML; empty if the attachment is missing.
    #[must_use]
    pub fn scenario(&self) -> Cow<'_, str> {
        self.attachment(SCENARIO_ATTACHMENT).map_or(Cow::Borrowed(""), String::from_utf8_lossy)
    }

    /// Bytes of the file.
    #[must_use]
    pub fn length(&self) -> u64 {
        self.source.length()
    }

    /// Whether two files are equal, byte for byte.
    #[must_use]
    pub fn has_same_bytes(&self, other: &Self) -> bool {
        self.source.is_same(&other.source).unwrap_or_default()
    }

    /// Scenario and map, by name.
    #[must_use]
    pub fn attachments(&self) -> &BTreeMap<String, Vec<u8>> {
        &self.attachments
    }

    /// An attachment.
    #[must_use]
    pub fn attachment(&self, name: &str) -> Option<&[u8]> {
        self.attachments.get(name).map(Vec::as_slice)
    }

    /// The attachment that holds the map, if there is one, with its name.
    #[must_use]
    pub fn map_attachment(&self) -> Option<(&'static str, &[u8])> {
        [MAP_ATTACHMENT, TEXT_MAP_ATTACHMENT].into_iter().find_map(|name| Some((name, self.attachment(name)?)))
    }

    /// All messages, in file order.
    #[must_use]
    pub fn messages(&self) -> Messages<'_> {
        Messages::new(&self.source)
    }

    /// The messages on some topics, in file order. The others are checked, and not copied.
    #[must_use]
    pub fn messages_on(&self, is_wanted: fn(&str) -> bool) -> Messages<'_> {
        let mut messages = self.messages();
        messages.known.wanted = Some(is_wanted);
        messages
    }
}

fn no_mcap(file: &str, reason: &str) -> RecordingError {
    RecordingError::NoMcap { file: file.to_owned(), reason: reason.to_owned() }
}

/// Whether some message is of a type of this project, so that the file is of a run, whatever a
/// program has made of it since.
fn has_messages_of_a_run(source: &Source) -> bool {
    let is_of_a_run = |message: &Message| message.channel.type_name.starts_with("maes_msgs/");
    Messages::new(source).take(MESSAGES_INSPECTED_MAX).any(|message| is_of_a_run(&message))
}

impl End {
    fn of(flaw: Flaw, length: u64) -> Self {
        match flaw {
            Flaw::CutOff => Self::CutOff { bytes: length },
            Flaw::Damage { before_byte, reason } => Self::Damage { before_byte: before_byte.min(length), reason },
        }
    }
}

/// Iterator over the messages of a recording, up to its end or damage.
pub struct Messages<'a> {
    frames: Frames<'a>,
    chunk: Option<ChunkRecords>,
    known: KnownChannels,
    /// Messages returned so far.
    count: u64,
    /// Offset of the last chunk so far, and the messages before it.
    last_chunk: Option<(u64, u64)>,
    /// Of the bytes so far; `None` if reading did not begin with the file.
    hasher: Option<Hasher>,
    end: Option<End>,
}

impl<'a> Messages<'a> {
    /// From the beginning of a file on.
    fn new(source: &'a Source) -> Self {
        let mut hasher = Hasher::new();
        hasher.update(mcap::MAGIC);
        Self { hasher: Some(hasher), ..Self::of_part(source, mcap::MAGIC.len() as u64, KnownChannels::default()) }
    }

    /// From a record at the top level on; `known` is from the records before.
    fn of_part(source: &'a Source, at: u64, known: KnownChannels) -> Self {
        Self {
            frames: Frames::new(source, at, WINDOW_BYTES),
            chunk: None,
            known,
            count: 0,
            last_chunk: None,
            hasher: None,
            end: None,
        }
    }
}

impl Messages<'_> {
    /// Where they ended, once the iterator is exhausted.
    #[must_use]
    pub fn end(&self) -> Option<&End> {
        self.end.as_ref()
    }

    /// Messages so far on topics that are not wanted, see [`Recording::messages_on`].
    #[must_use]
    pub fn left_out(&self) -> u64 {
        self.known.left_out
    }

    /// Reads up to a message, or a part without one.
    fn step(&mut self) -> Result<Option<Message>, Flaw> {
        if let Some(chunk) = &mut self.chunk {
            let known = &mut self.known;
            let message = chunk.next(self.frames.window.source, &mut self.hasher, |kind, data| known.read(kind, data));
            if message.is_none()
                && let Some(chunk) = self.chunk.take()
            {
                self.frames.reuse(chunk);
            }
            return message.transpose();
        }
        let Some(frame) = self.frames.next().transpose()? else {
            self.end = Some(End::Missing);
            return Ok(None);
        };
        match frame.kind {
            op::CHUNK => {
                self.last_chunk = Some((frame.at, self.count));
                self.chunk = Some(self.frames.chunk(&frame, &mut self.hasher)?);
                return Ok(None);
            }
            op::DATA_END => {
                self.check_end(&frame)?;
                self.end = Some(End::Whole);
                return Ok(None);
            }
            _ => {}
        }
        if let Some(hasher) = &mut self.hasher {
            self.frames.hash(&frame, hasher)?;
        }
        match frame.kind {
            op::SCHEMA | op::CHANNEL | op::MESSAGE => {
                let content = self.frames.content(&frame)?;
                self.known.read(frame.kind, content).map_err(|reason| frame.damage(reason))
            }
            op::ATTACHMENT => self.frames.attachment(&frame, &DOCUMENTS).map(|_| None),
            op::MESSAGE_INDEX => self.frames.check_index(&frame).map(|()| None),
            _ => Ok(None),
        }
    }

    /// Checks what the end of a file says about the whole of it.
    fn check_end(&mut self, data_end: &Frame) -> Result<(), Flaw> {
        let hasher = self.hasher.take();
        let content = self.frames.content(data_end)?;
        let Ok(Record::DataEnd(record)) = mcap::parse_record(op::DATA_END, content) else {
            return Err(data_end.damage("an end of data that cannot be read"));
        };
        let is_whole = hasher.is_some();
        if let Some(found) = hasher.map(Hasher::finalize)
            && record.data_section_crc != 0
            && record.data_section_crc != found
        {
            return Err(data_end.damage("the bytes before do not match the checksum at the end"));
        }
        loop {
            let Some(frame) = self.frames.next().transpose()? else { return Err(Flaw::CutOff) };
            match frame.kind {
                op::STATISTICS => {
                    let Ok(Record::Statistics(all)) = mcap::parse_record(frame.kind, self.frames.content(&frame)?)
                    else {
                        return Err(frame.damage("statistics that cannot be read"));
                    };
                    let found = self.count + self.known.left_out;
                    if is_whole && all.message_count != found {
                        let named = all.message_count;
                        return Err(
                            frame.damage(format!("the statistics name {named} messages, and {found} are there"))
                        );
                    }
                }
                op::FOOTER => {
                    let magic = mcap::MAGIC;
                    let end = self.frames.window.bytes(frame.end(), magic.len() + 1);
                    return match end.map_err(|error| frame.damage(error.to_string()))? {
                        end if end == magic => Ok(()),
                        end if magic.starts_with(end) => Err(Flaw::CutOff),
                        _ => Err(frame.damage("the file does not end there as MCAP does")),
                    };
                }
                _ => {}
            }
        }
    }
}

impl Iterator for Messages<'_> {
    type Item = Message;

    fn next(&mut self) -> Option<Message> {
        while self.end.is_none() {
            match self.step() {
                Ok(None) => {}
                Ok(Some(message)) => {
                    self.count += 1;
                    return Some(message);
                }
                Err(flaw) => self.end = Some(End::of(flaw, self.frames.window.source.length())),
            }
        }
        None
    }
}

#[cfg(test)]
mod tests;
