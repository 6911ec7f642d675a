//! Inbound messages of agents: joins and commands, accepted or refused.
//!
//! **Replacement of a process.** Under `faults.on_agent_loss = "wait"` a second process that joins
//! with a taken id is held as a contender. It is refused when the first process answers an
//! observation that was sent after the join; it takes over when the first one is given up. The
//! observation log is then replayed to it before it gets a new observation, so it must start
//! without state: a process that has answered something and was replaced cannot return. A process
//! that is replaced as one agent is given up as all of them, so that its successor gets all. A
//! process that has answered ahead of its replay is refused, and must be started again.
//!
//! **Authentication** ([`authentication`](super::authentication)): a join is proven before it can
//! hold or contend for an id, and a replacement gets a key of its own, so that no command of its
//! predecessor is accepted any more.
//!
//! Invariant: a refused message changes nothing but its counter.

use std::time::Instant;

use msgs::cdr;
use msgs::ids::{AgentId, Tick};
use msgs::maes_msgs::{Command, Join, JoinReply, SignedCommand, SignedJoin};
use msgs::signing::NONE;

use super::observation_log::Recall;
use super::{AgentSessions, CommandReply, REFUSAL_REPORTS_MAX, REPLY_PERIOD, WaitContext};
use crate::transport::{Inbound, Incoming};
use simulation::lockstep::{Barrier, JoinRequest, Lease, Refusal, SourceId};
use simulation::wire;

impl AgentSessions {
    pub(super) fn handle(
        &mut self,
        incoming: Incoming,
        barrier: &mut Barrier<CommandReply>,
        context: &mut WaitContext<'_, '_>,
    ) {
        let Incoming { topic_agent, source, message } = incoming;
        if self.is_of_earlier_run(&message) {
            return;
        }
        let handled = match message {
            Inbound::Join(join) => {
                let unsigned = SignedJoin { join, ..SignedJoin::default() };
                self.handle_join(topic_agent, source, unsigned, barrier, context)
            }
            Inbound::SignedJoin(join) => self.handle_join(topic_agent, source, join, barrier, context),
            Inbound::Command(command) => {
                let unsigned = SignedCommand { command, mac: NONE };
                self.handle_command(topic_agent, source, unsigned, barrier, context)
            }
            Inbound::SignedCommand(command) => self.handle_command(topic_agent, source, command, barrier, context),
            Inbound::Undecodable { reason } => Err(Refusal::Undecodable { topic: topic_agent, reason }),
        };
        self.count(handled, context);
    }

    /// Whether a message was sent before the last reset of this server; such a message is no fault.
    fn is_of_earlier_run(&self, message: &Inbound) -> bool {
        let run = match message {
            Inbound::Join(join) | Inbound::SignedJoin(SignedJoin { join, .. }) => join.run,
            Inbound::Command(command) | Inbound::SignedCommand(SignedCommand { command, .. }) => command.run,
            Inbound::Undecodable { .. } => return false,
        };
        self.start.succeeds(run)
    }

    fn count(&mut self, handled: Result<(), Refusal>, context: &mut WaitContext<'_, '_>) {
        if let Err(refusal) = handled {
            let name = refusal.counter();
            let count = self.refusals.entry(name).or_default();
            *count += 1;
            match *count {
                ..REFUSAL_REPORTS_MAX => context.warn(&format!("refused: {refusal}")),
                REFUSAL_REPORTS_MAX => {
                    context.warn(&format!("refused: {refusal} (more of this kind are only counted: {name})"));
                }
                _ => {}
            }
        }
    }

