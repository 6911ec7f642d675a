//! Local Voronoi Decomposition (LVD): each agent explores what is nearer to it than to the agents
//! in contact.
//!
//! After the papers on MAES3D (and Fu, Bandyopadhyay and Ang 2009, whom they follow), with the
//! rules that their code leaves out. At each decision:
//! 1. **Region.** A cell is the agent's own if no agent in contact is nearer to it (`region`).
//! 2. **Exploration mode.** A cell is *unvisited* if it is free and not covered; the agent covers
//!    the free cells that it sees within a small radius, and shares the marks with its map. It goes
//!    to the nearest unvisited cell of its own region in the last scan (`exploring`).
//! 3. **Search mode**, if there is none: it goes to an occlusion point, preferably one never
//!    visited, else the one visited longest ago; else to the nearest boundary of its region; else
//!    to the nearest unvisited cell with a known path; else it waits for map updates (`searching`).
//!    It leaves search mode as soon as it sees an unvisited cell in its own region.
//!
//! A confined body, which many unvisited cells are out of reach of, goes to a viewpoint
//! (`viewpoints.rs`) once it has seen nothing new for long, and if nothing else is left.
//!
//! Invariants: all its commands are legal, whatever it observes; on maps of any size, a decision
//! examines at most 200 000 cells beside those in view, and longer searches continue in the next
//! tick. Differences from the reference as coded: docs/reference-differences.md, and
//! [`super::lvd_maes3d`].

pub(crate) mod exploring;
pub(crate) mod flood;
pub(crate) mod last_scan;
pub(crate) mod occlusion;
pub(crate) mod places;
pub(crate) mod region;
pub(crate) mod searching;
pub(crate) mod sights;

use std::collections::BTreeMap;
use std::task::Poll;

use msgs::ids::Tick;
use protocol::event_mask::EventMask;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use voxels::Cell;

use super::blockage::{Blockages, Yield};
use super::dsvp::avoidance::{Waypoints, way_round};
use super::failed_goals::FailedGoals;
use super::settings::{SettingError, Settings};
use super::viewpoints::{Growth, NOTHING_TO_SEE, Viewpoint, Viewpoints};
use super::{Controller, Ctx};
use agent::command::{Command, Motion, Stage, WakeCondition};
use agent::exploration_map::CellState;
use agent::navigation::{NavigationStatus, SearchTime};
use agent::observation::Observation;
use flood::Flood;
use last_scan::LastScan;
use places::Places;
use region::Region;

/// The events that end a leg or can change the destination of an agent under way.
const UNDER_WAY: EventMask = EventMask::TASK_DONE.union(EventMask::COLLISION).union(EventMask::NEW_CELL);

/// How long an agent without a destination waits for map updates at a time: 5 s, as the reference's
/// map sharing.
const WAIT_TICKS: u64 = 250;

/// How long a destination is avoided after a failed search or a collision on the path to it: 30 s.
const REFUSAL_TICKS: u64 = 1500;

/// A destination in a pocket of fewer cells is recognised as cut off without a path search.
const POCKET_CELLS_MAX: usize = 4096;

/// Most cells that a path search expands: about a millisecond.
const SEARCH_CELLS_MAX: u64 = 1 << 12;

/// The same for confined bodies, whose cells are short.
const WIDE_SEARCH_CELLS_MAX: u64 = 1 << 14;

/// Destinations farther away than this many steps are approached in stages, each of which a search
/// is sure to find.
const STAGE_STEPS: usize = 48;

/// Waits after a collision, ticks: half a second to two and a half.
const EVASION_TICKS: std::ops::Range<u64> = 25..125;

/// The purpose of a destination.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Purpose {
    /// An unvisited cell in sight.
    Explore,
    /// An occlusion point, to look behind a corner.
    OcclusionPoint,
    /// The boundary of the region.
    Boundary,
    /// A known unvisited cell out of sight.
    Remembered,
    /// A stage on the path to the given destination.
    Towards(Cell),
    /// A place from which a confined body sees something unexplored.
    Viewpoint,
    /// A clear neighbour, to let another agent pass.
    Evade,
}

impl Purpose {
    fn is_search(self) -> bool {
        matches!(self, Self::OcclusionPoint | Self::Boundary | Self::Remembered | Self::Towards(_))
    }

