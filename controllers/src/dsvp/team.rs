//! The tour stage: an agent plans tours for the whole team, as far as it knows it, over viewpoints
//! that see what is behind all frontiers, and follows its own.
//!
//! It takes the place of the exploration stage. At each plan the tasks of the nearest regions with
//! frontiers are found anew ([`viewpoints`]), weighted by the number of free cells that they are
//! expected to show ([`super::expectation`]) and by the probability that no other agent has seen
//! them in the meantime ([`sightings`]), and divided among this agent, from where it is, and the
//! others, from their claimed goals ([`division`]). Claims are exchanged as in the auction, which
//! also settles conflicts. An agent without a task in that division plans for itself alone; one
//! without any task at all relocates.
//!
//! Invariants: it goes only where the graph knows a path; it depends on the map, the graph and the
//! observations alone.

mod division;
mod sightings;
mod viewpoints;

use std::collections::BTreeMap;

use msgs::ids::{AgentId, Tick};
use voxels::Cell;

use super::avoidance::motion_to;
use super::coordination::Coordination;
use super::gain::GainEstimator;
use super::goal::Goal;
use super::obstacles::Obstacles;
use super::{ATTEMPTS, Dsvp, Plan, has_gain_left};
use crate::Ctx;
use crate::auction::{Auction, AuctionParams};
use agent::abstract_graph::{AbstractGraph, PathLengths, RegionId};
use agent::command::{Command, WakeCondition};
use agent::observation::{Observation, RunInfo};
use division::Division;
use sightings::{Prospect, Sighting, Sightings};
use viewpoints::{Candidate, Task, Viewpoints};

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
    viewpoints: Viewpoints,
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
            params: params.of(run_info.bodies.of(agent).kind),
            auction: Auction::new(params.auction, &run_info.bodies, agent, run_info.extent),
            viewpoints: Viewpoints::new(run_info.extent),
            sightings: Sightings::default(),
            lengths: PathLengths::default(),
        }
    }

    /// The tasks that are worth most for their time, with the times to them.
    fn valued(&mut self, tasks: Vec<Task>, own_m: &BTreeMap<RegionId, f64>, world: &TeamContext<'_>) -> Vec<Valued> {
        let TeamParams { leg_s, exponent, .. } = self.params;
        let mut arrivals_s: Vec<Vec<f64>> = vec![Vec::new(); tasks.len()];
        self.lengths.renew(world.graph);
        for (_, sighting) in self.sightings.iter() {
            self.lengths.begin(world.graph, sighting.cell, tasks.iter().map(|task| task.region));
            for (arrivals_s, task) in arrivals_s.iter_mut().zip(&tasks) {
                let length = self.lengths.to(world.graph, task.region);
                let travel_s = world.leg_s(length, sighting.speed_m_s, leg_s);
                arrivals_s.push(sighting.free_s - seconds(world.now) + travel_s);
            }
        }
        let valued = tasks.into_iter().zip(arrivals_s).map(|(task, arrivals_s)| {
            let own_s = own_m[&task.region] / world.speed_m_s + leg_s;
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
        let mut between_s = vec![vec![UNREACHABLE_S; tasks.len()]; tasks.len()];
        // A path is as long as the way back. The searches from the tasks farthest from here come
        // first: they cover the map, and those that are left stay among the tasks nearby.
        let mut farthest_first: Vec<usize> = (0..tasks.len()).collect();
        farthest_first.sort_by(|&a, &b| valued[b].own_s.total_cmp(&valued[a].own_s).then(a.cmp(&b)));
        for (done, &from) in farthest_first.iter().enumerate() {
            let left = &farthest_first[done..];
            self.lengths.begin(world.graph, tasks[from].cell, left.iter().map(|&to| tasks[to].region));
            for &to in left {
                let other = &tasks[to];
                let length = self.lengths.to(world.graph, other.region);
                let leg_s = world.leg_s(length, world.speed_m_s, leg_s);
                between_s[from][to] = leg_s;
                between_s[to][from] = leg_s;
            }
        }
        let whole: f64 = valued.iter().map(|valued| valued.weight).sum();
        let weights: Vec<f64> = valued.iter().map(|valued| valued.weight / whole).collect();
        let own: Vec<f64> = valued.iter().map(|valued| valued.own_s).collect();
        let takes_part = |sighting: &Sighting| seconds(world.now) - sighting.free_s < memory_s;
        let others = self.sightings.iter().enumerate().filter(|(_, (_, sighting))| takes_part(sighting));
        let arrivals_s = others.map(|(other, _)| arrivals_s(valued, other));
        let first_s = std::iter::once(own.clone()).chain(arrivals_s).collect();
        let division = Division { first_s, between_s: &between_s, weights: &weights, latency_weight };
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
    fn wake(&self) -> WakeCondition {
        Coordination::wake(&self.auction)
    }

    fn receive(&mut self, observation: &Observation, agents: u32) {
        Coordination::receive(&mut self.auction, observation, agents);
    }

    /// The tour stage: to the first task of the own tour that can be reached.
    fn first_stage(
        planner: &mut Dsvp<Self>,
        observation: &Observation,
        ctx: &mut Ctx<'_>,
        obstacles: &Obstacles,
    ) -> Plan {
        let Dsvp { params, graph, paths, gain_estimator, coordination: team, unproductive, abandoned, .. } = planner;
        let (map, here, now) = (ctx.map(), ctx.cell(), observation.tick);
        if has_gain_left(planner.goal, here, map, gain_estimator, params.gain_min) {
            unproductive.insert(here);
        }
        team.sightings.update(&team.auction, observation);
        let cell_m = map.extent().cell_m();
        let world = TeamContext { graph, cell_m, speed_m_s: team.auction.own_speed_m_s(), now };
        let mut candidates = Vec::new();
        let mut own_m = BTreeMap::new();
        paths.begin(graph, here);
        while candidates.len() < team.params.regions
            && paths.has_frontiers_left()
            && let Some((id, region, length)) = paths.next(graph)
        {
            let Some(candidate) = Candidate::new(graph, id, region, here, abandoned) else { continue };
            if candidate.cell == here {
                abandoned.insert(candidate.frontier);
                continue;
            }
            candidates.push(candidate);
            own_m.insert(id, length * cell_m);
        }
        let is_unproductive = |cell: Cell| cell == here || unproductive.contains(&cell);
        let least = team.params.expected_min;
        let tasks = team.viewpoints.tasks(map, gain_estimator, &candidates, &is_unproductive, least);
        if tasks.is_empty() {
            return Plan::Nothing;
        }
        let valued = team.valued(tasks, &own_m, &world);
        for number in team.own_tour(&valued, &world).into_iter().take(ATTEMPTS) {
            let task = &valued[number].task;
            if let Some(motion) = motion_to(ctx, graph, paths, task.cell, obstacles, params.waypoints) {
                return Plan::Go(goal(task, gain_estimator, ctx, params.gain_min, least), motion);
            }
        }
        Plan::Blocked
    }

    fn is_outbid(&self, now: Tick) -> bool {
        self.auction.is_outbid(now)
    }

    fn claim(&mut self, goal: Cell, path_m: f64, now: Tick) {
        self.auction.claim(goal, path_m, now);
    }

    fn withdraw(&mut self) {
        self.auction.withdraw();
    }

    fn utility_factor(&self, viewpoint: Cell, path_m: f64, now: Tick) -> f64 {
        self.auction.utility_factor(viewpoint, path_m, now)
    }

    fn penalty_m(&self, viewpoint: Cell, path_m: f64, observation: &Observation) -> f64 {
        Coordination::penalty_m(&self.auction, viewpoint, path_m, observation)
    }

    fn with_claims(&self, command: Command, observation: &Observation) -> Command {
        self.auction.with_claims(command, observation)
    }
}

/// The goal of a task: its viewpoint, if that has a gain, or else its frontier.
fn goal(task: &Task, gain_estimator: &mut GainEstimator, ctx: &Ctx<'_>, gain_min: u32, expected_min: f64) -> Goal {
    let gain = gain_estimator.gain(ctx.map(), task.cell);
    if gain >= gain_min && task.expected_cells >= expected_min {
        Goal::Viewpoint { cell: task.cell, gain }
    } else {
        Goal::Frontier { cell: task.cell, frontier: task.frontier }
    }
}

/// Sim time, seconds.
fn seconds(tick: Tick) -> f64 {
    tick.0 as f64 * Tick::TICK_S
}

#[cfg(test)]
mod tests;
