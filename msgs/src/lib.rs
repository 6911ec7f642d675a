//! What goes over the wire: the messages of the ROS 2 package `maes_msgs`, and those of the
//! packages that come with ROS 2, as serde structs, and the topics that carry them.
//!
//! The list of topics is in [`topics`], and in words in `docs/topics.md` and `docs/ros2.md`.
//!
//! The folder of this crate is also the interface package itself: `package.xml`, `CMakeLists.txt`
//! and `msg/` build with colcon or ament. The build script makes the structs of the `.msg` files;
//! a test compares the bytes with those of a real ROS 2.
//!
//! Invariants: no ROS client, no transport and no wall clock in here; names, units and frames of
//! the fields are those of the `.msg` files (SI units, radians, frame `map` unless said otherwise).
//! This crate does not check what a message says.

#![warn(missing_docs)]

pub mod ids;
pub mod topics;

pub mod maes_msgs;

pub mod type_hash;

pub mod builtin_interfaces;
pub mod geometry_msgs;
pub mod nav_msgs;
pub mod octomap_msgs;
pub mod rcl_interfaces;
pub mod simulation_interfaces;
pub mod visualization_msgs;

macro_rules! packages {
    ($($package:ident)*) => { $(
        #[doc = concat!("The package `", stringify!($package), "`.")]
        pub mod $package {
            include!(concat!(env!("OUT_DIR"), "/", stringify!($package), ".rs"));
        }
    )* };
}

packages! {
    action_msgs diagnostic_msgs rosgraph_msgs sensor_msgs service_msgs std_msgs tf2_msgs unique_identifier_msgs
}

pub mod cdr;
pub mod counters;
mod definition;
pub mod message;
pub mod parameters;
pub mod printable;
pub mod schema;
pub mod sensor_name;
pub mod service;
pub mod shared_bytes;
