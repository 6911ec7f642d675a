//! What people ask of a run, carried out between two ticks.
//!
//! Invariants: a request is answered once, also if the run ends first; what changes the world is recorded at the tick before which it
//! was done, and enters the digest there; what does not leaves no trace; while time stands still the loop waits for messages,
//! and nobody is timed out.

use std::ops::ControlFlow;
use std::time::Duration;

use msgs::ids::{AgentId, Tick};
use msgs::maes_msgs::Observation as Part;
use msgs::service::{Ask, Reply};
use msgs::simulation_interfaces::{
    INVALID_POSE, Result as Outcome, ResultResponse, SetEntityStateRequest, SimulationState, StateResponse,
};

use super::exchange::{Asked, Meanwhile, PATIENCE};
use super::log::Kind;
use super::pace::Pace;
use super::{FAREWELL, Run, RunError};
use crate::control::entities::Team;
use crate::control::{self, Control, Request, Steps};
use crate::lockstep::Wake;
use crate::scenario::ExecutionSection;
use crate::wire;
use crate::world::Since;
use crate::world::body::Pose;

/// Requests that are answered between two ticks at the most, so that a flood of them does not stop the clock.
const REQUESTS_MAX: usize = 32;

/// Wall time between two looks at who wants to see what, while time stands still.
const SHOW_PERIOD: Duration = Duration::from_millis(20);

/// How far a run is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Phase {
    /// Agents are awaited.
    Admission,
    /// The clock has started.
    Running,
}

/// Where requests are dealt with: the state of the simulation, its pace, and who waits for steps.
pub(super) struct Desk {
    control: Control,
    pace: Pace,
    waiting: Option<Waiting>,
    /// How many of the steps are done, and how many are not, if that has not been told yet.
    untold: Option<(u64, u64)>,
    interventions: u64,
    /// Who has left the run since the last tick.
    leaving: Vec<AgentId>,
}

/// Who waits for steps.
enum Waiting {
    Answer(Reply<ResultResponse>),
    News(Box<dyn Steps>),
}

impl Waiting {
    fn end(self, outcome: Outcome) {
        match self {
            Self::Answer(reply) => reply.send(ResultResponse { result: outcome }),
            Self::News(steps) => steps.end(outcome),
        }
    }
}

impl Desk {
    pub(super) fn new(execution: &ExecutionSection) -> Self {
        Self {
            control: Control::new(execution.paused),
            pace: Pace::new(execution.rtf),
            waiting: None,
            untold: None,
            interventions: 0,
            leaving: Vec::new(),
        }
    }

    /// The clock starts in a tick.
    pub(super) fn start(&mut self, tick: Tick) {
        self.pace.go_on(tick);
    }

    /// A tick has been made.
    pub(super) fn ticked(&mut self) {
        self.untold = self.control.ticked();
    }

    /// The clock has told everybody of the last tick, so whoever has asked for it may be answered.
    pub(super) fn steps_are_visible(&mut self) {
        let Some((done, left)) = self.untold.take() else {
            return;
        };
        if let Some(Waiting::News(steps)) = &self.waiting {
            steps.tell(done, left);
        }
        if left == 0
            && let Some(waiting) = self.waiting.take()
        {
            waiting.end(Outcome::ok());
        }
    }

    /// The run ends, and with it what is under way.
    pub(super) fn end_run(&mut self) {
        self.end_steps("the run has ended");
    }

    /// Who has left the run since the last tick, and does nothing from now on.
    pub(super) fn take_leaving(&mut self) -> Vec<AgentId> {
        std::mem::take(&mut self.leaving)
    }

    /// How often something was done to the run from outside.
    pub(super) fn interventions(&self) -> u64 {
        self.interventions
    }

    fn end_steps(&mut self, reason: &str) {
        self.control.end_steps();
        if let Some(waiting) = self.waiting.take() {
            waiting.end(Outcome::failure(Outcome::OPERATION_FAILED, format!("not all steps were made: {reason}")));
        }
    }

