//! The graph of a path search: the moves of a body, and these moves on a map.

use std::collections::BTreeSet;

use protocol::body_model::BodyModel;
use voxels::{BodyLattice, Cell, FACES, Footing};

use super::EDGE_COST;
use super::room::{BlockSteps, Footprint};
use super::sweep::{clearance, place, touched};
use crate::exploration_map::ExplorationMap;

/// Connectivity of cells.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Neighbours {
    /// Cells that share a face: the moves of the reference.
    #[default]
    Six,
    /// Cells that share a face, an edge or a corner.
    TwentySix,
}

/// A step to a neighbour.
#[derive(Debug, Clone)]
pub(super) struct Step {
    pub(super) by: Cell,
    pub(super) cost: u64,
    /// The cells touched by the body during the step, relative to its first cell.
    swept: Vec<Cell>,
}

/// Number of bits in a set of steps.
const STEP_BITS: usize = u32::BITS as usize;

/// The bit of each step in a set of them.
const STEP_BIT: [u32; STEP_BITS] = {
    let mut bits = [0; STEP_BITS];
    let mut number = 0;
    while number < STEP_BITS {
        bits[number] = 1 << number;
        number += 1;
    }
    bits
};

/// The moves of a body of a given size. Compute them once and keep them.
#[derive(Debug, Clone)]
pub struct Moves {
    pub(super) steps: Vec<Step>,
    neighbours: Neighbours,
    radius_m: f64,
    /// Where the body is in a cell.
    lattice: BodyLattice,
    /// The cells touched by the body at rest, relative to its cell; empty if it fits nowhere.
    sphere: Vec<Cell>,
    /// The cells within a few cells of the body relative to its own, nearest first; empty unless
    /// it is [confined](Moves::are_confined).
    nearby: Vec<Cell>,
    /// For each step the cells that the body touches, as bits of the block of 27 cells around its
    /// first cell; for the numbers beyond the steps a set that never is free. `None`: the body is
    /// confined, and some lie outside that block or a step needs footing as well.
    masks: Option<[u32; STEP_BITS]>,
    /// The same by rows of cells, for confined bodies.
    footprint: Footprint,
}

impl Moves {
    /// The moves of a sphere of `radius_m` metres on cells with edges of `cell_m` metres.
    ///
    /// A body with a radius above 16 cells, negative or not a number fits nowhere, and has no
    /// moves.
    #[must_use]
    pub fn new(radius_m: f64, cell_m: f64, neighbours: Neighbours) -> Self {
        let lattice = BodyLattice::of(radius_m, cell_m);
        let Some(radius) = clearance(radius_m, cell_m) else {
            return Self {
                steps: Vec::new(),
                neighbours,
                radius_m,
                lattice,
                sphere: Vec::new(),
                nearby: Vec::new(),
                masks: None,
                footprint: Footprint::default(),
            };
        };
        let home = Cell::default();
        let step = |by: Cell| {
            let swept = touched(place(lattice, home), place(lattice, by), radius);
            Step { by, cost: cost_of(by), swept }
        };
        let steps: Vec<Step> = match neighbours {
            Neighbours::Six => FACES.into_iter().map(step).collect(),
            Neighbours::TwentySix => home.neighbours26().into_iter().map(step).collect(),
        };
        let masks = masks(&steps);
        let sphere = touched(place(lattice, home), place(lattice, home), radius);
        let nearby =
            if sphere.len() > 1 { nearest_first(radius.ceil() as i32 + nearby_cells(lattice)) } else { Vec::new() };
        let footprint = Footprint::new(&sphere, steps.iter().map(|step| (step.by, &step.swept[..])));
        Self { steps, neighbours, radius_m, lattice, sphere, nearby, masks, footprint }
    }

    /// The moves of a body: for a ground body those of its sphere for which it has footing.
    #[must_use]
    pub fn of(body: &BodyModel, cell_m: f64, neighbours: Neighbours) -> Self {
        let moves = Self::new(body.radius_m, cell_m, neighbours);
        let Some(footing) = body.footing(cell_m).filter(|_| !moves.sphere.is_empty()) else { return moves };
        let nearby = nearest_first((body.radius_m / cell_m).ceil() as i32 + NEAR_GROUND_CELLS);
        Self { nearby, masks: None, footprint: moves.footprint.with(footing), ..moves }
    }

    /// The footing of a ground body.
    pub(super) fn footing(&self) -> Option<&Footing> {
        self.footprint.footing()
    }

    /// What the body touches.
    pub(super) fn footprint(&self) -> &Footprint {
        &self.footprint
    }

    pub(super) fn radius_m(&self) -> f64 {
        self.radius_m
    }

    /// Where the body is in a cell.
    #[must_use]
    pub fn lattice(&self) -> BodyLattice {
        self.lattice
    }

    /// The cells that the body touches at the place of a cell, relative to it, in order.
    pub(crate) fn touched(&self) -> &[Cell] {
        &self.sphere
    }

    /// The lowest and the highest layer of these cells.
    pub(crate) fn layers(&self) -> [i32; 2] {
        let layers = self.sphere.iter().map(|by| by.z);
        [layers.clone().min().unwrap_or_default(), layers.max().unwrap_or_default()]
    }

