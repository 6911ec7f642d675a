//! What goes over the wire: the messages of the ROS 2 package `maes_msgs` as serde structs, and the topics that carry them.
//!
//! | topic | from -> to | type | QoS: reliable, keep last, and |
//! |---|---|---|---|
//! | `/clock` | server -> all | `rosgraph_msgs/Clock` | volatile, depth 10 |
//! | `/sim/scenario` | server -> all | `maes_msgs/Scenario` | transient local, depth 1 |
//! | `/agent_<id>/join` | agent -> server | `maes_msgs/Join` | volatile, depth 16 |
//! | `/sim/join_reply` | server -> all | `maes_msgs/JoinReply` | transient local, depth 256 |
//! | `/agent_<id>/observation` | server -> agent | `maes_msgs/Observation` | volatile, depth 16 |
//! | `/agent_<id>/command` | agent -> server | `maes_msgs/Command` | volatile, depth 16 |
//! | `/tf` (so far in recordings only) | server -> people | `tf2_msgs/TFMessage` | volatile, depth 100 |
//! | `/sim/progress` | server -> people | `maes_msgs/Progress` | transient local, depth 1 |
//! | `/sim/digest` (so far in recordings only) | server -> people | `maes_msgs/Digest` | volatile, depth 10 |
//! | `/sim/intervention` (in recordings only) | server -> people | `maes_msgs/Intervention` | volatile, depth 10 |
//! | `/sim/result` (so far in recordings only) | server -> people | `maes_msgs/Result` | transient local, depth 1 |
//!
//! The folder of this crate is also the interface package itself: `package.xml`, `CMakeLists.txt` and `msg/` build with colcon
//! or ament. The `.msg` files are the source; a test compares the structs with them, and another compares the bytes with those
//! of a real ROS 2.
//!
//! Invariants: no ROS client, no transport and no wall clock in here; names, units and frames of the fields are those of the
//! `.msg` files (SI units, radians, frame `map` unless said otherwise). This crate does not check what a message says.

pub mod ids;
pub mod limits;
pub mod topics;

pub mod maes_msgs;

pub mod builtin_interfaces;
pub mod geometry_msgs;
pub mod rosgraph_msgs;
pub mod simulation_interfaces;
pub mod std_msgs;
pub mod tf2_msgs;

pub mod cdr;
pub mod message;
pub mod parameters;
pub mod schema;
pub mod service;

#[cfg(feature = "ros")]
pub mod ros;
pub mod ros_env;
pub mod seed;
