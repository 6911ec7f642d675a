//! What goes over the wire: the messages of the ROS 2 package `maes_msgs`, and those of the
//! packages that come with ROS 2, as serde structs, and the topics that carry them.
//!
//! With them come what both sides compute alike from their fields: signatures, and how a body moves
//! ([`kinematics`]).
//!
//! The list of topics is in [`topics`], and in words in `docs/topics.md` and `docs/ros2.md`.
//!
//! The folder of this crate is also the interface package itself: `package.xml`, `CMakeLists.txt`
//! and `msg/` build with colcon or ament. The `.msg` files are the source; a test compares the
//! structs with them, and another compares the bytes with those of a real ROS 2.
//!
//! Invariants: no ROS client, no transport and no wall clock in here; names, units and frames of
//! the fields are those of the `.msg` files (SI units, radians, frame `map` unless said otherwise).
//! This crate does not check what a message says.

#![warn(missing_docs)]

pub mod ids;
pub mod limits;
pub mod topics;

pub mod maes_msgs;
pub mod relay_id;

pub mod body_model;
pub mod event_mask;
pub mod kinematics;
pub mod message_type;
pub mod scan_request;
pub mod stage;
pub mod type_hash;
pub mod wake_condition;

pub mod builtin_interfaces;
pub mod diagnostic_msgs;
pub mod geometry_msgs;
pub mod nav_msgs;
pub mod octomap_msgs;
pub mod rcl_interfaces;
pub mod rosgraph_msgs;
pub mod sensor_msgs;
pub mod simulation_interfaces;
pub mod std_msgs;
pub mod tf2_msgs;
pub mod visualization_msgs;

pub mod cdr;
mod counter_names;
pub mod message;
pub mod parameters;
pub mod printable;
pub mod schema;
pub mod service;
pub mod shared_bytes;
pub mod signing;
