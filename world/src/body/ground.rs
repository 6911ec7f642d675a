//! A body on the ground: it drives along the floor and climbs upright, first up, then on.
//!
//! The centre of a ground body is at the height of a place ([`BodyLattice`]) of its lowest layer of
//! cells in which it touches no wall; in between it climbs, with its top speed and without moving
//! aside. What it climbs is what [`voxels::footing`] says. A motion to where no floor is near
//! enough is refused as one into a wall, and whatever is in the way is a wall to the body.
//!
//! Invariants: below the body, no deeper than it climbs, is a floor; where a floor goes away, the
//! body is let down to the next one. Heights of waypoints and the pitch of a move have no effect.

use nalgebra::{Point3, Vector3};
use protocol::body_model::{BodyKind, BodyModel, Drive};
use protocol::kinematics::{turned, wrapped};
use protocol::observation::{Collision, Surface};
use voxels::{BodyLattice, Cell, Climb, Grid, Terrain};

use super::super::collision::{Obstacles, is_touched};
use super::ramp::Ramp;
use super::{Body, MotionOutcome, PathLeg};

/// A centre this little above a layer is in it, cells.
const SNAP_CELLS: f64 = 1e-6;

/// The floors of a terrain, for one body.
pub(in super::super) struct Floors<'t> {
    terrain: &'t Grid<Terrain>,
    radius_m: f64,
    lattice: BodyLattice,
    climb: Climb,
}

/// A wall is in the way that the body does not climb, or the floor goes down too far.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct NoWay;

impl<'t> Floors<'t> {
    fn new(terrain: &'t Grid<Terrain>, body: &BodyModel) -> Self {
        let cell_m = terrain.extent().cell_m();
        let climb = Climb::new(body.step_max_m, body.slope_max_rad, cell_m);
        Self { terrain, radius_m: body.radius_m, lattice: BodyLattice::of(body.radius_m, cell_m), climb }
    }

    /// Where a body comes to rest that is put at a position (metres, frame `map`): on the floor
    /// below, if it is a ground body. `None`: it has no room there.
    pub(in super::super) fn rest(
        terrain: &'t Grid<Terrain>,
        body: &BodyModel,
        position: &Point3<f64>,
    ) -> Option<Point3<f64>> {
        if body.kind != BodyKind::Ground {
            return Some(*position);
        }
        let floors = Self::new(terrain, body);
        let layer = floors.lattice.cell_near(terrain.extent(), position).z;
        let has_room = !floors.touches(position, layer);
        has_room.then(|| floors.at(position, floors.floor(position, layer)))
    }

    /// The point above or below another at the height of a layer.
    fn at(&self, point: &Point3<f64>, layer: i32) -> Point3<f64> {
        let z = self.lattice.place(self.terrain.extent(), Cell::new(0, 0, layer)).z;
        Point3::new(point.x, point.y, z)
    }

    /// The lowest layer that is not below a point.
    fn layer_above(&self, point: &Point3<f64>) -> i32 {
        let cells = point.z / self.terrain.extent().cell_m() - self.lattice.offset_cells();
        (cells - SNAP_CELLS).ceil() as i32
    }

    /// The walls that the body touches above or below a point in a layer.
    fn touched(&self, point: &Point3<f64>, layer: i32) -> impl Iterator<Item = Cell> + use<'t> {
        let (terrain, centre, radius_m) = (self.terrain, self.at(point, layer), self.radius_m);
        let (extent, reach) = (terrain.extent(), Vector3::repeat(radius_m));
        let (low, high) = (extent.cell_of(&(centre - reach)), extent.cell_of(&(centre + reach)));
        let cells = (low.z..=high.z)
            .flat_map(move |z| (low.y..=high.y).flat_map(move |y| (low.x..=high.x).map(move |x| Cell::new(x, y, z))));
        cells.filter(move |&cell| {
            terrain.get(cell) != Some(&Terrain::Free) && is_touched(extent, cell, &centre, radius_m)
        })
    }

    fn touches(&self, point: &Point3<f64>, layer: i32) -> bool {
        self.touched(point, layer).next().is_some()
    }

    /// The lowest layer to which the body sinks from another above or below a point.
    fn floor(&self, point: &Point3<f64>, from: i32) -> i32 {
        let mut layer = from;
        while !self.touches(point, layer - 1) {
            layer -= 1;
        }
        layer
    }

    /// The layer in which the body moves by `by` (metres, horizontal); without a motion the one
    /// in which it rests.
    ///
    /// # Errors
    /// If there is none.
    fn layer(&self, from: &Point3<f64>, by: &Vector3<f64>) -> Result<i32, NoWay> {
        let floor = self.floor(from, self.layer_above(from));
        if *by == Vector3::zeros() {
            return Ok(floor);
        }
        let (to, walls) = (from + by, Obstacles::new(self.terrain, &[], 0));
        for layer in floor..=floor + self.climb.cells_max() {
            if layer > floor && self.touches(from, layer) {
                break;
            }
            if walls.first_contact(&self.at(from, layer), by, self.radius_m).is_some() {
                continue;
            }
            let is_floor = |&depth: &i32| self.touches(&to, layer - 1 - depth);
            let Some(depth) = (0..=self.climb.cells_max()).find(is_floor) else { break };
            let below = self.touched(from, layer - 1).chain(self.touched(&to, layer - 1));
            let is_allowed = self.climb.allows(self.terrain, depth.max(layer - floor), below);
            return if is_allowed { Ok(layer) } else { Err(NoWay) };
        }
        Err(NoWay)
    }
}

