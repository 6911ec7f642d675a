//! Who hears whom: the communication models, and what messages are.
//!
//! Contact is symmetric, hangs on the places of the two radios and on the terrain alone, and agents do not hide each other
//! (reference: line casts against the map alone). Which model assumes what: docs/communication.md.
//!
//! This module does not look into messages, and delivers none: `air.rs` does.

use msgs::ids::AgentId;
use msgs::relay_id::RelayId;
use nalgebra::Point3;
use serde::{Deserialize, Serialize};
use voxels::{Grid, Terrain, length_in_walls_m, line_of_sight};

/// When two radios are in contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ContactModel {
    /// No wall cell lies on the straight line between them, and they are within range.
    LineOfSightAndRange {
        /// Greatest distance, metres; infinity: as far as the line of sight.
        range_m: f64,
    },
    /// They are within range, whatever is between them.
    Range {
        /// Greatest distance, metres.
        range_m: f64,
    },
    /// Always.
    Global,
    /// The power that is received is enough.
    Attenuated(PathLoss),
}

/// How a signal grows weaker, `[communication.attenuation]`: as the distance to a power, and as another power of the length of
/// the way inside walls. The defaults are those of IR2 (docs/communication.md).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PathLoss {
    /// Power sent, dBm.
    pub tx_dbm: f64,
    /// Least power that can be received, dBm.
    pub threshold_dbm: f64,
    /// Loss over the reference distance in the open, dB.
    pub reference_loss_db: f64,
    /// The reference distance, metres.
    pub reference_m: f64,
    /// Path loss exponent in the open.
    pub free_exponent: f64,
    /// Path loss exponent of the way inside walls.
    pub wall_exponent: f64,
    /// Length inside walls that is measured in, metres: walls of this length cost `3.01 * wall_exponent` dB.
    pub wall_reference_m: f64,
}

impl Default for PathLoss {
    fn default() -> Self {
        Self {
            tx_dbm: -20.0,
            threshold_dbm: -70.0,
            reference_loss_db: 31.0,
            reference_m: 35.0,
            free_exponent: 2.0,
            wall_exponent: 4.0,
            wall_reference_m: 1.0,
        }
    }
}

impl PathLoss {
    /// Power received over a distance of which a part lies in walls, dBm. It never exceeds the power sent.
    #[must_use]
    pub fn received_dbm(&self, distance_m: f64, in_walls_m: f64) -> f64 {
        let free_db = self.reference_loss_db + 10.0 * self.free_exponent * libm::log10(distance_m / self.reference_m);
        let wall_db = 10.0 * self.wall_exponent * libm::log10(1.0 + in_walls_m / self.wall_reference_m);
        self.tx_dbm - free_db.max(0.0) - wall_db
    }

    /// How far it reaches in the open, metres; less than 0: nowhere.
    #[must_use]
    pub fn reach_m(&self) -> f64 {
        let left_db = self.tx_dbm - self.threshold_dbm;
        if left_db < 0.0 {
            return -1.0;
        }
        self.reference_m * libm::pow(10.0, (left_db - self.reference_loss_db) / (10.0 * self.free_exponent))
    }
}

impl ContactModel {
    /// Whether radios at two places are in contact.
    #[must_use]
    pub fn joins(&self, terrain: &Grid<Terrain>, one: &Point3<f64>, other: &Point3<f64>) -> bool {
        let distance_m = (other - one).norm();
        match self {
            Self::LineOfSightAndRange { range_m } => distance_m <= *range_m && line_of_sight(terrain, one, other),
            Self::Range { range_m } => distance_m <= *range_m,
            Self::Global => true,
            Self::Attenuated(loss) => {
                // The walls are looked at only where the open would let the signal through.
                let is_enough = |in_walls_m| loss.received_dbm(distance_m, in_walls_m) >= loss.threshold_dbm;
                is_enough(0.0) && is_enough(length_in_walls_m(terrain, one, other))
            }
        }
    }
}

