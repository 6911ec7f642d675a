//! The waypoints that take a body the least time, on a path and beside it.
//!
//! A body stops at every waypoint, and a submarine turns there: as few legs as possible along the
//! shortest path are seldom the quickest. This is A* over straight legs between the cells of the
//! path and some of those around them, by predicted times; long paths are searched piece by piece.
//! Each cell keeps one way to it, the quickest, whatever turn follows.
//!
//! Source: P. E. Hart, N. J. Nilsson, B. Raphael, "A Formal Basis for the Heuristic Determination
//! of Minimum Cost Paths", IEEE Transactions on Systems Science and Cybernetics 4(2), 1968.
//!
//! Invariants: every leg is clear; by the prediction the waypoints take less time than those that
//! are given, and there are none for ground bodies; they depend on these, the path, the map, the
//! body and its pose alone.

use nalgebra::{Point3, Vector3};
use protocol::limits::PATH_POINTS_MAX;
use voxels::{BodyLattice, Cell};

use super::Path;
use super::graph::is_free;
use super::legs::is_clear;
use super::sweep::{clearance, in_cells, place};
use crate::bodies::{BodyKind, BodyModel, leg_from, leg_s, legs_s};
use crate::exploration_map::ExplorationMap;

/// Cells of a path that are searched at once; the waypoints of the first half are kept. Costs grow
/// with the square; a third more shorten no durations.
const PIECE: usize = 48;

/// Waypoints (metres, frame `map`) that take less time than `fewest`, which lead along the path
/// ([`super::straighten_from`]), if there are any. The body is anywhere in the first cell of the
/// path, with a heading in radians. More than [`PATH_POINTS_MAX`] are cut there.
#[must_use]
pub fn quicker(
    path: &Path,
    fewest: &[Point3<f64>],
    map: &ExplorationMap,
    body: &BodyModel,
    (from, yaw_rad): (&Point3<f64>, f64),
) -> Option<Vec<Point3<f64>>> {
    let cell_m = map.extent().cell_m();
    // The legs of a ground body are those that the floor allows.
    let has_choice = fewest.len() > 1 && body.kind != BodyKind::Ground;
    let radius = clearance(body.radius_m, cell_m).filter(|_| has_choice)?;
    let lattice = BodyLattice::of(body.radius_m, cell_m);
    let legs = Legs { map, body, radius, lattice, cell_m };
    let start = Stop { at: in_cells((*from).into(), cell_m), yaw_rad };
    let found = legs.along(&path.cells, start)?;
    let fewest_s = legs.duration_s(start, fewest.iter().map(|point| in_cells((*point).into(), cell_m)));
    let is_quicker = legs.duration_s(start, found.iter().map(|&cell| place(lattice, cell))) < fewest_s;
    let point = |cell| lattice.place(map.extent(), cell);
    is_quicker.then(|| found.into_iter().take(PATH_POINTS_MAX).map(point).collect())
}

/// Where a body stops, in units of cells, and its heading there.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Stop {
    at: [f64; 3],
    yaw_rad: f64,
}

/// A cell in which a leg may end.
struct Node {
    cell: Cell,
    stop: Stop,
    /// When it is reached on the quickest way found so far, seconds, and the node before it there.
    reached_s: f64,
    before: usize,
    /// No way from here to the goal takes less, seconds.
    rest_s: f64,
    is_open: bool,
}

/// The parts of a leg between whose ends its cells are looked at first.
const PARTS: u32 = 8;

/// The index of the goal among the nodes.
const GOAL: usize = 0;

/// The straight legs of a body on its map.
struct Legs<'m> {
    map: &'m ExplorationMap,
    body: &'m BodyModel,
    /// Its clearance, cells.
    radius: f64,
    lattice: BodyLattice,
    cell_m: f64,
}

