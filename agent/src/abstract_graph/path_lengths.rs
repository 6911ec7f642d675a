//! Lengths of shortest paths from many cells to many regions: a copy of the graph as flat arrays,
//! and Dijkstra's algorithm with buckets instead of a heap.
//!
//! Every edge is at least as long as a bucket is wide. So no path to a region in the lowest bucket
//! that is not empty gets shorter over another region of that bucket, and their order does not
//! matter (Dinitz 1978; Cherkassky, Goldberg, Radzik 1996).
//!
//! Invariant: the lengths are those of [`ShortestPaths`](super::ShortestPaths), to the bit.

use std::ops::Range;

use voxels::Cell;

use super::shortest_paths::{PER_CELL, edge_length};
use super::{AbstractGraph, BLOCK_CELLS, RegionId};

/// Width of a bucket: the length of the shortest edge possible, a step from face to face.
const WIDTH: u32 = PER_CELL as u32;

/// Buckets in use at a time, a power of two: the longest edge possible, over two blocks from corner
/// to corner, reaches fewer buckets ahead.
const BUCKETS: usize = 16;

// The longest edge leads from corner to corner of a block, and the same beyond its face.
const _: () = assert!(
    4 * 3 * (BLOCK_CELLS as usize - 1).pow(2) < (BUCKETS - 1).pow(2),
    "an edge reaches fewer buckets ahead than there are"
);

/// The length of what has not been reached.
const UNREACHED: u32 = u32::MAX;

/// The lengths of the paths from the cell of the last call of [`PathLengths::begin`]. They are
/// those of the graph at the last call of [`PathLengths::renew`].
#[derive(Debug, Clone, Default)]
pub struct PathLengths {
    /// By slot of the region, the place of its edges.
    places: Vec<Range<u32>>,
    /// Slot of the target and length.
    edges: Vec<(u32, u32)>,
    /// By slot.
    lengths: Vec<u32>,
    /// Slots whose lengths are to be found.
    awaited: Vec<u32>,
    /// Slots to visit, by length.
    buckets: [Vec<u32>; BUCKETS],
}

impl PathLengths {
    /// Copies the graph.
    pub fn renew(&mut self, graph: &AbstractGraph) {
        self.places.clear();
        self.places.resize(graph.slots as usize, 0..0);
        self.edges.clear();
        for region in graph.blocks.iter().flatten().flat_map(|block| &block.regions) {
            let start = self.edges.len() as u32;
            self.edges.extend(region.edges.iter().map(|edge| (edge.slot, edge_length(edge))));
            debug_assert!(self.edges[start as usize..].iter().all(|&(_, length)| length >= WIDTH));
            self.places[region.slot as usize] = start..self.edges.len() as u32;
        }
    }

    /// Finds the lengths of the paths from a cell to these regions; those to other regions may be
    /// missing or too long. From a cell outside all regions there are none. The graph must be that
    /// of the last call of [`PathLengths::renew`].
    pub fn begin(&mut self, graph: &AbstractGraph, from: Cell, to: impl IntoIterator<Item = RegionId>) {
        self.lengths.clear();
        self.lengths.resize(self.places.len(), UNREACHED);
        let Some(start) = graph.region_of(from).and_then(|start| graph.get(start)) else { return };
        self.lengths[start.slot as usize] = 0;
        self.buckets[0].push(start.slot);
        self.awaited.clear();
        self.awaited.extend(to.into_iter().filter_map(|region| Some(graph.get(region)?.slot)));
        let mut bucket = 0;
        let mut empty = 0;
        while empty < BUCKETS {
            // What was found in an earlier bucket is final.
            let is_final = |&slot: &u32| ((self.lengths[slot as usize] / WIDTH) as usize) < bucket;
            while self.awaited.pop_if(|slot| is_final(slot)).is_some() {}
            if self.awaited.is_empty() {
                self.buckets.iter_mut().for_each(Vec::clear);
                return;
            }
            let mut slots = std::mem::take(&mut self.buckets[bucket % BUCKETS]);
            empty = if slots.is_empty() { empty + 1 } else { 0 };
            for slot in slots.drain(..) {
                let length = self.lengths[slot as usize];
                // A shorter path was found, and the region was visited in an earlier bucket.
                if (length / WIDTH) as usize != bucket {
                    continue;
                }
                let Range { start, end } = self.places[slot as usize];
                for &(to, by) in &self.edges[start as usize..end as usize] {
                    if length + by < self.lengths[to as usize] {
                        self.lengths[to as usize] = length + by;
                        self.buckets[((length + by) / WIDTH) as usize % BUCKETS].push(to);
                    }
                }
            }
            // Its memory serves the next lengths.
            self.buckets[bucket % BUCKETS] = slots;
            bucket += 1;
        }
    }

    /// The length of the path to a region, cells; `None` if there is none.
    #[must_use]
    pub fn to(&self, graph: &AbstractGraph, region: RegionId) -> Option<f64> {
        let length = *self.lengths.get(graph.get(region)?.slot as usize)?;
        (length != UNREACHED).then(|| f64::from(length) / f64::from(PER_CELL))
    }
}