/// How agents communicate: who hears whom, and what the radios can do.
#[derive(Debug, Clone, PartialEq)]
pub struct Comms {
    /// Who hears whom.
    pub contact: ContactModel,
    /// Probability that a message is lost on its way to one receiver, 0 ..= 1.
    pub loss: f64,
    /// What each agent can send; infinity: unlimited.
    pub bytes_per_s: f64,
    /// What waits at an agent to be sent, at the most.
    pub queue_bytes: u64,
    /// Relays that each agent can leave behind, at most [`msgs::limits::RELAYS_PER_AGENT_MAX`].
    pub relays_per_agent: u32,
    /// How near a relay in contact has to be to be read and written, metres; infinity: contact is enough.
    pub relay_read_range_m: f64,
    /// The seed of what is lost by chance.
    pub seed: u64,
}

impl Comms {
    /// Radios that lose and delay nothing, and no relays.
    #[must_use]
    pub fn perfect(contact: ContactModel) -> Self {
        let unlimited = f64::INFINITY;
        Self {
            contact,
            loss: 0.0,
            bytes_per_s: unlimited,
            queue_bytes: 0,
            relays_per_agent: 0,
            relay_read_range_m: unlimited,
            seed: 0,
        }
    }
}

/// A message on its way or in an inbox.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AgentMessage {
    /// In a command: the receiver; in an inbox: the sender.
    pub peer: Peer,
    /// The sender's mark, for accounting.
    pub kind: u8,
    /// The content.
    pub data: Vec<u8>,
}

/// The other end of a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Peer {
    /// One agent.
    One(AgentId),
    /// Everybody in contact (as a receiver only).
    Broadcast,
    /// A relay: as a receiver it keeps the content, as a sender it tells what it keeps.
    Relay(RelayId),
    /// A relay that is left behind where the agent is, and keeps the content (as a receiver only).
    NewRelay,
}

/// The contacts of one tick, found out pair by pair when they are asked for.
///
/// Positions do not change between the phases look and communicate, so a table serves the whole tick.
#[derive(Debug, Clone)]
pub struct ContactTable {
    positions: Vec<Point3<f64>>,
    known: Vec<Option<bool>>,
    /// By agent the networks of relays that it hears, ascending; empty if there are no relays.
    networks: Vec<Vec<usize>>,
}

impl ContactTable {
    /// A table for bodies at `positions` (metres, frame `map`), by agent. `networks` are those of relays that each agent hears,
    /// ascending; none at all if there are no relays.
    #[must_use]
    pub fn new(positions: Vec<Point3<f64>>, networks: Vec<Vec<usize>>) -> Self {
        let agents = positions.len();
        Self { positions, known: vec![None; agents * agents], networks }
    }

    /// The agents in contact with `agent`, ascending.
    pub fn of(&mut self, agent: AgentId, model: &ContactModel, terrain: &Grid<Terrain>) -> Vec<AgentId> {
        (0..self.positions.len())
            .map(AgentId::from_index)
            .filter(|&other| other != agent && self.in_contact(agent, other, model, terrain))
            .collect()
    }

    /// Whether two different agents are in contact, directly or over a network of relays that both hear.
    pub fn in_contact(&mut self, one: AgentId, other: AgentId, model: &ContactModel, terrain: &Grid<Terrain>) -> bool {
        let (low, high) = if one < other { (one.index(), other.index()) } else { (other.index(), one.index()) };
        let slot = low * self.positions.len() + high;
        if let Some(known) = self.known[slot] {
            return known;
        }
        let heard =
            self.share_a_network(low, high) || model.joins(terrain, &self.positions[low], &self.positions[high]);
        self.known[slot] = Some(heard);
        heard
    }

    fn share_a_network(&self, one: usize, other: usize) -> bool {
        match (self.networks.get(one), self.networks.get(other)) {
            (Some(one), Some(other)) => one.iter().any(|network| other.binary_search(network).is_ok()),
            _ => false,
        }
    }
}

#[cfg(test)]
mod tests;
