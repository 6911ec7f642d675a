//! The package `octomap_msgs`: maps of space as trees of OctoMap.

use serde::{Deserialize, Serialize};

use crate::std_msgs::Header;

/// A map of space, as a tree of OctoMap without the header of a file.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Octomap {
    /// Sim time, and the frame of the map.
    pub header: Header,
    /// Whether cells are only free or occupied, two bits for each.
    pub binary: bool,
    /// The type of the tree.
    pub id: String,
    /// Length of a cell, m.
    pub resolution: f64,
    /// The nodes, as OctoMap's `writeBinaryData` writes them.
    pub data: Vec<i8>,
}

impl Octomap {
    /// The type of a tree of occupancies.
    pub const OC_TREE: &str = "OcTree";
}
