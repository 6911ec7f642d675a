//! Questions and answers: sends observations, sends them again on silence, and takes in what is legal.
//!
//! Invariants: a refused message changes nothing but its counter; sending again changes nothing, because a tick has one answer;
//! every wait is bounded or can be stopped; what goes in and comes out has no number of a run: it is put on and taken off here.

mod inbound;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use msgs::ids::{AgentId, Tick};
use msgs::limits::PROTOCOL;
use msgs::maes_msgs::{Command, Join, Observation as Part, Progress, Scenario};

use msgs::nav_msgs::Odometry;
use msgs::scan_request::ScanRequest;
use msgs::sensor_msgs::PointCloud2;
use msgs::trigger::Trigger;

use super::history::History;
use super::log::Log;
use super::{RunError, Start, Watcher, now};
use crate::control::Request;
use crate::link::{Level, Link};
use crate::recorder::RecordError;
use simulation::lockstep::{Barrier, Refusal, Roster, listed};
use simulation::scenario::{OnAgentLoss, Rtf};
use simulation::views::{Listeners, Picture, View};
use simulation::world::body::Motion;
use simulation::world::{Action, Since};

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
    pub(super) wake: Trigger,
}

impl Answer {
    /// Whether the run would be the same without it.
    pub(super) fn does_nothing(&self) -> bool {
        let Action { motion, lidar, want_view, parcels } = &self.action;
        *motion == Motion::Keep
            && *lidar == ScanRequest::Keep
            && !want_view
            && parcels.is_empty()
            && self.message.info.is_empty()
    }
}

/// What to do about silence.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Patience {
    /// To give up.
    Limited,
    /// To wait until somebody else takes the place of who is silent.
    Endless,
}

