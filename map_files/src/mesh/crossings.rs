//! Signed crossings of lines through the centres of cells with a mesh.
//!
//! A line along an axis that enters the solid through a triangle gains one turn, and loses one
//! where it leaves; between the two it is inside as often as solids overlap there. At the end of a
//! line that has come through no hole nothing is left, and it has a vote in each of its cells.
//!
//! Corners lie on a lattice of whole units ([`super::lattice`]), so that integers decide which
//! triangles a line meets and on which side of a centre, without rounding. A centre on a triangle,
//! and a line through an edge or a corner, count as if all centres were moved by the same
//! infinitely small step along +x, by a still smaller one along +y, and by the smallest along +z
//! (simulation of simplicity; H. Edelsbrunner, E. P. Mücke, 1990). So a line meets one of the two
//! triangles at an edge, lines along all axes agree on each centre, and faces through centres give
//! the cells that the same faces give a little beside them.

use voxels::{Extent, Grid};

use super::super::{FormatError, ImportSpec, new_grid};
use super::lattice::{self, UNIT};
use super::{Triangle, WorkBudget};

/// Votes of the lines through each cell.
pub(super) struct Votes {
    /// For each cell the number of axes that find it inside, plus four times those that find it
    /// outside.
    cells: Grid<u8>,
    /// Number of lines along x, y and z that come through holes.
    pub(super) holes: [usize; 3],
}

impl Votes {
    /// Whether a cell is inside; `None` if less than two lines have a vote, or they differ.
    pub(super) fn is_inside(&self, index: usize) -> Option<bool> {
        match (self.cells[index] & 3, self.cells[index] >> 2) {
            (2.., 0) => Some(true),
            (0, 2..) => Some(false),
            _ => None,
        }
    }

    /// What most of the lines with a vote find.
    pub(super) fn majority(&self, index: usize) -> bool {
        self.cells[index] & 3 > self.cells[index] >> 2
    }
}

/// The votes of all lines.
///
/// # Errors
/// If there is no memory for them, or no work left.
pub(super) fn votes(
    extent: Extent,
    triangles: &[Triangle],
    spec: &ImportSpec,
    work: &mut WorkBudget,
) -> Result<Votes, FormatError> {
    let mut votes = new_grid(extent, 0u8, spec)?;
    let mut turns = new_grid(extent, 0i16, spec)?;
    let size = extent.size().map(|cells| cells as usize);
    let stride = [1, size[0], size[0] * size[1]];
    let mut holes = [0; 3];
    for axis in 0..3 {
        let (u, v) = OTHERS[axis];
        let turns = turns.as_mut_slice();
        for triangle in triangles {
            cross(triangle, axis, size, work, |index, turn| turns[index] = turns[index].saturating_add(turn))?;
        }
        let cells = votes.as_mut_slice();
        for column in 0..size[u] * size[v] {
            let first = column % size[u] * stride[u] + column / size[u] * stride[v];
            let line = || (0..size[axis]).map(|at| first + at * stride[axis]);
            let is_hole = line().map(|index| i64::from(turns[index])).sum::<i64>() != 0;
            holes[axis] += usize::from(is_hole);
            let mut inside = 0;
            for index in line() {
                inside += i64::from(turns[index]);
                turns[index] = 0;
                if !is_hole {
                    cells[index] += if inside == 0 { 4 } else { 1 };
                }
            }
        }
    }
    Ok(Votes { cells: votes, holes })
}

