//! The lock-step: who takes part, who is asked in a tick, and when the answers are complete.
//!
//! Three pure state machines. [`Roster`] grants each agent id to one process. [`Trigger`](msgs::trigger::Trigger) says
//! whether an agent is due. [`Barrier`] collects the answers of one tick.
//!
//! Invariants: an id belongs to one process at a time; the barrier of a tick is complete exactly when every awaited agent has
//! given one legal answer for that tick, whatever the order of arrival; a refused message changes nothing.
//!
//! This module knows no transport, no threads and no wall time: time-outs belong to the run loop.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use msgs::ids::{AgentId, Tick};
use msgs::limits::PROTOCOL;
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
        /// Whose topic.
        topic: AgentId,
    },
    /// The id is not one of the run's.
    #[error("agent {agent} does not take part: ids are 0 .. {agents}")]
    UnknownAgent {
        /// Claimed id.
        agent: AgentId,
        /// Size of the team.
        agents: u32,
    },
    /// The message names another agent than its topic.
    #[error("a message that names agent {named} came in on a topic of agent {topic}")]
    WrongTopic {
        /// Whose topic.
        topic: AgentId,
        /// Named in the message.
        named: AgentId,
    },
    /// Another process has this id.
    #[error("agent {agent} is taken by another process")]
    IdTaken {
        /// Claimed id.
        agent: AgentId,
    },
    /// A process that would take the place of another one runs something else.
    #[error("agent {agent} is to be run again by {before:?}, and not by {got:?}")]
    OtherController {
        /// Claimed id.
        agent: AgentId,
        /// What the process runs.
        got: String,
        /// What its predecessor ran.
        before: String,
    },
    /// The process speaks another version of the protocol.
    #[error("agent {agent} speaks protocol {got}, the server speaks {expected}")]
    WrongProtocol {
        /// Claimed id.
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
    /// An answer to another tick.
    #[error("agent {agent} answered tick {got} while tick {expected} is awaited")]
    WrongTick {
        /// Who.
        agent: AgentId,
        /// Tick of the answer.
        got: Tick,
        /// Tick of the barrier.
        expected: Tick,
    },
    /// A second answer to a tick.
    #[error("agent {agent} answered tick {tick} twice")]
    SecondAnswer {
        /// Who.
        agent: AgentId,
        /// Which tick.
        tick: Tick,
    },
    /// Numbers that are no numbers, or out of range.
    #[error("agent {agent}, tick {tick}: {reason}")]
    IllegalCommand {
        /// Who.
        agent: AgentId,
        /// Which tick.
        tick: Tick,
        /// Field, value and allowed values.
        reason: String,
    },
    /// Bytes that are no message.
    #[error("a message on a topic of agent {topic} cannot be decoded: {reason}")]
    Undecodable {
        /// Whose topic.
        topic: AgentId,
        /// What is wrong.
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
            Self::WrongTick { .. } => "refused_wrong_tick",
            Self::SecondAnswer { .. } => "refused_second_answer",
            Self::IllegalCommand { .. } => "refused_illegal_command",
            Self::Undecodable { .. } => "refused_undecodable",
        }
    }

    /// All counters of refusals, in the order of their definition.
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

/// Which process is which agent.
#[derive(Debug, Clone)]
pub struct Roster {
    seats: Vec<Option<Seat>>,
}

/// What is kept of what an agent says that it runs, characters: it is shown and recorded, and could be as long as a sample.
const CONTROLLER_CHARS_MAX: usize = 1_024;

/// A process that has been granted an id.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Seat {
    /// The process, as the transport knows it.
    pub source: SourceId,
    /// The process, as it calls itself.
    pub instance: u64,
    /// What it runs.
    pub controller: String,
}

impl Seat {
    /// The same, as it is kept.
    fn shortened(self) -> Self {
        Self { controller: self.controller.chars().take(CONTROLLER_CHARS_MAX).collect(), ..self }
    }
}

/// A claim of an id.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Claim {
    /// Whose topic it came in on.
    pub topic: AgentId,
    /// The id claimed.
    pub agent: AgentId,
    /// The protocol spoken.
    pub protocol: u32,
    /// Who claims.
    pub seat: Seat,
}

