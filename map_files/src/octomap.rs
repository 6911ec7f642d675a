//! Trees of OctoMap: free, occupied and unknown cells.
//!
//! **Binary trees (`.bt`).** A text header with the resolution, then the tree, its nodes before
//! their children: two bytes for each node that has children, with two bits for each child, from
//! the lowest bits on. 00: unknown, 01: free, 10: occupied, 11: has children, which follow.
//!
//! **Full trees (`.ot`).** After a header of the same kind, each node has the logarithm of its odds
//! of being occupied as four bytes, in `ColorOcTree` three more, and a byte with a bit for each
//! child, which follow. A leaf is occupied from even odds on. Nodes of a tree that is not known
//! have the length that follows from their number.
//!
//! Child i is on the upper side of x if bit 0 of i is set, of y if bit 1 is, of z if bit 2 is. Both
//! trees are 16 levels deep, and the origin of the file is their middle.
//!
//! **Longer cells.** A cell of several of the tree's is occupied if one of these is, else free if
//! one is, as inner nodes of OctoMap have the largest odds of their known children. Such cells lie
//! on multiples of their length from the origin of the file.

use voxels::octree::DEPTH;
use voxels::{Cell, Extent, ExtentError, Terrain};

use super::bytes::{Bytes, number, shown, words};
use super::cloud::keep_from;
use super::frame::Bounds;
use super::options::Kind;
use super::{FormatError, ImportSpec, Imported, MapReader, Note, new_grid, surrounded};

/// A tree of OctoMap, binary or full.
pub(super) const READER: MapReader = MapReader {
    stored_cell_m: Some(|bytes| resolution_m(bytes).ok()),
    ..MapReader::new(
        "tree of OctoMap",
        &["bt", "ot"],
        &["unknown", "crop", "free_from", "gap_cells", "cells_max"],
        read,
    )
};

/// Cells of the tree between its lowest corner and the origin of the file.
const MIDDLE: i32 = 1 << (DEPTH - 1);

