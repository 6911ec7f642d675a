//! What goes into the lock-step protocol and comes out of it: messages of agent processes, requests
//! of the session, messages to send, and events.

use core::time::Duration;
use std::collections::BTreeMap;
use std::fmt;
use std::sync::Arc;

use msgs::ids::{AgentId, Tick};
use msgs::maes_msgs::{Command, JoinReply, Observation as Fragment};

use super::{Refusal, SourceId, listed};
use crate::command;
use crate::observation::RequestKind;
use crate::signed::{JoinRequest, Signed, Verified};

/// A message from an agent process.
#[derive(Debug, Clone, PartialEq)]
pub enum Inbound {
    /// From the topic `join` of an agent; unsigned over a private transport.
    Join(Signed<JoinRequest>),
    /// From the topic `command` of an agent; unsigned over a private transport, or if it is made
    /// from a standard message.
    Command(Signed<Command>),
    /// Bytes on one of these topics that do not decode.
    Undecodable {
        /// The decoding error.
        reason: String,
    },
}

/// A message from an agent process, with its origin.
#[derive(Debug, Clone, PartialEq)]
pub struct Incoming {
    /// The agent whose topic carried it.
    pub topic_agent: AgentId,
    /// The process that sent it.
    pub source: SourceId,
    /// The message.
    pub message: Inbound,
}

/// A message to send; the transport may lose it.
#[derive(Debug, Clone, PartialEq)]
#[expect(clippy::large_enum_variant, reason = "nearly all are observations, each of which a box would allocate")]
pub enum Transmit {
    /// The reply to a join, which all processes receive.
    JoinReply(JoinReply),
    /// A fragment of an observation, to the topic of an agent.
    Observation(AgentId, Signed<Fragment>),
}

/// An observation that awaits a command.
#[derive(Debug, Clone)]
pub struct ObservationRequest {
    /// Who observes.
    pub agent: AgentId,
    /// Whether the agent is due, or is asked out of turn.
    pub kind: RequestKind,
    /// The observation, as it is recorded: without the number of the run.
    pub fragments: Arc<Vec<Fragment>>,
}

/// A legal command.
#[derive(Debug, Clone, PartialEq)]
pub struct CommandReply {
    /// As received, without the number of the run.
    pub message: Command,
    /// The command that it is.
    pub command: command::Command,
}

impl CommandReply {
    /// The reply that a message is, which has no number of the run.
    ///
    /// # Errors
    /// If the command is not legal for a team of `agents`.
    pub fn new(message: Verified<Command>, agents: u32) -> Result<Self, String> {
        let message = message.into_inner();
        let command = command::Command::from_message(&message, agents)?;
        Ok(Self { message, command })
    }

    /// Whether the run would be the same without it.
    #[must_use]
    pub fn is_no_op(&self) -> bool {
        self.command.is_noop()
    }
}

/// The replies of a tick, by agent.
pub type Replies = BTreeMap<AgentId, CommandReply>;

/// The replies of a tick that was given up.
#[derive(Debug, Clone, PartialEq)]
pub struct MissingReplies {
    /// Those that have come.
    pub received: Replies,
    /// Agents without a reply, or whose replay was not complete, ascending.
    pub missing: Vec<AgentId>,
}

/// What has happened in the protocol.
#[derive(Debug, Clone, PartialEq)]
pub enum Event {
    /// All replies of the tick are in, and every replaced process has replayed its log.
    Answered(Replies),
    /// The timeout has passed, and the clock is not held.
    TimedOut(MissingReplies),
    /// A replayed agent has answered an observation differently; the run cannot go on.
    Diverged {
        /// The agent.
        agent: AgentId,
        /// The tick of the observation.
        tick: Tick,
        /// The command in the log.
        recorded: Box<Command>,
        /// The command of the present process.
        given: Box<Command>,
    },
    /// Something that people should know.
    Notice(Notice),
}

/// A line for people.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Notice {
    /// A message was refused.
    Refused {
        /// Why.
        refusal: Refusal,
        /// Whether further refusals of this kind are only counted.
        is_last: bool,
    },
    /// A process has started itself again because its start stalled.
    Restarted {
        /// One of its agents.
        agent: AgentId,
        /// How often it has.
        times: u32,
    },
    /// Another process has taken over an agent.
    Replaced {
        /// The agent.
        agent: AgentId,
    },
    /// Agents have not answered in time, and other processes may take over.
    Silent {
        /// The agents.
        agents: Vec<AgentId>,
        /// The time that they had, wall time.
        timeout: Duration,
    },
}

impl fmt::Display for Notice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Refused { refusal, is_last: false } => write!(f, "refused: {refusal}"),
            Self::Refused { refusal, is_last: true } => {
                write!(f, "refused: {refusal} (more of this kind are only counted: {})", refusal.counter())
            }
            Self::Restarted { agent, times } => {
                write!(f, "the process of agent {agent} has stalled at its start, and began again ({times}x)")
            }
            Self::Replaced { agent } => {
                write!(f, "agent {agent} was started again; its observation log is replayed to it")
            }
            Self::Silent { agents, timeout } => {
                let (names, seconds) = (listed(agents.iter().copied()), timeout.as_secs_f64());
                write!(f, "no answer within {seconds} s from: {names}; the clock is held until they are started again")
            }
        }
    }
}
