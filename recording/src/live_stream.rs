//! The live MCAP stream of a run: its recording as a stream that observers read while it grows.
//!
//! It is an MCAP file without chunks, readable up to its last message at any time: the messages of
//! the [recording](crate::recorder), in the same order, and the same attachments. Its file is
//! unnamed and disappears with the process.
//!
//! Invariants: readers never delay the run and read at their own pace; bytes once read never
//! change; a write error ends the stream for its readers and does not concern the run.
//!
//! This module knows no network: the Foxglove server serves the bytes.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, Write};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use mcap::records::MessageHeader;
use mcap::write::NoSeek;
use mcap::{McapResult, Writer};
use msgs::ids::Tick;
use msgs::topics::Topic;

use crate::recorder::{self, Document};
use system::os;
use system::wall_clock::now;

/// Maximum wall time for which messages are buffered.
const FLUSH_PERIOD: Duration = Duration::from_millis(20);

/// Maximum bytes that are buffered.
const FLUSH_BYTES: usize = 1 << 16;

/// The writing end. Dropping it ends the stream.
pub struct LiveStream {
    writer: Writer<NoSeek<StreamFile>>,
    channel_of_topic: BTreeMap<String, u16>,
    shared: Arc<StreamState>,
    last_flush: Instant,
    unflushed_bytes: usize,
}

/// The reading end; clones read the same stream.
#[derive(Clone)]
pub struct LiveStreamReader(Arc<StreamState>);

/// The result of a read.
#[derive(Debug, PartialEq, Eq)]
pub enum StreamChunk {
    /// Bytes; none if there are no more yet.
    Bytes(Vec<u8>),
    /// The run has ended and all bytes were read.
    End,
}

struct StreamState {
    file: File,
    length: AtomicU64,
    has_ended: AtomicBool,
    /// Why writing failed.
    failure: Mutex<Option<String>>,
}

/// The buffered sink of the MCAP writer.
struct StreamFile {
    unflushed: Vec<u8>,
    shared: Arc<StreamState>,
}

impl LiveStream {
    /// Creates a stream with its documents (scenario, map).
    ///
    /// # Errors
    /// If its file cannot be created.
    pub fn create(documents: &[Document<'_>]) -> io::Result<Self> {
        let shared = Arc::new(StreamState {
            file: tempfile::tempfile()?,
            length: AtomicU64::new(0),
            has_ended: AtomicBool::new(false),
            failure: Mutex::new(None),
        });
        let file = StreamFile { unflushed: Vec::new(), shared: Arc::clone(&shared) };
        let writer = open_writer(file, documents).map_err(io::Error::other)?;
        Ok(Self { writer, channel_of_topic: BTreeMap::new(), shared, last_flush: now(), unflushed_bytes: 0 })
    }

    /// A reader.
    #[must_use]
    pub fn reader(&self) -> LiveStreamReader {
        LiveStreamReader(Arc::clone(&self.shared))
    }

    /// Appends a message, CDR with its encapsulation header.
    pub fn write(&mut self, topic: &Topic, tick: Tick, cdr: &[u8]) {
        if self.shared.has_failed() {
            return;
        }
        let written = self.try_write(topic, tick, cdr);
        self.shared.note_failure(written);
        self.unflushed_bytes += cdr.len();
        if self.unflushed_bytes >= FLUSH_BYTES {
            self.flush();
        } else {
            self.flush_if_due();
        }
    }

    /// Makes buffered messages readable if it is time to. Call it also while the run waits.
    pub fn flush_if_due(&mut self) {
        if self.unflushed_bytes > 0 && self.last_flush.elapsed() >= FLUSH_PERIOD {
            self.flush();
        }
    }

    fn flush(&mut self) {
        (self.last_flush, self.unflushed_bytes) = (now(), 0);
        let flushed = self.writer.flush();
        self.shared.note_failure(flushed);
    }

    fn try_write(&mut self, topic: &Topic, tick: Tick, cdr: &[u8]) -> McapResult<()> {
        let channel_id = match self.channel_of_topic.get(&topic.name) {
            Some(&channel) => channel,
            None => {
                let channel = recorder::add_channel(&mut self.writer, topic)?;
                self.channel_of_topic.insert(topic.name.clone(), channel);
                channel
            }
        };
        let time_ns = tick.time_ns();
        let header = MessageHeader { channel_id, sequence: 0, log_time: time_ns, publish_time: time_ns };
        self.writer.write_to_known_channel(&header, cdr)
    }
}

impl Drop for StreamFile {
    /// Ends the stream, also that of an aborted run.
    fn drop(&mut self) {
        let flushed = self.flush();
        self.shared.note_failure(flushed.map_err(mcap::McapError::Io));
        self.shared.has_ended.store(true, Ordering::Release);
    }
}

impl LiveStreamReader {
    /// Reads up to `bytes_max` bytes from `offset` on.
    ///
    /// # Errors
    /// If the offset is beyond the end, or reading or writing has failed.
    pub fn read(&self, offset: u64, bytes_max: usize) -> Result<StreamChunk, String> {
        let shared = &self.0;
        // In this order: once the end is seen, so is everything written before it.
        let has_ended = shared.has_ended.load(Ordering::Acquire);
        let length = shared.length.load(Ordering::Acquire);
        let left = length.checked_sub(offset).ok_or_else(|| format!("offset {offset}: expected 0 to {length}"))?;
        if left == 0 {
            if let Some(failure) = &*shared.failure.lock().unwrap_or_else(PoisonError::into_inner) {
                return Err(format!("the live stream ends here, because its file could not be written: {failure}"));
            }
            return Ok(if has_ended { StreamChunk::End } else { StreamChunk::Bytes(Vec::new()) });
        }
        let mut bytes = vec![0; usize::try_from(left).map_or(bytes_max, |left| left.min(bytes_max))];
        os::read_exact_at(&shared.file, &mut bytes, offset).map_err(|error| error.to_string())?;
        Ok(StreamChunk::Bytes(bytes))
    }
}

impl StreamState {
    fn has_failed(&self) -> bool {
        self.failure.lock().unwrap_or_else(PoisonError::into_inner).is_some()
    }

