//! The dual-stage viewpoint planner as coded in MAES3D, slips included, for comparison with its
//! results.
//!
//! **Exploration.** While frontiers in view are not covered, a random tree grows from the last
//! destination, and the agent goes to the node with the highest gain. **Relocation.** Otherwise it
//! goes to a frontier of its list; once the list is empty it never moves again.
//!
//! Reproduced although hardly intended (docs/reference-differences.md names the main ones):
//! - the direction of exploration, by which the attracting frontiers are chosen, is always y;
//! - frontiers that are not chosen are appended to the list at each stage, even if they are on it;
//! - of a sample only the cell at the end is checked, which must be free and not covered; cells
//!   between are not checked;
//! - the gain of a node considers five of its six neighbours: the one towards +y is left out;
//! - the end of a branch counts twice in its gain, and depth begins at -1;
//! - relocation takes the last frontier of the list, not the nearest; it discards frontiers as long
//!   as they can be reached straight;
//! - after the first relocation every stage begins with a copy of the global tree, re-rooted at the
//!   node nearest to the last destination; nodes outside the horizon are pruned while iterating
//!   over the list of nodes, which skips some;
//! - the last destination becomes the root even if it was not reached;
//! - an agent that is done stays done, whatever it receives;
//! - the end of a task is noticed a tick late, as in [`super::rbw_maes3d`];
//! - before a vertical or empty leg it turns to heading 0 (`maes3d_legs`).
//!
//! The reference draws from the one random stream of its engine; this controller draws from its
//! own. The reference throws if a stage finds no destination, which ends the tick for the whole
//! team; here the agent tries again. It makes way for agents that it runs into again and again, and
//! rests before one that does not move for long. Stages that lead nowhere follow each other less
//! and less often.
//!
//! The reference has no confined bodies. Nodes for such a body are cells in which it has
//! room, with the gain of the cells beside all that it touches there; it goes as near to a frontier
//! as it can, once, and without other frontiers on its list to where it sees something unexplored
//! (`viewpoints`).
//!
//! Lengths are in cells. Axes: x is the reference's x, y its z, z its y.

mod frontiers;
mod tree;

use std::collections::{BTreeMap, BTreeSet};
use std::task::Poll;

use msgs::ids::Tick;
use nalgebra::{Point3, Vector3};
use protocol::event_mask::EventMask;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use voxels::{Cell, FACES};

use super::blockage::{Blockages, Yield};
use super::maes3d_legs::Legs;
use super::viewpoints::{NOTHING_TO_SEE, Viewpoints};
use super::{Controller, Ctx, collision_recovery};
use agent::command::{Command, Motion, Stage, WakeCondition};
use agent::exploration_map::{CellState, ExplorationMap};
use agent::navigation::{NavigationStatus, SearchTime};
use agent::observation::{Cells, Observation};
use agent::path::{Graph, Neighbours};
use frontiers::{Frontiers, local_frontiers};
use tree::{Index, Tree};

/// The direction of exploration: the reference's (0, 0, 1).
const DIRECTION: Vector3<f64> = Vector3::new(0.0, 1.0, 0.0);

/// Number of frontiers in view that attract the tree.
const CHOSEN: usize = 5;

/// Samples per stage.
const SAMPLES: usize = 200;

/// Share of the samples near a chosen frontier.
const BIAS: f64 = 0.3;

/// Greatest distance of such samples from the centre of the frontier along each axis.
const JITTER: f64 = 1.0;

/// Half the side of the cube around the root that contains the other samples, and beyond which the
/// local tree is pruned.
const HORIZON: f64 = 15.0;

/// Greatest length of an edge.
const STEP: f64 = 1.0;

/// Gain of an unexplored neighbour.
const GAIN_UNEXPLORED: f64 = 10.0;

/// Gain of a wall as a neighbour.
const GAIN_WALL: f64 = -1.0;

/// The neighbour without a gain: the reference's +z.
const LEFT_OUT: Cell = Cell::new(0, 1, 0);

/// Ticks after which a confined body without a destination looks again: 5 s.
const IDLE_TICKS: u64 = 250;

/// After so many collisions with agents in one cell it makes way after each further one; a body
/// wider than a cell does after each.
const RUN_INTO_MAX: u32 = 8;

/// Stages in a row that lead nowhere, with the map within the horizon as it was, after which the
/// next one waits, each time twice as long, up to [`STALL_TICKS_MAX`]: 30 s. The trees grow with
/// every stage.
const STALLS_MIN: u32 = 50;
const STALL_TICKS_MAX: u64 = 1500;

