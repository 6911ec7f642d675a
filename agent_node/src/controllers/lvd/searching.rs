//! Search mode: where to go when no unvisited cell of the own region is in sight.

use std::convert::Infallible;

use voxels::Cell;

use super::flood::{Flood, Verdict};
use super::last_scan::LastScan;
use super::occlusion;
use super::places::{Places, squared};
use super::region::Region;
use crate::controllers::Ctx;
use crate::exploration_map::CellState;

/// Most cells that one look around for the nearest unvisited one goes through: some milliseconds.
const FLOOD_CELLS_MAX: usize = 1 << 18;

/// What search mode knows when it has to choose.
pub(crate) struct Search<'a, 'b> {
    pub(crate) ctx: &'a Ctx<'b>,
    pub(crate) scan: &'a LastScan,
    pub(crate) region: &'a Region,
    pub(crate) places: &'a Places,
    /// Places visited more often are left alone.
    pub(crate) visits_max: u64,
    /// What is refused for other reasons.
    pub(crate) is_refused: &'a dyn Fn(Cell) -> bool,
}

impl Search<'_, '_> {
    /// The occlusion point to look from: one never visited, else the one not visited for the longest time; of several, the
    /// nearest; of several of these, the one with the lowest index. Near ones are one, at the place that is nearest to the agent.
    /// A point counts if it is in the region, and next to it there is a cell that is unexplored, or unvisited and out of sight.
    pub(crate) fn occlusion_point(&self) -> Option<Cell> {
        let extent = self.ctx.map().extent();
        let own = self.ctx.cell();
        let mut points = Vec::new();
        for &wall in self.scan.wall() {
            let is_wall = |cell| Ok(!extent.contains(cell) || self.scan.is_wall(extent, cell));
            let note = |cell| {
                if self.scan.is_free(extent, cell) {
                    points.push((squared(cell - own), cell));
                }
                Ok::<_, Infallible>(())
            };
            let Ok(()) = occlusion::candidates(own, extent.cell_at(wall as usize), is_wall, note);
        }
        points.sort_unstable();
        points.dedup();
        let mut merged: Vec<Cell> = Vec::new();
        for (_, point) in points {
            if !merged.iter().any(|&other| self.places.is_same(other, point))
                && self.may_be_chosen(point)
                && self.region.holds(&extent.centre(point))
                && self.hides_something(point)
            {
                merged.push(point);
            }
        }
        self.places.longest_ago(&merged)
    }

    fn may_be_chosen(&self, cell: Cell) -> bool {
        self.places.visits(cell).0 < self.visits_max && !(self.is_refused)(cell)
    }

    fn hides_something(&self, point: Cell) -> bool {
        let map = self.ctx.map();
        point.neighbours26().into_iter().any(|cell| match map.state(cell) {
            CellState::Unexplored => true,
            CellState::Free => !self.scan.is_free(map.extent(), cell),
            CellState::Covered | CellState::Wall => false,
        })
    }

    /// The nearest cell in sight and in the region that has a neighbour in another's region; of several, the one with the lowest
    /// index. Places that are refused or were visited too often do not count.
    pub(crate) fn boundary(&self) -> Option<Cell> {
        if self.region.is_everything() {
            return None;
        }
        let extent = self.ctx.map().extent();
        let own = self.ctx.cell();
        let mut nearest: Option<(i32, Cell)> = None;
        for &index in self.scan.free() {
            let cell = extent.cell_at(index as usize);
            let distance = squared(cell - own);
            if cell != own
                && nearest.is_none_or(|(least, _)| distance < least)
                && self.region.holds(&extent.centre(cell))
                && cell.neighbours6().into_iter().any(|next| !self.region.holds(&extent.centre(next)))
                && self.may_be_chosen(cell)
            {
                nearest = Some((distance, cell));
            }
        }
        nearest.map(|(_, cell)| cell)
    }

    /// The unvisited cell with the shortest way through free cells, in the region if there is one there, else anywhere; then a
    /// cell at the edge of what is known.
    pub(crate) fn nearest_on_map(&self, flood: &mut Flood) -> Option<Cell> {
        let map = self.ctx.map();
        let mut edge = None;
        let own = self.ctx.cell();
        let unvisited = flood.nearest(map, own, FLOOD_CELLS_MAX, |cell| {
            if map.state(cell) == CellState::Free && !(self.is_refused)(cell) {
                if self.region.holds(&map.extent().centre(cell)) { Verdict::Best } else { Verdict::Good }
            } else {
                if edge.is_none() && cell != own && map.is_frontier(cell) && self.may_be_chosen(cell) {
                    edge = Some(cell);
                }
                Verdict::No
            }
        });
        unvisited.or(edge)
    }
}
