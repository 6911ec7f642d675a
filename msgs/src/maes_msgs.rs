//! The package `maes_msgs`: the messages of the protocol and of recordings.
//!
//! Each struct serialises to the CDR bytes of the type that ROS 2 builds from its `.msg` file. Its
//! receiver checks the raw numbers and converts them. Ticks are fixed updates of 20 ms.

include!(concat!(env!("OUT_DIR"), "/maes_msgs.rs"));

impl Observation {
    /// Whether this is the last fragment.
    #[must_use]
    pub fn is_last(&self) -> bool {
        u32::from(self.part) + 1 == u32::from(self.parts)
    }
}

impl Command {
    /// The bytes at the end of the CDR encoding that the digest leaves out: the stage, on which no
    /// run depends.
    pub const UNDIGESTED_BYTES: usize = 1;
}