    /// The most cells that a ground body may be above its floor; `None` for others.
    pub(crate) fn climb_cells(&self) -> Option<i32> {
        self.footing().map(|footing| footing.climb().cells_max())
    }

    /// Whether the body needs a floor.
    #[must_use]
    pub fn are_on_ground(&self) -> bool {
        self.footing().is_some()
    }

    /// Whether there are free cells in which the body cannot be alone: it touches more than one
    /// cell wherever it is at the place of one, or it needs a floor.
    #[must_use]
    pub fn are_confined(&self) -> bool {
        self.sphere.len() > 1 || self.are_on_ground()
    }

    /// A consistent lower bound on the path cost between two cells.
    pub(super) fn estimate(&self, a: Cell, b: Cell) -> u32 {
        let [x, y, z] = [a.x - b.x, a.y - b.y, a.z - b.z].map(|cells| u64::from(cells.unsigned_abs()));
        let cost = match self.neighbours {
            Neighbours::Six => (x + y + z) * EDGE_COST,
            Neighbours::TwentySix => {
                let (least, most) = (x.min(y).min(z), x.max(y).max(z));
                let middle = x + y + z - least - most;
                least * COSTS[3] + (middle - least) * COSTS[2] + (most - middle) * COSTS[1]
            }
        };
        u32::try_from(cost).expect("three axes of 1024 cells cost less than 2^32")
    }
}

/// How far beyond its body [`Graph::cells_near`] reaches, cells: it holds all cells from which a
/// step of the body touches the one in the middle.
fn nearby_cells(lattice: BodyLattice) -> i32 {
    match lattice {
        BodyLattice::Centres => 3,
        BodyLattice::Corners => 4,
    }
}

/// The same for a ground body, which looks up and down at what it is not beside.
const NEAR_GROUND_CELLS: i32 = 8;

/// The cells of a ball, by their distances from its centre; of equal ones in the order of cells.
fn nearest_first(radius: i32) -> Vec<Cell> {
    let along = -radius..=radius;
    let mut cells: Vec<Cell> = along
        .clone()
        .flat_map(|z| {
            along.clone().flat_map({
                let along = along.clone();
                move |y| along.clone().map(move |x| Cell::new(x, y, z))
            })
        })
        .filter(|cell| cell.distance_squared(Cell::default()) <= i64::from(radius * radius))
        .collect();
    cells.sort_by_key(|&cell| (cell.distance_squared(Cell::default()), cell));
    cells
}

/// Cost of a step that changes this many coordinates.
const COSTS: [u64; 4] = [0, EDGE_COST, 1_414_214, 1_732_051];

fn cost_of(by: Cell) -> u64 {
    COSTS[[by.x, by.y, by.z].iter().filter(|&&along| along != 0).count()]
}

/// See [`Moves::masks`].
fn masks(steps: &[Step]) -> Option<[u32; STEP_BITS]> {
    let mut masks = [u32::MAX; STEP_BITS];
    for (mask, step) in masks.iter_mut().zip(steps) {
        *mask = step.swept.iter().try_fold(0, |mask, &cell| Some(mask | bit(cell)?))?;
    }
    Some(masks)
}

/// The bit of a cell in the block of 27 cells around the origin.
fn bit(cell: Cell) -> Option<u32> {
    let is_near = [cell.x, cell.y, cell.z].iter().all(|along| (-1..=1).contains(along));
    is_near.then(|| 1 << ((cell.z + 1) * 9 + (cell.y + 1) * 3 + cell.x + 1))
}

/// The cells known to be free, and the moves between them.
#[derive(Debug, Clone, Copy)]
pub struct Graph<'a> {
    map: &'a ExplorationMap,
    moves: &'a Moves,
}

impl<'a> Graph<'a> {
    /// The moves of a body on the present map.
    #[must_use]
    pub fn new(map: &'a ExplorationMap, moves: &'a Moves) -> Self {
        Self { map, moves }
    }

