//! The stage of an agent: what its controller is busy with, for measures of where the time goes.
//!
//! The message is the field `stage` of `maes_msgs/Command`. The world does not depend on it, and it
//! is not in the digest.

use thiserror::Error;

use msgs::maes_msgs::Command;

/// What an agent is busy with; it stays so until a command names another stage.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Stage {
    /// On the way to a viewpoint nearby.
    Exploring,
    /// On the way to a frontier that is not nearby.
    Relocating,
    /// On the way to another agent, with news for it.
    Carrying,
    /// Without a goal, or out of the way of others.
    Waiting,
}

/// A stage that is none of the constants of `maes_msgs/Command`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
#[error("stage = {0}, 0 to 4 are allowed")]
pub struct UnknownStage(pub u8);

impl Stage {
    /// All stages.
    pub const ALL: [Self; 4] = [Self::Exploring, Self::Relocating, Self::Carrying, Self::Waiting];

    /// The word for it, such as `exploring`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Exploring => "exploring",
            Self::Relocating => "relocating",
            Self::Carrying => "carrying",
            Self::Waiting => "waiting",
        }
    }

    /// The number in a command; `None`: as before.
    #[must_use]
    pub fn on_wire(stage: Option<Self>) -> u8 {
        match stage {
            None => Command::SAME,
            Some(Self::Exploring) => Command::EXPLORING,
            Some(Self::Relocating) => Command::RELOCATING,
            Some(Self::Carrying) => Command::CARRYING,
            Some(Self::Waiting) => Command::WAITING,
        }
    }

    /// The stage of a command; `None`: as before.
    ///
    /// # Errors
    /// If the number is none of the constants.
    pub fn from_wire(stage: u8) -> Result<Option<Self>, UnknownStage> {
        match stage {
            Command::SAME => Ok(None),
            Command::EXPLORING => Ok(Some(Self::Exploring)),
            Command::RELOCATING => Ok(Some(Self::Relocating)),
            Command::CARRYING => Ok(Some(Self::Carrying)),
            Command::WAITING => Ok(Some(Self::Waiting)),
            other => Err(UnknownStage(other)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use msgs::cdr;

    #[test]
    fn numbers_round_trip_and_others_are_refused() {
        for stage in Stage::ALL.into_iter().map(Some).chain([None]) {
            assert_eq!(Stage::from_wire(Stage::on_wire(stage)), Ok(stage));
        }
        let refused = Stage::from_wire(5).unwrap_err();
        assert_eq!(refused.to_string(), "stage = 5, 0 to 4 are allowed");
    }

    #[test]
    fn stage_is_the_end_of_a_command_and_nothing_else() {
        for info in ["", "a", "ab", "abc", "abcd"] {
            let with = |stage| cdr::encode(&Command { info: info.to_owned(), stage, ..Command::default() });
            let [before, after] = [with(Command::SAME), with(Command::WAITING)];
            let end = before.len() - Command::UNDIGESTED_BYTES;
            assert_eq!(before[..end], after[..end], "{info}");
            assert_eq!((&before[end..], &after[end..]), (&[0][..], &[4][..]), "{info}");
        }
    }
}
