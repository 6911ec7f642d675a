//! What a body can reach of a map, and what it can see from there.
//!
//! A body moves through faces of cells, from centre to centre, where no wall is nearer than its
//! radius. A free cell is *seen* if the centre of a cell that the body reaches is on a ray from its
//! own centre through free cells, no longer than the range of the LiDAR: a line of sight leads both
//! ways. The bodies of other agents are no obstacles here.
//!
//! The share of the free cells that are seen is the most that a team of such bodies can explore.

use std::ops::ControlFlow;

use nalgebra::Point3;
use voxels::clearance::REACH_CELLS;
use voxels::{Cell, CellSet, Clearance, Extent, Grid, Terrain, lattice, walk};

use super::World;

/// Rays from a cell: as many as those of the LiDAR of MAES3D.
const RAYS: u32 = 5124;

/// Longest line of sight, cells; it bounds the time.
const RANGE_CELLS_MAX: f64 = 128.0;

/// Free cells that [`of_wide_bodies`] examines at most: some tenths of a second.
const SAMPLE_CELLS: usize = 1 << 15;

/// Largest map of [`of_wide_bodies`], cells: distances to walls take a second there.
const MAP_CELLS_MAX: usize = 1 << 24;

/// What bodies of one radius can do in a map, in cells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Attainable {
    /// Free cells of the map.
    pub free: usize,
    /// Cells at whose centres a body can be.
    pub reached: usize,
    /// Free cells that were examined.
    pub examined: usize,
    /// Those of them that a body can see or reach.
    pub seen: usize,
}

impl Attainable {
    /// Of bodies of `radius_cells` cells that start at the centres of some cells, or close to them,
    /// with a LiDAR of `range_cells` cells; at most `cells_max` free cells, spread evenly, are
    /// examined for whether they are seen.
    #[must_use]
    pub fn of(
        terrain: &Grid<Terrain>,
        clearance: &Clearance,
        radius_cells: f64,
        starts: &[Cell],
        range_cells: f64,
        cells_max: usize,
    ) -> Self {
        let extent = terrain.extent();
        let reached = reach(&clearance.room(radius_cells), starts);
        let rays = Rays::new(range_cells.min(RANGE_CELLS_MAX));
        let free: Vec<usize> = (0..extent.volume()).filter(|&index| terrain[index] == Terrain::Free).collect();
        let examined = free.iter().step_by(free.len().div_ceil(cells_max.max(1)).max(1));
        let is_seen = |index: usize| reached.contains(index) || rays.meet(terrain, extent.cell_at(index), &reached);
        Self {
            free: free.len(),
            reached: reached.len(),
            examined: examined.clone().count(),
            seen: examined.filter(|&&index| is_seen(index)).count(),
        }
    }

    /// Share of the free cells at whose centres a body can be.
    #[must_use]
    pub fn reached_share(&self) -> f64 {
        share(self.reached, self.free)
    }

    /// Share of the free cells examined that a body can see.
    #[must_use]
    pub fn seen_share(&self) -> f64 {
        share(self.seen, self.examined)
    }
}

/// What the bodies of a world that are wider than a cell can reach and see from where they are, by
/// radius, metres. Empty on large maps, and without a radius that is too large to tell.
#[must_use]
pub fn of_wide_bodies(world: &World) -> Vec<(f64, Attainable)> {
    let (terrain, extent) = (world.terrain(), world.terrain().extent());
    let cell_m = extent.cell_m();
    let mut teams: Vec<(f64, Vec<Cell>)> = Vec::new();
    for agent in world.agents() {
        let sphere = world.body(agent).sphere();
        let radius_cells = sphere.radius_m / cell_m;
        if radius_cells <= 0.5 || radius_cells > f64::from(REACH_CELLS) {
            continue;
        }
        let start = extent.cell_of(&sphere.centre);
        match teams.iter_mut().find(|(radius_m, _)| *radius_m == sphere.radius_m) {
            Some((_, starts)) => starts.push(start),
            None => teams.push((sphere.radius_m, vec![start])),
        }
    }
    if teams.is_empty() || extent.volume() > MAP_CELLS_MAX {
        return Vec::new();
    }
    let clearance = Clearance::of(terrain);
    let range_cells = world.params.scanner.greatest_range_m(cell_m) / cell_m;
    let attainable = |(radius_m, starts): (f64, Vec<Cell>)| {
        (radius_m, Attainable::of(terrain, &clearance, radius_m / cell_m, &starts, range_cells, SAMPLE_CELLS))
    };
    teams.into_iter().map(attainable).collect()
}

fn share(part: usize, whole: usize) -> f64 {
    if whole == 0 { 0.0 } else { part as f64 / whole as f64 }
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
    // A start that is no centre may be beside the only cells with room.
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
        // Neighbouring rays end at the same walls: a step that has no common divisor with their
        // number takes them far apart from each other.
        let order = (0..RAYS).map(|number| number * 1597 % RAYS);
        let rays = order.map(|number| {
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

    /// Whether a ray from a cell meets one of a set before a wall.
    fn meet(&self, terrain: &Grid<Terrain>, from: Cell, goals: &CellSet) -> bool {
        let extent = terrain.extent();
        self.rays.iter().any(|ray| {
            let free =
                ray.iter().map_while(|&by| extent.index(from + by).filter(|&index| terrain[index] == Terrain::Free));
            free.into_iter().any(|index| goals.contains(index))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn attainable(text: &str, radius_cells: f64, start: Cell, range_cells: f64) -> Attainable {
        let terrain = Grid::from_text(text).unwrap();
        Attainable::of(&terrain, &Clearance::of(&terrain), radius_cells, &[start], range_cells, usize::MAX)
    }

    /// Two rooms of 3 x 3 x 3 cells with a slit of one cell between them.
    fn rooms() -> String {
        let solid = "#########\n".repeat(5);
        let wall = "#########\n#...#...#\n#...#...#\n#...#...#\n#########\n";
        let slit = "#########\n#...#...#\n#.......#\n#...#...#\n#########\n";
        [&solid, wall, slit, wall, &solid].map(str::to_owned).join("\n")
    }

    #[test]
    fn wide_body_sees_through_a_slit_that_it_does_not_pass() {
        let start = Cell::new(2, 2, 2);
        let small = attainable(&rooms(), 0.4, start, 20.0);
        assert_eq!((small.free, small.reached, small.seen), (55, 55, 55));
        let wide = attainable(&rooms(), 1.4, start, 20.0);
        assert_eq!((wide.free, wide.reached), (55, 1));
        // Its own room, the slit, and what is behind it within the opening angle.
        assert!((29..55).contains(&wide.seen), "{wide:?}");
        let short = attainable(&rooms(), 1.4, start, 2.0);
        assert_eq!(short.seen, 28, "its own room and the slit");
        let nowhere = attainable(&rooms(), 1.6, start, 20.0);
        assert_eq!((nowhere.reached, nowhere.seen), (0, 0));
    }

    #[test]
    fn a_sample_of_the_cells_has_about_the_same_share() {
        let terrain = Grid::from_text(&rooms()).unwrap();
        let clearance = Clearance::of(&terrain);
        let of = |cells_max| Attainable::of(&terrain, &clearance, 1.4, &[Cell::new(2, 2, 2)], 20.0, cells_max);
        assert_eq!(of(20).examined, 19);
        assert!((of(20).seen_share() - of(100).seen_share()).abs() < 0.2);
    }
}
