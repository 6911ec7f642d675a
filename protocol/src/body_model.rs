//! The kinematic model of a body: its kind and its limits, with the defaults of each kind.
//!
//! The server moves bodies by it, agents predict travel times with it. Its serde form is the table
//! `[body]` of a scenario, its message is `maes_msgs/Body`. Values are not validated here: the
//! parser of scenarios does that.

use std::f64::consts::TAU;

use serde::{Deserialize, Serialize};
use thiserror::Error;
use voxels::{Climb, Footing};

use msgs::maes_msgs;

/// The kinematics of a body.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BodyKind {
    /// Turns on the spot, then moves along its heading; the body of MAES3D.
    #[default]
    Submarine,
    /// Accelerates in any direction and turns while it moves.
    Aerial,
    /// Stands on the floor below it and climbs steps and slopes, upright: first up, then on.
    Ground,
}

/// How a ground body moves on the floor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Drive {
    /// Turns on the spot and moves along its heading.
    #[default]
    Differential,
    /// Moves in any direction and keeps its heading.
    Holonomic,
}

/// Kind and limits of a body, a sphere.
///
/// Deserialises from the table `[body]` of a scenario, in which missing keys take the defaults of
/// the kind.
///
/// It is serialised without the kind where that is the default, and without the keys of ground
/// bodies for others, so that the text of a scenario without them stays the same, byte for byte.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(from = "BodyKeys", into = "BodyKeys")]
pub struct BodyModel {
    /// Kinematics.
    pub kind: BodyKind,
    /// Radius of the sphere, metres.
    pub radius_m: f64,
    /// Maximum speed along the path, m/s.
    pub speed_max_m_s: f64,
    /// Acceleration along the path, m/s^2.
    pub acceleration_m_s2: f64,
    /// Deceleration along the path, m/s^2.
    pub deceleration_m_s2: f64,
    /// Maximum turn rate about the vertical, rad/s.
    pub turn_rate_max_rad_s: f64,
    /// Acceleration of a turn, rad/s^2.
    pub turn_acceleration_rad_s2: f64,
    /// Deceleration of a turn, rad/s^2.
    pub turn_deceleration_rad_s2: f64,
    /// How a ground body moves.
    pub drive: Drive,
    /// Highest step that a ground body climbs, metres.
    pub step_max_m: f64,
    /// Steepest slope that a ground body climbs, radians, 0 to pi/4; see [`voxels::footing`].
    pub slope_max_rad: f64,
}

impl BodyModel {
    /// The limits of the submarine of MAES3D, where turns are 100, 50 and 25 degrees.
    pub const SUBMARINE: Self = Self {
        kind: BodyKind::Submarine,
        radius_m: 0.4,
        speed_max_m_s: 1.5,
        acceleration_m_s2: 0.5,
        deceleration_m_s2: 0.25,
        turn_rate_max_rad_s: TAU * 100.0 / 360.0,
        turn_acceleration_rad_s2: TAU * 50.0 / 360.0,
        turn_deceleration_rad_s2: TAU * 25.0 / 360.0,
        drive: Drive::Differential,
        step_max_m: 0.0,
        slope_max_rad: 0.0,
    };

    /// The limits of a small indoor multicopter.
    pub const AERIAL: Self = Self {
        kind: BodyKind::Aerial,
        radius_m: 0.4,
        speed_max_m_s: 3.0,
        acceleration_m_s2: 2.0,
        deceleration_m_s2: 2.0,
        turn_rate_max_rad_s: 2.0,
        turn_acceleration_rad_s2: 4.0,
        turn_deceleration_rad_s2: 4.0,
        ..Self::SUBMARINE
    };

    /// The limits of a small robot on wheels.
    pub const GROUND: Self = Self {
        kind: BodyKind::Ground,
        speed_max_m_s: 1.0,
        acceleration_m_s2: 1.0,
        deceleration_m_s2: 1.0,
        turn_rate_max_rad_s: 1.5,
        turn_acceleration_rad_s2: 3.0,
        turn_deceleration_rad_s2: 3.0,
        step_max_m: 0.1,
        slope_max_rad: 0.35,
        ..Self::SUBMARINE
    };

    /// The default limits of a kind.
    #[must_use]
    pub fn of(kind: BodyKind) -> Self {
        match kind {
            BodyKind::Submarine => Self::SUBMARINE,
            BodyKind::Aerial => Self::AERIAL,
            BodyKind::Ground => Self::GROUND,
        }
    }

