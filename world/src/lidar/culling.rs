//! Which rays of a scan can reach a cell that its memory has not seen. The others find nothing new,
//! so [`CullingEngine`] does not cast them.
//!
//! **Why it is exact.** The cells that a ray visits before the first unseen one are seen and free,
//! and the last of them is at the edge of what is seen. So it is enough to follow the rays through
//! seen free cells to the edge. They are followed all at once, as a set for each block of cells,
//! from the body's cell outwards: the rays that may enter a block are those that may come from a
//! neighbour and whose direction passes it. A face between a cell of the edge and an unseen
//! neighbour makes the rays *open* that pass both. The sets have more rays than truly pass, never
//! fewer: they hold for every position in the body's cell, they tell groups of rays apart and not
//! single ones, blocks are larger than cells, and all is widened by [`SLACK_CELLS`] against
//! rounding. Active rays are cast in full.
//!
//! **What stays known.** Cells are forgotten only when the map changes, and all that is said here
//! with them ([`CullingState::forget_active`]). So a group that is not active from a cell of
//! the body never is from there again. A memory keeps the active groups of each cell that its body
//! has scanned from, and follows only those the next time. (A scan that was cast ahead may be taken
//! back, with all that was known by it.) While the body stays in its cell, a group
//! stays active as long as the unseen cell that activated it, its watched cell, is unseen; then it
//! is followed anew.
//!
//! **A common start.** The first cells of a ray mostly pass. Up to the nearest cell that does not
//! and that a group may enter, its rays need not be followed cell by cell (`clear`).
//!
//! Invariant: the marks of a memory and the lists of new cells, with their order, are those of a
//! cast of all rays, whatever the memory holds; tests compare the two.

mod clear;
mod passing;

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

use voxels::bits;

use super::cast::{Kernel, Start};
use super::engine::{CastCount, Engine, NewCells, NotCast};
use super::marks::Marks;
use super::memory::Parts;
use super::pattern::Bundle;
use super::slots::step;
use super::{Pattern, Scanner, SensorMemory};
use crate::body::Pose;
use clear::ClearCells;
use passing::Passing;

/// Rays are followed for `1 << OFFSET_BITS` cells along each axis; those that are free for longer
/// are always cast.
const OFFSET_BITS: u32 = 5;

/// Rays from which on following them in groups is faster than casting them.
const RAYS_MIN: u32 = 1000;

/// How far a ray may pass from a cell that it is taken to enter, because of rounding. The errors of
/// the traversal are below 1e-9 cells on the largest map.
const SLACK_CELLS: f64 = 1e-6;

/// A set of groups of rays of one octant, one bit each.
type Groups = u64;

/// Casts the rays that can find something new, in bundles.
#[derive(Debug)]
pub(crate) struct CullingEngine;

impl Engine for CullingEngine {
    fn cast(&mut self, scanner: &Scanner, memory: &mut SensorMemory, pose: &Pose, new: NewCells<'_>) -> CastCount {
        self.cast_undoable(scanner, memory, pose, new).0
    }
}

impl CullingEngine {
    /// As [`Engine::cast`]; also returns what the scan has replaced of what the memory knew about
    /// rays.
    pub(super) fn cast_undoable(
        &self,
        scanner: &Scanner,
        memory: &mut SensorMemory,
        pose: &Pose,
        mut new: NewCells<'_>,
    ) -> (CastCount, Option<UndoEntry>) {
        let due = u64::from(scanner.rays());
        let Some(start) = scanner.start(memory, pose) else {
            return (CastCount::without(due, NotCast::OutsideMap), None);
        };
        let extent = memory.extent();
        memory.see_body(&pose.position, &mut new);
        let Parts { marks, culling } = memory.parts();
        start.see_own(marks, &mut new);
        let kernel = Kernel::best();
        let bundles = scanner.bundles(pose.yaw_rad);
        let (active, undo) = match &scanner.rays.culling {
            Some(rays) => {
                let active = rays.active_bundles(&start, scanner.unit_range_cells(extent), marks, culling);
                (active.bundles, active.undo)
            }
            None => (vec![(0..bundles.len(), 0.0)], None),
        };
        let mut count = CastCount::of(due);
        let (mut followed, mut cast) = (0, 0);
        for (active, clear_cells) in active {
            followed += bundles[active.clone()].iter().map(Bundle::rays).sum::<u64>();
            cast += kernel.scan(marks, &start, &bundles[active], clear_cells, &mut new);
        }
        count.leave_out(due - followed, NotCast::NothingUnseen);
        count.leave_out(followed - cast, NotCast::OutsideView);
        (count, undo)
    }
}