    fn note_failure(&self, done: McapResult<()>) {
        if let Err(error) = done {
            self.failure.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error.to_string());
        }
    }
}

impl Write for StreamFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.unflushed.extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        let length = self.shared.length.load(Ordering::Relaxed);
        os::write_all_at(&self.shared.file, &self.unflushed, length)?;
        self.shared.length.store(length + self.unflushed.len() as u64, Ordering::Release);
        self.unflushed.clear();
        Ok(())
    }
}

fn open_writer(file: StreamFile, documents: &[Document<'_>]) -> McapResult<Writer<NoSeek<StreamFile>>> {
    let options = recorder::options().use_chunks(false).compression(None).disable_seeking(true);
    let mut writer = options.create(NoSeek::new(file))?;
    recorder::attach(&mut writer, documents)?;
    Ok(writer)
}

#[cfg(test)]
mod tests {
    use msgs::{cdr, rosgraph_msgs::Clock, topics};

    use super::*;

    fn read_chunk(reader: &LiveStreamReader, offset: usize) -> StreamChunk {
        reader.read(offset as u64, 1000).unwrap()
    }

    /// The whole stream, a few bytes at a time.
    fn read_all(reader: &LiveStreamReader) -> Vec<u8> {
        let mut bytes = Vec::new();
        loop {
            match reader.read(bytes.len() as u64, 7).unwrap() {
                StreamChunk::Bytes(more) if more.is_empty() => panic!("the stream has ended"),
                StreamChunk::Bytes(more) => bytes.extend(more),
                StreamChunk::End => return bytes,
            }
        }
    }

    #[test]
    fn stream_is_readable_while_it_grows_and_becomes_a_recording() {
        let document = Document { name: "scenario.toml", media_type: "text/plain", data: b"seed = 1" };
        let mut stream = LiveStream::create(&[document]).unwrap();
        let reader = stream.reader();
        let StreamChunk::Bytes(first) = read_chunk(&reader, 0) else { panic!("the stream has begun") };
        assert!(first.windows(8).any(|bytes| bytes == b"seed = 1"));
        assert_eq!(read_chunk(&reader, first.len()), StreamChunk::Bytes(Vec::new()));
        for tick in 0..3 {
            stream.write(&topics::clock(), Tick(tick), &cdr::encode(&Clock { clock: Tick(tick).into() }));
        }
        stream.flush();
        let StreamChunk::Bytes(second) = read_chunk(&reader, first.len()) else { panic!("the stream continues") };
        assert!(!second.is_empty());
        drop(stream);
        let bytes = read_all(&reader);
        assert!(bytes.starts_with(&[first, second].concat()));
        let ticks: Vec<u64> =
            mcap::MessageStream::new(&bytes).unwrap().map(|message| message.unwrap().log_time).collect();
        assert_eq!(ticks, [0, 20_000_000, 40_000_000]);
        let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
        assert_eq!((summary.channels.len(), summary.attachment_indexes.len()), (1, 1));
        assert!(reader.read(bytes.len() as u64 + 1, 10).is_err(), "nothing lies beyond the end");
    }

    #[test]
    fn dropped_stream_ends_for_its_readers() {
        let stream = LiveStream::create(&[]).unwrap();
        let reader = stream.reader();
        drop(stream);
        assert!(!read_all(&reader).is_empty());
    }
}
