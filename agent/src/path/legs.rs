//! Straight legs: whether a leg to a cell is clear, and as few waypoints as possible for a path
//! (string pulling).

use nalgebra::Point3;
use protocol::limits::PATH_POINTS_MAX;
use voxels::{BodyLattice, Cell};

use super::Path;
use super::sweep::{clearance, in_cells, place, rows, touches_run};
use crate::exploration_map::ExplorationMap;

/// Cells of a path ahead among which a shortcut is searched; bounds the cost on long and winding
/// paths.
const AHEAD: usize = 256;

/// Whether a body of `radius_m` metres, on the straight leg from a point (metres, frame `map`) to
/// the place of a cell, touches only cells known to be free, those at both ends included.
///
/// False if either end lies outside the map.
#[must_use]
pub fn direct(map: &ExplorationMap, from: &Point3<f64>, to: Cell, radius_m: f64) -> bool {
    let extent = map.extent();
    let lattice = BodyLattice::of(radius_m, extent.cell_m());
    clearance(radius_m, extent.cell_m()).is_some_and(|radius| {
        extent.contains(to) && is_clear(map, in_cells((*from).into(), extent.cell_m()), place(lattice, to), radius)
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
pub fn straighten(path: &Path, map: &ExplorationMap, radius_m: f64) -> Vec<Point3<f64>> {
    let lattice = BodyLattice::of(radius_m, map.extent().cell_m());
    path.cells.first().map_or_else(Vec::new, |&first| pull(path, map, radius_m, place(lattice, first)))
}

/// [`straighten`] for a body anywhere in the first cell of the path (metres, frame `map`).
///
/// If it cannot reach the second cell or beyond on a straight leg, the place of the first cell is
/// its first waypoint.
#[must_use]
pub fn straighten_from(from: &Point3<f64>, path: &Path, map: &ExplorationMap, radius_m: f64) -> Vec<Point3<f64>> {
    pull(path, map, radius_m, in_cells((*from).into(), map.extent().cell_m()))
}

fn pull(path: &Path, map: &ExplorationMap, radius_m: f64, start: [f64; 3]) -> Vec<Point3<f64>> {
    let extent = map.extent();
    let (radius, lattice) = (clearance(radius_m, extent.cell_m()), BodyLattice::of(radius_m, extent.cell_m()));
    let mut points = Vec::new();
    // The position of the body, its cell on the path, and the first later cell that it can surely
    // reach.
    let (mut here, mut at) = (start, 0);
    let mut next = usize::from(path.cells.first().is_some_and(|&first| start == place(lattice, first)));
    while next < path.cells.len() && points.len() < PATH_POINTS_MAX {
        let farthest = (at + AHEAD).min(path.cells.len() - 1);
        let clear = |&index: &usize| radius.is_some_and(|r| is_clear(map, here, place(lattice, path.cells[index]), r));
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
