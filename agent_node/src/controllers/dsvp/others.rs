//! The bodies of the agents in contact, as obstacles.
//!
//! They move on, so only those nearby count. This module knows nothing of their plans.

use nalgebra::Point3;
use voxels::{Cell, Extent};

use crate::body::Bodies;
use crate::command::Motion;
use crate::observation::Contact;

/// Distance between the centres of two bodies below which a way is blocked, as a multiple of that at which they touch.
const BERTH: f64 = 1.025;

/// Bodies farther away than this will have moved on before one gets there, as a multiple of the distance at which they touch.
const NEAR: f64 = 6.0;

/// Bodies that are in the way.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::controllers) struct Others {
    extent: Extent,
    near: Vec<Other>,
}

/// A body, and how near to it another one may come, from centre to centre.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Other {
    at: Point3<f64>,
    berth_m: f64,
}

impl Others {
    /// Those near to a body of some radius at `here`; metres, frame `map`. `bodies` are those of the team.
    pub(in crate::controllers) fn near(
        contacts: &[Contact],
        here: &Point3<f64>,
        radius_m: f64,
        bodies: &Bodies,
        extent: Extent,
    ) -> Self {
        let is_near = |contact: &Contact| {
            let touch_m = radius_m + bodies.of(contact.agent).radius_m;
            let other = Other { at: contact.position, berth_m: BERTH * touch_m };
            ((contact.position - here).norm() < NEAR * touch_m).then_some(other)
        };
        Self { extent, near: contacts.iter().filter_map(is_near).collect() }
    }

    /// Whether a body at the centre of a cell would be in touch with one of them, or nearly.
    pub(in crate::controllers) fn take(&self, cell: Cell) -> bool {
        !self.near.is_empty() && {
            let centre = self.extent.centre(cell);
            self.near.iter().any(|other| (other.at - centre).norm() < other.berth_m)
        }
    }

    /// Whether a body that moves straight would come too near to one of them. Where it starts does not count, as long as it does
    /// not come nearer still.
    pub(in crate::controllers) fn block(&self, from: &Point3<f64>, to: &Point3<f64>) -> bool {
        let by = to - from;
        let length_squared = by.norm_squared();
        self.near.iter().any(|other| {
            let share =
                if length_squared > 0.0 { ((other.at - from).dot(&by) / length_squared).clamp(0.0, 1.0) } else { 0.0 };
            let apart = (other.at - (from + by * share)).norm();
            apart < other.berth_m && share > 0.0
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
    use crate::body::Body;

    /// A body at some place, of agent 1 with a radius of 0.4 m, or of agent 2 with 1.4 m.
    fn of(agent: u32, at: [f64; 3]) -> Others {
        let contacts = [Contact { agent: AgentId(agent), position: Point3::from(at) }];
        let large = Body { radius_m: 1.4, ..Body::SUBMARINE };
        let bodies = Bodies::new(vec![Body::SUBMARINE, large], vec![0, 0, 1]).unwrap();
        let extent = Extent::new([20, 20, 20], 1.0).unwrap();
        Others::near(&contacts, &Point3::new(1.5, 1.5, 1.5), 0.4, &bodies, extent)
    }

    fn others(at: [f64; 3]) -> Others {
        of(1, at)
    }

    #[test]
    fn a_larger_body_needs_more_room_and_counts_from_farther_away() {
        let (here, ahead) = (Point3::new(1.5, 1.5, 1.5), Point3::new(12.5, 1.5, 1.5));
        assert!(!of(1, [4.5, 3.2, 1.5]).block(&here, &ahead) && of(2, [4.5, 3.2, 1.5]).block(&here, &ahead));
        assert!(!of(1, [9.5, 1.5, 1.5]).block(&here, &ahead) && of(2, [9.5, 1.5, 1.5]).block(&here, &ahead));
        assert!(of(2, [4.5, 1.5, 1.5]).take(Cell::new(3, 2, 1)));
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
