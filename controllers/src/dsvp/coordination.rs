//! How the planners of a team keep out of each other's way: [`Coordination`], with an
//! implementation for each way: not at all ([`Alone`]), by an auction of goals ([`Auction`]), and
//! by tours that each agent plans for the whole team ([`TourCoordination`](super::team::Team)).
//!
//! The planner asks here what a goal is worth beside the goals of others.

use std::fmt;

use msgs::ids::Tick;
use protocol::event_mask::EventMask;
use protocol::message_type::MessageType;
use voxels::Cell;

use super::obstacles::Obstacles;
use super::{Dsvp, Plan};
use crate::Ctx;
use crate::auction::Auction;
use agent::command::{Command, WakeCondition};
use agent::observation::Observation;

/// A way to coordinate, with its state in one agent.
///
/// Invariant: it depends on the observations and on what the planner claims alone, so that agents
/// that have received the same messages agree.
pub(super) trait Coordination: fmt::Debug + Send + Sized {
    /// The events at which an agent under way is due, to read the messages of others.
    fn wake(&self) -> WakeCondition;

    /// Processes the messages of an observation. `agents` is the team size.
    fn receive(&mut self, observation: &Observation, agents: u32);

    /// The first stage of a plan; with [`Plan::Nothing`] the planner relocates. By
    /// default it explores nearby.
    fn first_stage(
        planner: &mut Dsvp<Self>,
        observation: &Observation,
        ctx: &mut Ctx<'_>,
        obstacles: &Obstacles,
    ) -> Plan {
        planner.explore(observation, ctx, obstacles)
    }

    /// Whether another agent has the better claim to the goal last claimed.
    fn is_outbid(&self, now: Tick) -> bool;

    /// Claims a goal to which the path is `path_m` long, metres.
    fn claim(&mut self, goal: Cell, path_m: f64, now: Tick);

    /// Withdraws the last claim.
    fn withdraw(&mut self);

    /// The factor on the utility of a viewpoint at the end of a path of `path_m` metres, 0 to 1.
    fn utility_factor(&self, viewpoint: Cell, path_m: f64, now: Tick) -> f64;

    /// The cost added to the path length `path_m` to a viewpoint beside frontiers, metres.
    fn penalty_m(&self, viewpoint: Cell, path_m: f64, observation: &Observation) -> f64;

    /// Adds the claims for the agents in contact to a command.
    fn with_claims(&self, command: Command, observation: &Observation) -> Command;
}

/// Each agent for itself: it claims nothing, and no goal of others counts.
#[derive(Debug, Clone, Copy)]
pub(super) struct Alone;

impl Coordination for Alone {
    fn wake(&self) -> WakeCondition {
        WakeCondition::on(EventMask::empty())
    }

    fn receive(&mut self, _observation: &Observation, _agents: u32) {}

    fn is_outbid(&self, _now: Tick) -> bool {
        false
    }

    fn claim(&mut self, _goal: Cell, _path_m: f64, _now: Tick) {}

    fn withdraw(&mut self) {}

    fn utility_factor(&self, _viewpoint: Cell, _path_m: f64, _now: Tick) -> f64 {
        1.0
    }

    fn penalty_m(&self, _viewpoint: Cell, _path_m: f64, _observation: &Observation) -> f64 {
        0.0
    }

    fn with_claims(&self, command: Command, _observation: &Observation) -> Command {
        command
    }
}

impl Coordination for Auction {
    fn wake(&self) -> WakeCondition {
        WakeCondition::on(EventMask::CONTACTS | EventMask::MESSAGE)
    }

    fn receive(&mut self, observation: &Observation, agents: u32) {
        Auction::receive(self, &observation.messages, observation.tick, agents);
    }

    fn is_outbid(&self, now: Tick) -> bool {
        Auction::is_outbid(self, now)
    }

    fn claim(&mut self, goal: Cell, path_m: f64, now: Tick) {
        Auction::claim(self, goal, path_m, now);
    }

    fn withdraw(&mut self) {
        Auction::withdraw(self);
    }

    fn utility_factor(&self, viewpoint: Cell, path_m: f64, now: Tick) -> f64 {
        Auction::utility_factor(self, viewpoint, path_m, now)
    }

    fn penalty_m(&self, viewpoint: Cell, path_m: f64, observation: &Observation) -> f64 {
        Auction::penalty_m(self, viewpoint, path_m, &observation.contacts, observation.tick)
    }

    fn with_claims(&self, command: Command, observation: &Observation) -> Command {
        if observation.contacts.is_empty() {
            return command;
        }
        command.with_message(None, MessageType::Claims.number(), self.encode())
    }
}
