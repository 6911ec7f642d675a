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
/// One with an auction claims its goals there, and its agents keep off the claims of others; one
/// without claims nothing.
///
/// Invariant: it depends on the observations and on what the planner claims alone, so that agents
/// that have received the same messages agree.
pub(super) trait Coordination: fmt::Debug + Send + Sized {
    /// The auction of goals, if there is one.
    fn auction(&self) -> Option<&Auction> {
        None
    }

    /// The auction of goals, if there is one.
    fn auction_mut(&mut self) -> Option<&mut Auction> {
        None
    }

    /// The events at which an agent under way is due, to read the messages of others.
    fn wake(&self) -> WakeCondition {
        let events = self.auction().map_or(EventMask::empty(), |_| EventMask::CONTACTS | EventMask::MESSAGE);
        WakeCondition::on(events)
    }

    /// Processes the messages of an observation. `agents` is the team size.
    fn receive(&mut self, observation: &Observation, agents: u32) {
        if let Some(auction) = self.auction_mut() {
            auction.receive(&observation.messages, observation.tick, agents);
        }
    }

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
    fn is_outbid(&self, now: Tick) -> bool {
        self.auction().is_some_and(|auction| auction.is_outbid(now))
    }

    /// Claims a goal to which the path is `path_m` long, metres.
    fn claim(&mut self, goal: Cell, path_m: f64, now: Tick) {
        if let Some(auction) = self.auction_mut() {
            auction.claim(goal, path_m, now);
        }
    }

    /// Withdraws the last claim.
    fn withdraw(&mut self) {
        if let Some(auction) = self.auction_mut() {
            auction.withdraw();
        }
    }

    /// The factor on the utility of a viewpoint at the end of a path of `path_m` metres, 0 to 1.
    fn utility_factor(&self, viewpoint: Cell, path_m: f64, now: Tick) -> f64 {
        self.auction().map_or(1.0, |auction| auction.utility_factor(viewpoint, path_m, now))
    }

    /// The cost added to the path length `path_m` to a viewpoint beside frontiers, metres.
    fn penalty_m(&self, viewpoint: Cell, path_m: f64, observation: &Observation) -> f64 {
        let Observation { contacts, tick, .. } = observation;
        self.auction().map_or(0.0, |auction| auction.penalty_m(viewpoint, path_m, contacts, *tick))
    }

    /// Adds what the agents in contact have to know to a command: by default the claims.
    fn with_messages(&mut self, command: Command, observation: &Observation) -> Command {
        match self.auction() {
            Some(auction) => with_claims(auction, command, observation),
            None => command,
        }
    }
}

/// Adds the claims for the agents in contact to a command.
pub(super) fn with_claims(auction: &Auction, command: Command, observation: &Observation) -> Command {
    if observation.contacts.is_empty() {
        return command;
    }
    command.with_message(None, MessageType::Claims.number(), auction.encode())
}

/// Each agent for itself: it claims nothing, and no goal of others counts.
#[derive(Debug, Clone, Copy)]
pub(super) struct Alone;

impl Coordination for Alone {}

impl Coordination for Auction {
    fn auction(&self) -> Option<&Auction> {
        Some(self)
    }

    fn auction_mut(&mut self) -> Option<&mut Auction> {
        Some(self)
    }
}
