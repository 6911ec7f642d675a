//! Kinematics of an aerial body: it accelerates in any direction and turns towards its direction of
//! flight.
//!
//! It flies straight from waypoint to waypoint, as fast as it can while still able to stop at the
//! next bend, where it is at rest for one tick. Waypoints on a straight line are flown through. Its
//! heading turns towards the leg independently of its speed; a vertical leg keeps the heading. The
//! turn ends with the path.
//!
//! Invariants: from tick to tick its velocity changes by no more than its acceleration allows (when
//! braking: the larger of acceleration and deceleration), unless a task or a collision stops it at
//! once; it stops exactly on waypoints at which the path bends, and on the last one.

use std::collections::VecDeque;

use nalgebra::{Point3, Vector3};
use protocol::kinematics::{approached, turned, wrapped};

use super::ramp::{Ramp, landing_speed};
use super::{Body, MOVE_REST_M, MotionOutcome, Obstacles};

/// A path bends where its direction differs by more than this from that at the beginning of a leg,
/// radians; at 3 m/s that is a change of velocity of 3 mm/s.
const BEND_RAD: f64 = 1e-3;

/// A heading closer than this to its target has reached it, radians.
const HEADING_REST_RAD: f64 = 1e-9;

/// Ratio of two speeds from which on they count as equal despite rounding.
const EQUALLY_FAST: f64 = 1.0 - 1e-9;

/// A flight along waypoints.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Flight {
    targets: VecDeque<Point3<f64>>,
    /// `None`: at rest on a waypoint at which the path bends.
    leg: Option<Leg>,
}

/// The active straight leg of a flight.
#[derive(Debug, Clone, PartialEq)]
struct Leg {
    /// Number of targets on it, the last of which is its end.
    targets: usize,
    go: Ramp,
    /// Its direction about the vertical, radians; `None` for a vertical leg.
    heading_rad: Option<f64>,
}

impl Flight {
    /// A flight from rest along waypoints; `None` without waypoints.
    pub(super) fn from_rest(from: &Point3<f64>, waypoints: Vec<Point3<f64>>) -> Option<Self> {
        let targets = VecDeque::from(waypoints);
        let leg = Leg::of(from, &targets)?;
        Some(Self { targets, leg: Some(leg) })
    }

    /// The remaining waypoints.
    pub(super) fn waypoints(&self) -> Vec<Point3<f64>> {
        self.targets.iter().copied().collect()
    }
}

impl Leg {
    /// The leg that begins at `from`, with as many waypoints as lie on a straight line.
    fn of(from: &Point3<f64>, targets: &VecDeque<Point3<f64>>) -> Option<Self> {
        let mut direction: Option<Vector3<f64>> = None;
        let (mut count, mut length_m, mut end) = (0, 0.0, *from);
        for target in targets {
            let offset = target - end;
            if let Some(heading) = offset.try_normalize(0.0) {
                if (heading - direction.unwrap_or(heading)).norm() > BEND_RAD {
                    break;
                }
                direction = direction.or(Some(heading));
            }
            count += 1;
            length_m += offset.norm();
            end = *target;
        }
        let offset = end - from;
        let is_level = libm::hypot(offset.x, offset.y) >= MOVE_REST_M;
        let heading_rad = is_level.then(|| libm::atan2(offset.y, offset.x));
        (count > 0).then(|| Self { targets: count, go: Ramp::from_rest(length_m), heading_rad })
    }

    /// The position of a body after a step of `step_m` metres from `from`; removes the targets that
    /// it passes.
    fn after(&mut self, from: Point3<f64>, step_m: f64, targets: &mut VecDeque<Point3<f64>>) -> Point3<f64> {
        let (mut at, mut left_m) = (from, step_m);
        while let Some(&target) = targets.front() {
            let offset = target - at;
            let offset_m = offset.norm();
            if self.targets == 1 || left_m < offset_m {
                return at + offset.try_normalize(0.0).unwrap_or_else(Vector3::zeros) * left_m;
            }
            (at, left_m) = (target, left_m - offset_m);
            targets.pop_front();
            self.targets -= 1;
        }
        at
    }
}