impl Roster {
    /// Nobody is there yet.
    #[must_use]
    pub fn new(agents: u32) -> Self {
        Self { seats: vec![None; agents as usize] }
    }

    /// Grants an id, or grants it again to the process that has it.
    ///
    /// # Errors
    /// If the id is not one of the run's or belongs to another process, or the protocol is another.
    pub fn join(&mut self, claim: Claim) -> Result<(), Refusal> {
        let agent = claim.agent;
        if claim.topic != agent {
            return Err(Refusal::WrongTopic { topic: claim.topic, named: agent });
        }
        if claim.protocol != PROTOCOL {
            return Err(Refusal::WrongProtocol { agent, got: claim.protocol, expected: PROTOCOL });
        }
        let agents = self.seats.len() as u32;
        let seat = self.seats.get_mut(agent.index()).ok_or(Refusal::UnknownAgent { agent, agents })?;
        match seat {
            None => {
                *seat = Some(claim.seat.shortened());
                Ok(())
            }
            Some(taken) if taken.source == claim.seat.source && taken.instance == claim.seat.instance => Ok(()),
            Some(_) => Err(Refusal::IdTaken { agent }),
        }
    }

    /// Grants an id that belongs to a process which is given up.
    ///
    /// # Errors
    /// If the new one runs something else.
    pub fn replace(&mut self, agent: AgentId, seat: Seat) -> Result<(), Refusal> {
        let seat = seat.shortened();
        let taken = &mut self.seats[agent.index()];
        if let Some(before) = taken.as_ref().map(|seat| seat.controller.clone()).filter(|it| *it != seat.controller) {
            return Err(Refusal::OtherController { agent, got: seat.controller, before });
        }
        *taken = Some(seat);
        Ok(())
    }

    /// All agents of a process, ascending.
    pub fn agents_of(&self, source: SourceId) -> impl Iterator<Item = AgentId> + '_ {
        let is_of = move |seat: &Option<Seat>| seat.as_ref().is_some_and(|seat| seat.source == source);
        (0..).map(AgentId).zip(&self.seats).filter(move |(_, seat)| is_of(seat)).map(|(agent, _)| agent)
    }

    /// Whether `source` has been granted `agent`.
    ///
    /// # Errors
    /// If it has not.
    pub fn check(&self, agent: AgentId, source: SourceId) -> Result<(), Refusal> {
        let agents = self.seats.len() as u32;
        match self.seats.get(agent.index()) {
            None => Err(Refusal::UnknownAgent { agent, agents }),
            Some(Some(seat)) if seat.source == source => Ok(()),
            Some(_) => Err(Refusal::NotJoined { agent }),
        }
    }

    /// The process of an agent.
    #[must_use]
    pub fn seat(&self, agent: AgentId) -> Option<&Seat> {
        self.seats.get(agent.index()).and_then(Option::as_ref)
    }

    /// Ids nobody has claimed yet, ascending.
    #[must_use]
    pub fn missing(&self) -> Vec<AgentId> {
        (0..).map(AgentId).zip(&self.seats).filter(|(_, seat)| seat.is_none()).map(|(agent, _)| agent).collect()
    }
}

/// The answers of one tick.
#[derive(Debug, Clone)]
pub struct Barrier<C> {
    tick: Tick,
    awaited: BTreeSet<AgentId>,
    answers: BTreeMap<AgentId, C>,
}

impl<C: PartialEq> Barrier<C> {
    /// Awaits one answer for `tick` from each of `awaited`.
    #[must_use]
    pub fn new(tick: Tick, awaited: BTreeSet<AgentId>) -> Self {
        Self { tick, awaited, answers: BTreeMap::new() }
    }

    /// The tick.
    #[must_use]
    pub fn tick(&self) -> Tick {
        self.tick
    }

    /// Takes an answer.
    ///
    /// # Errors
    /// If it is for another tick, not awaited, or a second one.
    pub fn accept(&mut self, agent: AgentId, tick: Tick, answer: C) -> Result<(), Refusal> {
        self.expect(agent, tick)?;
        self.awaited.remove(&agent);
        self.answers.insert(agent, answer);
        Ok(())
    }