    fn handle_join(
        &mut self,
        topic: AgentId,
        source: SourceId,
        signed: SignedJoin,
        barrier: &Barrier<CommandReply>,
        context: &mut WaitContext<'_, '_>,
    ) -> Result<(), Refusal> {
        let join = &signed.join;
        if join.run != self.start.run() {
            return Err(Refusal::OtherRun { topic });
        }
        let agent = AgentId(join.agent);
        let lease = Lease { source, instance: join.instance, controller: join.controller.clone() };
        let request = JoinRequest { topic, agent, protocol: join.protocol, lease: lease.clone() };
        let is_contender =
            self.allows_replacement && join.last_tick == Join::NONE && !self.membership.is_given_up(source);
        let mut granted = self
            .membership
            .check_request(&request)
            .and_then(|()| self.authentication.check_join(agent, source, &signed))
            .and_then(|()| self.membership.join(request));
        if is_contender && matches!(granted, Err(Refusal::IdTaken { .. })) {
            let holder = self.membership.lease(agent).map(|lease| lease.source);
            let is_given_up = holder.is_some_and(|holder| self.membership.is_given_up(holder));
            if !self.unresponsive.contains(&agent) && !is_given_up {
                // The next observation shows whether the present process is alive.
                let since = self.contenders.get(&agent).map_or(barrier.tick(), |(since, ..)| *since);
                self.reply_held(source, &signed, context);
                self.contenders.insert(agent, (since, source, signed));
                return Ok(());
            }
            granted = self.membership.replace(agent, lease);
            if granted.is_ok() {
                self.start_replay(agent, barrier, context);
            }
        }
        if granted.is_ok() {
            self.authentication.grant(agent, source, &signed);
            self.note_restart(agent, &signed, context);
        }
        if granted.is_ok()
            && join.last_tick != Join::NONE
            && let Some(expected) = self.observation_log.expected(agent)
            && Tick(join.last_tick) > expected
        {
            self.refuse_overtaken(agent, expected, context);
            return Ok(());
        }
        self.reply(source, &signed, &granted, context);
        granted
    }

    /// Reports and counts a process that has started itself again, once.
    fn note_restart(&mut self, agent: AgentId, signed: &SignedJoin, context: &mut WaitContext<'_, '_>) {
        let SignedJoin { join, starts, .. } = signed;
        if *starts > 1 && self.restarted.insert(join.instance) {
            let again = starts - 1;
            context.warn(&format!("the process of agent {agent} has stalled at its start, and began again ({again}x)"));
        }
    }

    /// Refuses a process that has answered an observation ahead of its replay, because a late copy
    /// of it has overtaken the others: it ignores earlier ones, and must be started again.
    fn refuse_overtaken(&mut self, agent: AgentId, expected: Tick, context: &mut WaitContext<'_, '_>) {
        if let Some(lease) = self.membership.lease(agent) {
            let reason = format!("a later observation has overtaken that of tick {expected}; start it again");
            let (run, instance, code) = (self.start.run(), lease.instance, JoinReply::OVERTAKEN);
            let reply = JoinReply { run, agent: agent.0, instance, code, reason, ..JoinReply::default() };
            context.transport.reply_join(&self.authentication.complete_for_holder(agent, reply));
        }
    }

    /// Starts to replay the observation log of an agent to its new process.
    fn start_replay(&mut self, agent: AgentId, barrier: &Barrier<CommandReply>, context: &mut WaitContext<'_, '_>) {
        self.unresponsive.remove(&agent);
        self.contenders.remove(&agent);
        if barrier.answer(agent).is_some() {
            self.answered_by_predecessor.insert(agent);
        }
        self.observation_log.rewind(agent);
        self.to_prompt.insert(agent);
        context.warn(&format!("agent {agent} was started again; its observation log is replayed to it"));
    }

    /// Replies to a join. All agents receive the reply, and compare its instance with their own: a
    /// foreign process that uses the instance of a member must not make that member hear a refusal.
    /// A member that is given up must hear it, since it has to end for its successor to be started.
    fn reply(
        &mut self,
        source: SourceId,
        join: &SignedJoin,
        granted: &Result<(), Refusal>,
        context: &mut WaitContext<'_, '_>,
    ) {
        let Join { run, agent, instance, .. } = join.join;
        let is_of_member = |lease: &Lease| lease.instance == instance && !self.membership.is_given_up(lease.source);
        if granted.is_err() && self.membership.lease(AgentId(agent)).is_some_and(is_of_member) {
            return;
        }
        if granted.is_ok() && !self.begins_reply_period(AgentId(agent), instance, context.transport.now()) {
            return;
        }
        let reason = granted.as_ref().err().map_or_else(String::new, Refusal::to_string);
        let code = granted.as_ref().err().map_or(JoinReply::NONE, Refusal::code);
        let accepted = granted.is_ok();
        let reply = JoinReply { run, agent, instance, accepted, code, reason, ..JoinReply::default() };
        context.transport.reply_join(&self.authentication.complete(reply, source, join));
    }

