//! The engine that casts every ray, one by one: the oracle of the others, and what shows a whole
//! scan.

use nalgebra::{Point3, Vector3};

use super::cast::{self, Start};
use super::engine::{CastCount, Engine, NewCells, NotCast};
use super::{Scanner, SensorMemory};
use crate::world::body::Pose;

/// Casts every ray of a scan, and notes where they hit walls.
#[derive(Debug, Default)]
pub(in crate::world) struct NaiveEngine {
    /// The points where rays of the scans hit walls, metres, frame `map`.
    hits: Vec<Point3<f64>>,
}

/// Everything that one scan sees.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ScanView {
    /// Indices of the free cells, the body's own included, ascending.
    pub free: Vec<u32>,
    /// Indices of the walls that ended a ray, ascending.
    pub wall: Vec<u32>,
    /// The points where rays hit walls, metres, frame `map`, in the fixed order of the scanner's
    /// rays.
    pub hits: Vec<Point3<f64>>,
}

impl Engine for NaiveEngine {
    fn cast(&mut self, scanner: &Scanner, memory: &mut SensorMemory, pose: &Pose, mut new: NewCells<'_>) -> CastCount {
        let due = u64::from(scanner.rays());
        let Some(start) = scanner.start(memory, pose) else { return CastCount::without(due, NotCast::OutsideMap) };
        let marks = memory.parts().marks;
        marks.see(start.slot(), &mut new);
        let mut ends = Vec::new();
        let enter = |slot| marks.see(slot, &mut new);
        let in_view = follow(scanner, &start, enter, |end| ends.push(end));
        self.hits.extend(ends.iter().filter_map(|end| end.hit(memory, pose)));
        let mut count = CastCount::of(due);
        count.leave_out(due - in_view, NotCast::OutsideView);
        count
    }
}

impl Scanner {
    /// Everything that a scan from `pose` sees, whether seen before or not.
    pub fn view(&self, memory: &SensorMemory, pose: &Pose) -> ScanView {
        let mut view = ScanView::default();
        let mut engine = NaiveEngine::default();
        let new = NewCells { free: &mut view.free, wall: &mut view.wall };
        engine.cast(self, &mut memory.unused(), pose, new);
        view.hits = engine.hits;
        view.free.sort_unstable();
        view.wall.sort_unstable();
        view
    }

    /// The points where the rays of a scan from `pose` hit walls, metres, frame `map`: the hits of
    /// its [`Scanner::view`].
    pub fn hits(&self, memory: &SensorMemory, pose: &Pose) -> Vec<Point3<f64>> {
        let mut hits = Vec::new();
        let Some(start) = self.start(memory, pose) else { return hits };
        let enter = |slot| memory.marks().is_free(slot);
        follow(self, &start, enter, |end| hits.extend(end.hit(memory, pose)));
        hits
    }
}

/// The end of a ray in a wall or at the edge of the map.
struct RayEnd {
    slot: u64,
    /// In cells if the direction has length 1, otherwise in lengths of the direction.
    distance: f64,
    direction: Vector3<f64>,
}

impl RayEnd {
    /// Where the ray meets a wall, metres, frame `map`; `None` at the edge of the map.
    fn hit(&self, memory: &SensorMemory, pose: &Pose) -> Option<Point3<f64>> {
        let extent = memory.extent();
        let is_inside = extent.contains(memory.marks().slots().cell(self.slot));
        is_inside.then(|| pose.position + self.direction * (self.distance * extent.cell_m()))
    }
}

/// Follows all rays in the field of view, in their fixed order, each until `enter` returns false
/// for a slot or its range ends; `end` gets where it returned false. Returns the number of rays.
fn follow(scanner: &Scanner, start: &Start, mut enter: impl FnMut(u64) -> bool, mut end: impl FnMut(RayEnd)) -> u64 {
    let mut rays = 0;
    for bundle in scanner.bundles() {
        for lane in bundle.lanes(start.cone()) {
            rays += 1;
            if let Some((slot, distance)) = cast::cast_ray(start, bundle, lane, &mut enter) {
                end(RayEnd { slot, distance, direction: bundle.direction(lane) });
            }
        }
    }
    rays
}
