//! Scenes at true scale: kinds of places that the literature on exploration compares on, drawn in
//! metres into a map of any size and resolution.
//!
//! An office of cubicles, an octagonal maze, tunnels with junctions as of SubT, a garage with
//! ramps, a hall of pillars, a campus and a forest; each in a file of its own. Lengths are those of
//! such places, so that a body, a sensor and a speed of the literature meet what they were made
//! for; the seed decides doors, gaps, junctions, pillars, buildings and trees; the garage has none.
//!
//! Invariants: one solid layer stands around it on every side, and its free space is connected but
//! for pockets, which are filled as in every map.

mod campus;
mod forest;
mod garage;
mod octagon;
mod office;
mod pillars;
mod tunnels;

use std::ops::Range;

use serde::{Deserialize, Serialize};
use voxels::{Cell, Extent, Grid, Terrain, close_shell};

use super::{Draft, MapError, check_sides};

/// Parameters of a scene.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SceneSpec {
    /// Which place. Default office.
    pub name: SceneName,
}

/// A kind of place.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SceneName {
    /// Cubicles of 3 m along aisles.
    #[default]
    Office,
    /// Lanes of 2.5 m between octagons, each with a gap and a barrier.
    OctagonMaze,
    /// Tunnels of 3 m between junctions 20 m apart, at different heights.
    Tunnels,
    /// Floors of 3 m with pillars, joined by ramps.
    Garage,
    /// A hall with round pillars.
    Pillars,
    /// Buildings along streets of 6 m, some with a courtyard.
    Campus,
    /// Trees under an open sky.
    Forest,
}

impl SceneSpec {
    pub(super) fn check(&self, extent: Extent) -> Result<(), MapError> {
        check_sides(extent)?;
        let needed = self.least_m().map(|along_m| (along_m / extent.cell_m()).ceil() as u32 + 2);
        let is_large_enough = extent.size().iter().zip(needed).all(|(&cells, needed)| cells >= needed);
        if is_large_enough {
            return Ok(());
        }
        Err(MapError::SceneTooSmall { size: extent.size(), cell_m: extent.cell_m(), needed })
    }

    /// The least size inside the outer walls, metres.
    fn least_m(&self) -> [f64; 3] {
        match self.name {
            SceneName::Office => [8.0, 10.0, 2.0],
            SceneName::OctagonMaze => [14.0, 14.0, 2.0],
            SceneName::Tunnels => [24.0, 24.0, 3.0],
            SceneName::Garage => [30.0, 15.0, 3.0],
            SceneName::Pillars => [8.0, 8.0, 2.0],
            SceneName::Campus => [28.0, 28.0, 3.0],
            SceneName::Forest => [12.0, 12.0, 3.0],
        }
    }
}

/// Draws the scene.
pub(super) fn draft(spec: &SceneSpec, extent: Extent, seed: u64) -> Result<Draft, MapError> {
    spec.check(extent)?;
    let mut rng = voxels::random_streams::stream(seed, 0, "map.scene");
    let mut canvas = Canvas::new(extent);
    match spec.name {
        SceneName::Office => office::draw(&mut canvas, &mut rng),
        SceneName::OctagonMaze => octagon::draw(&mut canvas, &mut rng),
        SceneName::Tunnels => tunnels::draw(&mut canvas, &mut rng),
        SceneName::Garage => garage::draw(&mut canvas),
        SceneName::Pillars => pillars::draw(&mut canvas, &mut rng),
        SceneName::Campus => campus::draw(&mut canvas, &mut rng),
        SceneName::Forest => forest::draw(&mut canvas, &mut rng),
    }
    let mut terrain = canvas.terrain;
    let shell_cells_closed = close_shell(&mut terrain, 1);
    Ok(Draft { terrain, carved: None, shell_cells_closed })
}

/// A solid map into which boxes are drawn in metres from the corner inside its outer layer.
struct Canvas {
    terrain: Grid<Terrain>,
    /// The size inside the outer layer, metres.
    size_m: [f64; 3],
}

impl Canvas {
    fn new(extent: Extent) -> Self {
        let size_m = extent.size().map(|cells| f64::from(cells - 2) * extent.cell_m());
        Self { terrain: Grid::new(extent, Terrain::Wall), size_m }
    }

    fn cell_m(&self) -> f64 {
        self.terrain.extent().cell_m()
    }

    /// The thickness of a wall that is to be so thick, metres: at least a cell.
    fn thick_m(&self, wall_m: f64) -> f64 {
        wall_m.max(self.cell_m())
    }

    /// Sets the cells of a box, from its lowest to its highest corner; what is outside the outer
    /// layer is left out, and the sides are rounded to whole cells.
    fn fill(&mut self, low_m: [f64; 3], high_m: [f64; 3], terrain: Terrain) {
        let (cell_m, size) = (self.cell_m(), self.terrain.extent().size());
        let range = |axis: usize| {
            let last = size[axis] as i32 - 1;
            let to_cell = |at_m: f64| ((at_m / cell_m).round() as i32 + 1).clamp(1, last);
            to_cell(low_m[axis])..to_cell(high_m[axis])
        };
        for cell in cells_in([0, 1, 2].map(range)) {
            self.terrain.set(cell, terrain);
        }
    }

    /// Frees a box.
    fn free(&mut self, low_m: [f64; 3], high_m: [f64; 3]) {
        self.fill(low_m, high_m, Terrain::Free);
    }

    /// Fills a box with wall.
    fn wall(&mut self, low_m: [f64; 3], high_m: [f64; 3]) {
        self.fill(low_m, high_m, Terrain::Wall);
    }

