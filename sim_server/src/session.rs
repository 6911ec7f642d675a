//! The session: executes the run of a scenario over a [`transport`].
//!
//! A run admits its agents, and then repeats per tick: look, request commands from the agents that
//! are due, commit their replies, communicate and move, record. In reading order: [`RunConfig`]
//! says what is run; this file has the loop; `admission` its start and `result` its end; `engine`
//! executes a tick; `agents` speaks the [protocol](protocol::lockstep) over the transport;
//! `re_execution` takes the place of the agents for ticks that a recording already has; `control`
//! answers requests; `log` and `observers` write and publish; `phase` names the parts of the loop.
//!
//! Wall time decides only when to resend, when to give up, and how fast to go; a run that is not
//! given up has one result.
//!
//! A resumed run re-executes its recording, replays the observation logs to the agents, and
//! continues live. A verified run re-executes its recording without agents, and each message that
//! it writes goes to a [`Checker`](recording::comparison::Checker). Both use this loop, so that
//! they write the same bytes.

mod admission;
mod agents;
mod config;
mod control;
mod engine;
mod entities;
mod error;
mod events;
mod log;
mod null;
mod observers;
mod phase;
mod re_execution;
mod record;
mod result;

use std::collections::BTreeSet;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use msgs::ids::{AgentId, Tick};
use msgs::maes_msgs::{self, Observation as Fragment};

pub use protocol::lockstep::JoinPolicy;
use protocol::lockstep::{AgentSessions, MissingReplies, ObservationRequest, ReplayPolicy, Replies, TimeoutPolicy};
use recording::playback::{Playback, RecordedTick};
use simulation::digest::Digest;
pub use simulation::end_reason::EndReason;
use simulation::scenario::{OnAgentLoss, Scenario, StopRule};
use simulation::wire;
use system::wall_clock::nanoseconds;
use transport::control::{Request, Reset, SimulationControl};
use transport::{Level, Transport};
use world::World;

use agents::{Agents, Awaited, WaitContext};
use engine::Engine;
use log::{EntryKind, SessionLog};
use observers::Observers;

pub use config::{Mode, RunConfig, RunStart};
pub use error::RunError;
pub use log::RecordingSinks;
pub use null::{NullObserver, NullTransport};
pub use phase::{Phase, PhaseTimes};

/// Wall time between two reports of progress, and between two provisional saves during ticks.
const REPORT_PERIOD: Duration = Duration::from_millis(500);

/// Wall time that agents have to acknowledge the shutdown message.
pub const SHUTDOWN_TIMEOUT: Duration = Duration::from_secs(2);

/// The outcome of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// The result as it stands in the recording.
    pub result: maes_msgs::Result,
    pub digest: Digest,
    /// Wall time of the ticks, without admission.
    pub wall: Duration,
    /// Area of the walls around what the team has seen, m^2. It follows from the recording and is
    /// no part of it.
    pub explored_m2: f64,
    /// Agent processes that have started themselves again because their start stalled. It depends
    /// on the machine, so that it is no part of the result.
    pub restarted: usize,
}

impl Outcome {
    /// Why the run has ended.
    #[must_use]
    pub fn reason(&self) -> EndReason {
        EndReason::from(self.result.reason.as_str())
    }
}

/// An observer of the progress of a run: a progress bar, a log.
pub trait RunObserver {
    /// Called while these agents have not joined.
    fn waiting(&mut self, missing: &[AgentId]);
    /// Called when all agents have joined and the clock starts.
    fn started(&mut self);
    /// Called about twice a second of wall time.
    fn progress(&mut self, world: &World);
    /// Called with a line for people.
    fn note(&mut self, level: Level, text: &str);
    /// Called when a phase of the loop has ended, which began when the one before ended.
    fn phase_ended(&mut self, _phase: Phase, _tick: Tick) {}
}

