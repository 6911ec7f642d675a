//! What an agent knows and can do: its map, paths on it, and its exchange with other agents.
//!
//! In reading order: [`observation`] and [`command`] are the inputs and outputs of an agent,
//! [`bodies`] what the bodies of the team can do; [`exploration_map`] is its map, [`path`] searches
//! paths on it, [`abstract_graph`] does so coarsely, [`blind_spot`] is what a body assumes around
//! it, [`navigation`] makes motions of paths, [`sharing`] exchanges maps with other agents;
//! [`map_markers`] visualises a map.
//!
//! ```
//! use agent::exploration_map::ExplorationMap;
//! use voxels::{Cell, Extent};
//!
//! let extent = Extent::new([3, 1, 1], 1.0)?;
//! let mut map = ExplorationMap::new(extent);
//! map.note_free(&[0, 1]);
//! assert!(map.state(Cell::new(1, 0, 0)).is_free());
//! assert!(map.is_frontier(Cell::new(1, 0, 0)));
//! # Ok::<(), voxels::ExtentError>(())
//! ```
//!
//! This crate decides nothing, and knows no message of ROS, no transport and no clock.

#![warn(missing_docs)]

pub mod abstract_graph;
pub mod blind_spot;
pub mod bodies;
pub mod exploration_map;
pub mod map_markers;
pub mod navigation;
pub mod path;
pub mod sharing;
/// Drawn maps for tests: a module without a feature of its own, so that the workspace and its
/// programs build one and the same crate.
#[doc(hidden)]
pub mod testing;

pub use protocol::{command, observation};
