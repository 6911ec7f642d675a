//! The tasks of a map: viewpoints that together see what is behind all of its frontiers.
//!
//! Each region with frontiers offers two viewpoints, its frontier nearest to its centre and the
//! centre. Of all, the one that adds most expected free cells is chosen first, then the one that
//! adds most to that (greedy set cover), down to a least gain; a region of which nothing is seen by
//! those chosen is a task of its own, however little it may hide.
//!
//! Source: C. Cao, H. Zhu, H. Choset, J. Zhang, "TARE: A Hierarchical Framework for Efficiently
//! Exploring Complex 3D Environments", RSS 2021 (viewpoints that cover all surfaces by a submodular
//! gain); here for frontiers and by probabilities.
//!
//! Invariants: the tasks depend on the map, the graph and the cells to leave out alone, not on when
//! they were last asked for: what a viewpoint sees is kept only while nothing in its reach has
//! changed. This module plans no tours.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet, BinaryHeap};

use voxels::{Cell, CellSet, Extent};

use super::super::expectation::{Expectation, Place};
use super::super::gain::{GainEstimator, WHOLE};
use super::super::relocation::nearest_viewpoint;
use crate::abstract_graph::{AbstractGraph, Region, RegionId};
use crate::exploration_map::{CellState, ExplorationMap};

/// Side of the blocks of which changes are noted, cells.
const BLOCK_CELLS: i32 = 10;

/// A viewpoint to visit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Task {
    pub(super) region: RegionId,
    /// The viewpoint.
    pub(super) cell: Cell,
    /// A frontier of the region.
    pub(super) frontier: Cell,
    /// Expected number of free cells that it adds to those of the tasks chosen before.
    pub(super) expected_cells: f64,
}

/// A region with frontiers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Candidate {
    pub(super) region: RegionId,
    pub(super) centre: Cell,
    /// The frontier nearest to the centre.
    pub(super) frontier: Cell,
    /// The viewpoint of the frontier.
    pub(super) cell: Cell,
}

impl Candidate {
    /// The candidate of a region, if it has a frontier that is not left out.
    pub(super) fn new(
        graph: &AbstractGraph,
        id: RegionId,
        region: &Region,
        here: Cell,
        left_out: &BTreeSet<Cell>,
    ) -> Option<Self> {
        let (frontier, cell) = nearest_viewpoint(graph, (id, region), here, left_out)?;
        Some(Self { region: id, centre: region.centre, frontier, cell })
    }
}

/// What the viewpoints of one agent see.
#[derive(Debug)]
pub(super) struct Viewpoints {
    expectation: Expectation,
    extent: Extent,
    /// Distance in cells within which a change of the map can change what is seen.
    reach: i32,
    /// Blocks of the map along each axis, and by block the position in the journal of its last
    /// change.
    size: [i32; 3],
    changed: Vec<usize>,
    read: usize,
    /// By viewpoint.
    views: BTreeMap<Cell, View>,
    covered: CellSet,
}

/// The unexplored cells seen from a viewpoint with their probabilities to be free, in units of 1 /
/// [`WHOLE`].
#[derive(Debug)]
struct View {
    cells: Vec<(u32, u32)>,
    /// The position in the journal up to which it is true.
    read: usize,
}

impl Viewpoints {
    /// No viewpoint has been looked at yet; rays are at most `range_cells` long.
    pub(super) fn new(extent: Extent, range_cells: f64) -> Self {
        let size = extent.size().map(|cells| cells.div_ceil(BLOCK_CELLS as u32) as i32);
        let blocks: usize = size.iter().map(|&blocks| blocks as usize).product();
        Self {
            expectation: Expectation::new(),
            extent,
            // A cell counts by what is known of its neighbours.
            reach: range_cells.ceil() as i32 + 1,
            size,
            changed: vec![0; blocks],
            read: 0,
            views: BTreeMap::new(),
            covered: CellSet::new(extent.volume()),
        }
    }