/// Most bytes of a node with its children, of a tree that is not known.
const NODE_BYTES_MAX: usize = 256;

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
    let header = header(&mut bytes)?;
    let (start, tree) = (bytes.at(), bytes.rest());
    let (kind, note_of_kind) = header.tree(tree.len())?;
    let cell_m = spec.cell_m.unwrap_or(header.resolution_m);
    let times = libm::round(cell_m / header.resolution_m);
    let is_multiple = times >= 1.0 && (cell_m - times * header.resolution_m).abs() <= 1e-9 * cell_m;
    if !is_multiple || times > f64::from(MIDDLE) {
        return Err(FormatError::NoMultiple { stored: header.resolution_m, asked: cell_m });
    }
    let times = times as i32;
    let crop = crop(spec, cell_m);
    let mut bounds: Option<[[i32; 3]; 2]> = None;
    let left = walk(kind, tree, start, |_, corner, edge| {
        let Some([low, high]) = crop(coarse(corner, edge, times)) else { return };
        let [lowest, highest] = bounds.unwrap_or([low, high]);
        bounds = Some([
            [0, 1, 2].map(|axis| lowest[axis].min(low[axis])),
            [0, 1, 2].map(|axis| highest[axis].max(high[axis])),
        ]);
    })?;
    let lacks = "cell that is free or occupied";
    let lacks =
        if spec.options.crop.is_some() { "cell inside the box of crop that is free or occupied" } else { lacks };
    let [low, high] = bounds.ok_or(FormatError::Nothing(lacks))?;
    let size = [0, 1, 2].map(|axis| (high[axis] - low[axis]) as u32);
    let extent = Extent::new(size, cell_m).map_err(|reason| match reason {
        reason @ ExtentError::Size { .. } => {
            FormatError::Box { reason, cell_m, advice: longer_cells(size, cell_m, times) }
        }
        reason => FormatError::Extent(reason),
    })?;
    let unknown = match spec.options.unknown.unwrap_or(Kind::Wall) {
        Kind::Wall => Terrain::Wall,
        Kind::Free => Terrain::Free,
    };
    let mut terrain = new_grid(extent, unknown, spec)?;
    let mut known = [0u64; 2];
    // Occupied cells after free ones, which may share a longer cell.
    for pass in [Leaf::Free, Leaf::Occupied] {
        walk(kind, tree, start, |leaf, corner, edge| {
            if leaf != pass {
                return;
            }
            let Some([first, end]) = crop(coarse(corner, edge, times)) else { return };
            known[usize::from(leaf == Leaf::Occupied)] += if times == 1 {
                (0..3).map(|axis| (end[axis] - first[axis]) as u64).product()
            } else {
                u64::from(edge).pow(3)
            };
            let [first, end] = [first, end].map(|place| [0, 1, 2].map(|axis| place[axis] - low[axis]));
            let here = if leaf == Leaf::Free { Terrain::Free } else { Terrain::Wall };
            for (z, y) in (first[2]..end[2]).flat_map(|z| (first[1]..end[1]).map(move |y| (z, y))) {
                let row = extent.index(Cell::new(first[0], y, z)).expect("leaves are in the extent");
                terrain.as_mut_slice()[row..row + (end[0] - first[0]) as usize].fill(here);
            }
        })?;
    }

    let [free, occupied] = known;
    let of_tree = extent.volume() as u64 * (times as u64).pow(3);
    if free == 0 && occupied < of_tree && spec.options.unknown.is_none() {
        let reason = format!(
            "it has {occupied} occupied cells and no free one; map.import.unknown = \"free\" (--unknown free) takes all \
             others for free"
        );
        return Err(FormatError::Entry { place: "the tree".to_owned(), reason });
    }
    let becomes = if unknown == Terrain::Wall { "wall" } else { "free" };
    let text = if times == 1 {
        let rest = extent.volume() as u64 - free - occupied;
        format!("{occupied} occupied, {free} free, {rest} unknown, which become {becomes}")
    } else {
        format!(
            "{occupied} occupied and {free} free of {} m; {times} of these along a cell, wall if one is occupied, else \
             free if one is; unknown ones become {becomes}",
            header.resolution_m
        )
    };
    let mut notes = vec![Note::new("tree", text)];
    notes.extend(note_of_kind);
    notes.extend((left > 0).then(|| Note::new("ignored", format!("{left} bytes after the tree"))));
    let (mut terrain, closed) = surrounded(terrain)?;
    let layers = if closed.is_some() { 1.0 } else { 0.0 };
    notes.extend(closed);
    let begin = low.map(|along| f64::from(along) - layers);
    let [x, y, z] = begin.map(|along| along * cell_m);
    notes.push(Note::new("origin", format!("the map begins at ({x}, {y}, {z}) m of the file")));
    notes.extend(keep_from(&mut terrain, &spec.options, |place| {
        let [x, y, z] = [0, 1, 2].map(|axis| libm::floor(place[axis] / cell_m - begin[axis]) as i32);
        Cell::new(x, y, z)
    })?);
    Ok(Imported { terrain, notes, stores_cell_m: true, origin_m: Some([x, y, z]), yaw_rad: 0.0 })
}

/// The part of a box of cells, the first ones and those after the last, in the box of the option
/// `crop`; `None` if there is none.
fn crop(spec: &ImportSpec, cell_m: f64) -> impl Fn([[i32; 3]; 2]) -> Option<[[i32; 3]; 2]> {
    let crop = spec.options.crop.map(|corners| {
        let [x, y, z, to_x, to_y, to_z] = corners.map(|along| along / cell_m);
        Bounds { low: [x, y, z], high: [to_x, to_y, to_z] }.cells()
    });
    move |[low, high]| {
        let [first, end] = crop.unwrap_or([low, high]);
        let low = [0, 1, 2].map(|axis| low[axis].max(first[axis]));
        let high = [0, 1, 2].map(|axis| high[axis].min(end[axis]));
        (0..3).all(|axis| low[axis] < high[axis]).then_some([low, high])
    }
}

/// The cells, of `times` cells of the tree along each edge, in which a leaf lies: the first ones
/// and those after the last, counted from the origin of the file.
fn coarse(corner: [u32; 3], edge: u32, times: i32) -> [[i32; 3]; 2] {
    let from_origin = corner.map(|along| along as i32 - MIDDLE);
    [
        from_origin.map(|along| along.div_euclid(times)),
        from_origin.map(|along| (along + edge as i32 - 1).div_euclid(times) + 1),
    ]
}

