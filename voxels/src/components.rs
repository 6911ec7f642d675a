//! Connected parts of free space, and the two repairs that make a map sound: one connected cave
//! inside a closed shell.
//!
//! Two free cells are connected if they share a face. The parts are found by union of *stretches*,
//! the longest pieces of free cells along x, so that a map of 2^30 cells takes memory for its
//! stretches and not for its cells. This module never turns wall into free space.

use std::ops::Range;

use crate::{Grid, Terrain};

/// Cells that are compared at once where a stretch may begin.
const AT_ONCE: usize = 32;

/// Largest number of bytes that [`free_components`] takes for a stretch.
pub const STRETCH_BYTES: usize = 8;

/// The 6-connected parts of free space, numbered in the order of their first cells.
#[derive(Clone, Debug, PartialEq)]
pub struct Components {
    /// The number of cells in each component.
    pub sizes: Vec<usize>,
    /// The index of the first cell of each component, ascending.
    pub firsts: Vec<usize>,
    /// The component of each stretch, in the order of their cells.
    of_stretch: Vec<u32>,
}

impl Components {
    /// The number of the component with most cells (of several, the first), or `None` without any
    /// free cell.
    pub fn largest(&self) -> Option<u32> {
        let most = *self.sizes.iter().max()?;
        self.sizes.iter().position(|&size| size == most).map(|number| number as u32)
    }

    /// Whether each component has a cell in the shell of the map, the outermost layer, or next to
    /// it. `terrain` is the map that they are of.
    ///
    /// # Panics
    /// If it is another map, with more stretches of free cells.
    pub fn beside_shell(&self, terrain: &Grid<Terrain>) -> Vec<bool> {
        let [size_x, size_y, size_z] = terrain.extent().size().map(|cells| cells as usize);
        let mut is_beside = vec![false; self.sizes.len()];
        let mut components = self.of_stretch.iter();
        for (row, cells) in terrain.as_slice().chunks_exact(size_x).enumerate() {
            let (y, z) = (row % size_y, row / size_y);
            let is_row_beside = y <= 1 || z <= 1 || y + 2 >= size_y || z + 2 >= size_z;
            stretches(cells, |found| {
                let component = components.next().expect("each stretch has a component");
                is_beside[*component as usize] |= is_row_beside || found.start <= 1 || found.end + 1 >= size_x;
            });
        }
        is_beside
    }
}

/// What [`keep_largest_component`] filled and what it left.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Pockets {
    /// Components that were filled.
    pub filled_components: usize,
    /// Cells in them.
    pub filled_cells: usize,
    /// Free cells that are left, all of them connected; 0 if the map was solid.
    pub kept_cells: usize,
}

/// The number of stretches of free cells along x.
pub fn free_stretches(terrain: &Grid<Terrain>) -> usize {
    let size_x = terrain.extent().size()[0] as usize;
    let mut count = 0;
    for row in terrain.as_slice().chunks_exact(size_x) {
        stretches(row, |_| count += 1);
    }
    count
}

/// Calls `found` with the stretches of a row of cells, in their order.
fn stretches(row: &[Terrain], mut found: impl FnMut(Range<usize>)) {
    let mut end = 0;
    while let Some(begin) = next_of(row, end, Terrain::Free) {
        end = next_of(row, begin, Terrain::Wall).unwrap_or(row.len());
        found(begin..end);
    }
}

/// The first cell of a kind from a position on.
fn next_of(row: &[Terrain], from: usize, kind: Terrain) -> Option<usize> {
    let mut at = from;
    for piece in row.get(from..)?.chunks(AT_ONCE) {
        // Without an early end this is a few comparisons of whole vectors.
        if piece.iter().fold(false, |is_there, &here| is_there | (here == kind)) {
            return piece.iter().position(|&here| here == kind).map(|place| at + place);
        }
        at += piece.len();
    }
    None
}

/// A stretch of the layer that is read or of the one below it.
struct Stretch {
    along_x: Range<u16>,
    number: u32,
}

/// The stretches of a layer, with the position of the first one of each row.
#[derive(Default)]
struct Layer {
    stretches: Vec<Stretch>,
    rows: Vec<usize>,
}

impl Layer {
    fn row(&self, y: usize) -> &[Stretch] {
        let end = self.rows.get(y + 1).copied().unwrap_or(self.stretches.len());
        self.rows.get(y).map_or(&[], |&begin| &self.stretches[begin..end])
    }
}

