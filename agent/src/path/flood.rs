//! What a body reaches from some cells: a flood over the rows of blocks.
//!
//! The cells of a row are the bits of a word here, as in `room`, and a step is made by all of them
//! at once. Most steps lead to what has been reached, and cost one look; only the others are looked
//! at in full, diagonal ones after all steps through faces.
//!
//! Invariant: the cells are those that a search reaches, whatever the order.

use std::cell::RefCell;

use voxels::{Cell, CellSet, Extent, bits};

use super::Graph;
use super::room::{Around, Footprint};

/// Edge of a block, cells.
const SIDE: i32 = 8;

/// Rows of a block.
const ROWS: usize = (SIDE * SIDE) as usize;

/// A block with reached cells from which not all steps have been made.
struct Block {
    corner: Cell,
    /// Room in the rows of the block and in those around it; read when it is needed first.
    around: Option<Around>,
    /// By row the cells from which no step has been made, and those without the diagonal ones.
    new: [u8; ROWS],
    turned: [u8; ROWS],
    /// The rows of both with any cell, one bit each.
    new_rows: u64,
    turned_rows: u64,
    is_listed: bool,
}

impl Block {
    fn at(corner: Cell) -> Self {
        let none = [0; ROWS];
        Self { corner, around: None, new: none, turned: none, new_rows: 0, turned_rows: 0, is_listed: false }
    }
}

/// Memory of floods, to use again.
#[derive(Default)]
struct Scratch {
    /// By block of the map 1 + its place among the blocks of the flood, or 0.
    places: Vec<u32>,
    /// The blocks of the flood, and their numbers in the map.
    blocks: Vec<Block>,
    numbers: Vec<u32>,
    /// The places of those with steps to make.
    left: Vec<u32>,
}

thread_local! {
    /// One for all bodies of a thread.
    static SCRATCH: RefCell<Scratch> = RefCell::default();
}

/// A flood over one map for one body.
struct Flood<'f> {
    graph: Graph<'f>,
    footprint: &'f Footprint,
    extent: Extent,
    /// Blocks along x and y.
    size: [i32; 2],
    cells: &'f mut CellSet,
    resting: Option<&'f mut CellSet>,
    scratch: &'f mut Scratch,
}

/// Adds all cells that the body reaches from those of some boxes that are in the set, and from the
/// cell where it is. `resting` gets those of the new cells in which a ground body can rest.
pub(super) fn flood(
    graph: Graph<'_>,
    from: Cell,
    boxes: impl Iterator<Item = (Cell, Cell)>,
    cells: &mut CellSet,
    resting: Option<&mut CellSet>,
) {
    let extent = graph.map().extent();
    let [size_x, size_y, size_z] = extent.size().map(|cells| cells.cast_signed() / SIDE + 1);
    SCRATCH.with_borrow_mut(|scratch| {
        scratch.places.resize((size_x * size_y * size_z) as usize, 0);
        let footprint = graph.moves().footprint();
        let mut flood = Flood { graph, footprint, extent, size: [size_x, size_y], cells, resting, scratch };
        for (low, high) in boxes {
            flood.open(low, high);
        }
        // What the body touches where it is does not block its first step.
        for next in graph.steps().next_to(from, true) {
            if let Some(index) = extent.index(next) {
                let new_cells = flood.cells.missing(index, 1);
                flood.reach(next, new_cells);
            }
        }
        flood.run();
        for number in scratch.numbers.drain(..) {
            scratch.places[number as usize] = 0;
        }
        scratch.blocks.clear();
    });
}

