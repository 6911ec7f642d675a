//! The pairs of spheres joined by tunnels: each sphere with its nearest neighbours.
//!
//! Distances are squared integers and ties go to the sphere that was made first, so the answer is
//! exact. Centres are sorted into cubic buckets, because a map of 1024^3 cells has hundreds of
//! thousands of them.

use std::ops::RangeInclusive;

use voxels::{Cell, Extent};

/// The pairs (from, to) of indices into `centres` such that `to` is one of the `connections`
/// nearest other centres of `from`; every unordered pair once, listed by the sphere that comes
/// first.
pub(super) fn nearest(extent: Extent, centres: &[Cell], connections: usize) -> Vec<(usize, usize)> {
    if connections == 0 {
        return Vec::new();
    }
    let buckets = Buckets::new(extent, centres, connections);
    let neighbours: Vec<Vec<usize>> = (0..centres.len()).map(|index| buckets.nearest(index, connections)).collect();
    let mut pairs = Vec::new();
    for (from, near) in neighbours.iter().enumerate() {
        let known = |to: usize| to < from && neighbours[to].contains(&from);
        pairs.extend(near.iter().filter(|&&to| !known(to)).map(|&to| (from, to)));
    }
    pairs
}

/// The centres, grouped by the cube of the map that they lie in.
struct Buckets<'a> {
    centres: &'a [Cell],
    /// Edge of a bucket in cells.
    edge: i32,
    /// Buckets along each axis.
    counts: [i32; 3],
    /// For each bucket, the indices of its centres, in ascending order.
    members: Vec<Vec<usize>>,
}

impl<'a> Buckets<'a> {
    /// Buckets that hold about as many centres as a query looks for.
    fn new(extent: Extent, centres: &'a [Cell], connections: usize) -> Self {
        let volume_per_bucket = extent.volume() as f64 * (connections as f64 + 1.0) / centres.len().max(1) as f64;
        let edge = (libm::cbrt(volume_per_bucket) as i32).max(1);
        let counts = extent.size().map(|cells| (cells as i32 - 1) / edge + 1);
        let mut buckets = Self { centres, edge, counts, members: Vec::new() };
        buckets.members = vec![Vec::new(); counts.iter().product::<i32>() as usize];
        for (index, &centre) in centres.iter().enumerate() {
            let bucket = buckets.index(buckets.bucket_of(centre));
            buckets.members[bucket].push(index);
        }
        buckets
    }

    /// The `count` centres nearest to the one at `index`, nearest first, ties in ascending order of
    /// index.
    fn nearest(&self, index: usize, count: usize) -> Vec<usize> {
        let centre = self.centres[index];
        let home = self.bucket_of(centre);
        let mut found: Vec<(i32, usize)> = Vec::new();
        let rings = self.counts.into_iter().fold(0, i32::max);
        for ring in 0..rings {
            // Whatever lies in this ring or beyond is at least this far away along one axis.
            let square_min = if ring == 0 { 0 } else { ((ring - 1) * self.edge + 1).pow(2) };
            if found.len() >= count && found[count - 1].0 < square_min {
                break;
            }
            self.visit_ring(home, ring, |members| {
                let others = members.iter().filter(|&&other| other != index);
                found.extend(others.map(|&other| (square(self.centres[other] - centre), other)));
            });
            found.sort_unstable();
            found.truncate(count);
        }
        found.into_iter().map(|(_, other)| other).collect()
    }

    /// Calls `visit` for every bucket whose largest distance from `home` along an axis is `ring`.
    fn visit_ring(&self, home: [i32; 3], ring: i32, mut visit: impl FnMut(&[usize])) {
        let [x, y, z]: [RangeInclusive<i32>; 3] =
            std::array::from_fn(|axis| (home[axis] - ring).max(0)..=(home[axis] + ring).min(self.counts[axis] - 1));
        for k in z {
            for j in y.clone() {
                let on_face = (k - home[2]).abs() == ring || (j - home[1]).abs() == ring;
                // Inside the ring's hull only the two ends of a row belong to the ring.
                let step = if on_face || ring == 0 { 1 } else { 2 * ring as usize };
                let row = if step == 1 { x.clone() } else { home[0] - ring..=home[0] + ring };
                for i in row.step_by(step).filter(|i| x.contains(i)) {
                    visit(&self.members[self.index([i, j, k])]);
                }
            }
        }
    }

    fn bucket_of(&self, cell: Cell) -> [i32; 3] {
        [cell.x / self.edge, cell.y / self.edge, cell.z / self.edge]
    }

    fn index(&self, [x, y, z]: [i32; 3]) -> usize {
        ((z * self.counts[1] + y) * self.counts[0] + x) as usize
    }
}

fn square(way: Cell) -> i32 {
    way.x * way.x + way.y * way.y + way.z * way.z
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    /// The rule by definition: all others sorted by distance, ties in order of creation.
    fn literal(centres: &[Cell], connections: usize) -> Vec<(usize, usize)> {
        let mut known = BTreeSet::new();
        let mut pairs = Vec::new();
        for (from, &centre) in centres.iter().enumerate() {
            let mut others: Vec<usize> = (0..centres.len()).filter(|&other| other != from).collect();
            others.sort_by_key(|&other| square(centres[other] - centre));
            for to in others.into_iter().take(connections) {
                if known.insert((from.min(to), from.max(to))) {
                    pairs.push((from, to));
                }
            }
        }
        pairs
    }

    proptest! {
        #[test]
        fn buckets_equal_the_literal_rule(
            places in prop::collection::btree_set((0i32..40, 0i32..9, 0i32..25), 0..60),
            connections in 0usize..8,
        ) {
            let extent = Extent::new([40, 9, 25], 1.0).unwrap();
            let centres: Vec<Cell> = places.into_iter().map(|(x, y, z)| Cell::new(x, y, z)).collect();
            prop_assert_eq!(nearest(extent, &centres, connections), literal(&centres, connections));
        }
    }

    #[test]
    fn mutual_neighbours_share_one_tunnel() {
        let centres = [Cell::new(1, 1, 1), Cell::new(3, 1, 1), Cell::new(9, 1, 1)];
        let extent = Extent::new([11, 3, 3], 1.0).unwrap();
        assert_eq!(nearest(extent, &centres, 1), [(0, 1), (2, 1)]);
        assert_eq!(nearest(extent, &centres, 9), [(0, 1), (0, 2), (1, 2)]);
        assert!(nearest(extent, &centres[..1], 3).is_empty());
    }
}