/// Executes a run in the world that was built for its scenario. `stop` ends it early, with a
/// result, once it is set.
///
/// # Errors
/// If agents are missing, lost or divergent, a recording does not fit the scenario or cannot be
/// written, or another server is in the network. [`RunError::Reset`] is no failure: the caller
/// continues with [`RunConfig::after_reset`].
pub fn run(
    config: RunConfig<'_>,
    world: World,
    transport: &mut dyn Transport,
    sinks: impl Into<RecordingSinks>,
    observer: &mut dyn RunObserver,
    stop: &AtomicBool,
) -> Result<Outcome, RunError> {
    let RunConfig { scenario, mode, start, policy } = config;
    if start.is_paused && !transport.accepts_requests() {
        return Err(RunError::PausedForEver);
    }
    let agents = scenario.agents.count;
    let announcement = wire::scenario(scenario, &world.terrain().extent(), world.rays());
    let allows_replacement = scenario.faults.on_agent_loss == OnAgentLoss::Wait;
    let (keeps_log, playback, checker) = match mode {
        Mode::Live => (allows_replacement, None, None),
        Mode::Resume(playback) => (true, Some(playback), None),
        Mode::Verify(playback, checker) => (false, Some(playback), Some(checker)),
    };
    let mut engine = Engine::new(scenario, world)?;
    if let Some(first) = playback.as_ref().and_then(Playback::first_digest) {
        engine.continue_chain_of(first);
    }
    let begun = transport.now();
    let mut session = Session {
        scenario,
        teleoperated: scenario.teleoperated(),
        engine,
        begun,
        agents: Agents::new(AgentSessions::new(
            start.identity,
            policy.with_third_party(&scenario.third_party()),
            agents,
            ReplayPolicy { keeps_log, allows_replacement },
        )),
        control: SimulationControl::new(
            start.is_paused,
            start.rtf,
            transport::control::features(!scenario.agents.reserve.is_empty()),
        ),
        pending_request: None,
        log: SessionLog::new(sinks.into(), checker, agents, begun),
        recorded: record::LastRecorded::default(),
        observers: Observers::new(scenario, begun),
        reported: begun,
        playback,
        transport,
        observer,
        stop,
    };
    session.log.write(EntryKind::Scenario, Tick::ZERO, &announcement)?;
    session.agents.announce(&announcement, session.transport);
    session.transport.real_time_factor(start.rtf);
    let admitted = session.admit();
    session.observers.start_clock(session.transport.now());
    let ended = match admitted {
        Ok(ControlFlow::Continue(())) => session.execute(),
        Ok(ControlFlow::Break(reason)) => Ok(reason),
        Err(error) => Err(error),
    };
    if let Some(Reset { is_paused }) = session.control.pending_reset() {
        session.log.discard();
        session.control.end_steps("the simulation was reset");
        let start = start.reset(is_paused, session.control.rtf());
        return Err(RunError::Reset { start, departed: session.agents.sessions().departed() });
    }
    let is_complete = ended.as_ref().is_ok_and(EndReason::is_complete);
    if session.playback.is_some() && !is_complete && session.log.checker().is_none() {
        // The recording that was to be resumed holds more than what was re-executed of it.
        session.log.discard();
    }
    let wall = session.observers.elapsed(session.transport.now());
    let reason = match &ended {
        Ok(reason) => reason.clone(),
        Err(error) => EndReason::Failed(error.to_string()),
    };
    let outcome = session.finish(&reason, ended.is_ok(), wall)?;
    ended.map(|_| outcome)
}

/// A run under way: `'c` is the lifetime of its configuration, `'p` that of its ports.
struct Session<'c, 'p> {
    scenario: &'c Scenario,
    /// Agents that external nodes control through standard messages.
    teleoperated: BTreeSet<AgentId>,
    engine: Engine<'c>,
    /// The start of the session, wall time.
    begun: Instant,
    agents: Agents,
    control: SimulationControl,
    /// A request that has arrived and was not answered yet.
    pending_request: Option<Request>,
    log: SessionLog<'c>,
    recorded: record::LastRecorded,
    observers: Observers,
    /// When progress was last reported.
    reported: Instant,
    /// The recording that is re-executed; `None` while the run is live.
    playback: Option<Playback<'c>>,
    transport: &'p mut dyn Transport,
    observer: &'p mut dyn RunObserver,
    stop: &'p AtomicBool,
}

