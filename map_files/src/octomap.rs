//! Trees of OctoMap: free, occupied and unknown cells.
//!
//! **Binary trees (`.bt`).** A text header with the resolution, then the tree, its nodes before
//! their children: two bytes for each node that has children, with two bits for each child, from
//! the lowest bits on. 00: unknown, 01: free, 10: occupied, 11: has children, which follow.
//!
//! **Full trees (`.ot`).** After a header of the same kind, each node has the logarithm of its odds
//! of being occupied as four bytes, in `ColorOcTree` three more, and a byte with a bit for each
//! child, which follow. A leaf is occupied from even odds on.
//!
//! Child i is on the upper side of x if bit 0 of i is set, of y if bit 1 is, of z if bit 2 is. Both
//! trees are 16 levels deep, and the origin of the file is their middle.

use voxels::{Cell, Extent, Terrain};

use super::bytes::{Bytes, number, shown, words};
use super::cloud::keep_from;
use super::options::Kind;
use super::{FormatError, ImportSpec, Imported, MapReader, Note, new_grid, surrounded};

/// A tree of OctoMap, binary or full.
pub(super) const READER: MapReader = MapReader {
    stored_cell_m: Some(|bytes| resolution_m(bytes).ok()),
    ..MapReader::new("tree of OctoMap", &["bt", "ot"], &["unknown", "free_from", "cells_max"], read)
};

/// Levels of the tree below its root.
const DEPTH: u32 = 16;

/// The state of a leaf.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Leaf {
    Free,
    Occupied,
}

/// A map of a tree.
///
/// # Errors
/// If the file is malformed, or the known cells do not fit into a map.
pub(super) fn read(spec: &ImportSpec) -> Result<Imported, FormatError> {
    let mut bytes = Bytes::new(&spec.bytes);
    let Header { resolution_m, kind } = header(&mut bytes)?;
    let (start, tree) = (bytes.at(), bytes.rest());
    let mut low = [u32::MAX; 3];
    let mut high = [0; 3];
    let left = walk(kind, tree, start, |_, corner, edge| {
        for axis in 0..3 {
            low[axis] = low[axis].min(corner[axis]);
            high[axis] = high[axis].max(corner[axis] + edge);
        }
    })?;
    if high == [0; 3] {
        return Err(FormatError::Nothing("cell that is free or occupied"));
    }
    let extent =
        Extent::new([0, 1, 2].map(|axis| high[axis] - low[axis]), resolution_m).map_err(FormatError::Extent)?;
    let unknown = match spec.options.unknown.unwrap_or(Kind::Wall) {
        Kind::Wall => Terrain::Wall,
        Kind::Free => Terrain::Free,
    };
    let mut terrain = new_grid(extent, unknown, spec)?;
    let mut known = [0u64; 2];
    walk(kind, tree, start, |leaf, corner, edge| {
        let first = [0, 1, 2].map(|axis| (corner[axis] - low[axis]) as i32);
        let edge = edge as i32;
        let here = if leaf == Leaf::Free { Terrain::Free } else { Terrain::Wall };
        known[here as usize] += (edge as u64).pow(3);
        for (z, y) in (0..edge).flat_map(|z| (0..edge).map(move |y| (z, y))) {
            let row = extent.index(Cell::new(first[0], first[1] + y, first[2] + z)).expect("leaves are in the extent");
            terrain.as_mut_slice()[row..row + edge as usize].fill(here);
        }
    })?;

    let [free, occupied] = known;
    let rest = extent.volume() as u64 - free - occupied;
    let becomes = if unknown == Terrain::Wall { "wall" } else { "free" };
    let text = format!("{occupied} occupied, {free} free, {rest} unknown, which become {becomes}");
    let mut notes = vec![Note::new("tree", text)];
    notes.extend((left > 0).then(|| Note::new("ignored", format!("{left} bytes after the tree"))));
    let (mut terrain, closed) = surrounded(terrain, spec)?;
    let layers = if closed.is_some() { 1.0 } else { 0.0 };
    notes.extend(closed);
    let begin = low.map(|along| f64::from(along) - f64::from(1 << (DEPTH - 1)) - layers);
    let [x, y, z] = begin.map(|along| along * resolution_m);
    notes.push(Note::new("origin", format!("the map begins at ({x}, {y}, {z}) m of the file")));
    notes.extend(keep_from(&mut terrain, spec.options.free_from, |place| {
        let [x, y, z] = [0, 1, 2].map(|axis| libm::floor(place[axis] / resolution_m - begin[axis]) as i32);
        Cell::new(x, y, z)
    })?);
    Ok(Imported { terrain, notes, stores_cell_m: true, origin_m: Some([x, y, z]), yaw_rad: 0.0 })
}

