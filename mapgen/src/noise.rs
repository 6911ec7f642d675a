//! Smoothed Noise: every inner cell is wall by chance, then the map is smoothed
//! (docs/reference-model.md, "Map generators: Smoothed Noise").
//!
//! One solid layer is guaranteed on every side; free cells may touch it. The map may fall into many
//! caves, of which the caller keeps the largest.

use rand::RngExt;
use serde::{Deserialize, Serialize};
use voxels::{Extent, Grid, Terrain};

use super::smoothing::{self, PASSES_MAX};
use super::{Draft, MapError, check_sides, in_range};

/// Parameters of Smoothed Noise; the defaults are those of the user interface of MAES3D.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct NoiseSpec {
    /// Probability that an inner cell starts as wall, 0 to 1. Default 0.53 (MAES3D's slider: 0.45
    /// to 0.60).
    pub fill: f64,
    /// How many times the map is smoothed, 0 to 1000. Default 5 (MAES3D's slider: 0 to 20).
    pub smoothing: u32,
}

impl Default for NoiseSpec {
    fn default() -> Self {
        Self { fill: 0.53, smoothing: 5 }
    }
}

impl NoiseSpec {
    pub(super) fn check(&self, extent: Extent) -> Result<(), MapError> {
        check_sides(extent)?;
        in_range("fill", self.fill, 0.0..=1.0)?;
        in_range("smoothing", self.smoothing, 0..=PASSES_MAX)
    }
}

/// Draws the noise in index order and smooths it.
pub(super) fn draft(spec: &NoiseSpec, extent: Extent, seed: u64) -> Result<Draft, MapError> {
    spec.check(extent)?;
    let mut rng = voxels::random_streams::stream(seed, 0, "map.noise");
    let mut terrain = Grid::new(extent, Terrain::Wall);
    let [size_x, size_y, size_z] = extent.size().map(|cells| cells as usize);
    let layers = terrain.as_mut_slice().chunks_mut(size_x * size_y);
    for layer in layers.take(size_z - 1).skip(1) {
        for row in layer.chunks_mut(size_x).take(size_y - 1).skip(1) {
            for cell in &mut row[1..size_x - 1] {
                if rng.random::<f64>() >= spec.fill {
                    *cell = Terrain::Free;
                }
            }
        }
    }
    smoothing::smooth(&mut terrain, spec.smoothing);
    Ok(Draft { terrain, carved: None, shell_cells_closed: 0 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::free_cells;

    fn free(fill: f64, smoothing: u32) -> u64 {
        let extent = Extent::new([7, 6, 5], 1.0).unwrap();
        let draft = draft(&NoiseSpec { fill, smoothing }, extent, 1).unwrap();
        free_cells(&draft.terrain)
    }

    #[test]
    fn the_ends_of_the_fill_range_are_exact() {
        assert_eq!(free(0.0, 0), 5 * 4 * 3);
        assert_eq!(free(1.0, 0), 0);
    }

    #[test]
    fn raw_noise_has_the_requested_fill() {
        let extent = Extent::new([52; 3], 1.0).unwrap();
        for fill in [0.1, 0.53, 0.9] {
            let draft = draft(&NoiseSpec { fill, smoothing: 0 }, extent, 3).unwrap();
            let free = free_cells(&draft.terrain);
            // 125 000 draws: the standard deviation of the share is below 0.0015.
            assert!((free as f64 / 125_000.0 - (1.0 - fill)).abs() < 0.0075, "fill {fill}: {free} free");
        }
    }
}
