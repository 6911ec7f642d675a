//! The stages without gain nearby: relocation to a frontier, for wide bodies to where they see what
//! they cannot come near, and pursuit of other agents without any.

use std::collections::BTreeSet;
use std::task::Poll;

use nalgebra::Point3;
use rand::seq::IndexedRandom;

use super::avoidance::{motion_to, way_round};
use super::coordination::Coordination;
use super::goal::Goal;
use super::obstacles::Obstacles;
use super::{ATTEMPTS, Dsvp, Plan, by_distance};
use crate::Ctx;
use crate::viewpoints::{Viewpoint, Viewpoints};
use agent::abstract_graph::{AbstractGraph, Region, RegionId};
use agent::command::Motion;
use agent::exploration_map::{CellState, ExplorationMap};
use agent::observation::{FieldOfView, Observation};
use voxels::{BodyLattice, Cell};

impl<C: Coordination> Dsvp<C> {
    /// The relocation stage: to the nearest frontier, or to the one of least cost beside
    /// the goals of others.
    pub(super) fn relocate(&mut self, observation: &Observation, ctx: &mut Ctx<'_>, obstacles: &Obstacles) -> Plan {
        let Self { graph, paths, coordination, .. } = self;
        let here = ctx.cell();
        let cell_m = ctx.map().extent().cell_m();
        let sight = Sight::of(ctx);
        // The cheapest candidates so far: cost, viewpoint, frontier.
        let mut best: Vec<(f64, Cell, Cell)> = Vec::new();
        paths.begin(graph, here);
        while paths.has_frontiers_left()
            && let Some((id, region, length)) = paths.next(graph)
        {
            let path_m = length * cell_m;
            if best.len() == ATTEMPTS && best.last().is_some_and(|&(most, ..)| most <= path_m) {
                break;
            }
            let Some((frontier, cell)) = nearest_viewpoint(graph, sight, (id, region), here, &self.abandoned) else {
                continue;
            };
            if cell == here {
                self.abandoned.extend(seen_from(graph, (id, region), here));
                continue;
            }
            best.push((path_m + coordination.penalty_m(cell, path_m, observation), cell, frontier));
            best.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
            best.truncate(ATTEMPTS);
        }
        for &(_, cell, frontier) in &best {
            if let Some(motion) = motion_to(ctx, graph, paths, cell, obstacles, self.params.waypoints) {
                return Plan::Go(Goal::Frontier { cell, frontier }, motion);
            }
        }
        if best.is_empty() {
            return Plan::Nothing;
        }
        // No body blocks the paths: there are none.
        if obstacles.is_empty() {
            self.abandoned.extend(best.into_iter().map(|(_, _, frontier)| frontier));
            return Plan::Pending;
        }
        Plan::Blocked
    }

    /// The last stage of a body that needs viewpoints: to the nearest place from which it sees
    /// something unexplored.
    pub(super) fn look_from_afar(&mut self, observation: &Observation, ctx: &Ctx<'_>, obstacles: &Obstacles) -> Plan {
        if !ctx.needs_viewpoints() {
            return Plan::Nothing;
        }
        let (extent, here) = (ctx.map().extent(), ctx.cell());
        let viewpoints = self.viewpoints.get_or_insert_with(|| Viewpoints::new(ctx.run_info(), ctx.body().radius_m));
        if !observation.is_active {
            viewpoints.visit(extent, here);
        }
        let viewpoint = match viewpoints.next(ctx) {
            Poll::Ready(Some(viewpoint)) => viewpoint,
            Poll::Ready(None) => return Plan::Nothing,
            Poll::Pending => return Plan::Pending,
        };
        let waypoints = self.params.waypoints;
        let go = |Viewpoint { cell, target }: Viewpoint| {
            Some(Plan::Go(Goal::Sight { cell, target }, way_round(ctx, cell, obstacles, waypoints)?))
        };
        if let Some(plan) = go(viewpoint) {
            return plan;
        }
        if obstacles.is_empty() {
            viewpoints.visit(extent, viewpoint.cell);
            return Plan::Pending;
        }
        // A body is in it or in the way there: another one.
        match viewpoints.next_within(ctx, &|cell| !obstacles.occupy(cell)) {
            Poll::Ready(Some(other)) => go(other).unwrap_or(Plan::Blocked),
            Poll::Ready(None) | Poll::Pending => Plan::Blocked,
        }
    }

