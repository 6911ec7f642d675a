//! What onlookers get to see of the agents of a process: their maps, in pieces.
//!
//! Invariant: nothing here changes what an agent answers, and nothing of it waits; the answer comes first.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use msgs::ids::{AgentId, Tick};
use voxels::Extent;

use super::{PATIENCE, Process, Seat, now};
use crate::belief_view::BeliefView;
use crate::link::Level;

/// Wall time between two pieces of one map: a reader must be able to take each before the next comes.
const PIECE_PERIOD: Duration = Duration::from_millis(10);

/// Pieces that are shown at the end in one go: readers that are there for a moment longer would rather have them than not.
const LAST_PIECES_MAX: usize = 64;

/// What has been shown of one agent's map, and when.
pub(super) struct Shown {
    view: BeliefView,
    onlookers: u64,
    looked: Option<Instant>,
    shown: Option<Instant>,
}

impl Shown {
    pub(super) fn new(extent: Extent) -> Self {
        Self { view: BeliefView::new(extent), onlookers: 0, looked: None, shown: None }
    }
}

impl Process<'_> {
    /// Shows what has changed of the maps to those who look at them: at most a piece of each. Says how long to wait for the next
    /// message, with as much patience as there is without onlookers.
    pub(super) fn show_beliefs(&mut self) -> Duration {
        let Some(onlookers) = self.link.onlookers().cloned() else { return PATIENCE };
        let look_period = Duration::from_secs_f64(1.0 / self.map_hz);
        for (id, onlookers) in onlookers {
            let Some(seat) = self.seats.get_mut(&id) else { continue };
            let Shown { view, onlookers: before, looked, shown } = &mut seat.shown;
            if std::mem::replace(before, onlookers) < onlookers {
                view.show_again();
            }
            if looked.is_none_or(|looked| looked.elapsed() >= look_period) {
                *looked = Some(now());
                view.look(seat.agent.map());
            }
            let tick = seat.agent.last_tick().unwrap_or(Tick::ZERO);
            if shown.is_none_or(|shown| shown.elapsed() >= PIECE_PERIOD)
                && let Some(part) = view.next(seat.agent.map(), tick)
            {
                *shown = Some(now());
                self.link.show(id, &part);
            }
        }
        PIECE_PERIOD
    }

    /// Shows what is left of a map at the end of the run.
    pub(super) fn show_last(&mut self, id: AgentId) {
        let Some(seat) = self.seats.get_mut(&id) else { return };
        if self.link.onlookers().is_none_or(|onlookers| !onlookers.contains_key(&id)) {
            return;
        }
        seat.shown.view.look(seat.agent.map());
        let tick = seat.agent.last_tick().unwrap_or(Tick::ZERO);
        for _ in 0..LAST_PIECES_MAX {
            let Some(part) = seat.shown.view.next(seat.agent.map(), tick) else { break };
            self.link.show(id, &part);
        }
    }

    /// What has been shown of the agents, for a run that begins again.
    pub(super) fn shown(&mut self) -> BTreeMap<AgentId, Shown> {
        let begun_again = |(id, mut seat): (AgentId, Seat)| {
            seat.shown.view.begin_again();
            (id, seat.shown)
        };
        std::mem::take(&mut self.seats).into_iter().map(begun_again).collect()
    }

    /// Tells people something of all agents that are still here.
    pub(super) fn tell_all(&mut self, level: Level, text: &str) {
        for &id in self.seats.keys() {
            self.link.log(id, level, text);
        }
    }
}
