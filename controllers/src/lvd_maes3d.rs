//! Local Voronoi Decomposition as coded in MAES3D, for comparison with its results.
//!
//! Axes: our x is its x, our y its z, our z its y. Differences from [`super::lvd`]:
//! - it acts a tick late after a task that ended by itself, and at the start, because the status
//!   becomes idle only then;
//! - it uses the view of the last scan alone, which may be from another place, and goes to the
//!   single nearest cell;
//! - of cells at equal distances, the first in ray order wins: rays go from the +z side (our +y) to
//!   the other;
//! - the region is decided by cell centres, and cells between two agents belong to both;
//! - search mode ends with any visible uncovered cell, in any region, by going to the centre of the
//!   own cell;
//! - selections of an occlusion point count, not visits, and if all were selected before, the last
//!   one listed wins;
//! - points near each other are not merged, and there is no fallback: it stays and tries again, in
//!   each tick there, here when the result can be another one;
//! - a wall at the edge of the map that is seen in search mode is an error, and the agent does
//!   nothing in that tick.
//!
//! Before a vertical or empty leg it turns to heading 0 (`maes3d_legs`). Unlike the
//! reference it rests before a body that does not move for
//! long.
//!
//! The reference has no confined bodies. Such a body goes as near to a cell as it can, to
//! no cell again to which it found no path until something near it changes, to no occlusion point
//! twice, and without a destination to where it sees something unexplored (`viewpoints`).
//!
//! Not reproducible: the order of rays on the same circle about the pole (here upwards, then along
//! x), walls listed once for each of their rays (here once), straight paths checked on the true map
//! (here on the agent's own), the duration of a search on another thread (here none), and paths
//! some cells longer than necessary.

use std::collections::BTreeMap;
use std::task::Poll;

use msgs::ids::Tick;
use nalgebra::Point3;
use protocol::event_mask::EventMask;
use voxels::{Cell, Extent};

use super::blockage::Blockages;
use super::failed_goals::FailedGoals;
use super::lvd::last_scan::LastScan;
use super::lvd::occlusion;
use super::lvd::places::squared;
use super::maes3d_legs::Legs;
use super::viewpoints::{NOTHING_TO_SEE, Viewpoints};
use super::{Controller, Ctx};
use agent::command::{Command, Motion, Stage, WakeCondition};
use agent::exploration_map::CellState;
use agent::navigation::{NavigationStatus, SearchTime};
use agent::observation::{Contact, Observation};
use agent::path::Neighbours;

/// Cells seen from within this distance are visited, in cells.
const VISIT_RADIUS_CELLS: f64 = 3.75;

/// Ticks after which an agent without a destination looks again if nothing has changed: 5 s.
const IDLE_TICKS: u64 = 250;

/// What an agent says that has no destination.
const NO_DESTINATION: &str = "sees no destination";

const UNDER_WAY: EventMask = EventMask::TASK_DONE.union(EventMask::COLLISION).union(EventMask::NEW_CELL);

/// The reference would have read a cell outside the map.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct OutOfBounds;

/// The exploration of one agent.
#[derive(Debug, Default)]
pub struct LvdMaes3d {
    scan: LastScan,
    /// Whether it differs from the one before.
    is_view_new: bool,
    /// Selections by occlusion point.
    selections: BTreeMap<Cell, u64>,
    is_in_search_mode: bool,
    /// What is left of the path to the destination.
    legs: Legs,
    /// The tick in which the end of the present task is noticed.
    notices_at: Option<Tick>,
    said: String,
    /// The agents that it has run into.
    blockages: Blockages,
    /// The last search without a path: from which cell, to which, and with how many changes of the
    /// map.
    no_path: Option<(Cell, Cell, usize)>,
    /// The last choice without a destination.
    idle: Option<Idle>,
    /// Of a confined body.
    wide: Option<Wide>,
}

/// What a choice without a destination depended on, beside the view.
#[derive(Debug, PartialEq)]
struct Idle {
    contacts: Vec<Contact>,
    map_changes: usize,
    position: Point3<f64>,
}

/// What a confined body remembers beside that.
#[derive(Debug)]
struct Wide {
    failed: FailedGoals,
    viewpoints: Viewpoints,
}

