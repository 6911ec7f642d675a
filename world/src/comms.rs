//! The contact models of the radios.
//!
//! Contact is symmetric and depends on the positions of the two radios and on the terrain alone;
//! bodies do not block it (as in MAES3D, which casts lines against the map only). The assumptions
//! of each model: docs/communication.md.
//!
//! Messages are delivered in `radio_medium.rs`.

mod contact_table;

use nalgebra::Point3;
use serde::{Deserialize, Serialize};
use voxels::{Grid, Terrain, length_in_walls_m, line_of_sight};

pub use contact_table::{ContactRules, ContactTable, Radio};

/// The condition under which two radios are in contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ContactModel {
    /// No wall cell lies on the straight line between them, and their distance is within range.
    LineOfSightAndRange {
        /// Greatest distance, metres; infinity: as far as the line of sight.
        range_m: f64,
    },
    /// Their distance is within range, whatever lies between them.
    Range {
        /// Greatest distance, metres.
        range_m: f64,
    },
    /// Always.
    Global,
    /// The received power reaches the threshold.
    Attenuated(PathLoss),
}

/// The path loss model `[communication.attenuation]`: log-distance loss in the open plus
/// log-distance loss of the length inside walls. The defaults are those of IR2
/// (docs/communication.md).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PathLoss {
    /// Transmit power, dBm.
    pub tx_dbm: f64,
    /// Receiver sensitivity, dBm.
    pub threshold_dbm: f64,
    /// Path loss over the reference distance in the open, dB.
    pub reference_loss_db: f64,
    /// The reference distance, metres.
    pub reference_m: f64,
    /// Path loss exponent in the open.
    pub free_exponent: f64,
    /// Path loss exponent inside walls.
    pub wall_exponent: f64,
    /// Reference length inside walls, metres: walls of this length cost `3.01 * wall_exponent` dB.
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
    /// Received power over `distance_m`, `in_walls_m` of which lie inside walls, dBm. It never
    /// exceeds the transmit power.
    #[must_use]
    pub fn received_dbm(&self, distance_m: f64, in_walls_m: f64) -> f64 {
        let free_db = self.reference_loss_db + 10.0 * self.free_exponent * libm::log10(distance_m / self.reference_m);
        let wall_db = 10.0 * self.wall_exponent * libm::log10(1.0 + in_walls_m / self.wall_reference_m);
        self.tx_dbm - free_db.max(0.0) - wall_db
    }

    /// Range in the open, metres; negative if nothing can be received.
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
    /// Whether radios at two positions (metres, frame `map`) are in contact.
    #[must_use]
    pub fn joins(&self, terrain: &Grid<Terrain>, one: &Point3<f64>, other: &Point3<f64>) -> bool {
        let distance_m = (other - one).norm();
        match self {
            Self::LineOfSightAndRange { range_m } => distance_m <= *range_m && line_of_sight(terrain, one, other),
            Self::Range { range_m } => distance_m <= *range_m,
            Self::Global => true,
            Self::Attenuated(loss) => {
                // Walls are measured only if the received power in the open suffices.
                let is_enough = |in_walls_m| loss.received_dbm(distance_m, in_walls_m) >= loss.threshold_dbm;
                is_enough(0.0) && is_enough(length_in_walls_m(terrain, one, other))
            }
        }
    }
}

/// The contact model and the properties of the radios and relays.
#[derive(Debug, Clone, PartialEq)]
pub struct Comms {
    /// The contact model.
    pub contact: ContactModel,
    /// Probability that a message is lost on its way to one receiver, 0 ..= 1.
    pub loss: f64,
    /// Transmit rate of each agent, bytes/s; infinity: unlimited.
    pub bytes_per_s: f64,
    /// Capacity of an agent's transmit queue, bytes.
    pub queue_bytes: u64,
    /// Relays that each agent can deploy, at most [`protocol::limits::RELAYS_PER_AGENT_MAX`].
    pub relays_per_agent: u32,
    /// Distance within which a relay in contact can be read and written, metres; infinity: contact
    /// suffices.
    pub relay_read_range_m: f64,
    /// Seed of the packet loss.
    pub seed: u64,
}

impl Comms {
    /// Radios without loss, delay or limit, and no relays.
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

#[cfg(test)]
mod tests;
