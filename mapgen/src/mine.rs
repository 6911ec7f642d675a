//! Mines: levels of drifts with crosscuts and stopes, joined by a ramp.
//!
//! Each level has a haulage drift and an ore drift along x, and crosscuts between them along y, of
//! which some end blind. Stopes, large rooms from which ore was taken, stand beside the ore drift.
//! A ramp goes up from level to level in legs along x that turn at its ends. Then single cells
//! break out of roofs and walls.
//!
//! The ranges follow mines that are described in public: crosscuts 12 m apart, drifts of 3 m x 3 m
//! and gradients up to 15 % (Sangdong, miningdataonline.com/property/3406), and a stope of 17 m
//! along the drift, 30 m across and 27 m high (Obuasi: C. G. Amedjoe, J. Agyeman, Journal of
//! Geology and Mining Research 7(3), 2015). With cells of 1 m the defaults are of that size; widths
//! are those that vehicles need.
//!
//! Invariants: two solid layers stand around it on every side, and every opening is joined with the
//! ramp.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use voxels::{Cell, Extent, FACES, Grid, Terrain};

use super::{Draft, MapError, check_sides, in_range};

/// Solid layers on every side.
const OUTER: i32 = 2;

/// Solid cells between the legs of the ramp, and between the ramp and the haulage drift.
const PILLAR: i32 = 3;

/// Largest shift of a drift from its straight line, cells.
const WANDER_MAX: i32 = 2;

/// Probability that a drift shifts by one cell at a step along it.
const WANDER_CHANCE: f64 = 0.1;

/// Parameters of a mine.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MineSpec {
    /// Levels on top of each other, 1 to 50. Default 3.
    pub levels: u32,
    /// Cells from the floor of a level to that of the next, 4 to 500. Default 20.
    pub level_spacing: u32,
    /// Width of drifts, crosscuts and the ramp in cells, 1 to 100. Default 4.
    pub drift_width: u32,
    /// Their height in cells, 2 to 100. Default 4.
    pub drift_height: u32,
    /// Cells from a crosscut to the next, 2 to 500. Default 12 (Sangdong).
    pub crosscut_spacing: u32,
    /// Probability that a crosscut goes through; others end blind halfway. Default 0.7.
    pub crosscut_chance: f64,
    /// Rise of the ramp for each cell along it, 0.02 to 1. Default 0.15 (Sangdong).
    pub ramp_gradient: f64,
    /// Stopes on each level, 0 to 64. Default 2.
    pub stopes: u32,
    /// Size of a stope along the ore drift in cells, 1 to 500. Default 17 (Obuasi).
    pub stope_length: u32,
    /// Its size across the drift, 1 to 500. Default 12.
    pub stope_width: u32,
    /// Its height, 1 to 500. Default 16: less than the level spacing leaves a pillar above it.
    pub stope_height: u32,
    /// Probability that a cell of a wall or roof breaks out. Default 0.15.
    pub overbreak: f64,
}

impl Default for MineSpec {
    fn default() -> Self {
        Self {
            levels: 3,
            level_spacing: 20,
            drift_width: 4,
            drift_height: 4,
            crosscut_spacing: 12,
            crosscut_chance: 0.7,
            ramp_gradient: 0.15,
            stopes: 2,
            stope_length: 17,
            stope_width: 12,
            stope_height: 16,
            overbreak: 0.15,
        }
    }
}

/// The lines along which a mine of a legal spec lies, in cells.
struct Layout {
    size: [i32; 3],
    width: i32,
    height: i32,
    /// Lowest y of the two legs of the ramp, of the haulage drift and of the ore drift.
    legs: [i32; 2],
    haulage: i32,
    ore: i32,
}

