//! Lengths of shortest paths from many cells to many regions: a copy of the graph as flat arrays,
//! and Dijkstra's algorithm with buckets instead of a heap.
//!
//! Every edge is at least as long as a bucket is wide. So no path to a region in the lowest bucket
//! that is not empty gets shorter over another region of that bucket, and their order does not
//! matter (Dinitz 1978; Cherkassky, Goldberg, Radzik 1996).
//!
//! The lengths from a region are kept, and repaired where the graph has changed (`repair`): most
//! regions from which lengths are asked for are those of the last decision, and most changes are
//! far from the paths between them.
//!
//! Invariant: the lengths are those of [`ShortestPaths`](super::ShortestPaths), to the bit.

mod repair;

use std::ops::Range;

use voxels::Cell;

use super::shortest_paths::{PER_CELL, edge_length};
use super::{AbstractGraph, BLOCK_CELLS, RegionId};

/// Width of a bucket: the length of the shortest edge possible, a step from face to face.
pub(super) const WIDTH: u32 = PER_CELL as u32;

/// Buckets in use at a time, a power of two: the longest edge possible, over two blocks from corner
/// to corner, reaches fewer buckets ahead.
pub(super) const BUCKETS: usize = 16;

// The longest edge leads from corner to corner of a block, and the same beyond its face.
const _: () = assert!(
    4 * 3 * (BLOCK_CELLS as usize - 1).pow(2) < (BUCKETS - 1).pow(2),
    "an edge reaches fewer buckets ahead than there are"
);

/// The length of what has not been reached.
const UNREACHED: u32 = u32::MAX;

/// Most lengths kept in all: 8 MiB.
const KEPT_MAX: usize = 1 << 21;

/// Calls of [`PathLengths::renew`] for which lengths are kept without being asked for.
const UNUSED_MAX: u32 = 3;

/// The lengths of the paths from the cell of the last call of [`PathLengths::begin`]. They are
/// those of the graph at the last call of [`PathLengths::renew`].
#[derive(Debug, Clone, Default)]
pub struct PathLengths {
    flat: FlatGraph,
    /// The update of the graph that was copied last.
    as_of: u32,
    /// Number of calls of [`PathLengths::renew`].
    renewals: u32,
    kept: Vec<Lengths>,
    /// Those of the last call of [`PathLengths::begin`], if they are kept.
    present: Option<usize>,
    /// Those of the last call otherwise.
    passing: Lengths,
    /// Slots whose lengths are to be found.
    awaited: Vec<u32>,
    /// Slots to visit, by length.
    buckets: [Vec<u32>; BUCKETS],
    /// Slots whose lengths are repaired.
    queue: repair::Queue,
    /// Lists of lengths to use again.
    spare: Vec<Vec<u32>>,
    visited: usize,
}

/// The edges of all regions, by slot.
#[derive(Debug, Clone, Default)]
struct FlatGraph {
    /// By slot, the place of its edges.
    places: Vec<Range<u32>>,
    edges: Vec<FlatEdge>,
    /// Edges that belong to no region any more.
    stale: usize,
}

/// An edge as seen from one of its ends.
#[derive(Debug, Clone, Copy)]
struct FlatEdge {
    /// Slot of the other end.
    to: u32,
    length: u32,
    /// Length on the way back, which may differ by a rounding error.
    back: u32,
}

/// The lengths of the paths from one region.
#[derive(Debug, Clone, Default)]
struct Lengths {
    start: u32,
    /// By slot; [`UNREACHED`] where it is more than the bound.
    by_slot: Vec<u32>,
    /// Up to this length all are known.
    bound: u32,
    /// The last renewal after which they were asked for.
    used: u32,
}

impl FlatGraph {
    fn edges(&self, slot: u32) -> &[FlatEdge] {
        let Range { start, end } = self.places[slot as usize];
        &self.edges[start as usize..end as usize]
    }

    /// Copies the edges of the region with a slot; of one that is not in use there are none.
    fn copy(&mut self, graph: &AbstractGraph, slot: u32) {
        let start = self.edges.len() as u32;
        if let Some((id, region)) = graph.region_with(slot) {
            for edge in &region.edges {
                let back = graph.get(edge.to).into_iter().flat_map(|other| &other.edges).find(|back| back.to == id);
                let length = edge_length(edge);
                debug_assert!(length >= WIDTH);
                self.edges.push(FlatEdge { to: edge.slot, length, back: back.map_or(length, edge_length) });
            }
        }
        let place = &mut self.places[slot as usize];
        self.stale += place.len();
        *place = start..self.edges.len() as u32;
    }
}

