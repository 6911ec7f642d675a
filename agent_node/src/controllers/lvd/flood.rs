//! Looking for the nearest cell with some property through the free cells of a map, breadth first.
//!
//! Cells at equal distances come in the order of [`voxels::FACES`] from their predecessors, so the answer depends on the map
//! and the question alone.

use std::collections::VecDeque;

use voxels::Cell;

use crate::exploration_map::{CellState, ExplorationMap};

/// What a flood makes of a cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Verdict {
    /// It is what is looked for.
    Best,
    /// It will do if there is nothing better.
    Good,
    /// It is not.
    No,
}

/// What floods write on: one word per cell of the map, provided by the system page by page where floods get to.
#[derive(Debug, Clone, Default)]
pub(crate) struct Flood {
    marks: Vec<u32>,
    epoch: u32,
    queue: VecDeque<Cell>,
}

impl Flood {
    /// The first cell that is best, else the first one that is good, among at most `cells_max` cells around `start`, in steps
    /// over faces. The start itself need not be free.
    pub(crate) fn nearest(
        &mut self,
        map: &ExplorationMap,
        start: Cell,
        cells_max: usize,
        mut judge: impl FnMut(Cell) -> Verdict,
    ) -> Option<Cell> {
        let extent = map.extent();
        if self.marks.len() != extent.volume() || self.epoch == u32::MAX {
            *self = Self { marks: vec![0; extent.volume()], ..Self::default() };
        }
        self.epoch += 1;
        self.queue.clear();
        self.marks[extent.index(start)?] = self.epoch;
        self.queue.push_back(start);
        let mut good = None;
        for _ in 0..cells_max {
            let Some(cell) = self.queue.pop_front() else { break };
            match judge(cell) {
                Verdict::Best => return Some(cell),
                Verdict::Good => good = good.or(Some(cell)),
                Verdict::No => {}
            }
            for next in cell.neighbours6() {
                if let Some(index) = extent.index(next)
                    && self.marks[index] != self.epoch
                    && matches!(map.state(next), CellState::Free | CellState::Covered)
                {
                    self.marks[index] = self.epoch;
                    self.queue.push_back(next);
                }
            }
        }
        good
    }

    /// Whether there is no way over faces from `from` to `to` through free cells, because the free cells around `from` end before
    /// `cells_max` of them are counted. What was seen through a gap in what is known is often such a pocket, and a search that
    /// begins outside of it would go through everything else first.
    pub(crate) fn is_cut_off(&mut self, map: &ExplorationMap, from: Cell, to: Cell, cells_max: usize) -> bool {
        let judge = |cell| if cell == to { Verdict::Best } else { Verdict::No };
        self.nearest(map, from, cells_max, judge).is_none() && self.queue.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use voxels::{Extent, Grid, Terrain};

    use super::*;

    fn known(text: &str) -> ExplorationMap {
        let world: Grid<Terrain> = Grid::from_text(text).unwrap();
        let mut map = ExplorationMap::new(world.extent());
        for (index, terrain) in (0..).zip(world.as_slice()) {
            if *terrain == Terrain::Free {
                map.note_free(&[index]);
            }
        }
        map
    }

    #[test]
    fn finds_the_nearest_on_the_way_through_free_cells() {
        let map = known("...\n.#.\n.#.\n");
        let mut flood = Flood::default();
        let at = |cell| move |found| if found == cell { Verdict::Best } else { Verdict::No };
        let start = Cell::new(0, 0, 0);
        let goal = Cell::new(2, 0, 0);
        assert_eq!(flood.nearest(&map, start, 100, at(goal)), Some(goal));
        assert_eq!(flood.nearest(&map, start, 6, at(goal)), None);
        assert_eq!(flood.nearest(&map, start, 100, at(Cell::new(1, 1, 0))), None);
        assert_eq!(flood.nearest(&map, Cell::new(0, 9, 0), 100, |_| Verdict::Best), None);
        let good = |cell: Cell| if cell.y == 2 { Verdict::Good } else { Verdict::No };
        assert_eq!(flood.nearest(&map, start, 100, good), Some(Cell::new(0, 2, 0)));
    }

    #[test]
    fn a_pocket_is_cut_off() {
        let map = known(".#....\n.#.##.\n");
        let mut flood = Flood::default();
        let (pocket, here, there) = (Cell::new(0, 0, 0), Cell::new(2, 0, 0), Cell::new(5, 0, 0));
        assert!(flood.is_cut_off(&map, pocket, here, 9) && flood.is_cut_off(&map, here, pocket, 9));
        assert!(!flood.is_cut_off(&map, there, here, 9));
        // Nobody knows after so few.
        assert!(!flood.is_cut_off(&map, pocket, here, 1));
    }

    #[test]
    fn can_be_used_for_another_map() {
        let mut flood = Flood::default();
        let empty = ExplorationMap::new(Extent::new([1, 1, 1], 1.0).unwrap());
        assert_eq!(flood.nearest(&empty, Cell::default(), 9, |_| Verdict::Good), Some(Cell::default()));
        assert_eq!(
            flood.nearest(&known("..\n"), Cell::new(1, 0, 0), 9, |cell| if cell.x == 0 {
                Verdict::Best
            } else {
                Verdict::No
            }),
            Some(Cell::default())
        );
    }
}
