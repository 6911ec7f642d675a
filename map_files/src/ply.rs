//! Meshes and point clouds in the Polygon File Format (PLY 1.0): ascii, and binary of either byte
//! order.
//!
//! Of the element `vertex`, the properties x, y and z are used, of the element `face` the list
//! `vertex_indices` or `vertex_index`, and of the element `tristrips` likewise the strips of
//! triangles, between which stands -1. A file with faces or strips is a mesh, one without a point
//! cloud. Of a point cloud, the sensor is where `vp_x`, `vp_y` and `vp_z` of each point or PCL's
//! element `camera` have it. Elements `origin` and `voxel_size` before the vertices, as Open3D
//! writes them, make indices of voxels of them. Other elements are skipped.

mod voxel_grid;

use super::bytes::{Bytes, float, number, shown, words};
use super::cloud::{self, Cloud, Points, Records, Sensors};
use super::formats::joined;
use super::mesh::{self, Mesh};
use super::{FormatError, ImportSpec, Imported, MapReader, Note};
use voxel_grid::{NUDGE, VoxelGrid};

/// A mesh or a point cloud in the Polygon File Format.
pub(super) const READER: MapReader = MapReader {
    stored_cell_m: Some(|bytes| VoxelGrid::of(bytes).map(|grid| grid.size)),
    in_pieces: Some(in_pieces),
    ..MapReader::new("polygon file", &["ply"], OPTIONS, read)
};

/// The options of a cloud, and those that only meshes have.
const OPTIONS: &[&str] = &joined::<{ 2 + cloud::OPTIONS.len() }>(&[&["fill", "inside"], cloud::OPTIONS]);

/// Names of the property with the time of a point, seconds.
const TIMES: [&str; 4] = ["timestamp", "time", "gps_time", "scalar_GpsTime"];

/// Largest number of bytes, or words, of an element.
const ELEMENT_MAX: usize = 1 << 20;

/// The encoding of numbers.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Order {
    Ascii,
    Little,
    Big,
}

/// Type of a number.
#[derive(Clone, Copy)]
enum Number {
    Signed(usize),
    Unsigned(usize),
    Float(usize),
}

/// A property of an element.
struct Property {
    name: Vec<u8>,
    number: Number,
    /// Of a list, the type of its length.
    length: Option<Number>,
}

struct Element {
    name: Vec<u8>,
    count: usize,
    properties: Vec<Property>,
}

