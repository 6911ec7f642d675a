//! Search mode: the destination when no unvisited cell of the own region is in sight.

use std::collections::BTreeMap;
use std::convert::Infallible;
use std::task::Poll;

use voxels::Cell;

use super::flood::{Flood, Verdict};
use super::last_scan::LastScan;
use super::occlusion;
use super::places::{Places, squared};
use super::region::Region;
use crate::Ctx;
use agent::exploration_map::CellState;

/// Most cells that the flood for the nearest unvisited cell examines in a tick: a millisecond or
/// two.
const FLOOD_CELLS_MAX: usize = 1 << 16;

/// The inputs of search mode.
pub(crate) struct Search<'a, 'b> {
    pub(crate) ctx: &'a Ctx<'b>,
    pub(crate) scan: &'a LastScan,
    pub(crate) region: &'a Region,
    pub(crate) places: &'a Places,
    /// Visits to cells that were frontiers afterwards as before.
    pub(crate) frontier_visits: &'a BTreeMap<Cell, u64>,
    /// Places and frontiers visited this often are left out.
    pub(crate) visits_max: u64,
    /// Destinations refused for other reasons.
    pub(crate) is_refused: &'a dyn Fn(Cell) -> bool,
}

impl Search<'_, '_> {
    /// The occlusion point to visit: one never visited, else the one visited longest ago; ties go
    /// to the nearest, then to the lowest index. Points within the merging distance are one, at the
    /// position nearest to the agent. A point counts if it is in the region and has a neighbour
    /// that is unexplored, or unvisited and out of sight.
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

    fn is_worth_a_visit(&self, frontier: Cell) -> bool {
        let visits = self.frontier_visits.get(&frontier).copied().unwrap_or_default();
        visits < self.visits_max && !(self.is_refused)(frontier)
    }

    fn hides_something(&self, point: Cell) -> bool {
        let map = self.ctx.map();
        point.neighbours26().into_iter().any(|cell| match map.state(cell) {
            CellState::Unexplored => true,
            CellState::Free => !self.scan.is_free(map.extent(), cell),
            CellState::Covered | CellState::Wall => false,
        })
    }

    /// The nearest cell in sight and in the region with a neighbour in another region; of several,
    /// the one with the lowest index. Refused places and those visited too often do not count.
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

    /// The unvisited cell with the shortest path, in the region if there is one, else anywhere;
    /// then a frontier. On large maps this takes several ticks.
    ///
    /// Visits to frontiers count by cell: in narrow lanes many frontiers are one place.
    pub(crate) fn nearest_on_map(&self, flood: &mut Flood) -> Poll<Option<Cell>> {
        let map = self.ctx.map();
        let own = self.ctx.cell();
        flood.nearest(map, own, FLOOD_CELLS_MAX, self.ctx.tick(), |cell| {
            if map.state(cell) == CellState::Free && !(self.is_refused)(cell) {
                if self.region.holds(&map.extent().centre(cell)) { Verdict::Best } else { Verdict::Good }
            } else if cell != own && map.is_frontier(cell) && self.is_worth_a_visit(cell) {
                Verdict::Fair
            } else {
                Verdict::No
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use msgs::ids::{AgentId, Tick};

    use super::*;
    use crate::testing::{World, flat};
    use agent::observation::Contact;

    /// A corridor with two side corridors, of which only the mouths are visible.
    const MOUTHS: &str = "\
        ###########\n\
        #.........#\n\
        ####.##.###\n\
        ####.##.###\n\
        ###########\n";

    const NEAR: Cell = flat(4, 3);
    const FAR: Cell = flat(7, 3);

    /// At the left end, after a scan.
    fn at_the_left() -> World {
        let mut world = World::new(MOUTHS, flat(1, 3));
        world.sense();
        world
    }

    /// The result of `ask` for a search in a world.
    fn search<T>(world: &mut World, places: &Places, refused: &[Cell], ask: impl FnOnce(&Search<'_, '_>) -> T) -> T {
        let mut scan = LastScan::default();
        scan.load(world.map.extent(), &world.view());
        let observation = world.observation.clone();
        let ctx = world.ctx();
        let region = Region::new(&observation, &ctx);
        let is_refused = &|cell| refused.contains(&cell);
        let frontier_visits = &BTreeMap::new();
        ask(&Search { ctx: &ctx, scan: &scan, region: &region, places, frontier_visits, visits_max: 2, is_refused })
    }

    #[test]
    fn occlusion_points_alternate_up_to_the_visit_limit() {
        let mut world = at_the_left();
        let mut places = Places::new(0.0);
        let mut looked_from = Vec::new();
        for tick in 1.. {
            let Some(point) = search(&mut world, &places, &[], |search| search.occlusion_point()) else { break };
            places.visit(point, Tick(tick));
            looked_from.push(point);
        }
        assert_eq!(looked_from, [NEAR, FAR, NEAR, FAR]);
    }

    #[test]
    fn nearby_occlusion_points_are_merged() {
        let mut world = at_the_left();
        let mut places = Places::new(3.0);
        places.visit(NEAR, Tick(1));
        assert_eq!(search(&mut world, &places, &[], |search| search.occlusion_point()), Some(NEAR));
        places.visit(NEAR, Tick(2));
        assert_eq!(search(&mut world, &places, &[], |search| search.occlusion_point()), None);
    }

    #[test]
    fn useless_occlusion_points_are_left_out() {
        let mut world = at_the_left();
        let places = Places::new(0.0);
        assert_eq!(search(&mut world, &places, &[NEAR], |search| search.occlusion_point()), Some(FAR));
        // Both mouths are nearer to the other agent.
        world.observation.contacts =
            vec![Contact { agent: AgentId(0), position: world.map.extent().centre(flat(6, 3)) }];
        assert_eq!(search(&mut world, &places, &[], |search| search.occlusion_point()), None);
        assert_eq!(search(&mut world, &places, &[], |search| search.boundary()), Some(flat(3, 3)));
        world.observation.contacts.clear();
        assert_eq!(search(&mut world, &places, &[], |search| search.boundary()), None);
        for y in 1..3 {
            world.map.note_covered(flat(4, y));
        }
        world.map.note_wall(&[flat(3, 2), flat(5, 2)].map(|cell| world.map.extent().index(cell).unwrap() as u32));
        assert_eq!(search(&mut world, &places, &[], |search| search.occlusion_point()), Some(FAR));
    }
}
