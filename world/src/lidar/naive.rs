//! The engine that casts every ray, one by one: the oracle of the others, and what shows a whole
//! scan.

use nalgebra::{Point3, Vector3};

use super::bodies::{Bodies, BodyOnRay};
use super::cast;
use super::engine::{CastCount, Engine, NewCells, NotCast};
use super::{Scanner, SensorMemory};
use crate::body::Pose;

/// Casts every ray of a scan, and notes where they hit something. The engine of LiDARs whose
/// rays end at what moves, too.
#[derive(Debug, Default)]
pub(crate) struct NaiveEngine {
    /// The points where rays of the scans hit walls and bodies, metres, frame `map`.
    hits: Vec<Point3<f64>>,
    bodies: Bodies,
}

impl NaiveEngine {
    /// Casts scans past these bodies.
    pub(crate) fn past(bodies: Bodies) -> Self {
        Self { hits: Vec::new(), bodies }
    }
}

/// Everything that one scan sees.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ScanView {
    /// Indices of the free cells, the body's own included, ascending.
    pub free: Vec<u32>,
    /// Indices of the walls that ended a ray, ascending.
    pub wall: Vec<u32>,
    /// The points where rays hit walls, or bodies, metres, frame `map`, in the fixed order of the
    /// scanner's rays.
    pub hits: Vec<Point3<f64>>,
}

impl Engine for NaiveEngine {
    fn cast(&mut self, scanner: &Scanner, memory: &mut SensorMemory, pose: &Pose, mut new: NewCells<'_>) -> CastCount {
        let due = u64::from(scanner.rays());
        let Some(start) = scanner.start(memory, pose) else { return CastCount::without(due, NotCast::OutsideMap) };
        start.see_own(memory.parts().marks, &mut new);
        memory.see_body(&pose.position, &mut new);
        let (mut in_view, origin, cell_m) = (0, scanner.origin(pose), memory.extent().cell_m());
        for bundle in &*scanner.bundles(pose.yaw_rad) {
            for lane in bundle.lanes(start.cone()) {
                in_view += 1;
                let (marks, direction) = (memory.parts().marks, bundle.direction(lane));
                let body = BodyOnRay::new(&self.bodies, &start, &origin, &direction, cell_m);
                if start.is_blind(marks, bundle, lane) || body.is_too_near {
                    continue;
                }
                let end = cast::cast_ray_within(&start, body.limit, bundle, lane, |slot| marks.see(slot, &mut new));
                let hit = end.map_or_else(|| body.point(), |end| hit(end, direction, memory, &origin));
                self.hits.extend(hit);
            }
        }
        let mut count = CastCount::of(due);
        count.leave_out(due - in_view, NotCast::OutsideView);
        count
    }
}

impl Scanner {
    /// Everything that a scan from `pose` sees, whether seen before or not.
    pub fn view(&self, memory: &SensorMemory, pose: &Pose) -> ScanView {
        self.view_past(memory, pose, &Bodies::default())
    }

    /// The same past these bodies.
    pub(crate) fn view_past(&self, memory: &SensorMemory, pose: &Pose, bodies: &Bodies) -> ScanView {
        let mut view = ScanView::default();
        let mut engine = NaiveEngine::past(bodies.clone());
        let new = NewCells { free: &mut view.free, wall: &mut view.wall };
        engine.cast(self, &mut memory.unused(), pose, new);
        view.hits = engine.hits;
        view.free.sort_unstable();
        view.wall.sort_unstable();
        view
    }
}

/// Where a ray meets a wall, metres, frame `map`; `None` at the edge of the map. The ray ends in a
/// slot, at a distance that is in cells if its direction has length 1, otherwise in lengths of the
/// direction.
pub(super) fn hit(
    (slot, distance): (u64, f64),
    direction: Vector3<f64>,
    memory: &SensorMemory,
    origin: &Point3<f64>,
) -> Option<Point3<f64>> {
    let extent = memory.extent();
    let is_inside = extent.contains(memory.marks().slots().cell(slot));
    is_inside.then(|| origin + direction * (distance * extent.cell_m()))
}
