//! Kinematics of a body: how a motion task changes its pose in one fixed update.
//!
//! There are three kinds. The submarine is that of MAES3D: a sphere that turns about the vertical
//! and moves along a line raised by a pitch angle, with bang-bang speed control. The aerial body
//! (`body/aerial.rs`) accelerates in any direction and turns while it moves. The ground body
//! (`body/ground.rs`) drives along the floor. Every leg (a straight move or a turn) starts from
//! rest. A new task ends the previous one at rest, except that a velocity task continues from the
//! velocity of a velocity task.
//!
//! Invariants: a body never comes nearer to a wall or to another body than its radius allows (see
//! [`super::collision`]); a completed leg of a path ends exactly on its waypoint, unless that is
//! blocked; other legs of a submarine end within `MOVE_REST_M` or `TURN_REST_RAD` of their target,
//! as in MAES3D; all quantities stay finite.
//!
//! The order in which bodies move is that of [`super::World::step`].

mod aerial;
mod ground;
mod ramp;

use std::collections::VecDeque;
use std::f64::consts::PI;

use nalgebra::{Point3, Vector3};
use protocol::body_model::{BodyKind, BodyModel};
use protocol::kinematics::{turned, wrapped};
pub use protocol::motion::Motion;
use protocol::observation::Surface;
pub use protocol::observation::{Collision, Pose};

use super::collision::{Obstacles, Sphere, surface_of};
use aerial::Flight;
pub(super) use ground::Floors;
use ground::level;
use ramp::{Ramp, RampLimits};

/// A leg with less than this to go is finished; 0.001 voxel and 0.001 degree in MAES3D.
const MOVE_REST_M: f64 = 1e-3;
const TURN_REST_RAD: f64 = 1e-3 * PI / 180.0;

#[derive(Debug, Clone, PartialEq)]
enum Task {
    Idle,
    Move { direction_in_map: Vector3<f64>, ramp: Ramp },
    Turn { sign: f64, ramp: Ramp },
    Path { leg: PathLeg, rest: VecDeque<Point3<f64>> },
    Flight(Flight),
    Velocity { target_in_body_m_s: Vector3<f64>, target_yaw_rate_rad_s: f64, path: Vec<Point3<f64>> },
}

/// The active leg of a path: a turn towards `target`, then a straight move.
#[derive(Debug, Clone, PartialEq)]
struct PathLeg {
    target: Point3<f64>,
    turn: Option<(f64, Ramp)>,
    go: Ramp,
}

/// The outcome of one fixed update of a body.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct MotionOutcome {
    /// The task has ended, by itself or by a collision.
    pub task_done: bool,
    /// The motion of this tick was refused because of a collision.
    pub collided: bool,
    /// Distance moved in this tick, metres.
    pub distance_m: f64,
}

/// A body and its motion task.
#[derive(Debug, Clone, PartialEq)]
pub struct Body {
    model: BodyModel,
    pose: Pose,
    task: Task,
    velocity_in_body_m_s: Vector3<f64>,
    yaw_rate_rad_s: f64,
    collision: Option<Collision>,
}

impl Body {
    /// A body at rest without a task.
    #[must_use]
    pub fn at_rest(model: BodyModel, pose: Pose) -> Self {
        Self {
            model,
            pose: Pose { yaw_rad: wrapped(pose.yaw_rad), ..pose },
            task: Task::Idle,
            velocity_in_body_m_s: Vector3::zeros(),
            yaw_rate_rad_s: 0.0,
            collision: None,
        }
    }

    /// Its kind and limits.
    #[must_use]
    pub fn model(&self) -> &BodyModel {
        &self.model
    }

    /// Its pose.
    #[must_use]
    pub fn pose(&self) -> &Pose {
        &self.pose
    }

    /// The sphere that it occupies.
    #[must_use]
    pub fn sphere(&self) -> Sphere {
        Sphere { centre: self.pose.position, radius_m: self.model.radius_m }
    }

