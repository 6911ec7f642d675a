//! Map generation: a spec, an extent and a seed become the true terrain.
//!
//! Invariants of every generated map: at least one layer of wall on every side, at least one free
//! cell, and all free cells connected through faces. The terrain depends on spec, extent and seed
//! alone. Generation always terminates: a request that cannot be met is an error.
//!
//! Maps from elsewhere, read by the crate `map_files`, get the same form by [`repair`]; the options
//! of their import are [`ImportOptions`], as part of a scenario. There are no files, no clock and
//! no source of seeds here.

#![warn(missing_docs)]

pub mod building;
pub mod import_options;
pub mod mine;
pub mod noise;
pub mod scene;
mod smoothing;
pub mod spheres;

use std::fmt::Display;
use std::ops::RangeInclusive;

use serde::{Deserialize, Serialize};
use thiserror::Error;
use voxels::{Extent, Grid, Pockets, STRETCH_BYTES, Terrain, close_shell, free_stretches, keep_largest_component};

pub use building::{BuildingSpec, Built, Entrance};
pub use import_options::{Fill, ImportOptions, Kind};
pub use mine::MineSpec;
pub use noise::NoiseSpec;
pub use scene::{SceneName, SceneSpec};
pub use spheres::{SphereRandom, SpheresSpec};

/// The shortest side of a generated map, in cells: one cell between two solid layers on either
/// side.
pub const SIDE_MIN: u32 = 5;

/// The kind and parameters of a generated map.
#[derive(Debug, Clone, PartialEq)]
pub enum MapSpec {
    /// Random Connected Spheres.
    Spheres(SpheresSpec),
    /// Smoothed Noise.
    Noise(NoiseSpec),
    /// Floors of hallways and rooms.
    Building(BuildingSpec),
    /// Levels of drifts with crosscuts, stopes and a ramp.
    Mine(MineSpec),
    /// A place of the literature at true scale.
    Scene(SceneSpec),
}

impl MapSpec {
    /// Checks the parameters for a map of this extent.
    ///
    /// # Errors
    /// For the first parameter or side that is not usable; the error names it, its value and what
    /// is allowed.
    pub fn check(&self, extent: Extent) -> Result<(), MapError> {
        match self {
            Self::Spheres(spec) => spec.check(extent),
            Self::Noise(spec) => spec.check(extent),
            Self::Building(spec) => spec.check(extent),
            Self::Mine(spec) => spec.check(extent),
            Self::Scene(spec) => spec.check(extent),
        }
    }
}

/// A terrain with its report.
#[derive(Debug, Clone, PartialEq)]
pub struct GeneratedMap {
    /// The true map.
    pub terrain: Grid<Terrain>,
    /// The entrances of a building; empty for other maps.
    pub entrances: Vec<Entrance>,
    /// The report of its generation or import.
    pub report: MapReport,
}

/// The report of the generation and repair of a map.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MapReport {
    /// The seed that reproduces this map from the same spec and extent; an import does not depend
    /// on it.
    pub seed: u64,
    /// Free cells of the finished map.
    pub free_cells: u64,
    /// Free cells divided by all cells of the map.
    pub free_fraction: f64,
    /// Spheres and tunnels, for [`MapSpec::Spheres`].
    pub carved: Option<Carved>,
    /// Floors, rooms and so on, for [`MapSpec::Building`].
    pub built: Option<Built>,
    /// Free cells that became wall because they lay in a layer that must be solid.
    pub shell_cells_closed: u64,
    /// Caves that were filled because they were not connected to the largest one.
    pub pockets_removed: u64,
    /// Cells of these caves.
    pub pocket_cells_removed: u64,
    /// Why an imported map is probably not what its user wants; not part of a recording.
    #[serde(skip)]
    pub warnings: Vec<String>,
}

/// What Random Connected Spheres carved.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Carved {
    /// Number of spheres.
    pub spheres: u64,
    /// Number of tunnels between them.
    pub tunnels: u64,
}

