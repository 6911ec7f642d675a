//! Where a body is out of the way of another: the nearest cell beside the line on which that one
//! comes, at which it does not close a passage.
//!
//! A body in a lane as wide as itself closes it wherever it stands, so it backs out to where there
//! is room. Whether it closes a passage is decided from the cells around: those that another body
//! can be in beside it have to be connected there, as they are without it.

use std::cell::Cell as Slot;

use msgs::ids::AgentId;
use nalgebra::Point3;
use voxels::Cell;

use crate::Ctx;
use crate::dsvp::avoidance::{Waypoints, motion_along};
use crate::dsvp::obstacles::Obstacles;
use agent::command::Motion;
use agent::observation::{Contact, Observation};
use agent::path::{Goal, Graph, Neighbours, Search};

/// Most cells whose surroundings are looked at, most cells of all these surroundings, and most
/// cells that a search expands. The surroundings of a wide body have many cells.
const EXAMINED_MAX: usize = 1 << 10;
const SURROUNDING_MAX: usize = 1 << 24;
const EXPANSIONS_MAX: u64 = 1 << 16;

/// Cells whose surroundings are looked at are this share of the clearance apart.
const SPACING: f64 = 0.5;

/// The motion to the nearest room that a path clear of `obstacles` leads to. `before`: where the
/// bodies are whose way it leaves, metres, frame `map`. `clearance_m`: the distance between centres
/// at which two bodies pass each other.
pub(super) fn way_to_room(
    ctx: &Ctx<'_>,
    obstacles: &Obstacles,
    before: &[Point3<f64>],
    clearance_m: f64,
) -> Option<Motion> {
    let (here, cell_m) = (ctx.position(), ctx.map().extent().cell_m());
    let graph = ctx.graph(Neighbours::TwentySix);
    let spacing = ((clearance_m / cell_m * SPACING) as i32).max(1);
    let examined = Slot::new(0);
    let side = 2 * reach_cells(clearance_m / cell_m) as usize + 1;
    let examined_max = (SURROUNDING_MAX / side.pow(3)).clamp(1, EXAMINED_MAX);
    let is_room = |cell: Cell| {
        let is_due = [cell.x, cell.y, cell.z].iter().all(|along| along % spacing == 0);
        let place = ctx.place(cell);
        let is_out_of_way = || !before.iter().any(|at| is_ahead(at, &here, &place, clearance_m));
        if !is_due || examined.get() == examined_max || !is_out_of_way() {
            return false;
        }
        examined.set(examined.get() + 1);
        keeps_passage(graph, cell, (clearance_m / cell_m).powi(2))
    };
    let is_open = |cell| !obstacles.occupy(cell);
    let search = Search::new(graph, ctx.cell(), Goal::Where(&is_room)).at_most(EXPANSIONS_MAX);
    let path = search.within(&is_open).run()?;
    motion_along(ctx, &path, obstacles, Waypoints::Fewest)
}

/// The motion to the nearest place farther than a distance (metres) from all the bodies whose way
/// it leaves, by a path clear of `obstacles`; `before` as in [`way_to_room`].
pub(super) fn way_back(
    ctx: &Ctx<'_>,
    obstacles: &Obstacles,
    before: &[Point3<f64>],
    distance_m: f64,
) -> Option<Motion> {
    let is_far = |cell: Cell| before.iter().all(|at| (ctx.place(cell) - at).norm() > distance_m);
    let is_open = |cell| !obstacles.occupy(cell);
    let search = Search::new(ctx.graph(Neighbours::TwentySix), ctx.cell(), Goal::Where(&is_far));
    let path = search.at_most(EXPANSIONS_MAX).within(&is_open).run()?;
    motion_along(ctx, &path, obstacles, Waypoints::Fewest)
}