impl MineSpec {
    pub(super) fn check(&self, extent: Extent) -> Result<(), MapError> {
        check_sides(extent)?;
        in_range("levels", self.levels, 1..=50)?;
        in_range("level_spacing", self.level_spacing, 4..=500)?;
        in_range("drift_width", self.drift_width, 1..=100)?;
        in_range("drift_height", self.drift_height, 2..=100)?;
        in_range("crosscut_spacing", self.crosscut_spacing, 2..=500)?;
        in_range("crosscut_chance", self.crosscut_chance, 0.0..=1.0)?;
        in_range("ramp_gradient", self.ramp_gradient, 0.02..=1.0)?;
        in_range("stopes", self.stopes, 0..=64)?;
        in_range("stope_length", self.stope_length, 1..=500)?;
        in_range("stope_width", self.stope_width, 1..=500)?;
        in_range("stope_height", self.stope_height, 1..=500)?;
        in_range("overbreak", self.overbreak, 0.0..=1.0)?;
        self.layout(extent).map(|_| ())
    }

    /// # Errors
    /// If the mine does not fit into the extent.
    fn layout(&self, extent: Extent) -> Result<Layout, MapError> {
        let size = extent.size().map(|cells| cells as i32);
        let too_large =
            |key, value: u32, allowed: String| Err(MapError::OutOfRange { key, value: value.to_string(), allowed });
        let [size_x, size_y, size_z] = size;
        let (width, height) = (self.drift_width as i32, self.drift_height as i32);
        if height >= self.level_spacing as i32 {
            return too_large(
                "drift_height",
                self.drift_height,
                format!("2 to {}, less than level_spacing", self.level_spacing - 1),
            );
        }
        let room_z = size_z - 2 * OUTER - height;
        if (self.levels as i32 - 1) * self.level_spacing as i32 > room_z {
            let most = room_z.max(0) / self.level_spacing as i32 + 1;
            let allowed = format!(
                "1 to {most}: levels {} cells apart, the highest of them {height} high, in {size_z} along z",
                self.level_spacing
            );
            return too_large("levels", self.levels, allowed);
        }
        if 4 * width + 2 * OUTER > size_x {
            let allowed = format!("1 to {}, a quarter of the {size_x} cells along x", (size_x - 2 * OUTER) / 4);
            return too_large("drift_width", self.drift_width, allowed);
        }
        let legs = [OUTER, OUTER + width + PILLAR];
        let haulage = legs[1] + width + PILLAR + WANDER_MAX;
        // The shortest crosscut leaves a pillar, and the drifts wander.
        let first_ore = haulage + width + PILLAR + 2 * WANDER_MAX;
        let stope_width = if self.stopes > 0 { self.stope_width as i32 } else { 0 };
        let last_ore = size_y - OUTER - stope_width.max(WANDER_MAX) - width;
        if first_ore > last_ore {
            let needed = size_y + first_ore - last_ore;
            let allowed =
                format!("what fits: with stopes of {stope_width} it takes {needed} cells along y, there are {size_y}");
            return too_large("drift_width", self.drift_width, allowed);
        }
        // Three quarters of what is left is for the crosscuts.
        let ore = first_ore + (last_ore - first_ore) * 3 / 4;
        Ok(Layout { size, width, height, legs, haulage, ore })
    }
}

/// Carves the mine out of the solid.
pub(super) fn draft(spec: &MineSpec, extent: Extent, seed: u64) -> Result<Draft, MapError> {
    spec.check(extent)?;
    let layout = spec.layout(extent)?;
    let mut mine = Mine {
        terrain: Grid::new(extent, Terrain::Wall),
        rng: voxels::random_streams::stream(seed, 0, "map.mine"),
        layout,
        spec,
    };
    let floors: Vec<i32> = (0..spec.levels as i32).map(|level| OUTER + level * spec.level_spacing as i32).collect();
    for &floor in &floors {
        mine.level(floor);
    }
    mine.ramp(&floors);
    mine.break_out();
    Ok(Draft { terrain: mine.terrain, carved: None, shell_cells_closed: 0 })
}

