//! The simulated LiDAR: rays from a body through the true terrain, and a memory of the cells they
//! have hit before.
//!
//! A scan visits exactly the cells that [`voxels::walk`] visits along each of its rays up to the
//! first wall, the wall included, with the same arithmetic and the same tie rule; a test compares
//! the two. Rays are fixed in the frame `map` and do not turn with the body
//! (docs/reference-model.md, "LiDAR"); the heading only selects which of them are used if the field
//! of view is limited. Scans are exact, except for those of `noisy`. Bodies do not occlude what is
//! behind them. `culling` says which rays find nothing new and need not be cast.
//!
//! Invariants: a scan changes only the seen marks of its memory, and these are the same on every
//! processor; if a scan that was cast ahead is taken back, the memory is as if it had never been
//! cast. When scans are due is decided in [`super::World::sense`].

mod cast;
mod culling;
mod noisy;
mod pattern;
mod revision;

use std::f64::consts::TAU;
use std::fmt;
use std::sync::{Arc, Mutex, PoisonError, Weak};

use nalgebra::{Point3, Vector3};
use voxels::{Extent, Grid, Terrain};

use super::body::Pose;
use cast::{CellLists, FREE, Field, Kernel, OUTSIDE, Start, WALL};
use culling::{Culling, CullingState, Frontier, UndoEntry};
pub use noisy::NoisyScan;
use pattern::Bundle;
pub(super) use revision::change_kinds;

/// The directions of the rays of a scan.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pattern {
    /// A Fibonacci lattice: ray i of n has the azimuth `2 pi i / golden ratio` about the x axis of
    /// the map and the angle `acos(1 - 2 (i + 0.5) / n)` from it.
    Lattice {
        /// Number of rays; 5124 in MAES3D (docs/reference-model.md, "LiDAR").
        rays: u32,
    },
    /// One ray to every cell on the edge of a sphere about the body's cell: the older sensing of
    /// MAES3D.
    ///
    /// The edge is the cells of the ball (offset length at most the radius) that share a face with
    /// a cell outside it. A ray goes from the body's exact position along the offset of its edge
    /// cell and is as long as that offset, so it ends in that cell; nothing beyond the radius is
    /// seen. MAES3D counts 360 rays for a radius of 5 and 528 for 6 because its list repeats mirror
    /// images; these are 222 and 354 different rays.
    Shell {
        /// Radius of the sphere in cells; 5 in MAES3D. It is clamped to 1774, which covers the
        /// largest map.
        radius_cells: u32,
    },
}

/// A LiDAR: its rays, range and field of view.
#[derive(Clone)]
pub struct Scanner {
    rays: Arc<Rays>,
    range_m: f64,
    /// Cosine of half the field of view, or `None` if that is all directions.
    cone_cos: Option<f64>,
}

/// The rays of a pattern.
struct Rays {
    pattern: Pattern,
    count: u32,
    bundles: Vec<Bundle>,
    /// Says which bundles need not be cast; `None` if all are.
    culling: Option<Arc<Culling>>,
}

/// Those in use in this process: they take 10 ms and 4 MB, and are the same in each world.
static RAYS: Mutex<Vec<Weak<Rays>>> = Mutex::new(Vec::new());

impl Rays {
    /// The rays of a pattern, shared with all scanners that have them.
    fn of(pattern: Pattern) -> Arc<Self> {
        let mut in_use = RAYS.lock().unwrap_or_else(PoisonError::into_inner);
        in_use.retain(|rays| rays.strong_count() > 0);
        let present = in_use.iter().filter_map(Weak::upgrade).find(|rays| rays.pattern == pattern);
        present.unwrap_or_else(|| {
            let directions = pattern.directions();
            let count = directions.len() as u32;
            let bundles = Bundle::pack(directions);
            let culling = Culling::of_many(pattern, count, &bundles);
            let rays = Arc::new(Self { pattern, count, bundles, culling });
            in_use.push(Arc::downgrade(&rays));
            rays
        })
    }
}

/// Omits the rays, of which there are thousands.
impl fmt::Debug for Scanner {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Scanner")
            .field("pattern", &self.rays.pattern)
            .field("rays", &self.rays.count)
            .field("range_m", &self.range_m)
            .field("cone_cos", &self.cone_cos)
            .finish_non_exhaustive()
    }
}