    /// Whether it ends with a visit to the destination, or to one farther on.
    fn is_visit(self) -> bool {
        matches!(self, Self::Explore | Self::Remembered | Self::Towards(_))
    }

    /// The final destination of a stage, or the cell itself.
    fn aim(self, goal: Cell) -> Cell {
        if let Self::Towards(aim) = self { aim } else { goal }
    }

    fn stage(self) -> Stage {
        match self {
            Self::Explore => Stage::Exploring,
            Self::Evade => Stage::Waiting,
            _ => Stage::Relocating,
        }
    }

    fn text(self) -> &'static str {
        match self {
            Self::Explore => "exploring",
            Self::OcclusionPoint => "search mode: looking behind a corner",
            Self::Boundary => "search mode: to the boundary of the region",
            Self::Remembered | Self::Towards(_) => "search mode: back to what is unvisited",
            Self::Viewpoint => "search mode: to a viewpoint",
            Self::Evade => "making way",
        }
    }
}

/// What a confined body remembers beside that.
#[derive(Debug)]
struct Wide {
    /// Destinations without a path.
    failed: FailedGoals,
    viewpoints: Viewpoints,
    growth: Growth,
}

/// The exploration of one agent.
#[derive(Debug)]
pub struct Lvd {
    rng: ChaCha8Rng,
    visit_radius_m: f64,
    near_m: f64,
    leg_max_m: f64,
    visits_max: u64,
    search_time: SearchTime,
    scan: LastScan,
    flood: Flood,
    places: Places,
    /// See [`searching::Search`].
    frontier_visits: BTreeMap<Cell, u64>,
    /// The present destination and its purpose.
    destination: Option<(Cell, Purpose)>,
    /// Destinations to avoid, and until when.
    refused: Vec<(Cell, Tick)>,
    /// Of a confined body.
    wide: Option<Wide>,
    waits_until: Tick,
    /// The agents that it has run into.
    blockages: Blockages,
    has_asked_for_view: bool,
    last_info: String,
}

impl Lvd {
    /// Settings:
    /// - `visit_radius_m`: free cells seen from within this distance, and from at most 24 cells,
    ///   are visited (reference: 3.75; in one of its branches 6.75);
    /// - `leg_max_m`: greatest length of a straight leg on through unvisited cells (ours, 20;
    ///   reference, and 0: to the nearest one);
    /// - `near_m`: of 26 directions, those whose nearest unvisited cell is at most this much
    ///   farther than the nearest of all tie, and the longest leg decides, then their order (ours,
    ///   4; reference, and 0: the nearest cell alone);
    /// - `merge_m`: occlusion points within this distance are merged (ours, 3.75; the paper merges
    ///   near ones, without a number);
    /// - `visits_max`: how often search mode visits the same place (ours, 3);
    /// - `search_time`, `search_ticks`, `search_cells_per_tick`: see [`Settings::search_time`].
    ///
    /// # Errors
    /// If a setting is out of range.
    pub fn new(settings: &mut Settings, cell_m: f64, rng: ChaCha8Rng) -> Result<Self, SettingError> {
        let visit_radius_m = settings.number("visit_radius_m", 3.75, 0.0, 1e6)?;
        let near_m = settings.number("near_m", 4.0, 0.0, 1e6)?;
        let leg_max_m = settings.number("leg_max_m", 20.0, 0.0, 1e6)?;
        let merge_m = settings.number("merge_m", 3.75, 0.0, 1e6)?;
        let visits_max = settings.integer("visits_max", 3, 1, u64::from(u32::MAX))?;
        let search_time = settings.search_time()?;
        Ok(Self {
            rng,
            visit_radius_m,
            near_m,
            leg_max_m,
            visits_max,
            search_time,
            scan: LastScan::default(),
            flood: Flood::default(),
            places: Places::new(merge_m / cell_m),
            frontier_visits: BTreeMap::new(),
            destination: None,
            refused: Vec::new(),
            wide: None,
            waits_until: Tick::ZERO,
            blockages: Blockages::with_rests_alone(),
            has_asked_for_view: false,
            last_info: String::new(),
        })
    }

