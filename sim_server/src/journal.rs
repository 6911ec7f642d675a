//! Everything that a run writes down, as those who look on read it while it grows: a recording in the form of a stream.
//!
//! It is an MCAP file without chunks, so that it can be read up to its last message at any time: the same messages as in the
//! [recording](crate::recorder), in the same order, and the same attachments. It lies in a file that has no name and goes with the process.
//!
//! Invariants: whoever reads never makes the run wait, and reads at its own pace; what has been read once never changes; that the
//! journal cannot be written is told to those who read it, and is nothing to the run.
//!
//! This module knows no network: `viewing` hands the bytes out.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, Write};
use std::os::unix::fs::FileExt;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use mcap::records::MessageHeader;
use mcap::write::NoSeek;
use mcap::{McapResult, Writer};
use msgs::ids::Tick;
use msgs::topics::Topic;

use crate::recorder::{self, Document};
use crate::wall_clock::now;

/// Wall time for which messages are kept back, so that they go to the file many at a time.
const FLUSH_PERIOD: Duration = Duration::from_millis(20);

/// Bytes that are kept back at the most.
const FLUSH_BYTES: usize = 1 << 16;

/// The end at which a run writes. Whoever has read everything is told so once this is dropped.
pub struct Journal {
    writer: Writer<NoSeek<Tail>>,
    channel_of_topic: BTreeMap<String, u16>,
    shared: Arc<Shared>,
    flushed: Instant,
    unflushed: usize,
}

/// The end at which others read; clones read the same.
#[derive(Clone)]
pub struct JournalReader(Arc<Shared>);

/// What a reader gets.
#[derive(Debug, PartialEq, Eq)]
pub enum Page {
    /// Bytes; none if there is nothing more yet.
    Bytes(Vec<u8>),
    /// The run has ended, and all was read.
    End,
}

struct Shared {
    file: File,
    length: AtomicU64,
    has_ended: AtomicBool,
    /// Why nothing more can be written.
    failure: Mutex<Option<String>>,
}

/// Where the MCAP writer writes to.
struct Tail {
    unflushed: Vec<u8>,
    shared: Arc<Shared>,
}

impl Journal {
    /// Begins a journal with its documents (scenario, map).
    ///
    /// # Errors
    /// If no file can be made for it.
    pub fn begin(documents: &[Document<'_>]) -> io::Result<Self> {
        let shared = Arc::new(Shared {
            file: tempfile::tempfile()?,
            length: AtomicU64::new(0),
            has_ended: AtomicBool::new(false),
            failure: Mutex::new(None),
        });
        let tail = Tail { unflushed: Vec::new(), shared: Arc::clone(&shared) };
        let writer = begin(tail, documents).map_err(io::Error::other)?;
        Ok(Self { writer, channel_of_topic: BTreeMap::new(), shared, flushed: now(), unflushed: 0 })
    }

    /// A way to read it.
    #[must_use]
    pub fn reader(&self) -> JournalReader {
        JournalReader(Arc::clone(&self.shared))
    }

    /// Adds a message, as CDR with its encapsulation header.
    pub fn write(&mut self, topic: &Topic, tick: Tick, cdr: &[u8]) {
        if self.shared.has_failed() {
            return;
        }
        let written = self.put(topic, tick, cdr);
        self.shared.unless_failed(written);
        self.unflushed += cdr.len();
        if self.unflushed >= FLUSH_BYTES {
            self.flush();
        } else {
            self.flush_now_and_then();
        }
    }

    /// Lets others read what there is if it is time to. To be called while the run waits, too.
    pub fn flush_now_and_then(&mut self) {
        if self.unflushed > 0 && self.flushed.elapsed() >= FLUSH_PERIOD {
            self.flush();
        }
    }

    fn flush(&mut self) {
        (self.flushed, self.unflushed) = (now(), 0);
        let flushed = self.writer.flush();
        self.shared.unless_failed(flushed);
    }

    fn put(&mut self, topic: &Topic, tick: Tick, cdr: &[u8]) -> McapResult<()> {
        let channel_id = match self.channel_of_topic.get(&topic.name) {
            Some(&channel) => channel,
            None => {
                let channel = recorder::announce(&mut self.writer, topic)?;
                self.channel_of_topic.insert(topic.name.clone(), channel);
                channel
            }
        };
        let time_ns = tick.time_ns();
        let header = MessageHeader { channel_id, sequence: 0, log_time: time_ns, publish_time: time_ns };
        self.writer.write_to_known_channel(&header, cdr)
    }
}

impl Drop for Tail {
    /// The writer has come to its end. Also of a run that was given up there is nothing more to come.
    fn drop(&mut self) {
        let flushed = self.flush();
        self.shared.unless_failed(flushed.map_err(mcap::McapError::Io));
        self.shared.has_ended.store(true, Ordering::Release);
    }
}

impl JournalReader {
    /// What lies from `offset` on, `bytes_max` at the most.
    ///
    /// # Errors
    /// If it lies beyond the end, cannot be read, or could not be written; the text is for people.
    pub fn read(&self, offset: u64, bytes_max: usize) -> Result<Page, String> {
        let shared = &self.0;
        // In this order: what was written before the end is there once the end is seen.
        let has_ended = shared.has_ended.load(Ordering::Acquire);
        let length = shared.length.load(Ordering::Acquire);
        let left = length.checked_sub(offset).ok_or_else(|| format!("offset {offset}: expected 0 to {length}"))?;
        if left == 0 {
            if let Some(failure) = &*shared.failure.lock().unwrap_or_else(PoisonError::into_inner) {
                return Err(format!("the server could not keep what comes next: {failure}"));
            }
            return Ok(if has_ended { Page::End } else { Page::Bytes(Vec::new()) });
        }
        let mut bytes = vec![0; usize::try_from(left).map_or(bytes_max, |left| left.min(bytes_max))];
        shared.file.read_exact_at(&mut bytes, offset).map_err(|error| error.to_string())?;
        Ok(Page::Bytes(bytes))
    }
}

impl Shared {
    fn has_failed(&self) -> bool {
        self.failure.lock().unwrap_or_else(PoisonError::into_inner).is_some()
    }

