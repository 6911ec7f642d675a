//! The visualisation topics of a run: standard messages of the state of the world, for live
//! subscribers and for the recording.
//!
//! Live and recorded topics are made by the same code and are independent of each other. A recorded
//! topic depends on sim time alone, so equal runs give equal bytes. A live topic has a period in
//! sim time and a rate limit in wall time, because runs reach hundreds of times real time. Topics
//! without subscribers are not computed, and a new subscriber gets everything from the start.
//!
//! Invariants: the world does not change; no message is larger than
//! [`msgs::limits::VIEW_BYTES_MAX`]; every stamp is sim time. Frames: `map` is the world,
//! `agent_<id>/base_link` is a body in it, `agent_<id>/lidar` coincides with the body. There is no
//! frame `odom`, because poses are known.
//!
//! Subscribers and wall time are arguments: there is no transport and no clock here.

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
pub use status::{LiveStatus, RunStatus};

/// Wall time between two chunks of a topic, ns, so that a subscriber can take each before the next.
const CHUNK_PERIOD_NS: u64 = 10_000_000;

/// A visualisation topic.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum VisualisationTopic {
    /// The poses of all bodies.
    Transforms,
    /// The static frames.
    StaticTransforms,
    /// Pose and velocity of an agent.
    Odometry(AgentId),
    /// The last scan of an agent, as a point cloud.
    Points(AgentId),
    /// The remaining waypoints of an agent.
    Path(AgentId),
    /// The visible walls of the map.
    Map,
    /// The free cells that no agent has seen.
    Unexplored,
    /// The contacts between agents and relays.
    Contacts,
    /// The status of the run and of each agent, as diagnostics.
    Info,
    /// The digest of the run so far.
    Digest,
    /// The result of the run.
    Result,
}

impl VisualisationTopic {
    /// All topics of a run with this many agents.
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

    /// Whether it is published in chunks.
    fn is_chunked(self) -> bool {
        matches!(self, Self::Map | Self::Unexplored)
    }

    /// Its name, type and QoS.
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

/// A message of a visualisation topic.
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
    /// Of [`VisualisationTopic::Map`], [`VisualisationTopic::Unexplored`] and
    /// [`VisualisationTopic::Contacts`].
    Marker(Box<Marker>),
    /// Of [`VisualisationTopic::Info`].
    Info(DiagnosticArray),
    /// Of [`VisualisationTopic::Digest`].
    Digest(maes_msgs::Digest),
    /// Of [`VisualisationTopic::Result`].
    Result(Box<maes_msgs::Result>),
}

/// Serialises as the message that it holds.
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

/// The topics with subscribers, each with the number of subscribers that have ever matched: a
/// larger number than before means a new one.
pub type Subscribers = BTreeMap<VisualisationTopic, u64>;

/// Messages to be published or recorded, in order.
pub type VisualisationMessages = Vec<(VisualisationTopic, VisualisationMessage)>;

/// The wall time at which live topics are published.
#[derive(Debug, Clone, Copy)]
pub struct PublishTime {
    /// Wall time since a fixed instant, ns.
    pub wall_ns: u64,
    /// Whether the simulation is paused.
    pub is_paused: bool,
}

/// Schedules the visualisation topics of a run, live and recorded.
#[derive(Debug)]
pub struct VisualisationScheduler {
    settings: ViewsSection,
    recorded_topics: Vec<VisualisationTopic>,
    live: PublishState,
    recorded: PublishState,
}

impl VisualisationScheduler {
    /// Nothing published yet of a run with this many agents.
    #[must_use]
    pub fn new(settings: ViewsSection, agents: u32) -> Self {
        let asked: BTreeSet<RecordedView> = settings.record.iter().copied().collect();
        let recorded_topics = VisualisationTopic::all(agents)
            .filter(|topic| recorded_as(*topic).is_some_and(|name| asked.contains(&name)));
        Self {
            recorded_topics: recorded_topics.collect(),
            settings,
            live: PublishState::default(),
            recorded: PublishState::default(),
        }
    }

    /// Whether messages are recorded at all.
    #[must_use]
    pub fn records(&self) -> bool {
        !self.recorded_topics.is_empty()
    }