/// A map of a PLY file.
///
/// # Errors
/// If the file is malformed, or its content does not fit into a map.
pub(super) fn read(spec: &ImportSpec) -> Result<Imported, FormatError> {
    let mut bytes = Bytes::new(&spec.bytes);
    let (order, elements) = header(&mut bytes)?;
    let at = bytes.at();
    if let Some(record) = Record::of(spec, order, &elements) {
        return record.read(spec, at, &elements);
    }
    let place = |name: &[u8]| elements.iter().position(|element| element.name == name);
    let vertices = place(b"vertex").ok_or_else(|| FormatError::byte(at, "there is no element vertex in the header"))?;
    let with_lists = [b"face".as_slice(), b"tristrips"].into_iter().filter_map(place);
    let faces: Vec<(usize, usize)> = with_lists
        .filter(|&faces| elements[faces].count > 0)
        .map(|faces| corners_of(&elements[faces], at).map(|list| (faces, list)))
        .collect::<Result<_, _>>()?;
    let list_of = |number: usize| faces.iter().find(|&&(faces, _)| faces == number).map(|&(_, list)| list);
    let coordinates = positions(&elements[vertices], ["x", "y", "z"], at)?;
    let seen_from = positions(&elements[vertices], ["vp_x", "vp_y", "vp_z"], at).ok();
    let time = elements[vertices].properties.iter().position(|property| {
        property.length.is_none() && TIMES.iter().any(|name| property.name.eq_ignore_ascii_case(name.as_bytes()))
    });
    let time = time.filter(|_| spec.options.trajectory.is_some());
    let (mut from, mut times_s) = (Vec::new(), Vec::new());
    if faces.iter().any(|&(faces, _)| faces < vertices) {
        return Err(FormatError::byte(at, "the element face comes before the element vertex"));
    }
    let last = faces.iter().map(|&(faces, _)| faces).max().unwrap_or(vertices);

    let camera = place(b"camera").filter(|&camera| faces.is_empty() && elements[camera].count > 0);
    let camera_at = camera.and_then(|camera| positions(&elements[camera], ["view_px", "view_py", "view_pz"], at).ok());
    let grid = VoxelGrid::of(&spec.bytes).filter(|_| faces.is_empty());
    let last = last.max(if camera_at.is_some() { camera.unwrap_or(0) } else { 0 });

    let mut mesh = Mesh::default();
    let mut skipped = 0;
    let mut seen_by_camera = None;
    let (mut values, mut items, mut corners) = (Vec::new(), Vec::new(), Vec::new());
    for (number, element) in elements[..=last].iter().enumerate() {
        // An element without properties takes no bytes, however many there are of it.
        let count = if element.properties.is_empty() { 0 } else { element.count };
        let list = list_of(number);
        let begun = match list {
            _ if order == Order::Ascii => 0,
            _ if number == vertices && seen_from.is_none() && time.is_none() => {
                plain_vertices(&mut bytes, order, element, coordinates, &mut mesh)
            }
            Some(list) if element.name != b"tristrips" => plain_faces(&mut bytes, order, element, list, &mut mesh)?,
            _ => 0,
        };
        for place in begun..count {
            let at = bytes.at();
            items.clear();
            read_values(&mut bytes, order, element, place, &mut values, list.map(|list| (list, &mut items)))?;
            if number == vertices {
                mesh.vertices.push(coordinates.map(|property| values[property]));
                from.extend(seen_from.map(|seen_from| seen_from.map(|property| values[property])));
                times_s.extend(time.map(|property| values[property]));
            } else if camera == Some(number) {
                seen_by_camera = seen_by_camera.or(camera_at.map(|camera| camera.map(|property| values[property])));
            } else if list.is_some() && element.name == b"tristrips" {
                for strip in items.split(|&item| item == -1.0).filter(|strip| !strip.is_empty()) {
                    corners_in(strip, mesh.vertices.len(), at, &mut corners)?;
                    mesh.add_strip(&corners);
                    skipped += u64::from(strip.len() < 3);
                    mesh.check_count()?;
                }
            } else if list.is_some() {
                corners_in(&items, mesh.vertices.len(), at, &mut corners)?;
                if corners.len() < 3 {
                    skipped += 1;
                } else {
                    mesh.add_polygon(&corners);
                    mesh.check_count()?;
                }
            }
        }
    }
    let is_of_grid = |element: &Element| {
        grid.is_some() && [b"origin".as_slice(), b"voxel_size", b"rotation"].contains(&&*element.name)
    };
    let used = |number: usize| {
        let is_camera = camera == Some(number) && camera_at.is_some();
        number == vertices || list_of(number).is_some() || is_camera || is_of_grid(&elements[number])
    };
    let ignored = elements.iter().enumerate().filter(|&(number, element)| !used(number) && element.count > 0);
    let notes = ignored.map(|(_, element)| note_of_ignored(element));
    let mut notes: Vec<Note> = notes.chain(mesh::note_of_skipped(skipped)).collect();
    let given_only_for =
        |one: &[&str], other: &[&str]| spec.options.given().find(|name| one.contains(name) && !other.contains(name));
    if !faces.is_empty() {
        if let Some(name) = given_only_for(cloud::OPTIONS, mesh::OPTIONS) {
            return Err(FormatError::HasFaces { name });
        }
        return mesh::map(spec, mesh, notes);
    }
    if let Some(name) = given_only_for(mesh::OPTIONS, cloud::OPTIONS) {
        return Err(FormatError::NoFaces { name });
    }
    if let Some(grid) = grid {
        let size = grid.size * spec.options.scale.unwrap_or(1.0);
        if spec.length_m() < size * (1.0 - NUDGE) {
            return Err(FormatError::CellLength { stored: size, asked: spec.length_m() });
        }
        for voxel in &mut mesh.vertices {
            *voxel = grid.centre(*voxel);
        }
        notes.push(grid.note());
    }
    let sensors = match seen_by_camera {
        _ if seen_from.is_some() => Sensors::Each(from),
        Some(camera) if camera != [0.0; 3] => Sensors::One(camera),
        _ => Sensors::None,
    };
    cloud::map(spec, Cloud { points: mesh.vertices.into(), sensors, times_s, notes })
}