impl Scanner {
    /// A LiDAR with this pattern of rays.
    ///
    /// A lattice sees cells that a ray enters within `range_m` metres, which may be infinite; a
    /// shell sees as far as its radius and ignores `range_m`. `fov_rad` is the full opening angle
    /// of a cone about the heading, in radians; from 2 pi on all rays are used.
    pub fn new(pattern: Pattern, range_m: f64, fov_rad: f64) -> Self {
        Self { rays: Rays::of(pattern), range_m, cone_cos: (fov_rad < TAU).then(|| libm::cos(fov_rad / 2.0)) }
    }

    /// Number of rays of a scan with an unlimited field of view.
    pub fn rays(&self) -> u32 {
        self.rays.count
    }

    /// The greatest length of a ray, metres, with cells of this length.
    pub fn greatest_range_m(&self, cell_m: f64) -> f64 {
        match self.rays.pattern {
            Pattern::Lattice { .. } => self.range_m,
            Pattern::Shell { radius_cells } => f64::from(radius_cells) * cell_m,
        }
    }

    /// Whether its scans do not depend on the heading.
    pub fn sees_all_around(&self) -> bool {
        self.cone_cos.is_none()
    }

    /// Whether scans from two poses see the same. The heading matters only with a limited field of
    /// view.
    pub fn sees_the_same(&self, a: &Pose, b: &Pose) -> bool {
        a.position == b.position && (self.cone_cos.is_none() || a.yaw_rad == b.yaw_rad)
    }

    /// Casts a scan from `pose` and marks the cells it hits as seen.
    ///
    /// Appends the indices of the cells that this memory has not seen before: crossed free cells
    /// (and the body's own) to `new_free`, walls that ended a ray to `new_wall`. **They come in no
    /// particular order, and that order differs between processors: sort before anything depends on
    /// it.** A position outside the map sees nothing.
    pub fn scan(&self, memory: &mut SensorMemory, pose: &Pose, new_free: &mut Vec<u32>, new_wall: &mut Vec<u32>) {
        let first = [new_free.len(), new_wall.len()];
        self.cast(memory, pose, &mut CellLists { free: new_free, wall: new_wall });
        for slot in new_free[first[0]..].iter_mut().chain(&mut new_wall[first[1]..]) {
            *slot = memory.index_of(*slot);
        }
    }

    /// Casts a scan before it is due. It may be taken back ([`SensorMemory::take_back`]) unless a
    /// later one is not cast ahead.
    pub fn scan_ahead(&self, memory: &mut SensorMemory, pose: &Pose) -> ScanAhead {
        let (mut free, mut wall) = (Vec::new(), Vec::new());
        let undo = self.cast(memory, pose, &mut CellLists { free: &mut free, wall: &mut wall });
        ScanAhead { pose: *pose, free, wall, undo }
    }

    /// Casts a scan, marks the cells it hits as seen, and adds the slots of the new ones. Returns
    /// what it has replaced of what was known.
    fn cast(&self, memory: &mut SensorMemory, pose: &Pose, found: &mut CellLists<'_>) -> Option<UndoEntry> {
        let start = self.start(memory, pose)?;
        let first = found.free.len();
        let mut undo = None;
        let mut field = Field { kinds: &memory.kinds, seen: &mut memory.seen };
        found.mark(&mut field, start.slot());
        let kernel = Kernel::best();
        if let Some(culling) = &self.rays.culling {
            let range_cells = self.unit_range_cells(memory.extent);
            let active = culling.active_bundles(&start, range_cells, field.seen, &mut memory.culling);
            undo = active.undo;
            for active in active.bundles {
                kernel.scan(&mut field, &start, &self.rays.bundles[active], found);
            }
        } else {
            kernel.scan(&mut field, &start, &self.rays.bundles, found);
        }
        found.free[first..].iter().for_each(|&slot| memory.culling.note_free(slot as usize));
        undo
    }

