//! Control requests, answered between two ticks.
//!
//! Invariants: each request is answered once, also if the run ends first; a request that changes
//! the world is recorded as an intervention at the tick before which it takes effect, and enters
//! the digest there; other requests leave no trace; while the clock is held the session keeps
//! receiving, and no agent times out.

use std::ops::ControlFlow;
use std::time::Duration;

use msgs::geometry_msgs;
use msgs::maes_msgs::{ChangeMapRequest, ChangeMapResponse};
use msgs::service::Ask;
use msgs::simulation_interfaces::{
    DeleteEntityResponse, Result as Outcome, SetEntityStateRequest, SetEntityStateResponse, SpawnEntityRequest,
    SpawnEntityResponse,
};

use super::agents::POLL_PERIOD;
use super::entities::{self, Team};
use super::{RunError, Session};
use nalgebra::Point3;
use transport::control::Request;
use voxels::Terrain;
use world::map_change::MapChange;

/// Most requests that are answered between two ticks, so that a flood does not stop the clock.
const REQUESTS_MAX: usize = 32;

/// Wall time between two checks for visualisation messages that are due, while the clock is held.
const PUBLISH_PERIOD: Duration = Duration::from_millis(20);

/// The phase of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Phase {
    /// Agents are joining.
    Admission,
    /// The clock has started.
    Running,
}

impl Session<'_, '_> {
    /// Waits until the real-time factor allows the present tick, or a request arrives.
    pub(super) fn hold_pace(&mut self) -> Result<(), RunError> {
        let tick = self.engine.tick();
        while !self.is_stopped()
            && self.control.may_tick()
            && let Some(wait_ns) = self.control.wait_ns(tick, self.wall_ns())
            && !self.has_request()
        {
            self.listen(Duration::from_nanos(wait_ns))?;
        }
        Ok(())
    }

    /// Answers requests until a tick may be executed. Breaks if the run ends.
    pub(super) fn wait_for_turn(&mut self) -> Result<ControlFlow<()>, RunError> {
        loop {
            if self.answer_requests(Phase::Running)?.is_break() || self.is_stopped() {
                return Ok(ControlFlow::Break(()));
            }
            let wait = if self.control.may_tick() {
                match self.control.wait_ns(self.engine.tick(), self.wall_ns()) {
                    Some(wait_ns) => Duration::from_nanos(wait_ns),
                    None => return Ok(ControlFlow::Continue(())),
                }
            } else {
                POLL_PERIOD
            };
            if !self.has_request() {
                self.listen(wait)?;
            }
        }
    }

    /// Receives for a moment while the clock is held, and publishes what is due.
    fn listen(&mut self, wait: Duration) -> Result<(), RunError> {
        let tick = self.engine.tick();
        let (agents, mut context) = self.waiting();
        agents.listen(tick, wait.min(PUBLISH_PERIOD), &mut context)?;
        self.publish();
        Ok(())
    }

    fn has_request(&mut self) -> bool {
        self.pending_request = self.next_request();
        self.pending_request.is_some()
    }

    fn next_request(&mut self) -> Option<Request> {
        self.pending_request.take().or_else(|| self.transport.request())
    }

    /// Answers the requests that have arrived. Breaks if the run ends.
    pub(super) fn answer_requests(&mut self, phase: Phase) -> Result<ControlFlow<()>, RunError> {
        for _ in 0..REQUESTS_MAX {
            let Some(request) = self.next_request() else {
                break;
            };
            self.answer_request(request, phase)?;
            if self.control.pending_reset().is_some() {
                // Later requests are for the run after the reset.
                break;
            }
        }
        let is_over = self.control.is_quitting() || self.control.pending_reset().is_some();
        Ok(if is_over { ControlFlow::Break(()) } else { ControlFlow::Continue(()) })
    }

    fn answer_request(&mut self, request: Request, phase: Phase) -> Result<(), RunError> {
        let rtf = self.control.rtf();
        let (tick, wall_ns) = (self.engine.tick(), self.wall_ns());
        let Some(request) = self.control.answer(request, tick, wall_ns) else {
            if self.control.rtf() != rtf {
                self.transport.real_time_factor(self.control.rtf());
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
                reply.send(SetEntityStateResponse { result });
            }
            Request::Delete(Ask { request, reply }) => {
                let result = self.delete(&request.entity, phase)?;
                reply.send(DeleteEntityResponse { result });
            }
            Request::Spawn(Ask { request, reply }) => reply.send(self.spawn(&request, phase)?),
            Request::ChangeMap(Ask { request, reply }) => reply.send(self.change_map(&request, phase)?),
            _ => unreachable!("requests that concern time alone are answered by the simulation control"),
        }
        Ok(())
    }

