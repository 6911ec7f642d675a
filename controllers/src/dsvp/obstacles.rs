//! The bodies of the agents in contact as moving obstacles.
//!
//! They move on, so only nearby ones matter. Their plans are unknown here.

use nalgebra::{Point3, Vector3};
use voxels::{BodyLattice, Cell, Extent};

use crate::Ctx;
use agent::bodies::{Bodies, nearest_share};
use agent::command::Motion;
use agent::observation::{Contact, Observation};

/// Distance between body centres below which a path is blocked, as a multiple of the distance at
/// which the bodies touch.
pub(crate) const CLEARANCE: f64 = 1.025;

/// Bodies beyond this distance will have moved on before one gets there, as a multiple of the
/// distance at which the bodies touch.
pub(crate) const NEAR: f64 = 6.0;

/// The bodies nearby.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Obstacles {
    extent: Extent,
    /// Where the body is in a cell.
    lattice: BodyLattice,
    near: Vec<Obstacle>,
    /// No cell outside this box is occupied, so a search that goes far looks at no obstacle there.
    low: Cell,
    high: Cell,
    /// The occupied cells of the box, one bit each; empty if the box is large, and then each cell
    /// is decided when it is asked for.
    occupied: Vec<u64>,
}

/// Greatest number of cells of a box whose cells are all decided at once.
const BOX_CELLS_MAX: usize = 1 << 15;

/// A body and the clearance between centres that it needs.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Obstacle {
    at: Point3<f64>,
    clearance_m: f64,
}

/// Whether an agent in contact is near a body with a radius at `here`; metres, frame `map`.
pub(crate) fn is_near(contact: &Contact, here: &Point3<f64>, radius_m: f64, bodies: &Bodies) -> bool {
    let touch_m = radius_m + bodies.of(contact.agent).radius_m;
    (contact.position - here).norm() < NEAR * touch_m
}

impl Obstacles {
    /// The bodies that may block that of the agent.
    pub(crate) fn of(observation: &Observation, ctx: &Ctx<'_>) -> Self {
        let (here, bodies) = (ctx.position(), &ctx.run_info().bodies);
        Self::near(&observation.contacts, &here, ctx.body().radius_m, bodies, ctx.map().extent())
    }

    /// The obstacles near a body with a radius at `here`; metres, frame `map`. `bodies` are those
    /// of the team.
    pub(crate) fn near(
        contacts: &[Contact],
        here: &Point3<f64>,
        radius_m: f64,
        bodies: &Bodies,
        extent: Extent,
    ) -> Self {
        let obstacle = |contact: &Contact| {
            let touch_m = radius_m + bodies.of(contact.agent).radius_m;
            let obstacle = Obstacle { at: contact.position, clearance_m: CLEARANCE * touch_m };
            is_near(contact, here, radius_m, bodies).then_some(obstacle)
        };
        let near: Vec<Obstacle> = contacts.iter().filter_map(obstacle).collect();
        // A centre within the clearance is within the cells of these corners; one more for
        // rounding.
        let corner = |by: f64, pick: fn(f64, f64) -> f64| {
            let along = |axis: usize| {
                let ends = near.iter().map(|obstacle| obstacle.at[axis] + by * obstacle.clearance_m);
                ends.reduce(pick).unwrap_or_default()
            };
            extent.cell_of(&Point3::new(along(0), along(1), along(2)))
        };
        let one = Cell::new(1, 1, 1);
        let (low, high) = (corner(-1.0, f64::min) - one, corner(1.0, f64::max) + one);
        let lattice = BodyLattice::of(radius_m, extent.cell_m());
        let mut obstacles = Self { extent, lattice, near, low, high, occupied: Vec::new() };
        obstacles.decide_all();
        obstacles
    }

    /// Whether no body is nearby.
    pub(crate) fn is_empty(&self) -> bool {
        self.near.is_empty()
    }

