//! What each ray of a scan measures: a return from a wall, or the reason why it has none.
//!
//! The messages of sensors are made of it. What a scan sees of the map is the matter of the
//! engines.

use nalgebra::{Point3, Vector3};
use voxels::Cell;

use super::bodies::{Bodies, BodyOnRay};
use super::cast;
use super::grid::RayGrid;
use super::naive::hit;
use super::{Pattern, Rays, Scanner, SensorMemory, TurningRays};
use crate::body::Pose;

/// What one ray measures.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RayReturn {
    /// Direction of the ray in the frame `map`; that of a shell is as long as the ray, in cells,
    /// those of the others have length 1.
    pub direction: Vector3<f64>,
    /// The return, or the reason for none.
    pub measured: Measured,
}

/// The return of a ray.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Measured {
    /// A wall or a body.
    Surface {
        /// Where the return comes from, metres, frame `map`.
        point: Point3<f64>,
        /// Cosine of the angle between the ray and the normal of the surface, 0 ..= 1.
        incidence_cos: f64,
    },
    /// Nothing within the range.
    OutOfRange,
    /// Something that is too near.
    TooNear,
    /// A return that noise has swallowed.
    Missed,
}

impl RayReturn {
    /// Where the return comes from, metres, frame `map`.
    #[must_use]
    pub fn point(&self) -> Option<Point3<f64>> {
        if let Measured::Surface { point, .. } = self.measured { Some(point) } else { None }
    }
}

/// The line of a spinning LiDAR that is closest to the plane of the sensor.
#[derive(Debug, Clone)]
pub struct MiddleLine {
    /// The line alone. Its rays turn with the body, also those of a level LiDAR, of which the phase
    /// is free.
    pub scanner: Scanner,
    /// Its rows and columns.
    pub grid: RayGrid,
    /// Its elevation above the plane of the sensor, radians.
    pub elevation_rad: f64,
}

impl Scanner {
    /// What the rays of a scan from `pose` past bodies measure, in the fixed order of the scanner's
    /// rays; empty outside the map.
    pub(crate) fn returns(&self, memory: &SensorMemory, pose: &Pose, bodies: &Bodies) -> Vec<RayReturn> {
        let mut returns = Vec::new();
        let Some(start) = self.start(memory, pose) else { return returns };
        let (marks, origin) = (memory.marks(), self.origin(pose));
        let wall = |end: (u64, f64), direction: Vector3<f64>| {
            let point = hit(end, direction, memory, &origin)?;
            let incidence_cos = incidence_cos(memory, &origin, &direction, marks.slots().cell(end.0));
            Some(Measured::Surface { point, incidence_cos })
        };
        for bundle in &*self.bundles(pose.yaw_rad) {
            for lane in bundle.lanes(start.cone()) {
                let direction = bundle.direction(lane);
                let body = BodyOnRay::new(bodies, &start, &origin, &direction, memory.extent().cell_m());
                let measured = if start.is_blind(marks, bundle, lane) || body.is_too_near {
                    Measured::TooNear
                } else {
                    let end = cast::cast_ray_within(&start, body.limit, bundle, lane, |slot| marks.is_free(slot));
                    let of_body = || body.met.map(|(point, incidence_cos)| Measured::Surface { point, incidence_cos });
                    end.map_or_else(of_body, |end| wall(end, direction)).unwrap_or(Measured::OutOfRange)
                };
                returns.push(RayReturn { direction, measured });
            }
        }
        returns
    }

    /// Its rows and columns, if it has any.
    #[must_use]
    pub fn grid(&self) -> Option<&RayGrid> {
        if let Pattern::Grid(grid) = &self.rays.pattern { Some(grid) } else { None }
    }

    /// The row and the column of a ray of a scan at a heading, if it has any, by its direction in
    /// the frame `map`.
    #[must_use]
    pub fn place_of(&self, direction: &Vector3<f64>, yaw_rad: f64) -> Option<[u32; 2]> {
        let grid = self.grid()?;
        if self.rays.turning.is_none() {
            return Some(grid.place_of(direction));
        }
        let (sin, cos) = libm::sincos(yaw_rad);
        let [x, y, z] = <[f64; 3]>::from(*direction);
        Some(grid.place_of(&Vector3::new(cos * x + sin * y, cos * y - sin * x, z)))
    }

    /// The line closest to the plane of the sensor; `None` unless it is a spinning LiDAR.
    #[must_use]
    pub fn middle_line(&self) -> Option<MiddleLine> {
        let (grid, elevation_rad) = self.grid()?.middle_row()?;
        let pattern = Pattern::Grid(grid.clone());
        let turning = Some(TurningRays::new(pattern.directions()));
        let rays = Rays { pattern, count: grid.rays(), bundles: Vec::new(), turning, culling: None };
        let scanner = Self { rays: rays.into(), ..self.clone() };
        Some(MiddleLine { scanner, grid, elevation_rad })
    }

    /// The direction of its axis, the middle of a camera's image, in the frame `map`, with a body
    /// at a heading.
    #[must_use]
    pub fn axis(&self, yaw_rad: f64) -> Vector3<f64> {
        let (up, ahead) = libm::sincos(self.place_on_body().pitch_rad);
        let (left, forward) = libm::sincos(yaw_rad);
        Vector3::new(ahead * forward, ahead * left, up)
    }
}

/// Cosine of the angle between a ray and the normal of the face through which it enters a cell: of
/// the three planes that bound the cell on the side of the origin (metres, frame `map`), the one
/// that the ray crosses last.
pub(super) fn incidence_cos(memory: &SensorMemory, origin: &Point3<f64>, direction: &Vector3<f64>, cell: Cell) -> f64 {
    let corner = [cell.x, cell.y, cell.z].map(f64::from);
    let origin = memory.extent().in_cells(origin);
    let entry = |axis: usize| {
        let face = if direction[axis] < 0.0 { corner[axis] + 1.0 } else { corner[axis] };
        (face - origin[axis]) / direction[axis]
    };
    let axes = (0..3).filter(|&axis| direction[axis] != 0.0);
    let last = axes.max_by(|&one, &other| entry(one).total_cmp(&entry(other)));
    last.map_or(0.0, |axis| direction[axis].abs() / direction.norm())
}
