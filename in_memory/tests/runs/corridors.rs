//! Bodies pass every corridor that is as wide as they are: from one room to another, whatever the
//! length of the cells.

use crate::support::{fill, result, solid};
use proptest::prelude::*;
use voxels::Terrain;

/// Two rooms and a corridor between them that turns twice, `wide` cells wide and high.
fn rooms(cell_m: f64, wide: i32) -> voxels::Grid<Terrain> {
    let (room, length) = (wide + 4, wide + 3);
    let [low, high] = [1 + room, 1 + room + 3 * length];
    let size = [high + room + 1, room + 2 + 2 * length, room + 2];
    let mut terrain = solid(size.map(i32::cast_unsigned), cell_m);
    let up = 1..1 + wide;
    fill(&mut terrain, [1..low, 1..1 + room, 1..1 + room], Terrain::Free);
    fill(&mut terrain, [low - 1..low + length, 1..1 + wide, up.clone()], Terrain::Free);
    fill(&mut terrain, [low + length - wide..low + length, 1..1 + wide + length, up.clone()], Terrain::Free);
    fill(&mut terrain, [low + length - wide..high + 1, 1 + length..1 + length + wide, up], Terrain::Free);
    fill(&mut terrain, [high..high + room, 1 + length..1 + length + room, 1..1 + room], Terrain::Free);
    terrain
}

/// The share of the free cells that one body sees.
fn explored(cell_m: f64, radius_m: f64, controller: &str) -> f64 {
    let wide = (2.0 * radius_m / cell_m - 1e-6).ceil().max(1.0) as i32;
    let keys = format!(
        "duration_s = 600.0\nbody = {{ kind = \"aerial\", radius_m = {radius_m:?} }}\nlidar = {{ range_m = 6.0 }}\n\
         agents = {{ count = 1, controller = \"{controller}\" }}\n"
    );
    result(&rooms(cell_m, wide), &keys).explored
}

#[test]
fn body_of_0_8_m_passes_two_cells_of_0_55_m() {
    for controller in [
        "nearest-frontier",
        "dsvp",
        "dsvp-team",
        "hungarian",
        "rendezvous",
        "racer",
        "c2-explorer",
        "dsvp-maes3d",
        "lvd",
        "lvd-maes3d",
        "boustrophedon",
    ] {
        let explored = explored(0.55, 0.4, controller);
        assert!(explored > 0.99, "{controller}: {explored}");
    }
}

#[test]
fn bodies_of_whole_cells_pass_corridors_as_wide_as_they_are() {
    for (cell_m, radius_m) in [(0.1, 0.3), (0.2, 0.2), (0.3, 0.15), (0.3, 0.3), (0.4, 0.6), (1.0, 0.5)] {
        let explored = explored(cell_m, radius_m, "nearest-frontier");
        assert!(explored > 0.99, "{radius_m} m in cells of {cell_m} m: {explored}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// The margin is what rounds the diameter up to whole cells.
    #[test]
    fn corridor_as_wide_as_the_body_is_passed(cell_m in 0.1..1.0_f64, radius_m in 0.1..0.6_f64) {
        let explored = explored(cell_m, radius_m, "nearest-frontier");
        prop_assert!(explored > 0.98, "{explored}");
    }
}
