//! A* search on a graph, and its variants without a heuristic (Dijkstra's algorithm).
//!
//! Cells are expanded in the order of (cost so far + heuristic, heuristic, index), which is total,
//! and a cell keeps the first of several paths of equal cost. The heuristic is consistent, so no
//! cell is expanded twice.

use std::cell::RefCell;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

use voxels::Cell;

use super::graph::Steps;
use super::{EDGE_COST, Graph, Path};

/// Scratch memory of searches, reusable for any number of searches, one after the other.
///
/// It takes 16 bytes per cell of the map, and 16 more per entry of the queue. It is allocated at
/// the first search, and used only for cells that searches visit, where the system provides memory
/// page by page; a search clears nothing.
#[derive(Debug, Default)]
struct Scratch {
    /// Per cell: cost of the best path to it; mark.
    nodes: Vec<[u64; 2]>,
    /// The epoch of the present search; marks of other epochs are stale.
    epoch: u64,
    /// Of each entry, from its highest bits: cost plus heuristic (64), heuristic (32), cell (32).
    queue: BinaryHeap<Reverse<u128>>,
}

/// An entry of the queue.
fn entry(cost: u64, estimate: u32, index: usize) -> Reverse<u128> {
    Reverse(u128::from(cost + u64::from(estimate)) << 64 | u128::from(estimate) << 32 | index as u128)
}

/// A mark holds, from its lowest bit: the step that led to the cell, whether it is a goal, whether
/// it was expanded, the epoch.
const STEP: u64 = 0x1f;
const IS_GOAL: u64 = 0x40;
const IS_EXPANDED: u64 = 0x80;
const EPOCH_SHIFT: u32 = 8;

thread_local! {
    /// Scratch memory that no search uses at present: mostly one, which the searches of all agents
    /// of a thread use in turn.
    static SPARE: RefCell<Vec<Scratch>> = const { RefCell::new(Vec::new()) };
}

impl Scratch {
    /// Of this thread, for a search on a map of so many cells.
    fn take(cells: usize) -> Self {
        let mut scratch = SPARE.with_borrow_mut(Vec::pop).unwrap_or_default();
        scratch.begin(cells);
        scratch
    }

    fn begin(&mut self, cells: usize) {
        // Exactly as many: a thread does not keep the memory of a larger map.
        if self.nodes.len() != cells {
            // Not grown in place: zeroed memory costs nothing until it is used.
            self.nodes = vec![[0; 2]; cells];
        }
        self.epoch += 1;
        self.queue.clear();
    }

    /// The node of a cell in the present search.
    #[inline]
    fn node(&mut self, index: usize) -> &mut [u64; 2] {
        let node = &mut self.nodes[index];
        if node[1] >> EPOCH_SHIFT != self.epoch {
            *node = [u64::MAX, self.epoch << EPOCH_SHIFT];
        }
        node
    }
}

/// The goal of a search.
#[derive(Clone, Copy)]
pub enum Goal<'g> {
    /// This cell.
    Cell(Cell),
    /// The nearest of these cells, in any order; ties go to the lowest index.
    AnyOf(&'g [Cell]),
    /// The nearest cell with this property in which the body can rest; ties as before. Evaluated
    /// once for each expanded cell, the start included.
    Where(&'g dyn Fn(Cell) -> bool),
}

/// The progress of a search.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Progress {
    /// The search has not ended.
    Searching,
    /// The search has ended with a cheapest path.
    Found(Path),
    /// The search has ended; there is no path.
    NoPath,
}

/// A search that can run in slices; the slicing does not change the result.
///
/// It borrows the map, which cannot change meanwhile; [`super::Budgeted`] and [`super::Background`]
/// are results that take sim time while the simulation continues.
///
/// The start is the cell of the body: it need not be usable, and cells that the body touches there
/// do not block its first step. If no goal is usable (nor the start), there is no path, at once.
pub struct Search<'a> {
    graph: Graph<'a>,
    steps: Steps<'a>,
    /// Returned to the thread at the end.
    scratch: Scratch,
    goal: Goal<'a>,
    start: Cell,
    /// The change of the cell index by each step.
    strides: [isize; 26],
    /// The target of the heuristic, if there is one.
    ahead: Option<Cell>,
    found: Option<Cell>,
    /// Cells marked as goals.
    goals: usize,
    expansions: u64,
    /// Limit of expansions.
    expansions_max: u64,
    /// If set, only these cells are entered.
    is_open: Option<&'a dyn Fn(Cell) -> bool>,
}

