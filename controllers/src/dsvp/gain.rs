//! The gain of a viewpoint: the unexplored cells that it would see, by ray casting in the agent's
//! own map.
//!
//! A ray from the centre of a cell passes through free cells and counts the unexplored cells it
//! meets, up to a depth, because behind the first ones there is usually rock; it ends at a wall and
//! at its range. A cell counts once for a viewpoint, however many rays meet it, and for less if it
//! is beside known walls ([`Likelihood`]).

mod rays;

use std::cell::RefCell;
use std::sync::Arc;

use voxels::{BodyLattice, Cell, Terrain};

use super::expectation::{Expectation, Place};
use agent::exploration_map::{Around, CellState, ExplorationMap};
use agent::observation::FieldOfView;
use rays::{Pattern, RayCell, Rays};

/// How much an unexplored cell counts, by the number of known walls beside it: surfaces are smooth,
/// so what is beside a wall is mostly wall.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Likelihood {
    /// By the number of known walls among the six neighbours, in units of 1 / [`WHOLE`]; `None`:
    /// all cells count alike.
    by_walls: Option<[u32; 7]>,
}

/// What a cell without known walls beside it counts.
pub(crate) const WHOLE: u32 = 256;

impl Likelihood {
    /// Each known wall beside a cell multiplies what it counts by `wall_adjacency_factor`.
    pub(crate) fn new(wall_adjacency_factor: f64) -> Self {
        let mut factor = 1.0;
        let by_walls = [0; 7].map(|_: u32| {
            let counts = (f64::from(WHOLE) * factor).round() as u32;
            factor *= wall_adjacency_factor;
            counts
        });
        Self { by_walls: (wall_adjacency_factor < 1.0).then_some(by_walls) }
    }

    /// What an unexplored cell counts.
    pub(crate) fn of(self, map: &ExplorationMap, cell: Cell) -> u32 {
        let Some(by_walls) = self.by_walls else { return WHOLE };
        by_walls[cell.neighbours6().into_iter().filter(|&beside| map.state(beside) == CellState::Wall).count()]
    }
}

/// A ray is not followed once it is less probable than this that its cells are free.
const CERTAIN_MIN: u32 = 3;

/// One of so many rays is always looked at by [`GainEstimator::first_unexplored`].
const FIRST: u32 = 16;

/// Estimates the gain of viewpoints.
#[derive(Debug, Clone)]
pub(crate) struct GainEstimator {
    pattern: Pattern,
    /// Once the size of the map is known.
    rays: Option<Arc<Rays>>,
    /// Most unexplored cells that one ray counts.
    depth: u32,
    likelihood: Likelihood,
}

/// What is noted of the cells around a viewpoint.
#[derive(Debug, Default)]
struct Scratch {
    /// The number of the viewpoint; numbers of a thread are not used twice.
    viewpoint: u32,
    /// For each cell of the cube around it, the viewpoint that last counted the cell there.
    counted: Vec<u32>,
    /// What was around it then, once [`GainEstimator::expected`] has been asked for.
    around: Vec<Around>,
}

thread_local! {
    static SCRATCH: RefCell<Scratch> = RefCell::default();
}

impl Scratch {
    /// Begins with a viewpoint; the cube around it has so many cells.
    fn begin(&mut self, cells: usize) {
        if self.counted.len() < cells {
            self.counted.resize(cells, 0);
        }
        self.viewpoint = self.viewpoint.wrapping_add(1);
        if self.viewpoint == 0 {
            self.counted.fill(0);
            self.viewpoint = 1;
        }
    }

    /// Counts a cell; returns whether it is new to this viewpoint.
    fn count(&mut self, place: usize) -> bool {
        std::mem::replace(&mut self.counted[place], self.viewpoint) != self.viewpoint
    }
}

/// An unexplored cell on a ray.
struct VisitedCell {
    cell: Cell,
    /// Its index in the cube around the viewpoint.
    place: usize,
    /// How many such cells are before it on the ray.
    before: u32,
}

impl GainEstimator {
    /// Rays in all directions, `range_cells` long.
    pub(crate) fn new(rays: u32, range_cells: f64, depth: u32, likelihood: Likelihood) -> Self {
        let pattern = Pattern { from: BodyLattice::Centres, rays, range_cells, view: None };
        Self { pattern, rays: None, depth, likelihood }
    }

    /// With rays that begin where a body is in a cell.
    pub(crate) fn from(mut self, lattice: BodyLattice) -> Self {
        self.pattern.from = lattice;
        self
    }

    /// Leaves out the rays that no heading brings into a field of view; `None`: none.
    pub(crate) fn limit_to(&mut self, view: Option<&FieldOfView>) {
        if self.pattern.view.as_ref() != view {
            self.pattern.view = view.copied();
            self.rays = None;
        }
    }

