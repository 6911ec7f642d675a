//! How a run begins, the first one of a server or one that begins again.

use super::RunError;
use simulation::scenario::{Rtf, Scenario};

/// How a run is told from others, and begins.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Start {
    /// Number of the first run of this server: not 0, which stands for no run in particular.
    pub(super) origin: u64,
    /// How often it has begun again.
    resets: u64,
    pub(super) is_paused: bool,
    pub(super) rtf: Rtf,
}

impl Start {
    /// As the scenario says.
    pub(super) fn of(scenario: &Scenario) -> Result<Self, RunError> {
        let (is_paused, rtf) = (scenario.execution.paused, scenario.execution.rtf);
        // Room for resets above it.
        Ok(Self { origin: (getrandom::u64()? >> 1).max(1), resets: 0, is_paused, rtf })
    }

    /// Number of the run.
    pub(super) fn run(&self) -> u64 {
        self.origin + self.resets
    }

    /// The next run of the same server.
    pub(super) fn again(self, is_paused: bool, rtf: Rtf) -> Self {
        Self { resets: self.resets + 1, is_paused, rtf, ..self }
    }

    /// Whether a number is that of a run of this server before this one.
    pub(super) fn comes_after(&self, run: u64) -> bool {
        (self.origin..self.run()).contains(&run)
    }
}
