//! How far around each cell all cells are free, for segments through open space.
//!
//! A segment whose points all have free cells around them meets no wall. That is seen without a
//! walk from cell to cell ([`crate::traverse`]): from a point in a cell with free cells around it,
//! the segment is followed to the border of this cube at once, as in the sphere tracing of distance
//! fields (Hart, 1996).
//!
//! Invariant: all cells within the reach of a cell, along each axis, are free and inside the map.
//! This module follows no changes of the terrain, and says nothing about segments close to walls.

use crate::extent::floor;
use crate::sight::MARGIN_CELLS;
use crate::{Cell, Extent, Grid, Terrain};

/// The reaches that are distinguished, cells.
const REACHES: [i32; 3] = [4, 2, 1];

/// By how much less than its reach the free space around a cell is used as slack at most, cells:
/// the rest is the least step along a segment.
const STEP_CELLS_MIN: f64 = 0.5;

/// The cells with free cells around them.
#[derive(Clone, Debug, PartialEq)]
pub struct OpenSpace {
    extent: Extent,
    /// Words of a row of cells along x.
    row_words: usize,
    /// For each reach one bit for each cell; 64 cells of a row in a word.
    words: Vec<[u64; REACHES.len()]>,
}

impl OpenSpace {
    /// The open space of a terrain.
    #[must_use]
    pub fn of(terrain: &Grid<Terrain>) -> Self {
        let extent = terrain.extent();
        let size = extent.size().map(|cells| cells as usize);
        let row_words = size[0].div_ceil(64);
        let mut free = vec![0; row_words * size[1] * size[2]];
        for (words, row) in free.chunks_exact_mut(row_words).zip(terrain.as_slice().chunks_exact(size[0])) {
            for (word, cells) in words.iter_mut().zip(row.chunks(64)) {
                let bits = (0..).zip(cells).map(|(bit, &cell)| u64::from(cell == Terrain::Free) << bit);
                *word = bits.fold(0, |word, bit| word | bit);
            }
        }
        let shape = [row_words, size[1], size[2]];
        let one = eroded(&free, shape);
        let two = eroded(&one, shape);
        let four = eroded(&eroded(&two, shape), shape);
        let words = four.into_iter().zip(two).zip(one).map(|((four, two), one)| [four, two, one]);
        Self { extent, row_words, words: words.collect() }
    }

    /// A distance in cells within which all cells around this one are free, along each axis; 0 if
    /// there is none.
    #[must_use]
    pub fn reach(&self, cell: Cell) -> i32 {
        if !self.extent.contains(cell) {
            return 0;
        }
        let [x, y, z] = [cell.x, cell.y, cell.z].map(|at| at as usize);
        let row = z * self.extent.size()[1] as usize + y;
        let words = &self.words[row * self.row_words + x / 64];
        let is_set = |word: &u64| word >> (x % 64) & 1 != 0;
        words.iter().position(is_set).map_or(0, |reach| REACHES[reach])
    }

    /// How far both ends of a segment can move so that all cells within this distance of it stay
    /// free, cells, up to `most`; nothing if it comes close to a wall. `from` and `to` are in
    /// cells, finite, and not far outside the map.
    pub(crate) fn slack_cells(&self, from: [f64; 3], to: [f64; 3], most: f64) -> Option<f64> {
        let along = [to[0] - from[0], to[1] - from[1], to[2] - from[2]];
        let mut slack = most;
        let mut entry = 0.0;
        loop {
            let cell = [0, 1, 2].map(|axis| floor(from[axis] + along[axis] * entry));
            let reach = match self.reach(Cell::new(cell[0], cell[1], cell[2])) {
                0 => return None,
                reach => f64::from(reach),
            };
            slack = slack.min(reach - STEP_CELLS_MIN);
            let inside = reach - slack - MARGIN_CELLS;
            let mut exit = f64::INFINITY;
            for axis in 0..3 {
                let low = f64::from(cell[axis]);
                let border = if along[axis] > 0.0 { low + 1.0 + inside } else { low - inside };
                if along[axis] != 0.0 {
                    exit = exit.min((border - from[axis]) / along[axis]);
                }
            }
            if exit >= 1.0 {
                return Some(slack);
            }
            entry = exit;
        }
    }
}

/// The cells of a set with all neighbours in it, across corners as well. `shape`: words of a row,
/// rows, layers.
fn eroded(set: &[u64], [row_words, rows, layers]: [usize; 3]) -> Vec<u64> {
    let mut along_x = vec![0; set.len()];
    for (eroded, row) in along_x.chunks_exact_mut(row_words).zip(set.chunks_exact(row_words)) {
        for (word, eroded) in eroded.iter_mut().enumerate() {
            let before = word.checked_sub(1).map_or(0, |before| row[before] >> 63);
            let after = row.get(word + 1).map_or(0, |after| after << 63);
            *eroded = row[word] & (row[word] << 1 | before) & (row[word] >> 1 | after);
        }
    }
    let along_y = with_neighbours(&along_x, row_words, rows);
    with_neighbours(&along_y, row_words * rows, layers)
}

/// Intersects each slice of `words` words with the ones before and after it, of groups of `slices`;
/// beyond a group there is nothing.
fn with_neighbours(set: &[u64], words: usize, slices: usize) -> Vec<u64> {
    let group = words * slices;
    let mut found = vec![0; set.len()];
    for (found, set) in found.chunks_exact_mut(group).zip(set.chunks_exact(group)) {
        for place in words..group.saturating_sub(words) {
            found[place] = set[place - words] & set[place] & set[place + words];
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn reach_is_that_of_a_search(
            size in (1_u32..70, 1_u32..14, 1_u32..14).prop_map(|(x, y, z)| [x, y, z]),
            walls in prop::collection::vec(any::<prop::sample::Index>(), 0..6),
        ) {
            let extent = Extent::new(size, 1.0).unwrap();
            let mut terrain = Grid::new(extent, Terrain::Free);
            for wall in walls {
                let index = wall.index(terrain.as_slice().len());
                terrain.as_mut_slice()[index] = Terrain::Wall;
            }
            let open_space = OpenSpace::of(&terrain);
            for cell in extent.cells() {
                let is_free = |reach: i32| {
                    let axis = -reach..=reach;
                    let around = axis.clone().flat_map(|z| {
                        let axis = axis.clone();
                        axis.clone().flat_map(move |y| axis.clone().map(move |x| Cell::new(x, y, z)))
                    });
                    around.into_iter().all(|by| terrain.get(cell + by) == Some(&Terrain::Free))
                };
                let expected = REACHES.into_iter().find(|&reach| is_free(reach)).unwrap_or(0);
                prop_assert_eq!(open_space.reach(cell), expected, "{:?}", cell);
            }
            prop_assert_eq!(open_space.reach(Cell::new(-1, 0, 0)), 0);
        }
    }
}
