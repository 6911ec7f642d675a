//! The wake-up condition of an agent: when the server requests its next command.
//!
//! The message is `maes_msgs/WakeCondition`.

use crate::event_mask::EventMask;
use msgs::ids::Tick;
use msgs::maes_msgs;

/// A tick and a set of events, whichever comes first.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WakeCondition {
    /// The latest tick. One that has passed means the next tick.
    pub at: Tick,
    /// The events that end the wait earlier.
    pub events: EventMask,
}

impl WakeCondition {
    /// The next tick; also what holds before an agent's first command.
    pub const NEXT_TICK: Self = Self { at: Tick::ZERO, events: EventMask::empty() };

    /// The end of the task, by itself or by a collision.
    pub const TASK_DONE: Self = Self { at: Tick(u64::MAX), events: EventMask::TASK_DONE.union(EventMask::COLLISION) };

    /// A tick and no event.
    #[must_use]
    pub fn at(tick: Tick) -> Self {
        Self { at: tick, events: EventMask::empty() }
    }

    /// Any of these events, however late.
    #[must_use]
    pub fn on(events: EventMask) -> Self {
        Self { at: Tick(u64::MAX), events }
    }

    /// Whether the agent is scheduled at `tick`, given the `events` since its last observation.
    /// [`EventMask::REVISED`] ends every wait: who has planned on what is no longer so plans anew.
    #[must_use]
    pub fn is_met(&self, tick: Tick, events: EventMask) -> bool {
        tick >= self.at || events.intersects(self.events.union(EventMask::REVISED))
    }

    /// The earlier of two wake-up conditions.
    #[must_use]
    pub fn or(self, other: Self) -> Self {
        Self { at: self.at.min(other.at), events: self.events | other.events }
    }
}

impl From<maes_msgs::WakeCondition> for WakeCondition {
    fn from(message: maes_msgs::WakeCondition) -> Self {
        Self { at: Tick(message.at_tick), events: EventMask::from_bits_retain(message.events) }
    }
}

impl From<WakeCondition> for maes_msgs::WakeCondition {
    fn from(wake: WakeCondition) -> Self {
        Self { at_tick: wake.at.0, events: wake.events.bits() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn met_at_the_tick_or_at_an_event() {
        let events = EventMask::from_bits_retain;
        let wake = WakeCondition { at: Tick(10), events: events(0b101) };
        assert!(!wake.is_met(Tick(9), events(0b010)));
        assert!(wake.is_met(Tick(9), events(0b100)));
        assert!(wake.is_met(Tick(10), events(0)));
        assert!(wake.is_met(Tick(11), events(0)));
        assert!(WakeCondition::NEXT_TICK.is_met(Tick(0), events(0)));
    }

    #[test]
    fn either_of_two_is_met_with_the_earlier() {
        let either = WakeCondition::at(Tick(5)).or(WakeCondition::on(EventMask::MESSAGE));
        assert_eq!(either, WakeCondition { at: Tick(5), events: EventMask::MESSAGE });
    }

    #[test]
    fn message_round_trips() {
        let wake = WakeCondition { at: Tick(7), events: EventMask::from_bits_retain(0b1010_0001) };
        assert_eq!(WakeCondition::from(maes_msgs::WakeCondition::from(wake)), wake);
    }
}
