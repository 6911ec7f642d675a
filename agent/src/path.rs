//! Path planning on an agent's own exploration map: search, and straight legs along the path.
//!
//! In reading order: [`Moves`] are the steps of a body of a given size from cell to cell; [`Graph`]
//! is these moves on a map; [`Search`] finds the cheapest path on a graph; [`Budgeted`] and
//! [`Background`] define when the result of a search is available; [`straighten`] reduces a path to
//! few waypoints and [`quicker`] to those that take the least time, a [`Trajectory`] leads along
//! them without a stop, and [`direct`] says whether no search is needed.
//!
//! Invariants: the sphere of the body, moved along any path found here, touches neither wall nor
//! unexplored cells (except those it touches at the start); costs are integers and every order is
//! total, so a result depends on the map and the query alone. The absence of a path is a result.
//!
//! This module does not consider other bodies.

mod flood;
mod graph;
mod legs;
mod quickest;
mod reachable;
mod room;
mod search;
mod sweep;
#[cfg(test)]
mod tests;
mod timing;
mod trajectory;

pub use graph::{Graph, Moves, Neighbours};
pub use legs::{LegBody, direct, straighten, straighten_from};
pub use quickest::quicker;
pub use reachable::Reachable;
pub use search::{Goal, Progress, Search, distances, find, nearest_distances};
pub use timing::{Background, Budgeted};
pub use trajectory::{BodyState, HeldVelocity, Trajectory};

use voxels::{Cell, Extent};

/// Cost of a path of one cell edge. Diagonals cost the square roots of 2 and 3 times that, rounded.
pub const EDGE_COST: u64 = 1_000_000;

/// A path from cell to cell.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Path {
    /// From the start to the goal, both included; only the start if it is the goal.
    pub cells: Vec<Cell>,
    /// Length of the path, in units of [`EDGE_COST`] per cell edge.
    pub cost: u64,
}

impl Path {
    /// Length along the centres of the cells, metres.
    #[must_use]
    pub fn length_m(&self, extent: Extent) -> f64 {
        self.cost as f64 / EDGE_COST as f64 * extent.cell_m()
    }
}