    /// Bodies that stay are in the way to the goals of the stages: the nearest frontier or
    /// viewpoint to which they leave one.
    pub(super) fn detour(&mut self, ctx: &Ctx<'_>, obstacles: &Obstacles) -> Option<(Goal, Motion)> {
        let is_open = |cell| !obstacles.occupy(cell);
        let goal = if ctx.needs_viewpoints() {
            let viewpoints =
                self.viewpoints.get_or_insert_with(|| Viewpoints::new(ctx.run_info(), ctx.body().radius_m));
            let found = viewpoints.next_within(ctx, &is_open);
            let Poll::Ready(Some(Viewpoint { cell, target })) = found else { return None };
            Goal::Sight { cell, target }
        } else {
            let cell = ctx.frontier_through(&is_open, |cell| !self.abandoned.contains(&cell))?;
            Goal::Frontier { cell, frontier: cell }
        };
        Some((goal, way_round(ctx, goal.cell(), obstacles, self.params.waypoints)?))
    }

    /// No frontier is left on this map: carries the map to the agent out of contact for longest of
    /// those that may have something left to explore; once all have been tried, to a random region,
    /// which also clears the way of those that explore. The team rests when all have nothing left.
    pub(super) fn pursue(&mut self, observation: &Observation, ctx: &mut Ctx<'_>, obstacles: &Obstacles) -> Plan {
        let Self { graph, paths, pursuit, .. } = self;
        let here = ctx.cell();
        pursuit.report(graph.region_of(here).is_some(), observation.tick);
        let are_all_in_contact = observation.contacts.len() + 1 >= ctx.run_info().agents as usize;
        if are_all_in_contact || pursuit.have_all_finished() {
            return Plan::Nothing;
        }
        pursuit.arrive(self.goal, here);
        paths.begin(graph, here);
        let mut reached = Vec::new();
        while let Some((_, region, _)) = paths.next(graph) {
            reached.push(region.centre);
        }
        let wandering = reached.choose(&mut self.rng).map(|&cell| Goal::Wandering { cell });
        for goal in pursuit.candidates(&observation.contacts, here).take(ATTEMPTS - 1).chain(wandering) {
            if let Some(motion) = motion_to(ctx, graph, paths, goal.cell(), obstacles, self.params.waypoints) {
                return Plan::Go(goal, motion);
            }
        }
        if obstacles.is_empty() { Plan::Nothing } else { Plan::Blocked }
    }
}

/// What an agent sees from a place.
#[derive(Clone, Copy)]
pub(super) struct Sight<'a> {
    map: &'a ExplorationMap,
    lattice: BodyLattice,
    /// What its LiDAR sees with some heading; `None`: everything.
    view: Option<&'a FieldOfView>,
}

impl<'a> Sight<'a> {
    pub(super) fn of(ctx: &'a Ctx<'_>) -> Self {
        Self { map: ctx.map(), lattice: ctx.moves().lattice(), view: ctx.run_info().field_of_view.as_ref() }
    }

    /// The sight of a body at the centres of cells which sees everything.
    #[cfg(test)]
    pub(super) fn everywhere(map: &'a ExplorationMap) -> Self {
        Self { map, lattice: BodyLattice::Centres, view: None }
    }

    /// Whether the centre of a cell is in sight from a place (metres, frame `map`).
    fn shows(&self, place: &Point3<f64>, cell: Cell) -> bool {
        let offset = self.map.extent().centre(cell) - place;
        self.view.is_none_or(|view| view.holds(&offset)) && self.map.is_seen_from(place, cell)
    }
}