    fn begin_steps(&mut self, count: u64, waiting: Waiting) {
        match self.control.step(count) {
            Ok(()) => self.waiting = Some(waiting),
            Err(outcome) => waiting.end(outcome),
        }
    }

    fn set_state(&mut self, number: u8, tick: Tick) -> Outcome {
        match self.control.set_state(number) {
            Ok(()) => {
                self.end_steps("the state of the simulation was set");
                self.pace.go_on(tick);
                Outcome::ok()
            }
            Err(outcome) => outcome,
        }
    }
}

impl Run<'_> {
    /// Waits until the pace allows the present tick, or somebody asks something.
    pub(super) fn hold_pace(&mut self) -> Result<(), RunError> {
        let tick = self.world.tick();
        while !self.is_stopped()
            && self.desk.control.may_tick()
            && !self.desk.control.is_stepping()
            && let Some(wait) = self.desk.pace.wait(tick)
            && !self.exchange.is_asked()
        {
            self.listen(wait)?;
        }
        Ok(())
    }

    /// Answers requests until there is to be a tick. Breaks if the run is to end.
    pub(super) fn wait_for_turn(&mut self) -> Result<ControlFlow<()>, RunError> {
        loop {
            if self.answer_requests(Phase::Running)?.is_break() || self.is_stopped() {
                return Ok(ControlFlow::Break(()));
            }
            let wait = if !self.desk.control.may_tick() {
                PATIENCE
            } else if self.desk.control.is_stepping() {
                return Ok(ControlFlow::Continue(()));
            } else {
                match self.desk.pace.wait(self.world.tick()) {
                    Some(wait) => wait,
                    None => return Ok(ControlFlow::Continue(())),
                }
            };
            if !self.exchange.is_asked() {
                self.listen(wait)?;
            }
        }
    }

    /// Listens while time stands still, for a moment, and shows what there is.
    fn listen(&mut self, wait: Duration) -> Result<(), RunError> {
        let mut meanwhile = Meanwhile { watcher: self.watcher, log: &mut self.log, stop: self.stop };
        self.exchange.listen(self.world.tick(), wait.min(SHOW_PERIOD), &mut meanwhile)?;
        self.show();
        Ok(())
    }

    /// Answers what has been asked. Breaks if the run is to end.
    pub(super) fn answer_requests(&mut self, phase: Phase) -> Result<ControlFlow<()>, RunError> {
        for _ in 0..REQUESTS_MAX {
            let Some(request) = self.exchange.request() else {
                break;
            };
            self.answer_request(request, phase)?;
        }
        let quits = self.desk.control.state() == control::State::Quitting;
        Ok(if quits { ControlFlow::Break(()) } else { ControlFlow::Continue(()) })
    }

    fn answer_request(&mut self, request: Request, phase: Phase) -> Result<(), RunError> {
        let tick = self.world.tick();
        match request {
            Request::Features(ask) => {
                ask.answer(|_| msgs::simulation_interfaces::FeaturesResponse { features: control::features() })
            }
            Request::State(ask) => {
                let state = SimulationState { state: self.desk.control.state().number() };
                ask.answer(|_| StateResponse { state, result: Outcome::ok() });
            }
            Request::SetState(ask) => {
                ask.answer(|request| ResultResponse { result: self.desk.set_state(request.state.state, tick) });
            }
            Request::Step(Ask { request, reply }) => self.desk.begin_steps(request.steps, Waiting::Answer(reply)),
            Request::Steps(steps) => self.desk.begin_steps(steps.steps(), Waiting::News(steps)),
            Request::CancelSteps => {
                if matches!(self.desk.waiting, Some(Waiting::News(_))) {
                    self.desk.end_steps("the goal was cancelled");
                }
            }
            Request::Reset(ask) => ask.answer(|_| control::reset()),
            Request::Entities(ask) => self.with_team(|team| ask.answer(|request| team.entities(&request.filters))),
            Request::EntityState(ask) => self.with_team(|team| ask.answer(|request| team.state(&request.entity))),
            Request::EntitiesStates(ask) => self.with_team(|team| ask.answer(|request| team.states(&request.filters))),
            Request::EntityInfo(ask) => self.with_team(|team| ask.answer(|request| team.info(&request.entity))),
            Request::EntityBounds(ask) => self.with_team(|team| ask.answer(|request| team.bounds(&request.entity))),
            Request::SetEntityState(Ask { request, reply }) => {
                let result = self.set_entity_state(&request, phase)?;
                reply.send(ResultResponse { result });
            }
            Request::Delete(Ask { request, reply }) => {
                let result = self.delete(&request.entity, phase)?;
                reply.send(ResultResponse { result });
            }
            Request::Spawn(ask) => ask.answer(|_| control::spawn()),
            Request::Rtf(rtf) => self.desk.pace.change(rtf, tick),
        }
        Ok(())
    }

    fn with_team<T>(&self, look: impl FnOnce(&Team<'_>) -> T) -> T {
        let has_left: Vec<bool> = self.world.agents().map(|agent| self.lost.contains(&agent)).collect();
        let radius_m = self.scenario.body.radius_m;
        look(&Team { world: &self.world, controllers: &self.exchange.controllers(), has_left: &has_left, radius_m })
    }

    fn set_entity_state(&mut self, request: &SetEntityStateRequest, phase: Phase) -> Result<Outcome, RunError> {
        let (agent, pose) = match self.with_team(|team| team.placement(request)) {
            Ok(placement) => placement,
            Err(outcome) => return Ok(outcome),
        };
        if phase == Phase::Admission || !self.desk.control.is_at_rest() {
            return Ok(not_now("pause the simulation before a state is set"));
        }
        Ok(self.place(agent, pose)?.map_or_else(|reason| Outcome::failure(INVALID_POSE, reason), |()| Outcome::ok()))
    }

    /// Puts an agent somewhere, or says why not.
    pub(super) fn place(&mut self, agent: AgentId, pose: Pose) -> Result<Result<(), &'static str>, RunError> {
        let placed = self.world.place(agent, pose);
        if placed.is_ok() {
            // It is somewhere else, whatever it has wanted to wait for.
            self.wakes[agent.index()] = Wake::AT_ONCE;
            self.intervene(agent, Some(&pose))?;
        }
        Ok(placed)
    }

    /// Takes an agent out of the run.
    pub(super) fn remove(&mut self, agent: AgentId) -> Result<(), RunError> {
        self.lost.insert(agent);
        self.desk.leaving.push(agent);
        self.intervene(agent, None)
    }

    fn delete(&mut self, entity: &str, phase: Phase) -> Result<Outcome, RunError> {
        let agent = match self.with_team(|team| team.find(entity)) {
            Ok(agent) => agent,
            Err(outcome) => return Ok(outcome),
        };
        if phase == Phase::Admission {
            return Ok(not_now("agents are awaited"));
        }
        // Told out of turn, so that the end of the recording has what it was never told.
        let observation = self.world.observe(agent, Since::LastAsked);
        let parts = wire::observation_parts(&observation, Part::ENDED);
        let told = [Asked { agent, since: Since::LastAsked, parts }];
        let mut meanwhile = Meanwhile { watcher: self.watcher, log: &mut self.log, stop: self.stop };
        self.exchange.farewell(self.world.tick(), &told, FAREWELL, &mut meanwhile)?;
        self.remove(agent)?;
        Ok(Outcome::ok())
    }

    /// Records what was done, as part of the run.
    fn intervene(&mut self, agent: AgentId, placed: Option<&Pose>) -> Result<(), RunError> {
        let tick = self.world.tick();
        self.desk.interventions += 1;
        let intervention = wire::intervention(tick, agent, placed);
        Ok(self.log.exchange(Kind::Intervention, tick, &intervention, &mut self.chain)?)
    }
}

fn not_now(reason: &str) -> Outcome {
    Outcome::failure(Outcome::INCORRECT_STATE, reason)
}