    /// The footing of a ground body on cells with edges of `cell_m` metres; `None` for others.
    #[must_use]
    pub fn footing(&self, cell_m: f64) -> Option<Footing> {
        let climb = Climb::new(self.step_max_m, self.slope_max_rad, cell_m);
        (self.kind == BodyKind::Ground).then(|| Footing::new(self.radius_m, cell_m, climb))
    }

    /// Whether it turns on the spot towards each waypoint.
    #[must_use]
    pub fn turns_first(&self) -> bool {
        match self.kind {
            BodyKind::Submarine => true,
            BodyKind::Aerial => false,
            BodyKind::Ground => self.drive == Drive::Differential,
        }
    }

    /// The numeric keys of the table `[body]` that all kinds have, each with its value in this
    /// model.
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

/// The keys of a body in a scenario, all of them optional.
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
    #[serde(skip_serializing_if = "Option::is_none")]
    drive: Option<Drive>,
    #[serde(skip_serializing_if = "Option::is_none")]
    step_max_m: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    slope_max_rad: Option<f64>,
}

impl BodyKeys {
    /// The model with these keys; missing keys are those of `base`, or the defaults of the kind if
    /// `base` is of another kind.
    #[must_use]
    pub fn over(&self, base: &BodyModel) -> BodyModel {
        let kind = self.kind.unwrap_or(base.kind);
        let usual = if kind == base.kind { *base } else { BodyModel::of(kind) };
        BodyModel {
            kind,
            radius_m: self.radius_m.unwrap_or(usual.radius_m),
            speed_max_m_s: self.speed_max_m_s.unwrap_or(usual.speed_max_m_s),
            acceleration_m_s2: self.acceleration_m_s2.unwrap_or(usual.acceleration_m_s2),
            deceleration_m_s2: self.deceleration_m_s2.unwrap_or(usual.deceleration_m_s2),
            turn_rate_max_rad_s: self.turn_rate_max_rad_s.unwrap_or(usual.turn_rate_max_rad_s),
            turn_acceleration_rad_s2: self.turn_acceleration_rad_s2.unwrap_or(usual.turn_acceleration_rad_s2),
            turn_deceleration_rad_s2: self.turn_deceleration_rad_s2.unwrap_or(usual.turn_deceleration_rad_s2),
            drive: self.drive.unwrap_or(usual.drive),
            step_max_m: self.step_max_m.unwrap_or(usual.step_max_m),
            slope_max_rad: self.slope_max_rad.unwrap_or(usual.slope_max_rad),
        }
    }

    /// All keys of a model, its kind included.
    #[must_use]
    pub fn all(body: BodyModel) -> Self {
        Self { kind: Some(body.kind), ..body.into() }
    }
}

impl From<BodyKeys> for BodyModel {
    fn from(keys: BodyKeys) -> Self {
        keys.over(&Self::SUBMARINE)
    }
}

impl From<BodyModel> for BodyKeys {
    fn from(body: BodyModel) -> Self {
        let is_ground = body.kind == BodyKind::Ground;
        Self {
            kind: (body.kind != BodyKind::Submarine).then_some(body.kind),
            radius_m: Some(body.radius_m),
            speed_max_m_s: Some(body.speed_max_m_s),
            acceleration_m_s2: Some(body.acceleration_m_s2),
            deceleration_m_s2: Some(body.deceleration_m_s2),
            turn_rate_max_rad_s: Some(body.turn_rate_max_rad_s),
            turn_acceleration_rad_s2: Some(body.turn_acceleration_rad_s2),
            turn_deceleration_rad_s2: Some(body.turn_deceleration_rad_s2),
            drive: (is_ground || body.drive != Drive::default()).then_some(body.drive),
            step_max_m: (is_ground || body.step_max_m != 0.0).then_some(body.step_max_m),
            slope_max_rad: (is_ground || body.slope_max_rad != 0.0).then_some(body.slope_max_rad),
        }
    }
}

impl BodyModel {
    /// What a ground body can do beside what `maes_msgs/Body` says, as a setting of
    /// `maes_msgs/Scenario` says it; `None` for others.
    #[must_use]
    pub fn ground_setting(&self) -> Option<String> {
        let drive = match self.drive {
            Drive::Differential => DIFFERENTIAL,
            Drive::Holonomic => HOLONOMIC,
        };
        let Self { step_max_m, slope_max_rad, .. } = self;
        (self.kind == BodyKind::Ground).then(|| format!("{drive} {step_max_m} {slope_max_rad}"))
    }

