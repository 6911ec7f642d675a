//! Meshes of triangles: cells whose centres are inside, or cells that the surface touches.
//!
//! **Inside** is where the mesh winds around a centre at least half a time, so that solids that
//! overlap, that intersect themselves or that have a narrow opening come out as their union. Lines
//! along the three axes count the turns ([`crossings`]); where less than two of them come through
//! no hole, or they differ, the generalised winding number decides ([`winding`]). Before, two-sided
//! surfaces lose one side ([`doubled`]), and triangles are turned to face outwards together
//! ([`orientation`]), body by body ([`bodies`]).
//!
//! **Ties.** Centres on a face count as if all of them were moved a little the same way
//! ([`crossings`]); so a mesh that is made of cells comes back as these cells, wherever they lie.
//!
//! **Surface.** A triangle touches a cell if a part of it with an area lies in the cell, the lower
//! faces of which belong to it.
//!
//! The work is counted, not timed: a file that needs more steps than allowed is refused.

mod bodies;
mod crossings;
mod doubled;
mod lattice;
mod orientation;
mod patches;
pub(super) mod polygon;
mod touch;
mod valid_triangles;
mod winding;

use voxels::{Terrain, close_shell};

use super::cloud::keep_from;
use super::frame::{Bounds, Frame, Units};
use super::free_space::FreeSpace;
use super::options::{Fill, Kind, Up};
use super::work_budget::WorkBudget;
use super::{FormatError, ImportSpec, Imported, Note};

use orientation::{Opening, Orientation};
use valid_triangles::ValidTriangles;
use winding::Winding;

/// The import options of meshes.
pub(super) const OPTIONS: &[&str] =
    &["fill", "inside", "up", "scale", "margin_cells", "crop", "free_from", "gap_cells", "cells_max", "steps_max"];

/// Corners of a triangle.
type Triangle = [[f64; 3]; 3];

/// Largest number of triangles of a mesh; each takes about 200 bytes while it is read.
pub(super) const TRIANGLES_MAX: usize = 1 << 22;

/// What surfaces between solids that touch do, as meshes of several volumes have them.
const INTERFACES: &str = "as where solids touch and share a surface: what is inside cannot be told; export the union \
                          of the solids (fuse, instead of fragments)";

/// Most openings that a report names.
const OPENINGS_SHOWN: usize = 3;

/// Most parts that an error names, and most characters of a name.
const PARTS_SHOWN: usize = 8;
const NAME_SHOWN: usize = 40;

/// Distance of a winding number from one half within which the lines decide.
const UNDECIDED: f64 = 1e-6;

/// How many times shorter than the others the side along an axis is that probably is upwards.
const FLAT: f64 = 2.0;

/// What to say if all free space lies around a mesh.
const AROUND: &str = "the inside of the mesh is wall, and what is free lies around it; map.import.inside = \"free\" \
                      (--inside free) makes a cave of it, \"wall\" says that this is meant";

/// Where winding numbers are taken: this far from a centre along x, y and z, in lengths of cells,
/// as a small picture of the step that decides ties.
const STEP: [f64; 3] = [1.0 / (1 << 10) as f64, 1.0 / (1 << 15) as f64, 1.0 / (1 << 20) as f64];

/// Vertices, and triangles of the numbers of three of them.
#[derive(Clone, Default)]
pub(super) struct Mesh {
    pub(super) vertices: Vec<[f64; 3]>,
    pub(super) triangles: Vec<[u32; 3]>,
    /// Parts that have a name, with the number of their first triangle, in this order.
    pub(super) parts: Vec<(String, usize)>,
}

fn shorten(name: &str) -> String {
    name.chars().take(NAME_SHOWN).collect()
}

impl Mesh {
    /// Adds a triangle with vertices of its own.
    pub(super) fn add(&mut self, corners: Triangle) {
        let first = self.vertices.len() as u32;
        self.vertices.extend(corners);
        self.triangles.push([first, first + 1, first + 2]);
    }

    /// Begins a part, which goes up to the next one.
    pub(super) fn begin_part(&mut self, name: &str) {
        let first = self.triangles.len();
        if self.parts.last().is_some_and(|(_, last)| *last == first) {
            self.parts.pop();
        }
        if self.parts.last().is_none_or(|(last, _)| last != name) {
            self.parts.push((name.to_owned(), first));
        }
    }

