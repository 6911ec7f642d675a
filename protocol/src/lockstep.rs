//! The lock-step protocol: the sessions with the agents, the wake-up conditions that make agents
//! due, and the barrier of a tick.
//!
//! Pure state machines. [`AgentSessions`] is the protocol of the server, to be driven by whoever
//! has a transport and a clock: its membership leases each agent id to one process, and a session
//! for each agent says how it stands with that process.
//! [`WakeCondition`](crate::wake_condition::WakeCondition) says whether an agent is due.
//! [`Barrier`] collects the replies of one tick.
//!
//! Invariants: an id belongs to one process at a time; the barrier of a tick is complete exactly
//! when every awaited agent has given one legal reply for that tick, whatever the order of arrival;
//! a refused message changes nothing. `testing/fault_injection/tests/lockstep_model` checks them,
//! and that a run ends, in all orders of events of a small team.
//!
//! This module knows no transport, no threads and no clock: times are arguments.

mod agent_session;
mod agent_sessions;
mod authentication;
mod identity;
mod inbound;
mod membership;
mod messages;
mod refusal;
mod resend_estimator;
mod timers;

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use msgs::ids::{AgentId, Tick};

pub use agent_sessions::{AgentSessions, ReplayPolicy, TimeoutPolicy};
pub use identity::{JoinPolicy, RunIdentity};
use membership::Lease;
pub use messages::{
    CommandReply, Event, Inbound, Incoming, MissingReplies, Notice, ObservationRequest, Replies, Transmit,
};
pub use refusal::Refusal;

/// The process that sent a message, as the transport identifies it: one value for each process.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct SourceId(pub [u8; 16]);

/// The replies of one tick.
#[derive(Debug, Clone)]
pub struct Barrier<C> {
    tick: Tick,
    awaited: BTreeSet<AgentId>,
    answers: BTreeMap<AgentId, C>,
}

impl<C: PartialEq> Barrier<C> {
    /// Awaits one reply for `tick` from each of `awaited`.
    #[must_use]
    pub fn new(tick: Tick, awaited: BTreeSet<AgentId>) -> Self {
        Self { tick, awaited, answers: BTreeMap::new() }
    }

    /// Awaits a reply from one more agent.
    pub fn request(&mut self, agent: AgentId) {
        self.awaited.insert(agent);
    }

    /// The tick.
    #[must_use]
    pub fn tick(&self) -> Tick {
        self.tick
    }

    /// Accepts a reply.
    ///
    /// # Errors
    /// If it is for another tick, not awaited, or a second one.
    pub fn accept(&mut self, agent: AgentId, tick: Tick, answer: C) -> Result<(), Refusal> {
        self.expect(agent, tick)?;
        self.awaited.remove(&agent);
        self.answers.insert(agent, answer);
        Ok(())
    }

    /// Whether a reply of this agent to this tick would be accepted.
    ///
    /// # Errors
    /// If it is for another tick, not awaited, or a second one.
    pub fn expect(&self, agent: AgentId, tick: Tick) -> Result<(), Refusal> {
        if tick == self.tick && self.answers.contains_key(&agent) {
            return Err(Refusal::SecondAnswer { agent, tick });
        }
        if tick != self.tick || !self.awaited.contains(&agent) {
            return Err(Refusal::WrongTick { agent, got: tick, expected: self.tick });
        }
        Ok(())
    }

    /// The reply of an agent, if it has given one.
    #[must_use]
    pub fn answer(&self, agent: AgentId) -> Option<&C> {
        self.answers.get(&agent)
    }

    /// Whether a reply of this agent is still awaited.
    #[must_use]
    pub fn awaits(&self, agent: AgentId) -> bool {
        self.awaited.contains(&agent)
    }

    /// Agents without a reply, ascending.
    pub fn missing(&self) -> impl Iterator<Item = AgentId> + '_ {
        self.awaited.iter().copied()
    }

    /// Whether all replies are in.
    #[must_use]
    pub fn is_complete(&self) -> bool {
        self.awaited.is_empty()
    }

    /// The replies of a barrier that is given up, by agent.
    #[must_use]
    pub fn into_answers_so_far(self) -> BTreeMap<AgentId, C> {
        self.answers
    }

    /// The replies, by agent.
    ///
    /// # Panics
    /// If the barrier is not complete: the world must never advance with a reply missing.
    #[must_use]
    pub fn into_answers(self) -> BTreeMap<AgentId, C> {
        assert!(self.is_complete(), "the world must not advance while answers are missing");
        self.answers
    }
}

/// Consecutive ids of which only the first and the last one are listed.
const RUN_LEN_MIN: usize = 10;

/// Ids in ascending order, separated by commas; many consecutive ones as a range: `0, 3, 7-90`.
#[must_use]
pub fn listed(agents: impl IntoIterator<Item = AgentId>) -> impl fmt::Display {
    let agents: Vec<AgentId> = agents.into_iter().collect();
    let runs = agents.chunk_by(|before, after| before.0.checked_add(1) == Some(after.0));
    let names = runs.flat_map(|run| match run {
        [first, .., last] if run.len() >= RUN_LEN_MIN => vec![format!("{first}-{last}")],
        few => few.iter().map(AgentId::to_string).collect(),
    });
    names.collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn many_consecutive_ids_are_listed_as_a_range() {
        let listed = |ids: &mut dyn Iterator<Item = u32>| listed(ids.map(AgentId)).to_string();
        assert_eq!(listed(&mut [0, 3, 4, 5].into_iter()), "0, 3, 4, 5");
        assert_eq!(listed(&mut [0, 2].into_iter().chain(7..=90).chain([92])), "0, 2, 7-90, 92");
        assert_eq!(listed(&mut (0..9)), "0, 1, 2, 3, 4, 5, 6, 7, 8");
        assert_eq!(listed(&mut (0..0)), "");
    }

    #[test]
    fn complete_when_all_have_answered_in_any_order() {
        let awaited: BTreeSet<_> = [0, 2, 5].map(AgentId).into();
        for order in [[0, 2, 5], [5, 2, 0], [2, 0, 5]] {
            let mut barrier = Barrier::new(Tick(3), awaited.clone());
            for agent in order.map(AgentId) {
                assert!(!barrier.is_complete());
                barrier.accept(agent, Tick(3), agent.0 * 10).unwrap();
            }
            assert!(barrier.is_complete());
            let answers: Vec<_> = barrier.into_answers().into_iter().collect();
            assert_eq!(answers, [(AgentId(0), 0), (AgentId(2), 20), (AgentId(5), 50)]);
        }
    }

    #[test]
    fn wrong_answers_change_nothing() {
        let mut barrier = Barrier::new(Tick(3), [AgentId(0), AgentId(1)].into());
        assert!(matches!(
            barrier.accept(AgentId(0), Tick(2), 1),
            Err(Refusal::WrongTick { got: Tick(2), expected: Tick(3), .. })
        ));
        assert!(matches!(barrier.accept(AgentId(4), Tick(3), 1), Err(Refusal::WrongTick { .. })));
        barrier.accept(AgentId(0), Tick(3), 1).unwrap();
        assert!(matches!(barrier.accept(AgentId(0), Tick(3), 2), Err(Refusal::SecondAnswer { .. })));
        assert_eq!(barrier.answer(AgentId(0)), Some(&1));
        assert_eq!(barrier.missing().collect::<Vec<_>>(), [AgentId(1)]);
    }

    #[test]
    #[should_panic(expected = "answers are missing")]
    fn the_world_never_advances_with_an_answer_missing() {
        let _ = Barrier::<u8>::new(Tick(0), [AgentId(0)].into()).into_answers();
    }
}
