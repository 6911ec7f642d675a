//! The abstract graph of the known free space: blocks of cells, the connected regions in each, and
//! edges between adjacent regions.
//!
//! It is built like the clusters of HPA* (Botea, Müller, Schaeffer, 2004) and plays the part of the
//! global graph of DSVP and TARE: on a map of a million cells it answers in about a millisecond
//! where the frontiers are and how long the paths to them are. A *region* is a set of cells of one
//! block, all usable for the body and connected through faces within the block. Regions of
//! neighbouring blocks have an edge if a face leads from one to the other.
//!
//! Invariants: every usable cell lies in exactly one region; edges are symmetric; a frontier of the
//! map is listed with exactly one region, or with none if its block has none. The graph is updated
//! incrementally from the journal of the map, at a cost proportional to the changes, and depends on
//! the map alone, not on when it was updated.
//!
//! Lengths are estimates: from centre to centre through the best face. This module plans nothing.

mod block;
mod path_lengths;
mod shortest_paths;

#[cfg(test)]
mod tests;

use voxels::{Cell, Extent, FACES};

use crate::exploration_map::{ExplorationMap, Finding};
use crate::path::Graph;

pub use block::BLOCK_CELLS;
use block::{CELLS, Cells, Side, connected, middle, offset, place_of, places};
pub use path_lengths::PathLengths;
pub use shortest_paths::ShortestPaths;

/// A region: its block in the upper 24 bits (the largest map has 205^3 blocks), and its number
/// within the block in the lower 8.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct RegionId(u32);

impl RegionId {
    fn new(block: u32, number: u8) -> Self {
        Self(block << 8 | u32::from(number))
    }

    fn block(self) -> u32 {
        self.0 >> 8
    }

    fn number(self) -> usize {
        (self.0 & 0xff) as usize
    }
}

/// A node of the graph.
#[derive(Debug, Clone, PartialEq)]
pub struct Region {
    /// The cell of the region that is nearest to its mean, of those in which the body can rest if
    /// it can in any.
    pub centre: Cell,
    /// The frontiers of the region, ascending.
    pub frontiers: Vec<Cell>,
    edges: Vec<Edge>,
    cells: Cells,
    /// Those of its cells in which the body can rest.
    resting: Cells,
    /// A number below [`AbstractGraph::slots`], unique among the present regions: the index of
    /// per-region data.
    slot: u32,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Edge {
    to: RegionId,
    /// Slot of the target region.
    slot: u32,
    /// Length of the path between the centres, cells.
    length: f32,
}

#[derive(Debug, Clone)]
struct Block {
    /// At least one.
    regions: Vec<Region>,
}

/// What has happened to a slot.
#[derive(Debug, Clone, Copy, Default)]
struct History {
    /// The region that has it, if there is one.
    region: Option<RegionId>,
    /// The update that gave it to that region, or took it away.
    made: u32,
    /// The last update that may have changed the edges of the region, or that.
    changed: u32,
}

/// The abstract graph of one map.
#[derive(Debug, Clone)]
pub struct AbstractGraph {
    extent: Extent,
    /// Blocks along each axis.
    size: [i32; 3],
    blocks: Vec<Option<Box<Block>>>,
    /// Position in the journal of the map up to which changes are applied.
    read: usize,
    /// Distance in cells within which a change can make a cell usable or unusable.
    reach: i32,
    /// Number of revisions of the map up to there: until the next one, free cells stay free.
    revisions: u64,
    /// Number of regions with frontiers.
    regions_with_frontiers: usize,
    /// Number of slots ever used, and those that are free again.
    slots: u32,
    free_slots: Vec<u32>,
    /// Number of updates so far.
    updates: u32,
    /// By slot.
    histories: Vec<History>,
    /// By block what an update has found out about it, bits; 0 between updates.
    marks: Vec<u8>,
}

impl Region {
    /// Whether the body can rest in a cell of it.
    #[must_use]
    pub fn has_rest(&self) -> bool {
        self.resting != 0
    }
}

impl AbstractGraph {
    /// The graph of an unexplored map. `radius_m` is the radius of the body.
    #[must_use]
    pub fn new(extent: Extent, radius_m: f64) -> Self {
        let size = extent.size().map(|cells| cells.div_ceil(BLOCK_CELLS as u32) as i32);
        let blocks: usize = size.iter().map(|&blocks| blocks as usize).product();
        let reach = 1.max((radius_m / extent.cell_m() + 0.5).floor() as i32);
        Self {
            extent,
            size,
            blocks: vec![None; blocks],
            read: 0,
            reach,
            revisions: 0,
            regions_with_frontiers: 0,
            slots: 0,
            free_slots: Vec::new(),
            updates: 0,
            histories: Vec::new(),
            marks: vec![0; blocks],
        }
    }

