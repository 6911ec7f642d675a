//! What a world is told and tells: actions of agents, what they learn, what happens to them, and running totals.
//!
//! This module does nothing: see [`super::World`].

use std::collections::BTreeMap;

use msgs::ids::{AgentId, Tick};
use msgs::relay_id::RelayId;
use msgs::scan_request::ScanRequest;
use nalgebra::{Point3, Vector3};

use super::body::{Collision, Motion, Pose};
use super::comms::AgentMessage;
use super::lidar::ScanView;

/// Things that can happen to an agent between two observations: a set of the bits of `maes_msgs/Wake`.
pub type Events = u8;
/// The task has ended.
pub const TASK_DONE: Events = msgs::maes_msgs::Wake::TASK_DONE;
/// A motion was refused.
pub const COLLISION: Events = msgs::maes_msgs::Wake::COLLISION;
/// The centre of the body has entered another cell.
pub const NEW_CELL: Events = msgs::maes_msgs::Wake::NEW_CELL;
/// The contacts differ from those of the last observation.
pub const CONTACTS: Events = msgs::maes_msgs::Wake::CONTACTS;
/// A message has arrived.
pub const PARCEL: Events = msgs::maes_msgs::Wake::PARCEL;

/// What the world does for an agent in one tick: a command, without its wake condition.
#[derive(Debug, Clone, PartialEq)]
pub struct Action {
    /// Task of the body.
    pub motion: Motion,
    /// Request to the LiDAR.
    pub lidar: ScanRequest,
    /// Whether the next observation is to hold the view of the last scan.
    pub want_view: bool,
    /// To send in this tick.
    pub messages: Vec<AgentMessage>,
}

impl Action {
    /// What becomes of an agent that does not answer any more: its body stops, and its LiDAR is off where agents decide about it;
    /// a schedule that takes turns goes on scanning for it.
    pub const LOST: Self =
        Self { motion: Motion::Stop, lidar: ScanRequest::Never, want_view: false, messages: Vec::new() };
}

/// What an agent learns. Cell lists are ascending indices.
#[derive(Debug, Clone, PartialEq)]
pub struct Observation {
    /// The tick it is of.
    pub tick: Tick,
    /// Whom it is for.
    pub agent: AgentId,
    /// Own pose.
    pub pose: Pose,
    /// Own velocity, m/s, frame `map`.
    pub velocity_in_map_m_s: Vector3<f64>,
    /// Own turn rate, rad/s.
    pub yaw_rate_rad_s: f64,
    /// Whether a task is under way.
    pub is_active: bool,
    /// Collision of the last motion that was tried.
    pub collision: Option<Collision>,
    /// What has happened since the last observation.
    pub events: Events,
    /// Agents in contact and where they are, ascending.
    pub contacts: Vec<(AgentId, Point3<f64>)>,
    /// Relays in reach and where they are, ascending.
    pub relays: Vec<(RelayId, Point3<f64>)>,
    /// Arrived since the last observation.
    pub messages: Vec<AgentMessage>,
    /// Tick of the last scan.
    pub scan_tick: Option<Tick>,
    /// Free cells seen for the first time since the last observation.
    pub seen_free: Vec<u32>,
    /// Walls seen for the first time since the last observation.
    pub seen_wall: Vec<u32>,
    /// The last scan as a whole, on request.
    pub view: Option<ScanView>,
}

/// How much of what an agent has not been told yet an observation takes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Commit {
    /// Everything since the last observation that counted.
    Committed,
    /// Only what is new since the agent was last asked, for an agent that is asked out of turn.
    Speculative,
}

/// Running totals of a world, for the result of a run.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Totals {
    /// Scans that were due.
    pub scans: u64,
    /// Scans that were cast: the others were of a body that had not moved.
    pub scans_cast: u64,
    /// Motions refused.
    pub collisions: u64,
    /// Parcels sent, one for each receiver named or in contact.
    pub parcels_sent: u64,
    /// Parcels delivered.
    pub parcels_delivered: u64,
    /// Parcels lost because the receiver was out of contact.
    pub parcels_out_of_contact: u64,
    /// Parcels lost because the receiver's inbox was full.
    pub parcels_inbox_full: u64,
    /// Parcels lost by chance.
    pub parcels_lost_radio: u64,
    /// Parcels lost because too much waited to be sent.
    pub parcels_queue_full: u64,
    /// Relays left behind.
    pub relays_left: u64,
    /// Relays that agents wanted to leave and did not have.
    pub relays_refused: u64,
    /// How often relays were written on after they were left.
    pub relay_writings: u64,
    /// How often that failed, because the relay was out of reach or is none.
    pub relay_writings_lost: u64,
    /// How often agents were told what relays keep.
    pub relay_readings: u64,
    /// Bytes delivered.
    pub parcel_bytes_delivered: u64,
    /// The same by the sender's mark.
    pub parcel_bytes_by_kind: BTreeMap<u8, u64>,
}
