//! The lock-step protocol: the membership of a run, the triggers that make agents due, and the
//! barrier of a tick.
//!
//! Three pure state machines. [`Membership`] leases each agent id to one process.
//! [`Trigger`](msgs::trigger::Trigger) tells whether an agent is due. [`Barrier`] collects the
//! replies of one tick.
//!
//! Invariants: an id belongs to one process at a time; the barrier of a tick is complete exactly
//! when every awaited agent has given one legal reply for that tick, whatever the order of arrival;
//! a refused message changes nothing.
//!
//! This module knows no transport, no threads and no wall time: timeouts belong to the session
//! loop.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use msgs::ids::{AgentId, Tick};
use msgs::limits::PROTOCOL;
use msgs::maes_msgs::JoinReply;
use thiserror::Error;

/// The process that sent a message, as the transport identifies it: one value for each process.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct SourceId(pub [u8; 16]);

/// Why a message was refused. Each kind has a counter in the result of a run.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum Refusal {
    /// The message belongs to another run.
    #[error("a message on a topic of agent {topic} is of another run")]
    OtherRun {
        /// The agent whose topic carried it.
        topic: AgentId,
    },
    /// The id is not one of the run's.
    #[error("agent {agent} does not take part: ids are 0 .. {agents}")]
    UnknownAgent {
        /// The requested id.
        agent: AgentId,
        /// Size of the team.
        agents: u32,
    },
    /// The message names another agent than its topic.
    #[error("a message that names agent {named} came in on a topic of agent {topic}")]
    WrongTopic {
        /// The agent whose topic carried it.
        topic: AgentId,
        /// Named in the message.
        named: AgentId,
    },
    /// Another process holds this id.
    #[error("agent {agent} is taken by another process")]
    IdTaken {
        /// The requested id.
        agent: AgentId,
    },
    /// A process that would replace another one runs another controller.
    #[error("agent {agent} is to be run again by {before:?}, and not by {got:?}")]
    OtherController {
        /// The requested id.
        agent: AgentId,
        /// Controller of the process.
        got: String,
        /// Controller of its predecessor.
        before: String,
    },
    /// The process uses another version of the protocol.
    #[error("agent {agent} speaks protocol {got}, the server speaks {expected}")]
    WrongProtocol {
        /// The requested id.
        agent: AgentId,
        /// Version of the agent.
        got: u32,
        /// Version of the server.
        expected: u32,
    },
    /// A command from a process that has not joined with this id.
    #[error("a command for agent {agent} came from a process that has not joined as it")]
    NotJoined {
        /// Named id.
        agent: AgentId,
    },
    /// A join without proof of the join secret, or of a process that does not sign its commands.
    #[error("a join as agent {agent} {what}")]
    UnprovenJoin {
        /// The requested id.
        agent: AgentId,
        /// What is wrong with it, and the remedy.
        what: &'static str,
    },
    /// A command without the message authentication code of the process that has joined.
    #[error("a command of agent {agent}, tick {tick}, is not signed by the process that has joined")]
    ForgedCommand {
        /// Named id.
        agent: AgentId,
        /// Named tick.
        tick: Tick,
    },
    /// A reply to another tick.
    #[error("agent {agent} answered tick {got} while tick {expected} is awaited")]
    WrongTick {
        /// The agent that replied.
        agent: AgentId,
        /// Tick of the answer.
        got: Tick,
        /// Tick of the barrier.
        expected: Tick,
    },
    /// A second reply to a tick.
    #[error("agent {agent} answered tick {tick} twice")]
    SecondAnswer {
        /// The agent that replied.
        agent: AgentId,
        /// The tick of the reply.
        tick: Tick,
    },
    /// A value that is not a number, or out of range.
    #[error("agent {agent}, tick {tick}: {reason}")]
    IllegalCommand {
        /// The agent that replied.
        agent: AgentId,
        /// The tick of the reply.
        tick: Tick,
        /// Field, value and allowed values.
        reason: String,
    },
    /// Bytes that do not decode.
    #[error("a message on a topic of agent {topic} cannot be decoded: {reason}")]
    Undecodable {
        /// The agent whose topic carried it.
        topic: AgentId,
        /// The decoding error.
        reason: String,
    },
}