/// Vertices of a cloud that stand first in a binary file, with numbers only.
struct Record<'a> {
    vertex: &'a Element,
    /// The place of each coordinate in a vertex, and its type.
    coordinates: [(usize, Number); 3],
    stride: usize,
    order: Order,
}

impl<'a> Record<'a> {
    /// The vertices of a file; `None` if they are not of this kind, or options or other elements
    /// have a say in them.
    fn of(spec: &ImportSpec, order: Order, elements: &'a [Element]) -> Option<Self> {
        let vertices = elements.iter().position(|element| element.name == b"vertex")?;
        let vertex = &elements[vertices];
        let is_there = |element: &Element| element.count > 0 && !element.properties.is_empty();
        let has_a_say =
            |element: &Element| [b"face".as_slice(), b"tristrips", b"camera"].contains(&element.name.as_slice());
        if order == Order::Ascii
            || elements[..vertices].iter().any(is_there)
            || elements.iter().any(|element| has_a_say(element) && element.count > 0)
            || positions(vertex, ["vp_x", "vp_y", "vp_z"], 0).is_ok()
            || spec.options.trajectory.is_some()
            || spec.options.given().any(|name| !cloud::OPTIONS.contains(&name))
        {
            return None;
        }
        let places = places(&vertex.properties)?;
        let stride = vertex.properties.iter().map(|property| property.number.size()).sum();
        let coordinates = positions(vertex, ["x", "y", "z"], 0).ok()?.map(|property| places[property]);
        Some(Self { vertex, coordinates, stride, order })
    }

    /// A map of the vertices, which begin at a byte.
    fn read(&self, spec: &ImportSpec, at: usize, elements: &[Element]) -> Result<Imported, FormatError> {
        let Self { vertex, coordinates, stride, order } = *self;
        let decode = move |record: &[u8]| Some(coordinates.map(|(at, number)| decoded(&record[at..], order, number)));
        let points = Points::Records(Records::new(spec, at, stride, vertex.count, decode)?);
        let ignored = elements.iter().filter(|element| element.name != b"vertex" && element.count > 0);
        let notes = ignored.map(note_of_ignored).collect();
        cloud::map(spec, Cloud { points, notes, ..Cloud::default() })
    }
}

/// Whether a file is read a piece at a time, of which the header is at hand.
fn in_pieces(spec: &ImportSpec) -> bool {
    let header = header(&mut Bytes::new(&spec.bytes));
    header.is_ok_and(|(order, elements)| Record::of(spec, order, &elements).is_some())
}

fn note_of_ignored(element: &Element) -> Note {
    let name = String::from_utf8_lossy(&element.name).escape_debug().to_string();
    Note::new("ignored", format!("{} elements {name}", element.count))
}

/// The places of three numbers among the properties of a vertex.
fn positions(vertex: &Element, names: [&str; 3], at: usize) -> Result<[usize; 3], FormatError> {
    let mut coordinates = [0; 3];
    for (slot, name) in coordinates.iter_mut().zip(names) {
        let is_it = |property: &Property| property.name == name.as_bytes() && property.length.is_none();
        let found = vertex.properties.iter().position(is_it);
        let missing = || FormatError::byte(at, format!("the element vertex has no property {name:?}"));
        *slot = found.ok_or_else(missing)?;
    }
    Ok(coordinates)
}

/// The place of the list of corners among the properties of a face.
fn corners_of(face: &Element, at: usize) -> Result<usize, FormatError> {
    let is_corners = |property: &Property| {
        property.length.is_some() && matches!(property.name.as_slice(), b"vertex_indices" | b"vertex_index")
    };
    let name = String::from_utf8_lossy(&face.name).into_owned();
    let missing = || FormatError::byte(at, format!("the element {name} has no list vertex_indices"));
    face.properties.iter().position(is_corners).ok_or_else(missing)
}

