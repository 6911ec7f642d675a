//! Maps drawn as text, an observation to start from, and a check of paths, for tests of this crate
//! and of controllers.

use msgs::ids::{AgentId, Tick};
use nalgebra::{Point3, Vector3};
use protocol::event_mask::EventMask;
use protocol::observation::{Cells, Observation, Pose};
use voxels::{Cell, Grid, Terrain};

use crate::exploration_map::ExplorationMap;

/// Radius of the body, metres.
pub const RADIUS_M: f64 = 0.4;

/// A map with the drawn knowledge: `.` free, `#` wall, `?` unexplored.
///
/// # Panics
/// If the drawing is none.
#[must_use]
pub fn drawn(text: &str) -> ExplorationMap {
    let free = Grid::from_text(&text.replace('?', "#")).expect("a drawing of cells");
    let unexplored = Grid::from_text(&text.replace('#', ".").replace('?', "#")).expect("a drawing of cells");
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

/// What an agent at rest at a position (metres, frame `map`), heading along x, observes in the
/// first tick, without events and before the first scan.
#[must_use]
pub fn idle_at(agent: AgentId, position: Point3<f64>) -> Observation {
    Observation {
        tick: Tick::ZERO,
        agent,
        pose: Pose { position, yaw_rad: 0.0 },
        velocity_in_map_m_s: Vector3::zeros(),
        yaw_rate_rad_s: 0.0,
        is_active: false,
        collision: None,
        events: EventMask::empty(),
        contacts: Vec::new(),
        relays: Vec::new(),
        messages: Vec::new(),
        scan_tick: None,
        seen: Cells::default(),
        view: None,
        energy: None,
        field_of_view: None,
        map_frames: Vec::new(),
        change: None,
    }
}

/// Cell of a flat world.
#[must_use]
pub const fn flat(x: i32, y: i32) -> Cell {
    Cell::new(x, y, 0)
}

/// Whether a body of [`RADIUS_M`] on these waypoints, in a map with cells of 1 m, touches only
/// cells known to be free. Checked point by point along the path, unlike the code under test.
#[must_use]
pub fn is_through_free_cells(map: &ExplorationMap, from: &Point3<f64>, waypoints: &[Point3<f64>]) -> bool {
    let mut from = *from;
    waypoints.iter().all(|to| {
        let steps = ((to - from).norm() / 0.02).ceil().max(1.0);
        let is_clear_at = |step: usize| {
            let centre = from + (to - from) * (step as f64 / steps);
            let here = map.extent().cell_of(&centre);
            here.neighbours26().into_iter().chain([here]).all(|cell| {
                let low = Point3::new(f64::from(cell.x), f64::from(cell.y), f64::from(cell.z));
                let nearest = centre.coords.sup(&low.coords).inf(&low.coords.add_scalar(1.0));
                let is_touched = (nearest - centre.coords).norm() < RADIUS_M - 1e-9;
                !is_touched || map.state(cell).is_free()
            })
        };
        let is_clear = (0..=steps as usize).all(is_clear_at);
        from = *to;
        is_clear
    })
}
