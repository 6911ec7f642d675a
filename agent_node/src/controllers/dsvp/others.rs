//! The bodies of the agents in contact, as obstacles.
//!
//! They move on, so only those nearby count. This module knows nothing of their plans.

use nalgebra::Point3;
use voxels::{Cell, Extent};

use crate::command::Motion;
use crate::observation::Contact;

/// Distance between the centres of two bodies below which a way is blocked, in body radii: they touch at 2.
const BERTH_RADII: f64 = 2.05;

/// Bodies farther away than this will have moved on before one gets there, in body radii.
const NEAR_RADII: f64 = 12.0;

/// Bodies that are in the way.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::controllers) struct Others {
    extent: Extent,
    near: Vec<Point3<f64>>,
    berth_m: f64,
}

impl Others {
    /// Those near to a body of some radius at `here`; metres, frame `map`.
    pub(in crate::controllers) fn near(
        contacts: &[Contact],
        here: &Point3<f64>,
        radius_m: f64,
        extent: Extent,
    ) -> Self {
        let is_near = |at: &Point3<f64>| (at - here).norm() < NEAR_RADII * radius_m;
        let near = contacts.iter().map(|contact| contact.position).filter(is_near).collect();
        Self { extent, near, berth_m: BERTH_RADII * radius_m }
    }

    /// Whether a body at the centre of a cell would be in touch with one of them, or nearly.
    pub(in crate::controllers) fn take(&self, cell: Cell) -> bool {
        !self.near.is_empty() && {
            let centre = self.extent.centre(cell);
            self.near.iter().any(|other| (other - centre).norm() < self.berth_m)
        }
    }

    /// Whether a body that moves straight would come too near to one of them. Where it starts does not count, as long as it does
    /// not come nearer still.
    pub(in crate::controllers) fn block(&self, from: &Point3<f64>, to: &Point3<f64>) -> bool {
        let by = to - from;
        let length_squared = by.norm_squared();
        self.near.iter().any(|other| {
            let share =
                if length_squared > 0.0 { ((other - from).dot(&by) / length_squared).clamp(0.0, 1.0) } else { 0.0 };
            let apart = (other - (from + by * share)).norm();
            apart < self.berth_m && share > 0.0
        })
    }

    /// Whether a body on a path of way-points would come too near to one of them.
    pub(in crate::controllers) fn block_motion(&self, from: &Point3<f64>, motion: &Motion) -> bool {
        let Motion::Path(way_points) = motion else { return false };
        let starts = std::iter::once(from).chain(way_points);
        starts.zip(way_points).any(|(from, to)| self.block(from, to))
    }
}

#[cfg(test)]
mod tests {
    use msgs::ids::AgentId;

    use super::*;

    fn others(at: [f64; 3]) -> Others {
        let contacts = [Contact { agent: AgentId(1), position: Point3::from(at) }];
        Others::near(&contacts, &Point3::new(1.5, 1.5, 1.5), 0.4, Extent::new([20, 20, 20], 1.0).unwrap())
    }

    #[test]
    fn a_body_in_the_way_blocks_and_one_behind_does_not() {
        let here = Point3::new(1.5, 1.5, 1.5);
        let ahead = Point3::new(6.5, 1.5, 1.5);
        assert!(others([3.5, 1.5, 1.5]).block(&here, &ahead));
        assert!(others([3.5, 2.3, 1.5]).block(&here, &ahead));
        assert!(!others([3.5, 2.5, 1.5]).block(&here, &ahead));
        assert!(!others([0.7, 1.5, 1.5]).block(&here, &ahead));
        assert!(!others([9.5, 1.5, 1.5]).block(&here, &Point3::new(12.5, 1.5, 1.5)), "far away");
        assert!(others([3.5, 1.5, 1.5]).take(Cell::new(3, 1, 1)));
        assert!(!others([3.5, 1.5, 1.5]).take(Cell::new(4, 1, 1)));
    }
}
