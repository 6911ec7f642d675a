//! What people look at: standard messages made of the world, for whoever listens and for the recording.
//!
//! Live and recorded views are made by the same code and know nothing of each other. A recorded view hangs on sim time alone, so
//! equal runs give equal bytes. A live one has a period in sim time and a greatest rate in wall time, because runs go at
//! hundreds of times real time; what nobody listens to is not made, and a new reader is shown everything from the start.
//!
//! Invariants: looking changes nothing of the world; no message is larger than [`msgs::limits::VIEW_BYTES_MAX`]; every
//! stamp is sim time. Frames: `map` is the world, and `agent_<id>/base_link` moves in it; `agent_<id>/lidar` is at the same
//! place. There is no frame `odom`, because bodies know where they are.
//!
//! This module knows no transport and no clock: who listens and what time it is are arguments.

mod cells;
mod cloud;
mod poses;
mod status;

use std::collections::{BTreeMap, BTreeSet};

use msgs::diagnostic_msgs::DiagnosticArray;
use msgs::ids::{AgentId, Tick};
use msgs::maes_msgs;
use msgs::nav_msgs::{Odometry, Path};
use msgs::sensor_msgs::PointCloud2;
use msgs::tf2_msgs::TFMessage;
use msgs::topics::{self, Topic};
use msgs::visualization_msgs::Marker;
use nalgebra::Point3;
use serde::{Serialize, Serializer};
use voxels::{Grid, Terrain};

use crate::scenario::{RecordedView, ViewsSection};
use crate::world::World;

use cells::{Unexplored, walls};
pub use cloud::points;
pub use poses::odometry;
pub use status::RunStatus;

/// Wall time between two pieces of one view: a reader must be able to take each before the next comes.
const PIECE_PERIOD_NS: u64 = 10_000_000;

/// Something to look at: a topic.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum VisualisationTopic {
    /// The poses of all bodies.
    Transforms,
    /// The frames that do not move.
    StaticTransforms,
    /// Where an agent is and how it moves.
    Odometry(AgentId),
    /// The last scan of an agent.
    Points(AgentId),
    /// Where an agent is going.
    Path(AgentId),
    /// The walls.
    Map,
    /// What nobody has seen.
    Unexplored,
    /// Who hears whom.
    Contacts,
    /// How things are, in words.
    Info,
    /// The digest.
    Digest,
    /// The outcome.
    Result,
}

impl VisualisationTopic {
    /// All views of a run with this many agents.
    pub fn all(agents: u32) -> impl Iterator<Item = Self> {
        let of_run = [
            Self::Transforms,
            Self::StaticTransforms,
            Self::Map,
            Self::Unexplored,
            Self::Contacts,
            Self::Info,
            Self::Digest,
            Self::Result,
        ];
        let of_agent = |agent| [Self::Odometry(agent), Self::Points(agent), Self::Path(agent)];
        of_run.into_iter().chain((0..agents).map(AgentId).flat_map(of_agent))
    }

    /// Whether it comes in pieces, one after the other.
    fn has_pieces(self) -> bool {
        matches!(self, Self::Map | Self::Unexplored)
    }

    /// Its topic.
    #[must_use]
    pub fn topic(self) -> Topic {
        match self {
            Self::Transforms => topics::tf(),
            Self::StaticTransforms => topics::tf_static(),
            Self::Odometry(agent) => topics::odometry(agent),
            Self::Points(agent) => topics::points(agent),
            Self::Path(agent) => topics::path(agent),
            Self::Map => topics::map(),
            Self::Unexplored => topics::unexplored(),
            Self::Contacts => topics::contacts(),
            Self::Info => topics::info(),
            Self::Digest => topics::digest(),
            Self::Result => topics::result(),
        }
    }
}

