//! Dijkstra's algorithm on the abstract graph: shortest paths from one region to all others.

use std::cmp::Reverse;
use std::collections::{BTreeSet, BinaryHeap};

use voxels::Cell;

use super::{AbstractGraph, BLOCK_CELLS, Region, RegionId};
use crate::exploration_map::ExplorationMap;
use crate::path::{Goal, Graph, Moves, Path, Scratch, Search};

/// Lengths are counted in this fraction of a cell, so that they have a total order.
pub(super) const PER_CELL: f32 = 1024.0;

/// The shortest paths from one cell to the regions, found in ascending order of length. They are
/// valid until the graph is updated.
#[derive(Debug, Clone, Default)]
pub struct ShortestPaths {
    /// By slot of the region; entries of another epoch are stale.
    reached: Vec<Reached>,
    epoch: u32,
    /// Length of the path and its region.
    queue: BinaryHeap<Reverse<(u32, RegionId)>>,
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
        self.queue.clear();
        if let Some((start, region)) = graph.region_of(from).and_then(|start| Some((start, graph.get(start)?))) {
            self.reached[region.slot as usize] = Reached { epoch: self.epoch, length: 0, from: None, is_done: false };
            self.queue.push(Reverse((0, start)));
        }
    }

    /// The next region in ascending order of path length (cells), until all reachable regions have
    /// been returned.
    pub fn next<'r>(&mut self, graph: &'r AbstractGraph) -> Option<(RegionId, &'r Region, f64)> {
        loop {
            let Reverse((length, id)) = self.queue.pop()?;
            let Some(region) = graph.get(id) else { continue };
            let here = &mut self.reached[region.slot as usize];
            if std::mem::replace(&mut here.is_done, true) {
                continue;
            }
            for edge in &region.edges {
                let to = length + (edge.length * PER_CELL) as u32;
                let there = &mut self.reached[edge.slot as usize];
                let is_new = there.epoch != self.epoch;
                // Among paths of equal length the one over the region with the lowest id wins,
                // whichever is found first.
                if is_new || !there.is_done && (to, Some(id)) < (there.length, there.from) {
                    if is_new || to < there.length {
                        self.queue.push(Reverse((to, edge.to)));
                    }
                    *there = Reached { epoch: self.epoch, length: to, from: Some(id), is_done: false };
                }
            }
            return Some((id, region, f64::from(length) / f64::from(PER_CELL)));
        }
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
        map: &ExplorationMap,
        moves: &Moves,
        scratch: &mut Scratch,
        (from, to): (Cell, Cell),
        keeps_out: &dyn Fn(Cell) -> bool,
    ) -> Option<Path> {
        let end = graph.region_of(to).filter(|&end| self.reached(graph, end).is_some())?;
        let mut corridor = BTreeSet::new();
        let back = std::iter::successors(Some(end), |&region| self.reached(graph, region)?.from);
        for region in back {
            let corner = graph.corner(region.block);
            corridor.insert(region.block);
            for beside in Cell::default().neighbours26() {
                let by = Cell::new(beside.x * BLOCK_CELLS, beside.y * BLOCK_CELLS, beside.z * BLOCK_CELLS);
                corridor.extend(graph.block_of(corner + by));
            }
        }
        // Neighbours are mostly of one block.
        let last = std::cell::Cell::new((u32::MAX, false));
        let is_in_corridor = |block: u32| {
            if last.get().0 != block {
                last.set((block, corridor.contains(&block)));
            }
            last.get().1
        };
        let is_open = |cell: Cell| graph.block_of(cell).is_some_and(is_in_corridor) && (cell == to || !keeps_out(cell));
        Search::new(Graph::new(map, moves), scratch, from, Goal::Cell(to)).within(&is_open).run()
    }
}
