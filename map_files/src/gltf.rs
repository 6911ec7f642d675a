//! Scenes of meshes in glTF 2.0: `.glb` in one piece, and `.gltf` with its data inside or in files
//! below its folder.
//!
//! The nodes of the scene place meshes of triangles; materials, skins and animations are ignored.
//! The axis y points upwards, as the format has it, save in files of writers that leave coordinates
//! as they are ([`upwards`]); `up` overrides both. Coordinates may be integers
//! (`KHR_mesh_quantization`), and views compressed ([`meshopt`]). Sparse data and Draco are
//! refused, and so is an extension that a file requires and that may change the shape of its
//! meshes.

mod document;
mod meshopt;
mod upwards;

use std::borrow::Cow;
use std::path::{Component, PathBuf};

use nalgebra::{Matrix4, Quaternion, Translation3, UnitQuaternion, Vector3};
use voxels::Extent;

use super::bytes::{Bytes, shown};
use super::mesh::{self, Mesh};
use super::options::Up;
use super::{FormatError, ImportSpec, Imported, MapReader, Note};
use document::{Accessor, Buffer, Document, Node, Places, Versioned, View};
use meshopt::Mode;
use upwards::upwards;
pub(super) use upwards::writer_as_given;

/// A scene of meshes, as text or binary.
pub(super) const READER: MapReader = MapReader {
    companions: Some(companions),
    stored_cell_m: Some(stored_cell_m),
    ..MapReader::new("scene of glTF", &["gltf", "glb"], mesh::OPTIONS, read)
};

/// Largest document: each of its bytes may become some fifty in memory.
const DOCUMENT_BYTES_MAX: usize = 1 << 24;

/// Most nodes on the way from a scene to a mesh.
const DEPTH_MAX: usize = 256;

/// What is wrong with a file of glTF 1.0.
const OF_VERSION_1: &str = "glTF 1.0 is not read, allowed is 2.0; convert the file, for instance by gltf-pipeline -i \
                            OLD -o NEW.glb";

/// Types of the numbers of an accessor.
const I8: u32 = 5120;
const I16: u32 = 5122;
const U8: u32 = 5121;
const U16: u32 = 5123;
const U32: u32 = 5125;
const F32: u32 = 5126;

/// Kinds of primitives that consist of triangles.
const TRIANGLES: u32 = 4;
const STRIP: u32 = 5;
const FAN: u32 = 6;

/// Extensions that are read, or refused where they are used.
const KNOWN: [&str; 6] = [
    "EXT_mesh_gpu_instancing",
    "KHR_node_visibility",
    "KHR_draco_mesh_compression",
    "KHR_mesh_quantization",
    "EXT_meshopt_compression",
    "KHR_meshopt_compression",
];

/// Most bytes that a byte of a compressed view stands for.
const UNPACKED_MAX: usize = 64;

/// Beginnings of the names of extensions that change looks and not shapes.
const OF_LOOKS: [&str; 9] = [
    "KHR_materials_",
    "KHR_texture_",
    "KHR_lights_",
    "KHR_xmp",
    "KHR_animation_",
    "EXT_texture_",
    "EXT_lights_",
    "MSFT_texture_",
    "ADOBE_materials_",
];

impl Buffer<'_> {
    /// The other file that has its data, as the document names it.
    fn file(&self) -> Option<&str> {
        self.uri.as_deref().filter(|uri| !uri.starts_with("data:"))
    }
}

/// The files that a document needs, relative to its folder, in the order of its buffers; none if
/// one of them may not be read.
fn companions(spec: &ImportSpec) -> Vec<PathBuf> {
    let document = pieces(&spec.bytes).ok().and_then(|(text, _)| parsed(text).ok());
    let buffers = document.iter().flat_map(|document| &document.buffers);
    let files: Option<Vec<PathBuf>> = buffers.filter_map(Buffer::file).map(below_folder).collect();
    files.unwrap_or_default()
}

/// The path of a URI of a file below the folder of the document; `None` if it is elsewhere.
fn below_folder(uri: &str) -> Option<PathBuf> {
    let mut bytes = Vec::new();
    let mut rest = uri.bytes();
    while let Some(byte) = rest.next() {
        bytes.push(match byte {
            b'%' => {
                let digits = [rest.next()?, rest.next()?];
                u8::from_str_radix(str::from_utf8(&digits).ok()?, 16).ok()?
            }
            byte => byte,
        });
    }
    let path = PathBuf::from(String::from_utf8(bytes).ok()?);
    let is_below = path.components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir));
    (is_below && !uri.contains("://") && path.file_name().is_some()).then_some(path)
}

