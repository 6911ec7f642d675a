//! The reply of a controller: motion, scans, messages, relays, and the next wake-up condition.
//!
//! Lengths in metres, angles in radians, frame `map` unless a name says otherwise.

use std::f64::consts::{PI, TAU};

use msgs::ids::AgentId;
use msgs::limits::INFO_BYTES_MAX;
pub use msgs::message_type::MessageType;
use msgs::relay_id::RelayId;
pub use msgs::scan_request::ScanRequest;
use msgs::shared_bytes::SharedBytes;
pub use msgs::stage::Stage;
pub use msgs::wake_condition::WakeCondition;
use nalgebra::{Point3, Vector3};

/// A task for the body. A new task starts from rest.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum Motion {
    /// Continue the present task.
    #[default]
    Keep,
    /// End the present task, at rest at once.
    Stop,
    /// Straight along the heading, raised by `pitch_rad`, for `distance_m` (infinity: until a
    /// collision).
    Move {
        /// Elevation above the horizontal, -pi/2 ..= pi/2.
        pitch_rad: f64,
        /// At least 0.
        distance_m: f64,
    },
    /// Turn about the vertical, positive to the left, -2 pi ..= 2 pi.
    Turn {
        /// Radians.
        angle_rad: f64,
    },
    /// Visit 1 to 1024 waypoints in sequence (metres, frame `map`).
    Path(Vec<Point3<f64>>),
    /// Hold a velocity, clamped to the limits of the body.
    Velocity {
        /// Frame of the body: x forward, y left, z up; m/s.
        linear_in_body_m_s: Vector3<f64>,
        /// Positive to the left.
        yaw_rate_rad_s: f64,
        /// Where that is to lead, for people: at most 1024 points, metres, frame `map`; it moves
        /// nothing.
        path: Vec<Point3<f64>>,
    },
}

impl Motion {
    /// Straight along the heading, raised by `pitch_rad` (-pi/2 ..= pi/2), for `distance_m`
    /// (infinity: until a collision).
    #[must_use]
    pub fn straight(pitch_rad: f64, distance_m: f64) -> Self {
        Self::Move { pitch_rad, distance_m }
    }

    /// Turn to the heading at which a turn by `angle_rad` ends, the shorter way round; half a turn
    /// goes to the right.
    #[must_use]
    pub fn turn(angle_rad: f64) -> Self {
        Self::Turn { angle_rad: angle_rad - TAU * libm::floor((angle_rad + PI) / TAU) }
    }
}

/// A message to other agents (`maes_msgs/AgentMessage`).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AgentMessage {
    /// The receiver; `None`: all agents in contact.
    pub to: Option<AgentId>,
    /// The sender's mark, by which messages are distinguished and counted.
    pub kind: u8,
    /// At most 57344 bytes over all messages and relay commands of a command.
    pub data: SharedBytes,
}

/// A command to a relay: to be dropped, or to store other bytes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RelayOrder {
    /// The relay; `None`: drop one at the position of the body.
    pub relay: Option<RelayId>,
    /// The mark of the content.
    pub kind: u8,
    /// The new content; at most 4096 bytes.
    pub data: SharedBytes,
}

/// The reply to an observation.
#[derive(Debug, Clone, PartialEq)]
pub struct Command {
    /// Task of the body.
    pub motion: Motion,
    /// Request to the LiDAR.
    pub lidar: ScanRequest,
    /// Whether the next observation includes the view of the last scan.
    pub want_view: bool,
    /// Messages to send in this tick.
    pub messages: Vec<AgentMessage>,
    /// Relay commands of this tick.
    pub relays: Vec<RelayOrder>,
    /// When the controller is due next.
    pub wake: WakeCondition,
    /// What the agent is busy with from now on; `None`: unchanged.
    pub stage: Option<Stage>,
    /// A text for people, at most 1024 bytes; empty: unchanged.
    pub info: String,
}

impl Command {
    /// Continues the present task until `wake` fires.
    #[must_use]
    pub fn keep(wake: WakeCondition) -> Self {
        Self::new(Motion::Keep, wake)
    }

    /// Starts a task; everything else is unchanged.
    #[must_use]
    pub fn new(motion: Motion, wake: WakeCondition) -> Self {
        Self {
            motion,
            lidar: ScanRequest::Keep,
            want_view: false,
            messages: Vec::new(),
            relays: Vec::new(),
            wake,
            stage: None,
            info: String::new(),
        }
    }

    /// Adds a message: `kind` is the type of the content (not
    /// [`MessageType::Map`]), `to` the receiver (`None`: all
    /// agents in contact).
    #[must_use]
    pub fn with_message(mut self, to: Option<AgentId>, kind: u8, data: impl Into<SharedBytes>) -> Self {
        self.messages.push(AgentMessage { to, kind, data: data.into() });
        self
    }

    /// Drops a relay that stores these bytes, unless the agent has none left.
    #[must_use]
    pub fn with_relay(mut self, kind: u8, data: impl Into<SharedBytes>) -> Self {
        self.relays.push(RelayOrder { relay: None, kind, data: data.into() });
        self
    }

    /// Replaces the content of a relay in reach.
    #[must_use]
    pub fn with_relay_update(mut self, relay: RelayId, kind: u8, data: impl Into<SharedBytes>) -> Self {
        self.relays.push(RelayOrder { relay: Some(relay), kind, data: data.into() });
        self
    }

    /// Names what the agent is busy with from now on.
    #[must_use]
    pub fn with_stage(self, stage: Stage) -> Self {
        Self { stage: Some(stage), ..self }
    }

    /// Sets the text for people, cut at [`msgs::limits::INFO_BYTES_MAX`].
    #[must_use]
    pub fn with_info(mut self, info: impl Into<String>) -> Self {
        self.info = info.into();
        let end = (0..=INFO_BYTES_MAX.min(self.info.len())).rev().find(|&end| self.info.is_char_boundary(end));
        self.info.truncate(end.unwrap_or(0));
        self
    }

    /// Requests the view of the last scan in the next observation.
    #[must_use]
    pub fn with_view_request(mut self) -> Self {
        self.want_view = true;
        self
    }

    /// Whether the run is the same without it: between its wake-ups the server ignores such a
    /// command, its wake-up condition included.
    #[must_use]
    pub fn is_noop(&self) -> bool {
        self.motion == Motion::Keep
            && self.lidar == ScanRequest::Keep
            && !self.want_view
            && self.messages.is_empty()
            && self.relays.is_empty()
            && self.stage.is_none()
            && self.info.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shorter_turn_ends_at_the_same_heading() {
        for degrees in -720..=720 {
            let angle_rad = f64::from(degrees) * PI / 180.0;
            let Motion::Turn { angle_rad: shorter } = Motion::turn(angle_rad) else { panic!() };
            assert!(shorter.abs() <= PI + 1e-12);
            let turns = (angle_rad - shorter) / TAU;
            assert!((turns - turns.round()).abs() < 1e-9);
        }
    }

    #[test]
    fn a_stage_alone_is_an_act() {
        let keep = Command::keep(WakeCondition::NEXT_TICK);
        assert!(keep.is_noop() && !keep.with_stage(Stage::Waiting).is_noop());
    }

    #[test]
    fn info_is_cut_at_a_character_boundary() {
        let said = Command::keep(WakeCondition::NEXT_TICK).with_info("\u{e9}".repeat(INFO_BYTES_MAX));
        assert_eq!(said.info.len(), INFO_BYTES_MAX / 2 * 2);
        assert_eq!(Command::keep(WakeCondition::NEXT_TICK).with_info("short").info, "short");
    }
}