    /// Everything that a scan from `pose` sees, whether seen before or not.
    pub fn view(&self, memory: &SensorMemory, pose: &Pose) -> ScanView {
        let mut view = ScanView::default();
        let Some(start) = self.start(memory, pose) else { return view };
        let cell_m = memory.extent.cell_m();
        let mut met = vec![false; memory.kinds.len()];
        let mut lists = CellLists { free: &mut view.free, wall: &mut view.wall };
        let mut meet = |slot: usize, lists: &mut CellLists<'_>| {
            if !std::mem::replace(&mut met[slot], true) {
                lists.add(memory.kinds[slot], slot);
            }
        };
        meet(start.slot(), &mut lists);
        for bundle in &self.rays.bundles {
            for lane in bundle.lanes(start.cone()) {
                let end = cast::cast_ray(&start, bundle, lane, |slot| {
                    meet(slot, &mut lists);
                    !cast::is_stop(memory.kinds[slot])
                });
                if let Some((slot, entry)) = end
                    && cast::is_wall(memory.kinds[slot])
                {
                    view.hits.push(pose.position + bundle.direction(lane) * (entry * cell_m));
                }
            }
        }
        for list in [&mut view.free, &mut view.wall] {
            list.iter_mut().for_each(|slot| *slot = memory.index_of(*slot));
            list.sort_unstable();
        }
        view
    }

    /// The points where the rays of a scan from `pose` hit walls, metres, frame `map`: the hits of
    /// its [`Scanner::view`].
    pub fn hits(&self, memory: &SensorMemory, pose: &Pose) -> Vec<Point3<f64>> {
        let mut hits = Vec::new();
        let Some(start) = self.start(memory, pose) else { return hits };
        let cell_m = memory.extent.cell_m();
        for bundle in &self.rays.bundles {
            for lane in bundle.lanes(start.cone()) {
                let end = cast::cast_ray(&start, bundle, lane, |slot| !cast::is_stop(memory.kinds[slot]));
                if let Some((slot, entry)) = end
                    && cast::is_wall(memory.kinds[slot])
                {
                    hits.push(pose.position + bundle.direction(lane) * (entry * cell_m));
                }
            }
        }
        hits
    }

    /// The range of rays whose direction has length 1, in cells; infinite if they have other
    /// lengths.
    fn unit_range_cells(&self, extent: Extent) -> f64 {
        match self.rays.pattern {
            Pattern::Lattice { .. } => self.range_m / extent.cell_m(),
            Pattern::Shell { .. } => f64::INFINITY,
        }
    }

    fn start(&self, memory: &SensorMemory, pose: &Pose) -> Option<Start> {
        let cell_m = memory.extent.cell_m();
        let cell = memory.extent.cell_of(&pose.position);
        let slot = memory.extent.contains(cell).then(|| memory.slot_of(cell))?;
        let position = memory.extent.in_cells(&pose.position);
        let limit = match self.rays.pattern {
            Pattern::Lattice { .. } => self.range_m / cell_m,
            Pattern::Shell { .. } => 1.0,
        };
        let cone = self
            .cone_cos
            .map(|cone_cos| (Vector3::new(libm::cos(pose.yaw_rad), libm::sin(pose.yaw_rad), 0.0), cone_cos));
        Some(Start::new(cell, slot, memory.strides, position, limit, cone))
    }
}

/// The cells that one agent's LiDAR has seen so far. One byte per cell holds its kind once it has
/// been seen; the kinds of all cells are shared by all agents. Pages of cells that were never seen
/// take no memory where the system commits it on first write.
///
/// One layer of marks for the outside surrounds the cells, so that a ray needs no range test.
#[derive(Clone)]
pub struct SensorMemory {
    extent: Extent,
    strides: [usize; 3],
    kinds: Arc<Vec<u8>>,
    /// The kind of each cell that has been seen, 0 for the others.
    seen: Vec<u8>,
    /// By cell index the number of rays that crossed it minus those that ended in it; empty without
    /// noise.
    votes: Vec<i8>,
    culling: CullingState,
}

/// Omits the cells, of which there are millions.
impl fmt::Debug for SensorMemory {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("SensorMemory").field("extent", &self.extent).finish_non_exhaustive()
    }
}

