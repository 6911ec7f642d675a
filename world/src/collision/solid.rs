//! Solids that bodies collide with beside the terrain and each other: spheres and boxes along the
//! axes.

use nalgebra::{Point3, Vector3};
use voxels::{Cell, Extent, Grid, Terrain};

use super::{AlignedBox, Contact, Obstacles, SLACK_M2, Sphere};

/// How deep a box may reach into a wall cell before it touches it, metres: rounding.
const SLACK_M: f64 = 1e-6;

/// Where a line crosses a box along the axes, in lengths of its direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Crossing {
    pub(crate) enters: f64,
    pub(crate) leaves: f64,
    /// The axis of the side at which it enters.
    pub(crate) axis: usize,
}

impl Crossing {
    /// Where a line crosses a box with this centre and half of its edges (metres); `None` if the
    /// line misses it.
    pub(crate) fn of(
        centre: &Point3<f64>,
        half_m: &Vector3<f64>,
        origin: &Point3<f64>,
        direction: &Vector3<f64>,
    ) -> Option<Self> {
        let mut crossing = Self { enters: f64::NEG_INFINITY, leaves: f64::INFINITY, axis: 0 };
        for axis in 0..3 {
            let offset = centre[axis] - origin[axis];
            if direction[axis] == 0.0 {
                if offset.abs() >= half_m[axis] {
                    return None;
                }
                continue;
            }
            let (one, other) = ((offset - half_m[axis]) / direction[axis], (offset + half_m[axis]) / direction[axis]);
            if one.min(other) > crossing.enters {
                (crossing.enters, crossing.axis) = (one.min(other), axis);
            }
            crossing.leaves = crossing.leaves.min(one.max(other));
        }
        (crossing.enters < crossing.leaves).then_some(crossing)
    }
}

/// The shape of a solid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Shape {
    /// A sphere.
    Sphere {
        /// Its radius, metres.
        radius_m: f64,
    },
    /// A box along the axes of the map.
    Box {
        /// Half of its edges, metres.
        half_m: Vector3<f64>,
    },
}

/// A shape at a place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Solid {
    /// Centre, metres, frame `map`.
    pub centre: Point3<f64>,
    /// Its shape.
    pub shape: Shape,
}

impl Shape {
    /// Half of the edges of the box around it, metres.
    #[must_use]
    pub fn half_m(&self) -> Vector3<f64> {
        match *self {
            Self::Sphere { radius_m } => Vector3::repeat(radius_m),
            Self::Box { half_m } => half_m,
        }
    }
}

impl Solid {
    /// The first contact of a sphere of `radius_m` that moves from `from` by `displacement`
    /// (metres, frame `map`).
    #[must_use]
    pub fn first_contact(&self, from: &Point3<f64>, displacement: &Vector3<f64>, radius_m: f64) -> Option<Contact> {
        match self.shape {
            Shape::Sphere { radius_m: own_m } => {
                Sphere { centre: self.centre, radius_m: own_m }.first_contact(from, displacement, radius_m)
            }
            Shape::Box { half_m } => {
                let solid = AlignedBox { low: self.centre - half_m, edges_m: half_m * 2.0 };
                let contact = solid.first_contact(from, displacement, radius_m)?;
                Some(Contact { with_agent: true, ..contact })
            }
        }
    }

    /// Distance of a point from its surface, metres; 0 inside.
    #[must_use]
    pub fn distance_m(&self, point: &Point3<f64>) -> f64 {
        let offset = point - self.centre;
        match self.shape {
            Shape::Sphere { radius_m } => (offset.norm() - radius_m).max(0.0),
            Shape::Box { half_m } => (offset.abs() - half_m).sup(&Vector3::zeros()).norm(),
        }
    }

    /// Whether a sphere overlaps it by more than rounding.
    #[must_use]
    pub fn overlaps(&self, sphere: &Sphere) -> bool {
        let distance_m = self.distance_m(&sphere.centre);
        distance_m * distance_m < sphere.radius_m * sphere.radius_m - SLACK_M2
    }