/// The planner of one agent.
#[derive(Debug)]
pub struct DsvpMaes3d {
    rng: ChaCha8Rng,
    trees: Option<Trees>,
    frontiers: Frontiers,
    /// The cell of the body at the last call.
    cell: Option<Cell>,
    /// The tick in which the end of the present task is noticed.
    notices_at: Option<Tick>,
    /// Whether the last stage found no destination.
    is_trying_again: bool,
    is_done: bool,
    /// What is left of the path that is under way.
    legs: Legs,
    /// Stages in a row that have led nowhere, and the changes of the map up to the last one.
    stalls: (u32, usize),
    /// The agents that it has run into.
    blockages: Blockages,
    /// The cell in which it has run into an agent, and how often in a row.
    run_into: (Cell, u32),
    /// See [`Gains::of`].
    beside: Vec<Cell>,
    /// Of a confined body, once its list is empty.
    viewpoints: Option<Viewpoints>,
    /// The frontiers that a confined body has come as near to as it can.
    approached: BTreeSet<Cell>,
}

impl DsvpMaes3d {
    /// The controller has no settings.
    #[must_use]
    pub fn new(rng: ChaCha8Rng) -> Self {
        Self {
            rng,
            trees: None,
            frontiers: Frontiers::default(),
            cell: None,
            notices_at: None,
            is_trying_again: false,
            is_done: false,
            legs: Legs::default(),
            stalls: (0, 0),
            blockages: Blockages::default(),
            run_into: (Cell::default(), 0),
            beside: Vec::new(),
            viewpoints: None,
            approached: BTreeSet::new(),
        }
    }

    /// One stage: exploration if there are frontiers in view, else relocation.
    fn stage(&mut self, view: &Cells, ctx: &mut Ctx<'_>) -> Command {
        let here = in_cells(ctx.position(), ctx);
        let map = ctx.map();
        let trees = self.trees.get_or_insert_with(|| Trees::new(here));
        trees.begin_stage();
        let (chosen, others) = local_frontiers(view, map, here);
        if !self.is_trying_again {
            others.into_iter().for_each(|cell| self.frontiers.push(cell, map));
        }
        trees.grow(&mut self.rng, ctx.graph(Neighbours::Six), &chosen);
        if chosen.is_empty() {
            self.is_trying_again = false;
            return self.relocate(ctx);
        }
        let mut gains = Gains::of(ctx.graph(Neighbours::Six), &mut self.beside);
        let best = trees.local.best_branch(|at| gains.at(cell_of(at)));
        self.is_trying_again = best.is_none();
        let Some(node) = best else {
            if ctx.is_confined() {
                return self.looks_from_afar(ctx);
            }
            // A body at rest sees nothing new before the next scan.
            let period_ticks = u64::from(ctx.run_info().lidar_period_ticks.max(1));
            let at = if trees.may_grow(map) { Tick::ZERO } else { ctx.tick().after(period_ticks) };
            return Command::keep(WakeCondition { at, events: EventMask::MESSAGE })
                .with_stage(Stage::Exploring)
                .with_info("exploration: no destination");
        };
        let at = trees.local.at(node);
        let cell = cell_of(at);
        if ctx.is_confined() && gains.at(cell) <= 0.0 {
            return self.relocate(ctx);
        }
        trees.destination = Some((at, node));
        match ctx.go_to_cell_by(cell, Neighbours::Six, SearchTime::Instant) {
            NavigationStatus::Go(motion) => {
                let is_there = Legs::is_done(&ctx.place(cell), ctx);
                match is_there.then(|| self.wake_after_stall(ctx)).flatten() {
                    Some(wake) => Command::keep(wake).with_stage(Stage::Waiting).with_info("exploration: stays"),
                    None => self.goes(ctx, motion, Stage::Exploring, format!("exploration: to {}", text(cell))),
                }
            }
            NavigationStatus::NoPath | NavigationStatus::Searching(_) if ctx.is_confined() => self.looks_from_afar(ctx),
            NavigationStatus::NoPath | NavigationStatus::Searching(_) => {
                Command::keep(self.wake_after_stall(ctx).unwrap_or(WakeCondition::NEXT_TICK))
                    .with_stage(Stage::Exploring)
                    .with_info(format!("exploration: no way to {}", text(cell)))
            }
        }
    }

