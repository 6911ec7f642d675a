//! Dual-Stage Viewpoint Planner (DSVP) in three dimensions, for teams.
//!
//! Source: Zhu et al., IROS 2021 (see `dsvp/tree.rs`), and its multi-agent use in the papers on
//! MAES3D. In the *exploration* stage the agent grows a tree of viewpoints within its horizon and
//! follows the branch with the highest gain; if no viewpoint has a gain, the *relocation* stage
//! takes it to the nearest reachable frontier of its map.
//!
//! Beyond the papers: viewpoint gains are computed by ray casting; the relocation path is the
//! shortest one on the abstract graph of all known free space ([`agent::abstract_graph`]), which
//! replaces the global RRG; a goal is dropped as soon as its unexplored cells have been seen by any
//! agent; an agent that knows no frontier pursues the agent it has been out of contact with for
//! longest, to deliver its map, and explores again when map updates bring frontiers. Agents report
//! to each other who knows none, and rest when all have none (see `dsvp/pursuit.rs`).
//!
//! A confined body cannot be in most frontiers, and some it cannot come near: once no
//! other stage has a goal, it goes where it sees what is behind those (`viewpoints`).
//!
//! **Frontiers of other agents.** Frontiers are a function of the map: merging another agent's map
//! brings its frontiers, except those that the own map already resolves. So exchanging maps
//! exchanges frontiers.
//!
//! Invariants: it moves only through cells known to be free; it never waits indefinitely while it
//! knows a reachable frontier or the last position of another agent.

pub(crate) mod avoidance;
mod baselines;
mod coordination;
mod division;
mod driving;
mod dtw;
mod expectation;
mod exploration;
pub(super) mod gain;
mod goal;
pub(crate) mod obstacles;
mod params;
mod pursuit;
mod relocation;
mod scanning;
mod tasks;
mod team;
#[cfg(test)]
mod tests;
mod tree;
mod variants;

use std::cmp::Ordering;
use std::collections::BTreeSet;

use msgs::ids::Tick;
use nalgebra::Vector3;
use protocol::event_mask::EventMask;
use rand::RngExt;
use rand::seq::{IndexedRandom, SliceRandom};
use rand_chacha::ChaCha8Rng;
use voxels::{BodyLattice, Cell};

use super::blockage::{Blockages, Bypass};
use super::viewpoints::{NOTHING_TO_SEE, Viewpoints};
use super::{Controller, Ctx, Setup};
use agent::abstract_graph::{AbstractGraph, ShortestPaths};
use agent::command::{Command, Motion, ScanRequest, Stage, WakeCondition};
use agent::exploration_map::{CellState, ExplorationMap};
use agent::observation::Observation;
use agent::path::Neighbours;
use avoidance::{Waypoints, hold, motion_to, path_length_m};
pub use baselines::{c2_explorer, hungarian, racer, rendezvous};
use coordination::Coordination;
use driving::Driving;
use gain::{GainEstimator, Likelihood};
use goal::Goal;
use obstacles::Obstacles;
pub use params::Params;

use pursuit::Pursuit;
use scanning::Scanning;
use tree::Tree;
pub use variants::{alone, with_auction, with_team};

/// Longest wait after a collision with another agent, ticks: about the time in which the other one
/// moves away.
const BACKOFF_TICKS_MAX: u64 = 100;

/// Ticks after which an agent without a goal plans again, even if the map has not changed.
const IDLE_TICKS: u64 = 250;

/// Ticks that an agent at rest waits for a scan if the one it requested for the next tick does not
/// come.
const SCAN_TIMEOUT_TICKS: u64 = 50;

/// Goals to try when other agents block the paths to some.
const ATTEMPTS: usize = 3;

/// Greatest length of an evasive path, cells.
const EVASION_CELLS_MAX: f64 = 15.0;

/// Greatest length of an evasive path before a body that is not in contact and stays where it is,
/// cells.
const SHORT_EVASION_CELLS_MAX: f64 = 5.0;

