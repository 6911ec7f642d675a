//! The membership of a run: which process holds which agent id.
//!
//! Invariants: an id belongs to one process at a time; a process that another one replaces loses
//! all its ids; a refused request changes nothing. When a process counts as lost is not decided
//! here.

use std::collections::BTreeSet;

use msgs::ids::AgentId;
use msgs::limits::PROTOCOL;

use super::{Refusal, SourceId};

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
}
