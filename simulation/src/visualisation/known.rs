//! What is known of the cells of a map: all, its surfaces, or what the team has seen.

use fixedbitset::FixedBitSet;
use voxels::{Cell, Grid, Terrain};

/// All cells.
pub(super) fn whole(terrain: &Grid<Terrain>) -> impl Fn(Cell) -> Option<Terrain> {
    |cell| terrain.get(cell).copied()
}

/// The free cells, and the walls that share a face with one of them.
pub(super) fn surfaces(terrain: &Grid<Terrain>) -> impl Fn(Cell) -> Option<Terrain> {
    around(terrain, |cell| terrain.get(cell) == Some(&Terrain::Free))
}

/// The free cells that the team has seen, and the walls that share a face with one of them.
pub(super) fn explored(terrain: &Grid<Terrain>, explored: &FixedBitSet) -> impl Fn(Cell) -> Option<Terrain> {
    let extent = terrain.extent();
    around(terrain, move |cell| extent.index(cell).is_some_and(|index| explored.contains(index)))
}

fn around(terrain: &Grid<Terrain>, is_free: impl Fn(Cell) -> bool) -> impl Fn(Cell) -> Option<Terrain> {
    move |cell| match terrain.get(cell) {
        Some(Terrain::Free) if is_free(cell) => Some(Terrain::Free),
        Some(Terrain::Wall) if cell.neighbours6().into_iter().any(&is_free) => Some(Terrain::Wall),
        _ => None,
    }
}
