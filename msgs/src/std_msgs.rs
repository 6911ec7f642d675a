//! The package `std_msgs`: the header that stamped messages begin with.

use serde::{Deserialize, Serialize};

use crate::builtin_interfaces::Time;

/// When and in which frame the rest of a message holds.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Header {
    /// Sim time.
    pub stamp: Time,
    /// Name of the frame that coordinates are given in.
    pub frame_id: String,
}
