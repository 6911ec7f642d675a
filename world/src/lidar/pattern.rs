//! The directions of rays, and their order: neighbouring rays are cast together, because they cross
//! the same cells.

use nalgebra::Vector3;
use voxels::{Cell, FACES, lattice};

use super::Pattern;

/// Rays that are cast side by side: two registers of the widest vectors, which hides the latency of
/// loads.
pub(super) const LANES: usize = 16;

/// The largest radius of a shell, in cells; it covers the largest map.
const RADIUS_CELLS_MAX: u32 = 1774;

/// A heading and the cosine of half the field of view.
pub(super) type Cone = (Vector3<f64>, f64);

impl Pattern {
    /// The directions of the rays in cell units; their length is the unit of distances along them.
    /// Those of a grid are at heading 0.
    pub(super) fn directions(&self) -> Vec<Vector3<f64>> {
        match self {
            &Pattern::Lattice { rays } => (0..rays).map(|ray| lattice::direction(ray, rays)).collect(),
            &Pattern::Shell { radius_cells } => shell(radius_cells),
            Pattern::Grid(grid) => grid.directions(),
        }
    }
}

fn shell(radius_cells: u32) -> Vec<Vector3<f64>> {
    let radius = radius_cells.min(RADIUS_CELLS_MAX) as i32;
    let inside = |cell: Cell| cell.x * cell.x + cell.y * cell.y + cell.z * cell.z <= radius * radius;
    let mut directions = Vec::new();
    for z in -radius..=radius {
        for y in -radius..=radius {
            for x in -radius..=radius {
                let offset = Cell::new(x, y, z);
                if inside(offset) && FACES.iter().any(|&face| !inside(offset + face)) {
                    directions.push(Vector3::new(f64::from(x), f64::from(y), f64::from(z)));
                }
            }
        }
    }
    directions
}

/// Up to [`LANES`] neighbouring rays of one octant; lanes without a ray are never active.
#[derive(Clone)]
pub(super) struct Bundle {
    /// 1 / |component| per axis and lane: the distance between two crossings of cell boundaries.
    pub(super) inverse: [[f64; LANES]; 3],
    /// Per axis, whether the rays go down it. A ray that does not move along an axis counts as
    /// going up.
    pub(super) goes_down: [bool; 3],
    directions: [Vector3<f64>; LANES],
    /// The directions with length 1.
    units: [Vector3<f64>; LANES],
    rays: usize,
}

impl Bundle {
    /// Groups rays into bundles.
    pub(super) fn pack(mut directions: Vec<Vector3<f64>>) -> Vec<Self> {
        directions.sort_by_key(|direction| (octant(direction), neighbourhood(direction)));
        let octants = directions.chunk_by(|a, b| octant(a) == octant(b));
        octants.flat_map(|rays| rays.chunks(LANES)).map(Self::of).collect()
    }

    /// A bundle of 1 to [`LANES`] rays of one octant.
    pub(super) fn of(rays: &[Vector3<f64>]) -> Self {
        let mut directions = [rays[0]; LANES];
        directions[..rays.len()].copy_from_slice(rays);
        Self {
            inverse: [0, 1, 2].map(|axis| directions.map(|direction| 1.0 / direction[axis].abs())),
            goes_down: octant(&rays[0]),
            directions,
            units: directions.map(|direction| direction.normalize()),
            rays: rays.len(),
        }
    }

    /// Whether every lane has a ray.
    #[cfg(any(target_arch = "x86_64", test))]
    pub(super) fn is_full(&self) -> bool {
        self.rays == LANES
    }

    /// Number of rays.
    pub(super) fn rays(&self) -> u64 {
        self.rays as u64
    }

    /// The direction of one ray; see [`Pattern::directions`].
    pub(super) fn direction(&self, lane: usize) -> Vector3<f64> {
        self.directions[lane]
    }

    /// The lanes whose rays are within the field of view.
    pub(super) fn lanes(&self, cone: Option<&Cone>) -> impl Iterator<Item = usize> {
        (0..self.rays).filter(move |&lane| match cone {
            Some((heading, cone_cos)) => heading.dot(&self.units[lane]) > *cone_cos,
            None => true,
        })
    }
}

/// By axis, whether a direction goes down it.
pub(super) fn octant(direction: &Vector3<f64>) -> [bool; 3] {
    [0, 1, 2].map(|axis| direction[axis] < 0.0)
}

/// The Morton code of the point where a ray crosses its octant's triangle: rays with close codes
/// are close.
fn neighbourhood(direction: &Vector3<f64>) -> u32 {
    let sum = direction.x.abs() + direction.y.abs() + direction.z.abs();
    let [u, v] = [direction.x, direction.y].map(|component| (component.abs() / sum * 1023.0) as u32);
    (0..10).fold(0, |code, bit| code | (u >> bit & 1) << (2 * bit) | (v >> bit & 1) << (2 * bit + 1))
}