    /// When the next stage begins after one that leads nowhere, if not at once.
    fn wake_after_stall(&mut self, ctx: &Ctx<'_>) -> Option<WakeCondition> {
        let (stalls, read) = self.stalls;
        let by = Cell::new(HORIZON as i32, HORIZON as i32, HORIZON as i32);
        let (lowest, highest) = (ctx.cell() - by, ctx.cell() + by);
        let is_near = |(low, high): (Cell, Cell)| {
            let along = |low, high, lowest, highest| low <= highest && high >= lowest;
            along(low.x, high.x, lowest.x, highest.x)
                && along(low.y, high.y, lowest.y, highest.y)
                && along(low.z, high.z, lowest.z, highest.z)
        };
        let has_changed = ctx.map().boxes_changed_since(read).any(is_near);
        self.stalls = (if has_changed { 0 } else { stalls + 1 }, ctx.map().journal_len());
        let doublings = self.stalls.0.checked_sub(STALLS_MIN)?.min(STALL_TICKS_MAX.ilog2());
        let at = ctx.tick().after((1 << doublings).min(STALL_TICKS_MAX));
        Some(WakeCondition::at(at).or(WakeCondition::on(EventMask::MESSAGE)))
    }

    fn relocate(&mut self, ctx: &mut Ctx<'_>) -> Command {
        self.frontiers.clear_of_others(ctx.map());
        let mut command = Command::keep(NEVER);
        while let Some(cell) = self.frontiers.take_last() {
            if self.approached.contains(&cell) {
                continue;
            }
            if let Some(trees) = &mut self.trees {
                trees.relocate_to(centre(cell));
            }
            // A frontier that can be reached straight is discarded for the next one in the same
            // tick.
            let goes_on = ctx.is_clear_to(cell) && !self.frontiers.list.is_empty();
            if goes_on {
                continue;
            }
            let to = ctx.approach(cell);
            if ctx.is_confined() && to.is_some_and(|to| to == ctx.cell() && Legs::is_done(&ctx.place(to), ctx)) {
                self.approached.insert(cell);
                continue;
            }
            command = match to.map(|to| ctx.go_to_cell_by(to, Neighbours::Six, SearchTime::Instant)) {
                Some(NavigationStatus::Go(motion)) => {
                    self.goes(ctx, motion, Stage::Relocating, format!("relocation: to {}", text(cell)))
                }
                _ if ctx.is_confined() => {
                    self.frontiers.list_again();
                    return self.looks_from_afar(ctx);
                }
                Some(NavigationStatus::NoPath | NavigationStatus::Searching(_)) | None => {
                    Command::keep(WakeCondition::NEXT_TICK)
                        .with_stage(Stage::Relocating)
                        .with_info(format!("relocation: no way to {}", text(cell)))
                }
            };
            break;
        }
        self.frontiers.list_again();
        if self.frontiers.list.is_empty() {
            if ctx.is_confined() {
                return if command.motion == Motion::Keep { self.looks_from_afar(ctx) } else { command };
            }
            self.is_done = true;
            command.wake = self.wake_when_done();
            command.stage = command.stage.or(Some(Stage::Waiting));
            command.info.push_str(if command.info.is_empty() { "no frontiers left" } else { "; no frontiers left" });
        }
        command
    }

    /// A confined body without another destination goes where it sees something
    /// unexplored.
    fn looks_from_afar(&mut self, ctx: &mut Ctx<'_>) -> Command {
        let viewpoints = self.viewpoints.get_or_insert_with(|| Viewpoints::new(ctx.run_info(), ctx.body().radius_m));
        viewpoints.visit(ctx.map().extent(), ctx.cell());
        match viewpoints.next(ctx) {
            Poll::Ready(Some(viewpoint)) => {
                let cell = viewpoint.cell;
                match ctx.go_to_cell_by(cell, Neighbours::TwentySix, SearchTime::Instant) {
                    NavigationStatus::Go(motion) => {
                        if let Some(trees) = &mut self.trees {
                            trees.relocate_to(centre(cell));
                        }
                        self.goes(
                            ctx,
                            motion,
                            Stage::Relocating,
                            format!("relocation: to the viewpoint {}", text(cell)),
                        )
                    }
                    NavigationStatus::NoPath | NavigationStatus::Searching(_) => {
                        viewpoints.visit(ctx.map().extent(), cell);
                        Command::keep(WakeCondition::NEXT_TICK)
                    }
                }
            }
            Poll::Pending => Command::keep(WakeCondition::NEXT_TICK),
            Poll::Ready(None) => {
                let wake = WakeCondition::at(ctx.tick().after(IDLE_TICKS)).or(WakeCondition::on(EventMask::MESSAGE));
                Command::keep(wake).with_stage(Stage::Waiting).with_info(NOTHING_TO_SEE)
            }
        }
    }

