//! A plan with the map known in advance, flown by the team in its world.
//!
//! Each agent follows its tour of viewpoints along shortest paths through free cells, with the
//! clearance of the largest body, stops at each, and scans. Places that have nothing new to show
//! any more are left out. An agent that is ready takes over a part of the longest tour. The first
//! tours lead to what shows most; scattered cells that the team has not seen by the way get tours
//! of their own afterwards.
//!
//! Bodies meet in narrow passages. Agents are interchangeable, so an agent that is blocked by
//! another swaps tours with it, and both turn round; if that does not help, it waits, and then goes
//! round the others. A flight ends when everything is seen, all tours are done, or at the greatest
//! duration of the run.
//!
//! Invariants: bodies move as the world moves them, collisions included; the flight is a function
//! of world and scanner.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use agent_node::bodies::{self, BodyModel};
use agent_node::exploration_map::ExplorationMap;
use agent_node::path::{Goal, Graph, Moves, Neighbours, Search, direct, find, nearest_distances, straighten_from};
use msgs::ids::{AgentId, Tick};
use nalgebra::Point3;
use protocol::command::{Command, WakeCondition};
use protocol::motion::Motion;
use protocol::scan_request::ScanRequest;
use voxels::{Cell, Terrain};
use world::World;
use world::lidar::Scanner;
use world::workers::Workers;

use super::tours::{self, Costs};
use super::viewpoints::{self, Viewpoint, Views};
use crate::rows::Marks;

/// Paths are searched to so many places nearest to each; the costs to others are sums of these.
const NEAREST: usize = 32;

/// The cost of a place that cannot be reached, ms: more than any tour, and sums of it fit.
const UNREACHABLE_MS: u64 = 1 << 40;

/// The turn that the cost of a leg assumes, rad.
const TURN_RAD: f64 = 1.0;

/// A body is at a place if it is not farther from it, m.
const AT_M: f64 = 1e-6;

/// Plans for what earlier tours have not seen, at most.
const PLANS_MAX: u32 = 20;

/// After so many failed attempts to get to a place it is left out.
const ATTEMPTS_MAX: u32 = 40;

/// Ticks that a blocked agent waits.
const WAIT_TICKS: u64 = 50;

/// Cells of a way round others, after which the path is searched again.
const DETOUR_CELLS: usize = 12;

/// Room between two bodies on such a way, m.
const ROOM_M: f64 = 0.1;

/// What an agent is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Phase {
    /// It is on its way, or has nothing to do.
    Going,
    /// It is at a viewpoint since this tick, and needs a scan from there.
    Scanning(Tick),
    /// Another body is in its way, so it waits until this tick.
    Waiting(Tick),
}

/// An agent and the rest of its tour, in numbers of places.
#[derive(Debug)]
struct Pilot {
    phase: Phase,
    /// The last place of its tour where it was.
    at: usize,
    target: Option<usize>,
    rest: VecDeque<usize>,
    /// Attempts to get to the target that ended elsewhere.
    attempts: u32,
    /// Another agent has swapped tours with it: what it does ends.
    is_called: bool,
}

/// Flies the team of a world, whose LiDARs scan every `period_ticks` on the way; returns when the
/// free cells were seen.
pub(super) fn fly(world: World, scanner: &Scanner, period_ticks: u32, end: Tick) -> Marks {
    let mut flight = Flight::new(world, scanner, period_ticks);
    flight.plan();
    let alone = Workers::new(1).expect("one thread is this one");
    let mut plans_left = PLANS_MAX;
    while flight.world.tick() < end {
        if !flight.step(&alone) {
            plans_left -= 1;
            if plans_left == 0 || flight.world.coverage().is_explored() || !flight.plan_rest() {
                break;
            }
        }
    }
    let reached = |mark: u64| {
        let tick = flight.world.coverage().milestones().find(|(permille, _)| *permille == mark)?.1;
        Some(tick.0 as f64 / (1e9 / Tick::TICK_NS as f64))
    };
    Marks { t90_s: reached(900), t99_s: reached(990), t100_s: reached(1000) }
}

