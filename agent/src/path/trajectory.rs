//! Trajectories: velocities, held one after the other, with which a submarine passes waypoints
//! without a stop at each.
//!
//! A body that turns only at rest spends most of its time on stops, turns and starts. Here it turns
//! while it moves: it is simulated as it pursues a point of the way ahead of it (`pursuit.rs`), and
//! slows down for corners as far as it must to touch only cells known to be free (`corners.rs`).
//! A trajectory begins with any velocity and ends at rest.
//!
//! Invariants: the sphere of the body touches only cells known to be free, but those that it
//! touches at the start; velocities and accelerations are within the limits of the body, so that a
//! body that is not disturbed is where the trajectory says, bit by bit; it depends on the map, the
//! body, its state and the waypoints alone. Other bodies are not considered.

mod corners;
mod pursuit;
#[cfg(test)]
mod tests;

use msgs::ids::Tick;
use nalgebra::{Point3, Vector3};
use protocol::body_model::{BodyKind, BodyModel};
use protocol::kinematics::{turned, wrapped};

use super::sweep::clearance;
use crate::exploration_map::ExplorationMap;
use corners::Corner;
use pursuit::{CHORD_SAG_M, Pursuit};

/// Position, heading and velocity of a body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BodyState {
    /// Centre of the body, metres, frame `map`.
    pub position: Point3<f64>,
    /// Heading: 0 along x, positive to the left, in (-pi, pi].
    pub yaw_rad: f64,
    /// Velocity in the frame of the body: x forward, y left, z up; m/s.
    pub velocity_in_body_m_s: Vector3<f64>,
    /// Turn rate, positive to the left.
    pub yaw_rate_rad_s: f64,
}

impl BodyState {
    /// A body that does not move.
    #[must_use]
    pub fn at_rest(position: Point3<f64>, yaw_rad: f64) -> Self {
        Self { position, yaw_rad, velocity_in_body_m_s: Vector3::zeros(), yaw_rate_rad_s: 0.0 }
    }

    fn is_at_rest(&self) -> bool {
        self.velocity_in_body_m_s == Vector3::zeros() && self.yaw_rate_rad_s == 0.0
    }

    /// The same body a tick later, while it holds a velocity: as the server moves a submarine.
    pub fn advance(&mut self, body: &BodyModel, held: &HeldVelocity) {
        let target_m_s = body.clamped(held.linear_in_body_m_s);
        let velocity_m_s = body.velocity_towards(&self.velocity_in_body_m_s, &target_m_s, Tick::TICK_S);
        let rate_rad_s = body.turn_rate_towards(self.yaw_rate_rad_s, held.yaw_rate_rad_s, Tick::TICK_S);
        self.position += turned(&velocity_m_s, self.yaw_rad) * Tick::TICK_S;
        self.velocity_in_body_m_s = velocity_m_s;
        self.yaw_rate_rad_s = rate_rad_s;
        self.yaw_rad = wrapped(self.yaw_rad + rate_rad_s * Tick::TICK_S);
    }
}

/// A velocity that a body is to hold.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HeldVelocity {
    /// Frame of the body: x forward, y left, z up; m/s.
    pub linear_in_body_m_s: Vector3<f64>,
    /// Positive to the left.
    pub yaw_rate_rad_s: f64,
}

/// A velocity and where the body is when it has been held for [`Trajectory::STEP_TICKS`].
#[derive(Debug, Clone, Copy, PartialEq)]
struct Step {
    held: HeldVelocity,
    /// Index of the waypoint ahead at its start.
    ahead: usize,
    end: BodyState,
}

/// A way of a body through time.
#[derive(Debug, Clone, PartialEq)]
pub struct Trajectory {
    start: BodyState,
    steps: Vec<Step>,
}

/// Attempts at a trajectory; each passes one corner more slowly than the one before. Those of
/// narrow and winding ways that need more are not worth their search.
const ATTEMPTS_MAX: usize = 60;

impl Trajectory {
    /// Ticks for which a velocity is held: those between two scans by default, at which an
    /// exploring agent decides anyway.
    pub const STEP_TICKS: u64 = 10;

    /// A trajectory that leads a body along waypoints (metres, frame `map`) to rest at the last
    /// one, within 0.3 m. `None` if none is found; so for bodies that are no submarines.
    #[must_use]
    pub fn along(waypoints: &[Point3<f64>], map: &ExplorationMap, body: &BodyModel, start: &BodyState) -> Option<Self> {
        if body.kind != BodyKind::Submarine || waypoints.is_empty() {
            return None;
        }
        let cell_m = map.extent().cell_m();
        let radius = clearance(body.radius_m, cell_m)? + CHORD_SAG_M / cell_m;
        let mut corners = Corner::all(start, waypoints);
        for _ in 0..ATTEMPTS_MAX {
            match Pursuit::new(&corners, body, start).run(map, radius) {
                Ok(steps) => return Some(Self { start: *start, steps }),
                Err(ahead) => corners::slow_down(&mut corners, ahead)?,
            }
        }
        None
    }

    /// The velocity of a step, counted from 0, and the index of the waypoint ahead at its start;
    /// `None` after the last one.
    #[must_use]
    pub fn step(&self, step: usize) -> Option<(&HeldVelocity, usize)> {
        self.steps.get(step).map(|step| (&step.held, step.ahead))
    }

    /// The first step after this one with another velocity, or the number of steps.
    #[must_use]
    pub fn next_change(&self, step: usize) -> usize {
        let held = self.steps.get(step).map(|step| step.held);
        (step + 1..self.steps.len()).find(|&later| Some(self.steps[later].held) != held).unwrap_or(self.steps.len())
    }

    /// The body this many ticks after the start; `None` after the end.
    #[must_use]
    pub fn state_after(&self, ticks: u64, body: &BodyModel) -> Option<BodyState> {
        let whole = (ticks / Self::STEP_TICKS) as usize;
        let mut state = match whole.checked_sub(1) {
            None => self.start,
            Some(last) => self.steps.get(last)?.end,
        };
        for _ in 0..ticks % Self::STEP_TICKS {
            state.advance(body, &self.steps.get(whole)?.held);
        }
        Some(state)
    }

    /// Its duration, ticks.
    #[must_use]
    pub fn ticks(&self) -> u64 {
        self.steps.len() as u64 * Self::STEP_TICKS
    }

    /// Where the body is after each step (metres, frame `map`), the start included.
    pub fn positions(&self) -> impl Iterator<Item = Point3<f64>> {
        std::iter::once(self.start.position).chain(self.steps.iter().map(|step| step.end.position))
    }
}