    /// The messages to record at the start of this tick. Must be called in every tick.
    pub fn due_for_recording(&mut self, world: &mut World, run_status: &RunStatus<'_>) -> VisualisationMessages {
        let mut messages = Vec::new();
        let run_status = RunStatus { live: None, ..*run_status };
        for &topic in &self.recorded_topics {
            let period = self.settings.period_ticks(topic);
            if self.recorded.is_due(topic, world, period) {
                self.recorded.mark_published(topic, world);
                self.recorded.render(topic, world, &run_status, &mut messages);
                while self.recorded.chunk(topic, world, &mut messages) {}
            }
        }
        messages
    }

    /// The messages to publish now; of a chunked topic at most one chunk.
    pub fn due_live(
        &mut self,
        world: &mut World,
        run_status: &RunStatus<'_>,
        subscribers: &Subscribers,
        now: PublishTime,
    ) -> VisualisationMessages {
        let mut messages = Vec::new();
        let PublishTime { wall_ns, is_paused } = now;
        for (&topic, &arrivals) in subscribers {
            let entry = self.live.entry(topic);
            let is_new = entry.arrivals < arrivals;
            // The fast path: in almost every tick of a fast run nothing is due.
            if !is_new && wall_ns < entry.next_ns && (wall_ns < entry.next_chunk_ns || !topic.is_chunked()) {
                continue;
            }
            if is_new {
                if !is_paused && entry.published == Some(world.tick()) {
                    // Repeated in the next tick: tf2 refuses a transform with a stamp that it has.
                    continue;
                }
                entry.arrivals = arrivals;
                self.live.reset(topic);
            }
            if wall_ns >= self.live.entry(topic).next_ns
                && self.live.is_due(topic, world, self.settings.period_ticks(topic))
            {
                self.live.mark_published(topic, world);
                self.live.entry(topic).next_ns = wall_ns + self.settings.pause_ns();
                self.live.render(topic, world, run_status, &mut messages);
            }
            if wall_ns >= self.live.entry(topic).next_chunk_ns && self.live.chunk(topic, world, &mut messages) {
                self.live.entry(topic).next_chunk_ns = wall_ns + CHUNK_PERIOD_NS;
            }
        }
        messages
    }

    /// Whether a message that the session makes itself, such as the digest, may be published now.
    /// Takes its slot of the rate limit.
    pub fn may_publish(&mut self, topic: VisualisationTopic, subscribers: &Subscribers, wall_ns: u64) -> bool {
        let pause_ns = self.settings.pause_ns();
        let entry = self.live.entry(topic);
        let may = subscribers.contains_key(&topic) && wall_ns >= entry.next_ns;
        if may {
            entry.next_ns = wall_ns + pause_ns;
        }
        may
    }
}

