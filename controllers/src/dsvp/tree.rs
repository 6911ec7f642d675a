//! The local tree of DSVP: a rapidly-exploring random tree (RRT) inside the planning horizon, whose
//! nodes are viewpoints.
//!
//! Source: H. Zhu, C. Cao, Y. Xia, S. Scherer, J. Zhang, W. Wang, "DSVP: Dual-Stage Viewpoint
//! Planner for Rapid Exploration by Dynamic Expansion", IROS 2021: dynamic expansion (III-B: the
//! last tree is pruned, re-rooted and grown on) and the gains of nodes and branches, here in three
//! dimensions.
//!
//! Invariants: every node is the place of a cell within the horizon (a cube about the root); every
//! edge, once the tree is re-rooted on the present map, is a straight leg on which the body touches
//! only cells known to be free, level for a ground body; no two nodes share a cell.

use nalgebra::{Point3, Vector3};
use rand::{Rng, RngExt};
use voxels::{Cell, Extent};

use super::gain::GainEstimator;
use super::obstacles::Obstacles;
use agent::exploration_map::ExplorationMap;
use agent::path::{Graph, direct};

/// Parameters of growth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Growth {
    /// Half the side of the cube that contains the tree, cells.
    pub(crate) horizon: i32,
    /// Greatest length of an edge, cells.
    pub(crate) extension: f64,
    /// Number of samples.
    pub(crate) samples: u32,
    /// Share of the samples near the chosen local frontiers.
    pub(crate) bias: f64,
    /// Greatest distance of such samples from their frontier along each axis, cells.
    pub(crate) jitter: i32,
}

/// Parameters of the branch gain.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Valuation {
    /// Discount per metre of path to a node.
    pub(crate) lambda_distance: f64,
    /// Discount per metre of DTW distance between a branch and the last direction.
    pub(crate) lambda_direction: f64,
    /// Viewpoints with a gain below this count as having none.
    pub(crate) gain_min: u32,
}

#[derive(Debug, Clone, PartialEq)]
struct Node {
    cell: Cell,
    parent: usize,
    /// Path length from the root, cells.
    length: f64,
}

/// A branch with a gain.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Branch {
    /// From the root to the end of the branch.
    pub(crate) cells: Vec<Cell>,
    /// The gain of the end of the branch.
    pub(crate) gain: u32,
}

/// The tree. Node 0 is its root and its own parent; every other node follows its parent.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Tree {
    nodes: Vec<Node>,
    /// Revisions of the map when all edges were last looked at: free cells stay free without one.
    revisions: u64,
}

impl Tree {
    /// The tree that is only a root.
    pub(crate) fn new(root: Cell) -> Self {
        Self { nodes: vec![Node { cell: root, parent: 0, length: 0.0 }], revisions: 0 }
    }

    /// The tree re-rooted at a new cell: the component within the horizon that is connected to it
    /// by edges that are still clear, if a node within two edge lengths can be reached on a
    /// straight leg; else the root alone.
    pub(crate) fn rerooted_at(&self, root: Cell, graph: Graph<'_>, growth: &Growth) -> Self {
        let (map, moves) = (graph.map(), graph.moves());
        let place_of = |cell| moves.lattice().place(map.extent(), cell);
        let place = place_of(root);
        let mut near: Vec<(f64, usize)> = (0..self.nodes.len())
            .map(|node| (self.nodes[node].cell.distance(root), node))
            .filter(|&(length, _)| length <= 2.0 * growth.extension)
            .collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let link = near.into_iter().find(|&(_, node)| direct(map, &place, self.nodes[node].cell, moves));
        let mut moved = Self { revisions: map.revisions(), ..Self::new(root) };
        let is_clear =
            |from: Cell, to: Cell| self.revisions == map.revisions() || direct(map, &place_of(from), to, moves);
        let Some((length, link)) = link else {
            return moved;
        };
        let mut beside: Vec<Vec<usize>> = vec![Vec::new(); self.nodes.len()];
        for (node, Node { parent, .. }) in self.nodes.iter().enumerate().skip(1) {
            beside[*parent].push(node);
            beside[node].push(*parent);
        }
        // Nodes with the new number of their parent.
        let mut next = std::collections::VecDeque::new();
        let mut is_taken = vec![false; self.nodes.len()];
        is_taken[link] = true;
        if length == 0.0 {
            next.extend(beside[link].iter().map(|&node| (node, 0)));
        } else {
            next.push_back((link, 0));
        }
        while let Some((node, parent)) = next.pop_front() {
            is_taken[node] = true;
            let cell = self.nodes[node].cell;
            let is_kept = cell.is_within(root, growth.horizon) && cell != root;
            if !is_kept || !is_clear(moved.nodes[parent].cell, cell) {
                continue;
            }
            let number = moved.add(cell, parent);
            next.extend(beside[node].iter().filter(|&&node| !is_taken[node]).map(|&node| (node, number)));
        }
        moved
    }

    fn root(&self) -> Cell {
        self.nodes[0].cell
    }

