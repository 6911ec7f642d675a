//! The repair of lengths after a change of the graph, at the cost of the regions whose lengths
//! change and their neighbours.
//!
//! A length that no neighbour explains any more is void, and so are those that it alone explains;
//! then the shorter and the void ones are found anew, outwards from what is known.
//!
//! Source: G. Ramalingam, T. Reps, "An Incremental Algorithm for a Generalization of the
//! Shortest-Path Problem", Journal of Algorithms 21(2), 1996; here for many changes at once.

use super::{FlatGraph, Lengths, UNREACHED, WIDTH};

/// Most buckets that are kept between repairs, a multiple of 64: 96 KiB without their entries. A
/// repair uses as many as the longest path has steps.
const BUCKETS_KEPT_MAX: usize = 1 << 12;

/// A queue of slots by their lengths, in buckets as those of [`super::PathLengths`], of which any
/// may be in use.
#[derive(Debug, Clone, Default)]
pub(super) struct Queue {
    buckets: Vec<Vec<(u32, u32)>>,
    /// A bit for each bucket that is not empty; those before `first` are 0.
    occupied: Vec<u64>,
    first: usize,
}

impl Queue {
    fn push(&mut self, length: u32, slot: u32) {
        let bucket = (length / WIDTH) as usize;
        if bucket >= self.buckets.len() {
            self.buckets.resize_with(bucket + 1, Vec::new);
            self.occupied.resize(bucket / 64 + 1, 0);
        }
        self.buckets[bucket].push((length, slot));
        self.occupied[bucket / 64] |= 1 << (bucket % 64);
        self.first = self.first.min(bucket / 64);
    }

    /// One of the lowest bucket: no other of it can change by it.
    fn pop(&mut self) -> Option<(u32, u32)> {
        while let Some(&word) = self.occupied.get(self.first) {
            if word != 0 {
                let bucket = 64 * self.first + word.trailing_zeros() as usize;
                let entry = self.buckets[bucket].pop();
                if self.buckets[bucket].is_empty() {
                    self.occupied[self.first] &= word - 1;
                }
                return entry;
            }
            self.first += 1;
        }
        None
    }

    /// Gives back the memory of the queue, which is empty, beyond what is kept between repairs.
    fn trim(&mut self) {
        self.buckets.truncate(BUCKETS_KEPT_MAX);
        self.buckets.shrink_to(BUCKETS_KEPT_MAX);
        self.occupied.truncate(BUCKETS_KEPT_MAX / 64);
    }
}

/// Repairs lengths on a graph in which some slots have `new` regions or none, and the edges of the
/// `relinked` ones have changed. All ends of edges that have changed are among them. Returns the
/// number of regions visited.
pub(super) fn repair(
    graph: &FlatGraph,
    lengths: &mut Lengths,
    queue: &mut Queue,
    new: &[u32],
    relinked: &[u32],
) -> usize {
    let Lengths { start, by_slot, bound, .. } = lengths;
    let mut visited = new.len();
    new.iter().for_each(|&slot| by_slot[slot as usize] = UNREACHED);
    // The nearest first: those of buckets before it explain a length or have been found void.
    let is_reached = |&&slot: &&u32| slot != *start && by_slot[slot as usize] != UNREACHED;
    relinked.iter().filter(is_reached).for_each(|&slot| queue.push(by_slot[slot as usize], slot));
    let mut void = Vec::new();
    while let Some((length, slot)) = queue.pop() {
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
                queue.push(beyond, edge.to);
            }
        }
    }
    for &slot in new.iter().chain(&void).chain(relinked) {
        let over = |length: u32, by: u32| if length == UNREACHED { UNREACHED } else { length + by };
        let best = graph.edges(slot).iter().map(|edge| over(by_slot[edge.to as usize], edge.back)).min();
        if let Some(best) = best.filter(|&best| best < by_slot[slot as usize] && best <= *bound) {
            by_slot[slot as usize] = best;
            queue.push(best, slot);
        }
    }
    while let Some((length, slot)) = queue.pop() {
        visited += 1;
        if by_slot[slot as usize] != length {
            continue;
        }
        for edge in graph.edges(slot) {
            let there = length + edge.length;
            if there < by_slot[edge.to as usize] && there <= *bound {
                by_slot[edge.to as usize] = there;
                queue.push(there, edge.to);
            }
        }
    }
    queue.trim();
    visited
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drain(queue: &mut Queue) -> Vec<u32> {
        std::iter::from_fn(|| queue.pop()).map(|(length, _)| length / WIDTH).collect()
    }

    #[test]
    fn queue_is_in_the_order_of_buckets_and_keeps_few() {
        let mut queue = Queue::default();
        let far = BUCKETS_KEPT_MAX as u32 + 100;
        for _ in 0..2 {
            [far, 70, 3, 200, 3].into_iter().for_each(|bucket| queue.push(bucket * WIDTH + 1, bucket));
            assert_eq!([queue.pop(), queue.pop()], [Some((3 * WIDTH + 1, 3)); 2]);
            assert_eq!(queue.pop(), Some((70 * WIDTH + 1, 70)));
            // A shorter length is found after longer ones.
            [69, 1].into_iter().for_each(|bucket| queue.push(bucket * WIDTH, bucket));
            assert_eq!(drain(&mut queue), [1, 69, 200, far]);
            queue.trim();
            assert_eq!((queue.buckets.len(), queue.occupied.len()), (BUCKETS_KEPT_MAX, BUCKETS_KEPT_MAX / 64));
        }
    }
}
