//! The bodies of the team, and how long they take for a leg.
//!
//! The server simulates the motion; agents only predict it.

use std::f64::consts::TAU;

use nalgebra::{Point3, Vector3};
pub use protocol::body_model::{BodyKind, BodyModel};
pub use protocol::run_info::Bodies;

/// Time of a straight leg from rest to rest, seconds: including the turn before it, by at most this
/// angle, if the body turns on the spot.
#[must_use]
pub fn leg_s(body: &BodyModel, length_m: f64, turn_rad: f64) -> f64 {
    let go_s = ramp_s(length_m, body.speed_max_m_s, body.acceleration_m_s2, body.deceleration_m_s2);
    if !body.turns_first() {
        return go_s;
    }
    let (faster, slower) = (body.turn_acceleration_rad_s2, body.turn_deceleration_rad_s2);
    go_s + ramp_s(turn_rad, body.turn_rate_max_rad_s, faster, slower)
}

/// The same for a leg by `by`, in units of `unit_m` metres, of a body with this heading, and the
/// heading at its end.
#[must_use]
pub fn leg_from(body: &BodyModel, yaw_rad: f64, by: &Vector3<f64>, unit_m: f64) -> (f64, f64) {
    let is_vertical = by.x == 0.0 && by.y == 0.0;
    let heading_rad = if is_vertical { yaw_rad } else { libm::atan2(by.y, by.x) };
    let turn_rad = (heading_rad - yaw_rad).abs() % TAU;
    (leg_s(body, by.norm() * unit_m, turn_rad.min(TAU - turn_rad)), heading_rad)
}

/// Time along points, with a stop at each, seconds; all in units of `unit_m` metres.
#[must_use]
pub fn legs_s(
    body: &BodyModel,
    (from, mut yaw_rad): (Point3<f64>, f64),
    points: impl IntoIterator<Item = Point3<f64>>,
    unit_m: f64,
) -> f64 {
    let mut at = from;
    let leg_s = |point: Point3<f64>| {
        let by = point - std::mem::replace(&mut at, point);
        let (leg_s, heading_rad) = leg_from(body, yaw_rad, &by, unit_m);
        yaw_rad = heading_rad;
        leg_s
    };
    points.into_iter().map(leg_s).sum()
}

/// Length of the legs along points, metres.
#[must_use]
pub fn legs_m(from: &Point3<f64>, points: &[Point3<f64>]) -> f64 {
    std::iter::once(from).chain(points).zip(points).map(|(from, to)| (to - from).norm()).sum()
}

/// The place on a leg by `by` that is nearest to a point, as a share of it, 0 to 1.
#[must_use]
pub fn nearest_share(from: &Point3<f64>, by: &Vector3<f64>, point: &Point3<f64>) -> f64 {
    let length_squared = by.norm_squared();
    if length_squared > 0.0 { ((point - from).dot(by) / length_squared).clamp(0.0, 1.0) } else { 0.0 }
}

/// Time from rest to rest over a distance, seconds.
fn ramp_s(distance: f64, speed_max: f64, acceleration: f64, deceleration: f64) -> f64 {
    let per_speed_s = 1.0 / acceleration + 1.0 / deceleration;
    let top = speed_max.min((2.0 * distance / per_speed_s).sqrt());
    if top > 0.0 { distance / top + 0.5 * top * per_speed_s } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use super::*;

    #[test]
    fn leg_times_match_the_simulated_bodies() {
        // Measured with the server's bodies, which lose up to a tenth of a second to whole ticks.
        for (body, length_m, turn_rad, expected_s) in [
            (BodyModel::SUBMARINE, 10.0, 0.0, 10.6),
            (BodyModel::SUBMARINE, 1.0, 0.0, 3.22),
            (BodyModel::SUBMARINE, 1.0, FRAC_PI_2, 3.22 + 3.08),
            (BodyModel::SUBMARINE, 0.0, 0.0, 0.0),
            (BodyModel::AERIAL, 8.0, FRAC_PI_2, 4.17),
            (BodyModel::AERIAL, 2.0, FRAC_PI_2, 2.0),
        ] {
            let reckoned_s = leg_s(&body, length_m, turn_rad);
            assert!((reckoned_s - expected_s).abs() <= 0.6, "{length_m} m: {reckoned_s} s, not {expected_s} s");
        }
    }

    #[test]
    fn legs_begin_with_a_turn_unless_they_are_vertical() {
        let body = BodyModel::SUBMARINE;
        // Ahead, beside and behind: the same distance, and a turn.
        let time_s = |x, y| leg_from(&body, 0.0, &Vector3::new(x, y, 0.0), 1.0).0;
        assert!(time_s(5.0, 0.0) + 2.0 < time_s(0.0, 5.0) && time_s(0.0, 5.0) + 1.0 < time_s(-5.0, 0.0));
        assert_eq!(leg_from(&body, 0.5, &Vector3::z(), 1.0), (leg_s(&body, 1.0, 0.0), 0.5), "up, without a turn");
    }
}
