//! The world server: it owns the true world and the clock of a run.
//!
//! In reading order: [`setup`] makes the world of a scenario, and [`session`] executes its run over
//! a [`transport`], `ros` over ROS 2; [`control`] answers requests of `simulation_interfaces`;
//! [`recorder`] and [`live_stream`] write what a run exchanges; [`recording`] reads it,
//! [`playback`] by tick and [`replay`] by time; [`verify`] re-executes a recording and
//! [`comparison`] finds the first difference; `foxglove` serves observers; `program` is the process
//! of all this. The pure core is in the crate `simulation`.
//!
//! This crate does not know what agents believe or how they decide.

pub mod bag;
pub mod cli;
pub mod cmu_metrics;
pub mod comparison;
pub mod control;
pub mod difference;
pub mod exit;
#[cfg(feature = "view")]
pub mod foxglove;
pub mod info;
pub mod live_stream;
pub mod map_file;
pub mod playback;
pub mod profile;
#[cfg(feature = "ros")]
pub mod program;
pub mod recorder;
pub mod recording;
pub mod renamed;
pub mod replay;
#[cfg(feature = "ros")]
pub mod ros;
pub mod session;
pub mod setup;
pub mod terminal;
pub mod transport;
pub mod verify;
pub mod wall_clock;

pub use system::{input_file, os};
