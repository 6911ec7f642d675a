//! A simulated body that pursues a point of its way ahead of it.
//!
//! Source: R. C. Coulter, "Implementation of the Pure Pursuit Path Tracking Algorithm",
//! CMU-RI-TR-92-01, 1992; with a turn rate from which the body can stop turning in time, and a
//! speed that falls with the turn still to make.

use std::f64::consts::PI;

use msgs::ids::Tick;
use nalgebra::{Point3, Vector3};
use protocol::body_model::BodyModel;
use protocol::kinematics::wrapped;

use super::corners::{Corner, Passage};
use super::{BodyState, HeldVelocity, Step, Trajectory};
use crate::exploration_map::ExplorationMap;
use crate::path::legs::is_clear;
use crate::path::sweep::in_cells;

/// Ticks between two positions that are joined by a straight line for the test of clearance.
const CHORD_TICKS: u64 = 5;

/// By how much such a line may cut the curve: at full speed and turn rate, with some more. Metres.
pub(super) const CHORD_SAG_M: f64 = 0.005;

/// How far ahead the pursued point is: this time at the present speed, about that of a turn, and at
/// least this distance.
const AHEAD_S: f64 = 1.7;
const AHEAD_MIN_M: f64 = 0.6;

/// How far beyond a corner, along the leg to it, the pursued point can be, metres.
const BEYOND_M: f64 = 5.0;

/// How far ahead it still is where the body is beyond the last waypoint, metres.
const PAST_M: f64 = 0.2;

/// A direction with less than this along the horizontal is vertical, metres.
const VERTICAL_M: f64 = 0.05;

/// Share of the highest turn rate from which the body can stop turning in time.
const RATE_SHARE: f64 = 0.9;

/// A turn still to make by less than this does not slow the body down, radians.
const ALIGNED_RAD: f64 = 0.15;

/// With more than this beside it the body is in a turn, and passes a corner, radians.
const TURNING_RAD: f64 = 0.1;

/// The body waits for its turn where the cosine of the turn still to make is less than this.
const WAIT_COS: f64 = 0.2;

/// The body brakes to rest this near to the last waypoint, metres.
const END_M: f64 = 0.12;

/// No trajectory ends farther from it, metres.
pub(super) const MISSED_MAX_M: f64 = 0.3;

/// The least speed with which it approaches that, m/s.
const CREEP_M_S: f64 = 0.08;

/// A velocity that differs by less than these from the one before is not worth a command.
const SAME_M_S: f64 = 0.08;
const SAME_RAD_S: f64 = 0.15;

/// Speeds that differ by less are equal but for rounding, m/s.
const EQUAL_M_S: f64 = 1e-9;

/// Longest trajectory, steps: 200 s. Longer ways are taken with stops, and a body that circles is
/// given up.
const STEPS_MAX: usize = 1000;

/// Duration of a step, seconds.
const STEP_S: f64 = Trajectory::STEP_TICKS as f64 * Tick::TICK_S;

/// The pursuit along a way whose corners are passed in a given manner.
pub(super) struct Pursuit<'b> {
    body: &'b BodyModel,
    /// By corner, the start first.
    passages: Vec<Passage>,
    /// The highest speed at each corner from which those after it can be passed, m/s.
    speeds_m_s: Vec<f64>,
    state: BodyState,
    /// The corner ahead.
    next: usize,
}

impl<'b> Pursuit<'b> {
    pub(super) fn new(corners: &[Corner], body: &'b BodyModel, start: &BodyState) -> Self {
        let passages: Vec<Passage> = corners.iter().map(|corner| corner.passage(body)).collect();
        let last = passages.len() - 1;
        let mut speeds_m_s = vec![0.0; passages.len()];
        for index in (1..last).rev() {
            let length_m = (passages[index + 1].aim - passages[index].aim).norm();
            speeds_m_s[index] = passages[index].speed_m_s.min(braked(body, speeds_m_s[index + 1], length_m));
        }
        Self { body, passages, speeds_m_s, state: *start, next: 1 }
    }

    /// The steps to rest at the last corner.
    ///
    /// # Errors
    /// The index of the corner to which the body does not get.
    pub(super) fn run(mut self, map: &ExplorationMap, radius: f64) -> Result<Vec<Step>, usize> {
        let mut steps = Vec::new();
        let mut is_braking = false;
        while steps.len() < STEPS_MAX {
            is_braking |= self.pass_corners() < END_M && self.is_last_leg();
            if is_braking && self.state.is_at_rest() {
                let missed_m = (self.state.position - self.passages[self.next].aim).norm();
                return if missed_m < MISSED_MAX_M { Ok(steps) } else { Err(self.next) };
            }
            let before = steps.last().map(|step: &Step| step.held);
            let held = match (self.velocity(), before) {
                _ if is_braking => HeldVelocity { linear_in_body_m_s: Vector3::zeros(), yaw_rate_rad_s: 0.0 },
                (wanted, Some(before)) if may_stay(&before, &wanted) => before,
                (wanted, _) => wanted,
            };
            // The first corner is the start.
            let ahead = self.next - 1;
            for _ in 0..Trajectory::STEP_TICKS / CHORD_TICKS {
                let from = self.state.position;
                (0..CHORD_TICKS).for_each(|_| self.state.advance(self.body, &held));
                let cells = |point: Point3<f64>| in_cells(point.into(), map.extent().cell_m());
                if !is_clear(map, cells(from), cells(self.state.position), radius) {
                    return Err(self.next);
                }
            }
            steps.push(Step { held, ahead, end: self.state });
        }
        Err(self.next)
    }

