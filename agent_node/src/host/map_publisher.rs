//! What observers get to see of the agents of a process: their maps, in pieces.
//!
//! Invariant: nothing here changes what an agent answers, and nothing of it waits; the answer comes first.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use msgs::ids::{AgentId, Tick};
use voxels::Extent;

use super::{Host, HostedAgent, RECEIVE_TIMEOUT, now};
use crate::map_markers::MapMarkers;
use crate::transport::Level;

/// Wall time between two pieces of one map: a reader must be able to take each before the next comes.
const MARKER_PERIOD: Duration = Duration::from_millis(10);

/// Pieces that are shown at the end in one go: readers that are there for a moment longer would rather have them than not.
const FINAL_MARKERS_MAX: usize = 64;

/// What has been shown of one agent's map, and when.
pub(super) struct PublishedMap {
    view: MapMarkers,
    observers: u64,
    looked: Option<Instant>,
    published: Option<Instant>,
}

impl PublishedMap {
    pub(super) fn new(extent: Extent) -> Self {
        Self { view: MapMarkers::new(extent), observers: 0, looked: None, published: None }
    }
}

impl Host<'_> {
    /// Shows what has changed of the maps to those who look at them: at most a piece of each. Says how long to wait for the next
    /// message, with as much patience as there is without observers.
    pub(super) fn publish_maps(&mut self) -> Duration {
        let Some(observers) = self.transport.observers().cloned() else { return RECEIVE_TIMEOUT };
        let look_period = Duration::from_secs_f64(1.0 / self.map_hz);
        for (id, observers) in observers {
            let Some(hosted) = self.agents.get_mut(&id) else { continue };
            let PublishedMap { view, observers: before, looked, published } = &mut hosted.published;
            if std::mem::replace(before, observers) < observers {
                view.show_again();
            }
            if looked.is_none_or(|looked| looked.elapsed() >= look_period) {
                *looked = Some(now());
                view.look(hosted.agent.map());
            }
            let tick = hosted.agent.last_tick().unwrap_or(Tick::ZERO);
            if published.is_none_or(|published| published.elapsed() >= MARKER_PERIOD)
                && let Some(part) = view.next(hosted.agent.map(), tick)
            {
                *published = Some(now());
                self.transport.publish_map(id, &part);
            }
        }
        MARKER_PERIOD
    }

    /// Shows what is left of a map at the end of the run.
    pub(super) fn publish_rest(&mut self, id: AgentId) {
        let Some(hosted) = self.agents.get_mut(&id) else { return };
        if self.transport.observers().is_none_or(|observers| !observers.contains_key(&id)) {
            return;
        }
        hosted.published.view.look(hosted.agent.map());
        let tick = hosted.agent.last_tick().unwrap_or(Tick::ZERO);
        for _ in 0..FINAL_MARKERS_MAX {
            let Some(part) = hosted.published.view.next(hosted.agent.map(), tick) else { break };
            self.transport.publish_map(id, &part);
        }
    }

    /// What has been shown of the agents, for a run that begins again.
    pub(super) fn published(&mut self) -> BTreeMap<AgentId, PublishedMap> {
        let begun_again = |(id, mut hosted): (AgentId, HostedAgent)| {
            hosted.published.view.begin_again();
            (id, hosted.published)
        };
        std::mem::take(&mut self.agents).into_iter().map(begun_again).collect()
    }

    /// Tells people something of all agents that are still here.
    pub(super) fn log_for_all(&mut self, level: Level, text: &str) {
        for &id in self.agents.keys() {
            self.transport.log(id, level, text);
        }
    }
}