    /// Fills a vertical cylinder about x and y from one height to another with wall, as far as it
    /// lies inside: the cells whose middle is in it, and that of its axis.
    fn post(&mut self, [x_m, y_m]: [f64; 2], radius_m: f64, [low_m, high_m]: [f64; 2]) {
        let middle_m = [x_m, y_m, (low_m + high_m) / 2.0];
        let half_m = [radius_m, radius_m, (high_m - low_m) / 2.0];
        self.wall_where(middle_m, half_m, |[x_m, y_m, z_m]| {
            libm::hypot(x_m, y_m) <= radius_m && z_m.abs() <= half_m[2]
        });
        // Thin ones are a cell wide.
        let [left_m, front_m] = [x_m, y_m].map(|at_m| (at_m / self.cell_m()).floor() * self.cell_m());
        self.wall([left_m, front_m, low_m], [left_m + self.cell_m(), front_m + self.cell_m(), high_m]);
    }

    /// Fills a ball with wall, as far as it lies inside: the cells whose middle is in it.
    fn ball(&mut self, middle_m: [f64; 3], radius_m: f64) {
        self.wall_where(middle_m, [radius_m; 3], |[x_m, y_m, z_m]| {
            x_m * x_m + y_m * y_m + z_m * z_m <= radius_m * radius_m
        });
    }

    /// Makes wall of the cells of a box about its middle for whose middle, relative to that of the
    /// box, metres, `is_wall` holds.
    fn wall_where(&mut self, middle_m: [f64; 3], half_m: [f64; 3], is_wall: impl Fn([f64; 3]) -> bool) {
        let (cell_m, size) = (self.cell_m(), self.terrain.extent().size());
        let range = |axis: usize| {
            let last = size[axis] as i32 - 1;
            let to_cell = |at_m: f64| ((at_m / cell_m).floor() as i32 + 1).clamp(1, last);
            to_cell(middle_m[axis] - half_m[axis])..to_cell(middle_m[axis] + half_m[axis] + cell_m)
        };
        for cell in cells_in([0, 1, 2].map(range)) {
            let at = [cell.x, cell.y, cell.z].map(|along| (f64::from(along) - 0.5) * cell_m);
            if is_wall([0, 1, 2].map(|axis| at[axis] - middle_m[axis])) {
                self.terrain.set(cell, Terrain::Wall);
            }
        }
    }

    /// The lowest corners of the squares of a grid that lie inside, x and y, metres, but for the
    /// first one, in which agents start.
    fn squares(&self, side_m: f64) -> Vec<[f64; 2]> {
        let [columns, rows] = [self.size_m[0], self.size_m[1]].map(|size_m| (size_m / side_m) as u32);
        let all = (0..rows).flat_map(|row| (0..columns).map(move |column| [column, row]));
        all.skip(1).map(|square| square.map(|along| f64::from(along) * side_m)).collect()
    }
}

/// The cells of a box, given as ranges along x, y and z.
fn cells_in([x, y, z]: [Range<i32>; 3]) -> impl Iterator<Item = Cell> {
    z.flat_map(move |z| {
        let x = x.clone();
        y.clone().flat_map(move |y| x.clone().map(move |x| Cell::new(x, y, z)))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::assert_sound;
    use crate::{MapSpec, generate};

    const ALL: [SceneName; 7] = [
        SceneName::Office,
        SceneName::OctagonMaze,
        SceneName::Tunnels,
        SceneName::Garage,
        SceneName::Pillars,
        SceneName::Campus,
        SceneName::Forest,
    ];

    fn spec(name: SceneName) -> MapSpec {
        MapSpec::Scene(SceneSpec { name })
    }

    #[test]
    fn scenes_are_sound_and_hardly_lose_pockets_at_any_resolution() {
        for name in ALL {
            for (size_m, cell_m) in [([42.0, 36.0, 7.0], 0.2), ([60.0, 32.0, 4.0], 0.25), ([44.0, 50.0, 8.0], 0.5)] {
                let size = size_m.map(|along_m: f64| (along_m / cell_m).round() as u32);
                let extent = Extent::new(size, cell_m).unwrap();
                for seed in [1, 2] {
                    let map = generate(&spec(name), extent, seed).unwrap();
                    assert_sound(&map, 1);
                    let lost = map.report.pocket_cells_removed as f64 / map.report.free_cells as f64;
                    assert!(lost < 0.02, "{name:?} {size:?} of {cell_m} m, seed {seed}: {lost}");
                    assert!((0.05..0.97).contains(&map.report.free_fraction), "{name:?}: {}", map.report.free_fraction);
                }
            }
        }
    }

    #[test]
    fn seeds_decide_all_but_the_garage() {
        let extent = Extent::new([200, 160, 20], 0.2).unwrap();
        let terrain = |name, seed| generate(&spec(name), extent, seed).unwrap().terrain;
        for name in ALL.into_iter().filter(|name| *name != SceneName::Garage) {
            assert!(terrain(name, 1) != terrain(name, 2), "{name:?}");
            assert!(terrain(name, 1) == terrain(name, 1), "{name:?}");
        }
    }

    #[test]
    fn scenes_that_do_not_fit_name_the_size_they_need() {
        let extent = Extent::new([300, 300, 20], 0.1).unwrap();
        let error = spec(SceneName::Garage).check(extent).unwrap_err().to_string();
        assert_eq!(
            error,
            "300x300x20 cells of 0.1 m are too few for this scene, it needs at least 302x152x32; choose a larger map, or \
             longer cells"
        );
        for name in ALL {
            let least = SceneSpec { name }.least_m().map(|along_m| (along_m / 0.5).ceil() as u32 + 2);
            assert_sound(&generate(&spec(name), Extent::new(least, 0.5).unwrap(), 3).unwrap(), 1);
        }
    }
}