    /// Turns to the next legs where that is due; how far it is to the corner ahead then, metres.
    fn pass_corners(&mut self) -> f64 {
        loop {
            let (from, along, length_m) = self.leg();
            let rest_m = length_m - (self.state.position - from).dot(&along);
            if self.is_last_leg() || rest_m > self.passages[self.next].begins_m.max(END_M) {
                return rest_m;
            }
            self.next += 1;
        }
    }

    /// The leg to the corner ahead: where it begins, its direction and its length, metres.
    fn leg(&self) -> (Point3<f64>, Vector3<f64>, f64) {
        let from = self.passages[self.next - 1].aim;
        let by = self.passages[self.next].aim - from;
        (from, by.try_normalize(1e-6).unwrap_or_else(Vector3::zeros), by.norm())
    }

    /// The velocity to hold from here.
    fn velocity(&self) -> HeldVelocity {
        let (from, along, length_m) = self.leg();
        let done_m = (self.state.position - from).dot(&along);
        let to_pursued = from + along * self.pursued_m(done_m, length_m) - self.state.position;
        let (turn_rad, in_step_rad) = self.turn_to(&to_pursued);

        let stoppable_rad_s = (2.0 * self.body.turn_deceleration_rad_s2 * turn_rad.abs()).sqrt();
        let rate_rad_s = self.body.turn_rate_max_rad_s.min(RATE_SHARE * stoppable_rad_s);
        let speed_m_s = self.speed_m_s(length_m - done_m, turn_rad.abs() + in_step_rad.abs());
        let up = to_pursued.z / to_pursued.norm().max(1e-6);
        HeldVelocity {
            linear_in_body_m_s: Vector3::new((1.0 - up * up).max(0.0).sqrt(), 0.0, up) * speed_m_s,
            yaw_rate_rad_s: rate_rad_s.copysign(turn_rad),
        }
    }

    /// How far along the leg the pursued point is, metres, where the body is `done_m` along it.
    fn pursued_m(&self, done_m: f64, length_m: f64) -> f64 {
        let ahead_m = (AHEAD_S * self.state.velocity_in_body_m_s.norm()).max(AHEAD_MIN_M);
        let farthest_m = if self.is_last_leg() { length_m.max(done_m + PAST_M) } else { length_m + BEYOND_M };
        (done_m + ahead_m).min(farthest_m)
    }

    /// The turn to a direction from the heading in the middle of the step, radians, and the turn
    /// until then.
    fn turn_to(&self, direction: &Vector3<f64>) -> (f64, f64) {
        let BodyState { yaw_rad, yaw_rate_rad_s, .. } = self.state;
        let heading_rad = yaw_rad + yaw_rate_rad_s * STEP_S * 0.5;
        let is_vertical = libm::hypot(direction.x, direction.y) < VERTICAL_M;
        let turn_rad = if is_vertical { 0.0 } else { wrapped(libm::atan2(direction.y, direction.x) - heading_rad) };
        (turn_rad, heading_rad - yaw_rad)
    }

    /// The speed to hold where it is `rest_m` to the corner ahead and `turn_rad` is still to turn:
    /// that of the corner behind until the body is aligned, and from which it can brake for that
    /// ahead.
    fn speed_m_s(&self, rest_m: f64, turn_rad: f64) -> f64 {
        let off_rad = (turn_rad - ALIGNED_RAD).max(0.0);
        let aligned = ((libm::cos(off_rad.min(PI)) - WAIT_COS) / (1.0 - WAIT_COS)).max(0.0);
        let wanted_m_s =
            if off_rad > TURNING_RAD { self.passages[self.next - 1].speed_m_s } else { self.body.speed_max_m_s };
        let is_last = self.is_last_leg();
        let free_m = rest_m - if is_last { END_M / 2.0 } else { self.passages[self.next].begins_m };
        let in_step_m = self.state.velocity_in_body_m_s.norm() * STEP_S;
        let braked_m_s = braked(self.body, self.speeds_m_s[self.next], free_m - in_step_m);
        let least_m_s = if is_last && aligned > 0.5 { CREEP_M_S } else { 0.0 };
        (wanted_m_s * aligned).min(braked_m_s).max(least_m_s)
    }

    fn is_last_leg(&self) -> bool {
        self.next == self.passages.len() - 1
    }
}

/// Whether a velocity may be held on instead of the wanted one: it differs little and is no faster,
/// so that the body brakes in time.
fn may_stay(held: &HeldVelocity, wanted: &HeldVelocity) -> bool {
    (held.linear_in_body_m_s - wanted.linear_in_body_m_s).norm() < SAME_M_S
        && held.linear_in_body_m_s.norm() <= wanted.linear_in_body_m_s.norm() + EQUAL_M_S
        && (held.yaw_rate_rad_s - wanted.yaw_rate_rad_s).abs() < SAME_RAD_S
}

/// The highest speed from which a body can brake to another one over a length, m/s.
fn braked(body: &BodyModel, to_m_s: f64, over_m: f64) -> f64 {
    (to_m_s * to_m_s + 2.0 * body.deceleration_m_s2 * over_m.max(0.0)).sqrt()
}
