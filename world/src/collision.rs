//! Swept-sphere collision of a body against the walls of the terrain and against other bodies.
//!
//! A motion with contact is refused as a whole. Contact means that the sphere would come nearer to
//! a wall cell or to another sphere than its radius *while approaching it*; a motion that leaves or
//! slides along a surface is free, so that rounding can never lock a body. The distance from a
//! moving point to a box is a convex function of time, which makes the test exact.
//!
//! Everything outside the map is wall.

mod solid;

use nalgebra::{Point3, Vector3};
use protocol::observation::Surface;
use voxels::{Cell, Extent, Grid, Terrain};

pub(super) use solid::Crossing;
pub use solid::{Shape, Solid};

/// Cosine of 45 degrees: a surface whose normal is closer to the vertical is a floor or a ceiling,
/// and one at 45 degrees a wall (as in MAES3D). The margin holds rounding off: bodies that start at
/// cell centres and rise at 45 degrees meet edges at exactly this angle.
const STEEP: f64 = std::f64::consts::FRAC_1_SQRT_2 + 1e-6;

/// A body that is farther away than this after a motion is not touched, whatever the rounding,
/// metres.
const FAR_M: f64 = 1e-3;

/// How much nearer than its radius a body may come to something, as a difference of squares, square
/// metres: a body that fits exactly, as one of 0.3 m does beside a wall at 0.3 m, slides along it
/// whatever the rounding of lengths that are no binary fractions.
const SLACK_M2: f64 = 1e-12;

/// The side of a body at which a surface with this unit normal (pointing towards the body) is.
#[must_use]
pub fn surface_of(normal: &Vector3<f64>) -> Surface {
    if normal.z > STEEP {
        Surface::Floor
    } else if normal.z < -STEEP {
        Surface::Ceiling
    } else {
        Surface::Wall
    }
}

/// The first contact of a motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Contact {
    /// Fraction of the motion before the contact, 0 ..= 1.
    pub time: f64,
    /// Unit normal of the surface at the point of contact, towards the body, frame `map`.
    pub normal: Vector3<f64>,
    /// Whether the obstacle moves: another body, or a moving obstacle.
    pub with_agent: bool,
}

/// The obstacles of one body.
pub struct Obstacles<'a> {
    /// `None` if nothing is in the way.
    terrain: Option<&'a Grid<Terrain>>,
    others: &'a [Sphere],
    itself: usize,
    solids: &'a [Solid],
}

/// The sphere that a body occupies.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sphere {
    /// Centre, metres, frame `map`.
    pub centre: Point3<f64>,
    /// Radius, metres.
    pub radius_m: f64,
}

impl<'a> Obstacles<'a> {
    /// The terrain and all bodies but the one at index `itself`.
    #[must_use]
    pub fn new(terrain: &'a Grid<Terrain>, bodies: &'a [Sphere], itself: usize) -> Self {
        Self { terrain: Some(terrain), others: bodies, itself, solids: &[] }
    }

    /// These obstacles, and solids that move.
    #[must_use]
    pub fn and(self, solids: &'a [Solid]) -> Self {
        Self { solids, ..self }
    }

    /// None at all.
    #[must_use]
    pub fn none() -> Self {
        Self { terrain: None, others: &[], itself: 0, solids: &[] }
    }

    /// The terrain, unless nothing is in the way.
    pub(super) fn terrain(&self) -> Option<&'a Grid<Terrain>> {
        self.terrain
    }

    /// The first contact of a sphere of `radius_m` that moves from `from` by `displacement`
    /// (metres, frame `map`). Of simultaneous contacts, walls win over bodies and lower cells over
    /// higher ones.
    #[must_use]
    pub fn first_contact(&self, from: &Point3<f64>, displacement: &Vector3<f64>, radius_m: f64) -> Option<Contact> {
        let terrain = self.terrain?;
        let mut first: Option<Contact> = None;
        let mut consider = |contact: Option<Contact>| {
            if let Some(contact) = contact
                && first.is_none_or(|known| contact.time < known.time)
            {
                first = Some(contact);
            }
        };
        let extent = terrain.extent();
        let to = from + displacement;
        let reach = Vector3::repeat(radius_m);
        let low = extent.cell_of(&(from.inf(&to) - reach));
        let high = extent.cell_of(&(from.sup(&to) + reach));
        for z in low.z..=high.z {
            for y in low.y..=high.y {
                for x in low.x..=high.x {
                    let cell = Cell::new(x, y, z);
                    if terrain.get(cell).is_none_or(|&terrain| terrain == Terrain::Wall) {
                        let corner = Point3::new(f64::from(x), f64::from(y), f64::from(z));
                        let edges_m = Vector3::repeat(extent.cell_m());
                        let cell = AlignedBox { low: corner * extent.cell_m(), edges_m };
                        consider(cell.first_contact(from, displacement, radius_m));
                    }
                }
            }
        }
        for (index, other) in self.others.iter().enumerate() {
            // Most bodies are too far away already along one axis.
            let reach_m = radius_m + other.radius_m + displacement.x.abs() + FAR_M;
            if (other.centre.x - from.x).abs() > reach_m {
                continue;
            }
            if index != self.itself && other.is_solid() {
                consider(other.first_contact(from, displacement, radius_m));
            }
        }
        for solid in self.solids {
            consider(solid.first_contact(from, displacement, radius_m));
        }
        first
    }

    /// Whether a sphere that moves between two centres has a contact.
    #[must_use]
    pub fn blocks(&self, from: &Point3<f64>, to: &Point3<f64>, radius_m: f64) -> bool {
        self.first_contact(from, &(to - from), radius_m).is_some()
    }
}