/// A message of a view.
#[derive(Debug, Clone, PartialEq)]
pub enum VisualisationMessage {
    /// Of [`VisualisationTopic::Transforms`] and [`VisualisationTopic::StaticTransforms`].
    Transforms(TFMessage),
    /// Of [`VisualisationTopic::Odometry`].
    Odometry(Box<Odometry>),
    /// Of [`VisualisationTopic::Points`].
    Points(PointCloud2),
    /// Of [`VisualisationTopic::Path`].
    Path(Path),
    /// Of [`VisualisationTopic::Map`], [`VisualisationTopic::Unexplored`] and [`VisualisationTopic::Contacts`].
    Marker(Box<Marker>),
    /// Of [`VisualisationTopic::Info`].
    Info(DiagnosticArray),
    /// Of [`VisualisationTopic::Digest`].
    Digest(maes_msgs::Digest),
    /// Of [`VisualisationTopic::Result`].
    Result(Box<maes_msgs::Result>),
}

/// As the message that it holds.
impl Serialize for VisualisationMessage {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Transforms(message) => message.serialize(serializer),
            Self::Odometry(message) => message.serialize(serializer),
            Self::Points(message) => message.serialize(serializer),
            Self::Path(message) => message.serialize(serializer),
            Self::Marker(message) => message.serialize(serializer),
            Self::Info(message) => message.serialize(serializer),
            Self::Digest(message) => message.serialize(serializer),
            Self::Result(message) => message.serialize(serializer),
        }
    }
}

/// The views that somebody listens to, each with how many readers have ever come: more than before means that there is a new one.
pub type Subscribers = BTreeMap<VisualisationTopic, u64>;

/// Messages that are to be shown or recorded, in order.
pub type VisualisationMessages = Vec<(VisualisationTopic, VisualisationMessage)>;

/// When something is shown.
#[derive(Debug, Clone, Copy)]
pub struct PublishTime {
    /// Nanoseconds since some moment on the wall.
    pub wall_ns: u64,
    /// Whether sim time stands still until somebody says otherwise.
    pub is_paused: bool,
}

/// What has been shown of a run, and when.
#[derive(Debug)]
pub struct VisualisationScheduler {
    settings: ViewsSection,
    recorded_views: Vec<VisualisationTopic>,
    live: Shown,
    recorded: Shown,
}

impl VisualisationScheduler {
    /// Nothing shown yet of a run with this many agents.
    #[must_use]
    pub fn new(settings: ViewsSection, agents: u32) -> Self {
        let asked: BTreeSet<RecordedView> = settings.record.iter().copied().collect();
        let recorded_views =
            VisualisationTopic::all(agents).filter(|view| recorded_as(*view).is_some_and(|name| asked.contains(&name)));
        Self { recorded_views: recorded_views.collect(), settings, live: Shown::default(), recorded: Shown::default() }
    }

    /// What there is to record at the start of this tick. To be asked in every tick.
    pub fn due_for_recording(&mut self, world: &mut World, facts: &RunStatus<'_>) -> VisualisationMessages {
        let mut pictures = Vec::new();
        let facts = RunStatus { rtf: None, ..*facts };
        for &view in &self.recorded_views {
            let period = self.settings.period_ticks(view);
            if self.recorded.is_due(view, world, period) {
                self.recorded.note(view, world);
                self.recorded.look(view, world, &facts, &mut pictures);
                while self.recorded.piece(view, world, &mut pictures) {}
            }
        }
        pictures
    }

    /// What there is to show now: at most one piece of what comes in pieces.
    pub fn due_live(
        &mut self,
        world: &mut World,
        facts: &RunStatus<'_>,
        listeners: &Subscribers,
        now: PublishTime,
    ) -> VisualisationMessages {
        let mut pictures = Vec::new();
        let PublishTime { wall_ns, is_paused } = now;
        for (&view, &arrivals) in listeners {
            let entry = self.live.entry(view);
            let is_new = entry.arrivals < arrivals;
            // In almost every tick of a fast run there is nothing to do, so that has to take next to no time.
            if !is_new && wall_ns < entry.open_ns && (wall_ns < entry.piece_ns || !view.has_pieces()) {
                continue;
            }
            if is_new {
                if !is_paused && entry.shown == Some(world.tick()) {
                    // It is shown again in the next tick: transforms of a tick that has been told are refused by those who have them.
                    continue;
                }
                entry.arrivals = arrivals;
                self.live.forget(view);
            }
            if wall_ns >= self.live.entry(view).open_ns
                && self.live.is_due(view, world, self.settings.period_ticks(view))
            {
                self.live.note(view, world);
                self.live.entry(view).open_ns = wall_ns + self.settings.pause_ns();
                self.live.look(view, world, facts, &mut pictures);
            }
            if wall_ns >= self.live.entry(view).piece_ns && self.live.piece(view, world, &mut pictures) {
                self.live.entry(view).piece_ns = wall_ns + PIECE_PERIOD_NS;
            }
        }
        pictures
    }