/// The planner of one agent, with its way to coordinate.
#[derive(Debug)]
struct Dsvp<C> {
    params: Params,
    coordination: C,
    rng: ChaCha8Rng,
    graph: AbstractGraph,
    paths: ShortestPaths,
    gain_estimator: GainEstimator,
    pursuit: Pursuit,
    /// The last local tree.
    tree: Option<Tree>,
    /// Direction of the last branch from its root to its end; unit vector.
    direction: Option<Vector3<f64>>,
    goal: Option<Goal>,
    /// The trajectory to it that is under way, if it is not on waypoints at which the body stops.
    driving: Option<Driving>,
    /// Number of known cells at the last plan.
    known_cells: usize,
    /// Whether the present goal was taken although another agent outbids it, for lack of a better
    /// one.
    is_contested: bool,
    scanning: Scanning,
    /// Until when it waits at rest because another agent blocked its path.
    waits_until: Option<Tick>,
    /// The agents that blocked its paths.
    blockages: Blockages,
    /// Whether it rests because another agent stays in its way.
    is_resting: bool,
    /// Since when it has been at rest, waiting for a scan from here.
    at_rest_since: Option<Tick>,
    /// Frontiers that stayed frontiers when observed from the nearest viewpoint.
    abandoned: BTreeSet<Cell>,
    /// Viewpoints from which a scan did not reveal the cells they were chosen for.
    unproductive: BTreeSet<Cell>,
    /// Of a confined body, once it has needed them.
    viewpoints: Option<Viewpoints>,
}

impl<C: Coordination> Dsvp<C> {
    /// The planner before its first observation.
    fn new(params: Params, coordination: C, setup: Setup<'_>) -> Self {
        let Setup { agent, run_info, rng } = setup;
        let extent = run_info.extent;
        let Params { gain_range_m, gain_rays, gain_depth, wall_adjacency_factor, .. } = params;
        let range_m = gain_range_m.min(run_info.lidar_range_m).min(100.0 * extent.cell_m());
        let range_cells = range_m / extent.cell_m();
        let radius_m = run_info.bodies.of(agent).radius_m;
        Self {
            params,
            coordination,
            rng,
            graph: AbstractGraph::new(extent, radius_m),
            paths: ShortestPaths::default(),
            gain_estimator: GainEstimator::new(
                gain_rays,
                range_cells,
                gain_depth,
                Likelihood::new(wall_adjacency_factor),
            )
            .from(BodyLattice::of(radius_m, extent.cell_m())),
            pursuit: Pursuit::new(agent, run_info.agents),
            tree: None,
            direction: None,
            goal: None,
            driving: None,
            known_cells: 0,
            is_contested: false,
            scanning: Scanning::default(),
            waits_until: None,
            blockages: Blockages::default(),
            is_resting: false,
            at_rest_since: None,
            abandoned: BTreeSet::new(),
            unproductive: BTreeSet::new(),
            viewpoints: None,
        }
    }

    /// Takes what an observation says about the other agents: claims, last known positions.
    fn receive(&mut self, observation: &Observation, ctx: &Ctx<'_>) {
        let run_info = ctx.run_info();
        self.coordination.receive(observation, run_info.agents);
        self.pursuit.receive(observation, run_info.extent);
    }

    /// Brings the abstract graph up to date with the map. Most decisions do not need it: it does
    /// not depend on how often it was updated.
    fn update_graph(&mut self, ctx: &Ctx<'_>) {
        self.graph.update(ctx.graph(Neighbours::TwentySix));
    }

    /// Whether the present goal is still worth pursuing.
    fn is_goal_valid(&mut self, observation: &Observation, ctx: &Ctx<'_>) -> bool {
        if !self.is_contested && self.coordination.is_outbid(observation.tick) {
            return false;
        }
        match self.goal {
            Some(Goal::Viewpoint { cell, gain }) => {
                let left = self.gain_estimator.gain(ctx.map(), cell);
                left >= self.params.gain_min && f64::from(left) >= self.params.gain_left * f64::from(gain)
            }
            Some(Goal::Frontier { frontier, .. }) => ctx.map().is_frontier(frontier),
            Some(Goal::Sight { target, .. }) => ctx.map().state(target) == CellState::Unexplored,
            Some(Goal::Pursuit { agent, .. }) => {
                self.pursuit.is_sought(agent, &observation.contacts) && !self.has_map_changed(ctx.map())
            }
            Some(Goal::Wandering { .. }) => !self.pursuit.have_all_finished() && !self.has_map_changed(ctx.map()),
            Some(Goal::Evasion { .. } | Goal::Meeting { .. }) => true,
            None => false,
        }
    }