/// The rays of a scanner, in groups that are followed together.
pub(super) struct Culling {
    octants: Vec<Octant>,
    offset_bits: u32,
    /// `None` if lengths along rays are no distances.
    clear: Option<ClearCells>,
}

/// The rays of one octant.
struct Octant {
    goes_down: [bool; 3],
    /// Its bundles among those of the scanner.
    bundles: Range<usize>,
    bundles_per_group: usize,
    passing: Passing,
}

/// What a memory knows about the cells that it has not seen.
#[derive(Clone)]
pub(super) struct CullingState {
    /// The rays for which the rest is known.
    culling: Option<Arc<Culling>>,
    /// By slot of the body's cell, and by octant, the groups that were active at the last scan from
    /// there.
    active_from: BTreeMap<u64, [Groups; 8]>,
    /// The slot of the body's cell at the last scan.
    slot: Option<u64>,
    /// What is active from there, by octant.
    active: [ActiveSet; 8],
}

/// The rays to cast.
pub(super) struct ActiveBundles {
    /// Groups of bundles, each with the length in cells up to which its rays cross only cells that
    /// pass.
    pub(super) bundles: Vec<(Range<usize>, f64)>,
    /// What finding them has replaced.
    pub(super) undo: Option<UndoEntry>,
}

/// A slot of a body's cell, and what was known about scans from there.
#[derive(Debug)]
pub(super) struct UndoEntry(u64, Option<[Groups; 8]>);

/// The active groups of one octant.
#[derive(Clone, Copy)]
struct ActiveSet {
    groups: Groups,
    /// By group, the slot of an unseen cell that activates it; [`NO_WATCHED_CELL`] if it is active
    /// because it is free for too long.
    watched_cells: WatchedCells,
}

/// By group, the slot of a cell.
type WatchedCells = [u64; Groups::BITS as usize];

/// No slot.
const NO_WATCHED_CELL: u64 = u64::MAX;

/// A block that groups may enter.
#[derive(Clone, Copy)]
struct Offset {
    /// Its offset in blocks from that of the body, packed: x first.
    offset: u32,
    /// The octant of the marks that it is, with the coordinates along which rays go down flipped.
    flipped: u64,
}

/// Buffers for following rays.
#[derive(Default)]
struct Scratch {
    /// By offset in blocks the groups that may enter; all 0 between two uses.
    entering: Vec<Groups>,
    /// The places at one number of steps from the body's block, and at one more.
    layers: [Vec<Offset>; 2],
}

thread_local! {
    static SCRATCH: RefCell<Scratch> = RefCell::default();
}

impl Culling {
    /// The reach of these bundles, or `None` if there are too few rays to gain from it.
    pub(super) fn of_many(pattern: &Pattern, rays: u32, bundles: &[Bundle]) -> Option<Arc<Self>> {
        (rays >= RAYS_MIN).then(|| Arc::new(Self::new(pattern, bundles, OFFSET_BITS)))
    }

    /// The reach of bundles that are sorted by octant, followed for `1 << offset_bits` cells.
    pub(super) fn new(pattern: &Pattern, bundles: &[Bundle], offset_bits: u32) -> Self {
        let mut octants = Vec::new();
        let mut begin = 0;
        for bundles in bundles.chunk_by(|a, b| a.goes_down == b.goes_down) {
            let bundles_per_group = bundles.len().div_ceil(Groups::BITS as usize);
            let end = begin + bundles.len();
            octants.push(Octant {
                goes_down: bundles[0].goes_down,
                bundles: begin..end,
                bundles_per_group,
                passing: Passing::new(pattern, bundles, bundles_per_group, offset_bits),
            });
            begin = end;
        }
        let is_of_distances = !matches!(pattern, Pattern::Shell { .. });
        let clear = is_of_distances.then(|| ClearCells::new(offset_bits));
        Self { octants, offset_bits, clear }
    }

