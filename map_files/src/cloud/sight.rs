//! Rays between positions of a sensor and cells with points.

use std::ops::ControlFlow;

use nalgebra::Point3;
use voxels::{Cell, Grid, walk_segment};

use super::super::FormatError;
use super::super::work_budget::WorkBudget;

/// Cells without a point, behind one with a point, from which on a ray has passed through it: rays
/// that graze a surface leave its cells for shorter stretches.
const BEHIND_CELLS: u32 = 2;

/// Positions of the sensor that are compared with a cell in one step of work.
const PLACES_PER_STEP: usize = 16;

/// The cells of a ray from the sensor on, and whether they have points.
type Way = Vec<(Cell, bool)>;

/// Puts the cells between the sensor and a point, in lengths of cells, into `way`.
///
/// # Errors
/// If no work is left.
pub(super) fn way_between(
    is_hit: &Grid<bool>,
    sensor: Point3<f64>,
    point: Point3<f64>,
    work: &mut WorkBudget,
    way: &mut Way,
) -> Result<(), FormatError> {
    way.clear();
    let crossed = walk_segment(is_hit.extent(), &sensor, &point, |cell| {
        way.push((cell, is_hit.get(cell) == Some(&true)));
        work.spend(1).map_or_else(ControlFlow::Break, ControlFlow::Continue)
    });
    if let ControlFlow::Break(error) = crossed {
        return Err(error);
    }
    // A segment is walked from the end with the lower coordinates.
    let [x, y, z] = [point.x, point.y, point.z].map(|along| libm::floor(along) as i32);
    if way.first().map(|&(cell, _)| cell) == Some(Cell::new(x, y, z)) {
        way.reverse();
    }
    Ok(())
}

/// Whether a ray leaves cells with points again, of its cells from the sensor on and whether they
/// have points.
pub(super) fn passes_through(way: &[(Cell, bool)]) -> bool {
    let from_first = way.iter().skip_while(|&&(_, is_hit)| !is_hit);
    let mut behind = 0;
    for &(_, is_hit) in from_first {
        behind = if is_hit { 0 } else { behind + 1 };
        if behind >= BEHIND_CELLS {
            return true;
        }
    }
    false
}

/// Cells with points that are in sight of a position of the sensor, and those that are not.
pub(super) struct Seen {
    pub(super) seen: u64,
    pub(super) unseen: u64,
}

/// Visits the cells between each cell with a point and the nearest of the positions in sight, which
/// are in lengths of cells.
///
/// # Errors
/// If no work is left.
pub(super) fn from_nearest(
    is_hit: &Grid<bool>,
    places: &[[f64; 3]],
    work: &mut WorkBudget,
    mut free: impl FnMut(Cell),
) -> Result<Seen, FormatError> {
    // Positions in one cell see the same.
    let mut apart: Vec<([i64; 3], [f64; 3])> =
        places.iter().map(|&place| (place.map(|along| libm::floor(along) as i64), place)).collect();
    apart.sort_by_key(|&(cell, _)| cell);
    apart.dedup_by_key(|&mut (cell, _)| cell);
    let mut result = Seen { seen: 0, unseen: 0 };
    let mut by_distance = Vec::with_capacity(apart.len());
    let mut way = Vec::new();
    for (cell, _) in is_hit.iter().filter(|&(_, &is_hit)| is_hit) {
        let centre = [cell.x, cell.y, cell.z].map(|along| f64::from(along) + 0.5);
        work.spend(1 + apart.len() / PLACES_PER_STEP)?;
        by_distance.clear();
        by_distance.extend(apart.iter().map(|&(_, place)| {
            let squares = [0, 1, 2].map(|axis| (place[axis] - centre[axis]) * (place[axis] - centre[axis]));
            (squares.iter().sum::<f64>(), place)
        }));
        // The nearest one is usually in sight; the others are put in order only if it is not.
        let order = |one: &(f64, [f64; 3]), other: &(f64, [f64; 3])| {
            one.0.total_cmp(&other.0).then(one.1.partial_cmp(&other.1).unwrap_or(std::cmp::Ordering::Equal))
        };
        if let Some(nearest) = (0..by_distance.len()).min_by(|&a, &b| order(&by_distance[a], &by_distance[b])) {
            by_distance.swap(0, nearest);
        }
        let mut is_seen = false;
        for rank in 0..by_distance.len() {
            if rank == 1 {
                work.spend(by_distance.len())?;
                by_distance[1..].sort_by(order);
            }
            way_between(is_hit, Point3::from(by_distance[rank].1), Point3::from(centre), work, &mut way)?;
            if !passes_through(&way) {
                way.iter().for_each(|&(cell, _)| free(cell));
                is_seen = true;
                break;
            }
        }
        if is_seen {
            result.seen += 1;
        } else {
            result.unseen += 1;
        }
    }
    Ok(result)
}
