//! Motions that avoid the other agents.
//!
//! Invariants: every motion leads only through cells known to be free, and keeps its clearance to
//! the bodies nearby except where it starts. This module chooses neither the goal nor what happens
//! if there is no such motion.

use nalgebra::Point3;
use protocol::limits::PATH_POINTS_MAX;
use voxels::Cell;

use super::super::Ctx;
use super::obstacles::Obstacles;
use agent::abstract_graph::{AbstractGraph, ShortestPaths};
use agent::bodies::legs_m;
use agent::command::Motion;
use agent::navigation::NavigationStatus;
use agent::observation::Observation;
use agent::path::{Goal, Neighbours, Path, Search, quicker, straighten};

/// Cells of a path, or edges of the tree, that an agent follows one by one to get clear of other
/// bodies before it takes straight legs.
const CLEARING_STEPS_MAX: usize = 4;

/// Which waypoints are taken along a path.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Waypoints {
    /// As few as possible on the shortest path.
    Fewest,
    /// Those that take the least time, on that path and beside it.
    Quickest,
    /// These, passed without a stop at each where there is a trajectory for it.
    Passed,
}

impl Waypoints {
    /// The word of the setting.
    pub(super) fn word(self) -> &'static str {
        match self {
            Self::Fewest => "fewest",
            Self::Quickest => "quickest",
            Self::Passed => "passed",
        }
    }
}

/// The motion of a body that is to be at rest: `Keep` if it is already.
pub(super) fn hold(observation: &Observation) -> Motion {
    if observation.is_active { Motion::Stop } else { Motion::Keep }
}

/// Length of a motion along waypoints from `from`, metres; 0 for other motions.
pub(crate) fn path_length_m(from: &Point3<f64>, motion: &Motion) -> f64 {
    let Motion::Path(waypoints) = motion else { return 0.0 };
    legs_m(from, waypoints)
}

/// The motion to a cell in a region that has been reached, if a path avoids the other agents.
pub(super) fn motion_to(
    ctx: &mut Ctx<'_>,
    graph: &AbstractGraph,
    paths: &ShortestPaths,
    to: Cell,
    obstacles: &Obstacles,
    waypoints: Waypoints,
) -> Option<Motion> {
    let moves = ctx.graph(Neighbours::TwentySix);
    let path = paths.path(graph, moves, (ctx.cell(), to), &|cell| obstacles.occupy(cell))?;
    motion_along(ctx, &path, obstacles, waypoints)
}

/// The motion to the place of another cell that avoids the other agents, on the shortest path past
/// them.
pub(crate) fn way_round(ctx: &Ctx<'_>, to: Cell, obstacles: &Obstacles, waypoints: Waypoints) -> Option<Motion> {
    let is_open = |cell| !obstacles.occupy(cell);
    let search = Search::new(ctx.graph(Neighbours::TwentySix), ctx.cell(), Goal::Cell(to));
    motion_along(ctx, &search.within(&is_open).run()?, obstacles, waypoints)
}

/// The motion along a path that avoids the other agents, if possible on the wanted waypoints; else
/// as few legs as possible, after as few single steps as needed to get clear of them.
pub(crate) fn motion_along(ctx: &Ctx<'_>, path: &Path, obstacles: &Obstacles, waypoints: Waypoints) -> Option<Motion> {
    let map = ctx.map();
    let is_clear = |motion: &Motion| !obstacles.block_motion(&ctx.position(), motion);
    let recentrings = ctx.recentrings();
    if !recentrings.is_empty() {
        return recentrings.into_iter().find(is_clear);
    }
    let NavigationStatus::Go(straight) = ctx.follow(path) else { return None };
    let after = |steps: usize| {
        let rest = Path { cells: path.cells[steps..].to_vec(), cost: 0 };
        let by_steps = path.cells[1..=steps].iter().map(|&cell| ctx.place(cell));
        Motion::Path(by_steps.chain(straighten(&rest, map, ctx.moves())).take(PATH_POINTS_MAX).collect())
    };
    // A single step is clear of walls from place to place, and not from between them.
    let is_begun_clear =
        path.cells.len() > 1 && (ctx.position() == ctx.place(path.cells[0]) || ctx.is_clear_to(path.cells[1]));
    let steps_max = if is_begun_clear { CLEARING_STEPS_MAX.min(path.cells.len() - 1) } else { 0 };
    let quicker = match (waypoints, &straight) {
        (Waypoints::Quickest | Waypoints::Passed, Motion::Path(fewest)) => {
            quicker(path, fewest, map, ctx.body(), (&ctx.position(), ctx.yaw_rad())).map(Motion::Path)
        }
        _ => None,
    };
    quicker.into_iter().chain([straight]).chain((1..=steps_max).map(after)).find(is_clear)
}
