//! The membership of a run: the sessions with all agents, and which process holds which agent id.
//!
//! Invariants: an id belongs to one process at a time; a process that another one replaces is given
//! up with all its ids, because a process ends as a whole; a refused request changes nothing. When
//! a process counts as lost is not decided here.

use crate::limits::PROTOCOL;
use crate::signed::{JoinRequest, Verified};
use msgs::ids::AgentId;
use msgs::maes_msgs::Join;

use super::agent_session::{AgentSession, Holder, State, numbered};
use super::authentication::Grant;
use super::{Refusal, SourceId};

/// The membership of a run: which process holds which agent id.
#[derive(Debug, Clone)]
pub(super) struct Membership {
    sessions: Vec<AgentSession>,
}

/// Longest controller label that is kept, characters: it is displayed and recorded, and a sample
/// could hold 60 kB of it.
const CONTROLLER_CHARS_MAX: usize = 1_024;

/// The lease of an agent id to a process.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Lease {
    /// The process, as the transport knows it.
    pub(super) source: SourceId,
    /// The random number that the process drew at its start.
    pub(super) instance: u64,
    /// Its controller.
    pub(super) controller: String,
}

impl Lease {
    /// The lease that a process asks for.
    pub(super) fn new(source: SourceId, request: &Verified<JoinRequest>) -> Self {
        let Join { instance, controller, .. } = &request.join;
        Self { source, instance: *instance, controller: controller.clone() }
    }

    /// With the label shortened.
    fn shortened(self) -> Self {
        Self { controller: self.controller.chars().take(CONTROLLER_CHARS_MAX).collect(), ..self }
    }
}

impl Membership {
    /// A membership of `agents` ids without processes.
    pub(super) fn new(agents: u32) -> Self {
        Self { sessions: vec![AgentSession::default(); agents as usize] }
    }

    /// Number of ids.
    pub(super) fn agents(&self) -> u32 {
        self.sessions.len() as u32
    }

    /// The session with an agent.
    ///
    /// # Panics
    /// If the id is not one of the run's.
    pub(super) fn session(&self, agent: AgentId) -> &AgentSession {
        &self.sessions[agent.index()]
    }

    /// See [`Membership::session`].
    pub(super) fn session_mut(&mut self, agent: AgentId) -> &mut AgentSession {
        &mut self.sessions[agent.index()]
    }

    /// All sessions, ascending by agent.
    pub(super) fn sessions(&self) -> impl Iterator<Item = (AgentId, &AgentSession)> {
        numbered(&self.sessions)
    }

    /// See [`Membership::sessions`].
    pub(super) fn sessions_mut(&mut self) -> impl Iterator<Item = (AgentId, &mut AgentSession)> {
        numbered(&mut self.sessions)
    }

    /// Grants an id of the run, or confirms it to the process that holds it.
    ///
    /// # Errors
    /// If it belongs to another process.
    pub(super) fn join(&mut self, agent: AgentId, lease: Lease, grant: impl FnOnce() -> Grant) -> Result<(), Refusal> {
        match &self.session(agent).state {
            State::Absent if !self.is_given_up(lease.source) => {
                self.session_mut(agent).begin(Holder::new(lease.shortened(), grant()));
                Ok(())
            }
            State::Live { holder }
            | State::Contended { holder, .. }
            | State::Replaying { holder, .. }
            | State::Lost { holder, .. }
            | State::Left { holder }
                if holder.process() == (lease.source, lease.instance) =>
            {
                Ok(())
            }
            _ => Err(Refusal::IdTaken { agent }),
        }
    }

    /// Whether a join, from the topic of an agent, could be granted if the id were free.
    ///
    /// # Errors
    /// If the id is not one of the run's, or the protocol is another.
    pub(super) fn check_join(&self, topic: AgentId, join: &Join) -> Result<(), Refusal> {
        let agent = AgentId(join.agent);
        if topic != agent {
            return Err(Refusal::WrongTopic { topic, named: agent });
        }
        if join.protocol != PROTOCOL {
            return Err(Refusal::WrongProtocol { agent, got: join.protocol, expected: PROTOCOL });
        }
        let agents = self.agents();
        if agent.0 >= agents {
            return Err(Refusal::UnknownAgent { agent, agents });
        }
        Ok(())
    }

    /// Transfers an id from a process that is lost or given up, which is given up with its other
    /// ids.
    ///
    /// # Errors
    /// If the new one runs another controller.
    pub(super) fn replace(
        &mut self,
        agent: AgentId,
        lease: Lease,
        grant: impl FnOnce() -> Grant,
    ) -> Result<(), Refusal> {
        let lease = lease.shortened();
        let before = self.session(agent).holder().map(|holder| holder.lease.clone());
        if let Some(before) = before.as_ref().filter(|before| before.controller != lease.controller) {
            let (got, before) = (lease.controller, before.controller.clone());
            return Err(Refusal::OtherController { agent, got, before });
        }
        let successor = lease.source;
        self.session_mut(agent).begin(Holder::new(lease, grant()));
        if let Some(predecessor) = before.map(|lease| lease.source).filter(|source| *source != successor) {
            self.of_process_mut(predecessor).for_each(AgentSession::give_up);
        }
        Ok(())
    }

    /// Whether a process is given up: another one has taken an id of it, and it holds others.
    pub(super) fn is_given_up(&self, source: SourceId) -> bool {
        let is_of = |session: &AgentSession| matches!(&session.state, State::GivenUp { holder } if holder.lease.source == source);
        self.sessions.iter().any(is_of)
    }

    /// The sessions of a process.
    fn of_process_mut(&mut self, source: SourceId) -> impl Iterator<Item = &mut AgentSession> {
        let is_of =
            move |session: &&mut AgentSession| session.holder().is_some_and(|holder| holder.lease.source == source);
        self.sessions.iter_mut().filter(is_of)
    }