    /// Whether the map has changed since the last plan, so that new frontiers are possible.
    fn has_map_changed(&self, map: &ExplorationMap) -> bool {
        map.free() + map.wall() != self.known_cells
    }

    /// Chooses the next goal; called at rest after a scan, or when the present goal has become
    /// invalid.
    fn plan(&mut self, observation: &Observation, ctx: &mut Ctx<'_>) -> Command {
        self.update_graph(ctx);
        let obstacles = Obstacles::of(observation, ctx);
        let plan = match C::first_stage(self, observation, ctx, &obstacles) {
            // With a band of elevations a frontier itself is no viewpoint of what is above it.
            Plan::Nothing if ctx.run_info().field_of_view.is_some() => {
                match self.look_from_afar(observation, ctx, &obstacles) {
                    Plan::Nothing => self.pursue(observation, ctx, &obstacles),
                    plan => plan,
                }
            }
            Plan::Nothing => match self.relocate(observation, ctx, &obstacles) {
                Plan::Nothing => match self.look_from_afar(observation, ctx, &obstacles) {
                    Plan::Nothing => self.pursue(observation, ctx, &obstacles),
                    plan => plan,
                },
                plan => plan,
            },
            plan => plan,
        };
        self.at_rest_since = None;
        self.known_cells = ctx.map().free() + ctx.map().wall();
        match plan {
            Plan::Go(goal, motion) => self.go(goal, motion, observation, ctx, &obstacles),
            Plan::Blocked => self.resolve_blockage(observation, ctx, &obstacles),
            Plan::Pending => {
                self.goal = None;
                Command::new(hold(observation), WakeCondition::NEXT_TICK)
                    .with_stage(Stage::Waiting)
                    .with_info("looks for a viewpoint")
            }
            Plan::Wait { until, info } => {
                self.goal = None;
                let wake = WakeCondition::at(until).or(WakeCondition::on(EventMask::CONTACTS | EventMask::MESSAGE));
                let command = Command::new(hold(observation), wake).with_stage(Stage::Waiting).with_info(info);
                self.coordination.with_messages(command, observation)
            }
            Plan::Nothing => {
                self.goal = None;
                let wake = WakeCondition::at(observation.tick.after(IDLE_TICKS));
                let has_finished = self.pursuit.have_all_finished();
                let info = match (has_finished, ctx.needs_viewpoints() && ctx.map().frontier_count() > 0) {
                    (_, true) => NOTHING_TO_SEE,
                    (true, false) => "nothing left to do",
                    (false, false) => "waiting for news",
                };
                Command::new(hold(observation), wake.or(WakeCondition::on(EventMask::CONTACTS | EventMask::MESSAGE)))
                    .with_stage(Stage::Waiting)
                    .with_info(info)
            }
        }
    }

    fn go(
        &mut self,
        goal: Goal,
        motion: Motion,
        observation: &Observation,
        ctx: &Ctx<'_>,
        obstacles: &Obstacles,
    ) -> Command {
        self.goal = Some(goal);
        match goal {
            Goal::Viewpoint { cell, .. } | Goal::Frontier { cell, .. } | Goal::Sight { cell, .. } => {
                self.pursuit.report(false, observation.tick);
                self.coordination.claim(cell, path_length_m(&ctx.position(), &motion), observation.tick);
            }
            _ => self.coordination.withdraw(),
        }
        self.is_contested = self.coordination.is_outbid(observation.tick);
        let before = self.driving.take();
        if let (Waypoints::Passed, Motion::Path(waypoints)) = (self.params.waypoints, &motion) {
            self.driving = Driving::along(waypoints, before.as_ref(), observation, ctx, obstacles);
        }
        let motion = self.driving.as_ref().map_or(motion, |driving| driving.motion(observation.tick));
        let command = Command::new(motion, self.wake(observation.tick)).with_stage(goal.stage()).with_info(goal.info());
        self.coordination.with_messages(command, observation)
    }

