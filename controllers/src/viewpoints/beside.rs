//! The cells near frontiers from which an unexplored cell is in sight, kept up to date with the
//! map.
//!
//! A cell depends on the map within a few cells of it. So after an update only the blocks near what
//! has changed are looked at, and there the cells near frontiers alone: those blocks that a search
//! comes to, or all once it matters that there is no such cell.

use voxels::{Cell, CellSet, Extent};

use agent::exploration_map::ExplorationMap;

/// Edge of the blocks that are looked at anew, cells.
const SIDE: i32 = 8;

/// Changes from which on all frontiers are looked at instead.
const CHANGES_MAX: usize = 1 << 15;

/// Such cells of one map.
#[derive(Debug)]
pub(super) struct BesideFrontiers {
    /// Those in blocks that need not be looked at.
    cells: CellSet,
    /// Blocks along each axis.
    size: [i32; 3],
    /// Cells within this distance of a frontier along each axis are near it.
    reach: i32,
    /// Position in the journal of the map up to which changes have been read.
    read: Option<usize>,
    /// Blocks to look at.
    changed: CellSet,
    /// Cells examined so far.
    examined: usize,
}

impl BesideFrontiers {
    pub(super) fn new(extent: Extent, reach: i32) -> Self {
        let size = extent.size().map(|cells| cells.div_ceil(SIDE.cast_unsigned()).cast_signed());
        let blocks = size.iter().map(|&blocks| blocks as usize).product();
        let (cells, changed) = (CellSet::new(extent.volume()), CellSet::new(blocks));
        Self { cells, size, reach, read: None, changed, examined: 0 }
    }

    /// Notes the changes of the map since the last update.
    pub(super) fn update(&mut self, map: &ExplorationMap) {
        let read = self.read.replace(map.journal_len());
        let extent = map.extent();
        match read.filter(|&read| map.journal_len() - read <= CHANGES_MAX) {
            Some(read) => map.boxes_revealed_since(read).for_each(|(low, high)| self.note(extent, low, high)),
            None => {
                self.cells.clear();
                for cell in map.frontiers().map(|index| extent.cell_at(index as usize)) {
                    self.note(extent, cell, cell);
                }
            }
        }
    }

    /// Looks at all blocks that have changed. `is_one` examines a cell near a frontier; it may
    /// depend on the cells within one more than the reach.
    pub(super) fn settle(&mut self, map: &ExplorationMap, is_one: impl Fn(Cell) -> bool) {
        let changed: Vec<usize> = self.changed.iter().collect();
        self.changed.clear();
        for block in changed {
            self.examine(map, block as i32, &is_one);
        }
    }

    /// The cells known so far: all after [`BesideFrontiers::settle`].
    pub(super) fn cells(&self) -> &CellSet {
        &self.cells
    }

    /// Whether a cell of the map is one of them, in a block that is looked at if it has changed.
    pub(super) fn holds(&mut self, map: &ExplorationMap, cell: Cell, is_one: impl Fn(Cell) -> bool) -> bool {
        let block = self.number_of([cell.x, cell.y, cell.z].map(|along| along / SIDE));
        if self.changed.contains(block) {
            self.changed.remove(block);
            self.examine(map, block as i32, &is_one);
        }
        map.extent().index(cell).is_some_and(|index| self.cells.contains(index))
    }

    /// Number of cells examined so far: a measure of the work.
    #[cfg(test)]
    pub(super) fn examined(&self) -> usize {
        self.examined
    }

    fn number_of(&self, [x, y, z]: [i32; 3]) -> usize {
        ((z * self.size[1] + y) * self.size[0] + x) as usize
    }

    /// Notes the blocks with cells that may depend on a box; what is known of them is over.
    fn note(&mut self, extent: Extent, low: Cell, high: Cell) {
        let near = |low: i32, high: i32, blocks: i32| {
            let low = (low - self.reach - 1).max(0) / SIDE;
            let high = ((high + self.reach + 1) / SIDE).min(blocks - 1);
            low..=high
        };
        let [along_x, along_y, along_z] =
            [near(low.x, high.x, self.size[0]), near(low.y, high.y, self.size[1]), near(low.z, high.z, self.size[2])];
        for (z, y) in along_z.flat_map(|z| along_y.clone().map(move |y| (z, y))) {
            for x in along_x.clone() {
                let block = self.number_of([x, y, z]);
                if !self.changed.contains(block) {
                    self.changed.insert(block);
                    self.forget(extent, Cell::new(x, y, z));
                }
            }
        }
    }

