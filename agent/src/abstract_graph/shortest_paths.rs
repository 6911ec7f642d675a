//! Dijkstra's algorithm on the abstract graph: shortest paths from one region to all others, with
//! buckets as in [`super::path_lengths`]. What is in the lowest bucket is final, and is sorted.

use voxels::Cell;

use super::path_lengths::{BUCKETS, WIDTH};
use super::{AbstractGraph, Edge, Region, RegionId, block_along};
use crate::path::{Goal, Graph, Path, Search};

/// Lengths are counted in this fraction of a cell, so that they have a total order.
pub(super) const PER_CELL: f32 = 1024.0;

/// The shortest paths from one cell to the regions, found in ascending order of length. They are
/// valid until the graph is updated.
#[derive(Debug, Clone, Default)]
pub struct ShortestPaths {
    /// By slot of the region; entries of another epoch are stale.
    reached: Vec<Reached>,
    epoch: u32,
    /// Length of the path in the upper 32 bits, its region in the lower ones; those of the bucket
    /// before the next one, the longest first.
    nearest: Vec<u64>,
    /// The next bucket, and those in use by their numbers modulo their count.
    bucket: usize,
    buckets: [Vec<u64>; BUCKETS],
    /// Number of regions with frontiers that have not been returned.
    frontiers_left: usize,
}

#[derive(Debug, Clone, Copy, Default)]
struct Reached {
    epoch: u32,
    length: u32,
    from: Option<RegionId>,
    /// Whether the path is final.
    is_done: bool,
}

impl ShortestPaths {
    /// Starts at a cell. From a cell outside all regions there are no paths.
    pub fn begin(&mut self, graph: &AbstractGraph, from: Cell) {
        self.epoch += 1;
        self.reached.resize(graph.slots as usize, Reached::default());
        self.nearest.clear();
        self.buckets.iter_mut().for_each(Vec::clear);
        self.bucket = 0;
        self.frontiers_left = graph.regions_with_frontiers();
        if let Some((start, region)) = graph.region_of(from).and_then(|start| Some((start, graph.get(start)?))) {
            self.reached[region.slot as usize] = Reached { epoch: self.epoch, length: 0, from: None, is_done: false };
            self.nearest.push(entry(0, start));
            self.bucket = 1;
        }
    }

    /// The next region in ascending order of path length (cells), until all reachable regions have
    /// been returned.
    pub fn next<'r>(&mut self, graph: &'r AbstractGraph) -> Option<(RegionId, &'r Region, f64)> {
        loop {
            let first = self.nearest.pop().or_else(|| self.fetch())?;
            let (length, id) = ((first >> 32) as u32, RegionId(first as u32));
            let Some(region) = graph.get(id) else { continue };
            let here = &mut self.reached[region.slot as usize];
            if std::mem::replace(&mut here.is_done, true) {
                continue;
            }
            for edge in &region.edges {
                let to = length + edge_length(edge);
                let there = &mut self.reached[edge.slot as usize];
                let is_new = there.epoch != self.epoch;
                // Among paths of equal length the one over the region with the lowest id wins,
                // whichever is found first.
                if is_new || !there.is_done && (to, Some(id)) < (there.length, there.from) {
                    if is_new || to < there.length {
                        self.buckets[(to / WIDTH) as usize % BUCKETS].push(entry(to, edge.to));
                    }
                    *there = Reached { epoch: self.epoch, length: to, from: Some(id), is_done: false };
                }
            }
            self.frontiers_left -= usize::from(!region.frontiers.is_empty());
            return Some((id, region, f64::from(length) / f64::from(PER_CELL)));
        }
    }

    /// The nearest entry of the next bucket that has any.
    fn fetch(&mut self) -> Option<u64> {
        for _ in 0..BUCKETS {
            std::mem::swap(&mut self.nearest, &mut self.buckets[self.bucket % BUCKETS]);
            self.bucket += 1;
            if !self.nearest.is_empty() {
                self.nearest.sort_unstable_by(|a, b| b.cmp(a));
                return self.nearest.pop();
            }
        }
        None
    }

    /// Whether regions with frontiers are left to return, if they can be reached: else a search for
    /// frontiers may end.
    #[must_use]
    pub fn has_frontiers_left(&self) -> bool {
        self.frontiers_left > 0
    }

    fn reached(&self, graph: &AbstractGraph, region: RegionId) -> Option<&Reached> {
        let reached = self.reached.get(graph.get(region)?.slot as usize)?;
        (reached.epoch == self.epoch && reached.is_done).then_some(reached)
    }

    /// The cheapest path from a cell to a cell in a region that has been reached. The search is
    /// confined to the blocks along the abstract path and their neighbours, without the cells that
    /// `keeps_out`.
    pub fn path(
        &self,
        graph: &AbstractGraph,
        moves: Graph<'_>,
        (from, to): (Cell, Cell),
        keeps_out: &dyn Fn(Cell) -> bool,
    ) -> Option<Path> {
        let end = graph.region_of(to).filter(|&end| self.reached(graph, end).is_some())?;
        let back = std::iter::successors(Some(end), |&region| self.reached(graph, region)?.from);
        let corridor = Corridor::along(graph, back);
        let is_open = |cell: Cell| corridor.contains(cell) && (cell == to || !keeps_out(cell));
        Search::new(moves, from, Goal::Cell(to)).within(&is_open).run()
    }
}

