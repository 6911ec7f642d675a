//! What an agent believes of the world: each cell unexplored, free or wall, and covered as a mark of its own.
//!
//! Invariants: a cell that is known stays as it is; only free cells are covered; the counts are those of the cells.
//!
//! This module does not judge whether what it is told is true.

use voxels::{Cell, Extent, Grid};

/// What is known of a cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
#[repr(u8)]
pub enum CellState {
    /// Nothing.
    #[default]
    Unexplored,
    /// It is free.
    Free,
    /// It is free and has been visited.
    Covered,
    /// It is wall.
    Wall,
}

/// The map of one agent.
#[derive(Debug, Clone)]
pub struct ExplorationMap {
    states: Grid<CellState>,
    free: usize,
    wall: usize,
    covered: usize,
}

impl ExplorationMap {
    /// A map of which nothing is known.
    #[must_use]
    pub fn new(extent: Extent) -> Self {
        Self { states: Grid::new(extent, CellState::Unexplored), free: 0, wall: 0, covered: 0 }
    }

    /// Where the map lies.
    #[must_use]
    pub fn extent(&self) -> Extent {
        self.states.extent()
    }

    /// What is known of a cell; outside the map all is wall.
    #[must_use]
    pub fn state(&self, cell: Cell) -> CellState {
        self.states.get(cell).copied().unwrap_or(CellState::Wall)
    }

    /// Free cells known, covered ones included.
    #[must_use]
    pub fn free(&self) -> usize {
        self.free
    }

    /// Walls known.
    #[must_use]
    pub fn wall(&self) -> usize {
        self.wall
    }

    /// Cells known to be covered.
    #[must_use]
    pub fn covered(&self) -> usize {
        self.covered
    }

    /// Notes that cells of the map (by index) are free.
    pub fn note_free(&mut self, cells: &[u32]) {
        let states = self.states.as_mut_slice();
        for &cell in cells {
            let state = &mut states[cell as usize];
            if *state == CellState::Unexplored {
                *state = CellState::Free;
                self.free += 1;
            }
        }
    }

    /// Notes that cells of the map (by index) are wall.
    pub fn note_wall(&mut self, cells: &[u32]) {
        let states = self.states.as_mut_slice();
        for &cell in cells {
            let state = &mut states[cell as usize];
            if *state == CellState::Unexplored {
                *state = CellState::Wall;
                self.wall += 1;
            }
        }
    }

    /// Notes that a cell has been visited, which makes it free as well. Outside the map nothing is noted, nor in a wall.
    pub fn note_covered(&mut self, cell: Cell) {
        let Some(state) = self.states.get_mut(cell) else {
            return;
        };
        match *state {
            CellState::Unexplored => self.free += 1,
            CellState::Free => {}
            CellState::Covered | CellState::Wall => return,
        }
        *state = CellState::Covered;
        self.covered += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_known_stays_known() {
        let extent = Extent::new([3, 2, 1], 1.0).unwrap();
        let mut map = ExplorationMap::new(extent);
        map.note_free(&[0, 1]);
        map.note_wall(&[1, 2]);
        map.note_free(&[2, 2]);
        assert_eq!(map.state(Cell::new(0, 0, 0)), CellState::Free);
        assert_eq!(map.state(Cell::new(1, 0, 0)), CellState::Free);
        assert_eq!(map.state(Cell::new(2, 0, 0)), CellState::Wall);
        assert_eq!(map.state(Cell::new(0, 1, 0)), CellState::Unexplored);
        assert_eq!(map.state(Cell::new(0, 2, 0)), CellState::Wall);
        assert_eq!((map.free(), map.wall(), map.covered()), (2, 1, 0));
    }

    #[test]
    fn covered_is_kept_and_free() {
        let mut map = ExplorationMap::new(Extent::new([2, 2, 1], 1.0).unwrap());
        map.note_covered(Cell::new(1, 1, 0));
        map.note_covered(Cell::new(1, 1, 0));
        map.note_free(&[3]);
        assert_eq!(map.state(Cell::new(1, 1, 0)), CellState::Covered);
        map.note_wall(&[0]);
        map.note_covered(Cell::new(0, 0, 0));
        map.note_covered(Cell::new(-1, 0, 0));
        assert_eq!((map.free(), map.wall(), map.covered()), (1, 1, 1));
    }
}
