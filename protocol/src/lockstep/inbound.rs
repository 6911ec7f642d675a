//! Inbound messages of agents: joins and commands, accepted or refused.
//!
//! **Replacement of a process.** Under `faults.on_agent_loss = "wait"` a second process that joins
//! with a taken id is held as a rival. It is refused when the first process answers an observation
//! that was sent after the join; it takes over when the first one is lost. The observation log is
//! then replayed to it before it gets a new observation, so it must start without state: a process
//! that has answered something and was replaced cannot return. A process that is replaced as one
//! agent is given up as all of them, so that its successor gets all. A process that has answered
//! ahead of its replay is refused, and must be started again.
//!
//! **Authentication** ([`authentication`](super::authentication)): a join is [`Verified`] before it
//! can hold or contend for an id, and a command before it can be a reply. A replacement gets a key
//! of its own, so that no command of its predecessor is accepted any more.
//!
//! Invariant: a refused message changes nothing but its counter.

use core::time::Duration;

use crate::signed::{JoinRequest, Signed, Verified};
use msgs::ids::{AgentId, Tick};
use msgs::maes_msgs::{Command, Join, JoinReply};

use super::agent_session::{Recall, Rival};
use super::membership::Lease;
use super::{AgentSessions, CommandReply, Event, Inbound, Incoming, Notice, Refusal, SourceId};

/// Wall time in which a process that repeats its join is not answered again: the reply is on its
/// way, to all processes. A large team that is answered more often than they can receive never
/// starts.
const REPLY_PERIOD: Duration = Duration::from_millis(900);

/// Refusals of one kind that are reported; further ones are only counted, because an agent may
/// flood.
const REFUSAL_REPORTS_MAX: u64 = 5;

/// What a process gets that asks for an id.
enum Claim {
    /// The id.
    Granted(Verified<JoinRequest>),
    /// Nothing yet: another process has the id, and is replaced if it does not answer.
    Held,
}

impl AgentSessions {
    /// Handles a message that has arrived at a time.
    pub fn handle(&mut self, incoming: Incoming, now: Duration) {
        self.advance_clock(now);
        let Incoming { topic_agent, source, message } = incoming;
        if self.is_of_earlier_run(&message) {
            return;
        }
        let handled = match message {
            Inbound::Join(join) => self.handle_join(topic_agent, source, &join, now),
            Inbound::Command(command) => self.handle_command(topic_agent, source, command, now),
            Inbound::Undecodable { reason } => Err(Refusal::Undecodable { topic: topic_agent, reason }),
        };
        if let Err(refusal) = handled {
            self.count(refusal);
        }
    }

    /// Whether a message was sent before the last reset of this server; such a message is no fault.
    fn is_of_earlier_run(&self, message: &Inbound) -> bool {
        let run = match message {
            Inbound::Join(request) => request.claimed().join.run,
            Inbound::Command(command) => command.claimed().run,
            Inbound::Undecodable { .. } => return false,
        };
        self.identity.succeeds(run)
    }

    fn count(&mut self, refusal: Refusal) {
        let count = self.refusals.entry(refusal.counter()).or_default();
        *count += 1;
        if let Refusal::IllegalCommand { agent, tick, reason } = &refusal {
            self.illegal_commands.insert(*agent, (*tick, reason.clone()));
        }
        if *count <= REFUSAL_REPORTS_MAX {
            let is_last = *count == REFUSAL_REPORTS_MAX;
            self.notice(Notice::Refused { refusal, is_last });
        }
    }

