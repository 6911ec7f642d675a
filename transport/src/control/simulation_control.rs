//! Simulation control over time: the state of the simulation, its real-time factor, and the callers
//! that wait for steps.
//!
//! Invariants: a request is answered exactly once, even if the run ends first; steps are answered
//! after the clock has published the last of them.
//!
//! Wall time is an argument, in nanoseconds since an arbitrary epoch.

use msgs::ids::Tick;
use msgs::service::{Ask, Reply};
use msgs::simulation_interfaces::{
    GetSimulationStateResponse, GetSimulatorFeaturesResponse, ResetSimulationResponse, Result as Outcome,
    SetSimulationStateResponse, SimulationState, SimulatorFeatures, StepSimulationResponse,
};

use super::pacer::Pacer;
use super::{Request, Reset, State, StateMachine, Steps};
use simulation::scenario::Rtf;

/// State machine, real-time pacing and the pending caller of steps.
pub struct SimulationControl {
    features: SimulatorFeatures,
    machine: StateMachine,
    pace: Pacer,
    step_caller: Option<StepCaller>,
    /// Steps done and left, until the caller gets them.
    unreported: Option<(u64, u64)>,
}

/// The caller that waits for steps.
enum StepCaller {
    Service(Reply<StepSimulationResponse>),
    Action(Box<dyn Steps>),
}

impl StepCaller {
    fn end(self, outcome: Outcome) {
        match self {
            Self::Service(reply) => reply.send(StepSimulationResponse { result: outcome }),
            Self::Action(steps) => steps.finish(outcome),
        }
    }
}

impl SimulationControl {
    /// A simulation that starts at this real-time factor, or paused, with these features.
    #[must_use]
    pub fn new(is_paused: bool, rtf: Rtf, features: SimulatorFeatures) -> Self {
        let has = |feature| features.features.contains(&u16::from(feature));
        let (can_reset, can_spawn) = (has(SimulatorFeatures::SIMULATION_RESET), has(SimulatorFeatures::SPAWNING));
        let machine = StateMachine::new(is_paused, can_reset, can_spawn);
        Self { features, machine, pace: Pacer::new(rtf), step_caller: None, unreported: None }
    }

    /// See [`StateMachine::may_tick`].
    #[must_use]
    pub fn may_tick(&self) -> bool {
        self.machine.may_tick()
    }

    /// See [`StateMachine::is_stepping`].
    #[must_use]
    pub fn is_stepping(&self) -> bool {
        self.machine.is_stepping()
    }

    /// See [`StateMachine::is_at_rest`].
    #[must_use]
    pub fn is_at_rest(&self) -> bool {
        self.machine.is_at_rest()
    }

    /// Restarts pacing at this tick: earlier delays are neither made up for nor waited out.
    pub fn restart_pacing(&mut self, tick: Tick, wall_ns: u64) {
        self.pace.restart(tick, wall_ns);
    }

    /// Wall time to wait before a tick, in ns, if the real-time factor requires it; steps run as
    /// fast as possible.
    #[must_use]
    pub fn wait_ns(&self, tick: Tick, wall_ns: u64) -> Option<u64> {
        if self.machine.is_stepping() { None } else { self.pace.wait_ns(tick, wall_ns) }
    }

    /// Counts a tick.
    pub fn ticked(&mut self) {
        self.unreported = self.machine.ticked();
    }

    /// Reports finished steps to their caller. Call it after the clock was published.
    pub fn report_steps(&mut self) {
        let Some((done, left)) = self.unreported.take() else {
            return;
        };
        if let Some(StepCaller::Action(steps)) = &self.step_caller {
            steps.feedback(done, left);
        }
        if left == 0
            && let Some(step_caller) = self.step_caller.take()
        {
            step_caller.end(Outcome::ok());
        }
    }

    /// Drops pending steps and reports the reason to their caller.
    pub fn end_steps(&mut self, reason: &str) {
        self.machine.end_steps();
        if let Some(step_caller) = self.step_caller.take() {
            step_caller
                .end(Outcome::failure(Outcome::RESULT_OPERATION_FAILED, format!("not all steps were made: {reason}")));
        }
    }

    /// Answers a request before `tick`, or returns it if it is not about time alone.
    pub fn answer(&mut self, request: Request, tick: Tick, wall_ns: u64) -> Option<Request> {
        match request {
            Request::Features(ask) => ask.answer(|_| GetSimulatorFeaturesResponse { features: self.features.clone() }),
            Request::State(ask) => {
                let state = SimulationState { state: self.machine.state().number() };
                ask.answer(|_| GetSimulationStateResponse { state, result: Outcome::ok() });
            }
            Request::SetState(ask) => {
                ask.answer(|request| SetSimulationStateResponse {
                    result: self.set_state(request.state.state, tick, wall_ns),
                });
            }
            Request::Step(Ask { request, reply }) => self.begin_steps(request.steps, StepCaller::Service(reply)),
            Request::Steps(steps) => self.begin_steps(steps.steps(), StepCaller::Action(steps)),
            Request::CancelSteps => {
                if matches!(self.step_caller, Some(StepCaller::Action(_))) {
                    self.end_steps("the goal was cancelled");
                }
            }
            Request::Reset(ask) => ask.answer(|request| {
                let result = self.machine.reset(request.scope).err().unwrap_or_else(Outcome::ok);
                ResetSimulationResponse { result }
            }),
            Request::Rtf(rtf) => self.pace.set_rtf(rtf, tick, wall_ns),
            other => return Some(other),
        }
        None
    }

    /// The requested reset.
    #[must_use]
    pub fn pending_reset(&self) -> Option<Reset> {
        self.machine.pending_reset()
    }

    /// The real-time factor.
    #[must_use]
    pub fn rtf(&self) -> Rtf {
        self.pace.rtf()
    }

    /// Whether quitting was requested.
    #[must_use]
    pub fn is_quitting(&self) -> bool {
        self.machine.state() == State::Quitting
    }

    fn begin_steps(&mut self, count: u64, step_caller: StepCaller) {
        match self.machine.step(count) {
            Ok(()) => self.step_caller = Some(step_caller),
            Err(outcome) => step_caller.end(outcome),
        }
    }

    fn set_state(&mut self, number: u8, tick: Tick, wall_ns: u64) -> Outcome {
        match self.machine.set_state(number) {
            Ok(()) => {
                self.end_steps("the state of the simulation was set");
                self.pace.restart(tick, wall_ns);
                Outcome::ok()
            }
            Err(outcome) => outcome,
        }
    }
}
