//! The package `octomap_msgs`: maps of space as trees of OctoMap.

include!(concat!(env!("OUT_DIR"), "/octomap_msgs.rs"));

impl Octomap {
    /// The type of a tree of occupancies.
    pub const OC_TREE: &str = "OcTree";
}
