//! The bodies placed so far, in a spatial hash that answers whether another one fits.

use nalgebra::Point3;
use voxels::{BodyLattice, Cell, Grid, Terrain};

use super::super::collision::Sphere;
use super::{Candidate, has_room_from_walls};

/// Largest number of buckets along an axis, which bounds their memory.
const BUCKETS_MAX: f64 = 64.0;

/// Bodies on a map in cubic buckets by their centres.
pub(super) struct PlacedBodies<'a> {
    terrain: &'a Grid<Terrain>,
    min_distance_m: f64,
    /// Edge of a bucket, metres; bodies that conflict are in the same or in adjacent buckets.
    bucket_m: f64,
    /// Number of buckets along each axis.
    counts: [usize; 3],
    buckets: Vec<Vec<Sphere>>,
}

impl<'a> PlacedBodies<'a> {
    /// No bodies yet. `radii_m` are the radii of all bodies that may be placed; the centres of any
    /// two stay at least `min_distance_m` apart.
    pub(super) fn new(terrain: &'a Grid<Terrain>, radii_m: &[f64], min_distance_m: f64) -> Self {
        let extent = terrain.extent();
        let lengths_m = extent.size().map(|cells| f64::from(cells) * extent.cell_m());
        let longest_m = lengths_m.into_iter().fold(0.0, f64::max);
        let reach_m = radii_m.iter().fold(0.0, |most: f64, &radius_m| most.max(2.0 * radius_m)).max(min_distance_m);
        let bucket_m = reach_m.max(longest_m / BUCKETS_MAX);
        let counts = lengths_m.map(|length_m| (length_m / bucket_m) as usize + 1);
        let buckets = vec![Vec::new(); counts.iter().product()];
        Self { terrain, min_distance_m, bucket_m, counts, buckets }
    }

    /// Places a body at the place of a cell and returns the position, if it fits, and stands there
    /// if it has to.
    pub(super) fn place(&mut self, cell: Cell, body: &Candidate) -> Option<Point3<f64>> {
        let radius_m = body.radius_m;
        let stands = || body.footing.as_ref().is_none_or(|footing| footing.stands(self.terrain, cell));
        if !self.has_room(cell, radius_m) || !stands() {
            return None;
        }
        let centre = self.place_of(cell, radius_m);
        let [x, y, z] = self.bucket_of(&centre);
        let bucket = self.index(x, y, z);
        self.buckets[bucket].push(Sphere { centre, radius_m });
        Some(centre)
    }

    /// Where a body is in a cell.
    fn place_of(&self, cell: Cell, radius_m: f64) -> Point3<f64> {
        let extent = self.terrain.extent();
        BodyLattice::of(radius_m, extent.cell_m()).place(extent, cell)
    }

    /// Whether a body fits at the place of a cell.
    pub(super) fn has_room(&self, cell: Cell, radius_m: f64) -> bool {
        let centre = self.place_of(cell, radius_m);
        self.terrain.get(cell) == Some(&Terrain::Free)
            && !self.conflicts(&centre, radius_m)
            && has_room_from_walls(self.terrain, &centre, radius_m)
    }

    /// The bodies placed so far, each with how far the centre of one of another radius stays from
    /// its own, metres.
    pub(super) fn apart_from(&self, radius_m: f64) -> impl Iterator<Item = (Point3<f64>, f64)> + '_ {
        let bodies = self.buckets.iter().flatten();
        bodies.map(move |other| (other.centre, self.min_distance_m.max(radius_m + other.radius_m)))
    }

    fn conflicts(&self, centre: &Point3<f64>, radius_m: f64) -> bool {
        let near = |other: &Sphere| (other.centre - centre).norm() < self.min_distance_m.max(radius_m + other.radius_m);
        let home = self.bucket_of(centre);
        // Most conflicts are with a body of the same bucket.
        if self.buckets[self.index(home[0], home[1], home[2])].iter().any(near) {
            return true;
        }
        let [x, y, z] =
            [0, 1, 2].map(|axis| home[axis].saturating_sub(1)..=(home[axis] + 1).min(self.counts[axis] - 1));
        z.into_iter().any(|z| y.clone().any(|y| x.clone().any(|x| self.buckets[self.index(x, y, z)].iter().any(near))))
    }

    fn bucket_of(&self, point: &Point3<f64>) -> [usize; 3] {
        [point.x, point.y, point.z].map(|along_m| (along_m / self.bucket_m) as usize)
    }

    fn index(&self, x: usize, y: usize, z: usize) -> usize {
        (z * self.counts[1] + y) * self.counts[0] + x
    }
}