    /// Calls `found` with the first unexplored cell of each ray that meets one before a wall,
    /// relative to the viewpoint.
    pub(crate) fn each_first_unexplored(&mut self, map: &ExplorationMap, viewpoint: Cell, mut found: impl FnMut(Cell)) {
        let rays = self.rays(map);
        let mut start = 0;
        for &end in &rays.ends {
            let ray = &rays.cells[start..end as usize];
            start = end as usize;
            let end = ray.iter().find(|at| !map.state(viewpoint + at.by).is_free());
            if let Some(end) = end.filter(|end| map.state(viewpoint + end.by) == CellState::Unexplored) {
                found(end.by);
            }
        }
    }

    /// The rays on a map.
    fn rays(&mut self, map: &ExplorationMap) -> Arc<Rays> {
        let map_size = map.extent().size();
        match &self.rays {
            Some(rays) if rays.fits(self.pattern, map_size) => Arc::clone(rays),
            _ => Arc::clone(self.rays.insert(Rays::shared(self.pattern, map_size))),
        }
    }

    /// The unexplored cells visible from the centre of a cell, each by its likelihood to be free.
    pub(crate) fn gain(&mut self, map: &ExplorationMap, viewpoint: Cell) -> u32 {
        let rays = self.rays(map);
        let mut gain = 0;
        SCRATCH.with_borrow_mut(|scratch| {
            scratch.begin(rays.cube_cells);
            let mut meet = |VisitedCell { cell, place, .. }: VisitedCell| {
                if scratch.count(place) {
                    gain += self.likelihood.of(map, cell);
                }
                true
            };
            self.along_rays(&rays, map, viewpoint, &mut meet);
        });
        gain / WHOLE
    }

    /// Cells on all rays of a viewpoint, at least 1.
    pub(crate) fn ray_cells(&mut self, map: &ExplorationMap) -> usize {
        self.rays(map).cells.len().max(1)
    }

    /// The first unexplored cell that a ray from the centre of a cell meets, in the order of the
    /// rays.
    ///
    /// What a ray meets first lies behind a frontier. So of a viewpoint from which the first rays
    /// meet nothing, only those that pass a frontier are looked at.
    pub(crate) fn first_unexplored(&mut self, map: &ExplorationMap, viewpoint: Cell) -> Option<Cell> {
        let rays = self.rays(map);
        let extent = map.extent();
        let index = extent.index(viewpoint)?;
        let met_by = |ray: u32| {
            let (ray, offsets) = (rays.ray(ray), &rays.offsets[rays.places(ray)]);
            // A ray is straight, so it lies inside the map if its last cell does.
            let end = if ray.last().is_none_or(|last| extent.contains(viewpoint + last.by)) {
                offsets.iter().position(|&offset| !map.is_free_at(index.wrapping_add_signed(offset as isize)))
            } else {
                ray.iter().position(|at| !map.is_free(viewpoint + at.by))
            };
            let end = viewpoint + ray[end?].by;
            (map.state(end) == CellState::Unexplored).then_some(end)
        };
        let count = rays.ends.len() as u32;
        let is_before_ray = map.is_frontier(viewpoint) || !map.is_free(viewpoint);
        let first = if is_before_ray { count } else { count / FIRST };
        if let Some(found) = (0..first).find_map(met_by) {
            return Some(found);
        }
        if first == count {
            return None;
        }
        let mut found: Option<(u32, Cell)> = None;
        let mut looks = 0;
        for frontier in map.frontiers_near(viewpoint, rays.reach()) {
            let before = found.map_or(count, |(ray, _)| ray);
            for ray in rays.through(frontier - viewpoint).take_while(|&ray| ray < before) {
                looks += 1;
                if ray >= first
                    && let Some(cell) = met_by(ray)
                {
                    found = Some((ray, cell));
                    break;
                }
            }
            // There are so many frontiers that all rays cost less.
            if looks > count {
                return (first..count).find_map(met_by);
            }
        }
        found.map(|(_, cell)| cell)
    }

