//! What the bodies of a team can reach of a map, and what they can see from there.
//!
//! A body moves from place to place ([`BodyLattice`]) along the axes where no wall is nearer than
//! its radius. A free cell is *attainable* if a scan from a place that a body reaches sees it; no
//! team of such bodies explores more, but for the little that is seen only from between the places,
//! which [`World::attainable_share`] counts as well once it has been seen.
//! The bodies of other agents are no obstacles here. A ground body rests where it stands, and
//! climbs as [`voxels::footing`] says.
//!
//! Scans from some of the places see nearly all that is attainable, because the time is bounded:
//! from all places if they are few, else from a lattice of them, and for each cell that is left
//! then from those that a ray from its own centre meets.

use std::collections::BTreeSet;
use std::f64::consts::TAU;
use std::ops::ControlFlow;

use nalgebra::Point3;
use protocol::body_model::{BodyKind, BodyModel};
use voxels::clearance::REACH_CELLS;
use voxels::{BodyLattice, Cell, CellSet, Clearance, Extent, Footing, Grid, Terrain, lattice, walk};

use super::body::{Floors, Pose};
use super::lidar::{Scanner, SensorMemory, SensorSuite};
use super::{Presence, World};

/// Rays from a cell that is left: as many as those of the LiDAR of MAES3D.
const RAYS: u32 = 5124;

/// Longest ray from a cell that is left, cells; it bounds the memory of the rays.
const RANGE_CELLS_MAX: f64 = 128.0;

/// Places from which scans are cast before single cells are looked at.
const PLACES_MAX: usize = 1 << 13;

/// Places from which a cell that is left is looked at.
const LOOKS_MAX: usize = 32;

/// Cells on the rays from cells that are left: about a second.
const STEPS_MAX: usize = 1 << 28;

/// Headings of the scans from one place with a LiDAR that does not see all around.
const HEADINGS: u32 = 16;

/// Largest map of [`of_team`], cells: distances to walls take a second there.
const MAP_CELLS_MAX: usize = 1 << 24;

/// Bodies of one model with the same LiDARs.
#[derive(Debug, Clone, PartialEq)]
pub struct Bodies {
    /// Their model.
    pub model: BodyModel,
    /// Their LiDARs.
    pub sensors: SensorSuite,
    /// The cells whose places are nearest to them.
    pub starts: Vec<Cell>,
}

/// What bodies can do in a map.
#[derive(Debug, Clone)]
pub struct Attainable {
    free: usize,
    reached: CellSet,
    seen: CellSet,
}

impl Attainable {
    /// Of a team of bodies.
    #[must_use]
    pub fn of(terrain: &Grid<Terrain>, team: &[Bodies]) -> Self {
        let extent = terrain.extent();
        let free = terrain.as_slice().iter().filter(|&&cell| cell == Terrain::Free).count();
        let mut reached = CellSet::new(extent.volume());
        let mut looks = Looks {
            memory: SensorMemory::new(terrain),
            seen: CellSet::new(extent.volume()),
            found: (Vec::new(), Vec::new()),
        };
        for bodies in team {
            looks.look_around(terrain, bodies, &mut reached);
        }
        Self { free, reached, seen: looks.seen }
    }

    /// Share of the free cells at whose places a body can be, 0 ..= 1.
    #[must_use]
    pub fn reached_share(&self) -> f64 {
        share(self.reached.len(), self.free)
    }

    /// Share of the free cells that are attainable, 0 ..= 1.
    #[must_use]
    pub fn seen_share(&self) -> f64 {
        share(self.seen.len(), self.free)
    }

    /// The attainable cells.
    #[must_use]
    pub fn seen(&self) -> &CellSet {
        &self.seen
    }
}

