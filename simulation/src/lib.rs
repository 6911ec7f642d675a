//! The pure core of a run: scenario, digest and the conversion to messages.
//!
//! In reading order: [`scenario`] defines a run; the crate [`world`] is its physics; [`wire`] makes
//! messages of both; [`digest`] proves that two runs are equal; [`end_reason`] says why a run has
//! ended; [`visualisation`] makes the standard messages of visualisation tools, [`twist`] the
//! commands of externally controlled agents, and [`parameters`] the ROS parameters of a scenario.
//! Which agent is due, and when the replies of a tick are complete, decides [`protocol::lockstep`].
//!
//! Invariants: no file, no network, no wall clock and no environment. No dependency provides them,
//! and `tests/tidy.rs` finds whoever names those of the standard library.

#![warn(missing_docs)]

pub mod digest;
pub mod end_reason;
pub mod parameters;
pub mod scenario;
pub mod twist;
pub mod visualisation;
pub mod wire;
