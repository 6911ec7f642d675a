//! What was said in a recorded run, tick by tick, to carry it out again without those who said it.
//!
//! Invariants: what was said in a tick is given out only if the recording holds something of a later tick or has its end, so that it
//! is all of it; what was done to the run from outside is given out as soon as it stands there, for somebody was told that it
//! is done.
//!
//! This module knows no world, and does not compare.

use std::collections::BTreeMap;

use msgs::cdr::CdrError;
use msgs::ids::{AgentId, Tick};
use msgs::maes_msgs::{self, Command, Intervention, Join, Observation};
use msgs::topics;
use thiserror::Error;

use crate::recording::{Message, Messages, Recording};
use simulation::digest::Digest;

/// A message of a recording that cannot be read.
#[derive(Debug, Error)]
#[error("{file}: {topic} in tick {tick}: {source}")]
pub struct PlaybackError {
    file: String,
    topic: String,
    tick: Tick,
    source: CdrError,
}

/// How a recording ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Horizon {
    /// With a result, in this tick.
    Ended(Tick),
    /// Without one: this is the first tick of which not everything need be there.
    Open(Tick),
}

/// How a run that has a result has ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Ending {
    /// As the result says.
    pub reason: String,
    /// Whether its last tick had begun: scans were cast and agents asked, but not all answers awaited.
    pub is_mid_tick: bool,
}

/// A recorded run, from its start on.
pub struct Playback<'a> {
    file: String,
    messages: Messages<'a>,
    /// The first one that was not given out.
    next: Option<Message>,
    horizon: Horizon,
    ending: Option<Ending>,
    /// What each agent ran, of those that had joined.
    joins: BTreeMap<AgentId, Join>,
}

/// What was said in a tick.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RecordedTick {
    /// The digest at its start, if it was told.
    pub digest: Option<Digest>,
    /// What was done to the run before it, in order.
    pub interventions: Vec<Intervention>,
    /// What was answered.
    pub commands: BTreeMap<AgentId, Command>,
}

impl<'a> Playback<'a> {
    /// Begins at the start of a recording.
    ///
    /// # Errors
    /// If a message of its protocol cannot be read.
    pub fn new(recording: &'a Recording) -> Result<Self, PlaybackError> {
        let mut horizon = Horizon::Open(Tick::ZERO);
        let mut joins = BTreeMap::new();
        let mut reason = None;
        // Of the last tick.
        let mut observations: Vec<Message> = Vec::new();
        for message in recording.messages() {
            let tick = message.tick();
            if message.channel.topic == topics::result().name {
                let result: maes_msgs::Result =
                    message.decode().map_err(|source| unreadable(recording, &message, source))?;
                reason = Some(result.reason);
                horizon = Horizon::Ended(tick);
            } else if let Horizon::Open(last) = &mut horizon {
                *last = tick.max(*last);
            }
            if let Some((agent, "join")) = message.of_agent() {
                let join = message.decode().map_err(|source| unreadable(recording, &message, source))?;
                joins.insert(agent, join);
            } else if let Some((_, "observation")) = message.of_agent() {
                observations.retain(|observation| observation.tick() == tick);
                observations.push(message);
            }
        }
        let mut is_mid_tick = false;
        for message in observations {
            let observation: Observation =
                message.decode().map_err(|source| unreadable(recording, &message, source))?;
            // Those who were not due have no observation of it, but scans show.
            is_mid_tick |= observation.phase == Observation::RUNNING || observation.scan_tick == observation.tick;
        }
        let ending = reason.map(|reason| Ending { reason, is_mid_tick });
        let mut messages = recording.messages();
        let next = messages.next();
        Ok(Self { file: recording.file().to_owned(), messages, next, horizon, ending, joins })
    }

    /// How the recording ended.
    #[must_use]
    pub fn horizon(&self) -> Horizon {
        self.horizon
    }

    /// How the run has ended, if it has.
    #[must_use]
    pub fn ending(&self) -> Option<&Ending> {
        self.ending.as_ref()
    }

    /// What the agents ran, by agent.
    #[must_use]
    pub fn joins(&self) -> &BTreeMap<AgentId, Join> {
        &self.joins
    }

    /// Whether everything is there that was said in a tick.
    #[must_use]
    pub fn covers(&self, tick: Tick) -> bool {
        match self.horizon {
            Horizon::Ended(end) | Horizon::Open(end) => tick < end,
        }
    }

    /// What was said in a tick; each one after those before it.
    ///
    /// # Errors
    /// If it cannot be read.
    pub fn read_tick(&mut self, tick: Tick) -> Result<RecordedTick, PlaybackError> {
        let is_covered = self.covers(tick);
        let mut recorded = RecordedTick::default();
        while let Some(message) = self.next.take_if(|message| message.tick() <= tick) {
            self.next = self.messages.next();
            let unreadable =
                |source| PlaybackError { file: self.file.clone(), topic: message.channel.topic.clone(), tick, source };
            match message.of_agent() {
                Some((agent, "command")) if is_covered => {
                    recorded.commands.insert(agent, message.decode().map_err(unreadable)?);
                }
                None if message.channel.topic == topics::intervention().name => {
                    recorded.interventions.push(message.decode().map_err(unreadable)?);
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

fn unreadable(recording: &Recording, message: &Message, source: CdrError) -> PlaybackError {
    let (file, topic) = (recording.file().to_owned(), message.channel.topic.clone());
    PlaybackError { file, topic, tick: message.tick(), source }
}
