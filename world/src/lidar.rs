//! The simulated LiDAR: rays from a body through the true terrain, and a memory of the cells they
//! have hit before.
//!
//! A scan visits exactly the cells that [`voxels::walk`] visits along each of its rays up to the
//! first wall, the wall included, with the same arithmetic and the same tie rule; a test compares
//! the two. Rays are fixed in the frame `map` and do not turn with the body
//! (docs/reference-model.md, "LiDAR"), except those of a `grid` that has a front; with a cone the
//! heading selects which of them are used. Scans are exact, except for those of `noisy`. Bodies do
//! not occlude what is behind them, unless the LiDAR sees agents: see `bodies`.
//!
//! Layers, each of which knows only those above it:
//!
//! - this file, `pattern`, `grid`, `slots`, `marks` and `memory`: what a scan is, its rays, and
//!   what a sensor has seen;
//! - `engine`: the trait of all that casts scans, and [`NotCast`], the reasons why a scan or a ray
//!   is not cast;
//! - `cast`: how one ray, or a bundle of them, is followed;
//! - `naive`: the engine that casts every ray, the oracle of the others;
//! - `returns`: what each ray measures, for messages;
//! - `suite`: the LiDARs of a body;
//! - `culling`: the engine that leaves out the rays that can find nothing new;
//! - `noisy`: the engine of scans with noise;
//! - `speculation`: the engine that casts scans ahead, and takes them back if others become due.
//!
//! Invariants: a scan changes only the seen marks of its memory, and these are the same on every
//! processor and with each engine; if a scan that was cast ahead is taken back, the memory is as if
//! it had never been cast. When scans are due is decided in [`super::World::sense`].

mod bodies;
mod cast;
mod culling;
mod engine;
mod grid;
mod marks;
mod memory;
mod naive;
mod noisy;
mod pattern;
mod returns;
mod revision;
mod slots;
mod speculation;
mod suite;

use std::borrow::Cow;
use std::f64::consts::TAU;
use std::fmt;
use std::sync::{Arc, Mutex, PoisonError, Weak};

use nalgebra::{Point3, Vector3};
use protocol::field_of_view::FieldOfView;
use voxels::Extent;

use super::body::Pose;
pub(super) use bodies::Bodies;
use cast::Start;
use culling::{Culling, CullingEngine};
pub use engine::{CastCount, NotCast};
pub(super) use engine::{Engine, NewCells};
use grid::TurningRays;
pub use grid::{Elevations, Projection, RayGrid};
pub use memory::SensorMemory;
pub(super) use naive::NaiveEngine;
pub use naive::ScanView;
pub(super) use noisy::NoisyScan;
use pattern::Bundle;
pub use returns::{Measured, MiddleLine, RayReturn};
pub(super) use revision::{ForgottenCells, change_kinds};
pub(super) use speculation::SpeculativeEngine;
pub use suite::{NamedScanner, SensorSuite};

/// The directions of the rays of a scan.
#[derive(Debug, Clone, PartialEq)]
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
    /// Rows and columns of rays, as those of a spinning LiDAR or a depth camera.
    Grid(RayGrid),
}

/// Where a sensor is on its body, and what is too near for it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Mount {
    /// Height above the centre of the body, metres, less than the radius of the body; negative:
    /// below.
    pub height_m: f64,
    /// A ray that meets a wall up to this distance has no return, metres.
    pub min_range_m: f64,
}

/// Where the frame of a sensor is on its body, and what looks along it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PlaceOnBody {
    /// Height above the centre of the body, metres.
    pub height_m: f64,
    /// By how much it looks up, radians.
    pub pitch_rad: f64,
    /// Whether it is a camera, which has an optical frame.
    pub is_camera: bool,
}

/// A LiDAR: its rays, range and field of view.
#[derive(Clone)]
pub struct Scanner {
    rays: Arc<Rays>,
    range_m: f64,
    /// Cosine of half the field of view, or `None` if that is all directions.
    cone_cos: Option<f64>,
    mount: Mount,
    sees_agents: bool,
    meets_obstacles: bool,
}

impl PartialEq for Scanner {
    fn eq(&self, other: &Self) -> bool {
        let Self { rays, range_m, cone_cos, mount, sees_agents, meets_obstacles } = self;
        // Those of a pattern are shared.
        Arc::ptr_eq(rays, &other.rays)
            && (range_m, cone_cos, mount) == (&other.range_m, &other.cone_cos, &other.mount)
            && (sees_agents, meets_obstacles) == (&other.sees_agents, &other.meets_obstacles)
    }
}

/// The rays of a pattern.
struct Rays {
    pattern: Pattern,
    count: u32,
    /// Those that do not turn with the body.
    bundles: Vec<Bundle>,
    /// Those that do.
    turning: Option<TurningRays>,
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
            let rays = Arc::new(match &pattern {
                Pattern::Grid(grid) if grid.turns() => {
                    let turning = Some(TurningRays::new(directions));
                    Self { pattern, count, bundles: Vec::new(), turning, culling: None }
                }
                _ => {
                    let bundles = Bundle::pack(directions);
                    let culling = Culling::of_many(&pattern, count, &bundles);
                    Self { pattern, count, bundles, turning: None, culling }
                }
            });
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
            .field("mount", &self.mount)
            .field("sees_agents", &self.sees_agents)
            .finish_non_exhaustive()
    }
}

