//! How the velocity of a body follows one that it is to hold: what the server simulates and agents
//! predict, so that both compute the same, bit by bit.
//!
//! Invariants: no speed, turn rate or acceleration exceeds the limits of the body; all quantities
//! stay finite.

use std::f64::consts::{PI, TAU};

use nalgebra::Vector3;

use crate::body_model::BodyModel;

impl BodyModel {
    /// The velocity with its magnitude clamped to the maximum speed.
    #[must_use]
    pub fn clamped(&self, velocity_m_s: Vector3<f64>) -> Vector3<f64> {
        let speed_m_s = velocity_m_s.norm();
        let limit_m_s = self.speed_max_m_s;
        if speed_m_s > limit_m_s { velocity_m_s * (limit_m_s / speed_m_s) } else { velocity_m_s }
    }

    /// The velocity after `dt_s` seconds on its way from `present_m_s` to `target_m_s`, within the
    /// acceleration limits.
    #[must_use]
    pub fn velocity_towards(&self, present_m_s: &Vector3<f64>, target_m_s: &Vector3<f64>, dt_s: f64) -> Vector3<f64> {
        approached(present_m_s, target_m_s, self.acceleration_m_s2 * dt_s, self.deceleration_m_s2 * dt_s)
    }

    /// The turn rate after `dt_s` seconds on its way from `present_rad_s` to `target_rad_s`, which
    /// is clamped, within the acceleration limits.
    #[must_use]
    pub fn turn_rate_towards(&self, present_rad_s: f64, target_rad_s: f64, dt_s: f64) -> f64 {
        let limit_rad_s = self.turn_rate_max_rad_s;
        approached(
            &Vector3::new(present_rad_s, 0.0, 0.0),
            &Vector3::new(target_rad_s.clamp(-limit_rad_s, limit_rad_s), 0.0, 0.0),
            self.turn_acceleration_rad_s2 * dt_s,
            self.turn_deceleration_rad_s2 * dt_s,
        )
        .x
    }
}

/// `present` moved towards `target` by at most `faster` if that accelerates, and at most `slower`
/// if it brakes.
#[must_use]
pub fn approached(present: &Vector3<f64>, target: &Vector3<f64>, faster: f64, slower: f64) -> Vector3<f64> {
    let change = target - present;
    let size = change.norm();
    let limit = if target.norm_squared() >= present.norm_squared() { faster } else { slower };
    if size <= limit { *target } else { present + change * (limit / size) }
}

/// `angle_rad` wrapped into (-pi, pi].
#[must_use]
pub fn wrapped(angle_rad: f64) -> f64 {
    if angle_rad > -PI && angle_rad <= PI {
        return angle_rad;
    }
    let turned = angle_rad - TAU * libm::floor((angle_rad + PI) / TAU);
    if turned <= -PI { turned + TAU } else { turned }
}

/// `vector` rotated about the vertical by `yaw_rad`.
#[must_use]
pub fn turned(vector: &Vector3<f64>, yaw_rad: f64) -> Vector3<f64> {
    let (sin, cos) = libm::sincos(yaw_rad);
    Vector3::new(vector.x * cos - vector.y * sin, vector.x * sin + vector.y * cos, vector.z)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_are_wrapped() {
        for (angle_rad, expected_rad) in
            [(0.0, 0.0), (PI, PI), (-PI, PI), (3.0 * PI, PI), (TAU, 0.0), (-TAU + 0.5, 0.5), (7.0, 7.0 - TAU)]
        {
            assert!((wrapped(angle_rad) - expected_rad).abs() < 1e-12, "{angle_rad}");
        }
    }

    #[test]
    fn acceleration_and_deceleration_have_their_limits() {
        let body = BodyModel::SUBMARINE;
        let (rest, ahead) = (Vector3::zeros(), Vector3::x());
        assert_eq!(body.velocity_towards(&rest, &ahead, 0.1), ahead * 0.05);
        assert_eq!(body.velocity_towards(&ahead, &rest, 0.1), ahead * 0.975);
        assert_eq!(body.velocity_towards(&rest, &ahead, 9.0), ahead);
        assert_eq!(body.clamped(ahead * 9.0), ahead * 1.5);
        assert_eq!(body.turn_rate_towards(0.0, 9.0, 0.1), body.turn_acceleration_rad_s2 * 0.1);
        assert_eq!(body.turn_rate_towards(1.0, 0.0, 0.1), 1.0 - body.turn_deceleration_rad_s2 * 0.1);
        assert_eq!(body.turn_rate_towards(0.0, -9.0, 9.0), -body.turn_rate_max_rad_s);
    }
}