/// Reads the vertices of a binary file if they have numbers only and the file has all of them, and
/// returns how many these are.
fn plain_vertices(
    bytes: &mut Bytes<'_>,
    order: Order,
    element: &Element,
    coordinates: [usize; 3],
    mesh: &mut Mesh,
) -> usize {
    let Some(places) = places(&element.properties) else { return 0 };
    let stride: usize = element.properties.iter().map(|property| property.number.size()).sum();
    let length = element.count.checked_mul(stride);
    let Some(data) = length.and_then(|length| bytes.take(length, "the vertices").ok()) else { return 0 };
    let coordinates = coordinates.map(|property| places[property]);
    let vertex = |record: &[u8]| coordinates.map(|(at, number)| decoded(&record[at..], order, number));
    mesh.vertices.extend(data.chunks_exact(stride).map(vertex));
    element.count
}

/// The place of each property in an element, bytes, and its type; `None` if one is a list.
fn places(properties: &[Property]) -> Option<Vec<(usize, Number)>> {
    let mut at = 0;
    let place = |property: &Property| {
        let here = at;
        at += property.number.size();
        property.length.is_none().then_some((here, property.number))
    };
    properties.iter().map(place).collect()
}

/// Reads faces of a binary file that have one list, up to the first that is not sound, and returns
/// how many these are.
fn plain_faces(
    bytes: &mut Bytes<'_>,
    order: Order,
    element: &Element,
    list: usize,
    mesh: &mut Mesh,
) -> Result<usize, FormatError> {
    let (before, after) = (&element.properties[..list], &element.properties[list + 1..]);
    let size = |properties: &[Property]| -> usize { properties.iter().map(|property| property.number.size()).sum() };
    let Property { number, length: Some(length), .. } = element.properties[list] else { return Ok(0) };
    if before.iter().chain(after).any(|property| property.length.is_some()) {
        return Ok(0);
    }
    let (first, after) = (size(before), size(after));
    let vertices = mesh.vertices.len() as f64;
    let mut corners: Vec<u32> = Vec::new();
    for place in 0..element.count {
        let rest = bytes.rest();
        let Some(counted) = rest.get(first..first + length.size()) else { return Ok(place) };
        let count = decoded(counted, order, length);
        if !(3.0..=ELEMENT_MAX as f64).contains(&count) {
            return Ok(place);
        }
        let (begin, items) = (first + length.size(), count as usize * number.size());
        let Some(items) = rest.get(begin..begin + items) else { return Ok(place) };
        corners.clear();
        for item in items.chunks_exact(number.size()) {
            let item = decoded(item, order, number);
            let corner = item as u32;
            if f64::from(corner) != item || item >= vertices {
                return Ok(place);
            }
            corners.push(corner);
        }
        if bytes.take(begin + items.len() + after, "a face").is_err() {
            return Ok(place);
        }
        mesh.add_polygon(&corners);
        mesh.check_count()?;
    }
    Ok(element.count)
}

/// Puts the items of the list of a face that begins at a byte into `corners`, as numbers of
/// vertices.
fn corners_in(items: &[f64], vertices: usize, at: usize, corners: &mut Vec<u32>) -> Result<(), FormatError> {
    corners.clear();
    for &item in items {
        let corner = item as u32;
        if f64::from(corner) != item || corner as usize >= vertices {
            return Err(FormatError::byte(at, format!("a face has the corner {item}, there are {vertices} vertices")));
        }
        corners.push(corner);
    }
    Ok(())
}

