//! Starts at the entrances of a building: bodies are assigned to the entrances in turn and queue
//! there.
//!
//! The queue of an entrance consists of its own cells and then the cells behind them, in
//! breadth-first order over free cells that share a face. A cell belongs to one queue, and a cell
//! without room is not tried again.

use std::collections::VecDeque;

use nalgebra::Point3;
use voxels::{Cell, Grid, Terrain};

use super::super::body::Pose;
use super::placed_bodies::PlacedBodies;
use super::{Candidate, Site, SpawnError};
use mapgen::Entrance;

/// Starts of bodies with these radii, by agent; each faces inwards from its entrance.
pub(super) fn at_entrances(site: &Site<'_>, team: &[Candidate]) -> Result<Vec<Pose>, SpawnError> {
    if site.entrances.is_empty() {
        return Err(SpawnError::NoEntrances);
    }
    let mut queues = Queues::new(site.terrain, site.entrances);
    let mut placed = PlacedBodies::new(site.terrain, &Candidate::radii_m(team), 0.0);
    let mut starts = Vec::with_capacity(team.len());
    for (agent, body) in team.iter().enumerate() {
        let count = site.entrances.len();
        // If a queue has no more room, the next one takes the body.
        let mut in_turn = (0..count).map(|later| (agent + later) % count);
        let place = in_turn.find_map(|entrance| {
            let position = queues.find(entrance, |cell| placed.place(cell, body))?;
            let outward = site.entrances[entrance].outward;
            Some(Pose { position, yaw_rad: libm::atan2(f64::from(-outward.y), f64::from(-outward.x)) })
        });
        starts.push(place.ok_or_else(|| SpawnError::Full {
            agents: team.len(),
            fit: starts.len(),
            place: format!("in line behind the {count} entrance(s) of this map"),
        })?);
    }
    Ok(starts)
}

/// The queues of all entrances, as far as they have been searched.
struct Queues<'a> {
    terrain: &'a Grid<Terrain>,
    is_queued: Grid<bool>,
    /// By entrance, the cells to be tried next.
    next: Vec<VecDeque<Cell>>,
}

impl<'a> Queues<'a> {
    fn new(terrain: &'a Grid<Terrain>, entrances: &[Entrance]) -> Self {
        let mut is_queued = Grid::new(terrain.extent(), false);
        for &cell in entrances.iter().flat_map(|entrance| &entrance.cells) {
            is_queued.set(cell, true);
        }
        let next = entrances.iter().map(|entrance| entrance.cells.iter().copied().collect()).collect();
        Self { terrain, is_queued, next }
    }

    /// The first position that `take` returns for an untried cell of a queue.
    fn find(&mut self, entrance: usize, mut take: impl FnMut(Cell) -> Option<Point3<f64>>) -> Option<Point3<f64>> {
        while let Some(cell) = self.next[entrance].pop_front() {
            for behind in cell.neighbours6() {
                let is_free = self.terrain.get(behind) == Some(&Terrain::Free);
                if is_free && self.is_queued.set(behind, true) == Some(false) {
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
