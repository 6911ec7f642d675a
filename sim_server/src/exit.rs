//! Exit codes of the commands.

use std::process::ExitCode;

pub use system::exit_code::{AGENTS_LOST, AGENTS_MISSING, BAD_INPUT, BY_SIGNAL, DIFFERENT, FAILED};

use crate::session::{Outcome, RunError};
use crate::verify::VerifyError;
use recording::recorder::RecordError;

/// An error with its causes, as far as its own text does not have them already.
#[must_use]
pub fn described(error: &anyhow::Error) -> String {
    let mut text = error.to_string();
    for cause in error.chain().skip(1).map(ToString::to_string) {
        if !text.contains(&cause) {
            text += &format!(": {cause}");
        }
    }
    text
}

/// Exit code of a run with a result.
#[must_use]
pub fn of_outcome(outcome: &Outcome) -> ExitCode {
    if outcome.reason().is_early() { ExitCode::from(BY_SIGNAL) } else { ExitCode::SUCCESS }
}

/// Exit code of a run that its memory limit has ended: a failure, and another error keeps its code.
#[must_use]
pub fn after_memory_limit(code: ExitCode) -> ExitCode {
    let hides_nothing = [ExitCode::SUCCESS, ExitCode::from(BY_SIGNAL)].contains(&code);
    if hides_nothing { ExitCode::from(FAILED) } else { code }
}

/// Exit code of a recording that does not verify or cannot be checked.
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

/// Exit code of a recording that cannot be created.
#[must_use]
pub fn of_record_error(error: &RecordError) -> ExitCode {
    ExitCode::from(match error {
        RecordError::Destination { .. } => BAD_INPUT,
        RecordError::File { .. } | RecordError::Mcap { .. } => FAILED,
    })
}

/// Exit code of a run without a result.
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
        | RunError::Reset { .. }
        | RunError::Threads(_) => FAILED,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_memory_limit_hides_no_other_error() {
        for code in [ExitCode::SUCCESS, ExitCode::from(BY_SIGNAL)] {
            assert_eq!(after_memory_limit(code), ExitCode::from(FAILED));
        }
        for code in [BAD_INPUT, AGENTS_MISSING, AGENTS_LOST] {
            assert_eq!(after_memory_limit(ExitCode::from(code)), ExitCode::from(code));
        }
    }
}
