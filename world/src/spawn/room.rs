//! The cells of a map that still have room for a body.
//!
//! [`PlacedBodies::has_room`] decides for one cell. A map has up to 2^30 of them, so those without
//! room are ruled out in bulk before: blocks of cells of which all are too near to one body that is
//! placed, and, for a body that is wider than a cell, cells with a wall in the cube inside the body
//! or on its axes, found for 64 cells at once.
//!
//! Invariant: the list is that of all cells with room, in the order of their indices; what is ruled
//! out in bulk never has room.

use voxels::{BodyLattice, Cell, Grid, Terrain};

use super::placed_bodies::PlacedBodies;

/// Edge of a block of cells.
const BLOCK_CELLS: usize = 4;

/// Longest distance in cells that is compared in bulk; walls farther away are left to the check of
/// single cells.
const REACH_CELLS_MAX: usize = 8;

/// Share of a length by which it is taken as shorter, against rounding.
const SLACK: f64 = 1e-9;

/// The indices of the cells in which a body has room, ascending.
pub(super) fn cells_with_room(terrain: &Grid<Terrain>, placed: &PlacedBodies<'_>, radius_m: f64) -> Vec<u32> {
    let extent = terrain.extent();
    let [size_x, size_y, _] = extent.size().map(|cells| cells as usize);
    let blocks = Blocks::without(terrain, placed, radius_m);
    let radius_cells = radius_m / extent.cell_m() * (1.0 - SLACK);
    let lattice = BodyLattice::of(radius_m, extent.cell_m());
    let clear = (radius_cells > 0.5).then(|| Bits::clear_around(terrain, radius_cells, lattice));
    let mut cells = Vec::new();
    for (number, row) in terrain.as_slice().chunks_exact(size_x).enumerate() {
        let (y, z) = (number % size_y, number / size_y);
        for (block, is_open) in blocks.row(y, z).iter().enumerate() {
            if !is_open {
                continue;
            }
            for (x, &here) in row.iter().enumerate().skip(block * BLOCK_CELLS).take(BLOCK_CELLS) {
                let may_have_room = here == Terrain::Free && clear.as_ref().is_none_or(|clear| clear.has(x, number));
                if may_have_room && placed.has_room(Cell::new(x as i32, y as i32, z as i32), radius_m) {
                    cells.push((number * size_x + x) as u32);
                }
            }
        }
    }
    cells
}

/// Blocks of cells, x first, with whether a cell of theirs may be far enough from all bodies.
struct Blocks {
    size: [usize; 3],
    is_open: Vec<bool>,
}

impl Blocks {
    /// All blocks but those of which every cell is too near to one of the bodies.
    fn without(terrain: &Grid<Terrain>, placed: &PlacedBodies<'_>, radius_m: f64) -> Self {
        let cell_m = terrain.extent().cell_m();
        let size = terrain.extent().size().map(|cells| (cells as usize).div_ceil(BLOCK_CELLS));
        let mut blocks = Self { size, is_open: vec![true; size.iter().product()] };
        let edge_m = BLOCK_CELLS as f64 * cell_m;
        let offset_m = BodyLattice::of(radius_m, cell_m).offset_cells() * cell_m;
        for (centre, apart_m) in placed.apart_from(radius_m) {
            let apart_m = apart_m * (1.0 - SLACK);
            let centre = [centre.x, centre.y, centre.z];
            let near = |axis: usize| {
                let block = |at_m: f64| (at_m / edge_m).clamp(0.0, size[axis] as f64 - 1.0) as usize;
                block(centre[axis] - apart_m)..=block(centre[axis] + apart_m)
            };
            // The square of the largest distance of the place of a cell along an axis.
            let farthest = |axis: usize, block: usize| {
                let low_m = block as f64 * edge_m - centre[axis];
                let [low_m, high_m] = [low_m + offset_m, low_m + edge_m - cell_m + offset_m];
                low_m.abs().max(high_m.abs()).powi(2)
            };
            for z in near(2) {
                for y in near(1) {
                    let across = farthest(2, z) + farthest(1, y);
                    let first = (z * size[1] + y) * size[0];
                    for x in near(0) {
                        blocks.is_open[first + x] &= across + farthest(0, x) >= apart_m * apart_m;
                    }
                }
            }
        }
        blocks
    }

    /// The blocks along x that a row of cells passes.
    fn row(&self, y: usize, z: usize) -> &[bool] {
        let first = (z / BLOCK_CELLS * self.size[1] + y / BLOCK_CELLS) * self.size[0];
        &self.is_open[first..first + self.size[0]]
    }
}

/// One bit for each cell, 64 of a row in a word; outside the map all are 0.
#[derive(Clone)]
struct Bits {
    words_in_row: usize,
    rows: [usize; 2],
    words: Vec<u64>,
}

