//! Where a body wider than a cell has room, and which steps it can make there: for blocks of cells
//! at a time.
//!
//! At fine resolutions a body touches a hundred cells in a step. Here the cells of a row are the
//! bits of a word, so that the cells that the body touches are looked up for all cells of a row at
//! once. What a step touches beyond the body at both of its ends are a few cells.
//!
//! A ground body makes only those of them for which it has footing.
//!
//! Invariant: the steps are those found cell by cell, to the bit. They are those of one map at one
//! time: who keeps them must not change the map.

use std::cell::RefCell;

use voxels::{Cell, Footing};

use super::graph::those_of_cube;
use crate::exploration_map::ExplorationMap;

/// Edge of a block, cells.
const SIDE: i32 = 8;

/// Rows of a block.
const ROWS: usize = (SIDE * SIDE) as usize;

/// Bytes of a row of a block: one for each step, with a bit for each cell.
const ROW_BYTES: usize = 32;

/// Steps from the cells of a block: by row a byte for each step.
type OfBlock = [u8; ROWS * ROW_BYTES];

/// A run of cells along x, relative to the cell of a body.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Span {
    y: i32,
    z: i32,
    low: i32,
    high: i32,
}

impl Span {
    /// The runs of cells, which are in the order of cells.
    fn all(cells: &[Cell]) -> Vec<Self> {
        let mut spans: Vec<Self> = Vec::new();
        for &Cell { x, y, z } in cells {
            match spans.last_mut() {
                Some(last) if (last.y, last.z, last.high + 1) == (y, z, x) => last.high = x,
                _ => spans.push(Self { y, z, low: x, high: x }),
            }
        }
        spans
    }

    /// The greatest coordinate, without its sign.
    fn reach(&self) -> i32 {
        [self.y, self.z, self.low, self.high].into_iter().map(i32::abs).max().unwrap_or_default()
    }
}

/// What a body touches.
#[derive(Debug, Clone, Default)]
pub(super) struct Footprint {
    /// At rest at the centre of a cell; spans with the same ends follow each other.
    body: Vec<Span>,
    /// For each step where it leads, and what the body touches on the way alone.
    steps: Vec<(Cell, Vec<Span>)>,
    /// Cells along each axis that matter for the steps from a cell.
    reach: i32,
    /// That of a ground body.
    footing: Option<Footing>,
}

