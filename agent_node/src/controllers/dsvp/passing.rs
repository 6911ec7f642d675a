//! Motions past the other agents.
//!
//! Invariants: a motion that comes out of here leads only through cells that are known to be free, and comes too near to none of the
//! bodies nearby, save where it starts. This module does not choose where to go, nor what to do if there is no such motion.

use msgs::limits::PATH_POINTS_MAX;
use nalgebra::Point3;
use voxels::Cell;

use super::super::Ctx;
use super::others::Others;
use crate::command::Motion;
use crate::observation::Observation;
use crate::path::{Neighbours, Path, straighten};
use crate::regions::{Regions, Ways};
use crate::travel::Journey;

/// Steps from cell to cell, or along edges of the tree, that an agent takes to get clear of others before it goes straight.
const STEPS_PAST_OTHERS_MAX: usize = 4;

/// The bodies that may be in the way of this one.
pub(super) fn others_near(observation: &Observation, ctx: &Ctx<'_>) -> Others {
    Others::near(
        &observation.contacts,
        &ctx.position(),
        ctx.body().radius_m,
        &ctx.briefing().bodies,
        ctx.map().extent(),
    )
}

/// The motion of a body that is to be at rest: one that is so already is not told to stop.
pub(super) fn rest(observation: &Observation) -> Motion {
    if observation.is_active { Motion::Stop } else { Motion::Keep }
}

/// Length of a motion along way-points that begins at `from`, metres; 0 for other motions.
pub(super) fn length_m(from: &Point3<f64>, motion: &Motion) -> f64 {
    let Motion::Path(way_points) = motion else { return 0.0 };
    std::iter::once(from).chain(way_points).zip(way_points).map(|(from, to)| (to - from).norm()).sum()
}

/// The motion to a cell in a region that has been reached, if there is a way past the other agents.
pub(super) fn way(ctx: &mut Ctx<'_>, regions: &Regions, ways: &Ways, to: Cell, others: &Others) -> Option<Motion> {
    let here = ctx.cell();
    let (map, moves, scratch) = ctx.searching(Neighbours::TwentySix);
    let path = ways.path(regions, map, moves, scratch, (here, to), &|cell| others.take(cell))?;
    past(ctx, &path, others)
}

/// The motion along a path, past the other agents: with as few legs as do, after as few steps from cell to cell as are needed to
/// get clear of them.
pub(super) fn past(ctx: &Ctx<'_>, path: &Path, others: &Others) -> Option<Motion> {
    let (map, radius_m) = (ctx.map(), ctx.body().radius_m);
    let is_open = |motion: &Motion| !others.block_motion(&ctx.position(), motion);
    let Journey::Go(straight) = ctx.follow(path) else { return None };
    let after = |steps: usize| {
        let rest = Path { cells: path.cells[steps..].to_vec(), cost: 0 };
        let by_steps = path.cells[1..=steps].iter().map(|&cell| map.extent().centre(cell));
        Motion::Path(by_steps.chain(straighten(&rest, map, radius_m)).take(PATH_POINTS_MAX).collect())
    };
    let steps_max = STEPS_PAST_OTHERS_MAX.min(path.cells.len() - 1);
    std::iter::once(straight).chain((1..=steps_max).map(after)).find(is_open)
}
