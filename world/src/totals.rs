//! Running totals of a world. Plain data; they are counted by [`super::World`].

use std::collections::BTreeMap;

use super::lidar::CastCount;

/// Running totals of a world. The names are those of the counters in the result of a run, where
/// agent messages are called messages.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Totals {
    /// Scans that were due, and those of them that were not cast as the body has not moved
    /// ([`super::lidar::NotCast::SamePose`]).
    pub scans: CastCount,
    /// Motions refused because of a collision.
    pub collisions: u64,
    /// Messages sent, counted once per receiver.
    pub messages_sent: u64,
    /// Messages delivered.
    pub messages_delivered: u64,
    /// Messages lost because the receiver was out of contact.
    pub messages_out_of_contact: u64,
    /// Messages lost because the receiver's inbox was full.
    pub messages_inbox_full: u64,
    /// Messages lost to random packet loss.
    pub messages_lost_radio: u64,
    /// Messages lost because the sender's transmit queue was full.
    pub messages_queue_full: u64,
    /// Relays deployed.
    pub relays_left: u64,
    /// Deployments refused because the agent had no relay left.
    pub relays_refused: u64,
    /// Writes to deployed relays.
    pub relay_writings: u64,
    /// Writes that failed because the relay was out of reach or does not exist.
    pub relay_writings_lost: u64,
    /// Reads of relay content by agents.
    pub relay_readings: u64,
    /// Bytes of delivered messages.
    pub message_bytes_delivered: u64,
    /// Bytes of delivered messages by message type.
    pub message_bytes_by_kind: BTreeMap<u8, u64>,
}
