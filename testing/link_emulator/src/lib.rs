//! Network namespaces as hosts of one machine, and an emulated link between them.
//!
//! A [`Network`] makes a namespace for each host, with one network device, and forwards Ethernet
//! frames between the devices as a switch does: with a delay, losses, reordering and an outage, as
//! its [`Link`] says. It does in user space what `tc netem` does in the kernel, because not every
//! kernel has `sch_netem`, and so that an outage can begin after a number of frames instead of at
//! a time: a test then has it in every run, however fast the machine is.
//!
//! Invariants: no frame leaves the namespaces; the namespaces and devices end with the network; the
//! draws of losses and delays are those of the seed. What traffic there is depends on the time, so
//! two networks with the same seed do not lose the same frames.
//!
//! What it does not do: limit the bandwidth.

mod device;
mod network;
mod switch;

pub use network::{Network, NetworkError};
pub use switch::{Counts, Link, Outage};
