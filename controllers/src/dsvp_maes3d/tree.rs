//! Trees of points, and nearest-neighbour search among many points.
//!
//! Lengths are in cells: the edge of a cell is 1.

use std::collections::BTreeMap;

use nalgebra::Point3;

/// Marks the absence of a node.
const NONE: u32 = u32::MAX;

#[derive(Debug, Clone, Copy, PartialEq)]
struct Node {
    at: Point3<f64>,
    parent: u32,
}

/// A tree, as the list of its nodes in insertion order. The list can also hold nodes that were cut
/// off from the root.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Tree {
    nodes: Vec<Node>,
    root: u32,
}

impl Tree {
    pub(super) fn new(root: Point3<f64>) -> Self {
        Self { nodes: vec![Node { at: root, parent: NONE }], root: 0 }
    }

    #[cfg(test)]
    pub(super) fn len(&self) -> usize {
        self.nodes.len()
    }

    pub(super) fn root(&self) -> u32 {
        self.root
    }

    pub(super) fn at(&self, node: u32) -> Point3<f64> {
        self.nodes[node as usize].at
    }

    /// Adds a node below a parent.
    pub(super) fn add(&mut self, at: Point3<f64>, parent: u32) -> u32 {
        self.nodes.push(Node { at, parent });
        self.nodes.len() as u32 - 1
    }

    /// Makes a node connected to the root the new root.
    pub(super) fn reroot(&mut self, root: u32) {
        let (mut above, mut node) = (NONE, root);
        while node != NONE {
            let below = std::mem::replace(&mut self.nodes[node as usize].parent, above);
            (above, node) = (node, below);
        }
        self.root = root;
    }

    /// Removes nodes outside a cube around the root from the list, in the reference's way:
    /// iterating from the front, it skips the node after each removed one. The descendants of a
    /// removed node stay on the list, cut off from the root.
    pub(super) fn prune(&mut self, half_side: f64) {
        let centre = self.at(self.root);
        let mut is_taken_off = false;
        let mut left = 0;
        let mut renumbered = Vec::with_capacity(self.nodes.len());
        for node in &self.nodes {
            let is_outside = (node.at - centre).iter().any(|along| along.abs() > half_side);
            is_taken_off = is_outside && !is_taken_off;
            renumbered.push(if is_taken_off { NONE } else { left });
            left += u32::from(!is_taken_off);
        }
        let mut numbers = renumbered.iter();
        self.nodes.retain(|_| numbers.next() != Some(&NONE));
        for node in &mut self.nodes {
            node.parent = renumbered.get(node.parent as usize).copied().unwrap_or(NONE);
        }
        self.root = renumbered[self.root as usize];
    }

    /// The nodes connected to the root in post-order: each after its children, children in list
    /// order.
    pub(super) fn post_order(&self) -> Vec<u32> {
        let parents = || self.nodes.iter().map(|node| node.parent as usize);
        // Start of each node's children in a list of all children.
        let mut begin = vec![0; self.nodes.len() + 1];
        for parent in parents().filter(|&parent| parent < self.nodes.len()) {
            begin[parent + 1] += 1;
        }
        for node in 0..self.nodes.len() {
            begin[node + 1] += begin[node];
        }
        let mut children = vec![0; begin[self.nodes.len()]];
        let mut end = begin.clone();
        for (node, parent) in (0..).zip(parents()).filter(|&(_, parent)| parent < self.nodes.len()) {
            children[end[parent]] = node;
            end[parent] += 1;
        }
        let mut order = Vec::new();
        let mut open = vec![self.root];
        while let Some(node) = open.pop() {
            order.push(node);
            open.extend(&children[begin[node as usize]..begin[node as usize + 1]]);
        }
        order.reverse();
        order
    }

