//! Authentication of the agents: who may join, and whether a command comes from whoever has joined.
//!
//! Over a private transport, to which only the agents have access, nothing is signed. Over an open
//! one every process must sign its commands, except those of third-party agents, which foreign
//! nodes run. With a join secret a process must prove that it knows it.
//!
//! Invariant: a process keeps the key that it was granted.

use super::{JoinPolicy, Refusal, RunIdentity, SourceId};
use crate::signed::{JoinRequest, Signed, Verified};
use crate::signing::{self, Bytes, JoinContext, NONE, SessionKey};
use msgs::ids::{AgentId, Tick};
use msgs::maes_msgs::{Command, JoinReply, Observation as Fragment, Scenario};

const UNPROVEN: &str = "does not prove the join secret of this run; expected the same MAES_JOIN_SECRET or \
                        --join-secret-file on both sides";

const UNSIGNED: &str = "comes from a process that does not sign its commands; a foreign node needs \
                        --external with this id, or agents.command_signs = false for agents.command";

/// What a process that holds an id was sent.
#[derive(Debug, Clone, Default)]
pub(super) struct Grant {
    /// The join that was granted.
    join: Signed<JoinRequest>,
    /// Of the server, with a join secret.
    nonce: Bytes,
    /// The key as it is sent, without a join secret.
    sent_key: Bytes,
    /// `None`: the process does not sign.
    key: Option<SessionKey>,
}

impl Grant {
    /// The join that was granted.
    pub(super) fn join(&self) -> &Signed<JoinRequest> {
        &self.join
    }

    /// A command of the process, if it is signed by it.
    pub(super) fn verify(&self, agent: AgentId, command: Signed<Command>) -> Result<Verified<Command>, Refusal> {
        let tick = Tick(command.claimed().tick);
        command.verify_with(self.key.as_ref()).map_err(|_| Refusal::ForgedCommand { agent, tick })
    }

    /// Signs a fragment of an observation for the process.
    pub(super) fn sign(&self, fragment: Fragment) -> Signed<Fragment> {
        Signed::sign_with(fragment, self.key.as_ref())
    }
}

/// Who may join a run, and with which keys.
#[derive(Debug, Clone)]
pub(super) struct Authentication {
    policy: JoinPolicy,
    identity: RunIdentity,
    is_open: bool,
    announcement: Bytes,
    /// Number of grants so far.
    granted: u64,
}

impl Authentication {
    pub(super) fn new(policy: JoinPolicy, identity: RunIdentity) -> Self {
        Self { policy, identity, is_open: false, announcement: NONE, granted: 0 }
    }

    /// Notes the announcement, and whether others than the agents can send on the transport.
    pub(super) fn announce(&mut self, scenario: &Scenario, is_open: bool) {
        self.announcement = signing::announcement(scenario);
        self.is_open = is_open;
    }

    fn is_external(&self, agent: AgentId) -> bool {
        self.policy.third_party.contains(&agent)
    }

    /// The join of a process that signs its commands, and proves the join secret if there is one.
    fn proven(&self, source: SourceId, join: &Signed<JoinRequest>) -> Option<Verified<JoinRequest>> {
        let join = join.clone();
        let proven = match &self.policy.secret {
            Some(secret) => join.verify(&secret.join_key(&self.announcement, &source.0)).ok()?,
            None => join.trusted(),
        };
        (proven.nonce != NONE).then_some(proven)
    }

    /// The join of a process that may join.
    pub(super) fn verify_join(
        &self,
        agent: AgentId,
        source: SourceId,
        join: &Signed<JoinRequest>,
    ) -> Result<Verified<JoinRequest>, Refusal> {
        if !self.is_open || self.is_external(agent) {
            return Ok(join.clone().trusted());
        }
        let what = if self.policy.secret.is_some() { UNPROVEN } else { UNSIGNED };
        self.proven(source, join).ok_or(Refusal::UnprovenJoin { agent, what })
    }

    /// Grants an id to a process.
    pub(super) fn grant(&mut self, agent: AgentId, source: SourceId, join: &Signed<JoinRequest>) -> Grant {
        self.granted += 1;
        let run = self.identity.run();
        let number = [run.to_le_bytes(), u64::from(agent.0).to_le_bytes(), self.granted.to_le_bytes()].concat();
        let mut grant = Grant { join: join.clone(), nonce: NONE, sent_key: NONE, key: None };
        if self.is_open && self.proven(source, join).is_some() {
            let random = self.identity.random().derive(b"grant", &[&number]);
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
        grant
    }

    /// Completes the reply to a join with the proof of the server, and with what the process needs
    /// for its key if it was granted the id.
    pub(super) fn complete(
        &self,
        mut reply: JoinReply,
        source: SourceId,
        join: &Signed<JoinRequest>,
        grant: Option<&Grant>,
    ) -> JoinReply {
        if !self.is_open {
            return reply;
        }
        if let Some(grant) = grant.filter(|_| reply.accepted) {
            (reply.nonce, reply.key) = (grant.nonce, grant.sent_key);
        }
        let Some(secret) = &self.policy.secret else { return reply };
        let context = JoinContext { announcement: &self.announcement, source: &source.0, join };
        Signed::sign(reply, &secret.reply_key(context)).into()
    }
}
