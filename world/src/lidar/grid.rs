//! Rays in rows and columns, as spinning LiDARs and depth cameras cast them.
//!
//! A level spinning LiDAR looks the same in all directions: the phase of its columns is free, and
//! its rays are fixed in the frame `map`, like those of the lattice. All other grids turn with the
//! body ([`RayGrid::turns`]). For these the rays are turned scan by scan, which the tables of
//! culling do not allow, so all of them are cast.

use std::f64::consts::{FRAC_PI_2, TAU};
use std::sync::Arc;

use nalgebra::Vector3;
use protocol::field_of_view::FieldOfView;

use super::pattern::{Bundle, LANES, octant};

/// Rows and columns of rays about the heading, the first row highest, the first column leftmost.
#[derive(Debug, Clone, PartialEq)]
pub struct RayGrid {
    /// The rows, and how the rays are spread.
    pub projection: Projection,
    /// Rays of a row, at least 1.
    pub columns: u32,
    /// Full horizontal angle, radians; from 2 pi on the rows are rings.
    pub horizontal_rad: f64,
    /// By how much it looks up, radians; negative: down.
    pub pitch_rad: f64,
}

/// The rows of a grid, and how its rays are spread.
#[derive(Debug, Clone, PartialEq)]
pub enum Projection {
    /// At equal angles: each row at one elevation, from `lowest_rad` to `highest_rad` (radians,
    /// ends included), each ray in the middle of its column. A single row is halfway.
    Spherical {
        /// Elevation of the last row, radians.
        lowest_rad: f64,
        /// Elevation of the first row, radians.
        highest_rad: f64,
        /// Number of rows, at least 1.
        rows: u32,
    },
    /// Each row at an elevation of its own, each ray in the middle of its column.
    Lines(Elevations),
    /// Through the centres of the pixels of a pinhole camera.
    Pinhole {
        /// Full vertical angle at the middle column, radians.
        vertical_rad: f64,
        /// Number of rows, at least 1.
        rows: u32,
    },
}

/// The elevations of the lines of a spinning LiDAR, radians: at least one, from the highest to the
/// lowest.
#[derive(Debug, Clone, PartialEq)]
pub struct Elevations(Arc<[f64]>);

impl Elevations {
    /// Of elevations in any order, radians; `None` if there are none or one is no number.
    #[must_use]
    pub fn new(mut elevations_rad: Vec<f64>) -> Option<Self> {
        elevations_rad.sort_by(|one, other| other.total_cmp(one));
        let are_some = !elevations_rad.is_empty() && elevations_rad.iter().all(|elevation| elevation.is_finite());
        are_some.then(|| Self(elevations_rad.into()))
    }

    /// The lowest and the highest one.
    fn band_rad(&self) -> [f64; 2] {
        [self.0[self.0.len() - 1], self.0[0]]
    }

    /// The greatest angle between neighbours; 0 for a single line.
    fn gap_max_rad(&self) -> f64 {
        self.0.windows(2).map(|pair| pair[0] - pair[1]).fold(0.0, f64::max)
    }

    /// The number of the line closest to an elevation, the upper of two.
    fn closest(&self, elevation_rad: f64) -> u32 {
        let above = self.0.partition_point(|&line| line > elevation_rad);
        let distance = |line: &usize| self.0.get(*line).map_or(f64::INFINITY, |at| (at - elevation_rad).abs());
        let upper = above.saturating_sub(1);
        let closest = if distance(&above) < distance(&upper) { above } else { upper };
        closest as u32
    }
}

/// A turn within which a tilted ring sees much the same, radians: it takes its front for all.
const TILTED_RING_RAD: f64 = FRAC_PI_2;

impl RayGrid {
    /// Whether its rays turn with the body: all but level rings.
    #[must_use]
    pub fn turns(&self) -> bool {
        let is_ring = !self.is_camera() && self.horizontal_rad >= TAU;
        !is_ring || self.pitch_rad != 0.0
    }

    /// Whether it is that of a camera, not of a spinning LiDAR.
    #[must_use]
    pub fn is_camera(&self) -> bool {
        matches!(self.projection, Projection::Pinhole { .. })
    }

    /// Number of its rows, at least 1.
    #[must_use]
    pub fn rows(&self) -> u32 {
        match &self.projection {
            Projection::Spherical { rows, .. } | Projection::Pinhole { rows, .. } => *rows,
            Projection::Lines(elevations) => elevations.0.len() as u32,
        }
    }

