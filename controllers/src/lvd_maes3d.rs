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
//! - points near each other are not merged, and there is no fallback: it stays and tries again in
//!   each tick;
//! - a wall at the edge of the map that is seen in search mode is an error, and the agent does
//!   nothing in that tick.
//!
//! Before a vertical or empty leg it turns to heading 0 (`maes3d_legs`). Unlike the
//! reference it rests before a body that does not move for
//! long.
//!
//! The reference has no bodies wider than a cell. Such a body goes as near to a cell as it can, to
//! no cell again to which it found no path until something near it changes, and without a
//! destination to where it sees something unexplored (`viewpoints`).
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
use agent::observation::Observation;
use agent::path::Neighbours;

/// Cells seen from within this distance are visited, in cells.
const VISIT_RADIUS_CELLS: f64 = 3.75;

const UNDER_WAY: EventMask = EventMask::TASK_DONE.union(EventMask::COLLISION).union(EventMask::NEW_CELL);

/// The reference would have read a cell outside the map.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct OutOfBounds;

/// The exploration of one agent.
#[derive(Debug, Default)]
pub struct LvdMaes3d {
    scan: LastScan,
    /// Selections by occlusion point.
    selections: BTreeMap<Cell, u64>,
    is_in_search_mode: bool,
    destination: Option<Point3<f64>>,
    /// What is left of the path to it.
    legs: Legs,
    /// The tick in which the end of the present task is noticed.
    notices_at: Option<Tick>,
    said: String,
    /// The agents that it has run into.
    blockages: Blockages,
    /// Of a body wider than a cell.
    wide: Option<Wide>,
}

/// What a body wider than a cell remembers beside that.
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
        let mut is_any_unvisited = false;
        for &index in self.scan.free() {
            let cell = extent.cell_at(index as usize);
            if ctx.map().state(cell) == CellState::Free {
                is_any_unvisited = true;
                if f64::from(squared(cell - own)) <= VISIT_RADIUS_CELLS * VISIT_RADIUS_CELLS {
                    ctx.mark_covered(cell);
                }
            }
        }
        is_any_unvisited
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

    /// The occlusion point to visit; counts its selection.
    fn occlusion_point(&mut self, extent: Extent, own: Cell, others: &[Cell]) -> Result<Option<Cell>, OutOfBounds> {
        let mut nearest: Option<(i32, Cell)> = None;
        let mut last = None;
        let inside = |cell: Cell| if extent.contains(cell) { Ok(cell) } else { Err(OutOfBounds) };
        for wall in self.walls_in_ray_order(extent, own) {
            let is_wall = |cell| Ok(self.scan.is_wall(extent, inside(cell)?));
            occlusion::candidates(own, wall, is_wall, |cell| {
                if !self.scan.is_free(extent, inside(cell)?) || !is_own(own, others, cell) || self.has_failed(cell) {
                    return Ok(());
                }
                let distance = squared(cell - own);
                let was_selected = self.selections.get(&cell).is_some_and(|&selections| selections > 0);
                if !was_selected && nearest.is_none_or(|(least, _)| distance < least) {
                    nearest = Some((distance, cell));
                } else {
                    last = Some(cell);
                }
                Ok(())
            })?;
        }
        let point = nearest.map(|(_, cell)| cell).or(last);
        if let Some(point) = point {
            *self.selections.entry(point).or_default() += 1;
        }
        Ok(point)
    }

    /// The walls in view by their angle from our +y, then upwards, then along x.
    fn walls_in_ray_order(&self, extent: Extent, own: Cell) -> Vec<Cell> {
        let along_pole = |cell: Cell| f64::from((cell - own).y) / f64::from(squared(cell - own).max(1)).sqrt();
        let walls = self.scan.wall().iter().map(|&index| extent.cell_at(index as usize));
        let mut walls: Vec<(f64, Cell)> = walls.map(|cell| (along_pole(cell), cell)).collect();
        walls.sort_by(|(one, a), (other, b)| other.total_cmp(one).then(a.cmp(b)));
        walls.into_iter().map(|(_, cell)| cell).collect()
    }

    /// Whether a body wider than a cell has found no path to a cell.
    fn has_failed(&self, cell: Cell) -> bool {
        self.wide.as_ref().is_some_and(|wide| wide.failed.holds(cell))
    }

    fn goes_to(&mut self, ctx: &mut Ctx<'_>, cell: Cell) -> Command {
        let to = ctx.approach(cell).filter(|&to| !ctx.is_wide() || to != ctx.cell());
        match to.map(|to| ctx.go_to_cell_by(to, Neighbours::Six, SearchTime::Instant)) {
            Some(NavigationStatus::Go(motion)) => self.sets_out(ctx, cell, motion),
            // It becomes idle again.
            Some(NavigationStatus::Searching(_) | NavigationStatus::NoPath) | None => {
                if let Some(wide) = &mut self.wide {
                    wide.failed.insert(cell);
                }
                looks_again(WakeCondition::NEXT_TICK)
            }
        }
    }

    /// A body wider than a cell without a destination goes where it sees something unexplored.
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
        self.destination = Some(ctx.map().extent().centre(cell));
        let motion = self.legs.begin(motion, ctx);
        self.with_new_info(under_way(motion))
    }

    fn goes_to_own_centre(&mut self, ctx: &Ctx<'_>) -> Command {
        let own = ctx.cell();
        self.sets_out(ctx, own, Motion::Path(vec![ctx.place(own)]))
    }

    fn with_new_info(&mut self, command: Command) -> Command {
        let Some(to) = self.destination else { return command };
        let mode = if self.is_in_search_mode { "search mode" } else { "exploration mode" };
        let text = format!("destination ({:.1}, {:.1}, {:.1}), {mode}", to.x, to.y, to.z);
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
            return self.goes_to(ctx, cell);
        }
        self.is_in_search_mode = true;
        match self.occlusion_point(extent, ctx.cell(), &others) {
            Ok(Some(cell)) => self.goes_to(ctx, cell),
            Ok(None) | Err(OutOfBounds) if ctx.is_wide() => self.looks_from_afar(ctx),
            Ok(None) | Err(OutOfBounds) => looks_again(WakeCondition::NEXT_TICK),
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
    fn decide(&mut self, observation: &Observation, ctx: &mut Ctx<'_>) -> Command {
        let now = observation.tick;
        let extent = ctx.map().extent();
        if !extent.contains(ctx.cell()) {
            return looks_again(WakeCondition::at(now.next()));
        }
        if let Some(view) = &observation.view {
            self.scan.load(extent, view);
        }
        if ctx.is_wide() {
            let (run_info, radius_m) = (ctx.run_info(), ctx.body().radius_m);
            let wide = self.wide.get_or_insert_with(|| Wide {
                failed: FailedGoals::new(radius_m, extent.cell_m()),
                viewpoints: Viewpoints::new(run_info, radius_m),
            });
            wide.failed.update(ctx.map());
        }
        if observation.events.intersects(EventMask::COLLISION)
            && observation.collision.is_some_and(|collision| collision.with_agent)
            && let Some(rest) = self.blockages.note(observation, ctx)
        {
            return rest.command().with_view_request();
        }
        if observation.collision.is_some() {
            self.legs.end();
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
                return if chosen.motion == Motion::Keep { self.goes_to_own_centre(ctx) } else { chosen };
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