    /// Whether an instance was not accepted within the last [`REPLY_PERIOD`]; then a new one
    /// begins.
    fn begins_reply_period(&mut self, agent: AgentId, instance: u64, now: Instant) -> bool {
        let is_recent =
            |&(accepted, at): &(u64, Instant)| accepted == instance && now.saturating_duration_since(at) < REPLY_PERIOD;
        if self.replied.get(&agent).is_some_and(is_recent) {
            return false;
        }
        self.replied.insert(agent, (instance, now));
        true
    }

    /// Replies to a process that the id it joins with is held for now.
    fn reply_held(&mut self, source: SourceId, signed: &SignedJoin, context: &mut WaitContext<'_, '_>) {
        let Join { run, agent, instance, .. } = signed.join;
        let reason = format!("agent {agent} is held by another process, which is replaced if it does not answer");
        let reply = JoinReply { run, agent, instance, code: JoinReply::HELD, reason, ..JoinReply::default() };
        context.transport.reply_join(&self.authentication.complete(reply, source, signed));
    }

    /// Notes that a process is alive, with all its agents, so that no other one replaces it.
    fn note_alive(&mut self, agent: AgentId, source: SourceId, tick: Tick, context: &mut WaitContext<'_, '_>) {
        if !self.unresponsive.is_empty() {
            for agent in self.membership.agents_of(source) {
                self.unresponsive.remove(&agent);
            }
        }
        // A reply to an observation from before the contender's join may have been on its way when
        // its process died.
        if self.contenders.get(&agent).is_some_and(|(since, ..)| tick > *since)
            && let Some((_, source, join)) = self.contenders.remove(&agent)
        {
            let refused = Err(Refusal::IdTaken { agent });
            self.reply(source, &join, &refused, context);
            self.count(refused, context);
        }
    }

    fn handle_command(
        &mut self,
        topic: AgentId,
        source: SourceId,
        SignedCommand { mut command, mac }: SignedCommand,
        barrier: &mut Barrier<CommandReply>,
        context: &mut WaitContext<'_, '_>,
    ) -> Result<(), Refusal> {
        if command.run != self.start.run() {
            return Err(Refusal::OtherRun { topic });
        }
        let agent = AgentId(command.agent);
        let tick = Tick(command.tick);
        if agent != topic {
            return Err(Refusal::WrongTopic { topic, named: agent });
        }
        self.membership.check(agent, source)?;
        self.authentication.check_command(agent, &command, &mac)?;
        command.run = 0;
        match self.observation_log.recall(agent, &command) {
            Recall::Complete => {}
            Recall::Retransmit => return Ok(()),
            Recall::Same => {
                // If it was prompted for again, it comes once more, maybe after the replay.
                self.last_commands[agent.index()] = Some(command);
                self.to_prompt.insert(agent);
                return Ok(());
            }
            Recall::OutOfOrder { expected } => {
                self.refuse_overtaken(agent, expected, context);
                return Err(Refusal::WrongTick { agent, got: tick, expected });
            }
            Recall::Different { what } => {
                self.divergence = Some((agent, tick, what));
                return Ok(());
            }
        }
        if let Err(refusal) = barrier.expect(agent, tick) {
            let due = &mut self.retransmits_due[agent.index()];
            // Compared as bytes: a field may be NaN, which does not equal itself.
            let is_same = |last: &Command| cdr::encode(last) == cdr::encode(&command);
            if *due > 0 && self.last_commands[agent.index()].as_ref().is_some_and(is_same) {
                *due -= 1;
                return Ok(());
            }
            if matches!(refusal, Refusal::SecondAnswer { .. }) && self.abandoned.remove(&agent) {
                return Ok(());
            }
            return Err(refusal);
        }
        let (action, trigger) =
            wire::command(&command, self.agents).map_err(|reason| Refusal::IllegalCommand { agent, tick, reason })?;
        self.last_commands[agent.index()] = Some(command.clone());
        self.note_alive(agent, source, tick, context);
        barrier.accept(agent, tick, CommandReply { message: command, action, trigger })
    }
}
