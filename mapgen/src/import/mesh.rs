//! Meshes of triangles: cells whose centres are inside, or cells that the surface touches.
//!
//! **Inside.** A line through a cell's centre along an axis enters and leaves a closed mesh by
//! turns, so the centre is inside if the line has met the mesh an odd number of times. Two of the
//! three axes decide. A line that has met it an odd number of times at its end has come through a
//! hole; its vote is void. **Surface.** A triangle touches a cell if a part of it lies in the cell,
//! the lower faces of which belong to it.
//!
//! The orientation of triangles is irrelevant. Two triangles that share an edge are intersected
//! with the same arithmetic along it, so no line passes between them.

use voxels::{Cell, Extent, Grid, Terrain, close_shell};

use super::cloud::keep_from;
use super::frame::{Bounds, Frame, Units};
use super::options::{Fill, Kind};
use super::{FormatError, ImportSpec, Imported, Note, new_grid};

/// Corners of a triangle.
type Triangle = [[f64; 3]; 3];

/// Votes of axes in a cell, and the mark that the mesh is crossed below the centre of a cell.
const VOTES: u8 = 0x03;
const CROSSED: u8 = 0x80;

/// Vertices, and triangles of the numbers of three of them.
#[derive(Default)]
pub(super) struct Mesh {
    pub(super) vertices: Vec<[f64; 3]>,
    pub(super) triangles: Vec<[u32; 3]>,
}

impl Mesh {
    /// Adds a triangle with vertices of its own.
    pub(super) fn add(&mut self, corners: Triangle) {
        let first = self.vertices.len() as u32;
        self.vertices.extend(corners);
        self.triangles.push([first, first + 1, first + 2]);
    }

    /// The triangles that have an area, in lengths of cells.
    fn sound(&self, units: Units) -> impl Iterator<Item = Triangle> {
        let in_cells = move |triangle: &[u32; 3]| triangle.map(|vertex| units.cells(self.vertices[vertex as usize]));
        self.triangles.iter().map(in_cells).filter(|corners| {
            let normal = normal(corners);
            corners.iter().flatten().all(|along| along.is_finite())
                && normal.iter().all(|along| along.is_finite())
                && normal != [0.0; 3]
        })
    }
}

/// A map of a mesh.
///
/// # Errors
/// If it has no triangle, or too many cells.
pub(super) fn map(spec: &ImportSpec, mesh: &Mesh) -> Result<Imported, FormatError> {
    let units = Units::new(spec)?;
    let fill = spec.options.fill.unwrap_or(Fill::Solid);
    let inside = spec.options.inside.unwrap_or(Kind::Wall);
    let bounds = Bounds::of(mesh.sound(units).flatten()).ok_or(FormatError::Nothing("triangle"))?;
    let frame = Frame::around(units, bounds, fill == Fill::Shell)?;
    let (outside, others) = match inside {
        Kind::Wall => (Terrain::Free, Terrain::Wall),
        Kind::Free => (Terrain::Wall, Terrain::Free),
    };
    let mut terrain = frame.grid(outside, spec)?;
    let triangles = || mesh.sound(units).map(|corners| corners.map(|corner| frame.in_map(corner)));
    let dropped = mesh.triangles.len() - triangles().count();
    let text =
        format!("{} triangles, {dropped} dropped because they have no area or are not finite", mesh.triangles.len());
    let mut notes = vec![Note::new("mesh", text)];
    if fill == Fill::Solid || inside == Kind::Free {
        let (votes, holes) = votes(terrain.extent(), triangles, spec.cells_max)?;
        for (cell, &votes) in terrain.as_mut_slice().iter_mut().zip(votes.as_slice()) {
            if votes & VOTES >= 2 {
                *cell = others;
            }
        }
        notes.extend(note_of_holes(holes));
    }
    if fill == Fill::Shell {
        for triangle in triangles() {
            touch(&triangle, |cell| {
                terrain.set(cell, Terrain::Wall);
            });
        }
    }
    close_shell(&mut terrain, 1);
    notes.push(frame.note());
    notes.extend(keep_from(&mut terrain, spec.options.free_from, |place| frame.cell_of_place(place))?);
    Ok(Imported { terrain, notes, stores_cell_m: false })
}

fn note_of_holes(holes: [usize; 3]) -> Option<Note> {
    let [x, y, z] = holes;
    let text = format!(
        "the mesh is not closed: {x}, {y} and {z} lines along x, y and z come through holes and were not counted"
    );
    (holes != [0; 3]).then(|| Note::new("holes", text))
}

