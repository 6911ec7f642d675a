//! Starts at the entrances of a building: one body after the other goes to the next entrance and stands in line there.
//!
//! The line of an entrance is its own cells and then the cells behind them, nearest first along free cells that share a face. A
//! cell belongs to one line, and one that is passed over for want of room is not looked at again.

use std::collections::VecDeque;

use nalgebra::Point3;
use voxels::{Cell, Grid, Terrain};

use super::super::body::Pose;
use super::placed_bodies::PlacedBodies;
use super::{Site, SpawnError};
use mapgen::Entrance;

/// Starts of bodies with these radii, by agent; each looks the way that leads in from its entrance.
pub(super) fn at_entrances(site: &Site<'_>, radii_m: &[f64]) -> Result<Vec<Pose>, SpawnError> {
    if site.entrances.is_empty() {
        return Err(SpawnError::NoEntrances);
    }
    let mut lines = Lines::new(site.terrain, site.entrances);
    let mut crowd = PlacedBodies::new(site.terrain, radii_m, 0.0);
    let mut starts = Vec::with_capacity(radii_m.len());
    for (agent, &radius_m) in radii_m.iter().enumerate() {
        let count = site.entrances.len();
        // Where a line has come to its end, the next one takes its bodies.
        let mut in_turn = (0..count).map(|later| (agent + later) % count);
        let place = in_turn.find_map(|entrance| {
            let position = lines.find(entrance, |cell| crowd.place(cell, radius_m))?;
            let outward = site.entrances[entrance].outward;
            Some(Pose { position, yaw_rad: libm::atan2(f64::from(-outward.y), f64::from(-outward.x)) })
        });
        starts.push(place.ok_or_else(|| SpawnError::Full {
            agents: radii_m.len(),
            fit: starts.len(),
            place: format!("in line behind the {count} entrance(s) of this map"),
        })?);
    }
    Ok(starts)
}

/// The lines of all entrances, as far as they have been looked at.
struct Lines<'a> {
    terrain: &'a Grid<Terrain>,
    is_in_line: Grid<bool>,
    /// By entrance: the cells that come next.
    next: Vec<VecDeque<Cell>>,
}

impl<'a> Lines<'a> {
    fn new(terrain: &'a Grid<Terrain>, entrances: &[Entrance]) -> Self {
        let mut is_in_line = Grid::new(terrain.extent(), false);
        for &cell in entrances.iter().flat_map(|entrance| &entrance.cells) {
            is_in_line.set(cell, true);
        }
        let next = entrances.iter().map(|entrance| entrance.cells.iter().copied().collect()).collect();
        Self { terrain, is_in_line, next }
    }

    /// The first answer of `take` to the cells of a line that have not been looked at.
    fn find(&mut self, entrance: usize, mut take: impl FnMut(Cell) -> Option<Point3<f64>>) -> Option<Point3<f64>> {
        while let Some(cell) = self.next[entrance].pop_front() {
            for behind in cell.neighbours6() {
                let is_free = self.terrain.get(behind) == Some(&Terrain::Free);
                if is_free && self.is_in_line.set(behind, true) == Some(false) {
                    self.next[entrance].push_back(behind);
                }
            }
            if let Some(position) = take(cell) {
                return Some(position);
            }
        }
        None
    }
}
