//! What a sensor has seen, as bits by [slot](super::slots).
//!
//! Invariants: a free cell that has been seen passes; a wall that has been seen stops; the free
//! cells that have been seen and have a neighbour that has not are edges. A mark of an edge may be
//! out of date: whoever finds that clears it. Slots outside the map stop once a ray has ended
//! there.

use std::fmt;
use std::sync::Arc;

use voxels::{Cell, Grid, Terrain};

use super::engine::NewCells;
use super::slots::{Slots, bit, word};

/// Bits of a word that a byte of it holds.
const OCTANT_BITS: u64 = 8;

/// The marks of one sensor, and the true free cells. Words of cells that were never seen take no
/// memory where the system commits it on first write.
#[derive(Clone)]
pub(super) struct Marks {
    slots: Slots,
    /// The free cells of the map, shared by all sensors.
    free: Arc<Vec<u64>>,
    /// The free cells that have been seen: rays cross them without a trace.
    passes: Vec<u64>,
    /// The walls that have been seen, with slots outside the map in which rays have ended; and the
    /// edge of what has been seen.
    sides: Vec<[u64; 2]>,
}

/// The numbers of the marks in `sides`.
const STOPS: usize = 0;
const EDGES: usize = 1;

/// Omits the cells, of which there are millions.
impl fmt::Debug for Marks {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Marks").field("slots", &self.slots).finish_non_exhaustive()
    }
}

impl Marks {
    /// No marks in a terrain.
    pub(super) fn new(terrain: &Grid<Terrain>) -> Self {
        let slots = Slots::new(terrain.extent());
        let mut free = vec![0; slots.words()];
        for (cell, _) in terrain.iter().filter(|&(_, &terrain)| terrain == Terrain::Free) {
            let slot = slots.of(cell);
            free[word(slot)] |= bit(slot);
        }
        Self::blank(slots, Arc::new(free))
    }

    /// No marks in the same terrain.
    pub(super) fn unused(&self) -> Self {
        Self::blank(self.slots, Arc::clone(&self.free))
    }

    fn blank(slots: Slots, free: Arc<Vec<u64>>) -> Self {
        Self { slots, free, passes: vec![0; slots.words()], sides: vec![[0; 2]; slots.words()] }
    }

    pub(super) fn slots(&self) -> &Slots {
        &self.slots
    }

    /// Whether the cell at a slot is free, seen or not; slots outside the map are not.
    pub(super) fn is_free(&self, slot: u64) -> bool {
        self.free[word(slot)] & bit(slot) != 0
    }

    /// The cells that pass, by word.
    #[inline(always)]
    pub(super) fn passes(&self) -> &[u64] {
        &self.passes
    }

    /// Whether the cell at a slot has not been seen.
    #[inline]
    pub(super) fn is_unseen(&self, slot: u64) -> bool {
        (self.passes[word(slot)] | self.sides[word(slot)][STOPS]) & bit(slot) == 0
    }

    /// Marks the cell at a slot as seen, adds it if it is new, and returns whether a ray crosses
    /// it.
    #[inline(always)]
    pub(super) fn see(&mut self, slot: u64, new: &mut NewCells<'_>) -> bool {
        let (at, bit) = (word(slot), bit(slot));
        if self.passes[at] & bit != 0 {
            return true;
        }
        let sides = &mut self.sides[at];
        let is_free = self.free[at] & bit != 0;
        if is_free {
            self.passes[at] |= bit;
            sides[EDGES] |= bit;
        } else if sides[STOPS] & bit != 0 {
            return false;
        } else {
            sides[STOPS] |= bit;
        }
        if let Some(index) = self.slots.extent().index(self.slots.cell(slot)) {
            let cells = if is_free { &mut *new.free } else { &mut *new.wall };
            cells.push(index as u32);
        }
        is_free
    }

    /// Whether a cell of the map is free and has been seen.
    pub(super) fn passes_at(&self, cell: Cell) -> bool {
        let slot = self.slots.of(cell);
        self.passes[word(slot)] & bit(slot) != 0
    }

    /// Makes cells (by index) free or wall in the map that all these marks share.
    pub(super) fn change(mut all: Vec<&mut Self>, cells: &[u32], is_free: bool) {
        let Some(first) = all.first_mut() else { return };
        let slots = first.slots;
        let mut shared = std::mem::take(&mut first.free);
        all.iter_mut().skip(1).for_each(|marks| marks.free = Arc::default());
        // The only reference is left, so that nothing is copied.
        let free = Arc::make_mut(&mut shared);
        for slot in cells.iter().map(|&index| slots.of(slots.extent().cell_at(index as usize))) {
            match is_free {
                true => free[word(slot)] |= bit(slot),
                false => free[word(slot)] &= !bit(slot),
            }
        }
        all.iter_mut().for_each(|marks| marks.free = Arc::clone(&shared));
    }

    /// Marks cells as not seen, by index.
    pub(super) fn forget(&mut self, cells: impl Iterator<Item = u32> + Clone) {
        let (slots, extent) = (self.slots, self.slots.extent());
        let cells = cells.map(|index| slots.of(extent.cell_at(index as usize)));
        for slot in cells.clone() {
            let (at, bit) = (word(slot), bit(slot));
            self.passes[at] &= !bit;
            self.sides[at][STOPS] &= !bit;
            self.sides[at][EDGES] &= !bit;
        }
        for beside in cells.flat_map(|slot| slots.beside(slot)) {
            self.sides[word(beside)][EDGES] |= self.passes[word(beside)] & bit(beside);
        }
    }

    /// Whether an octant has a cell that passes.
    #[inline]
    pub(super) fn octant_passes(&self, octant: u64) -> bool {
        byte(self.passes[word_of(octant)], octant) != 0
    }

    /// The cells of an octant that do not pass.
    #[inline]
    pub(super) fn octant_stops(&self, octant: u64) -> u8 {
        !byte(self.passes[word_of(octant)], octant)
    }

    /// The cells of an octant that may be at the edge.
    #[inline]
    pub(super) fn edges_of(&self, octant: u64) -> u8 {
        byte(self.sides[word_of(octant)][EDGES], octant)
    }

    /// Marks cells of an octant as not at the edge.
    pub(super) fn clear_edges(&mut self, octant: u64, cells: u8) {
        self.sides[word_of(octant)][EDGES] &= !(u64::from(cells) << (octant % 8 * OCTANT_BITS));
    }
}

fn word_of(octant: u64) -> usize {
    (octant / 8) as usize
}

fn byte(word: u64, octant: u64) -> u8 {
    (word >> (octant % 8 * OCTANT_BITS)) as u8
}
