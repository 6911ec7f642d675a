//! The quality of service of topics, in the terms of ROS.

/// Whether what was lost on the way is sent again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reliability {
    /// It is sent again while it is kept.
    Reliable,
    /// It is lost.
    BestEffort,
}

/// Whether a reader that comes late gets what was sent before.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Durability {
    /// It gets what the writer still keeps.
    TransientLocal,
    /// It gets what is sent from then on.
    Volatile,
}

/// The quality of service of a topic. The history is always "keep last"; deadline, lifespan and
/// liveliness are not used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Qos {
    /// Whether what was lost is sent again.
    pub reliability: Reliability,
    /// Whether late readers get what was sent before.
    pub durability: Durability,
    /// How many samples are kept.
    pub depth: u32,
}

impl Qos {
    /// Reliable, and kept for late readers only as far as the protocol resends: volatile.
    pub const fn reliable(depth: u32) -> Self {
        Qos { reliability: Reliability::Reliable, durability: Durability::Volatile, depth }
    }

    /// Reliable, with the last `depth` samples kept for late readers: transient local.
    pub const fn latched(depth: u32) -> Self {
        Qos { reliability: Reliability::Reliable, durability: Durability::TransientLocal, depth }
    }

    pub(super) const fn sensor_data(depth: u32) -> Self {
        Qos { reliability: Reliability::BestEffort, durability: Durability::Volatile, depth }
    }

    /// The value of `offered_qos_profiles` in a recording: the YAML list that rosbag2 reads, in the
    /// form with integers, because the releases before Jazzy know no other.
    pub fn offered_qos_profiles(&self) -> String {
        let reliability = match self.reliability {
            Reliability::Reliable => 1,
            Reliability::BestEffort => 2,
        };
        let durability = match self.durability {
            Durability::TransientLocal => 1,
            Durability::Volatile => 2,
        };
        let depth = self.depth;
        format!(
            "- history: 1\n  depth: {depth}\n  reliability: {reliability}\n  durability: {durability}\n\
             \x20 deadline:\n{INFINITE}  lifespan:\n{INFINITE}  liveliness: 1\n  liveliness_lease_duration:\n{INFINITE}\
             \x20 avoid_ros_namespace_conventions: false\n"
        )
    }
}

/// The duration that means "none set" in a QoS profile.
const INFINITE: &str = "    sec: 9223372036\n    nsec: 854775807\n";