impl PathLengths {
    /// Copies what has changed of the graph, which must be the same each time.
    pub fn renew(&mut self, graph: &AbstractGraph) {
        self.renewals += 1;
        self.present = None;
        let oldest = self.renewals.saturating_sub(UNUSED_MAX);
        self.release(|lengths| lengths.used < oldest);
        let since = std::mem::replace(&mut self.as_of, graph.updates());
        let slots = graph.slots as usize;
        let changed: Vec<u32> = (0..graph.slots).filter(|&slot| graph.changed(slot) > since).collect();
        self.flat.places.resize(slots, 0..0);
        if self.flat.stale + changed.len() > self.flat.edges.len() / 2 {
            self.flat.edges.clear();
            self.flat.places.fill(0..0);
            (0..graph.slots).for_each(|slot| self.flat.copy(graph, slot));
            self.flat.stale = 0;
        } else {
            changed.iter().for_each(|&slot| self.flat.copy(graph, slot));
        }
        let is_new = |slot: u32| graph.made(slot) > since || graph.region_with(slot).is_none();
        self.release(|lengths| is_new(lengths.start));
        let (new, relinked): (Vec<u32>, Vec<u32>) = changed.into_iter().partition(|&slot| is_new(slot));
        for lengths in &mut self.kept {
            lengths.by_slot.resize(slots, UNREACHED);
            self.visited += repair::repair(&self.flat, lengths, &mut self.queue, &new, &relinked);
        }
    }

    /// Finds the lengths of the paths from a cell to these regions; those to other regions may be
    /// missing or too long. From a cell outside all regions there are none. The graph must be that
    /// of the last call of [`PathLengths::renew`].
    pub fn begin(&mut self, graph: &AbstractGraph, from: Cell, to: impl IntoIterator<Item = RegionId>) {
        self.present = None;
        self.passing.by_slot.clear();
        let Some(start) = graph.region_of(from).and_then(|start| graph.get(start)) else { return };
        self.awaited.clear();
        self.awaited.extend(to.into_iter().filter_map(|region| Some(graph.get(region)?.slot)));
        let slots = self.flat.places.len();
        let known = self.kept.iter().position(|lengths| lengths.start == start.slot);
        let place = known.or_else(|| {
            let has_room = (self.kept.len() + 1) * slots <= KEPT_MAX;
            has_room.then(|| {
                let by_slot = self.spare.pop().unwrap_or_default();
                self.kept.push(Lengths { start: start.slot, by_slot, ..Lengths::default() });
                self.kept.len() - 1
            })
        });
        self.present = place;
        let mut lengths =
            place.map_or_else(|| std::mem::take(&mut self.passing), |at| std::mem::take(&mut self.kept[at]));
        if known.is_none() {
            lengths.start = start.slot;
            lengths.bound = 0;
            lengths.by_slot.clear();
            lengths.by_slot.resize(slots, UNREACHED);
            lengths.by_slot[start.slot as usize] = 0;
            self.spread(&mut lengths);
        } else if lengths.bound != UNREACHED
            && self.awaited.iter().any(|&slot| lengths.by_slot[slot as usize] == UNREACHED)
        {
            self.spread(&mut lengths);
        }
        lengths.used = self.renewals;
        match place {
            Some(at) => self.kept[at] = lengths,
            None => self.passing = lengths,
        }
    }

    /// Finds the lengths to the slots awaited, from those that are known.
    fn spread(&mut self, lengths: &mut Lengths) {
        // No edge from before these buckets leads beyond the bound.
        let mut bucket = ((lengths.bound / WIDTH) as usize + 1).saturating_sub(BUCKETS);
        for (slot, &length) in (0..).zip(&lengths.by_slot) {
            if length != UNREACHED && (length / WIDTH) as usize >= bucket {
                self.buckets[(length / WIDTH) as usize % BUCKETS].push(slot);
            }
        }
        lengths.bound = UNREACHED;
        let mut empty = 0;
        while empty < BUCKETS {
            // What was found in an earlier bucket is final.
            let is_final = |&slot: &u32| ((lengths.by_slot[slot as usize] / WIDTH) as usize) < bucket;
            while self.awaited.pop_if(|slot| is_final(slot)).is_some() {}
            if self.awaited.is_empty() {
                // What lies farther may not be final.
                lengths.bound = (bucket as u32 * WIDTH).saturating_sub(1);
                for slot in self.buckets.iter_mut().flat_map(|slots| slots.drain(..)) {
                    let length = &mut lengths.by_slot[slot as usize];
                    *length = if *length > lengths.bound { UNREACHED } else { *length };
                }
                return;
            }
            let mut slots = std::mem::take(&mut self.buckets[bucket % BUCKETS]);
            empty = if slots.is_empty() { empty + 1 } else { 0 };
            self.visited += slots.len();
            for slot in slots.drain(..) {
                let length = lengths.by_slot[slot as usize];
                // A shorter path was found, and the region was visited in an earlier bucket.
                if (length / WIDTH) as usize != bucket {
                    continue;
                }
                for &FlatEdge { to, length: by, .. } in self.flat.edges(slot) {
                    if length + by < lengths.by_slot[to as usize] {
                        lengths.by_slot[to as usize] = length + by;
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
        let lengths = self.present.map_or(&self.passing, |place| &self.kept[place]);
        let length = *lengths.by_slot.get(graph.get(region)?.slot as usize)?;
        (length != UNREACHED).then(|| f64::from(length) / f64::from(PER_CELL))
    }

    /// Keeps some lengths no longer.
    fn release(&mut self, is_released: impl Fn(&Lengths) -> bool) {
        for lengths in self.kept.extract_if(.., |lengths| is_released(lengths)) {
            self.spare.push(lengths.by_slot);
        }
    }

    /// Number of regions visited so far, to find and to repair lengths: a measure of the work.
    #[must_use]
    pub fn visited(&self) -> usize {
        self.visited
    }
}
