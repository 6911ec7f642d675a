//! Meshes of COLLADA 1.4 and 1.5 (`.dae`): the geometries that the nodes of its scene place.
//!
//! Triangles, polygons without holes, strips and fans are read, the transforms of nodes, nodes in
//! other nodes, and skins as they stand before any motion. Lengths are in metres by `unit`. The
//! axis `up_axis` counts, save in files of writers that name one whatever their coordinates
//! ([`AS_GIVEN`]).
//!
//! Looked at: the crate dae-parser (0.11) reads whole documents and refuses one for any element
//! that it does not know, and knows no bounds; roxmltree (0.21), a parser of XML without entities
//! of its own, with a bound on nodes, is what this reader is built on. Gazebo's own reader is
//! `ColladaLoader` of gz-common.

mod scene;

use std::collections::BTreeMap;
use std::ops::Range;

use nalgebra::Matrix4;
use roxmltree::Node;

use super::mesh::{self, Mesh};
use super::options::Up;
use super::{FormatError, ImportSpec, Imported, MapReader, Note, gltf, xml};
use scene::Scene;

/// A scene of COLLADA.
pub(super) const READER: MapReader = MapReader::new("scene of COLLADA", &["dae"], mesh::OPTIONS, read);

/// Writers, by a part of `authoring_tool`, that name the axis y whatever the axes of what they
/// write: assimp (5.2) and MeshLab (pymeshlab 2025.7), as files of theirs made from one with z
/// upwards show.
const AS_GIVEN: [&str; 3] = [ASSIMP, "MeshLab", "VCGLib"];

/// How assimp names itself.
const ASSIMP: &str = "Assimp";

/// Largest number of floats, and of indices, of a list.
const NUMBERS_MAX: usize = 1 << 26;

/// A map of a COLLADA file.
///
/// # Errors
/// If the file is malformed, or its meshes do not fit into a map.
pub(super) fn read(spec: &ImportSpec) -> Result<Imported, FormatError> {
    let mut model = Model::read(&spec.bytes)?;
    if model.is_x_up {
        for place in &mut model.mesh.vertices {
            let [x, y, z] = *place;
            *place = [-y, -z, x];
        }
    }
    let reason = model.reason + model.mesh.advice_on_up(model.up);
    mesh::map_up(spec, model.mesh, (model.up, &reason), model.notes)
}

/// The meshes of a file, in metres, with the axis upwards that it is written with.
///
/// Gazebo heeds its unit and no axis.
pub(super) struct Model {
    pub(super) mesh: Mesh,
    up: Up,
    /// Whether x points upwards until it becomes z.
    is_x_up: bool,
    /// Why this axis.
    reason: String,
    notes: Vec<Note>,
}

impl Model {
    /// The meshes of a file.
    ///
    /// # Errors
    /// If it is malformed, or too large.
    pub(super) fn read(bytes: &[u8]) -> Result<Self, FormatError> {
        let text = xml::text(bytes)?;
        let document = xml::parse(text)?;
        let root = document.root_element();
        if root.tag_name().name() != "COLLADA" {
            return Err(xml::fault(root, "the file begins with another element, expected COLLADA"));
        }
        let asset = xml::child(root, "asset");
        let unit = asset.and_then(|asset| xml::child(asset, "unit")).and_then(|unit| unit.attribute("meter"));
        let metres = unit.map_or(Ok(1.0), |metres| metres.trim().parse::<f64>());
        let metres = metres.ok().filter(|metres| metres.is_finite() && *metres > 0.0);
        let metres = metres.ok_or_else(|| xml::fault(root, "asset.unit.meter is no length above 0"))?;
        let scene = Scene::of(root);
        let mut mesh = Mesh::default();
        let mut skipped = Skipped::default();
        let mut shapes: BTreeMap<&str, Mesh> = BTreeMap::new();
        let mut placed = 0u64;
        for (geometry, matrix, name) in scene.instances()? {
            let id = geometry.attribute("id").unwrap_or_default();
            if !shapes.contains_key(id) {
                shapes.insert(id, shape(geometry, &mut skipped)?);
            }
            mesh.begin_part(name);
            mesh.add_placed(&shapes[id], &(Matrix4::new_scaling(metres) * matrix))?;
            placed += 1;
        }
        let mut notes =
            vec![Note::new("scene", format!("{placed} mesh(es) put into it, which come out as their union"))];
        if metres != 1.0 {
            notes.push(Note::new("unit", format!("{metres} m, as the file says")));
        }
        notes.extend(skipped.note());
        let contributor = asset.and_then(|asset| xml::child(asset, "contributor"));
        let said_of = |name| {
            let said = contributor.and_then(|contributor| xml::child(contributor, name));
            said.and_then(|said| said.text()).unwrap_or_default()
        };
        let tool = said_of("authoring_tool");
        let axis = asset.and_then(|asset| xml::child(asset, "up_axis")).and_then(|axis| axis.text()).map(str::trim);
        // assimp names itself as the author, and as the tool the one that wrote what it converts.
        let of_assimp = said_of("author").contains(ASSIMP).then(|| gltf::writer_as_given(tool)).flatten();
        let writer = AS_GIVEN.into_iter().find(|&writer| tool.contains(writer)).or(of_assimp);
        // pycollada names no tool and no unit, and y unless its user says otherwise.
        let is_pycollada = asset.is_some_and(|asset| xml::child(asset, "contributor").is_none()) && unit.is_none();
        let (up, reason) = match (axis, writer) {
            (Some("Z_UP"), _) => (Up::Z, "as up_axis says".to_owned()),
            (Some("X_UP"), _) => (Up::Z, "after x, which up_axis names, has become z".to_owned()),
            (_, Some(writer)) => (Up::Z, format!("as {writer} writes it, whatever it says in up_axis")),
            _ if is_pycollada => (Up::Z, "as trimesh and pycollada write it, whatever they say in up_axis".to_owned()),
            (Some("Y_UP"), _) => (Up::Y, "as up_axis says".to_owned()),
            (None, _) => (Up::Y, "as COLLADA has it".to_owned()),
            (Some(_), _) => return Err(xml::fault(root, "up_axis is none of X_UP, Y_UP and Z_UP")),
        };
        Ok(Self { mesh, up, is_x_up: axis == Some("X_UP"), reason, notes })
    }
}

