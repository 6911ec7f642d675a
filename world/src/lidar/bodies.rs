//! The bodies of others that the rays of a scan meet.
//!
//! A ray ends at the first body or wall. The cells before a body are seen, those behind it are not,
//! and the body itself is nothing of the map.

use std::sync::Arc;

use nalgebra::{Point3, Vector3};

use super::cast::Start;
use crate::collision::Sphere;

/// The bodies of others at the time of a scan; none if rays pass them.
#[derive(Debug, Clone, Default)]
pub(crate) struct Bodies(Option<Arc<[Sphere]>>);

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
    /// All spheres but that of an agent, and those of agents that are not in the world.
    pub(crate) fn others(spheres: &[Sphere], index: usize) -> Self {
        let others = spheres.iter().enumerate().filter(|&(other, sphere)| other != index && sphere.radius_m > 0.0);
        Self(Some(others.map(|(_, sphere)| *sphere).collect()))
    }

    /// The first body on a ray (metres, frame `map`).
    pub(super) fn first_on(&self, origin: &Point3<f64>, direction: &Vector3<f64>) -> Option<BodyHit> {
        let spheres = self.0.as_deref().unwrap_or_default();
        let hits = spheres.iter().filter_map(|sphere| meet(sphere, origin, direction));
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
