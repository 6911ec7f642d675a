//! The run of a scenario: admit the agents, then tick by tick look, ask, wait, step, record.
//!
//! The loop is the same over every [`Link`]. Wall time decides nothing but when to send again, when to give up, and how fast to
//! go; a run that is not given up has one result.
//!
//! A run that is checked is nothing but what a recording says of it: nobody takes part, and what the run writes goes before somebody
//! who has the recording.
//!
//! A run that is resumed begins with what a recording says of it: until then nobody is asked, and afterwards the agents are told
//! their past. It is the same loop, so that it writes the same recording.
//!
//! Asking every agent at every tick (`look_ahead = false`) is the same run for agents that act only when they are due: what an
//! agent answers out of turn counts only if it does something, and only what counts is recorded and enters the digest.

mod control;
mod error;
mod exchange;
mod history;
mod log;
mod nobody;
mod record;
mod replay;
mod result;
mod show;
mod start;

use std::collections::{BTreeMap, BTreeSet};
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use msgs::ids::{AgentId, Tick};
use msgs::maes_msgs::{self, Observation as Part};

use crate::control::Reset;
use crate::control::SimulationControl;
use crate::link::{Level, Link};
use crate::playback::{Playback, RecordedTick};
use simulation::digest::{Chain, Digest};
use simulation::lockstep::Wake;
use simulation::scenario::{OnAgentLoss, Scenario};
use simulation::views::Views;
use simulation::wire;
use simulation::world::{Action, Since, World};

use control::Phase;
use exchange::{Answer, Asked, Exchange, Meanwhile, PATIENCE, Patience, Silence};
pub use log::{Checker, Records};
use log::{Kind, Log, Outlets};
pub use nobody::Nobody;
pub use start::Start;

pub(crate) use crate::wall_clock::now;
pub use error::RunError;

/// Wall time after which people are told how far the run is, and what they are told of is saved.
const REPORT_PERIOD: Duration = Duration::from_millis(500);

/// Wall time that agents have to receive the end of the run.
const FAREWELL: Duration = Duration::from_secs(2);

/// The counter of the tick in which the team had seen so many thousandths of the free cells, up to that number.
pub const MILESTONE_COUNTER: &str = "tick_explored_permille_";

/// Reason of a result: the team has seen everything.
pub const EXPLORED: &str = "explored";

/// Reason of a result: bodies have been everywhere.
pub const COVERED: &str = "covered";

/// Reason of a result: the time is up.
pub const DURATION: &str = "duration";

/// Reason of a result: the run was stopped from outside.
pub const INTERRUPTED: &str = "interrupted";

/// Reason of a result: somebody has asked the server to end the run.
pub const QUIT: &str = "quit";

/// What became of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// The result as it stands in the recording.
    pub result: maes_msgs::Result,
    /// The digest.
    pub digest: Digest,
    /// Wall time of the ticks, without waiting for agents to join.
    pub wall: Duration,
}

/// Something that wants to know how a run goes: a progress bar, a log.
pub trait Watcher {
    /// These agents are still awaited at the start.
    fn waiting(&mut self, missing: &[AgentId]);
    /// All agents are there, and the clock starts.
    fn started(&mut self);
    /// The run has come this far.
    fn progress(&mut self, world: &World);
    /// Something happened that a person should read.
    fn note(&mut self, text: &str);
}

/// Carries out a scenario in a world that was made for it.
///
/// `stop` ends the run early, with a result, once it is set.
///
/// # Errors
/// If agents are missing or lost, the recording cannot be written, or another server is heard before the clock starts; then no
/// recording is left.
pub fn run(
    scenario: &Scenario,
    world: World,
    link: &mut dyn Link,
    records: impl Into<Records>,
    watcher: &mut dyn Watcher,
    stop: &AtomicBool,
) -> Result<Outcome, RunError> {
    carry_out(Start::of(scenario)?, scenario, world, link, records.into().into(), watcher, stop, None)
}

/// Carries out a scenario once more, after [`RunError::Reset`], in a world that was made anew, with the same agents.
///
/// # Errors
/// As [`run`].
pub fn begin_again(
    start: Start,
    scenario: &Scenario,
    world: World,
    link: &mut dyn Link,
    records: impl Into<Records>,
    watcher: &mut dyn Watcher,
    stop: &AtomicBool,
) -> Result<Outcome, RunError> {
    carry_out(start, scenario, world, link, records.into().into(), watcher, stop, None)
}

