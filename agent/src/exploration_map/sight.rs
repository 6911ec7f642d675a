//! Lines of sight over cells known to be free, and what is known of the ground.

use std::ops::ControlFlow;

use nalgebra::Point3;
use voxels::{Cell, Ground, walk_segment};

use super::{CellState, ExplorationMap};

impl Ground for ExplorationMap {
    fn is_free(&self, cell: Cell) -> bool {
        Self::is_free(self, cell)
    }

    fn is_wall(&self, cell: Cell) -> bool {
        self.state(cell) == CellState::Wall
    }
}

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

    /// Whether the straight segment from a point (metres, frame `map`) to the centre of a cell
    /// crosses only cells known to be free before that one.
    pub fn is_seen_from(&self, from: &Point3<f64>, target: Cell) -> bool {
        let end = walk_segment(self.extent(), from, &self.extent().centre(target), |cell| {
            match cell == target || self.is_free(cell) {
                true => ControlFlow::Continue(()),
                false => ControlFlow::Break(()),
            }
        });
        end.is_continue()
    }

    /// [`ExplorationMap::is_free_between`] for the segment between the centres of two cells.
    pub fn is_in_sight(&self, one: Cell, other: Cell) -> bool {
        self.is_free_between(&self.extent().centre(one), &self.extent().centre(other))
    }
}