struct Flight<'a> {
    world: World,
    views: Views<'a>,
    map: ExplorationMap,
    moves: Moves,
    radius_m: f64,
    period_ticks: u32,
    /// Indices of the cells where a body can get, ascending.
    open: Vec<u32>,
    /// Indices of free cells that are seen from nowhere near by.
    hopeless: BTreeSet<u32>,
    costs: Costs,
    /// By place; those of the starts see nothing.
    places: Vec<Viewpoint>,
    pilots: Vec<Pilot>,
}

impl<'a> Flight<'a> {
    /// A team that is to fly, and has no tours yet.
    fn new(world: World, scanner: &'a Scanner, period_ticks: u32) -> Self {
        let terrain = world.terrain();
        let extent = terrain.extent();
        let mut map = ExplorationMap::new(extent);
        let of_kind = |kind: Terrain| -> Vec<u32> {
            (0_u32..).zip(terrain.as_slice()).filter(|(_, cell)| **cell == kind).map(|(index, _)| index).collect()
        };
        map.note_free(&of_kind(Terrain::Free));
        map.note_wall(&of_kind(Terrain::Wall));
        let radius_m = world.agents().map(|agent| world.body(agent).model().radius_m).fold(0.0, f64::max);
        let moves = Moves::new(radius_m, extent.cell_m(), Neighbours::TwentySix);
        let graph = Graph::new(&map, &moves);
        let usable: Vec<u32> = of_kind(Terrain::Free)
            .into_iter()
            .filter(|&index| graph.is_usable(extent.cell_at(index as usize)))
            .collect();
        let cells: Vec<Cell> = usable.iter().map(|&index| extent.cell_at(index as usize)).collect();
        let mut is_open = vec![false; usable.len()];
        for start in world.agents().map(|agent| moves.lattice().cell_near(extent, &world.body(agent).pose().position)) {
            // Most teams start in one part of the map, which is searched once.
            let is_known = cells.binary_search(&start).is_ok_and(|place| is_open[place]);
            if !is_known {
                let costs = nearest_distances(graph, start, &cells, usize::MAX);
                is_open.iter_mut().zip(costs).for_each(|(open, cost)| *open |= cost.is_some());
            }
        }
        let open = usable.into_iter().zip(is_open).filter(|(_, is_open)| *is_open).map(|(index, _)| index).collect();
        Self {
            views: Views::new(scanner, terrain, moves.lattice()),
            map,
            moves,
            radius_m,
            period_ticks,
            open,
            hopeless: BTreeSet::new(),
            costs: Costs { agents: 0, between: Vec::new() },
            places: Vec::new(),
            pilots: Vec::new(),
            world,
        }
    }

    /// Plans tours to most of what the team does not see from where it is.
    fn plan(&mut self) {
        let mut seen = vec![false; self.map.extent().volume()];
        self.views.note_seen(&self.positions(), &mut seen);
        let viewpoints = viewpoints::coarse(&self.views, &self.open, &mut seen);
        self.share(viewpoints);
    }

    /// Plans tours to what has not been seen; returns whether there are any.
    fn plan_rest(&mut self) -> bool {
        let explored = self.world.coverage().explored_cells();
        let mut seen: Vec<bool> = (0..self.map.extent().volume()).map(|cell| explored.contains(cell)).collect();
        let rest = viewpoints::rest(self.world.terrain(), &self.views, &self.open, &mut seen, &mut self.hopeless);
        let is_any = !rest.is_empty();
        self.share(rest);
        is_any
    }

    fn positions(&self) -> Vec<Point3<f64>> {
        self.world.agents().map(|agent| self.world.body(agent).pose().position).collect()
    }

