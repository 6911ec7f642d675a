//! The places that search mode has visited, and when.

use msgs::ids::Tick;
use voxels::Cell;

/// A place with its visits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Place {
    cell: Cell,
    visits: u64,
    last: Tick,
}

/// All visited places. Cells within the merging distance of a place are the same place.
#[derive(Debug, Clone)]
pub(crate) struct Places {
    merge_cells: f64,
    places: Vec<Place>,
}

impl Places {
    /// No places yet; cells whose centres are at most `merge_cells` cells apart are one place.
    pub(crate) fn new(merge_cells: f64) -> Self {
        Self { merge_cells, places: Vec::new() }
    }

    /// Whether two cells are one place.
    pub(crate) fn is_same(&self, one: Cell, other: Cell) -> bool {
        f64::from(squared(one - other)) <= self.merge_cells * self.merge_cells
    }

    /// The number of visits to a place, and the last one.
    pub(crate) fn visits(&self, cell: Cell) -> (u64, Option<Tick>) {
        self.find(cell).map_or((0, None), |at| (self.places[at].visits, Some(self.places[at].last)))
    }

    /// Records a visit.
    pub(crate) fn visit(&mut self, cell: Cell, now: Tick) {
        match self.find(cell) {
            Some(at) => {
                self.places[at].visits += 1;
                self.places[at].last = now;
            }
            None => self.places.push(Place { cell, visits: 1, last: now }),
        }
    }

    /// The first cell never visited, else the one visited longest ago.
    pub(crate) fn longest_ago(&self, cells: &[Cell]) -> Option<Cell> {
        cells.iter().copied().min_by_key(|&cell| self.visits(cell).1)
    }

    /// The nearest place within the merging distance, of several the first one visited.
    fn find(&self, cell: Cell) -> Option<usize> {
        let same = (0..self.places.len()).filter(|&at| self.is_same(self.places[at].cell, cell));
        same.min_by_key(|&at| squared(self.places[at].cell - cell))
    }
}

/// The squared length of a cell offset, in cells. Axes have at most 1024 cells.
pub(crate) fn squared(offset: Cell) -> i32 {
    let square = |along: i32| along.saturating_mul(along);
    square(offset.x).saturating_add(square(offset.y)).saturating_add(square(offset.z))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nearby_cells_are_one_place() {
        let mut places = Places::new(2.0);
        assert_eq!(places.visits(Cell::new(5, 5, 5)), (0, None));
        places.visit(Cell::new(5, 5, 5), Tick(3));
        places.visit(Cell::new(5, 7, 5), Tick(8));
        assert_eq!(places.visits(Cell::new(4, 5, 5)), (2, Some(Tick(8))));
        places.visit(Cell::new(5, 8, 5), Tick(9));
        assert_eq!(places.visits(Cell::new(5, 7, 5)), (1, Some(Tick(9))));
        assert_eq!(places.visits(Cell::new(9, 9, 9)), (0, None));
    }

    #[test]
    fn place_visited_longest_ago_comes_first() {
        let mut places = Places::new(0.0);
        let [first, second, third, fourth] = [1, 2, 3, 4].map(|x| Cell::new(x, 0, 0));
        for (cell, tick) in [(first, 5), (second, 6), (first, 7)] {
            places.visit(cell, Tick(tick));
        }
        assert_eq!(places.longest_ago(&[first, second, third, fourth]), Some(third));
        // Fewer visits do not matter.
        assert_eq!(places.longest_ago(&[first, second]), Some(second));
        places.visit(second, Tick(8));
        places.visit(second, Tick(9));
        assert_eq!(places.longest_ago(&[second, first]), Some(first));
        assert_eq!(places.longest_ago(&[]), None);
    }
}
