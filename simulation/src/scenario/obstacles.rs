//! `[[obstacle]]`: obstacles that move on given paths, such as people and vehicles.
//!
//! Whether a path is clear of walls is checked where the map is known
//! ([`world::moving_obstacles::ObstacleModel::check_place`]).

use msgs::ids::Tick;
use nalgebra::{Point3, Vector3};
use serde::{Deserialize, Serialize};

use super::{Checker, Scenario, ScenarioError};
use world::collision::Shape;
use world::moving_obstacles::{ObstacleModel, Repeat};

/// Most moving obstacles.
const OBSTACLES_MAX: usize = 1000;

/// Most points of a path.
const POINTS_MAX: usize = 100;

/// Least distance of two points that follow each other, metres.
const APART_M: f64 = 1e-3;

/// An entry of `[[obstacle]]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ObstacleEntry {
    /// Its shape.
    pub kind: ObstacleKind,
    /// Radius of a sphere, metres.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub radius_m: Option<f64>,
    /// Edges of a box, metres.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub size_m: Option<[f64; 3]>,
    /// Points that its centre goes through, metres, frame `map`.
    pub path: Vec<[f64; 3]>,
    /// Its speed, m/s.
    pub speed_m_s: f64,
    /// What follows the last point.
    #[serde(default)]
    pub repeat: Repeat,
    /// Sim time at which it begins to move, s.
    #[serde(default)]
    pub start_s: f64,
}

/// The shape of a moving obstacle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ObstacleKind {
    /// A sphere.
    Sphere,
    /// A box along the axes of the map.
    Box,
}

impl ObstacleEntry {
    fn shape(&self) -> Option<Shape> {
        match (self.kind, self.radius_m, self.size_m) {
            (ObstacleKind::Sphere, Some(radius_m), None) => Some(Shape::Sphere { radius_m }),
            (ObstacleKind::Box, None, Some(size_m)) => Some(Shape::Box { half_m: Vector3::from(size_m) / 2.0 }),
            _ => None,
        }
    }

    fn model(&self) -> Option<ObstacleModel> {
        Some(ObstacleModel {
            shape: self.shape()?,
            path: self.path.iter().copied().map(Point3::from).collect(),
            speed_m_s: self.speed_m_s,
            repeat: self.repeat,
            start: Tick(libm::ceil(self.start_s / Tick::TICK_S - 1e-6) as u64),
        })
    }
}

impl Scenario {
    /// The moving obstacles, by number; a checked scenario has all of them.
    #[must_use]
    pub fn obstacle_models(&self) -> Vec<ObstacleModel> {
        self.obstacle.iter().filter_map(ObstacleEntry::model).collect()
    }

    pub(super) fn check_obstacles(&self, checker: &Checker<'_>) -> Result<(), ScenarioError> {
        let count = self.obstacle.len();
        let allowed = format!("expected at most {OBSTACLES_MAX}");
        checker.require("obstacle", format!("{count} entries"), count <= OBSTACLES_MAX, &allowed)?;
        for (number, entry) in self.obstacle.iter().enumerate() {
            self.check_obstacle(number, entry, checker)?;
        }
        Ok(())
    }