    /// The body with what such a setting says; `None`: it is none.
    #[must_use]
    pub fn with_ground_setting(self, setting: &str) -> Option<Self> {
        let mut words = setting.split(' ');
        let drive = match words.next()? {
            DIFFERENTIAL => Drive::Differential,
            HOLONOMIC => Drive::Holonomic,
            _ => return None,
        };
        let mut number = || words.next()?.parse().ok().filter(|number: &f64| number.is_finite() && *number >= 0.0);
        let (step_max_m, slope_max_rad) = (number()?, number()?);
        let is_whole = words.next().is_none() && self.kind == BodyKind::Ground;
        is_whole.then_some(Self { drive, step_max_m, slope_max_rad, ..self })
    }
}

const DIFFERENTIAL: &str = "differential";
const HOLONOMIC: &str = "holonomic";

impl From<BodyModel> for maes_msgs::Body {
    fn from(model: BodyModel) -> Self {
        Self {
            kind: match model.kind {
                BodyKind::Submarine => Self::SUBMARINE,
                BodyKind::Aerial => Self::AERIAL,
                BodyKind::Ground => Self::GROUND,
            },
            radius_m: model.radius_m,
            speed_max_m_s: model.speed_max_m_s,
            acceleration_m_s2: model.acceleration_m_s2,
            deceleration_m_s2: model.deceleration_m_s2,
            turn_rate_max_rad_s: model.turn_rate_max_rad_s,
            turn_acceleration_rad_s2: model.turn_acceleration_rad_s2,
            turn_deceleration_rad_s2: model.turn_deceleration_rad_s2,
        }
    }
}

/// A `maes_msgs/Body` whose `kind` is none of the constants.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
#[error("kind = {kind}, 0 (submarine), 1 (aerial) or 2 (ground) is allowed")]
pub struct UnknownBodyKind {
    /// The value of the message.
    pub kind: u8,
}

impl TryFrom<&maes_msgs::Body> for BodyModel {
    type Error = UnknownBodyKind;

    fn try_from(message: &maes_msgs::Body) -> Result<Self, UnknownBodyKind> {
        Ok(Self {
            kind: match message.kind {
                maes_msgs::Body::SUBMARINE => BodyKind::Submarine,
                maes_msgs::Body::AERIAL => BodyKind::Aerial,
                maes_msgs::Body::GROUND => BodyKind::Ground,
                kind => return Err(UnknownBodyKind { kind }),
            },
            radius_m: message.radius_m,
            speed_max_m_s: message.speed_max_m_s,
            acceleration_m_s2: message.acceleration_m_s2,
            deceleration_m_s2: message.deceleration_m_s2,
            turn_rate_max_rad_s: message.turn_rate_max_rad_s,
            turn_acceleration_rad_s2: message.turn_acceleration_rad_s2,
            turn_deceleration_rad_s2: message.turn_deceleration_rad_s2,
            ..Self::SUBMARINE
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn message_round_trips() {
        for model in [BodyModel::SUBMARINE, BodyModel { radius_m: 0.2, ..BodyModel::AERIAL }] {
            assert_eq!(BodyModel::try_from(&maes_msgs::Body::from(model)), Ok(model));
        }
        let ground = BodyModel { drive: Drive::Holonomic, step_max_m: 0.3, slope_max_rad: 0.1, ..BodyModel::GROUND };
        let sent = BodyModel::try_from(&maes_msgs::Body::from(ground)).unwrap();
        let setting = ground.ground_setting().unwrap();
        assert_eq!((setting.as_str(), sent.with_ground_setting(&setting)), ("holonomic 0.3 0.1", Some(ground)));
        for wrong in ["", "hovering 0 0", "holonomic 0.3", "holonomic 0.3 NaN", "holonomic -1 0", "holonomic 0 0 0"] {
            assert_eq!(sent.with_ground_setting(wrong), None, "{wrong}");
        }
        assert_eq!(BodyModel::AERIAL.with_ground_setting(&setting), None);
        let unknown = maes_msgs::Body { kind: 3, ..BodyModel::SUBMARINE.into() };
        assert_eq!(BodyModel::try_from(&unknown), Err(UnknownBodyKind { kind: 3 }));
    }
}
