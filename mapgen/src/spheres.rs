//! Random Connected Spheres: hollow spheres at random places, each joined to its nearest neighbours
//! by tunnels (docs/reference-model.md, "Map generators: Random Connected Spheres").
//!
//! Invariants: two solid layers on every side; the loop always ends, because every sphere turns at
//! least its centre from wall to free and a request that runs out of solid centres is an error.
//! Tunnels are not counted in the fill ratio, so a map has a little more free space than was asked
//! for; smoothing and pocket removal take some of it back.

mod centres;
mod links;
mod unity;

use serde::{Deserialize, Serialize};
use voxels::{Cell, Extent, Grid, Terrain, close_shell};

use self::centres::Centres;
use super::smoothing::{self, PASSES_MAX};
use super::{Carved, Draft, MapError, by, check_sides, in_range};

/// Solid layers on every side, as in MAES3D (docs/reference-model.md, "Map generators: Random
/// Connected Spheres"); they survive smoothing.
const SHELL_LAYERS: u32 = 2;

/// The largest number of tunnels that a spec may ask for per sphere: beyond it tunnels fill a map
/// rather than join it.
const CONNECTIONS_MAX: u32 = 64;

/// Parameters of Random Connected Spheres; the defaults are those of the user interface of MAES3D.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SpheresSpec {
    /// Spheres are added until they have freed this share of the map's volume, above 0 and at most
    /// the share of the cells that a sphere can reach. Default 0.20 (MAES3D's slider: 0.01 to
    /// 0.30).
    pub fill_ratio: f64,
    /// Smallest radius of a sphere and radius of every tunnel, in cells, from 0 (a single cell).
    /// Default 3 (MAES3D's slider: 2 to 15).
    pub radius_min: u32,
    /// Largest radius of a sphere, in cells, at most (shortest side - 4) / 2. Default 8 (MAES3D's
    /// slider: 2 to 15).
    pub radius_max: u32,
    /// To how many nearest spheres each sphere is joined, 0 to 64. Default 3 (MAES3D's slider: 1 to
    /// 10).
    pub connections: u32,
    /// How many times the map is smoothed, 0 to 1000. Default 5 (MAES3D's slider: 0 to 20).
    pub smoothing: u32,
    /// The random numbers that the spheres are drawn with.
    #[serde(skip_serializing_if = "SphereRandom::is_default")]
    pub random: SphereRandom,
}

/// A source of random numbers for spheres. With those of MAES3D's engine, a seed makes the map that
/// it makes there.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SphereRandom {
    /// The stream of the seed for this generator ([`voxels::random_streams`]).
    #[default]
    Chacha,
    /// The generator of Unity, as for a seed that the user of MAES3D has typed in.
    Unity,
    /// The same after one draw: MAES3D, asked for a random seed, draws the number by which it names
    /// the map before it makes it.
    UnityNamed,
}

impl SphereRandom {
    fn is_default(&self) -> bool {
        *self == Self::default()
    }
}

impl Default for SpheresSpec {
    fn default() -> Self {
        let random = SphereRandom::default();
        Self { fill_ratio: 0.20, radius_min: 3, radius_max: 8, connections: 3, smoothing: 5, random }
    }
}

impl SpheresSpec {
    pub(super) fn check(&self, extent: Extent) -> Result<(), MapError> {
        check_sides(extent)?;
        let radius_limit = (extent.size().into_iter().fold(u32::MAX, u32::min) - 4) / 2;
        in_range("radius_min", self.radius_min, 0..=radius_limit)?;
        in_range("radius_max", self.radius_max, self.radius_min..=radius_limit)?;
        in_range("connections", self.connections, 0..=CONNECTIONS_MAX)?;
        in_range("smoothing", self.smoothing, 0..=PASSES_MAX)?;
        // Spheres reach the cells 1 to size - 3 of every axis.
        let reachable: f64 = extent.size().into_iter().map(|cells| f64::from(cells - 3) / f64::from(cells)).product();
        if !(self.fill_ratio > 0.0 && self.fill_ratio <= reachable) {
            return Err(MapError::OutOfRange {
                key: "fill_ratio",
                value: self.fill_ratio.to_string(),
                allowed: format!("more than 0 and at most {reachable:.4} on a map of {} cells", by(extent.size())),
            });
        }
        Ok(())
    }
}

/// A hollow sphere; all its cells lie in the map.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Sphere {
    centre: Cell,
    radius: u32,
}

/// Carves spheres and tunnels, closes the shell and smooths.
pub(super) fn draft(spec: &SpheresSpec, extent: Extent, seed: u64) -> Result<Draft, MapError> {
    spec.check(extent)?;
    let mut terrain = Grid::new(extent, Terrain::Wall);
    let spheres = carve_spheres(&mut terrain, spec, seed)?;

    let centres: Vec<Cell> = spheres.iter().map(|sphere| sphere.centre).collect();
    let links = links::nearest(extent, &centres, spec.connections as usize);
    let ball = Ball::new(spec.radius_min * spec.radius_min);
    for &(from, to) in &links {
        carve_tunnel(&mut terrain, &ball, centres[from], centres[to]);
    }

    let shell_cells_closed = close_shell(&mut terrain, SHELL_LAYERS);
    smoothing::smooth(&mut terrain, spec.smoothing);
    let carved = Carved { spheres: spheres.len() as u64, tunnels: links.len() as u64 };
    Ok(Draft { terrain, carved: Some(carved), shell_cells_closed })
}

