//! Markers of cells, in chunks: the visible walls and the unexplored free cells.

use std::collections::BTreeSet;

use fixedbitset::FixedBitSet;
use msgs::ids::Tick;
use msgs::std_msgs::ColorRGBA;
use msgs::visualization_msgs::Marker;
use protocol::limits::{MESSAGE_BYTES_BARE, POINT_BYTES, VIEW_BYTES_MAX};
use voxels::{Blocks, Cell, Extent, Grid, Terrain};

use crate::wire::{header, point};

/// Largest number of cubes in a chunk.
const CUBES_MAX: usize = (VIEW_BYTES_MAX - MESSAGE_BYTES_BARE) / POINT_BYTES;

/// Cells along each axis of a block, as many as fit into a chunk.
const BLOCK_SIDE: u32 = 13;

const WALL_COLOUR: ColorRGBA = ColorRGBA { r: 0.6, g: 0.6, b: 0.55, a: 1.0 };
const UNEXPLORED_COLOUR: ColorRGBA = ColorRGBA { r: 0.9, g: 0.1, b: 0.1, a: 0.25 };

fn cubes(extent: Extent, tick: Tick, (ns, colour): (&str, ColorRGBA), id: i32, cells: &[Cell]) -> Marker {
    let points = cells.iter().map(|&cell| point(&extent.centre(cell))).collect();
    Marker::cubes(header(tick), ns, id, extent.cell_m(), colour, points)
}

/// The walls that share a face with a free cell, by index.
pub(super) fn visible_walls(terrain: &Grid<Terrain>) -> Vec<Cell> {
    let is_free = |cell| terrain.get(cell) == Some(&Terrain::Free);
    let seen = |(cell, kind): &(Cell, &Terrain)| **kind == Terrain::Wall && cell.neighbours6().into_iter().any(is_free);
    terrain.iter().filter(seen).map(|(cell, _)| cell).collect()
}

/// These walls in chunks with marker ids from 0. If the map has changed, there were `before`
/// chunks, and those that there are no more are deleted.
pub(super) fn walls(terrain: &Grid<Terrain>, tick: Tick, before: usize) -> Vec<Marker> {
    let walls = visible_walls(terrain);
    let present = walls.chunks(CUBES_MAX);
    let deleted = std::iter::repeat_n(&[][..], before.saturating_sub(present.len()));
    let chunks = (0..).zip(present.chain(deleted));
    chunks.map(|(id, cells)| cubes(terrain.extent(), tick, ("walls", WALL_COLOUR), id, cells)).collect()
}

/// The unexplored free cells, block by block, as far as they have been published.
#[derive(Debug)]
pub(super) struct Unexplored {
    blocks: Blocks,
    /// The explored cells at the last update.
    explored: FixedBitSet,
    /// Blocks that differ from what was published last.
    changed: BTreeSet<u32>,
}

impl Unexplored {
    /// Nothing published: every block with free cells has changed.
    pub(super) fn new(terrain: &Grid<Terrain>) -> Self {
        let blocks = Blocks::new(terrain.extent(), BLOCK_SIDE);
        let free = terrain.as_slice().iter().enumerate().filter(|&(_, &kind)| kind == Terrain::Free);
        let changed = free.map(|(index, _)| blocks.of(index)).collect();
        Self { blocks, explored: FixedBitSet::with_capacity(terrain.extent().volume()), changed }
    }

    /// Updates the set of changed blocks.
    pub(super) fn update(&mut self, explored: &FixedBitSet) {
        let mut new = explored.clone();
        new.difference_with(&self.explored);
        self.changed.extend(new.ones().map(|index| self.blocks.of(index)));
        self.explored.clone_from(explored);
    }

    /// Has every block published again, after a change of the map.
    pub(super) fn revise(&mut self, terrain: &Grid<Terrain>) {
        self.changed.extend((0..terrain.extent().volume()).map(|index| self.blocks.of(index)));
    }

    /// The next changed block in its present state.
    pub(super) fn next(&mut self, terrain: &Grid<Terrain>, explored: &FixedBitSet, tick: Tick) -> Option<Marker> {
        let block = self.changed.pop_first()?;
        let extent = terrain.extent();
        let is_unseen = |&cell: &Cell| {
            let index = extent.index(cell).expect("the cells of a block are in the map");
            terrain.as_slice()[index] == Terrain::Free && !explored.contains(index)
        };
        let cells: Vec<Cell> = self.blocks.cells(block).filter(is_unseen).collect();
        let id = i32::try_from(block).expect("an extent has at most 2^30 cells");
        Some(cubes(extent, tick, ("unexplored", UNEXPLORED_COLOUR), id, &cells))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn full_block_fits_into_a_chunk() {
        assert!((BLOCK_SIDE as usize).pow(3) <= CUBES_MAX);
        let terrain = Grid::new(Extent::new([13, 13, 13], 0.1).unwrap(), Terrain::Free);
        let mut unexplored = Unexplored::new(&terrain);
        let explored = FixedBitSet::with_capacity(13_usize.pow(3));
        let marker = unexplored.next(&terrain, &explored, Tick(3)).unwrap();
        assert_eq!(marker.points.len(), 2197);
        assert!(msgs::cdr::encode(&marker).len() <= VIEW_BYTES_MAX);
        assert_eq!(unexplored.next(&terrain, &explored, Tick(3)), None);
    }

    #[test]
    fn visible_walls_are_split_into_chunks() {
        let extent = Extent::new([60, 60, 3], 0.5).unwrap();
        let mut terrain = Grid::new(extent, Terrain::Wall);
        for (x, y) in (1..59).flat_map(|x| (1..59).map(move |y| (x, y))) {
            terrain.set(Cell::new(x, y, 1), Terrain::Free);
        }
        let walls = walls(&terrain, Tick(0), 0);
        // Floor and ceiling of 58 x 58, and four sides without the corners.
        assert_eq!(walls.iter().map(|marker| marker.points.len()).sum::<usize>(), 2 * 58 * 58 + 4 * 58);
        assert!(walls.iter().all(|marker| msgs::cdr::encode(marker).len() <= VIEW_BYTES_MAX));
        let ids: Vec<i32> = walls.iter().map(|marker| marker.id).collect();
        assert_eq!(ids, [0, 1, 2]);
    }
}
