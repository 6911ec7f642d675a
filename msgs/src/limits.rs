//! The limits that the protocol sets, as the `.msg` files state them.
//!
//! All follow from one: a sample of more than 60 kB does not reach every reader over UDP with the socket buffers that a
//! machine has by default, and nobody is told. This module checks nothing; whoever receives a message does.

/// Version of the protocol. Another one is not understood, and a join that names it is refused.
pub const PROTOCOL: u32 = 1;

/// Longest CDR encoding of one part of an observation, bytes.
pub const OBSERVATION_BYTES_MAX: usize = 60_000;

/// Most bytes of data in the parcels of one command taken together, and so in each of them.
pub const PARCEL_BYTES_MAX: usize = 57_344;

/// Longest information text of a command, bytes.
pub const INFO_BYTES_MAX: usize = 1_024;

/// Most way-points of a path.
pub const PATH_POINTS_MAX: usize = 1_024;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::maes_msgs::{Command, Observation, Parcel, Task};
    use crate::message::Message;

    #[test]
    fn the_msg_files_state_the_same_limits() {
        let states = |definition: &str, words: String| assert!(definition.contains(&words), "{words}");
        states(Observation::TYPE.definition, format!("No part is larger than {OBSERVATION_BYTES_MAX} bytes."));
        states(Parcel::TYPE.definition, format!("at most {PARCEL_BYTES_MAX} bytes"));
        states(Command::TYPE.definition, format!("at most {INFO_BYTES_MAX} bytes"));
        states(Task::TYPE.definition, format!("1 to {PATH_POINTS_MAX}"));
    }
}
