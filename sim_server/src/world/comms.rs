//! Who hears whom: the communication model, and the delivery of parcels.
//!
//! Two agents are in contact if no wall cell lies on the straight line between their centres and they are within range.
//! Contact is symmetric; agents do not hide each other (reference: line casts against the map alone).
//!
//! This module does not look into parcels.

use msgs::ids::AgentId;
use nalgebra::Point3;
use voxels::{Grid, Terrain, line_of_sight};

/// When two agents hear each other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CommsModel {
    /// Greatest distance between the centres; infinity: as far as the line of sight.
    pub range_m: f64,
}

/// A parcel on its way or in an inbox.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Parcel {
    /// In a command: the receiver; in an inbox: the sender.
    pub peer: Peer,
    /// The sender's mark, for accounting.
    pub kind: u8,
    /// The content.
    pub data: Vec<u8>,
}

/// The other end of a parcel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Peer {
    /// One agent.
    One(AgentId),
    /// Everybody in contact (as a receiver only).
    Everybody,
}

/// The contacts of one tick, found out pair by pair when they are asked for.
///
/// Positions do not change between the phases look and communicate, so a table serves the whole tick.
#[derive(Debug, Clone)]
pub struct ContactTable {
    positions: Vec<Point3<f64>>,
    known: Vec<Option<bool>>,
}

impl ContactTable {
    /// A table for bodies at `positions` (metres, frame `map`), by agent.
    #[must_use]
    pub fn new(positions: Vec<Point3<f64>>) -> Self {
        let agents = positions.len();
        Self { positions, known: vec![None; agents * agents] }
    }

    /// The agents in contact with `agent`, ascending.
    pub fn of(&mut self, agent: AgentId, model: &CommsModel, terrain: &Grid<Terrain>) -> Vec<AgentId> {
        (0..self.positions.len())
            .map(AgentId::from_index)
            .filter(|&other| other != agent && self.in_contact(agent, other, model, terrain))
            .collect()
    }

    /// Whether two different agents are in contact.
    pub fn in_contact(&mut self, one: AgentId, other: AgentId, model: &CommsModel, terrain: &Grid<Terrain>) -> bool {
        let (low, high) = if one < other { (one.index(), other.index()) } else { (other.index(), one.index()) };
        let slot = low * self.positions.len() + high;
        if let Some(known) = self.known[slot] {
            return known;
        }
        let (from, to) = (self.positions[low], self.positions[high]);
        let heard = (to - from).norm() <= model.range_m && line_of_sight(terrain, &from, &to);
        self.known[slot] = Some(heard);
        heard
    }
}
