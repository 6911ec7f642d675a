//! Questions and answers: sends observations, sends them again on silence, and takes in what is legal.
//!
//! Invariants: a refused message changes nothing but its counter; sending again changes nothing, because a tick has one answer;
//! every wait is bounded; what goes in and comes out has no number of a run: it is put on and taken off here.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use msgs::cdr;
use msgs::ids::{AgentId, Tick};
use msgs::limits::PROTOCOL;
use msgs::maes_msgs::{Command, Join, JoinReply, Observation as Part, Progress, Scenario};

use msgs::nav_msgs::Odometry;
use msgs::sensor_msgs::PointCloud2;

use super::log::Log;
use super::{Watcher, now};
use crate::control::Request;
use crate::link::{Inbound, Incoming, Level, Link, SourceId};
use crate::lockstep::{Barrier, Claim, Refusal, Roster, Seat, Wake};
use crate::recorder::RecordError;
use crate::views::{Listeners, Picture, View};
use crate::wire;
use crate::world::body::Motion;
use crate::world::{Action, LidarRequest, Since};

/// Wall time of silence after which an observation is sent again the first time; it doubles from then on.
const SEND_AGAIN_FIRST: Duration = Duration::from_millis(100);

/// Wall time between two sendings at the most.
const SEND_AGAIN_MAX: Duration = Duration::from_secs(1);

/// Wall time for which the loop waits for a message before it looks at its other duties.
pub(super) const PATIENCE: Duration = Duration::from_millis(50);

/// Wall time between two looks at the inbox that counts as waiting for an answer, at the most.
const LOOK_MAX: Duration = Duration::from_millis(200);

/// Refusals of one kind that people are told about; the others are only counted, for an agent may flood.
const NOTES_MAX: u64 = 5;

/// An agent that is asked in a tick.
#[derive(Debug, Clone)]
pub(super) struct Asked {
    /// Who.
    pub(super) agent: AgentId,
    /// Whether it is its turn, or it is asked all the same.
    pub(super) since: Since,
    /// What it is told.
    pub(super) parts: Vec<Part>,
}

/// A legal answer.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Answer {
    /// As it came.
    pub(super) message: Command,
    /// What it does.
    pub(super) action: Action,
    /// When to ask again.
    pub(super) wake: Wake,
}

impl Answer {
    /// Whether the run would be the same without it.
    pub(super) fn does_nothing(&self) -> bool {
        let Action { motion, lidar, want_view, parcels } = &self.action;
        *motion == Motion::Keep
            && *lidar == LidarRequest::Keep
            && !want_view
            && parcels.is_empty()
            && self.message.info.is_empty()
    }
}

/// Why not all answers are there.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Silence {
    /// Those that are.
    pub(super) answers: BTreeMap<AgentId, Answer>,
    /// Who has not answered, ascending.
    pub(super) silent: Vec<AgentId>,
}

/// What goes on while messages are awaited.
pub(super) struct Meanwhile<'a> {
    /// Is told what a person should read.
    pub(super) watcher: &'a mut dyn Watcher,
    /// Is saved now and then.
    pub(super) log: &'a mut Log,
    /// Ends the waiting.
    pub(super) stop: &'a AtomicBool,
}

impl Meanwhile<'_> {
    /// To be called between two messages: whether to go on waiting.
    fn goes_on(&mut self) -> Result<bool, RecordError> {
        self.log.save_now_and_then()?;
        Ok(!self.stop.load(Ordering::Relaxed))
    }
}

/// The server's side of the protocol over a link.
pub(super) struct Exchange<'a> {
    link: &'a mut dyn Link,
    /// One that has come and was not taken yet.
    request: Option<Request>,
    /// Tells the messages of this run from those of any other. It must not get into the recording or the digest.
    run: u64,
    agents: u32,
    roster: Roster,
    last: Vec<Option<Command>>,
    /// How often a tick may be answered with the same words again, because it was asked again.
    echoes: Vec<u32>,
    refusals: BTreeMap<&'static str, u64>,
}

impl<'a> Exchange<'a> {
    pub(super) fn new(link: &'a mut dyn Link, run: u64, agents: u32) -> Self {
        Self {
            link,
            request: None,
            run,
            agents,
            roster: Roster::new(agents),
            last: vec![None; agents as usize],
            echoes: vec![0; agents as usize],
            refusals: Refusal::COUNTERS.into_iter().map(|name| (name, 0)).collect(),
        }
    }

