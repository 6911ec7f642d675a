//! Moving obstacles: solids, such as people and vehicles, that go along given paths.
//!
//! An obstacle stands at the first point of its path until its time, and then moves at one speed
//! from point to point. It gives way: where its next step would bring it into contact with a body,
//! or into a wall that an event has made, it waits, and after 2 s turns back, unless it goes its
//! path once. Obstacles pass through each other.
//!
//! Obstacles move in the order of their numbers, before the bodies. A body collides with them as
//! with other bodies, which its agent cannot tell apart. The rays of every LiDAR end at them, as
//! they do at bodies with `lidar.sees_agents`: the points have them, and maps do not.
//!
//! Invariants: no obstacle overlaps a body or a wall; a world without obstacles pays nothing.

use msgs::ids::{AgentId, Tick};
use nalgebra::{Point3, Vector3};
use serde::{Deserialize, Serialize};
use voxels::{Grid, Terrain};

use super::World;
use super::collision::{Shape, Solid, Sphere};

/// How long an obstacle waits for what is in its way, ticks: 2 s.
const WAIT_TICKS: u32 = 100;

/// A moving obstacle as a scenario has it.
#[derive(Debug, Clone, PartialEq)]
pub struct ObstacleModel {
    /// Its shape.
    pub shape: Shape,
    /// The points that its centre goes through, metres, frame `map`: at least two, each apart from
    /// the next one.
    pub path: Vec<Point3<f64>>,
    /// Its speed, m/s, above 0.
    pub speed_m_s: f64,
    /// What comes after the last point.
    pub repeat: Repeat,
    /// The tick in which it begins to move.
    pub start: Tick,
}

/// What an obstacle does at the end of its path.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Repeat {
    /// It goes back along the path, and so on.
    #[default]
    ToAndFro,
    /// It goes straight to the first point, and so on.
    Loop,
    /// It stays there.
    Once,
}

/// Why an obstacle cannot be where its scenario puts it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Misplaced {
    /// It meets a wall, or the end of the map, between this point of its path and the next.
    InWall {
        /// Number of the point.
        point: usize,
    },
    /// An agent starts within it.
    OnAgent(AgentId),
}

/// A moving obstacle of a world.
#[derive(Debug)]
struct MovingObstacle {
    model: ObstacleModel,
    /// The number of the point that it goes to; `None` at the end of its path.
    next: Option<usize>,
    is_forward: bool,
    /// Since when something is in its way, ticks.
    waited_ticks: u32,
}

/// The moving obstacles of a world.
#[derive(Debug)]
pub(super) struct MovingObstacles {
    obstacles: Vec<MovingObstacle>,
    /// Where they are, by number.
    solids: Vec<Solid>,
    /// The tick in which one has moved last.
    moved: Option<Tick>,
}

impl ObstacleModel {
    /// Where it is at the start.
    #[must_use]
    pub fn at_start(&self) -> Solid {
        Solid { centre: self.path[0], shape: self.shape }
    }

    /// Checks that it meets no wall on its path, and no agent at its start. `bodies` are those of
    /// the agents, by id.
    ///
    /// # Errors
    /// What it meets.
    pub fn check_place(&self, terrain: &Grid<Terrain>, bodies: &[Sphere]) -> Result<(), Misplaced> {
        let closing = (self.repeat == Repeat::Loop).then_some(&self.path[0]);
        let legs = self.path.iter().zip(self.path.iter().skip(1).chain(closing));
        for (point, (&centre, to)) in legs.enumerate() {
            if (Solid { centre, shape: self.shape }).meets_wall(terrain, to) {
                return Err(Misplaced::InWall { point });
            }
        }
        let start = self.at_start();
        match bodies.iter().position(|body| start.overlaps(body)) {
            Some(agent) => Err(Misplaced::OnAgent(AgentId::from_index(agent))),
            None => Ok(()),
        }
    }
}