    /// Whether an answer of this agent to this tick would be taken.
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

    /// The answer of an agent, if it has given one.
    #[must_use]
    pub fn answer(&self, agent: AgentId) -> Option<&C> {
        self.answers.get(&agent)
    }

    /// Whether an answer of this agent is still awaited.
    #[must_use]
    pub fn awaits(&self, agent: AgentId) -> bool {
        self.awaited.contains(&agent)
    }

    /// Who has not answered yet, ascending.
    pub fn missing(&self) -> impl Iterator<Item = AgentId> + '_ {
        self.awaited.iter().copied()
    }

    /// Whether nobody is awaited any more.
    #[must_use]
    pub fn is_complete(&self) -> bool {
        self.awaited.is_empty()
    }

    /// The answers of a barrier that is given up, by agent.
    #[must_use]
    pub fn into_answers_so_far(self) -> BTreeMap<AgentId, C> {
        self.answers
    }

    /// The answers, by agent.
    ///
    /// # Panics
    /// If the barrier is not complete: the world must never advance with an answer missing.
    #[must_use]
    pub fn into_answers(self) -> BTreeMap<AgentId, C> {
        assert!(self.is_complete(), "the world must not advance while answers are missing");
        self.answers
    }
}

/// Ids as people read them: `0, 3, 7`.
#[must_use]
pub fn listed(agents: impl IntoIterator<Item = AgentId>) -> impl fmt::Display {
    let names: Vec<String> = agents.into_iter().map(|agent| agent.to_string()).collect();
    names.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn claim(agent: u32, instance: u64, source: u8) -> Claim {
        Claim {
            topic: AgentId(agent),
            agent: AgentId(agent),
            protocol: PROTOCOL,
            seat: Seat { source: SourceId([source; 16]), instance, controller: "rbw".into() },
        }
    }

    #[test]
    fn an_id_belongs_to_one_process() {
        let mut roster = Roster::new(2);
        assert_eq!(roster.missing(), [AgentId(0), AgentId(1)]);
        roster.join(claim(1, 7, 1)).unwrap();
        roster.join(claim(1, 7, 1)).unwrap();
        assert_eq!(roster.join(claim(1, 8, 2)), Err(Refusal::IdTaken { agent: AgentId(1) }));
        assert_eq!(roster.missing(), [AgentId(0)]);
        assert_eq!(roster.seat(AgentId(1)).unwrap().instance, 7);
        assert!(roster.check(AgentId(1), SourceId([1; 16])).is_ok());
        assert_eq!(roster.check(AgentId(1), SourceId([2; 16])), Err(Refusal::NotJoined { agent: AgentId(1) }));
    }

    #[test]
    fn of_an_endless_name_the_beginning_is_kept() {
        let mut roster = Roster::new(1);
        let mut endless = claim(0, 1, 1);
        endless.seat.controller = "\u{e9}".repeat(1_000_000);
        roster.join(endless).unwrap();
        assert_eq!(roster.seat(AgentId(0)).unwrap().controller, "\u{e9}".repeat(CONTROLLER_CHARS_MAX));
        // Its successor says the same, and may follow.
        let mut successor = claim(0, 2, 2).seat;
        successor.controller = "\u{e9}".repeat(1_000_000);
        roster.replace(AgentId(0), successor).unwrap();
        assert_eq!(roster.seat(AgentId(0)).unwrap().controller, "\u{e9}".repeat(CONTROLLER_CHARS_MAX));
    }

    #[test]
    fn a_stranger_is_refused() {
        let mut roster = Roster::new(2);
        assert!(matches!(roster.join(claim(2, 1, 1)), Err(Refusal::UnknownAgent { agents: 2, .. })));
        let mut wrong = claim(0, 1, 1);
        wrong.protocol = 99;
        assert!(matches!(roster.join(wrong), Err(Refusal::WrongProtocol { got: 99, .. })));
        let mut wrong = claim(0, 1, 1);
        wrong.topic = AgentId(1);
        assert!(matches!(roster.join(wrong), Err(Refusal::WrongTopic { .. })));
        assert_eq!(roster.missing().len(), 2);
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
