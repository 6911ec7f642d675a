//! The cells of a block as the bits of a word, so that whole layers of them are computed at once.
//!
//! The *place* of a cell in its block counts x first, then y, then z; bit n stands for place n.

use voxels::{Cell, FACES};

/// Edge of a block, cells.
pub const BLOCK_CELLS: i32 = 5;

/// Number of cells of a block.
pub(super) const CELLS: usize = (BLOCK_CELLS * BLOCK_CELLS * BLOCK_CELLS) as usize;

/// A set of cells of a block, one bit each.
pub(super) type Cells = u128;

const SIDE: usize = BLOCK_CELLS as usize;

/// For each axis by how much one step along it changes the place.
const STRIDES: [u32; 3] = [1, BLOCK_CELLS as u32, (BLOCK_CELLS * BLOCK_CELLS) as u32];

/// For each axis and coordinate the cells with this coordinate.
const LAYERS: [[Cells; SIDE]; 3] = layers();

const fn layers() -> [[Cells; SIDE]; 3] {
    let mut layers = [[0; SIDE]; 3];
    let mut place = 0;
    while place < CELLS {
        layers[0][place % SIDE] |= 1 << place;
        layers[1][place / SIDE % SIDE] |= 1 << place;
        layers[2][place / SIDE / SIDE] |= 1 << place;
        place += 1;
    }
    layers
}

/// The place of a cell, relative to the corner of its block.
pub(super) fn place_of(offset: Cell) -> usize {
    ((offset.z * BLOCK_CELLS + offset.y) * BLOCK_CELLS + offset.x) as usize
}

/// The cell at a place, relative to the corner of its block.
pub(super) fn offset(place: usize) -> Cell {
    OFFSETS[place]
}

/// By place the cell, relative to the corner of its block.
const OFFSETS: [Cell; CELLS] = offsets();

const fn offsets() -> [Cell; CELLS] {
    let mut offsets = [Cell { x: 0, y: 0, z: 0 }; CELLS];
    let mut place = 0;
    while place < CELLS as i32 {
        let (x, y, z) = (place % BLOCK_CELLS, place / BLOCK_CELLS % BLOCK_CELLS, place / BLOCK_CELLS / BLOCK_CELLS);
        offsets[place as usize] = Cell { x, y, z };
        place += 1;
    }
    offsets
}

/// The places of the cells of a set, ascending.
pub(super) fn places(mut left: Cells) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let place = (left != 0).then(|| left.trailing_zeros() as usize);
        left &= left.wrapping_sub(1);
        place
    })
}

/// The cells that are connected with some of a set through faces of cells of this set.
pub(super) fn connected(from: Cells, within: Cells) -> Cells {
    let mut reached = from;
    loop {
        let before = reached;
        for axis in 0..3 {
            let [low, .., high] = LAYERS[axis];
            reached |= (reached & !high) << STRIDES[axis] & within;
            reached |= (reached & !low) >> STRIDES[axis] & within;
        }
        if reached == before {
            return reached;
        }
    }
}

/// The cell of a set, which is not empty, that is nearest to the mean of all; of equally near ones
/// the first.
pub(super) fn middle(members: Cells) -> Cell {
    let count = members.count_ones() as i32;
    let sum = |axis: usize| -> i32 {
        (0..).zip(LAYERS[axis]).map(|(at, layer): (i32, _)| at * (members & layer).count_ones() as i32).sum()
    };
    let sums = [sum(0), sum(1), sum(2)];
    let apart = |cell: &Cell| {
        let [x, y, z] = [cell.x * count - sums[0], cell.y * count - sums[1], cell.z * count - sums[2]];
        x * x + y * y + z * z
    };
    places(members).map(offset).min_by_key(apart).unwrap_or_default()
}

/// One of the faces between two blocks.
#[derive(Debug, Clone, Copy)]
pub(super) struct Side {
    axis: usize,
    is_upper: bool,
}

impl Side {
    /// All sides of a block, in the order of [`FACES`].
    pub(super) fn all() -> [Self; 6] {
        FACES.map(|face| {
            let axis = [face.x, face.y, face.z].iter().position(|&by| by != 0).unwrap_or_default();
            Self { axis, is_upper: face.x + face.y + face.z > 0 }
        })
    }

    /// The cells of a set at this side that have a cell of another set beside them, in the block
    /// beyond.
    pub(super) fn facing(self, here: Cells, beyond: Cells) -> Cells {
        let [low, .., high] = LAYERS[self.axis];
        let across = self.across();
        if self.is_upper { here & high & beyond << across } else { here & low & beyond >> across }
    }

    /// The place, in the block beyond, of the cell beside a place at this side.
    pub(super) fn beside(self, place: usize) -> usize {
        let across = self.across() as usize;
        if self.is_upper { place - across } else { place + across }
    }

    /// The difference of places from side to side.
    fn across(self) -> u32 {
        (BLOCK_CELLS - 1).cast_unsigned() * STRIDES[self.axis]
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use proptest::prelude::*;

    use super::*;

    fn cells() -> impl Strategy<Value = Cells> {
        prop::collection::vec(prop::bool::weighted(0.6), CELLS).prop_map(|bits| {
            bits.into_iter().enumerate().fold(0, |cells, (place, bit)| cells | Cells::from(bit) << place)
        })
    }

    fn is_inside(cell: Cell) -> bool {
        [cell.x, cell.y, cell.z].iter().all(|at| (0..BLOCK_CELLS).contains(at))
    }

    proptest! {
        #[test]
        fn connected_cells_are_those_of_a_search_cell_by_cell(cells in cells(), first in 0..CELLS) {
            prop_assume!(cells >> first & 1 != 0);
            let (mut seen, mut stack) = (BTreeSet::from([first]), vec![first]);
            while let Some(place) = stack.pop() {
                for next in FACES.map(|face| offset(place) + face).into_iter().filter(|&next| is_inside(next)) {
                    let next = place_of(next);
                    if cells >> next & 1 != 0 && seen.insert(next) {
                        stack.push(next);
                    }
                }
            }
            prop_assert!(places(connected(1 << first, cells)).eq(seen));
        }

        #[test]
        fn middle_is_the_first_cell_nearest_to_the_mean(cells in cells()) {
            prop_assume!(cells != 0);
            let all: Vec<Cell> = places(cells).map(offset).collect();
            prop_assert!(all.is_sorted());
            let sum = all.iter().fold(Cell::default(), |sum, &cell| sum + cell);
            let scaled = |cell: &Cell| {
                let count = all.len() as i32;
                Cell::new(cell.x * count, cell.y * count, cell.z * count).distance_squared(sum)
            };
            prop_assert_eq!(Some(middle(cells)), all.iter().copied().min_by_key(scaled));
        }

        #[test]
        fn facing_cells_share_a_face(here in cells(), beyond in cells()) {
            for (face, side) in FACES.into_iter().zip(Side::all()) {
                let mut expected = Vec::new();
                for place in places(here).filter(|&place| !is_inside(offset(place) + face)) {
                    let beside = offset(place) + face;
                    let beside = place_of(Cell::new(
                        beside.x.rem_euclid(BLOCK_CELLS),
                        beside.y.rem_euclid(BLOCK_CELLS),
                        beside.z.rem_euclid(BLOCK_CELLS),
                    ));
                    if beyond >> beside & 1 != 0 {
                        expected.push((place, beside));
                    }
                }
                let facing = places(side.facing(here, beyond));
                prop_assert!(facing.map(|place| (place, side.beside(place))).eq(expected));
            }
        }
    }
}
