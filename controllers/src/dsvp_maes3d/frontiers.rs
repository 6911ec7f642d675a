//! Frontiers of the planner: those in view, and the list of those to relocate to.

use std::collections::BTreeSet;

use agent::exploration_map::{CellState, ExplorationMap};
use agent::observation::Cells;
use nalgebra::Point3;
use voxels::Cell;

use super::{CHOSEN, DIRECTION, cells, centre};

/// The list is purged of former frontiers when it has this many entries, and again each time its
/// length has doubled.
pub(super) const CLEARED_FROM: usize = 4096;

/// The list of frontiers for relocation, with possible duplicates.
#[derive(Debug, Clone, Default)]
pub(super) struct Frontiers {
    pub(super) list: Vec<Cell>,
    /// The set of cells on the list.
    pub(super) listed: BTreeSet<Cell>,
    /// Length of the list after it was last purged.
    pub(super) cleared: usize,
}

impl Frontiers {
    pub(super) fn push(&mut self, cell: Cell, map: &ExplorationMap) {
        // A former frontier never becomes one again and is never a destination: when it is removed
        // makes no difference.
        if self.list.len() >= CLEARED_FROM.max(2 * self.cleared) {
            self.clear_of_others(map);
        }
        self.list.push(cell);
        self.listed.insert(cell);
    }

    /// Appends the frontiers in view that are not on the list, in the order of their indices.
    pub(super) fn push_new(&mut self, view: &Cells, map: &ExplorationMap) {
        for cell in cells(&view.free, map).filter(|&cell| map.is_frontier(cell)) {
            if !self.listed.contains(&cell) {
                self.push(cell, map);
            }
        }
    }

    pub(super) fn take_last(&mut self) -> Option<Cell> {
        self.list.pop()
    }

    /// Rebuilds the set of listed cells after cells have been taken.
    pub(super) fn list_again(&mut self) {
        self.listed = self.list.iter().copied().collect();
    }

    pub(super) fn clear_of_others(&mut self, map: &ExplorationMap) {
        self.list.retain(|&cell| map.is_frontier(cell));
        self.cleared = self.list.len();
        self.list_again();
    }
}

/// The frontiers in view that are not covered: those most aligned with the direction of
/// exploration, best first, and the others in the order of their indices.
pub(super) fn local_frontiers(view: &Cells, map: &ExplorationMap, here: Point3<f64>) -> (Vec<Cell>, Vec<Cell>) {
    let is_local = |&cell: &Cell| map.is_frontier(cell) && map.state(cell) == CellState::Free;
    let mut others: Vec<Cell> = cells(&view.free, map).filter(is_local).collect();
    let off = |cell: Cell| {
        let towards = centre(cell) - here;
        let length = towards.norm();
        let unit = if length > 0.0 { towards / length } else { towards };
        (unit - DIRECTION).norm_squared()
    };
    let mut by_direction: Vec<(f64, Cell)> = others.iter().map(|&cell| (off(cell), cell)).collect();
    by_direction.sort_by(|(a, _), (b, _)| a.total_cmp(b));
    by_direction.truncate(CHOSEN);
    let chosen: Vec<Cell> = by_direction.into_iter().map(|(_, cell)| cell).collect();
    others.retain(|cell| !chosen.contains(cell));
    (chosen, others)
}