    fn pursue(&mut self, observation: &Observation, ctx: &mut Ctx<'_>, goal: Cell, purpose: Purpose) -> Command {
        self.destination = Some((goal, purpose));
        ctx.limit_searches(if ctx.is_confined() { WIDE_SEARCH_CELLS_MAX } else { SEARCH_CELLS_MAX });
        let to = ctx.approach(goal);
        // As near as a wide body comes, and still it has not been visited or shown anything.
        let is_there = |to: Cell| ctx.is_confined() && to == ctx.cell();
        let is_pointless = |to: Cell| is_there(to) && (purpose.is_visit() || purpose == Purpose::Viewpoint);
        let status = match to.filter(|&to| !is_pointless(to)) {
            Some(to) if ctx.is_clear_to(to) || !self.flood.is_cut_off(ctx.map(), to, ctx.cell(), POCKET_CELLS_MAX) => {
                ctx.go_to_cell(to, self.search_time)
            }
            _ => NavigationStatus::NoPath,
        };
        match status {
            NavigationStatus::Go(motion) => {
                let command = Command::new(motion, WakeCondition::on(UNDER_WAY)).with_stage(purpose.stage());
                let centre = ctx.map().extent().centre(goal);
                let text =
                    format!("destination ({:.2}, {:.2}, {:.2}), {}", centre.x, centre.y, centre.z, purpose.text());
                self.with_new_info(command, text)
            }
            NavigationStatus::Searching(wake) => Command::keep(wake),
            NavigationStatus::NoPath => {
                let aim = purpose.aim(goal);
                self.refuse(aim, observation.tick);
                if let Some(wide) = &mut self.wide {
                    wide.failed.insert(aim);
                    if purpose == Purpose::Viewpoint {
                        wide.viewpoints.visit(ctx.map().extent(), aim);
                    }
                }
                self.destination = None;
                self.request_view(observation)
            }
        }
    }

    fn with_new_info(&mut self, command: Command, text: String) -> Command {
        if text == self.last_info {
            return command;
        }
        self.last_info = text;
        command.with_info(self.last_info.clone())
    }

    fn request_view(&mut self, observation: &Observation) -> Command {
        self.has_asked_for_view = true;
        Command::keep(WakeCondition::at(observation.tick.next())).with_view_request()
    }

    /// Ends the present task, to choose again with the view of the last scan.
    fn abort_task(&mut self) -> Command {
        self.destination = None;
        self.has_asked_for_view = true;
        Command::new(Motion::Stop, WakeCondition::NEXT_TICK).with_view_request()
    }

    fn refuse(&mut self, cell: Cell, now: Tick) {
        self.refused.push((cell, now.after(REFUSAL_TICKS)));
    }

    fn while_active(&mut self, observation: &Observation, ctx: &Ctx<'_>) -> Command {
        let keep = Command::keep(WakeCondition::on(UNDER_WAY));
        let Some((goal, purpose)) = self.destination else { return keep };
        let is_done = match purpose {
            Purpose::Explore | Purpose::Remembered => ctx.map().state(goal) == CellState::Covered,
            Purpose::Towards(goal) => ctx.map().state(goal) == CellState::Covered,
            Purpose::OcclusionPoint | Purpose::Boundary | Purpose::Viewpoint | Purpose::Evade => false,
        };
        if is_done || purpose.is_search() && self.sees_unvisited(observation, ctx) {
            return self.abort_task();
        }
        keep
    }

    /// Whether a cell that was first seen in this observation is unvisited and in the own region.
    fn sees_unvisited(&self, observation: &Observation, ctx: &Ctx<'_>) -> bool {
        let extent = ctx.map().extent();
        let region = Region::new(observation, ctx);
        observation.seen.free.iter().any(|&index| {
            let cell = extent.cell_at(index as usize);
            ctx.map().state(cell) == CellState::Free
                && region.holds(&extent.centre(cell))
                && !is_refused(ctx, &self.refused, self.wide.as_ref(), cell)
        })
    }

