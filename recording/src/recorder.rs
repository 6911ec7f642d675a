//! The recorder: it writes a run as an MCAP file (profile `ros2`, `ros2msg` schemas, `cdr`
//! messages).
//!
//! Invariants: equal runs give equal bytes, so every stamp is sim time and chunks end at fixed sim
//! times or sizes; everything written before the last [`Recorder::save_provisionally`] survives a
//! kill of the process, because the open chunk is appended behind the last whole one and
//! overwritten once it is complete; a recording that fails or is aborted has no end record.
//!
//! **File name.** A recording has a temporary name in its folder until [`Recorder::publish`], which
//! replaces an older recording. One that is aborted before leaves no file and keeps the older one.
//! `destination` decides what may be replaced.
//!
//! This module knows no world, only messages.

mod destination;
mod queue;
mod sink;

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io::{Cursor, ErrorKind, Seek, Write};
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use mcap::records::MessageHeader;
use mcap::{Attachment, Compression, McapResult, WriteOptions, Writer};
use msgs::ids::Tick;
use msgs::topics::Topic;
use msgs::{schema, type_hash};
use thiserror::Error;

use crate::bag::{self, BagTopic};
use destination::Destination;
pub use destination::{bag_folder, may_be_named};
pub use queue::{RecorderQueue, RunRecorder};
use sink::Sink;
pub use sink::Store;

/// Sim time per chunk. Long chunks compress better, but a full disk costs the open one; what a
/// crash may cost does not depend on it.
const CHUNK_TICKS: u64 = 500;

/// Bytes of messages after which a chunk ends early, so that readers and provisional saves need
/// little memory and time.
const CHUNK_BYTES_MAX: usize = 1 << 20;

/// The program that a recording names; its version follows.
pub(crate) const LIBRARY: &str = "maes sim_server";

/// Keys of the metadata of channels, as rosbag2 writes them.
pub(crate) const QOS_KEY: &str = "offered_qos_profiles";
pub(crate) const TYPE_HASH_KEY: &str = "topic_type_hash";

/// Provisional saves for each sync to the disk. The session saves twice a second, so that a power
/// failure costs about ten seconds.
const SAVES_PER_SYNC: u32 = 20;

/// Why a recording could not be written.
#[derive(Debug, Error)]
pub enum RecordError {
    /// The file may not be replaced, or is none.
    #[error("recording {file}: {source}")]
    Destination { file: String, source: std::io::Error },
    /// The file cannot be created or written.
    #[error("recording {file}: {source}")]
    File { file: String, source: std::io::Error },
    /// The MCAP writer refuses.
    #[error("recording {file}: {source}")]
    Mcap { file: String, source: mcap::McapError },
}

/// An attachment of a recording.
#[derive(Debug, Clone, Copy)]
pub struct Document<'a> {
    /// Name of the attachment.
    pub name: &'a str,
    pub media_type: &'a str,
    pub data: &'a [u8],
}

/// A recording being written.
pub struct Recorder {
    /// The file as the user names it.
    file: PathBuf,
    /// Its names; `None` for a recording that is no file.
    destination: Option<Destination>,
    /// Provisional saves since the last sync.
    saves: u32,
    /// Whether something was written since then.
    is_unsynced: bool,
    is_published: bool,
    sink: Sink,
    writer: Writer<Sink>,
    channels: Vec<RecordedTopic>,
    /// The ticks of the first and the latest message.
    ticks: Option<(Tick, Tick)>,
    channel_of_topic: BTreeMap<String, usize>,
    /// Channels that the writer knows: later ones are added with the open chunk.
    channels_known: usize,
    open: OpenChunk,
}

/// A topic of a recording.
struct RecordedTopic {
    topic: Topic,
    /// Its schema, which every provisional save repeats.
    definition: String,
    /// Number of its messages.
    messages: u64,
}

/// Messages of the open chunk.
#[derive(Debug, Default)]
struct OpenChunk {
    /// Channel, tick, and end of the message in `bytes`.
    messages: Vec<(usize, Tick, usize)>,
    bytes: Vec<u8>,
    /// Messages that have been saved provisionally.
    saved: usize,
}