impl Drop for Search<'_> {
    fn drop(&mut self) {
        let scratch = std::mem::take(&mut self.scratch);
        // A thread that ends has no use for it any more.
        let _ = SPARE.try_with(|spare| spare.borrow_mut().push(scratch));
    }
}

impl<'a> Search<'a> {
    /// Prepares a search; nothing is expanded yet.
    #[must_use]
    pub fn new(graph: Graph<'a>, start: Cell, goal: Goal<'a>) -> Self {
        let extent = graph.map().extent();
        let [size_x, size_y, _] = extent.size().map(|cells| cells as isize);
        let mut strides = [0; 26];
        for (stride, step) in strides.iter_mut().zip(&graph.moves().steps) {
            *stride = (step.by.z as isize * size_y + step.by.y as isize) * size_x + step.by.x as isize;
        }
        let mut search = Self {
            graph,
            steps: graph.steps(),
            scratch: Scratch::take(extent.volume()),
            goal,
            start,
            strides,
            ahead: None,
            found: None,
            goals: 0,
            expansions: 0,
            expansions_max: u64::MAX,
            is_open: None,
        };
        let can_be_found = match goal {
            Goal::Cell(cell) => search.mark_goals(&[cell]),
            Goal::AnyOf(cells) => search.mark_goals(cells),
            Goal::Where(_) => true,
        };
        if let Some(index) = extent.index(start).filter(|_| can_be_found) {
            let estimate = search.estimate(start);
            search.scratch.node(index)[0] = 0;
            search.scratch.queue.push(entry(0, estimate, index));
        }
        search
    }

    /// Restricts the search to open cells; the start need not be open.
    #[must_use]
    pub fn within(mut self, is_open: &'a dyn Fn(Cell) -> bool) -> Self {
        self.is_open = Some(is_open);
        self
    }

    /// Limits the number of expansions, beyond which no path is found.
    #[must_use]
    pub fn at_most(mut self, expansions_max: u64) -> Self {
        self.expansions_max = expansions_max;
        self
    }

    fn mark_goals(&mut self, cells: &[Cell]) -> bool {
        for &cell in cells {
            if let Some(index) = self.graph.map().extent().index(cell)
                && (cell == self.start || self.graph.is_usable(cell))
            {
                let mark = &mut self.scratch.node(index)[1];
                self.goals += usize::from(*mark & IS_GOAL == 0);
                *mark |= IS_GOAL;
                self.ahead = (self.goals == 1).then_some(cell);
            }
        }
        self.goals > 0
    }

    /// Expands at most this many more cells. After the end it repeats the result.
    pub fn step(&mut self, max_expansions: u64) -> Progress {
        let end = self.expansions.saturating_add(max_expansions);
        while self.found.is_none() {
            if self.expansions >= end {
                return if self.scratch.queue.is_empty() { Progress::NoPath } else { Progress::Searching };
            }
            let Some((cell, index)) = self.next() else {
                return Progress::NoPath;
            };
            if self.is_goal(cell, index) {
                self.found = Some(cell);
            } else {
                self.expand(cell, index);
            }
        }
        self.found.map_or(Progress::NoPath, |goal| Progress::Found(self.path_to(goal)))
    }

    /// Runs to the end, without sim time. `None`: there is no path.
    #[must_use]
    pub fn run(&mut self) -> Option<Path> {
        match self.step(u64::MAX) {
            Progress::Found(path) => Some(path),
            Progress::Searching | Progress::NoPath => None,
        }
    }

    /// Cells expanded so far, the goal included.
    #[must_use]
    pub fn expansions(&self) -> u64 {
        self.expansions
    }

    /// Length of the cheapest path to a cell that has been expanded, in cells.
    ///
    /// # Panics
    /// If the cell is outside the map.
    #[must_use]
    pub fn length_cells(&self, cell: Cell) -> f64 {
        let index = self.graph.map().extent().index(cell).expect("cells that were expanded lie in the map");
        self.scratch.nodes[index][0] as f64 / EDGE_COST as f64
    }