/// The length of a cell in a file that was written here, metres: a default, as of all meshes.
fn stored_cell_m(bytes: &[u8]) -> Option<f64> {
    let (text, _) = pieces(bytes).ok()?;
    let length_m = parsed(text).ok()?.asset.extras.cell_m?;
    Extent::new([1; 3], length_m).is_ok().then_some(length_m)
}

/// The document of a file.
fn parsed(text: &[u8]) -> Result<Document<'_>, FormatError> {
    if text.len() > DOCUMENT_BYTES_MAX {
        let reason = format!("a document of {} bytes, allowed are {DOCUMENT_BYTES_MAX}; save it as .glb", text.len());
        return Err(FormatError::byte(0, reason));
    }
    serde_json::from_slice(text).map_err(|error| {
        // Older documents name their nodes, meshes and buffers instead of numbering them.
        if serde_json::from_slice(text).is_ok_and(|Versioned { asset }| asset.is_old()) {
            return fault("asset.version", OF_VERSION_1);
        }
        let reason = error.to_string();
        FormatError::line(error.line(), reason.split(" at line").next().unwrap_or_default().escape_debug().to_string())
    })
}

/// A fault in the document, by the place in it.
fn fault(place: impl std::fmt::Display, reason: impl std::fmt::Display) -> FormatError {
    FormatError::Entry { place: place.to_string(), reason: reason.to_string() }
}

/// A map of a glTF file.
///
/// # Errors
/// If the file is malformed or has what is not read, or its meshes do not fit into a map.
pub(super) fn read(spec: &ImportSpec) -> Result<Imported, FormatError> {
    let (mesh, (up, reason), notes) = parse(spec)?;
    let reason = reason + mesh.advice_on_up(up);
    mesh::map_up(spec, mesh, (up, &reason), notes)
}

/// The mesh of a file, the axis upwards with a reason, and notes.
type Parsed = (Mesh, (Up, String), Vec<Note>);

/// The mesh of a file.
///
/// # Errors
/// If the file is malformed or has what is not read.
pub(super) fn parse(spec: &ImportSpec) -> Result<Parsed, FormatError> {
    let (text, binary) = pieces(&spec.bytes)?;
    let document = parsed(text)?;
    let is_known = |name: &str| KNOWN.contains(&name) || OF_LOOKS.iter().any(|beginning| name.starts_with(beginning));
    if let Some(name) = document.required.iter().find(|name| !is_known(name)) {
        let name = shown(name.as_bytes());
        return Err(fault("extensionsRequired", format_args!("{name} is not read; save the scene without it")));
    }
    let buffers: Vec<Cow<'_, [u8]>> = document
        .buffers
        .iter()
        .enumerate()
        .map(|(number, buffer)| match (&buffer.uri, binary) {
            (Some(_), _) if buffer.file().is_some() => {
                let place = format!("buffers[{number}].uri");
                let file = buffer.file().unwrap_or_default();
                let Some(path) = below_folder(file) else {
                    let name = shown(file.as_bytes());
                    let reason =
                        format!("{name} is no file below the folder of the scene; put it there, or save as .glb");
                    return Err(fault(place, reason));
                };
                spec.companion(&path).map(Cow::Borrowed).ok_or_else(|| {
                    fault(place, "the data are in another file, which is not at hand; save the scene as .glb")
                })
            }
            (Some(uri), _) => data(number, uri).map(Cow::Owned),
            (None, _) if buffer.extensions.meshopt.is_some() => Ok(Cow::Borrowed([].as_slice())),
            (None, Some(binary)) if number == 0 => Ok(Cow::Borrowed(binary)),
            (None, _) => Err(fault(format_args!("buffers[{number}]"), "there are no data")),
        })
        .collect::<Result<_, _>>()?;
    let reader = Reader { document: &document, buffers };
    let mut mesh = Mesh::default();
    let scene = document.scenes.get(document.scene.unwrap_or(0));
    if let (Some(number), None, false) = (document.scene, scene, document.scenes.is_empty()) {
        return Err(fault("scene", format_args!("{number} is none of the {} scenes", document.scenes.len())));
    }
    let roots = scene.map_or_else(|| document.nodes_without_parent(), |scene| scene.nodes.clone());
    let (mut placed, mut hidden) = (0u64, 0u64);
    let mut seen = vec![false; document.nodes.len()];
    let mut open: Vec<(usize, Matrix4<f64>, usize, bool)> =
        roots.into_iter().rev().map(|root| (root, Matrix4::identity(), 0, true)).collect();
    while let Some((number, above, depth, mut is_shown)) = open.pop() {
        let name = format!("nodes[{number}]");
        let node = document.nodes.get(number).ok_or_else(|| fault(&name, "there is no such node"))?;
        if std::mem::replace(&mut seen[number], true) {
            return Err(fault(&name, "a node has two parents"));
        }
        if depth > DEPTH_MAX {
            return Err(fault(&name, format_args!("it lies deeper than {DEPTH_MAX} nodes")));
        }
        is_shown &= node.extensions.visibility.as_ref().is_none_or(|visibility| visibility.visible);
        let here = above * node.matrix();
        if node.mesh.is_some() && !is_shown {
            hidden += 1;
        } else if let Some(number) = node.mesh {
            let copies = match &node.extensions.instancing {
                Some(instancing) => reader.copies(&name, &instancing.attributes)?,
                None => vec![Matrix4::identity()],
            };
            for copy in copies {
                placed += 1;
                mesh.begin_part(&node.name);
                reader.add(number, &(here * copy), &mut mesh)?;
            }
        }
        open.extend(node.children.iter().rev().map(|&child| (child, here, depth + 1, is_shown)));
    }
    let mut notes = vec![Note::new("scene", format!("{placed} mesh(es) put into it, which come out as their union"))];
    if hidden > 0 {
        notes.push(Note::new("hidden", format!("{hidden} mesh(es) of hidden nodes left out")));
    }
    let root = scene.and_then(|scene| document.nodes.get(*scene.nodes.first()?));
    Ok((mesh, upwards(&document.asset.generator, root), notes))
}