impl Recorder {
    /// Creates a recording with its documents (scenario, map), under a temporary name.
    ///
    /// # Errors
    /// See [`check_destination`]; also if the file cannot be created or written; then there is
    /// none.
    pub fn create(file: &Path, documents: &[Document<'_>]) -> Result<Self, RecordError> {
        let (destination, handle) = Destination::create(file).map_err(|source| destination_error(file, source))?;
        let mut recorder = Self::with_sink(file, Sink::new(handle));
        recorder.destination = Some(destination);
        recorder.attach(documents)?;
        Ok(recorder)
    }

    /// Creates a recording with its documents in a file that is no file of the system; errors call
    /// it `name`.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn create_in(
        store: impl Store + 'static,
        name: &Path,
        documents: &[Document<'_>],
    ) -> Result<Self, RecordError> {
        let mut recorder = Self::with_sink(name, Sink::new(store));
        recorder.attach(documents)?;
        Ok(recorder)
    }

    fn with_sink(file: &Path, sink: Sink) -> Self {
        let writer = open_writer(sink.clone()).expect("memory can be written");
        Self {
            file: file.to_owned(),
            destination: None,
            saves: 0,
            is_unsynced: false,
            is_published: false,
            sink,
            writer,
            channels: Vec::new(),
            ticks: None,
            channel_of_topic: BTreeMap::new(),
            channels_known: 0,
            open: OpenChunk::default(),
        }
    }

    fn attach(&mut self, documents: &[Document<'_>]) -> Result<(), RecordError> {
        attach(&mut self.writer, documents).map_err(|source| self.mcap_error(source))
    }

    /// Takes the final name, replacing an older recording.
    ///
    /// # Errors
    /// If the file cannot be synced or renamed, or something else has taken its place.
    pub fn publish(&mut self) -> Result<(), RecordError> {
        if std::mem::replace(&mut self.is_published, true) {
            return Ok(());
        }
        // A power failure must not leave a new name without content.
        self.sync()?;
        self.sink.publish().map_err(|source| self.file_error(source))?;
        let published = self.destination.as_mut().map_or(Ok(()), Destination::publish);
        published.map_err(|source| destination_error(&self.file, source))
    }

    fn sync(&mut self) -> Result<(), RecordError> {
        self.sink.sync().map_err(|source| self.file_error(source))?;
        (self.saves, self.is_unsynced) = (0, false);
        Ok(())
    }

    /// Adds a message, as CDR with its encapsulation header.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write(&mut self, topic: &Topic, tick: Tick, cdr: &[u8]) -> Result<(), RecordError> {
        if self.open.is_ended_by(tick, cdr.len()) {
            self.end_chunk()?;
        }
        let channel = match self.channel_of_topic.get(&topic.name) {
            Some(&channel) => channel,
            None => {
                let channel = self.channels.len();
                let definition = schema::text(topic.message);
                self.channels.push(RecordedTopic { topic: topic.clone(), definition, messages: 0 });
                self.channel_of_topic.insert(topic.name.clone(), channel);
                channel
            }
        };
        self.open.push(channel, tick, cdr);
        self.channels[channel].messages += 1;
        let first = self.ticks.map_or(tick, |(first, _)| first);
        self.ticks = Some((first, tick));
        Ok(())
    }

    /// Makes everything written so far readable, without ending the chunk, and syncs it to the disk
    /// every `SAVES_PER_SYNC` calls. Call it regularly in wall time; it changes no byte of the
    /// finished file.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn save_provisionally(&mut self) -> Result<(), RecordError> {
        if self.open.messages.len() != self.open.saved {
            let chunk = self.provisional_chunk().map_err(|source| self.mcap_error(source))?;
            self.sink.write_provisionally(&chunk).map_err(|source| self.file_error(source))?;
            self.open.saved = self.open.messages.len();
            self.is_unsynced = true;
        }
        self.saves = self.saves.saturating_add(1);
        if self.is_unsynced && self.saves >= SAVES_PER_SYNC { self.sync() } else { Ok(()) }
    }

    /// Ends the recording.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn finish(mut self) -> Result<(), RecordError> {
        self.end_chunk()?;
        let finished = self.writer.finish();
        finished.map_err(|source| self.mcap_error(source))?;
        self.sync()?;
        self.publish()?;
        let Some(destination) = &self.destination else { return Ok(()) };
        let written = destination.write_metadata(|name| self.metadata(name));
        written.map_err(|source| self.file_error(source))
    }

    /// The metadata of a rosbag2 bag with this recording under `file_name`.
    fn metadata(&self, file_name: &str) -> String {
        let mut topics: Vec<BagTopic> = self
            .channels
            .iter()
            .map(|RecordedTopic { topic, messages, .. }| BagTopic {
                name: topic.name.clone(),
                type_name: topic.message.to_string(),
                offered_qos: topic.qos.offered_qos_profiles(),
                type_hash: type_hash::of(topic.message),
                messages: *messages,
            })
            .collect();
        topics.sort_by(|one, other| one.name.cmp(&other.name));
        let (first, last) = self.ticks.unwrap_or_default();
        bag::text(&topics, first.time_ns()..=last.time_ns(), file_name)
    }

    fn end_chunk(&mut self) -> Result<(), RecordError> {
        let open = std::mem::take(&mut self.open);
        let ended =
            open.write(&mut self.writer, &self.channels, self.channels_known).and_then(|()| self.writer.flush());
        self.channels_known = self.channels.len();
        self.is_unsynced = true;
        ended.map_err(|source| self.mcap_error(source))
    }

    /// The records of the open chunk as they would stand in a file. They repeat all channels, so
    /// that they can be read whatever precedes them.
    fn provisional_chunk(&self) -> McapResult<Vec<u8>> {
        let mut bare = open_writer(Cursor::new(Vec::new()))?;
        bare.flush()?;
        let bytes_before = bare.into_inner().into_inner().len();

        let mut writer = open_writer(Cursor::new(Vec::new()))?;
        self.open.write(&mut writer, &self.channels, 0)?;
        writer.flush()?;
        let mut bytes = writer.into_inner().into_inner();
        bytes.drain(..bytes_before);
        Ok(bytes)
    }

    fn mcap_error(&self, source: mcap::McapError) -> RecordError {
        record_error(&self.file, source)
    }

    fn file_error(&self, source: std::io::Error) -> RecordError {
        file_error(&self.file, source)
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        // The writer writes an end record when it is dropped, which an unfinished recording must
        // not have.
        self.sink.seal();
    }
}