impl SensorMemory {
    /// The memory of a LiDAR that has seen nothing yet.
    pub fn new(terrain: &Grid<Terrain>) -> Self {
        let extent = terrain.extent();
        let [x, y, z] = extent.size().map(|cells| cells as usize + 2);
        let nothing = Self {
            extent,
            strides: [1, x, x * y],
            kinds: Arc::default(),
            seen: Vec::new(),
            votes: Vec::new(),
            culling: CullingState::new(Frontier::new([x, y, z])),
        };
        let mut kinds = vec![OUTSIDE; x * y * z];
        for (number, row) in terrain.as_slice().chunks_exact(x - 2).enumerate() {
            let (at_y, at_z) = (number % (y - 2), number / (y - 2));
            let first = (at_z + 1) * x * y + (at_y + 1) * x + 1;
            for (kind, terrain) in kinds[first..].iter_mut().zip(row) {
                *kind = kind_of(*terrain);
            }
        }
        let seen = vec![0; kinds.len()];
        Self { kinds: Arc::new(kinds), seen, ..nothing }
    }

    /// An empty memory for another LiDAR in the same terrain.
    #[must_use]
    pub fn unused(&self) -> Self {
        let (extent, strides, kinds) = (self.extent, self.strides, Arc::clone(&self.kinds));
        let (seen, culling) = (vec![0; self.seen.len()], self.culling.unused());
        Self { extent, strides, kinds, seen, votes: Vec::new(), culling }
    }

    /// Takes back the last scans of this memory, which were cast ahead: the latest first.
    pub fn take_back(&mut self, scans: impl Iterator<Item = ScanAhead>) {
        for ScanAhead { free, wall, undo, .. } in scans {
            // Marks of the outside may stay: no cell is there.
            free.iter().chain(&wall).for_each(|&slot| self.seen[slot as usize] = 0);
            for &slot in &free {
                self.culling.forget_free(slot as usize);
            }
            for &slot in free.iter().chain(&wall) {
                self.note_free_beside(slot as usize);
            }
            self.culling.restore(undo);
        }
    }

    /// Adds the seen free neighbours of a cell that has been forgotten to the frontier.
    fn note_free_beside(&mut self, slot: usize) {
        for neighbour in self.strides.into_iter().flat_map(|stride| [slot - stride, slot + stride]) {
            if self.seen[neighbour] == FREE {
                self.culling.note_free(neighbour);
            }
        }
    }

    /// The slot of a cell of the map in `kinds` and `seen`.
    fn slot_of(&self, cell: voxels::Cell) -> usize {
        let [x, y, z] = self.strides;
        (cell.x + 1) as usize * x + (cell.y + 1) as usize * y + (cell.z + 1) as usize * z
    }

    /// The cell index of a slot that holds a cell of the map.
    fn index_of(&self, slot: u32) -> u32 {
        let [_, row, layer] = self.strides.map(|stride| stride as u32);
        let [size_x, size_y, _] = self.extent.size();
        let (z, in_layer) = (slot / layer - 1, slot % layer);
        (z * size_y + in_layer / row - 1) * size_x + in_layer % row - 1
    }
}

/// The mark of a cell.
fn kind_of(terrain: Terrain) -> u8 {
    match terrain {
        Terrain::Free => FREE,
        Terrain::Wall => WALL,
    }
}

/// A scan that was cast ahead.
#[derive(Debug)]
pub struct ScanAhead {
    pose: Pose,
    /// Slots of the new cells.
    free: Vec<u32>,
    wall: Vec<u32>,
    undo: Option<UndoEntry>,
}

impl ScanAhead {
    /// The pose it is cast from.
    pub(super) fn pose(&self) -> &Pose {
        &self.pose
    }

    /// Appends what [`Scanner::scan`] would: the scan is due, and will not be taken back.
    pub fn report(&self, memory: &SensorMemory, new_free: &mut Vec<u32>, new_wall: &mut Vec<u32>) {
        new_free.extend(self.free.iter().map(|&slot| memory.index_of(slot)));
        new_wall.extend(self.wall.iter().map(|&slot| memory.index_of(slot)));
    }
}

/// Everything that one scan sees.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ScanView {
    /// Indices of the free cells, the body's own included, ascending.
    pub free: Vec<u32>,
    /// Indices of the walls that ended a ray, ascending.
    pub wall: Vec<u32>,
    /// The points where rays hit walls, metres, frame `map`, in the fixed order of the scanner's
    /// rays.
    pub hits: Vec<Point3<f64>>,
}

#[cfg(test)]
mod tests;