/// The reason why there is no map.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum MapError {
    /// A parameter is outside the range in which a map of this extent can be made.
    #[error("{key} is {value}, allowed is {allowed}")]
    OutOfRange {
        /// The parameter, as in the text form of a spec.
        key: &'static str,
        /// The refused value.
        value: String,
        /// The allowed range, both ends included unless it says otherwise.
        allowed: String,
    },
    /// A side of the map is too short for the generators.
    #[error("map size along {axis} is {cells} cells, generators need at least {SIDE_MIN}")]
    SideTooShort {
        /// `x`, `y` or `z`.
        axis: char,
        /// Cells along it.
        cells: u32,
    },
    /// Every place where a sphere could be centred is free, and the fill ratio is not reached.
    #[error(
        "fill_ratio {asked} is out of reach on a map of {} cells with radii from {radius_min} to {radius_max}: \
         {spheres} sphere(s) freed {reached:.4} of the volume, and no wall cell is left in which another one could be \
         centred",
        by(*size)
    )]
    FillUnreachable {
        /// Cells along x, y and z.
        size: [u32; 3],
        /// The fill ratio of the spec.
        asked: f64,
        /// The share of the volume that the spheres freed.
        reached: f64,
        /// Number of spheres.
        spheres: usize,
        /// Smallest radius of the spec, in cells.
        radius_min: u32,
        /// Largest radius of the spec, in cells.
        radius_max: u32,
    },
    /// A seed that the random numbers of Unity cannot begin with.
    #[error("seed is {seed}, allowed is 0 to {} where `random` is that of Unity", u32::MAX)]
    SeedTooLong {
        /// The seed.
        seed: u64,
    },
    /// A scene does not fit into the map.
    #[error(
        "{} cells of {cell_m} m are too few for this scene, it needs at least {}; choose a larger map, or longer cells",
        by(*size), by(*needed)
    )]
    SceneTooSmall {
        /// Cells along x, y and z.
        size: [u32; 3],
        /// Edge of a cell, metres.
        cell_m: f64,
        /// The cells that it needs along each axis.
        needed: [u32; 3],
    },
    /// The system has not enough memory for a map of this size.
    #[error("a map of {} cells and what is known of it take {mib} MiB of memory, which cannot be had; choose a smaller one", by(*size))]
    Memory {
        /// Cells along x, y and z.
        size: [u32; 3],
        /// The memory that would be needed, MiB.
        mib: usize,
    },
    /// Noise or smoothing has left nothing free.
    #[error("the map has no free cell left after smoothing; change its fill, radii or smoothing")]
    Empty,
    /// A map from elsewhere is solid.
    #[error(
        "{file}: the map has no free cell inside its outermost layer; a closed mesh is hollow with --inside free \
         (map.import.inside), and smaller cells (--cell-m) keep narrow spaces"
    )]
    ImportEmpty {
        /// The name of the map, such as its file.
        file: String,
    },
}

/// Generates the map of `spec` and `seed`.
///
/// ```
/// use mapgen::{MapSpec, NoiseSpec, generate};
/// use voxels::Extent;
///
/// let spec = MapSpec::Noise(NoiseSpec::default());
/// let extent = Extent::new([30, 30, 20], 1.0)?;
/// let map = generate(&spec, extent, 42)?;
/// assert_eq!(map.report.seed, 42);
/// assert_eq!(map, generate(&spec, extent, 42)?);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// The errors of [`MapSpec::check`]; [`MapError::Memory`]; [`MapError::FillUnreachable`];
/// [`MapError::SeedTooLong`]; [`MapError::Empty`] if nothing free is left.
pub fn generate(spec: &MapSpec, extent: Extent, seed: u64) -> Result<GeneratedMap, MapError> {
    check_memory(extent, GENERATION_CELL_BYTES)?;
    let (draft, built, entrances) = match spec {
        MapSpec::Spheres(spec) => (spheres::draft(spec, extent, seed)?, None, Vec::new()),
        MapSpec::Noise(spec) => (noise::draft(spec, extent, seed)?, None, Vec::new()),
        MapSpec::Mine(spec) => (mine::draft(spec, extent, seed)?, None, Vec::new()),
        MapSpec::Scene(spec) => (scene::draft(spec, extent, seed)?, None, Vec::new()),
        MapSpec::Building(spec) => {
            let (draft, built, entrances) = building::draft(spec, extent, seed)?;
            (draft, Some(built), entrances)
        }
    };
    let Draft { mut terrain, carved, shell_cells_closed } = draft;
    let pockets = keep_largest(&mut terrain)?;
    if pockets.kept_cells == 0 {
        return Err(MapError::Empty);
    }
    Ok(GeneratedMap { entrances, ..described(terrain, seed, pockets, (carved, built), shell_cells_closed) })
}

/// Layers of wall that an imported map gets on every side.
const SHELL_LAYERS: u32 = 1;

/// Repairs a map from elsewhere: closes its shell and keeps its largest cave. `file` is the name
/// for the error, `seed` for the report.
///
/// MAES3D announces this repair and does not perform it (docs/reference-model.md, "Repairs of a
/// map").
///
/// # Errors
/// [`MapError::Memory`]; [`MapError::ImportEmpty`] if nothing free is left.
pub fn repair(file: &str, mut terrain: Grid<Terrain>, seed: u64) -> Result<GeneratedMap, MapError> {
    let shell_cells_closed = close_shell(&mut terrain, SHELL_LAYERS);
    let pockets = keep_largest(&mut terrain)?;
    if pockets.kept_cells == 0 {
        return Err(MapError::ImportEmpty { file: file.to_owned() });
    }
    Ok(described(terrain, seed, pockets, (None, None), shell_cells_closed))
}

