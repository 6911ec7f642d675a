//! What a map knows of the cells of a cube, row by row instead of cell by cell.

use voxels::Cell;

use super::ExplorationMap;

impl ExplorationMap {
    /// The cells known to be free in a cube of at most 5 cells along each axis whose lowest cell is
    /// inside the map: one bit each, x first.
    pub fn free_in(&self, corner: Cell, side: i32) -> u128 {
        self.in_rows(corner, side, |start, count| self.free_cells.run(start, count))
    }

    /// The cells known to be free in a row of at most 64 cells along x, one bit each; those outside
    /// the map are not.
    #[inline]
    pub fn free_row(&self, first: Cell, count: u32) -> u64 {
        self.row(first, count, |start, count| self.free_cells.run(start, count))
    }

    /// The rows of a cube of at most 56 cells along each axis, as [`Self::free_row`] has them;
    /// `take` gets the coordinates y and z of each relative to the lowest cell.
    #[inline]
    pub(crate) fn each_free_row(&self, lowest: Cell, side: u32, mut take: impl FnMut([usize; 2], u64)) {
        let [size_x, size_y, size_z] = self.extent().size().map(u32::cast_signed);
        let is_inside = |low: i32, size: i32| low >= 0 && low + side.cast_signed() <= size;
        let side_cells = side as usize;
        let rows = (0..side_cells).flat_map(|z| (0..side_cells).map(move |y| [y, z]));
        if is_inside(lowest.x, size_x) && is_inside(lowest.y, size_y) && is_inside(lowest.z, size_z) {
            let start = ((lowest.z * size_y + lowest.y) * size_x + lowest.x) as usize;
            let [along_y, along_z] = [size_x as usize, (size_x * size_y) as usize];
            rows.for_each(|[y, z]| take([y, z], self.free_cells.piece(start + y * along_y + z * along_z, side_cells)));
        } else {
            rows.for_each(|[y, z]| take([y, z], self.free_row(lowest + Cell::new(0, y as i32, z as i32), side)));
        }
    }

    /// Those of such a row that are known to be free and have not been visited.
    #[inline]
    pub fn unvisited_row(&self, first: Cell, count: u32) -> u64 {
        self.row(first, count, |start, count| self.free_cells.run(start, count) & !self.covered_cells.run(start, count))
    }

    /// The bits of the part of a row inside the map; `run` gets its first cell and their number.
    #[inline]
    fn row(&self, first: Cell, count: u32, run: impl Fn(usize, usize) -> u64) -> u64 {
        let [size_x, size_y, size_z] = self.extent().size().map(u32::cast_signed);
        if !(0..size_y).contains(&first.y) || !(0..size_z).contains(&first.z) {
            return 0;
        }
        let (low, high) = (first.x.max(0), (first.x + count.cast_signed()).min(size_x));
        if low >= high {
            return 0;
        }
        let start = (first.z * size_y + first.y) * size_x + low;
        run(start as usize, (high - low) as usize) << (low - first.x)
    }

    /// The frontiers in such a cube.
    pub fn frontiers_in(&self, corner: Cell, side: i32) -> u128 {
        self.in_rows(corner, side, |start, count| self.frontier.run(start, count as u32))
    }

    /// Puts the bits of the rows of a cube together; `row` gets the first cell of a row and the
    /// number of its cells that are inside the map.
    fn in_rows(&self, corner: Cell, side: i32, row: impl Fn(usize, usize) -> u64) -> u128 {
        let [size_x, size_y, size_z] = self.extent().size().map(u32::cast_signed);
        let count = side.min(size_x - corner.x) as usize;
        let mut bits = 0;
        for z in 0..side.min(size_z - corner.z) {
            for y in 0..side.min(size_y - corner.y) {
                let start = ((corner.z + z) * size_y + corner.y + y) * size_x + corner.x;
                bits |= u128::from(row(start as usize, count)) << ((z * side + y) * side);
            }
        }
        bits
    }

    /// The frontiers within so many cells of a cell along each axis, by ascending index.
    pub fn frontiers_near(&self, cell: Cell, reach: i32) -> impl Iterator<Item = Cell> + '_ {
        let extent = self.extent();
        let [size_x, size_y, size_z] = extent.size().map(u32::cast_signed);
        let near = |at: i32, size: i32| {
            at.saturating_sub(reach).clamp(0, size)..at.saturating_add(reach).saturating_add(1).clamp(0, size)
        };
        let [along_x, along_y, along_z] = [near(cell.x, size_x), near(cell.y, size_y), near(cell.z, size_z)];
        let rows = along_z.flat_map(move |z| along_y.clone().map(move |y| (z * size_y + y) * size_x));
        let frontiers = rows
            .flat_map(move |row| self.frontier.iter_in((row + along_x.start) as usize..(row + along_x.end) as usize));
        frontiers.map(move |index| extent.cell_at(index))
    }
}
