//! The world server: it owns the true world and the clock of a run.
//!
//! In reading order: [`setup`] makes the world of a scenario, and [`session`] executes its run over
//! a [`transport`], `ros` over ROS 2; [`verify`] re-executes a [`recording`]; `program` is the
//! process of all this. The pure core is in the crate `simulation`, and `foxglove_server` serves
//! observers.
//!
//! This crate does not know what agents believe or how they decide.

pub mod cli;
pub mod cmu_metrics;
pub mod exit;
pub mod info;
pub mod map_file;
pub mod profile;
#[cfg(feature = "ros")]
pub mod program;
#[cfg(feature = "view")]
pub mod requested_run;
#[cfg(feature = "ros")]
pub mod ros;
pub mod session;
pub mod setup;
pub mod terminal;
pub mod verify;
