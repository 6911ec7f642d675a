//! Connected parts of free space, and the two repairs that make a map sound: one connected cave
//! inside a closed shell.
//!
//! Two free cells are connected if they share a face. This module never turns wall into free space.

use crate::{Cell, FACES, Grid, Terrain};

/// The label of a wall cell in [`Components::labels`].
pub const NO_COMPONENT: u32 = u32::MAX;

/// The 6-connected parts of free space, numbered in the order of their first cells.
#[derive(Clone, Debug, PartialEq)]
pub struct Components {
    /// The number of the component that each cell belongs to, [`NO_COMPONENT`] for wall.
    pub labels: Grid<u32>,
    /// The number of cells in each component.
    pub sizes: Vec<usize>,
}

impl Components {
    /// The number of the component with most cells (of several, the first), or `None` without any
    /// free cell.
    pub fn largest(&self) -> Option<u32> {
        let most = *self.sizes.iter().max()?;
        self.sizes.iter().position(|&size| size == most).map(|number| number as u32)
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

/// Finds the 6-connected components of free space.
pub fn free_components(terrain: &Grid<Terrain>) -> Components {
    let mut labels = Grid::new(terrain.extent(), NO_COMPONENT);
    let mut sizes = Vec::new();
    for first in 0..terrain.extent().volume() {
        if terrain[first] == Terrain::Free && labels[first] == NO_COMPONENT {
            sizes.push(flood(terrain, &mut labels, first, sizes.len() as u32));
        }
    }
    Components { labels, sizes }
}

/// Labels everything that is connected with the cell `first`; returns the number of cells.
fn flood(terrain: &Grid<Terrain>, labels: &mut Grid<u32>, first: usize, label: u32) -> usize {
    let extent = terrain.extent();
    labels[first] = label;
    let mut size = 0;
    let mut open: Vec<Cell> = vec![extent.cell_at(first)];
    while let Some(cell) = open.pop() {
        size += 1;
        for offset in FACES {
            let next = cell + offset;
            let Some(index) = extent.index(next) else {
                continue;
            };
            if terrain[index] == Terrain::Free && labels[index] == NO_COMPONENT {
                labels[index] = label;
                open.push(next);
            }
        }
    }
    size
}

/// Turns every free cell outside the largest component into wall; of several equally large ones the
/// one with the lowest cell index stays (docs/reference-model.md, "Repairs of a map").
pub fn keep_largest_component(terrain: &mut Grid<Terrain>) -> Pockets {
    let components = free_components(terrain);
    let Some(kept) = components.largest() else {
        return Pockets::default();
    };
    for (cell, &label) in terrain.as_mut_slice().iter_mut().zip(components.labels.as_slice()) {
        if label != kept {
            *cell = Terrain::Wall;
        }
    }
    let kept_cells = components.sizes[kept as usize];
    Pockets {
        filled_components: components.sizes.len() - 1,
        filled_cells: components.sizes.iter().sum::<usize>() - kept_cells,
        kept_cells,
    }
}

/// Turns the outermost `layers` layers on all six sides into wall; returns how many cells of them
/// were free. Layers beyond the middle of the map leave it solid.
pub fn close_shell(terrain: &mut Grid<Terrain>, layers: u32) -> usize {
    let extent = terrain.extent();
    let inside = |coordinate: i32, size: u32| {
        let coordinate = coordinate as u32;
        coordinate >= layers && size - coordinate > layers
    };
    let [size_x, size_y, size_z] = extent.size();
    let mut closed = 0;
    for (cell, here) in extent.cells().zip(terrain.as_mut_slice()) {
        let is_inside = inside(cell.x, size_x) && inside(cell.y, size_y) && inside(cell.z, size_z);
        if !is_inside && *here == Terrain::Free {
            *here = Terrain::Wall;
            closed += 1;
        }
    }
    closed
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Extent;
    use proptest::prelude::*;

    #[test]
    fn diagonal_cells_are_not_connected() {
        let world = Grid::from_text(".#.\n#.#\n\n###\n#.#\n").unwrap();
        let components = free_components(&world);
        assert_eq!(components.sizes, [2, 1, 1]);
        assert_eq!(components.labels.get(Cell::new(1, 0, 1)), Some(&0));
        assert_eq!(components.labels.get(Cell::new(2, 1, 0)), Some(&2));
        assert_eq!(components.labels.get(Cell::new(0, 0, 0)), Some(&NO_COMPONENT));
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

    proptest! {
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
