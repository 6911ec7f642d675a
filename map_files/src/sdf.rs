//! Worlds and models of SDF (`.sdf`, `.world`), as Gazebo reads them: models with their links, the
//! models in them, and what they include, placed by their poses.
//!
//! A link is its collision shapes, or its visual ones if it has none. Shapes are primitives, and
//! meshes of COLLADA, OBJ, STL and glTF, which are looked for below the folder of the file and the
//! folders of `model_path`, and nowhere else; the shell loads them
//! ([`super::ImportSpec::missing`]). z points upwards.
//!
//! Looked at: the crate sdformat (0.1, of Open-RMF) derives structs of the schema, reads no poses
//! relative to frames and has not been kept since; so roxmltree parses the XML, and the semantics
//! of poses (`relative_to`, `attached_to`, `placement_frame`, SDF 1.4 to 1.12) are here
//! ([`poses`]). Not read: height maps, road and actors, which are named or counted, and joints,
//! whose positions are those of the file.

mod geometry;
mod poses;
mod primitives;

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::path::{Component, Path, PathBuf};

use nalgebra::{Matrix4, Vector3};
use roxmltree::Node;

use super::frame::Bounds;
use super::mesh::{self, Mesh};
use super::options::Up;
use super::{FormatError, ImportSpec, Imported, MapReader, Note, Search, dae, gltf, obj, stl, xml};
use geometry::{Geometry, Part};
use poses::{Model, Shape};

/// A world or model of Gazebo.
pub(super) const READER: MapReader = MapReader {
    companions: Some(missing),
    search: Search::Models,
    ..MapReader::new(
        "world of Gazebo",
        &["sdf", "world"],
        &["fill", "inside", "margin_cells", "crop", "free_from", "gap_cells", "model_path", "cells_max", "steps_max"],
        read,
    )
};

/// Most models within models and files included by files.
const DEPTH_MAX: usize = 32;

/// Most models of a world, with the shapes of their links.
const PARTS_MAX: usize = 1 << 17;

/// What to do about a file that is not found.
const ELSEWHERE: &str = "is not found below the folder of the world; name the folder in which its model lies by \
                         map.import.model_path (--model-path)";

/// A map of a world.
///
/// # Errors
/// If a file is malformed, missing or has what is not read, or its shapes do not fit into a map.
pub(super) fn read(spec: &ImportSpec) -> Result<Imported, FormatError> {
    let files = Files::new(spec);
    let mut reader = Reader::new(&files);
    let world = reader.root(&spec.bytes, Path::new(""))?;
    let mut whole = Mesh::default();
    let mut shapes = 0u64;
    let mut planes = Vec::new();
    let mut meshes: BTreeMap<(PathBuf, Option<Part>), Mesh> = BTreeMap::new();
    world.place(&mut |shape: &Shape, place: &Matrix4<f64>| {
        shapes += 1;
        match &shape.geometry {
            Geometry::Plane { normal, size } => {
                planes.push((*normal, *size, *place));
                Ok(())
            }
            Geometry::Mesh { file, scale, part } => {
                let whole_file = (file.clone(), None);
                if !meshes.contains_key(&whole_file) {
                    meshes.insert(whole_file.clone(), files.mesh(file)?);
                }
                let key = (file.clone(), part.clone());
                if let Some(Part { name, is_centred }) = part
                    && !meshes.contains_key(&key)
                {
                    let mesh = meshes[&whole_file].part(name);
                    let mesh = mesh.map_err(|names| {
                        fault(file.display(), format_args!("submesh {name:?} is no part of it; {names}"))
                    });
                    let mut mesh = mesh?;
                    if *is_centred {
                        mesh.centre();
                    }
                    meshes.insert(key.clone(), mesh);
                }
                whole.add_placed(&meshes[&key], &(place * Matrix4::new_nonuniform_scaling(&Vector3::from(*scale))))
            }
            other => whole.add_placed(&primitives::mesh(other), place),
        }
    })?;
    let bounds = Bounds::of(whole.vertices.iter().copied());
    let cell_m = spec.length_m();
    for (normal, size, place) in &planes {
        if let Some(slab) = primitives::slab(*normal, *size, place, bounds, cell_m) {
            whole.add_placed(&slab.0, &slab.1)?;
        }
    }
    let mut notes = vec![Note::new(
        "world",
        format!(
            "{} model(s), {shapes} shapes of their links, {} of them planes, {} file(s) of meshes",
            world.models_in(),
            planes.len(),
            meshes.keys().filter(|(_, part)| part.is_none()).count()
        ),
    )];
    notes.extend(reader.notes());
    mesh::map_up(spec, &whole, (Up::Z, "as SDF has it"), notes)
}