/// The name in a scenario of a topic that can be recorded; the others are always or never recorded.
fn recorded_as(topic: VisualisationTopic) -> Option<RecordedView> {
    match topic {
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

/// What has been published to one side, live or recorded.
#[derive(Debug, Default)]
struct PublishState {
    entries: BTreeMap<VisualisationTopic, TopicState>,
    paths: BTreeMap<AgentId, Vec<Point3<f64>>>,
    unexplored: Option<Unexplored>,
    /// Chunks of walls still to be published, in reverse order.
    walls: Vec<Marker>,
}

/// The state of one topic.
#[derive(Debug, Default)]
struct TopicState {
    arrivals: u64,
    /// Tick of the last message; of points, that of the scan.
    published: Option<Tick>,
    /// Earliest wall time of the next message, ns.
    next_ns: u64,
    /// Earliest wall time of the next chunk, ns.
    next_chunk_ns: u64,
}

impl PublishState {
    fn entry(&mut self, topic: VisualisationTopic) -> &mut TopicState {
        self.entries.entry(topic).or_default()
    }

    /// Resets a topic for a new subscriber.
    fn reset(&mut self, topic: VisualisationTopic) {
        let entry = self.entry(topic);
        (entry.published, entry.next_ns) = (None, 0);
        match topic {
            VisualisationTopic::Path(agent) => drop(self.paths.remove(&agent)),
            VisualisationTopic::Unexplored => self.unexplored = None,
            _ => {}
        }
    }

    /// Whether a topic is due in this tick: a multiple of its period or, of points, after a scan. A
    /// topic that was never published is due at once.
    fn is_due(&mut self, topic: VisualisationTopic, world: &World, period_ticks: u64) -> bool {
        let published = self.entry(topic).published;
        match (topic, published) {
            (VisualisationTopic::Digest | VisualisationTopic::Result, _) => false,
            (VisualisationTopic::StaticTransforms | VisualisationTopic::Map, published) => published.is_none(),
            (VisualisationTopic::Points(agent), published) => world.last_scan(agent).is_some_and(|(_, scan)| {
                // A scan of this tick has not been cast yet, or not completely.
                scan < world.tick() && published.is_none_or(|published| scan.0 >= published.0 + period_ticks)
            }),
            (_, None) => true,
            (_, Some(published)) => world.tick() > published && world.tick().0.is_multiple_of(period_ticks),
        }
    }

    /// Marks a topic as published now.
    fn mark_published(&mut self, topic: VisualisationTopic, world: &World) {
        self.entry(topic).published = match topic {
            VisualisationTopic::Points(agent) => world.last_scan(agent).map(|(_, scan)| scan),
            _ => Some(world.tick()),
        };
    }

    /// Makes the messages of a topic; of a chunked topic, selects the chunks to be published.
    fn render(
        &mut self,
        topic: VisualisationTopic,
        world: &mut World,
        run_status: &RunStatus<'_>,
        messages: &mut VisualisationMessages,
    ) {
        match topic {
            VisualisationTopic::Transforms => {
                push(messages, topic, poses::transforms(world).map(VisualisationMessage::Transforms))
            }
            VisualisationTopic::StaticTransforms => push(
                messages,
                topic,
                poses::static_transforms(world.agents(), world.tick()).map(VisualisationMessage::Transforms),
            ),
            VisualisationTopic::Odometry(agent) => {
                push(messages, topic, [VisualisationMessage::Odometry(Box::new(odometry(world, agent)))])
            }
            VisualisationTopic::Points(agent) => {
                push(messages, topic, points(world, agent).map(VisualisationMessage::Points))
            }
            VisualisationTopic::Path(agent) => {
                let waypoints = world.body(agent).waypoints();
                if self.paths.get(&agent) != Some(&waypoints) {
                    push(messages, topic, [VisualisationMessage::Path(poses::path(world.tick(), &waypoints))]);
                    self.paths.insert(agent, waypoints);
                }
            }
            VisualisationTopic::Map => {
                self.walls = walls(world.terrain(), world.tick());
                self.walls.reverse();
            }
            VisualisationTopic::Unexplored => {
                let unexplored = self.unexplored.get_or_insert_with(|| Unexplored::new(world.terrain()));
                unexplored.update(world.coverage().explored_cells());
            }
            VisualisationTopic::Contacts => {
                push(messages, topic, [VisualisationMessage::Marker(Box::new(poses::contacts(world)))])
            }
            VisualisationTopic::Info => {
                push(messages, topic, status::info(world, run_status).into_iter().map(VisualisationMessage::Info))
            }
            VisualisationTopic::Digest | VisualisationTopic::Result => {}
        }
    }

    /// Takes the next chunk of a topic; returns whether there was one.
    fn chunk(&mut self, topic: VisualisationTopic, world: &World, messages: &mut VisualisationMessages) -> bool {
        let chunk = match topic {
            VisualisationTopic::Map => self.walls.pop(),
            VisualisationTopic::Unexplored => self.unexplored.as_mut().and_then(|unexplored| {
                unexplored.next(world.terrain(), world.coverage().explored_cells(), world.tick())
            }),
            _ => None,
        };
        let is_there = chunk.is_some();
        push(messages, topic, chunk.map(|marker| VisualisationMessage::Marker(Box::new(marker))));
        is_there
    }
}

/// The messages that do not change in a run, as of tick 0: static frames and walls.
#[must_use]
pub fn static_messages(terrain: &Grid<Terrain>, agents: u32) -> VisualisationMessages {
    let mut messages = Vec::new();
    let transforms = poses::static_transforms((0..agents).map(AgentId), Tick::ZERO);
    push(&mut messages, VisualisationTopic::StaticTransforms, transforms.map(VisualisationMessage::Transforms));
    let walls = walls(terrain, Tick::ZERO).into_iter();
    push(&mut messages, VisualisationTopic::Map, walls.map(|marker| VisualisationMessage::Marker(Box::new(marker))));
    messages
}

fn push(
    messages: &mut VisualisationMessages,
    topic: VisualisationTopic,
    new: impl IntoIterator<Item = VisualisationMessage>,
) {
    messages.extend(new.into_iter().map(|message| (topic, message)));
}

#[cfg(test)]
mod tests;
