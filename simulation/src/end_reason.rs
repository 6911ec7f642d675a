//! Why a run has ended, as its result says it.

use std::fmt;

use serde::{Deserialize, Serialize};

/// Why a run has ended.
#[derive(Debug, Clone, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(from = "String", into = "String")]
pub enum EndReason {
    /// The team has seen every free cell.
    Explored,
    /// No free cell that the team has not seen can be seen from where a body can be, and all agents
    /// rest or have seen nothing new for a minute.
    NothingMoreSeen,
    /// No body has left its place for five minutes, and no agent waits for a time.
    StandsStill,
    /// Bodies have been in every free cell.
    Covered,
    /// The team has come back to its bases for good.
    AllBack,
    /// A base station knows all that the team can see.
    KnownAtBase,
    /// The duration is over.
    Duration,
    /// The stop flag was set.
    Interrupted,
    /// A control request has ended the run.
    Quit,
    /// The run has failed, with this error.
    Failed(String),
    /// The recording ends before the run.
    #[default]
    Unknown,
}

/// A row of [`EndReason::TABLE`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct EndReasonRow {
    /// The reason.
    pub reason: EndReason,
    /// What it is called in results, tables and Python.
    pub name: &'static str,
    /// What it means.
    pub meaning: &'static str,
}

const fn row(reason: EndReason, name: &'static str, meaning: &'static str) -> EndReasonRow {
    EndReasonRow { reason, name, meaning }
}

impl EndReason {
    /// The reasons with a name. In place of a name, the result of a run that has failed has the
    /// text of its error.
    pub const TABLE: [EndReasonRow; 9] = [
        row(Self::Explored, "explored", "the team has seen every free cell"),
        row(
            Self::NothingMoreSeen,
            "nothing more can be seen",
            "what the team has not seen cannot be seen from anywhere that its bodies can reach, and all agents rest, \
             or have seen nothing new for a minute",
        ),
        row(
            Self::StandsStill,
            "the team stands still",
            "no body has left its place for five minutes, and no agent waits for a time",
        ),
        row(Self::Covered, "covered", "bodies have been in every free cell"),
        row(
            Self::AllBack,
            "all are back",
            "the team is back in its bases for good: it has seen every free cell, or has waited there for 10 s",
        ),
        row(
            Self::KnownAtBase,
            "the base has the map",
            "a base station knows every free cell, or all that the team has seen, and nothing more can be seen",
        ),
        row(Self::Duration, "duration", "the duration is over"),
        row(Self::Interrupted, "interrupted", "a signal has ended the run"),
        row(Self::Quit, "quit", "a control request has ended the run"),
    ];

    /// The text in the result.
    #[must_use]
    pub fn text(&self) -> &str {
        match self {
            Self::Failed(error) => error,
            Self::Unknown => "",
            named => Self::TABLE.iter().find(|row| row.reason == *named).map_or("", |row| row.name),
        }
    }

    /// Whether the run has reached the end that its scenario sets.
    #[must_use]
    pub fn is_complete(&self) -> bool {
        matches!(
            self,
            Self::Explored
                | Self::NothingMoreSeen
                | Self::StandsStill
                | Self::Covered
                | Self::AllBack
                | Self::KnownAtBase
                | Self::Duration
        )
    }

    /// Whether the run was ended from outside.
    #[must_use]
    pub fn is_early(&self) -> bool {
        matches!(self, Self::Interrupted | Self::Quit)
    }
}

impl fmt::Display for EndReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.text())
    }
}

impl From<&str> for EndReason {
    fn from(text: &str) -> Self {
        match Self::TABLE.into_iter().find(|row| row.name == text) {
            Some(row) => row.reason,
            None if text.is_empty() => Self::Unknown,
            None => Self::Failed(text.to_owned()),
        }
    }
}

impl From<String> for EndReason {
    fn from(text: String) -> Self {
        Self::from(text.as_str())
    }
}

impl From<EndReason> for String {
    fn from(reason: EndReason) -> Self {
        reason.text().to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_of_each_reason_is_read_back() {
        let failed = EndReason::Failed("agents missing after 60 s: 1".to_owned());
        let named = EndReason::TABLE.into_iter().map(|row| row.reason);
        for reason in named.chain([failed, EndReason::Unknown]) {
            assert_eq!(EndReason::from(reason.text()), reason);
        }
        // What recordings hold.
        let names = EndReason::TABLE.map(|row| row.name);
        let expected = [
            "explored",
            "nothing more can be seen",
            "the team stands still",
            "covered",
            "all are back",
            "the base has the map",
            "duration",
            "interrupted",
            "quit",
        ];
        assert_eq!(names, expected);
    }

    #[test]
    fn each_named_reason_is_complete_or_early() {
        for row in EndReason::TABLE {
            assert!(row.reason.is_complete() != row.reason.is_early(), "{}", row.name);
        }
    }
}