    /// The wake-up condition while under way. What an agent sees on the way matters only if it
    /// explores, and whom it meets if it has news.
    fn wake(&self, now: Tick) -> WakeCondition {
        let events = match self.goal {
            Some(Goal::Pursuit { .. } | Goal::Wandering { .. } | Goal::Meeting { .. }) => {
                EventMask::CONTACTS | EventMask::MESSAGE
            }
            _ => EventMask::NEW_CELL,
        };
        let under_way = WakeCondition::TASK_DONE.or(WakeCondition::on(events)).or(self.coordination.wake());
        self.driving.as_ref().map_or(under_way, |driving| under_way.or(driving.wake(now)))
    }

    /// Other agents block all paths: waits or evades at random, so that no two agents wait for each
    /// other for ever; goes where they leave a way, or rests, if one of them has not moved for
    /// long.
    fn resolve_blockage(&mut self, observation: &Observation, ctx: &mut Ctx<'_>, obstacles: &Obstacles) -> Command {
        let mut blockages = std::mem::take(&mut self.blockages);
        let standing = blockages.note_between_rests(observation, ctx, |obstacles| self.detour(ctx, obstacles));
        self.blockages = blockages;
        match standing {
            Some(Bypass::Detour((goal, motion))) => return self.go(goal, motion, observation, ctx, obstacles),
            Some(Bypass::Rest(command)) => {
                self.goal = None;
                self.driving = None;
                self.is_resting = true;
                return command;
            }
            None => {}
        }
        if self.rng.random_bool(0.5)
            && let Some((goal, motion)) = self.evade(ctx, obstacles)
        {
            return self.go(goal, motion, observation, ctx, obstacles);
        }
        self.goal = None;
        let until = observation.tick.after(self.rng.random_range(1..=BACKOFF_TICKS_MAX));
        self.waits_until = Some(until);
        Command::new(hold(observation), WakeCondition::at(until)).with_stage(Stage::Waiting).with_info("gives way")
    }

    /// To a random region nearby. A body that was stopped between places may be too near to others
    /// for any path that begins at the place of its cell: it goes to that of a cell beside it.
    fn evade(&mut self, ctx: &mut Ctx<'_>, obstacles: &Obstacles) -> Option<(Goal, Motion)> {
        let Self { graph, paths, blockages, .. } = self;
        let here = ctx.cell();
        paths.begin(graph, here);
        let mut reached = Vec::new();
        let cells_max = if blockages.is_by_unknown() { SHORT_EVASION_CELLS_MAX } else { EVASION_CELLS_MAX };
        while let Some((_, region, length)) = paths.next(graph)
            && length <= cells_max
        {
            reached.push(region.centre);
        }
        reached.retain(|&cell| cell != here && !obstacles.occupy(cell));
        reached.shuffle(&mut self.rng);
        let far = reached.into_iter().take(ATTEMPTS).find_map(|cell| {
            let motion = motion_to(ctx, graph, paths, cell, obstacles, self.params.waypoints)?;
            Some((cell, motion))
        });
        let (cell, motion) = far.or_else(|| {
            if ctx.position() == ctx.place(here) {
                return None;
            }
            let is_clear =
                |cell: &Cell| !obstacles.block(&ctx.position(), &ctx.place(*cell)) && !obstacles.occupy(*cell);
            let beside: Vec<Cell> = ctx.clear_neighbours().into_iter().filter(is_clear).collect();
            let &cell = beside.choose(&mut self.rng)?;
            Some((cell, Motion::Path(vec![ctx.place(cell)])))
        })?;
        Some((Goal::Evasion { cell }, motion))
    }
}

