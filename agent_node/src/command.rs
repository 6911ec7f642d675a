//! What an agent answers.
//!
//! Lengths in metres, angles in radians, frame `map` unless a name says otherwise.

use std::f64::consts::{PI, TAU};

use msgs::ids::{AgentId, Tick};
use msgs::limits::INFO_BYTES_MAX;
use msgs::maes_msgs::Wake as Events;
use msgs::relay_id::RelayId;
use nalgebra::{Point3, Vector3};

/// A task for the body. One that replaces another starts from rest.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum Motion {
    /// Go on with the present task.
    #[default]
    Keep,
    /// End the present task, at rest at once.
    Stop,
    /// Straight along the heading, raised by `pitch_rad` (-pi/2 ..= pi/2), for `distance_m` (infinity: until a collision).
    Move {
        /// Elevation above the horizontal.
        pitch_rad: f64,
        /// At least 0.
        distance_m: f64,
    },
    /// Turn about the vertical, positive to the left, -2 pi ..= 2 pi.
    Turn {
        /// How far.
        angle_rad: f64,
    },
    /// Visit 1 to 1024 way-points in turn.
    Path(Vec<Point3<f64>>),
    /// Hold a velocity, clamped to what the body can do.
    Velocity {
        /// In the frame of the body: x forward, y left, z up; m/s.
        linear_in_body_m_s: Vector3<f64>,
        /// Positive to the left.
        yaw_rate_rad_s: f64,
    },
}

impl Motion {
    /// Straight along the heading, raised by `pitch_rad` (-pi/2 ..= pi/2), for `distance_m` (infinity: until a collision).
    #[must_use]
    pub fn straight(pitch_rad: f64, distance_m: f64) -> Self {
        Self::Move { pitch_rad, distance_m }
    }

    /// Turn to where a turn by `angle_rad` ends, by the shorter way; half a turn goes to the right.
    #[must_use]
    pub fn turn(angle_rad: f64) -> Self {
        Self::Turn { angle_rad: angle_rad - TAU * libm::floor((angle_rad + PI) / TAU) }
    }
}

/// A request to the LiDAR.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum LidarRequest {
    /// As before; at the start: as the scenario says.
    #[default]
    Keep,
    /// No scans from now on.
    Never,
    /// One scan in the next tick.
    Once,
    /// A scan every so many ticks (at least 1), the next one in the next tick.
    Every(u32),
}

/// Bytes to send.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Parcel {
    /// To whom; `None`: everybody in contact.
    pub to: Option<AgentId>,
    /// What the bytes are, for accounting.
    pub kind: u8,
    /// The content; 57344 bytes at most over all parcels of a command.
    pub data: Vec<u8>,
}

/// Something to do with a relay. It keeps 4096 bytes at the most, which count among those of the parcels of a command.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RelayOrder {
    /// Which one; `None`: one that is left behind where the body is.
    pub relay: Option<RelayId>,
    /// What the bytes are, for who reads them.
    pub kind: u8,
    /// What it is to keep from now on.
    pub data: Vec<u8>,
}

/// When an agent wants to be asked again.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Wake {
    /// In this tick at the latest.
    pub at: Tick,
    /// Earlier, after any of these events: bits of `maes_msgs/Wake`.
    pub events: u8,
}

impl Wake {
    /// In the next tick.
    pub const NEXT_TICK: Self = Self { at: Tick::ZERO, events: 0 };

    /// Once the task has ended, by itself or by a collision.
    pub const TASK_DONE: Self = Self { at: Tick(u64::MAX), events: Events::TASK_DONE | Events::COLLISION };

    /// In a tick at the latest.
    #[must_use]
    pub fn at(tick: Tick) -> Self {
        Self { at: tick, events: 0 }
    }

    /// After any of these events, bits of `maes_msgs/Wake`.
    #[must_use]
    pub fn on(events: u8) -> Self {
        Self { at: Tick(u64::MAX), events }
    }

    /// Whether it is time to ask in a tick, after `events` (bits of `maes_msgs/Wake`) since the agent was last asked.
    #[must_use]
    pub fn is_due(&self, tick: Tick, events: u8) -> bool {
        tick >= self.at || events & self.events != 0
    }