    /// Whether it reaches into one of these cells.
    pub(crate) fn is_in(&self, extent: Extent, is_meant: impl Fn(Cell) -> bool) -> bool {
        let half_m = self.shape.half_m() - Vector3::repeat(SLACK_M);
        let (low, high) = (extent.cell_of(&(self.centre - half_m)), extent.cell_of(&(self.centre + half_m)));
        let is_reached = |cell: Cell| match self.shape {
            Shape::Box { .. } => true,
            Shape::Sphere { radius_m } => super::is_touched(extent, cell, &self.centre, radius_m),
        };
        is_any_between(low, high, |cell| is_meant(cell) && is_reached(cell))
    }

    /// Whether it reaches into a wall, or out of the map.
    #[must_use]
    pub fn is_in_wall(&self, terrain: &Grid<Terrain>) -> bool {
        let extent = terrain.extent();
        // First, so that the cells of a solid beyond all measure are not counted through.
        self.leaves_map(extent) || self.is_in(extent, |cell| terrain.get(cell) != Some(&Terrain::Free))
    }

    /// Whether it reaches out of the map. It does where the box around it does.
    fn leaves_map(&self, extent: Extent) -> bool {
        let half_m = self.shape.half_m() - Vector3::repeat(SLACK_M);
        let corners = [self.centre - half_m, self.centre + half_m];
        !corners.iter().all(|corner| extent.contains(extent.cell_of(corner)))
    }

    /// Whether it meets a wall or the end of the map on a straight way to `to`, or is in one at its
    /// start; the way is looked at in steps of at most a cell.
    #[must_use]
    pub fn meets_wall(&self, terrain: &Grid<Terrain>, to: &Point3<f64>) -> bool {
        if self.is_in_wall(terrain) || (Self { centre: *to, ..*self }).leaves_map(terrain.extent()) {
            return true;
        }
        let offset = to - self.centre;
        let steps = libm::ceil(offset.norm() / terrain.extent().cell_m()).max(1.0);
        let step = offset / steps;
        (0..steps as u64).any(|number| {
            let here = Self { centre: self.centre + step * number as f64, ..*self };
            here.sweeps_wall(terrain, &step)
        })
    }

    fn sweeps_wall(&self, terrain: &Grid<Terrain>, step: &Vector3<f64>) -> bool {
        let half_m = match self.shape {
            Shape::Sphere { radius_m } => {
                return Obstacles::new(terrain, &[], 0).first_contact(&self.centre, step, radius_m).is_some();
            }
            Shape::Box { half_m } => half_m,
        };
        let (extent, to) = (terrain.extent(), self.centre + step);
        let cell_half = Vector3::repeat(extent.cell_m() / 2.0);
        let reach = half_m + cell_half - Vector3::repeat(SLACK_M);
        let low = extent.cell_of(&(self.centre.inf(&to) - half_m));
        let high = extent.cell_of(&(self.centre.sup(&to) + half_m));
        let is_met = |cell: Cell| {
            let corner = Point3::new(f64::from(cell.x), f64::from(cell.y), f64::from(cell.z)) * extent.cell_m();
            let crossing = Crossing::of(&(corner + cell_half), &reach, &self.centre, step);
            crossing.is_some_and(|crossing| crossing.enters <= 1.0 && crossing.leaves >= 0.0)
        };
        is_any_between(low, high, |cell| terrain.get(cell) != Some(&Terrain::Free) && is_met(cell))
    }
}

