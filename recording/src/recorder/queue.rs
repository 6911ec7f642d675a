//! A recorder on a thread of its own: the loop of a run hands over messages, and the thread
//! compresses and writes them.
//!
//! Invariants: the file is that of a [`Recorder`] with the same calls in the same order; the queue
//! is bounded, so a disk that is slower than the run slows the run; the first error ends the
//! recording, and the next call returns it. A recording that is dropped unfinished is aborted, as a
//! [`Recorder`] is, and its file is settled once the drop returns.
//!
//! [`RecorderQueue::save_provisionally`] only orders a save, so what a kill of the process costs is
//! what it cost before plus what the thread has not done yet. All other calls that promise
//! something about the file wait for it.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::JoinHandle;

use msgs::ids::Tick;
use msgs::topics::Topic;

use super::{Document, RecordError, Recorder, file_error};

/// The recorder of a run.
pub enum RunRecorder {
    /// Written by the thread of the run.
    Direct(Box<Recorder>),
    Queued(RecorderQueue),
}

impl From<Recorder> for RunRecorder {
    fn from(recorder: Recorder) -> Self {
        Self::Direct(Box::new(recorder))
    }
}

impl RunRecorder {
    /// See [`Recorder::write`].
    ///
    /// # Errors
    /// If this or an earlier message cannot be written.
    pub fn write(&mut self, topic: &Topic, tick: Tick, cdr: &[u8]) -> Result<(), RecordError> {
        match self {
            Self::Direct(recorder) => recorder.write(topic, tick, cdr),
            Self::Queued(recorder) => recorder.write(topic, tick, cdr),
        }
    }

    /// See [`Recorder::save_provisionally`] and [`RecorderQueue::save_provisionally`].
    ///
    /// # Errors
    /// If this or an earlier call fails.
    pub fn save_provisionally(&mut self) -> Result<(), RecordError> {
        match self {
            Self::Direct(recorder) => recorder.save_provisionally(),
            Self::Queued(recorder) => recorder.save_provisionally(),
        }
    }

    /// See [`Recorder::publish`].
    ///
    /// # Errors
    /// If this or an earlier call fails.
    pub fn publish(&mut self) -> Result<(), RecordError> {
        match self {
            Self::Direct(recorder) => recorder.publish(),
            Self::Queued(recorder) => recorder.publish(),
        }
    }

    /// See [`Recorder::finish`].
    ///
    /// # Errors
    /// If this or an earlier call fails.
    pub fn finish(self) -> Result<(), RecordError> {
        match self {
            Self::Direct(recorder) => recorder.finish(),
            Self::Queued(recorder) => recorder.finish(),
        }
    }
}

/// Bytes of messages that are handed over at once, so that the thread is seldom woken.
const BATCH_BYTES: usize = 1 << 16;

/// Most jobs that wait for the thread: some megabytes of messages.
const JOBS_MAX: usize = 64;

/// A recorder on a thread of its own.
pub struct RecorderQueue {
    file: PathBuf,
    /// `None` once the recording has ended.
    thread: Option<Thread>,
    number_of_topic: BTreeMap<String, usize>,
    batch: Batch,
}

struct Thread {
    jobs: SyncSender<Job>,
    handle: JoinHandle<Result<(), RecordError>>,
}

/// What the thread is to do, in order.
enum Job {
    Write(Batch),
    Save,
    /// Answers when it is done; an error ends the thread, and with it the answer.
    Publish(SyncSender<()>),
    Finish,
}

/// Messages with the topics that are used for the first time.
#[derive(Default)]
struct Batch {
    new_topics: Vec<Topic>,
    /// Number of the topic, tick, and end of the message in `bytes`.
    messages: Vec<(usize, Tick, usize)>,
    bytes: Vec<u8>,
}