impl LvdMaes3d {
    /// The controller has no settings.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Marks nearby cells in view as visited; returns whether any cell in view was not.
    fn visits(&self, ctx: &mut Ctx<'_>) -> bool {
        let extent = ctx.map().extent();
        let own = ctx.cell();
        let cells = self.scan.free().iter().map(|&index| extent.cell_at(index as usize));
        let unvisited: Vec<Cell> = cells.filter(|&cell| ctx.map().state(cell) == CellState::Free).collect();
        let is_near = |&&cell: &&Cell| f64::from(squared(cell - own)) <= VISIT_RADIUS_CELLS * VISIT_RADIUS_CELLS;
        let near: Vec<Cell> = unvisited.iter().filter(is_near).copied().collect();
        ctx.mark_all_covered(&near);
        !unvisited.is_empty()
    }

    fn nearest_unvisited(&self, ctx: &Ctx<'_>, others: &[Cell]) -> Option<Cell> {
        let extent = ctx.map().extent();
        let own = ctx.cell();
        let cells = self.scan.free().iter().map(|&index| extent.cell_at(index as usize));
        let unvisited = cells.filter(|&cell| ctx.map().state(cell) == CellState::Free);
        unvisited.filter(|&cell| is_own(own, others, cell) && !self.has_failed(cell)).min_by_key(|&cell| {
            let offset = cell - own;
            (squared(offset), -offset.y, offset.z, offset.x)
        })
    }

    /// The occlusion points in the order of their walls, repeatedly.
    fn occlusion_points(&self, extent: Extent, own: Cell, others: &[Cell]) -> Result<Vec<Cell>, OutOfBounds> {
        let mut points = Vec::new();
        let inside = |cell: Cell| if extent.contains(cell) { Ok(cell) } else { Err(OutOfBounds) };
        for wall in self.walls_in_ray_order(extent, own) {
            let is_wall = |cell| Ok(self.scan.is_wall(extent, inside(cell)?));
            occlusion::candidates(own, wall, is_wall, |cell| {
                if self.scan.is_free(extent, inside(cell)?) && is_own(own, others, cell) && !self.has_failed(cell) {
                    points.push(cell);
                }
                Ok(())
            })?;
        }
        Ok(points)
    }

    fn was_selected(&self, point: Cell) -> bool {
        self.selections.get(&point).is_some_and(|&selections| selections > 0)
    }

    /// The occlusion point to visit, and how often it has now been selected. A body wider than a
    /// cell visits none twice.
    fn occlusion_point(
        &mut self,
        extent: Extent,
        own: Cell,
        others: &[Cell],
    ) -> Result<Option<(Cell, u64)>, OutOfBounds> {
        let mut nearest: Option<(i32, Cell)> = None;
        let mut last = None;
        for cell in self.occlusion_points(extent, own, others)? {
            let distance = squared(cell - own);
            if !self.was_selected(cell) && nearest.is_none_or(|(least, _)| distance < least) {
                nearest = Some((distance, cell));
            } else {
                last = Some(cell);
            }
        }
        let last = last.filter(|_| self.wide.is_none());
        Ok(nearest.map(|(_, cell)| cell).or(last).map(|point| {
            let selections = self.selections.entry(point).or_default();
            *selections += 1;
            (point, *selections)
        }))
    }

    /// The walls in view by their angle from our +y, then upwards, then along x.
    fn walls_in_ray_order(&self, extent: Extent, own: Cell) -> Vec<Cell> {
        let along_pole = |cell: Cell| f64::from((cell - own).y) / f64::from(squared(cell - own).max(1)).sqrt();
        let walls = self.scan.wall().iter().map(|&index| extent.cell_at(index as usize));
        let mut walls: Vec<(f64, Cell)> = walls.map(|cell| (along_pole(cell), cell)).collect();
        walls.sort_by(|(one, a), (other, b)| other.total_cmp(one).then(a.cmp(b)));
        walls.into_iter().map(|(_, cell)| cell).collect()
    }

    /// Whether a confined body has found no path to a cell.
    fn has_failed(&self, cell: Cell) -> bool {
        self.wide.as_ref().is_some_and(|wide| wide.failed.holds(cell))
    }

