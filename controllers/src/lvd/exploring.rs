//! Exploration mode: the nearest unvisited cell in the last scan and in the own region, by a
//! compass of 26 directions.

use nalgebra::{Point3, Vector3};
use voxels::{Cell, Extent};

use super::last_scan::LastScan;
use super::places::squared;
use super::region::Region;
use crate::Ctx;
use agent::exploration_map::CellState;

/// The nearest cell in each of the 26 directions of [`Cell::neighbours26`], with its squared
/// distance in cells.
pub(crate) type Compass = [Option<(i32, Cell)>; 26];

/// Fills a compass with the unvisited cells of the last scan in the region, except those that
/// `is_refused`. Of cells at the same distance in the same direction the one with the lowest index
/// wins.
pub(crate) fn compass(ctx: &Ctx<'_>, scan: &LastScan, region: &Region, is_refused: impl Fn(Cell) -> bool) -> Compass {
    let map = ctx.map();
    let extent = map.extent();
    let own = ctx.cell();
    let mut compass = [None; 26];
    for &index in scan.free() {
        let cell = extent.cell_at(index as usize);
        if map.state(cell) != CellState::Free {
            continue;
        }
        let offset = cell - own;
        let Some(direction) = direction_of(offset) else { continue };
        let distance = squared(offset);
        let slot: &mut Option<(i32, Cell)> = &mut compass[direction];
        if slot.is_none_or(|(nearest, _)| distance < nearest) && region.holds(&extent.centre(cell)) && !is_refused(cell)
        {
            *slot = Some((distance, cell));
        }
    }
    compass
}

/// The number of the direction nearest to an offset; `None` for no offset. A coordinate counts if
/// it is at least half of the largest one.
fn direction_of(offset: Cell) -> Option<usize> {
    let along = [offset.x, offset.y, offset.z];
    let most = along.iter().map(|cells| cells.abs()).max().unwrap_or_default();
    let [x, y, z] = along.map(|cells| if 2 * cells.abs() >= most { cells.signum() } else { 0 });
    let code = ((z + 1) * 9 + (y + 1) * 3 + x + 1) as usize;
    (code != 13).then_some(code - usize::from(code > 13))
}

/// A straight leg through a cell and beyond.
pub(crate) struct Leg {
    /// The last cell of the leg.
    pub(crate) goal: Cell,
    /// Length, metres.
    pub(crate) length_m: f64,
}

/// The leg from the agent straight through `cell`, and on as far as cells of the region are known
/// to be free and unvisited (with gaps of at most `gap_m` of visited ones) and the leg is known to
/// be clear for the body; at most `max_m` long, or to `cell`.
pub(crate) fn leg_through(ctx: &Ctx<'_>, region: &Region, cell: Cell, max_m: f64, gap_m: f64) -> Leg {
    let map = ctx.map();
    let extent = map.extent();
    let from = ctx.position();
    let offset = extent.centre(cell) - from;
    let to_cell_m = offset.norm();
    let direction = offset.try_normalize(0.0).unwrap_or_else(Vector3::zeros);
    let mut ends = vec![cell];
    let mut unvisited_m = to_cell_m;
    let mut along_m = to_cell_m + extent.cell_m();
    while along_m <= max_m && along_m - unvisited_m <= gap_m + extent.cell_m() {
        let at = extent.cell_of(&(from + direction * along_m));
        match map.state(at) {
            CellState::Unexplored | CellState::Wall => break,
            CellState::Free if region.holds(&extent.centre(at)) => {
                unvisited_m = along_m;
                ends.push(at);
            }
            CellState::Free | CellState::Covered => {}
        }
        along_m += extent.cell_m();
    }
    let goal = ends.into_iter().rev().find(|&end| end == cell || ctx.is_clear_to(end)).unwrap_or(cell);
    Leg { goal, length_m: distance_m(extent, &from, goal) }
}

/// Distance from a point to the centre of a cell, metres.
fn distance_m(extent: Extent, from: &Point3<f64>, to: Cell) -> f64 {
    (extent.centre(to) - from).norm()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn compass_directions_are_distinct() {
        for (number, step) in Cell::default().neighbours26().into_iter().enumerate() {
            assert_eq!(direction_of(step), Some(number));
            assert_eq!(direction_of(Cell::new(9 * step.x, 9 * step.y, 9 * step.z)), Some(number));
        }
        assert_eq!(direction_of(Cell::default()), None);
        assert_eq!(direction_of(Cell::new(10, 4, -4)), direction_of(Cell::new(1, 0, 0)));
    }
}