fn header(bytes: &mut Bytes<'_>) -> Result<(Order, Vec<Element>), FormatError> {
    let (line, first) = bytes.header_line("end_header")?;
    if first != b"ply" {
        return Err(FormatError::line(line, format!("the file begins with {}, expected ply", shown(first))));
    }
    let mut order = None;
    let mut elements: Vec<Element> = Vec::new();
    loop {
        let (at, line) = bytes.header_line("end_header")?;
        let mut words = words(line);
        match words.next() {
            None | Some(b"comment" | b"obj_info") => {}
            Some(b"format") => {
                order = Some(match words.next().unwrap_or_default() {
                    b"ascii" => Order::Ascii,
                    b"binary_little_endian" => Order::Little,
                    b"binary_big_endian" => Order::Big,
                    word => {
                        let reason = "expected ascii, binary_little_endian or binary_big_endian";
                        return Err(FormatError::line(at, format!("format {}, {reason}", shown(word))));
                    }
                });
            }
            Some(b"element") => {
                let name = words.next().unwrap_or_default().to_vec();
                let count = number(at, words.next(), "the number of elements")?;
                elements.push(Element { name, count, properties: Vec::new() });
            }
            Some(b"property") => {
                let element = elements.last_mut();
                let element = element.ok_or_else(|| FormatError::line(at, "a property before the first element"))?;
                let mut kind = words.next().unwrap_or_default();
                let mut length = None;
                if kind == b"list" {
                    length = Some(type_of(at, words.next().unwrap_or_default())?);
                    kind = words.next().unwrap_or_default();
                }
                let name = words.next().unwrap_or_default().to_vec();
                element.properties.push(Property { name, number: type_of(at, kind)?, length });
            }
            Some(b"end_header") => {
                let order = order.ok_or_else(|| FormatError::line(at, "the header ends without a format"))?;
                return Ok((order, elements));
            }
            Some(word) => return Err(FormatError::line(at, format!("{} is no key of a PLY header", shown(word)))),
        }
    }
}

fn type_of(line: usize, word: &[u8]) -> Result<Number, FormatError> {
    match word {
        b"char" | b"int8" => Ok(Number::Signed(1)),
        b"short" | b"int16" => Ok(Number::Signed(2)),
        b"int" | b"int32" => Ok(Number::Signed(4)),
        b"uchar" | b"uint8" => Ok(Number::Unsigned(1)),
        b"ushort" | b"uint16" => Ok(Number::Unsigned(2)),
        b"uint" | b"uint32" => Ok(Number::Unsigned(4)),
        b"float" | b"float32" => Ok(Number::Float(4)),
        b"double" | b"float64" => Ok(Number::Float(8)),
        _ => Err(FormatError::line(line, format!("{} is no type of a property", shown(word)))),
    }
}

/// Puts the values of the properties of the next element into `values`; of a list, its length.
/// `list` is the place of a list and where its items go.
fn read_values(
    bytes: &mut Bytes<'_>,
    order: Order,
    element: &Element,
    place: usize,
    values: &mut Vec<f64>,
    mut list: Option<(usize, &mut Vec<f64>)>,
) -> Result<(), FormatError> {
    let at = bytes.at();
    values.clear();
    let mut keep = |number: usize, item: f64| match &mut list {
        Some((wanted, items)) if *wanted == number => items.push(item),
        _ => {}
    };
    if order != Order::Ascii {
        for (number, property) in element.properties.iter().enumerate() {
            let at = bytes.at();
            let value = value(bytes, order, property.length.unwrap_or(property.number))?;
            if property.length.is_some() {
                let too_long = || FormatError::byte(at, "a list is longer than its element may be");
                for _ in 0..checked_length(value, too_long)? {
                    keep(number, self::value(bytes, order, property.number)?);
                }
            }
            values.push(value);
        }
        return Ok(());
    }
    let ends = || {
        let name = String::from_utf8_lossy(&element.name).escape_debug().to_string();
        FormatError::byte(at, format!("the file ends here after {place} of {} elements {name}", element.count))
    };
    let (mut line, mut text) = bytes.line().ok_or_else(ends)?;
    while text.is_empty() {
        (line, text) = bytes.line().ok_or_else(ends)?;
    }
    let mut words = words(text);
    for (place, property) in element.properties.iter().enumerate() {
        let value = float(line, words.next(), "a property")?;
        if property.length.is_some() {
            let items = checked_length(value, || FormatError::line(line, "a list is longer than its element may be"))?;
            for _ in 0..items {
                keep(place, float(line, words.next(), "an item of a list")?);
            }
        }
        values.push(value);
    }
    Ok(())
}

