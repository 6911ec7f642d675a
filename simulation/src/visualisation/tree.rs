//! Maps as trees of OctoMap.

use msgs::ids::Tick;
use msgs::octomap_msgs::Octomap;
use protocol::limits::{MESSAGE_BYTES_BARE, VIEW_BYTES_MAX};
use voxels::octree::binary_tree_within;
use voxels::{Cell, Extent, Terrain};

use crate::wire::header;

/// Most bytes of the nodes of a tree. A larger one has longer cells.
const NODES_BYTES_MAX: usize = VIEW_BYTES_MAX - MESSAGE_BYTES_BARE;

/// The known cells of a map (frame `map`), whose lowest corner is at the origin. Cells are as long
/// as those of the map, or 2, 4, 8 times as long if the tree is too large for a message.
pub(super) fn octomap(extent: Extent, tick: Tick, known: impl Fn(Cell) -> Option<Terrain>) -> Octomap {
    let tree = binary_tree_within(NODES_BYTES_MAX, extent, known);
    Octomap {
        header: header(tick),
        binary: true,
        id: Octomap::OC_TREE.to_owned(),
        resolution: extent.cell_m() * f64::from(tree.step),
        data: tree.nodes.into_iter().map(u8::cast_signed).collect(),
    }
}

#[cfg(test)]
mod tests {
    use voxels::Grid;

    use super::super::known::whole;
    use super::*;

    #[test]
    fn trees_fit_into_a_sample() {
        // Every other cell is wall: nothing of it is alike.
        let extent = Extent::new([64, 64, 64], 0.25).unwrap();
        let kind = |cell: Cell| if (cell.x + cell.y + cell.z) % 2 == 0 { Terrain::Wall } else { Terrain::Free };
        let terrain = Grid::from_vec(extent, extent.cells().map(kind).collect()).unwrap();
        let tree = octomap(extent, Tick(3), whole(&terrain));
        assert_eq!((tree.resolution, tree.binary, tree.id.as_str()), (0.5, true, "OcTree"));
        assert!(msgs::cdr::encode(&tree).len() <= VIEW_BYTES_MAX);
        // All of it is wall then: a cube in the highest corner of the root.
        assert!(tree.data.len() < 40, "{}", tree.data.len());
    }
}
