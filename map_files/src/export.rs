//! Export of maps: OctoMap's binary tree, and meshes of the walls' surface.
//!
//! Content is returned as bytes; no file is written.

mod surface;

use std::fmt::Write;
use std::path::Path;

use voxels::octree::{self, DEPTH};
use voxels::{Cell, Grid, Terrain, m3dm, packed};

use super::{FormatError, cell_length};
use surface::triangles;

/// A writer of a file format. A new format is one, and its line in [`WRITERS`].
#[derive(Debug)]
pub struct MapWriter {
    /// The extension of its files, without the dot.
    pub extension: &'static str,
    write: fn(&Grid<Terrain>) -> Result<Vec<u8>, FormatError>,
}

/// All formats that are written.
pub const WRITERS: &[MapWriter] = &[
    MapWriter { extension: "m3dm", write: m3dm_file },
    MapWriter { extension: "txt", write: text_file },
    MapWriter { extension: "bt", write: |terrain| Ok(octomap(terrain, [0; 3])) },
    MapWriter { extension: "obj", write: |terrain| Ok(obj(terrain)) },
    MapWriter { extension: "stl", write: |terrain| Ok(stl(terrain)) },
    MapWriter { extension: "glb", write: |terrain| Ok(glb(terrain)) },
    MapWriter { extension: "pcd", write: |terrain| Ok(pcd(terrain)) },
    MapWriter { extension: "yaml", write: |_| Err(FormatError::TwoFiles) },
];

impl MapWriter {
    /// The writer of a file by the extension of its name, ignoring case.
    ///
    /// # Errors
    /// [`FormatError::NotWritten`], which lists the extensions that have one.
    pub fn of(file: &Path) -> Result<&'static Self, FormatError> {
        let extension = file.extension().unwrap_or_default().to_string_lossy();
        let writer = WRITERS.iter().find(|writer| extension.eq_ignore_ascii_case(writer.extension));
        writer.ok_or_else(|| FormatError::NotWritten(extension.into_owned()))
    }

    /// The bytes of a file, with the length of its cells.
    ///
    /// # Errors
    /// If the format takes two files ([`floor_plan`]), or if the memory for a text cannot be had.
    pub fn write(&self, terrain: &Grid<Terrain>) -> Result<Vec<u8>, FormatError> {
        (self.write)(terrain)
    }
}

/// A plain file, or a packed one where a plain one cannot hold the map: if it has more than 127
/// cells along an axis, or if its cells are not 1 m long.
fn m3dm_file(terrain: &Grid<Terrain>) -> Result<Vec<u8>, FormatError> {
    let plain = if terrain.extent().cell_m() == 1.0 { m3dm::write(terrain).ok() } else { None };
    Ok(plain.unwrap_or_else(|| packed::write(terrain)))
}

/// A text file with the length of its cells.
fn text_file(terrain: &Grid<Terrain>) -> Result<Vec<u8>, FormatError> {
    let mut text = cell_length::line(terrain.extent());
    text.try_reserve_exact(terrain.text_bytes()).map_err(|_| FormatError::Memory(terrain.as_slice().len()))?;
    terrain.append_text(&mut text);
    Ok(text.into_bytes())
}

/// Distance from a whole number of cells within which a place lies between cells.
const BETWEEN_CELLS: f64 = 1e-6;

/// Brightness of free and occupied pixels, as the map server saves them.
const PLAN_FREE: u8 = 254;
const PLAN_OCCUPIED: u8 = 0;

/// Lengths in the header of a binary STL file.
const STL_TITLE: usize = 80;

/// Where the lowest corner of a map with this place, metres, and turn, radians, lies in a tree of
/// OctoMap, in cells; `None` if that is not between cells of the tree, or beyond it.
#[must_use]
pub fn octomap_corner(terrain: &Grid<Terrain>, place: [f64; 3], yaw_rad: f64) -> Option<[i32; 3]> {
    let extent = terrain.extent();
    let half = f64::from(1u32 << (DEPTH - 1));
    let along = |axis: usize| {
        let cells = place[axis] / extent.cell_m();
        let whole = libm::round(cells);
        let is_between = (cells - whole).abs() <= BETWEEN_CELLS;
        let is_inside = whole >= -half && whole + f64::from(extent.size()[axis]) <= half;
        (is_between && is_inside && yaw_rad == 0.0).then_some(whole as i32)
    };
    Some([along(0)?, along(1)?, along(2)?])
}

