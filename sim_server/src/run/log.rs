//! What a run writes down: messages on their way to the digest, and to a recording or to somebody who checks them.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use msgs::cdr;
use msgs::ids::{AgentId, Tick};
use msgs::topics::{self, Topic};
use serde::Serialize;

use super::now;
use crate::live_stream::LiveStream;
use crate::recorder::{RecordError, Recorder};
use simulation::digest::Chain;
use simulation::views::{Picture, View};

/// Wall time after which the open chunk of the recording is saved provisionally.
const SAVE_PERIOD: Duration = Duration::from_millis(500);

/// What a message is.
#[derive(Debug, Clone, Copy)]
pub(super) enum Kind {
    Scenario,
    Progress,
    Digest,
    Result,
    Transforms,
    Intervention,
    Join(AgentId),
    Observation(AgentId),
    Command(AgentId),
}

/// Where messages go.
enum Sink<'s> {
    /// Nowhere.
    Nothing,
    /// Into a recording.
    File(Box<Recorder>),
    /// Before somebody who knows what they should be.
    Checker(&'s mut dyn Checker),
}

/// Where messages go, beside the digest, and what those who look on read meanwhile.
pub(super) struct Outlets<'s> {
    sink: Sink<'s>,
    journal: Option<LiveStream>,
}

impl<'s> Outlets<'s> {
    /// Before somebody who knows what the messages should be.
    pub(super) fn checked_by(checker: &'s mut dyn Checker) -> Self {
        Self { sink: Sink::Checker(checker), journal: None }
    }

    /// Whether somebody checks what goes there.
    pub(super) fn are_checked(&self) -> bool {
        matches!(self.sink, Sink::Checker(_))
    }

    fn write(&mut self, topic: &Topic, tick: Tick, cdr: &[u8]) -> Result<(), RecordError> {
        if let Some(journal) = &mut self.journal {
            journal.write(topic, tick, cdr);
        }
        self.sink.write(topic, tick, cdr)
    }
}

/// Somebody who looks at everything that a run writes down, in order.
pub trait Checker {
    /// Looks at a message, as CDR with its encapsulation header.
    fn take(&mut self, topic: &str, tick: Tick, cdr: &[u8]);
    /// Whether it was found that something is not as it should be, so that there is no use in going on.
    fn is_done(&self) -> bool;
    /// What comes from now on is not to be looked at.
    fn close(&mut self);
}

/// The recording and the encoding of messages, which the digest needs in any case.
pub(super) struct Log<'s> {
    outlets: Outlets<'s>,
    sim_topics: [Topic; 6],
    agent_topics: Vec<[Topic; 3]>,
    /// Of the views that have been recorded so far.
    view_topics: BTreeMap<View, Topic>,
    bytes: Vec<u8>,
    saved: Instant,
}

impl<'s> Log<'s> {
    pub(super) fn new(outlets: Outlets<'s>, agents: u32) -> Self {
        let of_agent = |agent| [topics::join(agent), topics::observation(agent), topics::command(agent)];
        Self {
            outlets,
            sim_topics: [
                topics::scenario(),
                topics::progress(),
                topics::digest(),
                topics::result(),
                topics::tf(),
                topics::intervention(),
            ],
            agent_topics: (0..agents).map(AgentId).map(of_agent).collect(),
            view_topics: BTreeMap::new(),
            bytes: Vec::new(),
            saved: now(),
        }
    }

    /// Whether somebody wants what the digest does not need.
    pub(super) fn is_recording(&self) -> bool {
        self.outlets.journal.is_some() || !matches!(self.outlets.sink, Sink::Nothing)
    }

    /// Who checks what is written down, if somebody does.
    pub(super) fn checker(&mut self) -> Option<&mut (dyn Checker + 's)> {
        match &mut self.outlets.sink {
            Sink::Checker(checker) => Some(*checker),
            Sink::Nothing | Sink::File(_) => None,
        }
    }

    /// Writes a message that the digest covers.
    pub(super) fn exchange<M: Serialize>(
        &mut self,
        kind: Kind,
        tick: Tick,
        message: &M,
        chain: &mut Chain,
    ) -> Result<(), RecordError> {
        self.encode(message);
        chain.message(&self.bytes);
        self.put(kind, tick)
    }

