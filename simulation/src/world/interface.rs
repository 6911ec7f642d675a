//! The interface of the world: actions and observations of agents, events, and running totals.
//!
//! Plain data; the behaviour is that of [`super::World`].

use std::collections::BTreeMap;

use msgs::event_mask::EventMask;
use msgs::ids::{AgentId, Tick};
use msgs::relay_id::RelayId;
use msgs::scan_request::ScanRequest;
use nalgebra::{Point3, Vector3};

use super::body::{Collision, Motion, Pose};
use super::comms::AgentMessage;
use super::lidar::{CastCount, ScanView};

/// What an agent does in one tick: its command without the wake-up condition.
#[derive(Debug, Clone, PartialEq)]
pub struct Action {
    /// The motion task of the body.
    pub motion: Motion,
    /// The request to the LiDAR.
    pub lidar: ScanRequest,
    /// Whether the next observation includes the view of the last scan.
    pub want_view: bool,
    /// Messages to send in this tick.
    pub messages: Vec<AgentMessage>,
}

impl Action {
    /// The action of a lost agent: its body stops, and its LiDAR is off under
    /// [`ScanSchedule::OnRequest`](super::ScanSchedule::OnRequest).
    pub const LOST: Self =
        Self { motion: Motion::Stop, lidar: ScanRequest::Never, want_view: false, messages: Vec::new() };
}

/// An observation of an agent. Cell lists are ascending indices.
#[derive(Debug, Clone, PartialEq)]
pub struct Observation {
    /// The tick it was taken in.
    pub tick: Tick,
    /// The observing agent.
    pub agent: AgentId,
    /// The measured pose of its body, metres and radians, frame `map`.
    pub pose: Pose,
    /// The velocity of its body, m/s, frame `map`.
    pub velocity_in_map_m_s: Vector3<f64>,
    /// The turn rate of its body about the vertical, rad/s, positive to the left.
    pub yaw_rate_rad_s: f64,
    /// Whether a motion task is active.
    pub is_active: bool,
    /// The collision of the last attempted motion, if there was one.
    pub collision: Option<Collision>,
    /// Events since the last observation.
    pub events: EventMask,
    /// Agents in contact with their measured positions (metres, frame `map`), ascending.
    pub contacts: Vec<(AgentId, Point3<f64>)>,
    /// Relays in reach with their positions (metres, frame `map`), ascending.
    pub relays: Vec<(RelayId, Point3<f64>)>,
    /// Messages received since the last observation, in order of arrival.
    pub messages: Vec<AgentMessage>,
    /// Tick of the last scan, `None` before the first.
    pub scan_tick: Option<Tick>,
    /// Free cells seen for the first time since the last observation.
    pub seen_free: Vec<u32>,
    /// Walls seen for the first time since the last observation.
    pub seen_wall: Vec<u32>,
    /// Everything the last scan saw, on request.
    pub view: Option<ScanView>,
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

/// Running totals of a world. The names are those of the counters in the result of a run, where
/// agent messages are called messages.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Totals {
    /// Scans that were due, and those of them that were not cast as the body has not moved
    /// ([`super::lidar::NotCast::SamePose`]).
    pub scans: CastCount,
    /// Motions refused because of a collision.
    pub collisions: u64,
    /// Messages sent, counted once per receiver.
    pub messages_sent: u64,
    /// Messages delivered.
    pub messages_delivered: u64,
    /// Messages lost because the receiver was out of contact.
    pub messages_out_of_contact: u64,
    /// Messages lost because the receiver's inbox was full.
    pub messages_inbox_full: u64,
    /// Messages lost to random packet loss.
    pub messages_lost_radio: u64,
    /// Messages lost because the sender's transmit queue was full.
    pub messages_queue_full: u64,
    /// Relays deployed.
    pub relays_left: u64,
    /// Deployments refused because the agent had no relay left.
    pub relays_refused: u64,
    /// Writes to deployed relays.
    pub relay_writings: u64,
    /// Writes that failed because the relay was out of reach or does not exist.
    pub relay_writings_lost: u64,
    /// Reads of relay content by agents.
    pub relay_readings: u64,
    /// Bytes of delivered messages.
    pub message_bytes_delivered: u64,
    /// Bytes of delivered messages by message type.
    pub message_bytes_by_kind: BTreeMap<u8, u64>,
}
