//! Starts in the free cube nearest to the origin of the map, as in MAES3D.

use nalgebra::Point3;
use voxels::{Cell, Grid, Terrain};

use super::{Candidate, SpawnError};

/// The shortest edge of the cube, in cells.
const EDGE_MIN: i32 = 3;

/// The centres of the cells of the cube, one for each body; bodies wider than a cell stand side by
/// side.
pub(super) fn nearest_origin(terrain: &Grid<Terrain>, team: &[Candidate]) -> Result<Vec<Point3<f64>>, SpawnError> {
    let (agents, extent) = (team.len(), terrain.extent());
    if team.iter().any(|body| 2.0 * body.radius_m > extent.cell_m() || body.footing.is_some()) {
        return super::cluster::nearest_origin(terrain, team);
    }
    let room = |edge: i32| (edge.unsigned_abs() as usize).pow(3);
    let mut edge = EDGE_MIN;
    while room(edge) < agents {
        edge += 1;
    }
    let corner = nearest_cube(terrain, edge).ok_or_else(|| {
        let largest = (EDGE_MIN..edge).rev().find(|&edge| nearest_cube(terrain, edge).is_some());
        SpawnError::NoCube { edge, agents, fit: largest.map_or(0, room) }
    })?;
    Ok(cube(corner, edge).take(agents).map(|cell| extent.centre(cell)).collect())
}

/// The lowest corner of the free cube nearest to cell (0, 0, 0); of several, the first in the order
/// of [`cube`].
fn nearest_cube(terrain: &Grid<Terrain>, edge: i32) -> Option<Cell> {
    let is_free = |cell: Cell| terrain.get(cell) == Some(&Terrain::Free);
    let [size_x, size_y, size_z] = terrain.extent().size().map(u32::cast_signed);
    let mut nearest: Option<Cell> = None;
    let mut least = i32::MAX;
    for x in 0..=size_x - edge {
        for z in 0..=size_z - edge {
            if x * x + z * z >= least {
                break;
            }
            for y in 0..=size_y - edge {
                let square = x * x + z * z + y * y;
                if square >= least {
                    break;
                }
                let corner = Cell::new(x, y, z);
                if cube(corner, edge).all(is_free) {
                    (least, nearest) = (square, Some(corner));
                }
            }
        }
    }
    nearest
}

/// The cells of a cube in the order of MAES3D: x slowest, then up, then the other horizontal axis.
fn cube(corner: Cell, edge: i32) -> impl Iterator<Item = Cell> {
    (0..edge).flat_map(move |x| (0..edge).flat_map(move |z| (0..edge).map(move |y| corner + Cell::new(x, y, z))))
}
