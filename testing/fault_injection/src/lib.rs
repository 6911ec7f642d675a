//! Fault injection: one disturbed run per seed, compared with the undisturbed run. [`simulated`]
//! does so with a simulated network, disk and clock, thousands of times a minute.
//!
//! A fault [`plan`] is drawn from a seed. The run is performed over ROS 2 with one process per
//! agent; processes are killed, stopped, started twice and sent invalid messages as the plan says.
//! [`verdict`] compares the recording with that of the same run over the in-memory transport.
//!
//! Invariants: a seed has one plan; no process outlives its run; wall time decides when a fault is
//! injected and when a run counts as hung, and nothing else.

#[cfg(feature = "ros")]
mod fault_run;
#[cfg(feature = "ros")]
mod inject_garbage;
pub mod plan;
#[cfg(feature = "ros")]
mod processes;
#[cfg(feature = "ros")]
mod seeds;
pub mod simulated;
pub mod verdict;
#[cfg(feature = "ros")]
mod watch;

#[cfg(feature = "ros")]
pub use inject_garbage::inject_garbage;
#[cfg(feature = "ros")]
pub use seeds::{FaultsError, Options, Summary, plan_of, run};