    /// Waits or moves aside at random, so that two agents do not block each other for ever; rests
    /// if one of them has not moved for long.
    fn evade(&mut self, observation: &Observation, ctx: &mut Ctx<'_>) -> Command {
        let destination = self.destination.take();
        let to = destination.and_then(|(goal, _)| ctx.approach(goal)).filter(|&to| to != ctx.cell());
        let standing = self.blockages.note_between_steps(observation, ctx, |obstacles| {
            let motion = way_round(ctx, to?, obstacles, Waypoints::Fewest)?;
            let stage = destination.map_or(Stage::Relocating, |(_, purpose)| purpose.stage());
            Some(Command::new(motion, WakeCondition::on(UNDER_WAY)).with_stage(stage))
        });
        let is_standing = standing.is_some();
        match standing {
            Some(Yield::Rest(command)) => return command,
            Some(Yield::Detour(command)) => {
                self.destination = destination;
                return self.with_new_info(command, "going past a body in the way".to_owned());
            }
            Some(Yield::StepAside) | None => {}
        }
        if let Some((goal, purpose)) = destination.filter(|_| !is_standing) {
            self.refuse(purpose.aim(goal), observation.tick);
        }
        let asides = ctx.clear_neighbours();
        if !asides.is_empty() && (is_standing || self.rng.random_bool(0.5)) {
            let aside = asides[self.rng.random_range(0..asides.len())];
            return self.pursue(observation, ctx, aside, Purpose::Evade);
        }
        self.waits_until = observation.tick.after(self.rng.random_range(EVASION_TICKS));
        Command::keep(WakeCondition::at(self.waits_until))
    }

    fn choose(&mut self, observation: &Observation, ctx: &mut Ctx<'_>) -> Command {
        let has_stalled = |wide: &mut Wide| wide.growth.has_stalled(ctx.map(), observation.tick);
        if self.wide.as_mut().is_some_and(has_stalled) {
            match self.viewpoint(ctx) {
                Poll::Ready(Some(viewpoint)) => {
                    return self.pursue(observation, ctx, viewpoint.cell, Purpose::Viewpoint);
                }
                Poll::Pending => return self.request_view(observation),
                Poll::Ready(None) => {}
            }
        }
        let region = Region::new(observation, ctx);
        if let Some(goal) = self.nearest_unvisited(ctx, &region) {
            return self.pursue(observation, ctx, goal, Purpose::Explore);
        }
        let search = searching::Search {
            ctx: &*ctx,
            scan: &self.scan,
            region: &region,
            places: &self.places,
            frontier_visits: &self.frontier_visits,
            visits_max: self.visits_max,
            is_refused: &|cell| is_refused(ctx, &self.refused, self.wide.as_ref(), cell),
        };
        let in_sight = search
            .occlusion_point()
            .map(|goal| (goal, Purpose::OcclusionPoint))
            .or_else(|| search.boundary().map(|goal| (goal, Purpose::Boundary)));
        if let Some((goal, purpose)) = in_sight {
            return self.pursue(observation, ctx, goal, purpose);
        }
        match search.nearest_on_map(&mut self.flood) {
            Poll::Ready(Some(goal)) => {
                let stage = self.flood.towards(ctx.map(), goal, STAGE_STEPS);
                let purpose = if stage == goal { Purpose::Remembered } else { Purpose::Towards(goal) };
                self.pursue(observation, ctx, stage, purpose)
            }
            Poll::Pending => self.request_view(observation),
            Poll::Ready(None) if ctx.is_confined() => self.look_from_afar(observation, ctx),
            Poll::Ready(None) => self.wait(observation.tick, "nothing left to do, waiting for news"),
        }
    }

    /// Waits for what others bring, and looks again after a while.
    fn wait(&mut self, now: Tick, info: &str) -> Command {
        self.destination = None;
        let wake = WakeCondition { at: now.after(WAIT_TICKS), events: EventMask::CONTACTS | EventMask::MESSAGE };
        self.with_new_info(Command::keep(wake).with_stage(Stage::Waiting), info.to_owned())
    }

    /// Where a confined body sees something unexplored.
    fn viewpoint(&mut self, ctx: &Ctx<'_>) -> Poll<Option<Viewpoint>> {
        let Some(wide) = &mut self.wide else { return Poll::Ready(None) };
        wide.viewpoints.visit(ctx.map().extent(), ctx.cell());
        let found = wide.viewpoints.next(ctx);
        if found == Poll::Ready(None) {
            wide.growth.note_all_seen();
        }
        found
    }

    /// A confined body goes where it sees something unexplored, if there is such a place.
    fn look_from_afar(&mut self, observation: &Observation, ctx: &mut Ctx<'_>) -> Command {
        match self.viewpoint(ctx) {
            Poll::Ready(Some(viewpoint)) => self.pursue(observation, ctx, viewpoint.cell, Purpose::Viewpoint),
            Poll::Pending => self.request_view(observation),
            Poll::Ready(None) => self.wait(observation.tick, NOTHING_TO_SEE),
        }
    }