    /// The ranges of bundles to cast: those with rays that may reach an unseen cell. `range_cells`
    /// is that of rays whose direction has length 1, and infinite for others.
    pub(super) fn active_bundles(
        self: &Arc<Self>,
        start: &Start,
        range_cells: f64,
        marks: &mut Marks,
        culling: &mut CullingState,
    ) -> ActiveBundles {
        let mut changed = culling.changed(self, start.slot(), marks);
        SCRATCH.with_borrow_mut(|scratch| {
            scratch.entering.resize(1 << (3 * (self.offset_bits - 1)), 0);
            for ((octant, active), changed) in self.octants.iter().zip(&mut culling.active).zip(&mut changed) {
                active.groups &= !*changed;
                if *changed != 0 {
                    let flip = start.slots().flip(octant.goes_down);
                    let block_bits = self.offset_bits - 1;
                    let mut follow = Follow { octant, start, marks, range_cells, block_bits, flip };
                    active.groups |= follow.active_groups(*changed, &mut active.watched_cells, scratch);
                }
            }
        });
        let undo = (changed != [0; 8]).then(|| {
            let active = culling.active.map(|active| active.groups);
            UndoEntry(start.slot(), culling.active_from.insert(start.slot(), active))
        });
        let mut bundles = Vec::new();
        for (octant, active) in self.octants.iter().zip(&culling.active) {
            let clear_cells = match &self.clear {
                Some(clear) => clear.of_groups(octant, active.groups, start, marks),
                None => [0.0; Groups::BITS as usize],
            };
            let of_group = |group: u32| (octant.bundles_of(group), clear_cells[group as usize]);
            bundles.extend(bits(active.groups).map(of_group));
        }
        ActiveBundles { bundles, undo }
    }
}

impl CullingState {
    /// The state before the first scan: every group is active.
    pub(super) fn new() -> Self {
        let active = [ActiveSet { groups: 0, watched_cells: [NO_WATCHED_CELL; Groups::BITS as usize] }; 8];
        Self { culling: None, active_from: BTreeMap::new(), slot: None, active }
    }

    /// Takes back what is known since a scan that replaced this.
    pub(super) fn restore(&mut self, undo: Option<UndoEntry>) {
        match undo {
            Some(UndoEntry(slot, Some(active))) => self.active_from.insert(slot, active),
            Some(UndoEntry(slot, None)) => self.active_from.remove(&slot),
            None => None,
        };
        self.slot = None;
    }

    /// Forgets which groups are active, after cells have been forgotten.
    pub(super) fn forget_active(&mut self) {
        self.active_from.clear();
        self.slot = None;
    }

    /// The groups to be followed for a scan from a slot, by octant.
    fn changed(&mut self, culling: &Arc<Culling>, slot: u64, marks: &Marks) -> [Groups; 8] {
        let is_same = self.culling.as_ref().is_some_and(|known| Arc::ptr_eq(known, culling));
        if !is_same {
            self.culling = Some(Arc::clone(culling));
            self.active_from.clear();
        }
        if is_same && self.slot == Some(slot) {
            return self.active.each_ref().map(|active| active.outdated(marks));
        }
        self.slot = Some(slot);
        self.active.iter_mut().for_each(|active| active.groups = 0);
        self.active_from.get(&slot).copied().unwrap_or([Groups::MAX; 8])
    }
}

impl ActiveSet {
    /// The groups whose watched cell has been seen.
    fn outdated(&self, marks: &Marks) -> Groups {
        let mut outdated = 0;
        for group in bits(self.groups) {
            let watched = self.watched_cells[group as usize];
            outdated |= Groups::from(watched != NO_WATCHED_CELL && !marks.is_unseen(watched)) << group;
        }
        outdated
    }
}

impl Octant {
    /// The bundles of a group.
    fn bundles_of(&self, group: u32) -> Range<usize> {
        let begin = self.bundles.start + group as usize * self.bundles_per_group;
        begin..(begin + self.bundles_per_group).min(self.bundles.end)
    }
}

/// The place of a cell in its block, by its slot, flipped: bit 0 is set if it is the farther one
/// along x, bit 1 along y, bit 2 along z.
fn place_in_block(flipped: u64) -> usize {
    (flipped & IN_BLOCK_BITS) as usize
}

/// The rays of one octant on their way from the body's cell.
struct Follow<'a> {
    octant: &'a Octant,
    start: &'a Start,
    marks: &'a mut Marks,
    range_cells: f64,
    block_bits: u32,
    /// The bits of the coordinates along which the rays go down.
    flip: u64,
}

/// Bits of a slot that number the cell in its octant of the marks, which is a block here.
const IN_BLOCK: u32 = 3;

/// Those bits.
const IN_BLOCK_BITS: u64 = (1 << IN_BLOCK) - 1;

