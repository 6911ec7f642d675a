//! How probably an unexplored cell is free, by what is known of the 26 cells around it.
//!
//! Surfaces are smooth: what has known walls around it is mostly wall, and what is surrounded by
//! known free cells is mostly free. The odds are those of a logistic regression over 69 000
//! unexplored cells beside frontiers (see docs/controllers.md), rounded.

use super::gain::WHOLE;
use agent::exploration_map::Around;

/// Log odds without known neighbours, and what each known wall and each known free cell adds.
const LOG_ODDS: f64 = -0.4;
const LOG_ODDS_PER_WALL: f64 = -0.9;
const LOG_ODDS_PER_FREE: f64 = 0.28;

/// As how many known free neighbours the cell before it counts that a ray has found free so far.
const FREE_BEHIND: usize = 8;

/// Where a cell lies on a ray, as far as that says more than its neighbours.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Place {
    /// Beside a cell known to be free.
    AtFrontier,
    /// Behind an unexplored cell that is taken to be free.
    Beyond,
}

/// The probabilities, by the number of known walls and of known free cells around a cell.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Expectation {
    by_neighbours: Box<[[u32; 27]; 27]>,
}

impl Expectation {
    pub(super) fn new() -> Self {
        let mut by_neighbours = Box::new([[0; 27]; 27]);
        for (walls, row) in by_neighbours.iter_mut().enumerate() {
            for (free, chance) in row.iter_mut().enumerate() {
                let log_odds = LOG_ODDS + LOG_ODDS_PER_WALL * walls as f64 + LOG_ODDS_PER_FREE * free as f64;
                *chance = (f64::from(WHOLE) / (1.0 + libm::exp(-log_odds))).round() as u32;
            }
        }
        Self { by_neighbours }
    }

    /// The probability that an unexplored cell is free, in units of 1 / [`WHOLE`].
    pub(super) fn of(&self, around: Around, place: Place) -> u32 {
        let behind = if place == Place::Beyond { FREE_BEHIND } else { 0 };
        self.by_neighbours[usize::from(around.walls)][(usize::from(around.free) + behind).min(26)]
    }
}

#[cfg(test)]
mod tests {
    use voxels::{Cell, Extent};

    use super::*;
    use agent::exploration_map::ExplorationMap;

    #[test]
    fn walls_around_a_cell_make_it_less_probable_and_free_cells_more() {
        let extent = Extent::new([5; 3], 1.0).unwrap();
        let cell = Cell::new(2, 2, 2);
        let expectation = Expectation::new();
        let chance = |walls: usize, free: usize| {
            let mut map = ExplorationMap::new(extent);
            let indices = cell.neighbours26().map(|beside| extent.index(beside).unwrap() as u32);
            map.note_wall(&indices[..walls]);
            map.note_free(&indices[walls..walls + free]);
            expectation.of(map.around(cell), Place::AtFrontier)
        };
        assert!(chance(9, 1) < WHOLE / 100, "a hole in a surface: {}", chance(9, 1));
        assert!(chance(0, 9) > WHOLE * 4 / 5, "an opening: {}", chance(0, 9));
        assert!((1..6).all(|number| chance(number, 3) < chance(number - 1, 3)));
        assert!((1..10).all(|number| chance(3, number) > chance(3, number - 1)));
        let map = ExplorationMap::new(extent);
        let [at, beyond] = [Place::AtFrontier, Place::Beyond].map(|place| expectation.of(map.around(cell), place));
        assert!(at < beyond && beyond <= WHOLE);
    }
}
