//! The reader of a recording that is still being written.
//!
//! Invariants: each message is returned once, in file order, and only when the file has all
//! messages of its tick; what is being overwritten at the moment of reading is left for the next
//! time.
//!
//! This module does not wait: the caller decides when to read again.

use std::fs::File;
use std::path::Path;
use std::sync::Arc;

use super::source::Source;
use super::{End, KnownChannels, Message, Messages, RecordingError};
use system::input_file;

/// A recording from its beginning to what has been read.
pub struct Follower {
    name: String,
    file: Arc<File>,
    /// Offset of the first chunk that may be overwritten: the open one.
    open_at: u64,
    /// Messages of it that have been read.
    read: usize,
    known: KnownChannels,
    /// Messages of the last tick, until the next one begins.
    of_last_tick: Vec<Message>,
    has_ended: bool,
}

impl Follower {
    /// Opens a file before its first message. It stays the same file if another one takes its name.
    ///
    /// # Errors
    /// If it cannot be opened.
    pub fn open(file: &Path) -> Result<Self, RecordingError> {
        let name = file.display().to_string();
        let file = input_file::open(file).map_err(|source| RecordingError::Read { file: name.clone(), source })?;
        Ok(Self {
            name,
            file: Arc::new(file),
            open_at: mcap::MAGIC.len() as u64,
            read: 0,
            known: KnownChannels::default(),
            of_last_tick: Vec::new(),
            has_ended: false,
        })
    }

    /// Whether the end of the recording has been read. That of a killed server has no end.
    #[must_use]
    pub fn has_ended(&self) -> bool {
        self.has_ended
    }

    /// The messages since the last call.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn read(&mut self) -> Result<Vec<Message>, RecordingError> {
        if self.has_ended {
            return Ok(Vec::new());
        }
        let source = Source::of_file(Arc::clone(&self.file));
        let source = source.map_err(|source| RecordingError::Read { file: self.name.clone(), source })?;
        let Some(new) = self.parse(&source) else { return Ok(Vec::new()) };
        let mut messages = std::mem::take(&mut self.of_last_tick);
        messages.extend(new);
        if !self.has_ended {
            let last = messages.last().map(Message::tick);
            let is_before = |message: &Message| Some(message.tick()) != last;
            let complete = messages.iter().rposition(is_before).map_or(0, |at| at + 1);
            self.of_last_tick = messages.split_off(complete);
        }
        Ok(messages)
    }

    /// The new messages; `None` if the file ends within a record, or is damaged by a chunk that is
    /// being overwritten. Then nothing counts as read.
    fn parse(&mut self, source: &Source) -> Option<Vec<Message>> {
        let mut messages = Messages::of_part(source, self.open_at, self.known.clone());
        let mut new: Vec<Message> = messages.by_ref().collect();
        let has_ended = match messages.end {
            Some(End::Whole) => true,
            Some(End::Missing) => false,
            _ => return None,
        };
        let of_file = new.len();
        if of_file < self.read {
            return None;
        }
        let (open_at, closed) = messages.last_chunk.unwrap_or((messages.frames.position(), of_file as u64));
        new.drain(..self.read);
        self.open_at = open_at;
        self.read = of_file - closed as usize;
        self.known = messages.known;
        self.has_ended = has_ended;
        Some(new)
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use msgs::ids::Tick;
    use msgs::maes_msgs::Progress;
    use msgs::{cdr, topics};

    use super::*;
    use crate::recorder::{Document, Recorder};
    use crate::{Recording, SCENARIO_ATTACHMENT};

    const SCENARIO: Document<'_> =
        Document { name: SCENARIO_ATTACHMENT, media_type: "application/toml", data: b"seed = 1\n" };

    /// Ticks in order, two messages each.
    fn write(recorder: &mut Recorder, ticks: std::ops::Range<u64>) {
        for tick in ticks {
            // Numbers that do not compress away.
            let explored_by =
                (0..40_u64).map(|number| f64::from_bits((0x3fe << 52) | ((tick * 40 + number) * 0x9e37_79b9)));
            let progress = Progress { tick, explored_by: explored_by.collect(), ..Progress::default() };
            recorder.write(&topics::progress(), Tick(tick), &cdr::encode(&progress)).unwrap();
            let topic = topics::command(msgs::ids::AgentId((tick / 300) as u32));
            recorder.write(&topic, Tick(tick), &cdr::encode(&progress)).unwrap();
        }
    }

    fn messages(file: &Path) -> Vec<Message> {
        Recording::open(file).unwrap().messages().collect()
    }

    #[test]
    fn each_message_is_read_once() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.mcap");
        let mut recorder = Recorder::create(&file, &[SCENARIO]).unwrap();
        recorder.publish().unwrap();
        let mut follower = Follower::open(&file).unwrap();
        assert_eq!(follower.read().unwrap(), []);
        let (mut begin, mut read) = (0, Vec::new());
        for end in [1_u64, 3, 3, 400, 499, 500, 501, 1730, 1731, 2600] {
            write(&mut recorder, begin..end);
            recorder.save_provisionally().unwrap();
            read.extend(follower.read().unwrap());
            assert_eq!(read.len() as u64, 2 * (end - 1), "all but those of the last tick");
            begin = end;
        }
        assert!(!follower.has_ended());
        recorder.finish().unwrap();
        read.extend(follower.read().unwrap());
        assert!(follower.has_ended());
        assert_eq!(read, messages(&file));
        assert_eq!(follower.read().unwrap(), []);
    }

    #[test]
    fn whole_recording_is_read_at_once() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.mcap");
        for ticks in [0..0, 0..1, 0..1200] {
            let mut recorder = Recorder::create(&file, &[SCENARIO]).unwrap();
            write(&mut recorder, ticks);
            recorder.finish().unwrap();
            let mut follower = Follower::open(&file).unwrap();
            assert_eq!(follower.read().unwrap(), messages(&file));
            assert!(follower.has_ended());
        }
    }

    #[test]
    fn half_written_chunks_are_left_for_later() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.mcap");
        let mut recorder = Recorder::create(&file, &[SCENARIO]).unwrap();
        recorder.publish().unwrap();
        let mut states = vec![fs::read(&file).unwrap()];
        for ticks in [0..2, 2..90, 90..480, 480..510] {
            write(&mut recorder, ticks);
            recorder.save_provisionally().unwrap();
            states.push(fs::read(&file).unwrap());
        }
        recorder.finish().unwrap();
        states.push(fs::read(&file).unwrap());
        let all = messages(&file);
        // The follower keeps the file that it has opened, so each state is written into it.
        let put = |bytes: &[u8]| fs::write(&file, bytes).unwrap();
        for pair in states.windows(2) {
            let (before, after) = (&pair[0], &pair[1]);
            for written in (0..after.len()).step_by(after.len() / 97 + 1) {
                put(before);
                let mut follower = Follower::open(&file).unwrap();
                let mut read = follower.read().unwrap();
                put(&[&after[..written], before.get(written..).unwrap_or_default()].concat());
                read.extend(follower.read().unwrap());
                assert!(all.starts_with(&read), "{written} bytes written");
                put(after);
                read.extend(follower.read().unwrap());
                put(&states[states.len() - 1]);
                read.extend(follower.read().unwrap());
                assert_eq!(read, all, "{written} bytes written");
                assert!(follower.has_ended());
            }
        }
    }
}
