//! Breadth-first search for the nearest cell with a property through the free cells of a map.
//!
//! Cells at equal distances come in the order of [`voxels::FACES`] from their predecessors, so the
//! result depends on the map and the query alone.
//!
//! A flood too large for one decision continues in the next tick, on the map of that tick.

use std::collections::VecDeque;
use std::task::Poll;

use msgs::ids::Tick;
use voxels::{Cell, FACES};

use agent::exploration_map::ExplorationMap;

/// The verdict on a cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Verdict {
    /// Ends the search.
    Best,
    /// Second choice, if no cell is best.
    Good,
    /// Third choice, if no cell is good.
    Fair,
    /// Does not qualify.
    No,
}

/// Flood fills, with their memory: one word per cell of the map, which the system provides page by
/// page where floods reach.
#[derive(Debug, Clone, Default)]
pub(crate) struct Flood {
    /// For reached cells the epoch, and in the lowest bits the number of the face it was entered
    /// through.
    marks: Vec<u32>,
    epoch: u32,
    queue: VecDeque<Cell>,
    good: Option<Cell>,
    fair: Option<Cell>,
    /// Start of the present flood, and the tick of its last continuation.
    began: Option<(Cell, Tick)>,
}

const FACE_BITS: u32 = 3;

/// The face number of the start.
const START: u32 = FACES.len() as u32;

impl Flood {
    /// The first cell that is best, else the first good or fair one, around `start` in steps
    /// through faces. The start itself need not be free.
    ///
    /// It examines at most `cells_max` cells. If there are more, the result is pending, and a call
    /// with the same start in the next tick continues.
    pub(crate) fn nearest(
        &mut self,
        map: &ExplorationMap,
        start: Cell,
        cells_max: usize,
        now: Tick,
        judge: impl FnMut(Cell) -> Verdict,
    ) -> Poll<Option<Cell>> {
        let is_continued = self.began.is_some_and(|(cell, tick)| cell == start && tick.next() == now);
        if !(is_continued && self.marks.len() == map.extent().volume()) {
            self.begin(map, start);
        }
        let answer = self.spread(map, cells_max, judge);
        self.began = answer.is_pending().then_some((start, now));
        answer
    }

    fn begin(&mut self, map: &ExplorationMap, start: Cell) {
        let extent = map.extent();
        if self.marks.len() != extent.volume() || self.epoch == u32::MAX >> FACE_BITS {
            *self = Self { marks: vec![0; extent.volume()], ..Self::default() };
        }
        self.epoch += 1;
        (self.good, self.fair, self.began) = (None, None, None);
        self.queue.clear();
        if let Some(index) = extent.index(start) {
            self.marks[index] = self.epoch << FACE_BITS | START;
            self.queue.push_back(start);
        }
    }

    fn spread(
        &mut self,
        map: &ExplorationMap,
        cells_max: usize,
        mut judge: impl FnMut(Cell) -> Verdict,
    ) -> Poll<Option<Cell>> {
        let extent = map.extent();
        for _ in 0..cells_max {
            let Some(cell) = self.queue.pop_front() else { break };
            match judge(cell) {
                Verdict::Best => return Poll::Ready(Some(cell)),
                Verdict::Good => self.good = self.good.or(Some(cell)),
                Verdict::Fair => self.fair = self.fair.or(Some(cell)),
                Verdict::No => {}
            }
            for (face, next) in (0..).zip(cell.neighbours6()) {
                if let Some(index) = extent.index(next)
                    && self.marks[index] >> FACE_BITS != self.epoch
                    && map.state(next).is_free()
                {
                    self.marks[index] = self.epoch << FACE_BITS | face;
                    self.queue.push_back(next);
                }
            }
        }
        if self.queue.is_empty() { Poll::Ready(self.good.or(self.fair)) } else { Poll::Pending }
    }

    /// The cell `steps` steps along the path of the last flood to a reached cell; that cell itself
    /// if it is nearer.
    pub(crate) fn towards(&self, map: &ExplorationMap, goal: Cell, steps: usize) -> Cell {
        let mut path = VecDeque::from([goal]);
        let mut cell = goal;
        while let Some(index) = map.extent().index(cell)
            && let Some(&mark) = self.marks.get(index)
            && mark >> FACE_BITS == self.epoch
            && let Some(&entered_by) = FACES.get((mark & ((1 << FACE_BITS) - 1)) as usize)
        {
            cell = cell - entered_by;
            path.push_front(cell);
            path.truncate(steps + 1);
        }
        path.back().copied().unwrap_or(goal)
    }