    /// Whether a message of the run loop's own, such as the digest, may be shown now.
    pub fn may_publish(&mut self, view: VisualisationTopic, listeners: &Subscribers, wall_ns: u64) -> bool {
        let pause_ns = self.settings.pause_ns();
        let entry = self.live.entry(view);
        let may = listeners.contains_key(&view) && wall_ns >= entry.open_ns;
        if may {
            entry.open_ns = wall_ns + pause_ns;
        }
        may
    }
}

/// What a scenario calls a view that it can have recorded. The others are recorded in any case, or never.
fn recorded_as(view: VisualisationTopic) -> Option<RecordedView> {
    match view {
        VisualisationTopic::Odometry(_) => Some(RecordedView::Odom),
        VisualisationTopic::Points(_) => Some(RecordedView::Points),
        VisualisationTopic::Path(_) => Some(RecordedView::Path),
        VisualisationTopic::StaticTransforms => Some(RecordedView::TfStatic),
        VisualisationTopic::Map => Some(RecordedView::Map),
        VisualisationTopic::Unexplored => Some(RecordedView::Unexplored),
        VisualisationTopic::Contacts => Some(RecordedView::Contacts),
        VisualisationTopic::Info => Some(RecordedView::Info),
        VisualisationTopic::Transforms | VisualisationTopic::Digest | VisualisationTopic::Result => None,
    }
}

/// What has been shown to one audience.
#[derive(Debug, Default)]
struct Shown {
    entries: BTreeMap<VisualisationTopic, Entry>,
    paths: BTreeMap<AgentId, Vec<Point3<f64>>>,
    unexplored: Option<Unexplored>,
    /// Walls that are still to be shown, the last ones first.
    walls: Vec<Marker>,
}

/// What has been shown of one view.
#[derive(Debug, Default)]
struct Entry {
    arrivals: u64,
    /// The tick of what was shown last; of points, that of the scan.
    shown: Option<Tick>,
    /// Wall time from which on something may be shown again.
    open_ns: u64,
    /// The same for pieces.
    piece_ns: u64,
}

impl Shown {
    fn entry(&mut self, view: VisualisationTopic) -> &mut Entry {
        self.entries.entry(view).or_default()
    }

    /// As if nothing had been shown of a view, for a reader that has just come.
    fn forget(&mut self, view: VisualisationTopic) {
        let entry = self.entry(view);
        (entry.shown, entry.open_ns) = (None, 0);
        match view {
            VisualisationTopic::Path(agent) => drop(self.paths.remove(&agent)),
            VisualisationTopic::Unexplored => self.unexplored = None,
            _ => {}
        }
    }

    /// Whether this is a tick in which a view is shown: a multiple of its period, or, of points, after a scan. What was never
    /// shown is due at once.
    fn is_due(&mut self, view: VisualisationTopic, world: &World, period_ticks: u64) -> bool {
        let shown = self.entry(view).shown;
        match (view, shown) {
            (VisualisationTopic::Digest | VisualisationTopic::Result, _) => false,
            (VisualisationTopic::StaticTransforms | VisualisationTopic::Map, shown) => shown.is_none(),
            (VisualisationTopic::Points(agent), shown) => world.last_scan(agent).is_some_and(|(_, scan)| {
                // One of this tick has not been cast yet, or is not over.
                scan < world.tick() && shown.is_none_or(|shown| scan.0 >= shown.0 + period_ticks)
            }),
            (_, None) => true,
            (_, Some(shown)) => world.tick() > shown && world.tick().0.is_multiple_of(period_ticks),
        }
    }