    /// Whether a task is active.
    #[must_use]
    pub fn is_active(&self) -> bool {
        self.task != Task::Idle
    }

    /// The remaining waypoints of the present task, metres, frame `map`: those of a path, the end
    /// of a finite move, or where a velocity is said to lead.
    #[must_use]
    pub fn waypoints(&self) -> Vec<Point3<f64>> {
        match &self.task {
            Task::Path { leg, rest } => std::iter::once(leg.target).chain(rest.iter().copied()).collect(),
            Task::Flight(flight) => flight.waypoints(),
            Task::Move { direction_in_map, ramp } if ramp.rest.is_finite() => {
                vec![self.pose.position + direction_in_map * ramp.rest]
            }
            Task::Velocity { path, .. } => path.clone(),
            Task::Idle | Task::Move { .. } | Task::Turn { .. } => Vec::new(),
        }
    }

    /// The collision of the last attempted motion, if there was one.
    #[must_use]
    pub fn collision(&self) -> Option<Collision> {
        self.collision
    }

    /// Velocity of the last fixed update, m/s, frame `map`.
    #[must_use]
    pub fn velocity_in_map_m_s(&self) -> Vector3<f64> {
        turned(&self.velocity_in_body_m_s, self.pose.yaw_rad)
    }

    /// Velocity of the last fixed update, m/s, in the frame of the body: x forward, y left, z up.
    #[must_use]
    pub fn velocity_in_body_m_s(&self) -> Vector3<f64> {
        self.velocity_in_body_m_s
    }

    /// Turn rate of the last fixed update, rad/s, positive to the left.
    #[must_use]
    pub fn yaw_rate_rad_s(&self) -> f64 {
        self.yaw_rate_rad_s
    }

    /// Replaces the task. The motion must be legal: finite numbers (a move distance may be
    /// infinite) within the documented ranges.
    pub fn set_task(&mut self, motion: Motion) {
        let keeps_velocity = matches!(self.task, Task::Velocity { .. });
        self.task = match motion {
            Motion::Keep => return,
            Motion::Stop => Task::Idle,
            Motion::Move { pitch_rad, distance_m } => {
                let pitch_rad = if self.model.kind == BodyKind::Ground { 0.0 } else { pitch_rad };
                Task::Move { direction_in_map: self.heading_raised_by(pitch_rad), ramp: Ramp::from_rest(distance_m) }
            }
            Motion::Turn { angle_rad } => {
                Task::Turn { sign: angle_rad.signum(), ramp: Ramp::from_rest(angle_rad.abs()) }
            }
            Motion::Path(waypoints) if self.model.kind == BodyKind::Aerial => {
                Flight::from_rest(&self.pose.position, waypoints).map_or(Task::Idle, Task::Flight)
            }
            Motion::Path(waypoints) => {
                let mut rest = VecDeque::from(waypoints);
                match rest.pop_front() {
                    Some(target) => Task::Path { leg: self.leg_to(target), rest },
                    None => Task::Idle,
                }
            }
            Motion::Velocity { linear_in_body_m_s, yaw_rate_rad_s, path } => {
                if !keeps_velocity {
                    self.stop();
                }
                self.task = Task::Velocity {
                    target_in_body_m_s: linear_in_body_m_s,
                    target_yaw_rate_rad_s: yaw_rate_rad_s,
                    path,
                };
                return;
            }
        };
        self.stop();
    }