    /// Decides all cells of the box, if there are not too many. A search among many obstacles asks
    /// for each cell once for each of its neighbours.
    fn decide_all(&mut self) {
        let volume = self.box_size().into_iter().try_fold(1, usize::checked_mul);
        let Some(volume) = volume.filter(|&volume| volume <= BOX_CELLS_MAX && !self.near.is_empty()) else { return };
        let mut occupied = vec![0; volume.div_ceil(64)];
        for &Obstacle { at, clearance_m } in &self.near {
            // The centres of the outermost of these cells are half a cell from where rounding
            // matters.
            let reach = Vector3::repeat(clearance_m);
            let (low, high) = (self.extent.cell_of(&(at - reach)), self.extent.cell_of(&(at + reach)));
            for (z, y) in (low.z..=high.z).flat_map(|z| (low.y..=high.y).map(move |y| (z, y))) {
                for cell in (low.x..=high.x).map(|x| Cell::new(x, y, z)) {
                    if (at - self.lattice.place(self.extent, cell)).norm() < clearance_m {
                        let place = self.place(cell);
                        occupied[place / 64] |= 1 << (place % 64);
                    }
                }
            }
        }
        self.occupied = occupied;
    }

    /// Number of cells of the box along each axis.
    fn box_size(&self) -> [usize; 3] {
        let Self { low, high, .. } = self;
        [(low.x, high.x), (low.y, high.y), (low.z, high.z)].map(|(low, high)| high.abs_diff(low) as usize + 1)
    }

    /// The bit of a cell of the box.
    fn place(&self, cell: Cell) -> usize {
        let [size_x, size_y, _] = self.box_size();
        let by = [(cell.x, self.low.x), (cell.y, self.low.y), (cell.z, self.low.z)];
        let [x, y, z] = by.map(|(at, low)| at.abs_diff(low) as usize);
        (z * size_y + y) * size_x + x
    }

    /// Whether the body at the place of a cell would violate the clearance of an obstacle.
    pub(crate) fn occupy(&self, cell: Cell) -> bool {
        let Self { low, high, .. } = self;
        let is_in_box = (low.x..=high.x).contains(&cell.x)
            && (low.y..=high.y).contains(&cell.y)
            && (low.z..=high.z).contains(&cell.z);
        if is_in_box && !self.occupied.is_empty() {
            let place = self.place(cell);
            return self.occupied[place / 64] >> (place % 64) & 1 != 0;
        }
        is_in_box && {
            let place = self.lattice.place(self.extent, cell);
            self.near.iter().any(|obstacle| (obstacle.at - place).norm() < obstacle.clearance_m)
        }
    }

    /// Whether a body on a straight leg would violate the clearance of an obstacle. A violation at
    /// the start does not count unless the leg comes nearer still.
    pub(crate) fn block(&self, from: &Point3<f64>, to: &Point3<f64>) -> bool {
        let by = to - from;
        self.near.iter().any(|obstacle| {
            let share = nearest_share(from, &by, &obstacle.at);
            let apart = (obstacle.at - (from + by * share)).norm();
            apart < obstacle.clearance_m && share > 0.0
        })
    }

    /// Whether a body on a path of waypoints would violate the clearance of an obstacle.
    pub(crate) fn block_motion(&self, from: &Point3<f64>, motion: &Motion) -> bool {
        let Motion::Path(waypoints) = motion else { return false };
        let starts = std::iter::once(from).chain(waypoints);
        starts.zip(waypoints).any(|(from, to)| self.block(from, to))
    }
}

#[cfg(test)]
mod tests {
    use msgs::ids::AgentId;

    use super::*;
    use agent::bodies::BodyModel;

    /// An obstacle: agent 1 with a radius of 0.4 m, or agent 2 with 1.4 m.
    fn of(agent: u32, at: [f64; 3]) -> Obstacles {
        let contacts = [Contact { agent: AgentId(agent), position: Point3::from(at) }];
        let large = BodyModel { radius_m: 1.4, ..BodyModel::SUBMARINE };
        let bodies = Bodies::new(vec![BodyModel::SUBMARINE, large], vec![0, 0, 1]).unwrap();
        let extent = Extent::new([20, 20, 20], 1.0).unwrap();
        Obstacles::near(&contacts, &Point3::new(1.5, 1.5, 1.5), 0.4, &bodies, extent)
    }