    /// `is_last`: without a path there it would choose the same cell again.
    fn goes_to(&mut self, observation: &Observation, ctx: &mut Ctx<'_>, cell: Cell, is_last: bool) -> Command {
        let search = (ctx.cell(), cell, ctx.map().journal_len());
        let to = ctx.approach(cell).filter(|&to| match ctx.is_confined() {
            true => to != ctx.cell(),
            false => self.no_path != Some(search),
        });
        let status = to.map(|to| ctx.go_to_cell_by(to, Neighbours::Six, SearchTime::Instant));
        match (status, &mut self.wide) {
            (Some(NavigationStatus::Go(motion)), _) => self.sets_out(ctx, cell, motion),
            // It becomes idle again.
            (_, Some(wide)) => {
                wide.failed.insert(cell);
                looks_again(WakeCondition::NEXT_TICK)
            }
            (_, None) => {
                self.no_path = Some(search);
                if is_last { self.stays(observation, ctx) } else { looks_again(WakeCondition::NEXT_TICK) }
            }
        }
    }

    /// Without a destination it chooses again once that can have another result: after the next
    /// scan from here, when its map or the contacts change, and in the next tick if another agent
    /// moves that may leave a cell or an occlusion point to it.
    fn stays(&mut self, observation: &Observation, ctx: &Ctx<'_>) -> Command {
        let now = observation.tick;
        let idle = Idle {
            contacts: observation.contacts.clone(),
            map_changes: ctx.map().journal_len(),
            position: ctx.position(),
        };
        let before = self.idle.replace(idle);
        let is_left = !observation.contacts.is_empty() && self.is_anything_left(ctx);
        let is_any_moving = before.as_ref().is_none_or(|before| before.contacts != observation.contacts);
        let has_changed = self.is_view_new || before != self.idle;
        let period_ticks = u64::from(ctx.run_info().lidar_period_ticks.max(1));
        let next_scan = observation.scan_tick.map_or(now, |scan| scan.after(period_ticks)).max(now.next());
        let at = match is_left {
            true if is_any_moving => now.next(),
            false if !has_changed => now.after(IDLE_TICKS),
            _ => next_scan,
        };
        let command = looks_again(WakeCondition { at, events: EventMask::MESSAGE | EventMask::CONTACTS });
        self.with_new_info(command.with_stage(Stage::Waiting), NO_DESTINATION.to_owned())
    }

    /// Whether there is a destination in view, whichever agent it belongs to.
    fn is_anything_left(&self, ctx: &Ctx<'_>) -> bool {
        let points = self.occlusion_points(ctx.map().extent(), ctx.cell(), &[]);
        self.nearest_unvisited(ctx, &[]).is_some() || points.is_ok_and(|points| !points.is_empty())
    }

    /// A confined body without a destination goes where it sees something unexplored.
    fn looks_from_afar(&mut self, ctx: &mut Ctx<'_>) -> Command {
        let Some(wide) = &mut self.wide else { return looks_again(WakeCondition::NEXT_TICK) };
        wide.viewpoints.visit(ctx.map().extent(), ctx.cell());
        match wide.viewpoints.next(ctx) {
            Poll::Ready(Some(viewpoint)) => {
                let cell = viewpoint.cell;
                let status = ctx.go_to_cell_by(cell, Neighbours::TwentySix, SearchTime::Instant);
                if let NavigationStatus::Go(motion) = status {
                    return self.sets_out(ctx, cell, motion);
                }
                wide.viewpoints.visit(ctx.map().extent(), cell);
                looks_again(WakeCondition::NEXT_TICK)
            }
            Poll::Pending => looks_again(WakeCondition::NEXT_TICK),
            Poll::Ready(None) => looks_again(WakeCondition::on(EventMask::MESSAGE | EventMask::CONTACTS))
                .with_stage(Stage::Waiting)
                .with_info(NOTHING_TO_SEE),
        }
    }

    fn sets_out(&mut self, ctx: &Ctx<'_>, cell: Cell, motion: Motion) -> Command {
        self.notices_at = None;
        let motion = self.legs.begin(motion, ctx);
        let to = ctx.map().extent().centre(cell);
        let (mode, stage) = match self.is_in_search_mode {
            true => ("search mode", Stage::Relocating),
            false => ("exploration mode", Stage::Exploring),
        };
        let text = format!("destination ({:.1}, {:.1}, {:.1}), {mode}", to.x, to.y, to.z);
        self.with_new_info(under_way(motion).with_stage(stage), text)
    }

    fn goes_to_own_centre(&mut self, ctx: &Ctx<'_>) -> Command {
        let own = ctx.cell();
        self.sets_out(ctx, own, Motion::Path(vec![ctx.place(own)]))
    }