/// What the agents that have been in a world could reach and see together from where they started
/// or were put, if all their bodies are wider than a cell or on the ground, or their LiDARs do not
/// look up and down all the way; `None` for all others, for which that is everything, on large
/// maps, and with a radius that is too large to tell. Once the map has changed, it is what the
/// agents that still work can reach and see from where they were then, whatever the width of their
/// bodies.
#[must_use]
pub fn of_team(world: &World) -> Option<Attainable> {
    let extent = world.terrain().extent();
    if extent.volume() > MAP_CELLS_MAX {
        return None;
    }
    let mut team: Vec<Bodies> = Vec::new();
    let has_changed = world.map_revision() > 0;
    let takes_part = |presence| match has_changed {
        true => presence == Presence::Active,
        false => presence != Presence::Absent,
    };
    for agent in world.agents().filter(|&agent| takes_part(world.presence(agent))) {
        let (model, sensors) = (*world.body(agent).model(), world.sensors(agent));
        let (radius_m, is_ground) = (model.radius_m, model.kind == BodyKind::Ground);
        let radius_cells = radius_m / extent.cell_m();
        let sees_all_it_reaches = radius_cells <= 0.5 && sensors.field_of_view().is_none() && !is_ground;
        if (sees_all_it_reaches && !has_changed) || radius_cells > f64::from(REACH_CELLS) {
            return None;
        }
        // A ground body whose floor has gone away is on its way to the next one.
        let start = &world.starts[agent.index()];
        let start = Floors::rest(world.terrain(), &model, start).unwrap_or(*start);
        let start = BodyLattice::of(radius_m, extent.cell_m()).cell_near(extent, &start);
        let climbs =
            |body: &BodyModel| (body.kind == BodyKind::Ground).then_some((body.step_max_m, body.slope_max_rad));
        let are_same = |body: &BodyModel| (body.radius_m, climbs(body)) == (radius_m, climbs(&model));
        match team.iter_mut().find(|bodies| are_same(&bodies.model) && bodies.sensors == *sensors) {
            Some(bodies) => bodies.starts.push(start),
            None => team.push(Bodies { model, sensors: sensors.clone(), starts: vec![start] }),
        }
    }
    (!team.is_empty()).then(|| Attainable::of(world.terrain(), &team))
}

fn share(part: usize, whole: usize) -> f64 {
    if whole == 0 { 0.0 } else { part as f64 / whole as f64 }
}

/// Scans from places.
struct Looks {
    memory: SensorMemory,
    seen: CellSet,
    /// Reused: free cells and walls.
    found: (Vec<u32>, Vec<u32>),
}

impl Looks {
    /// Notes what bodies can reach, and sees what they can see.
    fn look_around(&mut self, terrain: &Grid<Terrain>, bodies: &Bodies, reached: &mut CellSet) {
        let extent = terrain.extent();
        let sensors = bodies.sensors.map(Scanner::swept);
        if sensors.field_of_view().is_some() {
            self.memory = self.memory.unused().of_body(bodies.model.radius_m);
        }
        let clearance = Clearance::for_body(bodies.model.radius_m, terrain);
        let lattice = clearance.lattice();
        let mut places = places(terrain, &clearance, bodies);
        places.iter().for_each(|index| reached.insert(index));
        let is_on_lattice = |index: usize, spacing: i32| {
            let Cell { x, y, z } = extent.cell_at(index);
            [x, y, z].iter().all(|along| along % spacing == 0)
        };
        let count = |spacing| places.iter().filter(|&index| is_on_lattice(index, spacing)).count();
        let spacing = (1..).find(|&spacing| count(spacing) <= PLACES_MAX).unwrap_or(1);
        for index in places.iter().filter(|&index| is_on_lattice(index, spacing)) {
            self.look_from(&sensors, lattice.place(extent, extent.cell_at(index)));
        }
        if spacing == 1 {
            return;
        }
        // A body sees the cells that it reaches.
        places.iter().for_each(|index| self.seen.insert(index));
        let rays = Rays::new((sensors.greatest_range_m(extent.cell_m()) / extent.cell_m()).min(RANGE_CELLS_MAX));
        let mut steps_left = STEPS_MAX;
        for cell in (0..extent.volume()).filter(|&index| terrain[index] == Terrain::Free) {
            if steps_left == 0 {
                break;
            }
            if self.seen.contains(cell) {
                continue;
            }
            for index in rays.in_sight(terrain, extent.cell_at(cell), &places, &mut steps_left) {
                places.remove(index);
                self.look_from(&sensors, lattice.place(extent, extent.cell_at(index)));
                if self.seen.contains(cell) {
                    break;
                }
            }
        }
    }

