//! The configuration of a run: its scenario, its mode, and the identity that distinguishes it from
//! other runs.

use std::collections::BTreeSet;
use std::fmt;

use msgs::ids::AgentId;
use msgs::signing::{Bytes, JoinSecret, SessionKey};
use simulation::scenario::{Rtf, Scenario};

use super::{Checker, RunError};
use crate::playback::Playback;

/// What a session runs.
pub struct RunConfig<'a> {
    pub(super) scenario: &'a Scenario,
    pub(super) mode: Mode<'a>,
    pub(super) start: RunStart,
    pub(super) policy: JoinPolicy,
}

/// Which processes may join over an open transport.
#[derive(Debug, Clone, Default)]
pub struct JoinPolicy {
    /// What a process must know; `None`: nothing.
    pub secret: Option<JoinSecret>,
    /// Ids whose processes need not sign their commands, because foreign nodes run them. Those that
    /// the scenario says so of ([`Scenario::unsigned`]) are always among them.
    pub external: BTreeSet<AgentId>,
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

    /// A live run after [`RunError::Reset`], with the same agents.
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
#[derive(Clone, Copy, PartialEq)]
pub struct RunStart {
    /// Number of the first run of this server; not 0, which stands for no particular run.
    pub(super) origin: u64,
    resets: u64,
    pub(super) is_paused: bool,
    pub(super) rtf: Rtf,
    /// Unknown to other processes.
    random: Bytes,
}

impl fmt::Debug for RunStart {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { origin, resets, is_paused, rtf, random: _ } = self;
        write!(f, "RunStart {{ run: {origin} + {resets}, is_paused: {is_paused}, rtf: {rtf:?} }}")
    }
}

impl RunStart {
    fn of(scenario: &Scenario) -> Result<Self, RunError> {
        let (is_paused, rtf) = (scenario.execution.paused, scenario.execution.rtf);
        // The upper half of the numbers is left for resets.
        let mut random = [0; 32];
        getrandom::fill(&mut random)?;
        Ok(Self { origin: (getrandom::u64()? >> 1).max(1), resets: 0, is_paused, rtf, random })
    }

    /// The random values of this server, from which nonces and session keys are derived.
    pub(super) fn random(&self) -> SessionKey {
        SessionKey::new(self.random)
    }

    /// Number of the run.
    pub(super) fn run(&self) -> u64 {
        self.origin + self.resets
    }

    /// The start of the next run of the same server.
    pub(super) fn reset(self, is_paused: bool, rtf: Rtf) -> Self {
        Self { resets: self.resets + 1, is_paused, rtf, ..self }
    }

    /// Whether `run` is the number of an earlier run of this server.
    pub(super) fn succeeds(&self, run: u64) -> bool {
        (self.origin..self.run()).contains(&run)
    }
}
