//! Export of maps: OctoMap's binary tree, and meshes of the walls' surface.
//!
//! The readers of the same formats are in [`super::import`]. Content is returned as bytes; no file
//! is written.

mod surface;

use std::fmt::Write;

use voxels::{Cell, Grid, Terrain};

use surface::rectangles;

/// Levels of a tree below its root.
const DEPTH: u32 = 16;

/// Brightness of free and occupied pixels, as the map server saves them.
const PLAN_FREE: u8 = 254;
const PLAN_OCCUPIED: u8 = 0;

/// Lengths in the header of a binary STL file.
const STL_TITLE: usize = 80;

/// A binary tree of OctoMap with all cells of the map; its origin is the lowest corner of the map.
#[must_use]
pub fn octomap(terrain: &Grid<Terrain>) -> Vec<u8> {
    let mut tree = Tree { terrain, nodes: Vec::new(), count: 1 };
    let middle = -(1 << (DEPTH - 1));
    let root = tree.add(Cell::new(middle, middle, middle), 1 << DEPTH);
    debug_assert!(root == Child::Inner, "a map is a small part of a tree");
    let header = format!(
        "# Octomap OcTree binary file\nid OcTree\nsize {}\nres {}\ndata\n",
        tree.count,
        terrain.extent().cell_m()
    );
    [header.into_bytes(), tree.nodes].concat()
}

/// The state of a child of a node, as its two bits.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Child {
    Unknown = 0,
    Free = 1,
    Occupied = 2,
    Inner = 3,
}

struct Tree<'a> {
    terrain: &'a Grid<Terrain>,
    /// Two bytes for each node that has children, before those of its children.
    nodes: Vec<u8>,
    /// Nodes and leaves.
    count: usize,
}

impl Tree<'_> {
    /// Adds the cube of cells with this lowest corner, unless all of it is the same.
    fn add(&mut self, corner: Cell, edge: i32) -> Child {
        let size = self.terrain.extent().size().map(|cells| cells as i32);
        let low = [corner.x, corner.y, corner.z];
        if (0..3).any(|axis| low[axis] >= size[axis] || low[axis] + edge <= 0) {
            return Child::Unknown;
        }
        if edge == 1 {
            return match self.terrain.get(corner) {
                Some(Terrain::Free) => Child::Free,
                Some(Terrain::Wall) => Child::Occupied,
                None => Child::Unknown,
            };
        }
        let (start, count) = (self.nodes.len(), self.count);
        self.nodes.extend([0; 2]);
        let half = edge / 2;
        let children: [Child; 8] = std::array::from_fn(|number| {
            let up = |axis: usize| if number >> axis & 1 == 1 { half } else { 0 };
            self.add(Cell::new(corner.x + up(0), corner.y + up(1), corner.z + up(2)), half)
        });
        if children[0] != Child::Inner && children.iter().all(|&child| child == children[0]) {
            self.nodes.truncate(start);
            self.count = count;
            return children[0];
        }
        self.count += children.iter().filter(|&&child| child != Child::Unknown).count();
        let bits = children.iter().rev().fold(0u16, |bits, &child| bits << 2 | child as u16);
        self.nodes[start..start + 2].copy_from_slice(&bits.to_le_bytes());
        Child::Inner
    }
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

/// The surface of the walls as a mesh in Wavefront's format, in metres; its normals point into free
/// space.
#[must_use]
pub fn obj(terrain: &Grid<Terrain>) -> Vec<u8> {
    let cell_m = terrain.extent().cell_m();
    let mut vertices = std::collections::BTreeMap::new();
    let mut faces = String::new();
    let mut text = format!("# the surface between wall and free cells, in metres, z up, cell_m = {cell_m:?}\n");
    for rectangle in rectangles(terrain) {
        faces.push('f');
        for corner in rectangle.corners() {
            let next = vertices.len() + 1;
            let number = *vertices.entry(corner).or_insert_with(|| {
                let [x, y, z] = corner.map(|along| f64::from(along) * cell_m);
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

/// The same as a binary STL file.
#[must_use]
pub fn stl(terrain: &Grid<Terrain>) -> Vec<u8> {
    let cell_m = terrain.extent().cell_m();
    let mut bytes = format!("the surface of walls, in metres, z up, cell_m = {cell_m:?}").into_bytes();
    bytes.resize(STL_TITLE, b' ');
    bytes.extend([0; 4]);
    let mut count = 0u32;
    for rectangle in rectangles(terrain) {
        let [a, b, c, d] = rectangle.corners().map(|corner| corner.map(|along| (f64::from(along) * cell_m) as f32));
        for corners in [[a, b, c], [a, c, d]] {
            let normal = rectangle.normal().map(|along| along as f32);
            let numbers = normal.into_iter().chain(corners.into_iter().flatten());
            bytes.extend(numbers.flat_map(f32::to_le_bytes));
            bytes.extend([0; 2]);
            count += 1;
        }
    }
    bytes[STL_TITLE..STL_TITLE + 4].copy_from_slice(&count.to_le_bytes());
    bytes
}

#[cfg(test)]
mod tests;