/// Adds spheres, each centred in a cell that is still wall, until they have freed the share that
/// was asked for.
fn carve_spheres(terrain: &mut Grid<Terrain>, spec: &SpheresSpec, seed: u64) -> Result<Vec<Sphere>, MapError> {
    let extent = terrain.extent();
    let mut centres = Centres::new(extent, spec, seed)?;
    let mut spheres = Vec::new();
    let mut freed = 0;
    loop {
        let reached = freed as f64 / extent.volume() as f64;
        if reached >= spec.fill_ratio {
            return Ok(spheres);
        }
        let Some(sphere) = centres.draw(terrain) else {
            return Err(MapError::FillUnreachable {
                size: extent.size(),
                asked: spec.fill_ratio,
                reached,
                spheres: spheres.len(),
                radius_min: spec.radius_min,
                radius_max: spec.radius_max,
            });
        };
        freed += Ball::new(sphere.radius * sphere.radius + sphere.radius).carve(terrain, sphere.centre);
        spheres.push(sphere);
    }
}

/// Frees a tunnel: a ball at every unit step from the centre of one cell to that of another.
fn carve_tunnel(terrain: &mut Grid<Terrain>, ball: &Ball, from: Cell, to: Cell) {
    let way = to - from;
    let length = f64::from(way.x * way.x + way.y * way.y + way.z * way.z).sqrt();
    for step in 0..=length as u32 {
        let share = f64::from(step) / length;
        // Both ends are cell centres, so the nearest cell is the one that the point lies in.
        let along = |cells: i32| (f64::from(cells) * share + 0.5).floor() as i32;
        ball.carve(terrain, from + Cell::new(along(way.x), along(way.y), along(way.z)));
    }
}

/// The cells around a centre up to a squared distance, as rows along x.
struct Ball {
    rows: Vec<Row>,
}

/// The cells (-half..=half, y, z) relative to the centre of a ball.
struct Row {
    y: i32,
    z: i32,
    half: i32,
}

impl Ball {
    /// All cells whose squared distance from the centre is at most `square_max`.
    fn new(square_max: u32) -> Self {
        let reach = square_max.isqrt() as i32;
        let mut rows = Vec::new();
        for z in -reach..=reach {
            for y in -reach..=reach {
                if let Some(left) = square_max.checked_sub((y * y + z * z) as u32) {
                    rows.push(Row { y, z, half: left.isqrt() as i32 });
                }
            }
        }
        Self { rows }
    }

    /// Frees the ball around `centre` and returns how many of its cells were wall.
    fn carve(&self, terrain: &mut Grid<Terrain>, centre: Cell) -> u64 {
        let extent = terrain.extent();
        let mut freed = 0;
        for row in &self.rows {
            let first = centre + Cell::new(-row.half, row.y, row.z);
            let first = extent.index(first).expect("centres are drawn so that their balls lie in the map");
            let cells = &mut terrain.as_mut_slice()[first..=first + 2 * row.half as usize];
            freed += cells.iter().filter(|&&cell| cell == Terrain::Wall).count() as u64;
            cells.fill(Terrain::Free);
        }
        freed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn solid(size: [u32; 3]) -> Grid<Terrain> {
        Grid::new(Extent::new(size, 1.0).unwrap(), Terrain::Wall)
    }

    fn free_cells(terrain: &Grid<Terrain>) -> Vec<Cell> {
        terrain.iter().filter(|&(_, &t)| t == Terrain::Free).map(|(cell, _)| cell).collect()
    }

    #[test]
    fn spheres_have_as_many_cells_as_in_maes3d() {
        let cells = |radius: u32| Ball::new(radius * radius + radius).carve(&mut solid([30; 3]), Cell::new(15, 15, 15));
        assert_eq!([2, 3, 4, 5, 6, 7, 8].map(cells), [81, 179, 389, 739, 1189, 1791, 2553]);
        assert_eq!(cells(0), 1);
    }

    #[test]
    fn only_newly_freed_cells_are_counted() {
        let mut terrain = solid([9; 3]);
        let ball = Ball::new(2);
        assert_eq!(ball.carve(&mut terrain, Cell::new(4, 4, 4)), 19);
        assert_eq!(ball.carve(&mut terrain, Cell::new(4, 4, 4)), 0);
        // One step along x frees one cell of each of the nine rows.
        assert_eq!(ball.carve(&mut terrain, Cell::new(5, 4, 4)), 9);
    }

    #[test]
    fn a_thin_tunnel_visits_the_cells_nearest_to_its_unit_steps() {
        let mut terrain = solid([9, 9, 5]);
        carve_tunnel(&mut terrain, &Ball::new(0), Cell::new(2, 6, 2), Cell::new(6, 4, 2));
        // |AB| = 4.47: unit steps 0 to 4.
        let expected = [(6, 4), (4, 5), (5, 5), (2, 6), (3, 6)].map(|(x, y)| Cell::new(x, y, 2));
        assert_eq!(free_cells(&terrain), expected);
    }

    #[test]
    fn every_cell_of_every_legal_sphere_lies_in_the_map() {
        for size in 5..=12 {
            let radius = (size - 4) / 2;
            let spec = SpheresSpec { radius_min: 0, radius_max: radius, ..SpheresSpec::default() };
            let extent = Extent::new([size, 12, 12], 1.0).unwrap();
            assert_eq!(spec.check(extent), Ok(()));
            assert!(SpheresSpec { radius_max: radius + 1, ..spec }.check(extent).is_err());
            for seed in 0..20 {
                let draft = draft(&spec, extent, seed).unwrap();
                assert!(draft.carved.unwrap().spheres > 0);
            }
        }
    }
}
