//! Viewpoints that together see every free cell that can be seen: greedy set cover over the views
//! of the scenario's LiDAR.
//!
//! There are rounds, because a team sees much on its way. The first one takes candidates of a
//! coarse grid as long as they see enough ([`coarse`]); later ones have viewpoints for what the
//! team has still not seen ([`rest`]). The candidate that sees most cells not yet seen is taken
//! next; since what a candidate adds only shrinks, only those whose old value is the greatest are
//! looked at again (lazy greedy).

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet, BinaryHeap};

use nalgebra::Point3;
use rayon::prelude::*;
use voxels::{BodyLattice, Cell, Extent, Grid, Terrain};
use world::body::Pose;
use world::lidar::{Scanner, SensorMemory};

/// A cell to scan from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Viewpoint {
    pub(super) cell: Cell,
    /// Indices of the cells that it is to see: those that earlier ones do not.
    pub(super) needs: Vec<u32>,
}

/// Candidates of a round, at most about.
const CANDIDATES: usize = 1000;

/// The first round ends when a viewpoint adds less than this share of the free cells.
const GAIN_MIN: f64 = 2e-4;

/// Viewpoints of a later round, at most; what they do not see is left to the next one.
const REST_MAX: usize = 300;

/// How far from a cell that is no place for a body a viewpoint for it is looked for, in cells.
const AROUND: i32 = 2;

/// What a LiDAR sees from the places of cells.
pub(super) struct Views<'a> {
    scanner: &'a Scanner,
    memory: SensorMemory,
    extent: Extent,
    /// Where bodies are in a cell.
    lattice: BodyLattice,
}

impl<'a> Views<'a> {
    pub(super) fn new(scanner: &'a Scanner, terrain: &Grid<Terrain>, lattice: BodyLattice) -> Self {
        Self { scanner, memory: SensorMemory::new(terrain), extent: terrain.extent(), lattice }
    }

    /// Marks the cells that are seen from these points (metres, frame `map`).
    pub(super) fn note_seen(&self, points: &[Point3<f64>], seen: &mut [bool]) {
        let view = |point: &Point3<f64>| self.scanner.view(&self.memory, &Pose { position: *point, yaw_rad: 0.0 }).free;
        let views: Vec<Vec<u32>> = points.par_iter().map(view).collect();
        views.iter().flatten().for_each(|&at| seen[at as usize] = true);
    }

    /// The free cells in view, ascending.
    fn from(&self, cell: Cell) -> Vec<u32> {
        let pose = Pose { position: self.lattice.place(self.extent, cell), yaw_rad: 0.0 };
        self.scanner.view(&self.memory, &pose).free
    }
}

/// Viewpoints among the `open` cells (ascending indices) for most free cells that are not yet
/// `seen`, which are marked there.
pub(super) fn coarse(views: &Views<'_>, open: &[u32], seen: &mut [bool]) -> Vec<Viewpoint> {
    let gain_min = (GAIN_MIN * open.len() as f64) as usize;
    greedy(views, &thinned(views.extent, open), seen, gain_min.max(1))
}