    /// Number of its rays.
    #[must_use]
    pub fn rays(&self) -> u32 {
        self.columns * self.rows()
    }

    /// The directions of its rays in the frame of the body, row by row; unit vectors.
    pub(super) fn directions(&self) -> Vec<Vector3<f64>> {
        let (sin, cos) = libm::sincos(self.pitch_rad);
        let rays = (0..self.rows()).flat_map(|row| (0..self.columns).map(move |column| (row, column)));
        rays.map(|(row, column)| {
            let level = self.level_direction(row, column);
            Vector3::new(cos * level.x - sin * level.z, level.y, sin * level.x + cos * level.z)
        })
        .collect()
    }

    /// The direction of a ray without the pitch.
    fn level_direction(&self, row: u32, column: u32) -> Vector3<f64> {
        // From 1 at the first to -1 at the last, at the middle of each.
        let middle = |at: u32, count: u32| 1.0 - (2.0 * f64::from(at) + 1.0) / f64::from(count);
        if let Projection::Pinhole { vertical_rad, rows } = self.projection {
            let left = libm::tan(self.horizontal_rad / 2.0) * middle(column, self.columns);
            let up = libm::tan(vertical_rad / 2.0) * middle(row, rows);
            return Vector3::new(1.0, left, up).normalize();
        }
        let elevation_rad = self.elevation_rad(row).unwrap_or_default();
        let azimuth_rad = self.horizontal_rad.min(TAU) / 2.0 * middle(column, self.columns);
        let (up, ahead) = libm::sincos(elevation_rad);
        let (left, forward) = libm::sincos(azimuth_rad);
        Vector3::new(ahead * forward, ahead * left, up)
    }

    /// The elevation of a line of a spinning LiDAR, radians; `None` for a camera.
    fn elevation_rad(&self, row: u32) -> Option<f64> {
        match &self.projection {
            Projection::Spherical { lowest_rad, highest_rad, rows } => {
                let below = match rows {
                    1 => 0.5,
                    rows => f64::from(row) / f64::from(rows - 1),
                };
                Some(highest_rad - below * (highest_rad - lowest_rad))
            }
            Projection::Lines(elevations) => elevations.0.get(row as usize).copied(),
            Projection::Pinhole { .. } => None,
        }
    }

    /// The row and the column of a ray by its direction in the frame of the body. Rows that lie on
    /// each other count as the first of them.
    pub(super) fn place_of(&self, direction: &Vector3<f64>) -> [u32; 2] {
        let (sin, cos) = libm::sincos(self.pitch_rad);
        let (ahead, left, up) =
            (cos * direction.x + sin * direction.z, direction.y, cos * direction.z - sin * direction.x);
        // The number of that of `count` places which has this at its middle, from 1 to -1.
        let numbered = |middle: f64, count: u32| (1.0 - middle) * f64::from(count) / 2.0 - 0.5;
        let elevation_rad = || libm::atan2(up, libm::hypot(ahead, left));
        let around = || numbered(libm::atan2(left, ahead) / (self.horizontal_rad.min(TAU) / 2.0), self.columns);
        let (row, column) = match &self.projection {
            Projection::Spherical { lowest_rad, highest_rad, rows } => {
                let below_rad = highest_rad - elevation_rad();
                let span_rad = highest_rad - lowest_rad;
                let row = if span_rad > 0.0 { below_rad / span_rad * f64::from(rows - 1) } else { 0.0 };
                (row, around())
            }
            Projection::Lines(elevations) => (f64::from(elevations.closest(elevation_rad())), around()),
            Projection::Pinhole { vertical_rad, rows } => (
                numbered(up / ahead / libm::tan(vertical_rad / 2.0), *rows),
                numbered(left / ahead / libm::tan(self.horizontal_rad / 2.0), self.columns),
            ),
        };
        let whole = |number: f64, count: u32| libm::round(number).clamp(0.0, f64::from(count - 1)) as u32;
        [whole(row, self.rows()), whole(column, self.columns)]
    }

    /// The row of a spinning LiDAR that is closest to the plane of the sensor, the upper of two, as
    /// a grid of its own, and its elevation, radians; `None` for a camera.
    pub(super) fn middle_row(&self) -> Option<(Self, f64)> {
        let lines = (0..self.rows()).map_while(|row| self.elevation_rad(row));
        // Rounding must not choose between two that are as close.
        let elevation_rad = lines.min_by_key(|elevation_rad| libm::round(elevation_rad.abs() * 1e9) as u64)?;
        let projection = Projection::Spherical { lowest_rad: elevation_rad, highest_rad: elevation_rad, rows: 1 };
        Some((Self { projection, ..*self }, elevation_rad))
    }

