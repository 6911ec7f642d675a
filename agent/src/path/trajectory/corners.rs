//! The corners of a way, and how each one is passed.

use nalgebra::{Point3, Vector3};
use protocol::body_model::BodyModel;
use protocol::kinematics::wrapped;

use super::BodyState;

/// How a corner is passed: at a share of the full speed, and aiming outside of it by a share of
/// what the turn cuts off. In the order in which they are tried: a faster passage first, and of two
/// as fast the one that does not cut the corner. At the last one the body all but stops.
const PASSAGES: [(f64, f64); 9] =
    [(1.0, 1.0), (1.0, 0.0), (0.7, 1.0), (0.7, 0.0), (0.4, 1.0), (0.4, 0.0), (0.2, 1.0), (0.2, 0.0), (0.04, 0.0)];

/// The share of the length of the arc before the corner. More than half: the body follows what it
/// pursues with a delay.
const BEGINS: f64 = 0.65;

/// The turn by which the width of a passage is bounded, radians.
const WIDEST_TURN_RAD: f64 = 2.8;

/// Legs shorter than this along the horizontal are vertical, metres.
const VERTICAL_M: f64 = 1e-3;

/// A point of the way where its direction changes: the start, or a waypoint.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Corner {
    at: Point3<f64>,
    /// Change of direction there.
    turn_rad: f64,
    /// Away from where the way bends to; unit vector, or 0.
    outwards: Vector3<f64>,
    /// Index of the passage.
    passage: usize,
}

/// Where the body aims at for a corner, its speed there, and how far before it the turn begins.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Passage {
    pub(super) aim: Point3<f64>,
    pub(super) speed_m_s: f64,
    pub(super) begins_m: f64,
}

impl Corner {
    /// The corners of the way of a body along waypoints: its start, with the turn to the first leg,
    /// and each waypoint. At the last one the way does not turn.
    pub(super) fn all(start: &BodyState, waypoints: &[Point3<f64>]) -> Vec<Self> {
        let points: Vec<Point3<f64>> = std::iter::once(start.position).chain(waypoints.iter().copied()).collect();
        let mut yaw_rad = start.yaw_rad;
        let mut before: Option<Vector3<f64>> = None;
        let corner = |index: usize| {
            let at = points[index];
            let Some(leg) = points.get(index + 1).map(|next| next - at) else {
                return Self { at, turn_rad: 0.0, outwards: Vector3::zeros(), passage: 0 };
            };
            let is_vertical = libm::hypot(leg.x, leg.y) < VERTICAL_M;
            let heading_rad = if is_vertical { yaw_rad } else { libm::atan2(leg.y, leg.x) };
            let turn_rad = wrapped(heading_rad - yaw_rad).abs();
            yaw_rad = heading_rad;
            let pitched_rad = before.map_or(0.0, |before| (pitch_rad(&leg) - pitch_rad(&before)).abs());
            let outwards = before.map_or_else(Vector3::zeros, |before| unit(&(unit(&before) - unit(&leg))));
            before = Some(leg);
            Self { at, turn_rad: turn_rad.max(pitched_rad), outwards, passage: 0 }
        };
        (0..points.len()).map(corner).collect()
    }

    /// How it is passed. A turn takes time, in which the body moves: the way there is an arc that
    /// begins before the corner and ends as far behind it.
    pub(super) fn passage(&self, body: &BodyModel) -> Passage {
        let (speed, outside) = PASSAGES[self.passage];
        let speed_m_s = speed * body.speed_max_m_s;
        let per_rate_s = 1.0 / body.turn_acceleration_rad_s2 + 1.0 / body.turn_deceleration_rad_s2;
        let turn_s = (2.0 * self.turn_rad * per_rate_s).sqrt();
        let arc_m = speed_m_s * turn_s;
        let cut_m = 0.5 * arc_m * libm::tan(self.turn_rad.min(WIDEST_TURN_RAD) / 4.0);
        Passage { aim: self.at + self.outwards * (outside * cut_m), speed_m_s, begins_m: BEGINS * arc_m }
    }
}

/// Passes a corner more slowly, since the body cannot get from the one before to the one `ahead`:
/// that before, if possible, else that ahead, else the one still before. `None` if all are passed
/// as slowly as can be.
pub(super) fn slow_down(corners: &mut [Corner], ahead: usize) -> Option<()> {
    let last = corners.len() - 1;
    let can_be_slower = |&index: &usize| index < last && corners[index].passage + 1 < PASSAGES.len();
    let which = [ahead - 1, ahead, ahead.saturating_sub(2)].into_iter().find(can_be_slower)?;
    corners[which].passage += 1;
    Some(())
}

fn pitch_rad(leg: &Vector3<f64>) -> f64 {
    libm::atan2(leg.z, libm::hypot(leg.x, leg.y))
}

fn unit(vector: &Vector3<f64>) -> Vector3<f64> {
    vector.try_normalize(1e-9).unwrap_or_else(Vector3::zeros)
}
