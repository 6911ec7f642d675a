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
//! of poses (`relative_to`, `attached_to`, `placement_frame`, SDF 1.2 to 1.12) are here
//! ([`poses`]). Not read: height maps, road and actors, which are named or counted, and joints,
//! whose positions are those of the file.

mod file_names;
mod geometry;
mod poses;
mod primitives;
mod saved_state;

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use nalgebra::{Matrix4, Vector3};
use roxmltree::Node;

use super::frame::Bounds;
use super::mesh::{self, Mesh};
use super::options::Up;
use super::{FormatError, ImportSpec, Imported, MapReader, Note, Search, dae, gltf, obj, stl, xml};
use file_names::{ELSEWHERE, file_of_config, known_model, path_of};
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

/// The first version of SDF that is read, whose shapes and poses are those of later ones.
const FIRST_VERSION: [u32; 2] = [1, 2];

/// A map of a world.
///
/// # Errors
/// If a file is malformed, missing or has what is not read, or its shapes do not fit into a map.
pub(super) fn read(spec: &ImportSpec) -> Result<Imported, FormatError> {
    let files = Files::new(spec);
    let mut reader = Reader::new(&files);
    let world = reader.root(&spec.bytes, Path::new(""), Role::Map)?;
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
    mesh::map_up(spec, whole, (Up::Z, "as SDF has it"), notes)
}

/// The files that a world needs and that have not been looked for.
fn missing(spec: &ImportSpec) -> Vec<PathBuf> {
    let files = Files::new(spec);
    if let Ok(world) = Reader::new(&files).root(&spec.bytes, Path::new(""), Role::Map) {
        world.each_shape(&mut |shape| {
            if let Geometry::Mesh { file, .. } = &shape.geometry {
                let _ = files.get(file);
            }
        });
    }
    files.missing.into_inner().into_iter().collect()
}

/// The files around a world.
struct Files<'a> {
    spec: &'a ImportSpec,
    missing: RefCell<BTreeSet<PathBuf>>,
}

impl<'a> Files<'a> {
    fn new(spec: &'a ImportSpec) -> Self {
        Self { spec, missing: RefCell::default() }
    }

    /// The content of a file; one that has not been looked for becomes missing.
    fn get(&self, name: &Path) -> Option<&'a [u8]> {
        if !self.spec.companions.contains_key(name) {
            self.missing.borrow_mut().insert(name.to_path_buf());
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
            // Gazebo takes coordinates of these as they are (ignition-common 4).
            Some("dae") => (dae::Model::read(bytes).map_err(inside)?.mesh, Up::Z),
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
    /// Models of Gazebo that are taken without their files.
    without_files: BTreeMap<&'static str, u64>,
    warnings: Vec<Note>,
}

/// Whether a file is the map, or one that others include.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Role {
    Map,
    Included,
}

impl<'a> Reader<'a> {
    fn new(files: &'a Files<'a>) -> Self {
        Self {
            files,
            parts: 0,
            depth: 0,
            known: BTreeMap::new(),
            skipped: BTreeMap::new(),
            without_files: BTreeMap::new(),
            warnings: Vec::new(),
        }
    }

