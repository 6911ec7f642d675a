//! The visualisation topics of a run: standard messages of the state of the world, for live
//! subscribers and for the recording.
//!
//! Live and recorded topics are made by the same code and are independent of each other. A recorded
//! topic depends on sim time alone, so equal runs give equal bytes. A live topic has a period in
//! sim time and a rate limit in wall time, because runs reach hundreds of times real time. Topics
//! without subscribers are not computed, and a new subscriber gets everything from the start.
//!
//! Invariants: the world does not change; no message is larger than
//! [`protocol::limits::VIEW_BYTES_MAX`]; every stamp is sim time; a message with a stamp comes
//! after the transforms of that stamp, to whoever receives both. Frames: `map` is the world,
//! `agent_<id>/base_link` is a body in it, `agent_<id>/lidar` is where its sensor is mounted,
//! `agent_<id>/camera_optical_frame` the frame of the images of a camera (of one of several sensors
//! `agent_<id>/<name>` and `agent_<id>/<name>_optical_frame`), and `agent_<id>/odom`
//! coincides with `map` where poses are known; where localisation drifts, `agent_<id>/map` is
//! between them (REP 105).
//!
//! Subscribers and wall time are arguments: there is no transport and no clock here.

mod battery;
mod cells;
mod cloud;
mod description;
mod known;
mod message;
mod poses;
mod scans;
mod sent_transforms;
mod status;
mod topic;

use std::cell::LazyCell;
use std::collections::{BTreeMap, BTreeSet};

use msgs::ids::{AgentId, Tick};
use msgs::rosgraph_msgs::Clock;
use msgs::tf2_msgs::TFMessage;
use msgs::visualization_msgs::Marker;
use nalgebra::Point3;
use protocol::map_views;
use voxels::{Grid, Terrain};

use crate::scenario::{RecordedView, ViewsSection};
use world::World;

use cells::{Unexplored, walls};
pub use cloud::points;
pub use message::VisualisationMessage;
pub use poses::{StaticFrames, measured_odometry, odometry};
use sent_transforms::SentTransforms;
pub use status::{LiveStatus, RunStatus};
pub use topic::{Equipment, LidarTopics, SensorId, VisualisationTopic};

/// Wall time between two chunks of a topic, ns, so that a subscriber can take each before the next.
const CHUNK_PERIOD_NS: u64 = 10_000_000;

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
    live_transforms: SentTransforms,
    recorded_transforms: SentTransforms,
}