    /// The wake-up condition of an agent that is done, and may be under way to its last
    /// destination.
    fn wake_when_done(&self) -> WakeCondition {
        if self.legs.is_any_left() { WakeCondition::TASK_DONE } else { NEVER }
    }

    fn goes(&mut self, ctx: &Ctx<'_>, motion: Motion, stage: Stage, info: String) -> Command {
        self.notices_at = None;
        Command::new(self.legs.begin(motion, ctx), UNDER_WAY).with_stage(stage).with_info(info)
    }
}

/// Under way the list of frontiers is updated in each new cell.
const UNDER_WAY: WakeCondition = WakeCondition {
    at: Tick(u64::MAX),
    events: EventMask::TASK_DONE.union(EventMask::COLLISION).union(EventMask::NEW_CELL),
};

const NEVER: WakeCondition = WakeCondition { at: Tick(u64::MAX), events: EventMask::empty() };

impl Controller for DsvpMaes3d {
    fn is_blocked(&self) -> bool {
        self.blockages.is_waiting()
    }

    fn decide(&mut self, observation: &Observation, ctx: &mut Ctx<'_>) -> Command {
        if observation.collision.is_some() {
            self.legs.end();
        }
        let next_leg = if observation.is_active { None } else { self.legs.next(ctx) };
        if self.is_done {
            return Command::new(next_leg.unwrap_or_default(), self.wake_when_done());
        }
        let mut acts_at = observation.tick;
        if !observation.is_active && next_leg.is_none() && observation.collision.is_none() {
            acts_at = *self.notices_at.get_or_insert(observation.tick.after(1));
        }
        let Some(view) = &observation.view else {
            return Command::new(next_leg.unwrap_or_default(), WakeCondition::NEXT_TICK).with_view_request();
        };
        if self.cell.replace(ctx.cell()) != Some(ctx.cell()) {
            self.frontiers.push_new(view, ctx.map());
        }
        let has_run_into_agent = observation.events.intersects(EventMask::COLLISION)
            && observation.collision.is_some_and(|collision| collision.with_agent);
        if has_run_into_agent {
            let times = if self.run_into.0 == ctx.cell() { self.run_into.1 + 1 } else { 1 };
            self.run_into = (ctx.cell(), times);
        }
        let evades = has_run_into_agent && (ctx.is_confined() || self.run_into.1 > RUN_INTO_MAX);
        let rest = self.blockages.still_waits(observation, ctx);
        let standing =
            if has_run_into_agent { self.blockages.note_between_steps(observation, ctx, |_| None) } else { None };
        let command = if let Some(command) = rest {
            command
        } else if let Some(Yield::Rest(command)) = standing {
            self.legs.end();
            command
        } else if evades {
            collision_recovery::step_aside(&mut self.rng, ctx)
        } else if let Some(motion) = next_leg {
            Command::new(motion, UNDER_WAY)
        } else if observation.is_active {
            Command::keep(UNDER_WAY)
        } else if observation.tick < acts_at {
            Command::keep(WakeCondition::at(acts_at))
        } else {
            self.stage(view, ctx)
        };
        command.with_view_request()
    }
}

/// The local and the global tree.
#[derive(Debug, Clone)]
struct Trees {
    local: Tree,
    local_index: Index,
    global: Tree,
    global_index: Index,
    /// The last destination, and its node of the local tree if it has never relocated.
    destination: Option<(Point3<f64>, u32)>,
    has_relocated: bool,
}

impl Trees {
    fn new(here: Point3<f64>) -> Self {
        let tree = Tree::new(here);
        let index = Index::of(&tree);
        Self {
            local: tree.clone(),
            local_index: index.clone(),
            global: tree,
            global_index: index,
            destination: None,
            has_relocated: false,
        }
    }

    /// Re-roots the local tree at the last destination and prunes it.
    fn begin_stage(&mut self) {
        let Some((at, mut node)) = self.destination else {
            return;
        };
        if self.has_relocated {
            self.local = self.global.clone();
            node = self.nearest_of_all(at);
        }
        self.local.reroot(node);
        self.local.prune(HORIZON);
        // The number of the root has changed; a retried stage begins with it.
        self.destination = Some((at, self.local.root()));
        self.local_index = Index::of(&self.local);
    }

    fn nearest_of_all(&self, at: Point3<f64>) -> u32 {
        self.global_index.nearest(at).unwrap_or_else(|| self.global.root())
    }

