//! Authentication of the agents: who may join, and whether a command comes from whoever has joined.
//!
//! Over a private transport, to which only the agents have access, nothing is signed. Over an open
//! one every process must sign its commands, except those of external agents, which foreign nodes
//! run. With a join secret a process must prove that it knows it.
//!
//! Invariants: the key of an id changes only with the process that holds it; a refused message
//! changes no key.

use std::collections::BTreeSet;

use msgs::ids::{AgentId, Tick};
use msgs::maes_msgs::{Command, JoinReply, Observation as Fragment, Scenario, SignedJoin, SignedObservation};
use msgs::signing::{self, Bytes, JoinContext, NONE, SessionKey, is_equal};
use simulation::lockstep::{Refusal, SourceId};

use crate::session::config::{JoinPolicy, RunStart};

const UNPROVEN: &str = "does not prove the join secret of this run; expected the same MAES_JOIN_SECRET or \
                        --join-secret-file on both sides";

const UNSIGNED: &str = "comes from a process that does not sign its commands; a foreign node needs \
                        --external with this id, or agents.command_signs = false for agents.command";

/// What a process that holds an id was sent.
struct Grant {
    source: SourceId,
    /// The join that was granted.
    join: SignedJoin,
    /// Of the server, with a join secret.
    nonce: Bytes,
    /// The key as it is sent, without a join secret.
    sent_key: Bytes,
    /// `None`: the process does not sign.
    key: Option<SessionKey>,
}

/// The keys of a run.
pub(super) struct Authentication {
    policy: JoinPolicy,
    run: u64,
    /// From which nonces and keys are derived.
    random: SessionKey,
    is_open: bool,
    announcement: Bytes,
    /// By agent.
    grants: Vec<Option<Grant>>,
    /// Number of grants so far.
    granted: u64,
}

impl Authentication {
    pub(super) fn new(policy: JoinPolicy, start: &RunStart, agents: u32) -> Self {
        Self {
            policy,
            run: start.run(),
            random: start.random(),
            is_open: false,
            announcement: NONE,
            grants: (0..agents).map(|_| None).collect(),
            granted: 0,
        }
    }

    /// Notes the announcement, and whether others than the agents can send on the transport.
    pub(super) fn announce(&mut self, scenario: &Scenario, is_open: bool) {
        self.announcement = signing::announcement(scenario);
        self.is_open = is_open;
    }

    fn is_external(&self, agent: AgentId) -> bool {
        self.policy.external.contains(&agent)
    }

    fn is_proven(&self, source: SourceId, join: &SignedJoin) -> bool {
        let context = JoinContext { announcement: &self.announcement, source: &source.0, join };
        match &self.policy.secret {
            Some(secret) => join.nonce != NONE && is_equal(&secret.prove_join(context), &join.proof),
            None => join.nonce != NONE,
        }
    }

    /// Whether a process may join.
    pub(super) fn check_join(&self, agent: AgentId, source: SourceId, join: &SignedJoin) -> Result<(), Refusal> {
        if !self.is_open || self.is_external(agent) || self.is_proven(source, join) {
            return Ok(());
        }
        let what = if self.policy.secret.is_some() { UNPROVEN } else { UNSIGNED };
        Err(Refusal::UnprovenJoin { agent, what })
    }

    /// Notes that a join was granted. A repeated join of the same process gets the same key.
    pub(super) fn grant(&mut self, agent: AgentId, source: SourceId, join: &SignedJoin) {
        let is_same = |grant: &Grant| grant.source == source && grant.join.join.instance == join.join.instance;
        if self.grants[agent.index()].as_ref().is_some_and(is_same) {
            return;
        }
        self.granted += 1;
        let number = [self.run.to_le_bytes(), u64::from(agent.0).to_le_bytes(), self.granted.to_le_bytes()].concat();
        let mut grant = Grant { source, join: join.clone(), nonce: NONE, sent_key: NONE, key: None };
        if self.is_open && self.is_proven(source, join) {
            let random = self.random.derive(b"grant", &[&number]);
            match &self.policy.secret {
                Some(secret) => {
                    let context = JoinContext { announcement: &self.announcement, source: &source.0, join };
                    grant.nonce = random;
                    grant.key = Some(secret.session_key(context, &random));
                }
                None => {
                    grant.sent_key = random;
                    grant.key = Some(SessionKey::new(random));
                }
            }
        }
        self.grants[agent.index()] = Some(grant);
    }

    /// Completes the reply to a join: with what the process needs for its key if it was granted,
    /// and with the proof of the server.
    pub(super) fn complete(&self, mut reply: JoinReply, source: SourceId, join: &SignedJoin) -> JoinReply {
        if !self.is_open {
            return reply;
        }
        if let Some(Some(grant)) = self.grants.get(reply.agent as usize).filter(|_| reply.accepted) {
            (reply.nonce, reply.key) = (grant.nonce, grant.sent_key);
        }
        if let Some(secret) = &self.policy.secret {
            let context = JoinContext { announcement: &self.announcement, source: &source.0, join };
            reply.proof = secret.prove_reply(context, &reply);
        }
        reply
    }

    /// Completes a reply to the process that holds an id, whose join was granted before.
    pub(super) fn complete_for_holder(&self, agent: AgentId, reply: JoinReply) -> JoinReply {
        match self.grants.get(agent.index()).and_then(Option::as_ref) {
            Some(grant) => self.complete(reply, grant.source, &grant.join),
            None => reply,
        }
    }

    /// Whether a command of the process that holds an id is signed by it.
    pub(super) fn check_command(&self, agent: AgentId, command: &Command, mac: &Bytes) -> Result<(), Refusal> {
        match self.grants.get(agent.index()).and_then(Option::as_ref).and_then(|grant| grant.key.as_ref()) {
            Some(key) if !is_equal(&key.of_command(command), mac) => {
                Err(Refusal::ForgedCommand { agent, tick: Tick(command.tick) })
            }
            _ => Ok(()),
        }
    }

    /// A fragment with its message authentication code.
    pub(super) fn sign(&self, agent: AgentId, observation: Fragment) -> SignedObservation {
        let grant = self.grants.get(agent.index()).and_then(Option::as_ref);
        let mac = grant.and_then(|grant| grant.key.as_ref()).map_or(NONE, |key| key.of_observation(&observation));
        SignedObservation { observation, mac }
    }
}

/// The ids whose processes need not sign: those that the user names, and those that are controlled
/// by standard messages.
pub(in crate::session) fn with_external(policy: &JoinPolicy, unsigned: &BTreeSet<AgentId>) -> JoinPolicy {
    JoinPolicy { external: policy.external.union(unsigned).copied().collect(), ..policy.clone() }
}
