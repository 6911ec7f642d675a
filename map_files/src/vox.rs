//! Models of MagicaVoxel (`.vox`, versions 150 and 200): voxels are wall, every other cell in the
//! box of a model is free.
//!
//! The models of a scene are placed by its transforms in their first frame; of a file without a
//! scene the first model is read. What is hidden in the editor, a node or a layer, is left out.
//! Colours, materials and cameras are ignored.

use std::collections::{BTreeMap, BTreeSet};

use voxels::{Cell, Extent, Terrain};

use super::bytes::{Bytes, shown};
use super::{FormatError, ImportSpec, Imported, MapReader, Note, new_grid, surrounded};

/// A model of MagicaVoxel.
pub(super) const READER: MapReader = MapReader::new("model of MagicaVoxel", &["vox"], &["cells_max"], read);

/// Bounds of the visited nodes of a scene and of the voxels put into the map, because a short file
/// can refer to a model often.
const VISITS_MAX: usize = 1 << 16;
const VOXELS_MAX: usize = 1 << 28;

/// Largest number of attributes of a node.
const PAIRS_MAX: u32 = 1 << 16;

/// A model: its size, and four bytes for each voxel.
struct Model<'a> {
    size: [u32; 3],
    voxels: &'a [u8],
}

/// A node of a scene.
enum Node {
    Transform(Placement),
    Group(SceneEntry),
    Shape(SceneEntry),
}

/// The children of a group, or the models of a shape, and whether its own attributes hide them.
struct SceneEntry {
    numbers: Vec<u32>,
    is_hidden: bool,
}

/// A transform of a child, and what hides the child.
struct Placement {
    transform: Transform,
    child: u32,
    layer: u32,
    is_hidden: bool,
}

/// The content of a file.
#[derive(Default)]
struct Scene<'a> {
    models: Vec<Model<'a>>,
    nodes: BTreeMap<u32, Node>,
    hidden_layers: BTreeSet<u32>,
    /// Bytes behind its end.
    ignored: usize,
}

/// The models of a scene with their transforms.
struct Placed<'m, 'a> {
    shown: Vec<(&'m Model<'a>, Transform)>,
    hidden: usize,
}

/// A rotation by right angles, perhaps with a reflection, and then a shift in cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Transform {
    rows: [[i64; 3]; 3],
    shift: [i64; 3],
}

const UNTURNED: Transform = Transform { rows: [[1, 0, 0], [0, 1, 0], [0, 0, 1]], shift: [0; 3] };

/// A map of a VOX file.
///
/// # Errors
/// If the file is malformed, or its models do not fit into a map.
pub(super) fn read(spec: &ImportSpec) -> Result<Imported, FormatError> {
    let scene = chunks(&spec.bytes)?;
    let models = &scene.models;
    let mut notes = Vec::new();
    if scene.ignored > 0 {
        notes.push(Note::new("end", format!("{} bytes after the last chunk are ignored", scene.ignored)));
    }
    let placed: Vec<(&Model<'_>, Transform)> = if scene.nodes.is_empty() {
        let dropped = models.len().saturating_sub(1);
        let text = format!("the first is read, {dropped} without a place are dropped");
        notes.push(if dropped > 0 { Note::warning("models", text) } else { Note::new("models", text) });
        models.iter().take(1).map(|model| (model, UNTURNED)).collect()
    } else {
        let Placed { shown, hidden } = scene.place()?;
        notes.push(Note::new("models", format!("{} put into the scene, of {} models", shown.len(), models.len())));
        if hidden > 0 {
            notes.push(Note::new("hidden", format!("{hidden} left out, which a node or a layer hides")));
            if shown.is_empty() {
                return Err(FormatError::Nothing("model that is not hidden"));
            }
        }
        shown
    };
    let mut low = [i64::MAX; 3];
    let mut high = [i64::MIN; 3];
    for (model, transform) in &placed {
        let last = model.size.map(|cells| i64::from(cells) - 1);
        for corner in [[0; 3], last].map(|corner| transform.cell(corner, model.size)) {
            for axis in 0..3 {
                low[axis] = low[axis].min(corner[axis]);
                high[axis] = high[axis].max(corner[axis]);
            }
        }
    }
    if placed.is_empty() {
        return Err(FormatError::Nothing("model"));
    }
    let size = [0, 1, 2].map(|axis| u32::try_from(high[axis] - low[axis] + 1).unwrap_or(u32::MAX));
    let extent = Extent::new(size, spec.length_m()).map_err(FormatError::Extent)?;
    let mut terrain = new_grid(extent, Terrain::Free, spec)?;
    for (model, transform) in &placed {
        for voxel in model.voxels.chunks_exact(4) {
            let at = transform.cell([0, 1, 2].map(|axis| voxel[axis].into()), model.size);
            let [x, y, z] = [0, 1, 2].map(|axis| (at[axis] - low[axis]) as i32);
            terrain.set(Cell::new(x, y, z), Terrain::Wall);
        }
    }
    let (terrain, closed) = surrounded(terrain)?;
    notes.extend(closed);
    Ok(Imported { terrain, notes, stores_cell_m: false, origin_m: None, yaw_rad: 0.0 })
}

