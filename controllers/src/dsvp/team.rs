//! The tour stage: an agent plans tours for the whole team, as far as it knows it, over viewpoints
//! that see what is behind all frontiers, and follows its own.
//!
//! It takes the place of the exploration stage. At each plan the tasks of the nearest regions with
//! frontiers are found anew ([`super::tasks`]), weighted by the number of free cells that they are
//! expected to show ([`super::expectation`]) and by the probability that no other agent has seen
//! them in the meantime ([`sightings`]), and divided among this agent, from where it is, and the
//! others, from their claimed goals ([`super::division`]). Claims are exchanged as in the auction,
//! which also settles conflicts. An agent without a task in that division plans for itself alone;
//! one without any task at all relocates.
//!
//! Invariants: it goes only where the graph knows a path; it depends on the map, the graph and the
//! observations alone.

mod sightings;

use msgs::ids::{AgentId, Tick};

use super::coordination::Coordination;
use super::division::Division;
use super::obstacles::Obstacles;
use super::tasks::{ReachedTask, Task, TaskSearch, lengths_between};
use super::{Dsvp, Plan};
use crate::Ctx;
use crate::auction::{Auction, AuctionParams};
use agent::abstract_graph::{AbstractGraph, PathLengths};
use agent::observation::{Observation, RunInfo};
use sightings::{Prospect, Sighting, Sightings};

/// Duration of a leg that is not possible, seconds: more than any tour takes.
const UNREACHABLE_S: f64 = 1e6;

/// What a task counts at least, expected free cells: so each one is visited in the end.
const EXPECTED_FLOOR: f64 = 0.05;

/// Added to the time to a task where those worth most for their time are chosen, seconds.
const NEAR_S: f64 = 10.0;

/// Parameters of the tours of a team.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct TeamParams {
    /// Those of the claims.
    pub(super) auction: AuctionParams,
    /// How many regions with frontiers a plan looks at, the nearest ones.
    pub(super) regions: usize,
    /// Most tasks of a division.
    pub(super) tasks: usize,
    /// Expected free cells from which on a viewpoint is a task.
    pub(super) expected_min: f64,
    /// Exponent of the expected free cells in the weight of a task.
    pub(super) exponent: f64,
    /// What the weighted mean of the times of all tasks counts beside the mean duration of tours.
    pub(super) latency_weight: f64,
    /// Time of a leg beside its length over the speed: to turn, start, stop and look; seconds.
    pub(super) leg_s: f64,
    /// The tasks, the latency_weight and the time of a leg for aerial bodies, which need not turn.
    pub(super) aerial_tasks: usize,
    pub(super) aerial_latency_weight: f64,
    pub(super) aerial_leg_s: f64,
    /// How long an agent has a part in divisions after it should have been at its last known goal,
    /// seconds.
    pub(super) memory_s: f64,
}

/// What an agent knows about the team and the tasks.
#[derive(Debug)]
pub(super) struct TourCoordination {
    params: TeamParams,
    auction: Auction,
    search: TaskSearch,
    sightings: Sightings,
    lengths: PathLengths,
}

/// A task with what a division has to know.
struct Valued {
    task: Task,
    own_s: f64,
    /// By agent of the sightings, seconds from now.
    arrivals_s: Vec<f64>,
    weight: f64,
}

impl Valued {
    fn prospect(&self) -> Prospect {
        Prospect { expected_cells: self.task.expected_cells, own_s: self.own_s }
    }
}

/// By task, when another agent is expected there, by the number of its sighting; seconds from now.
fn arrivals_s(valued: &[Valued], sighting: usize) -> Vec<f64> {
    valued.iter().map(|valued| valued.arrivals_s[sighting]).collect()
}

impl TourCoordination {
    /// That of an agent of a run, which knows nothing yet.
    pub(super) fn new(params: TeamParams, agent: AgentId, run_info: &RunInfo) -> Self {
        Self {
            search: TaskSearch::new(run_info.extent, params.regions, params.expected_min),
            params: params.of(run_info.bodies.of(agent).kind),
            auction: Auction::new(params.auction, &run_info.bodies, agent, run_info.extent),
            sightings: Sightings::default(),
            lengths: PathLengths::default(),
        }
    }