    /// Writes a message that only the recording holds.
    pub(super) fn write<M: Serialize>(&mut self, kind: Kind, tick: Tick, message: &M) -> Result<(), RecordError> {
        if self.is_recording() {
            self.encode(message);
            self.put(kind, tick)?;
        }
        Ok(())
    }

    /// Writes a message of a view.
    pub(super) fn write_view(&mut self, view: View, tick: Tick, picture: &Picture) -> Result<(), RecordError> {
        self.encode(picture);
        let topic = self.view_topics.entry(view).or_insert_with(|| view.topic());
        let written = self.outlets.write(topic, tick, &self.bytes);
        self.unless_failed(written)
    }

    /// See [`Recorder::publish`].
    pub(super) fn publish(&mut self) -> Result<(), RecordError> {
        let published = self.recorder().map_or(Ok(()), Recorder::publish);
        self.unless_failed(published)
    }

    /// Gives up the recording; there is none unless it is published.
    pub(super) fn give_up(&mut self) {
        self.outlets.sink = Sink::Nothing;
    }

    /// Saves provisionally if it is time to. To be called while the loop waits, too.
    pub(super) fn save_now_and_then(&mut self) -> Result<(), RecordError> {
        if let Some(journal) = &mut self.outlets.journal {
            journal.flush_if_due();
        }
        if self.saved.elapsed() >= SAVE_PERIOD { self.save_provisionally() } else { Ok(()) }
    }

    /// See [`Recorder::save_provisionally`].
    pub(super) fn save_provisionally(&mut self) -> Result<(), RecordError> {
        self.saved = now();
        let written = self.recorder().map_or(Ok(()), Recorder::save_provisionally);
        self.unless_failed(written)
    }

    pub(super) fn finish(self) -> Result<(), RecordError> {
        match self.outlets.sink {
            Sink::File(recorder) => recorder.finish(),
            Sink::Nothing | Sink::Checker(_) => Ok(()),
        }
    }

    fn recorder(&mut self) -> Option<&mut Recorder> {
        match &mut self.outlets.sink {
            Sink::File(recorder) => Some(&mut **recorder),
            Sink::Nothing | Sink::Checker(_) => None,
        }
    }

    fn encode<M: Serialize>(&mut self, message: &M) {
        self.bytes.clear();
        cdr::encode_into(&mut self.bytes, message);
    }

    fn put(&mut self, kind: Kind, tick: Tick) -> Result<(), RecordError> {
        let topic = match kind {
            Kind::Scenario => &self.sim_topics[0],
            Kind::Progress => &self.sim_topics[1],
            Kind::Digest => &self.sim_topics[2],
            Kind::Result => &self.sim_topics[3],
            Kind::Transforms => &self.sim_topics[4],
            Kind::Intervention => &self.sim_topics[5],
            Kind::Join(agent) => &self.agent_topics[agent.index()][0],
            Kind::Observation(agent) => &self.agent_topics[agent.index()][1],
            Kind::Command(agent) => &self.agent_topics[agent.index()][2],
        };
        let written = self.outlets.write(topic, tick, &self.bytes);
        self.unless_failed(written)
    }

    /// A recording that could once not be written to ends there: what comes later must not stand beside a gap.
    fn unless_failed(&mut self, written: Result<(), RecordError>) -> Result<(), RecordError> {
        if written.is_err() {
            self.outlets.sink = Sink::Nothing;
        }
        written
    }
}

impl Sink<'_> {
    fn write(&mut self, topic: &Topic, tick: Tick, cdr: &[u8]) -> Result<(), RecordError> {
        match self {
            Self::Nothing => Ok(()),
            Self::File(recorder) => recorder.write(topic, tick, cdr),
            Self::Checker(checker) => {
                checker.take(&topic.name, tick, cdr);
                Ok(())
            }
        }
    }
}

/// What a run is written into.
pub struct Records {
    /// The recording, if there is to be one.
    pub recorder: Option<Recorder>,
    /// What those who look on read, if there may be some.
    pub journal: Option<LiveStream>,
}

impl From<Records> for Outlets<'_> {
    fn from(Records { recorder, journal }: Records) -> Self {
        Self { sink: recorder.map_or(Sink::Nothing, |recorder| Sink::File(Box::new(recorder))), journal }
    }
}

impl From<Option<Recorder>> for Records {
    fn from(recorder: Option<Recorder>) -> Self {
        Self { recorder, journal: None }
    }
}