impl Transform {
    /// The composition that applies `first`, then `self`.
    fn after(&self, first: &Self) -> Self {
        let column = |axis: usize| [0, 1, 2].map(|row| first.rows[row][axis]);
        let rows = self.rows.map(|row| [0, 1, 2].map(|axis| dot(row, column(axis))));
        let shift = [0, 1, 2].map(|row| dot(self.rows[row], first.shift).saturating_add(self.shift[row]));
        Self { rows, shift }
    }

    /// The cell of a voxel of a model, which rotates about the lower middle of its box.
    fn cell(&self, voxel: [i64; 3], size: [u32; 3]) -> [i64; 3] {
        // In half cells, so that the centres of voxels are whole numbers.
        let centre = [0, 1, 2].map(|axis| 2 * voxel[axis] + 1 - 2 * i64::from(size[axis] / 2));
        [0, 1, 2].map(|row| dot(self.rows[row], centre).div_euclid(2).saturating_add(self.shift[row]))
    }
}

fn dot(row: [i64; 3], column: [i64; 3]) -> i64 {
    // All but one of a row are 0.
    (0..3).fold(0, |sum: i64, axis| sum.saturating_add(row[axis].saturating_mul(column[axis])))
}

/// All models, nodes and hidden layers of a file.
fn chunks(bytes: &[u8]) -> Result<Scene<'_>, FormatError> {
    let mut file = Bytes::new(bytes);
    let magic = file.take(4, "the mark VOX")?;
    if magic != b"VOX " {
        return Err(FormatError::byte(0, format!("the file begins with {}, expected \"VOX \"", shown(magic))));
    }
    file.u32("the version")?;
    let mut scene = Scene::default();
    let mut size = None;
    // Where the chunks of MAIN end, if it says so.
    let mut end = usize::MAX;
    while !file.rest().is_empty() {
        let at = file.at();
        if at >= end && !begins_chunk(file.rest()) {
            scene.ignored = file.rest().len();
            break;
        }
        let name = file.take(4, "the name of a chunk")?;
        let length = file.u32("the length of a chunk")?;
        // Child chunks follow their parent and are read as chunks of their own.
        let length_of_children = file.u32("the length of what a chunk has")? as usize;
        let start = file.at();
        if name == b"MAIN" && length_of_children > 0 {
            end = start.saturating_add(length as usize).saturating_add(length_of_children);
        }
        let mut chunk = Chunk { bytes: Bytes::new(file.take(length as usize, "a chunk")?), start };
        match name {
            b"SIZE" => {
                let sides = [chunk.u32("a size")?, chunk.u32("a size")?, chunk.u32("a size")?];
                if let Some(side) = sides.into_iter().find(|side| !(1..=256).contains(side)) {
                    return Err(FormatError::byte(start, format!("a side of a model is {side}, allowed is 1 to 256")));
                }
                size = Some(sides);
            }
            b"XYZI" => {
                let size =
                    size.take().ok_or_else(|| FormatError::byte(at, "a model without a chunk SIZE before it"))?;
                let count = chunk.u32("the number of voxels")?;
                let voxels = chunk.take((count as usize).saturating_mul(4), "the voxels")?;
                let is_outside = |voxel: &[u8]| (0..3).any(|axis| u32::from(voxel[axis]) >= size[axis]);
                if let Some(place) = voxels.chunks_exact(4).position(is_outside) {
                    let reason =
                        format!("voxel {place} is outside its model of {}x{}x{} cells", size[0], size[1], size[2]);
                    return Err(FormatError::byte(start, reason));
                }
                scene.models.push(Model { size, voxels });
            }
            b"nTRN" => chunk.transform(&mut scene.nodes)?,
            b"nGRP" => chunk.group(&mut scene.nodes)?,
            b"nSHP" => chunk.shape(&mut scene.nodes)?,
            b"LAYR" => {
                let layer = chunk.u32("the number of a layer")?;
                if is_hidden(&chunk.pairs()?) {
                    scene.hidden_layers.insert(layer);
                }
            }
            _ => {}
        }
    }
    Ok(scene)
}