/// The result of a stage.
#[derive(Debug, Clone, PartialEq)]
enum Plan {
    /// A goal and the motion to it.
    Go(Goal, Motion),
    /// There are goals, but other agents block the paths to them.
    Blocked,
    /// The search for a goal continues in the next tick.
    Pending,
    /// A rest until then at the latest, or until a contact changes or a message arrives; why, for
    /// people.
    Wait { until: Tick, info: &'static str },
    /// No goal.
    Nothing,
}

impl<C: Coordination> Controller for Dsvp<C> {
    fn is_blocked(&self) -> bool {
        self.is_resting || self.waits_until.is_some()
    }

    fn decide(&mut self, observation: &Observation, ctx: &mut Ctx<'_>) -> Command {
        self.receive(observation, ctx);
        self.gain_estimator.limit_to(ctx.run_info().field_of_view.as_ref());
        let command = self.choose(observation, ctx);
        let command = self.scanning.with_request(command, self.params.scan_range, observation, ctx);
        let has_met = observation.events.intersects(EventMask::CONTACTS);
        self.pursuit.with_reports(command, &observation.contacts, has_met)
    }
}

impl<C: Coordination> Dsvp<C> {
    /// The reply, without scans that are left out and without reports.
    fn choose(&mut self, observation: &Observation, ctx: &mut Ctx<'_>) -> Command {
        let now = observation.tick;
        if observation.events.intersects(EventMask::REVISED) {
            // The way to the goal may be closed, and what could not be reached or seen open.
            (self.goal, self.viewpoints, self.waits_until) = (None, None, None);
            self.abandoned.clear();
            self.unproductive.clear();
        }
        if self.is_resting
            && let Some(command) = self.blockages.still_waits(observation, ctx)
        {
            return command;
        }
        if observation.is_active {
            if !self.is_goal_valid(observation, ctx) {
                return self.plan(observation, ctx);
            }
            let motion = self.driving.as_ref().map_or(Motion::Keep, |driving| driving.motion(now));
            if motion == Motion::Stop {
                self.driving = None;
                return Command::new(motion, WakeCondition::NEXT_TICK);
            }
            let keep = Command::new(motion, self.wake(now));
            let has_met = observation.events.intersects(EventMask::CONTACTS);
            return if has_met { self.coordination.with_messages(keep, observation) } else { keep };
        }
        self.driving = None;
        if let Some(until) = self.waits_until
            && now < until
        {
            return Command::keep(WakeCondition::at(until));
        }
        let has_rested = std::mem::take(&mut self.is_resting);
        let has_waited = self.waits_until.take().is_some() || has_rested;
        if !has_waited && observation.collision.is_some_and(|collision| collision.with_agent) {
            self.update_graph(ctx);
            let obstacles = Obstacles::of(observation, ctx);
            return self.resolve_blockage(observation, ctx, &obstacles);
        }
        let since = *self.at_rest_since.get_or_insert(now);
        let is_seen = observation.scan_tick.is_some_and(|scan| scan >= since);
        if !is_seen && now < since.after(SCAN_TIMEOUT_TICKS) {
            let lidar =
                if now == since { ScanRequest::Every(ctx.run_info().lidar_period_ticks) } else { ScanRequest::Keep };
            return Command { lidar, ..Command::keep(WakeCondition::NEXT_TICK) };
        }
        self.plan(observation, ctx)
    }
}

/// Whether the agent is at the viewpoint that was its goal, and the scan from there did not reveal
/// the cells that it was chosen for.
fn has_gain_left(
    goal: Option<Goal>,
    here: Cell,
    map: &ExplorationMap,
    gain_estimator: &mut GainEstimator,
    gain_min: u32,
) -> bool {
    matches!(goal, Some(Goal::Viewpoint { cell, .. }) if cell == here) && gain_estimator.gain(map, here) >= gain_min
}

fn by_distance(here: Cell, a: &Cell, b: &Cell) -> Ordering {
    here.distance(*a).total_cmp(&here.distance(*b)).then(a.cmp(b))
}