    fn with_new_info(&mut self, command: Command, text: String) -> Command {
        if text == self.said {
            return command;
        }
        self.said.clone_from(&text);
        command.with_info(text)
    }

    fn chooses(&mut self, observation: &Observation, ctx: &mut Ctx<'_>) -> Command {
        let extent = ctx.map().extent();
        let others = observation.contacts.iter().map(|contact| extent.cell_of(&contact.position));
        let others: Vec<Cell> = others.filter(|&cell| extent.contains(cell)).collect();
        if let Some(cell) = self.nearest_unvisited(ctx, &others) {
            return self.goes_to(observation, ctx, cell, true);
        }
        self.is_in_search_mode = true;
        match self.occlusion_point(extent, ctx.cell(), &others) {
            Ok(Some((cell, selections))) => self.goes_to(observation, ctx, cell, selections > 1),
            Ok(None) | Err(OutOfBounds) if ctx.is_confined() => self.looks_from_afar(ctx),
            Ok(None) | Err(OutOfBounds) => self.stays(observation, ctx),
        }
    }
}

fn under_way(motion: Motion) -> Command {
    Command::new(motion, WakeCondition::on(UNDER_WAY)).with_view_request()
}

fn looks_again(wake: WakeCondition) -> Command {
    Command::keep(wake).with_view_request()
}

/// Whether no other agent's cell is nearer to a cell than the own one.
fn is_own(own: Cell, others: &[Cell], cell: Cell) -> bool {
    let distance = squared(cell - own);
    others.iter().all(|&other| squared(cell - other) >= distance)
}

impl Controller for LvdMaes3d {
    fn is_blocked(&self) -> bool {
        self.blockages.is_waiting()
    }

    fn decide(&mut self, observation: &Observation, ctx: &mut Ctx<'_>) -> Command {
        let now = observation.tick;
        let extent = ctx.map().extent();
        if !extent.contains(ctx.cell()) {
            return looks_again(WakeCondition::at(now.next()));
        }
        if let Some(view) = &observation.view {
            self.is_view_new = !self.scan.is_of(view);
            self.scan.load(extent, view);
        }
        if ctx.is_confined() {
            let (run_info, radius_m) = (ctx.run_info(), ctx.body().radius_m);
            let wide = self.wide.get_or_insert_with(|| Wide {
                failed: FailedGoals::new(radius_m, extent.cell_m()),
                viewpoints: Viewpoints::new(run_info, radius_m),
            });
            wide.failed.update(ctx.map());
        }
        if observation.events.intersects(EventMask::COLLISION)
            && observation.collision.is_some_and(|collision| collision.with_agent)
            && let Some(command) = self.blockages.note(observation, ctx)
        {
            self.legs.end();
            return command.with_view_request();
        }
        if observation.collision.is_some() {
            self.legs.end();
        }
        if let Some(command) = self.blockages.still_waits(observation, ctx) {
            return command.with_view_request();
        }
        let is_between_legs = !observation.is_active && self.legs.is_any_left();
        let is_idle = !observation.is_active && !is_between_legs && {
            let notices_at = *self.notices_at.get_or_insert(now.next());
            observation.collision.is_some() || now >= notices_at
        };
        if is_idle || observation.events.intersects(EventMask::NEW_CELL) {
            let is_any_unvisited = self.visits(ctx);
            if self.is_in_search_mode && is_any_unvisited {
                self.is_in_search_mode = false;
                // The status does not change by that, so an idle agent continues and chooses;
                // without a destination it stays at its centre.
                let chosen =
                    if is_idle { self.chooses(observation, ctx) } else { looks_again(WakeCondition::NEXT_TICK) };
                let is_there = is_idle && Legs::is_done(&ctx.place(ctx.cell()), ctx);
                return match chosen.motion {
                    Motion::Keep if !is_there => self.goes_to_own_centre(ctx),
                    _ => chosen,
                };
            }
        }
        if is_between_legs && let Some(motion) = self.legs.next(ctx) {
            return under_way(motion);
        }
        match (observation.is_active, is_idle) {
            (true, _) => looks_again(WakeCondition::on(UNDER_WAY)),
            (false, true) => self.chooses(observation, ctx),
            (false, false) => looks_again(WakeCondition::at(now.next())),
        }
    }
}

#[cfg(test)]
mod tests;