/// The document, and the binary data of a file in one piece.
fn pieces(bytes: &[u8]) -> Result<(&[u8], Option<&[u8]>), FormatError> {
    if !bytes.starts_with(b"glTF") {
        return Ok((bytes, None));
    }
    let mut file = Bytes::new(bytes);
    file.take(4, "the mark")?;
    let version = file.u32("the version")?;
    if version == 1 {
        return Err(FormatError::byte(4, OF_VERSION_1));
    }
    if version != 2 {
        return Err(FormatError::byte(4, format!("the version is {version}, allowed is 2")));
    }
    file.u32("the length")?;
    let mut chunk = |what: &str| {
        let length = file.u32("the length of a chunk")?;
        let kind = file.u32("the type of a chunk")?;
        Ok::<_, FormatError>((kind, file.take(length as usize, what)?, file.rest().is_empty()))
    };
    let (_, text, is_last) = chunk("the document")?;
    let binary = if is_last { None } else { Some(chunk("the binary data")?.1) };
    Ok((text, binary))
}

/// The bytes of a data URI.
fn data(number: usize, uri: &str) -> Result<Vec<u8>, FormatError> {
    let place = || format!("buffers[{number}].uri");
    let Some(text) = uri.strip_prefix("data:").and_then(|rest| rest.split_once(";base64,")) else {
        return Err(fault(place(), "it has no data in base64"));
    };
    let mut bytes = Vec::with_capacity(text.1.len() / 4 * 3);
    let (mut bits, mut count) = (0u32, 0);
    for character in text.1.bytes().take_while(|&character| character != b'=') {
        let six = match character {
            b'A'..=b'Z' => character - b'A',
            b'a'..=b'z' => character - b'a' + 26,
            b'0'..=b'9' => character - b'0' + 52,
            b'+' => 62,
            b'/' => 63,
            _ => return Err(fault(place(), "it is not base64")),
        };
        bits = bits << 6 | u32::from(six);
        count += 6;
        if count >= 8 {
            count -= 8;
            bytes.push((bits >> count) as u8);
        }
    }
    Ok(bytes)
}

impl Node {
    /// From its own coordinates to those of its parent.
    fn matrix(&self) -> Matrix4<f64> {
        if let Some(matrix) = &self.matrix {
            return Matrix4::from_column_slice(matrix.as_slice());
        }
        let rotation = self.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]);
        placed(self.translation.unwrap_or_default(), rotation, self.scale.unwrap_or([1.0; 3]))
    }
}

/// Scales, turns by a quaternion (x, y, z, w), then moves.
fn placed(translation: [f64; 3], [x, y, z, w]: [f64; 4], scale: [f64; 3]) -> Matrix4<f64> {
    let rotation = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
    let translation = Translation3::from(Vector3::from(translation));
    translation.to_homogeneous() * rotation.to_homogeneous() * Matrix4::new_nonuniform_scaling(&Vector3::from(scale))
}

