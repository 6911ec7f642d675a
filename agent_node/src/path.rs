//! Ways through what an agent knows: search on its own exploration map, and straight legs along what is found.
//!
//! In reading order: [`Moves`] is how a body of a given size may go from one cell to the next; [`Graph`] is these moves on a
//! map; [`Search`] finds the cheapest way on a graph; [`Budgeted`] and [`Background`] say when the answer of a search may be
//! used; [`straighten`] turns a way into waypoints, and [`direct`] says whether no search is needed.
//!
//! Invariants: the sphere of the body, moved along anything that is found here, touches neither wall nor unexplored cells
//! (what it touches where it starts excepted); costs are integers and every order is total, so an answer depends on the map
//! and the question alone. That there is no way is an answer.
//!
//! This module knows nothing of other bodies, of headings or of how long a way takes.

mod graph;
mod legs;
mod search;
mod sweep;
#[cfg(test)]
mod tests;
mod timing;

pub use graph::{Graph, Moves, Neighbours};
pub use legs::{direct, straighten, straighten_from};
pub use search::{Goal, Progress, Scratch, Search, distances, find};
pub use timing::{Background, Budgeted};

use voxels::{Cell, Extent};

/// Cost of a way as long as the edge of a cell. Diagonals cost the square roots of 2 and 3 times that, rounded.
pub const EDGE_COST: u64 = 1_000_000;

/// A way from cell to cell.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Path {
    /// From the start to the goal, both included; only the start if it is the goal.
    pub cells: Vec<Cell>,
    /// Its length, in units of [`EDGE_COST`] to the edge of a cell.
    pub cost: u64,
}

impl Path {
    /// Its length along the centres of its cells, metres.
    #[must_use]
    pub fn length_m(&self, extent: Extent) -> f64 {
        self.cost as f64 / EDGE_COST as f64 * extent.cell_m()
    }
}