impl Bits {
    /// The cells around whose places a body of this radius touches no wall in the cube inside it,
    /// and none on its axes.
    fn clear_around(terrain: &Grid<Terrain>, radius_cells: f64, lattice: BodyLattice) -> Self {
        // A cell touches the body if its face towards the centre is nearer than the radius. The
        // cells around a corner are those around the centres of the eight that meet there.
        let offset = lattice.offset_cells();
        let reach = |part: f64| (libm::ceil(radius_cells * part + offset) as usize - 1).min(REACH_CELLS_MAX);
        let around = |bits: Self| match lattice {
            BodyLattice::Centres => bits,
            BodyLattice::Corners => (0..3).fold(bits, |bits, axis| bits.with_lower(axis)),
        };
        let free = Self::free(terrain);
        let in_cube = reach(1.0 / 3.0_f64.sqrt());
        let mut clear = around((0..3).fold(free.clone(), |bits, axis| bits.eroded(axis, in_cube)));
        for axis in 0..3 {
            let bar = around(free.eroded(axis, reach(1.0)));
            clear.words.iter_mut().zip(&bar.words).for_each(|(word, other)| *word &= other);
        }
        clear
    }

    /// The cells that are set, and the one below each along an axis too.
    fn with_lower(&self, axis: usize) -> Self {
        let mut both = self.clone();
        let [size_y, _] = self.rows;
        for (number, row) in both.words.chunks_exact_mut(self.words_in_row).enumerate() {
            let before = self.row(number);
            let lower = match axis {
                0 => {
                    let carried = |word: usize| word.checked_sub(1).map_or(0, |below| before[below] >> 63);
                    row.iter_mut().enumerate().for_each(|(word, bits)| *bits &= before[word] << 1 | carried(word));
                    continue;
                }
                1 => (number % size_y > 0).then(|| number - 1),
                _ => number.checked_sub(size_y),
            };
            match lower {
                Some(lower) => row.iter_mut().zip(self.row(lower)).for_each(|(bits, lower)| *bits &= lower),
                None => row.fill(0),
            }
        }
        both
    }

    /// The free cells.
    fn free(terrain: &Grid<Terrain>) -> Self {
        let [size_x, size_y, size_z] = terrain.extent().size().map(|cells| cells as usize);
        let words_in_row = size_x.div_ceil(64);
        let of_row = |row: &[Terrain]| {
            let word = |cells: &[Terrain]| {
                cells.iter().enumerate().fold(0, |word, (bit, &cell)| word | u64::from(cell == Terrain::Free) << bit)
            };
            row.chunks(64).map(word).collect::<Vec<u64>>()
        };
        let words = terrain.as_slice().chunks_exact(size_x).flat_map(of_row).collect();
        Self { words_in_row, rows: [size_y, size_z], words }
    }

    /// The cells of which all cells within a distance along an axis are set.
    fn eroded(&self, axis: usize, cells: usize) -> Self {
        let mut eroded = self.clone();
        for distance in 1..=cells {
            for (number, row) in eroded.words.chunks_exact_mut(self.words_in_row).enumerate() {
                let [size_y, size_z] = self.rows;
                let (y, z) = (number % size_y, number / size_y);
                let (at, size, step) = match axis {
                    0 => {
                        let before = self.row(number);
                        row.iter_mut().enumerate().for_each(|(word, bits)| *bits &= shifted(before, word, distance));
                        continue;
                    }
                    1 => (y, size_y, 1),
                    _ => (z, size_z, size_y),
                };
                for other in [
                    (at >= distance).then(|| number - distance * step),
                    (at + distance < size).then(|| number + distance * step),
                ] {
                    match other {
                        Some(other) => row.iter_mut().zip(self.row(other)).for_each(|(bits, other)| *bits &= other),
                        None => row.fill(0),
                    }
                }
            }
        }
        eroded
    }

    fn row(&self, number: usize) -> &[u64] {
        &self.words[number * self.words_in_row..(number + 1) * self.words_in_row]
    }

    fn has(&self, x: usize, row: usize) -> bool {
        self.row(row)[x / 64] >> (x % 64) & 1 == 1
    }
}

/// A word of the cells of a row whose neighbours at a distance of 1 to 63 on both sides are set.
fn shifted(row: &[u64], word: usize, distance: usize) -> u64 {
    let at = |word: Option<usize>| word.and_then(|word| row.get(word)).copied().unwrap_or_default();
    let here = row[word];
    let below = here << distance | at(word.checked_sub(1)) >> (64 - distance);
    let above = here >> distance | at(Some(word + 1)) << (64 - distance);
    below & above
}