    /// Shares viewpoints out over the team, which is anywhere.
    fn share(&mut self, viewpoints: Vec<Viewpoint>) {
        let extent = self.map.extent();
        let starts: Vec<Cell> =
            self.positions().iter().map(|position| self.moves.lattice().cell_near(extent, position)).collect();
        let at_starts = starts.iter().map(|&cell| Viewpoint { cell, needs: Vec::new() });
        self.places = at_starts.chain(viewpoints).collect();
        let cells: Vec<Cell> = self.places.iter().map(|place| place.cell).collect();
        let body = *self.world.body(AgentId(0)).model();
        let between = costs(Graph::new(&self.map, &self.moves), &cells, &body);
        self.costs = Costs { agents: starts.len(), between };
        let pilot = |(at, tour): (usize, Vec<usize>)| Pilot {
            phase: Phase::Going,
            at,
            target: None,
            rest: tour.into(),
            attempts: 0,
            is_called: false,
        };
        self.pilots = tours::share(&self.costs).into_iter().enumerate().map(pilot).collect();
    }

    /// One tick. Returns whether there is anything left to see and to do.
    fn step(&mut self, workers: &Workers) -> bool {
        self.world.sense(workers);
        self.world.flush_scans();
        if self.world.coverage().is_explored() {
            return false;
        }
        let mut actions = BTreeMap::new();
        for agent in 0..self.pilots.len() {
            if self.is_free(agent)
                && let Some(action) = self.decide(agent)
            {
                actions.insert(AgentId::from_index(agent), action);
            }
        }
        let is_moving = |agent: usize| self.world.body(AgentId::from_index(agent)).is_active();
        let is_ready = |(agent, pilot): (usize, &Pilot)| {
            pilot.target.is_none() && pilot.rest.is_empty() && pilot.phase == Phase::Going && !is_moving(agent)
        };
        if actions.is_empty() && self.pilots.iter().enumerate().all(is_ready) {
            return false;
        }
        self.world.step(actions);
        true
    }

    /// Whether an agent has to decide in this tick.
    fn is_free(&mut self, agent: usize) -> bool {
        let id = AgentId::from_index(agent);
        let now = self.world.tick();
        let has_scanned = |since: Tick| self.world.last_scan(id).is_some_and(|(_, tick)| tick >= since);
        let is_free = match self.pilots[agent].phase {
            _ if self.pilots[agent].is_called => true,
            Phase::Scanning(since) => has_scanned(since),
            Phase::Waiting(until) => now >= until,
            Phase::Going => !self.world.body(id).is_active(),
        };
        if is_free {
            self.pilots[agent].phase = Phase::Going;
        }
        is_free
    }

    fn decide(&mut self, agent: usize) -> Option<Command> {
        let id = AgentId::from_index(agent);
        let now = self.world.tick();
        let was_called = std::mem::take(&mut self.pilots[agent].is_called);
        let position = self.world.body(id).pose().position;
        if let Some(target) = self.pilots[agent].target.filter(|_| !was_called) {
            if (self.centre(target) - position).norm() <= AT_M {
                let pilot = &mut self.pilots[agent];
                (pilot.at, pilot.target, pilot.attempts) = (target, None, 0);
                if self.is_needed(target) {
                    self.pilots[agent].phase = Phase::Scanning(now);
                    return Some(Command { lidar: ScanRequest::Every(self.period_ticks), ..still() });
                }
            } else if !self.is_needed(target) {
                self.pilots[agent].target = None;
            } else if self.world.body(id).collision().is_some_and(|collision| collision.with_agent) {
                return self.yield_way(agent);
            } else {
                self.note_attempt(agent);
            }
        }
        self.choose(agent);
        match self.pilots[agent].target {
            Some(target) => self.go(agent, target),
            // A body that was called stops.
            None => was_called.then(still),
        }
    }

    fn note_attempt(&mut self, agent: usize) {
        let pilot = &mut self.pilots[agent];
        pilot.attempts += 1;
        if pilot.attempts > ATTEMPTS_MAX {
            (pilot.target, pilot.attempts) = (None, 0);
        }
    }