/// Finds the 6-connected components of free space.
pub fn free_components(terrain: &Grid<Terrain>) -> Components {
    let [size_x, size_y, _] = terrain.extent().size().map(|cells| cells as usize);
    // By stretch, another one of its component, which is not a later one; the first one of a
    // component is its own.
    let mut parents: Vec<u32> = Vec::new();
    let (mut below, mut here) = (Layer::default(), Layer::default());
    for (z, layer) in terrain.as_slice().chunks_exact(size_x * size_y).enumerate() {
        std::mem::swap(&mut below, &mut here);
        here.stretches.clear();
        here.rows.clear();
        for (y, row) in layer.chunks_exact(size_x).enumerate() {
            here.rows.push(here.stretches.len());
            stretches(row, |found| {
                let number = parents.len() as u32;
                parents.push(number);
                here.stretches.push(Stretch { along_x: found.start as u16..found.end as u16, number });
            });
            if y > 0 {
                unite(here.row(y), here.row(y - 1), &mut parents);
            }
            if z > 0 {
                unite(here.row(y), below.row(y), &mut parents);
            }
        }
    }
    numbered(terrain, parents)
}

/// Joins the stretches of two adjacent rows that have a face in common.
fn unite(one: &[Stretch], other: &[Stretch], parents: &mut [u32]) {
    let (mut i, mut j) = (0, 0);
    while let (Some(a), Some(b)) = (one.get(i), other.get(j)) {
        if a.along_x.start < b.along_x.end && b.along_x.start < a.along_x.end {
            let (a, b) = (root(parents, a.number), root(parents, b.number));
            parents[a.max(b) as usize] = a.min(b);
        }
        if a.along_x.end < b.along_x.end { i += 1 } else { j += 1 }
    }
}

/// The first stretch of the component of a stretch.
fn root(parents: &mut [u32], mut number: u32) -> u32 {
    while parents[number as usize] != number {
        let above = parents[parents[number as usize] as usize];
        parents[number as usize] = above;
        number = above;
    }
    number
}

/// The components of stretches with these parents.
fn numbered(terrain: &Grid<Terrain>, mut of_stretch: Vec<u32>) -> Components {
    let (mut sizes, mut firsts) = (Vec::new(), Vec::new());
    let mut number = 0;
    for_stretches(terrain, |cells| {
        let parent = of_stretch[number];
        // Parents come before their stretches, so they have their component already.
        let component = if parent as usize == number {
            firsts.push(cells.start);
            sizes.push(0);
            sizes.len() as u32 - 1
        } else {
            of_stretch[parent as usize]
        };
        of_stretch[number] = component;
        sizes[component as usize] += cells.len();
        number += 1;
    });
    Components { sizes, firsts, of_stretch }
}

/// Calls `found` with the cell indices of all stretches, ascending.
fn for_stretches(terrain: &Grid<Terrain>, mut found: impl FnMut(Range<usize>)) {
    let size_x = terrain.extent().size()[0] as usize;
    for (number, row) in terrain.as_slice().chunks_exact(size_x).enumerate() {
        let first = number * size_x;
        stretches(row, |along_x| found(first + along_x.start..first + along_x.end));
    }
}

/// Turns every free cell outside the largest component into wall; of several equally large ones the
/// one with the lowest cell index stays (docs/reference-model.md, "Repairs of a map").
pub fn keep_largest_component(terrain: &mut Grid<Terrain>) -> Pockets {
    let components = free_components(terrain);
    let Some(kept) = components.largest() else {
        return Pockets::default();
    };
    let kept_cells = components.sizes[kept as usize];
    let filled_cells = components.sizes.iter().sum::<usize>() - kept_cells;
    if filled_cells > 0 {
        let size_x = terrain.extent().size()[0] as usize;
        let mut of_stretch = components.of_stretch.iter();
        for row in terrain.as_mut_slice().chunks_exact_mut(size_x) {
            let mut end = 0;
            while let Some(begin) = next_of(row, end, Terrain::Free) {
                end = next_of(row, begin, Terrain::Wall).unwrap_or(row.len());
                if of_stretch.next() != Some(&kept) {
                    row[begin..end].fill(Terrain::Wall);
                }
            }
        }
    }
    Pockets { filled_components: components.sizes.len() - 1, filled_cells, kept_cells }
}

