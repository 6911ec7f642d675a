//! The bodies of others, and the moving obstacles, that the rays of a scan meet.
//!
//! A ray ends at the first body or wall. The cells before a body are seen, those behind it are not,
//! and the body itself is nothing of the map.

use std::sync::Arc;

use nalgebra::{Point3, Vector3};

use super::Scanner;
use super::cast::Start;
use crate::collision::{Crossing, Shape, Solid, Sphere};

/// What moves, at the time of a scan; none of it if rays pass it.
#[derive(Debug, Clone, Default)]
pub(crate) struct Bodies {
    /// The bodies of other agents, then the moving obstacles.
    solids: Option<Arc<[Solid]>>,
    /// Number of the former.
    agents: usize,
    /// Whether rays end at the former.
    has_agents: bool,
}

/// What the bodies are for one ray.
#[derive(Debug, Clone, Copy)]
pub(super) struct BodyOnRay {
    /// The length of the ray up to the first body in its range, in cells if its direction has
    /// length 1, otherwise in lengths of the direction.
    pub(super) limit: f64,
    /// Whether that body is too near.
    pub(super) is_too_near: bool,
    /// Where it is met, metres, frame `map`, and the cosine of the angle of incidence.
    pub(super) met: Option<(Point3<f64>, f64)>,
}

impl BodyOnRay {
    /// The bodies on a ray of a scan that starts at a point (metres, frame `map`).
    pub(super) fn new(
        bodies: &Bodies,
        start: &Start,
        origin: &Point3<f64>,
        direction: &Vector3<f64>,
        cell_m: f64,
    ) -> Self {
        let in_range = bodies.first_on(origin, direction).filter(|hit| hit.distance / cell_m <= start.limit());
        let Some(BodyHit { distance, incidence_cos }) = in_range else {
            return Self { limit: start.limit(), is_too_near: false, met: None };
        };
        let limit = distance / cell_m;
        let point = origin + direction * distance;
        Self { limit, is_too_near: start.is_too_near(limit), met: Some((point, incidence_cos)) }
    }

    /// Where the body is met.
    pub(super) fn point(&self) -> Option<Point3<f64>> {
        self.met.map(|(point, _)| point)
    }
}

/// Where a ray meets a body.
#[derive(Debug, Clone, Copy)]
pub(super) struct BodyHit {
    /// The distance, metres for each length of the ray's direction.
    pub(super) distance: f64,
    /// Cosine of the angle between the ray and the normal of the surface, 0 ..= 1.
    pub(super) incidence_cos: f64,
}

impl Bodies {
    /// All spheres but that of an agent, and those of agents that are not in the world; and the
    /// moving obstacles.
    pub(crate) fn others(spheres: &[Sphere], index: usize, obstacles: &[Solid]) -> Self {
        let others = spheres.iter().enumerate().filter(|&(other, sphere)| other != index && sphere.radius_m > 0.0);
        let others =
            others.map(|(_, &Sphere { centre, radius_m })| Solid { centre, shape: Shape::Sphere { radius_m } });
        let mut solids: Vec<Solid> = others.collect();
        let agents = solids.len();
        solids.extend_from_slice(obstacles);
        Self { solids: Some(solids.into()), agents, has_agents: true }
    }

    /// The same for the rays of one of the LiDARs of a body.
    pub(crate) fn met_by(&self, scanner: &Scanner) -> Self {
        Self { has_agents: scanner.sees_agents(), ..self.clone() }
    }

    /// The first body on a ray (metres, frame `map`).
    pub(super) fn first_on(&self, origin: &Point3<f64>, direction: &Vector3<f64>) -> Option<BodyHit> {
        let solids = self.solids.as_deref().unwrap_or_default();
        let solids = if self.has_agents { solids } else { &solids[self.agents..] };
        let hits = solids.iter().filter_map(|solid| match solid.shape {
            Shape::Sphere { radius_m } => meet(&Sphere { centre: solid.centre, radius_m }, origin, direction),
            Shape::Box { half_m } => meet_box(&solid.centre, &half_m, origin, direction),
        });
        hits.min_by(|one, other| one.distance.total_cmp(&other.distance))
    }
}

/// Where a ray enters a sphere; `None` if it misses it, or begins in it.
fn meet(sphere: &Sphere, origin: &Point3<f64>, direction: &Vector3<f64>) -> Option<BodyHit> {
    let length = direction.norm();
    let unit = direction / length;
    let to_centre = sphere.centre - origin;
    let along_m = to_centre.dot(&unit);
    let beside_m2 = (to_centre - unit * along_m).norm_squared();
    let depth_m2 = sphere.radius_m * sphere.radius_m - beside_m2;
    if depth_m2 <= 0.0 {
        return None;
    }
    let depth_m = depth_m2.sqrt();
    let distance_m = along_m - depth_m;
    (distance_m >= 0.0).then(|| BodyHit { distance: distance_m / length, incidence_cos: depth_m / sphere.radius_m })
}

/// Where a ray enters a box along the axes; `None` if it misses it, or begins in it.
fn meet_box(
    centre: &Point3<f64>,
    half_m: &Vector3<f64>,
    origin: &Point3<f64>,
    direction: &Vector3<f64>,
) -> Option<BodyHit> {
    let Crossing { enters, axis, .. } = Crossing::of(centre, half_m, origin, direction)?;
    let incidence_cos = (direction[axis] / direction.norm()).abs();
    (enters >= 0.0).then_some(BodyHit { distance: enters, incidence_cos })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_enter_boxes_at_the_nearest_side() {
        let (centre, half_m) = (Point3::new(5.0, 0.0, 0.0), Vector3::new(1.0, 2.0, 3.0));
        let meet = |origin: [f64; 3], direction: [f64; 3]| {
            let hit = meet_box(&centre, &half_m, &origin.into(), &direction.into())?;
            Some((hit.distance, hit.incidence_cos))
        };
        assert_eq!(meet([0.0; 3], [1.0, 0.0, 0.0]), Some((4.0, 1.0)));
        assert_eq!(meet([0.0; 3], [2.0, 0.0, 0.0]), Some((2.0, 1.0)));
        assert_eq!(meet([0.0; 3], [-1.0, 0.0, 0.0]), None);
        assert_eq!(meet([0.0, 2.5, 0.0], [1.0, 0.0, 0.0]), None);
        assert_eq!(meet([5.0, 0.0, 0.0], [1.0, 0.0, 0.0]), None, "it begins inside");
        assert_eq!(meet([5.0, -6.0, -2.0], [0.0, 0.8, 0.6]), Some((5.0, 0.8)));
        assert_eq!(meet([5.0, -6.0, 0.0], [0.0, 0.6, 0.8]), None, "above it");
    }
}
