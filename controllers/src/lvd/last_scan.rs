//! The last scan, queried cell by cell.
//!
//! Invariant: only the cells of the scan that was loaded last are marked.

use voxels::{Cell, Extent};

use agent::observation::Cells;

const FREE: u8 = 1;
const WALL: u8 = 2;

/// The view of one scan. It takes a byte per cell of the map, which the system provides page by
/// page near scanned cells.
#[derive(Debug, Clone, Default)]
pub(crate) struct LastScan {
    marks: Vec<u8>,
    view: Cells,
}

impl LastScan {
    /// Replaces the scan. Cells outside the map are ignored.
    pub(crate) fn load(&mut self, extent: Extent, view: &Cells) {
        if self.marks.len() != extent.volume() {
            self.marks = vec![0; extent.volume()];
        }
        for &cell in self.view.free.iter().chain(&self.view.wall) {
            self.marks[cell as usize] = 0;
        }
        let inside = |cells: &[u32]| cells.iter().copied().filter(|&cell| (cell as usize) < extent.volume()).collect();
        self.view = Cells { free: inside(&view.free), wall: inside(&view.wall) };
        for (cells, mark) in [(&self.view.free, FREE), (&self.view.wall, WALL)] {
            for &cell in cells {
                self.marks[cell as usize] = mark;
            }
        }
    }

    /// Whether the scan is the one that is loaded.
    pub(crate) fn is_of(&self, view: &Cells) -> bool {
        self.view == *view
    }

    /// Indices of the free cells seen, ascending.
    pub(crate) fn free(&self) -> &[u32] {
        &self.view.free
    }

    /// Indices of the walls seen, ascending.
    pub(crate) fn wall(&self) -> &[u32] {
        &self.view.wall
    }

    /// Whether a cell was seen free.
    pub(crate) fn is_free(&self, extent: Extent, cell: Cell) -> bool {
        self.mark(extent, cell) == FREE
    }

    /// Whether a cell was seen as a wall.
    pub(crate) fn is_wall(&self, extent: Extent, cell: Cell) -> bool {
        self.mark(extent, cell) == WALL
    }

    fn mark(&self, extent: Extent, cell: Cell) -> u8 {
        extent.index(cell).and_then(|index| self.marks.get(index).copied()).unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn holds_only_the_last_scan() {
        let extent = Extent::new([4, 1, 1], 1.0).unwrap();
        let mut scan = LastScan::default();
        assert!(!scan.is_free(extent, Cell::new(0, 0, 0)));
        scan.load(extent, &Cells { free: vec![0, 1], wall: vec![2, 9] });
        assert!(scan.is_free(extent, Cell::new(1, 0, 0)) && scan.is_wall(extent, Cell::new(2, 0, 0)));
        scan.load(extent, &Cells { free: vec![3], wall: vec![] });
        assert!(!scan.is_free(extent, Cell::new(1, 0, 0)) && !scan.is_wall(extent, Cell::new(2, 0, 0)));
        assert!(!scan.is_free(extent, Cell::new(-1, 0, 0)));
        assert_eq!((scan.free(), scan.wall()), (&[3][..], &[][..]));
    }
}