    /// The end of the branch with the highest gain, except the root; of equal ones the first in
    /// post-order. The gain of a branch is the sum of the gains of its nodes from the root on, each
    /// discounted by its depth, plus that of its end a second time.
    pub(super) fn best_branch(&self, mut gain: impl FnMut(Point3<f64>) -> f64) -> Option<u32> {
        let order = self.post_order();
        let mut discounts = Discounts::default();
        // Depth, own discounted gain, and sum from the root on.
        let mut branches = vec![(0, 0.0, 0.0); self.nodes.len()];
        for &node in order.iter().rev() {
            let Node { at, parent } = self.nodes[node as usize];
            // The children of the root have depth 0.
            let (depth, so_far) = branches.get(parent as usize).map_or((-1, 0.0), |above| (above.0 + 1, above.2));
            let own = gain(at) * discounts.at(depth);
            branches[node as usize] = (depth, own, so_far + own);
        }
        let mut best = None;
        for &node in order.iter().filter(|&&node| node != self.root) {
            let (_, own, sum) = branches[node as usize];
            if best.is_none_or(|(most, _)| own + sum > most) {
                best = Some((own + sum, node));
            }
        }
        best.map(|(_, node)| node)
    }
}

/// Discount of a gain per edge from the root; the reference's value.
const DISCOUNT: f64 = 0.01;

/// The discounts by depth, from -1 on.
#[derive(Default)]
struct Discounts(Vec<f64>);

impl Discounts {
    fn at(&mut self, depth: i32) -> f64 {
        let place = (depth + 1) as usize;
        while self.0.len() <= place {
            self.0.push(libm::exp(-DISCOUNT * (self.0.len() as f64 - 1.0)));
        }
        self.0[place]
    }
}

/// A bucket index of numbered points, for the same nearest neighbours that a linear search finds.
/// Buckets are cells.
#[derive(Debug, Clone, Default)]
pub(super) struct Index {
    buckets: BTreeMap<[i32; 3], Vec<(Point3<f64>, u32)>>,
    /// The lowest and the highest bucket along each axis.
    bounds: Option<[[i32; 3]; 2]>,
}

impl Index {
    /// All nodes connected to the root of a tree.
    pub(super) fn of(tree: &Tree) -> Self {
        let mut index = Self::default();
        for node in tree.post_order() {
            index.insert(tree.at(node), node);
        }
        index
    }

    pub(super) fn insert(&mut self, at: Point3<f64>, number: u32) {
        let key = bucket_of(at);
        self.buckets.entry(key).or_default().push((at, number));
        let [low, high] = self.bounds.get_or_insert([key; 2]);
        for axis in 0..3 {
            (low[axis], high[axis]) = (low[axis].min(key[axis]), high[axis].max(key[axis]));
        }
    }

    /// The number of the nearest point; of equally near ones the lowest. `None` if there are no
    /// points.
    pub(super) fn nearest(&self, to: Point3<f64>) -> Option<u32> {
        let [lowest, highest] = self.bounds?;
        let mut best = (f64::INFINITY, NONE);
        let mut reach = 1.0;
        loop {
            // All points within this distance along each axis.
            let (low, high) = (bucket_of(to.map(|along| along - reach)), bucket_of(to.map(|along| along + reach)));
            let along = |axis: usize| low[axis].max(lowest[axis])..=high[axis].min(highest[axis]);
            let length = |axis: usize| (i64::from(*along(axis).end()) - i64::from(*along(axis).start()) + 1).max(0);
            // Points far apart: more columns than buckets.
            let is_wide = length(0).saturating_mul(length(1)) > self.buckets.len() as i64;
            if is_wide || !f64::is_finite(reach) {
                take_nearest(self.buckets.values(), to, &mut best);
                break;
            }
            let column = along(2);
            if !column.is_empty() {
                for (x, y) in along(0).flat_map(|x| along(1).map(move |y| (x, y))) {
                    let column = self.buckets.range([x, y, *column.start()]..=[x, y, *column.end()]);
                    take_nearest(column.map(|(_, bucket)| bucket), to, &mut best);
                }
            }
            let holds_all = (0..3).all(|axis| low[axis] <= lowest[axis] && high[axis] >= highest[axis]);
            if holds_all || best.0 <= reach * reach {
                break;
            }
            reach *= 2.0;
        }
        Some(best.1).filter(|&number| number != NONE)
    }
}

fn take_nearest<'b>(
    buckets: impl Iterator<Item = &'b Vec<(Point3<f64>, u32)>>,
    to: Point3<f64>,
    best: &mut (f64, u32),
) {
    for &(at, number) in buckets.flatten() {
        let distance_squared = (at - to).norm_squared();
        if (distance_squared, number) < *best {
            *best = (distance_squared, number);
        }
    }
}