    fn check_obstacle(&self, number: usize, entry: &ObstacleEntry, checker: &Checker<'_>) -> Result<(), ScenarioError> {
        let of = |name: &str| format!("obstacle[{number}].{name}");
        let ObstacleEntry { kind, radius_m, size_m, path, speed_m_s, repeat, .. } = entry;
        if entry.shape().is_none() {
            let (key, allowed) = match kind {
                ObstacleKind::Sphere => ("radius_m", "expected radius_m, and no size_m, for kind = \"sphere\""),
                ObstacleKind::Box => ("size_m", "expected size_m, and no radius_m, for kind = \"box\""),
            };
            let given = match kind {
                ObstacleKind::Sphere => radius_m.map_or("nothing".to_owned(), |value| value.to_string()),
                ObstacleKind::Box => size_m.map_or("nothing".to_owned(), |value| format!("{value:?}")),
            };
            return Err(checker.error_from(&format!("obstacle[{number}]"), &of(key), given, allowed));
        }
        if let Some(size_m) = size_m {
            let is_size = size_m.iter().all(|edge| (1e-3..=1e6).contains(edge));
            checker.require(&of("size_m"), format!("{size_m:?}"), is_size, "expected three lengths, 0.001 to 1e6 m")?;
        }
        let points = format!("{} points", path.len());
        let allowed = format!("expected 2 to {POINTS_MAX} points");
        checker.require(&of("path"), points, (2..=POINTS_MAX).contains(&path.len()), &allowed)?;
        for point in path {
            let is_finite = point.iter().all(|along| along.is_finite());
            checker.require(&of("path"), format!("{point:?}"), is_finite, "expected finite numbers")?;
        }
        let closing = (*repeat == Repeat::Loop).then_some(&path[0]);
        for (from, to) in path.iter().zip(path.iter().skip(1).chain(closing)) {
            let is_apart = (Point3::from(*from) - Point3::from(*to)).norm() >= APART_M;
            let allowed = format!("expected points at least {APART_M} m apart, from each to the next");
            checker.require(&of("path"), format!("{to:?}"), is_apart, &allowed)?;
        }
        let Some(cell_m) = self.map.cell_m else { return Ok(()) };
        let allowed =
            format!("expected at most one cell in a tick: 50 cells in a second, here {} m/s", cell_m / Tick::TICK_S);
        checker.require(&of("speed_m_s"), speed_m_s, speed_m_s * Tick::TICK_S <= cell_m, &allowed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(obstacle: &str) -> Result<Scenario, String> {
        let text = format!(
            "seed = 1\nduration_s = 1.0\nmap = {{ kind = \"spheres\", size = 20 }}\nagents = {{ count = 2 }}\n{obstacle}"
        );
        Scenario::parse("s.toml", &text, &[]).map_err(|error| error.to_string())
    }

    fn with(keys: &str) -> String {
        format!("[[obstacle]]\npath = [[2.0, 2.0, 2.0], [4.0, 2.0, 2.0]]\n{keys}")
    }

    #[test]
    fn identity_names_obstacles_only_if_there_are_any() {
        assert!(!parse("").unwrap().identity().contains("obstacle"));
        let with = parse(&with("kind = \"box\"\nsize_m = [1.0, 2.0, 3.0]\nspeed_m_s = 1.0\nstart_s = 2.0")).unwrap();
        assert_eq!(Scenario::parse("identity", &with.identity(), &[]).unwrap(), with);
        let [model] = &with.obstacle_models()[..] else { panic!("one obstacle") };
        assert_eq!((model.shape, model.start), (Shape::Box { half_m: Vector3::new(0.5, 1.0, 1.5) }, Tick(100)));
        assert_eq!((model.repeat, model.path.len()), (Repeat::ToAndFro, 2));
    }

    #[test]
    fn impossible_obstacles_are_named() {
        let refused = |keys: &str| parse(&with(keys)).unwrap_err();
        let sphere = |keys: &str| refused(&format!("kind = \"sphere\"\n{keys}"));
        assert!(
            sphere("radius_m = 1.0\nspeed_m_s = 0.0").contains("obstacle[0].speed_m_s = 0: expected a number above 0")
        );
        assert!(sphere("radius_m = 1.0\nspeed_m_s = 50.1").contains("at most one cell in a tick"));
        assert!(sphere("speed_m_s = 1.0").contains("obstacle[0].radius_m = nothing: expected radius_m, and no size_m"));
        assert!(refused("kind = \"box\"\nradius_m = 1.0\nspeed_m_s = 1.0").contains("obstacle[0].size_m = nothing"));
        let flat = refused("kind = \"box\"\nsize_m = [1.0, 0.0, 1.0]\nspeed_m_s = 1.0");
        assert!(flat.contains("obstacle[0].size_m = [1.0, 0.0, 1.0]: expected three lengths"), "{flat}");
        let of_path = |path: &str, more: &str| {
            let keys = format!("kind = \"sphere\"\nradius_m = 1.0\nspeed_m_s = 1.0\npath = {path}\n{more}");
            parse(&format!("[[obstacle]]\n{keys}")).unwrap_err()
        };
        assert!(of_path("[]", "").contains("obstacle[0].path = 0 points: expected 2 to 100 points"));
        assert!(of_path("[[1.0, 1.0, nan], [2.0, 1.0, 1.0]]", "").contains("expected finite numbers"));
        assert!(of_path("[[1.0, 1.0, 1.0], [1.0, 1.0, 1.0]]", "").contains("at least 0.001 m apart"));
        let closed = of_path("[[1.0, 1.0, 1.0], [2.0, 1.0, 1.0], [1.0, 1.0, 1.0]]", "repeat = \"loop\"");
        assert!(closed.contains("at least 0.001 m apart"), "{closed}");
    }
}