    fn obstacle(at: [f64; 3]) -> Obstacles {
        of(1, at)
    }

    #[test]
    fn larger_bodies_need_more_clearance() {
        let (here, ahead) = (Point3::new(1.5, 1.5, 1.5), Point3::new(12.5, 1.5, 1.5));
        assert!(!of(1, [4.5, 3.2, 1.5]).block(&here, &ahead) && of(2, [4.5, 3.2, 1.5]).block(&here, &ahead));
        assert!(!of(1, [9.5, 1.5, 1.5]).block(&here, &ahead) && of(2, [9.5, 1.5, 1.5]).block(&here, &ahead));
        assert!(of(2, [4.5, 1.5, 1.5]).occupy(Cell::new(3, 2, 1)));
    }

    #[test]
    fn cells_are_occupied_wherever_the_clearance_reaches() {
        for (agent, clearance_m) in [(1, CLEARANCE * 0.8), (2, CLEARANCE * 1.8)] {
            for at in [[3.5, 1.5, 1.5], [3.99, 2.01, 1.0], [1.32, 3.68, 0.4]] {
                let (obstacles, extent) = (of(agent, at), Extent::new([20, 20, 20], 1.0).unwrap());
                for (x, y, z) in (-3..9).flat_map(|z| (-3..9).flat_map(move |y| (-3..9).map(move |x| (x, y, z)))) {
                    let cell = Cell::new(x, y, z);
                    let is_within = (extent.centre(cell) - Point3::from(at)).norm() < clearance_m;
                    assert_eq!(obstacles.occupy(cell), is_within, "{cell:?}, {at:?}");
                }
            }
        }
        assert!(!of(1, [19.5, 19.5, 19.5]).occupy(Cell::new(0, 0, 0)), "no obstacle is near");
    }

    #[test]
    fn large_boxes_are_decided_cell_by_cell() {
        let giant = BodyModel { radius_m: 8.5, ..BodyModel::SUBMARINE };
        let bodies = Bodies::new(vec![giant], vec![0, 0, 0]).unwrap();
        let extent = Extent::new([60; 3], 1.0).unwrap();
        let at = [Point3::new(20.2, 30.0, 30.7), Point3::new(41.0, 28.5, 30.0)];
        let contacts = [0, 1].map(|agent: usize| Contact { agent: AgentId::from_index(agent), position: at[agent] });
        let obstacles = Obstacles::near(&contacts, &Point3::new(30.5, 30.5, 30.5), 8.5, &bodies, extent);
        assert!(obstacles.occupied.is_empty());
        for cell in extent.cells() {
            let is_within = at.iter().any(|at| (extent.centre(cell) - at).norm() < CLEARANCE * 17.0);
            assert_eq!(obstacles.occupy(cell), is_within, "{cell:?}");
        }
    }

    #[test]
    fn bodies_ahead_block_and_bodies_behind_do_not() {
        let here = Point3::new(1.5, 1.5, 1.5);
        let ahead = Point3::new(6.5, 1.5, 1.5);
        assert!(obstacle([3.5, 1.5, 1.5]).block(&here, &ahead));
        assert!(obstacle([3.5, 2.3, 1.5]).block(&here, &ahead));
        assert!(!obstacle([3.5, 2.5, 1.5]).block(&here, &ahead));
        assert!(!obstacle([0.7, 1.5, 1.5]).block(&here, &ahead));
        assert!(!obstacle([9.5, 1.5, 1.5]).block(&here, &Point3::new(12.5, 1.5, 1.5)), "far away");
        assert!(obstacle([3.5, 1.5, 1.5]).occupy(Cell::new(3, 1, 1)));
        assert!(!obstacle([3.5, 1.5, 1.5]).occupy(Cell::new(4, 1, 1)));
    }
}