    /// Whether a place has anything to show that was not seen yet.
    fn is_needed(&self, place: usize) -> bool {
        let explored = self.world.coverage().explored_cells();
        self.places[place].needs.iter().any(|&cell| !explored.contains(cell as usize))
    }

    fn centre(&self, place: usize) -> Point3<f64> {
        self.moves.lattice().place(self.map.extent(), self.places[place].cell)
    }

    /// Sets the next target of an agent, if it has none and there is one.
    fn choose(&mut self, agent: usize) {
        if self.pilots[agent].target.is_some() {
            return;
        }
        for other in 0..self.pilots.len() {
            let mut rest = std::mem::take(&mut self.pilots[other].rest);
            rest.retain(|&place| self.is_needed(place));
            self.pilots[other].rest = rest;
        }
        if self.pilots[agent].rest.is_empty() {
            self.take_over(agent);
        }
        self.pilots[agent].target = self.pilots[agent].rest.pop_front();
    }

    /// Takes over a part of the tour of the agent that will be ready last.
    fn take_over(&mut self, agent: usize) {
        let time = |busy: &Pilot| {
            let (at, head) = self.head(busy);
            let rest: Vec<usize> = busy.rest.iter().copied().collect();
            (head + self.costs.length(at, &rest), at, head, rest)
        };
        let longest =
            (0..self.pilots.len()).filter(|&other| other != agent).map(|other| (time(&self.pilots[other]), other));
        let Some(((_, at, head, rest), busy)) =
            longest.max_by_key(|((time, ..), other)| (*time, std::cmp::Reverse(*other)))
        else {
            return;
        };
        let Some((position, is_reversed)) = tours::take_over(&self.costs, self.pilots[agent].at, (at, head), &rest)
        else {
            return;
        };
        let mut part: Vec<usize> = self.pilots[busy].rest.drain(position..).collect();
        if is_reversed {
            part.reverse();
        }
        self.pilots[agent].rest = part.into();
    }

    /// Where an agent will be next on its tour, and the cost of getting there.
    fn head(&self, pilot: &Pilot) -> (usize, u64) {
        pilot.target.map_or((pilot.at, 0), |target| (target, self.costs.between[pilot.at][target]))
    }

    /// The motion to a place.
    fn go(&mut self, agent: usize, target: usize) -> Option<Command> {
        let position = self.world.body(AgentId::from_index(agent)).pose().position;
        let goal = self.places[target].cell;
        let graph = Graph::new(&self.map, &self.moves);
        let waypoints = if direct(&self.map, &position, goal, self.radius_m) {
            vec![self.moves.lattice().place(self.map.extent(), goal)]
        } else {
            let start = self.moves.lattice().cell_near(self.map.extent(), &position);
            let path = find(graph, start, Goal::Cell(goal));
            path.map_or_else(Vec::new, |path| straighten_from(&position, &path, &self.map, self.radius_m))
        };
        if waypoints.is_empty() {
            self.pilots[agent].target = None;
            return None;
        }
        Some(moving(waypoints))
    }

    /// What an agent does whose way another body blocks.
    fn yield_way(&mut self, agent: usize) -> Option<Command> {
        self.note_attempt(agent);
        let Some(target) = self.pilots[agent].target else { return Some(still()) };
        let other = self.nearest_other(agent);
        match self.pilots[agent].attempts % 3 {
            1 => {
                let (one, two) = (agent.min(other), agent.max(other));
                let (low, high) = self.pilots.split_at_mut(two);
                let (one, two) = (&mut low[one], &mut high[0]);
                std::mem::swap(&mut one.target, &mut two.target);
                std::mem::swap(&mut one.rest, &mut two.rest);
                std::mem::swap(&mut one.at, &mut two.at);
                for pilot in [one, two] {
                    (pilot.is_called, pilot.phase) = (true, Phase::Going);
                }
                // The count stays with the agent that is blocked.
                self.decide_called(agent)
            }
            2 => {
                self.pilots[agent].phase = Phase::Waiting(self.world.tick().after(WAIT_TICKS * (1 + agent as u64 % 4)));
                Some(still())
            }
            _ => self.go_round(agent, target),
        }
    }

