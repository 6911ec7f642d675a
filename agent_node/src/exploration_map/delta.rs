//! News of a map, as runs of cells.
//!
//! This module does not know how news travel, nor whether they are true.

use std::ops::Range;

use super::{Change, Finding};

/// What is known of some cells. Each list holds runs of cell indices; those that [`Delta::of`] and the decoder of parcels make
/// ascend, are disjoint, and are as long as they can be.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Delta {
    /// Free cells.
    pub free: Vec<Range<u32>>,
    /// Walls.
    pub wall: Vec<Range<u32>>,
    /// Covered cells, which are free as well.
    pub covered: Vec<Range<u32>>,
}

impl Delta {
    /// Changes in the order in which they were learnt: the last one of a cell is what is said of it.
    #[must_use]
    pub fn of(changes: impl IntoIterator<Item = Change>) -> Self {
        let mut sorted: Vec<u32> = changes.into_iter().map(|change| change.cell << 2 | change.finding as u32).collect();
        // Stable, so that the changes of a cell stay in order.
        sorted.sort_by_key(|word| word >> 2);
        let mut delta = Self::default();
        for (at, &word) in sorted.iter().enumerate() {
            let cell = word >> 2;
            if sorted.get(at + 1).is_some_and(|next| next >> 2 == cell) {
                continue;
            }
            let list = match word & 3 {
                free if free == Finding::Free as u32 => &mut delta.free,
                covered if covered == Finding::Covered as u32 => &mut delta.covered,
                _ => &mut delta.wall,
            };
            match list.last_mut() {
                Some(run) if run.end == cell => run.end += 1,
                _ => list.push(cell..cell + 1),
            }
        }
        delta
    }

    /// How many cells it says something of, each as often as it does.
    #[must_use]
    pub fn len(&self) -> usize {
        let lists = [&self.free, &self.wall, &self.covered];
        lists.into_iter().flatten().map(|run| (run.end.saturating_sub(run.start)) as usize).sum()
    }

    /// Whether it says nothing.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.free.is_empty() && self.wall.is_empty() && self.covered.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_change_of_a_cell_counts_and_cells_become_runs() {
        let change = |cell, finding| Change { cell, finding, from: None };
        let delta = Delta::of([
            change(8, Finding::Free),
            change(3, Finding::Free),
            change(2, Finding::Free),
            change(5, Finding::Free),
            change(4, Finding::Free),
            change(9, Finding::Wall),
            change(5, Finding::Covered),
            change(6, Finding::Wall),
            change(6, Finding::Free),
            change(8, Finding::Wall),
        ]);
        assert_eq!(delta.free, [2..5, 6..7]);
        assert_eq!(delta.covered, [5..6; 1]);
        assert_eq!(delta.wall, [8..10; 1]);
        assert!(!delta.is_empty() && Delta::of([]).is_empty());
    }
}
