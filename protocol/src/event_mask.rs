//! A set of events of an agent.
//!
//! On the wire it is a byte with the constants of `maes_msgs/WakeCondition`; bits that no constant
//! names are kept.

use bitflags::bitflags;

use msgs::maes_msgs::WakeCondition;

bitflags! {
    /// Events between two observations of an agent.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
    pub struct EventMask: u8 {
        /// The motion task has ended, by itself or by a collision.
        const TASK_DONE = WakeCondition::TASK_DONE;
        /// A motion was refused because of an obstacle.
        const COLLISION = WakeCondition::COLLISION;
        /// The centre of the body has entered another cell.
        const NEW_CELL = WakeCondition::NEW_CELL;
        /// The set of agents or relays in contact differs from that of the last observation.
        const CONTACTS = WakeCondition::CONTACTS;
        /// A message has arrived.
        const MESSAGE = WakeCondition::MESSAGE;
        /// An agent is in contact that no committed observation of this share period has listed. It
        /// is only looked for, and reported, if it is asked for.
        const FIRST_CONTACT = WakeCondition::FIRST_CONTACT;
        /// A scan has found a cell in another state than an earlier one, because the world has
        /// changed. Every wake-up condition includes it.
        const REVISED = WakeCondition::REVISED;
        const _ = !0;
    }
}