/// What a file has that is no surface.
#[derive(Default)]
struct Skipped {
    lines: u64,
    faces: u64,
    other: u64,
}

impl Skipped {
    fn note(&self) -> Option<Note> {
        let Self { lines, faces, other } = self;
        let named =
            [(lines, "lists of lines"), (faces, "faces of less than 3 corners"), (other, "shapes that are no meshes")];
        let parts: Vec<String> =
            named.iter().filter(|(count, _)| **count > 0).map(|(count, name)| format!("{count} {name}")).collect();
        (!parts.is_empty()).then(|| Note::new("skipped", parts.join(", ")))
    }
}

/// The mesh of a geometry, in its own coordinates.
fn shape(geometry: Node<'_, '_>, skipped: &mut Skipped) -> Result<Mesh, FormatError> {
    let mut shape = Mesh::default();
    let Some(mesh) = xml::child(geometry, "mesh") else {
        skipped.other += 1;
        return Ok(shape);
    };
    let mut parts = Parts::of(mesh);
    for list in mesh.children().filter(Node::is_element) {
        match list.tag_name().name() {
            "triangles" | "polylist" | "polygons" | "tristrips" | "trifans" => {
                add(list, &mut parts, &mut shape, skipped)?
            }
            "lines" | "linestrips" => skipped.lines += 1,
            _ => {}
        }
    }
    Ok(shape)
}

/// What the lists of a mesh refer to.
struct Parts<'a, 'i> {
    /// The elements `vertices` and `source`, by their ids.
    vertices: BTreeMap<&'a str, Node<'a, 'i>>,
    sources: BTreeMap<&'a str, Node<'a, 'i>>,
    /// The vertices of the shape that are the positions of a source, which several lists may have.
    positions: BTreeMap<&'a str, Range<u32>>,
}

impl<'a, 'i> Parts<'a, 'i> {
    fn of(mesh: Node<'a, 'i>) -> Self {
        let by_id = |name| {
            let mut by_id = BTreeMap::new();
            for child in xml::children(mesh, name) {
                by_id.entry(child.attribute("id").unwrap_or_default()).or_insert(child);
            }
            by_id
        };
        Self { vertices: by_id("vertices"), sources: by_id("source"), positions: BTreeMap::new() }
    }

    /// The positions that an input VERTEX names, as vertices of a shape; `None` if there are none.
    fn positions(&mut self, vertex: Node<'a, 'i>, shape: &mut Mesh) -> Result<Option<Range<u32>>, FormatError> {
        let id = |reference: Option<&'a str>| reference?.strip_prefix('#');
        let vertices = id(vertex.attribute("source")).and_then(|id| self.vertices.get(id));
        let position = vertices.and_then(|vertices| {
            xml::children(*vertices, "input").find(|input| input.attribute("semantic") == Some("POSITION"))
        });
        let Some(id) = position.and_then(|position| id(position.attribute("source"))) else { return Ok(None) };
        let Some(&source) = self.sources.get(id) else { return Ok(None) };
        if let Some(known) = self.positions.get(id) {
            return Ok(Some(known.clone()));
        }
        let first = shape.vertices.len() as u32;
        shape.vertices.extend(positions(source)?);
        let added = first..shape.vertices.len() as u32;
        self.positions.insert(id, added.clone());
        Ok(Some(added))
    }
}

