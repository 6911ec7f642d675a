//! Straight legs: whether a leg to a cell is clear, and as few waypoints as possible for a path
//! (string pulling).

use std::ops::ControlFlow;

use nalgebra::Point3;
use protocol::limits::PATH_POINTS_MAX;
use voxels::{BodyLattice, Cell, Footing, walk_segment};

use super::sweep::{clearance, in_cells, place, rows, touches_run};
use super::{Moves, Path};
use crate::exploration_map::ExplorationMap;

/// Cells of a path ahead among which a shortcut is searched; bounds the cost on long and winding
/// paths.
const AHEAD: usize = 256;

/// What of a body decides which straight legs it can make: its radius, in metres, and the footing
/// of a ground body.
#[derive(Debug, Clone, Copy)]
pub struct LegBody<'m> {
    radius_m: f64,
    footing: Option<&'m Footing>,
}

impl From<f64> for LegBody<'_> {
    fn from(radius_m: f64) -> Self {
        Self { radius_m, footing: None }
    }
}

impl<'m> From<&'m Moves> for LegBody<'m> {
    fn from(moves: &'m Moves) -> Self {
        Self { radius_m: moves.radius_m(), footing: moves.footing() }
    }
}

impl LegBody<'_> {
    /// Whether a leg between two points, in units of cells, is clear for it, with a clearance in
    /// cells.
    fn is_clear(&self, map: &ExplorationMap, from: [f64; 3], to: [f64; 3], radius: f64) -> bool {
        is_clear(map, from, to, radius)
            && self.footing.is_none_or(|footing| from[2] == to[2] && is_carried(map, footing, from, to))
    }
}

/// Whether the floor carries a ground body all along a level leg between two points, in units of
/// cells.
fn is_carried(map: &ExplorationMap, footing: &Footing, from: [f64; 3], to: [f64; 3]) -> bool {
    // Not between two layers of cells, where the places of some bodies are.
    let in_layer =
        |[x, y, z]: [f64; 3]| Point3::from([x, y, z.floor() + 0.5].map(|along| along * map.extent().cell_m()));
    let [from, to] = [from, to].map(in_layer);
    let carries = |cell| match footing.carries(map, cell) {
        true => ControlFlow::Continue(()),
        false => ControlFlow::Break(()),
    };
    walk_segment(map.extent(), &from, &to, carries).is_continue()
}

/// Whether a body of `radius_m` metres, on the straight leg from a point (metres, frame `map`) to
/// the place of a cell, touches only cells known to be free, those at both ends included, and rests
/// there.
///
/// False if either end lies outside the map.
#[must_use]
pub fn direct<'m>(map: &ExplorationMap, from: &Point3<f64>, to: Cell, body: impl Into<LegBody<'m>>) -> bool {
    let (extent, body) = (map.extent(), body.into());
    let radius_m = body.radius_m;
    let lattice = BodyLattice::of(radius_m, extent.cell_m());
    clearance(radius_m, extent.cell_m()).is_some_and(|radius| {
        extent.contains(to)
            && body.is_clear(map, in_cells((*from).into(), extent.cell_m()), place(lattice, to), radius)
            && body.footing.is_none_or(|footing| footing.stands(map, to))
    })
}

/// Waypoints (metres, frame `map`) for a body of `radius_m` metres at the place of the first cell
/// of a path: its last cell, and before it the cells where a leg must end because the next cells
/// cannot be reached on a straight leg.
///
/// Each leg goes to the last cell of the path, within 256 cells, to which it is [`direct`]; a
/// single step of the path is taken to be clear. The start is no waypoint, so a path of one cell
/// has none. A path that needs more than [`PATH_POINTS_MAX`] waypoints is cut there: the rest must
/// be requested again from its end.
#[must_use]
pub fn straighten<'m>(path: &Path, map: &ExplorationMap, body: impl Into<LegBody<'m>>) -> Vec<Point3<f64>> {
    let body = body.into();
    let lattice = BodyLattice::of(body.radius_m, map.extent().cell_m());
    path.cells.first().map_or_else(Vec::new, |&first| pull(path, map, &body, place(lattice, first)))
}

/// [`straighten`] for a body anywhere in the first cell of the path (metres, frame `map`).
///
/// If it cannot reach the second cell or beyond on a straight leg, the place of the first cell is
/// its first waypoint.
#[must_use]
pub fn straighten_from<'m>(
    from: &Point3<f64>,
    path: &Path,
    map: &ExplorationMap,
    body: impl Into<LegBody<'m>>,
) -> Vec<Point3<f64>> {
    pull(path, map, &body.into(), in_cells((*from).into(), map.extent().cell_m()))
}

fn pull(path: &Path, map: &ExplorationMap, body: &LegBody<'_>, start: [f64; 3]) -> Vec<Point3<f64>> {
    let (extent, radius_m) = (map.extent(), body.radius_m);
    let (radius, lattice) = (clearance(radius_m, extent.cell_m()), BodyLattice::of(radius_m, extent.cell_m()));
    let mut points = Vec::new();
    // The position of the body, its cell on the path, and the first later cell that it can surely
    // reach.
    let (mut here, mut at) = (start, 0);
    let mut next = usize::from(path.cells.first().is_some_and(|&first| start == place(lattice, first)));
    while next < path.cells.len() && points.len() < PATH_POINTS_MAX {
        let farthest = (at + AHEAD).min(path.cells.len() - 1);
        let clear =
            |&index: &usize| radius.is_some_and(|r| body.is_clear(map, here, place(lattice, path.cells[index]), r));
        at = (next + 1..=farthest).rev().find(clear).unwrap_or(next);
        next = at + 1;
        here = place(lattice, path.cells[at]);
        points.push(lattice.place(extent, path.cells[at]));
    }
    points
}

/// Cells of a row looked at together.
const TOGETHER: i32 = 64;

pub(super) fn is_clear(map: &ExplorationMap, from: [f64; 3], to: [f64; 3], radius: f64) -> bool {
    let is_inside = |(along, size): (f64, u32)| (0.0..=f64::from(size)).contains(&along);
    let touches_other = |(y, z): (i32, i32), (low_x, high_x): (i32, i32)| {
        let mut x = low_x;
        while x <= high_x {
            let count = (high_x - x + 1).min(TOGETHER);
            let free = map.free_row(Cell::new(x, y, z), count.cast_unsigned());
            let mut others = !free & u64::MAX >> (TOGETHER - count);
            // Run by run of cells that are not known to be free.
            while others != 0 {
                let first = others.trailing_zeros();
                let last = first + (others >> first).trailing_ones() - 1;
                let [first_x, last_x] = [first, last].map(|place| x + place.cast_signed());
                if touches_run(from, to, radius, (y, z), first_x, last_x) {
                    return true;
                }
                others &= u64::MAX.checked_shl(last + 1).unwrap_or(0);
            }
            x += TOGETHER;
        }
        false
    };
    from.into_iter().zip(map.extent().size()).all(is_inside) && !rows(from, to, radius, touches_other)
}
