//! The process of an agent: its control loop, over a transport.
//!
//! In reading order: [`control_loop`] merges observations into the map of an agent, calls its
//! controller and replies; [`host`] runs the agents of a process over a [`transport`]; `ros` is the
//! transport over ROS 2, `pipe` that of programs which a run in memory starts; [`program`] is the
//! whole program
//! `agent_node`. What an agent knows is in the crate `agent`, what it decides in `controllers`.
//!
//! A program elsewhere that depends on this crate registers controllers of its own and is an
//! `agent_node` with them: its `main` is [`program::main`]. What their interface is made of is
//! exported, so that it needs no other dependency.
//!
//! This crate has no access to the true world: an agent knows only what it has sensed and received.

#![warn(missing_docs)]

pub mod cli;
pub mod control_loop;
pub mod host;
pub mod parameters;
#[cfg(unix)]
pub mod pipe;
pub mod program;
#[cfg(feature = "ros")]
pub mod ros;
pub mod transport;

pub use agent::{
    abstract_graph, bodies, command, exploration_map, map_markers, navigation, observation, path, sharing,
};
pub use controllers::{self, stopwatch};
pub use msgs;
pub use nalgebra;
pub use protocol;
pub use rand;
pub use rand_chacha;
pub use voxels;