    fn estimate(&self, cell: Cell) -> u32 {
        self.ahead.map_or(0, |goal| self.graph.moves().estimate(cell, goal))
    }

    fn is_goal(&self, cell: Cell, index: usize) -> bool {
        match self.goal {
            Goal::Cell(_) | Goal::AnyOf(_) => self.scratch.nodes[index][1] & IS_GOAL != 0,
            Goal::Where(holds) => holds(cell) && self.graph.can_rest(cell),
        }
    }

    /// The next cell to expand, with its index.
    fn next(&mut self) -> Option<(Cell, usize)> {
        while self.expansions < self.expansions_max
            && let Some(Reverse(first)) = self.scratch.queue.pop()
        {
            let index = first as u32 as usize;
            let mark = &mut self.scratch.nodes[index][1];
            // A cell is in the queue once for every path that was the best one at some time.
            if *mark & IS_EXPANDED == 0 {
                *mark |= IS_EXPANDED;
                self.expansions += 1;
                return Some((self.graph.map().extent().cell_at(index), index));
            }
        }
        None
    }

    fn expand(&mut self, cell: Cell, index: usize) {
        let so_far = self.scratch.nodes[index][0];
        let mut open = self.steps.bits(cell, cell == self.start);
        while open != 0 {
            let number = open.trailing_zeros() as usize;
            open &= open - 1;
            let step = &self.graph.moves().steps[number];
            let to = index.wrapping_add_signed(self.strides[number]);
            let cost = so_far + step.cost;
            let node = self.scratch.node(to);
            if cost >= node[0] {
                continue;
            }
            if self.is_open.is_some_and(|is_open| !is_open(cell + step.by)) {
                // No path to it is better, so it is looked at once.
                node[0] = 0;
                continue;
            }
            *node = [cost, node[1] & !STEP | number as u64];
            let estimate = self.estimate(cell + step.by);
            self.scratch.queue.push(entry(cost, estimate, to));
        }
    }

    fn path_to(&self, goal: Cell) -> Path {
        let node = |cell: Cell| {
            let index = self.graph.map().extent().index(cell).expect("cells that were expanded lie in the map");
            self.scratch.nodes[index]
        };
        let mut cells = vec![goal];
        let mut cell = goal;
        while cell != self.start {
            cell = cell - self.graph.moves().steps[(node(cell)[1] & STEP) as usize].by;
            cells.push(cell);
        }
        cells.reverse();
        Path { cells, cost: node(goal)[0] }
    }
}

/// Runs a search to the end. `None`: there is no path.
#[must_use]
pub fn find(graph: Graph<'_>, start: Cell, goal: Goal<'_>) -> Option<Path> {
    Search::new(graph, start, goal).run()
}

/// The costs of the cheapest paths from one cell to several, in units of [`super::EDGE_COST`];
/// `None` where there is no path. Ends with the last reachable goal, or after all reachable cells
/// if a goal is unreachable.
#[must_use]
pub fn distances(graph: Graph<'_>, start: Cell, goals: &[Cell]) -> Vec<Option<u64>> {
    nearest_distances(graph, start, goals, usize::MAX)
}

/// As [`distances`], but ends with the `count` nearest goals, ties by index. The others have
/// `None`.
#[must_use]
pub fn nearest_distances(graph: Graph<'_>, start: Cell, goals: &[Cell], count: usize) -> Vec<Option<u64>> {
    let mut search = Search::new(graph, start, Goal::AnyOf(goals));
    // Several goals have no heuristic, so they come in the order of their costs.
    search.goals = search.goals.min(count);
    while search.goals > 0
        && let Some((cell, index)) = search.next()
    {
        search.goals -= usize::from(search.is_goal(cell, index));
        search.expand(cell, index);
    }
    let extent = graph.map().extent();
    let cost = |&goal: &Cell| {
        let [cost, mark] = *search.scratch.node(extent.index(goal)?);
        (mark & IS_EXPANDED != 0).then_some(cost)
    };
    goals.iter().map(cost).collect()
}