    fn unless_failed(&self, done: McapResult<()>) {
        if let Err(error) = done {
            self.failure.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error.to_string());
        }
    }
}

impl Write for Tail {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.unflushed.extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        let length = self.shared.length.load(Ordering::Relaxed);
        self.shared.file.write_all_at(&self.unflushed, length)?;
        self.shared.length.store(length + self.unflushed.len() as u64, Ordering::Release);
        self.unflushed.clear();
        Ok(())
    }
}

fn begin(tail: Tail, documents: &[Document<'_>]) -> McapResult<Writer<NoSeek<Tail>>> {
    let options = recorder::options().use_chunks(false).compression(None).disable_seeking(true);
    let mut writer = options.create(NoSeek::new(tail))?;
    recorder::attach(&mut writer, documents)?;
    Ok(writer)
}

#[cfg(test)]
mod tests {
    use msgs::{cdr, rosgraph_msgs::Clock, topics};

    use super::*;

    fn read(reader: &JournalReader, offset: usize) -> Page {
        reader.read(offset as u64, 1000).unwrap()
    }

    /// Everything there is, a few bytes at a time.
    fn all(reader: &JournalReader) -> Vec<u8> {
        let mut bytes = Vec::new();
        loop {
            match reader.read(bytes.len() as u64, 7).unwrap() {
                Page::Bytes(more) if more.is_empty() => panic!("it has ended"),
                Page::Bytes(more) => bytes.extend(more),
                Page::End => return bytes,
            }
        }
    }

    #[test]
    fn it_can_be_read_while_it_grows_and_is_a_recording_in_the_end() {
        let document = Document { name: "scenario.toml", media_type: "text/plain", data: b"seed = 1" };
        let mut journal = Journal::begin(&[document]).unwrap();
        let reader = journal.reader();
        let Page::Bytes(first) = read(&reader, 0) else { panic!("it has begun") };
        assert!(first.windows(8).any(|bytes| bytes == b"seed = 1"));
        assert_eq!(read(&reader, first.len()), Page::Bytes(Vec::new()));
        for tick in 0..3 {
            journal.write(&topics::clock(), Tick(tick), &cdr::encode(&Clock { clock: Tick(tick).into() }));
        }
        journal.flush();
        let Page::Bytes(second) = read(&reader, first.len()) else { panic!("it goes on") };
        assert!(!second.is_empty());
        drop(journal);
        let bytes = all(&reader);
        assert!(bytes.starts_with(&[first, second].concat()));
        let ticks: Vec<u64> =
            mcap::MessageStream::new(&bytes).unwrap().map(|message| message.unwrap().log_time).collect();
        assert_eq!(ticks, [0, 20_000_000, 40_000_000]);
        let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
        assert_eq!((summary.channels.len(), summary.attachment_indexes.len()), (1, 1));
        assert!(reader.read(bytes.len() as u64 + 1, 10).is_err(), "nothing lies beyond the end");
    }

    #[test]
    fn one_that_is_given_up_has_an_end_for_its_readers() {
        let journal = Journal::begin(&[]).unwrap();
        let reader = journal.reader();
        drop(journal);
        assert!(!all(&reader).is_empty());
    }
}
