//! What a run writes down: messages on their way to the digest and to the recording, if there is one.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use msgs::cdr;
use msgs::ids::{AgentId, Tick};
use msgs::topics::{self, Topic};
use serde::Serialize;

use super::now;
use crate::digest::Chain;
use crate::recorder::{RecordError, Recorder};
use crate::views::{Picture, View};

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

/// The recording and the encoding of messages, which the digest needs in any case.
pub(super) struct Log {
    recorder: Option<Recorder>,
    sim_topics: [Topic; 6],
    agent_topics: Vec<[Topic; 3]>,
    /// Of the views that have been recorded so far.
    view_topics: BTreeMap<View, Topic>,
    bytes: Vec<u8>,
    saved: Instant,
}

impl Log {
    pub(super) fn new(recorder: Option<Recorder>, agents: u32) -> Self {
        let of_agent = |agent| [topics::join(agent), topics::observation(agent), topics::command(agent)];
        Self {
            recorder,
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

    pub(super) fn is_recording(&self) -> bool {
        self.recorder.is_some()
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
        let Some(recorder) = &mut self.recorder else {
            return Ok(());
        };
        let topic = self.view_topics.entry(view).or_insert_with(|| view.topic());
        let written = recorder.write(topic, tick, &self.bytes);
        self.unless_failed(written)
    }

    /// See [`Recorder::publish`].
    pub(super) fn publish(&mut self) -> Result<(), RecordError> {
        let published = self.recorder.as_mut().map_or(Ok(()), Recorder::publish);
        self.unless_failed(published)
    }

    /// Gives up the recording; there is none unless it is published.
    pub(super) fn give_up(&mut self) {
        self.recorder = None;
    }

    /// Saves provisionally if it is time to. To be called while the loop waits, too.
    pub(super) fn save_now_and_then(&mut self) -> Result<(), RecordError> {
        if self.saved.elapsed() >= SAVE_PERIOD { self.save_provisionally() } else { Ok(()) }
    }

    /// See [`Recorder::save_provisionally`].
    pub(super) fn save_provisionally(&mut self) -> Result<(), RecordError> {
        self.saved = now();
        let written = self.recorder.as_mut().map_or(Ok(()), Recorder::save_provisionally);
        self.unless_failed(written)
    }

    pub(super) fn finish(self) -> Result<(), RecordError> {
        self.recorder.map_or(Ok(()), Recorder::finish)
    }

    fn encode<M: Serialize>(&mut self, message: &M) {
        self.bytes.clear();
        cdr::encode_into(&mut self.bytes, message);
    }

    fn put(&mut self, kind: Kind, tick: Tick) -> Result<(), RecordError> {
        let Some(recorder) = &mut self.recorder else {
            return Ok(());
        };
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
        let written = recorder.write(topic, tick, &self.bytes);
        self.unless_failed(written)
    }

    /// A recording that could once not be written to ends there: what comes later must not stand beside a gap.
    fn unless_failed(&mut self, written: Result<(), RecordError>) -> Result<(), RecordError> {
        if written.is_err() {
            self.recorder = None;
        }
        written
    }
}