    /// All parts with a name as one mesh.
    ///
    /// # Errors
    /// The names that there are, if none is this one.
    pub(super) fn part(&self, name: &str) -> Result<Self, String> {
        let ends = self.parts.iter().skip(1).map(|&(_, first)| first).chain([self.triangles.len()]);
        let mut part = Self::default();
        for ((_, first), end) in self.parts.iter().zip(ends).filter(|((other, _), _)| other == name) {
            for triangle in &self.triangles[*first..end] {
                part.add(triangle.map(|corner| self.vertices[corner as usize]));
            }
        }
        if !part.triangles.is_empty() {
            return Ok(part);
        }
        let mut names: Vec<String> = self.parts.iter().map(|(name, _)| format!("{:?}", shorten(name))).collect();
        names.sort();
        names.dedup();
        let more = if names.len() > PARTS_SHOWN { ", ..." } else { "" };
        names.truncate(PARTS_SHOWN);
        Err(if names.is_empty() {
            "it names no parts".to_owned()
        } else {
            format!("it has {}{more}", names.join(", "))
        })
    }

    /// Moves the middle of the box around all triangles to the origin.
    pub(super) fn centre(&mut self) {
        let corners = self.triangles.iter().flatten().map(|&corner| self.vertices[corner as usize]);
        let Some(Bounds { low, high }) = Bounds::of(corners) else { return };
        for place in &mut self.vertices {
            *place = [0, 1, 2].map(|axis| place[axis] - (low[axis] + high[axis]) / 2.0);
        }
    }

    /// Checks that there is room for more triangles.
    ///
    /// # Errors
    /// If the mesh has too many.
    pub(super) fn check_count(&self) -> Result<(), FormatError> {
        let count = self.triangles.len();
        let allowed = FormatError::TooManyTriangles { triangles_max: TRIANGLES_MAX };
        if count > TRIANGLES_MAX { Err(allowed) } else { Ok(()) }
    }

    /// Adds a polygon of the numbers of its corners, whose vertices are there.
    pub(super) fn add_polygon(&mut self, corners: &[u32]) {
        if let [a, b, c] = *corners {
            self.triangles.push([a, b, c]);
        } else {
            let cut = self.cut(corners);
            self.triangles.extend(cut);
        }
    }

    /// The triangles of a polygon, two less than it has corners, of which some may have no area.
    pub(super) fn cut(&self, corners: &[u32]) -> Vec<[u32; 3]> {
        if let [a, b, c] = *corners {
            return vec![[a, b, c]];
        }
        let places: Vec<[f64; 3]> = corners.iter().map(|&corner| self.vertices[corner as usize]).collect();
        let Some(cut) = polygon::triangles(&places, &[]) else {
            return corners[1..].windows(2).map(|edge| [corners[0], edge[0], edge[1]]).collect();
        };
        let mut cut: Vec<[u32; 3]> =
            cut.into_iter().map(|triangle| triangle.map(|place| corners[place as usize])).collect();
        cut.resize(corners.len() - 2, [corners[0]; 3]);
        cut
    }

    /// Adds a strip of triangles between three vertices in a row each, of which every other one
    /// goes round the other way.
    pub(super) fn add_strip(&mut self, corners: &[u32]) {
        for (number, triangle) in corners.windows(3).enumerate() {
            let [a, b, c] = [triangle[0], triangle[1], triangle[2]];
            self.triangles.push(if number % 2 == 0 { [a, b, c] } else { [b, a, c] });
        }
    }

    /// The lengths of the sides of the box around all vertices, in units of the file.
    fn spans(&self) -> [f64; 3] {
        let is_finite = |place: &[f64; 3]| place.iter().all(|along| along.is_finite());
        let bounds = Bounds::of(self.vertices.iter().copied().filter(is_finite));
        bounds.map_or([0.0; 3], |Bounds { low, high }| [0, 1, 2].map(|axis| high[axis] - low[axis]))
    }

