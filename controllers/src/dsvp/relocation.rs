//! The stages without gain nearby: relocation to a frontier, for wide bodies to where they see what
//! they cannot come near, and pursuit of other agents without any.

use std::collections::BTreeSet;
use std::task::Poll;

use rand::seq::IndexedRandom;

use super::avoidance::{motion_along, motion_to};
use super::coordination::Coordination;
use super::goal::Goal;
use super::obstacles::Obstacles;
use super::{ATTEMPTS, Dsvp, Plan, by_distance};
use crate::Ctx;
use crate::viewpoints::Viewpoints;
use agent::abstract_graph::{AbstractGraph, Region, RegionId};
use agent::observation::Observation;
use agent::path::{Goal as SearchGoal, Neighbours, Search};
use voxels::Cell;

impl<C: Coordination> Dsvp<C> {
    /// The relocation stage: to the nearest frontier, or to the one of least cost beside
    /// the goals of others.
    pub(super) fn relocate(&mut self, observation: &Observation, ctx: &mut Ctx<'_>, obstacles: &Obstacles) -> Plan {
        let Self { graph, paths, coordination, .. } = self;
        let here = ctx.cell();
        let cell_m = ctx.map().extent().cell_m();
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
            let Some((frontier, cell)) = nearest_viewpoint(graph, (id, region), here, &self.abandoned) else {
                continue;
            };
            if cell == here {
                let seen_from_here = |frontier: &&Cell| viewpoint(graph, id, region.centre, **frontier) == here;
                self.abandoned.extend(region.frontiers.iter().filter(seen_from_here));
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
        if best.is_empty() { Plan::Nothing } else { Plan::Blocked }
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
        let is_open = |cell| !obstacles.occupy(cell);
        let moves = ctx.graph(Neighbours::TwentySix);
        let path = Search::new(moves, here, SearchGoal::Cell(viewpoint.cell)).within(&is_open).run();
        match path.and_then(|path| motion_along(ctx, &path, obstacles, self.params.waypoints)) {
            Some(motion) => Plan::Go(Goal::Sight { cell: viewpoint.cell, target: viewpoint.target }, motion),
            None => Plan::Blocked,
        }
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
        Plan::Blocked
    }
}

/// The frontier of a region nearest to a cell, without those left out, and its viewpoint.
pub(super) fn nearest_viewpoint(
    graph: &AbstractGraph,
    (id, region): (RegionId, &Region),
    here: Cell,
    left_out: &BTreeSet<Cell>,
) -> Option<(Cell, Cell)> {
    let open = region.frontiers.iter().filter(|frontier| region.has_rest() && !left_out.contains(frontier));
    let &frontier = open.min_by(|a, b| by_distance(here, a, b))?;
    Some((frontier, viewpoint(graph, id, region.centre, frontier)))
}

/// The viewpoint of a frontier: the frontier itself, or the centre of its region if the body cannot
/// rest there.
pub(super) fn viewpoint(graph: &AbstractGraph, region: RegionId, centre: Cell, frontier: Cell) -> Cell {
    if graph.can_rest(region, frontier) { frontier } else { centre }
}