    /// Scans from a point, metres, frame `map`.
    fn look_from(&mut self, sensors: &SensorSuite, position: Point3<f64>) {
        for scanner in sensors.scanners() {
            let headings = if scanner.sees_all_around() { 1 } else { HEADINGS };
            for heading in 0..headings {
                let yaw_rad = f64::from(heading) * TAU / f64::from(headings);
                let (free, walls) = &mut self.found;
                free.clear();
                walls.clear();
                scanner.scan(&mut self.memory, &Pose { position, yaw_rad }, free, walls);
                free.iter().for_each(|&index| self.seen.insert(index as usize));
            }
        }
    }
}

/// The cells at whose places bodies can be and rest.
fn places(terrain: &Grid<Terrain>, clearance: &Clearance, Bodies { model, starts, .. }: &Bodies) -> CellSet {
    let room = clearance.room(model.radius_m / terrain.extent().cell_m());
    match model.footing(terrain.extent().cell_m()) {
        Some(footing) => {
            // A start between the places may be beside the only ones with room.
            let beside =
                |&start: &Cell| start.neighbours26().into_iter().filter(move |cell| cell.z == start.z).chain([start]);
            let starts: Vec<Cell> =
                starts.iter().flat_map(beside).filter(|&cell| footing.holds(terrain, cell)).collect();
            reach_on_ground(terrain, &room, &footing, &starts)
        }
        None => reach(&room, starts),
    }
}

/// The cells at which ground bodies stand that come from some.
fn reach_on_ground(terrain: &Grid<Terrain>, room: &Grid<Terrain>, footing: &Footing, starts: &[Cell]) -> CellSet {
    let extent = terrain.extent();
    let (mut reached, mut standing) = (CellSet::new(extent.volume()), CellSet::new(extent.volume()));
    let mut next = Vec::new();
    let mut enter = |cell: Cell, next: &mut Vec<Cell>| {
        if let Some(index) = extent.index(cell)
            && room[index] == Terrain::Free
            && !reached.contains(index)
        {
            reached.insert(index);
            if footing.stands(terrain, cell) {
                standing.insert(index);
            }
            next.push(cell);
        }
    };
    starts.iter().for_each(|&cell| enter(cell, &mut next));
    while let Some(cell) = next.pop() {
        let onward = cell.neighbours6().into_iter().filter(|&beside| footing.can_go(terrain, cell, beside));
        onward.for_each(|beside| enter(beside, &mut next));
    }
    standing
}

/// A part of the floor of a map, all of which a ground body reaches from one of its cells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StandingPart {
    /// The first of its cells.
    pub first: Cell,
    /// Number of cells at whose places the body stands.
    pub cells: usize,
}

/// The parts of the floor for a ground body; none for other bodies. What a body climbs it comes
/// down again, so that the parts have no cell in common.
#[must_use]
pub fn standing_parts(terrain: &Grid<Terrain>, model: &BodyModel) -> Vec<StandingPart> {
    let extent = terrain.extent();
    let Some(footing) = model.footing(extent.cell_m()) else { return Vec::new() };
    let room = Clearance::for_body(model.radius_m, terrain).room(model.radius_m / extent.cell_m());
    let mut done = CellSet::new(extent.volume());
    let mut parts = Vec::new();
    for (index, first) in extent.cells().enumerate() {
        if room[index] == Terrain::Free && !done.contains(index) && footing.stands(terrain, first) {
            let part = reach_on_ground(terrain, &room, &footing, &[first]);
            part.iter().for_each(|index| done.insert(index));
            parts.push(StandingPart { first, cells: part.len() });
        }
    }
    parts
}

