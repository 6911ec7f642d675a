//! The Voronoi decomposition of the abstract graph: each region belongs to the nearest of several
//! sources, by the length of the path.
//!
//! One search from all sources at once answers for every region which source is nearest, and for
//! neighbouring sources how far apart they are. It is valid until the graph is updated.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};

use super::shortest_paths::{PER_CELL, edge_length};
use super::{AbstractGraph, RegionId};

/// The decomposition by the sources of the last call of [`Voronoi::decompose`].
#[derive(Debug, Clone, Default)]
pub struct Voronoi {
    /// By slot of the region; entries of another epoch are stale.
    reached: Vec<Reached>,
    epoch: u32,
    /// Length of the path, its source, and the region where it ends.
    queue: BinaryHeap<Reverse<(u32, u32, RegionId)>>,
    /// The regions reached, in ascending order of path length.
    order: Vec<RegionId>,
}

#[derive(Debug, Clone, Copy, Default)]
struct Reached {
    epoch: u32,
    length: u32,
    source: u32,
    /// Whether the source is final.
    is_done: bool,
}

impl Voronoi {
    /// Assigns every region to the nearest source; of equally near ones to the one with the lowest
    /// number. A source may have several regions.
    pub fn decompose(&mut self, graph: &AbstractGraph, sources: impl IntoIterator<Item = (u32, RegionId)>) {
        self.epoch += 1;
        self.reached.resize(graph.slots as usize, Reached::default());
        self.queue.clear();
        self.order.clear();
        for (source, id) in sources {
            if let Some(region) = graph.get(id) {
                self.relax(region.slot, id, 0, source);
            }
        }
        while let Some(Reverse((length, source, id))) = self.queue.pop() {
            let Some(region) = graph.get(id) else { continue };
            if std::mem::replace(&mut self.reached[region.slot as usize].is_done, true) {
                continue;
            }
            self.order.push(id);
            for edge in &region.edges {
                self.relax(edge.slot, edge.to, length + edge_length(edge), source);
            }
        }
    }

    fn relax(&mut self, slot: u32, id: RegionId, length: u32, source: u32) {
        let there = &mut self.reached[slot as usize];
        if there.epoch != self.epoch || !there.is_done && (length, source) < (there.length, there.source) {
            *there = Reached { epoch: self.epoch, length, source, is_done: false };
            self.queue.push(Reverse((length, source, id)));
        }
    }

    /// The nearest source of a region and the length of the path to it, cells; `None` if no source
    /// is connected to it.
    #[must_use]
    pub fn nearest(&self, graph: &AbstractGraph, region: RegionId) -> Option<(u32, f64)> {
        let reached = self.reached.get(graph.get(region)?.slot as usize)?;
        let length = f64::from(reached.length) / f64::from(PER_CELL);
        (reached.epoch == self.epoch && reached.is_done).then_some((reached.source, length))
    }

    /// The pairs of sources (the lower number first) whose regions adjoin, with the length of the
    /// shortest path between them that does not leave the two, cells.
    #[must_use]
    pub fn borders(&self, graph: &AbstractGraph) -> BTreeMap<(u32, u32), f64> {
        let mut borders: BTreeMap<(u32, u32), f64> = BTreeMap::new();
        for &id in &self.order {
            let (Some(region), Some((source, length))) = (graph.get(id), self.nearest(graph, id)) else { continue };
            for edge in &region.edges {
                let Some((other, rest)) = self.nearest(graph, edge.to) else { continue };
                if source < other {
                    let whole = length + f64::from(edge.length) + rest;
                    borders.entry((source, other)).and_modify(|least| *least = least.min(whole)).or_insert(whole);
                }
            }
        }
        borders
    }
}