impl Refusal {
    /// Name of the counter of this kind.
    #[must_use]
    pub fn counter(&self) -> &'static str {
        match self {
            Self::OtherRun { .. } => "refused_other_run",
            Self::UnknownAgent { .. } => "refused_unknown_agent",
            Self::WrongTopic { .. } => "refused_wrong_topic",
            Self::IdTaken { .. } => "refused_id_taken",
            Self::OtherController { .. } => "refused_other_controller",
            Self::WrongProtocol { .. } => "refused_wrong_protocol",
            Self::NotJoined { .. } => "refused_not_joined",
            Self::UnprovenJoin { .. } => "refused_unproven_join",
            Self::ForgedCommand { .. } => "refused_forged_command",
            Self::WrongTick { .. } => "refused_wrong_tick",
            Self::SecondAnswer { .. } => "refused_second_answer",
            Self::IllegalCommand { .. } => "refused_illegal_command",
            Self::Undecodable { .. } => "refused_undecodable",
        }
    }

    /// The code of the reply to a refused join.
    #[must_use]
    pub fn code(&self) -> u8 {
        match self {
            Self::UnknownAgent { .. } => JoinReply::NOT_IN_RUN,
            Self::IdTaken { .. } => JoinReply::ID_TAKEN,
            Self::WrongProtocol { .. } => JoinReply::WRONG_PROTOCOL,
            Self::OtherController { .. } => JoinReply::OTHER_CONTROLLER,
            Self::UnprovenJoin { .. } => JoinReply::UNPROVEN,
            Self::OtherRun { .. }
            | Self::WrongTopic { .. }
            | Self::NotJoined { .. }
            | Self::ForgedCommand { .. }
            | Self::WrongTick { .. }
            | Self::SecondAnswer { .. }
            | Self::IllegalCommand { .. }
            | Self::Undecodable { .. } => JoinReply::REFUSED,
        }
    }

    /// Counters that a result names only if they are not zero, so that the recording of an
    /// undisturbed run is that of earlier versions.
    pub const COUNTERS_IF_ANY: [&'static str; 2] = ["refused_unproven_join", "refused_forged_command"];

    /// The counters of refusals that every result names.
    pub const COUNTERS: [&'static str; 11] = [
        "refused_other_run",
        "refused_unknown_agent",
        "refused_wrong_topic",
        "refused_id_taken",
        "refused_other_controller",
        "refused_wrong_protocol",
        "refused_not_joined",
        "refused_wrong_tick",
        "refused_second_answer",
        "refused_illegal_command",
        "refused_undecodable",
    ];
}

/// The membership of a run: which process holds which agent id.
#[derive(Debug, Clone)]
pub struct Membership {
    leases: Vec<Option<Lease>>,
    /// Processes of which another one has taken an id: they are given up with all that they still
    /// hold, because a process ends as a whole.
    given_up: BTreeSet<SourceId>,
}

/// Longest controller label that is kept, characters: it is displayed and recorded, and a sample
/// could hold 60 kB of it.
const CONTROLLER_CHARS_MAX: usize = 1_024;

/// The lease of an agent id to a process.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Lease {
    /// The process, as the transport knows it.
    pub source: SourceId,
    /// The random number that the process drew at its start.
    pub instance: u64,
    /// Its controller.
    pub controller: String,
}

impl Lease {
    /// With the label shortened.
    fn shortened(self) -> Self {
        Self { controller: self.controller.chars().take(CONTROLLER_CHARS_MAX).collect(), ..self }
    }
}

/// A request for an id.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct JoinRequest {
    /// The agent whose topic carried it.
    pub topic: AgentId,
    /// The requested id.
    pub agent: AgentId,
    /// Version of the protocol.
    pub protocol: u32,
    /// The lease that it asks for.
    pub lease: Lease,
}