impl Accessor {
    /// A number of an element.
    fn number(&self, bytes: &[u8]) -> f64 {
        let mut low = [0; 4];
        low[..bytes.len()].copy_from_slice(bytes);
        let unsigned = u32::from_le_bytes(low);
        let (number, largest): (f64, f64) = match self.component {
            I8 => (f64::from(unsigned as u8 as i8), i8::MAX.into()),
            U8 => (unsigned.into(), u8::MAX.into()),
            I16 => (f64::from(unsigned as u16 as i16), i16::MAX.into()),
            U16 => (unsigned.into(), u16::MAX.into()),
            U32 => return unsigned.into(),
            _ => return f32::from_bits(unsigned).into(),
        };
        if self.normalized { (number / largest).max(-1.0) } else { number }
    }
}

struct Reader<'a> {
    document: &'a Document<'a>,
    buffers: Vec<Cow<'a, [u8]>>,
}

impl Reader<'_> {
    /// Adds a mesh of the document at its place.
    fn add(&self, number: usize, here: &Matrix4<f64>, mesh: &mut Mesh) -> Result<(), FormatError> {
        let of_document = self.document.meshes.get(number);
        let of_document =
            of_document.ok_or_else(|| fault(format_args!("meshes[{number}]"), "there is no such mesh"))?;
        // A mirrored solid would face inwards.
        let is_mirrored = here.fixed_view::<3, 3>(0, 0).determinant() < 0.0;
        for (index, primitive) in of_document.primitives.iter().enumerate() {
            let place = format!("meshes[{number}].primitives[{index}]");
            if primitive.extensions.draco.is_some() {
                return Err(fault(place, "it is compressed with Draco; save the scene without compression"));
            }
            let mode = primitive.mode.unwrap_or(TRIANGLES);
            if !matches!(mode, TRIANGLES | STRIP | FAN) {
                continue;
            }
            let position = primitive.attributes.position;
            let position = position.ok_or_else(|| fault(&place, "it has no POSITION"))?;
            let first = mesh.vertices.len();
            self.each(position, "VEC3", &[F32, I8, U8, I16, U16], |[x, y, z, _]| {
                let at = here * nalgebra::Vector4::new(x, y, z, 1.0);
                mesh.vertices.push([at.x, at.y, at.z]);
            })?;
            let count = mesh.vertices.len() - first;
            let mut corners: Vec<u32> = Vec::new();
            match primitive.indices {
                Some(indices) => self.each(indices, "SCALAR", &[U8, U16, U32], |numbers| {
                    // Exact, as all numbers of 32 bits are.
                    corners.push(numbers[0] as u32);
                })?,
                None => corners.extend(0..count as u32),
            }
            if let Some(corner) = corners.iter().find(|&&corner| corner as usize >= count) {
                return Err(fault(place, format_args!("it has the corner {corner}, and {count} vertices")));
            }
            let triangles = if mode == TRIANGLES { corners.len() / 3 } else { corners.len().saturating_sub(2) };
            for triangle in 0..triangles {
                let [a, b, c] = match mode {
                    TRIANGLES => [3 * triangle, 3 * triangle + 1, 3 * triangle + 2],
                    STRIP => [triangle, triangle + 1 + triangle % 2, triangle + 2 - triangle % 2],
                    _ => [0, triangle + 1, triangle + 2],
                };
                let [b, c] = if is_mirrored { [c, b] } else { [b, c] };
                mesh.triangles.push([a, b, c].map(|corner| first as u32 + corners[corner]));
            }
            mesh.check_count()?;
        }
        Ok(())
    }

    /// The places of the copies of the mesh of a node.
    fn copies(&self, node: &str, places: &Places) -> Result<Vec<Matrix4<f64>>, FormatError> {
        let read = |accessor: Option<usize>, kind: &str| -> Result<Option<Vec<[f64; 4]>>, FormatError> {
            let Some(accessor) = accessor else { return Ok(None) };
            let mut values = Vec::new();
            let components: &[u32] = if kind == "VEC4" { &[F32, I8, I16] } else { &[F32] };
            self.each(accessor, kind, components, |numbers| values.push(numbers))?;
            Ok(Some(values))
        };
        let translation = read(places.translation, "VEC3")?;
        let rotation = read(places.rotation, "VEC4")?;
        let scale = read(places.scale, "VEC3")?;
        let mut counts = [&translation, &rotation, &scale].into_iter().flatten().map(Vec::len);
        let count = counts.next().unwrap_or(0);
        if counts.any(|other| other != count) {
            return Err(fault(node, "its instances have different numbers of translations, rotations and scales"));
        }
        let three = |values: &Option<Vec<[f64; 4]>>, at: usize, otherwise: f64| {
            values.as_ref().map_or([otherwise; 3], |values| [values[at][0], values[at][1], values[at][2]])
        };
        let turned = |at: usize| rotation.as_ref().map_or([0.0, 0.0, 0.0, 1.0], |rotation| rotation[at]);
        Ok((0..count).map(|at| placed(three(&translation, at, 0.0), turned(at), three(&scale, at, 1.0))).collect())
    }

    /// The bytes of a view.
    fn view<'v>(&'v self, view: &View, wrong: &impl Fn(&str) -> FormatError) -> Result<Cow<'v, [u8]>, FormatError> {
        let part = |buffer: usize, offset: usize, length: usize| -> Result<&'v [u8], FormatError> {
            let buffer = self.buffers.get(buffer).ok_or_else(|| wrong("there is no such buffer"))?;
            let data = offset.checked_add(length).and_then(|end| buffer.get(offset..end));
            data.ok_or_else(|| wrong("it lies behind the end of its buffer"))
        };
        let Some(packed) = &view.extensions.meshopt else {
            return part(view.buffer, view.offset, view.length).map(Cow::Borrowed);
        };
        let data = part(packed.buffer, packed.offset, packed.length)?;
        let mode = match packed.mode.as_str() {
            "ATTRIBUTES" => Mode::Attributes,
            "TRIANGLES" => Mode::Triangles,
            "INDICES" => Mode::Indices,
            _ => return Err(wrong("the mode of its compression is none of ATTRIBUTES, TRIANGLES and INDICES")),
        };
        let is_length = packed.count.checked_mul(packed.stride) == Some(view.length);
        if !is_length || view.length > data.len().saturating_mul(UNPACKED_MAX) {
            return Err(wrong("the length of its compressed data does not fit"));
        }
        let damaged = || wrong("its compressed data are damaged, or of a version that is not read");
        let mut bytes = meshopt::unpack(data, mode, packed.count, packed.stride).ok_or_else(damaged)?;
        match packed.filter.as_deref() {
            None | Some("NONE") => {}
            Some("EXPONENTIAL") if packed.stride % 4 == 0 => meshopt::from_exponents(&mut bytes),
            Some("QUATERNION") if packed.stride == 8 => meshopt::from_rotations(&mut bytes),
            Some(_) => {
                return Err(wrong("its compressed data have a filter for normals or colours, or of another stride"));
            }
        }
        Ok(Cow::Owned(bytes))
    }

    /// Visits the numbers of each element of an accessor; those that it lacks are 0.
    fn each(
        &self,
        number: usize,
        kind: &str,
        components: &[u32],
        mut visit: impl FnMut([f64; 4]),
    ) -> Result<(), FormatError> {
        let place = format!("accessors[{number}]");
        let wrong = |reason: &str| fault(&place, reason);
        let accessor = self.document.accessors.get(number).ok_or_else(|| wrong("there is no such accessor"))?;
        if accessor.kind != kind || !components.contains(&accessor.component) {
            let reason = format!(
                "it is of type {} and componentType {}, expected {kind} of {components:?}",
                accessor.kind.chars().take(20).collect::<String>().escape_debug(),
                accessor.component
            );
            return Err(wrong(&reason));
        }
        let (Some(view), None) = (accessor.view, &accessor.sparse) else {
            return Err(wrong("it is sparse or has no bufferView, which is not read"));
        };
        let view = self.document.views.get(view).ok_or_else(|| wrong("there is no such bufferView"))?;
        let bytes = self.view(view, &wrong)?;
        let data = bytes.get(accessor.offset..).ok_or_else(|| wrong("it lies behind the end of its buffer"))?;
        let width = match accessor.component {
            I8 | U8 => 1,
            I16 | U16 => 2,
            _ => 4,
        };
        let numbers = match kind {
            "VEC4" => 4,
            "VEC3" => 3,
            _ => 1,
        };
        let stride = view.stride.unwrap_or(width * numbers);
        if stride < width * numbers {
            return Err(wrong("its elements overlap"));
        }
        let needed = accessor
            .count
            .checked_sub(1)
            .map_or(Some(0), |count| count.checked_mul(stride).and_then(|bytes| bytes.checked_add(width * numbers)));
        if needed.is_none_or(|needed| needed > data.len()) {
            return Err(wrong(&format!("{} elements do not fit into its {} bytes", accessor.count, data.len())));
        }
        for element in 0..accessor.count {
            let mut values = [0.0; 4];
            for (at, value) in values.iter_mut().enumerate().take(numbers) {
                let from = element * stride + at * width;
                *value = accessor.number(&data[from..from + width]);
            }
            visit(values);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
