//! Goals to which no path was found: a search that failed is not made again until something near
//! its goal has changed.
//!
//! For confined bodies, which have many such goals: free cells that they see and cannot
//! come near. What is near is decided by buckets of cells as long as the radius of the body, so a
//! goal stands for those beside it.

use std::collections::BTreeSet;

use voxels::Cell;

use agent::exploration_map::ExplorationMap;

/// A change this many buckets away along each axis counts as near.
const NEAR_BUCKETS: i32 = 2;

/// The failed goals of one agent.
#[derive(Debug, Clone)]
pub(crate) struct FailedGoals {
    /// Edge of a bucket, cells; 0: nothing is remembered.
    edge: i32,
    buckets: BTreeSet<[i32; 3]>,
    /// Position in the journal of the map up to which changes have been read.
    read: usize,
}

impl FailedGoals {
    /// None yet, for a body of this radius; one that fits into a cell remembers nothing.
    pub(crate) fn new(radius_m: f64, cell_m: f64) -> Self {
        let radius_cells = radius_m / cell_m;
        let edge = if radius_cells > 0.5 { radius_cells.ceil() as i32 } else { 0 };
        Self { edge, buckets: BTreeSet::new(), read: 0 }
    }

    /// Forgets the goals near cells that have changed since the last call.
    pub(crate) fn update(&mut self, map: &ExplorationMap) {
        let since = std::mem::replace(&mut self.read, map.journal_len());
        if self.buckets.is_empty() {
            return;
        }
        let mut changed = BTreeSet::new();
        let mut last = None;
        for (cell, _) in map.cells_changed_since(since) {
            let bucket = self.bucket(cell);
            if last.replace(bucket) != Some(bucket) {
                changed.insert(bucket);
            }
        }
        let has_changed = |&[x, y, z]: &[i32; 3]| {
            let near = -NEAR_BUCKETS..=NEAR_BUCKETS;
            let columns = near.clone().flat_map(|by_x| near.clone().map(move |by_y| (x + by_x, y + by_y)));
            columns
                .into_iter()
                .any(|(x, y)| changed.range([x, y, z - NEAR_BUCKETS]..=[x, y, z + NEAR_BUCKETS]).next().is_some())
        };
        self.buckets.retain(|bucket| !has_changed(bucket));
    }

    /// Remembers a goal without a path.
    pub(crate) fn insert(&mut self, goal: Cell) {
        if self.edge > 0 {
            self.buckets.insert(self.bucket(goal));
        }
    }

    /// Whether the search to a goal, or to one beside it, has failed.
    pub(crate) fn holds(&self, goal: Cell) -> bool {
        !self.buckets.is_empty() && self.buckets.contains(&self.bucket(goal))
    }

    fn bucket(&self, cell: Cell) -> [i32; 3] {
        [cell.x, cell.y, cell.z].map(|along| along.div_euclid(self.edge))
    }
}

#[cfg(test)]
mod tests {
    use voxels::Extent;

    use super::*;

    #[test]
    fn goal_is_forgotten_when_something_near_it_changes() {
        let mut map = ExplorationMap::new(Extent::new([60, 10, 10], 0.2).unwrap());
        let index = |map: &ExplorationMap, x| map.extent().index(Cell::new(x, 5, 5)).unwrap() as u32;
        let mut failed = FailedGoals::new(0.3, 0.2);
        let goal = Cell::new(30, 5, 5);
        failed.insert(goal);
        assert!(failed.holds(goal) && failed.holds(Cell::new(31, 5, 4)) && !failed.holds(Cell::new(32, 5, 5)));
        for x in [10, 50] {
            map.note_free(&[index(&map, x)]);
            failed.update(&map);
            assert!(failed.holds(goal), "a change at {x}");
        }
        map.note_wall(&[index(&map, 33)]);
        failed.update(&map);
        assert!(!failed.holds(goal));
        failed.insert(goal);
        failed.update(&map);
        assert!(failed.holds(goal), "the change was before it failed");
    }

    #[test]
    fn bodies_that_fit_into_a_cell_remember_nothing() {
        let mut failed = FailedGoals::new(0.4, 1.0);
        failed.insert(Cell::default());
        assert!(!failed.holds(Cell::default()));
    }
}