/// Whether bytes are a chunk, as writers that give MAIN a wrong length have more of.
fn begins_chunk(bytes: &[u8]) -> bool {
    let Some((name, rest)) = bytes.split_at_checked(4) else { return false };
    let mut rest = Bytes::new(rest);
    let length = rest.u32("the length of a chunk").unwrap_or(u32::MAX) as usize;
    let fits = rest.u32("the length of what a chunk has").is_ok() && length <= rest.rest().len();
    fits && name.iter().all(u8::is_ascii_alphanumeric)
}

/// Whether attributes hide what they belong to.
fn is_hidden(attributes: &[[&[u8]; 2]]) -> bool {
    attributes.iter().any(|[key, value]| *key == b"_hidden" && *value != b"0")
}

/// The content of a chunk, and its position in the file.
struct Chunk<'a> {
    bytes: Bytes<'a>,
    start: usize,
}

impl<'a> Chunk<'a> {
    fn take(&mut self, count: usize, what: &str) -> Result<&'a [u8], FormatError> {
        let (at, left) = (self.start + self.bytes.at(), self.bytes.rest().len());
        let reason = || format!("the chunk ends here, {what} takes {count} bytes and {left} are left");
        self.bytes.take(count, what).map_err(|_| FormatError::byte(at, reason()))
    }

    fn u32(&mut self, what: &str) -> Result<u32, FormatError> {
        let bytes = self.take(4, what)?;
        Ok(u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]))
    }

    /// The attributes of a node, pairs of strings.
    fn pairs(&mut self) -> Result<Vec<[&'a [u8]; 2]>, FormatError> {
        let at = self.start + self.bytes.at();
        let count = self.u32("the number of attributes")?;
        if count > PAIRS_MAX {
            return Err(FormatError::byte(at, format!("a node has {count} attributes, allowed are {PAIRS_MAX}")));
        }
        let mut text = || {
            let length = self.u32("the length of an attribute")?;
            self.take(length as usize, "an attribute")
        };
        (0..count).map(|_| Ok([text()?, text()?])).collect()
    }

    fn transform(&mut self, nodes: &mut BTreeMap<u32, Node>) -> Result<(), FormatError> {
        let id = self.u32("the number of a node")?;
        let is_hidden = is_hidden(&self.pairs()?);
        let child = self.u32("the number of a node")?;
        self.u32("a reserved number")?;
        let layer = self.u32("the number of a layer")?;
        let mut transform = UNTURNED;
        let frames = self.u32("the number of frames")?;
        if frames > 0 {
            let at = self.start + self.bytes.at();
            for [key, value] in self.pairs()? {
                let text = str::from_utf8(value).ok();
                let wrong = || FormatError::byte(at, format!("{} is {}, which is none", shown(key), shown(value)));
                match key {
                    b"_t" => transform.shift = text.and_then(shift).ok_or_else(wrong)?,
                    b"_r" => transform.rows = text.and_then(rotation).ok_or_else(wrong)?,
                    _ => {}
                }
            }
        }
        nodes.insert(id, Node::Transform(Placement { transform, child, layer, is_hidden }));
        Ok(())
    }

    fn group(&mut self, nodes: &mut BTreeMap<u32, Node>) -> Result<(), FormatError> {
        let id = self.u32("the number of a node")?;
        let is_hidden = is_hidden(&self.pairs()?);
        let count = self.u32("the number of nodes in a group")?;
        let children: Result<Vec<u32>, FormatError> = (0..count).map(|_| self.u32("the number of a node")).collect();
        nodes.insert(id, Node::Group(SceneEntry { numbers: children?, is_hidden }));
        Ok(())
    }

    fn shape(&mut self, nodes: &mut BTreeMap<u32, Node>) -> Result<(), FormatError> {
        let id = self.u32("the number of a node")?;
        let is_hidden = is_hidden(&self.pairs()?);
        let count = self.u32("the number of models in a shape")?;
        let mut models = Vec::new();
        for _ in 0..count {
            models.push(self.u32("the number of a model")?);
            self.pairs()?;
        }
        // Several are the frames of an animation.
        models.truncate(1);
        nodes.insert(id, Node::Shape(SceneEntry { numbers: models, is_hidden }));
        Ok(())
    }
}