impl Legs<'_> {
    /// The cells in which the legs along a path end; `None` if the search does not get ahead.
    fn along(&self, path: &[Cell], start: Stop) -> Option<Vec<Cell>> {
        let (mut here, mut first) = (start, 0);
        let mut ends = Vec::new();
        while first + PIECE < path.len() - 1 {
            let piece = &path[first..=first + PIECE];
            // The last cell of the piece that is in or beside this one.
            let place = |cell: Cell| piece.iter().rposition(|near| near.is_within(cell, 1)).unwrap_or(0);
            let found = self.between(piece, here)?;
            let kept = found.iter().enumerate().take_while(|(leg, (cell, _))| *leg == 0 || place(*cell) <= PIECE / 2);
            let (last, _) = kept.last()?;
            let (cell, stop) = found[last];
            ends.extend(found[..=last].iter().map(|&(cell, _)| cell));
            here = stop;
            first += Some(place(cell)).filter(|&cells| cells > 0)?;
        }
        ends.extend(self.between(&path[first..], here)?.into_iter().map(|(cell, _)| cell));
        Some(ends)
    }

    /// The ends of the legs to the last cell of a piece of a path.
    fn between(&self, piece: &[Cell], start: Stop) -> Option<Vec<(Cell, Stop)>> {
        let (&goal, &home) = (piece.last()?, piece.first()?);
        let mut nodes: Vec<Node> = ends(self.map, piece, goal).map(|cell| self.node(cell, goal)).collect();
        let origin = nodes.len();
        nodes.push(Node { stop: start, reached_s: 0.0, ..self.node(home, goal) });
        while let Some(from) = next(&nodes) {
            nodes[from].is_open = false;
            let (Stop { at, yaw_rad }, reached_s) = (nodes[from].stop, nodes[from].reached_s);
            for to in 0..origin {
                let (node, bound_s) = (&nodes[to], nodes[GOAL].reached_s);
                let is_sooner = |there_s: f64| there_s < node.reached_s && there_s + node.rest_s < bound_s;
                let by = Vector3::from(node.stop.at) - Vector3::from(at);
                // The turn is left out at first, for it costs an arc tangent.
                if !node.is_open || !is_sooner(reached_s + self.least_s(by.norm())) {
                    continue;
                }
                let (leg_s, yaw_rad) = leg_from(self.body, yaw_rad, &by, self.cell_m);
                if is_sooner(reached_s + leg_s) && self.is_clear(at, node.stop.at) {
                    let node = &mut nodes[to];
                    (node.reached_s, node.before, node.stop.yaw_rad) = (reached_s + leg_s, from, yaw_rad);
                }
            }
        }
        let is_reached = nodes[GOAL].reached_s.is_finite();
        let before = |&node: &usize| Some(nodes[node].before).filter(|&before| before != origin);
        let back = std::iter::successors(is_reached.then_some(GOAL), before);
        let mut legs: Vec<(Cell, Stop)> = back.map(|node| (nodes[node].cell, nodes[node].stop)).collect();
        legs.reverse();
        (!legs.is_empty()).then_some(legs)
    }

    /// A node that has not been reached.
    fn node(&self, cell: Cell, goal: Cell) -> Node {
        let (at, end) = (place(self.lattice, cell), place(self.lattice, goal));
        let away = (Vector3::from(end) - Vector3::from(at)).norm();
        let rest_s = if self.is_clear(at, end) {
            self.least_s(away)
        } else {
            // Two legs take least if one of them is as short as possible.
            self.least_s((away - 1.0).max(0.0)) + self.least_s(1.0)
        };
        let stop = Stop { at, yaw_rad: 0.0 };
        Node { cell, stop, reached_s: f64::INFINITY, before: GOAL, rest_s, is_open: true }
    }

    /// Whether a leg is clear. Most are not, and pass through a wall at one of a few points.
    fn is_clear(&self, from: [f64; 3], to: [f64; 3]) -> bool {
        let is_free_at = |part: u32| {
            let along = |axis: usize| from[axis] + (to[axis] - from[axis]) * f64::from(part) / f64::from(PARTS);
            // The map has no negative coordinates.
            let [x, y, z] = [0, 1, 2].map(|axis| along(axis) as i32);
            is_free(self.map, Cell::new(x, y, z))
        };
        (1..PARTS).all(is_free_at) && is_clear(self.map, from, to, self.radius)
    }

    /// The time of a leg of this length in cells without a turn, seconds.
    fn least_s(&self, length: f64) -> f64 {
        leg_s(self.body, length * self.cell_m, 0.0)
    }

    /// The time of the motion along points, in units of cells, seconds.
    fn duration_s(&self, start: Stop, points: impl Iterator<Item = [f64; 3]>) -> f64 {
        legs_s(self.body, (start.at.into(), start.yaw_rad), points.map(Point3::from), self.cell_m)
    }
}

/// The open node that promises the soonest arrival, if it is sooner than the best known.
fn next(nodes: &[Node]) -> Option<usize> {
    let arrival_s = |node: &Node| node.reached_s + node.rest_s;
    let open = nodes.iter().enumerate().filter(|(_, node)| node.is_open);
    let sooner = open.filter(|(_, node)| arrival_s(node) < nodes[GOAL].reached_s);
    sooner.min_by(|(_, a), (_, b)| arrival_s(a).total_cmp(&arrival_s(b))).map(|(index, _)| index)
}