    /// Notes that a view is shown now.
    fn note(&mut self, view: VisualisationTopic, world: &World) {
        self.entry(view).shown = match view {
            VisualisationTopic::Points(agent) => world.last_scan(agent).map(|(_, scan)| scan),
            _ => Some(world.tick()),
        };
    }

    /// Makes the messages of a view; of one that comes in pieces, finds out which pieces are to be shown.
    fn look(
        &mut self,
        view: VisualisationTopic,
        world: &mut World,
        facts: &RunStatus<'_>,
        pictures: &mut VisualisationMessages,
    ) {
        match view {
            VisualisationTopic::Transforms => {
                push(pictures, view, poses::transforms(world).map(VisualisationMessage::Transforms))
            }
            VisualisationTopic::StaticTransforms => push(
                pictures,
                view,
                poses::static_transforms(world.agents(), world.tick()).map(VisualisationMessage::Transforms),
            ),
            VisualisationTopic::Odometry(agent) => {
                push(pictures, view, [VisualisationMessage::Odometry(Box::new(odometry(world, agent)))])
            }
            VisualisationTopic::Points(agent) => {
                push(pictures, view, points(world, agent).map(VisualisationMessage::Points))
            }
            VisualisationTopic::Path(agent) => {
                let waypoints = world.body(agent).waypoints();
                if self.paths.get(&agent) != Some(&waypoints) {
                    push(pictures, view, [VisualisationMessage::Path(poses::path(world.tick(), &waypoints))]);
                    self.paths.insert(agent, waypoints);
                }
            }
            VisualisationTopic::Map => {
                self.walls = walls(world.terrain(), world.tick());
                self.walls.reverse();
            }
            VisualisationTopic::Unexplored => {
                let unexplored = self.unexplored.get_or_insert_with(|| Unexplored::new(world.terrain()));
                unexplored.look(world.coverage().explored_cells());
            }
            VisualisationTopic::Contacts => {
                push(pictures, view, [VisualisationMessage::Marker(Box::new(poses::contacts(world)))])
            }
            VisualisationTopic::Info => {
                push(pictures, view, status::info(world, facts).into_iter().map(VisualisationMessage::Info))
            }
            VisualisationTopic::Digest | VisualisationTopic::Result => {}
        }
    }

    /// Takes the next piece that is to be shown of a view, if there is one.
    fn piece(&mut self, view: VisualisationTopic, world: &World, pictures: &mut VisualisationMessages) -> bool {
        let piece = match view {
            VisualisationTopic::Map => self.walls.pop(),
            VisualisationTopic::Unexplored => self.unexplored.as_mut().and_then(|unexplored| {
                unexplored.next(world.terrain(), world.coverage().explored_cells(), world.tick())
            }),
            _ => None,
        };
        let is_there = piece.is_some();
        push(pictures, view, piece.map(|marker| VisualisationMessage::Marker(Box::new(marker))));
        is_there
    }
}

/// What does not change in a run with this terrain and so many agents, as it is shown and recorded at tick 0: frames and walls.
#[must_use]
pub fn static_messages(terrain: &Grid<Terrain>, agents: u32) -> VisualisationMessages {
    let mut pictures = Vec::new();
    let transforms = poses::static_transforms((0..agents).map(AgentId), Tick::ZERO);
    push(&mut pictures, VisualisationTopic::StaticTransforms, transforms.map(VisualisationMessage::Transforms));
    let walls = walls(terrain, Tick::ZERO).into_iter();
    push(&mut pictures, VisualisationTopic::Map, walls.map(|marker| VisualisationMessage::Marker(Box::new(marker))));
    pictures
}

fn push(
    pictures: &mut VisualisationMessages,
    view: VisualisationTopic,
    new: impl IntoIterator<Item = VisualisationMessage>,
) {
    pictures.extend(new.into_iter().map(|picture| (view, picture)));
}

#[cfg(test)]
mod tests;