/// How many axes find each cell inside, and how many lines along each axis come through a hole.
fn votes<T: Iterator<Item = Triangle>>(
    extent: Extent,
    triangles: impl Fn() -> T,
    cells_max: usize,
) -> Result<(Grid<u8>, [usize; 3]), FormatError> {
    let mut votes = new_grid(extent, 0u8, cells_max)?;
    let size = extent.size().map(|cells| cells as usize);
    let stride = [1, size[0], size[0] * size[1]];
    let mut holes = [0; 3];
    for axis in 0..3 {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let cells = votes.as_mut_slice();
        for triangle in triangles() {
            cross(&triangle, axis, size, |index| cells[index] ^= CROSSED);
        }
        for column in 0..size[u] * size[v] {
            let first = column % size[u] * stride[u] + column / size[u] * stride[v];
            let line = || (0..size[axis]).map(|at| first + at * stride[axis]);
            let is_hole = line().filter(|&index| cells[index] & CROSSED != 0).count() % 2 == 1;
            holes[axis] += usize::from(is_hole);
            let mut is_inside = false;
            for index in line() {
                is_inside ^= cells[index] & CROSSED != 0;
                cells[index] = (cells[index] & VOTES) + u8::from(is_inside && !is_hole);
            }
        }
    }
    Ok((votes, holes))
}

/// Visits the index of each cell before whose centre a line along `axis` through it meets the
/// triangle, and after the centre before.
fn cross(triangle: &Triangle, axis: usize, size: [usize; 3], mut met: impl FnMut(usize)) {
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
        let mut ends = [0.0; 3];
        let mut count = 0;
        for edge in [[0, 1], [1, 2], [2, 0]] {
            let [mut a, mut b] = edge.map(|corner| triangle[corner]);
            if a[v] > b[v] {
                (a, b) = (b, a);
            }
            if a[v] <= at_v && at_v < b[v] {
                ends[count] = a[u] + (at_v - a[v]) * (b[u] - a[u]) / (b[v] - a[v]);
                count += 1;
            }
        }
        if count != 2 {
            continue;
        }
        for column in centres(ends[0].min(ends[1]), ends[0].max(ends[1]), size[u]) {
            let at_u = column as f64 + 0.5;
            let slope = normal[u] * (at_u - corner[u]) + normal[v] * (at_v - corner[v]);
            // A triangle parallel to the line has any depth between its ends; so has NaN.
            let depth = (corner[axis] - slope / normal[axis]).max(depth_min).min(depth_max);
            let cell = libm::floor(depth + 0.5).max(0.0) as usize;
            if cell < size[axis] {
                let mut at = [0; 3];
                (at[axis], at[u], at[v]) = (cell, column, row);
                met((at[2] * size[1] + at[1]) * size[0] + at[0]);
            }
        }
    }
}

/// The cells of a line of `size` whose centres lie from `low` on, and before `high`.
fn centres(low: f64, high: f64, size: usize) -> std::ops::Range<usize> {
    let first = |from: f64| (libm::ceil(from - 0.5).max(0.0) as usize).min(size);
    first(low)..first(high)
}

/// Visits each cell that a triangle touches.
fn touch(triangle: &Triangle, mut touched: impl FnMut(Cell)) {
    for x in cells(triangle, 0) {
        let slab = clipped(triangle, 0, x);
        for y in cells(&slab, 1) {
            let column = clipped(&slab, 1, y);
            for z in cells(&column, 2) {
                touched(Cell::new(x, y, z));
            }
        }
    }
}

/// The cells along an axis in which a polygon lies; one in a plane between two cells lies in the
/// upper one.
fn cells(polygon: &[[f64; 3]], axis: usize) -> std::ops::RangeInclusive<i32> {
    let Some(Bounds { low, high }) = Bounds::of(polygon.iter().copied()) else {
        return std::ops::RangeInclusive::new(1, 0);
    };
    let first = libm::floor(low[axis]);
    first as i32..=first.max(libm::ceil(high[axis]) - 1.0) as i32
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

/// The normal of a triangle, with twice its area as length.
fn normal([a, b, c]: &Triangle) -> [f64; 3] {
    let to = |corner: &[f64; 3]| [0, 1, 2].map(|along| corner[along] - a[along]);
    let (b, c) = (to(b), to(c));
    [b[1] * c[2] - b[2] * c[1], b[2] * c[0] - b[0] * c[2], b[0] * c[1] - b[1] * c[0]]
}

#[cfg(test)]
mod tests;