/// Adds the faces of a list, which has the positions of its mesh.
fn add<'a, 'i>(
    list: Node<'a, 'i>,
    parts: &mut Parts<'a, 'i>,
    shape: &mut Mesh,
    skipped: &mut Skipped,
) -> Result<(), FormatError> {
    let inputs: Vec<Node<'_, '_>> = xml::children(list, "input").collect();
    let offset =
        |input: &Node<'_, '_>| input.attribute("offset").and_then(|offset| offset.trim().parse::<usize>().ok());
    let stride = 1 + inputs.iter().filter_map(offset).max().unwrap_or(0);
    let vertex = inputs.iter().find(|input| input.attribute("semantic") == Some("VERTEX"));
    let vertex = vertex.ok_or_else(|| xml::fault(list, "it has no input VERTEX"))?;
    let at = offset(vertex).unwrap_or(0);
    let Range { start: first, end } = parts
        .positions(*vertex, shape)?
        .ok_or_else(|| xml::fault(list, "the positions of its vertices are not in the mesh"))?;
    let count = (end - first) as usize;
    let corners = |indices: Node<'_, '_>| -> Result<Vec<u32>, FormatError> {
        let numbers = xml::numbers::<u32>(indices, NUMBERS_MAX)?;
        let corner = |piece: &[u32]| {
            let number = piece.get(at).copied().filter(|&number| (number as usize) < count);
            let reason = || xml::fault(indices, format_args!("a corner is none of the {count} positions"));
            Ok(first + number.ok_or_else(reason)?)
        };
        numbers.chunks(stride).map(corner).collect()
    };
    let mut face = |corners: &[u32], shape: &mut Mesh| {
        if corners.len() < 3 {
            skipped.faces += 1;
        } else {
            shape.add_polygon(corners);
        }
        shape.check_count()
    };
    let kind = list.tag_name().name();
    if kind == "polygons" && xml::child(list, "ph").is_some() {
        return Err(xml::fault(list, "polygons with holes are not read; save the mesh as triangles"));
    }
    let lengths = xml::child(list, "vcount").map(|lengths| xml::numbers::<usize>(lengths, NUMBERS_MAX)).transpose()?;
    for indices in xml::children(list, "p") {
        let corners = corners(indices)?;
        match (kind, &lengths) {
            ("triangles", _) => corners.chunks(3).try_for_each(|corners| face(corners, shape))?,
            ("polylist", Some(lengths)) => {
                let mut rest = corners.as_slice();
                for &length in lengths {
                    let (polygon, others) = rest
                        .split_at_checked(length)
                        .ok_or_else(|| xml::fault(indices, "it has less corners than vcount says"))?;
                    face(polygon, shape)?;
                    rest = others;
                }
            }
            ("polylist", None) => return Err(xml::fault(list, "it has no vcount")),
            ("tristrips", _) => {
                shape.add_strip(&corners);
                shape.check_count()?;
            }
            // The triangles of a fan are those of a polygon.
            _ => face(&corners, shape)?,
        }
    }
    Ok(())
}

/// The positions of a source.
fn positions(source: Node<'_, '_>) -> Result<Vec<[f64; 3]>, FormatError> {
    let floats = xml::child(source, "float_array").ok_or_else(|| xml::fault(source, "it has no float_array"))?;
    let numbers = xml::numbers::<f64>(floats, NUMBERS_MAX)?;
    let accessor = xml::child(source, "technique_common").and_then(|common| xml::child(common, "accessor"));
    let number = |name: &str| accessor.and_then(|accessor| accessor.attribute(name)?.trim().parse::<usize>().ok());
    let (stride, offset) = (number("stride").unwrap_or(3), number("offset").unwrap_or(0));
    if !(3..=NUMBERS_MAX).contains(&stride) {
        return Err(xml::fault(source, format_args!("its accessor has stride {stride}, expected 3 or more")));
    }
    let pieces = numbers.get(offset..).unwrap_or_default().chunks_exact(stride);
    Ok(pieces.map(|piece| [piece[0], piece[1], piece[2]]).collect())
}

#[cfg(test)]
mod tests;
