//! The pure core of a run: a scenario, the true world and its fixed update, the lock-step, the digest, and the messages that
//! carry them.
//!
//! In reading order: [`scenario`] says what a run is; [`world`] is its physics; [`lockstep`] decides which agent is asked when;
//! [`wire`] converts to and from messages; [`digest`] is the proof that two runs are the same;
//! [`views`] makes the standard messages that visualisation tools show, [`twist`] the commands of
//! externally controlled agents, [`parameters`] the ROS parameters of a scenario, [`pace`] the real-time factor.
//!
//! Invariants: no file, no network, no wall clock and no environment. The dependencies of this crate allow none of them, save
//! the standard library, whose use `clippy.toml` restricts.

#![warn(missing_docs)]

pub mod digest;
pub mod lockstep;
pub mod pacer;
pub mod parameters;
pub mod scenario;
pub mod twist;
pub mod visualisation;
pub mod wire;
pub mod world;
