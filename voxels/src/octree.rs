//! Binary trees of OctoMap: a map as an octree of free, occupied and unknown cells.
//!
//! The format is that of OctoMap's `writeBinaryData`: two bytes for each node that has children,
//! two bits for each child, depth first. Cubes that are the same all over are one leaf. A tree is
//! 2^16 cells wide, and its middle is the origin of its coordinates.

use crate::{Cell, Extent, Terrain};

/// Levels of a tree of OctoMap below its root.
pub const DEPTH: u32 = 16;

/// A tree as the bytes that follow the header of a file, or that a message has.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BinaryTree {
    /// The nodes with children.
    pub nodes: Vec<u8>,
    /// Number of nodes and leaves.
    pub count: usize,
    /// Cells of the map along the edge of a cell of the tree: 1, 2, 4 or more.
    pub step: u32,
}

/// The tree of the known cells of a map, whose lowest corner lies at `corner`, in cells of the tree
/// from the origin.
#[must_use]
pub fn binary_tree(extent: Extent, corner: [i32; 3], known: impl Fn(Cell) -> Option<Terrain>) -> BinaryTree {
    tree(extent, corner, 1, &known)
}

/// The finest tree of the known cells of a map with at most `bytes_max` bytes of nodes, the lowest
/// corner of the map at the origin, or else that of a single cell. A coarse cell is occupied if one
/// of its cells is wall, else free if one is free.
#[must_use]
pub fn binary_tree_within(bytes_max: usize, extent: Extent, known: impl Fn(Cell) -> Option<Terrain>) -> BinaryTree {
    let longest = extent.size().into_iter().max().unwrap_or(1);
    let mut step = 1;
    loop {
        let tree = tree(extent, [0; 3], step, &known);
        if tree.nodes.len() <= bytes_max || step >= longest {
            return tree;
        }
        step *= 2;
    }
}

fn tree(extent: Extent, corner: [i32; 3], step: u32, known: &impl Fn(Cell) -> Option<Terrain>) -> BinaryTree {
    let size = extent.size().map(|cells| cells.div_ceil(step) as i32);
    let mut builder = Builder { size, step: step as i32, known, nodes: Vec::new(), count: 1 };
    let middle = -(1 << (DEPTH - 1));
    let [x, y, z] = corner.map(|along| middle - along);
    let root = builder.add(Cell::new(x, y, z), 1 << DEPTH);
    if root != Child::Inner {
        // Nothing is known: OctoMap writes no root then.
        builder.count = 0;
    }
    BinaryTree { nodes: builder.nodes, count: builder.count, step }
}

/// The state of a child of a node, as its two bits.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Child {
    Unknown = 0,
    Free = 1,
    Occupied = 2,
    Inner = 3,
}

struct Builder<'a, F> {
    size: [i32; 3],
    step: i32,
    known: &'a F,
    nodes: Vec<u8>,
    count: usize,
}

impl<F: Fn(Cell) -> Option<Terrain>> Builder<'_, F> {
    /// Adds the cube of cells with this lowest corner, unless all of it is the same.
    fn add(&mut self, corner: Cell, edge: i32) -> Child {
        let low = [corner.x, corner.y, corner.z];
        if (0..3).any(|axis| low[axis] >= self.size[axis] || low[axis] + edge <= 0) {
            return Child::Unknown;
        }
        if edge == 1 {
            return self.leaf(corner);
        }
        let (start, count) = (self.nodes.len(), self.count);
        self.nodes.extend([0; 2]);
        let half = edge / 2;
        let children: [Child; 8] = std::array::from_fn(|number| {
            let up = |axis: usize| if number >> axis & 1 == 1 { half } else { 0 };
            self.add(Cell::new(corner.x + up(0), corner.y + up(1), corner.z + up(2)), half)
        });
        if children[0] != Child::Inner && children.iter().all(|&child| child == children[0]) {
            self.nodes.truncate(start);
            self.count = count;
            return children[0];
        }
        self.count += children.iter().filter(|&&child| child != Child::Unknown).count();
        let bits = children.iter().rev().fold(0u16, |bits, &child| bits << 2 | child as u16);
        self.nodes[start..start + 2].copy_from_slice(&bits.to_le_bytes());
        Child::Inner
    }

    fn leaf(&self, corner: Cell) -> Child {
        let low = [corner.x, corner.y, corner.z].map(|along| along * self.step);
        let mut found = Child::Unknown;
        for z in low[2]..low[2] + self.step {
            for y in low[1]..low[1] + self.step {
                for x in low[0]..low[0] + self.step {
                    match (self.known)(Cell::new(x, y, z)) {
                        Some(Terrain::Wall) => return Child::Occupied,
                        Some(Terrain::Free) => found = Child::Free,
                        None => {}
                    }
                }
            }
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn extent(size: [u32; 3]) -> Extent {
        Extent::new(size, 0.5).unwrap()
    }

    fn within(extent: Extent, cell: Cell, known: Terrain) -> Option<Terrain> {
        extent.contains(cell).then_some(known)
    }

    #[test]
    fn a_cube_of_one_kind_is_a_leaf() {
        let two = extent([2; 3]);
        let tree = binary_tree(two, [0; 3], |cell| within(two, cell, Terrain::Free));
        // From the root down to the cube: 15 nodes, each with one child, and the leaf.
        assert_eq!((tree.nodes.len(), tree.count), (30, 16));
        // The last one has the leaf in its lowest corner.
        assert_eq!(tree.nodes[28..], [1, 0]);
        // The corner at the origin is in the highest child of the root.
        assert_eq!(tree.nodes[..2], [0, 0b1100_0000]);
        assert_eq!(binary_tree(two, [0; 3], |_| None), BinaryTree { nodes: vec![], count: 0, step: 1 });
    }

    #[test]
    fn a_tree_is_coarsened_until_it_fits() {
        let size = extent([16, 16, 4]);
        // A wall in the middle of free space with a hole of a cell.
        let known = |cell: Cell| {
            let kind = if cell.x == 8 && (cell.y, cell.z) != (3, 1) { Terrain::Wall } else { Terrain::Free };
            within(size, cell, kind)
        };
        let whole = binary_tree_within(usize::MAX, size, known);
        assert_eq!((whole.step, &whole), (1, &binary_tree(size, [0; 3], known)));
        let coarse = binary_tree_within(whole.nodes.len() - 1, size, known);
        assert!(coarse.step == 2 && coarse.nodes.len() < whole.nodes.len());
        // The hole is closed: walls count more than free cells.
        let half = extent([8, 8, 2]);
        let closed = |cell: Cell| within(half, cell, if cell.x == 4 { Terrain::Wall } else { Terrain::Free });
        assert_eq!(coarse.nodes, binary_tree(half, [0; 3], closed).nodes);
        assert_eq!(binary_tree_within(3, size, known).step, 16);
    }
}