    /// Applies the changes of the map since the last update. The map and the moves of the body must
    /// be the same each time.
    pub fn update(&mut self, moves: Graph<'_>) {
        let map = moves.map();
        self.reach = moves.ground_reach_cells().unwrap_or(self.reach);
        self.updates += 1;
        let mut changed = Vec::new();
        let mut reviewed = Vec::new();
        let mut marks = std::mem::take(&mut self.marks);
        // A change affects the frontiers of the cells beside it and, if the cell is free, which
        // cells are usable.
        if self.reach > 1 {
            for (low, high) in map.boxes_revealed_since(self.read) {
                self.for_blocks_near(low, high, 1, |block| add(&mut reviewed, &mut marks, block, REVIEWED));
                self.for_blocks_near(low, high, self.reach, |block| add(&mut changed, &mut marks, block, CHANGED));
            }
        } else {
            for (cell, finding) in map.cells_changed_since(self.read) {
                let (at, offset) = split(cell);
                let block = self.number_of(at);
                add(&mut reviewed, &mut marks, block, REVIEWED);
                self.for_blocks_beside(at, offset, |block| add(&mut reviewed, &mut marks, block, REVIEWED));
                if (self.label_at(block, offset) != 0) != (finding != Finding::Wall) {
                    add(&mut changed, &mut marks, block, CHANGED);
                }
            }
        }
        reviewed.iter().chain(&changed).for_each(|&block: &u32| marks[block as usize] = 0);
        self.read = map.journal_len();
        let revisions = std::mem::replace(&mut self.revisions, map.revisions());
        if revisions == self.revisions && !moves.moves().are_on_ground() {
            // What the body can use it can use from now on.
            changed.retain(|&block| !self.is_all_usable(block));
        }
        changed.sort_unstable();
        reviewed.sort_unstable();
        // Edges over a face depend on the blocks at both sides of it. Marks are sets of faces here.
        let mut relinked = Vec::new();
        for &block in &changed {
            if !self.label(block, moves) {
                continue;
            }
            add(&mut relinked, &mut marks, block, ALL_FACES);
            for (face, neighbour) in self.neighbours(block).into_iter().enumerate() {
                if let Some(neighbour) = neighbour {
                    add(&mut relinked, &mut marks, neighbour, 1 << opposite(face));
                }
            }
        }
        for &block in changed.iter().chain(reviewed.iter().filter(|block| changed.binary_search(block).is_err())) {
            self.list_frontiers(block, map);
        }
        for block in relinked {
            let faces = std::mem::take(&mut marks[block as usize]);
            if faces != 0 {
                self.edge(block, faces);
            }
        }
        self.marks = marks;
    }

    /// The region that contains a cell.
    #[must_use]
    pub fn region_of(&self, cell: Cell) -> Option<RegionId> {
        let (block, offset) = self.locate(cell)?;
        Some(RegionId::new(block, self.label_at(block, offset).checked_sub(1)?))
    }

    /// Whether a cell belongs to a region, and the body can rest there.
    #[must_use]
    pub fn can_rest(&self, region: RegionId, cell: Cell) -> bool {
        let rests = |(block, offset)| {
            let is_in_block = self.get(region).filter(|_| region.block() == block);
            is_in_block.is_some_and(|region| region.resting >> place_of(offset) & 1 != 0)
        };
        self.locate(cell).is_some_and(rests)
    }

    /// The number of regions with frontiers.
    #[must_use]
    pub fn regions_with_frontiers(&self) -> usize {
        self.regions_with_frontiers
    }

