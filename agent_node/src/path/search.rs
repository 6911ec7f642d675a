//! A* on a graph, and its relatives without an estimate of what is left (Dijkstra's algorithm).
//!
//! Cells are expanded in the order of (cost of the way to them and estimate of the rest, estimate, index), which is total, and
//! a cell keeps the first of several ways that cost the same. The estimate is consistent, so no cell is expanded twice.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use voxels::Cell;

use super::{Graph, Path};

/// What searches write on. One is enough for any number of searches, one after the other.
///
/// It takes 16 bytes per cell of the map, and 16 more for every entry of the queue. Nothing is taken before the first search,
/// and then only what searches have really visited, where the system provides memory page by page; a search clears nothing.
#[derive(Debug, Default)]
pub struct Scratch {
    /// Per cell: cost of the best way to it; mark.
    nodes: Vec<[u64; 2]>,
    /// Of the present search; a mark of another one means nothing.
    epoch: u64,
    /// Cost and estimate; estimate; cell.
    queue: BinaryHeap<Reverse<(u64, u32, u32)>>,
}

/// A mark holds, from its lowest bit: the step that led to the cell, whether it is a goal, whether it was expanded, the epoch.
const STEP: u64 = 0x1f;
const IS_GOAL: u64 = 0x40;
const IS_EXPANDED: u64 = 0x80;
const EPOCH_SHIFT: u32 = 8;

impl Scratch {
    /// Without any memory yet.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    fn begin(&mut self, cells: usize) {
        if self.nodes.len() < cells {
            // Not grown in place: memory that is zero from the start costs nothing until it is used.
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

/// What a search looks for.
#[derive(Clone, Copy)]
pub enum Goal<'g> {
    /// This cell.
    Cell(Cell),
    /// The nearest of these cells, in any order; of several that are equally near, the one with the lowest index.
    AnyOf(&'g [Cell]),
    /// The nearest cell of which this holds; ties as before. Asked once for each cell expanded, the start included.
    Where(&'g dyn Fn(Cell) -> bool),
}

/// How far a search has come.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Progress {
    /// It has not ended.
    Searching,
    /// It has ended with a cheapest way.
    Found(Path),
    /// It has ended; there is no way.
    NoPath,
}

/// A search that can be made in pieces; how it is cut does not change what is found.
///
/// It borrows the map, so the map stands still meanwhile; see [`super::Budgeted`] and [`super::Background`] for answers that
/// take time although the world goes on.
///
/// The start is the cell that the body is in: it need not be usable, and what the body touches there does not hinder its first
/// step. If no goal is usable (nor the start), there is no path, at once.
pub struct Search<'a> {
    graph: Graph<'a>,
    scratch: &'a mut Scratch,
    goal: Goal<'a>,
    start: Cell,
    /// How each step changes the index of a cell.
    strides: [isize; 26],
    /// Where the estimate leads to, if there is one.
    ahead: Option<Cell>,
    found: Option<Cell>,
    /// Cells marked as goals.
    goals: usize,
    expansions: u64,
    /// After so many it gives up.
    expansions_max: u64,
    /// No other cells are entered.
    is_open: Option<&'a dyn Fn(Cell) -> bool>,
}

impl<'a> Search<'a> {
    /// Prepares a search; nothing is expanded yet.
    #[must_use]
    pub fn new(graph: Graph<'a>, scratch: &'a mut Scratch, start: Cell, goal: Goal<'a>) -> Self {
        let extent = graph.map().extent();
        scratch.begin(extent.volume());
        let [size_x, size_y, _] = extent.size().map(|cells| cells as isize);
        let mut strides = [0; 26];
        for (stride, step) in strides.iter_mut().zip(&graph.moves().steps) {
            *stride = (step.by.z as isize * size_y + step.by.y as isize) * size_x + step.by.x as isize;
        }
        let mut search = Self {
            graph,
            scratch,
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
            search.scratch.queue.push(Reverse((u64::from(estimate), estimate, index as u32)));
        }
        search
    }

    /// The same search, through no other cells than those that are open; that the start is not does not matter.
    #[must_use]
    pub fn within(mut self, is_open: &'a dyn Fn(Cell) -> bool) -> Self {
        self.is_open = Some(is_open);
        self
    }

    /// The same search, which finds no way if it would have to expand more cells than so many.
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

    /// Expands at most so many cells more. After the end it says again what was found.
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

    /// Searches to the end: the answer that costs no time. `None`: there is no way.
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

    fn estimate(&self, cell: Cell) -> u32 {
        self.ahead.map_or(0, |goal| self.graph.moves().estimate(cell, goal))
    }

    fn is_goal(&self, cell: Cell, index: usize) -> bool {
        match self.goal {
            Goal::Cell(_) | Goal::AnyOf(_) => self.scratch.nodes[index][1] & IS_GOAL != 0,
            Goal::Where(holds) => holds(cell),
        }
    }

    /// The next cell to expand, with its index.
    fn next(&mut self) -> Option<(Cell, usize)> {
        while self.expansions < self.expansions_max
            && let Some(Reverse((_, _, index))) = self.scratch.queue.pop()
        {
            let index = index as usize;
            let mark = &mut self.scratch.nodes[index][1];
            // A cell is in the queue once for every way that was the best one to it for a time.
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
        let mut open = if cell == self.start { self.graph.steps_from_start(cell) } else { self.graph.steps_from(cell) };
        while open != 0 {
            let number = open.trailing_zeros() as usize;
            open &= open - 1;
            let step = &self.graph.moves().steps[number];
            let to = index.wrapping_add_signed(self.strides[number]);
            if self.is_open.is_some_and(|is_open| !is_open(cell + step.by)) {
                continue;
            }
            let cost = so_far + step.cost;
            let node = self.scratch.node(to);
            if cost < node[0] {
                *node = [cost, node[1] & !STEP | number as u64];
                let estimate = self.estimate(cell + step.by);
                self.scratch.queue.push(Reverse((cost + u64::from(estimate), estimate, to as u32)));
            }
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

/// Searches to the end at once. `None`: there is no way.
#[must_use]
pub fn find(graph: Graph<'_>, scratch: &mut Scratch, start: Cell, goal: Goal<'_>) -> Option<Path> {
    Search::new(graph, scratch, start, goal).run()
}

/// The costs of the cheapest ways from one cell to each of several, in units of [`super::EDGE_COST`]; `None` where there is no
/// way. Ends with the last of the goals that can be reached, or after all that can be reached if one cannot.
#[must_use]
pub fn distances(graph: Graph<'_>, scratch: &mut Scratch, start: Cell, goals: &[Cell]) -> Vec<Option<u64>> {
    let mut search = Search::new(graph, scratch, start, Goal::AnyOf(goals));
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