/// Goes on with a run: carries out again what a recording says of it, then tells the agents their past and goes on with them.
///
/// # Errors
/// As [`run`], and if the recording or an agent does not keep to what comes of the scenario here.
pub fn resume(
    scenario: &Scenario,
    world: World,
    link: &mut dyn Link,
    records: impl Into<Records>,
    watcher: &mut dyn Watcher,
    stop: &AtomicBool,
    playback: Playback<'_>,
) -> Result<Outcome, RunError> {
    carry_out(Start::of(scenario)?, scenario, world, link, records.into().into(), watcher, stop, Some(playback))
}

/// Carries out again what a recording says of a run, up to where it ends and with nobody taking part, before somebody who knows
/// what is in it.
///
/// # Errors
/// If the recording does not keep to what comes of the scenario here.
pub fn again(
    scenario: &Scenario,
    world: World,
    checker: &mut dyn Checker,
    playback: Playback<'_>,
) -> Result<Outcome, RunError> {
    let stop = AtomicBool::new(false);
    let start = Start::of(scenario)?;
    carry_out(start, scenario, world, &mut Nobody, Outlets::checked_by(checker), &mut Nobody, &stop, Some(playback))
}

#[expect(clippy::too_many_arguments, reason = "all that a run needs; it is put together here and nowhere else")]
fn carry_out<'a>(
    start: Start,
    scenario: &'a Scenario,
    world: World,
    link: &'a mut dyn Link,
    outlets: Outlets<'a>,
    watcher: &'a mut dyn Watcher,
    stop: &'a AtomicBool,
    playback: Option<Playback<'a>>,
) -> Result<Outcome, RunError> {
    if start.is_paused && !link.takes_requests() {
        return Err(RunError::NobodyResumes);
    }
    let threads = scenario.execution.threads as usize;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build()?;
    let announcement = wire::scenario(scenario, &world.terrain().extent(), world.rays());
    let has_successors = scenario.faults.on_agent_loss == OnAgentLoss::Wait;
    // Those who check have nobody to tell it.
    let keeps_history = !outlets.are_checked() && (playback.is_some() || has_successors);
    let mut run = Run {
        scenario,
        playback,
        said: None,
        chain: Chain::new(&scenario.identity(), &world),
        wakes: vec![Wake::AT_ONCE; scenario.agents.count as usize],
        driven: scenario.driven(),
        lost: BTreeSet::new(),
        desk: SimulationControl::new(start.is_paused, start.rtf, crate::control::features()),
        interventions: 0,
        leaving: Vec::new(),
        log: Log::new(outlets, scenario.agents.count),
        exchange: Exchange::new(link, start, scenario.agents.count, keeps_history, has_successors),
        world,
        watcher,
        stop,
        pool,
        decisions: 0,
        failed_searches: vec![0; scenario.agents.count as usize],
        digest_recorded: None,
        progress_recorded: None,
        reported: now(),
        views: Views::new(scenario.views.clone(), scenario.agents.count),
        infos: vec![String::new(); scenario.agents.count as usize],
        started: now(),
    };
    run.log.write(Kind::Scenario, Tick::ZERO, &announcement)?;
    run.exchange.announce(&announcement);
    run.exchange.pace(start.rtf);
    let admitted = run.admit();
    run.start_clock();
    let ended = match admitted {
        Ok(ControlFlow::Continue(())) => run.ticks(),
        Ok(ControlFlow::Break(reason)) => Ok(reason),
        Err(error) => Err(error),
    };
    if let Some(Reset { is_paused }) = run.desk.pending_reset() {
        run.log.give_up();
        run.desk.end_steps("the simulation was reset");
        return Err(RunError::Reset(start.again(is_paused, run.desk.rtf())));
    }
    let is_over = matches!(ended.as_deref(), Ok(EXPLORED | COVERED | DURATION));
    if run.is_replaying() && !is_over && run.log.checker().is_none() {
        // The recording that was read has more.
        run.log.give_up();
    }
    let wall = run.started.elapsed();
    let reason = match &ended {
        Ok(reason) => reason.clone(),
        Err(error) => error.to_string(),
    };
    let outcome = run.finish(reason, ended.is_ok(), wall)?;
    ended.map(|_| outcome)
}