/// The files that a world needs and that have not been looked for.
fn missing(spec: &ImportSpec) -> Vec<PathBuf> {
    let files = Files::new(spec);
    if let Ok(world) = Reader::new(&files).root(&spec.bytes, Path::new("")) {
        world.each_shape(&mut |shape| {
            if let Geometry::Mesh { file, .. } = &shape.geometry {
                let _ = files.get(file);
            }
        });
    }
    files.missing.into_inner()
}

/// The files around a world.
struct Files<'a> {
    spec: &'a ImportSpec,
    missing: RefCell<Vec<PathBuf>>,
}

impl<'a> Files<'a> {
    fn new(spec: &'a ImportSpec) -> Self {
        Self { spec, missing: RefCell::new(Vec::new()) }
    }

    /// The content of a file; one that has not been looked for becomes missing.
    fn get(&self, name: &Path) -> Option<&'a [u8]> {
        if !self.spec.companions.contains_key(name) && !self.missing.borrow().iter().any(|missing| missing == name) {
            self.missing.borrow_mut().push(name.to_path_buf());
        }
        self.spec.companion(name)
    }

    /// The mesh of a file, in metres and with z upwards.
    fn mesh(&self, file: &Path) -> Result<Mesh, FormatError> {
        let name = file.display().to_string();
        let inside = |reason: FormatError| fault(&name, reason);
        let bytes = self.get(file).ok_or_else(|| fault(&name, ELSEWHERE))?;
        let extension = file.extension().unwrap_or_default().to_ascii_lowercase();
        let (mut mesh, up) = match extension.to_str() {
            Some("dae") => dae::Model::read(bytes).map(|model| (model.mesh, model.up)).map_err(inside)?,
            // Gazebo takes coordinates of these as they are.
            Some("obj") => (obj::parse(bytes).map_err(inside)?.mesh, Up::Z),
            Some("stl") => (stl::parse(bytes).map_err(inside)?.0, Up::Z),
            Some("glb" | "gltf") => {
                let spec = ImportSpec::new(name.clone(), bytes.to_vec());
                let (mesh, (up, _), _) = gltf::parse(&spec).map_err(inside)?;
                (mesh, up)
            }
            _ => return Err(fault(&name, "meshes of a world are .dae, .obj, .stl, .glb or .gltf; convert it to one")),
        };
        if up == Up::Y {
            for place in &mut mesh.vertices {
                let [x, y, z] = *place;
                *place = [x, -z, y];
            }
        }
        Ok(mesh)
    }
}

/// A fault in a file.
fn fault(place: impl std::fmt::Display, reason: impl std::fmt::Display) -> FormatError {
    FormatError::Entry { place: place.to_string(), reason: reason.to_string() }
}

/// Reads documents into models.
struct Reader<'a> {
    files: &'a Files<'a>,
    /// Models and shapes so far.
    parts: usize,
    depth: usize,
    /// Files that are read, so that a tile that a world includes a hundred times is read once.
    known: BTreeMap<PathBuf, Model>,
    skipped: BTreeMap<&'static str, u64>,
}

impl<'a> Reader<'a> {
    fn new(files: &'a Files<'a>) -> Self {
        Self { files, parts: 0, depth: 0, known: BTreeMap::new(), skipped: BTreeMap::new() }
    }

    /// The world or model of a file whose relative names start from `folder`.
    fn root(&mut self, bytes: &[u8], folder: &Path) -> Result<Model, FormatError> {
        let text = xml::text(bytes)?;
        let document = xml::parse(text)?;
        let root = document.root_element();
        if !matches!(root.tag_name().name(), "sdf" | "gazebo") {
            return Err(xml::fault(root, "the file begins with another element, expected sdf"));
        }
        let of = |name| xml::child(root, name);
        let body = of("world").or_else(|| of("model"));
        let body = body.ok_or_else(|| xml::fault(root, "it has neither a world nor a model"))?;
        self.model(body, folder)
    }

    /// A model, or the world as one.
    fn model(&mut self, element: Node<'_, '_>, folder: &Path) -> Result<Model, FormatError> {
        if self.depth > DEPTH_MAX {
            return Err(xml::fault(element, format_args!("models lie at most {DEPTH_MAX} within each other")));
        }
        self.depth += 1;
        let mut model = Model::of(element)?;
        for child in element.children().filter(Node::is_element) {
            match child.tag_name().name() {
                "model" => model.models.push(self.model(child, folder)?),
                "include" => {
                    let included = self.include(child, folder)?;
                    model.models.extend(included);
                }
                "link" => model.links.push(poses::Link::of(child, folder)?),
                "actor" => *self.skipped.entry("actors").or_default() += 1,
                "population" => *self.skipped.entry("populations").or_default() += 1,
                "road" => *self.skipped.entry("roads").or_default() += 1,
                _ => {}
            }
        }
        self.depth -= 1;
        self.add(element, model.own_parts())?;
        Ok(model)
    }