/// A binary tree of OctoMap with all cells of the map, whose lowest corner lies there, in cells
/// from the origin; see [`octomap_corner`].
#[must_use]
pub fn octomap(terrain: &Grid<Terrain>, corner: [i32; 3]) -> Vec<u8> {
    let tree = octree::binary_tree(terrain.extent(), corner, |cell| terrain.get(cell).copied());
    let header = format!(
        "# Octomap OcTree binary file\nid OcTree\nsize {}\nres {}\ndata\n",
        tree.count,
        terrain.extent().cell_m()
    );
    [header.into_bytes(), tree.nodes].concat()
}

/// A map of ROS 2's map server.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FloorPlan {
    /// The `map.yaml`.
    pub yaml: Vec<u8>,
    /// The picture that it names, a binary PGM.
    pub image: Vec<u8>,
    /// The layer of cells that it shows.
    pub layer: u32,
}

/// The layer of a map with most free cells, the lowest of several, as a map of ROS 2's map server.
/// `image` is the name of its picture, `origin` the place of the map's lowest corner (x and y in
/// metres) with the turn about it in radians.
#[must_use]
pub fn floor_plan(terrain: &Grid<Terrain>, image: &str, [x, y, yaw]: [f64; 3]) -> FloorPlan {
    let [size_x, size_y, _] = terrain.extent().size();
    let layer_cells = size_x as usize * size_y as usize;
    let free = |layer: &[Terrain]| layer.iter().filter(|&&cell| cell == Terrain::Free).count();
    let layers = terrain.as_slice().chunks(layer_cells).enumerate();
    let lowest = |(number, layer): &(usize, &[Terrain])| (free(layer), std::cmp::Reverse(*number));
    let (layer, cells) = layers.max_by_key(lowest).unwrap_or_default();
    let mut picture = format!("P5\n{size_x} {size_y}\n255\n").into_bytes();
    for row in cells.chunks(size_x as usize).rev() {
        picture.extend(row.iter().map(|&cell| if cell == Terrain::Free { PLAN_FREE } else { PLAN_OCCUPIED }));
    }
    let cell_m = terrain.extent().cell_m();
    let yaml = format!(
        "image: {image:?}\nmode: trinary\nresolution: {cell_m:?}\norigin: [{x:?}, {y:?}, {yaw:?}]\nnegate: 0\n\
         occupied_thresh: 0.65\nfree_thresh: 0.25\n"
    );
    FloorPlan { yaml: yaml.into_bytes(), image: picture, layer: layer as u32 }
}

/// The surface of the free space as a mesh of triangles in Wavefront's format, in metres, which is
/// closed; its triangles face the wall.
#[must_use]
pub fn obj(terrain: &Grid<Terrain>) -> Vec<u8> {
    let cell_m = terrain.extent().cell_m();
    let mut vertices = std::collections::BTreeMap::new();
    let mut faces = String::new();
    let mut text = format!("# the surface between wall and free cells, in metres, z up, cell_m = {cell_m:?}\n");
    for triangle in triangles(terrain) {
        faces.push('f');
        for corner in triangle.corners {
            let next = vertices.len() + 1;
            let number = *vertices.entry(corner).or_insert_with(|| {
                let [x, y, z] = corner.map(|along| f64::from(along) / 2.0 * cell_m);
                // Writing to a string cannot fail.
                let _ = writeln!(text, "v {x} {y} {z}");
                next
            });
            let _ = write!(faces, " {number}");
        }
        faces.push('\n');
    }
    text.push_str(&faces);
    text.into_bytes()
}

/// The surface of walls as a binary STL file.
#[must_use]
pub fn stl(terrain: &Grid<Terrain>) -> Vec<u8> {
    let cell_m = terrain.extent().cell_m();
    let mut bytes = format!("the surface of walls, in metres, z up, cell_m = {cell_m:?}").into_bytes();
    bytes.resize(STL_TITLE, b' ');
    let triangles = triangles(terrain);
    bytes.extend((triangles.len() as u32).to_le_bytes());
    for triangle in triangles {
        let corners = triangle.corners.into_iter().flatten().map(|along| (f64::from(along) / 2.0 * cell_m) as f32);
        let numbers = triangle.normal.into_iter().map(f32::from).chain(corners);
        bytes.extend(numbers.flat_map(f32::to_le_bytes));
        bytes.extend([0; 2]);
    }
    bytes
}