struct Mine<'a> {
    terrain: Grid<Terrain>,
    rng: ChaCha8Rng,
    layout: Layout,
    spec: &'a MineSpec,
}

impl Mine<'_> {
    /// Frees a box, within the outer layers.
    fn carve(&mut self, low: [i32; 3], size: [i32; 3]) {
        let range = |axis: usize| low[axis].max(OUTER)..(low[axis] + size[axis]).min(self.layout.size[axis] - OUTER);
        let (xs, ys, zs) = (range(0), range(1), range(2));
        for (z, y) in zs.flat_map(|z| ys.clone().map(move |y| (z, y))) {
            for x in xs.clone() {
                self.terrain.set(Cell::new(x, y, z), Terrain::Free);
            }
        }
    }

    /// A drift along x; returns its lowest y at each x.
    fn drift(&mut self, y: i32, floor: i32) -> Vec<i32> {
        let Layout { size, width, height, .. } = self.layout;
        let mut shift = 0;
        let mut along = vec![y; size[0] as usize];
        for x in OUTER..size[0] - OUTER {
            let before = shift;
            if self.rng.random_bool(WANDER_CHANCE) {
                let step = if self.rng.random_bool(0.5) { 1 } else { -1 };
                shift = (shift + step).clamp(-WANDER_MAX, WANDER_MAX);
            }
            along[x as usize] = y + shift;
            // Both sides of a shift, so that a drift of one cell stays connected.
            self.carve([x, y + shift.min(before), floor], [1, width + (shift - before).abs(), height]);
        }
        along
    }

    /// Drifts, crosscuts and stopes of a level.
    fn level(&mut self, floor: i32) {
        let Layout { size, width, height, haulage, ore, .. } = self.layout;
        let from = self.drift(haulage, floor);
        let to = self.drift(ore, floor);
        let spacing = self.spec.crosscut_spacing as i32;
        let first = OUTER + self.rng.random_range(0..spacing);
        let last = size[0] - OUTER - width;
        // A level without a crosscut that goes through would be two.
        let through = self.rng.random_range(0..((last - first).max(0) / spacing + 1)) * spacing + first;
        let mut x = first.min(last);
        while x <= last {
            let (low, high) = (from[x as usize], to[x as usize] + width);
            let goes_through = x == through.min(last) || self.rng.random_bool(self.spec.crosscut_chance);
            let length = if goes_through { high - low } else { (high - low) / 2 };
            if goes_through || self.rng.random_bool(0.5) {
                self.carve([x, low, floor], [width, length, height]);
            } else {
                self.carve([x, high - length, floor], [width, length, height]);
            }
            x += spacing;
        }
        for _ in 0..self.spec.stopes {
            let [length, across, high] =
                [self.spec.stope_length, self.spec.stope_width, self.spec.stope_height].map(u32::cast_signed);
            let x = OUTER + self.rng.random_range(0..=(size[0] - 2 * OUTER - length).max(0));
            // From within the drift, wherever that has wandered to.
            self.carve([x, ore + width - 1 - WANDER_MAX, floor], [length, across + 1 + WANDER_MAX, high]);
        }
    }

    /// The ramp through all levels, with a way to each of them.
    fn ramp(&mut self, floors: &[i32]) {
        let Layout { size, width, height, legs, haulage, .. } = self.layout;
        let (first, last) = (OUTER, size[0] - OUTER - width);
        let top = floors.last().copied().unwrap_or(OUTER);
        let (mut x, mut step, mut leg, mut steps) = (first, 1, 0, 0);
        let mut floors = floors.iter().copied().peekable();
        loop {
            let z = OUTER + libm::floor(f64::from(steps) * self.spec.ramp_gradient) as i32;
            // One more above, so that there is headroom where the floor rises.
            self.carve([x, legs[leg], z], [width, width, height + 1]);
            while floors.next_if(|&floor| floor <= z).is_some() {
                self.carve([x, legs[leg], z], [width, haulage + width + WANDER_MAX - legs[leg], height]);
            }
            if z >= top {
                return;
            }
            steps += 1;
            if (first..=last).contains(&(x + step)) {
                x += step;
            } else {
                // The turn between the two legs is flat.
                self.carve([x, legs[0], z], [width, legs[1] + width - legs[0], height + 1]);
                (step, leg) = (-step, 1 - leg);
            }
        }
    }

    /// Frees single cells of walls and roofs; floors stay.
    fn break_out(&mut self) {
        let before = self.terrain.clone();
        let size = self.layout.size;
        for index in 0..before.extent().volume() {
            let cell = before.extent().cell_at(index);
            let is_inner =
                [cell.x, cell.y, cell.z].into_iter().zip(size).all(|(at, size)| (OUTER..size - OUTER).contains(&at));
            let is_free = |cell: Cell| before.get(cell) == Some(&Terrain::Free);
            if !is_inner || is_free(cell) || is_free(cell + Cell::new(0, 0, 1)) {
                continue;
            }
            if FACES.iter().any(|&face| is_free(cell + face)) && self.rng.random_bool(self.spec.overbreak) {
                self.terrain[index] = Terrain::Free;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{MapSpec, generate};
    use proptest::prelude::*;

    #[test]
    fn defaults_make_a_connected_mine_of_three_levels() {
        let extent = Extent::new([100, 80, 64], 1.0).unwrap();
        for seed in 0..5 {
            let map = generate(&MapSpec::Mine(MineSpec::default()), extent, seed).unwrap();
            let report = &map.report;
            assert_eq!(report.pockets_removed, 0, "seed {seed}");
            assert!((0.04..0.3).contains(&report.free_fraction), "seed {seed}: {}", report.free_fraction);
            for z in [OUTER, OUTER + 20, OUTER + 40] {
                let free = map.terrain.iter().filter(|(cell, here)| cell.z == z && **here == Terrain::Free).count();
                assert!(free > 2 * 4 * 96, "seed {seed}: {free} at z = {z}");
            }
        }
    }

    #[test]
    fn what_does_not_fit_names_the_key() {
        let refuse = |spec: MineSpec, size| spec.check(Extent::new(size, 1.0).unwrap()).unwrap_err().to_string();
        let levels = MineSpec { levels: 9, ..MineSpec::default() };
        assert_eq!(
            refuse(levels, [100, 80, 64]),
            "levels is 9, allowed is 1 to 3: levels 20 cells apart, the highest of them 4 high, in 64 along z"
        );
        let high = MineSpec { drift_height: 20, ..MineSpec::default() };
        assert_eq!(refuse(high, [100, 80, 64]), "drift_height is 20, allowed is 2 to 19, less than level_spacing");
        assert!(refuse(MineSpec::default(), [100, 20, 64]).starts_with("drift_width is 4, allowed is what fits"));
        assert!(
            refuse(MineSpec::default(), [10, 80, 64]).starts_with("drift_width is 4, allowed is 1 to 1, a quarter")
        );
    }

    proptest! {
        #[test]
        fn every_legal_mine_is_connected_within_its_outer_layers(
            size in [20u32..120, 40u32..100, 12u32..70], levels in 1u32..4, drift_width in 1u32..5, gradient in 0.02f64..1.0,
            overbreak in 0.0f64..1.0, stopes in 0u32..4, seed in 0u64..99,
        ) {
            let spec = MineSpec { levels, drift_width, ramp_gradient: gradient, overbreak, stopes, ..MineSpec::default() };
            let extent = Extent::new(size, 1.0).unwrap();
            let Ok(Draft { mut terrain, .. }) = draft(&spec, extent, seed) else { return Ok(()) };
            prop_assert_eq!(voxels::free_components(&terrain).sizes.len(), 1);
            prop_assert_eq!(voxels::close_shell(&mut terrain, OUTER as u32), 0);
        }
    }
}
