//! The motion task of a body.
//!
//! The message is `maes_msgs/Motion`. Lengths in metres, angles in radians, frame `map` unless a
//! name says otherwise.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use msgs::{geometry_msgs, maes_msgs};
use nalgebra::{Point3, Vector3};

use crate::geometry::{coordinate, point, vector, within};
use crate::limits::PATH_POINTS_MAX;

/// A task for the body. A new task starts from rest; a velocity that replaces a velocity continues
/// from the present one.
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
    /// Visit 1 to 1024 waypoints in sequence (metres, frame `map`): a submarine turns towards each
    /// and then moves straight, an aerial body moves at once.
    Path(Vec<Point3<f64>>),
    /// Hold a velocity, clamped to the limits of the body, until the next task.
    Velocity {
        /// Frame of the body: x forward, y left, z up; m/s. A submarine cannot move sideways and
        /// takes y as 0.
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

impl From<Motion> for maes_msgs::Motion {
    fn from(motion: Motion) -> Self {
        let bare = Self::default();
        let points = |path: Vec<Point3<f64>>| path.iter().map(point).collect();
        match motion {
            Motion::Keep => Self { kind: Self::KEEP, ..bare },
            Motion::Stop => Self { kind: Self::STOP, ..bare },
            Motion::Move { pitch_rad, distance_m } => Self { kind: Self::MOVE, pitch_rad, distance_m, ..bare },
            Motion::Turn { angle_rad } => Self { kind: Self::TURN, angle_rad, ..bare },
            Motion::Path(waypoints) => Self { kind: Self::PATH, path: points(waypoints), ..bare },
            Motion::Velocity { linear_in_body_m_s, yaw_rate_rad_s, path } => Self {
                kind: Self::VELOCITY,
                linear_m_s: vector(&linear_in_body_m_s),
                yaw_rate_rad_s,
                path: points(path),
                ..bare
            },
        }
    }
}

impl TryFrom<&maes_msgs::Motion> for Motion {
    type Error = String;

    /// # Errors
    /// Names the field, its value and the allowed values.
    fn try_from(motion: &maes_msgs::Motion) -> Result<Self, String> {
        use maes_msgs::Motion as Message;
        Ok(match motion.kind {
            Message::KEEP => Self::Keep,
            Message::STOP => Self::Stop,
            Message::MOVE => Self::Move {
                pitch_rad: within("motion.pitch_rad", motion.pitch_rad, -FRAC_PI_2, FRAC_PI_2)?,
                distance_m: within("motion.distance_m", motion.distance_m, 0.0, f64::INFINITY)?,
            },
            Message::TURN => Self::Turn { angle_rad: within("motion.angle_rad", motion.angle_rad, -TAU, TAU)? },
            Message::PATH if motion.path.is_empty() => {
                return Err(format!("motion.path has 0 waypoints, 1 to {PATH_POINTS_MAX} are allowed"));
            }
            Message::PATH => Self::Path(waypoints(&motion.path)?),
            Message::VELOCITY => Self::Velocity {
                linear_in_body_m_s: Vector3::new(
                    coordinate("motion.linear_m_s.x", motion.linear_m_s.x)?,
                    coordinate("motion.linear_m_s.y", motion.linear_m_s.y)?,
                    coordinate("motion.linear_m_s.z", motion.linear_m_s.z)?,
                ),
                yaw_rate_rad_s: coordinate("motion.yaw_rate_rad_s", motion.yaw_rate_rad_s)?,
                path: waypoints(&motion.path)?,
            },
            other => return Err(format!("motion.kind = {other}, 0 to 5 are allowed")),
        })
    }
}

fn waypoints(path: &[geometry_msgs::Point]) -> Result<Vec<Point3<f64>>, String> {
    if path.len() > PATH_POINTS_MAX {
        return Err(format!("motion.path has {} waypoints, at most {PATH_POINTS_MAX} are allowed", path.len()));
    }
    let waypoint = |point: &geometry_msgs::Point| {
        Ok(Point3::new(
            coordinate("motion.path x", point.x)?,
            coordinate("motion.path y", point.y)?,
            coordinate("motion.path z", point.z)?,
        ))
    };
    path.iter().map(waypoint).collect()
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
    fn message_round_trips() {
        let path = vec![Point3::new(1.0, 2.0, 3.0), Point3::new(-1.0, 0.0, 0.5)];
        for motion in [
            Motion::Keep,
            Motion::Stop,
            Motion::straight(0.5, f64::INFINITY),
            Motion::turn(-1.0),
            Motion::Path(path.clone()),
            Motion::Velocity { linear_in_body_m_s: Vector3::new(1.0, 0.5, -0.5), yaw_rate_rad_s: 0.25, path },
        ] {
            assert_eq!(Motion::try_from(&maes_msgs::Motion::from(motion.clone())), Ok(motion));
        }
    }
}