    /// Removes the cells of the block at these coordinates.
    fn forget(&mut self, extent: Extent, at: Cell) {
        let [size_x, size_y, size_z] = extent.size().map(u32::cast_signed);
        let along = |at: i32, size: i32| SIDE * at..(SIDE * (at + 1)).min(size);
        let along_x = along(at.x, size_x);
        for (z, y) in along(at.z, size_z).flat_map(|z| along(at.y, size_y).map(move |y| (z, y))) {
            let row = (z * size_y + y) * size_x;
            let mut left = self.cells.run((row + along_x.start) as usize, along_x.len() as u32);
            while left != 0 {
                self.cells.remove((row + along_x.start) as usize + left.trailing_zeros() as usize);
                left &= left - 1;
            }
        }
    }

    fn examine(&mut self, map: &ExplorationMap, block: i32, is_one: &impl Fn(Cell) -> bool) {
        let [size_x, size_y, _] = self.size;
        let corner = Cell::new(block % size_x * SIDE, block / size_x % size_y * SIDE, block / size_x / size_y * SIDE);
        let by = |by: i32| Cell::new(by, by, by);
        // By z and y the cells along x that are near a frontier.
        let mut near = [[0_u8; SIDE as usize]; SIDE as usize];
        for frontier in map.frontiers_near(corner + by(SIDE / 2), SIDE / 2 + self.reach) {
            let at = frontier - corner;
            let range = |at: i32| (at - self.reach).max(0)..(at + self.reach + 1).min(SIDE);
            let along_x = range(at.x).fold(0, |bits, x| bits | 1 << x);
            for z in range(at.z) {
                for y in range(at.y) {
                    near[z as usize][y as usize] |= along_x;
                }
            }
        }
        let cells = (0..SIDE).flat_map(|z| (0..SIDE).flat_map(move |y| (0..SIDE).map(move |x| Cell::new(x, y, z))));
        for offset in cells {
            let Some(index) = map.extent().index(corner + offset) else { continue };
            let is_near = near[offset.z as usize][offset.y as usize] >> offset.x & 1 != 0;
            self.examined += usize::from(is_near);
            if is_near && is_one(corner + offset) {
                self.cells.insert(index);
            } else {
                self.cells.remove(index);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Whether a cell is free and has as many walls around as its coordinates say, an arbitrary
    /// function of the map nearby.
    fn is_one(map: &ExplorationMap, cell: Cell) -> bool {
        let around = map.around(cell);
        map.state(cell).is_free() && (i32::from(around.walls) + cell.x + cell.y) % 3 != 0
    }

    #[test]
    fn an_update_examines_what_is_near_the_change() {
        let extent = Extent::new([200, 20, 20], 1.0).unwrap();
        let mut map = ExplorationMap::new(extent);
        let cell = |x: i32| extent.index(Cell::new(x, 10, 10)).unwrap() as u32;
        map.note_free(&(0..200).map(cell).collect::<Vec<u32>>());
        let mut beside = BesideFrontiers::new(extent, 2);
        let settle = |beside: &mut BesideFrontiers, map: &ExplorationMap| {
            beside.update(map);
            beside.settle(map, |cell| is_one(map, cell));
        };
        settle(&mut beside, &map);
        let all = beside.examined();
        assert_eq!(all, 200 * 5 * 5);
        map.note_free(&[extent.index(Cell::new(100, 11, 10)).unwrap() as u32]);
        settle(&mut beside, &map);
        assert!(beside.examined() - all < 30 * 6 * 6, "{}", beside.examined() - all);
        let examined = beside.examined();
        settle(&mut beside, &map);
        assert_eq!(beside.examined(), examined, "nothing has changed");
    }

    proptest! {
        #[test]
        fn updates_have_the_cells_of_a_search(
            cells in prop::collection::vec(0..5, 19 * 10 * 9), cuts in prop::collection::vec(0usize..200, 8..16),
            reach in 1..4_i32,
        ) {
            let extent = Extent::new([19, 10, 9], 1.0).unwrap();
            let mut map = ExplorationMap::new(extent);
            let mut beside = BesideFrontiers::new(extent, reach);
            let mut done = 0;
            for cut in cuts {
                let next = (done + cut).min(cells.len());
                for (at, kind) in (0..).zip(&cells).take(next).skip(done) {
                    match kind {
                        0 => map.note_wall(&[at]),
                        1 => {}
                        _ => map.note_free(&[at]),
                    }
                }
                done = next;
                beside.update(&map);
                if done % 3 == 0 {
                    beside.settle(&map, |cell| is_one(&map, cell));
                }
                // Some of the blocks are looked at after a later change.
                for cell in extent.cells().filter(|cell| cell.x % 16 < 8 || done % 2 == 0) {
                    let is_near = map.frontiers_near(cell, reach).next().is_some();
                    let is_held = beside.holds(&map, cell, |cell| is_one(&map, cell));
                    prop_assert_eq!(is_held, is_near && is_one(&map, cell), "{:?}", cell);
                }
            }
        }
    }
}
