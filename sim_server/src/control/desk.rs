//! Where requests are dealt with that are about time alone: the state of the simulation, its pace, and who waits for steps.
//!
//! Invariants: a request is answered once, also if all ends first; steps that were asked for are answered when everybody has been
//! told of the last one.
//!
//! The wall time is an argument: nanoseconds since some moment.

use msgs::ids::Tick;
use msgs::service::{Ask, Reply};
use msgs::simulation_interfaces::{
    FeaturesResponse, Result as Outcome, ResultResponse, SimulationState, SimulatorFeatures, StateResponse,
};

use super::{Beginning, Control, Request, State, Steps};
use simulation::pacer::Pacer;
use simulation::scenario::Rtf;

/// The state, the pace, and who waits.
pub struct Desk {
    features: SimulatorFeatures,
    control: Control,
    pace: Pacer,
    waiting: Option<Waiting>,
    /// How many of the steps are done, and how many are not, if that has not been told yet.
    untold: Option<(u64, u64)>,
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
    /// For something that begins at this pace, or paused, and can do this.
    #[must_use]
    pub fn new(is_paused: bool, rtf: Rtf, features: SimulatorFeatures) -> Self {
        let can_begin_again = features.features.contains(&SimulatorFeatures::SIMULATION_RESET);
        let control = Control::new(is_paused, can_begin_again);
        Self { features, control, pace: Pacer::new(rtf), waiting: None, untold: None }
    }

    /// The state of the simulation.
    #[must_use]
    pub fn control(&self) -> &Control {
        &self.control
    }

    /// Time goes on from this tick: what came before is no reason to hurry or to wait.
    pub fn go_on(&mut self, tick: Tick, wall_ns: u64) {
        self.pace.restart(tick, wall_ns);
    }

    /// Wall time for which the pace holds back a tick, ns, if it does; steps are made as fast as possible.
    #[must_use]
    pub fn wait_ns(&self, tick: Tick, wall_ns: u64) -> Option<u64> {
        if self.control.is_stepping() { None } else { self.pace.wait_ns(tick, wall_ns) }
    }

    /// A tick has been made.
    pub fn ticked(&mut self) {
        self.untold = self.control.ticked();
    }

    /// The clock has told everybody of the last tick, so whoever has asked for it may be answered.
    pub fn steps_are_visible(&mut self) {
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

    /// Makes no more steps, and says why to whoever waits for them.
    pub fn end_steps(&mut self, reason: &str) {
        self.control.end_steps();
        if let Some(waiting) = self.waiting.take() {
            waiting.end(Outcome::failure(Outcome::OPERATION_FAILED, format!("not all steps were made: {reason}")));
        }
    }

    /// Answers a request before `tick`, or gives it back if it is not about time alone.
    pub fn answer(&mut self, request: Request, tick: Tick, wall_ns: u64) -> Option<Request> {
        match request {
            Request::Features(ask) => ask.answer(|_| FeaturesResponse { features: self.features.clone() }),
            Request::State(ask) => {
                let state = SimulationState { state: self.control.state().number() };
                ask.answer(|_| StateResponse { state, result: Outcome::ok() });
            }
            Request::SetState(ask) => {
                ask.answer(|request| ResultResponse { result: self.set_state(request.state.state, tick, wall_ns) });
            }
            Request::Step(Ask { request, reply }) => self.begin_steps(request.steps, Waiting::Answer(reply)),
            Request::Steps(steps) => self.begin_steps(steps.steps(), Waiting::News(steps)),
            Request::CancelSteps => {
                if matches!(self.waiting, Some(Waiting::News(_))) {
                    self.end_steps("the goal was cancelled");
                }
            }
            Request::Reset(ask) => ask.answer(|request| {
                let result = self.control.reset(request.scope).err().unwrap_or_else(Outcome::ok);
                ResultResponse { result }
            }),
            Request::Rtf(rtf) => self.pace.set_rtf(rtf, tick, wall_ns),
            other => return Some(other),
        }
        None
    }

    /// How it is to begin again, if somebody has asked for that.
    #[must_use]
    pub fn beginning(&self) -> Option<Beginning> {
        self.control.beginning()
    }

    /// The pace.
    #[must_use]
    pub fn rtf(&self) -> Rtf {
        self.pace.rtf()
    }

    /// Whether somebody has asked for the end.
    #[must_use]
    pub fn is_quitting(&self) -> bool {
        self.control.state() == State::Quitting
    }

    fn begin_steps(&mut self, count: u64, waiting: Waiting) {
        match self.control.step(count) {
            Ok(()) => self.waiting = Some(waiting),
            Err(outcome) => waiting.end(outcome),
        }
    }

    fn set_state(&mut self, number: u8, tick: Tick, wall_ns: u64) -> Outcome {
        match self.control.set_state(number) {
            Ok(()) => {
                self.end_steps("the state of the simulation was set");
                self.pace.restart(tick, wall_ns);
                Outcome::ok()
            }
            Err(outcome) => outcome,
        }
    }
}