    /// Advances the task by one fixed update of `dt_s` seconds.
    pub fn advance(&mut self, obstacles: &Obstacles<'_>, dt_s: f64) -> MotionOutcome {
        let mut task = std::mem::replace(&mut self.task, Task::Idle);
        let moved = match &mut task {
            Task::Idle => {
                self.stop();
                return match self.model.kind {
                    BodyKind::Submarine | BodyKind::Aerial => MotionOutcome::default(),
                    BodyKind::Ground => self.settle(obstacles, dt_s),
                };
            }
            Task::Move { direction_in_map, ramp } => self.step_move(*direction_in_map, ramp, obstacles, dt_s),
            Task::Turn { sign, ramp } => {
                let done = self.step_turn(*sign, ramp, dt_s);
                MotionOutcome { task_done: done, ..MotionOutcome::default() }
            }
            Task::Path { leg, rest } => self.step_path(leg, rest, obstacles, dt_s),
            Task::Flight(flight) => self.step_flight(flight, obstacles, dt_s),
            Task::Velocity { target_in_body_m_s, target_yaw_rate_rad_s, .. } => {
                let target = (*target_in_body_m_s, *target_yaw_rate_rad_s);
                match self.model.kind {
                    BodyKind::Submarine => self.step_velocity(target, obstacles, dt_s),
                    BodyKind::Aerial => self.step_velocity_in_flight(target, obstacles, dt_s),
                    BodyKind::Ground => self.step_velocity_on_ground(target, obstacles, dt_s),
                }
            }
        };
        if moved.collided {
            self.stop();
        } else if !moved.task_done {
            self.task = task;
        }
        moved
    }

    /// Advances by `ticks` fixed updates of `dt_s` seconds or to the end of the task, whichever
    /// comes first, as if nothing were in the way; returns whether the task has ended.
    pub fn foresee(&mut self, ticks: u64, dt_s: f64) -> bool {
        (0..ticks).any(|_| self.advance(&Obstacles::none(), dt_s).task_done)
    }

    fn step_path(
        &mut self,
        leg: &mut PathLeg,
        rest: &mut VecDeque<Point3<f64>>,
        obstacles: &Obstacles<'_>,
        dt_s: f64,
    ) -> MotionOutcome {
        if let Some((sign, ramp)) = &mut leg.turn {
            if self.step_turn(*sign, ramp, dt_s) {
                leg.turn = None;
            }
            return MotionOutcome::default();
        }
        let mut moved = if self.model.kind == BodyKind::Ground {
            self.step_leg_on_ground(leg, obstacles, dt_s)
        } else {
            let offset = leg.target - self.pose.position;
            let direction = offset.try_normalize(0.0).unwrap_or_else(Vector3::zeros);
            self.step_move(direction, &mut leg.go, obstacles, dt_s)
        };
        if moved.task_done && !moved.collided {
            // The exact target, so that rounding errors do not accumulate over the legs of a long
            // path.
            if !obstacles.blocks(&self.pose.position, &leg.target, self.model.radius_m) {
                self.pose.position = leg.target;
            }
            if let Some(target) = rest.pop_front() {
                *leg = self.leg_to(target);
                moved.task_done = false;
            }
        }
        moved
    }

    fn step_move(
        &mut self,
        direction_in_map: Vector3<f64>,
        ramp: &mut Ramp,
        obstacles: &Obstacles<'_>,
        dt_s: f64,
    ) -> MotionOutcome {
        let (step_m, done) = match self.model.kind {
            BodyKind::Submarine => ramp.next_step(&self.move_limits(), dt_s),
            BodyKind::Aerial => ramp.next_landing_step(&self.move_limits(), dt_s),
            BodyKind::Ground => return self.step_move_on_ground(direction_in_map, ramp, obstacles, dt_s),
        };
        let mut moved = self.translate(direction_in_map * step_m, obstacles, dt_s);
        moved.task_done |= done;
        moved
    }

    fn move_limits(&self) -> RampLimits {
        RampLimits {
            speed_max: self.model.speed_max_m_s,
            acceleration: self.model.acceleration_m_s2,
            deceleration: self.model.deceleration_m_s2,
            rest_min: MOVE_REST_M,
        }
    }