    fn relocate_to(&mut self, goal: Point3<f64>) {
        self.has_relocated = true;
        let node = self.nearest_of_all(goal);
        self.destination = Some((self.global.at(node), node));
    }

    /// Grows both trees towards random samples.
    fn grow(&mut self, rng: &mut ChaCha8Rng, graph: Graph<'_>, chosen: &[Cell]) {
        let root = self.local.at(self.local.root());
        for _ in 0..SAMPLES {
            let target = sample(rng, root, chosen);
            let near = self.local_index.nearest(target).unwrap_or_else(|| self.local.root());
            let near_at = self.local.at(near);
            let near_global = self.nearest_of_all(near_at);
            let new = step(near_at, target);
            if is_open(graph, new) {
                let node = self.local.add(new, near);
                self.local_index.insert(new, node);
            }
            let new = step(self.global.at(near_global), target);
            if is_open(graph, new) {
                let node = self.global.add(new, near_global);
                self.global_index.insert(new, node);
            }
        }
    }

    /// Whether any sample can extend a local tree that is only a root.
    fn may_grow(&self, map: &ExplorationMap) -> bool {
        let root = cell_of(self.local.at(self.local.root()));
        root.neighbours26().into_iter().chain([root]).any(|cell| map.state(cell) == CellState::Free)
    }
}

/// A random sample, in this order of draws: whether it is near a chosen frontier (drawn even if
/// there are none), which frontier, and its coordinates x, y, z.
fn sample(rng: &mut ChaCha8Rng, root: Point3<f64>, chosen: &[Cell]) -> Point3<f64> {
    let is_biased = rng.random::<f64>() < BIAS;
    let (middle, half_side) = if is_biased && !chosen.is_empty() {
        (centre(chosen[rng.random_range(0..chosen.len())]), JITTER)
    } else {
        (root, HORIZON)
    };
    middle.map(|along| along + rng.random_range(-half_side..half_side))
}

/// The point at most one edge length from a node towards a sample.
fn step(from: Point3<f64>, to: Point3<f64>) -> Point3<f64> {
    let distance = (to - from).norm();
    if distance <= STEP { to } else { from + (to - from) * (STEP / distance) }
}

fn is_open(graph: Graph<'_>, at: Point3<f64>) -> bool {
    let cell = cell_of(at);
    graph.map().state(cell) == CellState::Free && (!graph.is_body_confined() || graph.is_usable(cell))
}

/// The gains of viewpoints at one time.
struct Gains<'a> {
    map: &'a ExplorationMap,
    /// The cells that count, relative to the viewpoint.
    beside: &'a [Cell],
    /// Those of a confined body, which has many nodes in the same cells.
    known: Option<BTreeMap<Cell, f64>>,
}

impl<'a> Gains<'a> {
    /// `beside` is empty before the first call, and the same body has it for the next ones.
    fn of(graph: Graph<'a>, beside: &'a mut Vec<Cell>) -> Self {
        if beside.is_empty() {
            beside.extend(graph.cells_beside_body(FACES.into_iter().filter(|&offset| offset != LEFT_OUT)));
        }
        Self { map: graph.map(), beside, known: graph.is_body_confined().then(BTreeMap::new) }
    }

    fn at(&mut self, cell: Cell) -> f64 {
        let (map, beside) = (self.map, self.beside);
        let gain = |by: &Cell| match map.state(cell + *by) {
            CellState::Unexplored => GAIN_UNEXPLORED,
            CellState::Wall => GAIN_WALL,
            CellState::Free | CellState::Covered => 0.0,
        };
        let gain = || beside.iter().map(gain).sum();
        match &mut self.known {
            Some(known) => *known.entry(cell).or_insert_with(gain),
            None => gain(),
        }
    }
}

fn cells<'a>(indices: &'a [u32], map: &'a ExplorationMap) -> impl Iterator<Item = Cell> + 'a {
    indices.iter().map(|&index| map.extent().cell_at(index as usize))
}

fn centre(cell: Cell) -> Point3<f64> {
    Point3::new(f64::from(cell.x), f64::from(cell.y), f64::from(cell.z)).map(|along| along + 0.5)
}

fn cell_of(at: Point3<f64>) -> Cell {
    let [x, y, z] = [at.x, at.y, at.z].map(|along| along.floor() as i32);
    Cell::new(x, y, z)
}

fn in_cells(point: Point3<f64>, ctx: &Ctx<'_>) -> Point3<f64> {
    point / ctx.map().extent().cell_m()
}

fn text(cell: Cell) -> String {
    format!("{} {} {}", cell.x, cell.y, cell.z)
}

#[cfg(test)]
mod tests;
