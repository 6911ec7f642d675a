//! The inputs of a recorded run (commands, interventions) by tick, for re-execution without its
//! agents.
//!
//! Invariants: commands of a tick are returned only if the recording holds a message of a later
//! tick or its end, so that they are complete; interventions are returned as soon as they are
//! recorded, because their caller has received a success reply.
//!
//! This module knows no world and compares nothing.

use std::collections::BTreeMap;

use msgs::cdr::CdrError;
use msgs::ids::{AgentId, Tick};
use msgs::maes_msgs::{self, Command, Intervention, Join, MapChange, Observation};
use msgs::topics;
use thiserror::Error;

use crate::comparison;
use crate::{End, Message, Messages, Recording};
use simulation::digest::Digest;
use simulation::end_reason::EndReason;

/// Why a recording cannot be re-executed.
#[derive(Debug, Error)]
pub enum PlaybackError {
    /// A message cannot be decoded.
    #[error("{file}: {topic} in tick {tick}: {source}")]
    Undecodable { file: String, topic: String, tick: Tick, source: CdrError },
    /// The messages are not in the order of their times.
    #[error(
        "{file}: {topic} of tick {tick} lies behind messages of tick {later}: expected messages in the order of \
         their log times; sort the file by them first"
    )]
    Disorder { file: String, topic: String, tick: Tick, later: Tick },
}

/// How a recording ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Horizon {
    /// With a result, in this tick, and an end.
    Ended(Tick),
    /// Without one of them: the first tick that may be incomplete.
    Open(Tick),
}

/// How a run with a result has ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Ending {
    /// Reason in the result.
    pub reason: EndReason,
    /// Whether its last tick had begun: scans were cast and observations sent, but not all commands
    /// received.
    pub is_mid_tick: bool,
}

/// A recorded run, read tick by tick.
///
/// For a fork, it ends at the tick of the fork ([`Playback::until`]).
pub struct Playback<'a> {
    file: String,
    messages: Messages<'a>,
    /// The next message of the run.
    next: Option<Message>,
    horizon: Horizon,
    end: End,
    /// The first tick whose inputs are ignored.
    fork: Option<Tick>,
    ending: Option<Ending>,
    /// Join messages, by agent.
    joins: BTreeMap<AgentId, Join>,
    first_digest: Option<Digest>,
}

/// A change of the run from outside, as recorded.
#[derive(Debug, Clone, PartialEq)]
pub enum RecordedIntervention {
    /// Of an agent.
    OfAgent(Intervention),
    /// Of the map, by a request.
    OfMap(MapChange),
}

/// The recorded inputs of a tick.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RecordedTick {
    /// The digest at its start, if recorded.
    pub digest: Option<Digest>,
    /// Interventions before it, in order.
    pub interventions: Vec<RecordedIntervention>,
    /// Commands, by agent.
    pub commands: BTreeMap<AgentId, Command>,
}

impl<'a> Playback<'a> {
    /// Starts at the beginning of a recording.
    ///
    /// # Errors
    /// If a protocol message cannot be decoded, or messages of the run are not in the order of
    /// time.
    pub fn new(recording: &'a Recording) -> Result<Self, PlaybackError> {
        let mut horizon = Horizon::Open(Tick::ZERO);
        let mut joins = BTreeMap::new();
        let (mut reason, mut first_digest) = (None, None);
        let mut latest = Tick::ZERO;
        // Observations of the last tick.
        let mut observations: Vec<Message> = Vec::new();
        let mut all = recording.messages();
        for message in all.by_ref() {
            let tick = message.tick();
            if !comparison::is_of_run(&message.channel.topic) {
                continue;
            }
            if tick < latest {
                let (file, topic) = (recording.file().to_owned(), message.channel.topic.clone());
                return Err(PlaybackError::Disorder { file, topic, tick, later: latest });
            }
            latest = tick;
            if message.channel.topic == topics::result().name {
                let result: maes_msgs::Result =
                    message.decode().map_err(|source| undecodable(recording.file(), &message, source))?;
                reason = Some(EndReason::from(result.reason));
                horizon = Horizon::Ended(tick);
            } else if let Horizon::Open(last) = &mut horizon {
                *last = tick.max(*last);
            }
            if tick == Tick::ZERO && message.channel.topic == topics::digest().name {
                let digest: maes_msgs::Digest =
                    message.decode().map_err(|source| undecodable(recording.file(), &message, source))?;
                first_digest.get_or_insert(Digest(digest.digest));
            }
            if let Some((agent, "join")) = message.of_agent() {
                let join = message.decode().map_err(|source| undecodable(recording.file(), &message, source))?;
                joins.insert(agent, join);
            } else if let Some((_, "observation")) = message.of_agent() {
                observations.retain(|observation| observation.tick() == tick);
                observations.push(message);
            }
        }
        if let Horizon::Ended(tick) = horizon
            && all.end() != Some(&End::Whole)
        {
            // The server has failed while it ended the recording, which can be completed.
            horizon = Horizon::Open(tick);
        }
        let end = all.end().cloned().unwrap_or(End::Missing);
        let mut is_mid_tick = false;
        for message in observations {
            let observation: Observation =
                message.decode().map_err(|source| undecodable(recording.file(), &message, source))?;
            // Agents that were not due have no observation of it, but scans show.
            is_mid_tick |= observation.phase == Observation::RUNNING || observation.scan_tick == observation.tick;
        }
        let ending = reason.map(|reason| Ending { reason, is_mid_tick });
        let mut messages = recording.messages();
        let next = next_of_run(&mut messages);
        let file = recording.file().to_owned();
        Ok(Self { file, messages, next, horizon, end, fork: None, ending, joins, first_digest })
    }