/// Turns the outermost `layers` layers on all six sides into wall; returns how many cells of them
/// were free. Layers beyond the middle of the map leave it solid.
pub fn close_shell(terrain: &mut Grid<Terrain>, layers: u32) -> usize {
    let [size_x, size_y, _] = terrain.extent().size().map(|cells| cells as usize);
    let size_z = terrain.extent().size()[2] as usize;
    let layers = layers as usize;
    let is_inside = |at: usize, size: usize| at >= layers && size - at > layers;
    let mut closed = 0;
    let mut close = |cells: &mut [Terrain]| {
        closed += cells.iter().filter(|&&here| here == Terrain::Free).count();
        cells.fill(Terrain::Wall);
    };
    for (number, row) in terrain.as_mut_slice().chunks_exact_mut(size_x).enumerate() {
        let (y, z) = (number % size_y, number / size_y);
        if is_inside(y, size_y) && is_inside(z, size_z) && 2 * layers < size_x {
            close(&mut row[..layers]);
            close(&mut row[size_x - layers..]);
        } else {
            close(row);
        }
    }
    closed
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Cell, Extent, FACES};
    use proptest::prelude::*;

    #[test]
    fn diagonal_cells_are_not_connected() {
        let world = Grid::from_text(".#.\n#.#\n\n###\n#.#\n").unwrap();
        let components = free_components(&world);
        assert_eq!(components.sizes, [2, 1, 1]);
        let firsts = [Cell::new(1, 0, 0), Cell::new(0, 1, 0), Cell::new(2, 1, 0)];
        assert_eq!(components.firsts, firsts.map(|cell| world.extent().index(cell).unwrap()));
        assert_eq!(free_stretches(&world), 4);
    }

    #[test]
    fn the_first_of_equal_components_stays() {
        let mut world = Grid::from_text("#..\n###\n..#\n").unwrap();
        let pockets = keep_largest_component(&mut world);
        assert_eq!(world.to_text(), "###\n###\n..#\n");
        assert_eq!(pockets, Pockets { filled_components: 1, filled_cells: 2, kept_cells: 2 });
    }

    #[test]
    fn a_solid_map_stays_as_it_is() {
        let mut world = Grid::from_text("##\n").unwrap();
        assert_eq!(keep_largest_component(&mut world), Pockets::default());
        assert_eq!(free_components(&world).largest(), None);
    }

    #[test]
    fn the_shell_is_closed_on_all_sides() {
        let mut world = Grid::new(Extent::new([4, 5, 3], 1.0).unwrap(), Terrain::Free);
        assert_eq!(close_shell(&mut world, 0), 0);
        assert_eq!(close_shell(&mut world, 1), 60 - 2 * 3);
        assert_eq!(
            world.to_text(),
            "####\n####\n####\n####\n####\n\n####\n#..#\n#..#\n#..#\n####\n\n####\n####\n####\n####\n####\n"
        );
        assert_eq!(close_shell(&mut world, 2), 6);
        assert_eq!(close_shell(&mut world, u32::MAX), 0);
    }

    /// The first cell and the number of cells of each component, by flooding cell by cell.
    fn flooded(terrain: &Grid<Terrain>) -> Vec<(usize, usize)> {
        let extent = terrain.extent();
        let mut left = terrain.clone();
        let mut found = Vec::new();
        for first in 0..extent.volume() {
            let mut open = vec![extent.cell_at(first)];
            let mut size = 0;
            while let Some(cell) = open.pop() {
                if left.get(cell) == Some(&Terrain::Free) {
                    left.set(cell, Terrain::Wall);
                    size += 1;
                    open.extend(FACES.map(|face| cell + face));
                }
            }
            found.extend((size > 0).then_some((first, size)));
        }
        found
    }

    proptest! {
        #[test]
        fn components_are_those_of_a_flood(
            size in (1u32..80, 1u32..6, 1u32..6), bits in prop::collection::vec(prop::bool::weighted(0.6), 2000),
        ) {
            let extent = Extent::new([size.0, size.1, size.2], 1.0).unwrap();
            let cells = bits[..extent.volume().min(2000)].iter().chain(std::iter::repeat(&true)).take(extent.volume());
            let cells = cells.map(|&free| if free { Terrain::Free } else { Terrain::Wall });
            let terrain = Grid::from_vec(extent, cells.collect()).unwrap();
            let Components { sizes, firsts, .. } = free_components(&terrain);
            prop_assert_eq!(firsts.into_iter().zip(sizes).collect::<Vec<_>>(), flooded(&terrain));
        }

        #[test]
        fn one_component_is_left_and_nothing_is_dug(
            size in prop::array::uniform3(1u32..8),
            bits in prop::collection::vec(any::<bool>(), 343),
        ) {
            let extent = Extent::new(size, 1.0).unwrap();
            let cells = bits[..extent.volume()].iter();
            let cells = cells.map(|&wall| if wall { Terrain::Wall } else { Terrain::Free });
            let before = Grid::from_vec(extent, cells.collect()).unwrap();
            let mut after = before.clone();
            let found = free_components(&before);
            let pockets = keep_largest_component(&mut after);

            prop_assert!(before.as_slice().iter().zip(after.as_slice()).all(|(b, a)| b <= a));
            let left = free_components(&after);
            prop_assert_eq!(left.sizes.len(), found.sizes.len().min(1));
            prop_assert_eq!(left.sizes.first(), found.sizes.iter().max());
            prop_assert_eq!(pockets.kept_cells + pockets.filled_cells, found.sizes.iter().sum::<usize>());
        }
    }
}
