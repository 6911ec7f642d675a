//! The observation of an agent: what it senses and receives, at each request.
//!
//! The message is `maes_msgs/Observation`, in [`fragments`] of bounded size. Lengths in metres,
//! angles in radians, frame `map` unless a name says otherwise.

pub mod fragments;

use msgs::ids::{AgentId, Tick};
use nalgebra::{Point3, Vector3};

pub use crate::agent_message::{AgentMessage, Peer};
pub use crate::energy::Energy;
use crate::event_mask::EventMask;
pub use crate::field_of_view::FieldOfView;
pub use crate::map_frame::MapFrame;
use crate::relay_id::RelayId;
pub use crate::run_info::RunInfo;

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

/// A relay in reach, to read from and to write to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Relay {
    /// Its id, which includes the agent that dropped it.
    pub id: RelayId,
    /// Its position, metres.
    pub position: Point3<f64>,
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
    /// The tick it was taken in.
    pub tick: Tick,
    /// The observing agent.
    pub agent: AgentId,
    /// The measured pose of the body.
    pub pose: Pose,
    /// Velocity of the body, m/s.
    pub velocity_in_map_m_s: Vector3<f64>,
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
    /// Messages received since the last observation, in order of arrival, and contents of relays in
    /// reach that the agent has not read yet.
    pub messages: Vec<AgentMessage>,
    /// Tick of the last scan.
    pub scan_tick: Option<Tick>,
    /// Cells seen for the first time since the last observation.
    pub seen: Cells,
    /// All cells of the last scan, if the last command requested them.
    pub view: Option<Cells>,
    /// The energy of the body, if bodies need any: a message of [`Peer::Server`].
    pub energy: Option<Box<Energy>>,
    /// Where the maps of others are on the own one, as far as they are elsewhere: those of agents
    /// in contact or with messages here, ascending; a message of [`Peer::Server`].
    pub map_frames: Vec<MapFrame>,
    /// What the LiDAR sees of its surroundings, if that is not all around: a message of
    /// [`Peer::Server`].
    pub field_of_view: Option<FieldOfView>,
    /// The run info that holds from now on, if it has changed: a message of [`Peer::Server`] that
    /// has reached the agent. Controllers never see it: the agent adopts it before.
    pub change: Option<Box<RunInfo>>,
}

/// Whether an observation is committed or speculative. An agent that is asked ahead of its wake-up
/// condition (look-ahead) gets a speculative one, which leaves the pending observation as it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RequestKind {
    /// It contains everything since the last committed observation, and clears it.
    Scheduled,
    /// It contains only what is new since the last observation of either kind, and clears nothing.
    Polled,
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
        let mut map_frames = self.map_frames;
        let is_listed = |frame: &MapFrame| map_frames.iter().any(|later| later.agent == frame.agent);
        let only_earlier: Vec<MapFrame> = earlier.map_frames.into_iter().filter(|frame| !is_listed(frame)).collect();
        map_frames.extend(only_earlier);
        map_frames.sort_by_key(|frame| frame.agent);
        Self {
            map_frames,
            events: earlier.events | self.events,
            messages,
            change: self.change.or(earlier.change),
            seen: Cells {
                free: together(earlier.seen.free, self.seen.free),
                wall: together(earlier.seen.wall, self.seen.wall),
            },
            ..self
        }
    }
}