    /// The world of a file, whose relative names start from `folder`, or a world of its models. Of
    /// an included file, its world or its first model.
    fn root(&mut self, bytes: &[u8], folder: &Path, role: Role) -> Result<Model, FormatError> {
        let text = xml::text(bytes)?;
        let document = xml::parse(text)?;
        let root = document.root_element();
        if !matches!(root.tag_name().name(), "sdf" | "gazebo") {
            return Err(xml::fault(root, "the file begins with another element, expected sdf"));
        }
        check_version(root)?;
        let worlds: Vec<Node<'_, '_>> = xml::children(root, "world").collect();
        let models: Vec<Node<'_, '_>> = xml::children(root, "model").collect();
        let mut warn = |text: String| self.warnings.push(Note::warning("world", text));
        let left_out = |count: usize, what: &str| format!("{count} {what} of the file are left out, only the first");
        match (worlds.as_slice(), models.as_slice()) {
            ([], []) => Err(xml::fault(root, "it has neither a world nor a model")),
            ([world, others @ ..], beside) => {
                if !others.is_empty() {
                    warn(format!("{} world is read", left_out(others.len(), "other worlds")));
                }
                if !beside.is_empty() {
                    warn(format!("{} models beside the world are left out; put them into it", beside.len()));
                }
                let mut model = self.model(*world, folder)?;
                if let Some(state) = xml::child(*world, "state") {
                    self.warnings.extend(saved_state::apply(state, &mut model)?);
                }
                Ok(model)
            }
            ([], [model, others @ ..]) if role == Role::Included => {
                if !others.is_empty() {
                    warn(format!("{} model of an included file is read", left_out(others.len(), "other models")));
                }
                self.model(*model, folder)
            }
            ([], [_, others @ ..]) => {
                if !others.is_empty() {
                    let count = models.len();
                    warn(format!("{count} models without a world, all of which are read; Gazebo takes the first only"));
                }
                let models = models.iter().map(|model| self.model(*model, folder));
                Ok(Model::of_models(models.collect::<Result<_, _>>()?))
            }
        }
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
                    match included {
                        Some(included) if xml::is_true(child, "merge") => model.merge(included)?,
                        included => model.models.extend(included),
                    }
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
        let is_looked_for = |file: &Path| self.files.spec.companions.contains_key(file);
        let place = path_of(uri, folder).map_err(|reason| named(&reason))?;
        let is_file = place.extension().is_some_and(|extension| extension == "sdf" || extension == "world");
        let file = if is_file {
            place.clone()
        } else {
            let config = place.join("model.config");
            match self.files.get(&config) {
                Some(bytes) => place.join(file_of_config(bytes).map_err(|error| fault(config.display(), error))?),
                None if !is_looked_for(&config) => return Ok(None),
                None => place.join("model.sdf"),
            }
        };
        let mut model = if let Some(known) = self.known.get(&file).map(|known| known.parts()) {
            self.add(element, known)?;
            self.known[&file].clone()
        } else {
            let bytes = match (self.files.get(&file), known_model(&place)) {
                (Some(bytes), _) => bytes,
                (None, _) if !is_looked_for(&file) => return Ok(None),
                (None, Some((name, text))) => {
                    *self.without_files.entry(name).or_default() += 1;
                    text.as_bytes()
                }
                (None, None) => return Err(named(ELSEWHERE)),
            };
            if self.depth > DEPTH_MAX {
                return Err(named("lies deeper than files may include each other"));
            }
            self.depth += 1;
            let folder = file.parent().unwrap_or(Path::new(""));
            let model = self.root(bytes, folder, Role::Included).map_err(|error| fault(file.display(), error))?;
            self.depth -= 1;
            self.known.insert(file, model.clone());
            model
        };
        model.include(element)?;
        Ok(Some(model))
    }

    fn notes(self) -> impl Iterator<Item = Note> {
        let parts: Vec<String> = self.skipped.iter().map(|(name, count)| format!("{count} {name}")).collect();
        let note =
            (!parts.is_empty()).then(|| Note::new("skipped", format!("{}, which are not read", parts.join(", "))));
        let names: Vec<&str> = self.without_files.keys().copied().collect();
        let known = (!names.is_empty()).then(|| {
            Note::new("models", format!("{}, taken as Gazebo has them, without their files", names.join(", ")))
        });
        note.into_iter().chain(known).chain(self.warnings)
    }
}

/// Refuses versions of SDF whose shapes and poses are written otherwise.
fn check_version(root: Node<'_, '_>) -> Result<(), FormatError> {
    let version = root.attribute("version").unwrap_or_default().trim();
    let numbers: Vec<u32> = version.split('.').map_while(|part| part.parse().ok()).collect();
    if numbers.is_empty() || numbers.as_slice() >= FIRST_VERSION.as_slice() {
        return Ok(());
    }
    let reason = format!(
        "SDF {} is not read, allowed are 1.2 to 1.12; convert it by the Gazebo that wrote it (gzsdf convert FILE), or \
         save the world as a mesh (.dae, .obj, .stl)",
        version.escape_debug()
    );
    Err(xml::fault(root, reason))
}

#[cfg(test)]
mod tests;
