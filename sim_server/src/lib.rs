//! The world server: owns the true world and the clock of a run.
//!
//! In reading order: [`scenario`] says what a run is; [`mapgen`] makes its terrain and [`world`] its physics; [`lockstep`] says
//! who is asked when; [`run`] puts them together over a [`link`]; [`wire`] translates to messages, [`recorder`] and [`digest`]
//! keep them; [`recording`] reads them again, [`playback`] says what was said when, and [`replay`] when each message is due;
//! [`comparison`] is what two of them do not have in common, and [`verify`] whether one is what comes of it; [`views`] are what
//! people look at; `ros` is the link over ROS 2.
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
pub mod link;
pub mod playback;
pub mod recorder;
pub mod recording;
pub mod renamed;
pub mod replay;
#[cfg(feature = "ros")]
pub mod ros;
pub mod run;
pub mod setup;
pub mod summary;
pub mod terminal;
pub mod verify;
#[cfg(feature = "view")]
pub mod viewing;
