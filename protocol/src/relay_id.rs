//! The identity of a radio relay.

use std::fmt;

use crate::limits::RELAYS_PER_AGENT_MAX;
use msgs::ids::AgentId;
use msgs::maes_msgs::AgentMessage;

/// A relay that an agent has deployed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct RelayId {
    /// Who left it.
    pub owner: AgentId,
    /// Which of that agent's it is: 0, 1, and so on, below [`RELAYS_PER_AGENT_MAX`].
    pub number: u32,
}

impl RelayId {
    /// The number by which messages name it.
    pub const fn on_wire(self) -> u32 {
        AgentMessage::FIRST_RELAY + RELAYS_PER_AGENT_MAX * self.owner.0 + self.number
    }

    /// The relay that a message names, if it is one.
    pub fn from_wire(number: u32) -> Option<Self> {
        let number = number.checked_sub(AgentMessage::FIRST_RELAY).filter(|_| number < AgentMessage::SERVER)?;
        Some(Self { owner: AgentId(number / RELAYS_PER_AGENT_MAX), number: number % RELAYS_PER_AGENT_MAX })
    }
}

/// As agent and number: `3.0` is the first one that agent 3 has left.
impl fmt::Display for RelayId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{}", self.owner, self.number)
    }
}
