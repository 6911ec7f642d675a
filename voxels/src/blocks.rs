//! A partition of a map into cubic blocks of cells, so that a change concerns one block.
//!
//! Blocks are numbered as cells are: x first, then y, then z. Those at the upper ends of the map
//! may be smaller.

use crate::{Cell, Extent};

/// The blocks of an extent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Blocks {
    extent: Extent,
    side: u32,
    count: [u32; 3],
}

impl Blocks {
    /// Blocks of `side` cells along each axis (at least 1).
    ///
    /// # Panics
    /// If `side` is 0.
    #[must_use]
    pub fn new(extent: Extent, side: u32) -> Self {
        Self { extent, side, count: extent.size().map(|cells| cells.div_ceil(side)) }
    }

    /// How many blocks there are.
    #[must_use]
    pub fn count(&self) -> u32 {
        self.count.iter().product()
    }

    /// The block that holds the cell with this index.
    #[must_use]
    pub fn of(&self, index: usize) -> u32 {
        let cell = self.extent.cell_at(index);
        let [x, y, z] = [cell.x, cell.y, cell.z].map(|along| along as u32 / self.side);
        (z * self.count[1] + y) * self.count[0] + x
    }

    /// The cells of a block inside the map, in the order of their indices.
    pub fn cells(&self, block: u32) -> impl Iterator<Item = Cell> + use<> {
        let [in_row, rows, _] = self.count;
        let place = [block % in_row, block / in_row % rows, block / in_row / rows];
        let size = self.extent.size();
        let [x, y, z] = [0, 1, 2].map(|axis: usize| {
            let from = (place[axis] * self.side).min(size[axis]);
            from as i32..(from + self.side).min(size[axis]) as i32
        });
        z.flat_map(move |z| {
            let x = x.clone();
            y.clone().flat_map(move |y| x.clone().map(move |x| Cell { x, y, z }))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_cell_is_in_its_block_and_in_no_other() {
        let extent = Extent::new([5, 3, 4], 0.5).unwrap();
        let blocks = Blocks::new(extent, 2);
        assert_eq!(blocks.count(), 3 * 2 * 2);
        let mut seen = 0;
        for block in 0..blocks.count() {
            let indices: Vec<usize> = blocks.cells(block).map(|cell| extent.index(cell).unwrap()).collect();
            assert!(indices.is_sorted() && indices.len() <= 8);
            assert!(indices.iter().all(|&index| blocks.of(index) == block), "{block}");
            seen += indices.len();
        }
        assert_eq!(seen, extent.volume());
    }
}