impl Sphere {
    /// Whether it is an obstacle: the sphere of a body that is not in the world has no radius.
    #[must_use]
    pub fn is_solid(&self) -> bool {
        self.radius_m > 0.0
    }

    fn first_contact(&self, from: &Point3<f64>, displacement: &Vector3<f64>, radius_m: f64) -> Option<Contact> {
        let apart = from - self.centre;
        let sum_m = radius_m + self.radius_m;
        let time = first_time_within(
            displacement.norm_squared(),
            apart.dot(displacement),
            apart.norm_squared(),
            sum_m * sum_m,
        )
        .filter(|&time| time <= 1.0)?;
        let normal = (apart + displacement * time).try_normalize(0.0)?;
        Some(Contact { time, normal, with_agent: true })
    }
}

/// Whether a sphere at rest is nearer to a cell than its radius, by more than rounding.
pub(super) fn is_touched(extent: Extent, cell: Cell, centre: &Point3<f64>, radius_m: f64) -> bool {
    let low = Point3::new(f64::from(cell.x), f64::from(cell.y), f64::from(cell.z)) * extent.cell_m();
    let nearest = centre.sup(&low).inf(&(low + Vector3::repeat(extent.cell_m())));
    (centre - nearest).norm_squared() < radius_m * radius_m - SLACK_M2
}

/// The first t >= 0 at which `a t^2 + 2 b t + c` falls below `limit` by more than rounding, `None`
/// if it does not decrease at 0.
fn first_time_within(a: f64, b: f64, c: f64, limit: f64) -> Option<f64> {
    let limit = limit - SLACK_M2;
    if b >= 0.0 {
        return None;
    }
    if c < limit {
        return Some(0.0);
    }
    let discriminant = b * b - a * (c - limit);
    // Touching without entering is not a contact.
    if discriminant <= 0.0 {
        return None;
    }
    Some((-b - discriminant.sqrt()) / a)
}

/// A wall cell, or a solid box along the axes.
struct AlignedBox {
    low: Point3<f64>,
    edges_m: Vector3<f64>,
}

impl AlignedBox {
    fn first_contact(&self, from: &Point3<f64>, displacement: &Vector3<f64>, radius_m: f64) -> Option<Contact> {
        let limit = radius_m * radius_m;
        // Between the times at which the centre crosses a face's plane, the distance to the slab of
        // each axis is linear in time.
        let mut times = [0.0; 8];
        let mut count = 1;
        for axis in 0..3 {
            for plane in [self.low[axis], self.low[axis] + self.edges_m[axis]] {
                let time = (plane - from[axis]) / displacement[axis];
                if time > 0.0 && time < 1.0 {
                    times[count] = time;
                    count += 1;
                }
            }
        }
        times[count] = 1.0;
        let times = &mut times[..=count];
        times.sort_by(f64::total_cmp);
        for window in times.windows(2) {
            let (start, end) = (window[0], window[1]);
            let middle = from + displacement * (0.5 * (start + end));
            let (mut a, mut b, mut c) = (0.0, 0.0, 0.0);
            for axis in 0..3 {
                let side = if middle[axis] < self.low[axis] {
                    self.low[axis]
                } else if middle[axis] > self.low[axis] + self.edges_m[axis] {
                    self.low[axis] + self.edges_m[axis]
                } else {
                    continue;
                };
                let offset = from[axis] + displacement[axis] * start - side;
                a += displacement[axis] * displacement[axis];
                b += displacement[axis] * offset;
                c += offset * offset;
            }
            if let Some(time) = first_time_within(a, b, c, limit)
                && start + time <= end
            {
                let time = start + time;
                return Some(Contact {
                    time,
                    normal: self.normal_at(&(from + displacement * time), displacement),
                    with_agent: false,
                });
            }
        }
        None
    }

    /// Unit vector from the nearest point of the box to `point`; against the motion if `point` is
    /// inside.
    fn normal_at(&self, point: &Point3<f64>, displacement: &Vector3<f64>) -> Vector3<f64> {
        let high = self.low + self.edges_m;
        let nearest = point.sup(&self.low).inf(&high);
        (point - nearest).try_normalize(0.0).or_else(|| (-displacement).try_normalize(0.0)).unwrap_or_else(Vector3::z)
    }
}

#[cfg(test)]
mod tests;