/// Whether one of the cells of a box, both corners included, is meant.
fn is_any_between(low: Cell, high: Cell, is_meant: impl Fn(Cell) -> bool) -> bool {
    (low.z..=high.z).any(|z| (low.y..=high.y).any(|y| (low.x..=high.x).any(|x| is_meant(Cell::new(x, y, z)))))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn boxed(x: f64, y: f64, z: f64) -> Solid {
        Solid { centre: Point3::new(5.0, 5.0, 5.0), shape: Shape::Box { half_m: Vector3::new(x, y, z) } }
    }

    #[test]
    fn distances_are_from_the_surface() {
        let solid = boxed(1.0, 2.0, 3.0);
        assert_eq!(solid.distance_m(&Point3::new(8.0, 5.0, 5.0)), 2.0);
        assert_eq!(solid.distance_m(&Point3::new(9.0, 11.0, 5.0)), 5.0);
        assert_eq!(solid.distance_m(&Point3::new(5.5, 6.5, 7.5)), 0.0);
        let sphere = Solid { shape: Shape::Sphere { radius_m: 1.0 }, ..solid };
        assert_eq!(sphere.distance_m(&Point3::new(5.0, 8.0, 5.0)), 2.0);
        assert!(sphere.overlaps(&Sphere { centre: Point3::new(5.0, 6.9, 5.0), radius_m: 1.0 }));
        assert!(!sphere.overlaps(&Sphere { centre: Point3::new(5.0, 7.0, 5.0), radius_m: 1.0 }));
    }

    #[test]
    fn contact_with_a_box_comes_where_the_sphere_touches_it() {
        let solid = boxed(1.0, 2.0, 3.0);
        let along = Vector3::new(10.0, 0.0, 0.0);
        let contact = solid.first_contact(&Point3::new(0.0, 5.0, 5.0), &along, 0.5).unwrap();
        assert!((contact.time - 0.35).abs() < 1e-9 && contact.with_agent, "{contact:?}");
        assert!((contact.normal - Vector3::new(-1.0, 0.0, 0.0)).norm() < 1e-9);
        assert_eq!(solid.first_contact(&Point3::new(0.0, 7.6, 5.0), &along, 0.5), None);
        // Away from it, whatever the distance.
        assert_eq!(solid.first_contact(&Point3::new(6.2, 5.0, 5.0), &along, 0.5), None);
    }

    #[test]
    fn solids_and_ways_beyond_all_measure_are_out_of_the_map() {
        let terrain = Grid::new(Extent::new([7, 5, 3], 1.0).unwrap(), Terrain::Free);
        let ball = |radius_m| Solid { centre: Point3::new(3.5, 2.5, 1.5), shape: Shape::Sphere { radius_m } };
        assert!(!ball(1.5).is_in_wall(&terrain) && ball(1.51).is_in_wall(&terrain) && ball(1e6).is_in_wall(&terrain));
        // The square of this distance is no number.
        assert!(ball(0.5).meets_wall(&terrain, &Point3::new(1e200, 2.5, 1.5)));
    }

    #[test]
    fn walls_on_the_way_are_met() {
        let layer = "#######\n#.....#\n#.....#\n#..#..#\n#######\n";
        let terrain =
            Grid::from_text(&["#######\n".repeat(5).as_str(), layer, "#######\n".repeat(5).as_str()].join("\n"));
        let terrain = terrain.unwrap();
        let at = |x, y, shape| Solid { centre: Point3::new(x, y, 1.5), shape };
        let (ball, cube) = (Shape::Sphere { radius_m: 0.5 }, Shape::Box { half_m: Vector3::repeat(0.5) });
        for shape in [ball, cube] {
            let low = at(1.5, 1.5, shape);
            assert!(low.meets_wall(&terrain, &Point3::new(5.5, 1.5, 1.5)), "{shape:?}");
            let high = at(1.5, 2.5, shape);
            assert!(!high.meets_wall(&terrain, &Point3::new(5.5, 2.5, 1.5)), "{shape:?}");
            assert!(high.meets_wall(&terrain, &Point3::new(9.5, 2.5, 1.5)), "{shape:?}, out of the map");
            assert!(at(3.5, 1.5, shape).is_in_wall(&terrain) && !high.is_in_wall(&terrain), "{shape:?}");
        }
    }
}
