//! Tasks: the frontiers of an agent's map in pieces small enough for one visit.
//!
//! A *task* is a set of regions with frontiers that lie in one block of the task grid and are
//! connected within it, so that rock separates tasks as it separates caves. The task grid is fixed,
//! and so agents with different maps can name tasks to each other: by the block and its *octants*
//! that have frontiers. Two names mean the same task if
//! they share an octant.
//!
//! Invariants: every frontier that the graph lists belongs to exactly one task, except those that
//! the caller ignores; tasks are in ascending order of their first region. This module knows no
//! owners.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::Point3;
use voxels::{Cell, Extent};

use super::super::gain::Likelihood;
use crate::abstract_graph::{AbstractGraph, BLOCK_CELLS, RegionId};
use crate::exploration_map::{CellState, ExplorationMap};

/// Edge of an octant, cells: two blocks of the abstract graph.
const OCTANT_CELLS: i32 = 2 * BLOCK_CELLS;

/// Edge of a block of the task grid, cells.
const EDGE_CELLS: i32 = 2 * OCTANT_CELLS;

/// The name of a task.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(in crate::controllers::dsvp) struct TaskId {
    /// Index of the block in the task grid.
    pub(super) block: u32,
    /// A bit for each octant of the block, x fastest.
    pub(super) octants: u8,
}

impl TaskId {
    /// Whether both names mean one task.
    pub(super) fn overlaps(self, other: Self) -> bool {
        self.block == other.block && self.octants & other.octants != 0
    }
}

/// The blocks of the task grid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct TaskGrid {
    extent: Extent,
    /// Blocks along each axis.
    size: [i32; 3],
}

impl TaskGrid {
    pub(super) fn new(extent: Extent) -> Self {
        Self { extent, size: extent.size().map(|cells| cells.div_ceil(EDGE_CELLS as u32) as i32) }
    }

    /// Number of blocks.
    pub(super) fn blocks(&self) -> u32 {
        self.size.iter().map(|&blocks| blocks as u32).product()
    }

    /// The name of a task with frontiers in the octant of this cell alone.
    pub(super) fn octant_of(&self, cell: Cell) -> TaskId {
        let [x, y, z] = [cell.x, cell.y, cell.z].map(|at| at.div_euclid(EDGE_CELLS));
        let [high_x, high_y, high_z] = [cell.x, cell.y, cell.z].map(|at| at.rem_euclid(EDGE_CELLS) / OCTANT_CELLS);
        let block = (z * self.size[1] + y) * self.size[0] + x;
        TaskId { block: block as u32, octants: 1 << (high_x + 2 * high_y + 4 * high_z) }
    }

    /// The mean of the centres of the octants of a task, metres.
    pub(super) fn centre(&self, task: TaskId) -> Point3<f64> {
        let block = task.block as i32;
        let [size_x, size_y, _] = self.size;
        let at = [block % size_x, block / size_x % size_y, block / size_x / size_y];
        let octants = || (0..8).filter(|octant| task.octants >> octant & 1 == 1);
        let mean = |axis: usize| {
            let high = octants().filter(|octant| octant >> axis & 1 == 1).count();
            f64::from(at[axis] * EDGE_CELLS) + high as f64 / octants().count() as f64 * f64::from(OCTANT_CELLS)
        };
        let along = |axis: usize| (mean(axis) + 0.5 * f64::from(OCTANT_CELLS)) * self.extent.cell_m();
        Point3::new(along(0), along(1), along(2))
    }
}

/// A task on one agent's map.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Task {
    pub(super) id: TaskId,
    /// Its regions, ascending.
    pub(super) regions: Vec<RegionId>,
    /// The unexplored cells beside its frontiers, by their likelihood to be free, in units of 1 /
    /// [`WHOLE`].
    pub(super) value: u32,
}

/// The tasks of a map.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Survey {
    pub(super) tasks: Vec<Task>,
    /// The index of the task of each region with frontiers.
    pub(super) task_of: BTreeMap<RegionId, usize>,
}

impl Survey {
    /// The tasks of all frontiers but the ignored ones. The graph must be up to date.
    pub(super) fn new(
        map: &ExplorationMap,
        graph: &AbstractGraph,
        grid: &TaskGrid,
        ignored: &BTreeSet<Cell>,
        likelihood: Likelihood,
    ) -> Self {
        let extent = map.extent();
        let mut open: BTreeMap<RegionId, u32> = BTreeMap::new();
        for frontier in map.frontiers().map(|index| extent.cell_at(index as usize)) {
            if !ignored.contains(&frontier)
                && let Some(region) = graph.region_listing(frontier).filter(|&region| graph.get(region).is_some())
            {
                let unexplored =
                    frontier.neighbours6().into_iter().filter(|&cell| map.state(cell) == CellState::Unexplored);
                let value: u32 = unexplored.map(|cell| likelihood.of(map, cell)).sum();
                *open.entry(region).or_default() += value;
            }
        }
        let mut survey = Self::default();
        for &first in open.keys() {
            if survey.task_of.contains_key(&first) {
                continue;
            }
            let number = survey.tasks.len();
            let mut task = Task { id: octant_of(grid, graph, first), regions: Vec::new(), value: 0 };
            survey.task_of.insert(first, number);
            let mut stack = vec![first];
            while let Some(region) = stack.pop() {
                task.id.octants |= octant_of(grid, graph, region).octants;
                task.value += open[&region];
                task.regions.push(region);
                for beside in graph.adjacent(region) {
                    let is_inside = open.contains_key(&beside) && octant_of(grid, graph, beside).block == task.id.block;
                    if is_inside && !survey.task_of.contains_key(&beside) {
                        survey.task_of.insert(beside, number);
                        stack.push(beside);
                    }
                }
            }
            task.regions.sort_unstable();
            survey.tasks.push(task);
        }
        survey
    }
}

fn octant_of(grid: &TaskGrid, graph: &AbstractGraph, region: RegionId) -> TaskId {
    grid.octant_of(graph.get(region).map(|region| region.centre).unwrap_or_default())
}

#[cfg(test)]
mod tests;