/// The resolution in the header, metres.
///
/// # Errors
/// If the header is malformed.
pub(super) fn resolution_m(bytes: &[u8]) -> Result<f64, FormatError> {
    Ok(header(&mut Bytes::new(bytes))?.resolution_m)
}

/// The encoding of a tree.
#[derive(Clone, Copy)]
enum Tree {
    /// Two bits for each child.
    Binary,
    /// Nodes with so many bytes of data.
    Full(usize),
}

struct Header {
    resolution_m: f64,
    kind: Tree,
}

fn header(bytes: &mut Bytes<'_>) -> Result<Header, FormatError> {
    let mut resolution_m = None;
    let (mut is_full, mut node_bytes) = (false, 4);
    loop {
        let (at, line) = bytes.header_line("data")?;
        if at == 1 {
            is_full = line.starts_with(b"# Octomap OcTree file");
            if !is_full && !line.starts_with(b"# Octomap OcTree binary file") {
                let reason = format!(
                    "the file begins with {}, expected # Octomap OcTree binary file or # Octomap OcTree file",
                    shown(line)
                );
                return Err(FormatError::line(at, reason));
            }
        }
        let mut words = words(line);
        match words.next() {
            Some(b"id") => {
                let id = words.next().unwrap_or_default();
                // Trees with colours have the same binary form.
                if !matches!(id, b"OcTree" | b"ColorOcTree") {
                    return Err(FormatError::line(at, format!("id {}, expected OcTree", shown(id))));
                }
                node_bytes = if id == b"OcTree" { 4 } else { 7 };
            }
            Some(b"res") => {
                let metres: f64 = number(at, words.next(), "res")?;
                Extent::new([1; 3], metres).map_err(|reason| FormatError::line(at, reason.to_string()))?;
                resolution_m = Some(metres);
            }
            Some(b"data") => {
                let kind = if is_full { Tree::Full(node_bytes) } else { Tree::Binary };
                let missing = || FormatError::line(at, "data without a line res before them");
                return Ok(Header { resolution_m: resolution_m.ok_or_else(missing)?, kind });
            }
            // Comments, and the number of nodes, which follows from the tree.
            _ => {}
        }
    }
}

/// Visits all leaves of a tree with their lowest corners and edges, in cells from the lowest corner
/// of the tree; returns how many bytes follow it. The tree begins at byte `start` of the file.
fn walk(
    kind: Tree,
    tree: &[u8],
    start: usize,
    mut leaf: impl FnMut(Leaf, [u32; 3], u32),
) -> Result<usize, FormatError> {
    if tree.is_empty() {
        return Ok(0);
    }
    if let Tree::Full(node_bytes) = kind {
        return walk_full(tree, start, node_bytes, leaf);
    }
    let mut at = 0;
    // Nodes with children that are to come, the next one last: their lowest corners and edges.
    let mut open = vec![([0; 3], 1u32 << DEPTH)];
    while let Some((corner, edge)) = open.pop() {
        let Some(&[first, second]) = tree.get(at..at + 2) else {
            let reason = format!("the file ends within the tree, {} nodes are missing", open.len() + 1);
            return Err(FormatError::byte(start + tree.len(), reason));
        };
        let children = u16::from_le_bytes([first, second]);
        let half = edge / 2;
        for child in (0..8).rev() {
            let corner = [0, 1, 2].map(|axis| corner[axis] + half * (child >> axis & 1));
            match children >> (2 * child) & 3 {
                1 => leaf(Leaf::Free, corner, half),
                2 => leaf(Leaf::Occupied, corner, half),
                3 if half > 1 => open.push((corner, half)),
                3 => {
                    return Err(FormatError::byte(
                        start + at,
                        format!("child {child} is below level {DEPTH}, and has children"),
                    ));
                }
                _ => {}
            }
        }
        at += 2;
    }
    Ok(tree.len() - at)
}