impl Patience {
    pub(super) fn of(on_agent_loss: OnAgentLoss) -> Self {
        match on_agent_loss {
            OnAgentLoss::Wait => Self::Endless,
            OnAgentLoss::Abort | OnAgentLoss::Drop => Self::Limited,
        }
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
pub(super) struct Meanwhile<'a, 's> {
    /// Is told what a person should read.
    pub(super) watcher: &'a mut dyn Watcher,
    /// Is saved now and then.
    pub(super) log: &'a mut Log<'s>,
    /// Ends the waiting.
    pub(super) stop: &'a AtomicBool,
}

impl Meanwhile<'_, '_> {
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
    start: Start,
    agents: u32,
    roster: Roster,
    last: Vec<Option<Command>>,
    /// How often a tick may be answered with the same words again, because it was asked again.
    echoes: Vec<u32>,
    refusals: BTreeMap<&'static str, u64>,
    history: History,
    /// Whether processes can take the place of others.
    has_successors: bool,
    /// Whose process is given up.
    silent: BTreeSet<AgentId>,
    /// Who claims the id of another process, and the tick in which that was.
    contenders: BTreeMap<AgentId, (Tick, Join)>,
    /// To whom there may be something to say.
    prompts: BTreeSet<AgentId>,
    /// Who has given another answer than before, when, and which.
    diverged: Option<(AgentId, Tick, String)>,
}

impl<'a> Exchange<'a> {
    pub(super) fn new(
        link: &'a mut dyn Link,
        start: Start,
        agents: u32,
        keeps_history: bool,
        has_successors: bool,
    ) -> Self {
        Self {
            history: History::new(agents, keeps_history),
            has_successors,
            silent: BTreeSet::new(),
            contenders: BTreeMap::new(),
            prompts: BTreeSet::new(),
            diverged: None,
            link,
            request: None,
            start,
            agents,
            roster: Roster::new(agents),
            last: vec![None; agents as usize],
            echoes: vec![0; agents as usize],
            refusals: Refusal::COUNTERS.into_iter().map(|name| (name, 0)).collect(),
        }
    }

    pub(super) fn announce(&mut self, scenario: &Scenario) {
        let (run, origin) = (self.start.run(), self.start.origin);
        self.link.announce(&Scenario { run, origin, ..scenario.clone() });
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

    /// See [`Link::pace`].
    pub(super) fn pace(&mut self, rtf: Rtf) {
        self.link.pace(rtf);
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
        (0..self.agents)
            .map(AgentId)
            .filter_map(|agent| Some((agent, recorded_join(agent, self.roster.seat(agent)?.controller.clone()))))
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
        meanwhile: &mut Meanwhile<'_, '_>,
    ) -> Result<(), RecordError> {
        if meanwhile.goes_on()?
            && let Some(incoming) = self.link.receive(wait.min(PATIENCE))
        {
            self.handle(incoming, &mut Barrier::new(tick, BTreeSet::new()), meanwhile.watcher);
        }
        Ok(())
    }

    /// See [`History::keep`].
    pub(super) fn keep(&mut self, agent: AgentId, parts: Vec<Part>, answer: &Command, is_known: bool) {
        self.history.keep(agent, parts, answer, is_known);
    }

    /// See [`History::excuse`].
    pub(super) fn excuse(&mut self, agent: AgentId) {
        self.history.excuse(agent);
    }

    /// Asks, and waits for all answers and until everybody knows its past; sends again on silence. There is silence in the end if
    /// someone has not answered within `limit` of wall time and patience is limited, or the waiting was stopped.
    ///
    /// # Errors
    /// If the recording cannot be saved meanwhile, or an agent gives another answer than before.
    pub(super) fn ask(
        &mut self,
        tick: Tick,
        asked: &[Asked],
        limit: Duration,
        patience: Patience,
        meanwhile: &mut Meanwhile<'_, '_>,
    ) -> Result<Result<BTreeMap<AgentId, Answer>, Silence>, RunError> {
        let mut barrier = Barrier::new(tick, asked.iter().map(|asked| asked.agent).collect());
        self.prompts = self.waited_for(&barrier);
        self.prompt(asked, &barrier);
        let mut last_looked = now();
        let mut waited = Duration::ZERO;
        let mut interval = SEND_AGAIN_FIRST;
        let mut send_again = interval;
        while self.is_waiting(&barrier) {
            if let Some(incoming) = self.link.receive(PATIENCE) {
                self.handle(incoming, &mut barrier, meanwhile.watcher);
            }
            if let Some((agent, tick, what)) = self.diverged.take() {
                return Err(RunError::Diverged { agent, tick, what });
            }
            if !self.prompts.is_empty() {
                // Somebody has come further: the others have not been silent for longer than before that.
                (waited, interval) = (Duration::ZERO, SEND_AGAIN_FIRST);
                send_again = interval;
                self.prompt(asked, &barrier);
            }
            if !self.is_waiting(&barrier) {
                break;
            }
            // Looked at after every message, so that a flood of them puts off neither the limit nor the other agents. A time for
            // which this process could not look, because it was stopped, is nobody's fault.
            let looked = now();
            waited += looked.duration_since(last_looked).min(LOOK_MAX);
            last_looked = looked;
            let is_over = waited >= limit && patience == Patience::Limited;
            if is_over || !meanwhile.goes_on()? {
                let silent = self.waited_for(&barrier).into_iter().collect();
                return Ok(Err(Silence { answers: barrier.into_answers_so_far(), silent }));
            }
            if waited >= limit {
                self.give_up(&self.waited_for(&barrier), limit, meanwhile.watcher);
            }
            if waited >= send_again {
                interval = (interval * 2).min(SEND_AGAIN_MAX);
                send_again = waited + interval;
                self.prompts = self.waited_for(&barrier);
                for agent in &self.prompts {
                    self.echoes[agent.index()] += 1;
                }
                self.prompt(asked, &barrier);
            }
        }
        Ok(Ok(barrier.into_answers()))
    }

    /// Whether somebody has still to say something.
    fn is_waiting(&self, barrier: &Barrier<Answer>) -> bool {
        !barrier.is_complete() || self.history.behind().next().is_some()
    }

    /// Who has.
    fn waited_for(&self, barrier: &Barrier<Answer>) -> BTreeSet<AgentId> {
        barrier.missing().chain(self.history.behind()).collect()
    }

    /// Says what there is to say to those who may have to be told something: their past first.
    fn prompt(&mut self, asked: &[Asked], barrier: &Barrier<Answer>) {
        for agent in std::mem::take(&mut self.prompts) {
            let present = || asked.iter().find(|asked| asked.agent == agent && barrier.awaits(agent));
            if let Some(parts) = self.history.next(agent) {
                send(self.link, self.start.run(), agent, parts);
            } else if let Some(asked) = present() {
                send(self.link, self.start.run(), agent, &asked.parts);
            }
        }
    }

    /// Lets others take the place of processes that are silent. A process is silent with all its agents.
    fn give_up(&mut self, missing: &BTreeSet<AgentId>, limit: Duration, watcher: &mut dyn Watcher) {
        let news: Vec<AgentId> = missing.difference(&self.silent).copied().collect();
        if news.is_empty() {
            return;
        }
        for &agent in &news {
            let source = self.roster.seat(agent).map(|seat| seat.source);
            self.silent.insert(agent);
            self.silent.extend(source.into_iter().flat_map(|source| self.roster.agents_of(source)));
        }
        let seconds = limit.as_secs_f64();
        self.warn(
            watcher,
            &format!(
                "no answer within {seconds} s from: {}; the clock is held until they are started again",
                listed(news)
            ),
        );
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
        meanwhile: &mut Meanwhile<'_, '_>,
    ) -> Result<(), RunError> {
        // What has not been told by now is told no more.
        (0..self.agents).map(AgentId).for_each(|agent| self.history.excuse(agent));
        let told: Vec<Asked> = told.iter().filter(|told| self.roster.seat(told.agent).is_some()).cloned().collect();
        if let Err(Silence { silent, .. }) = self.ask(tick, &told, limit, Patience::Limited, meanwhile)? {
            let silent = listed(silent);
            self.warn(meanwhile.watcher, &format!("no receipt for the end of the run from: {silent}"));
        }
        Ok(())
    }
}

/// The join of an agent as it is recorded: what tells one process from another is not in it.
pub(super) fn recorded_join(agent: AgentId, controller: String) -> Join {
    Join { run: 0, agent: agent.0, instance: 0, protocol: PROTOCOL, controller, last_tick: Join::NONE }
}

fn send(link: &mut dyn Link, run: u64, agent: AgentId, parts: &[Part]) {
    for part in parts {
        link.send(agent, &Part { run, ..part.clone() });
    }
}
