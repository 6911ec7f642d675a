//! Search results that take sim time: the tick of their availability is fixed at the request, so it
//! depends neither on the machine nor on polling.
//!
//! The third mode is [`super::Search::run`], whose result takes no sim time.

use std::num::NonZeroU64;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::task::Poll;
use std::thread::JoinHandle;

use msgs::ids::Tick;
use voxels::Cell;

use super::{Goal, Graph, Moves, Path, Progress, Search};
use crate::exploration_map::ExplorationMap;

/// A search that costs one tick for every so many expansions.
///
/// It runs at once, on the map at the time of the request, and its result is held back.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Budgeted {
    path: Option<Path>,
    usable_at: Tick,
}

impl Budgeted {
    /// Expansions per tick by default: those of the reference.
    pub const PER_TICK: NonZeroU64 = NonZeroU64::new(100).expect("100 is not 0");

    /// Completes a search. Its result is available at `requested + ceil(expansions / per_tick)`,
    /// counting all expansions of the search.
    #[must_use]
    pub fn new(mut search: Search<'_>, asked: Tick, per_tick: NonZeroU64) -> Self {
        let path = search.run();
        Self { path, usable_at: asked.after(search.expansions().div_ceil(per_tick.get())) }
    }

    /// The tick from which the result is available.
    #[must_use]
    pub fn usable_at(&self) -> Tick {
        self.usable_at
    }

    /// The result, if it is available; `None` as a result: there is no path.
    pub fn poll(&self, now: Tick) -> Poll<Option<&Path>> {
        if now < self.usable_at { Poll::Pending } else { Poll::Ready(self.path.as_ref()) }
    }
}

/// A search on a thread of its own while the clock runs on.
///
/// It searches a snapshot of the map, so its result is that of [`super::find`] at the time of the
/// request. Dropping it ends the thread.
#[derive(Debug)]
pub struct Background {
    usable_at: Tick,
    is_dropped: Arc<AtomicBool>,
    thread: Option<JoinHandle<Option<Path>>>,
    path: Option<Path>,
}

/// Expansions between two checks whether the result is still wanted: some tenths of a millisecond.
const EXPANSIONS_PER_LOOK: u64 = 1024;

impl Background {
    /// Starts a search for the nearest of `goals` on a copy of the map, with at most `cells_max`
    /// expansions; the result is available at `usable_at`.
    ///
    /// If the system grants no thread, the search runs here and now, with the same result.
    #[must_use]
    pub fn start(
        map: &ExplorationMap,
        moves: &Moves,
        start: Cell,
        goals: Vec<Cell>,
        cells_max: u64,
        usable_at: Tick,
    ) -> Self {
        let is_dropped = Arc::new(AtomicBool::new(false));
        let job = {
            let (map, moves, is_dropped) = (map.clone(), moves.clone(), Arc::clone(&is_dropped));
            let goals = goals.clone();
            move || search_unless(&is_dropped, Graph::new(&map, &moves), start, &goals, cells_max)
        };
        let thread = std::thread::Builder::new().name("path".to_owned()).spawn(job).ok();
        let path = match thread {
            Some(_) => None,
            None => search_unless(&is_dropped, Graph::new(map, moves), start, &goals, cells_max),
        };
        Self { usable_at, is_dropped, thread, path }
    }

    /// The tick from which the result is available.
    #[must_use]
    pub fn usable_at(&self) -> Tick {
        self.usable_at
    }

    /// The result, if it is available; `None` as a result: there is no path.
    ///
    /// Blocks on the thread if the tick has come and the result has not; never returns it earlier.
    pub fn poll(&mut self, now: Tick) -> Poll<Option<&Path>> {
        if now < self.usable_at {
            return Poll::Pending;
        }
        if let Some(thread) = self.thread.take() {
            self.path = thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        }
        Poll::Ready(self.path.as_ref())
    }
}

impl Drop for Background {
    fn drop(&mut self) {
        self.is_dropped.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            // Neither the result nor a panic matters any more.
            drop(thread.join());
        }
    }
}

fn search_unless(
    is_dropped: &AtomicBool,
    graph: Graph<'_>,
    start: Cell,
    goals: &[Cell],
    cells_max: u64,
) -> Option<Path> {
    let mut search = Search::new(graph, start, Goal::AnyOf(goals)).at_most(cells_max);
    while !is_dropped.load(Ordering::Relaxed) {
        match search.step(EXPANSIONS_PER_LOOK) {
            Progress::Searching => {}
            Progress::Found(path) => return Some(path),
            Progress::NoPath => return None,
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use voxels::Extent;

    use super::*;
    use crate::path::Neighbours;

    #[test]
    fn dropped_search_ends_its_thread() {
        let extent = Extent::new([60; 3], 1.0).unwrap();
        let mut map = ExplorationMap::new(extent);
        map.note_free(&(0..extent.volume() as u32).collect::<Vec<_>>());
        let moves = Moves::new(0.4, 1.0, Neighbours::TwentySix);
        let goals = vec![Cell::new(59, 59, 59), Cell::new(59, 58, 59)];
        let search = Background::start(&map, &moves, Cell::new(0, 0, 0), goals.clone(), u64::MAX, Tick(10));
        let is_dropped = Arc::clone(&search.is_dropped);
        drop(search);
        // The thread holds the other reference until it ends.
        assert_eq!(Arc::strong_count(&is_dropped), 1);
        let graph = Graph::new(&map, &moves);
        assert_eq!(search_unless(&is_dropped, graph, Cell::new(0, 0, 0), &goals, u64::MAX), None);
    }
}
