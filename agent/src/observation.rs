//! What an agent knows: the run info at the start, and an observation at each request.
//!
//! Lengths in metres, angles in radians, frame `map` unless a name says otherwise.

use msgs::event_mask::EventMask;
use msgs::ids::{AgentId, Tick};
use msgs::relay_id::RelayId;
use msgs::shared_bytes::SharedBytes;
use nalgebra::{Point3, Vector3};
use voxels::Extent;

use crate::bodies::{Bodies, BodyModel};

/// The static information on a run.
#[derive(Debug, Clone, PartialEq)]
pub struct RunInfo {
    /// Duration of the run at most.
    pub duration: Tick,
    /// Extent of the map.
    pub extent: Extent,
    /// Number of agents; their ids are 0 .. agents - 1.
    pub agents: u32,
    /// Seed of the agents' random streams.
    pub agents_seed: u64,
    /// The controller, unless the process is started with another one.
    pub controller: String,
    /// Settings of that controller, `KEY=VALUE`.
    pub settings: Vec<String>,
    /// The bodies of the team.
    pub bodies: Bodies,
    /// Greatest range of the LiDAR, metres; infinity: unlimited.
    pub lidar_range_m: f64,
    /// Ticks between scans by default.
    pub lidar_period_ticks: u32,
    /// Greatest distance of agents in contact, metres; infinity: limited by line of sight alone.
    pub communication_range_m: f64,
    /// Number of relays that each agent can drop.
    pub relays_per_agent: u32,
    /// Ticks between map exchanges with agents in contact; 0: agents only receive.
    pub share_period_ticks: u32,
}

/// Position and heading of a body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// Centre of the body, metres.
    pub position: Point3<f64>,
    /// Heading: 0 along x, positive to the left, in (-pi, pi].
    pub yaw_rad: f64,
}

/// The side on which a body collided.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Surface {
    /// Beside the body.
    Wall,
    /// Below the body.
    Floor,
    /// Above the body.
    Ceiling,
}

/// A collision.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Collision {
    /// The side of the body.
    pub surface: Surface,
    /// Whether the obstacle was another agent.
    pub with_agent: bool,
}

/// An agent in contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Contact {
    /// The id of the agent.
    pub agent: AgentId,
    /// Its position, metres.
    pub position: Point3<f64>,
}

/// A message from another agent (`maes_msgs/AgentMessage`).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ReceivedMessage {
    /// The sender.
    pub from: AgentId,
    /// The sender's mark.
    pub kind: u8,
    /// The content.
    pub data: SharedBytes,
}

/// A relay in reach, to read from and to write to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Relay {
    /// Its id, which includes the agent that dropped it.
    pub id: RelayId,
    /// Its position, metres.
    pub position: Point3<f64>,
}

/// The content of a relay.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Reading {
    /// The relay.
    pub relay: RelayId,
    /// The writer's mark.
    pub kind: u8,
    /// The content.
    pub data: SharedBytes,
}

/// Cells by index, ascending.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Cells {
    /// Free cells.
    pub free: Vec<u32>,
    /// Walls.
    pub wall: Vec<u32>,
}

/// An observation.
#[derive(Debug, Clone, PartialEq)]
pub struct Observation {
    /// The tick of the observation.
    pub tick: Tick,
    /// Pose of the body.
    pub pose: Pose,
    /// Velocity of the body, m/s.
    pub velocity_m_s: Vector3<f64>,
    /// Turn rate, rad/s, positive to the left.
    pub yaw_rate_rad_s: f64,
    /// Whether a task is under way.
    pub is_active: bool,
    /// The collision that ended the last motion, if any.
    pub collision: Option<Collision>,
    /// Events since the last observation: bits of `maes_msgs/WakeCondition`.
    pub events: EventMask,
    /// Agents in contact, ascending.
    pub contacts: Vec<Contact>,
    /// Relays in reach, ascending.
    pub relays: Vec<Relay>,
    /// Messages received since the last observation.
    pub messages: Vec<ReceivedMessage>,
    /// Contents of relays in reach that the agent has not read yet.
    pub readings: Vec<Reading>,
    /// Tick of the last scan.
    pub scan_tick: Option<Tick>,
    /// Cells seen for the first time since the last observation.
    pub seen: Cells,
    /// All cells of the last scan, if the last command requested them.
    pub view: Option<Cells>,
    /// The run info that holds from now on, if it has changed. Controllers never see it: the agent
    /// adopts it before.
    pub change: Option<Box<RunInfo>>,
}

impl RunInfo {
    /// The smallest run: one agent in a map of one cell, with everything unlimited and off. The
    /// settings of a controller are checked without a run, and so with this one.
    ///
    /// # Panics
    /// Never: a map of one cell is legal.
    #[must_use]
    pub fn smallest() -> Self {
        Self {
            duration: Tick::ZERO,
            extent: Extent::new([1; 3], 1.0).expect("a map of one cell is legal"),
            agents: 1,
            agents_seed: 0,
            controller: String::new(),
            settings: Vec::new(),
            bodies: Bodies::new(vec![BodyModel::SUBMARINE], vec![0]).expect("the agent has the only body"),
            lidar_range_m: f64::INFINITY,
            lidar_period_ticks: 1,
            communication_range_m: f64::INFINITY,
            relays_per_agent: 0,
            share_period_ticks: 0,
        }
    }

    /// The controller with its settings, as the agents that run it are labelled.
    #[must_use]
    pub fn controller_label(&self) -> String {
        std::iter::once(self.controller.as_str())
            .chain(self.settings.iter().map(String::as_str))
            .collect::<Vec<_>>()
            .join(" ")
    }
}

impl Observation {
    /// This observation, merged with an earlier one that was not processed.
    #[must_use]
    pub fn merged_with(self, earlier: Self) -> Self {
        let together = |earlier: Vec<u32>, later: Vec<u32>| {
            if earlier.is_empty() {
                return later;
            }
            let mut cells = earlier;
            cells.extend(later);
            // Both halves ascend, which the stable sort exploits.
            cells.sort();
            cells
        };
        let mut messages = earlier.messages;
        messages.extend(self.messages);
        let mut readings = earlier.readings;
        readings.extend(self.readings);
        Self {
            events: earlier.events | self.events,
            messages,
            readings,
            change: self.change.or(earlier.change),
            seen: Cells {
                free: together(earlier.seen.free, self.seen.free),
                wall: together(earlier.seen.wall, self.seen.wall),
            },
            ..self
        }
    }
}