/// Whether a recording may be written to `file`: to a new or empty file, or in place of a
/// recording. Call it before a run is prepared.
///
/// # Errors
/// [`RecordError::Destination`] if not.
pub fn check_destination(file: &Path) -> Result<(), RecordError> {
    destination::check(file).map_err(|source| destination_error(file, source))
}

impl OpenChunk {
    /// Whether a message belongs to the next chunk.
    fn is_ended_by(&self, tick: Tick, bytes: usize) -> bool {
        self.messages.first().is_some_and(|&(_, first, _)| {
            tick.0 / CHUNK_TICKS != first.0 / CHUNK_TICKS || self.bytes.len() + bytes > CHUNK_BYTES_MAX
        })
    }

    fn push(&mut self, channel: usize, tick: Tick, cdr: &[u8]) {
        self.bytes.extend_from_slice(cdr);
        self.messages.push((channel, tick, self.bytes.len()));
    }

    /// Writes the messages, after the channels from index `known` on.
    fn write<W: Write + Seek>(
        &self,
        writer: &mut Writer<W>,
        channels: &[RecordedTopic],
        known: usize,
    ) -> McapResult<()> {
        for (number, RecordedTopic { topic, definition, .. }) in channels.iter().enumerate().skip(known) {
            let id = add_defined_channel(writer, topic, definition)?;
            assert_eq!(id, channel_id(number), "channels are numbered in order");
        }
        let mut start = 0;
        for &(channel, tick, end) in &self.messages {
            let header = MessageHeader {
                channel_id: channel_id(channel),
                sequence: 0,
                log_time: tick.time_ns(),
                publish_time: tick.time_ns(),
            };
            writer.write_to_known_channel(&header, &self.bytes[start..end])?;
            start = end;
        }
        Ok(())
    }
}

fn file_error(file: &Path, source: std::io::Error) -> RecordError {
    RecordError::File { file: file.display().to_string(), source }
}

fn destination_error(file: &Path, source: std::io::Error) -> RecordError {
    if source.kind() == ErrorKind::InvalidInput {
        return RecordError::Destination { file: file.display().to_string(), source };
    }
    file_error(file, source)
}

/// The writer's error, or the system's if the writer only passes it on.
fn record_error(file: &Path, source: mcap::McapError) -> RecordError {
    match source {
        mcap::McapError::Io(source) => file_error(file, source),
        source => RecordError::Mcap { file: file.display().to_string(), source },
    }
}

fn open_writer<W: Write + Seek>(stream: W) -> McapResult<Writer<W>> {
    // The recorder ends chunks; compression stays on this thread.
    options().compression(Some(Compression::Zstd)).chunk_size(None).compression_threads(0).create(stream)
}

/// Writer options of recordings and live streams.
pub(crate) fn options() -> WriteOptions {
    // Made once, because making them counts the processors.
    static OPTIONS: LazyLock<WriteOptions> = LazyLock::new(|| {
        WriteOptions::new().profile("ros2").library(format!("{LIBRARY} {}", env!("CARGO_PKG_VERSION")))
    });
    OPTIONS.clone()
}

/// Attaches documents to a new file.
pub(crate) fn attach<W: Write + Seek>(writer: &mut Writer<W>, documents: &[Document<'_>]) -> McapResult<()> {
    for document in documents {
        writer.attach(&Attachment {
            log_time: 0,
            create_time: 0,
            name: document.name.to_owned(),
            media_type: document.media_type.to_owned(),
            data: Cow::Borrowed(document.data),
        })?;
    }
    writer.flush()
}

/// Channel ids count from 1, in the order of their creation.
fn channel_id(number: usize) -> u16 {
    u16::try_from(number + 1).expect("a run has fewer than 65535 topics")
}

/// Adds the channel of a topic.
pub(crate) fn add_channel<W: Write + Seek>(writer: &mut Writer<W>, topic: &Topic) -> McapResult<u16> {
    add_defined_channel(writer, topic, &schema::text(topic.message))
}

fn add_defined_channel<W: Write + Seek>(writer: &mut Writer<W>, topic: &Topic, definition: &str) -> McapResult<u16> {
    let schema = writer.add_schema(&topic.message.to_string(), "ros2msg", definition.as_bytes())?;
    let metadata = BTreeMap::from([
        (QOS_KEY.to_owned(), topic.qos.offered_qos_profiles()),
        (TYPE_HASH_KEY.to_owned(), type_hash::of(topic.message)),
    ]);
    writer.add_channel(schema, &topic.name, "cdr", &metadata)
}

#[cfg(test)]
mod tests;