    fn step_turn(&mut self, sign: f64, ramp: &mut Ramp, dt_s: f64) -> bool {
        let limits = RampLimits {
            speed_max: self.model.turn_rate_max_rad_s,
            acceleration: self.model.turn_acceleration_rad_s2,
            deceleration: self.model.turn_deceleration_rad_s2,
            rest_min: TURN_REST_RAD,
        };
        let (step_rad, done) = match self.model.kind {
            BodyKind::Submarine => ramp.next_step(&limits, dt_s),
            BodyKind::Aerial | BodyKind::Ground => ramp.next_landing_step(&limits, dt_s),
        };
        self.velocity_in_body_m_s = Vector3::zeros();
        self.yaw_rate_rad_s = sign * step_rad / dt_s;
        self.pose.yaw_rad = wrapped(self.pose.yaw_rad + sign * step_rad);
        self.collision = None;
        done
    }

    fn step_velocity(
        &mut self,
        (target_in_body_m_s, target_yaw_rate_rad_s): (Vector3<f64>, f64),
        obstacles: &Obstacles<'_>,
        dt_s: f64,
    ) -> MotionOutcome {
        let target = self.model.clamped(Vector3::new(target_in_body_m_s.x, 0.0, target_in_body_m_s.z));
        let velocity = self.model.velocity_towards(&self.velocity_in_body_m_s, &target, dt_s);
        let rate_rad_s = self.model.turn_rate_towards(self.yaw_rate_rad_s, target_yaw_rate_rad_s, dt_s);
        let moved = self.translate(turned(&velocity, self.pose.yaw_rad) * dt_s, obstacles, dt_s);
        if !moved.collided {
            self.velocity_in_body_m_s = velocity;
            self.yaw_rate_rad_s = rate_rad_s;
            self.pose.yaw_rad = wrapped(self.pose.yaw_rad + rate_rad_s * dt_s);
        }
        moved
    }

    /// Moves the centre by `displacement` (metres, frame `map`) unless something blocks it.
    fn translate(&mut self, displacement: Vector3<f64>, obstacles: &Obstacles<'_>, dt_s: f64) -> MotionOutcome {
        if let Some(contact) = obstacles.first_contact(&self.pose.position, &displacement, self.model.radius_m) {
            let surface = match self.model.kind {
                BodyKind::Submarine | BodyKind::Aerial => surface_of(&contact.normal),
                BodyKind::Ground => Surface::Wall,
            };
            self.collision = Some(Collision { surface, with_agent: contact.with_agent });
            return MotionOutcome { task_done: true, collided: true, distance_m: 0.0 };
        }
        self.pose.position += displacement;
        self.velocity_in_body_m_s = turned(&(displacement / dt_s), -self.pose.yaw_rad);
        self.yaw_rate_rad_s = 0.0;
        self.collision = None;
        MotionOutcome { task_done: false, collided: false, distance_m: displacement.norm() }
    }

    fn leg_to(&self, target: Point3<f64>) -> PathLeg {
        let mut offset = target - self.pose.position;
        if self.model.kind == BodyKind::Ground {
            offset = level(&offset);
        }
        let is_vertical = libm::hypot(offset.x, offset.y) < MOVE_REST_M;
        let turn_rad = if is_vertical || !self.model.turns_first() {
            0.0
        } else {
            wrapped(libm::atan2(offset.y, offset.x) - self.pose.yaw_rad)
        };
        PathLeg {
            target,
            turn: (turn_rad.abs() >= TURN_REST_RAD).then(|| (turn_rad.signum(), Ramp::from_rest(turn_rad.abs()))),
            go: Ramp::from_rest(offset.norm()),
        }
    }

    fn heading_raised_by(&self, pitch_rad: f64) -> Vector3<f64> {
        let (yaw_sin, yaw_cos) = libm::sincos(self.pose.yaw_rad);
        let (pitch_sin, pitch_cos) = libm::sincos(pitch_rad);
        Vector3::new(yaw_cos * pitch_cos, yaw_sin * pitch_cos, pitch_sin)
    }

    fn stop(&mut self) {
        self.velocity_in_body_m_s = Vector3::zeros();
        self.yaw_rate_rad_s = 0.0;
    }
}

#[cfg(test)]
mod tests;