impl Follow<'_> {
    /// The groups among `groups` that may reach a cell that has not been seen, with their watched
    /// cells.
    fn active_groups(&mut self, groups: Groups, watched_cells: &mut WatchedCells, scratch: &mut Scratch) -> Groups {
        let Scratch { entering, layers: [present, next] } = scratch;
        let home = self.start.slot() ^ self.flip;
        // Away from the body: 1 if its cell is the farther one of its block along an axis.
        let ahead = [0, 1, 2].map(|axis| (home >> axis & 1) as u32);
        let passing = self.octant.passing.blocks(place_in_block(home));
        let masks = self.start.slots().masks().map(|mask| mask >> IN_BLOCK);
        let flip = self.flip >> IN_BLOCK;
        let last = (1_u32 << self.block_bits) - 1;
        // The rays leave the body's cell whatever it is.
        let mut active = self.activated_at(groups, home, [0; 3], watched_cells);
        entering[0] = groups;
        present.push(Offset { offset: 0, flipped: home >> IN_BLOCK });
        while !present.is_empty() {
            for Offset { offset, flipped } in present.drain(..) {
                let mut entered = std::mem::take(&mut entering[offset as usize]) & passing[offset as usize] & !active;
                let blocks = [0, 1, 2].map(|axis| offset >> (axis * self.block_bits) & last);
                // The offset in cells of the nearest cell of the block; below 0 only behind the
                // body.
                let nearest = [0, 1, 2].map(|axis| (2 * blocks[axis]) as i32 - ahead[axis] as i32);
                if entered == 0 || !self.is_in_range(nearest.map(|cells| cells.max(0) as u32)) {
                    continue;
                }
                let cells = self.marks.edges_of(flipped ^ flip);
                if cells != 0 {
                    let (activated, outdated) =
                        self.activated_in_block(entered, flipped, cells, nearest, watched_cells);
                    self.marks.clear_edges(flipped ^ flip, outdated);
                    active |= activated;
                    entered &= !activated;
                }
                for axis in 0..3 {
                    if blocks[axis] == last {
                        active |= entered;
                        set_watched_cell(watched_cells, entered, NO_WATCHED_CELL);
                        break;
                    }
                    let beyond = step(flipped, masks[axis]);
                    if self.marks.octant_passes(beyond ^ flip) {
                        let offset = offset + (1 << (axis as u32 * self.block_bits));
                        let entering = &mut entering[offset as usize];
                        if *entering == 0 {
                            next.push(Offset { offset, flipped: beyond });
                        }
                        *entering |= entered;
                    }
                }
            }
            std::mem::swap(present, next);
        }
        active
    }

    /// The groups among `groups` that these cells of a block activate, and the cells that are not
    /// at the edge any more. The nearest cell of the block has this offset.
    fn activated_in_block(
        &self,
        groups: Groups,
        block: u64,
        mut cells: u8,
        nearest: [i32; 3],
        watched_cells: &mut WatchedCells,
    ) -> (Groups, u8) {
        let slots = self.start.slots();
        let (mut activated, mut outdated) = (0, 0);
        while cells != 0 {
            let cell = cells & cells.wrapping_neg();
            cells ^= cell;
            let flipped = block << IN_BLOCK | u64::from(cell.trailing_zeros()) ^ self.flip & 7;
            let offset = [0, 1, 2].map(|axis| nearest[axis] + (flipped >> axis & 1) as i32);
            if !slots.beside(flipped ^ self.flip).into_iter().any(|beside| self.marks.is_unseen(beside)) {
                outdated |= cell;
            } else if offset.iter().all(|&cells| cells >= 0) {
                let offset = offset.map(|cells| cells as u32);
                activated |= self.activated_at(groups & !activated, flipped, offset, watched_cells);
            }
        }
        (activated, outdated)
    }

    /// The groups among `groups` that pass the free cell at an offset and a neighbour that has not
    /// been seen, with that as their watched cell.
    fn activated_at(&self, groups: Groups, flipped: u64, offset: [u32; 3], watched_cells: &mut WatchedCells) -> Groups {
        let passing = &self.octant.passing;
        let groups = groups & passing.cell(offset);
        let mut activated = 0;
        for axis in 0..3 {
            let mut beside = offset;
            beside[axis] += 1;
            let slot = self.start.slots().above(flipped, axis) ^ self.flip;
            if groups & !activated != 0 && self.marks.is_unseen(slot) && self.is_in_range(beside) {
                let new = groups & !activated & passing.cell(beside);
                set_watched_cell(watched_cells, new, slot);
                activated |= new;
            }
        }
        activated
    }

    /// Whether a ray from some position in the body's cell can enter the cell at an offset within
    /// the range.
    fn is_in_range(&self, offset: [u32; 3]) -> bool {
        let squared = |cells: u32| {
            let gap = f64::from(cells.saturating_sub(1));
            gap * gap
        };
        let limit_cells = self.range_cells + SLACK_CELLS;
        self.range_cells == f64::INFINITY || offset.map(squared).iter().sum::<f64>() <= limit_cells * limit_cells
    }
}

fn set_watched_cell(watched_cells: &mut WatchedCells, mut groups: Groups, slot: u64) {
    while groups != 0 {
        watched_cells[groups.trailing_zeros() as usize] = slot;
        groups &= groups - 1;
    }
}