/// Three integers separated by spaces.
fn shift(text: &str) -> Option<[i64; 3]> {
    let numbers: Vec<i64> =
        text.split_ascii_whitespace().map(|word| word.parse::<i32>().ok().map(i64::from)).collect::<Option<_>>()?;
    numbers.try_into().ok()
}

/// A rotation: the places of the numbers that are not 0 in the first two rows, two bits each, then
/// the signs of the rows.
fn rotation(text: &str) -> Option<[[i64; 3]; 3]> {
    let bits: u8 = text.trim().parse().ok()?;
    let [first, second] = [bits & 3, bits >> 2 & 3].map(usize::from);
    if first > 2 || second > 2 || first == second {
        return None;
    }
    let places = [first, second, 3 - first - second];
    let mut rows = [[0; 3]; 3];
    for (row, place) in places.into_iter().enumerate() {
        rows[row][place] = if bits >> (4 + row) & 1 == 1 { -1 } else { 1 };
    }
    Some(rows)
}

impl<'a> Scene<'a> {
    /// The models with their transforms, from the first node on.
    fn place(&self) -> Result<Placed<'_, 'a>, FormatError> {
        let Self { models, nodes, hidden_layers, .. } = self;
        let fault = |reason: String| FormatError::Content { place: super::Place::Byte(0), reason };
        let mut placed = Placed { shown: Vec::new(), hidden: 0 };
        let (mut visits, mut voxels) = (0, 0);
        let mut open = vec![(0, UNTURNED, false)];
        while let Some((id, transform, is_hidden)) = open.pop() {
            visits += 1;
            if visits > VISITS_MAX || open.len() > VISITS_MAX {
                return Err(fault(format!("the scene has more than {VISITS_MAX} nodes, or goes in circles")));
            }
            match nodes.get(&id) {
                None => return Err(fault(format!("the scene names node {id}, which is not there"))),
                Some(Node::Transform(own)) => {
                    let is_hidden = is_hidden || own.is_hidden || hidden_layers.contains(&own.layer);
                    open.push((own.child, transform.after(&own.transform), is_hidden));
                }
                Some(Node::Group(own)) => {
                    let is_hidden = is_hidden || own.is_hidden;
                    open.extend(own.numbers.iter().rev().map(|&child| (child, transform, is_hidden)));
                }
                Some(Node::Shape(own)) if is_hidden || own.is_hidden => placed.hidden += own.numbers.len(),
                Some(Node::Shape(own)) => {
                    for &number in &own.numbers {
                        let missing = || fault(format!("the scene names model {number} of {}", models.len()));
                        let model = models.get(number as usize).ok_or_else(missing)?;
                        voxels += model.voxels.len() / 4;
                        if voxels > VOXELS_MAX {
                            return Err(fault(format!("the scene has more than {VOXELS_MAX} voxels")));
                        }
                        placed.shown.push((model, transform));
                    }
                }
            }
        }
        Ok(placed)
    }
}

#[cfg(test)]
mod tests;