/// The same as a scene of glTF in one piece, in metres; y is upwards, as glTF has it.
#[must_use]
pub fn glb(terrain: &Grid<Terrain>) -> Vec<u8> {
    let cell_m = terrain.extent().cell_m();
    let mut numbers = std::collections::BTreeMap::new();
    let (mut places, mut corners): (Vec<[f32; 3]>, Vec<u32>) = (Vec::new(), Vec::new());
    for corner in triangles(terrain).into_iter().flat_map(|triangle| triangle.corners) {
        let next = numbers.len() as u32;
        let number = *numbers.entry(corner).or_insert_with(|| {
            let [x, y, z] = corner.map(|along| (f64::from(along) / 2.0 * cell_m) as f32);
            // Of -0 some readers make another vertex than of 0.
            places.push([x, z, 0.0 - y]);
            next
        });
        corners.push(number);
    }
    let along = |axis: usize| places.iter().map(move |place| place[axis]);
    let low = [0, 1, 2].map(|axis| along(axis).fold(f32::INFINITY, f32::min));
    let high = [0, 1, 2].map(|axis| along(axis).fold(f32::NEG_INFINITY, f32::max));
    let (vertices, length) = (12 * places.len(), 12 * places.len() + 4 * corners.len());
    let mut document = serde_json::json!({
        "asset": { "version": "2.0", "generator": "maes", "extras": { "cell_m": cell_m } },
        "scene": 0,
        "scenes": [{ "nodes": [] }],
    });
    // A map without free cells has no surface, and glTF no empty buffers.
    if !places.is_empty() {
        document["scenes"] = serde_json::json!([{ "nodes": [0] }]);
        document["nodes"] = serde_json::json!([{ "name": "surface", "mesh": 0 }]);
        document["meshes"] = serde_json::json!([{ "primitives": [{ "attributes": { "POSITION": 0 }, "indices": 1 }] }]);
        document["buffers"] = serde_json::json!([{ "byteLength": length }]);
        document["bufferViews"] = serde_json::json!([
            { "buffer": 0, "byteLength": vertices, "target": 34962 },
            { "buffer": 0, "byteOffset": vertices, "byteLength": length - vertices, "target": 34963 },
        ]);
        document["accessors"] = serde_json::json!([
            { "bufferView": 0, "componentType": 5126, "count": places.len(), "type": "VEC3", "min": low, "max": high },
            { "bufferView": 1, "componentType": 5125, "count": corners.len(), "type": "SCALAR" },
        ]);
    }
    let mut text = document.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let places = places.into_iter().flatten().flat_map(f32::to_le_bytes);
    let binary: Vec<u8> = places.chain(corners.into_iter().flat_map(u32::to_le_bytes)).collect();
    let chunk = |kind: &[u8; 4], content: &[u8]| [&(content.len() as u32).to_le_bytes(), &kind[..], content].concat();
    let mut chunks = chunk(b"JSON", &text);
    if !binary.is_empty() {
        chunks.extend(chunk(b"BIN\0", &binary));
    }
    [&b"glTF"[..], &2u32.to_le_bytes(), &(12 + chunks.len() as u32).to_le_bytes(), &chunks].concat()
}

/// The walls that touch free cells, if only at a corner, as a point cloud: the centre of each cell,
/// in metres.
#[must_use]
pub fn pcd(terrain: &Grid<Terrain>) -> Vec<u8> {
    let extent = terrain.extent();
    let cell_m = extent.cell_m();
    let around = || (0..27).map(|number| Cell::new(number % 3 - 1, number / 3 % 3 - 1, number / 9 - 1));
    let is_free = |cell: Cell| terrain.get(cell) == Some(&Terrain::Free);
    let walls = terrain.iter().filter(|&(_, &here)| here == Terrain::Wall).map(|(cell, _)| cell);
    let surface = walls.filter(|&cell| around().any(|step| is_free(cell + step)));
    let places: Vec<u8> = surface
        .flat_map(|cell| [cell.x, cell.y, cell.z])
        .flat_map(|along| (((f64::from(along) + 0.5) * cell_m) as f32).to_le_bytes())
        .collect();
    let count = places.len() / 12;
    let header = format!(
        "# .PCD v0.7 - the surface of walls, z up, cell_m = {cell_m:?}\nVERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\n\
         COUNT 1 1 1\nWIDTH {count}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {count}\nDATA binary\n"
    );
    [header.into_bytes(), places].concat()
}

#[cfg(test)]
mod tests;
