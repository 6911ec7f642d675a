//! Random starts in the free space of the whole map.
//!
//! Rejection sampling: cells are drawn until a body fits. After many rejections in a row, the cells
//! that still have room are listed and each is drawn at most once, so the search ends when there is
//! no room left. Large bodies are placed first; a cell without room for one of them is not listed,
//! even if it has room for a smaller one.

use nalgebra::Point3;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use voxels::{Grid, Terrain};

use super::placed_bodies::PlacedBodies;
use super::room::cells_with_room;
use super::{Candidate, SpawnError};

/// Rejections before the cells with room are listed; a few milliseconds.
const REJECTIONS_MAX: u32 = 1 << 14;

/// Starts at cell centres for bodies with these radii, by agent.
pub(super) fn scattered(
    terrain: &Grid<Terrain>,
    team: &[Candidate],
    min_distance_m: f64,
    seed: u64,
) -> Result<Vec<Point3<f64>>, SpawnError> {
    let radii_m = Candidate::radii_m(team);
    let mut by_size: Vec<usize> = (0..radii_m.len()).collect();
    by_size.sort_by(|&one, &other| radii_m[other].total_cmp(&radii_m[one]));
    let mut sampler = Sampler { terrain, rng: voxels::random_streams::stream(seed, 0, "spawn.scattered"), left: None };
    let mut placed = PlacedBodies::new(terrain, &radii_m, min_distance_m);
    let mut starts = vec![Point3::origin(); radii_m.len()];
    for (fit, &agent) in by_size.iter().enumerate() {
        starts[agent] = sampler.place(&mut placed, &team[agent]).ok_or_else(|| SpawnError::Full {
            agents: radii_m.len(),
            fit,
            place: format!("in this map, at random and at least {min_distance_m} m apart"),
        })?;
    }
    Ok(starts)
}

struct Sampler<'a> {
    terrain: &'a Grid<Terrain>,
    rng: ChaCha8Rng,
    /// After too many rejections: indices of the cells that had room then and have not been drawn
    /// since.
    left: Option<Vec<u32>>,
}

impl Sampler<'_> {
    /// Places a body; `None` if there is no room for it.
    fn place(&mut self, placed: &mut PlacedBodies<'_>, body: &Candidate) -> Option<Point3<f64>> {
        let extent = self.terrain.extent();
        if self.left.is_none() {
            for _ in 0..REJECTIONS_MAX {
                let cell = extent.cell_at(self.rng.random_range(0..extent.volume()));
                if let Some(centre) = placed.place(cell, body) {
                    return Some(centre);
                }
            }
        }
        let left = self.left.get_or_insert_with(|| cells_with_room(self.terrain, placed, body.radius_m));
        while !left.is_empty() {
            let index = left.swap_remove(self.rng.random_range(0..left.len()));
            if let Some(centre) = placed.place(extent.cell_at(index as usize), body) {
                return Some(centre);
            }
        }
        None
    }
}