    fn handle_join(
        &mut self,
        topic: AgentId,
        source: SourceId,
        signed: &Signed<JoinRequest>,
        now: Duration,
    ) -> Result<(), Refusal> {
        let join = &signed.claimed().join;
        if join.run != self.identity.run() {
            return Err(Refusal::OtherRun { topic });
        }
        let agent = AgentId(join.agent);
        let claimed = self.claim(topic, agent, source, signed);
        match &claimed {
            Ok(Claim::Held) => {
                self.reply_held(source, signed);
                return Ok(());
            }
            Ok(Claim::Granted(request)) => {
                self.note_restart(agent, request);
                if request.join.last_tick != Join::NONE
                    && let Some(expected) = self.membership.session(agent).replayed_tick()
                    && Tick(request.join.last_tick) > expected
                {
                    self.refuse_overtaken(agent, expected);
                    return Ok(());
                }
            }
            Err(_) => {}
        }
        let granted = claimed.map(drop);
        self.reply(source, signed, &granted, now);
        granted
    }

    /// Grants an id to a process that asks for it, or holds the process until the one that has the
    /// id has shown whether it is alive.
    fn claim(
        &mut self,
        topic: AgentId,
        agent: AgentId,
        source: SourceId,
        signed: &Signed<JoinRequest>,
    ) -> Result<Claim, Refusal> {
        self.membership.check_join(topic, &signed.claimed().join)?;
        let request = self.authentication.verify_join(agent, source, signed)?;
        let is_rival = self.replays.allows_replacement
            && request.join.last_tick == Join::NONE
            && !self.membership.is_given_up(source);
        let lease = Lease::new(source, &request);
        let Self { membership, authentication, .. } = self;
        match membership.join(agent, lease.clone(), || authentication.grant(agent, source, signed)) {
            Err(Refusal::IdTaken { .. }) if is_rival => {}
            granted => return granted.map(|()| Claim::Granted(request)),
        }
        // The next observation shows whether the present process is alive.
        let rival = Rival { since: self.tick(), source, join: signed.clone() };
        if self.membership.session_mut(agent).hold(rival) {
            return Ok(Claim::Held);
        }
        let Self { membership, authentication, .. } = self;
        membership.replace(agent, lease, || authentication.grant(agent, source, signed))?;
        self.notice(Notice::Replaced { agent });
        self.continue_replay(agent);
        Ok(Claim::Granted(request))
    }
    /// Reports and counts a process that has started itself again, once.
    fn note_restart(&mut self, agent: AgentId, request: &Verified<JoinRequest>) {
        let JoinRequest { join, starts, .. } = &**request;
        if *starts > 1 && self.restarted.insert(join.instance) {
            self.notice(Notice::Restarted { agent, times: starts - 1 });
        }
    }

    /// Refuses a process that has answered an observation ahead of its replay, because a late copy
    /// of it has overtaken the others: it ignores earlier ones, and must be started again.
    fn refuse_overtaken(&mut self, agent: AgentId, expected: Tick) {
        if let Some(holder) = self.membership.holder(agent) {
            let reason = format!("a later observation has overtaken that of tick {expected}; start it again");
            let (run, instance, code) = (self.identity.run(), holder.lease.instance, JoinReply::OVERTAKEN);
            let reply = JoinReply { run, agent: agent.0, instance, code, reason, ..JoinReply::default() };
            let (source, join) = (holder.lease.source, holder.grant.join());
            self.send_reply(self.authentication.complete(reply, source, join, Some(&holder.grant)));
        }
    }

    /// Replies to a join. All agents receive the reply, and compare its instance with their own: a
    /// foreign process that uses the instance of a member must not make that member hear a refusal.
    /// A member that is given up must hear it, since it has to end for its successor to be started.
    fn reply(&mut self, source: SourceId, join: &Signed<JoinRequest>, granted: &Result<(), Refusal>, now: Duration) {
        let Join { run, agent, instance, .. } = join.claimed().join;
        let id = AgentId(agent);
        let is_of_member = || {
            let holder = self.membership.holder(id).filter(|holder| holder.lease.instance == instance);
            holder.is_some_and(|holder| !self.membership.is_given_up(holder.lease.source))
        };
        if granted.is_err() && is_of_member() {
            return;
        }
        if granted.is_ok() && !self.begins_reply_period(id, now) {
            return;
        }
        let reason = granted.as_ref().err().map_or_else(String::new, Refusal::to_string);
        let code = granted.as_ref().err().map_or(JoinReply::NONE, Refusal::code);
        let accepted = granted.is_ok();
        let reply = JoinReply { run, agent, instance, accepted, code, reason, ..JoinReply::default() };
        let grant = self.membership.holder(id).map(|holder| &holder.grant);
        self.send_reply(self.authentication.complete(reply, source, join, grant));
    }

