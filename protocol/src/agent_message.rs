//! Messages between agents, and between an agent and a relay.
//!
//! The message is `maes_msgs/AgentMessage`.

use msgs::ids::AgentId;
use msgs::maes_msgs;
use msgs::shared_bytes::SharedBytes;

use crate::limits::{AGENT_MESSAGE_BYTES_MAX, RELAY_BYTES_MAX};
use crate::message_type::MessageType;
use crate::relay_id::RelayId;

/// A message of an agent: to another one, or to a relay.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AgentMessage {
    /// In a command: the receiver; in an observation: the sender.
    pub peer: Peer,
    /// The kind of content, chosen by the sender, by which messages are distinguished and counted.
    pub kind: u8,
    /// The content: at most 57344 bytes over all messages of a command; to a relay at most 4096.
    pub data: SharedBytes,
}

/// The other end of a message, seen from an agent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Peer {
    /// One agent.
    One(AgentId),
    /// All agents in contact (as a receiver only).
    Broadcast,
    /// A relay: as a receiver it stores the content, as a sender it reports what it stores.
    Relay(RelayId),
    /// A relay that is deployed at the position of the agent and stores the content (as a receiver
    /// only).
    NewRelay,
    /// The server, which sends the scenario that holds from now on, or the energy of the agent (as
    /// a sender only).
    Server,
}

impl Peer {
    /// The number by which messages name it.
    fn on_wire(self) -> u32 {
        match self {
            Self::One(agent) => agent.0,
            Self::Broadcast => maes_msgs::AgentMessage::BROADCAST,
            Self::Relay(relay) => relay.on_wire(),
            Self::NewRelay => maes_msgs::AgentMessage::LEAVE_RELAY,
            Self::Server => maes_msgs::AgentMessage::SERVER,
        }
    }

    /// Whether it is a relay, deployed or to be deployed.
    #[must_use]
    pub fn is_relay(self) -> bool {
        matches!(self, Self::Relay(_) | Self::NewRelay)
    }

    /// Whose message this is in an observation of a legal sender.
    pub(crate) fn sender(number: u32) -> Self {
        match (number, RelayId::from_wire(number)) {
            (maes_msgs::AgentMessage::SERVER, _) => Self::Server,
            (_, Some(relay)) => Self::Relay(relay),
            (agent, None) => Self::One(AgentId(agent)),
        }
    }

    /// For whom a message of a command is, in a team of `agents`.
    fn receiver(number: u32, agents: u32) -> Result<Self, String> {
        let relay = RelayId::from_wire(number).filter(|relay| relay.owner.0 < agents);
        match (number, relay) {
            (maes_msgs::AgentMessage::BROADCAST, _) => Ok(Self::Broadcast),
            (maes_msgs::AgentMessage::LEAVE_RELAY, _) => Ok(Self::NewRelay),
            (_, Some(relay)) => Ok(Self::Relay(relay)),
            (agent, _) if agent < agents => Ok(Self::One(AgentId(agent))),
            (other, _) => Err(format!(
                "a message is for agent {other}, 0 to {}, BROADCAST, LEAVE_RELAY or a relay are allowed",
                agents - 1
            )),
        }
    }
}

impl AgentMessage {
    /// Whether it is a message of this type from another agent.
    #[must_use]
    pub fn is_from_agent(&self, of_type: MessageType) -> bool {
        matches!(self.peer, Peer::One(_)) && self.kind == of_type.number()
    }

    /// The messages of a command in a team of `agents`.
    ///
    /// # Errors
    /// If they are too large, or for others than the agents and relays of the team.
    pub(crate) fn of_command(messages: &[maes_msgs::AgentMessage], agents: u32) -> Result<Vec<Self>, String> {
        let bytes: usize = messages.iter().map(|message| message.data.len()).sum();
        if bytes > AGENT_MESSAGE_BYTES_MAX {
            return Err(format!("the messages hold {bytes} bytes, at most {AGENT_MESSAGE_BYTES_MAX} are allowed"));
        }
        let checked = |message: &maes_msgs::AgentMessage| {
            let peer = Peer::receiver(message.agent, agents)?;
            let bytes = message.data.len();
            if peer.is_relay() && bytes > RELAY_BYTES_MAX {
                return Err(format!("a message to a relay holds {bytes} bytes, at most {RELAY_BYTES_MAX} are allowed"));
            }
            Ok(Self { peer, kind: message.kind, data: message.data.clone() })
        };
        messages.iter().map(checked).collect()
    }
}

impl From<AgentMessage> for maes_msgs::AgentMessage {
    fn from(AgentMessage { peer, kind, data }: AgentMessage) -> Self {
        Self { agent: peer.on_wire(), kind, data }
    }
}
