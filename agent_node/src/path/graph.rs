//! The graph of a path search: the moves of a body, and these moves on a map.

use std::collections::BTreeSet;

use voxels::{BodyLattice, Cell, FACES};

use super::EDGE_COST;
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
    /// Where the body is in a cell.
    lattice: BodyLattice,
    /// The cells touched by the body at rest, relative to its cell; empty if it fits nowhere.
    sphere: Vec<Cell>,
    /// The cells within a few cells of the body relative to its own, nearest first; empty unless
    /// it is [wide](Moves::are_wide).
    nearby: Vec<Cell>,
    /// For each step the cells that the body touches, as bits of the block of 27 cells around its
    /// first cell; for the numbers beyond the steps a set that never is free. `None`: some lie
    /// outside that block.
    masks: Option<[u32; STEP_BITS]>,
    /// The same in the block of 125 cells around the first cell, for bodies that need no more;
    /// empty for all others.
    wide_masks: Vec<u128>,
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
                lattice,
                sphere: Vec::new(),
                nearby: Vec::new(),
                masks: None,
                wide_masks: Vec::new(),
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
        let wide_masks = if masks.is_none() { wide_masks(&steps).unwrap_or_default() } else { Vec::new() };
        Self { steps, neighbours, lattice, sphere, nearby, masks, wide_masks }
    }

    /// Where the body is in a cell.
    #[must_use]
    pub fn lattice(&self) -> BodyLattice {
        self.lattice
    }

    /// Whether the body touches more than one cell wherever it is at the place of one.
    #[must_use]
    pub fn are_wide(&self) -> bool {
        self.sphere.len() > 1
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

/// Cells from the middle of the block of [`Moves::wide_masks`] to its side.
const WIDE: i32 = 2;

/// See [`Moves::wide_masks`]; x first, as [`ExplorationMap::free_in`] has it.
fn wide_masks(steps: &[Step]) -> Option<Vec<u128>> {
    let side = 2 * WIDE + 1;
    let bit = |cell: &Cell| {
        let at = *cell + Cell::new(WIDE, WIDE, WIDE);
        let is_near = [at.x, at.y, at.z].iter().all(|along| (0..side).contains(along));
        is_near.then(|| 1_u128 << ((at.z * side + at.y) * side + at.x))
    };
    let mask = |step: &Step| step.swept.iter().try_fold(0, |mask, cell| Some(mask | bit(cell)?));
    steps.iter().map(mask).collect()
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

    pub(super) fn moves(&self) -> &'a Moves {
        self.moves
    }

    /// Whether the body at the place of a cell touches only cells known to be free.
    #[must_use]
    pub fn is_usable(&self, cell: Cell) -> bool {
        !self.moves.sphere.is_empty() && self.moves.sphere.iter().all(|&offset| is_free(self.map, cell + offset))
    }

    /// Whether the body is [wider than a cell](Moves::are_wide).
    pub(crate) fn is_body_wide(&self) -> bool {
        self.moves.are_wide()
    }

    /// The cells that the body does not touch, but that are beside one that it touches, in some
    /// directions; relative to its own cell.
    pub(crate) fn cells_beside_body(&self, directions: impl Iterator<Item = Cell> + Clone) -> BTreeSet<Cell> {
        let touched = &self.moves.sphere;
        let beside = touched.iter().flat_map(|&by| directions.clone().map(move |direction| by + direction));
        beside.filter(|by| touched.binary_search(by).is_err()).collect()
    }

    /// The cells within a few cells of a wide body at a cell, nearest first.
    pub(crate) fn cells_near(&self, cell: Cell) -> impl Iterator<Item = Cell> {
        self.moves.nearby.iter().map(move |&by| cell + by)
    }

    /// The usable cells of a cube of at most 5 cells along each axis whose lowest cell lies inside
    /// the map, one bit each, x first.
    pub(crate) fn usable_in(&self, corner: Cell, side: i32) -> u128 {
        if self.moves.sphere == [Cell::default()] {
            return self.map.free_in(corner, side);
        }
        let cells = (0..side).flat_map(|z| (0..side).flat_map(move |y| (0..side).map(move |x| Cell::new(x, y, z))));
        cells.enumerate().fold(0, |bits, (place, by)| bits | u128::from(self.is_usable(corner + by)) << place)
    }

    /// The cells to which a step leads from a usable cell, or from the start of a search.
    pub(crate) fn next_to(&self, cell: Cell, is_start: bool) -> impl Iterator<Item = Cell> {
        let open = if is_start { self.steps_from_start(cell) } else { self.steps_from(cell) };
        let steps = self.moves.steps.iter().enumerate();
        steps.filter(move |(number, _)| open >> number & 1 != 0).map(move |(_, step)| cell + step.by)
    }

    /// The possible steps from a usable cell, as bits in the order of the moves.
    pub(super) fn steps_from(&self, cell: Cell) -> u32 {
        let Some(masks) = &self.moves.masks else {
            let corner = cell - Cell::new(WIDE, WIDE, WIDE);
            if !self.moves.wide_masks.is_empty() && self.map.extent().contains(corner) {
                let blocked = !self.map.free_in(corner, 2 * WIDE + 1);
                return (0..)
                    .zip(&self.moves.wide_masks)
                    .fold(0, |steps, (number, mask)| steps | u32::from(mask & blocked == 0) << number);
            }
            return self.steps_where(|step| step.swept.iter().all(|&offset| is_free(self.map, cell + offset)));
        };
        let blocked = !self.map.free_around(cell);
        masks.iter().zip(STEP_BIT).fold(0, |steps, (mask, step)| steps | if mask & blocked == 0 { step } else { 0 })
    }

    /// The possible steps from a cell that need not be usable: cells that the body touches there
    /// are exempt.
    pub(super) fn steps_from_start(&self, cell: Cell) -> u32 {
        self.steps_where(|step| {
            let touched = |offset: &&Cell| self.moves.sphere.binary_search(offset).is_err();
            self.is_usable(cell + step.by)
                && step.swept.iter().filter(touched).all(|&offset| is_free(self.map, cell + offset))
        })
    }

    /// The steps with some property.
    fn steps_where(&self, can_be_made: impl Fn(&Step) -> bool) -> u32 {
        let steps = self.moves.steps.iter().enumerate();
        steps.fold(0, |bits, (number, step)| bits | u32::from(can_be_made(step)) << number)
    }
}

/// Whether a cell is known to be free.
pub(super) fn is_free(map: &ExplorationMap, cell: Cell) -> bool {
    map.state(cell).is_free()
}