impl Scanner {
    /// A LiDAR with this pattern of rays.
    ///
    /// A lattice or a grid sees cells that a ray enters within `range_m` metres, which may be
    /// infinite; a shell sees as far as its radius and ignores `range_m`. `fov_rad` is the full
    /// opening angle of a cone about the heading, in radians; from 2 pi on all rays are used.
    pub fn new(pattern: Pattern, range_m: f64, fov_rad: f64) -> Self {
        let cone_cos = (fov_rad < TAU).then(|| libm::cos(fov_rad / 2.0));
        Self {
            rays: Rays::of(pattern),
            range_m,
            cone_cos,
            mount: Mount::default(),
            sees_agents: false,
            meets_obstacles: false,
        }
    }

    /// The same LiDAR at another place on its body.
    #[must_use]
    pub fn on(self, mount: Mount) -> Self {
        Self { mount, ..self }
    }

    /// The same LiDAR, with rays that end at the bodies of others, or pass them.
    #[must_use]
    pub fn seeing_agents(self, sees_agents: bool) -> Self {
        Self { sees_agents, ..self }
    }

    /// Whether its rays end at the bodies of others.
    pub fn sees_agents(&self) -> bool {
        self.sees_agents
    }

    /// This LiDAR in a world with moving obstacles, or without.
    #[must_use]
    pub fn meeting_obstacles(self, meets_obstacles: bool) -> Self {
        Self { meets_obstacles, ..self }
    }

    /// Whether its rays end at something that moves.
    pub fn meets_bodies(&self) -> bool {
        self.sees_agents || self.meets_obstacles
    }

    /// What it sees of its surroundings; `None` for a lattice and a shell.
    pub fn field_of_view(&self) -> Option<FieldOfView> {
        match &self.rays.pattern {
            Pattern::Grid(grid) => Some(grid.field_of_view(self.mount.min_range_m)),
            Pattern::Lattice { .. } | Pattern::Shell { .. } => None,
        }
    }

    /// A LiDAR that sees from one place what this one sees there with all headings, if it is a
    /// grid; else this one.
    #[must_use]
    pub fn swept(&self) -> Self {
        match &self.rays.pattern {
            Pattern::Grid(grid) if grid.turns() => Self { rays: Rays::of(Pattern::Grid(grid.swept())), ..self.clone() },
            _ => self.clone(),
        }
    }

    /// Where it is on its body.
    pub fn place_on_body(&self) -> PlaceOnBody {
        let grid = self.grid();
        PlaceOnBody {
            height_m: self.mount.height_m,
            pitch_rad: grid.map_or(0.0, |grid| grid.pitch_rad),
            is_camera: grid.is_some_and(RayGrid::is_camera),
        }
    }

    /// Its least and its greatest range, metres; the latter may be infinite.
    pub fn range_m(&self) -> [f64; 2] {
        [self.mount.min_range_m, self.range_m]
    }

    /// Where its rays begin, metres, frame `map`.
    pub fn origin(&self, pose: &Pose) -> Point3<f64> {
        pose.position + Vector3::new(0.0, 0.0, self.mount.height_m)
    }

    /// Number of rays of a scan with an unlimited field of view.
    pub fn rays(&self) -> u32 {
        self.rays.count
    }

    /// The greatest length of a ray, metres, with cells of this length.
    pub fn greatest_range_m(&self, cell_m: f64) -> f64 {
        match self.rays.pattern {
            Pattern::Lattice { .. } | Pattern::Grid(_) => self.range_m,
            Pattern::Shell { radius_cells } => f64::from(radius_cells) * cell_m,
        }
    }

    /// Whether its scans do not depend on the heading.
    pub fn sees_all_around(&self) -> bool {
        self.cone_cos.is_none() && self.rays.turning.is_none()
    }

    /// Whether scans from two poses see the same. The heading matters only with a limited field of
    /// view.
    pub fn sees_the_same(&self, a: &Pose, b: &Pose) -> bool {
        a.position == b.position && (self.sees_all_around() || a.yaw_rad == b.yaw_rad)
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

    /// The rays of a scan at a heading.
    fn bundles(&self, yaw_rad: f64) -> Cow<'_, [Bundle]> {
        match &self.rays.turning {
            Some(turning) => Cow::Owned(turning.at(yaw_rad)),
            None => Cow::Borrowed(&self.rays.bundles),
        }
    }

    /// The range of rays whose direction has length 1, in cells; infinite if they have other
    /// lengths.
    fn unit_range_cells(&self, extent: Extent) -> f64 {
        match self.rays.pattern {
            Pattern::Lattice { .. } | Pattern::Grid(_) => self.range_m / extent.cell_m(),
            Pattern::Shell { .. } => f64::INFINITY,
        }
    }

    /// The start of the rays of a scan; `None`: outside the map.
    fn start(&self, memory: &SensorMemory, pose: &Pose) -> Option<Start> {
        let extent = memory.extent();
        let (origin, own) = (self.origin(pose), extent.cell_of(&pose.position));
        let cell = extent.cell_of(&origin);
        if !extent.contains(cell) || !extent.contains(own) {
            return None;
        }
        let limits = match self.rays.pattern {
            Pattern::Lattice { .. } | Pattern::Grid(_) => [self.mount.min_range_m, self.range_m],
            Pattern::Shell { .. } => [0.0, extent.cell_m()],
        };
        let cone = self
            .cone_cos
            .map(|cone_cos| (Vector3::new(libm::cos(pose.yaw_rad), libm::sin(pose.yaw_rad), 0.0), cone_cos));
        let slots = *memory.marks().slots();
        let limits = limits.map(|limit_m| limit_m / extent.cell_m());
        Some(Start::new(slots, [own, cell], extent.in_cells(&origin), limits, cone))
    }
}

#[cfg(test)]
mod tests;