    /// Notes that the process of an agent does not answer, as none of its agents: a process fails
    /// as a whole.
    pub(super) fn lose(&mut self, agent: AgentId) {
        if let Some(source) = self.session(agent).holder().map(|holder| holder.lease.source) {
            for session in self.of_process_mut(source) {
                session.lose();
            }
        }
    }

    /// Notes that the process of an agent answers. Returns whether it was lost.
    pub(super) fn revive(&mut self, agent: AgentId) -> bool {
        let source = match &self.session(agent).state {
            State::Lost { holder, .. } => holder.lease.source,
            _ => return false,
        };
        for session in self.of_process_mut(source) {
            session.revive();
        }
        true
    }

    /// Whether `source` holds `agent`.
    ///
    /// # Errors
    /// If it does not.
    pub(super) fn check(&self, agent: AgentId, source: SourceId) -> Result<&Holder, Refusal> {
        let agents = self.agents();
        match self.sessions.get(agent.index()).map(|session| &session.state) {
            None => Err(Refusal::UnknownAgent { agent, agents }),
            Some(
                State::Live { holder }
                | State::Contended { holder, .. }
                | State::Replaying { holder, .. }
                | State::Lost { holder, .. }
                | State::Left { holder },
            ) if holder.lease.source == source => Ok(holder),
            Some(_) => Err(Refusal::NotJoined { agent }),
        }
    }

    /// The process that holds an agent id, if there is one.
    pub(super) fn holder(&self, agent: AgentId) -> Option<&Holder> {
        self.sessions.get(agent.index()).and_then(AgentSession::holder)
    }

    /// Agents that have left the run, ascending.
    pub(super) fn departed(&self) -> Vec<AgentId> {
        let left = self.sessions().filter(|(_, session)| matches!(session.state, State::Left { .. }));
        left.map(|(agent, _)| agent).collect()
    }

    /// Ids that no process holds, ascending.
    pub(super) fn missing(&self) -> Vec<AgentId> {
        self.sessions().filter(|(_, session)| !session.has_process()).map(|(agent, _)| agent).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lease(instance: u64, source: u8) -> Lease {
        Lease { source: SourceId([source; 16]), instance, controller: "rbw".into() }
    }

    fn join(membership: &mut Membership, agent: u32, lease: Lease) -> Result<(), Refusal> {
        membership.join(AgentId(agent), lease, Grant::default)
    }

    #[test]
    fn an_id_belongs_to_one_process() {
        let mut membership = Membership::new(2);
        assert_eq!(membership.missing(), [AgentId(0), AgentId(1)]);
        join(&mut membership, 1, lease(7, 1)).unwrap();
        join(&mut membership, 1, lease(7, 1)).unwrap();
        assert_eq!(join(&mut membership, 1, lease(8, 2)), Err(Refusal::IdTaken { agent: AgentId(1) }));
        assert_eq!(membership.missing(), [AgentId(0)]);
        assert_eq!(membership.holder(AgentId(1)).unwrap().lease.instance, 7);
        assert!(membership.check(AgentId(1), SourceId([1; 16])).is_ok());
        assert_eq!(
            membership.check(AgentId(1), SourceId([2; 16])).err(),
            Some(Refusal::NotJoined { agent: AgentId(1) })
        );
    }

    #[test]
    fn a_process_is_given_up_with_all_its_ids() {
        let (old, new) = (SourceId([1; 16]), SourceId([2; 16]));
        let mut membership = Membership::new(3);
        (0..3).for_each(|agent| join(&mut membership, agent, lease(7, 1)).unwrap());
        membership.replace(AgentId(0), lease(8, 2), Grant::default).unwrap();
        assert!(membership.is_given_up(old) && !membership.is_given_up(new));
        for agent in [1, 2].map(AgentId) {
            assert_eq!(membership.check(agent, old).err(), Some(Refusal::NotJoined { agent }));
            assert_eq!(join(&mut membership, agent.0, lease(7, 1)), Err(Refusal::IdTaken { agent }));
            membership.replace(agent, lease(8, 2), Grant::default).unwrap();
            assert!(membership.check(agent, new).is_ok());
        }
        assert!(!membership.is_given_up(old), "it holds nothing");
    }

    #[test]
    fn an_overlong_label_is_shortened() {
        let mut membership = Membership::new(1);
        let endless = |instance, source| Lease { controller: "\u{e9}".repeat(1_000_000), ..lease(instance, source) };
        join(&mut membership, 0, endless(1, 1)).unwrap();
        assert_eq!(membership.holder(AgentId(0)).unwrap().lease.controller, "\u{e9}".repeat(CONTROLLER_CHARS_MAX));
        // Its replacement has the same label, and is accepted.
        membership.replace(AgentId(0), endless(2, 2), Grant::default).unwrap();
        assert_eq!(membership.holder(AgentId(0)).unwrap().lease.controller, "\u{e9}".repeat(CONTROLLER_CHARS_MAX));
    }

    #[test]
    fn foreign_joins_are_refused() {
        let membership = Membership::new(2);
        let check = |topic: u32, agent: u32, protocol: u32| {
            membership.check_join(AgentId(topic), &Join { agent, protocol, ..Join::default() })
        };
        assert_eq!(check(1, 1, PROTOCOL), Ok(()));
        assert!(matches!(check(2, 2, PROTOCOL), Err(Refusal::UnknownAgent { agents: 2, .. })));
        assert!(matches!(check(0, 0, 99), Err(Refusal::WrongProtocol { got: 99, .. })));
        assert!(matches!(check(1, 0, PROTOCOL), Err(Refusal::WrongTopic { .. })));
    }
}