impl<'c> Session<'c, '_> {
    /// Executes ticks until the run is over; returns the reason.
    fn execute(&mut self) -> Result<EndReason, RunError> {
        self.control.restart_pacing(self.engine.tick(), self.wall_ns());
        if self.playback.is_some()
            && let ControlFlow::Break(reason) = self.re_execute()?
        {
            return Ok(reason);
        }
        loop {
            // Before anything with the stamp of this tick is published, which may be while the pace
            // is held.
            self.transport.clock(self.engine.tick());
            self.hold_pace()?;
            self.end_phase(Phase::Pace);
            self.record_state()?;
            self.end_phase(Phase::State);
            self.control.report_steps();
            self.publish();
            self.apply_events()?;
            let reason = self.end_of_run()?;
            self.end_phase(Phase::Publish);
            if let Some(reason) = reason {
                return Ok(reason);
            }
            if let ControlFlow::Break(reason) = self.advance()? {
                return Ok(reason);
            }
        }
    }

    /// Reports progress if it is due, and returns the reason if the run ends before the present
    /// tick.
    fn end_of_run(&mut self) -> Result<Option<EndReason>, RunError> {
        let now = self.transport.now();
        if now.duration_since(self.reported) >= REPORT_PERIOD {
            self.reported = now;
            self.log.save_provisionally(now)?;
            self.engine.flush_scans();
            self.observer.progress(self.engine.world());
        }
        let rule = self.engine.scenario().stop_rule();
        let is_team_back = self.engine.is_team_back();
        let is_about_space = matches!(rule, StopRule::Covered | StopRule::Explored | StopRule::KnownAtBase);
        if is_about_space {
            self.engine.flush_scans();
            self.engine.note_explored();
            self.engine.note_places();
        }
        // A recording of an earlier build may go on where the team can see nothing more, or stands
        // still, and have ended there for another reason.
        let is_live = self.playback.as_ref().is_none_or(|playback| !playback.covers(self.engine.tick()));
        let checked = self.playback.as_ref().filter(|_| is_live && self.log.checker().is_some());
        let recorded = checked.and_then(Playback::ending).map(|ending| ending.reason.clone());
        let may_end = |reason: EndReason| is_live && recorded.as_ref().is_none_or(|recorded| *recorded == reason);
        let fulfilled = match rule {
            StopRule::Back => is_team_back.then_some(EndReason::AllBack),
            StopRule::KnownAtBase => {
                let is_known = self.engine.is_known_at_base(may_end(EndReason::KnownAtBase));
                is_known.then_some(EndReason::KnownAtBase)
            }
            StopRule::Covered => self.engine.world().coverage().is_covered().then_some(EndReason::Covered),
            StopRule::Explored if self.engine.world().coverage().is_explored() => Some(EndReason::Explored),
            StopRule::Explored => {
                let is_nothing_left = may_end(EndReason::NothingMoreSeen) && self.engine.can_see_nothing_more();
                is_nothing_left.then_some(EndReason::NothingMoreSeen)
            }
            StopRule::Duration => None,
        };
        let may_stand_still = is_about_space && may_end(EndReason::StandsStill);
        let fulfilled =
            fulfilled.or_else(|| (may_stand_still && self.engine.stands_still()).then_some(EndReason::StandsStill));
        Ok(if fulfilled.is_some() {
            fulfilled
        } else if self.engine.tick() >= self.engine.scenario().duration_ticks() {
            Some(EndReason::Duration)
        } else if self.is_stopped() {
            Some(EndReason::Interrupted)
        } else {
            None
        })
    }

    /// Executes the present tick live, once control and pace allow. Breaks with the reason if the
    /// run ends instead.
    fn advance(&mut self) -> Result<ControlFlow<EndReason>, RunError> {
        if self.wait_for_turn()?.is_break() {
            return Ok(ControlFlow::Break(if self.is_stopped() { EndReason::Interrupted } else { EndReason::Quit }));
        }
        self.end_phase(Phase::Pace);
        if self.tick(None)?.is_break() {
            return Ok(ControlFlow::Break(EndReason::Interrupted));
        }
        self.control.ticked();
        Ok(ControlFlow::Continue(()))
    }

    fn end_phase(&mut self, phase: Phase) {
        let tick = self.engine.tick();
        self.waiting().1.end_phase(phase, tick);
    }

    /// Executes one tick, with the replies of the agents or with recorded ones. Breaks if the wait
    /// for replies is stopped: then the world stays as it is, and the recording has the
    /// observations of this tick.
    fn tick(&mut self, recorded: Option<RecordedTick>) -> Result<ControlFlow<()>, RunError> {
        self.engine.sense();
        self.end_phase(Phase::Scan);
        let requests = self.requests(recorded.as_ref());
        self.end_phase(Phase::Observe);
        let is_live = recorded.is_none();
        let replies = match recorded {
            Some(recorded) => self.recorded_replies(&requests, recorded).map(ControlFlow::Continue),
            None if requests.is_empty() => Ok(ControlFlow::Continue(Replies::new())),
            None => self.await_replies(),
        };
        let replies = match replies {
            Ok(ControlFlow::Continue(replies)) => replies,
            given_up => {
                self.record_unanswered(&requests)?;
                return given_up.map(|_| ControlFlow::Break(()));
            }
        };
        self.end_phase(Phase::Agents);
        let (committed, actions) = self.engine.commit(requests, replies, &mut self.log)?;
        for exchange in committed {
            self.agents.sessions_mut().append(exchange.agent, exchange.fragments, &exchange.reply.message, is_live);
        }
        self.end_phase(Phase::Record);
        self.engine.step(actions);
        self.end_phase(Phase::Move);
        Ok(ControlFlow::Continue(()))
    }

    /// The requests of this tick. While the run is live each is sent as soon as it is complete, and
    /// third-party agents get their standard sensor messages as well.
    fn requests(&mut self, recorded: Option<&RecordedTick>) -> Vec<ObservationRequest> {
        let is_live = self.playback.is_none();
        let due = self.engine.due(recorded);
        self.agents.sessions_mut().enter(self.engine.tick());
        let mut requests = Vec::with_capacity(due.len());
        for (agent, since) in due {
            if is_live && self.teleoperated.contains(&agent) {
                self.observers.send_sensors(self.engine.world(), agent, self.transport);
            }
            let request = self.engine.request(agent, since, Fragment::RUNNING);
            if recorded.is_none() {
                self.agents.request(&request, self.transport);
            }
            requests.push(request);
        }
        requests
    }

    /// Waits for the replies of a live tick. Agents without one are lost, as the scenario says.
    fn await_replies(&mut self) -> Result<ControlFlow<(), Replies>, RunError> {
        let tick = self.engine.tick();
        let timeout = self.reply_timeout();
        let policy = timeout_policy(self.scenario.faults.on_agent_loss);
        let (agents, mut context) = self.waiting();
        let MissingReplies { received, missing } = match agents.await_replies(timeout, policy, &mut context)? {
            Awaited::Answered(replies) => return Ok(ControlFlow::Continue(replies)),
            Awaited::Incomplete(_) | Awaited::Stopped(_) if self.is_stopped() => return Ok(ControlFlow::Break(())),
            Awaited::Incomplete(missing) | Awaited::Stopped(missing) => missing,
        };
        let illegal = self.agents.sessions().illegal_reply(&missing, tick);
        let refused = illegal.map(|(agent, reason)| format!("the answer of agent {agent} was refused: {reason}"));
        let lost = RunError::AgentsLost { lost: missing.clone(), refused, tick, seconds: timeout.as_secs_f64() };
        match self.scenario.faults.on_agent_loss {
            OnAgentLoss::Abort | OnAgentLoss::Wait => Err(lost),
            OnAgentLoss::Drop => {
                self.note(Level::Error, &format!("{lost}; the run continues without"));
                for agent in missing {
                    self.engine.lose(agent);
                    self.agents.sessions_mut().leave(agent);
                }
                Ok(ControlFlow::Continue(received))
            }
        }
    }

    /// Wall time allowed for the replies of this tick. In tick 0, processes may still be
    /// discovering each other's topics, which counts as joining.
    fn reply_timeout(&self) -> Duration {
        let execution = &self.scenario.execution;
        let joining_s = if self.engine.tick() == Tick::ZERO { execution.join_timeout_s } else { 0.0 };
        Duration::from_secs_f64(execution.decision_timeout_s.max(joining_s))
    }

    /// The agents, with what the session attends to while it waits for them.
    fn waiting(&mut self) -> (&mut Agents, WaitContext<'_, 'c>) {
        let Self { begun, agents, transport, observer, observers, log, stop, .. } = self;
        let (transport, observer, phase_times) = (&mut **transport, &mut **observer, observers.phase_times());
        (agents, WaitContext { begun: *begun, transport, observer, phase_times, log, stop })
    }

    /// Publishes what is due.
    fn publish(&mut self) {
        let may_tick = self.control.may_tick();
        self.observers.publish(&mut self.engine, may_tick, self.transport);
    }

    /// Writes a line to the terminal and to the log topic.
    fn note(&mut self, level: Level, text: &str) {
        self.observer.note(level, text);
        self.transport.log(level, text);
    }

    fn is_stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    /// Wall time since the start of the ticks, nanoseconds.
    fn wall_ns(&self) -> u64 {
        nanoseconds(self.observers.elapsed(self.transport.now()))
    }
}

/// What follows when the replies of a tick are overdue.
fn timeout_policy(on_agent_loss: OnAgentLoss) -> TimeoutPolicy {
    match on_agent_loss {
        OnAgentLoss::Wait => TimeoutPolicy::Hold,
        OnAgentLoss::Abort | OnAgentLoss::Drop => TimeoutPolicy::ReturnIncomplete,
    }
}
