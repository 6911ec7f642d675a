//! The types of agent messages that the agents of this project send.
//!
//! On the wire a type is the field `kind` of `maes_msgs/AgentMessage`, for accounting; other
//! controllers choose other numbers.

/// A type of agent messages.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum MessageType {
    /// Map sharing: summaries, updates and acknowledgements. No controller may send it.
    Map = 1,
    /// Goals that an agent has claimed in an auction.
    Claims = 2,
    /// Agents that have nothing left to explore.
    Finished = 4,
    /// Planned meetings.
    Meeting = 5,
    /// Who explores which part of the unexplored space.
    Parts = 6,
    /// How much of the map a base station has, and who is about to bring it more.
    AtBase = 7,
}

impl MessageType {
    /// The number on the wire.
    #[must_use]
    pub const fn number(self) -> u8 {
        self as u8
    }

    /// The type of a number; `None` if it is another controller's.
    #[must_use]
    pub fn of(number: u8) -> Option<Self> {
        [Self::Map, Self::Claims, Self::Finished, Self::Meeting, Self::Parts, Self::AtBase]
            .into_iter()
            .find(|one| one.number() == number)
    }
}

#[cfg(test)]
mod tests {
    use super::MessageType;

    #[test]
    fn number_round_trips() {
        for number in 0..=u8::MAX {
            let is_ours = [1, 2, 4, 5, 6, 7].contains(&number);
            assert_eq!(MessageType::of(number).map(MessageType::number), is_ours.then_some(number));
        }
    }
}
