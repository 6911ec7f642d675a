//! The presence of the agents: who is in the world, who has broken down, whose radio works.
//!
//! A body that is not in the world is no obstacle, sees nothing and has no radio; its state keeps
//! the start pose before it joins, and the last pose after it has left. A broken-down body stays
//! where it is, at rest, as an obstacle. The agents' start poses are chosen as if all of them were
//! there, so that a late agent finds its place free unless a body has moved there.
//!
//! Invariant: no body overlaps another, whoever joins.

use msgs::ids::AgentId;
use msgs::maes_msgs;
use msgs::shared_bytes::SharedBytes;
use nalgebra::Point3;
use protocol::event_mask::EventMask;

use super::body::{Body, Pose};
use super::collision::Sphere;
use super::{ScanSchedule, World, index_of, spawn};
use protocol::agent_message::{AgentMessage, Peer};

/// Whether an agent is in the world.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Presence {
    /// It is, and works.
    Active,
    /// It has not joined yet.
    Absent,
    /// Its body is there as an obstacle.
    BrokenDown,
    /// It has left.
    Gone,
}

impl Presence {
    /// Whether there is a body.
    #[must_use]
    pub fn is_in_world(self) -> bool {
        matches!(self, Self::Active | Self::BrokenDown)
    }

    /// In words; `None` for an agent that works.
    #[must_use]
    pub fn word(self) -> Option<&'static str> {
        match self {
            Self::Active => None,
            Self::Absent => Some("not there yet"),
            Self::BrokenDown => Some("broken down"),
            Self::Gone => Some("gone"),
        }
    }
}

impl World {
    /// Whether an agent is in the world.
    #[must_use]
    pub fn presence(&self, agent: AgentId) -> Presence {
        self.agents[agent.index()].presence
    }

    /// Whether the radio of an agent works.
    #[must_use]
    pub fn is_on_air(&self, agent: AgentId) -> bool {
        let state = &self.agents[agent.index()];
        state.presence == Presence::Active && state.has_radio
    }

    /// Lets an absent agent join at its start pose, at rest, a ground body on the floor that is
    /// below it by now; returns false if there is no room.
    pub fn join(&mut self, agent: AgentId) -> bool {
        let pose = *self.body(agent).pose();
        self.join_at(agent, pose).is_ok()
    }

    /// Lets an absent agent join at another pose than its start pose, at rest.
    ///
    /// # Errors
    /// Why its body cannot be there.
    pub fn join_at(&mut self, agent: AgentId, pose: Pose) -> Result<(), &'static str> {
        let pose = Pose { position: self.room(agent, &pose.position)?, ..pose };
        let cell = self.terrain.extent().cell_of(&pose.position);
        let is_on_request = matches!(self.params.schedule, ScanSchedule::OnRequest { .. });
        let tick = self.tick;
        let state = &mut self.agents[agent.index()];
        state.body = Body::at_rest(*state.body.model(), pose);
        state.cell = cell;
        state.presence = Presence::Active;
        state.next_scan = is_on_request.then_some(tick);
        self.spheres[agent.index()] = state.sphere();
        self.coverage.cover(agent, index_of(&self.terrain, cell));
        self.contacts = None;
        self.localise_anew(agent);
        self.put(agent);
        Ok(())
    }

    /// Ends the work of an agent: its body stops at once and stays, and its radio is silent.
    pub fn break_down(&mut self, agent: AgentId) {
        self.retire(agent, Presence::BrokenDown);
    }

    /// Takes an agent out of the world.
    pub fn leave(&mut self, agent: AgentId) {
        self.retire(agent, Presence::Gone);
    }

    fn retire(&mut self, agent: AgentId, presence: Presence) {
        let state = &mut self.agents[agent.index()];
        state.presence = presence;
        state.body = Body::at_rest(*state.body.model(), *state.body.pose());
        (state.next_scan, state.scan_period_ticks, state.want_view) = (None, None, false);
        self.spheres[agent.index()] = state.sphere();
        self.clear_queue(agent);
        self.contacts = None;
    }

    /// Switches the radio of an agent. What is sent to it meanwhile is lost, and so is what it
    /// sends.
    pub fn switch_radio(&mut self, agent: AgentId, is_on: bool) {
        self.agents[agent.index()].has_radio = is_on;
        self.contacts = None;
    }

    /// Hands an agent over to another controller: its body is at rest, its task has ended with
    /// [`EventMask::TASK_DONE`], and its LiDAR scans as at the start.
    pub fn hand_over(&mut self, agent: AgentId) {
        let tick = self.tick;
        let schedule = self.params.schedule;
        let state = &mut self.agents[agent.index()];
        state.body = Body::at_rest(*state.body.model(), *state.body.pose());
        state.pending_observation.events |= EventMask::TASK_DONE;
        state.want_view = false;
        if let ScanSchedule::OnRequest { period_ticks } = schedule {
            (state.next_scan, state.scan_period_ticks) = (Some(tick), Some(period_ticks));
        }
    }

    /// Adds a message of the server to the next observation of an agent.
    pub fn tell(&mut self, agent: AgentId, data: SharedBytes) {
        let message = AgentMessage { peer: Peer::Server, kind: maes_msgs::AgentMessage::SCENARIO, data };
        self.agents[agent.index()].pending_observation.tell(message);
    }

    /// Where the body of an agent is that is put at a position (metres, frame `map`).
    pub(super) fn room(&self, agent: AgentId, position: &Point3<f64>) -> Result<Point3<f64>, &'static str> {
        let bodies = self.spheres.iter().enumerate();
        let others = bodies.filter(|(other, sphere)| *other != agent.index() && sphere.is_solid());
        let model = self.body(agent).model();
        let position = spawn::room(&self.terrain, others.map(|(_, sphere)| sphere), position, model)?;
        let body = Sphere { centre: position, radius_m: model.radius_m };
        match self.moving_obstacles().iter().any(|obstacle| obstacle.overlaps(&body)) {
            true => Err("a moving obstacle is too near"),
            false => Ok(position),
        }
    }
}
