//! Why a message is refused: one kind for each counter in the result of a run.

use msgs::counters::CounterName;
use msgs::ids::{AgentId, Tick};
use msgs::maes_msgs::JoinReply;
use thiserror::Error;

/// Why a message was refused. Each kind has a counter in the result of a run.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum Refusal {
    /// The message belongs to another run.
    #[error("a message on a topic of agent {topic} is of another run")]
    OtherRun {
        /// The agent whose topic carried it.
        topic: AgentId,
    },
    /// The id is not one of the run's.
    #[error("agent {agent} is not in the run: ids are 0 .. {agents}")]
    UnknownAgent {
        /// The requested id.
        agent: AgentId,
        /// Size of the team.
        agents: u32,
    },
    /// The message names another agent than its topic.
    #[error("a message that names agent {named} came in on a topic of agent {topic}")]
    WrongTopic {
        /// The agent whose topic carried it.
        topic: AgentId,
        /// Named in the message.
        named: AgentId,
    },
    /// Another process holds this id.
    #[error("agent {agent} is taken by another process")]
    IdTaken {
        /// The requested id.
        agent: AgentId,
    },
    /// A process that would replace another one runs another controller.
    #[error("agent {agent} is to be run again by {before:?}, and not by {got:?}")]
    OtherController {
        /// The requested id.
        agent: AgentId,
        /// Controller of the process.
        got: String,
        /// Controller of its predecessor.
        before: String,
    },
    /// The process uses another version of the protocol.
    #[error("agent {agent} speaks protocol {got}, the server speaks {expected}")]
    WrongProtocol {
        /// The requested id.
        agent: AgentId,
        /// Version of the agent.
        got: u32,
        /// Version of the server.
        expected: u32,
    },
    /// A command from a process that has not joined with this id.
    #[error("a command for agent {agent} came from a process that has not joined as it")]
    NotJoined {
        /// Named id.
        agent: AgentId,
    },
    /// A join without proof of the join secret, or of a process that does not sign its commands.
    #[error("a join as agent {agent} {what}")]
    UnprovenJoin {
        /// The requested id.
        agent: AgentId,
        /// What is wrong with it, and the remedy.
        what: &'static str,
    },
    /// A command without the message authentication code of the process that has joined.
    #[error("a command of agent {agent}, tick {tick}, is not signed by the process that has joined")]
    ForgedCommand {
        /// Named id.
        agent: AgentId,
        /// Named tick.
        tick: Tick,
    },
    /// A reply to another tick.
    #[error("agent {agent} answered tick {got} while tick {expected} is awaited")]
    WrongTick {
        /// The agent that replied.
        agent: AgentId,
        /// Tick of the answer.
        got: Tick,
        /// Tick of the barrier.
        expected: Tick,
    },
    /// A second reply to a tick.
    #[error("agent {agent} answered tick {tick} twice")]
    SecondAnswer {
        /// The agent that replied.
        agent: AgentId,
        /// The tick of the reply.
        tick: Tick,
    },
    /// A value that is not a number, or out of range.
    #[error("agent {agent}, tick {tick}: {reason}")]
    IllegalCommand {
        /// The agent that replied.
        agent: AgentId,
        /// The tick of the reply.
        tick: Tick,
        /// Field, value and allowed values.
        reason: String,
    },
    /// Bytes that do not decode.
    #[error("a message on a topic of agent {topic} cannot be decoded: {reason}")]
    Undecodable {
        /// The agent whose topic carried it.
        topic: AgentId,
        /// The decoding error.
        reason: String,
    },
}

impl Refusal {
    /// The counter of this kind.
    #[must_use]
    pub fn counter(&self) -> CounterName {
        match self {
            Self::OtherRun { .. } => CounterName::RefusedOtherRun,
            Self::UnknownAgent { .. } => CounterName::RefusedUnknownAgent,
            Self::WrongTopic { .. } => CounterName::RefusedWrongTopic,
            Self::IdTaken { .. } => CounterName::RefusedIdTaken,
            Self::OtherController { .. } => CounterName::RefusedOtherController,
            Self::WrongProtocol { .. } => CounterName::RefusedWrongProtocol,
            Self::NotJoined { .. } => CounterName::RefusedNotJoined,
            Self::UnprovenJoin { .. } => CounterName::RefusedUnprovenJoin,
            Self::ForgedCommand { .. } => CounterName::RefusedForgedCommand,
            Self::WrongTick { .. } => CounterName::RefusedWrongTick,
            Self::SecondAnswer { .. } => CounterName::RefusedSecondAnswer,
            Self::IllegalCommand { .. } => CounterName::RefusedIllegalCommand,
            Self::Undecodable { .. } => CounterName::RefusedUndecodable,
        }
    }

    /// The code of the reply to a refused join.
    #[must_use]
    pub fn code(&self) -> u8 {
        match self {
            Self::UnknownAgent { .. } => JoinReply::NOT_IN_RUN,
            Self::IdTaken { .. } => JoinReply::ID_TAKEN,
            Self::WrongProtocol { .. } => JoinReply::WRONG_PROTOCOL,
            Self::OtherController { .. } => JoinReply::OTHER_CONTROLLER,
            Self::UnprovenJoin { .. } => JoinReply::UNPROVEN,
            Self::OtherRun { .. }
            | Self::WrongTopic { .. }
            | Self::NotJoined { .. }
            | Self::ForgedCommand { .. }
            | Self::WrongTick { .. }
            | Self::SecondAnswer { .. }
            | Self::IllegalCommand { .. }
            | Self::Undecodable { .. } => JoinReply::REFUSED,
        }
    }
}
