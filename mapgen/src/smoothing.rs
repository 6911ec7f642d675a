//! The smoothing rule of both generators: a cell becomes what most of the 26 cells around it are.
//!
//! Invariants: all cells of a pass change at once, and the outermost layer never changes. The work
//! per cell does not depend on the neighbourhood: the 27 cells are added up axis by axis. Beside
//! the terrain there are three layers of sums, so a large map costs no second copy.

use voxels::{Grid, Terrain};

/// The largest number of passes that a spec may ask for.
///
/// A pass that changes nothing ends the smoothing: default spheres of 100^3 cells become stable
/// within a hundred passes, while noise of that size still changes slowly after a thousand, which
/// take half a second.
pub(super) const PASSES_MAX: u32 = 1000;

/// An inner cell is wall after a pass if more than this many of its 26 neighbours were
/// (docs/reference-model.md, "Map generators: Smoothed Noise").
const WALL_NEIGHBOURS_OF_FREE_MAX: u8 = 13;

/// Smooths the terrain `passes` times.
pub(super) fn smooth(terrain: &mut Grid<Terrain>, passes: u32) {
    let size = terrain.extent().size().map(|cells| cells as usize);
    if size.iter().any(|&cells| cells < 3) {
        return;
    }
    for _ in 0..passes {
        if !pass(terrain.as_mut_slice(), size) {
            return;
        }
    }
}

/// One simultaneous pass; returns whether any cell changed.
fn pass(cells: &mut [Terrain], [size_x, size_y, size_z]: [usize; 3]) -> bool {
    let layer = size_x * size_y;
    let mut rows = vec![0; size_x];
    let mut sums = [vec![0; layer], vec![0; layer], vec![0; layer]];
    sum_layer(&cells[..layer], size_x, &mut rows, &mut sums[1]);
    sum_layer(&cells[layer..2 * layer], size_x, &mut rows, &mut sums[2]);

    let mut changed = false;
    for z in 1..size_z - 1 {
        sums.rotate_left(1);
        // The layer above is still as it was before the pass: layers are rewritten from the bottom
        // up.
        sum_layer(&cells[(z + 1) * layer..(z + 2) * layer], size_x, &mut rows, &mut sums[2]);
        let [below, here, above] = &sums;
        for y in 1..size_y - 1 {
            let row = y * size_x + 1..(y + 1) * size_x - 1;
            let sums = below[row.clone()].iter().zip(&here[row.clone()]).zip(&above[row.clone()]);
            let row = &mut cells[z * layer..][row];
            for (cell, ((below, here), above)) in row.iter_mut().zip(sums) {
                let neighbours = below + here + above - *cell as u8;
                let smoothed = if neighbours > WALL_NEIGHBOURS_OF_FREE_MAX { Terrain::Wall } else { Terrain::Free };
                changed |= smoothed != *cell;
                *cell = smoothed;
            }
        }
    }
    changed
}

/// For every inner cell of one layer, the number of walls among the 3 x 3 cells around it; `rows`
/// is working space.
fn sum_layer(layer: &[Terrain], size_x: usize, rows: &mut [u8], sums: &mut [u8]) {
    for (y, sums) in sums.chunks_mut(size_x).enumerate().take(layer.len() / size_x - 1).skip(1) {
        let three = &layer[(y - 1) * size_x..(y + 2) * size_x];
        let (first, others) = three.split_at(size_x);
        let (second, third) = others.split_at(size_x);
        for (sum, ((a, b), c)) in rows.iter_mut().zip(first.iter().zip(second).zip(third)) {
            *sum = *a as u8 + *b as u8 + *c as u8;
        }
        for (sum, ((a, b), c)) in sums[1..size_x - 1].iter_mut().zip(rows.iter().zip(&rows[1..]).zip(&rows[2..])) {
            *sum = a + b + c;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use voxels::{Cell, Extent, is_wall_at};

    /// The smoothing rule by definition, cell by cell.
    fn literal(terrain: &Grid<Terrain>) -> Grid<Terrain> {
        let mut smoothed = terrain.clone();
        let [x, y, z] = terrain.extent().size().map(|cells| cells as i32);
        for cell in terrain.extent().cells() {
            let inner = (1..x - 1).contains(&cell.x) && (1..y - 1).contains(&cell.y) && (1..z - 1).contains(&cell.z);
            if inner {
                let walls = cell.neighbours26().into_iter().filter(|&n| is_wall_at(terrain, n)).count();
                smoothed.set(cell, if walls > 13 { Terrain::Wall } else { Terrain::Free });
            }
        }
        smoothed
    }

    proptest! {
        #[test]
        fn sums_by_axis_equal_the_literal_rule(
            size in prop::array::uniform3(1u32..9),
            bits in prop::collection::vec(any::<bool>(), 512),
            passes in 0u32..4,
        ) {
            let extent = Extent::new(size, 1.0).unwrap();
            let cells = bits[..extent.volume()].iter().map(|&wall| if wall { Terrain::Wall } else { Terrain::Free });
            let terrain = Grid::from_vec(extent, cells.collect()).unwrap();
            let mut smoothed = terrain.clone();
            smooth(&mut smoothed, passes);
            prop_assert_eq!(smoothed, (0..passes).fold(terrain, |terrain, _| literal(&terrain)));
        }
    }

    #[test]
    fn thirteen_walls_leave_a_cell_free_and_fourteen_fill_it() {
        let extent = Extent::new([3, 3, 3], 1.0).unwrap();
        let centre = Cell::new(1, 1, 1);
        for (walls, expected) in [(13, Terrain::Free), (14, Terrain::Wall)] {
            for before in [Terrain::Free, Terrain::Wall] {
                let mut terrain = Grid::new(extent, Terrain::Free);
                terrain.set(centre, before);
                for neighbour in centre.neighbours26().into_iter().take(walls) {
                    terrain.set(neighbour, Terrain::Wall);
                }
                smooth(&mut terrain, 1);
                assert_eq!(terrain.get(centre), Some(&expected), "{walls} walls around {before:?}");
            }
        }
    }
}