    /// Appends the unexplored cells that the viewpoint is expected to see, by index, each with the
    /// probability that it is free and seen, in units of 1 / [`WHOLE`]: that of all unexplored
    /// cells on the ray up to it.
    pub(super) fn expected(
        &mut self,
        map: &ExplorationMap,
        viewpoint: Cell,
        expectation: &Expectation,
        seen: &mut Vec<(u32, u32)>,
    ) {
        let rays = self.rays(map);
        SCRATCH.with_borrow_mut(|scratch| {
            scratch.begin(rays.cube_cells);
            scratch.around.resize(scratch.counted.len(), Around::default());
            let mut certain = WHOLE;
            let mut meet = |VisitedCell { cell, place, before }: VisitedCell| {
                let is_new = scratch.count(place);
                let around = &mut scratch.around[place];
                if is_new {
                    *around = map.around(cell);
                }
                certain = match before {
                    0 => expectation.of(*around, Place::AtFrontier),
                    _ => certain * expectation.of(*around, Place::Beyond) / WHOLE,
                };
                if is_new && let Some(index) = map.extent().index(cell) {
                    seen.push((index as u32, certain));
                }
                certain >= CERTAIN_MIN
            };
            self.along_rays(&rays, map, viewpoint, &mut meet);
        });
    }

    /// Calls `meet` for the unexplored cells that rays meet, ray by ray, nearest first; a ray ends
    /// once that returns false.
    fn along_rays(
        &self,
        rays: &Rays,
        map: &ExplorationMap,
        viewpoint: Cell,
        meet: &mut impl FnMut(VisitedCell) -> bool,
    ) {
        let extent = map.extent();
        let Some(index) = extent.index(viewpoint) else { return };
        let reach = Cell::new(rays.reach(), rays.reach(), rays.reach());
        let are_inside = extent.contains(viewpoint - reach) && extent.contains(viewpoint + reach);
        for ray in 0..rays.ends.len() as u32 {
            let (ray, offsets) = (rays.ray(ray), &rays.offsets[rays.places(ray)]);
            // A ray is straight, so it lies inside the map if its last cell does.
            if are_inside || ray.last().is_none_or(|last| extent.contains(viewpoint + last.by)) {
                let terrain = |&offset: &i32| map.terrain_at(index.wrapping_add_signed(offset as isize));
                self.follow(ray, viewpoint, offsets.iter().map(terrain), meet);
            } else {
                // Cells outside the map are walls.
                let terrain = |at: &RayCell| match extent.index(viewpoint + at.by) {
                    Some(index) => map.terrain_at(index),
                    None => Some(Terrain::Wall),
                };
                self.follow(ray, viewpoint, ray.iter().map(terrain), meet);
            }
        }
    }

