//! Why an agent rejects a message of the server.

use msgs::ids::Tick;
use thiserror::Error;
use voxels::{ExtentError, RunsError};

/// Why a message of the server is rejected.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum WireError {
    /// The extent of the map is illegal.
    #[error("scenario: {0}")]
    Extent(#[from] ExtentError),
    /// The bodies or the controllers do not match the team.
    #[error("scenario: {field} = {value}: expected {allowed}")]
    Scenario {
        /// The field.
        field: &'static str,
        /// Its value.
        value: String,
        /// The legal values.
        allowed: String,
    },
    /// A list of cells does not fit the map.
    #[error("observation of tick {tick}: {source}")]
    Cells {
        /// The tick of the observation.
        tick: Tick,
        /// What is wrong.
        source: RunsError,
    },
    /// A value is illegal.
    #[error("observation of tick {tick}: {field} = {value}: expected {allowed}")]
    Value {
        /// The tick of the observation.
        tick: Tick,
        /// The field.
        field: &'static str,
        /// Its value.
        value: String,
        /// The legal values.
        allowed: String,
    },
    /// A fragment number is out of range, or the fragments disagree on their count.
    #[error("observation of tick {tick}: part {part} of {parts}")]
    Part {
        /// The tick of the observation.
        tick: Tick,
        /// Number of the fragment.
        part: u16,
        /// Count of fragments.
        parts: u16,
    },
}