    /// A region, unless it no longer exists.
    #[must_use]
    pub fn get(&self, region: RegionId) -> Option<&Region> {
        self.blocks.get(region.block() as usize)?.as_ref()?.regions.get(region.number())
    }

    /// The regions of the blocks within this many cells of a cell along each axis, ascending.
    pub fn near(&self, cell: Cell, cells: i32) -> impl Iterator<Item = (RegionId, &Region)> {
        let axis = |at: i32, size: i32| {
            ((at - cells).div_euclid(BLOCK_CELLS).max(0), (at + cells).div_euclid(BLOCK_CELLS).min(size - 1))
        };
        let [(x0, x1), (y0, y1), (z0, z1)] =
            [axis(cell.x, self.size[0]), axis(cell.y, self.size[1]), axis(cell.z, self.size[2])];
        let blocks = (z0..=z1).flat_map(move |z| (y0..=y1).flat_map(move |y| (x0..=x1).map(move |x| (x, y, z))));
        blocks.flat_map(|(x, y, z)| {
            let block = self.number_of([x, y, z]);
            let regions = self.blocks[block as usize].as_ref().map_or(&[][..], |block| &block.regions);
            (0..).zip(regions).map(move |(number, region)| (RegionId::new(block, number), region))
        })
    }

    /// The number of the block at these coordinates.
    fn number_of(&self, [x, y, z]: [i32; 3]) -> u32 {
        ((z * self.size[1] + y) * self.size[0] + x) as u32
    }

    fn block_of(&self, cell: Cell) -> Option<u32> {
        Some(self.locate(cell)?.0)
    }

    /// The block of a cell, and the cell relative to the corner of the block.
    fn locate(&self, cell: Cell) -> Option<(u32, Cell)> {
        let (at, offset) = self.extent.contains(cell).then(|| split(cell))?;
        Some((self.number_of(at), offset))
    }

    /// 1 + the number of the region that contains a cell of a block, or 0.
    fn label_at(&self, block: u32, offset: Cell) -> u8 {
        let regions = self.blocks[block as usize].as_ref().map_or(&[][..], |block| &block.regions);
        let cell: Cells = 1 << place_of(offset);
        (1..).zip(regions).find(|(_, region)| region.cells & cell != 0).map_or(0, |(label, _)| label)
    }

    /// Whether all cells of a block are usable, and the body can rest in them.
    fn is_all_usable(&self, block: u32) -> bool {
        let regions = self.blocks[block as usize].as_ref().map_or(&[][..], |block| &block.regions);
        let is_all = |region: &Region| (region.cells & region.resting).count_ones() == CELLS as u32;
        regions.first().is_some_and(is_all)
    }

    /// Visits the blocks that adjoin a cell of the block at these coordinates.
    fn for_blocks_beside(&self, at: [i32; 3], offset: Cell, mut visit: impl FnMut(u32)) {
        for (axis, along) in [offset.x, offset.y, offset.z].into_iter().enumerate() {
            let mut beside = at;
            match along {
                0 => beside[axis] -= 1,
                LAST => beside[axis] += 1,
                _ => continue,
            }
            if (0..self.size[axis]).contains(&beside[axis]) {
                visit(self.number_of(beside));
            }
        }
    }

    /// Visits the blocks within this many cells of a box of cells of the map.
    fn for_blocks_near(&self, low: Cell, high: Cell, reach: i32, mut visit: impl FnMut(u32)) {
        const BLOCK: u32 = BLOCK_CELLS as u32;
        let axis = |low: i32, high: i32, size: i32| {
            let low = (low - reach).max(0).cast_unsigned() / BLOCK;
            let high = (high + reach).cast_unsigned() / BLOCK;
            (low.cast_signed(), high.cast_signed().min(size - 1))
        };
        let [(x0, x1), (y0, y1), (z0, z1)] =
            [axis(low.x, high.x, self.size[0]), axis(low.y, high.y, self.size[1]), axis(low.z, high.z, self.size[2])];
        for z in z0..=z1 {
            for y in y0..=y1 {
                for x in x0..=x1 {
                    visit(self.number_of([x, y, z]));
                }
            }
        }
    }