/// The cells of a terrain that are connected with some through faces.
fn reach(room: &Grid<Terrain>, starts: &[Cell]) -> CellSet {
    let extent = room.extent();
    let mut reached = CellSet::new(extent.volume());
    let mut next = Vec::new();
    let mut enter = |cell: Cell, next: &mut Vec<Cell>| {
        if let Some(index) = extent.index(cell)
            && room[index] == Terrain::Free
            && !reached.contains(index)
        {
            reached.insert(index);
            next.push(cell);
        }
    };
    // A start between the places may be beside the only ones with room.
    starts.iter().flat_map(|start| start.neighbours26().into_iter().chain([*start])).for_each(|cell| {
        enter(cell, &mut next);
    });
    while let Some(cell) = next.pop() {
        cell.neighbours6().into_iter().for_each(|beside| enter(beside, &mut next));
    }
    reached
}

/// The cells on rays in all directions, relative to their first one, nearest first.
struct Rays {
    rays: Vec<Vec<Cell>>,
}

impl Rays {
    fn new(range_cells: f64) -> Self {
        let reach = range_cells.ceil().max(1.0) as i32;
        let side = (2 * reach + 1).cast_unsigned();
        let cube = Extent::new([side; 3], 1.0).expect("the range is bounded");
        let home = Cell::new(reach, reach, reach);
        let origin: Point3<f64> = cube.centre(home);
        let rays = (0..RAYS).map(|number| {
            let mut cells = Vec::new();
            let direction = lattice::direction(number, RAYS);
            let _: ControlFlow<()> = walk(cube, &origin, &direction, range_cells, |cell, _| {
                cells.push(cell - home);
                ControlFlow::Continue(())
            });
            cells
        });
        Self { rays: rays.collect() }
    }

    /// Some cells of a set that are on rays from a cell before a wall, the first of each ray; each
    /// step along a ray is taken off those left.
    fn in_sight(
        &self,
        terrain: &Grid<Terrain>,
        from: Cell,
        places: &CellSet,
        steps_left: &mut usize,
    ) -> BTreeSet<usize> {
        let extent = terrain.extent();
        let mut met = BTreeSet::new();
        for ray in &self.rays {
            for &by in ray {
                let Some(index) = extent.index(from + by).filter(|&index| terrain[index] == Terrain::Free) else {
                    break;
                };
                *steps_left = steps_left.saturating_sub(1);
                if places.contains(index) {
                    met.insert(index);
                    break;
                }
            }
            if met.len() == LOOKS_MAX {
                break;
            }
        }
        met
    }
}

#[cfg(test)]
mod tests {
    use super::super::lidar::Pattern;
    use super::*;

    fn attainable(terrain: &Grid<Terrain>, radius_m: f64, start: Cell, range_m: f64) -> Attainable {
        let scanner = Scanner::new(Pattern::Lattice { rays: RAYS }, range_m, TAU);
        let model = BodyModel { radius_m, ..BodyModel::SUBMARINE };
        Attainable::of(terrain, &[Bodies { model, sensors: scanner.into(), starts: vec![start] }])
    }

    /// Two rooms of 3 x 3 x 3 cells with a slit of one cell between them.
    fn rooms() -> Grid<Terrain> {
        let solid = "#########\n".repeat(5);
        let wall = "#########\n#...#...#\n#...#...#\n#...#...#\n#########\n";
        let slit = "#########\n#...#...#\n#.......#\n#...#...#\n#########\n";
        Grid::from_text(&[&solid, wall, slit, wall, &solid].map(str::to_owned).join("\n")).unwrap()
    }

