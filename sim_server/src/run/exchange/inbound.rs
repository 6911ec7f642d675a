//! What comes in: joins and commands, taken in or refused.
//!
//! **When somebody takes the place of a process.** Where lost agents are waited for, a second process that claims an id waits until
//! the first one answers something that it was asked later, and is refused then; or until the first one is given up, and takes
//! its place. It is told its past before it is asked anything. So it must know nothing: a process that has answered something and was
//! given up in favour of another one cannot come back.
//!
//! Invariant: what is refused changes nothing but its counter.

use msgs::cdr;
use msgs::ids::{AgentId, Tick};
use msgs::maes_msgs::{Command, Join, JoinReply};

use super::{Answer, Exchange, NOTES_MAX};
use crate::link::{Inbound, Incoming};
use crate::run::Watcher;
use crate::run::history::Recall;
use simulation::lockstep::SourceId;
use simulation::lockstep::{Barrier, Claim, Refusal, Seat};
use simulation::wire;

impl Exchange<'_> {
    pub(super) fn handle(&mut self, incoming: Incoming, barrier: &mut Barrier<Answer>, watcher: &mut dyn Watcher) {
        let Incoming { topic_agent, source, message } = incoming;
        if self.is_left_over(&message) {
            return;
        }
        let handled = match message {
            Inbound::Join(join) => self.handle_join(topic_agent, source, join, barrier.tick(), watcher),
            Inbound::Command(command) => self.handle_command(topic_agent, source, command, barrier, watcher),
            Inbound::Undecodable { reason } => Err(Refusal::Undecodable { topic: topic_agent, reason }),
        };
        self.count(handled, watcher);
    }

    /// Whether something was said in a run that has begun again since: nobody is to blame for it.
    fn is_left_over(&self, message: &Inbound) -> bool {
        let run = match message {
            Inbound::Join(join) => join.run,
            Inbound::Command(command) => command.run,
            Inbound::Undecodable { .. } => return false,
        };
        self.start.comes_after(run)
    }

    fn count(&mut self, handled: Result<(), Refusal>, watcher: &mut dyn Watcher) {
        if let Err(refusal) = handled {
            let name = refusal.counter();
            let count = self.refusals.entry(name).or_default();
            *count += 1;
            match *count {
                ..NOTES_MAX => self.warn(watcher, &format!("refused: {refusal}")),
                NOTES_MAX => {
                    self.warn(watcher, &format!("refused: {refusal} (more of this kind are only counted: {name})"));
                }
                _ => {}
            }
        }
    }

    fn handle_join(
        &mut self,
        topic: AgentId,
        source: SourceId,
        join: Join,
        tick: Tick,
        watcher: &mut dyn Watcher,
    ) -> Result<(), Refusal> {
        if join.run != self.start.run() {
            return Err(Refusal::OtherRun { topic });
        }
        let agent = AgentId(join.agent);
        let seat = Seat { source, instance: join.instance, controller: join.controller.clone() };
        let mut granted = self.roster.join(Claim { topic, agent, protocol: join.protocol, seat: seat.clone() });
        if self.has_successors && join.last_tick == Join::NONE && matches!(granted, Err(Refusal::IdTaken { .. })) {
            if !self.silent.contains(&agent) {
                // Whether the other process is alive is found out when it is asked.
                let since = self.contenders.get(&agent).map_or(tick, |(since, _)| *since);
                self.contenders.insert(agent, (since, join));
                return Ok(());
            }
            granted = self.roster.replace(agent, seat);
            if granted.is_ok() {
                self.take_place(agent, watcher);
            }
        }
        self.reply(&join, &granted);
        granted
    }

    /// A new process runs an agent.
    fn take_place(&mut self, agent: AgentId, watcher: &mut dyn Watcher) {
        self.silent.remove(&agent);
        self.contenders.remove(&agent);
        self.history.start_again(agent);
        self.prompts.insert(agent);
        self.warn(watcher, &format!("agent {agent} was started again and is told what it has observed so far"));
    }

    /// Answers a join. Everybody hears that, and knows by the instance whether it is meant: a stranger that uses the instance of an
    /// agent that takes part must not have it told that it is refused.
    fn reply(&mut self, join: &Join, granted: &Result<(), Refusal>) {
        let Join { run, agent, instance, .. } = *join;
        let is_borrowed = self.roster.seat(AgentId(agent)).is_some_and(|seat| seat.instance == instance);
        if granted.is_err() && is_borrowed {
            return;
        }
        let reason = granted.as_ref().err().map_or_else(String::new, Refusal::to_string);
        self.link.reply_join(&JoinReply { run, agent, instance, accepted: granted.is_ok(), reason });
    }

    /// A process has answered: it is there, and so are its agents, and nobody takes its place.
    fn shows_life(&mut self, agent: AgentId, source: SourceId, tick: Tick, watcher: &mut dyn Watcher) {
        if !self.silent.is_empty() {
            for agent in self.roster.agents_of(source) {
                self.silent.remove(&agent);
            }
        }
        // An answer to what was asked before the other one came may have been on its way when its process died.
        if self.contenders.get(&agent).is_some_and(|(since, _)| tick > *since)
            && let Some((_, join)) = self.contenders.remove(&agent)
        {
            let refused = Err(Refusal::IdTaken { agent });
            self.reply(&join, &refused);
            self.count(refused, watcher);
        }
    }

    fn handle_command(
        &mut self,
        topic: AgentId,
        source: SourceId,
        mut command: Command,
        barrier: &mut Barrier<Answer>,
        watcher: &mut dyn Watcher,
    ) -> Result<(), Refusal> {
        if std::mem::take(&mut command.run) != self.start.run() {
            return Err(Refusal::OtherRun { topic });
        }
        let agent = AgentId(command.agent);
        let tick = Tick(command.tick);
        if agent != topic {
            return Err(Refusal::WrongTopic { topic, named: agent });
        }
        self.roster.check(agent, source)?;
        match self.history.recall(agent, &command) {
            Recall::Present => {}
            Recall::Again => return Ok(()),
            Recall::Same => {
                self.prompts.insert(agent);
                return Ok(());
            }
            Recall::OutOfOrder { expected } => return Err(Refusal::WrongTick { agent, got: tick, expected }),
            Recall::Different { what } => {
                self.diverged = Some((agent, tick, what));
                return Ok(());
            }
        }
        if let Err(refusal) = barrier.expect(agent, tick) {
            let echoes = &mut self.echoes[agent.index()];
            // The same bytes: numbers that nobody looks at may be NaN, which is not equal to itself.
            let is_echo = |last: &Command| cdr::encode(last) == cdr::encode(&command);
            if *echoes > 0 && self.last[agent.index()].as_ref().is_some_and(is_echo) {
                *echoes -= 1;
                return Ok(());
            }
            return Err(refusal);
        }
        let (action, wake) =
            wire::command(&command, self.agents).map_err(|reason| Refusal::IllegalCommand { agent, tick, reason })?;
        self.last[agent.index()] = Some(command.clone());
        self.shows_life(agent, source, tick, watcher);
        barrier.accept(agent, tick, Answer { message: command, action, wake })
    }
}
