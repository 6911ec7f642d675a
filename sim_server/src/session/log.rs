//! The log of a session: every message on its way to the digest, and to a recording or to a
//! checker.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use msgs::cdr;
use msgs::ids::{AgentId, Tick};
use msgs::maes_msgs::Command;
use msgs::topics::{self, Topic};
use serde::Serialize;

use recording::comparison::Checker;
use recording::live_stream::LiveStream;
use recording::recorder::{RecordError, RunRecorder};
use simulation::digest::Chain;
use simulation::visualisation::{VisualisationMessage, VisualisationTopic};

/// Wall time after which the open chunk of the recording is saved provisionally.
const SAVE_PERIOD: Duration = Duration::from_millis(500);

/// The kind of a message, which decides its topic.
#[derive(Debug, Clone, Copy)]
pub(super) enum EntryKind {
    Scenario,
    Progress,
    Digest,
    Result,
    Transforms,
    Intervention,
    MapChange,
    Join(AgentId),
    Observation(AgentId),
    Command(AgentId),
}

/// The recording sinks of a run.
#[derive(Default)]
pub struct RecordingSinks {
    /// The recording, if one is made.
    pub recorder: Option<RunRecorder>,
    /// The live stream, if observers can read one.
    pub live: Option<LiveStream>,
}

impl From<Option<RunRecorder>> for RecordingSinks {
    fn from(recorder: Option<RunRecorder>) -> Self {
        Self { recorder, live: None }
    }
}

/// The destination of messages besides the digest.
enum Sink<'s> {
    Null,
    File(RunRecorder),
    Checker(&'s mut dyn Checker),
}

/// The log of a session. Messages are encoded here, because the digest covers their bytes.
pub(super) struct SessionLog<'s> {
    sink: Sink<'s>,
    live: Option<LiveStream>,
    sim_topics: [Topic; 7],
    agent_topics: Vec<[Topic; 3]>,
    /// Topics of the recorded visualisation messages so far.
    view_topics: BTreeMap<VisualisationTopic, Topic>,
    bytes: Vec<u8>,
    saved: Instant,
}

impl<'s> SessionLog<'s> {
    /// The log of a run in this mode. Verification checks what is written instead of recording it.
    pub(super) fn new(sinks: RecordingSinks, checker: Option<&'s mut dyn Checker>, agents: u32, now: Instant) -> Self {
        let RecordingSinks { recorder, live } = sinks;
        let sink = match (checker, recorder) {
            (Some(checker), _) => Sink::Checker(checker),
            (None, Some(recorder)) => Sink::File(recorder),
            (None, None) => Sink::Null,
        };
        let of_agent = |agent| [topics::join(agent), topics::observation(agent), topics::command(agent)];
        Self {
            sink,
            live,
            sim_topics: [
                topics::scenario(),
                topics::progress(),
                topics::digest(),
                topics::result(),
                topics::tf(),
                topics::intervention(),
                topics::map_change(),
            ],
            agent_topics: (0..agents).map(AgentId).map(of_agent).collect(),
            view_topics: BTreeMap::new(),
            bytes: Vec::new(),
            saved: now,
        }
    }

    /// Whether messages have a destination besides the digest.
    pub(super) fn is_recording(&self) -> bool {
        self.live.is_some() || !matches!(self.sink, Sink::Null)
    }

    /// The checker of a run that is verified.
    pub(super) fn checker(&mut self) -> Option<&mut (dyn Checker + 's)> {
        match &mut self.sink {
            Sink::Checker(checker) => Some(*checker),
            Sink::Null | Sink::File(_) => None,
        }
    }

    /// Writes a message that the digest covers, of commands all but their stage.
    pub(super) fn write_digested<M: Serialize>(
        &mut self,
        kind: EntryKind,
        tick: Tick,
        message: &M,
        chain: &mut Chain,
    ) -> Result<(), RecordError> {
        self.encode(message);
        let left_out = if matches!(kind, EntryKind::Command(_)) { Command::UNDIGESTED_BYTES } else { 0 };
        chain.message(&self.bytes[..self.bytes.len() - left_out]);
        self.put(kind, tick)
    }

