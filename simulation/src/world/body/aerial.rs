//! How an aerial body flies: at once in any direction, within its accelerations, and turning towards where it goes.
//!
//! It flies straight from waypoint to waypoint, as fast as it can and still come to rest on the next one at which the way bends:
//! there it is at rest for one tick. Waypoints that lie straight on are flown through. Its heading turns meanwhile towards the
//! leg that is flown, at a rate of its own; that of a vertical leg is the one it has. When the path ends, so does the turn.
//!
//! Invariants: from tick to tick its velocity changes by no more than its acceleration allows, or its deceleration if it gets
//! slower by that and this is the larger one, unless a task or a collision puts it at rest at once; it lands exactly on waypoints
//! at which the way bends, and on the last one.

use std::collections::VecDeque;

use nalgebra::{Point3, Vector3};

use super::ramp::{Ramp, approached, landing_speed};
use super::{Body, MOVE_REST_M, Moved, Obstacles, turned, wrapped};

/// A way bends where its direction comes to differ by more than this from that at the beginning of a leg, radians: at 3 m/s that is
/// a change of velocity of 3 mm/s.
const BEND_RAD: f64 = 1e-3;

/// A heading that is nearer than this to where it turns to is there.
const HEADING_REST_RAD: f64 = 1e-9;

/// Share of a speed from which on another one counts as equally fast, whatever rounding does to it.
const EQUALLY_FAST: f64 = 1.0 - 1e-9;

/// Waypoints that are flown to.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Flight {
    targets: VecDeque<Point3<f64>>,
    /// None: at rest on a waypoint at which the way bends.
    leg: Option<Leg>,
}

/// The part of a flight that is under way, straight on.
#[derive(Debug, Clone, PartialEq)]
struct Leg {
    /// How many of the targets are on it, the last of them its end.
    targets: usize,
    go: Ramp,
    /// Where it leads to, unless that is up or down.
    heading_rad: Option<f64>,
}

impl Flight {
    /// A flight to waypoints; none if there are none.
    pub(super) fn from_rest(from: &Point3<f64>, waypoints: Vec<Point3<f64>>) -> Option<Self> {
        let targets = VecDeque::from(waypoints);
        let leg = Leg::of(from, &targets)?;
        Some(Self { targets, leg: Some(leg) })
    }

    /// Those that are still to be visited.
    pub(super) fn waypoints(&self) -> Vec<Point3<f64>> {
        self.targets.iter().copied().collect()
    }
}

impl Leg {
    /// The leg that begins at `from`: as many waypoints as lie straight on.
    fn of(from: &Point3<f64>, targets: &VecDeque<Point3<f64>>) -> Option<Self> {
        let mut direction: Option<Vector3<f64>> = None;
        let (mut count, mut length_m, mut end) = (0, 0.0, *from);
        for target in targets {
            let way = target - end;
            if let Some(onwards) = way.try_normalize(0.0) {
                if (onwards - direction.unwrap_or(onwards)).norm() > BEND_RAD {
                    break;
                }
                direction = direction.or(Some(onwards));
            }
            count += 1;
            length_m += way.norm();
            end = *target;
        }
        let way = end - from;
        let is_level = libm::hypot(way.x, way.y) >= MOVE_REST_M;
        let heading_rad = is_level.then(|| libm::atan2(way.y, way.x));
        (count > 0).then(|| Self { targets: count, go: Ramp::from_rest(length_m), heading_rad })
    }

    /// Where a body at `from` comes to by a step, metres; the targets that it passes are taken off.
    fn after(&mut self, from: Point3<f64>, step_m: f64, targets: &mut VecDeque<Point3<f64>>) -> Point3<f64> {
        let (mut at, mut left_m) = (from, step_m);
        while let Some(&target) = targets.front() {
            let way = target - at;
            let way_m = way.norm();
            if self.targets == 1 || left_m < way_m {
                return at + way.try_normalize(0.0).unwrap_or_else(Vector3::zeros) * left_m;
            }
            (at, left_m) = (target, left_m - way_m);
            targets.pop_front();
            self.targets -= 1;
        }
        at
    }
}

impl Body {
    pub(super) fn fly(&mut self, flight: &mut Flight, obstacles: &Obstacles<'_>, dt_s: f64) -> Moved {
        let here = self.pose.position;
        let Some(leg) = &mut flight.leg else {
            flight.leg = Leg::of(&here, &flight.targets);
            let heading_rad = flight.leg.as_ref().and_then(|leg| leg.heading_rad);
            self.has_flown(Vector3::zeros(), self.rate_to_heading(heading_rad, dt_s), dt_s);
            return Moved::default();
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
        let mut moved = self.shift(end - here, obstacles, dt_s);
        if !moved.collided {
            self.pose.position = end;
            self.has_flown((end - here) / dt_s, rate_rad_s, dt_s);
            moved.task_done = has_landed && flight.targets.is_empty();
        }
        moved
    }

    pub(super) fn hold_in_flight(
        &mut self,
        (target_in_body_m_s, target_yaw_rate_rad_s): (Vector3<f64>, f64),
        obstacles: &Obstacles<'_>,
        dt_s: f64,
    ) -> Moved {
        // In the frame `map`, because the body turns meanwhile.
        let target_m_s = turned(&self.clamped(target_in_body_m_s), self.pose.yaw_rad);
        let present_m_s = self.velocity_in_map_m_s();
        let mut velocity_m_s = self.velocity_towards(&present_m_s, &target_m_s, dt_s);
        if velocity_m_s.norm() >= EQUALLY_FAST * present_m_s.norm() {
            // What does not get slower is no braking.
            let limit_m_s = self.model.acceleration_m_s2 * dt_s;
            velocity_m_s = approached(&present_m_s, &target_m_s, limit_m_s, limit_m_s);
        }
        let rate_rad_s = self.rate_towards(target_yaw_rate_rad_s, dt_s);
        let moved = self.shift(velocity_m_s * dt_s, obstacles, dt_s);
        if !moved.collided {
            self.has_flown(velocity_m_s, rate_rad_s, dt_s);
        }
        moved
    }

    /// The turn rate for the next tick with which the heading gets to `heading_rad` soonest, and is at rest there; without one, it
    /// stops turning.
    fn rate_to_heading(&self, heading_rad: Option<f64>, dt_s: f64) -> f64 {
        let left_rad = heading_rad.map_or(0.0, |heading_rad| wrapped(heading_rad - self.pose.yaw_rad));
        if left_rad.abs() < HEADING_REST_RAD {
            return self.rate_towards(0.0, dt_s);
        }
        let rate_rad_s = landing_speed(left_rad.abs(), self.model.turn_deceleration_rad_s2, dt_s);
        self.rate_towards(rate_rad_s.copysign(left_rad), dt_s)
    }

    /// Takes note of the velocities of this tick (frame `map`), and turns.
    fn has_flown(&mut self, velocity_in_map_m_s: Vector3<f64>, rate_rad_s: f64, dt_s: f64) {
        self.pose.yaw_rad = wrapped(self.pose.yaw_rad + rate_rad_s * dt_s);
        self.velocity_in_body_m_s = turned(&velocity_in_map_m_s, -self.pose.yaw_rad);
        self.yaw_rate_rad_s = rate_rad_s;
    }
}

#[cfg(test)]
mod tests;