impl Body {
    pub(super) fn step_flight(&mut self, flight: &mut Flight, obstacles: &Obstacles<'_>, dt_s: f64) -> MotionOutcome {
        let here = self.pose.position;
        let Some(leg) = &mut flight.leg else {
            flight.leg = Leg::of(&here, &flight.targets);
            let heading_rad = flight.leg.as_ref().and_then(|leg| leg.heading_rad);
            self.set_velocities(Vector3::zeros(), self.rate_to_heading(heading_rad, dt_s), dt_s);
            return MotionOutcome::default();
        };
        let heading_rad = leg.heading_rad;
        let (step_m, has_landed) = leg.go.next_landing_step(&self.move_limits(), dt_s);
        let end = if has_landed {
            let end = flight.targets.drain(..leg.targets).next_back().unwrap_or(here);
            flight.leg = None;
            end
        } else {
            leg.after(here, step_m, &mut flight.targets)
        };
        let rate_rad_s = self.rate_to_heading(heading_rad, dt_s);
        let mut moved = self.translate(end - here, obstacles, dt_s);
        if !moved.collided {
            self.pose.position = end;
            self.set_velocities((end - here) / dt_s, rate_rad_s, dt_s);
            moved.task_done = has_landed && flight.targets.is_empty();
        }
        moved
    }

    pub(super) fn step_velocity_in_flight(
        &mut self,
        (target_in_body_m_s, target_yaw_rate_rad_s): (Vector3<f64>, f64),
        obstacles: &Obstacles<'_>,
        dt_s: f64,
    ) -> MotionOutcome {
        // In the frame `map`, because the body turns while it moves.
        let target_m_s = turned(&self.model.clamped(target_in_body_m_s), self.pose.yaw_rad);
        let present_m_s = self.velocity_in_map_m_s();
        let mut velocity_m_s = self.model.velocity_towards(&present_m_s, &target_m_s, dt_s);
        if velocity_m_s.norm() >= EQUALLY_FAST * present_m_s.norm() {
            // A change that does not reduce the speed is limited by the acceleration.
            let limit_m_s = self.model.acceleration_m_s2 * dt_s;
            velocity_m_s = approached(&present_m_s, &target_m_s, limit_m_s, limit_m_s);
        }
        let rate_rad_s = self.model.turn_rate_towards(self.yaw_rate_rad_s, target_yaw_rate_rad_s, dt_s);
        let moved = self.translate(velocity_m_s * dt_s, obstacles, dt_s);
        if !moved.collided {
            self.set_velocities(velocity_m_s, rate_rad_s, dt_s);
        }
        moved
    }

    /// The turn rate of the next tick that reaches `heading_rad` soonest and can stop there;
    /// without a heading, the turn is braked.
    fn rate_to_heading(&self, heading_rad: Option<f64>, dt_s: f64) -> f64 {
        let left_rad = heading_rad.map_or(0.0, |heading_rad| wrapped(heading_rad - self.pose.yaw_rad));
        if left_rad.abs() < HEADING_REST_RAD {
            return self.model.turn_rate_towards(self.yaw_rate_rad_s, 0.0, dt_s);
        }
        let rate_rad_s = landing_speed(left_rad.abs(), self.model.turn_deceleration_rad_s2, dt_s);
        self.model.turn_rate_towards(self.yaw_rate_rad_s, rate_rad_s.copysign(left_rad), dt_s)
    }

    /// Turns the body and stores the velocities of this tick (frame `map`).
    fn set_velocities(&mut self, velocity_in_map_m_s: Vector3<f64>, rate_rad_s: f64, dt_s: f64) {
        self.pose.yaw_rad = wrapped(self.pose.yaw_rad + rate_rad_s * dt_s);
        self.velocity_in_body_m_s = turned(&velocity_in_map_m_s, -self.pose.yaw_rad);
        self.yaw_rate_rad_s = rate_rad_s;
    }
}

#[cfg(test)]
mod tests;
