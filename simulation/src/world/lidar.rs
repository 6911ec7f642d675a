//! The simulated LiDAR: rays from a body through the true terrain, and a memory of the cells they
//! have hit before.
//!
//! A scan visits exactly the cells that [`voxels::walk`] visits along each of its rays up to the
//! first wall, the wall included, with the same arithmetic and the same tie rule; a test compares
//! the two. Rays are fixed in the frame `map` and do not turn with the body
//! (docs/reference-model.md, "LiDAR"); the heading only selects which of them are used if the field
//! of view is limited. Scans are exact, except for those of `noisy`. Bodies do not occlude what is
//! behind them.
//!
//! Layers, each of which knows only those above it:
//!
//! - this file, `pattern`, `slots`, `marks` and `memory`: what a scan is, its rays, and what a
//!   sensor has seen;
//! - `engine`: the trait of all that casts scans, and [`NotCast`], the reasons why a scan or a ray
//!   is not cast;
//! - `cast`: how one ray, or a bundle of them, is followed;
//! - `naive`: the engine that casts every ray, the oracle of the others;
//! - `culling`: the engine that leaves out the rays that can find nothing new;
//! - `noisy`: the engine of scans with noise;
//! - `speculation`: the engine that casts scans ahead, and takes them back if others become due.
//!
//! Invariants: a scan changes only the seen marks of its memory, and these are the same on every
//! processor and with each engine; if a scan that was cast ahead is taken back, the memory is as if
//! it had never been cast. When scans are due is decided in [`super::World::sense`].

mod cast;
mod culling;
mod engine;
mod marks;
mod memory;
mod naive;
mod noisy;
mod pattern;
mod revision;
mod slots;
mod speculation;

use std::f64::consts::TAU;
use std::fmt;
use std::sync::{Arc, Mutex, PoisonError, Weak};

use nalgebra::Vector3;
use voxels::Extent;

use super::body::Pose;
use cast::Start;
use culling::{Culling, CullingEngine};
pub use engine::{CastCount, NotCast};
pub(super) use engine::{Engine, NewCells};
pub use memory::SensorMemory;
pub use naive::ScanView;
pub(super) use noisy::NoisyScan;
use pattern::Bundle;
pub(super) use revision::change_kinds;
pub(super) use speculation::SpeculativeEngine;

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

    /// Casts a scan from `pose` and marks the cells it hits as seen. Returns the count of its rays.
    ///
    /// Appends the indices of the cells that this memory has not seen before: crossed free cells
    /// (and the body's own) to `new_free`, walls that ended a ray to `new_wall`. **They come in no
    /// particular order, and that order differs between processors: sort before anything depends on
    /// it.** A position outside the map sees nothing.
    pub fn scan(
        &self,
        memory: &mut SensorMemory,
        pose: &Pose,
        new_free: &mut Vec<u32>,
        new_wall: &mut Vec<u32>,
    ) -> CastCount {
        CullingEngine.cast(self, memory, pose, NewCells { free: new_free, wall: new_wall })
    }

    fn bundles(&self) -> &[Bundle] {
        &self.rays.bundles
    }

    /// The range of rays whose direction has length 1, in cells; infinite if they have other
    /// lengths.
    fn unit_range_cells(&self, extent: Extent) -> f64 {
        match self.rays.pattern {
            Pattern::Lattice { .. } => self.range_m / extent.cell_m(),
            Pattern::Shell { .. } => f64::INFINITY,
        }
    }

    /// The start of the rays of a scan; `None`: outside the map.
    fn start(&self, memory: &SensorMemory, pose: &Pose) -> Option<Start> {
        let extent = memory.extent();
        let cell = extent.cell_of(&pose.position);
        if !extent.contains(cell) {
            return None;
        }
        let position = extent.in_cells(&pose.position);
        let limit = match self.rays.pattern {
            Pattern::Lattice { .. } => self.range_m / extent.cell_m(),
            Pattern::Shell { .. } => 1.0,
        };
        let cone = self
            .cone_cos
            .map(|cone_cos| (Vector3::new(libm::cos(pose.yaw_rad), libm::sin(pose.yaw_rad), 0.0), cone_cos));
        Some(Start::new(*memory.marks().slots(), cell, position, limit, cone))
    }
}

#[cfg(test)]
mod tests;
