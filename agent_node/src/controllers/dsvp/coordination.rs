//! How the planners of a team keep out of each other's way: not at all, by an auction of goals,
//! by an auction and tours over shared-out tasks, by Voronoi regions, or by tours planned for all.
//!
//! The planner asks here what a goal is worth beside those of others; the answers are in
//! [`crate::controllers::auction`], [`super::tours`], [`super::voronoi`] and [`super::team`].

use msgs::ids::Tick;
use msgs::maes_msgs::Wake as Events;
use voxels::Cell;

use super::team::{Team, TeamParams};
use super::tours::{Tours, ToursParams};
use super::voronoi::Territories;
use crate::abstract_graph::{AbstractGraph, RegionId};
use crate::command::{Command, Trigger};
use crate::controllers::Ctx;
use crate::controllers::auction::{Auction, AuctionParams, CLAIMS_MESSAGE};
use crate::observation::Observation;

/// A way to coordinate, with its parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Scheme {
    /// Each agent for itself.
    Alone,
    Auction(AuctionParams),
    Tours(ToursParams),
    /// Voronoi regions; agents within so many metres of each other are a clump.
    Voronoi(AuctionParams, f64),
    /// Tours planned for the whole team.
    Team(TeamParams),
}

impl Scheme {
    /// The events at which an agent has to look at the messages of others.
    pub(super) fn trigger(self) -> Trigger {
        match self {
            Self::Alone => Trigger::on(0),
            Self::Auction(_) | Self::Tours(_) | Self::Voronoi(..) | Self::Team(_) => {
                Trigger::on(Events::CONTACTS | Events::PARCEL)
            }
        }
    }

    /// The state at the start.
    pub(super) fn begin(self, ctx: &Ctx<'_>) -> Coordination {
        let run_info = ctx.run_info();
        match self {
            Self::Alone => Coordination::Alone,
            Self::Auction(params) => {
                Coordination::Auction(Auction::new(params, &run_info.bodies, ctx.agent(), run_info.extent))
            }
            Self::Voronoi(params, clump_m) => Coordination::Voronoi(
                Auction::new(params, &run_info.bodies, ctx.agent(), run_info.extent),
                Box::new(Territories::new(ctx.agent(), run_info.extent, clump_m)),
            ),
            Self::Team(params) => Coordination::Team(
                Auction::new(params.auction, &run_info.bodies, ctx.agent(), run_info.extent),
                Box::new(Team::new(params.of(ctx.body().kind), run_info.extent)),
            ),
            Self::Tours(params) => Coordination::Tours(
                Auction::new(params.auction, &run_info.bodies, ctx.agent(), run_info.extent),
                Box::new(Tours::new(params, ctx.agent(), run_info.agents, run_info.extent)),
            ),
        }
    }
}

/// The state of the coordination.
#[derive(Debug)]
pub(super) enum Coordination {
    Alone,
    Auction(Auction),
    Tours(Auction, Box<Tours>),
    Voronoi(Auction, Box<Territories>),
    Team(Auction, Box<Team>),
}

impl Coordination {
    /// Processes the messages of an observation. `agents` is the team size.
    pub(super) fn receive(&mut self, observation: &Observation, agents: u32) {
        match self {
            Self::Alone => {}
            Self::Auction(auction) | Self::Voronoi(auction, _) | Self::Team(auction, _) => {
                auction.receive(&observation.messages, observation.tick, agents)
            }
            Self::Tours(auction, tours) => {
                auction.receive(&observation.messages, observation.tick, agents);
                tours.receive(&observation.messages, observation.tick);
            }
        }
    }

    /// Divides the map among the agents that this one knows of, if that is the scheme. The graph
    /// must be up to date.
    pub(super) fn share_out(&mut self, graph: &AbstractGraph, here: Cell, observation: &Observation) {
        let Self::Voronoi(auction, territories) = self else { return };
        if graph.regions_with_frontiers() == 0 {
            return;
        }
        let others = auction.presences(&observation.contacts, observation.tick);
        territories.divide(graph, (here, auction.own_speed_m_s()), &others);
    }

