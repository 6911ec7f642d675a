//! A controller inside a wrapper that decides in its place at times.
//!
//! Invariant: the controller sees every event, cell and message, in order; what was observed while
//! the wrapper decided comes in one observation afterwards.

use protocol::event_mask::EventMask;
use protocol::wake_condition::WakeCondition;

use super::{Controller, Ctx, Failure};
use agent::command::{Command, Motion};
use agent::observation::Observation;

/// A wrapped controller.
pub(super) struct Wrapped {
    controller: Box<dyn Controller>,
    wake: WakeCondition,
    /// Whether it has requested the view in its next observation.
    wants_view: bool,
    /// What it has not seen.
    unseen: Option<Observation>,
}

impl Wrapped {
    pub(super) fn new(controller: Box<dyn Controller>) -> Self {
        Self { controller, wake: WakeCondition::NEXT_TICK, wants_view: false, unseen: None }
    }

    /// Its wake-up condition.
    pub(super) fn wake(&self) -> WakeCondition {
        self.wake
    }

    /// Whether an observation meets its wake-up condition.
    pub(super) fn is_due(&self, observation: &Observation) -> bool {
        self.wake.is_met(observation.tick, observation.events)
    }

    /// Keeps an observation for its next decision.
    pub(super) fn note(&mut self, observation: &Observation) {
        self.unseen = Some(match self.unseen.take() {
            Some(earlier) => observation.clone().merged_with(earlier),
            None => observation.clone(),
        });
    }

    /// Its decision about all that it has not seen, this observation included, and these events.
    pub(super) fn ask(&mut self, observation: &Observation, ctx: &mut Ctx<'_>, also: EventMask) -> Command {
        let mut unseen = self.unseen.take().unwrap_or_else(|| observation.clone());
        unseen.events |= also;
        let command = self.controller.decide(&unseen, ctx);
        (self.wake, self.wants_view) = (command.wake, command.want_view);
        command
    }

    /// The command that leaves everything as its last one had it.
    pub(super) fn keep(&self) -> Command {
        Command { want_view: self.wants_view, ..Command::keep(self.wake) }
    }

    /// Its reply between its wake-ups, which counts if it does something.
    pub(super) fn poll(&mut self, observation: &Observation, ctx: &mut Ctx<'_>) -> Command {
        let command = self.controller.decide(observation, ctx);
        if !command.is_noop() {
            (self.wake, self.wants_view, self.unseen) = (command.wake, command.want_view, None);
        }
        command
    }

    /// Its decision where the wrapper is not there.
    pub(super) fn decide(&mut self, observation: &Observation, ctx: &mut Ctx<'_>) -> Command {
        self.controller.decide(observation, ctx)
    }

    pub(super) fn covers(&self) -> bool {
        self.controller.covers()
    }

    pub(super) fn is_blocked(&self) -> bool {
        self.controller.is_blocked()
    }

    pub(super) fn is_polled_between_wakes(&self) -> bool {
        self.controller.is_polled_between_wakes()
    }

    pub(super) fn failure(&mut self) -> Option<Failure> {
        self.controller.failure()
    }
}

/// Whether a body is at rest after a command.
pub(super) fn rests(command: &Command, observation: &Observation) -> bool {
    match command.motion {
        Motion::Keep => !observation.is_active,
        Motion::Stop => true,
        _ => false,
    }
}
