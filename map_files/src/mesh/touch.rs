//! The cells that a triangle touches: a part of it with an area lies in the cell, the lower faces
//! of which belong to it.

use voxels::Cell;

use super::super::FormatError;
use super::super::frame::Bounds;
use super::{Triangle, WorkBudget};

/// Steps of work for a column of cells: its part of the triangle is cut out.
const COLUMN_STEPS: usize = 32;

/// Depth to which a triangle may lie in a cell without touching it, in lengths of cells: more than
/// the rounding errors of cuts, and less than a unit of the lattice of corners.
const ROUNDING: f64 = 1.0 / (1 << 20) as f64;

/// Visits each cell that a triangle touches.
///
/// # Errors
/// If no work is left.
pub(super) fn touch(
    triangle: &Triangle,
    work: &mut WorkBudget,
    mut touched: impl FnMut(Cell),
) -> Result<(), FormatError> {
    for x in cells(triangle, 0) {
        let slab = clipped(triangle, 0, x);
        for y in cells(&slab, 1) {
            let column = clipped(&slab, 1, y);
            let cells = cells(&column, 2);
            work.spend(COLUMN_STEPS + cells.clone().count())?;
            for z in cells {
                touched(Cell::new(x, y, z));
            }
        }
    }
    Ok(())
}

/// The cells along an axis in which a polygon lies; one in a plane between two cells lies in the
/// upper one.
fn cells(polygon: &[[f64; 3]], axis: usize) -> std::ops::RangeInclusive<i32> {
    let Some(Bounds { low, high }) = Bounds::of(polygon.iter().copied()) else {
        return std::ops::RangeInclusive::new(1, 0);
    };
    let first = libm::floor(low[axis] + ROUNDING);
    first as i32..=first.max(libm::ceil(high[axis] - ROUNDING) - 1.0) as i32
}

/// The part of a convex polygon that lies in the cells with the coordinate `at` along an axis,
/// their faces included.
fn clipped(polygon: &[[f64; 3]], axis: usize, at: i32) -> Vec<[f64; 3]> {
    let above = half(polygon, axis, f64::from(at), 1.0);
    half(&above, axis, f64::from(at) + 1.0, -1.0)
}

/// The part of a convex polygon on one side of a plane.
fn half(polygon: &[[f64; 3]], axis: usize, plane: f64, side: f64) -> Vec<[f64; 3]> {
    let mut part = Vec::with_capacity(polygon.len() + 1);
    for (number, &corner) in polygon.iter().enumerate() {
        let next = polygon[(number + 1) % polygon.len()];
        let [here, there] = [corner, next].map(|corner| (corner[axis] - plane) * side);
        if here >= 0.0 {
            part.push(corner);
        }
        if (here > 0.0 && there < 0.0) || (here < 0.0 && there > 0.0) {
            let share = here / (here - there);
            let mut cut = [0, 1, 2].map(|along| corner[along] + share * (next[along] - corner[along]));
            cut[axis] = plane;
            part.push(cut);
        }
    }
    part
}