    #[test]
    fn wide_body_sees_through_a_slit_that_it_does_not_pass() {
        let (rooms, start) = (rooms(), Cell::new(2, 2, 2));
        let counts = |radius_m, range_m| {
            let attainable = attainable(&rooms, radius_m, start, range_m);
            (attainable.reached.len(), attainable.seen.len())
        };
        assert_eq!(counts(0.4, 20.0), (55, 55));
        let (reached, seen) = counts(1.4, 20.0);
        // Its own room, the slit, and what is behind it within the opening angle.
        assert!(reached == 1 && (29..=55).contains(&seen), "{seen}");
        // Its own room and the slit.
        assert_eq!(counts(1.4, 2.0), (1, 28));
        assert_eq!(counts(1.6, 20.0), (0, 0));
    }

    #[test]
    fn ground_bodies_reach_what_they_climb() {
        // Two floors, one of them a cell higher, and a ledge of three cells.
        let layers = ["#########", "#...#####", "#......##", "#......##", "#.......#", "#.......#", "#########"];
        let hall = layers.map(|layer| format!("#########\n{layer}\n{layer}\n#########\n")).join("\n");
        let hall = Grid::from_text(&hall).unwrap();
        let on = |step_max_m: f64| BodyModel { step_max_m, slope_max_rad: 0.0, ..BodyModel::GROUND };
        let parts =
            |step_max_m| standing_parts(&hall, &on(step_max_m)).iter().map(|part| part.cells).collect::<Vec<usize>>();
        assert_eq!([parts(0.9), parts(1.0), parts(2.0)], [vec![6, 6, 2], vec![12, 2], vec![14]]);
        let sensors = SensorSuite::from(Scanner::new(Pattern::Lattice { rays: RAYS }, 20.0, TAU));
        let starts = vec![Cell::new(1, 1, 1)];
        let of = |model| Attainable::of(&hall, &[Bodies { model, sensors: sensors.clone(), starts: starts.clone() }]);
        let (low, all) = (of(on(0.5)), of(on(2.0)));
        assert_eq!((low.reached.len(), all.reached.len()), (6, 14));
        assert_eq!((low.seen_share(), all.seen_share()), (1.0, 1.0), "what it does not reach it sees from below");
    }

    #[test]
    fn bodies_of_two_cells_are_at_corners() {
        // A corridor of 2 x 2 x 7 cells.
        let (wall, free) = ("#########\n".repeat(4), "#########\n#.......#\n#.......#\n#########\n");
        let corridor = Grid::from_text(&[&wall, free, free, &wall].map(str::to_owned).join("\n")).unwrap();
        let through = attainable(&corridor, 1.0, Cell::new(2, 2, 2), 3.0);
        assert_eq!((through.reached.len(), through.seen_share()), (6, 1.0));
        assert_eq!(attainable(&corridor, 1.01, Cell::new(2, 2, 2), 3.0).reached_share(), 0.0);
    }

    #[test]
    fn cells_that_a_lattice_of_places_leaves_out_are_looked_at() {
        // A hall with more places than are scanned, and slits of one cell in its wall.
        let extent = Extent::new([60, 60, 12], 1.0).unwrap();
        let mut hall = Grid::new(extent, Terrain::Wall);
        for cell in extent.cells().filter(|cell| cell.is_within(Cell::new(30, 30, 6), 29)) {
            let is_inside = (1..51).contains(&cell.x) && (1..59).contains(&cell.y) && (1..11).contains(&cell.z);
            let is_slit = (51..56).contains(&cell.x) && cell.y % 7 == 3 && cell.z % 4 == 2;
            if is_inside || is_slit {
                hall.set(cell, Terrain::Free);
            }
        }
        let seen = attainable(&hall, 0.9, Cell::new(20, 20, 5), 12.0).seen_share();
        assert!(seen > 0.999, "{seen}");
    }
}
