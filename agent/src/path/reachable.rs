//! The cells that a confined body can reach, kept up to date with its map.
//!
//! Such a body sees many cells that it cannot come near: a search to one of them would expand
//! everything else first, again and again. What can be reached only grows while cells become known
//! to be free, so an update is a flood (`flood`) that costs as much as what has changed. A wall
//! where a cell was taken to be free may cut off cells that stay in the set: a search says so.

use voxels::{Cell, CellSet};

use super::Graph;
use super::flood::flood;

/// The reachable cells of one body.
#[derive(Debug, Default)]
pub struct Reachable {
    /// Once it has been asked for.
    cells: Option<CellSet>,
    /// Those of them in which it can rest, if it is a ground body.
    resting: Option<CellSet>,
    /// Where the body was then.
    from: Option<Cell>,
    /// Position in the journal of the map up to which changes have been read.
    read: usize,
}

impl Reachable {
    /// Applies the changes of the map since the last update. Begins anew if the cell of the body
    /// was out of reach, for a body that flies only if no step leads from there to what it reached.
    /// Returns whether it has begun anew. The map and the moves of the body must be the same each
    /// time.
    pub fn update(&mut self, graph: Graph<'_>, from: Cell) -> bool {
        let map = graph.map();
        let extent = map.extent();
        let Some(start) = extent.index(from) else { return false };
        let read = std::mem::replace(&mut self.read, map.journal_len());
        let before = self.from.replace(from);
        if read == self.read && before == Some(from) {
            return false;
        }
        let known = self.cells.take().filter(|cells| cells.contains(start) || is_beside(graph, from, cells));
        let is_known = known.is_some();
        let only_start = || {
            let mut cells = CellSet::new(extent.volume());
            cells.insert(start);
            cells
        };
        let resting = self.resting.take().filter(|_| is_known);
        let mut resting = graph.moves().are_on_ground().then(|| resting.unwrap_or_else(only_start));
        let mut cells = known.unwrap_or_else(only_start);
        cells.insert(start);
        let has_left = |&before: &Cell| before != from && !graph.moves().are_on_ground() && !graph.is_usable(before);
        if let Some(index) = before.filter(has_left).and_then(|before| extent.index(before)) {
            cells.remove(index);
        }
        // Near what has been revealed, steps may be open that were blocked by what was unexplored.
        let by = graph.step_reach_cells();
        let reach = Cell::new(by, by, by);
        let revealed = is_known.then(|| map.boxes_revealed_since(read)).into_iter().flatten();
        let boxes = revealed.map(|(low, high)| (low - reach, high + reach));
        flood(graph, from, boxes, &mut cells, resting.as_mut());
        (self.cells, self.resting) = (Some(cells), resting);
        !is_known
    }

    /// Whether the body could reach a cell at the last update, and rest there; that in which it is
    /// counts as well.
    pub fn holds(&self, graph: Graph<'_>, cell: Cell) -> bool {
        graph.map().extent().index(cell).is_some_and(|index| self.contains(index))
    }

    /// [`Reachable::holds`] for the cell with an index.
    pub fn contains(&self, index: usize) -> bool {
        self.goals().is_some_and(|cells| cells.contains(index))
    }

    /// Those of at most 64 cells from an index on that could be reached, one bit each.
    pub fn run(&self, first: usize, count: u32) -> u64 {
        self.goals().map_or(0, |cells| cells.run(first, count))
    }

    /// Whether one of some cells could be reached that is not among others.
    pub fn reaches_any(&self, cells: &CellSet, without: &CellSet) -> bool {
        self.goals().is_some_and(|goals| goals.meets(cells, without))
    }

    /// The cells that it could reach, and rest in.
    fn goals(&self) -> Option<&CellSet> {
        self.resting.as_ref().or(self.cells.as_ref())
    }
}