    /// The tasks of some regions, those that add most first. `is_unproductive` tells viewpoints
    /// from which a scan did not show what was expected.
    pub(super) fn tasks(
        &mut self,
        map: &ExplorationMap,
        gain_estimator: &mut GainEstimator,
        candidates: &[Candidate],
        is_unproductive: &dyn Fn(Cell) -> bool,
        expected_min: f64,
    ) -> Vec<Task> {
        self.note_changes(map);
        let mut queue = BinaryHeap::new();
        let mut views = BTreeMap::new();
        for (number, candidate) in candidates.iter().enumerate() {
            for cell in [candidate.cell, candidate.centre] {
                if !is_unproductive(cell) && !views.contains_key(&cell) {
                    let view = self.view(map, gain_estimator, cell);
                    queue.push((sum(&view), Reverse((number, cell)), 0));
                    views.insert(cell, view);
                }
            }
        }
        self.covered.clear();
        let mut tasks = Vec::new();
        // A gain only falls as others are chosen: one that is up to date and still the greatest is
        // the greatest of all.
        while let Some((gain, Reverse((number, cell)), as_of)) = queue.pop() {
            let expected_cells = gain as f64 / f64::from(WHOLE);
            if expected_cells < expected_min {
                break;
            }
            let seen = &views[&cell];
            if as_of < tasks.len() {
                let covered = &self.covered;
                let rest = seen.cells.iter().filter(|&&(index, _)| !covered.contains(index as usize));
                let gain = rest.map(|&(_, chance)| u64::from(chance)).sum();
                queue.push((gain, Reverse((number, cell)), tasks.len()));
                continue;
            }
            seen.cells.iter().for_each(|&(index, _)| self.covered.insert(index as usize));
            let Candidate { region, frontier, .. } = candidates[number];
            tasks.push(Task { region, cell, frontier, expected_cells });
        }
        self.views = views;
        let chosen: BTreeSet<RegionId> = tasks.iter().map(|task| task.region).collect();
        let left = candidates.iter().filter(|candidate| !chosen.contains(&candidate.region));
        tasks.extend(left.filter_map(|candidate| self.remnant(map, candidate, expected_min)));
        tasks
    }

    /// The task of a region of which the tasks chosen see nothing.
    fn remnant(&self, map: &ExplorationMap, candidate: &Candidate, expected_min: f64) -> Option<Task> {
        let unexplored = candidate.frontier.neighbours6().into_iter().filter_map(|beside| {
            (map.state(beside) == CellState::Unexplored).then_some((beside, self.extent.index(beside)?))
        });
        let mut chances = 0;
        for (beside, index) in unexplored {
            if self.covered.contains(index) {
                return None;
            }
            chances += self.expectation.of(map, beside, Place::AtFrontier);
        }
        let expected_cells = (f64::from(chances) / f64::from(WHOLE)).min(expected_min);
        let Candidate { region, cell, frontier, .. } = *candidate;
        Some(Task { region, cell, frontier, expected_cells })
    }

    fn view(&mut self, map: &ExplorationMap, gain_estimator: &mut GainEstimator, cell: Cell) -> View {
        if let Some(view) = self.views.remove(&cell)
            && !self.has_changed_since(view.read, cell)
        {
            return view;
        }
        let mut cells = Vec::new();
        gain_estimator.expected(map, cell, &self.expectation, &mut cells);
        View { cells, read: self.read }
    }

    /// Notes which blocks have changed since the last time.
    fn note_changes(&mut self, map: &ExplorationMap) {
        let before = std::mem::replace(&mut self.read, map.journal_len());
        for (cell, _) in map.cells_changed_since(before) {
            let [x, y, z] = [cell.x, cell.y, cell.z].map(|at| at / BLOCK_CELLS);
            self.changed[((z * self.size[1] + y) * self.size[0] + x) as usize] = self.read;
        }
    }

    /// Whether something within the reach of a viewpoint has changed since a position of the
    /// journal.
    fn has_changed_since(&self, read: usize, cell: Cell) -> bool {
        let blocks = |at: i32, size: i32| {
            let [low, high] = [at - self.reach, at + self.reach].map(|at| at.div_euclid(BLOCK_CELLS));
            low.max(0)..=high.min(size - 1)
        };
        let [along_x, along_y, along_z] =
            [blocks(cell.x, self.size[0]), blocks(cell.y, self.size[1]), blocks(cell.z, self.size[2])];
        let mut rows = along_z.flat_map(|z| along_y.clone().map(move |y| (z * self.size[1] + y) * self.size[0]));
        rows.any(|row| {
            let blocks = (row + along_x.start()) as usize..=(row + along_x.end()) as usize;
            self.changed[blocks].iter().any(|&changed| changed > read)
        })
    }
}

fn sum(view: &View) -> u64 {
    view.cells.iter().map(|&(_, chance)| u64::from(chance)).sum()
}