/// Whether an agent in contact that stands at a place (metres, frame `map`) comes to no frontier
/// that is known here, because of this body and of others nearby.
pub(super) fn is_shut_in((agent, at): (AgentId, Point3<f64>), observation: &Observation, ctx: &Ctx<'_>) -> bool {
    let own = Contact { agent: ctx.agent(), position: ctx.position() };
    let others = observation.contacts.iter().filter(|contact| contact.agent != agent);
    let others: Vec<Contact> = others.chain([&own]).cloned().collect();
    let (map, bodies) = (ctx.map(), &ctx.run_info().bodies);
    let obstacles = Obstacles::near(&others, &at, bodies.of(agent).radius_m, bodies, map.extent());
    let is_open = |cell| !obstacles.occupy(cell);
    let from = ctx.cell_near(&at);
    // A confined body is not in a frontier, but before it.
    let reach = if ctx.is_confined() { (ctx.body().radius_m / map.extent().cell_m() + 0.5).ceil() as i32 } else { 0 };
    let is_before_frontier = |cell: Cell| cell != from && map.frontiers_near(cell, reach).next().is_some();
    let search = Search::new(ctx.graph(Neighbours::TwentySix), from, Goal::Where(&is_before_frontier));
    let mut search = search.within(&is_open).at_most(EXPANSIONS_MAX);
    search.run().is_none() && search.expansions() < EXPANSIONS_MAX
}

/// Whether a place is within the clearance of the line from a body at `at` through `here` and on.
fn is_ahead(at: &Point3<f64>, here: &Point3<f64>, place: &Point3<f64>, clearance_m: f64) -> bool {
    let (by, offset) = (here - at, place - at);
    let along_m = by.try_normalize(0.0).map_or(0.0, |along| along.dot(&offset).max(0.0));
    let nearest = by.try_normalize(0.0).map_or(*at, |along| at + along * along_m);
    (place - nearest).norm() < clearance_m
}

/// How far the surroundings of a cell reach along each axis, in which bodies pass each other at
/// this distance; cells.
fn reach_cells(clearance_cells: f64) -> i32 {
    clearance_cells.ceil() as i32 + 1
}

/// Whether what a body can reach around a cell stays connected while another one is there.
/// `clearance_squared`: square of the distance at which they pass each other, cells.
fn keeps_passage(graph: Graph<'_>, cell: Cell, clearance_squared: f64) -> bool {
    let reach = reach_cells(clearance_squared.sqrt());
    let side = 2 * reach + 1;
    let number = |by: Cell| (((by.z + reach) * side + by.y + reach) * side + by.x + reach) as usize;
    let is_beside = |by: Cell| by.distance_squared(Cell::default()) as f64 >= clearance_squared;
    let heights = if graph.moves().are_on_ground() { -1..=1 } else { 0..=0 };
    let steps: Vec<Cell> = Cell::default()
        .neighbours6()
        .into_iter()
        .flat_map(|face| heights.clone().map(move |z| face + Cell::new(0, 0, z)))
        .filter(|&by| by != Cell::default())
        .collect();
    // The cells that are connected with some around, of those that are not left out.
    let flood = |starts: &[Cell], left_out: &dyn Fn(Cell) -> bool| {
        let mut reached = vec![false; (side * side * side) as usize];
        let mut next = Vec::new();
        let mut count = 0;
        let mut enter = |by: Cell, next: &mut Vec<Cell>| {
            let is_near = [by.x, by.y, by.z].iter().all(|along| along.abs() <= reach);
            if is_near && !reached[number(by)] && !left_out(by) && graph.is_usable(cell + by) {
                reached[number(by)] = true;
                count += usize::from(is_beside(by));
                next.push(by);
            }
        };
        starts.iter().for_each(|&by| enter(by, &mut next));
        let mut first_beside = None;
        while let Some(by) = next.pop() {
            if is_beside(by) {
                first_beside = Some(first_beside.map_or(by, |first: Cell| first.min(by)));
            }
            steps.iter().for_each(|&step| enter(by + step, &mut next));
        }
        (count, first_beside)
    };
    let (all, first) = flood(&[Cell::default()], &|_| false);
    first.is_none_or(|first| flood(&[first], &|by| !is_beside(by)).0 == all)
}