fn bucket_of(at: Point3<f64>) -> [i32; 3] {
    [at.x, at.y, at.z].map(|along| along.floor() as i32)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn at(x: f64) -> Point3<f64> {
        Point3::new(x, 0.0, 0.0)
    }

    #[test]
    fn post_order_is_children_first_in_the_order_of_the_list() {
        let mut tree = Tree::new(at(0.0));
        let a = tree.add(at(1.0), 0);
        let b = tree.add(at(2.0), 0);
        let c = tree.add(at(3.0), a);
        let d = tree.add(at(4.0), a);
        assert_eq!(tree.post_order(), [c, d, a, b, 0]);
        tree.reroot(a);
        assert_eq!(tree.post_order(), [b, 0, c, d, a]);
        assert_eq!(tree.root(), a);
    }

    #[test]
    fn pruning_skips_the_next_node_and_disconnects_descendants() {
        // A chain that leaves the cube and re-enters it with its last node.
        let mut tree = Tree::new(at(0.0));
        let inside = tree.add(at(14.0), 0);
        let outside = tree.add(at(16.0), inside);
        let skipped = tree.add(at(17.0), inside);
        let below = tree.add(at(18.0), outside);
        tree.add(at(15.0), below);
        assert_eq!(skipped, 3);
        tree.prune(15.0);
        // 16 and 18 are removed; 17 was skipped; 15 stays on the list, disconnected.
        let listed: Vec<f64> = tree.nodes.iter().map(|node| node.at.x).collect();
        assert_eq!(listed, [0.0, 14.0, 17.0, 15.0]);
        let found: Vec<f64> = tree.post_order().into_iter().map(|node| tree.at(node).x).collect();
        assert_eq!(found, [17.0, 14.0, 0.0]);
        assert_eq!(Index::of(&tree).nearest(at(15.0)), Some(1), "14, for 15 cannot be found any more");
    }

    #[test]
    fn end_of_a_branch_counts_twice_and_depth_discounts() {
        let gain_of = |tree: &Tree, gains: &[f64]| {
            let gains = gains.to_vec();
            tree.best_branch(move |at| gains[at.x as usize])
        };
        let mut tree = Tree::new(at(0.0));
        assert_eq!(gain_of(&tree, &[5.0]), None, "the root is no destination");
        let a = tree.add(at(1.0), 0);
        let b = tree.add(at(2.0), a);
        let c = tree.add(at(3.0), 0);
        // Once: 10 + 6 against 15. Twice: 10 + 12 against 30.
        assert_eq!(gain_of(&tree, &[0.0, 10.0, 6.0, 15.0]), Some(c));
        // Without a discount it would be a tie, which b wins as the first in post-order.
        assert_eq!(gain_of(&tree, &[0.0, 8.0, 4.0, 8.0]), Some(a));
        assert_eq!(gain_of(&tree, &[0.0, 0.0, 8.0, 8.0]), Some(c));
        assert_eq!(gain_of(&tree, &[0.0, 0.0, 0.0, 0.0]), Some(b), "all alike: the first in post-order");
        // The root has depth -1: its gain counts in all branches alike, so it changes nothing.
        assert_eq!(gain_of(&tree, &[1000.0, 0.0, 8.0, 8.0]), Some(c));
        assert_eq!(gain_of(&tree, &[0.0, -1.0, -1.0, -2.0]), Some(a), "less than nothing is no hindrance");
    }

    proptest! {
        #[test]
        fn index_agrees_with_linear_search(
            places in proptest::collection::vec([-9i32..9, -9..9, -9..9], 0..60),
            to in [-200i32..200, -20..20, -20..20],
            stretch in 0i32..9,
        ) {
            // A coarse raster, so that distances tie; also far beyond any map.
            let spacing = 1.5 * 10.0_f64.powi(stretch);
            let place = |[x, y, z]: [i32; 3]| Point3::new(f64::from(x), f64::from(y), f64::from(z)) * spacing;
            let mut index = Index::default();
            for (number, &at) in (0..).zip(&places) {
                index.insert(place(at), number);
            }
            let far = |number: &usize| (place(places[*number]) - place(to)).norm_squared();
            let expected = (0..places.len()).min_by(|a, b| far(a).total_cmp(&far(b)));
            prop_assert_eq!(index.nearest(place(to)).map(|number| number as usize), expected);
        }
    }
}