/// A finished map with its report.
fn described(
    terrain: Grid<Terrain>,
    seed: u64,
    pockets: Pockets,
    (carved, built): (Option<Carved>, Option<Built>),
    shell_cells_closed: usize,
) -> GeneratedMap {
    let report = MapReport {
        seed,
        free_cells: pockets.kept_cells as u64,
        free_fraction: pockets.kept_cells as f64 / terrain.extent().volume() as f64,
        carved,
        built,
        shell_cells_closed: shell_cells_closed as u64,
        pockets_removed: pockets.filled_components as u64,
        pocket_cells_removed: pockets.filled_cells as u64,
        warnings: Vec::new(),
    };
    GeneratedMap { terrain, entrances: Vec::new(), report }
}

/// The entrances of the map that [`generate`] returns for the same arguments, without generating
/// it.
///
/// # Errors
/// The errors of [`MapSpec::check`]; [`MapError::OutOfRange`] if the building has fewer entrances
/// than it should.
pub fn entrances(spec: &MapSpec, extent: Extent, seed: u64) -> Result<Vec<Entrance>, MapError> {
    match spec {
        MapSpec::Building(spec) => building::entrances(spec, extent, seed),
        MapSpec::Spheres(_) | MapSpec::Noise(_) | MapSpec::Mine(_) | MapSpec::Scene(_) => Ok(Vec::new()),
    }
}

/// Bytes per cell that generation takes beside what its parts check themselves: the terrain.
const GENERATION_CELL_BYTES: usize = 1;

/// Checks that the system can allocate `cell_bytes` for each cell, in pieces of a byte for each, as
/// maps and memories of their cells are. The system may overcommit, but an allocation that it
/// refuses is a clear error here instead of an abort later.
///
/// # Errors
/// [`MapError::Memory`] if the allocation fails.
pub fn check_memory(extent: Extent, cell_bytes: usize) -> Result<(), MapError> {
    check_pieces(extent, cell_bytes, extent.volume())
}

/// Checks that the system can allocate pieces of memory, all at once.
fn check_pieces(extent: Extent, pieces: usize, bytes: usize) -> Result<(), MapError> {
    let error = |_| MapError::Memory { size: extent.size(), mib: bytes.saturating_mul(pieces) >> 20 };
    let mut reserved = vec![Vec::<u8>::new(); pieces];
    reserved.iter_mut().try_for_each(|piece| piece.try_reserve_exact(bytes)).map_err(error)
}

/// As [`keep_largest_component`], after a check of the memory that it takes.
///
/// # Errors
/// [`MapError::Memory`].
fn keep_largest(terrain: &mut Grid<Terrain>) -> Result<Pockets, MapError> {
    check_pieces(terrain.extent(), STRETCH_BYTES, free_stretches(terrain))?;
    Ok(keep_largest_component(terrain))
}

/// The number of free cells.
pub fn free_cells(terrain: &Grid<Terrain>) -> u64 {
    terrain.as_slice().iter().filter(|&&cell| cell == Terrain::Free).count() as u64
}

/// The BLAKE3 hash that identifies a terrain: of its size (three little-endian `u32`, x first),
/// then one byte per cell in index order, 0 free and 1 wall. The length of a cell's edge is not
/// part of it.
pub fn terrain_hash(terrain: &Grid<Terrain>) -> blake3::Hash {
    let mut hasher = blake3::Hasher::new();
    for cells in terrain.extent().size() {
        hasher.update(&cells.to_le_bytes());
    }
    let mut bytes = Vec::new();
    for cells in terrain.as_slice().chunks(1 << 16) {
        bytes.clear();
        bytes.extend(cells.iter().map(|&cell| cell as u8));
        hasher.update(&bytes);
    }
    hasher.finalize()
}

/// The output of a generator: a terrain that may still have pockets.
struct Draft {
    terrain: Grid<Terrain>,
    carved: Option<Carved>,
    shell_cells_closed: usize,
}

/// A size in the form `30x30x20`.
fn by([x, y, z]: [u32; 3]) -> String {
    format!("{x}x{y}x{z}")
}

fn check_sides(extent: Extent) -> Result<(), MapError> {
    match ['x', 'y', 'z'].into_iter().zip(extent.size()).find(|&(_, cells)| cells < SIDE_MIN) {
        Some((axis, cells)) => Err(MapError::SideTooShort { axis, cells }),
        None => Ok(()),
    }
}

fn in_range<T: Display + PartialOrd>(key: &'static str, value: T, range: RangeInclusive<T>) -> Result<(), MapError> {
    if range.contains(&value) {
        return Ok(());
    }
    let allowed = format!("{} to {}", range.start(), range.end());
    Err(MapError::OutOfRange { key, value: value.to_string(), allowed })
}

#[cfg(test)]
mod tests;
