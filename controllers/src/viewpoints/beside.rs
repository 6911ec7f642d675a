//! The cells near frontiers from which an unexplored cell is in sight, kept up to date with the
//! map.
//!
//! A cell depends on the map within a few cells of it. So an update looks at the blocks near what
//! has changed, and there at the cells near frontiers alone.

use voxels::{Cell, CellSet, Extent};

use agent::exploration_map::ExplorationMap;

/// Edge of the blocks that are looked at anew, cells.
const SIDE: i32 = 8;

/// Changes from which on all frontiers are looked at instead.
const CHANGES_MAX: usize = 1 << 15;

/// Such cells of one map.
#[derive(Debug)]
pub(super) struct BesideFrontiers {
    cells: CellSet,
    /// Blocks along each axis.
    size: [i32; 3],
    /// Cells within this distance of a frontier along each axis are near it.
    reach: i32,
    /// Position in the journal of the map up to which changes have been read.
    read: Option<usize>,
    /// Blocks to look at; empty between updates.
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

    /// Applies the changes of the map since the last update. `is_one` examines a cell near a
    /// frontier; it may depend on the cells within one more than the reach.
    pub(super) fn update(&mut self, map: &ExplorationMap, is_one: impl Fn(Cell) -> bool) {
        let read = self.read.replace(map.journal_len());
        match read.filter(|&read| map.journal_len() - read <= CHANGES_MAX) {
            Some(read) => map.boxes_changed_since(read).for_each(|(low, high)| self.note(low, high)),
            None => {
                self.cells.clear();
                for cell in map.frontiers().map(|index| map.extent().cell_at(index as usize)) {
                    self.note(cell, cell);
                }
            }
        }
        let changed: Vec<usize> = self.changed.iter().collect();
        self.changed.clear();
        for block in changed {
            self.examine(map, block as i32, &is_one);
        }
    }

    /// The cells, ascending.
    pub(super) fn iter(&self) -> impl Iterator<Item = usize> + '_ {
        self.cells.iter()
    }

    pub(super) fn holds(&self, index: usize) -> bool {
        self.cells.contains(index)
    }

    /// Number of cells examined so far: a measure of the work.
    #[cfg(test)]
    pub(super) fn examined(&self) -> usize {
        self.examined
    }

    /// Notes the blocks with cells that may depend on a box of cells.
    fn note(&mut self, low: Cell, high: Cell) {
        let near = |low: i32, high: i32, blocks: i32| {
            let low = (low - self.reach - 1).max(0) / SIDE;
            let high = ((high + self.reach + 1) / SIDE).min(blocks - 1);
            low..=high
        };
        let [along_x, along_y, along_z] =
            [near(low.x, high.x, self.size[0]), near(low.y, high.y, self.size[1]), near(low.z, high.z, self.size[2])];
        for (z, y) in along_z.flat_map(|z| along_y.clone().map(move |y| (z, y))) {
            for x in along_x.clone() {
                self.changed.insert(((z * self.size[1] + y) * self.size[0] + x) as usize);
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
        beside.update(&map, |cell| is_one(&map, cell));
        let all = beside.examined();
        assert_eq!(all, 200 * 5 * 5);
        map.note_free(&[extent.index(Cell::new(100, 11, 10)).unwrap() as u32]);
        beside.update(&map, |cell| is_one(&map, cell));
        assert!(beside.examined() - all < 30 * 6 * 6, "{}", beside.examined() - all);
        let examined = beside.examined();
        beside.update(&map, |cell| is_one(&map, cell));
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
                beside.update(&map, |cell| is_one(&map, cell));
                for cell in extent.cells() {
                    let is_near = map.frontiers_near(cell, reach).next().is_some();
                    let is_held = beside.holds(extent.index(cell).unwrap());
                    prop_assert_eq!(is_held, is_near && is_one(&map, cell), "{:?}", cell);
                }
            }
        }
    }
}
