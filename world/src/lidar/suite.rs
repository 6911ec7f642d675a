//! The LiDARs of a body. They scan in the same ticks, and their agent gets what they see together.
//!
//! They share one memory: a cell is new if none of them has seen it before.

use std::sync::Arc;

use msgs::sensor_name::SensorName;
use protocol::field_of_view::FieldOfView;

use super::Scanner;
use crate::body::Pose;

/// One or more LiDARs. Suites are equal if their LiDARs are, whatever their names.
#[derive(Debug, Clone)]
pub struct SensorSuite(Arc<[NamedScanner]>);

/// One of the LiDARs of a body.
#[derive(Debug, Clone)]
pub struct NamedScanner {
    /// Its name; the only LiDAR of a body need not have one.
    pub name: Option<SensorName>,
    /// The LiDAR.
    pub scanner: Scanner,
}

impl PartialEq for SensorSuite {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0) || self.scanners().eq(other.scanners())
    }
}

impl From<Scanner> for SensorSuite {
    fn from(scanner: Scanner) -> Self {
        Self(Arc::new([NamedScanner { name: None, scanner }]))
    }
}

impl SensorSuite {
    /// These LiDARs; `None` without any.
    #[must_use]
    pub fn new(lidars: Vec<NamedScanner>) -> Option<Self> {
        (!lidars.is_empty()).then(|| Self(lidars.into()))
    }

    /// The LiDARs, in their order.
    #[must_use]
    pub fn lidars(&self) -> &[NamedScanner] {
        &self.0
    }

    /// The same without names.
    pub fn scanners(&self) -> impl Iterator<Item = &Scanner> {
        self.0.iter().map(|lidar| &lidar.scanner)
    }

    /// The same suite, with LiDARs that are changed.
    #[must_use]
    pub(crate) fn map(&self, change: impl Fn(&Scanner) -> Scanner) -> Self {
        let changed = |lidar: &NamedScanner| NamedScanner { name: lidar.name, scanner: change(&lidar.scanner) };
        Self(self.0.iter().map(changed).collect())
    }

    /// Number of rays of one scan of all of them.
    #[must_use]
    pub fn rays(&self) -> u32 {
        self.scanners().map(Scanner::rays).sum()
    }

    /// Whether their scans do not depend on the heading.
    #[must_use]
    pub fn sees_all_around(&self) -> bool {
        self.scanners().all(Scanner::sees_all_around)
    }

    /// Whether rays of any end at something that moves.
    pub(crate) fn meets_bodies(&self) -> bool {
        self.scanners().any(Scanner::meets_bodies)
    }

    /// Whether rays of any end at the bodies of others.
    pub(crate) fn sees_agents(&self) -> bool {
        self.scanners().any(Scanner::sees_agents)
    }

    /// Whether scans from two poses see the same.
    pub(crate) fn sees_the_same(&self, a: &Pose, b: &Pose) -> bool {
        self.scanners().all(|scanner| scanner.sees_the_same(a, b))
    }

    /// The greatest length of a ray, metres, with cells of this length.
    #[must_use]
    pub fn greatest_range_m(&self, cell_m: f64) -> f64 {
        self.scanners().map(|scanner| scanner.greatest_range_m(cell_m)).fold(0.0, f64::max)
    }

    /// What they see of their surroundings together; `None` if one of them is a lattice or a shell.
    #[must_use]
    pub fn field_of_view(&self) -> Option<FieldOfView> {
        let views: Option<Vec<FieldOfView>> = self.scanners().map(Scanner::field_of_view).collect();
        FieldOfView::together(&views?)
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;
    use crate::lidar::{Pattern, Projection, RayGrid};

    fn camera(pitch_rad: f64) -> Scanner {
        let projection = Projection::Pinhole { vertical_rad: 1.0, rows: 6 };
        let grid = RayGrid { projection, columns: 8, horizontal_rad: 1.4, pitch_rad };
        Scanner::new(Pattern::Grid(grid), 4.5, TAU)
    }

    fn lattice() -> Scanner {
        Scanner::new(Pattern::Lattice { rays: 100 }, 20.0, TAU)
    }

    fn suite(scanners: &[Scanner]) -> SensorSuite {
        let named = |scanner: &Scanner| NamedScanner { name: None, scanner: scanner.clone() };
        SensorSuite::new(scanners.iter().map(named).collect()).unwrap()
    }

    #[test]
    fn suite_is_the_union_of_its_lidars() {
        let both = suite(&[lattice(), camera(0.2).seeing_agents(true)]);
        assert_eq!((both.rays(), both.greatest_range_m(1.0), both.field_of_view()), (148, 20.0, None));
        assert!(!both.sees_all_around() && both.sees_agents() && both.meets_bodies());
        let cameras = suite(&[camera(0.4), camera(-0.4)]).field_of_view().unwrap();
        assert!((cameras.lowest_rad + 0.9).abs() < 1e-12 && (cameras.highest_rad - 0.9).abs() < 1e-12, "{cameras:?}");
        assert!(SensorSuite::new(Vec::new()).is_none());
    }

    #[test]
    fn suite_of_one_sees_what_it_sees() {
        let alone = SensorSuite::from(camera(0.2));
        assert_eq!(alone.field_of_view(), camera(0.2).field_of_view());
        assert!(alone == SensorSuite::from(camera(0.2)) && alone != SensorSuite::from(camera(0.3)));
    }
}