    pub(super) fn announce(&mut self, scenario: &Scenario) {
        self.link.announce(&Scenario { run: self.run, ..scenario.clone() });
    }

    pub(super) fn clock(&mut self, tick: Tick) {
        self.link.clock(tick);
    }

    pub(super) fn progress(&mut self, progress: &Progress) {
        self.link.progress(progress);
    }

    /// See [`Link::drive`].
    pub(super) fn drive(&mut self, agent: AgentId, odometry: Odometry, points: Option<PointCloud2>) {
        self.link.drive(agent, odometry, points);
    }

    /// See [`Link::listeners`].
    pub(super) fn listeners(&mut self) -> Option<&Listeners> {
        self.link.listeners()
    }

    /// See [`Link::show`].
    pub(super) fn show(&mut self, view: View, picture: &Picture) {
        self.link.show(view, picture);
    }

    /// See [`Link::log`].
    pub(super) fn log(&mut self, level: Level, text: &str) {
        self.link.log(level, text);
    }

    /// Tells people that something is not as expected.
    fn warn(&mut self, watcher: &mut dyn Watcher, text: &str) {
        watcher.note(text);
        self.link.log(Level::Warn, text);
    }

    /// See [`Link::other_run`].
    pub(super) fn other_run(&self) -> Option<u64> {
        self.link.other_run()
    }

    /// See [`Link::request`].
    pub(super) fn request(&mut self) -> Option<Request> {
        self.request.take().or_else(|| self.link.request())
    }

    /// Whether there is a request.
    pub(super) fn is_asked(&mut self) -> bool {
        self.request = self.request();
        self.request.is_some()
    }

    /// What an agent runs, by agent, as far as they have joined.
    pub(super) fn controllers(&self) -> Vec<String> {
        let label = |agent| self.roster.seat(AgentId(agent)).map(|seat| seat.controller.clone()).unwrap_or_default();
        (0..self.agents).map(label).collect()
    }

    /// Ids that nobody has claimed, ascending.
    pub(super) fn missing(&self) -> Vec<AgentId> {
        self.roster.missing()
    }

