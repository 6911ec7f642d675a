//! Signed crossings of lines through the centres of cells with a mesh.
//!
//! A line along an axis that enters the solid through a triangle gains one turn, and loses one
//! where it leaves; between the two it is inside as often as solids overlap there. At the end of a
//! line that has come through no hole nothing is left, and it has a vote in each of its cells.
//!
//! Two triangles that share an edge are intersected with the same arithmetic along it, and the sign
//! follows from the order of the intersections, so that a line along an edge counts once.

use voxels::{Extent, Grid};

use super::super::{FormatError, ImportSpec, new_grid};
use super::{Triangle, Work, normal};

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
    work: &mut Work,
) -> Result<Votes, FormatError> {
    let mut votes = new_grid(extent, 0u8, spec)?;
    let mut turns = new_grid(extent, 0i16, spec)?;
    let size = extent.size().map(|cells| cells as usize);
    let stride = [1, size[0], size[0] * size[1]];
    let mut holes = [0; 3];
    for axis in 0..3 {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
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
    work: &mut Work,
    mut met: impl FnMut(usize, i16),
) -> Result<(), FormatError> {
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    let (corner, normal) = (triangle[0], normal(triangle));
    let range = |along: usize| {
        let of = triangle.map(|corner| corner[along]);
        (of[0].min(of[1]).min(of[2]), of[0].max(of[1]).max(of[2]))
    };
    let (depth_min, depth_max) = range(axis);
    let (low, high) = range(v);
    for row in centres(low, high, size[v]) {
        let at_v = row as f64 + 0.5;
        let (mut up, mut down) = (None, None);
        for edge in [[0, 1], [1, 2], [2, 0]] {
            let [from, to] = edge.map(|corner| triangle[corner]);
            let rises = from[v] <= to[v];
            let (a, b) = if rises { (from, to) } else { (to, from) };
            if a[v] <= at_v && at_v < b[v] {
                let end = a[u] + (at_v - a[v]) * (b[u] - a[u]) / (b[v] - a[v]);
                *(if rises { &mut up } else { &mut down }) = Some(end);
            }
        }
        let (Some(up), Some(down)) = (up, down) else { continue };
        // Seen against the axis, the corners of a triangle that faces the viewer go round to the
        // left.
        let turn = if up > down { -1 } else { 1 };
        let columns = centres(up.min(down), up.max(down), size[u]);
        work.spend(1 + columns.len())?;
        for column in columns {
            let at_u = column as f64 + 0.5;
            let slope = normal[u] * (at_u - corner[u]) + normal[v] * (at_v - corner[v]);
            // A triangle parallel to the line has any depth between its ends; so has NaN.
            let depth = (corner[axis] - slope / normal[axis]).max(depth_min).min(depth_max);
            let cell = libm::floor(depth + 0.5).max(0.0) as usize;
            if cell < size[axis] {
                let mut at = [0; 3];
                (at[axis], at[u], at[v]) = (cell, column, row);
                met((at[2] * size[1] + at[1]) * size[0] + at[0], turn);
            }
        }
    }
    Ok(())
}

/// The cells of a line of `size` whose centres lie from `low` on, and before `high`.
fn centres(low: f64, high: f64, size: usize) -> std::ops::Range<usize> {
    let first = |from: f64| (libm::ceil(from - 0.5).max(0.0) as usize).min(size);
    first(low)..first(high)
}