    /// Follows one ray, with what is known of its cells.
    #[inline(always)]
    fn follow(
        &self,
        ray: &[RayCell],
        viewpoint: Cell,
        terrain: impl Iterator<Item = Option<Terrain>>,
        meet: &mut impl FnMut(VisitedCell) -> bool,
    ) {
        let mut unexplored = 0;
        for (number, terrain) in terrain.enumerate() {
            match terrain {
                Some(Terrain::Wall) => break,
                Some(Terrain::Free) => {}
                None => {
                    let RayCell { by, place } = ray[number];
                    let cell = viewpoint + by;
                    let is_followed = meet(VisitedCell { cell, place: place as usize, before: unexplored });
                    unexplored += 1;
                    if unexplored == self.depth || !is_followed {
                        break;
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;
    use std::ops::ControlFlow;

    use proptest::prelude::*;
    use voxels::{Extent, lattice, walk};

    use super::*;

    const ALIKE: Likelihood = Likelihood { by_walls: None };

    /// A corridor along x, known from x = 1 to x = 8, with walls all around.
    fn corridor() -> ExplorationMap {
        let extent = Extent::new([20, 3, 3], 1.0).unwrap();
        let mut map = ExplorationMap::new(extent);
        for x in 0..20 {
            for (y, z) in (0..3).flat_map(|y| (0..3).map(move |z| (y, z))) {
                let index = [extent.index(Cell::new(x, y, z)).unwrap() as u32];
                if (y, z) != (1, 1) || x == 0 {
                    map.note_wall(&index);
                } else if x <= 8 {
                    map.note_free(&index);
                }
            }
        }
        map
    }

    proptest! {
        #[test]
        fn first_unexplored_cell_is_that_of_a_look_along_all_rays(
            kinds in prop::collection::vec(0..40, 12 * 11 * 10), unexplored in 0..6, range in 1.0..9.0_f64,
        ) {
            let extent = Extent::new([12, 11, 10], 1.0).unwrap();
            let mut map = ExplorationMap::new(extent);
            for (index, kind) in (0..).zip(kinds) {
                match kind {
                    _ if kind < unexplored => {}
                    6..9 => map.note_wall(&[index]),
                    _ => map.note_free(&[index]),
                }
            }
            for from in [BodyLattice::Centres, BodyLattice::Corners] {
                let mut rays = GainEstimator::new(700, range, 1, ALIKE).from(from);
                for viewpoint in extent.cells().filter(|cell| (cell.x + 3 * cell.y + 5 * cell.z) % 29 == 0) {
                    let mut first = None;
                    rays.each_first_unexplored(&map, viewpoint, |by| first = first.or(Some(viewpoint + by)));
                    prop_assert_eq!(rays.first_unexplored(&map, viewpoint), first, "{:?}", viewpoint);
                }
            }
        }

        #[test]
        fn gain_is_that_of_a_walk_ray_by_ray(
            cells in prop::collection::vec(0..5, 9 * 8 * 7),
            at in (0..9_i32, 0..8_i32, 0..7_i32),
            range in prop::sample::select(vec![1.0, 2.5, 5.0]),
            depth in 1..4_u32,
            wall_adjacency_factor in prop::sample::select(vec![1.0, 0.5]),
        ) {
            let extent = Extent::new([9, 8, 7], 1.0).unwrap();
            let mut map = ExplorationMap::new(extent);
            for (index, kind) in (0..).zip(cells) {
                match kind {
                    0 => map.note_wall(&[index]),
                    1..=3 => map.note_free(&[index]),
                    _ => {}
                }
            }
            let viewpoint = Cell::new(at.0, at.1, at.2);
            let likelihood = Likelihood::new(wall_adjacency_factor);
            let mut met = BTreeSet::new();
            for ray in 0..300 {
                let mut unexplored = 0;
                let direction = lattice::direction(ray, 300);
                // The rays start in the middle of a cell, so a walk is the same in a larger world.
                let world = Extent::new([50; 3], 1.0).unwrap();
                let home = Cell::new(20, 20, 20);
                let _ = walk(world, &world.centre(home), &direction, range, |cell, _| {
                    let cell = cell - home + viewpoint;
                    if cell == viewpoint {
                        return ControlFlow::Continue(());
                    }
                    if map.state(cell) == CellState::Unexplored {
                        met.insert(cell);
                        unexplored += 1;
                    }
                    let is_over = map.state(cell) == CellState::Wall || unexplored == depth;
                    if is_over { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
                });
            }
            let expected = met.into_iter().map(|cell| likelihood.of(&map, cell)).sum::<u32>() / WHOLE;
            let mut estimator = GainEstimator::new(300, range, depth, likelihood);
            prop_assert_eq!([0; 2].map(|_| estimator.gain(&map, viewpoint)), [expected; 2]);
        }
    }

    #[test]
    fn gain_is_limited_by_range_and_depth() {
        let map = corridor();
        let gain = |range, depth, x| GainEstimator::new(2000, range, depth, ALIKE).gain(&map, Cell::new(x, 1, 1));
        assert_eq!(gain(5.0, 9, 8), 5);
        assert_eq!(gain(5.0, 2, 8), 2);
        assert_eq!(gain(5.0, 9, 5), 2);
        assert_eq!(gain(5.0, 9, 2), 0);
    }

    #[test]
    fn cells_beside_walls_count_less() {
        let map = corridor();
        let ahead = Cell::new(9, 1, 1);
        // Four walls beside the cell at the end of the corridor.
        let of = |wall_adjacency_factor| Likelihood::new(wall_adjacency_factor).of(&map, ahead);
        assert_eq!([of(1.0), of(0.5), of(0.1)], [WHOLE, WHOLE / 16, 0]);
        let empty = ExplorationMap::new(Extent::new([21; 3], 1.0).unwrap());
        assert_eq!(Likelihood::new(0.1).of(&empty, Cell::new(10, 10, 10)), WHOLE);
        let gain = |wall_adjacency_factor| {
            GainEstimator::new(2000, 5.0, 9, Likelihood::new(wall_adjacency_factor)).gain(&map, Cell::new(8, 1, 1))
        };
        assert_eq!([gain(1.0), gain(0.9), gain(0.1)], [5, 3, 0]);
    }

    #[test]
    fn walls_block_rays_and_cells_count_once() {
        let mut map = corridor();
        let wall = map.extent().index(Cell::new(9, 1, 1)).unwrap() as u32;
        map.note_wall(&[wall]);
        let mut gain_estimator = GainEstimator::new(500, 8.0, 8, ALIKE);
        assert_eq!(gain_estimator.gain(&map, Cell::new(8, 1, 1)), 0);
        let empty = ExplorationMap::new(Extent::new([21; 3], 1.0).unwrap());
        let mut gain_estimator = GainEstimator::new(5000, 3.0, 9, ALIKE);
        // All cells within 3 cells of the viewpoint, up to some at the edge.
        let all = gain_estimator.gain(&empty, Cell::new(10, 10, 10));
        assert!((100..260).contains(&all), "{all}");
        assert_eq!(gain_estimator.gain(&empty, Cell::new(10, 10, 10)), all);
    }
}
