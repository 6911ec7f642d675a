//! The world server: owns the true world and the clock of a run.
//!
//! In reading order: [`session`] executes a run over a [`transport`], which ROS 2 (`ros`) and the in-memory transport
//! implement; [`control`] is the state machine of control requests; [`recorder`] and [`journal`] write recordings,
//! [`recording`] and [`playback`] read them; [`verify`] re-executes one and [`comparison`] finds the first difference;
//! [`replay`] schedules its messages for publication; [`setup`] builds worlds from files.
//!
//! This crate knows nothing of what agents believe or how they decide.

pub mod bag;
pub mod cli;
pub mod comparison;
pub mod control;
pub mod difference;
pub mod exit;
pub mod info;
pub mod journal;
pub mod map_cli;
pub mod playback;
pub mod recorder;
pub mod recording;
pub mod replay;
#[cfg(feature = "ros")]
pub mod ros;
pub mod session;
pub mod setup;
pub mod terminal;
pub mod transport;
pub mod verify;
#[cfg(feature = "view")]
pub mod viewing;
pub mod wall_clock;