    /// Whether the process of an agent was not accepted within the last [`REPLY_PERIOD`]; then a
    /// new one begins.
    fn begins_reply_period(&mut self, agent: AgentId, now: Duration) -> bool {
        let Some(holder) = self.membership.session_mut(agent).holder_mut() else { return false };
        let is_recent = holder.accepted_at.is_some_and(|at| now.saturating_sub(at) < REPLY_PERIOD);
        if !is_recent {
            holder.accepted_at = Some(now);
        }
        !is_recent
    }

    /// Replies to a process that the id it joins with is held for now.
    fn reply_held(&mut self, source: SourceId, signed: &Signed<JoinRequest>) {
        let Join { run, agent, instance, .. } = signed.claimed().join;
        let reason = format!("agent {agent} is held by another process, which is replaced if it does not answer");
        let reply = JoinReply { run, agent, instance, code: JoinReply::HELD, reason, ..JoinReply::default() };
        self.send_reply(self.authentication.complete(reply, source, signed, None));
    }

    /// Refuses the process that has asked for the id of one that answers.
    fn refuse_rival(&mut self, agent: AgentId, tick: Tick, now: Duration) {
        if let Some(Rival { source, join, .. }) = self.membership.session_mut(agent).refuse_rival(tick) {
            let refusal = Refusal::IdTaken { agent };
            self.reply(source, &join, &Err(refusal.clone()), now);
            self.count(refusal);
        }
    }

    fn handle_command(
        &mut self,
        topic: AgentId,
        source: SourceId,
        signed: Signed<Command>,
        now: Duration,
    ) -> Result<(), Refusal> {
        let &Command { run, agent, tick, .. } = signed.claimed();
        let (agent, tick) = (AgentId(agent), Tick(tick));
        if run != self.identity.run() {
            return Err(Refusal::OtherRun { topic });
        }
        if agent != topic {
            return Err(Refusal::WrongTopic { topic, named: agent });
        }
        let command = self.membership.check(agent, source)?.grant.verify(agent, signed)?;
        let command = command.map(|command| Command { run: 0, ..command });
        let session = self.membership.session_mut(agent);
        match session.recall(&command) {
            Recall::Complete => {}
            Recall::Retransmit => return Ok(()),
            Recall::Same => {
                // If it was prompted for again, it comes once more, maybe after the replay.
                session.expected.note_command(&command);
                self.note_alive(agent);
                self.continue_replay(agent);
                return Ok(());
            }
            Recall::OutOfOrder { expected } => {
                self.refuse_overtaken(agent, expected);
                return Err(Refusal::WrongTick { agent, got: tick, expected });
            }
            Recall::Different(recorded) => {
                self.events.push_back(Event::Diverged { agent, tick, recorded, given: Box::new(command.into_inner()) });
                return Ok(());
            }
        }
        if let Err(refusal) = self.expects(agent, tick) {
            let expected = &mut self.membership.session_mut(agent).expected;
            return if expected.excuses(&command, &refusal) { Ok(()) } else { Err(refusal) };
        }
        let reply = CommandReply::new(command, self.membership.agents()).map_err(|reason| Refusal::IllegalCommand {
            agent,
            tick,
            reason,
        })?;
        self.membership.session_mut(agent).expected.note_command(&reply.message);
        self.note_alive(agent);
        self.refuse_rival(agent, tick, now);
        self.accept(agent, tick, reply)
    }
}