impl Body {
    /// Whether it is a ground body that would sink.
    fn is_up(&self, obstacles: &Obstacles<'_>) -> bool {
        let is_up = |floors: &Floors<'_>| {
            let at = &self.pose.position;
            floors.layer(at, &Vector3::zeros()) != Ok(floors.layer_above(at))
        };
        obstacles.terrain().is_some_and(|terrain| is_up(&Floors::new(terrain, &self.model)))
    }

    /// Sinks to the floor, or stays there.
    pub(super) fn settle(&mut self, obstacles: &Obstacles<'_>, dt_s: f64) -> MotionOutcome {
        let (moved, _) = self.drive(Vector3::zeros(), obstacles, dt_s);
        MotionOutcome { distance_m: moved.distance_m, ..MotionOutcome::default() }
    }

    /// Moves by `along` (metres, frame `map`, horizontal), or climbs towards where it can; returns
    /// whether it has climbed.
    fn drive(&mut self, along: Vector3<f64>, obstacles: &Obstacles<'_>, dt_s: f64) -> (MotionOutcome, bool) {
        let Some(terrain) = obstacles.terrain() else { return (self.translate(along, obstacles, dt_s), false) };
        let floors = Floors::new(terrain, &self.model);
        let layer = match floors.layer(&self.pose.position, &along) {
            Ok(layer) => layer,
            Err(NoWay) => {
                self.collision = Some(Collision { surface: Surface::Wall, with_agent: false });
                return (MotionOutcome { task_done: true, collided: true, distance_m: 0.0 }, false);
            }
        };
        let at_layer = floors.at(&self.pose.position, layer);
        let up_m = at_layer.z - self.pose.position.z;
        if up_m == 0.0 {
            return (self.translate(along, obstacles, dt_s), false);
        }
        let step_max_m = self.model.speed_max_m_s * dt_s;
        let is_last = up_m.abs() <= step_max_m;
        let step_m = if is_last { up_m } else { step_max_m.copysign(up_m) };
        let moved = self.translate(Vector3::new(0.0, 0.0, step_m), obstacles, dt_s);
        if is_last && !moved.collided {
            self.pose.position = at_layer;
        }
        (moved, true)
    }

    pub(super) fn step_move_on_ground(
        &mut self,
        direction: Vector3<f64>,
        ramp: &mut Ramp,
        obstacles: &Obstacles<'_>,
        dt_s: f64,
    ) -> MotionOutcome {
        let mut next = *ramp;
        let (step_m, done) = next.next_landing_step(&self.move_limits(), dt_s);
        let (mut moved, has_climbed) = self.drive(direction * step_m, obstacles, dt_s);
        if has_climbed {
            *ramp = Ramp::from_rest(ramp.rest);
        } else {
            *ramp = next;
            moved.task_done |= done && !self.is_up(obstacles);
        }
        moved
    }

    /// A step of a leg of a path after its turn; it is done on its waypoint, on the floor.
    pub(super) fn step_leg_on_ground(
        &mut self,
        leg: &mut PathLeg,
        obstacles: &Obstacles<'_>,
        dt_s: f64,
    ) -> MotionOutcome {
        let offset = level(&(leg.target - self.pose.position));
        let direction = offset.try_normalize(0.0).unwrap_or_else(Vector3::zeros);
        let moved = self.step_move_on_ground(direction, &mut leg.go, obstacles, dt_s);
        // So that the leg ends exactly on the waypoint.
        leg.target.z = self.pose.position.z;
        moved
    }

    pub(super) fn step_velocity_on_ground(
        &mut self,
        (target_in_body_m_s, target_yaw_rate_rad_s): (Vector3<f64>, f64),
        obstacles: &Obstacles<'_>,
        dt_s: f64,
    ) -> MotionOutcome {
        let mut target_m_s = level(&target_in_body_m_s);
        if self.model.drive == Drive::Differential {
            target_m_s.y = 0.0;
        }
        let present_m_s = level(&self.velocity_in_body_m_s);
        let velocity_m_s = self.model.velocity_towards(&present_m_s, &self.model.clamped(target_m_s), dt_s);
        let rate_rad_s = self.model.turn_rate_towards(self.yaw_rate_rad_s, target_yaw_rate_rad_s, dt_s);
        let (moved, has_climbed) = self.drive(turned(&velocity_m_s, self.pose.yaw_rad) * dt_s, obstacles, dt_s);
        if !moved.collided {
            if !has_climbed {
                self.velocity_in_body_m_s = velocity_m_s;
            }
            self.yaw_rate_rad_s = rate_rad_s;
            self.pose.yaw_rad = wrapped(self.pose.yaw_rad + rate_rad_s * dt_s);
        }
        moved
    }
}

/// The horizontal part of a vector.
pub(super) fn level(vector: &Vector3<f64>) -> Vector3<f64> {
    Vector3::new(vector.x, vector.y, 0.0)
}

#[cfg(test)]
mod tests;