impl Membership {
    /// A membership of `agents` ids without processes.
    #[must_use]
    pub fn new(agents: u32) -> Self {
        Self { leases: vec![None; agents as usize], given_up: BTreeSet::new() }
    }

    /// Grants an id, or confirms it to the process that holds it.
    ///
    /// # Errors
    /// If the id is not one of the run's or belongs to another process, or the protocol is another.
    pub fn join(&mut self, request: JoinRequest) -> Result<(), Refusal> {
        self.check_request(&request)?;
        let agent = request.agent;
        if self.is_given_up(request.lease.source) {
            return Err(Refusal::IdTaken { agent });
        }
        let lease = &mut self.leases[agent.index()];
        match lease {
            None => {
                *lease = Some(request.lease.shortened());
                Ok(())
            }
            Some(taken) if taken.source == request.lease.source && taken.instance == request.lease.instance => Ok(()),
            Some(_) => Err(Refusal::IdTaken { agent }),
        }
    }

    /// Whether a request could be granted if the id were free.
    ///
    /// # Errors
    /// If the id is not one of the run's, or the protocol is another.
    pub fn check_request(&self, request: &JoinRequest) -> Result<(), Refusal> {
        let agent = request.agent;
        if request.topic != agent {
            return Err(Refusal::WrongTopic { topic: request.topic, named: agent });
        }
        if request.protocol != PROTOCOL {
            return Err(Refusal::WrongProtocol { agent, got: request.protocol, expected: PROTOCOL });
        }
        let agents = self.leases.len() as u32;
        if agent.index() >= self.leases.len() {
            return Err(Refusal::UnknownAgent { agent, agents });
        }
        Ok(())
    }

    /// Transfers an id from a process that is given up, with its other ids.
    ///
    /// # Errors
    /// If the new one runs another controller.
    pub fn replace(&mut self, agent: AgentId, lease: Lease) -> Result<(), Refusal> {
        let lease = lease.shortened();
        let taken = &mut self.leases[agent.index()];
        if let Some(before) = taken.as_ref().map(|lease| lease.controller.clone()).filter(|it| *it != lease.controller)
        {
            return Err(Refusal::OtherController { agent, got: lease.controller, before });
        }
        let successor = lease.source;
        let predecessor = taken.replace(lease).map(|lease| lease.source);
        self.given_up.extend(predecessor.filter(|predecessor| *predecessor != successor));
        let Self { leases, given_up } = self;
        given_up.retain(|source| leases.iter().flatten().any(|lease| lease.source == *source));
        Ok(())
    }

    /// Whether a process is given up: another one has taken an id of it.
    #[must_use]
    pub fn is_given_up(&self, source: SourceId) -> bool {
        self.given_up.contains(&source)
    }

    /// All agents of a process, ascending.
    pub fn agents_of(&self, source: SourceId) -> impl Iterator<Item = AgentId> + '_ {
        let is_of = move |lease: &Option<Lease>| lease.as_ref().is_some_and(|lease| lease.source == source);
        (0..).map(AgentId).zip(&self.leases).filter(move |(_, lease)| is_of(lease)).map(|(agent, _)| agent)
    }

    /// Whether `source` holds `agent`.
    ///
    /// # Errors
    /// If it does not.
    pub fn check(&self, agent: AgentId, source: SourceId) -> Result<(), Refusal> {
        let agents = self.leases.len() as u32;
        match self.leases.get(agent.index()) {
            None => Err(Refusal::UnknownAgent { agent, agents }),
            Some(Some(lease)) if lease.source == source && !self.is_given_up(source) => Ok(()),
            Some(_) => Err(Refusal::NotJoined { agent }),
        }
    }

    /// The lease of an agent id, if it is held.
    #[must_use]
    pub fn lease(&self, agent: AgentId) -> Option<&Lease> {
        self.leases.get(agent.index()).and_then(Option::as_ref)
    }

    /// Ids that no process holds, ascending.
    #[must_use]
    pub fn missing(&self) -> Vec<AgentId> {
        (0..).map(AgentId).zip(&self.leases).filter(|(_, lease)| lease.is_none()).map(|(agent, _)| agent).collect()
    }
}

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