    /// What to say beside the axis that is taken for upwards, if another one probably is: halls and
    /// caves are seldom highest.
    pub(super) fn advice_on_up(&self, up: Up) -> &'static str {
        let [x, y, z] = self.spans();
        match up {
            Up::Z if FLAT * y <= x.min(z) => "; y is by far the shortest side: y, if the file has it upwards",
            Up::Y if FLAT * z <= x.min(y) => "; z is by far the shortest side: z, if the file has it upwards",
            _ => "",
        }
    }
}

/// A map of a mesh. `notes` are those of its reader.
///
/// # Errors
/// If it has no triangle, or too many, too many cells, or takes too much work.
pub(super) fn map(spec: &ImportSpec, mesh: Mesh, notes: Vec<Note>) -> Result<Imported, FormatError> {
    let advice = mesh.advice_on_up(Up::Z);
    map_up(spec, mesh, (Up::Z, &format!("as the format leaves it open{advice}")), notes)
}

/// As [`map`], with the axis that points upwards unless the option says otherwise, and why.
///
/// # Errors
/// See [`map`].
pub(super) fn map_up(
    spec: &ImportSpec,
    mesh: Mesh,
    (up, reason): (Up, &str),
    mut notes: Vec<Note>,
) -> Result<Imported, FormatError> {
    mesh.check_count()?;
    let (up, reason) = match spec.options.up {
        Some(up) => (up, "by the option up".to_owned()),
        None if spec.options_of_format().contains(&"up") => (up, format!("{reason}; the option up changes that")),
        None => (up, reason.to_owned()),
    };
    notes.push(Note::new("up", format!("{}, {reason}", if up == Up::Z { "z" } else { "y" })));
    let units = Units::new(spec)?.with_up(up);
    let fill = spec.options.fill.unwrap_or(Fill::Solid);
    let inside = spec.options.inside.unwrap_or(Kind::Wall);
    let count = mesh.triangles.len();
    let mut valid = ValidTriangles::of(mesh, units);
    let nothing = || FormatError::Nothing("triangle");
    let bounds = valid.bounds().ok_or_else(nothing)?;
    // The lattice is too coarse for what is far smaller than a cell.
    units.check_span(spec, bounds)?;
    valid.put_on_lattice(bounds);
    let bounds = valid.bounds().ok_or_else(nothing)?;
    let mut frame = Frame::around(units, bounds, fill == Fill::Shell)?;
    let (outside, others) = match inside {
        Kind::Wall => (Terrain::Free, Terrain::Wall),
        Kind::Free => (Terrain::Wall, Terrain::Free),
    };
    let mut terrain = frame.grid(outside, spec)?;
    valid.put_into(&frame);
    let mut triangles: Vec<Triangle> = valid.triangles().collect();
    let (places, mut vertices) = valid.into_parts();
    let dropped = count - triangles.len();
    let mut work = WorkBudget::new(spec);
    let mut corners = orientation::corners(&places, &vertices, &mut work)?;
    drop(places);
    let doubled = doubled::drop_backs(&mut triangles, &mut vertices, &mut corners);
    let Orientation { turned, parts, openings, rims } =
        orientation::orient(&mut triangles, corners, &vertices, &mut work)?;
    let text =
        format!("{count} triangles in {parts} part(s), {dropped} dropped because they have no area or are not finite");
    let mut notes: Vec<Note> = std::iter::once(Note::new("mesh", text)).chain(notes).collect();
    notes.push(Note::new("spans", units.span(bounds)));
    if doubled > 0 {
        notes
            .push(Note::new("doubled", format!("{doubled} triangles that stand back to back with others are dropped")));
    }
    if turned > 0 {
        notes.push(Note::new("turned", format!("{turned} triangles that did not face outwards with the others")));
    }
    if fill == Fill::Solid || inside == Kind::Free {
        let extent = terrain.extent();
        let votes = crossings::votes(extent, &triangles, spec, &mut work)?;
        let mut winding = None;
        let (mut filled, mut decided) = (0u64, 0u64);
        for index in 0..extent.volume() {
            let is_inside = if let Some(is_inside) = votes.is_inside(index) {
                is_inside
            } else {
                decided += 1;
                let cell = extent.cell_at(index);
                let at = [cell.x, cell.y, cell.z];
                let point = [0, 1, 2].map(|axis| f64::from(at[axis]) + 0.5 + STEP[axis]);
                let turns = winding.get_or_insert_with(|| Winding::new(&triangles)).at(point, &mut work)?.abs();
                if (turns - 0.5).abs() < UNDECIDED { votes.majority(index) } else { turns > 0.5 }
            };
            if is_inside {
                filled += 1;
                terrain.as_mut_slice()[index] = others;
            }
        }
        let kind = if inside == Kind::Wall { "wall" } else { "free" };
        let text = format!("solid: {filled} cells inside become {kind}, {decided} cells decided by winding number");
        notes.push(Note::new("fill", text));
        notes.extend(note_of_openings(Some(votes.holes), &openings, &frame));
        if rims > 0 {
            let text = format!("three faces or more meet at {rims} edges, {INTERFACES}");
            notes.push(Note::warning("interfaces", text));
        }
    } else {
        notes.extend(note_of_openings(None, &openings, &frame));
    }
    if fill == Fill::Shell {
        let mut touched = 0u64;
        for triangle in &triangles {
            touch::touch(triangle, &mut work, |cell| {
                touched += u64::from(terrain.set(cell, Terrain::Wall) == Some(Terrain::Free));
            })?;
        }
        notes.push(Note::new("fill", format!("shell: {touched} free cells that the surface touches become wall")));
    }
    close_shell(&mut terrain, 1);
    let free = mapgen::free_cells(&terrain);
    if free == 1 || inside == Kind::Free {
        units.check_free(spec, bounds, free)?;
    }
    let free_space = FreeSpace::of(&terrain);
    if spec.options.inside.is_none() && free_space.is_all_around() {
        notes.push(Note::warning("inside", AROUND));
    }
    // Of a shell, walls are hollow.
    if fill == Fill::Solid {
        notes.extend(free_space.warning(&spec.options));
    }
    let (mut terrain, cropped) = frame.cropped(terrain, spec)?;
    notes.extend(cropped);
    notes.push(frame.note());
    notes.extend(keep_from(&mut terrain, &spec.options, |place| frame.cell_of_place(place))?);
    Ok(Imported { terrain, notes, stores_cell_m: false, origin_m: Some(frame.origin_m()), yaw_rad: 0.0 })
}

