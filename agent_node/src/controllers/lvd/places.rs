//! Places that search mode has led to, and when.

use msgs::ids::Tick;
use voxels::Cell;

/// A place and what is remembered of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Place {
    cell: Cell,
    visits: u64,
    last: Tick,
}

/// All places visited. Cells within the merging distance of a place are the same place.
#[derive(Debug, Clone)]
pub(crate) struct Places {
    merge_cells: f64,
    places: Vec<Place>,
}

impl Places {
    /// None yet; cells whose centres are at most `merge_cells` cells apart are one place.
    pub(crate) fn new(merge_cells: f64) -> Self {
        Self { merge_cells, places: Vec::new() }
    }

    /// Whether two cells are one place.
    pub(crate) fn is_same(&self, one: Cell, other: Cell) -> bool {
        f64::from(squared(one - other)) <= self.merge_cells * self.merge_cells
    }

    /// How often a place was visited, and when last.
    pub(crate) fn visits(&self, cell: Cell) -> (u64, Option<Tick>) {
        self.find(cell).map_or((0, None), |at| (self.places[at].visits, Some(self.places[at].last)))
    }

    /// Notes a visit.
    pub(crate) fn visit(&mut self, cell: Cell, now: Tick) {
        match self.find(cell) {
            Some(at) => {
                self.places[at].visits += 1;
                self.places[at].last = now;
            }
            None => self.places.push(Place { cell, visits: 1, last: now }),
        }
    }

    /// The nearest place that this is, of several the first one visited.
    fn find(&self, cell: Cell) -> Option<usize> {
        let same = (0..self.places.len()).filter(|&at| self.is_same(self.places[at].cell, cell));
        same.min_by_key(|&at| squared(self.places[at].cell - cell))
    }
}

/// The square of the length of a cell offset, in cells. Axes have at most 1024 cells.
pub(crate) fn squared(offset: Cell) -> i32 {
    let square = |along: i32| along.saturating_mul(along);
    square(offset.x).saturating_add(square(offset.y)).saturating_add(square(offset.z))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn near_cells_are_one_place() {
        let mut places = Places::new(2.0);
        assert_eq!(places.visits(Cell::new(5, 5, 5)), (0, None));
        places.visit(Cell::new(5, 5, 5), Tick(3));
        places.visit(Cell::new(5, 7, 5), Tick(8));
        assert_eq!(places.visits(Cell::new(4, 5, 5)), (2, Some(Tick(8))));
        places.visit(Cell::new(5, 8, 5), Tick(9));
        assert_eq!(places.visits(Cell::new(5, 7, 5)), (1, Some(Tick(9))));
        assert_eq!(places.visits(Cell::new(9, 9, 9)), (0, None));
    }
}