    fn decide_called(&mut self, agent: usize) -> Option<Command> {
        self.pilots[agent].is_called = false;
        self.choose(agent);
        match self.pilots[agent].target {
            Some(target) => self.go(agent, target),
            None => Some(still()),
        }
    }

    fn nearest_other(&self, agent: usize) -> usize {
        let position = |agent: usize| self.world.body(AgentId::from_index(agent)).pose().position;
        let here = position(agent);
        let others = (0..self.pilots.len()).filter(|&other| other != agent);
        let apart = |&other: &usize| (position(other) - here).norm();
        others.min_by(|one, other| apart(one).total_cmp(&apart(other))).unwrap_or(agent)
    }

    /// A path from cell to cell that keeps away from all other bodies.
    fn go_round(&mut self, agent: usize, target: usize) -> Option<Command> {
        let extent = self.map.extent();
        let here = self.world.body(AgentId::from_index(agent)).pose().position;
        let others: Vec<Point3<f64>> = (0..self.pilots.len())
            .filter(|&other| other != agent)
            .map(|other| self.world.body(AgentId::from_index(other)).pose().position)
            .collect();
        let room_m = 2.0 * self.radius_m + ROOM_M;
        let lattice = self.moves.lattice();
        let is_open = |cell: Cell| others.iter().all(|other| (lattice.place(extent, cell) - other).norm() > room_m);
        let graph = Graph::new(&self.map, &self.moves);
        let goal = Goal::Cell(self.places[target].cell);
        let mut search = Search::new(graph, lattice.cell_near(extent, &here), goal).within(&is_open);
        let points: Option<Vec<_>> = search.run().map(|path| {
            path.cells
                .iter()
                .take(DETOUR_CELLS)
                .map(|&cell| lattice.place(extent, cell))
                .filter(|point| *point != here)
                .collect()
        });
        match points.filter(|points| !points.is_empty()) {
            Some(points) => Some(moving(points)),
            None => {
                self.pilots[agent].phase = Phase::Waiting(self.world.tick().after(WAIT_TICKS));
                Some(still())
            }
        }
    }
}

/// The body ends its task; its LiDAR continues as it was.
fn still() -> Command {
    Command::new(Motion::Stop, WakeCondition::NEXT_TICK)
}

fn moving(waypoints: Vec<Point3<f64>>) -> Command {
    Command { motion: Motion::Path(waypoints), ..still() }
}

/// Times between places, ms: those of a leg along the shortest path.
fn costs(graph: Graph<'_>, places: &[Cell], body: &BodyModel) -> Vec<Vec<u64>> {
    let edge_m = graph.map().extent().cell_m() / agent_node::path::EDGE_COST as f64;
    let mut between = vec![vec![UNREACHABLE_MS; places.len()]; places.len()];
    for (one, &cell) in places.iter().enumerate() {
        between[one][one] = 0;
        let lengths = nearest_distances(graph, cell, places, NEAREST);
        for (other, length) in lengths.into_iter().enumerate().filter(|(other, _)| *other != one) {
            if let Some(length) = length {
                let time_ms = (bodies::leg_s(body, length as f64 * edge_m, TURN_RAD) * 1e3) as u64;
                between[one][other] = between[one][other].min(time_ms);
                between[other][one] = between[one][other];
            }
        }
    }
    // Floyd and Warshall: places farther away are reached by way of others.
    for via in 0..places.len() {
        let row = between[via].clone();
        for from in &mut between {
            let to_via = from[via];
            for (time, onwards) in from.iter_mut().zip(&row) {
                *time = (*time).min(to_via + onwards);
            }
        }
    }
    between
}