/// A run under way.
struct Run<'a> {
    scenario: &'a Scenario,
    /// What is still to be carried out again.
    playback: Option<Playback<'a>>,
    /// What was said in this tick.
    said: Option<RecordedTick>,
    world: World,
    chain: Chain,
    wakes: Vec<Wake>,
    driven: BTreeSet<AgentId>,
    lost: BTreeSet<AgentId>,
    desk: SimulationControl,
    /// How often something was done to the run from outside.
    interventions: u64,
    /// Who has left the run since the last tick, and does nothing from now on.
    leaving: Vec<AgentId>,
    log: Log<'a>,
    exchange: Exchange<'a>,
    watcher: &'a mut dyn Watcher,
    stop: &'a AtomicBool,
    pool: rayon::ThreadPool,
    decisions: u64,
    failed_searches: Vec<u32>,
    digest_recorded: Option<Tick>,
    progress_recorded: Option<Tick>,
    reported: Instant,
    views: Views,
    /// The last information text of each agent.
    infos: Vec<String>,
    /// When the ticks began, wall time.
    started: Instant,
}

impl Run<'_> {
    /// Waits until every id has been claimed. Breaks with the reason if there is to be no tick.
    fn admit(&mut self) -> Result<ControlFlow<String>, RunError> {
        if self.log.checker().is_some() {
            return self.admit_again();
        }
        let seconds = self.scenario.execution.join_timeout_s;
        let deadline = now() + Duration::from_secs_f64(seconds);
        loop {
            let missing = self.exchange.missing();
            if missing.is_empty() {
                break;
            }
            if self.is_stopped() {
                return Ok(ControlFlow::Continue(()));
            }
            if now() >= deadline {
                return Err(RunError::AgentsMissing { missing, seconds });
            }
            if let Some(other) = self.exchange.other_run() {
                self.log.give_up();
                return Err(RunError::OtherServer { other });
            }
            self.watcher.waiting(&missing);
            if self.answer_requests(Phase::Admission)?.is_break() {
                return Ok(ControlFlow::Continue(()));
            }
            let mut meanwhile = Meanwhile { watcher: self.watcher, log: &mut self.log, stop: self.stop };
            self.exchange.listen(Tick::ZERO, PATIENCE, &mut meanwhile)?;
        }
        self.check_controllers()?;
        for (agent, join) in self.exchange.joins() {
            self.log.write(Kind::Join(agent), Tick::ZERO, &join)?;
        }
        if !self.is_replaying() {
            self.log.publish()?;
        }
        self.watcher.started();
        self.exchange.log(Level::Info, &format!("the run begins with {} agents", self.scenario.agents.count));
        Ok(ControlFlow::Continue(()))
    }

    /// Ticks until the run is over; says why it is.
    fn ticks(&mut self) -> Result<String, RunError> {
        let end = self.scenario.duration_ticks();
        self.desk.restart_pacing(self.world.tick(), self.wall_ns());
        loop {
            if !self.is_replaying() {
                self.hold_pace()?;
                self.exchange.clock(self.world.tick());
            }
            self.record_state()?;
            if !self.is_replaying() {
                self.desk.report_steps();
                self.show();
            }
            if self.reported.elapsed() >= REPORT_PERIOD {
                self.report()?;
            }
            let (coverage, scenario) = (self.world.coverage(), self.scenario);
            if scenario.stop_when_covered {
                if coverage.is_covered() {
                    return Ok(COVERED.to_owned());
                }
            } else if scenario.stop_when_explored && coverage.is_explored() {
                return Ok(EXPLORED.to_owned());
            }
            if self.world.tick() >= end {
                return Ok(DURATION.to_owned());
            }
            if self.is_stopped() {
                return Ok(INTERRUPTED.to_owned());
            }
            if let ControlFlow::Break(reason) = self.replay()? {
                return Ok(reason);
            }
            if !self.is_replaying() && self.wait_for_turn()?.is_break() {
                return Ok(if self.is_stopped() { INTERRUPTED } else { QUIT }.to_owned());
            }
            if self.tick()?.is_break() {
                return Ok(INTERRUPTED.to_owned());
            }
            self.desk.ticked();
        }
    }

    /// One fixed update, unless it is given up while agents are waited for: then the world stays as it is, and the recording
    /// has what they were told.
    fn tick(&mut self) -> Result<ControlFlow<()>, RunError> {
        self.world.look(&self.pool);
        let asked = self.ask();
        let mut actions = if asked.is_empty() && self.said.is_none() {
            BTreeMap::new()
        } else {
            match self.answers(&asked) {
                Ok(ControlFlow::Continue(answers)) => self.take_in(asked, &answers)?,
                given_up => {
                    self.record_unanswered(&asked)?;
                    return given_up.map(|_| ControlFlow::Break(()));
                }
            }
        };
        actions.extend(std::mem::take(&mut self.leaving).into_iter().map(|agent| (agent, Action::LOST)));
        self.world.step(actions);
        self.chain.close(&self.world);
        Ok(ControlFlow::Continue(()))
    }

    /// Who is asked in this tick, with the observations they get.
    fn ask(&mut self) -> Vec<Asked> {
        let mut asked = Vec::new();
        for agent in self.world.agents() {
            if self.lost.contains(&agent) {
                continue;
            }
            let wake = self.wakes[agent.index()];
            let happened = self.world.events(agent, wake.events);
            let since = if wake.is_due(self.world.tick(), happened) {
                Since::LastCounted
            } else if let Some(said) = &self.said {
                // Out of turn only those have counted who have done something.
                if !said.commands.contains_key(&agent) {
                    continue;
                }
                Since::LastAsked
            } else if self.scenario.execution.look_ahead {
                continue;
            } else {
                Since::LastAsked
            };
            if self.driven.contains(&agent) && !self.is_replaying() {
                self.drive(agent);
            }
            let observation = self.world.observe(agent, since);
            asked.push(Asked { agent, since, parts: wire::observation_parts(&observation, Part::RUNNING) });
        }
        asked
    }

    /// Waits for the answers. Agents that do not give one are lost.
    fn answers(&mut self, asked: &[Asked]) -> Result<ControlFlow<(), BTreeMap<AgentId, Answer>>, RunError> {
        if let Some(said) = self.said.take() {
            return self.answers_again(asked, said).map(ControlFlow::Continue);
        }
        let tick = self.world.tick();
        let limit = Duration::from_secs_f64(self.answer_timeout_s());
        let mut meanwhile = Meanwhile { watcher: self.watcher, log: &mut self.log, stop: self.stop };
        let patience = Patience::of(self.scenario.faults.on_agent_loss);
        let Silence { answers, silent } = match self.exchange.ask(tick, asked, limit, patience, &mut meanwhile)? {
            Ok(answers) => return Ok(ControlFlow::Continue(answers)),
            Err(silence) => silence,
        };
        if self.is_stopped() {
            return Ok(ControlFlow::Break(()));
        }
        let lost = RunError::AgentsLost { lost: silent.clone(), tick, seconds: limit.as_secs_f64() };
        match self.scenario.faults.on_agent_loss {
            OnAgentLoss::Abort | OnAgentLoss::Wait => Err(lost),
            OnAgentLoss::Drop => {
                self.note(Level::Error, &format!("{lost}; the run goes on without"));
                self.lost.extend(silent);
                Ok(ControlFlow::Continue(answers))
            }
        }
    }

    /// How long to wait for the answers of this tick. Processes that have just joined may still be looking for each other's topics,
    /// which belongs to joining.
    fn answer_timeout_s(&self) -> f64 {
        let execution = &self.scenario.execution;
        let joining_s = if self.world.tick() == Tick::ZERO { execution.join_timeout_s } else { 0.0 };
        execution.decision_timeout_s.max(joining_s)
    }

    /// Records what counts of the answers, and says what the world is to do.
    fn take_in(
        &mut self,
        asked: Vec<Asked>,
        answers: &BTreeMap<AgentId, Answer>,
    ) -> Result<BTreeMap<AgentId, Action>, RunError> {
        let tick = self.world.tick();
        let mut actions = BTreeMap::new();
        for Asked { agent, since, parts } in asked {
            let Some(answer) = answers.get(&agent) else {
                actions.insert(agent, Action::LOST);
                continue;
            };
            let parts = match since {
                Since::LastCounted => parts,
                Since::LastAsked if answer.does_nothing() => continue,
                Since::LastAsked => {
                    let whole = self.world.observe(agent, Since::LastCounted);
                    wire::observation_parts(&whole, Part::RUNNING)
                }
            };
            for part in &parts {
                self.log.exchange(Kind::Observation(agent), tick, part, &mut self.chain)?;
            }
            self.log.exchange(Kind::Command(agent), tick, &answer.message, &mut self.chain)?;
            self.wakes[agent.index()] = answer.wake;
            self.decisions += 1;
            self.world.note_belief(agent, answer.message.known_free);
            self.failed_searches[agent.index()] = answer.message.failed_searches;
            if !answer.message.info.is_empty() {
                self.infos[agent.index()].clone_from(&answer.message.info);
            }
            actions.insert(agent, answer.action.clone());
            self.exchange.keep(agent, parts, &answer.message, !self.is_replaying());
        }
        Ok(actions)
    }

    fn report(&mut self) -> Result<(), RunError> {
        self.reported = now();
        self.log.save_provisionally()?;
        self.watcher.progress(&self.world);
        Ok(())
    }

    fn is_stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }
}