impl Footprint {
    /// That of a body which at rest touches these cells, in their order, and for each step those
    /// that it touches in it.
    pub(super) fn new<'s>(body: &[Cell], steps: impl Iterator<Item = (Cell, &'s [Cell])>) -> Self {
        let touches = |cell: Cell| body.binary_search(&cell).is_ok();
        let on_the_way = |by: Cell, swept: &[Cell]| {
            let extra: Vec<Cell> =
                swept.iter().copied().filter(|&cell| !touches(cell) && !touches(cell - by)).collect();
            (by, Span::all(&extra))
        };
        let steps: Vec<(Cell, Vec<Span>)> = steps.map(|(by, swept)| on_the_way(by, swept)).collect();
        let mut body = Span::all(body);
        body.sort_unstable_by_key(|span| (span.low, span.high));
        let of_body = body.iter().map(Span::reach).max().unwrap_or_default();
        let of_steps = steps.iter().flat_map(|(_, spans)| spans).map(Span::reach).max().unwrap_or_default();
        Self { body, steps, reach: of_steps.max(of_body + 1), footing: None }
    }

    /// That of a ground body.
    pub(super) fn with(self, footing: Footing) -> Self {
        Self { footing: Some(footing), ..self }
    }

    /// The footing of a ground body.
    pub(super) fn footing(&self) -> Option<&Footing> {
        self.footing.as_ref()
    }

    /// Cells along each axis that matter for the steps from a cell.
    pub(super) fn reach(&self) -> i32 {
        self.reach
    }

    /// For each step where it leads, and what the body touches on the way alone.
    pub(super) fn steps(&self) -> &[(Cell, Vec<Span>)] {
        &self.steps
    }

    /// Room in a block of cells and around it.
    pub(super) fn around(&self, map: &ExplorationMap, corner: Cell, side: i32) -> Around {
        let mut around = Around { side, ..Around::default() };
        around.read(map, self, corner);
        around
    }

    /// Whether the body has room at a cell.
    pub(super) fn has_room(&self, map: &ExplorationMap, cell: Cell) -> bool {
        let is_clear = |&Span { y, z, low, high }: &Span| {
            let count = (high - low + 1).cast_unsigned();
            map.free_row(cell + Cell::new(low, y, z), count) == low_bits(count)
        };
        !self.body.is_empty() && self.body.iter().all(is_clear)
    }

    /// The cells of a cube, at most 5 along each axis, in which the body has room and can be: one
    /// bit each, x first.
    pub(super) fn usable_in(&self, map: &ExplorationMap, corner: Cell, side: i32) -> u128 {
        let is_narrow = side + 2 * self.reach <= Layers::SIDE as i32;
        let room =
            if is_narrow { self.room_in_layers(map, corner, side) } else { self.room_in_rows(map, corner, side) };
        match &self.footing {
            Some(footing) => those_of_cube(corner, side, room, |cell| footing.holds(map, cell)),
            None => room,
        }
    }

    /// The cells of such a cube with room for the body, row by row.
    fn room_in_rows(&self, map: &ExplorationMap, corner: Cell, side: i32) -> u128 {
        let mut rows = Rows::default();
        rows.read(map, corner, side, self.reach);
        let along = (0..side).flat_map(|z| (0..side).map(move |y| (z, y)));
        let usable = |(z, y)| u128::from(self.usable(&rows, (0, y, z), side.cast_unsigned()));
        along.fold(0, |bits, (z, y)| bits | usable((z, y)) << ((z * side + y) * side))
    }

    /// The cells of a cube with room for the body, with all rows of a layer at once; body and cube
    /// are small enough for [`Layers`].
    fn room_in_layers(&self, map: &ExplorationMap, corner: Cell, side: i32) -> u128 {
        let reach = self.reach;
        let mut layers = Layers::default();
        let (lowest, width) = (corner - Cell::new(reach, reach, reach), (side + 2 * reach).cast_unsigned());
        map.each_free_row(lowest, width, |[y, z], row| layers.0[z][y] = row as u16);
        let mut room = [[low_bits(side.cast_unsigned()) as u16; Layers::ROWS]; Layers::ROWS];
        let room_of_cube = &mut room[..side as usize];
        for spans in self.body.chunk_by(|a, b| (a.low, a.high) == (b.low, b.high)) {
            let all_free = layers.all_free((spans[0].low + reach).cast_unsigned(), spans[0].high - spans[0].low + 1);
            for span in spans {
                let [first, lowest] = [span.y + reach, span.z + reach].map(|at| at as usize);
                for (rows, layer) in room_of_cube.iter_mut().zip(&all_free.0[lowest..]) {
                    for (room, free) in rows.iter_mut().zip(&layer[first..first + Layers::ROWS]) {
                        *room &= free;
                    }
                }
            }
        }
        let rows = (0..side).flat_map(|z| (0..side).map(move |y| (z, y)));
        let row = |(z, y): (i32, i32)| u128::from(room[z as usize][y as usize]) << ((z * side + y) * side);
        rows.fold(0, |bits, place| bits | row(place))
    }

    /// The cells of a row with room for the body, from a place relative to the corner on.
    fn usable(&self, rows: &Rows, at: (i32, i32, i32), count: u32) -> u64 {
        let mut usable = low_bits(count);
        for span in &self.body {
            usable &= rows.all_free(at, span);
            if usable == 0 {
                break;
            }
        }
        usable
    }
}

/// The lowest bits of a word.
fn low_bits(count: u32) -> u64 {
    (1 << count) - 1
}

/// The free cells of a cube and around it, a word for each row.
#[derive(Debug, Clone, Default)]
struct Rows {
    rows: Vec<u64>,
    side: i32,
    /// Cells around the cube.
    reach: i32,
}

impl Rows {
    fn read(&mut self, map: &ExplorationMap, corner: Cell, side: i32, reach: i32) {
        (self.side, self.reach) = (side + 2 * reach, reach);
        self.rows.clear();
        let along = -reach..side + reach;
        for z in along.clone() {
            let row = |y| map.free_row(corner + Cell::new(-reach, y, z), self.side.cast_unsigned());
            self.rows.extend(along.clone().map(row));
        }
    }

    /// The cells of a row, from a place relative to the corner on, for which all cells of a span
    /// are free.
    #[inline]
    fn all_free(&self, (x, y, z): (i32, i32, i32), span: &Span) -> u64 {
        let row = (z + span.z + self.reach) * self.side + y + span.y + self.reach;
        let mut free = self.rows[row as usize] >> (x + span.low + self.reach);
        let count = span.high - span.low + 1;
        let mut joined = 1;
        while 2 * joined <= count {
            free &= free >> joined;
            joined *= 2;
        }
        free & free >> (count - joined)
    }
}

/// The free cells of a small cube and around it: by layer and row a bit for each.
#[derive(Default)]
struct Layers([[u16; Layers::SIDE + Layers::ROWS]; Layers::SIDE]);

impl Layers {
    /// Cells along each axis at most.
    const SIDE: usize = 16;

    /// Rows of a cube that are computed side by side.
    const ROWS: usize = 8;

    /// The cells for which all of so many cells of their row are free, the first of them this far
    /// up.
    fn all_free(&self, first: u32, count: i32) -> Self {
        let mut free = Self::default();
        for (layer, free) in self.0.iter().zip(&mut free.0) {
            for (row, free) in layer.iter().zip(free) {
                *free = row >> first;
            }
        }
        let mut joined = 1;
        while joined < count {
            let by = joined.min(count - joined);
            free.0.iter_mut().flatten().for_each(|row| *row &= *row >> by);
            joined += by;
        }
        free
    }
}