    fn corner(&self, block: u32) -> Cell {
        let block = block as i32;
        let (x, y) = (block % self.size[0], block / self.size[0] % self.size[1]);
        let z = block / self.size[0] / self.size[1];
        Cell::new(x * BLOCK_CELLS, y * BLOCK_CELLS, z * BLOCK_CELLS)
    }

    fn neighbours(&self, block: u32) -> [Option<u32>; 6] {
        let corner = self.corner(block);
        FACES.map(|face| {
            let by = Cell::new(face.x * BLOCK_CELLS, face.y * BLOCK_CELLS, face.z * BLOCK_CELLS);
            self.block_of(corner + by)
        })
    }

    /// Recomputes the regions of a block, unless they are the same; returns whether they were not.
    fn label(&mut self, block: u32, graph: Graph<'_>) -> bool {
        let corner = self.corner(block);
        let usable: Cells = graph.usable_in(corner, BLOCK_CELLS);
        let known = self.blocks[block as usize].as_ref().map_or(&[][..], |block| &block.regions);
        let resting = graph.resting_in(corner, BLOCK_CELLS, usable);
        let all = |cells: fn(&Region) -> Cells| known.iter().fold(0, |all, region| all | cells(region));
        if all(|region| region.cells) == usable && all(|region| region.resting) == resting {
            return false;
        }
        let old = self.blocks[block as usize].take().map(|old| old.regions).unwrap_or_default();
        let updates = self.updates;
        for region in &old {
            self.free_slots.push(region.slot);
            self.histories[region.slot as usize] = History { region: None, made: updates, changed: updates };
        }
        self.regions_with_frontiers -= count_with_frontiers(&old);
        if usable == 0 {
            return true;
        }
        // The lists of old regions serve new ones, so that a change of a block takes no memory.
        let mut spare = old.into_iter().map(|Region { frontiers, edges, .. }| (frontiers, edges));
        let mut regions: Vec<Region> = Vec::with_capacity(spare.len().max(1));
        let mut left = usable;
        while left != 0 {
            let members = connected(left & left.wrapping_neg(), left);
            left &= !members;
            let slot = self.slot();
            let region = Some(RegionId::new(block, regions.len() as u8));
            self.histories[slot as usize] = History { region, made: updates, changed: updates };
            let resting = resting & members;
            let centre = corner + middle(if resting == 0 { members } else { resting });
            let (mut frontiers, mut edges) = spare.next().unwrap_or_default();
            frontiers.clear();
            edges.clear();
            regions.push(Region { centre, frontiers, edges, cells: members, resting, slot });
        }
        self.blocks[block as usize] = Some(Box::new(Block { regions }));
        true
    }

    /// Recomputes the frontier lists of a block.
    fn list_frontiers(&mut self, block: u32, map: &ExplorationMap) {
        let corner = self.corner(block);
        let Some(Block { regions }) = self.blocks[block as usize].as_deref_mut() else {
            return;
        };
        self.regions_with_frontiers -= count_with_frontiers(regions);
        // A frontier that the body does not fit into is observed from the first region of its
        // block.
        let mut left = map.frontiers_in(corner, BLOCK_CELLS);
        for (number, region) in regions.iter_mut().enumerate().rev() {
            let own = if number == 0 { left } else { left & region.cells };
            left &= !own;
            region.frontiers.clear();
            region.frontiers.extend(places(own).map(|place| corner + offset(place)));
        }
        self.regions_with_frontiers += count_with_frontiers(regions);
    }

    fn slot(&mut self) -> u32 {
        self.free_slots.pop().unwrap_or_else(|| {
            self.slots += 1;
            self.histories.push(History::default());
            self.slots - 1
        })
    }

    /// Number of updates so far.
    fn updates(&self) -> u32 {
        self.updates
    }

    /// The region that has a slot.
    fn region_with(&self, slot: u32) -> Option<(RegionId, &Region)> {
        let id = self.histories[slot as usize].region?;
        Some((id, self.get(id)?))
    }

    /// The update in which a slot was last given to a region or taken away.
    fn made(&self, slot: u32) -> u32 {
        self.histories[slot as usize].made
    }

    /// The last update that may have changed the edges of the region with a slot, or that.
    fn changed(&self, slot: u32) -> u32 {
        self.histories[slot as usize].changed
    }