/// The cells in which legs may end: the goal, the cells of the path, and of the free ones around
/// them those of one colour of a chessboard.
fn ends(map: &ExplorationMap, piece: &[Cell], goal: Cell) -> impl Iterator<Item = Cell> {
    let is_of_colour = |cell: &Cell| (cell.x + cell.y + cell.z) % 2 == 0;
    let around = piece.iter().flat_map(|cell| cell.neighbours26()).filter(is_of_colour);
    let mut cells: Vec<Cell> = around.filter(|&cell| is_free(map, cell)).chain(piece.iter().copied()).collect();
    cells.sort_unstable();
    cells.dedup();
    std::iter::once(goal).chain(cells.into_iter().filter(move |&cell| cell != goal))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use voxels::Extent;

    use super::*;
    use crate::path::{Goal, Graph, Moves, Neighbours, find, straighten_from};
    use crate::testing::drawn;
    use crate::testing::is_through_free_cells;

    const BODY: BodyModel = BodyModel::SUBMARINE;

    fn shortest(map: &ExplorationMap, from: Cell, to: Cell) -> Option<Path> {
        let moves = Moves::new(BODY.radius_m, 1.0, Neighbours::TwentySix);
        find(Graph::new(map, &moves), from, Goal::Cell(to))
    }

    fn legs(map: &ExplorationMap) -> Legs<'_> {
        let radius = clearance(BODY.radius_m, 1.0).unwrap();
        Legs { map, body: &BODY, radius, lattice: BodyLattice::Centres, cell_m: 1.0 }
    }

    fn duration_s(map: &ExplorationMap, (from, yaw_rad): (&Point3<f64>, f64), waypoints: &[Point3<f64>]) -> f64 {
        let start = Stop { at: (*from).into(), yaw_rad };
        legs(map).duration_s(start, waypoints.iter().map(|&point| point.into()))
    }

    #[test]
    fn a_detour_spares_a_stop() {
        let map = drawn(
            "##############\n\
             #............#\n\
             #.....##.....#\n\
             #............#\n\
             #............#\n\
             ##############\n",
        );
        let path = shortest(&map, Cell::new(1, 3, 0), Cell::new(12, 3, 0)).unwrap();
        let from = map.extent().centre(path.cells[0]);
        let fewest = straighten_from(&from, &path, &map, BODY.radius_m);
        let quickest = quicker(&path, &fewest, &map, &BODY, (&from, 0.0)).unwrap();
        assert_eq!((fewest.len(), quickest.len()), (3, 2), "{fewest:?} {quickest:?}");
        let [fewest_s, quickest_s] = [&fewest, &quickest].map(|points| duration_s(&map, (&from, 0.0), points));
        assert!(quickest_s < fewest_s - 3.0, "{quickest_s} {fewest_s}");
    }

    #[test]
    fn long_paths_are_searched_piece_by_piece() {
        let row = ["#.##########\n", "#..........#\n", "##########.#\n", "#..........#\n"].concat();
        let map = drawn(&format!("############\n#..........#\n{}############\n", row.repeat(5)));
        let path = shortest(&map, Cell::new(10, 1, 0), Cell::new(10, 21, 0)).unwrap();
        assert!(path.cells.len() > 2 * PIECE, "{}", path.cells.len());
        let start = Stop { at: place(BodyLattice::Centres, path.cells[0]), yaw_rad: 0.0 };
        let found = legs(&map).along(&path.cells, start).unwrap();
        let points: Vec<Point3<f64>> = found.iter().map(|&cell| map.extent().centre(cell)).collect();
        let from = map.extent().centre(path.cells[0]);
        assert!(is_through_free_cells(&map, &from, &points));
        assert_eq!(found.last(), path.cells.last());
        let fewest = straighten_from(&from, &path, &map, BODY.radius_m);
        assert!(duration_s(&map, (&from, 0.0), &points) <= duration_s(&map, (&from, 0.0), &fewest));
    }

    proptest! {
        #[test]
        fn waypoints_are_clear_and_never_slower_than_the_fewest(
            walls in prop::collection::vec(0..5, 12 * 11 * 3),
            ends in prop::array::uniform2(0..12 * 11 * 3_usize),
            yaw_rad in -3.0..3.0,
            aside in prop::array::uniform3(-0.1..0.1_f64),
        ) {
            let extent = Extent::new([12, 11, 3], 1.0).unwrap();
            let mut map = ExplorationMap::new(extent);
            for (index, kind) in (0..).zip(walls) {
                if kind == 0 { map.note_wall(&[index]) } else { map.note_free(&[index]) }
            }
            let Some(path) = shortest(&map, extent.cell_at(ends[0]), extent.cell_at(ends[1])) else { return Ok(()) };
            let from = extent.centre(path.cells[0]) + Vector3::from(aside);
            prop_assume!(is_through_free_cells(&map, &from, &[from]));
            let fewest = straighten_from(&from, &path, &map, BODY.radius_m);
            let quickest = quicker(&path, &fewest, &map, &BODY, (&from, yaw_rad)).unwrap_or_else(|| fewest.clone());
            prop_assert!(is_through_free_cells(&map, &from, &quickest));
            prop_assert_eq!(quickest.last(), fewest.last());
            let [quickest_s, fewest_s] = [&quickest, &fewest].map(|points| duration_s(&map, (&from, yaw_rad), points));
            prop_assert!(quickest_s <= fewest_s + 1e-9, "{quickest_s} {fewest_s}");
        }
    }
}
