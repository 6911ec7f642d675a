//! What people ask of a run, carried out between two ticks.
//!
//! Invariants: a request is answered once, also if the run ends first; what changes the world is recorded at the tick before which it
//! was done, and enters the digest there; what does not leaves no trace; while time stands still the loop waits for messages,
//! and nobody is timed out.

use std::ops::ControlFlow;
use std::time::Duration;

use msgs::ids::AgentId;
use msgs::maes_msgs::Observation as Part;
use msgs::service::Ask;
use msgs::simulation_interfaces::{INVALID_POSE, Result as Outcome, ResultResponse, SetEntityStateRequest};

use super::exchange::{Asked, Meanwhile, PATIENCE};
use super::log::Kind;
use super::{FAREWELL, Run, RunError};
use crate::control::entities::Team;
use crate::control::{self, Request};
use simulation::lockstep::Wake;
use simulation::wire;
use simulation::world::Since;
use simulation::world::body::Pose;

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

impl Run<'_> {
    /// Waits until the pace allows the present tick, or somebody asks something.
    pub(super) fn hold_pace(&mut self) -> Result<(), RunError> {
        let tick = self.world.tick();
        while !self.is_stopped()
            && self.desk.may_tick()
            && let Some(wait_ns) = self.desk.wait_ns(tick, self.wall_ns())
            && !self.exchange.is_asked()
        {
            self.listen(Duration::from_nanos(wait_ns))?;
        }
        Ok(())
    }

    /// Answers requests until there is to be a tick. Breaks if the run is to end.
    pub(super) fn wait_for_turn(&mut self) -> Result<ControlFlow<()>, RunError> {
        loop {
            if self.answer_requests(Phase::Running)?.is_break() || self.is_stopped() {
                return Ok(ControlFlow::Break(()));
            }
            let wait = if self.desk.may_tick() {
                match self.desk.wait_ns(self.world.tick(), self.wall_ns()) {
                    Some(wait_ns) => Duration::from_nanos(wait_ns),
                    None => return Ok(ControlFlow::Continue(())),
                }
            } else {
                PATIENCE
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
            if self.desk.pending_reset().is_some() {
                // What is asked next is asked of the run that begins then.
                break;
            }
        }
        let is_over = self.desk.is_quitting() || self.desk.pending_reset().is_some();
        Ok(if is_over { ControlFlow::Break(()) } else { ControlFlow::Continue(()) })
    }

    fn answer_request(&mut self, request: Request, phase: Phase) -> Result<(), RunError> {
        let rtf = self.desk.rtf();
        let Some(request) = self.desk.answer(request, self.world.tick(), self.wall_ns()) else {
            if self.desk.rtf() != rtf {
                self.exchange.pace(self.desk.rtf());
            }
            return Ok(());
        };
        match request {
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
            _ => unreachable!("the desk answers what is about time alone"),
        }
        Ok(())
    }

    fn with_team<T>(&self, look: impl FnOnce(&Team<'_>) -> T) -> T {
        let has_left: Vec<bool> = self.world.agents().map(|agent| self.lost.contains(&agent)).collect();
        look(&Team { world: &self.world, controllers: &self.exchange.controllers(), has_left: &has_left })
    }

    fn set_entity_state(&mut self, request: &SetEntityStateRequest, phase: Phase) -> Result<Outcome, RunError> {
        let (agent, pose) = match self.with_team(|team| team.placement(request)) {
            Ok(placement) => placement,
            Err(outcome) => return Ok(outcome),
        };
        if phase == Phase::Admission || !self.desk.is_at_rest() {
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
        self.leaving.push(agent);
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
        self.interventions += 1;
        let intervention = wire::intervention(tick, agent, placed);
        Ok(self.log.exchange(Kind::Intervention, tick, &intervention, &mut self.chain)?)
    }
}

fn not_now(reason: &str) -> Outcome {
    Outcome::failure(Outcome::INCORRECT_STATE, reason)
}
