//! Starts of teams with bodies wider than a cell, or on the ground, near the origin of the map:
//! side by side, as near to each other as they have room.
//!
//! MAES3D has no such bodies: its starts are the cells of a cube ([`super::cube`]). Here the first
//! start is the cell with room that is nearest to the origin, and each of the others the cell
//! nearest to the first that it can be reached from and that the bodies before leave free.

use nalgebra::Point3;
use voxels::{Cell, CellSet, Extent, Grid, Terrain};

use super::placed_bodies::PlacedBodies;
use super::room::cells_with_room;
use super::{Candidate, SpawnError};

/// The places of the start cells, one for each body. Connected parts of the cells that have room
/// for the largest body are tried in the order of their distances from the origin.
pub(super) fn nearest_origin(terrain: &Grid<Terrain>, team: &[Candidate]) -> Result<Vec<Point3<f64>>, SpawnError> {
    let (extent, radii_m) = (terrain.extent(), Candidate::radii_m(team));
    let largest_m = radii_m.iter().copied().fold(0.0, f64::max);
    let mut left = CellSet::new(extent.volume());
    let mut by_origin = Vec::new();
    for index in cells_with_room(terrain, &PlacedBodies::new(terrain, &radii_m, 0.0), largest_m) {
        left.insert(index as usize);
        by_origin.push(extent.cell_at(index as usize));
    }
    by_origin.sort_by_key(|&cell| by_distance(cell, Cell::default()));
    let mut most = 0;
    for first in by_origin {
        let mut part = take_part(extent, &mut left, first);
        part.sort_by_key(|&cell| by_distance(cell, first));
        let mut placed = PlacedBodies::new(terrain, &radii_m, 0.0);
        let mut cells = part.into_iter();
        let starts: Vec<Point3<f64>> =
            team.iter().map_while(|body| cells.find_map(|cell| placed.place(cell, body))).collect();
        if starts.len() == radii_m.len() {
            return Ok(starts);
        }
        most = most.max(starts.len());
    }
    Err(SpawnError::Full {
        agents: radii_m.len(),
        fit: most,
        place: format!(
            "side by side in a connected part of this map, in cells of {} m; the widest has a radius of \
             {largest_m} m (`maes map check --radius-m {largest_m}` says where it fits)",
            extent.cell_m()
        ),
    })
}

/// Takes the cells that are connected with a cell through faces out of those that are left; none if
/// the cell has been taken.
fn take_part(extent: Extent, left: &mut CellSet, first: Cell) -> Vec<Cell> {
    let mut part = Vec::new();
    let mut take = |cell: Cell, part: &mut Vec<Cell>| {
        if let Some(index) = extent.index(cell).filter(|&index| left.contains(index)) {
            left.remove(index);
            part.push(cell);
        }
    };
    take(first, &mut part);
    let mut done = 0;
    while let Some(&cell) = part.get(done) {
        done += 1;
        cell.neighbours6().into_iter().for_each(|next| take(next, &mut part));
    }
    part
}

/// The order of cells by their distance from another; of equal ones x comes first, then z, then y.
fn by_distance(cell: Cell, from: Cell) -> (i64, i32, i32, i32) {
    let by = cell - from;
    let square = |along: i32| i64::from(along) * i64::from(along);
    (square(by.x) + square(by.y) + square(by.z), by.x, by.z, by.y)
}
