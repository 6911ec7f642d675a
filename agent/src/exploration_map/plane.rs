//! A set of cells by index, a bit for each, of which runs of cells along x are read at once.
//!
//! All bits are 0 at first, which takes no memory where the system provides it page by page.

/// Bytes beyond the last cell, so that a run is read in one piece.
const SPARE_BYTES: usize = 8;

/// The longest run that is read in one piece, cells.
const PIECE: usize = 56;

/// Cells by index.
#[derive(Debug, Clone)]
pub(super) struct Plane(Vec<u8>);

impl Plane {
    /// None of so many cells.
    pub(super) fn new(cells: usize) -> Self {
        Self(vec![0; cells.div_ceil(8) + SPARE_BYTES])
    }

    /// Whether a cell is in it.
    #[inline]
    pub(super) fn contains(&self, index: usize) -> bool {
        self.0[index / 8] >> (index % 8) & 1 != 0
    }

    /// Adds a cell.
    #[inline]
    pub(super) fn insert(&mut self, index: usize) {
        self.0[index / 8] |= 1 << (index % 8);
    }

    /// Removes a cell.
    #[inline]
    pub(super) fn remove(&mut self, index: usize) {
        self.0[index / 8] &= !(1 << (index % 8));
    }

    /// Adds those of four cells from an index on whose bits are set.
    #[inline]
    pub(super) fn insert_four(&mut self, start: usize, bits: u8) {
        let [low, high] = (u16::from(bits) << (start % 8)).to_le_bytes();
        self.0[start / 8] |= low;
        if high != 0 {
            self.0[start / 8 + 1] |= high;
        }
    }

    /// The cells of a run that are in it, as bits, the first one lowest; `count` is at most 64.
    #[inline]
    pub(super) fn run(&self, start: usize, count: usize) -> u64 {
        if count <= PIECE {
            return self.piece(start, count);
        }
        self.piece(start, PIECE) | self.piece(start + PIECE, count - PIECE) << PIECE
    }

    /// Of a run of at most [`PIECE`] cells.
    #[inline]
    pub(super) fn piece(&self, start: usize, count: usize) -> u64 {
        let eight = self.0[start / 8..].first_chunk().copied().unwrap_or_default();
        u64::from_le_bytes(eight) >> (start % 8) & ((1 << count) - 1)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn runs_hold_the_cells(
            changes in prop::collection::vec((0_usize..300, any::<bool>()), 0..300),
            fours in prop::collection::vec((0_usize..297, 0_u8..16), 0..9),
        ) {
            let (mut plane, mut model) = (Plane::new(300), BTreeSet::new());
            for (cell, is_added) in changes {
                if is_added {
                    plane.insert(cell);
                    model.insert(cell);
                } else {
                    plane.remove(cell);
                    model.remove(&cell);
                }
            }
            for (start, bits) in fours {
                plane.insert_four(start, bits);
                model.extend((0..4).filter(|by| bits >> by & 1 != 0).map(|by| start + by));
            }
            for start in 0..300 {
                prop_assert_eq!(plane.contains(start), model.contains(&start));
                for count in [0, 1, 7, 56, 57, 64].into_iter().filter(|count| start + count <= 300) {
                    let bits = (0..count).fold(0, |bits, by| bits | u64::from(model.contains(&(start + by))) << by);
                    prop_assert_eq!(plane.run(start, count), bits);
                }
            }
        }
    }
}
