//! What an agent knows of a small world, drawn as text for tests.

use nalgebra::Point3;
use voxels::{Cell, Grid, Terrain};

use crate::exploration_map::ExplorationMap;

/// Radius of the body, metres.
pub(crate) const RADIUS_M: f64 = 0.4;

/// A map of which is known what is drawn: `.` free, `#` wall, `?` unexplored.
pub(crate) fn drawn(text: &str) -> ExplorationMap {
    let free = Grid::from_text(&text.replace('?', "#")).unwrap();
    let unexplored = Grid::from_text(&text.replace('#', ".").replace('?', "#")).unwrap();
    let mut map = ExplorationMap::new(free.extent());
    for (index, (terrain, mark)) in (0..).zip(free.as_slice().iter().zip(unexplored.as_slice())) {
        match (terrain, mark) {
            (Terrain::Free, _) => map.note_free(&[index]),
            (Terrain::Wall, Terrain::Free) => map.note_wall(&[index]),
            (Terrain::Wall, Terrain::Wall) => {}
        }
    }
    map
}

/// Cell of a flat world.
pub(crate) fn flat(x: i32, y: i32) -> Cell {
    Cell::new(x, y, 0)
}

/// Whether a body of [`RADIUS_M`] that goes through these points, in a map with cells of 1 m, comes near to nothing but cells that
/// are known to be free. Looked up point by point along the way, unlike what it is to check.
pub(crate) fn is_through_free_cells(map: &ExplorationMap, from: &Point3<f64>, way_points: &[Point3<f64>]) -> bool {
    use crate::exploration_map::CellState;
    let mut from = *from;
    way_points.iter().all(|to| {
        let steps = ((to - from).norm() / 0.02).ceil().max(1.0);
        let is_clear_at = |step: usize| {
            let centre = from + (to - from) * (step as f64 / steps);
            let here = map.extent().cell_of(&centre);
            here.neighbours26().into_iter().chain([here]).all(|cell| {
                let low = Point3::new(f64::from(cell.x), f64::from(cell.y), f64::from(cell.z));
                let nearest = centre.coords.sup(&low.coords).inf(&low.coords.add_scalar(1.0));
                let is_touched = (nearest - centre.coords).norm() < RADIUS_M - 1e-9;
                !is_touched || matches!(map.state(cell), CellState::Free | CellState::Covered)
            })
        };
        let is_clear = (0..=steps as usize).all(is_clear_at);
        from = *to;
        is_clear
    })
}