    fn nearest_unvisited(&self, ctx: &Ctx<'_>, region: &Region) -> Option<Cell> {
        let compass = exploring::compass(ctx, &self.scan, region, |cell| {
            is_refused(ctx, &self.refused, self.wide.as_ref(), cell)
        });
        let extent = ctx.map().extent();
        let in_m = |squared_cells: i32| f64::from(squared_cells).sqrt() * extent.cell_m();
        let nearest_m = compass.iter().flatten().map(|&(distance, _)| in_m(distance)).min_by(f64::total_cmp)?;
        let near = compass.iter().flatten().filter(|&&(distance, _)| in_m(distance) <= nearest_m + self.near_m);
        let legs =
            near.map(|&(_, cell)| exploring::leg_through(ctx, region, cell, self.leg_max_m, self.visit_radius_m));
        // Of equal lengths the first in the order of the compass.
        let longest = legs.fold(None, |best: Option<exploring::Leg>, leg| match best {
            Some(best) if best.length_m >= leg.length_m => Some(best),
            _ => Some(leg),
        });
        longest.map(|leg| leg.goal)
    }
}

/// Whether a cell is no destination: refused for a while, or, for a confined body, without
/// a path or a place to see it from.
fn is_refused(ctx: &Ctx<'_>, refused: &[(Cell, Tick)], wide: Option<&Wide>, cell: Cell) -> bool {
    refused.iter().any(|&(other, _)| other == cell)
        || wide.is_some_and(|wide| wide.failed.holds(cell) || !ctx.can_approach(cell))
}

impl Controller for Lvd {
    fn is_blocked(&self) -> bool {
        self.blockages.is_waiting() || self.waits_until != Tick::ZERO
    }

    fn decide(&mut self, observation: &Observation, ctx: &mut Ctx<'_>) -> Command {
        let now = observation.tick;
        if !ctx.map().extent().contains(ctx.cell()) {
            return Command::keep(WakeCondition::at(now.after(WAIT_TICKS)));
        }
        self.refused.retain(|&(_, until)| until > now);
        if observation.events.intersects(EventMask::REVISED) {
            // What could not be reached may be open now.
            (self.wide, self.waits_until) = (None, Tick::ZERO);
            self.refused.clear();
            self.frontier_visits.clear();
        }
        if ctx.is_confined() {
            let (run_info, radius_m) = (ctx.run_info(), ctx.body().radius_m);
            let wide = self.wide.get_or_insert_with(|| Wide {
                failed: FailedGoals::new(radius_m, run_info.extent.cell_m()),
                viewpoints: Viewpoints::new(run_info, radius_m),
                growth: Growth::default(),
            });
            wide.failed.update(ctx.map());
            ctx.update_reachable();
        }
        if let Some(view) = &observation.view {
            self.scan.load(ctx.map().extent(), view);
        }
        sights::mark_visited(ctx, self.visit_radius_m);
        if let Some(command) = self.blockages.still_waits(observation, ctx) {
            return command;
        }
        if observation.is_active {
            return self.while_active(observation, ctx);
        }
        if now < self.waits_until {
            return Command::keep(WakeCondition::at(self.waits_until));
        }
        self.waits_until = Tick::ZERO;
        if observation.events.intersects(EventMask::COLLISION) {
            return self.evade(observation, ctx);
        }
        if let Some((goal, purpose)) = self.destination {
            if !observation.events.intersects(EventMask::TASK_DONE) {
                // The path there is being searched for.
                return self.pursue(observation, ctx, goal, purpose);
            }
            self.destination = None;
            if purpose.is_search() && purpose.aim(goal) == goal {
                self.places.visit(goal, now);
                if ctx.map().is_frontier(goal) {
                    *self.frontier_visits.entry(goal).or_default() += 1;
                }
            }
            if purpose == Purpose::Explore && ctx.map().state(goal) == CellState::Free {
                self.refuse(goal, now);
            }
            let is_unvisited = purpose.is_visit() && ctx.map().state(goal) == CellState::Free;
            if let Some(wide) = self.wide.as_mut().filter(|_| is_unvisited && purpose.aim(goal) == goal) {
                wide.failed.insert(goal);
            }
        }
        if observation.view.is_none() && (observation.scan_tick.is_none() || !self.has_asked_for_view) {
            return self.request_view(observation);
        }
        self.has_asked_for_view = false;
        self.choose(observation, ctx)
    }
}

#[cfg(test)]
mod tests;
