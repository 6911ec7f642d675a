//! The package `rosgraph_msgs`: the simulated clock.

use serde::{Deserialize, Serialize};

use crate::builtin_interfaces::Time;

/// What the clock of the simulation shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Clock {
    /// Sim time.
    pub clock: Time,
}
