//! Publishes the maps of the agents for observers, as markers and in standard messages.
//!
//! Invariant: publishing neither changes nor delays a reply; replies come first.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use msgs::ids::{AgentId, Tick};
use voxels::{Cell, Extent, Terrain};

use super::{Host, HostedAgent, RECEIVE_TIMEOUT};
use crate::transport::{Level, MapView, MapViewMessage, ServerTransport};
use agent::exploration_map::{CellState, ExplorationMap};
use agent::map_markers::MapMarkers;
use protocol::map_views;

/// Wall time between two markers of one map, so that subscribers can keep up.
const MARKER_PERIOD: Duration = Duration::from_millis(10);

/// Most markers published in one go at the end of the run, for subscribers that stay a moment
/// longer.
const FINAL_MARKERS_MAX: usize = 64;

/// Wall time between two standard messages of a map, each of which holds all of it.
const VIEW_PERIOD: Duration = Duration::from_secs(1);

/// The state of one published map.
pub(super) struct PublishedMap {
    view: MapMarkers,
    observers: u64,
    looked: Option<Instant>,
    published: Option<Instant>,
    views: BTreeMap<MapView, PublishedView>,
}

/// What was published last of a standard message.
struct PublishedView {
    observers: u64,
    /// Length of the journal of the map.
    changes: usize,
    at: Instant,
}

impl PublishedMap {
    pub(super) fn new(extent: Extent) -> Self {
        Self { view: MapMarkers::new(extent), observers: 0, looked: None, published: None, views: BTreeMap::new() }
    }
}

impl<T: ServerTransport> Host<T> {
    /// Publishes the changes of the maps to their observers: at most one marker of each map.
    /// Returns how long to wait for the next message: the usual time if there are no observers.
    pub(super) fn publish_maps(&mut self) -> Duration {
        self.publish_views();
        let Some(observers) = self.transport.observers().cloned() else { return RECEIVE_TIMEOUT };
        let now = self.transport.now();
        let look_period = Duration::from_secs_f64(1.0 / self.map_hz);
        for (id, observers) in observers {
            let Some(hosted) = self.agents.get_mut(&id) else { continue };
            let PublishedMap { view, observers: before, looked, published, .. } = &mut hosted.published;
            if std::mem::replace(before, observers) < observers {
                view.show_again();
            }
            if looked.is_none_or(|looked| now.duration_since(looked) >= look_period) {
                *looked = Some(now);
                view.look(hosted.agent.map());
            }
            let tick = hosted.agent.last_tick().unwrap_or(Tick::ZERO);
            if published.is_none_or(|published| now.duration_since(published) >= MARKER_PERIOD)
                && let Some(part) = view.next(hosted.agent.map(), tick)
            {
                *published = Some(now);
                self.transport.publish_map(id, &part);
            }
        }
        MARKER_PERIOD
    }

    /// Publishes the standard messages of the maps that have changed, or that have a new observer.
    fn publish_views(&mut self) {
        let Some(observed) = self.transport.observed_views().cloned() else { return };
        let now = self.transport.now();
        for ((id, view), observers) in observed {
            let Some(hosted) = self.agents.get_mut(&id) else { continue };
            let map = hosted.agent.map();
            let is_due = hosted.published.views.get(&view).is_none_or(|last| {
                let is_new = last.observers < observers;
                is_new || last.changes != map.journal_len() && now.duration_since(last.at) >= VIEW_PERIOD
            });
            if is_due {
                let message = message_of(view, map, hosted.agent.last_tick().unwrap_or(Tick::ZERO));
                let last = PublishedView { observers, changes: map.journal_len(), at: now };
                hosted.published.views.insert(view, last);
                self.transport.publish_view(id, &message);
            }
        }
    }

    /// Publishes what is left of a map at the end of the run.
    pub(super) fn publish_rest(&mut self, id: AgentId) {
        if let Some(hosted) = self.agents.get_mut(&id) {
            // The last one may be less than a period old.
            hosted.published.views.retain(|_, last| last.changes == hosted.agent.map().journal_len());
        }
        self.publish_views();
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

    /// The state of the published maps, kept over a reset.
    pub(super) fn published(&mut self) -> BTreeMap<AgentId, PublishedMap> {
        let begun_again = |(id, mut hosted): (AgentId, HostedAgent)| {
            hosted.published.view.begin_again();
            hosted.published.views.clear();
            (id, hosted.published)
        };
        std::mem::take(&mut self.agents).into_iter().map(begun_again).collect()
    }

    /// Logs a text for all agents that are still running.
    pub(super) fn log_for_all(&mut self, level: Level, text: &str) {
        for &id in self.agents.keys() {
            self.transport.log(id, level, text);
        }
    }
}

/// A map as a standard message of a tick: free cells, and the walls that the agent knows.
fn message_of(view: MapView, map: &ExplorationMap, tick: Tick) -> MapViewMessage {
    let known = |cell: Cell| match map.state(cell) {
        CellState::Unexplored => None,
        CellState::Free | CellState::Covered => Some(Terrain::Free),
        CellState::Wall => Some(Terrain::Wall),
    };
    let extent = map.extent();
    match view {
        MapView::Occupancy => MapViewMessage::Occupancy(map_views::occupancy(extent, tick, known)),
        MapView::Octomap => MapViewMessage::Octomap(map_views::octomap(extent, tick, known)),
        MapView::Points => MapViewMessage::Points(map_views::wall_points(extent, tick, known)),
    }
}
