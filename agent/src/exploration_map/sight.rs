//! Lines of sight over cells known to be free.

use std::ops::ControlFlow;

use nalgebra::Point3;
use voxels::{Cell, walk_segment};

use super::ExplorationMap;

impl ExplorationMap {
    /// Whether the straight segment between two points (metres, frame `map`) crosses only cells
    /// known to be free.
    pub fn is_free_between(&self, from: &Point3<f64>, to: &Point3<f64>) -> bool {
        let end = walk_segment(self.extent(), from, to, |cell| match self.is_free(cell) {
            true => ControlFlow::Continue(()),
            false => ControlFlow::Break(()),
        });
        end.is_continue()
    }

    /// The same for the segment between the centres of two cells.
    pub fn is_in_sight(&self, one: Cell, other: Cell) -> bool {
        self.is_free_between(&self.extent().centre(one), &self.extent().centre(other))
    }
}