/// As [`walk`], of a full tree.
fn walk_full(
    tree: &[u8],
    start: usize,
    node_bytes: usize,
    mut leaf: impl FnMut(Leaf, [u32; 3], u32),
) -> Result<usize, FormatError> {
    let mut at = 0;
    let mut open = vec![([0; 3], 1u32 << DEPTH)];
    while let Some((corner, edge)) = open.pop() {
        let Some(node) = tree.get(at..=at + node_bytes) else {
            let reason = format!("the file ends within the tree, {} nodes are missing", open.len() + 1);
            return Err(FormatError::byte(start + tree.len(), reason));
        };
        let children = node[node_bytes];
        if children == 0 {
            let log_odds = f32::from_le_bytes([node[0], node[1], node[2], node[3]]);
            leaf(if log_odds >= 0.0 { Leaf::Occupied } else { Leaf::Free }, corner, edge);
        } else if edge == 1 {
            return Err(FormatError::byte(start + at, format!("a node of level {DEPTH} has children")));
        }
        let half = edge / 2;
        let child = |child: u32| ([0, 1, 2].map(|axis| corner[axis] + half * (child >> axis & 1)), half);
        open.extend((0..8).rev().filter(|number| children >> number & 1 == 1).map(child));
        at += node_bytes + 1;
    }
    Ok(tree.len() - at)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ImportOptions, export};
    use mapgen::free_cells;
    use voxels::Grid;

    const HEADER: &str = "# Octomap OcTree binary file\n# of no use\nid OcTree\nsize 17\nres 0.25\ndata\n";

    /// The way down to the eight cells around (0, 0, 0) on their upper side, then these cells.
    fn lowest(children: u16) -> ImportSpec {
        let path = std::iter::once(0b11u16 << 14).chain([0b11; 14]).chain([children]);
        let tree: Vec<u8> = path.flat_map(u16::to_le_bytes).collect();
        ImportSpec::new("a.bt", [HEADER.as_bytes(), &tree].concat())
    }

    #[test]
    fn cells_are_free_occupied_or_unknown() {
        // Free at (0, 0, 0), occupied at (1, 0, 0), free at (0, 1, 1).
        let spec = lowest(0b01 | 0b10 << 2 | 0b01 << 12);
        let Imported { terrain, notes, stores_cell_m, .. } = read(&spec).unwrap();
        assert_eq!((terrain.extent().cell_m(), stores_cell_m), (0.25, true));
        assert_eq!(terrain.extent().size(), [4; 3]);
        let wall = "####\n".repeat(4);
        let layers = ["####\n####\n#.##\n####\n", "####\n#.##\n####\n####\n"];
        assert_eq!(terrain.to_text(), [&wall, layers[0], layers[1], &wall].join("\n"));
        assert_eq!(notes[0].text, "1 occupied, 2 free, 5 unknown, which become wall");
        assert_eq!(notes[2].text, "the map begins at (-0.25, -0.25, -0.25) m of the file");

        let options = ImportOptions { unknown: Some(Kind::Free), ..ImportOptions::default() };
        assert_eq!(free_cells(&read(&ImportSpec { options, ..spec.clone() }).unwrap().terrain), 7);
        let options = ImportOptions { free_from: Some([0.1, 0.1, 0.1]), ..ImportOptions::default() };
        assert_eq!(free_cells(&read(&ImportSpec { options, ..spec }).unwrap().terrain), 1);
    }

    #[test]
    fn full_trees_have_odds() {
        let node = |log_odds: f32, children: u8, extra: &[u8]| [&log_odds.to_le_bytes(), extra, &[children]].concat();
        let tree = |extra: &[u8]| {
            // Down to the eight cells on the upper side of the middle, of which two are known.
            let path = std::iter::once(node(0.5, 1 << 7, extra)).chain((0..14).map(|_| node(0.5, 1, extra)));
            let leaves = [node(0.5, 0b1001, extra), node(-0.4, 0, extra), node(0.85, 0, extra)];
            path.chain(leaves).flatten().collect::<Vec<u8>>()
        };
        let read_tree = |id: &str, tree: &[u8]| {
            let header = format!("# Octomap OcTree file\nid {id}\nsize 18\nres 0.25\ndata\n");
            read(&ImportSpec::new("a.ot", [header.as_bytes(), tree].concat()))
        };
        let plain = read_tree("OcTree", &tree(&[])).unwrap();
        assert_eq!(plain.notes[0].text, "1 occupied, 1 free, 2 unknown, which become wall");
        assert_eq!(plain.terrain.extent().size(), [4, 4, 3]);
        assert_eq!(read_tree("ColorOcTree", &tree(&[1, 2, 3])).unwrap(), plain);
        let error = read_tree("OcTree", &tree(&[])[..50]).unwrap_err().to_string();
        assert!(error.ends_with("the file ends within the tree, 1 nodes are missing"), "{error}");
    }

    #[test]
    fn written_tree_merges_equal_cells() {
        let solid = Grid::new(Extent::new([64; 3], 0.1).unwrap(), Terrain::Wall);
        let bytes = export::octomap(&solid);
        assert!(bytes.ends_with(&[&b"data\n"[..], &[0, 0xc0], &[3, 0].repeat(8), &[2, 0]].concat()), "{bytes:?}");
        assert_eq!(read(&ImportSpec::new("a.bt", bytes)).unwrap().terrain, solid);
    }

    #[test]
    fn errors_name_the_place() {
        let refuse = |text: &str| read(&ImportSpec::new("a.bt", text.into())).unwrap_err().to_string();
        assert_eq!(
            refuse("x\n"),
            "line 1: the file begins with \"x\", expected # Octomap OcTree binary file or # Octomap OcTree file"
        );
        let header = |rest: &str| refuse(&format!("# Octomap OcTree binary file\n{rest}"));
        assert_eq!(header("id Tree"), "line 2: id \"Tree\", expected OcTree");
        assert_eq!(header("res 0"), "line 2: cell_m is 0, allowed are finite lengths in metres above 0");
        assert_eq!(header("data\n"), "line 2: data without a line res before them");
        assert_eq!(refuse(HEADER), "the file has no cell that is free or occupied");
        let bytes = |tree: &[u8]| ImportSpec::new("a.bt", [HEADER.as_bytes(), tree].concat());
        let refuse = |tree: &[u8]| read(&bytes(tree)).unwrap_err().to_string();
        assert_eq!(refuse(&[3]), "byte 74: the file ends within the tree, 1 nodes are missing");
        assert_eq!(refuse(&[0x0f, 0, 1, 0]), "byte 77: the file ends within the tree, 1 nodes are missing");
        assert_eq!(refuse(&[1, 0]), "map size along x is 32768 cells, allowed are 1 to 1024");
        let deep = [3, 0].repeat(16);
        assert_eq!(refuse(&deep), "byte 103: child 0 is below level 16, and has children");
    }
}