    /// Adds a node, and returns its number.
    fn add(&mut self, cell: Cell, parent: usize) -> usize {
        let length = self.nodes[parent].length + self.nodes[parent].cell.distance(cell);
        self.nodes.push(Node { cell, parent, length });
        self.nodes.len() - 1
    }

    /// Grows the tree by random samples, some of them near `frontiers`, with clearance to other
    /// bodies.
    pub(crate) fn grow(
        &mut self,
        graph: Graph<'_>,
        growth: &Growth,
        frontiers: &[Cell],
        obstacles: &Obstacles,
        rng: &mut impl Rng,
    ) {
        let root = self.root();
        let (map, moves) = (graph.map(), graph.moves());
        let (extent, lattice) = (map.extent(), moves.lattice());
        for _ in 0..growth.samples {
            let (about, by) = if !frontiers.is_empty() && rng.random_bool(growth.bias) {
                (frontiers[rng.random_range(0..frontiers.len())], growth.jitter)
            } else {
                (root, growth.horizon)
            };
            let mut along = |about: i32| about + rng.random_range(-by..=by);
            let sample = Cell::new(along(about.x), along(about.y), along(about.z));
            let nearest = self.nearest(sample);
            let from = self.nodes[nearest].cell;
            let sample = if moves.are_on_ground() { Cell { z: from.z, ..sample } } else { sample };
            let cell = towards(from, sample, growth.extension, &extent);
            let is_new = cell != from && cell.is_within(root, growth.horizon) && !self.holds(cell);
            let is_open = || {
                let from = lattice.place(extent, from);
                !obstacles.block(&from, &lattice.place(extent, cell)) && direct(map, &from, cell, moves)
            };
            if is_new && is_open() {
                self.add(cell, nearest);
            }
        }
    }

    fn nearest(&self, sample: Cell) -> usize {
        let nodes = self.nodes.iter().enumerate();
        nodes.min_by_key(|(_, node)| node.cell.distance_squared(sample)).map_or(0, |(number, _)| number)
    }

    fn holds(&self, cell: Cell) -> bool {
        self.nodes.iter().any(|node| node.cell == cell)
    }

    /// The branch with the highest gain, if one has a gain; of equal ones the oldest.
    /// `utility_factor` multiplies the gain of a viewpoint, given its path length in metres.
    pub(crate) fn best(
        &self,
        map: &ExplorationMap,
        gain_estimator: &mut GainEstimator,
        valuation: &Valuation,
        direction: Option<Vector3<f64>>,
        utility_factor: &dyn Fn(Cell, f64) -> f64,
    ) -> Option<Branch> {
        let cell_m = map.extent().cell_m();
        let mut gains = vec![0; self.nodes.len()];
        let mut sums = vec![0.0; self.nodes.len()];
        let mut best: Option<(f64, usize)> = None;
        for (number, node) in self.nodes.iter().enumerate().skip(1) {
            let gain = gain_estimator.gain(map, node.cell);
            gains[number] = gain;
            let counts = if gain < valuation.gain_min {
                0.0
            } else {
                f64::from(gain) * utility_factor(node.cell, node.length * cell_m)
            };
            let exponent = -valuation.lambda_distance * node.length * cell_m;
            sums[number] = sums[node.parent] + counts * libm::exp(exponent);
            if counts == 0.0 {
                continue;
            }
            let value = match direction {
                Some(direction) if valuation.lambda_direction > 0.0 => {
                    let apart_m = super::dtw::difference(&self.path_points(number), direction) * cell_m;
                    sums[number] * libm::exp(-valuation.lambda_direction * apart_m)
                }
                _ => sums[number],
            };
            if best.is_none_or(|(most, _)| value > most) {
                best = Some((value, number));
            }
        }
        let (_, end) = best?;
        Some(Branch { cells: self.path_to(end), gain: gains[end] })
    }

    /// The cells from the root to a node.
    fn path_to(&self, end: usize) -> Vec<Cell> {
        let mut cells = vec![self.nodes[end].cell];
        let mut node = end;
        while node != 0 {
            node = self.nodes[node].parent;
            cells.push(self.nodes[node].cell);
        }
        cells.reverse();
        cells
    }

    /// The path to a node relative to the root, in cells, without the root.
    fn path_points(&self, end: usize) -> Vec<Vector3<f64>> {
        let root = self.root();
        self.path_to(end).into_iter().skip(1).map(|cell| vector(cell - root)).collect()
    }
}

pub(crate) fn vector(by: Cell) -> Vector3<f64> {
    Vector3::new(f64::from(by.x), f64::from(by.y), f64::from(by.z))
}

/// The cell at most `length` cells from one cell towards another.
fn towards(from: Cell, to: Cell, length: f64, extent: &Extent) -> Cell {
    let whole = from.distance(to);
    if whole <= length {
        return to;
    }
    let centre: Point3<f64> = extent.centre(from);
    extent.cell_of(&(centre + vector(to - from) * (length / whole * extent.cell_m())))
}

#[cfg(test)]
mod tests;