impl MovingObstacle {
    /// Notes that it has reached the point that it went to.
    fn pass(&mut self, point: usize) {
        let last = self.model.path.len() - 1;
        if self.model.repeat == Repeat::ToAndFro {
            self.is_forward = if self.is_forward { point < last } else { point == 0 };
        }
        self.next = (self.model.repeat != Repeat::Once || point < last).then(|| self.after(point));
    }

    /// The point that follows another one in its direction.
    fn after(&self, point: usize) -> usize {
        let count = self.model.path.len();
        if self.is_forward { (point + 1) % count } else { (point + count - 1) % count }
    }

    /// Waits for what is in its way, or turns back.
    fn wait(&mut self, point: usize) {
        self.waited_ticks += 1;
        if self.waited_ticks >= WAIT_TICKS && self.model.repeat != Repeat::Once {
            (self.waited_ticks, self.is_forward) = (0, !self.is_forward);
            self.next = Some(self.after(point));
        }
    }

    /// Moves it by a tick, as far as nothing is in its way.
    fn advance(&mut self, solid: &mut Solid, is_free: impl Fn(&Solid, &Vector3<f64>) -> bool) {
        let mut left_m = self.model.speed_m_s * Tick::TICK_S;
        while let Some(point) = self.next {
            let target = self.model.path[point];
            let offset = target - solid.centre;
            let length_m = offset.norm();
            let is_last = length_m > left_m;
            let step = if is_last { offset * (left_m / length_m) } else { offset };
            if !is_free(solid, &step) {
                return self.wait(point);
            }
            self.waited_ticks = 0;
            if is_last {
                solid.centre += step;
                return;
            }
            solid.centre = target;
            left_m -= length_m;
            self.pass(point);
        }
    }
}

impl MovingObstacles {
    /// At the starts of their paths.
    pub(super) fn new(models: &[ObstacleModel]) -> Self {
        let obstacle = |model: &ObstacleModel| MovingObstacle {
            model: model.clone(),
            next: Some(1),
            is_forward: true,
            waited_ticks: 0,
        };
        Self {
            obstacles: models.iter().map(obstacle).collect(),
            solids: models.iter().map(ObstacleModel::at_start).collect(),
            moved: None,
        }
    }

    pub(super) fn solids(&self) -> &[Solid] {
        &self.solids
    }
}

impl World {
    /// Where the moving obstacles are, by number.
    #[must_use]
    pub fn moving_obstacles(&self) -> &[Solid] {
        self.moving_obstacles.solids()
    }

    /// Whether an obstacle has moved in a tick or later, or has not begun its path yet.
    #[must_use]
    pub fn have_obstacles_moved_since(&self, tick: Tick) -> bool {
        let MovingObstacles { obstacles, moved, .. } = &self.moving_obstacles;
        *moved >= Some(tick) || obstacles.iter().any(|obstacle| self.tick < obstacle.model.start)
    }

    /// Moves the obstacles for the tick that ends.
    pub(super) fn move_obstacles(&mut self) {
        let Self { moving_obstacles, spheres, terrain, map_revision, tick, .. } = self;
        let MovingObstacles { obstacles, solids, moved } = moving_obstacles;
        for (obstacle, solid) in obstacles.iter_mut().zip(solids) {
            if *tick < obstacle.model.start {
                continue;
            }
            let before = solid.centre;
            obstacle.advance(solid, |solid, step| {
                // Seen from the obstacle, the bodies move.
                let meets = |body: &Sphere| solid.first_contact(&body.centre, &-step, body.radius_m).is_some();
                let meets_wall = || *map_revision > 0 && solid.meets_wall(terrain, &(solid.centre + step));
                !spheres.iter().any(|body| body.is_solid() && meets(body)) && !meets_wall()
            });
            if solid.centre != before {
                *moved = Some(*tick);
            }
        }
    }
}

#[cfg(test)]
mod tests;