    /// The inputs before a tick alone: from there on, a fork goes another way.
    #[must_use]
    pub fn until(self, tick: Tick) -> Self {
        Self { fork: Some(tick), ..self }
    }

    /// The digest at the start of tick 0, if recorded.
    #[must_use]
    pub fn first_digest(&self) -> Option<Digest> {
        self.first_digest
    }

    /// How the recording ends.
    #[must_use]
    pub fn horizon(&self) -> Horizon {
        self.horizon
    }

    /// Where the file ends.
    #[must_use]
    pub fn end(&self) -> &End {
        &self.end
    }

    /// How the run has ended, if it has.
    #[must_use]
    pub fn ending(&self) -> Option<&Ending> {
        self.ending.as_ref()
    }

    /// Join messages, by agent.
    #[must_use]
    pub fn joins(&self) -> &BTreeMap<AgentId, Join> {
        &self.joins
    }

    /// Whether the recording holds a tick completely.
    #[must_use]
    pub fn covers(&self, tick: Tick) -> bool {
        match self.horizon {
            Horizon::Ended(end) | Horizon::Open(end) => tick < end && self.fork.is_none_or(|fork| tick < fork),
        }
    }

    /// The inputs of a tick; call it for ascending ticks.
    ///
    /// # Errors
    /// If a message cannot be decoded.
    pub fn read_tick(&mut self, tick: Tick) -> Result<RecordedTick, PlaybackError> {
        let is_covered = self.covers(tick);
        let mut recorded = RecordedTick::default();
        while let Some(message) = self.next.take_if(|message| message.tick() <= tick) {
            self.next = next_of_run(&mut self.messages);
            let unreadable = |source| undecodable(&self.file, &message, source);
            let is_past = self.fork.is_none_or(|fork| message.tick() < fork);
            match message.of_agent() {
                Some((agent, "command")) if is_covered => {
                    recorded.commands.insert(agent, message.decode().map_err(unreadable)?);
                }
                None if message.channel.topic == topics::intervention().name && is_past => {
                    let intervention = message.decode().map_err(unreadable)?;
                    recorded.interventions.push(RecordedIntervention::OfAgent(intervention));
                }
                None if message.channel.topic == topics::map_change().name && is_past => {
                    let change: MapChange = message.decode().map_err(unreadable)?;
                    // The events of the scenario make the others.
                    if matches!(change.kind, MapChange::FREE_ON_REQUEST | MapChange::WALL_ON_REQUEST) {
                        recorded.interventions.push(RecordedIntervention::OfMap(change));
                    }
                }
                None if message.channel.topic == topics::digest().name => {
                    let digest: maes_msgs::Digest = message.decode().map_err(unreadable)?;
                    recorded.digest = Some(Digest(digest.digest));
                }
                _ => {}
            }
        }
        Ok(recorded)
    }
}

/// The next message that belongs to the run: others may have any stamp.
fn next_of_run(messages: &mut Messages<'_>) -> Option<Message> {
    messages.find(|message| comparison::is_of_run(&message.channel.topic))
}

fn undecodable(file: &str, message: &Message, source: CdrError) -> PlaybackError {
    let (file, topic) = (file.to_owned(), message.channel.topic.clone());
    PlaybackError::Undecodable { file, topic, tick: message.tick(), source }
}