    /// Writes a message that only the recording holds.
    pub(super) fn write<M: Serialize>(&mut self, kind: EntryKind, tick: Tick, message: &M) -> Result<(), RecordError> {
        if self.is_recording() {
            self.encode(message);
            self.put(kind, tick)?;
        }
        Ok(())
    }

    /// Writes a visualisation message.
    pub(super) fn write_view(
        &mut self,
        view: VisualisationTopic,
        tick: Tick,
        picture: &VisualisationMessage,
    ) -> Result<(), RecordError> {
        self.encode(picture);
        let topic = self.view_topics.entry(view).or_insert_with(|| view.topic());
        let written = write(&mut self.live, &mut self.sink, topic, tick, &self.bytes);
        self.unless_failed(written)
    }

    /// See [`RunRecorder::publish`].
    pub(super) fn publish(&mut self) -> Result<(), RecordError> {
        let published = self.recorder().map_or(Ok(()), RunRecorder::publish);
        self.unless_failed(published)
    }

    /// Discards the recording; no file is left unless it is published.
    pub(super) fn discard(&mut self) {
        self.sink = Sink::Null;
    }

    /// Saves provisionally if it is due; also called while the session waits.
    pub(super) fn save_if_due(&mut self, now: Instant) -> Result<(), RecordError> {
        if let Some(live) = &mut self.live {
            live.flush_if_due();
        }
        if now.duration_since(self.saved) >= SAVE_PERIOD { self.save_provisionally(now) } else { Ok(()) }
    }

    /// See [`RunRecorder::save_provisionally`].
    pub(super) fn save_provisionally(&mut self, now: Instant) -> Result<(), RecordError> {
        self.saved = now;
        let written = self.recorder().map_or(Ok(()), RunRecorder::save_provisionally);
        self.unless_failed(written)
    }

    pub(super) fn finish(self) -> Result<(), RecordError> {
        match self.sink {
            Sink::File(recorder) => recorder.finish(),
            Sink::Null | Sink::Checker(_) => Ok(()),
        }
    }

    fn recorder(&mut self) -> Option<&mut RunRecorder> {
        match &mut self.sink {
            Sink::File(recorder) => Some(recorder),
            Sink::Null | Sink::Checker(_) => None,
        }
    }

    fn encode<M: Serialize>(&mut self, message: &M) {
        self.bytes.clear();
        cdr::encode_into(&mut self.bytes, message);
    }

    fn put(&mut self, kind: EntryKind, tick: Tick) -> Result<(), RecordError> {
        let topic = match kind {
            EntryKind::Scenario => &self.sim_topics[0],
            EntryKind::Progress => &self.sim_topics[1],
            EntryKind::Digest => &self.sim_topics[2],
            EntryKind::Result => &self.sim_topics[3],
            EntryKind::Transforms => &self.sim_topics[4],
            EntryKind::Intervention => &self.sim_topics[5],
            EntryKind::MapChange => &self.sim_topics[6],
            EntryKind::Join(agent) => &self.agent_topics[agent.index()][0],
            EntryKind::Observation(agent) => &self.agent_topics[agent.index()][1],
            EntryKind::Command(agent) => &self.agent_topics[agent.index()][2],
        };
        let written = write(&mut self.live, &mut self.sink, topic, tick, &self.bytes);
        self.unless_failed(written)
    }

    /// A recording ends at its first write error: later messages would follow a gap.
    fn unless_failed(&mut self, written: Result<(), RecordError>) -> Result<(), RecordError> {
        if written.is_err() {
            self.sink = Sink::Null;
        }
        written
    }
}

fn write(
    live: &mut Option<LiveStream>,
    sink: &mut Sink<'_>,
    topic: &Topic,
    tick: Tick,
    cdr: &[u8],
) -> Result<(), RecordError> {
    if let Some(live) = live {
        live.write(topic, tick, cdr);
    }
    sink.write(topic, tick, cdr)
}

impl Sink<'_> {
    fn write(&mut self, topic: &Topic, tick: Tick, cdr: &[u8]) -> Result<(), RecordError> {
        match self {
            Self::Null => Ok(()),
            Self::File(recorder) => recorder.write(topic, tick, cdr),
            Self::Checker(checker) => {
                checker.take(&topic.name, tick, cdr);
                Ok(())
            }
        }
    }
}