/// Whether a body that flies, at a cell in which it may have no room, has a step to one of some
/// cells: straight legs end beside walls, between the places of cells.
fn is_beside(graph: Graph<'_>, from: Cell, cells: &CellSet) -> bool {
    let extent = graph.map().extent();
    let is_in = |cell: Cell| extent.index(cell).is_some_and(|index| cells.contains(index));
    !graph.moves().are_on_ground() && graph.steps().next_to(from, true).any(is_in)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use protocol::body_model::BodyModel;
    use voxels::Extent;

    use super::*;
    use crate::exploration_map::ExplorationMap;
    use crate::path::{Goal, Moves, Neighbours, find};

    /// Each decision at a place beside a wall began anew, which took most of its time on large
    /// maps.
    #[test]
    fn body_beside_a_wall_keeps_what_it_reaches() {
        let extent = Extent::new([14, 10, 8], 0.2).unwrap();
        let moves = Moves::new(0.3, 0.2, Neighbours::TwentySix);
        let mut map = ExplorationMap::new(extent);
        let is_inside = |cell: &Cell| (1..13).contains(&cell.x) && (1..9).contains(&cell.y) && (1..7).contains(&cell.z);
        let inside = extent.cells().filter(is_inside).filter_map(|cell| extent.index(cell));
        map.note_free(&inside.map(|index| index as u32).collect::<Vec<u32>>());
        let graph = Graph::new(&map, &moves);
        let (middle, beside) = (Cell::new(7, 5, 4), Cell::new(1, 5, 4));
        let mut kept = Reachable::default();
        for (from, is_first) in [(middle, true), (beside, false), (middle, false), (beside, false)] {
            assert_eq!(kept.update(graph, from), is_first);
            let is_right = |cell: Cell| kept.holds(graph, cell) == (graph.is_usable(cell) || cell == from);
            assert!(!graph.is_usable(beside) && extent.cells().all(is_right), "{from:?}");
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(60))]

        #[test]
        fn cells_are_reachable_if_a_search_finds_a_path(
            radius_m in 0.05..0.5_f64,
            boxes in prop::collection::vec((0..12_i32, 0..8_i32, 0..6_i32, 2..7_i32, 0..14 * 10 * 8_usize), 1..10),
            stays in any::<bool>(),
        ) {
            let extent = Extent::new([14, 10, 8], 0.2).unwrap();
            let moves = Moves::new(radius_m, 0.2, Neighbours::TwentySix);
            let mut map = ExplorationMap::new(extent);
            let mut from = Cell::new(7, 5, 4);
            // A body without room in its cell may have come from where it cannot go back to.
            let mut has_come_far = false;
            let mut kept = Reachable::default();
            for (x, y, z, side, next) in boxes {
                let is_in_box = |cell: &Cell| [cell.x - x, cell.y - y, cell.z - z].iter().all(|by| (0..side).contains(by));
                let cells: Vec<u32> =
                    extent.cells().filter(is_in_box).map(|cell| extent.index(cell).unwrap() as u32).collect();
                map.note_free(&cells);
                let graph = Graph::new(&map, &moves);
                if !stays {
                    from = extent.cell_at(next);
                    has_come_far |= !graph.is_usable(from);
                }
                kept.update(graph, from);
            }
            let graph = Graph::new(&map, &moves);
            for cell in extent.cells() {
                let is_reached = find(graph, from, Goal::Cell(cell)).is_some();
                prop_assert!(kept.holds(graph, cell) == is_reached || has_come_far && !is_reached, "{:?}", cell);
            }
        }

        #[test]
        fn ground_body_reaches_more_as_floors_become_known(
            heights in prop::collection::vec(0..3_i32, 140),
            (step_max_m, slope_max_rad) in prop_oneof![Just((0.2, 0.0)), Just((0.0, 0.7)), Just((0.4, 0.4))],
            boxes in prop::collection::vec((0..12_i32, 0..8_i32, 0..6_i32, 2..7_i32), 1..10),
        ) {
            let extent = Extent::new([14, 10, 8], 0.2).unwrap();
            let body = BodyModel { radius_m: 0.1, step_max_m, slope_max_rad, ..BodyModel::GROUND };
            let moves = Moves::of(&body, 0.2, Neighbours::TwentySix);
            let mut map = ExplorationMap::new(extent);
            let height = |cell: Cell| heights[(cell.y * 14 + cell.x) as usize];
            let from = Cell::new(7, 5, height(Cell::new(7, 5, 0)) + 1);
            let mut kept = Reachable::default();
            for (x, y, z, side) in std::iter::once((5, 3, 0, 5)).chain(boxes) {
                let is_in_box = |cell: &Cell| [cell.x - x, cell.y - y, cell.z - z].iter().all(|by| (0..side).contains(by));
                let index = |cell: Cell| extent.index(cell).unwrap() as u32;
                let (wall, free): (Vec<Cell>, Vec<Cell>) =
                    extent.cells().filter(is_in_box).partition(|&cell| cell.z <= height(cell));
                map.note_free(&free.into_iter().map(index).collect::<Vec<u32>>());
                map.note_wall(&wall.into_iter().map(index).collect::<Vec<u32>>());
                kept.update(Graph::new(&map, &moves), from);
            }
            let graph = Graph::new(&map, &moves);
            for cell in extent.cells() {
                let is_reached = find(graph, from, Goal::Cell(cell)).is_some();
                prop_assert_eq!(kept.holds(graph, cell), is_reached, "{:?}", cell);
            }
        }
    }
}