    /// Counts parts, of which a few bytes may include many.
    fn add(&mut self, element: Node<'_, '_>, parts: usize) -> Result<(), FormatError> {
        self.parts += parts;
        if self.parts > PARTS_MAX {
            return Err(xml::fault(element, format_args!("a world has at most {PARTS_MAX} models and shapes")));
        }
        Ok(())
    }

    /// What an element includes; `None` if its file has not been loaded yet.
    fn include(&mut self, element: Node<'_, '_>, folder: &Path) -> Result<Option<Model>, FormatError> {
        let uri = xml::child(element, "uri").and_then(|uri| uri.text()).map(str::trim).unwrap_or_default();
        let named = |reason: &str| xml::fault(element, format_args!("uri {uri:?} {reason}"));
        let place = path_of(uri, folder).map_err(|reason| named(&reason))?;
        let is_file = place.extension().is_some_and(|extension| extension == "sdf" || extension == "world");
        let file = if is_file {
            place.clone()
        } else {
            let config = place.join("model.config");
            match self.files.get(&config) {
                Some(bytes) => place.join(file_of_config(bytes).map_err(|error| fault(config.display(), error))?),
                None if !self.files.spec.companions.contains_key(&config) => return Ok(None),
                None => place.join("model.sdf"),
            }
        };
        let mut model = if let Some(known) = self.known.get(&file).map(|known| known.parts()) {
            self.add(element, known)?;
            self.known[&file].clone()
        } else {
            let Some(bytes) = self.files.get(&file) else {
                let is_looked_for = self.files.spec.companions.contains_key(&file);
                return if is_looked_for { Err(named(ELSEWHERE)) } else { Ok(None) };
            };
            if self.depth > DEPTH_MAX {
                return Err(named("lies deeper than files may include each other"));
            }
            self.depth += 1;
            let folder = file.parent().unwrap_or(Path::new(""));
            let model = self.root(bytes, folder).map_err(|error| fault(file.display(), error))?;
            self.depth -= 1;
            self.known.insert(file, model.clone());
            model
        };
        model.include(element)?;
        Ok(Some(model))
    }

    fn notes(&self) -> impl Iterator<Item = Note> {
        let parts: Vec<String> = self.skipped.iter().map(|(name, count)| format!("{count} {name}")).collect();
        let note =
            (!parts.is_empty()).then(|| Note::new("skipped", format!("{}, which are not read", parts.join(", "))));
        note.into_iter()
    }
}

/// The file of a model that its `model.config` names: that of the newest version.
fn file_of_config(bytes: &[u8]) -> Result<PathBuf, FormatError> {
    let text = xml::text(bytes)?;
    let document = xml::parse(text)?;
    let root = document.root_element();
    let version = |file: &Node<'_, '_>| {
        let parts = file.attribute("version").unwrap_or("1.0").split('.');
        parts.map(|part| part.trim().parse::<u32>().unwrap_or(0)).collect::<Vec<u32>>()
    };
    let file = xml::children(root, "sdf").max_by_key(version).and_then(|file| file.text()).map(str::trim);
    file.map(PathBuf::from).ok_or_else(|| xml::fault(root, "it names no sdf file"))
}

/// The file that a URI names, from a folder or from a model.
///
/// # Errors
/// If it names none below them.
fn path_of(uri: &str, folder: &Path) -> Result<PathBuf, String> {
    let joined = match uri.split_once("://") {
        Some(("model" | "package", rest)) => Path::new("model:").join(rest.trim_start_matches('/')),
        Some(("file", rest)) if !rest.starts_with('/') => folder.join(rest),
        Some(("file", _)) => return Err(ELSEWHERE.to_owned()),
        Some(("http" | "https" | "fuel", _)) => {
            return Err(
                "is on the network, from which nothing is read; download the model (gz fuel download -u URI) and \
                        name its folder by map.import.model_path (--model-path)"
                    .to_owned(),
            );
        }
        Some(_) => return Err("is of a kind that is not known, expected model:// or the name of a file".to_owned()),
        None if uri.is_empty() => return Err("is missing".to_owned()),
        None => folder.join(uri),
    };
    let mut path = PathBuf::new();
    for part in joined.components() {
        match part {
            Component::Normal(part) => path.push(part),
            Component::CurDir => {}
            Component::ParentDir if path.pop() => {}
            _ => return Err(ELSEWHERE.to_owned()),
        }
    }
    Ok(path)
}

#[cfg(test)]
mod tests;