    /// The map of the graph.
    #[must_use]
    pub fn map(&self) -> &'a ExplorationMap {
        self.map
    }

    /// The moves of the graph.
    #[must_use]
    pub fn moves(&self) -> &'a Moves {
        self.moves
    }

    /// Whether the body at the place of a cell touches only cells known to be free, and stands
    /// there if it is a ground body.
    #[must_use]
    pub fn is_usable(&self, cell: Cell) -> bool {
        self.moves.footprint.has_room(self.map, cell) && self.can_rest(cell)
    }

    /// Whether the body stays where it is in a cell in which it has room: not so a ground body that
    /// climbs.
    #[must_use]
    pub fn can_rest(&self, cell: Cell) -> bool {
        self.moves.footing().is_none_or(|footing| footing.stands(self.map, cell))
    }

    /// Those of the cells of a cube, as [`Graph::usable_in`] has them, in which the body can rest.
    pub(crate) fn resting_in(&self, corner: Cell, side: i32, cells: u128) -> u128 {
        let Some(footing) = self.moves.footing() else { return cells };
        those_of_cube(corner, side, cells, |cell| footing.stands(self.map, cell))
    }

    /// The distance in cells within which a change of the map can open or block a step from a cell.
    pub(super) fn step_reach_cells(&self) -> i32 {
        self.ground_reach_cells().unwrap_or(self.moves.footprint.reach())
    }

    /// The distance in cells within which a change of the map can make a cell usable or unusable
    /// for a ground body; `None` for others.
    pub(crate) fn ground_reach_cells(&self) -> Option<i32> {
        self.moves.footing().map(Footing::reach_cells)
    }

    /// Whether the body is [confined](Moves::are_confined).
    pub fn is_body_confined(&self) -> bool {
        self.moves.are_confined()
    }

    /// The cells that the body does not touch, but that are beside one that it touches, in some
    /// directions; relative to its own cell.
    pub fn cells_beside_body(&self, directions: impl Iterator<Item = Cell> + Clone) -> BTreeSet<Cell> {
        let touched = &self.moves.sphere;
        let beside = touched.iter().flat_map(|&by| directions.clone().map(move |direction| by + direction));
        beside.filter(|by| touched.binary_search(by).is_err()).collect()
    }

    /// The cells within a few cells of a confined body at a cell, nearest first.
    pub fn cells_near(&self, cell: Cell) -> impl Iterator<Item = Cell> {
        self.moves.nearby.iter().map(move |&by| cell + by)
    }

    /// The usable cells of a cube of at most 5 cells along each axis whose lowest cell lies inside
    /// the map, one bit each, x first.
    pub fn usable_in(&self, corner: Cell, side: i32) -> u128 {
        if self.moves.sphere == [Cell::default()] && !self.moves.are_on_ground() {
            return self.map.free_in(corner, side);
        }
        if self.moves.sphere.is_empty() {
            return 0;
        }
        self.moves.footprint.usable_in(self.map, corner, side)
    }

    /// The steps of the body on the present map.
    pub fn steps(&self) -> Steps<'a> {
        let by_blocks = self.moves.masks.is_none().then(BlockSteps::take);
        Steps { graph: *self, by_blocks }
    }

    /// The possible steps from a cell that need not be usable: cells that the body touches there
    /// are exempt.
    pub(super) fn steps_from_start(&self, cell: Cell) -> u32 {
        let can_be_made = |step: &Step| {
            let touched = |offset: &&Cell| self.moves.sphere.binary_search(offset).is_err();
            self.moves.footprint.has_room(self.map, cell + step.by)
                && step.swept.iter().filter(touched).all(|&offset| is_free(self.map, cell + offset))
                && self.moves.footing().is_none_or(|footing| footing.can_go(self.map, cell, cell + step.by))
        };
        let steps = self.moves.steps.iter().enumerate();
        steps.fold(0, |bits, (number, step)| bits | u32::from(can_be_made(step)) << number)
    }
}

/// The possible steps of a body, while its map does not change.
#[derive(Debug)]
pub struct Steps<'a> {
    graph: Graph<'a>,
    /// Of a confined body.
    by_blocks: Option<BlockSteps>,
}

impl Drop for Steps<'_> {
    fn drop(&mut self) {
        if let Some(by_blocks) = self.by_blocks.take() {
            by_blocks.give_back();
        }
    }
}

impl Steps<'_> {
    /// The steps from a usable cell, or from the start of a search, as bits in the order of the
    /// moves.
    #[inline]
    pub(super) fn bits(&mut self, cell: Cell, is_start: bool) -> u32 {
        let Graph { map, moves } = self.graph;
        match (&moves.masks, &mut self.by_blocks) {
            _ if is_start => self.graph.steps_from_start(cell),
            (Some(masks), _) => {
                let blocked = !map.free_around(cell);
                let step = |(mask, step): (&u32, u32)| if mask & blocked == 0 { step } else { 0 };
                masks.iter().zip(STEP_BIT).map(step).fold(0, |steps, step| steps | step)
            }
            (None, Some(by_blocks)) => by_blocks.from(map, &moves.footprint, cell),
            (None, None) => 0,
        }
    }

    /// The cells to which a step leads from a usable cell, or from the start of a search.
    pub fn next_to(&mut self, cell: Cell, is_start: bool) -> impl Iterator<Item = Cell> + use<'_> {
        let open = self.bits(cell, is_start);
        let steps = self.graph.moves.steps.iter().enumerate();
        steps.filter(move |(number, _)| open >> number & 1 != 0).map(move |(_, step)| cell + step.by)
    }
}

/// Those of the cells of a cube for which something holds.
pub(super) fn those_of_cube(corner: Cell, side: i32, cells: u128, holds: impl Fn(Cell) -> bool) -> u128 {
    let offset = |place: i32| Cell::new(place % side, place / side % side, place / side / side);
    let is_kept = |&place: &i32| cells >> place & 1 != 0 && holds(corner + offset(place));
    (0..side * side * side).filter(is_kept).fold(0, |kept, place| kept | 1 << place)
}

/// Whether a cell is known to be free.
pub(super) fn is_free(map: &ExplorationMap, cell: Cell) -> bool {
    map.is_free(cell)
}