/// The frontier of a region nearest to a cell, without those left out, and its viewpoint. Of a
/// frontier in which the body cannot rest, what is behind it has to be in sight from there: the
/// others are for [`crate::viewpoints`].
pub(super) fn nearest_viewpoint(
    graph: &AbstractGraph,
    sight: Sight<'_>,
    (id, region): (RegionId, &Region),
    here: Cell,
    left_out: &BTreeSet<Cell>,
) -> Option<(Cell, Cell)> {
    let open = region.frontiers.iter().filter(|frontier| region.has_rest() && !left_out.contains(frontier));
    let map = sight.map;
    let is_unexplored = |cell: &Cell| map.extent().contains(*cell) && map.state(*cell) == CellState::Unexplored;
    let shows = |frontier: Cell| {
        let can_rest = graph.can_rest(id, frontier);
        if can_rest && sight.view.is_none() {
            return true;
        }
        let place = sight.lattice.place(map.extent(), if can_rest { frontier } else { region.centre });
        frontier.neighbours6().into_iter().filter(is_unexplored).any(|behind| sight.shows(&place, behind))
    };
    let nearest = |a: &&Cell, b: &&Cell| by_distance(here, a, b);
    let mut frontier = *open.clone().min_by(nearest)?;
    if !shows(frontier) {
        frontier = *open.filter(|&&frontier| shows(frontier)).min_by(nearest)?;
    }
    Some((frontier, viewpoint(graph, id, region.centre, frontier)))
}

/// The frontiers of a region whose viewpoint is a cell.
pub(super) fn seen_from(
    graph: &AbstractGraph,
    (id, region): (RegionId, &Region),
    cell: Cell,
) -> impl Iterator<Item = Cell> {
    region.frontiers.iter().copied().filter(move |&frontier| viewpoint(graph, id, region.centre, frontier) == cell)
}

/// The viewpoint of a frontier: the frontier itself, or the centre of its region if the body cannot
/// rest there.
fn viewpoint(graph: &AbstractGraph, region: RegionId, centre: Cell, frontier: Cell) -> Cell {
    if graph.can_rest(region, frontier) { frontier } else { centre }
}

#[cfg(test)]
mod tests {
    use agent::path::{Graph, Moves, Neighbours};
    use voxels::Extent;

    use super::*;

    /// A room of 3 x 3 x 3 cells, in whose middle alone a body of 1.2 cells has room, and a niche
    /// of two cells along x. Some cells are unexplored, all others wall.
    fn room(unexplored: &[Cell]) -> ExplorationMap {
        let extent = Extent::new([8, 5, 5], 1.0).unwrap();
        let mut map = ExplorationMap::new(extent);
        let is_free = |cell: Cell| cell.x < 3 && cell.y < 3 && cell.z < 3 || cell.x < 5 && (cell.y, cell.z) == (1, 1);
        for cell in extent.cells().filter(|cell| !unexplored.contains(cell)) {
            let index = [extent.index(cell).unwrap() as u32];
            if is_free(cell) { map.note_free(&index) } else { map.note_wall(&index) }
        }
        map
    }

    #[test]
    fn viewpoint_shows_what_is_behind_its_frontier() {
        let (middle, niche) = (Cell::new(1, 1, 1), Cell::new(4, 1, 1));
        let (ahead, around_the_corner) = (Cell::new(5, 1, 1), Cell::new(4, 2, 1));
        let moves = Moves::new(1.2, 1.0, Neighbours::TwentySix);
        for (unexplored, expected) in
            [(vec![ahead], Some((niche, middle))), (vec![around_the_corner], None), (vec![], None)]
        {
            let map = room(&unexplored);
            let mut graph = AbstractGraph::new(map.extent(), 1.2);
            graph.update(Graph::new(&map, &moves));
            let id = graph.region_of(middle).unwrap();
            let region = (id, graph.get(id).unwrap());
            assert_eq!(region.1.frontiers, if unexplored.is_empty() { vec![] } else { vec![niche] });
            let sight = Sight { map: &map, lattice: moves.lattice(), view: None };
            assert_eq!(nearest_viewpoint(&graph, sight, region, middle, &BTreeSet::new()), expected, "{unexplored:?}");
            assert!(seen_from(&graph, region, middle).eq(region.1.frontiers.iter().copied()));
        }
    }
}