/// Viewpoints for other free cells that can be seen from near by. Those that cannot are marked as
/// `hopeless`, and are left out from then on.
pub(super) fn rest(
    terrain: &Grid<Terrain>,
    views: &Views<'_>,
    open: &[u32],
    seen: &mut [bool],
    hopeless: &mut BTreeSet<u32>,
) -> Vec<Viewpoint> {
    let extent = terrain.extent();
    let unseen: Vec<u32> = open.iter().copied().filter(|&index| !seen[index as usize]).collect();
    let mut chosen = greedy(views, &thinned(extent, &unseen), seen, 1);
    chosen.truncate(REST_MAX);
    // Cells near each other have the same places around them. All that is asked of a view is what
    // it shows of the cells that are left.
    let left: Vec<u32> = (0_u32..)
        .zip(terrain.as_slice())
        .filter(|(index, kind)| **kind == Terrain::Free && !seen[*index as usize] && !hopeless.contains(index))
        .map(|(index, _)| index)
        .collect();
    let mut shown: BTreeMap<Cell, Vec<u32>> = BTreeMap::new();
    for &index in &left {
        if chosen.len() >= REST_MAX {
            break;
        }
        if seen[index as usize] {
            continue;
        }
        let is_open = |near: &Cell| extent.index(*near).is_some_and(|at| open.binary_search(&(at as u32)).is_ok());
        let mut shows = |near: &Cell| {
            let view = shown
                .entry(*near)
                .or_insert_with(|| views.from(*near).into_iter().filter(|at| left.binary_search(at).is_ok()).collect());
            view.binary_search(&index).is_ok()
        };
        // A body sees its own cell.
        match around(extent.cell_at(index as usize)).into_iter().find(|near| is_open(near) && shows(near)) {
            Some(near) => chosen.push(take(near, &shown[&near], seen)),
            None => _ = hopeless.insert(index),
        }
    }
    chosen
}

/// The cells within [`AROUND`], nearest first.
fn around(cell: Cell) -> Vec<Cell> {
    let reach = -AROUND..=AROUND;
    let mut cells: Vec<Cell> = reach
        .clone()
        .flat_map(|z| {
            reach.clone().flat_map({
                let reach = reach.clone();
                move |y| reach.clone().map(move |x| Cell::new(x, y, z))
            })
        })
        .collect();
    cells.sort_by_key(|by| (by.x * by.x + by.y * by.y + by.z * by.z, *by));
    cells.into_iter().map(|by| cell + by).collect()
}

/// Of these cells the one nearest to the middle of each block of a grid, of which there are about
/// [`CANDIDATES`] at most.
fn thinned(extent: Extent, cells: &[u32]) -> Vec<Cell> {
    let mut side: usize = 2;
    while cells.len() / side.pow(3) > CANDIDATES {
        side += 1;
    }
    let side = side as i32;
    let mut nearest = BTreeMap::new();
    for &index in cells {
        let cell = extent.cell_at(index as usize);
        let block = [cell.z / side, cell.y / side, cell.x / side];
        let from_middle = |at: i32| (2 * (at % side) + 1 - side).pow(2);
        let key = (from_middle(cell.x) + from_middle(cell.y) + from_middle(cell.z), index);
        let best = nearest.entry(block).or_insert(key);
        *best = (*best).min(key);
    }
    nearest.into_values().map(|(_, index)| extent.cell_at(index as usize)).collect()
}

fn greedy(views: &Views<'_>, candidates: &[Cell], seen: &mut [bool], gain_min: usize) -> Vec<Viewpoint> {
    let new = |cells: &[u32], seen: &[bool]| cells.iter().filter(|&&at| !seen[at as usize]).count();
    // What was seen before stays so, and need not be remembered.
    let from = |cell: &Cell| -> Vec<u32> { views.from(*cell).into_iter().filter(|&at| !seen[at as usize]).collect() };
    let lists: Vec<Vec<u32>> = candidates.par_iter().map(from).collect();
    let mut queue: BinaryHeap<(usize, Reverse<usize>)> =
        lists.iter().enumerate().map(|(number, list)| (list.len(), Reverse(number))).collect();
    let mut chosen = Vec::new();
    while let Some((known, Reverse(number))) = queue.pop() {
        let gain = new(&lists[number], seen);
        if gain < gain_min {
            continue;
        }
        if gain < known && queue.peek().is_some_and(|next| *next > (gain, Reverse(number))) {
            queue.push((gain, Reverse(number)));
        } else {
            chosen.push(take(candidates[number], &lists[number], seen));
        }
    }
    chosen
}

fn take(cell: Cell, view: &[u32], seen: &mut [bool]) -> Viewpoint {
    let is_new = |&at: &u32| !std::mem::replace(&mut seen[at as usize], true);
    Viewpoint { cell, needs: view.iter().copied().filter(is_new).collect() }
}