fn checked_length(value: f64, error: impl Fn() -> FormatError) -> Result<usize, FormatError> {
    if (0.0..=ELEMENT_MAX as f64).contains(&value) { Ok(value as usize) } else { Err(error()) }
}

impl Number {
    fn size(self) -> usize {
        match self {
            Self::Signed(size) | Self::Unsigned(size) | Self::Float(size) => size,
        }
    }
}

fn value(bytes: &mut Bytes<'_>, order: Order, number: Number) -> Result<f64, FormatError> {
    Ok(decoded(bytes.take(number.size(), "a property")?, order, number))
}

/// The number that bytes begin with.
#[inline]
fn decoded(bytes: &[u8], order: Order, number: Number) -> f64 {
    // Most numbers of meshes have four bytes.
    if let (4, &[a, b, c, d, ..]) = (number.size(), bytes) {
        let bits =
            if order == Order::Big { u32::from_be_bytes([a, b, c, d]) } else { u32::from_le_bytes([a, b, c, d]) };
        return match number {
            Number::Float(_) => f32::from_bits(bits).into(),
            Number::Unsigned(_) => bits.into(),
            Number::Signed(_) => (bits as i32).into(),
        };
    }
    let size = number.size();
    let mut low = [0; 8];
    low[..size].copy_from_slice(&bytes[..size]);
    if order == Order::Big {
        low[..size].reverse();
    }
    let (bits, unused) = (u64::from_le_bytes(low), 64 - 8 * size as u32);
    match number {
        Number::Float(_) => f64::from_bits(bits),
        Number::Unsigned(_) => bits as f64,
        Number::Signed(_) => ((bits << unused) as i64 >> unused) as f64,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn camera_is_the_sensor_of_a_cloud() {
        // Both points lie in one row of cells, which the sensor sees from above.
        let cloud = |camera: &str| {
            let header = "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\n\
                          element camera 1\nproperty float view_px\nproperty float view_py\nproperty float view_pz\n\
                          property float x_axisx\nproperty int viewportx\nend_header\n0.5 0.5 0.5\n6.5 0.5 0.5\n";
            read(&ImportSpec::new("a.ply", format!("{header}{camera} 1 640\n").into_bytes())).unwrap()
        };
        let seen = cloud("0.5 0.5 3.5");
        let option = ImportOptions { sensor: Some([0.5, 0.5, 3.5]), ..ImportOptions::default() };
        let points = "0.5 0.5 0.5\n6.5 0.5 0.5\n";
        let asked = ImportSpec { options: option, ..ImportSpec::new("a.xyz", points.into()) }.read().unwrap();
        assert_eq!(seen.terrain, asked.terrain);
        assert!(seen.notes.iter().all(|note| note.name != "ignored"), "{:?}", seen.notes);
        assert_eq!(cloud("0 0 0").terrain, ImportSpec::new("a.xyz", points.into()).read().unwrap().terrain);
    }

    #[test]
    fn strips_of_triangles_are_a_mesh() {
        // A tetrahedron as one strip of all four corners and the first two again, and as two
        // strips.
        let read = |lists: &str| {
            let header = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
                          element tristrips 1\nproperty list int int vertex_indices\nend_header\n";
            let text = format!("{header}0 0 0\n9 0 0\n0 9 0\n0 0 9\n{lists}\n");
            let imported = read(&ImportSpec::new("a.ply", text.into_bytes())).unwrap();
            (mapgen::free_cells(&imported.terrain), imported.notes[0].text.clone())
        };
        let one = read("6 0 1 2 3 0 1");
        assert!(one.1.starts_with("4 triangles in 1 part(s), 0 dropped"), "{}", one.1);
        assert_eq!(read("10 0 1 2 3 -1 2 3 0 1 -1"), one);
    }
    use crate::ImportOptions;

    const ELEMENTS: &str = "element camera 1\nproperty list uchar short at\nelement vertex 2\nproperty double x\n\
                            property int8 y\ncomment of no use\nproperty float z\nelement edge 7\n\
                            property list uchar int vertices\nend_header\n";

    fn with_format(format: &str, data: &[u8]) -> ImportSpec {
        ImportSpec::new("a.ply", [format!("ply\r\nformat {format} 1.0\n{ELEMENTS}").as_bytes(), data].concat())
    }

    /// A camera with two numbers, and the vertices (1, -2, 0.5) and (3, 0, 0.5).
    fn data(is_big: bool) -> Vec<u8> {
        let f64s = |value: f64| if is_big { value.to_be_bytes() } else { value.to_le_bytes() };
        let f32s = |value: f32| if is_big { value.to_be_bytes() } else { value.to_le_bytes() };
        let vertex = |x: f64, y: u8| [f64s(x).as_slice(), &[y], &f32s(0.5)].concat();
        [vec![2, 1, 1, 1, 1], vertex(1.0, 0xfe), vertex(3.0, 0)].concat()
    }

    #[test]
    fn all_encodings_give_the_same_map() {
        let ascii = read(&with_format("ascii", b"2 5 5\n1 -2 0.5\r\n\n3 0 0.5\n3 0 1 2\n")).unwrap();
        assert_eq!(ascii.terrain.extent().size(), [5, 5, 3]);
        assert_eq!(mapgen::free_cells(&ascii.terrain), 9 - 2);
        assert_eq!(ascii.notes[0].text, "1 elements camera");
        assert_eq!(ascii.notes[1].text, "7 elements edge");
        assert_eq!(read(&with_format("binary_little_endian", &data(false))).unwrap(), ascii);
        assert_eq!(read(&with_format("binary_big_endian", &data(true))).unwrap(), ascii);
    }

    #[test]
    fn options_of_points_are_refused_with_faces() {
        let mesh = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
                    element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n4 0 0\n0 4 4\n3 0 1 2\n";
        let with = |options| ImportSpec { options, ..ImportSpec::new("a.ply", mesh.into()) }.read();
        let sensor = ImportOptions { sensor: Some([0.0; 3]), ..ImportOptions::default() };
        assert_eq!(
            with(sensor).unwrap_err().to_string(),
            "a.ply: sensor is an option for point clouds, and the file has faces; leave it out, or remove the faces"
        );
        let unknown = ImportOptions { unknown: Some(crate::options::Kind::Free), ..ImportOptions::default() };
        assert!(with(unknown).unwrap_err().to_string().contains("unknown is an option for point clouds"));
        assert!(with(ImportOptions::default()).is_ok());
    }

    #[test]
    fn errors_name_the_place() {
        let refuse = |text: &str| read(&ImportSpec::new("a.ply", text.into())).unwrap_err().to_string();
        assert_eq!(refuse("plx\n"), "line 1: the file begins with \"plx\", expected ply");
        assert_eq!(refuse("ply\nelement"), "line 2: the number of elements is missing");
        assert_eq!(refuse("ply\nproperty int x"), "line 2: a property before the first element");
        assert_eq!(refuse("ply\nelement a 1\nproperty long x"), "line 3: \"long\" is no type of a property");
        assert_eq!(refuse("ply\nend_header\n"), "line 2: the header ends without a format");
        assert_eq!(refuse("ply\nformat ascii 1.0\n"), "byte 21: the file ends within its header, before end_header");
        let without = "ply\nformat ascii 1.0\nend_header\n";
        assert_eq!(refuse(without), "byte 32: there is no element vertex in the header");
        let huge = "ply\nformat ascii 1.0\nelement none 18446744073709551615\nelement vertex 9\nproperty int x\n\
                    property int y\nproperty int z\nend_header\n1 2 3\n1 2\n";
        assert_eq!(refuse(huge), "line 10: a property is missing");
        let short = with_format("binary_little_endian", &data(false)[..20]);
        assert!(read(&short).unwrap_err().to_string().contains("the file ends here, a property takes 8 bytes"));
        let long_list = with_format("ascii", b"99999999 1\n");
        assert!(read(&long_list).unwrap_err().to_string().contains("a list is longer than its element may be"));
    }
}
