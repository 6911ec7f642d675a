//! The configuration of a run: its scenario, its mode, and the identity that distinguishes it from
//! other runs.

use protocol::lockstep::{JoinPolicy, RunIdentity};
use simulation::scenario::{Rtf, Scenario};

use super::RunError;
use recording::comparison::Checker;
use recording::playback::Playback;

/// What a session runs.
pub struct RunConfig<'a> {
    pub(super) scenario: &'a Scenario,
    pub(super) mode: Mode<'a>,
    pub(super) start: RunStart,
    pub(super) policy: JoinPolicy,
}

/// Where the commands of a run come from.
pub enum Mode<'a> {
    /// From the agents, from the first tick on.
    Live,
    /// From a recording as far as it goes, and from the agents afterwards.
    Resume(Playback<'a>),
    /// From a recording alone; every message the run writes goes to the checker.
    Verify(Playback<'a>, &'a mut dyn Checker),
}

impl<'a> RunConfig<'a> {
    /// A live run.
    ///
    /// # Errors
    /// If the system provides no random number for its identity.
    pub fn live(scenario: &'a Scenario) -> Result<Self, RunError> {
        Self::new(scenario, Mode::Live)
    }

    /// A live run after [`RunError::Reset`], with the agents of the scenario.
    #[must_use]
    pub fn after_reset(scenario: &'a Scenario, start: RunStart) -> Self {
        Self { scenario, mode: Mode::Live, start, policy: JoinPolicy::default() }
    }

    /// A run in the given mode.
    ///
    /// # Errors
    /// If the system provides no random number for its identity.
    pub fn new(scenario: &'a Scenario, mode: Mode<'a>) -> Result<Self, RunError> {
        Ok(Self { scenario, mode, start: RunStart::of(scenario)?, policy: JoinPolicy::default() })
    }

    /// The same run with this policy.
    #[must_use]
    pub fn with_policy(self, policy: JoinPolicy) -> Self {
        Self { policy, ..self }
    }
}

/// The identity and the initial state of a run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RunStart {
    pub(super) identity: RunIdentity,
    pub(super) is_paused: bool,
    pub(super) rtf: Rtf,
}

impl RunStart {
    fn of(scenario: &Scenario) -> Result<Self, RunError> {
        let (is_paused, rtf) = (scenario.execution.paused, scenario.execution.rtf);
        let mut random = [0; 32];
        getrandom::fill(&mut random)?;
        Ok(Self { identity: RunIdentity::new(getrandom::u64()?, random), is_paused, rtf })
    }

    /// The start of the next run of the same server.
    pub(super) fn reset(self, is_paused: bool, rtf: Rtf) -> Self {
        Self { identity: self.identity.after_reset(), is_paused, rtf }
    }
}