/// Room for a body in the rows of a block and in those around it, where steps lead to.
#[derive(Debug, Clone, Default)]
pub(super) struct Around {
    side: i32,
    rows: Rows,
    /// From the cell before each row on, one bit for each cell.
    room: Vec<u64>,
}

impl Around {
    fn read(&mut self, map: &ExplorationMap, footprint: &Footprint, corner: Cell) {
        let Self { side, rows, room } = self;
        rows.read(map, corner, *side, footprint.reach);
        let along = -1..=*side;
        room.clear();
        for z in along.clone() {
            room.extend(along.clone().map(|y| footprint.usable(rows, (-1, y, z), side.cast_unsigned() + 2)));
        }
    }

    /// The cells of a row with room, from the one before the row on.
    #[inline]
    pub(super) fn room(&self, y: i32, z: i32) -> u64 {
        self.room[((z + 1) * (self.side + 2) + y + 1) as usize]
    }

    /// Those of some cells of a row from which a step is open, by what the body touches on the way.
    #[inline]
    pub(super) fn open(&self, cells: u64, (y, z): (i32, i32), on_the_way: &[Span]) -> u64 {
        let free = |open: u64, span: &Span| if open == 0 { 0 } else { open & self.rows.all_free((0, y, z), span) };
        on_the_way.iter().fold(cells, free)
    }
}

/// The steps of a body from the cells of the blocks that were asked for.
///
/// It takes 2 KiB for each of them: a quarter of what a search notes of their cells.
#[derive(Debug, Default)]
pub(super) struct BlockSteps {
    /// By block 1 + its place in the list, or 0.
    places: Vec<u32>,
    /// The blocks of the list.
    listed: Vec<u32>,
    steps: Vec<OfBlock>,
    around: Around,
}

thread_local! {
    /// What no search of this thread uses at present.
    static SPARE: RefCell<Vec<BlockSteps>> = const { RefCell::new(Vec::new()) };
}

impl BlockSteps {
    /// Of this thread, of no block yet.
    pub(super) fn take() -> Self {
        let mut taken = SPARE.with_borrow_mut(Vec::pop).unwrap_or_default();
        for block in taken.listed.drain(..) {
            taken.places[block as usize] = 0;
        }
        taken.steps.clear();
        taken
    }

    /// For another search of this thread.
    pub(super) fn give_back(self) {
        // A thread that ends has no use for it any more.
        let _ = SPARE.try_with(|spare| spare.borrow_mut().push(self));
    }

    /// The possible steps from a cell of the map, as bits in the order of the footprint; none where
    /// the body has no room.
    pub(super) fn from(&mut self, map: &ExplorationMap, footprint: &Footprint, cell: Cell) -> u32 {
        let at = [cell.x, cell.y, cell.z];
        let [block_x, block_y, block_z] = at.map(|along| along / SIDE);
        let [size_x, size_y, size_z] = map.extent().size().map(|cells| cells.cast_signed() / SIDE + 1);
        let block = ((block_z * size_y + block_y) * size_x + block_x) as usize;
        if block >= self.places.len() {
            self.places.resize((size_x * size_y * size_z) as usize, 0);
        }
        if self.places[block] == 0 {
            self.listed.push(block as u32);
            self.places[block] = self.listed.len() as u32;
            let steps = self.fill(map, footprint, Cell::new(SIDE * block_x, SIDE * block_y, SIDE * block_z));
            self.steps.push(steps);
        }
        let steps = &self.steps[self.places[block] as usize - 1];
        let [x, y, z] = at.map(|along| along % SIDE);
        let row = (z * SIDE + y) as usize * ROW_BYTES;
        let bytes = &steps[row..row + ROW_BYTES];
        (0..).zip(bytes).fold(0, |steps, (number, &byte): (u32, _)| steps | u32::from(byte >> x & 1) << number)
    }

    fn fill(&mut self, map: &ExplorationMap, footprint: &Footprint, corner: Cell) -> OfBlock {
        let Self { around, .. } = self;
        let mut steps = [0; ROWS * ROW_BYTES];
        around.side = SIDE;
        around.read(map, footprint, corner);
        for (y, z) in (0..SIDE).flat_map(|z| (0..SIDE).map(move |y| (y, z))) {
            let here = around.room(y, z) >> 1 & low_bits(SIDE.cast_unsigned());
            if here == 0 {
                continue;
            }
            let row = (z * SIDE + y) as usize * ROW_BYTES;
            for (byte, (by, on_the_way)) in steps[row..row + ROW_BYTES].iter_mut().zip(&footprint.steps) {
                let ends = here & around.room(y + by.y, z + by.z) >> (1 + by.x);
                *byte = around.open(ends, (y, z), on_the_way) as u8;
                if let Some(footing) = &footprint.footing {
                    for x in 0..SIDE {
                        let from = corner + Cell::new(x, y, z);
                        if *byte >> x & 1 != 0 && !footing.can_go(map, from, from + *by) {
                            *byte &= !(1 << x);
                        }
                    }
                }
            }
        }
        steps
    }
}