impl RecorderQueue {
    /// Creates a recording, see [`Recorder::create`].
    ///
    /// # Errors
    /// See [`Recorder::create`]; also if the system has no thread left.
    pub fn create(file: &Path, documents: &[Document<'_>]) -> Result<Self, RecordError> {
        let (jobs, queue) = sync_channel(JOBS_MAX);
        let (created, is_created) = sync_channel(0);
        let documents: Vec<(String, String, Vec<u8>)> = documents
            .iter()
            .map(|document| (document.name.to_owned(), document.media_type.to_owned(), document.data.to_owned()))
            .collect();
        let name = file.to_owned();
        let perform = move || {
            let documents: Vec<Document<'_>> =
                documents.iter().map(|(name, media_type, data)| Document { name, media_type, data }).collect();
            let recorder = Recorder::create(&name, &documents)?;
            // The creator waits for it, unless its thread has panicked.
            let _ = created.send(());
            perform_jobs(recorder, &queue)
        };
        let handle = std::thread::Builder::new()
            .name("recorder".to_owned())
            .spawn(perform)
            .map_err(|source| file_error(file, source))?;
        let mut recorder = Self {
            file: file.to_owned(),
            thread: Some(Thread { jobs, handle }),
            number_of_topic: BTreeMap::new(),
            batch: Batch::default(),
        };
        match is_created.recv() {
            Ok(()) => Ok(recorder),
            Err(_) => Err(recorder.failure()),
        }
    }

    /// Adds a message, as CDR with its encapsulation header.
    ///
    /// # Errors
    /// If an earlier job has failed.
    pub fn write(&mut self, topic: &Topic, tick: Tick, cdr: &[u8]) -> Result<(), RecordError> {
        let number = match self.number_of_topic.get(&topic.name) {
            Some(&number) => number,
            None => {
                let number = self.number_of_topic.len();
                self.number_of_topic.insert(topic.name.clone(), number);
                self.batch.new_topics.push(topic.clone());
                number
            }
        };
        self.batch.bytes.extend_from_slice(cdr);
        self.batch.messages.push((number, tick, self.batch.bytes.len()));
        if self.batch.bytes.len() >= BATCH_BYTES { self.hand_over() } else { Ok(()) }
    }

    /// Orders what [`Recorder::save_provisionally`] does, for everything written so far.
    ///
    /// # Errors
    /// If an earlier job has failed.
    pub fn save_provisionally(&mut self) -> Result<(), RecordError> {
        self.hand_over()?;
        self.send(Job::Save)
    }

    /// See [`Recorder::publish`].
    ///
    /// # Errors
    /// If that or an earlier job fails.
    pub fn publish(&mut self) -> Result<(), RecordError> {
        self.hand_over()?;
        let (done, is_done) = sync_channel(0);
        self.send(Job::Publish(done))?;
        is_done.recv().map_err(|_| self.failure())
    }

    /// See [`Recorder::finish`].
    ///
    /// # Errors
    /// If that or an earlier job fails.
    pub fn finish(mut self) -> Result<(), RecordError> {
        self.hand_over()?;
        self.send(Job::Finish)?;
        self.join()
    }

    fn hand_over(&mut self) -> Result<(), RecordError> {
        if self.batch.messages.is_empty() {
            return Ok(());
        }
        let batch = std::mem::take(&mut self.batch);
        self.send(Job::Write(batch))
    }

    fn send(&mut self, job: Job) -> Result<(), RecordError> {
        let is_sent = self.thread.as_ref().is_some_and(|thread| thread.jobs.send(job).is_ok());
        if is_sent { Ok(()) } else { Err(self.failure()) }
    }

    /// Why the thread has ended early.
    fn failure(&mut self) -> RecordError {
        match self.join() {
            Err(error) => error,
            Ok(()) => file_error(&self.file, std::io::Error::other("an earlier write has failed")),
        }
    }

    /// Waits for the end of the thread, which gets no more jobs.
    fn join(&mut self) -> Result<(), RecordError> {
        let Some(Thread { jobs, handle }) = self.thread.take() else { return Ok(()) };
        drop(jobs);
        handle.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    }
}

impl Drop for RecorderQueue {
    fn drop(&mut self) {
        if let Some(Thread { jobs, handle }) = self.thread.take() {
            drop(jobs);
            // An error has no receiver any more, and the thread has reported a panic itself.
            drop(handle.join());
        }
    }
}

/// Performs jobs until the recording is finished, a job fails, or no more can come, which aborts
/// the recording.
fn perform_jobs(mut recorder: Recorder, queue: &Receiver<Job>) -> Result<(), RecordError> {
    let mut topics = Vec::new();
    for job in queue {
        match job {
            Job::Write(Batch { new_topics, messages, bytes }) => {
                topics.extend(new_topics);
                let mut start = 0;
                for (number, tick, end) in messages {
                    recorder.write(&topics[number], tick, &bytes[start..end])?;
                    start = end;
                }
            }
            Job::Save => recorder.save_provisionally()?,
            Job::Publish(done) => {
                recorder.publish()?;
                // The receiver waits for it.
                let _ = done.send(());
            }
            Job::Finish => return recorder.finish(),
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::fs;

    use msgs::maes_msgs::Progress;
    use msgs::{cdr, topics};

    use super::*;

    const SCENARIO: Document<'_> = Document { name: "scenario.toml", media_type: "application/toml", data: b"a = 1\n" };

    fn messages() -> impl Iterator<Item = (Topic, Tick, Vec<u8>)> {
        (0..3000).map(|tick| {
            let progress = Progress { tick, explored_by: vec![0.25; 40], ..Progress::default() };
            let topic = if tick % 7 == 0 { topics::digest() } else { topics::progress() };
            (topic, Tick(tick), cdr::encode(&progress))
        })
    }

    #[test]
    fn file_is_that_of_a_recorder() {
        let folder = tempfile::tempdir().unwrap();
        let [direct, queued] = ["direct.mcap", "queued.mcap"].map(|name| folder.path().join(name));
        let mut recorder = Recorder::create(&direct, &[SCENARIO]).unwrap();
        messages().for_each(|(topic, tick, cdr)| recorder.write(&topic, tick, &cdr).unwrap());
        recorder.finish().unwrap();

        let mut queue = RecorderQueue::create(&queued, &[SCENARIO]).unwrap();
        queue.publish().unwrap();
        assert!(queued.exists(), "it has its name once it is published");
        for (topic, tick, cdr) in messages() {
            if tick.0.is_multiple_of(450) {
                queue.save_provisionally().unwrap();
            }
            queue.write(&topic, tick, &cdr).unwrap();
        }
        queue.finish().unwrap();
        assert_eq!(fs::read(&queued).unwrap(), fs::read(&direct).unwrap());
    }

    #[test]
    fn aborted_recording_leaves_no_file_once_it_is_dropped() {
        let folder = tempfile::tempdir().unwrap();
        let mut queue = RecorderQueue::create(&folder.path().join("a.mcap"), &[SCENARIO]).unwrap();
        messages().for_each(|(topic, tick, cdr)| queue.write(&topic, tick, &cdr).unwrap());
        drop(queue);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }

    #[test]
    fn errors_name_the_file() {
        let error = RecorderQueue::create(Path::new("/nowhere/a.mcap"), &[]).err().unwrap().to_string();
        assert!(error.contains("/nowhere/a.mcap"), "{error}");
    }

    #[test]
    fn first_error_is_returned_and_ends_the_recording() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.mcap");
        let mut queue = RecorderQueue::create(&file, &[SCENARIO]).unwrap();
        // Something else takes its place, which it may not replace.
        fs::create_dir(&file).unwrap();
        let error = queue.publish().unwrap_err().to_string();
        assert!(error.contains("a.mcap") && !error.contains("earlier"), "{error}");
        let mut written = messages().map(|(topic, tick, cdr)| queue.write(&topic, tick, &cdr));
        let error = written.find_map(Result::err).unwrap().to_string();
        assert!(error.ends_with("an earlier write has failed"), "{error}");
    }
}