/// The shortest length of cells with which a map of this size fits, as advice.
fn longer_cells(size: [u32; 3], cell_m: f64, times: i32) -> String {
    let longest = size.into_iter().max().unwrap_or(1);
    // One cell more, because longer cells need not begin where the map does.
    let most = Extent::AXIS_MAX - 1;
    let factor = longest.div_ceil(most);
    let resolution_m = cell_m / f64::from(times);
    format!(
        "with map.cell_m (--cell-m) = {} or more, a multiple of {resolution_m}, it fits",
        f64::from(factor) * cell_m
    )
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
    id: String,
    is_full: bool,
    /// Nodes and leaves.
    nodes: Option<usize>,
}

impl Header {
    /// The encoding of the tree, which has so many bytes, and a note if it is not known.
    ///
    /// # Errors
    /// If it follows from nothing.
    fn tree(&self, bytes: usize) -> Result<(Tree, Option<Note>), FormatError> {
        if !self.is_full {
            // All kinds of trees have the same binary form.
            return Ok((Tree::Binary, None));
        }
        match self.id.as_str() {
            // The stamp of a node is not written.
            "OcTree" | "OcTreeStamped" => return Ok((Tree::Full(4), None)),
            "ColorOcTree" => return Ok((Tree::Full(7), None)),
            _ => {}
        }
        let id = shown(self.id.as_bytes());
        let each = self.nodes.filter(|&nodes| nodes > 0 && bytes.is_multiple_of(nodes)).map(|nodes| bytes / nodes);
        let Some(node_bytes) = each.filter(|each| (5..=NODE_BYTES_MAX).contains(each)) else {
            let reason = format!(
                "it is of kind {id}, whose nodes are not known, as their number does not fit the length of the file; write \
                 it as a binary tree (.bt)"
            );
            return Err(FormatError::Entry { place: "the tree".to_owned(), reason });
        };
        let text = format!(
            "of kind {id}, which is not known: the first 4 of {} bytes of each node are taken for its odds",
            node_bytes - 1
        );
        Ok((Tree::Full(node_bytes - 1), Some(Note::new("tree", text))))
    }
}

