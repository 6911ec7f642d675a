//! The length of a straight line inside walls.

use std::ops::ControlFlow;

use nalgebra::Point3;

use crate::{Grid, Terrain, is_wall_at, walk};

/// Metres of the straight line between two points of the map frame that lie in wall cells.
/// Symmetric in its two points.
///
/// The world outside the map is wall: a line with an end out there counts as a whole.
///
/// ```
/// use nalgebra::Point3;
/// use voxels::{Grid, length_in_walls_m};
/// let world = Grid::from_text("..#..\n")?;
/// let (left, right) = (Point3::new(0.5, 0.5, 0.5), Point3::new(4.5, 0.5, 0.5));
/// assert_eq!(length_in_walls_m(&world, &left, &right), 1.0);
/// # Ok::<(), voxels::TextError>(())
/// ```
pub fn length_in_walls_m(terrain: &Grid<Terrain>, a: &Point3<f64>, b: &Point3<f64>) -> f64 {
    let extent = terrain.extent();
    let is_inside = |point: &Point3<f64>| extent.contains(extent.cell_of(point));
    let length_m = (b - a).norm();
    if !(is_inside(a) && is_inside(b)) {
        return length_m;
    }
    // Always from the same end, so that rounding is the same both ways.
    let [from, to] = if [b.x, b.y, b.z] < [a.x, a.y, a.z] { [b, a] } else { [a, b] };
    let mut share = 0.0;
    let mut wall_since = None;
    let _always_to_the_end = walk(extent, from, &(to - from), 1.0, |cell, at| {
        if let Some(since) = wall_since.take() {
            share += at - since;
        }
        wall_since = is_wall_at(terrain, cell).then_some(at);
        ControlFlow::<()>::Continue(())
    });
    share += wall_since.map_or(0.0, |since: f64| 1.0 - since);
    share.clamp(0.0, 1.0) * length_m
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::{Extent, line_of_sight};

    #[test]
    fn lengths_add_up_along_the_line() {
        let world = Grid::from_text(".....\n#.##.\n").unwrap();
        let at = |x, y| Point3::new(x, y, 0.5);
        assert_eq!(length_in_walls_m(&world, &at(0.5, 0.5), &at(4.5, 0.5)), 2.5);
        assert_eq!(length_in_walls_m(&world, &at(0.5, 1.5), &at(4.5, 1.5)), 0.0);
        assert_eq!(length_in_walls_m(&world, &at(0.25, 0.5), &at(0.75, 0.5)), 0.5);
        assert_eq!(length_in_walls_m(&world, &at(2.5, 0.5), &at(2.5, 0.5)), 0.0);
        let aslant = length_in_walls_m(&world, &at(0.5, 0.5), &at(1.5, 1.5));
        assert!((aslant - 0.5_f64.sqrt()).abs() < 1e-12, "{aslant}");
        assert_eq!(length_in_walls_m(&world, &at(1.5, 1.5), &at(1.5, 5.5)), 4.0, "outside");
    }

    proptest! {
        #[test]
        fn length_is_symmetric_and_matches_samples(
            walls in prop::collection::vec(prop::bool::weighted(0.3), 216),
            a in prop::array::uniform3(0.0..5.99_f64),
            b in prop::array::uniform3(0.0..5.99_f64),
        ) {
            let extent = Extent::new([6, 6, 6], 1.0).unwrap();
            let cells = walls.iter().map(|&wall| if wall { Terrain::Wall } else { Terrain::Free });
            let world = Grid::from_vec(extent, cells.collect()).unwrap();
            let [a, b] = [Point3::from(a), Point3::from(b)];
            let length_m = length_in_walls_m(&world, &a, &b);
            prop_assert_eq!(length_m.to_bits(), length_in_walls_m(&world, &b, &a).to_bits());
            if line_of_sight(&world, &a, &b) {
                prop_assert_eq!(length_m, 0.0);
            }
            let samples = 2000;
            let is_in_wall = |n: &i32| {
                let along = (f64::from(*n) + 0.5) / f64::from(samples);
                is_wall_at(&world, extent.cell_of(&(a + (b - a) * along)))
            };
            let hits = (0..samples).filter(is_in_wall).count() as f64;
            let sampled_m = hits / f64::from(samples) * (b - a).norm();
            prop_assert!((length_m - sampled_m).abs() < 0.1, "{length_m} {sampled_m}");
        }
    }
}
