//! What an agent learns: the briefing at the start, and an observation each time it is asked.
//!
//! Lengths in metres, angles in radians, frame `map` unless a name says otherwise.

use msgs::ids::{AgentId, Tick};
use msgs::relay_id::RelayId;
use nalgebra::{Point3, Vector3};
use voxels::Extent;

use crate::body::Bodies;

/// What an agent may know of the run.
#[derive(Debug, Clone, PartialEq)]
pub struct Briefing {
    /// The run ends at this tick at the latest.
    pub duration: Tick,
    /// The map: where it lies and how many cells it has.
    pub extent: Extent,
    /// How many agents take part: ids 0 .. agents - 1.
    pub agents: u32,
    /// Seed of the agents' random numbers.
    pub agents_seed: u64,
    /// What an agent runs if it is not told otherwise.
    pub controller: String,
    /// Settings of that controller, `KEY=VALUE`.
    pub settings: Vec<String>,
    /// What the bodies of the team can do.
    pub bodies: Bodies,
    /// Greatest range of the LiDAR; infinity: unlimited.
    pub lidar_range_m: f64,
    /// Ticks between scans if the agent does not ask otherwise.
    pub lidar_period_ticks: u32,
    /// Greatest distance of agents in contact; infinity: as far as the line of sight.
    pub communication_range_m: f64,
    /// Relays that the agent can leave behind.
    pub relays_per_agent: u32,
    /// Ticks between two tellings of what is new on the map to agents in contact; 0: agents only listen.
    pub share_period_ticks: u32,
}

/// Where a body is and where it looks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// Centre of the body.
    pub position: Point3<f64>,
    /// Heading: 0 along x, positive to the left, in (-pi, pi].
    pub yaw_rad: f64,
}

/// What is beside the body where a motion was refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Surface {
    /// Beside it.
    Wall,
    /// Below it.
    Floor,
    /// Above it.
    Ceiling,
}

/// A motion that was refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Collision {
    /// Which side of the body.
    pub surface: Surface,
    /// Whether another agent was in the way.
    pub with_agent: bool,
}

/// An agent that is heard now.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Contact {
    /// Its id.
    pub agent: AgentId,
    /// Where it is.
    pub position: Point3<f64>,
}

/// Bytes that arrived.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Received {
    /// Who sent them.
    pub from: AgentId,
    /// The sender's mark.
    pub kind: u8,
    /// The content.
    pub data: Vec<u8>,
}

/// A relay that can be read and written from here.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Relay {
    /// Its name, which says who left it.
    pub id: RelayId,
    /// Where it floats.
    pub position: Point3<f64>,
}

/// What a relay keeps.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Reading {
    /// The relay.
    pub relay: RelayId,
    /// The mark of who wrote it.
    pub kind: u8,
    /// The content.
    pub data: Vec<u8>,
}

/// Cells by index, ascending.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Cells {
    /// Free ones.
    pub free: Vec<u32>,
    /// Walls.
    pub wall: Vec<u32>,
}

/// What an agent learns when it is asked.
#[derive(Debug, Clone, PartialEq)]
pub struct Observation {
    /// The tick it is of.
    pub tick: Tick,
    /// Own pose.
    pub pose: Pose,
    /// Own velocity, m/s.
    pub velocity_m_s: Vector3<f64>,
    /// Own turn rate, rad/s, positive to the left.
    pub yaw_rate_rad_s: f64,
    /// Whether a task is under way.
    pub is_active: bool,
    /// Whether the last motion that was tried was refused, and why.
    pub collision: Option<Collision>,
    /// What has happened since the last observation: bits of `maes_msgs/Wake`.
    pub events: u8,
    /// Agents in contact now, ascending.
    pub contacts: Vec<Contact>,
    /// Relays in reach now, ascending.
    pub relays: Vec<Relay>,
    /// What has arrived since the last observation.
    pub parcels: Vec<Received>,
    /// What relays in reach keep, as far as the agent has not been told.
    pub readings: Vec<Reading>,
    /// Tick of the last scan.
    pub scan_tick: Option<Tick>,
    /// Cells seen for the first time since the last observation.
    pub seen: Cells,
    /// All cells of the last scan, if the last command asked for them.
    pub view: Option<Cells>,
}

impl Observation {
    /// This observation, with the news of an earlier one that nobody has looked at.
    #[must_use]
    pub fn with_news_of(self, earlier: Self) -> Self {
        let together = |earlier: Vec<u32>, later: Vec<u32>| {
            if earlier.is_empty() {
                return later;
            }
            let mut cells = earlier;
            cells.extend(later);
            // Both halves ascend, which the stable sort makes use of.
            cells.sort();
            cells
        };
        let mut parcels = earlier.parcels;
        parcels.extend(self.parcels);
        let mut readings = earlier.readings;
        readings.extend(self.readings);
        Self {
            events: earlier.events | self.events,
            parcels,
            readings,
            seen: Cells {
                free: together(earlier.seen.free, self.seen.free),
                wall: together(earlier.seen.wall, self.seen.wall),
            },
            ..self
        }
    }
}