    /// When either of two wants to be asked.
    #[must_use]
    pub fn or(self, other: Self) -> Self {
        Self { at: self.at.min(other.at), events: self.events | other.events }
    }
}

/// What an agent answers to an observation.
#[derive(Debug, Clone, PartialEq)]
pub struct Command {
    /// Task of the body.
    pub motion: Motion,
    /// Request to the LiDAR.
    pub lidar: LidarRequest,
    /// Whether the next observation is to hold the view of the last scan.
    pub want_view: bool,
    /// To send in this tick.
    pub parcels: Vec<Parcel>,
    /// Relays to leave and to write on in this tick.
    pub relays: Vec<RelayOrder>,
    /// When to ask again.
    pub wake: Wake,
    /// A text for people, at most 1024 bytes; empty: as before.
    pub info: String,
}

impl Command {
    /// Goes on as before until `wake`.
    #[must_use]
    pub fn keep(wake: Wake) -> Self {
        Self::new(Motion::Keep, wake)
    }

    /// Takes up a task, and leaves everything else as it is.
    #[must_use]
    pub fn new(motion: Motion, wake: Wake) -> Self {
        Self {
            motion,
            lidar: LidarRequest::Keep,
            want_view: false,
            parcels: Vec::new(),
            relays: Vec::new(),
            wake,
            info: String::new(),
        }
    }

    /// The same, and sends bytes: `kind` is the sender's mark (not [`crate::sharing::MAP_PARCEL`]), `to` the receiver (`None`:
    /// everybody in contact).
    #[must_use]
    pub fn sending(mut self, to: Option<AgentId>, kind: u8, data: Vec<u8>) -> Self {
        self.parcels.push(Parcel { to, kind, data });
        self
    }

    /// The same, and leaves a relay behind, which keeps these bytes. Who has none left leaves none.
    #[must_use]
    pub fn leaving_relay(mut self, kind: u8, data: Vec<u8>) -> Self {
        self.relays.push(RelayOrder { relay: None, kind, data });
        self
    }

    /// The same, and has a relay in reach keep these bytes instead of what it kept.
    #[must_use]
    pub fn writing_on(mut self, relay: RelayId, kind: u8, data: Vec<u8>) -> Self {
        self.relays.push(RelayOrder { relay: Some(relay), kind, data });
        self
    }

    /// The same, with a text for people, of which as much is kept as fits ([`msgs::limits::INFO_BYTES_MAX`]).
    #[must_use]
    pub fn saying(mut self, info: impl Into<String>) -> Self {
        self.info = info.into();
        let end = (0..=INFO_BYTES_MAX.min(self.info.len())).rev().find(|&end| self.info.is_char_boundary(end));
        self.info.truncate(end.unwrap_or(0));
        self
    }

    /// The same, and asks for the view of the last scan in the next observation.
    #[must_use]
    pub fn asking_for_view(mut self) -> Self {
        self.want_view = true;
        self
    }

    /// Whether the run would be the same without it: out of turn the server takes no notice of it, its wake included.
    #[must_use]
    pub fn does_nothing(&self) -> bool {
        self.motion == Motion::Keep
            && self.lidar == LidarRequest::Keep
            && !self.want_view
            && self.parcels.is_empty()
            && self.relays.is_empty()
            && self.info.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shorter_way_ends_at_the_same_heading() {
        for degrees in -720..=720 {
            let angle_rad = f64::from(degrees) * PI / 180.0;
            let Motion::Turn { angle_rad: way } = Motion::turn(angle_rad) else { panic!() };
            assert!(way.abs() <= PI + 1e-12);
            let turns = (angle_rad - way) / TAU;
            assert!((turns - turns.round()).abs() < 1e-9);
        }
    }

    #[test]
    fn a_text_for_people_is_cut_where_a_character_ends() {
        let said = Command::keep(Wake::NEXT_TICK).saying("\u{e9}".repeat(INFO_BYTES_MAX));
        assert_eq!(said.info.len(), INFO_BYTES_MAX / 2 * 2);
        assert_eq!(Command::keep(Wake::NEXT_TICK).saying("short").info, "short");
    }
}