impl VisualisationScheduler {
    /// Nothing published yet of a run whose recording has the poses of all agents every
    /// `recorded_poses_period_ticks`, or not at all if that is 0.
    #[must_use]
    pub fn new(settings: ViewsSection, equipment: &Equipment, recorded_poses_period_ticks: u32) -> Self {
        let agents = equipment.lidars.len() as u32;
        let asked: BTreeSet<RecordedView> = settings.record.iter().copied().collect();
        let asks_for_all = asked.contains(&RecordedView::All);
        // The clock comes before what has its stamp.
        let recorded_topics = std::iter::once(VisualisationTopic::Clock)
            .chain(VisualisationTopic::all(equipment))
            .filter(|topic| recorded_as(*topic).is_some_and(|name| asks_for_all || asked.contains(&name)));
        Self {
            recorded_topics: recorded_topics.collect(),
            settings,
            live: PublishState::default(),
            recorded: PublishState::default(),
            live_transforms: SentTransforms::new(agents, 0),
            recorded_transforms: SentTransforms::new(agents, recorded_poses_period_ticks),
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
                self.recorded.render(topic, world, &self.settings, &run_status, &mut messages);
                while self.recorded.chunk(topic, world, &mut messages) {}
            }
        }
        self.recorded_transforms.precede(world, messages, |_| false)
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
            if topic.accompanies().is_some_and(|other| subscribers.contains_key(&other)) {
                continue;
            }
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
                if topic == VisualisationTopic::Transforms {
                    self.live_transforms.forget();
                }
            }
            if wall_ns >= self.live.entry(topic).next_ns
                && self.live.is_due(topic, world, self.settings.period_ticks(topic))
            {
                self.live.mark_published(topic, world);
                self.live.entry(topic).next_ns = wall_ns + self.settings.pause_ns();
                self.live.render(topic, world, &self.settings, run_status, &mut messages);
                if let Some(companion) = topic.companion().filter(|companion| subscribers.contains_key(companion)) {
                    self.live.render(companion, world, &self.settings, run_status, &mut messages);
                }
            }
            if wall_ns >= self.live.entry(topic).next_chunk_ns && self.live.chunk(topic, world, &mut messages) {
                self.live.entry(topic).next_chunk_ns = wall_ns + CHUNK_PERIOD_NS;
            }
        }
        if !subscribers.contains_key(&VisualisationTopic::Transforms) {
            return messages;
        }
        // Needed with messages alone, and then for each agent.
        let scanned =
            LazyCell::new(|| subscribers.keys().filter_map(|topic| topic.scanned_by()).collect::<BTreeSet<AgentId>>());
        let messages = self.live_transforms.precede(world, messages, |agent| scanned.contains(&agent));
        if self.live_transforms.is_complete_at(world.tick()) {
            let entry = self.live.entry(VisualisationTopic::Transforms);
            if entry.published != Some(world.tick()) {
                // These poses take the turn of the next ones.
                (entry.published, entry.next_ns) = (Some(world.tick()), wall_ns + self.settings.pause_ns());
            }
        }
        messages
    }

    /// The transforms that precede sensor messages of an agent with the stamp of this tick, if they
    /// were not published yet and their topic has subscribers.
    pub fn due_before_sensors(
        &mut self,
        world: &World,
        agent: AgentId,
        subscribers: &Subscribers,
    ) -> Vec<VisualisationMessage> {
        if !subscribers.contains_key(&VisualisationTopic::Transforms) {
            return Vec::new();
        }
        let of_scan = has_scans(subscribers, agent).then(|| self.live_transforms.of_scan(world, agent)).flatten();
        let present = self.live_transforms.insert(world, agent, world.tick());
        let present = present.then(|| crate::wire::present_transforms(world, agent));
        let parts = of_scan.map(|(_, transforms)| transforms).into_iter().chain(present);
        parts.map(|transforms| VisualisationMessage::Transforms(TFMessage { transforms })).collect()
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

/// Whether a topic with scans of an agent has subscribers.
fn has_scans(subscribers: &Subscribers, agent: AgentId) -> bool {
    subscribers.keys().any(|topic| topic.scanned_by() == Some(agent))
}

/// The name in a scenario of a topic that can be recorded; the others are always or never recorded.
fn recorded_as(topic: VisualisationTopic) -> Option<RecordedView> {
    match topic {
        VisualisationTopic::Odometry(_) => Some(RecordedView::Odom),
        VisualisationTopic::Points(_) => Some(RecordedView::Points),
        VisualisationTopic::Scan(_) => Some(RecordedView::Scan),
        VisualisationTopic::DepthImage(_) => Some(RecordedView::DepthImage),
        VisualisationTopic::CameraInfo(_) => Some(RecordedView::CameraInfo),
        VisualisationTopic::Battery(_) => Some(RecordedView::Battery),
        VisualisationTopic::Path(_) => Some(RecordedView::Path),
        VisualisationTopic::StaticTransforms => Some(RecordedView::TfStatic),
        VisualisationTopic::Map => Some(RecordedView::Map),
        VisualisationTopic::Unexplored => Some(RecordedView::Unexplored),
        VisualisationTopic::Contacts => Some(RecordedView::Contacts),
        VisualisationTopic::Info => Some(RecordedView::Info),
        VisualisationTopic::Diagnostics => Some(RecordedView::Diagnostics),
        VisualisationTopic::RobotDescription => Some(RecordedView::RobotDescription),
        VisualisationTopic::Occupancy => Some(RecordedView::Occupancy),
        VisualisationTopic::MapPoints => Some(RecordedView::MapPoints),
        VisualisationTopic::Octomap => Some(RecordedView::Octomap),
        VisualisationTopic::ExploredOctomap => Some(RecordedView::ExploredOctomap),
        VisualisationTopic::ExploredOccupancy => Some(RecordedView::ExploredOccupancy),
        VisualisationTopic::ExploredPoints => Some(RecordedView::ExploredPoints),
        VisualisationTopic::Clock => Some(RecordedView::Clock),
        VisualisationTopic::Transforms | VisualisationTopic::Digest | VisualisationTopic::Result => None,
    }
}

/// What has been published to one side, live or recorded.
#[derive(Debug, Default)]
struct PublishState {
    entries: BTreeMap<VisualisationTopic, TopicState>,
    paths: BTreeMap<AgentId, Vec<Point3<f64>>>,
    unexplored: Option<Unexplored>,
    /// The revision of the map that it is of.
    unexplored_revision: u32,
    /// Chunks of walls still to be published, in reverse order.
    walls: Vec<Marker>,
    /// Chunks of walls at the last time.
    wall_chunks: usize,
    /// Number of explored cells in the last message of each topic of explored maps.
    explored: BTreeMap<VisualisationTopic, usize>,
}

/// The state of one topic.
#[derive(Debug, Default)]
struct TopicState {
    arrivals: u64,
    /// Tick of the last message; of what shows a scan, that of the scan.
    published: Option<Tick>,
    /// The revision of the map in the last message.
    map_revision: u32,
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
            _ => drop(self.explored.remove(&topic)),
        }
    }

    /// Whether a topic is due in this tick: a multiple of its period or, of points, after a scan. A
    /// topic that was never published is due at once.
    fn is_due(&mut self, topic: VisualisationTopic, world: &World, period_ticks: u64) -> bool {
        let &mut TopicState { published, map_revision, .. } = self.entry(topic);
        if let Some(agent) = topic.scanned_by() {
            return world.last_scan(agent).is_some_and(|(_, scan)| {
                // A scan of this tick has not been cast yet, or not completely.
                scan < world.tick() && published.is_none_or(|published| scan.0 >= published.0 + period_ticks)
            });
        }
        match (topic, published) {
            (VisualisationTopic::Digest | VisualisationTopic::Result, _) => false,
            (topic, Some(_)) if topic.shows_map() => map_revision != world.map_revision(),
            (topic, published) if topic.is_static() => published.is_none(),
            (_, None) => true,
            (_, Some(published)) => world.tick() > published && world.tick().0.is_multiple_of(period_ticks),
        }
    }

    /// Marks a topic as published now.
    fn mark_published(&mut self, topic: VisualisationTopic, world: &World) {
        let entry = self.entry(topic);
        entry.map_revision = world.map_revision();
        entry.published = match topic.scanned_by() {
            Some(agent) => world.last_scan(agent).map(|(_, scan)| scan),
            None => Some(world.tick()),
        };
    }

    /// Makes the messages of a topic; of a chunked topic, selects the chunks to be published.
    fn render(
        &mut self,
        topic: VisualisationTopic,
        world: &mut World,
        settings: &ViewsSection,
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
                poses::static_transforms(&StaticFrames::of(world), world.tick()).map(VisualisationMessage::Transforms),
            ),
            VisualisationTopic::Odometry(agent) => {
                push(messages, topic, [VisualisationMessage::Odometry(Box::new(odometry(world, agent)))])
            }
            VisualisationTopic::Points(sensor) => {
                push(messages, topic, points(world, sensor, &settings.points_fields).map(VisualisationMessage::Points))
            }
            VisualisationTopic::Scan(sensor) => {
                push(messages, topic, scans::laser_scan(world, sensor).map(VisualisationMessage::Scan))
            }
            VisualisationTopic::DepthImage(sensor) => {
                push(messages, topic, scans::depth_image(world, sensor).map(VisualisationMessage::Image))
            }
            VisualisationTopic::CameraInfo(sensor) => {
                let info = scans::camera_info(world, sensor).map(Box::new);
                push(messages, topic, info.map(VisualisationMessage::CameraInfo))
            }
            VisualisationTopic::Battery(agent) => {
                let state = battery::battery_state(world, agent).map(Box::new);
                push(messages, topic, state.map(VisualisationMessage::Battery))
            }
            VisualisationTopic::Path(agent) => {
                let waypoints = world.body(agent).waypoints();
                if self.paths.get(&agent) != Some(&waypoints) {
                    push(
                        messages,
                        topic,
                        [VisualisationMessage::Path(poses::path(world.tick(), world.body(agent).pose(), &waypoints))],
                    );
                    self.paths.insert(agent, waypoints);
                }
            }
            VisualisationTopic::Map => {
                self.walls = walls(world.terrain(), world.tick(), self.wall_chunks);
                self.wall_chunks = self.walls.len();
                self.walls.reverse();
            }
            VisualisationTopic::Unexplored => {
                let unexplored = self.unexplored.get_or_insert_with(|| Unexplored::new(world.terrain()));
                unexplored.update(world.coverage().explored_cells());
                let before = std::mem::replace(&mut self.unexplored_revision, world.map_revision());
                if before != world.map_revision() {
                    unexplored.revise(world.terrain());
                }
            }
            VisualisationTopic::Contacts => {
                push(messages, topic, [VisualisationMessage::Marker(Box::new(poses::contacts(world)))])
            }
            VisualisationTopic::Info => {
                push(messages, topic, status::info(world, run_status).into_iter().map(VisualisationMessage::Info))
            }
            VisualisationTopic::Diagnostics => push(
                messages,
                topic,
                status::diagnostics(world, run_status).into_iter().map(VisualisationMessage::Info),
            ),
            VisualisationTopic::RobotDescription => {
                push(messages, topic, [VisualisationMessage::Text(description::robots(world))])
            }
            VisualisationTopic::Occupancy => {
                let terrain = world.terrain();
                let occupancy = map_views::occupancy(terrain.extent(), world.tick(), known::surfaces(terrain));
                push(messages, topic, [VisualisationMessage::Occupancy(Box::new(occupancy))])
            }
            VisualisationTopic::MapPoints => {
                let terrain = world.terrain();
                let points = map_views::wall_points(terrain.extent(), world.tick(), known::surfaces(terrain));
                push(messages, topic, [VisualisationMessage::Points(points)])
            }
            VisualisationTopic::Octomap => {
                let tree = map_views::octomap(world.terrain().extent(), world.tick(), known::whole(world.terrain()));
                push(messages, topic, [VisualisationMessage::Octomap(Box::new(tree))])
            }
            VisualisationTopic::ExploredOctomap
            | VisualisationTopic::ExploredOccupancy
            | VisualisationTopic::ExploredPoints => {
                let count = world.coverage().explored_count();
                if self.explored.insert(topic, count) != Some(count) {
                    push(messages, topic, [explored(topic, world)]);
                }
            }
            VisualisationTopic::Clock => {
                push(messages, topic, [VisualisationMessage::Clock(Clock { clock: world.tick().into() })])
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

/// What the team has seen of the map, as the message of a topic of explored maps.
fn explored(topic: VisualisationTopic, world: &World) -> VisualisationMessage {
    let (extent, tick) = (world.terrain().extent(), world.tick());
    let known = known::explored(world.terrain(), world.coverage().explored_cells());
    match topic {
        VisualisationTopic::ExploredOctomap => {
            VisualisationMessage::Octomap(Box::new(map_views::octomap(extent, tick, known)))
        }
        VisualisationTopic::ExploredPoints => VisualisationMessage::Points(map_views::wall_points(extent, tick, known)),
        _ => VisualisationMessage::Occupancy(Box::new(map_views::occupancy(extent, tick, known))),
    }
}

/// The static frames and the walls as of tick 0.
#[must_use]
pub fn static_messages(terrain: &Grid<Terrain>, frames: &StaticFrames) -> VisualisationMessages {
    let mut messages = Vec::new();
    let transforms = poses::static_transforms(frames, Tick::ZERO);
    push(&mut messages, VisualisationTopic::StaticTransforms, transforms.map(VisualisationMessage::Transforms));
    let walls = walls(terrain, Tick::ZERO, 0).into_iter();
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
