//! The repair of lengths after a change of the graph, at the cost of the regions whose lengths
//! change and their neighbours.
//!
//! A length that no neighbour explains any more is void, and so are those that it alone explains;
//! then the shorter and the void ones are found anew, outwards from what is known.
//!
//! Source: G. Ramalingam, T. Reps, "An Incremental Algorithm for a Generalization of the
//! Shortest-Path Problem", Journal of Algorithms 21(2), 1996; here for many changes at once.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::{FlatGraph, Lengths, UNREACHED};

/// Repairs lengths on a graph in which some slots have `new` regions or none, and the edges of the
/// `relinked` ones have changed. All ends of edges that have changed are among them. Returns the
/// number of regions visited.
pub(super) fn repair(graph: &FlatGraph, lengths: &mut Lengths, new: &[u32], relinked: &[u32]) -> usize {
    let Lengths { start, by_slot, bound, .. } = lengths;
    let mut visited = new.len();
    new.iter().for_each(|&slot| by_slot[slot as usize] = UNREACHED);
    // The nearest first: those before it explain a length or have been found void.
    let mut doubtful: BinaryHeap<Reverse<(u32, u32)>> = BinaryHeap::new();
    let is_reached = |&&slot: &&u32| slot != *start && by_slot[slot as usize] != UNREACHED;
    doubtful.extend(relinked.iter().filter(is_reached).map(|&slot| Reverse((by_slot[slot as usize], slot))));
    let mut void = Vec::new();
    while let Some(Reverse((length, slot))) = doubtful.pop() {
        visited += 1;
        if by_slot[slot as usize] != length {
            continue;
        }
        let edges = graph.edges(slot);
        let explained = |length: u32, by: u32, whole: u32| length != UNREACHED && length + by == whole;
        if edges.iter().any(|edge| explained(by_slot[edge.to as usize], edge.back, length)) {
            continue;
        }
        by_slot[slot as usize] = UNREACHED;
        void.push(slot);
        for edge in edges {
            let beyond = by_slot[edge.to as usize];
            if beyond != UNREACHED && length + edge.length == beyond && edge.to != *start {
                doubtful.push(Reverse((beyond, edge.to)));
            }
        }
    }
    let mut queue = doubtful;
    for &slot in new.iter().chain(&void).chain(relinked) {
        let over = |length: u32, by: u32| if length == UNREACHED { UNREACHED } else { length + by };
        let best = graph.edges(slot).iter().map(|edge| over(by_slot[edge.to as usize], edge.back)).min();
        if let Some(best) = best.filter(|&best| best < by_slot[slot as usize] && best <= *bound) {
            by_slot[slot as usize] = best;
            queue.push(Reverse((best, slot)));
        }
    }
    while let Some(Reverse((length, slot))) = queue.pop() {
        visited += 1;
        if by_slot[slot as usize] != length {
            continue;
        }
        for edge in graph.edges(slot) {
            let there = length + edge.length;
            if there < by_slot[edge.to as usize] && there <= *bound {
                by_slot[edge.to as usize] = there;
                queue.push(Reverse((there, edge.to)));
            }
        }
    }
    visited
}