/// Visits the index of each cell before whose centre a line along `axis` through it meets the
/// triangle, and after the centre before, with the turn that the line gains there.
fn cross(
    triangle: &Triangle,
    axis: usize,
    size: [usize; 3],
    work: &mut WorkBudget,
    mut met: impl FnMut(usize, i16),
) -> Result<(), FormatError> {
    // The step along u is infinitely larger than that along v.
    let (u, v) = OTHERS[axis];
    let corners = lattice::units(triangle);
    let normal = lattice::normal(&corners);
    if normal[axis] == 0 {
        return Ok(());
    }
    // Out of the solid where the normal points along the line.
    let turn = if normal[axis] > 0 { -1 } else { 1 };
    // The step from a centre on the triangle leads beyond it if it leads to the side to which the
    // line goes: the normal's first part that is not 0 decides.
    let steps_beyond = normal.iter().find(|&&along| along != 0).is_some_and(|&first| (first > 0) == (normal[axis] > 0));
    let start = corners[0];
    let along_v = corners.map(|corner| corner[v]);
    let (low, high) = along_v.iter().fold((i64::MAX, i64::MIN), |(low, high), &at| (low.min(at), high.max(at)));
    let clamped = |first: i64, size: usize| first.clamp(0, size as i64) as usize;
    for row in clamped(first_centre(low, 1), size[v])..clamped(first_centre(high, 1), size[v]) {
        let at_v = centre(row);
        // The row meets two edges, in whose lower ends it may lie.
        let (mut first, mut end) = (i64::MAX, i64::MIN);
        for edge in [[0, 1], [1, 2], [2, 0]] {
            let [a, b] = edge.map(|corner| corners[corner]);
            let (a, b) = if a[v] <= b[v] { (a, b) } else { (b, a) };
            if a[v] <= at_v && at_v < b[v] {
                let rise = b[v] - a[v];
                let column = first_centre(a[u] * rise + (at_v - a[v]) * (b[u] - a[u]), rise);
                (first, end) = (first.min(column), end.max(column));
            }
        }
        let columns = clamped(first, size[u])..clamped(end.max(first), size[u]);
        work.spend(1 + columns.len())?;
        // Where the line meets the triangle, less half a cell, as a fraction of cells.
        let denominator = i128::from(normal[axis]) * i128::from(UNIT);
        let along_row = i128::from(start[axis] - UNIT / 2) * i128::from(normal[axis])
            - i128::from(normal[v]) * i128::from(at_v - start[v]);
        for column in columns {
            let numerator = along_row - i128::from(normal[u]) * i128::from(centre(column) - start[u]);
            let cell = first_cell(numerator, denominator, steps_beyond).max(0) as usize;
            if cell < size[axis] {
                let mut at = [0; 3];
                (at[axis], at[u], at[v]) = (cell, column, row);
                met((at[2] * size[1] + at[1]) * size[0] + at[0], turn);
            }
        }
    }
    Ok(())
}

/// The axes across an axis, the one with the larger step first.
const OTHERS: [(usize, usize); 3] = [(1, 2), (0, 2), (0, 1)];

/// Distance of a quotient from a whole number beyond which 64 bits tell it from that number: the
/// quotients are below 2^11, and their rounding errors below 2^-40.
const CLEAR: f64 = 1e-9;

/// The centre of a cell along an axis, units.
fn centre(cell: usize) -> i64 {
    cell as i64 * UNIT + UNIT / 2
}

/// The first cell along an axis with a centre from `at / over` units on; `over` is positive.
fn first_centre(at: i64, over: i64) -> i64 {
    let (numerator, denominator) = (at - UNIT / 2 * over, UNIT * over);
    let quotient = numerator.div_euclid(denominator);
    quotient + i64::from(numerator.rem_euclid(denominator) > 0)
}

/// The first whole number beyond a fraction, which itself is beyond if `is_beyond`.
fn first_cell(numerator: i128, denominator: i128, is_beyond: bool) -> i64 {
    let quotient = numerator as f64 / denominator as f64;
    let near = libm::round(quotient);
    if (quotient - near).abs() > CLEAR {
        return libm::ceil(quotient) as i64;
    }
    let difference = numerator - near as i128 * denominator;
    let is_above = (difference > 0) == (denominator > 0);
    let is_near_beyond = if difference == 0 { is_beyond } else { !is_above };
    near as i64 + i64::from(!is_near_beyond)
}