    /// The joins that were granted, without what tells one process from another.
    pub(super) fn joins(&self) -> impl Iterator<Item = (AgentId, Join)> + '_ {
        (0..self.agents).map(AgentId).filter_map(|agent| {
            let controller = self.roster.seat(agent)?.controller.clone();
            let id = agent.0;
            let join = Join { run: 0, agent: id, instance: 0, protocol: PROTOCOL, controller, last_tick: Join::NONE };
            Some((agent, join))
        })
    }

    /// Counters of refusals by name.
    pub(super) fn refusals(&self) -> impl Iterator<Item = (&'static str, u64)> + '_ {
        Refusal::COUNTERS.into_iter().map(|name| (name, self.refusals[name]))
    }

    /// Takes in a message while nobody is asked, or waits so long for one, or until somebody asks something; `tick` is the one
    /// that comes next.
    pub(super) fn listen(
        &mut self,
        tick: Tick,
        wait: Duration,
        meanwhile: &mut Meanwhile<'_>,
    ) -> Result<(), RecordError> {
        if meanwhile.goes_on()?
            && let Some(incoming) = self.link.receive(wait.min(PATIENCE))
        {
            self.handle(incoming, &mut Barrier::new(tick, BTreeSet::new()), meanwhile.watcher);
        }
        Ok(())
    }

    /// Asks, and waits for all answers; sends again on silence. There is silence in the end if someone has not answered within
    /// `limit` of wall time, or the waiting was stopped.
    ///
    /// # Errors
    /// If the recording cannot be saved meanwhile.
    pub(super) fn ask(
        &mut self,
        tick: Tick,
        asked: &[Asked],
        limit: Duration,
        meanwhile: &mut Meanwhile<'_>,
    ) -> Result<Result<BTreeMap<AgentId, Answer>, Silence>, RecordError> {
        let mut barrier = Barrier::new(tick, asked.iter().map(|asked| asked.agent).collect());
        for asked in asked {
            self.send(asked);
        }
        let mut last_looked = now();
        let mut waited = Duration::ZERO;
        let mut patience = SEND_AGAIN_FIRST;
        let mut send_again = patience;
        while !barrier.is_complete() {
            if let Some(incoming) = self.link.receive(PATIENCE) {
                self.handle(incoming, &mut barrier, meanwhile.watcher);
            }
            if barrier.is_complete() {
                break;
            }
            // Looked at after every message, so that a flood of them puts off neither the limit nor the other agents. A time for
            // which this process could not look, because it was stopped, is nobody's fault.
            let looked = now();
            waited += looked.duration_since(last_looked).min(LOOK_MAX);
            last_looked = looked;
            if waited >= limit || !meanwhile.goes_on()? {
                let silent = barrier.missing().collect();
                return Ok(Err(Silence { answers: barrier.into_answers_so_far(), silent }));
            }
            if waited >= send_again {
                patience = (patience * 2).min(SEND_AGAIN_MAX);
                send_again = waited + patience;
                for asked in asked.iter().filter(|asked| barrier.awaits(asked.agent)) {
                    self.echoes[asked.agent.index()] += 1;
                    self.send(asked);
                }
            }
        }
        Ok(Ok(barrier.into_answers()))
    }

    /// Tells agents that the run is over, and waits a while for their receipts.
    ///
    /// # Errors
    /// If the recording cannot be saved meanwhile.
    pub(super) fn farewell(
        &mut self,
        tick: Tick,
        told: &[Asked],
        limit: Duration,
        meanwhile: &mut Meanwhile<'_>,
    ) -> Result<(), RecordError> {
        let told: Vec<Asked> = told.iter().filter(|told| self.roster.seat(told.agent).is_some()).cloned().collect();
        if let Err(Silence { silent, .. }) = self.ask(tick, &told, limit, meanwhile)? {
            let silent = crate::lockstep::listed(silent);
            self.warn(meanwhile.watcher, &format!("no receipt for the end of the run from: {silent}"));
        }
        Ok(())
    }

    fn send(&mut self, asked: &Asked) {
        for part in &asked.parts {
            self.link.send(asked.agent, &Part { run: self.run, ..part.clone() });
        }
    }

    fn handle(&mut self, incoming: Incoming, barrier: &mut Barrier<Answer>, watcher: &mut dyn Watcher) {
        let Incoming { topic_agent, source, message } = incoming;
        let handled = match message {
            Inbound::Join(join) => self.handle_join(topic_agent, source, join),
            Inbound::Command(command) => self.handle_command(topic_agent, source, command, barrier),
            Inbound::Undecodable { reason } => Err(Refusal::Undecodable { topic: topic_agent, reason }),
        };
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

    fn handle_join(&mut self, topic: AgentId, source: SourceId, join: Join) -> Result<(), Refusal> {
        let Join { run, agent, instance, protocol, controller, last_tick: _ } = join;
        if run != self.run {
            return Err(Refusal::OtherRun { topic });
        }
        let seat = Seat { source, instance, controller };
        let granted = self.roster.join(Claim { topic, agent: AgentId(agent), protocol, seat });
        let reason = granted.as_ref().err().map_or_else(String::new, Refusal::to_string);
        // Everybody hears the reply, and knows by the instance whether it is meant: a stranger that uses the instance of an agent
        // that takes part must not have it told that it is refused.
        let is_borrowed = self.roster.seat(AgentId(agent)).is_some_and(|seat| seat.instance == instance);
        if granted.is_ok() || !is_borrowed {
            self.link.reply_join(&JoinReply { run, agent, instance, accepted: granted.is_ok(), reason });
        }
        granted
    }

    fn handle_command(
        &mut self,
        topic: AgentId,
        source: SourceId,
        mut command: Command,
        barrier: &mut Barrier<Answer>,
    ) -> Result<(), Refusal> {
        if std::mem::take(&mut command.run) != self.run {
            return Err(Refusal::OtherRun { topic });
        }
        let agent = AgentId(command.agent);
        let tick = Tick(command.tick);
        if agent != topic {
            return Err(Refusal::WrongTopic { topic, named: agent });
        }
        self.roster.check(agent, source)?;
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
        barrier.accept(agent, tick, Answer { message: command, action, wake })
    }
}
