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
//! they were last asked for: what a viewpoint sees is kept only while nothing has changed that it
//! depends on. This module plans no tours.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet, BinaryHeap};

use voxels::{Cell, CellSet, Extent};

use super::super::expectation::{Expectation, Place};
use super::super::gain::{GainEstimator, WHOLE};
use super::super::relocation::nearest_viewpoint;
use crate::abstract_graph::{AbstractGraph, Region, RegionId};
use crate::exploration_map::{CellState, ExplorationMap};

/// For how many plans a view is kept that none of them asks for.
const KEPT_PLANS: u64 = 20;

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
///
/// A ray passes known cells, which stay what they are unless a report is corrected, and ends in
/// unexplored ones. So a view depends on its unexplored cells and those around them alone; after a
/// correction all are looked at anew.
#[derive(Debug)]
pub(super) struct Viewpoints {
    expectation: Expectation,
    extent: Extent,
    /// By viewpoint.
    views: BTreeMap<Cell, View>,
    /// The number of plans so far.
    plans: u64,
    /// The position in the journal and the number of corrections at the last plan.
    read: usize,
    corrections: u64,
    /// The cells that have changed since the last plan, and those around them.
    changed: CellSet,
    covered: CellSet,
}

/// What is seen from a viewpoint.
#[derive(Debug)]
struct View {
    /// The unexplored cells that its rays meet, with their probabilities to be free and seen, in
    /// units of 1 / [`WHOLE`].
    cells: Vec<(u32, u32)>,
    /// The sum of these probabilities.
    gain: u64,
    /// The last plan that asked for it.
    plan: u64,
}

impl Viewpoints {
    /// No viewpoint has been looked at yet.
    pub(super) fn new(extent: Extent) -> Self {
        Self {
            expectation: Expectation::new(),
            extent,
            views: BTreeMap::new(),
            plans: 0,
            read: 0,
            corrections: 0,
            changed: CellSet::new(extent.volume()),
            covered: CellSet::new(extent.volume()),
        }
    }

    /// The tasks of some regions, those that add most first. `is_unproductive` names viewpoints
    /// from which a scan did not show what was expected.
    pub(super) fn tasks(
        &mut self,
        map: &ExplorationMap,
        gain_estimator: &mut GainEstimator,
        candidates: &[Candidate],
        is_unproductive: &dyn Fn(Cell) -> bool,
        expected_min: f64,
    ) -> Vec<Task> {
        self.plans += 1;
        self.note_changes(map);
        let mut queue = BinaryHeap::new();
        for (number, candidate) in candidates.iter().enumerate() {
            for cell in [candidate.cell, candidate.centre] {
                if !is_unproductive(cell)
                    && let Some(gain) = self.first_gain(map, gain_estimator, cell)
                {
                    queue.push((gain, Reverse((number, cell)), 0));
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
            let seen = &self.views[&cell].cells;
            if as_of < tasks.len() {
                let covered = &self.covered;
                let rest = seen.iter().filter(|&&(index, _)| !covered.contains(index as usize));
                let gain = rest.map(|&(_, chance)| u64::from(chance)).sum();
                queue.push((gain, Reverse((number, cell)), tasks.len()));
                continue;
            }
            seen.iter().for_each(|&(index, _)| self.covered.insert(index as usize));
            let Candidate { region, frontier, .. } = candidates[number];
            tasks.push(Task { region, cell, frontier, expected_cells });
        }
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
            chances += self.expectation.of(map.around(beside), Place::AtFrontier);
        }
        let expected_cells = (f64::from(chances) / f64::from(WHOLE)).min(expected_min);
        let Candidate { region, cell, frontier, .. } = *candidate;
        Some(Task { region, cell, frontier, expected_cells })
    }

    /// The gain of a viewpoint by itself; `None` if it was asked for in this plan already.
    fn first_gain(&mut self, map: &ExplorationMap, gain_estimator: &mut GainEstimator, cell: Cell) -> Option<u64> {
        let view = self.views.entry(cell).or_insert_with(|| {
            let mut cells = Vec::new();
            gain_estimator.expected(map, cell, &self.expectation, &mut cells);
            let gain = cells.iter().map(|&(_, chance)| u64::from(chance)).sum();
            View { cells, gain, plan: 0 }
        });
        (std::mem::replace(&mut view.plan, self.plans) != self.plans).then_some(view.gain)
    }

    /// Notes which cells have changed since the last plan, and forgets what is no longer true.
    fn note_changes(&mut self, map: &ExplorationMap) {
        self.changed.clear();
        if self.corrections != map.corrections() {
            self.corrections = map.corrections();
            self.views.clear();
        }
        let [size_x, size_y, size_z] = self.extent.size().map(u32::cast_signed);
        for (cell, _) in map.cells_changed_since(self.read) {
            let around = |at: i32, size: i32| (at - 1).max(0)..(at + 2).min(size);
            let row = around(cell.x, size_x);
            for (z, y) in around(cell.z, size_z).flat_map(|z| around(cell.y, size_y).map(move |y| (z, y))) {
                if let Some(start) = self.extent.index(Cell::new(row.start, y, z)) {
                    self.changed.insert_run(start, row.len() as u32);
                }
            }
        }
        self.read = map.journal_len();
        let (changed, plans) = (&self.changed, self.plans);
        self.views.retain(|_, view| {
            let is_true = || !view.cells.iter().any(|&(index, _)| changed.contains(index as usize));
            plans - view.plan <= KEPT_PLANS && is_true()
        });
    }
}
