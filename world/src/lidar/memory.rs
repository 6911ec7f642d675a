//! What the LiDAR of one agent has seen, and what is known of its rays.

use std::fmt;

use nalgebra::Point3;
use voxels::{Cell, Extent, Grid, Terrain};

use super::culling::CullingState;
use super::engine::NewCells;
use super::marks::Marks;

/// The cells that one agent's LiDAR has seen so far.
#[derive(Clone)]
pub struct SensorMemory {
    marks: Marks,
    /// By cell index the number of rays that crossed it minus those that ended in it; empty without
    /// noise.
    votes: Vec<i8>,
    culling: CullingState,
    /// Radius of the body that knows the cells it is in, metres; 0: it knows that of its centre
    /// alone, as its LiDAR sees the others.
    body_radius_m: f64,
}

/// The parts of a memory that its engines change.
pub(super) struct Parts<'a> {
    pub(super) marks: &'a mut Marks,
    pub(super) culling: &'a mut CullingState,
}

/// Omits the cells, of which there are millions.
impl fmt::Debug for SensorMemory {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("SensorMemory").field("extent", &self.extent()).finish_non_exhaustive()
    }
}

impl SensorMemory {
    /// The memory of a LiDAR that has seen nothing yet.
    pub fn new(terrain: &Grid<Terrain>) -> Self {
        Self { marks: Marks::new(terrain), votes: Vec::new(), culling: CullingState::new(), body_radius_m: 0.0 }
    }

    /// The same for a body of this radius (metres) that knows which cells it is in, whether its
    /// LiDAR sees them or not.
    #[must_use]
    pub fn of_body(self, body_radius_m: f64) -> Self {
        Self { body_radius_m, ..self }
    }

    /// The free cells that the body is in with its centre at a point (metres, frame `map`); none if
    /// its LiDAR sees them.
    pub(super) fn body_cells(&self, centre: &Point3<f64>) -> Vec<Cell> {
        if self.body_radius_m == 0.0 {
            return Vec::new();
        }
        let extent = self.extent();
        let (at, radius) = (extent.in_cells(centre), self.body_radius_m / extent.cell_m());
        let [x, y, z] = at.map(|at| (at - radius).floor() as i32..=(at + radius).floor() as i32);
        let gap = |along: i32, axis: usize| {
            let low = f64::from(along);
            (low - at[axis]).max(at[axis] - low - 1.0).max(0.0)
        };
        let cells = z.flat_map(|z| {
            y.clone().flat_map({
                let x = x.clone();
                move |y| x.clone().map(move |x| Cell::new(x, y, z))
            })
        });
        let is_in = |cell: &Cell| {
            let gaps = [gap(cell.x, 0), gap(cell.y, 1), gap(cell.z, 2)];
            gaps.iter().map(|gap| gap * gap).sum::<f64>() < radius * radius
        };
        cells.filter(|cell| extent.contains(*cell) && is_in(cell) && !self.is_wall(*cell)).collect()
    }

    /// Sees the cells that the body is in.
    pub(super) fn see_body(&mut self, centre: &Point3<f64>, new: &mut NewCells<'_>) {
        self.body_cells(centre).into_iter().for_each(|cell| self.see(cell, new));
    }

    /// An empty memory for another LiDAR in the same terrain.
    #[must_use]
    pub fn unused(&self) -> Self {
        let (votes, culling) = (Vec::new(), CullingState::new());
        Self { marks: self.marks.unused(), votes, culling, body_radius_m: self.body_radius_m }
    }

    /// The extent of the map.
    pub(super) fn extent(&self) -> Extent {
        self.marks.slots().extent()
    }

    /// What has been seen.
    pub(super) fn marks(&self) -> &Marks {
        &self.marks
    }

    /// Whether a cell of the map has been seen.
    pub(super) fn has_seen(&self, cell: Cell) -> bool {
        !self.marks.is_unseen(self.marks.slots().of(cell))
    }

    /// Whether a cell of the map is truly a wall.
    pub(super) fn is_wall(&self, cell: Cell) -> bool {
        !self.marks.is_free(self.marks.slots().of(cell))
    }

    /// Marks a cell of the map as seen, and adds it if it is new.
    pub(super) fn see(&mut self, cell: Cell, new: &mut NewCells<'_>) {
        self.marks.see(self.marks.slots().of(cell), new);
    }

    /// The indices of the cells that have been seen, ascending.
    #[cfg(test)]
    pub(super) fn seen_cells(&self) -> impl Iterator<Item = usize> + '_ {
        let extent = self.extent();
        (0..extent.volume()).filter(move |&index| self.has_seen(extent.cell_at(index)))
    }

    /// The parts that engines change.
    pub(super) fn parts(&mut self) -> Parts<'_> {
        Parts { marks: &mut self.marks, culling: &mut self.culling }
    }

    /// Takes the votes of noisy scans out of the memory, one for each cell: those of rays that
    /// crossed it minus those of rays that ended in it.
    pub(super) fn take_votes(&mut self) -> Vec<i8> {
        let mut votes = std::mem::take(&mut self.votes);
        votes.resize(self.extent().volume(), 0);
        votes
    }

    /// Takes the votes about a cell, by index; `None` without noise.
    pub(super) fn take_vote(&mut self, cell: u32) -> Option<i8> {
        self.votes.get_mut(cell as usize).map(std::mem::take)
    }

    /// Puts the votes of noisy scans back.
    pub(super) fn put_votes(&mut self, votes: Vec<i8>) {
        self.votes = votes;
    }
}
