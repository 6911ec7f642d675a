//! The exit codes of a run, the same whatever carries it out.

use std::process::ExitCode;

use crate::session::{INTERRUPTED, Outcome, QUIT, RunError};
use crate::verify::VerifyError;

/// A failure of the system: no network, a full disk.
pub const FAILED: u8 = 1;
/// A recording does not hold, or two recordings differ.
pub const DIFFERENT: u8 = 1;
/// Bad input: a scenario, a map, a recording, an argument.
pub const BAD_INPUT: u8 = 2;
/// Agents were missing at the start.
pub const AGENTS_MISSING: u8 = 3;
/// An agent was lost and the scenario says `abort`.
pub const AGENTS_LOST: u8 = 4;
/// The run was interrupted by a signal, 128 + SIGINT, or ended early by a service.
pub const BY_SIGNAL: u8 = 130;

/// The exit code for a run with a result.
#[must_use]
pub fn of_outcome(outcome: &Outcome) -> ExitCode {
    if [INTERRUPTED, QUIT].contains(&outcome.result.reason.as_str()) {
        ExitCode::from(BY_SIGNAL)
    } else {
        ExitCode::SUCCESS
    }
}

/// The exit code for a recording that does not hold, or cannot be checked.
#[must_use]
pub fn of_verify_error(error: &VerifyError) -> ExitCode {
    match error {
        VerifyError::Different { .. } => ExitCode::from(DIFFERENT),
        VerifyError::Run { source, .. } => match **source {
            RunError::OtherRun { .. } => ExitCode::from(DIFFERENT),
            ref source => of_error(source),
        },
        VerifyError::Scenario(_) | VerifyError::World { .. } | VerifyError::Playback(_) => ExitCode::from(BAD_INPUT),
    }
}

/// The exit code for a run without one.
#[must_use]
pub fn of_error(error: &RunError) -> ExitCode {
    ExitCode::from(match error {
        RunError::AgentsMissing { .. } => AGENTS_MISSING,
        RunError::AgentsLost { .. } | RunError::Diverged { .. } => AGENTS_LOST,
        RunError::PausedForEver
        | RunError::OtherController { .. }
        | RunError::Playback(_)
        | RunError::OtherRun { .. } => BAD_INPUT,
        RunError::OtherServer { .. }
        | RunError::Random(_)
        | RunError::Record(_)
        | RunError::Reset(_)
        | RunError::Threads(_) => FAILED,
    })
}