/// A note on faces that a reader left out.
pub(super) fn note_of_skipped(faces: u64) -> Option<Note> {
    (faces > 0).then(|| Note::new("skipped", format!("{faces} faces of less than 3 corners")))
}

/// What is open. `holes` are the lines along each axis that come through holes, if lines decide
/// what is inside.
fn note_of_openings(holes: Option<[usize; 3]>, openings: &[Opening], frame: &Frame) -> Option<Note> {
    if holes.unwrap_or_default() == [0; 3] && openings.is_empty() {
        return None;
    }
    let mut text = "the mesh is not closed".to_owned();
    if let Some([x, y, z]) = holes {
        text += &format!(": {x}, {y} and {z} lines along x, y and z come through holes and have no vote");
    }
    let shown = openings.len().min(OPENINGS_SHOWN);
    if shown > 0 {
        let places: Vec<String> = openings[..shown].iter().map(|one| frame.opening(one.centre, one.area)).collect();
        let more = if shown < openings.len() {
            format!(", and {} smaller ones", openings.len() - shown)
        } else {
            String::new()
        };
        text += &format!("; {} opening(s): {}{more}", openings.len(), places.join(", "));
    }
    Some(Note::new("holes", text))
}

/// The area of a triangle.
fn area(triangle: &Triangle) -> f64 {
    libm::sqrt(normal(triangle).iter().map(|along| along * along).sum()) / 2.0
}

/// The normal of a triangle, with twice its area as length.
fn normal([a, b, c]: &Triangle) -> [f64; 3] {
    let to = |corner: &[f64; 3]| [0, 1, 2].map(|along| corner[along] - a[along]);
    let (b, c) = (to(b), to(c));
    [b[1] * c[2] - b[2] * c[1], b[2] * c[0] - b[0] * c[2], b[0] * c[1] - b[1] * c[0]]
}

#[cfg(test)]
mod tests;