/// Ids separated by commas: `0, 3, 7`.
#[must_use]
pub fn listed(agents: impl IntoIterator<Item = AgentId>) -> impl fmt::Display {
    let names: Vec<String> = agents.into_iter().map(|agent| agent.to_string()).collect();
    names.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn request(agent: u32, instance: u64, source: u8) -> JoinRequest {
        JoinRequest {
            topic: AgentId(agent),
            agent: AgentId(agent),
            protocol: PROTOCOL,
            lease: Lease { source: SourceId([source; 16]), instance, controller: "rbw".into() },
        }
    }

    #[test]
    fn an_id_belongs_to_one_process() {
        let mut membership = Membership::new(2);
        assert_eq!(membership.missing(), [AgentId(0), AgentId(1)]);
        membership.join(request(1, 7, 1)).unwrap();
        membership.join(request(1, 7, 1)).unwrap();
        assert_eq!(membership.join(request(1, 8, 2)), Err(Refusal::IdTaken { agent: AgentId(1) }));
        assert_eq!(membership.missing(), [AgentId(0)]);
        assert_eq!(membership.lease(AgentId(1)).unwrap().instance, 7);
        assert!(membership.check(AgentId(1), SourceId([1; 16])).is_ok());
        assert_eq!(membership.check(AgentId(1), SourceId([2; 16])), Err(Refusal::NotJoined { agent: AgentId(1) }));
    }

    #[test]
    fn a_process_is_given_up_with_all_its_ids() {
        let (old, new) = (SourceId([1; 16]), SourceId([2; 16]));
        let mut membership = Membership::new(3);
        (0..3).for_each(|agent| membership.join(request(agent, 7, 1)).unwrap());
        membership.replace(AgentId(0), request(0, 8, 2).lease).unwrap();
        assert!(membership.is_given_up(old) && !membership.is_given_up(new));
        for agent in [1, 2].map(AgentId) {
            assert_eq!(membership.check(agent, old), Err(Refusal::NotJoined { agent }));
            assert_eq!(membership.join(request(agent.0, 7, 1)), Err(Refusal::IdTaken { agent }));
            membership.replace(agent, request(agent.0, 8, 2).lease).unwrap();
            assert!(membership.check(agent, new).is_ok());
        }
        assert!(!membership.is_given_up(old), "it holds nothing");
    }

    #[test]
    fn an_overlong_label_is_shortened() {
        let mut membership = Membership::new(1);
        let mut endless = request(0, 1, 1);
        endless.lease.controller = "\u{e9}".repeat(1_000_000);
        membership.join(endless).unwrap();
        assert_eq!(membership.lease(AgentId(0)).unwrap().controller, "\u{e9}".repeat(CONTROLLER_CHARS_MAX));
        // Its replacement has the same label, and is accepted.
        let mut successor = request(0, 2, 2).lease;
        successor.controller = "\u{e9}".repeat(1_000_000);
        membership.replace(AgentId(0), successor).unwrap();
        assert_eq!(membership.lease(AgentId(0)).unwrap().controller, "\u{e9}".repeat(CONTROLLER_CHARS_MAX));
    }

    #[test]
    fn foreign_requests_are_refused() {
        let mut membership = Membership::new(2);
        assert!(matches!(membership.join(request(2, 1, 1)), Err(Refusal::UnknownAgent { agents: 2, .. })));
        let mut wrong = request(0, 1, 1);
        wrong.protocol = 99;
        assert!(matches!(membership.join(wrong), Err(Refusal::WrongProtocol { got: 99, .. })));
        let mut wrong = request(0, 1, 1);
        wrong.topic = AgentId(1);
        assert!(matches!(membership.join(wrong), Err(Refusal::WrongTopic { .. })));
        assert_eq!(membership.missing().len(), 2);
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