    fn with_team<T>(&self, read: impl FnOnce(&Team<'_>) -> T) -> T {
        let world = self.engine.world();
        let has_left: Vec<bool> = world.agents().map(|agent| !self.engine.takes_part(agent)).collect();
        let mut controllers = vec![String::new(); self.engine.agents()];
        for (agent, controller) in self.agents.sessions().controllers() {
            controller.clone_into(&mut controllers[agent.index()]);
        }
        let answer_bytes_max = self.transport.answer_bytes_max();
        read(&Team { world, controllers: &controllers, has_left: &has_left, answer_bytes_max })
    }

    fn set_entity_state(&mut self, request: &SetEntityStateRequest, phase: Phase) -> Result<Outcome, RunError> {
        let (agent, pose) = match self.with_team(|team| team.placement(request)) {
            Ok(placement) => placement,
            Err(outcome) => return Ok(outcome),
        };
        if phase == Phase::Admission || !self.control.is_at_rest() {
            return Ok(not_now("pause the simulation before a state is set"));
        }
        let placed = self.engine.place(agent, pose, &mut self.log)?;
        Ok(placed
            .map_or_else(|reason| Outcome::failure(SetEntityStateResponse::INVALID_POSE, reason), |()| Outcome::ok()))
    }

    fn delete(&mut self, entity: &str, phase: Phase) -> Result<Outcome, RunError> {
        let agent = match self.with_team(|team| team.find(entity)) {
            Ok(agent) => agent,
            Err(outcome) => return Ok(outcome),
        };
        if phase == Phase::Admission {
            return Ok(not_now("agents are awaited"));
        }
        self.dismiss(agent)?;
        self.engine.leave(agent, &mut self.log)?;
        Ok(Outcome::ok())
    }

    fn spawn(&mut self, request: &SpawnEntityRequest, phase: Phase) -> Result<SpawnEntityResponse, RunError> {
        let refused = |result| SpawnEntityResponse { result, entity_name: String::new() };
        if phase == Phase::Admission {
            return Ok(refused(not_now("agents are awaited")));
        }
        let waiting = self.engine.reserve();
        let (agent, pose) = match self.with_team(|team| team.to_spawn(request, &waiting)) {
            Ok(found) => found,
            Err(outcome) => return Ok(refused(outcome)),
        };
        Ok(match self.engine.join(agent, pose, &mut self.log)? {
            Ok(()) => SpawnEntityResponse { result: Outcome::ok(), entity_name: entities::name(agent) },
            Err(reason) => refused(Outcome::failure(SpawnEntityResponse::INVALID_POSE, reason)),
        })
    }

    fn change_map(&mut self, request: &ChangeMapRequest, phase: Phase) -> Result<ChangeMapResponse, RunError> {
        let refused =
            |message: String| Ok(ChangeMapResponse { success: false, message, ..ChangeMapResponse::default() });
        let terrain = match request.kind {
            ChangeMapRequest::FREE => Terrain::Free,
            ChangeMapRequest::WALL => Terrain::Wall,
            kind => return refused(format!("kind = {kind}: expected 0 (FREE) or 1 (WALL)")),
        };
        if phase == Phase::Admission {
            return refused("the run waits for agents: ask again once it has started".to_owned());
        }
        let point = |corner: &geometry_msgs::Point| Point3::new(corner.x, corner.y, corner.z);
        let (low, high) = (point(&request.low), point(&request.high));
        let extent = self.engine.world().terrain().extent();
        let Some(cells) = (MapChange { terrain, low, high, trigger: None }).cells(extent) else {
            let [x, y, z] = extent.size().map(|cells| f64::from(cells) * extent.cell_m());
            return refused(format!(
                "no cell has its centre in the box from {low} to {high} m: expected low below high, inside the \
                 outermost layer of the map of {x} x {y} x {z} m"
            ));
        };
        Ok(match self.engine.change_cells(cells, terrain, &mut self.log)? {
            Ok(changed) => ChangeMapResponse { success: true, message: String::new(), changed },
            Err(reason) => ChangeMapResponse { success: false, message: reason.to_owned(), changed: 0 },
        })
    }
}

fn not_now(reason: &str) -> Outcome {
    Outcome::failure(Outcome::RESULT_INCORRECT_STATE, reason)
}