    /// Whether there is no path through faces from `from` to `to`, because the free cells around
    /// `from` end before `cells_max` of them are counted. Cells seen through a gap in the map are
    /// often such a pocket, and a search from outside would expand everything else first.
    pub(crate) fn is_cut_off(&mut self, map: &ExplorationMap, from: Cell, to: Cell, cells_max: usize) -> bool {
        let judge = |cell| if cell == to { Verdict::Best } else { Verdict::No };
        self.begin(map, from);
        self.spread(map, cells_max, judge) == Poll::Ready(None)
    }
}

#[cfg(test)]
mod tests {
    use voxels::{Extent, Grid, Terrain};

    use super::*;

    fn known(text: &str) -> ExplorationMap {
        let world: Grid<Terrain> = Grid::from_text(text).unwrap();
        let mut map = ExplorationMap::new(world.extent());
        for (index, terrain) in (0..).zip(world.as_slice()) {
            if *terrain == Terrain::Free {
                map.note_free(&[index]);
            }
        }
        map
    }

    fn at(cell: Cell) -> impl Fn(Cell) -> Verdict {
        move |found| if found == cell { Verdict::Best } else { Verdict::No }
    }

    #[test]
    fn finds_the_nearest_cell_through_free_cells() {
        let map = known("...\n.#.\n.#.\n");
        let mut flood = Flood::default();
        let start = Cell::new(0, 0, 0);
        let goal = Cell::new(2, 0, 0);
        let mut nearest = |start, judge: &dyn Fn(Cell) -> Verdict| flood.nearest(&map, start, 100, Tick(1), judge);
        assert_eq!(nearest(start, &at(goal)), Poll::Ready(Some(goal)));
        assert_eq!(nearest(start, &at(Cell::new(1, 1, 0))), Poll::Ready(None));
        assert_eq!(nearest(Cell::new(0, 9, 0), &|_| Verdict::Best), Poll::Ready(None));
        let good = |cell: Cell| if cell.y == 2 { Verdict::Good } else { Verdict::Fair };
        assert_eq!(nearest(start, &good), Poll::Ready(Some(Cell::new(0, 2, 0))));
        let fair = |cell: Cell| if cell.y == 2 { Verdict::Fair } else { Verdict::No };
        assert_eq!(nearest(start, &fair), Poll::Ready(Some(Cell::new(0, 2, 0))));
    }

    #[test]
    fn continues_in_the_next_tick_or_restarts() {
        let map = known("......\n");
        let [start, goal] = [0, 5].map(|x| Cell::new(x, 0, 0));
        let mut flood = Flood::default();
        let mut nearest = |tick, start| flood.nearest(&map, start, 2, Tick(tick), at(goal));
        assert_eq!([1, 2, 3].map(|tick| nearest(tick, start)), [Poll::Pending, Poll::Pending, Poll::Ready(Some(goal))]);
        // A tick too late, and from elsewhere.
        assert_eq!([5, 6, 8, 9].map(|tick| nearest(tick, start)), [Poll::Pending; 4]);
        assert_eq!(nearest(10, Cell::new(1, 0, 0)), Poll::Pending);
    }

    #[test]
    fn path_of_a_flood_is_known() {
        let map = known("...\n.#.\n.#.\n");
        let mut flood = Flood::default();
        let [start, goal] = [0, 2].map(|x| Cell::new(x, 0, 0));
        assert_eq!(flood.nearest(&map, start, 100, Tick(1), at(goal)), Poll::Ready(Some(goal)));
        let after = [0, 1, 2, 3, 5, 6, 9].map(|steps| flood.towards(&map, goal, steps));
        let path = [(0, 0), (0, 1), (0, 2), (1, 2), (2, 1), (2, 0), (2, 0)].map(|(x, y)| Cell::new(x, y, 0));
        assert_eq!(after, path);
    }

    #[test]
    fn pocket_is_cut_off() {
        let map = known(".#....\n.#.##.\n");
        let mut flood = Flood::default();
        let (pocket, here, there) = (Cell::new(0, 0, 0), Cell::new(2, 0, 0), Cell::new(5, 0, 0));
        assert!(flood.is_cut_off(&map, pocket, here, 9) && flood.is_cut_off(&map, here, pocket, 9));
        assert!(!flood.is_cut_off(&map, there, here, 9));
        // Undecided after so few cells.
        assert!(!flood.is_cut_off(&map, pocket, here, 1));
    }

    #[test]
    fn flood_is_reusable_for_another_map() {
        let mut flood = Flood::default();
        let empty = ExplorationMap::new(Extent::new([1, 1, 1], 1.0).unwrap());
        let mut nearest =
            |map: &ExplorationMap, x| {
                flood.nearest(map, Cell::new(x, 0, 0), 9, Tick(1), |cell| {
                    if cell.x == 0 { Verdict::Best } else { Verdict::No }
                })
            };
        assert_eq!(nearest(&empty, 0), Poll::Ready(Some(Cell::default())));
        assert_eq!(nearest(&known("..\n"), 1), Poll::Ready(Some(Cell::default())));
    }
}
