//! Wall time of decisions, for information only: no result depends on it.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use msgs::ids::{AgentId, Tick};

use crate::{Controller, Ctx, Failure};
use agent::command::Command;
use agent::observation::Observation;

/// The wall time of each decision of some agents, in no order. Clones share it.
#[derive(Debug, Clone)]
pub struct DecisionTimes {
    /// The wall clock.
    now: fn() -> Instant,
    decisions: Arc<Mutex<Vec<Decision>>>,
}

/// A decision of an agent.
#[derive(Debug, Clone, Copy)]
pub struct Decision {
    /// The agent.
    pub agent: AgentId,
    /// The tick of its observation.
    pub tick: Tick,
    /// When it began, wall time.
    pub start: Instant,
    /// How long it took, wall time.
    pub duration: Duration,
}

impl DecisionTimes {
    /// No decisions yet; later ones are timed by this wall clock.
    #[must_use]
    pub fn new(now: fn() -> Instant) -> Self {
        Self { now, decisions: Arc::default() }
    }

    /// Wraps a controller to time its decisions.
    #[must_use]
    pub fn of(&self, controller: Box<dyn Controller>) -> Box<dyn Controller> {
        Box::new(Timed { controller, times: self.clone() })
    }

    /// All times, ascending.
    #[must_use]
    pub fn sorted(&self) -> Vec<Duration> {
        let mut times: Vec<Duration> = self.all().iter().map(|decision| decision.duration).collect();
        times.sort_unstable();
        times
    }

    /// All decisions so far.
    #[must_use]
    pub fn all(&self) -> Vec<Decision> {
        self.decisions.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

struct Timed {
    controller: Box<dyn Controller>,
    times: DecisionTimes,
}

impl Controller for Timed {
    fn decide(&mut self, observation: &Observation, ctx: &mut Ctx<'_>) -> Command {
        let now = self.times.now;
        let start = now();
        let command = self.controller.decide(observation, ctx);
        let (agent, tick, duration) = (ctx.agent(), observation.tick, now().duration_since(start));
        let mut times = self.times.decisions.lock().unwrap_or_else(PoisonError::into_inner);
        times.push(Decision { agent, tick, start, duration });
        command
    }

    fn covers(&self) -> bool {
        self.controller.covers()
    }

    fn is_polled_between_wakes(&self) -> bool {
        self.controller.is_polled_between_wakes()
    }

    fn failure(&mut self) -> Option<Failure> {
        self.controller.failure()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::build;
    use crate::testing::{World, idle};
    use agent::observation::RunInfo;

    #[test]
    fn decisions_are_timed_and_unchanged() {
        let times = DecisionTimes::new(system::wall_clock::now);
        let walk = || build("rbw", &[], AgentId(0), &RunInfo::smallest()).unwrap();
        let (mut plain, mut timed) = (walk(), times.of(walk()));
        let mut world = World::empty();
        for decisions in 1..4 {
            assert_eq!(world.ask_about(timed.as_mut(), &idle()), world.ask_about(plain.as_mut(), &idle()));
            assert_eq!(times.sorted().len(), decisions);
        }
        assert!(times.sorted().is_sorted());
    }
}
