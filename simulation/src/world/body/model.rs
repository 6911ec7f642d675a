//! What bodies can do: the kinds and their parameters, with the defaults of each kind.
//!
//! This module checks nothing: see [`crate::scenario::Scenario::parse`].

use std::f64::consts::TAU;

use serde::{Deserialize, Serialize};

/// How a body moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BodyKind {
    /// The reference's: it turns first, and then moves along its heading.
    #[default]
    Submarine,
    /// It moves in any direction at once, and turns on its way.
    Aerial,
}

/// What a body can do: the table `[body]` of a scenario, in which keys that are left out are those of its kind.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(from = "BodyKeys")]
pub struct BodyModel {
    /// How it moves. Not written where it is the default, so that scenarios without other bodies stay the same, byte for byte.
    #[serde(skip_serializing_if = "is_submarine")]
    pub kind: BodyKind,
    /// Radius of the sphere.
    pub radius_m: f64,
    /// Top speed along the path.
    pub speed_max_m_s: f64,
    /// How fast it speeds up.
    pub acceleration_m_s2: f64,
    /// How fast it brakes.
    pub deceleration_m_s2: f64,
    /// Top turn rate.
    pub turn_rate_max_rad_s: f64,
    /// How fast a turn speeds up.
    pub turn_acceleration_rad_s2: f64,
    /// How fast a turn brakes.
    pub turn_deceleration_rad_s2: f64,
}

impl BodyModel {
    /// The reference's constants; there the turn is 100, 50 and 25 degrees.
    pub const SUBMARINE: Self = Self {
        kind: BodyKind::Submarine,
        radius_m: 0.4,
        speed_max_m_s: 1.5,
        acceleration_m_s2: 0.5,
        deceleration_m_s2: 0.25,
        turn_rate_max_rad_s: TAU * 100.0 / 360.0,
        turn_acceleration_rad_s2: TAU * 50.0 / 360.0,
        turn_deceleration_rad_s2: TAU * 25.0 / 360.0,
    };

    /// A small multicopter indoors.
    pub const AERIAL: Self = Self {
        kind: BodyKind::Aerial,
        radius_m: 0.4,
        speed_max_m_s: 3.0,
        acceleration_m_s2: 2.0,
        deceleration_m_s2: 2.0,
        turn_rate_max_rad_s: 2.0,
        turn_acceleration_rad_s2: 4.0,
        turn_deceleration_rad_s2: 4.0,
    };

    /// What a body of a kind can do unless it is said.
    #[must_use]
    pub fn of(kind: BodyKind) -> Self {
        match kind {
            BodyKind::Submarine => Self::SUBMARINE,
            BodyKind::Aerial => Self::AERIAL,
        }
    }

    /// The keys of a scenario that have numbers, with what they are here.
    #[must_use]
    pub fn numbers(&self) -> [(&'static str, f64); 7] {
        [
            ("radius_m", self.radius_m),
            ("speed_max_m_s", self.speed_max_m_s),
            ("acceleration_m_s2", self.acceleration_m_s2),
            ("deceleration_m_s2", self.deceleration_m_s2),
            ("turn_rate_max_rad_s", self.turn_rate_max_rad_s),
            ("turn_acceleration_rad_s2", self.turn_acceleration_rad_s2),
            ("turn_deceleration_rad_s2", self.turn_deceleration_rad_s2),
        ]
    }
}

impl Default for BodyModel {
    fn default() -> Self {
        Self::SUBMARINE
    }
}

fn is_submarine(kind: &BodyKind) -> bool {
    *kind == BodyKind::Submarine
}

/// The keys of a body as they are written, each of which can be left out.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BodyKeys {
    #[serde(skip_serializing_if = "Option::is_none")]
    kind: Option<BodyKind>,
    #[serde(skip_serializing_if = "Option::is_none")]
    radius_m: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    speed_max_m_s: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    acceleration_m_s2: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    deceleration_m_s2: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    turn_rate_max_rad_s: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    turn_acceleration_rad_s2: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    turn_deceleration_rad_s2: Option<f64>,
}

impl BodyKeys {
    /// The body that differs in these keys from another one, or from what is usual for its kind if it is of another kind.
    #[must_use]
    pub fn over(&self, other: &BodyModel) -> BodyModel {
        let kind = self.kind.unwrap_or(other.kind);
        let usual = if kind == other.kind { *other } else { BodyModel::of(kind) };
        BodyModel {
            kind,
            radius_m: self.radius_m.unwrap_or(usual.radius_m),
            speed_max_m_s: self.speed_max_m_s.unwrap_or(usual.speed_max_m_s),
            acceleration_m_s2: self.acceleration_m_s2.unwrap_or(usual.acceleration_m_s2),
            deceleration_m_s2: self.deceleration_m_s2.unwrap_or(usual.deceleration_m_s2),
            turn_rate_max_rad_s: self.turn_rate_max_rad_s.unwrap_or(usual.turn_rate_max_rad_s),
            turn_acceleration_rad_s2: self.turn_acceleration_rad_s2.unwrap_or(usual.turn_acceleration_rad_s2),
            turn_deceleration_rad_s2: self.turn_deceleration_rad_s2.unwrap_or(usual.turn_deceleration_rad_s2),
        }
    }
}

impl From<BodyKeys> for BodyModel {
    fn from(keys: BodyKeys) -> Self {
        keys.over(&Self::SUBMARINE)
    }
}

impl From<BodyModel> for BodyKeys {
    fn from(body: BodyModel) -> Self {
        Self {
            kind: Some(body.kind),
            radius_m: Some(body.radius_m),
            speed_max_m_s: Some(body.speed_max_m_s),
            acceleration_m_s2: Some(body.acceleration_m_s2),
            deceleration_m_s2: Some(body.deceleration_m_s2),
            turn_rate_max_rad_s: Some(body.turn_rate_max_rad_s),
            turn_acceleration_rad_s2: Some(body.turn_acceleration_rad_s2),
            turn_deceleration_rad_s2: Some(body.turn_deceleration_rad_s2),
        }
    }
}
