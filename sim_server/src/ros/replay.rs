//! A recording on its ROS 2 topics: one participant with one node `replay`, its services, and a publisher for each topic.
//!
//! Invariants: everything is published with the type and the quality of service that it has in a run, as it stands in the file;
//! readers are waited for, but each topic only for a moment (see [`ros_node::BlockingPublisher`]); a late reader of a latched topic
//! is told all that holds. When something is due is decided in [`crate::replay`].

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use msgs::cdr::Encoded;
use msgs::ids::Tick;
use msgs::rosgraph_msgs::Clock;
use msgs::topics;
use ros_node::ros_env::RosEnv;
use ros_node::{BlockingPublisher, EndpointFactory, Inbox, PublishOutcome, RosError, SubscriptionTracker, linger};
use ros2_client::{Context, Node};

use super::services::{ServiceEvent, Services};
use crate::recording::Recording;
use crate::replay::{
    LatchedCache, PlaybackCursor, PlaybackSchedule, PlaybackTiming, Player, PlayerAction, ScheduledMessage,
};
use crate::terminal::{self, Terminal};
use crate::wall_clock::now;
use simulation::parameters;

/// The name of the node.
const NODE: &str = "replay";

/// Wall time that those who were there first get to be found, before anything is said: at the least, and at the most.
const OPENING: Duration = Duration::from_millis(300);
const OPENING_MAX: Duration = Duration::from_secs(3);

/// Wall time between two looks for requests and for late readers while there is something to publish.
const LOOK_PERIOD: Duration = Duration::from_millis(5);

/// Wall time for which requests are awaited at the most, before it is looked who listens and whether to end.
const PATIENCE: Duration = Duration::from_millis(20);

/// Wall time between two messages that late readers are told again, so that they can take each.
const PIECE_PERIOD: Duration = Duration::from_millis(10);

/// Wall time between two reports.
const REPORT_PERIOD: Duration = Duration::from_millis(500);

/// Publishers that take as many files as an agent of a run at the most.
const TOPICS_OF_AGENT: usize = 8;

/// What became of a replay.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Played {
    /// Messages of the schedule that were published, `/clock` not among them.
    pub messages: u64,
    /// Sim time that has passed, ticks.
    pub sim_ticks: u64,
    /// Whether it was ended from outside.
    pub is_interrupted: bool,
}

/// Plays a recording until its end, or until `stop` is set.
///
/// # Errors
/// If the network cannot be joined, or the system has not enough of something.
pub fn play(
    recording: &Recording,
    schedule: &PlaybackSchedule,
    timing: PlaybackTiming,
    env: &RosEnv,
    terminal: &mut Terminal,
    stop: &AtomicBool,
) -> Result<Played, RosError> {
    let mut node = ReplayNode::new(schedule, timing, env)?;
    node.open(stop);
    let mut player = Player::new(schedule, timing, node.wall_ns());
    let mut cursor = PlaybackCursor::begin(recording, schedule);
    node.say_opening(&mut cursor, stop);
    let mut reported = None;
    let is_stopped = || stop.load(Ordering::Relaxed);
    while !is_stopped() {
        node.look(&mut player, Duration::ZERO);
        if reported.is_none_or(|reported: Instant| reported.elapsed() >= REPORT_PERIOD) {
            reported = Some(now());
            terminal.status(player.position(), node.status(&player));
        }
        match player.next_action(node.wall_ns()) {
            PlayerAction::Play(tick) => {
                node.say_tick(tick, &mut cursor, stop);
                player.played();
            }
            PlayerAction::Wait(wait_ns) => node.look(&mut player, Duration::from_nanos(wait_ns)),
            PlayerAction::Idle => node.look(&mut player, PATIENCE),
            PlayerAction::Rewind => {
                cursor = PlaybackCursor::begin(recording, schedule);
                node.say_opening(&mut cursor, stop);
            }
            PlayerAction::End => break,
        }
    }
    player.end();
    let is_interrupted = is_stopped() || player.is_quitting();
    Ok(Played { messages: node.messages, sim_ticks: player.sim_ticks(), is_interrupted })
}

/// A replay in a ROS network.
struct ReplayNode {
    inbox: Inbox<ServiceEvent>,
    services: Services,
    clock: BlockingPublisher,
    topics: Vec<ReplayTopic>,
    subscriptions: SubscriptionTracker,
    looked: Instant,
    /// When late readers may be told the next thing.
    piece: Instant,
    begun: Instant,
    messages: u64,
    node: Node,
    context: Context,
}

/// A topic.
struct ReplayTopic {
    publisher: BlockingPublisher,
    cache: Option<LatchedCache>,
    /// Readers that have ever come.
    arrivals: u64,
}