    /// Whether the goal last claimed belongs to another agent.
    pub(super) fn is_lost(&self, now: Tick) -> bool {
        match self {
            Self::Alone => false,
            Self::Auction(auction) | Self::Team(auction, _) => auction.is_outbid(now),
            Self::Voronoi(..) => false,
            Self::Tours(_, tours) if tours.explores_own() => tours.is_lost(now),
            Self::Tours(auction, _) => auction.is_outbid(now),
        }
    }

    /// Claims a goal to which the path has this length.
    pub(super) fn claim(&mut self, graph: &AbstractGraph, cell: Cell, path_m: f64, now: Tick) {
        match self {
            Self::Alone => {}
            Self::Auction(auction) | Self::Voronoi(auction, _) | Self::Team(auction, _) => {
                auction.claim(cell, path_m, now);
            }
            Self::Tours(auction, tours) => {
                auction.claim(cell, path_m, now);
                tours.claim(graph, cell);
            }
        }
    }

    /// Withdraws the last claim.
    pub(super) fn withdraw(&mut self) {
        match self {
            Self::Alone => {}
            Self::Auction(auction) | Self::Voronoi(auction, _) | Self::Team(auction, _) => auction.withdraw(),
            Self::Tours(auction, tours) => {
                auction.withdraw();
                tours.withdraw();
            }
        }
    }

    /// Whether the exploration stage sees the frontiers of a region.
    pub(super) fn is_open(&self, graph: &AbstractGraph, centre: Cell) -> bool {
        match self {
            Self::Alone | Self::Auction(_) | Self::Team(..) => true,
            Self::Voronoi(_, territories) => territories.is_own(graph, centre),
            Self::Tours(_, tours) => !tours.explores_own() || tours.is_own(graph, centre),
        }
    }

    /// The factor on the utility of a viewpoint.
    pub(super) fn utility_factor(&self, graph: &AbstractGraph, cell: Cell, path_m: f64, now: Tick) -> f64 {
        match self {
            Self::Alone => 1.0,
            Self::Voronoi(_, territories) => f64::from(u8::from(territories.is_own(graph, cell))),
            Self::Tours(_, tours) if tours.explores_own() => f64::from(u8::from(tours.is_own(graph, cell))),
            Self::Auction(auction) | Self::Tours(auction, _) | Self::Team(auction, _) => {
                auction.utility_factor(cell, path_m, now)
            }
        }
    }

    /// The cost added to the path length to a viewpoint of a region with frontiers, metres.
    pub(super) fn penalty_m(&self, (region, cell): (RegionId, Cell), path_m: f64, observation: &Observation) -> f64 {
        match self {
            Self::Alone => 0.0,
            Self::Auction(auction) | Self::Team(auction, _) => {
                auction.penalty_m(cell, path_m, &observation.contacts, observation.tick)
            }
            Self::Voronoi(auction, territories) => {
                if territories.owns(region) {
                    0.0
                } else {
                    auction.trespass_m()
                }
            }
            Self::Tours(auction, tours) => {
                let bid_m = auction.penalty_m(cell, path_m, &observation.contacts, observation.tick);
                tours.penalty_m(region, path_m, bid_m, observation.tick)
            }
        }
    }

    /// Adds the claims for the agents in contact to a command, if there is an auction.
    pub(super) fn with_claims(&self, command: Command, observation: &Observation) -> Command {
        match self {
            Self::Auction(auction) | Self::Tours(auction, _) | Self::Voronoi(auction, _) | Self::Team(auction, _)
                if !observation.contacts.is_empty() =>
            {
                command.with_message(None, CLAIMS_MESSAGE, auction.encode())
            }
            _ => command,
        }
    }
}