    /// The tasks that are worth most for their time, with the times to them.
    fn valued(&mut self, tasks: Vec<ReachedTask>, world: &TeamContext<'_>) -> Vec<Valued> {
        let TeamParams { leg_s, exponent, .. } = self.params;
        let mut arrivals_s: Vec<Vec<f64>> = vec![Vec::new(); tasks.len()];
        self.lengths.renew(world.graph);
        for (_, sighting) in self.sightings.iter() {
            self.lengths.begin(world.graph, sighting.cell, tasks.iter().map(|reached| reached.task.region));
            for (arrivals_s, ReachedTask { task, .. }) in arrivals_s.iter_mut().zip(&tasks) {
                let length = self.lengths.to(world.graph, task.region);
                let travel_s = world.leg_s(length, sighting.speed_m_s, leg_s);
                arrivals_s.push(sighting.free_s - seconds(world.now) + travel_s);
            }
        }
        let valued = tasks.into_iter().zip(arrivals_s).map(|(ReachedTask { task, own_m }, arrivals_s)| {
            let own_s = own_m / world.speed_m_s + leg_s;
            let valued = Valued { task, own_s, arrivals_s, weight: 0.0 };
            let chance = |((_, sighting), &arrival_s): ((AgentId, &Sighting), &f64)| {
                sighting.chance_seen(valued.prospect(), arrival_s, world.now)
            };
            let seen = self.sightings.iter().zip(&valued.arrivals_s).map(chance).fold(0.0, f64::max);
            let expected_cells = (task.expected_cells * (1.0 - seen)).max(EXPECTED_FLOOR);
            Valued { weight: libm::pow(expected_cells, exponent), ..valued }
        });
        let mut valued: Vec<Valued> = valued.collect();
        let worth = |valued: &Valued| {
            let soonest_s = valued.arrivals_s.iter().copied().fold(valued.own_s, f64::min);
            valued.weight / (soonest_s.max(0.0) + NEAR_S)
        };
        valued.sort_by(|a, b| worth(b).total_cmp(&worth(a)).then(a.task.cell.cmp(&b.task.cell)));
        valued.truncate(self.params.tasks);
        valued
    }

    /// The tour of this agent over some tasks: its part in the division among the team, or, if that
    /// is empty, a tour over all of them.
    fn own_tour(&mut self, valued: &[Valued], world: &TeamContext<'_>) -> Vec<usize> {
        let TeamParams { leg_s, latency_weight, memory_s, .. } = self.params;
        let tasks: Vec<Task> = valued.iter().map(|valued| valued.task).collect();
        let mut farthest_first: Vec<usize> = (0..tasks.len()).collect();
        farthest_first.sort_by(|&a, &b| valued[b].own_s.total_cmp(&valued[a].own_s).then(a.cmp(&b)));
        let between = lengths_between(&mut self.lengths, world.graph, &tasks, &farthest_first);
        let leg_s = |length: Option<f64>| world.leg_s(length, world.speed_m_s, leg_s);
        let between_s: Vec<Vec<f64>> = between.into_iter().map(|row| row.into_iter().map(leg_s).collect()).collect();
        let whole: f64 = valued.iter().map(|valued| valued.weight).sum();
        let weights: Vec<f64> = valued.iter().map(|valued| valued.weight / whole).collect();
        let own: Vec<f64> = valued.iter().map(|valued| valued.own_s).collect();
        let takes_part = |sighting: &Sighting| seconds(world.now) - sighting.free_s < memory_s;
        let others = self.sightings.iter().enumerate().filter(|(_, (_, sighting))| takes_part(sighting));
        let arrivals_s = others.map(|(other, _)| arrivals_s(valued, other));
        let first_s = std::iter::once(own.clone()).chain(arrivals_s).collect();
        let load_max = f64::INFINITY;
        let division = Division { first_s, between_s: &between_s, weights: &weights, latency_weight, load_max };
        let tour = division.tours().swap_remove(0);
        if tour.is_empty() { Division { first_s: vec![own], ..division }.tours().swap_remove(0) } else { tour }
    }
}

/// What a plan starts from.
struct TeamContext<'g> {
    graph: &'g AbstractGraph,
    cell_m: f64,
    speed_m_s: f64,
    now: Tick,
}

impl TeamContext<'_> {
    /// The duration of a leg of this length in cells, with a stop, seconds.
    fn leg_s(&self, length: Option<f64>, speed_m_s: f64, stop_s: f64) -> f64 {
        length.map_or(UNREACHABLE_S, |cells| cells * self.cell_m / speed_m_s + stop_s)
    }
}

impl Coordination for TourCoordination {
    fn auction(&self) -> Option<&Auction> {
        Some(&self.auction)
    }

    fn auction_mut(&mut self) -> Option<&mut Auction> {
        Some(&mut self.auction)
    }

    /// The tour stage: to the first task of the own tour that can be reached.
    fn first_stage(
        planner: &mut Dsvp<Self>,
        observation: &Observation,
        ctx: &mut Ctx<'_>,
        obstacles: &Obstacles,
    ) -> Plan {
        let (mut at, team) = planner.split();
        team.sightings.update(&team.auction, observation);
        let cell_m = ctx.map().extent().cell_m();
        let (graph, now) = (at.graph, observation.tick);
        let world = TeamContext { graph, cell_m, speed_m_s: team.auction.own_speed_m_s(), now };
        let tasks = team.search.tasks(&mut at, ctx);
        if tasks.is_empty() {
            return Plan::Nothing;
        }
        let valued = team.valued(tasks, &world);
        let tour = team.own_tour(&valued, &world);
        team.search.go(tour.into_iter().map(|number| &valued[number].task), &mut at, ctx, obstacles)
    }
}

/// Sim time, seconds.
fn seconds(tick: Tick) -> f64 {
    tick.0 as f64 * Tick::TICK_S
}

#[cfg(test)]
mod tests;