fn header(bytes: &mut Bytes<'_>) -> Result<Header, FormatError> {
    let mut resolution_m = None;
    let (mut is_full, mut id, mut nodes) = (false, "OcTree".to_owned(), None);
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
            Some(b"id") => id = String::from_utf8_lossy(words.next().unwrap_or_default()).into_owned(),
            Some(b"size") => nodes = number(at, words.next(), "size").ok(),
            Some(b"res") => {
                let metres: f64 = number(at, words.next(), "res")?;
                Extent::new([1; 3], metres).map_err(|reason| FormatError::line(at, reason.to_string()))?;
                resolution_m = Some(metres);
            }
            Some(b"data") => {
                let missing = || FormatError::line(at, "data without a line res before them");
                return Ok(Header { resolution_m: resolution_m.ok_or_else(missing)?, id, is_full, nodes });
            }
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
    fn longer_cells_are_those_of_octomap() {
        // Free at (0, 0, 0) and (0, 1, 1), occupied at (1, 0, 0), all in one cell of 0.5 m; free at
        // (-1, -1, -1) in another one, whose other cells are unknown.
        let upper = std::iter::once(0b11u16 << 14 | 0b11).chain([0b11; 14]).chain([0b01 | 0b10 << 2 | 0b01 << 12]);
        let lower = std::iter::repeat_n(0b11u16 << 14, 14).chain([0b01 << 14]);
        let tree: Vec<u8> = upper.take(1).chain(lower).flat_map(u16::to_le_bytes).collect();
        let rest: Vec<u8> =
            [0b11u16; 14].into_iter().chain([0b01 | 0b10 << 2 | 0b01 << 12]).flat_map(u16::to_le_bytes).collect();
        let bytes = [HEADER.replace("OcTree\nsize", "OwnTree\nsize").as_bytes(), &tree, &rest].concat();
        let spec = |cell_m| ImportSpec { cell_m: Some(cell_m), ..ImportSpec::new("a.bt", bytes.clone()) };
        assert_eq!(free_cells(&spec(0.25).read().unwrap().terrain), 3);
        let Imported { terrain, origin_m, stores_cell_m, .. } = spec(0.5).read().unwrap();
        assert_eq!((terrain.extent().size(), terrain.extent().cell_m(), stores_cell_m), ([4; 3], 0.5, true));
        assert_eq!(origin_m, Some([-1.0; 3]));
        assert_eq!(free_cells(&terrain), 1);
        assert_eq!(terrain.get(Cell::new(1, 1, 1)), Some(&Terrain::Free));
        let error = spec(0.3).read().unwrap_err().to_string();
        assert!(
            error.ends_with("the file has cells of 0.25 m, asked for are cells of 0.3 m; allowed are multiples"),
            "{error}"
        );
    }

    #[test]
    fn a_tree_of_occupied_cells_alone_asks_what_others_are() {
        let spec = lowest(0b10 | 0b10 << 12);
        let refused = read(&spec).unwrap_err().to_string();
        assert!(
            refused.contains("it has 2 occupied cells and no free one; map.import.unknown = \"free\""),
            "{refused}"
        );
        let free = ImportSpec { options: ImportOptions { unknown: Some(Kind::Free), ..Default::default() }, ..spec };
        assert_eq!(free_cells(&read(&free).unwrap().terrain), 2);
    }

    #[test]
    fn a_box_is_cut_out_of_a_tree() {
        let mut room = Grid::new(Extent::new([9, 8, 7], 0.25).unwrap(), Terrain::Free);
        voxels::close_shell(&mut room, 1);
        let bytes = export::octomap(&room, [0; 3]);
        let with = |crop| ImportSpec {
            options: ImportOptions { crop: Some(crop), ..Default::default() },
            ..ImportSpec::new("a.bt", bytes.clone())
        };
        let Imported { terrain, origin_m, .. } = read(&with([0.5, 0.3, -9.0, 1.25, 1.0, 9.0])).unwrap();
        assert_eq!(free_cells(&terrain), 3 * 3 * 5);
        assert_eq!((terrain.extent().size(), origin_m), ([5, 5, 9], Some([0.25, 0.0, -0.25])));
        let refused = read(&with([9.0, 0.0, 0.0, 10.0, 1.0, 1.0])).unwrap_err().to_string();
        assert_eq!(refused, "the file has no cell inside the box of crop that is free or occupied");
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
        assert_eq!(read_tree("OcTreeStamped", &tree(&[])).unwrap(), plain);
        let other = read_tree("OwnTree", &tree(&[9; 5])).unwrap();
        assert_eq!(other.terrain, plain.terrain);
        assert!(other.notes[1].text.ends_with("the first 4 of 9 bytes of each node are taken for its odds"));
        let error = read_tree("OwnTree", &tree(&[])[1..]).unwrap_err().to_string();
        assert!(error.starts_with("the tree: it is of kind \"OwnTree\""), "{error}");
        let error = read_tree("OcTree", &tree(&[])[..50]).unwrap_err().to_string();
        assert!(error.ends_with("the file ends within the tree, 1 nodes are missing"), "{error}");
    }

    #[test]
    fn written_tree_merges_equal_cells() {
        let solid = Grid::new(Extent::new([64; 3], 0.1).unwrap(), Terrain::Wall);
        let bytes = export::octomap(&solid, [0; 3]);
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
        assert_eq!(header("res 0"), "line 2: cell_m is 0, allowed are finite lengths in metres above 0");
        assert_eq!(header("data\n"), "line 2: data without a line res before them");
        assert_eq!(refuse(HEADER), "the file has no cell that is free or occupied");
        let bytes = |tree: &[u8]| ImportSpec::new("a.bt", [HEADER.as_bytes(), tree].concat());
        let refuse = |tree: &[u8]| read(&bytes(tree)).unwrap_err().to_string();
        assert_eq!(refuse(&[3]), "byte 74: the file ends within the tree, 1 nodes are missing");
        assert_eq!(refuse(&[0x0f, 0, 1, 0]), "byte 77: the file ends within the tree, 1 nodes are missing");
        assert_eq!(
            refuse(&[1, 0]),
            "map size along x is 32768 cells, allowed are 1 to 1024, with cells of 0.25 m; with map.cell_m (--cell-m) = \
             8.25 or more, a multiple of 0.25, it fits"
        );
        let deep = [3, 0].repeat(16);
        assert_eq!(refuse(&deep), "byte 103: child 0 is below level 16, and has children");
    }
}
