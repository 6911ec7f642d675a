//! An agent: its map, its controllers, and its process.
//!
//! In reading order: [`observation`] and [`command`] are its inputs and outputs, [`bodies`] what
//! the bodies of the team can do; [`exploration_map`] is its map, [`path`] searches paths on it,
//! [`abstract_graph`] does so coarsely, [`navigation`] makes motions of paths, [`sharing`]
//! exchanges maps with other agents; [`controllers`] decide; [`agent`] combines all of these;
//! [`host`] runs the agents of a process over a [`transport`]; [`wire`] converts messages;
//! [`map_markers`] visualises a map; `ros` is the transport over ROS 2; [`program`] is the whole
//! program `agent_node`.
//!
//! A program elsewhere that depends on this crate registers controllers of its own and is an
//! `agent_node` with them: its `main` is [`program::main`]. What their interface is made of is
//! exported, so that it needs no other dependency.
//!
//! This crate has no access to the true world: an agent knows only what it has sensed and received.

#![warn(missing_docs)]

pub mod agent;

pub mod abstract_graph;
pub mod bodies;
pub mod cli;
pub mod command;
pub mod controllers;
pub mod exploration_map;
pub mod host;
pub mod map_markers;
pub mod navigation;
pub mod observation;
pub mod parameters;
pub mod path;
pub mod program;
#[cfg(feature = "ros")]
pub mod ros;
pub mod sharing;
pub mod stopwatch;
pub mod transport;
pub mod wire;

pub use msgs;
pub use nalgebra;
pub use rand;
pub use rand_chacha;
pub use voxels;
