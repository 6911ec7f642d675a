//! The identity of a run, and the policy by which processes may join it.

use std::collections::BTreeSet;
use std::fmt;

use crate::signing::{Bytes, JoinSecret, SessionKey};
use msgs::ids::AgentId;

/// Which processes may join over an open transport.
#[derive(Debug, Clone, Default)]
pub struct JoinPolicy {
    /// What a process must know; `None`: nothing.
    pub secret: Option<JoinSecret>,
    /// Ids whose processes need not sign their commands, because foreign nodes run them. The
    /// third-party agents of the scenario are always among them.
    pub third_party: BTreeSet<AgentId>,
}

impl JoinPolicy {
    /// This policy with further third-party agents.
    #[must_use]
    pub fn with_third_party(&self, agents: &BTreeSet<AgentId>) -> Self {
        Self { third_party: self.third_party.union(agents).copied().collect(), ..self.clone() }
    }
}

/// What distinguishes a run from others, and from those of the same server before a reset.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct RunIdentity {
    origin: u64,
    resets: u64,
    /// Unknown to other processes.
    random: Bytes,
}

impl fmt::Debug for RunIdentity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { origin, resets, random: _ } = self;
        write!(f, "RunIdentity({origin} + {resets})")
    }
}

impl RunIdentity {
    /// The first run of a server, from two random values: its number, of which the upper half is
    /// left for resets, and what nonces and session keys are derived from.
    #[must_use]
    pub fn new(number: u64, random: Bytes) -> Self {
        // 0 stands for no particular run.
        Self { origin: (number >> 1).max(1), resets: 0, random }
    }

    /// The next run of the same server.
    #[must_use]
    pub fn after_reset(self) -> Self {
        Self { resets: self.resets + 1, ..self }
    }

    /// Number of the run, not 0.
    #[must_use]
    pub fn run(&self) -> u64 {
        self.origin + self.resets
    }

    /// Number of the first run of the server.
    #[must_use]
    pub fn origin(&self) -> u64 {
        self.origin
    }

    /// Whether `run` is the number of an earlier run of this server.
    #[must_use]
    pub fn succeeds(&self, run: u64) -> bool {
        (self.origin..self.run()).contains(&run)
    }

    /// The random value of this server, from which nonces and session keys are derived.
    pub(super) fn random(&self) -> SessionKey {
        SessionKey::new(self.random)
    }
}