    /// Recomputes the edges that start in a block and lead over some of its faces, a bit for each.
    /// The edges of a region are in the order of the faces.
    fn edge(&mut self, block: u32, faces: u8) {
        let Some(mut here) = self.blocks[block as usize].take() else {
            return;
        };
        let neighbours = self.neighbours(block);
        for region in &mut here.regions {
            self.histories[region.slot as usize].changed = self.updates;
            match faces {
                ALL_FACES => region.edges.clear(),
                _ => region.edges.retain(|edge| faces >> face_towards(&neighbours, edge) & 1 == 0),
            }
        }
        let sides = Side::all().into_iter().zip(neighbours).enumerate();
        for (_, (side, neighbour)) in sides.filter(|(number, _)| faces >> number & 1 != 0) {
            let Some((number, there)) = neighbour.and_then(|to| Some((to, self.blocks[to as usize].as_ref()?))) else {
                continue;
            };
            for region in &mut here.regions {
                let (first, centre) = (region.edges.len(), place_in_block(region.centre));
                for (other, far) in (0..).zip(&there.regions) {
                    let far_centre = place_in_block(far.centre);
                    let length =
                        |place: usize| distance(centre, place) + 1.0 + distance(side.beside(place), far_centre);
                    let lengths = places(side.facing(region.cells, far.cells)).map(length);
                    if let Some(length) = lengths.reduce(f32::min) {
                        region.edges.push(Edge { to: RegionId::new(number, other), slot: far.slot, length });
                    }
                }
                let cells = region.cells;
                let first_place =
                    |edge: &Edge| side.facing(cells, there.regions[edge.to.number()].cells).trailing_zeros();
                region.edges[first..].sort_by_key(first_place);
            }
        }
        if faces != ALL_FACES {
            for region in &mut here.regions {
                region.edges.sort_by_key(|edge| face_towards(&neighbours, edge));
            }
        }
        self.blocks[block as usize] = Some(here);
    }
}

fn count_with_frontiers(regions: &[Region]) -> usize {
    regions.iter().filter(|region| !region.frontiers.is_empty()).count()
}

/// The set of all faces of a block.
const ALL_FACES: u8 = (1 << FACES.len()) - 1;

/// The face of the neighbour at a face, both as places in [`FACES`].
fn opposite(face: usize) -> usize {
    face ^ 1
}

/// The face over which an edge leads, given the neighbours of its block.
fn face_towards(neighbours: &[Option<u32>; 6], edge: &Edge) -> usize {
    neighbours.iter().position(|&neighbour| neighbour == Some(edge.to.block())).unwrap_or_default()
}

/// Mark of a block whose regions may have changed.
const CHANGED: u8 = 1;
/// Mark of a block whose frontiers may have changed.
const REVIEWED: u8 = 2;

/// Appends a block unless it has these marks, which it gets.
fn add(blocks: &mut Vec<u32>, marks: &mut [u8], block: u32, mark: u8) {
    let marks = &mut marks[block as usize];
    if *marks & mark != mark {
        *marks |= mark;
        blocks.push(block);
    }
}

/// The greatest coordinate of a cell relative to the corner of its block.
const LAST: i32 = BLOCK_CELLS - 1;

/// The coordinate along an axis of the block that contains a coordinate inside the map.
fn block_along(at: i32) -> i32 {
    // An unsigned division is cheaper.
    (at.cast_unsigned() / BLOCK_CELLS.cast_unsigned()).cast_signed()
}

/// The coordinates of the block of a cell inside the map, and the cell relative to the corner of
/// this block.
fn split(cell: Cell) -> ([i32; 3], Cell) {
    let [x, y, z] = [cell.x, cell.y, cell.z].map(block_along);
    ([x, y, z], cell - Cell::new(x * BLOCK_CELLS, y * BLOCK_CELLS, z * BLOCK_CELLS))
}

/// The place in its block of a cell inside the map.
fn place_in_block(cell: Cell) -> usize {
    place_of(split(cell).1)
}

/// Distance between the centres of the cells at two places of a block, cells.
fn distance(a: usize, b: usize) -> f32 {
    let by = offset(a) - offset(b);
    let [x, y, z] = [by.x, by.y, by.z].map(|by| by as f32);
    (x * x + y * y + z * z).sqrt()
}