impl Flood<'_> {
    /// Opens the cells of a box that are in the set.
    fn open(&mut self, low: Cell, high: Cell) {
        let size = self.extent.size().map(u32::cast_signed);
        let clip = |low: i32, high: i32, size: i32| low.max(0)..=high.min(size - 1);
        let along_x = clip(low.x, high.x, size[0]);
        for z in clip(low.z, high.z, size[2]) {
            for y in clip(low.y, high.y, size[1]) {
                let mut x = *along_x.start();
                while x <= *along_x.end() {
                    let count = (SIDE - x % SIDE).min(along_x.end() - x + 1).cast_unsigned();
                    let first = Cell::new(x, y, z);
                    let known = self.extent.index(first).map_or(0, |index| self.cells.run(index, count));
                    if known != 0 {
                        self.note(first, known);
                        // The floor that has become known may be higher than the one below it.
                        self.rest(first, known);
                    }
                    x += count.cast_signed();
                }
            }
        }
    }

    /// Adds cells of a row from a cell on, which were not in the set; the cell itself may be
    /// outside the map if its bit is not set.
    fn reach(&mut self, first: Cell, new_cells: u64) {
        if new_cells == 0 {
            return;
        }
        let by = new_cells.trailing_zeros().cast_signed();
        let (first, new_cells) = (Cell::new(first.x + by, first.y, first.z), new_cells >> by);
        let Some(index) = self.extent.index(first) else { return };
        self.cells.insert_missing(index, new_cells);
        self.rest(first, new_cells);
        self.note(first, new_cells);
    }

    /// Finds out in which cells of a row, from a cell of the map on, a ground body can rest.
    fn rest(&mut self, first: Cell, cells: u64) {
        let Some(resting) = &mut self.resting else { return };
        for cell in bits(cells).map(|by| Cell::new(first.x + by.cast_signed(), first.y, first.z)) {
            if let Some(index) = self.extent.index(cell).filter(|_| self.graph.can_rest(cell)) {
                resting.insert(index);
            }
        }
    }

    /// Notes that steps are to be made from cells of a row, from a cell of the map on: at most 10.
    fn note(&mut self, first: Cell, cells: u64) {
        let spread = cells << (first.x % SIDE);
        for by in 0..3 {
            let of_block = (spread >> (SIDE * by)) as u8;
            if of_block != 0 {
                self.note_in_block([first.x / SIDE + by, first.y / SIDE, first.z / SIDE], first, of_block);
            }
        }
    }

    fn note_in_block(&mut self, [x, y, z]: [i32; 3], row: Cell, cells: u8) {
        let number = (z * self.size[1] + y) * self.size[0] + x;
        let place = &mut self.scratch.places[number as usize];
        if *place == 0 {
            self.scratch.blocks.push(Block::at(Cell::new(SIDE * x, SIDE * y, SIDE * z)));
            self.scratch.numbers.push(number.cast_unsigned());
            *place = self.scratch.blocks.len() as u32;
        }
        let place = *place - 1;
        let block = &mut self.scratch.blocks[place as usize];
        let row = (row.z % SIDE * SIDE + row.y % SIDE) as usize;
        block.new[row] |= cells;
        block.new_rows |= 1 << row;
        if !std::mem::replace(&mut block.is_listed, true) {
            self.scratch.left.push(place);
        }
    }

    fn run(&mut self) {
        while let Some(place) = self.scratch.left.pop() {
            let place = place as usize;
            let block = &mut self.scratch.blocks[place];
            let corner = block.corner;
            let around = block.around.take();
            let around = around.unwrap_or_else(|| self.footprint.around(self.graph.map(), corner, SIDE));
            loop {
                let block = &mut self.scratch.blocks[place];
                let is_through_faces = block.new_rows != 0;
                let rows = if is_through_faces { &mut block.new_rows } else { &mut block.turned_rows };
                if *rows == 0 {
                    break;
                }
                let row = rows.trailing_zeros() as usize;
                *rows &= *rows - 1;
                let cells = if is_through_faces { &mut block.new } else { &mut block.turned };
                let here = std::mem::take(&mut cells[row]);
                if is_through_faces {
                    block.turned[row] |= here;
                    block.turned_rows |= 1 << row;
                }
                let at = (row as i32 % SIDE, row as i32 / SIDE);
                self.make_steps(corner, at, here, &around, is_through_faces);
            }
            let block = &mut self.scratch.blocks[place];
            (block.around, block.is_listed) = (Some(around), false);
        }
    }

    /// Makes the steps from some cells of a row of a block: those through faces, or the others.
    fn make_steps(&mut self, corner: Cell, (y, z): (i32, i32), cells: u8, around: &Around, is_through_faces: bool) {
        let here = u64::from(cells) & around.room(y, z) >> 1;
        if here == 0 {
            return;
        }
        for (by, on_the_way) in self.footprint.steps() {
            let is_through_face = by.x.abs() + by.y.abs() + by.z.abs() == 1;
            if is_through_face != is_through_faces {
                continue;
            }
            let ends = here & around.room(y + by.y, z + by.z) >> (1 + by.x);
            if ends == 0 {
                continue;
            }
            // In which there is room, so they are inside the map, but for the first of the row.
            let mut first = corner + Cell::new(0, y, z) + *by;
            let outside = (-first.x).max(0);
            first.x += outside;
            let Some(index) = self.extent.index(first) else { continue };
            let missing = self.cells.missing(index, ends >> outside) << outside;
            let mut open = around.open(missing, (y, z), on_the_way);
            if let Some(footing) = self.footprint.footing() {
                let can_go = |&x: &u32| {
                    let from = corner + Cell::new(x.cast_signed(), y, z);
                    footing.can_go(self.graph.map(), from, from + *by)
                };
                open = bits(open).filter(can_go).fold(0, |open, x| open | 1 << x);
            }
            self.reach(first, open >> outside);
        }
    }
}