/// The length of an edge, in fractions of a cell.
pub(super) fn edge_length(edge: &Edge) -> u32 {
    (edge.length * PER_CELL) as u32
}

/// An entry of the queue.
fn entry(length: u32, region: RegionId) -> u64 {
    u64::from(length) << 32 | u64::from(region.0)
}

/// Blocks and the blocks around them, one bit for each block of a box.
struct Corridor {
    /// The first block of the box along each axis, and the number of blocks.
    low: [i32; 3],
    size: [u32; 3],
    bits: Vec<u64>,
}

impl Corridor {
    /// The blocks of some regions, and those around them.
    fn along(graph: &AbstractGraph, regions: impl Iterator<Item = RegionId>) -> Self {
        let blocks: Vec<[i32; 3]> = regions
            .map(|region| {
                let corner = graph.corner(region.block());
                [corner.x, corner.y, corner.z].map(block_along)
            })
            .collect();
        let low = [0, 1, 2].map(|axis: usize| blocks.iter().map(|block| block[axis] - 1).min().unwrap_or_default());
        let high = [0, 1, 2].map(|axis: usize| blocks.iter().map(|block| block[axis] + 1).max().unwrap_or_default());
        let size = [0, 1, 2].map(|axis: usize| (high[axis] - low[axis] + 1).cast_unsigned());
        let volume: usize = size.iter().map(|&blocks| blocks as usize).product();
        let mut corridor = Self { low, size, bits: vec![0; volume.div_ceil(64)] };
        for [x, y, z] in blocks {
            for (z, y) in (z - 1..=z + 1).flat_map(|z| (y - 1..=y + 1).map(move |y| (z, y))) {
                for x in x - 1..=x + 1 {
                    if let Some(place) = corridor.place([x, y, z]) {
                        corridor.bits[place / 64] |= 1 << (place % 64);
                    }
                }
            }
        }
        corridor
    }

    /// The bit of a block of the box.
    fn place(&self, block: [i32; 3]) -> Option<usize> {
        let [x, y, z] = [0, 1, 2].map(|axis: usize| (block[axis] - self.low[axis]).cast_unsigned());
        let [size_x, size_y, size_z] = self.size;
        // What is below the box wraps around to a number beyond it.
        (x < size_x && y < size_y && z < size_z).then(|| ((z * size_y + y) * size_x + x) as usize)
    }

    /// Whether a cell of the map lies in one of the blocks.
    fn contains(&self, cell: Cell) -> bool {
        let place = self.place([cell.x, cell.y, cell.z].map(block_along));
        place.is_some_and(|place| self.bits[place / 64] >> (place % 64) & 1 != 0)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use proptest::prelude::*;
    use voxels::Extent;

    use super::*;

    proptest! {
        #[test]
        fn corridor_has_the_blocks_of_a_set(blocks in prop::collection::vec(0u32..3 * 2 * 4, 1..6)) {
            let extent = Extent::new([14, 10, 17], 1.0).unwrap();
            let graph = AbstractGraph::new(extent, 0.4);
            let corridor = Corridor::along(&graph, blocks.iter().map(|&block| RegionId::new(block, 0)));
            let mut model = BTreeSet::new();
            for block in blocks {
                let corner = graph.corner(block);
                let around = Cell::default().neighbours26().map(|by| Cell::new(5 * by.x, 5 * by.y, 5 * by.z));
                model.extend(around.into_iter().chain([Cell::default()]).filter_map(|by| graph.block_of(corner + by)));
            }
            for cell in extent.cells() {
                let is_in_model = graph.block_of(cell).is_some_and(|block| model.contains(&block));
                prop_assert_eq!(corridor.contains(cell), is_in_model);
            }
        }
    }
}