impl ReplayNode {
    fn new(schedule: &PlaybackSchedule, timing: PlaybackTiming, env: &RosEnv) -> Result<Self, RosError> {
        // So many publishers take no more files than an agent of a run.
        ros_node::allow_open_files(
            u32::try_from(schedule.topics().len().div_ceil(TOPICS_OF_AGENT)).unwrap_or(u32::MAX),
        )?;
        let context = ros_node::join(env, true)?;
        let mut node = ros_node::node(&context, NODE)?;
        let mut endpoints = EndpointFactory::new(&context);
        let clock = endpoints.blocking_publisher(&context, &mut node, &topics::clock())?;
        let mut topics = Vec::new();
        for topic in schedule.topics() {
            let publisher = endpoints.blocking_publisher(&context, &mut node, topic)?;
            topics.push(ReplayTopic { publisher, cache: LatchedCache::for_topic(topic), arrivals: 0 });
        }
        let mut inbox = Inbox::default();
        let declared = parameters::of_replay(timing.rate);
        let services = Services::of_replay(&mut node, &mut endpoints, &mut inbox, declared)?;
        let subscriptions = SubscriptionTracker::new(schedule.topics());
        let born = now();
        Ok(Self {
            inbox,
            services,
            clock,
            topics,
            subscriptions,
            looked: born,
            piece: born,
            begun: born,
            messages: 0,
            node,
            context,
        })
    }

    /// Waits until those who were there first can hear everything. Requests wait meanwhile.
    fn open(&mut self, stop: &AtomicBool) {
        let begun = now();
        let is_open = |subscriptions: &SubscriptionTracker| begun.elapsed() >= OPENING && subscriptions.all_settled();
        while !stop.load(Ordering::Relaxed) && !is_open(&self.subscriptions) && begun.elapsed() < OPENING_MAX {
            self.receive(PATIENCE);
            self.subscriptions.poll(&self.context);
        }
        // They are no late readers.
        self.greet_new_readers(false);
        self.begun = now();
    }

    fn wall_ns(&self) -> u64 {
        u64::try_from(self.begun.elapsed().as_nanos()).unwrap_or(u64::MAX)
    }

    fn receive(&mut self, timeout: Duration) -> bool {
        let event = self.inbox.receive(timeout);
        let is_there = event.is_some();
        if let Some(event) = event {
            self.services.receive(&mut self.node, event);
        }
        is_there
    }

    /// Answers requests and tells late readers what they have missed; waits so long for a request if there is none.
    fn look(&mut self, player: &mut Player, wait: Duration) {
        if wait.is_zero() && self.looked.elapsed() < LOOK_PERIOD {
            return;
        }
        self.looked = now();
        let mut wait = wait.min(PATIENCE);
        while self.services.has_room() && self.receive(std::mem::take(&mut wait)) {}
        while let Some(request) = self.services.next() {
            player.answer(request, self.wall_ns());
        }
        if self.subscriptions.poll(&self.context) {
            self.greet_new_readers(true);
        }
        if now() >= self.piece {
            self.say_again();
        }
    }

    fn greet_new_readers(&mut self, are_late: bool) {
        for (number, topic) in self.topics.iter_mut().enumerate() {
            let arrivals = self.subscriptions.arrivals(number).unwrap_or(topic.arrivals);
            if std::mem::replace(&mut topic.arrivals, arrivals) < arrivals
                && are_late
                && let Some(cache) = &mut topic.cache
            {
                cache.reader_joined();
            }
        }
    }

    /// Tells late readers of each topic one thing that they have missed.
    fn say_again(&mut self) {
        for topic in &mut self.topics {
            let Some(cache) = &mut topic.cache else { continue };
            if let Some(message) = cache.next_missing().cloned() {
                self.piece = now() + PIECE_PERIOD;
                match topic.publisher.publish(&mut self.node, &message) {
                    PublishOutcome::Sent => cache.record_published(&message),
                    PublishOutcome::Retry => {}
                    PublishOutcome::Renewed => cache.publisher_replaced(),
                }
            }
        }
    }

    fn say_opening(&mut self, cursor: &mut PlaybackCursor<'_>, stop: &AtomicBool) {
        while let Some(cue) = cursor.opening() {
            self.say(&cue, stop);
        }
    }

    /// Says what belongs to a tick, the clock first.
    fn say_tick(&mut self, tick: Tick, cursor: &mut PlaybackCursor<'_>, stop: &AtomicBool) {
        let clock = Encoded::of(&Clock { clock: tick.into() });
        while self.clock.publish(&mut self.node, &clock) != PublishOutcome::Sent && !stop.load(Ordering::Relaxed) {
            self.receive(LOOK_PERIOD);
        }
        while let Some(cue) = cursor.until(tick) {
            self.say(&cue, stop);
        }
    }

    fn say(&mut self, cue: &ScheduledMessage, stop: &AtomicBool) {
        while !stop.load(Ordering::Relaxed) {
            let topic = &mut self.topics[cue.topic];
            match topic.publisher.publish(&mut self.node, &cue.message) {
                PublishOutcome::Sent => {
                    self.messages += 1;
                    return topic.cache.iter_mut().for_each(|cache| cache.record_published(&cue.message));
                }
                PublishOutcome::Retry => {}
                PublishOutcome::Renewed => topic.cache.iter_mut().for_each(LatchedCache::publisher_replaced),
            }
            self.receive(LOOK_PERIOD);
        }
    }

    fn status(&self, player: &Player) -> String {
        let passed_s = Tick(player.sim_ticks()).time_ns() as f64 * 1e-9;
        let wall_s = self.begun.elapsed().as_secs_f64();
        format!(
            "{} | {:6.1} x real time | {} messages",
            terminal::clock(player.position()),
            if wall_s > 0.0 { passed_s / wall_s } else { 0.0 },
            self.messages
        )
    }
}

impl Drop for ReplayNode {
    fn drop(&mut self) {
        linger(true);
    }
}