    /// The greatest angle between neighbouring rays, radians, across the columns and the rows.
    fn spacing_rad(&self) -> [f64; 2] {
        let of_row = self.horizontal_rad.min(TAU);
        let apart = |angle_rad: f64, count: u32| 2.0 * libm::tan(angle_rad / 2.0) / f64::from(count);
        let around = of_row / f64::from(self.columns);
        match &self.projection {
            Projection::Spherical { lowest_rad, highest_rad, rows } => {
                let gaps = f64::from(rows.saturating_sub(1).max(1));
                [around, (highest_rad - lowest_rad) / gaps]
            }
            Projection::Lines(elevations) => [around, elevations.gap_max_rad()],
            Projection::Pinhole { vertical_rad, rows } => [apart(of_row, self.columns), apart(*vertical_rad, *rows)],
        }
    }

    /// What it sees of its surroundings, if walls up to a distance (metres) are not seen.
    pub(super) fn field_of_view(&self, min_range_m: f64) -> FieldOfView {
        let horizontal_rad = self.horizontal_rad;
        let [lowest_rad, highest_rad] = match &self.projection {
            Projection::Spherical { lowest_rad, highest_rad, .. } => [*lowest_rad, *highest_rad],
            Projection::Lines(elevations) => elevations.band_rad(),
            Projection::Pinhole { vertical_rad, .. } => [-vertical_rad / 2.0, vertical_rad / 2.0],
        };
        let is_tilted_ring = self.turns() && horizontal_rad >= TAU;
        let [across, along] = self.spacing_rad();
        FieldOfView {
            horizontal_rad: if is_tilted_ring { TILTED_RING_RAD } else { horizontal_rad.min(TAU) },
            lowest_rad: (lowest_rad + self.pitch_rad).max(-FRAC_PI_2),
            highest_rad: (highest_rad + self.pitch_rad).min(FRAC_PI_2),
            spacing_rad: across.max(along),
            min_range_m,
        }
    }

    /// A level ring that sees what this grid sees from one place with all headings, but for rays
    /// that pass between its own.
    pub(super) fn swept(&self) -> Self {
        if !self.turns() {
            return self.clone();
        }
        let FieldOfView { lowest_rad, highest_rad, .. } = self.field_of_view(0.0);
        let spacing_rad = self.spacing_rad().map(|spacing| spacing.max(SWEPT_SPACING_MIN_RAD));
        Self {
            projection: Projection::Spherical {
                lowest_rad,
                highest_rad,
                rows: ((highest_rad - lowest_rad) / spacing_rad[1]).ceil() as u32 + 1,
            },
            columns: (TAU / spacing_rad[0]).ceil() as u32,
            horizontal_rad: TAU,
            pitch_rad: 0.0,
        }
    }
}

/// The spacing of the rays of a swept ring is no finer, radians: it bounds their number.
const SWEPT_SPACING_MIN_RAD: f64 = 0.01;

/// The rays of a grid that turns, in an order in which neighbours are close.
pub(super) struct TurningRays(Vec<Vector3<f64>>);

impl TurningRays {
    /// Sorts the rays of a grid, which are in the frame of the body.
    pub(super) fn new(directions: Vec<Vector3<f64>>) -> Self {
        let packed = Bundle::pack(directions);
        Self(packed.iter().flat_map(|bundle| bundle.lanes(None).map(|lane| bundle.direction(lane))).collect())
    }

    /// The rays at a heading, in bundles.
    pub(super) fn at(&self, yaw_rad: f64) -> Vec<Bundle> {
        let (sin, cos) = libm::sincos(yaw_rad);
        let mut bundles = Vec::with_capacity(self.0.len() / LANES + 8);
        // By octant, the rays that are in no bundle yet.
        let mut open: [Vec<Vector3<f64>>; 8] = Default::default();
        for direction in &self.0 {
            let [x, y, z] = <[f64; 3]>::from(*direction);
            let turned = Vector3::new(cos * x - sin * y, sin * x + cos * y, z);
            let [x, y, z] = octant(&turned).map(usize::from);
            let open = &mut open[x | y << 1 | z << 2];
            open.push(turned);
            if open.len() == LANES {
                bundles.push(Bundle::of(open));
                open.clear();
            }
        }
        bundles.extend(open.iter().filter(|open| !open.is_empty()).map(|open| Bundle::of(open)));
        bundles
    }
}
