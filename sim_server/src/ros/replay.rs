//! Replay of a recording over ROS 2: one participant with one node `replay`, its services, and a
//! publisher per topic.
//!
//! Invariants: messages are published as recorded, with the type and QoS they have in a run;
//! readers are waited for, in the middle and at the end, but each only while it acknowledges
//! something (see [`ros_node::BlockingPublisher`]); a late reader of a latched topic receives every
//! message that still holds. [`recording::replay`] decides when a message is due.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use msgs::cdr::Encoded;
use msgs::ids::Tick;
use msgs::rosgraph_msgs::Clock;
use msgs::topics;
use ros_node::ros_env::RosEnv;
use ros_node::{
    Acknowledgements, BlockingPublisher, Context, Inbox, Node, PublishOutcome, RosError, SubscriptionTracker, linger,
};

use super::services::{ServiceEvent, Services};
use crate::terminal::{self, Terminal};
use recording::Recording;
use recording::replay::{
    LatchedCache, PlaybackCursor, PlaybackSchedule, PlaybackTiming, Player, PlayerAction, ScheduledMessage,
};
use simulation::parameters;
use system::wall_clock::now;
use transport::Level;

const NODE: &str = "replay";

/// Minimum and maximum wall time for existing readers to be matched before the first message.
const MATCHING_TIME_MIN: Duration = Duration::from_millis(300);
const MATCHING_TIME_MAX: Duration = Duration::from_secs(3);

/// Wall time between two polls for requests and late readers while messages are due.
const POLL_PERIOD: Duration = Duration::from_millis(5);

/// Maximum wall time that one wait for requests takes, before readers and `stop` are polled.
const WAIT_MAX: Duration = Duration::from_millis(20);

/// Minimum wall time between two retransmissions to late readers, so that they can keep up.
const RETRANSMISSION_PERIOD: Duration = Duration::from_millis(10);

/// Wall time between two progress reports.
const REPORT_PERIOD: Duration = Duration::from_millis(500);

/// Publishers that need at most as many open files as an agent of a run.
const TOPICS_OF_AGENT: usize = 8;

/// Outcome of a replay.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PlaybackSummary {
    /// Published messages without `/clock`.
    pub messages: u64,
    /// Sim time that has passed, in ticks.
    pub sim_ticks: u64,
    /// Whether a signal or a service ended it.
    pub is_interrupted: bool,
}

/// Plays a recording until its end, or until `stop` is set.
///
/// # Errors
/// If the network cannot be joined or a system limit is reached.
pub fn play(
    recording: &Recording,
    schedule: &PlaybackSchedule,
    timing: PlaybackTiming,
    env: &RosEnv,
    terminal: &mut Terminal,
    stop: &AtomicBool,
) -> Result<PlaybackSummary, RosError> {
    let mut node = ReplayNode::new(schedule, timing, env)?;
    node.wait_for_readers(stop);
    let mut player = Player::new(schedule, timing, node.wall_ns());
    let mut cursor = PlaybackCursor::new(recording, schedule);
    node.publish_initial(&mut cursor, stop);
    let mut reported = None;
    let is_stopped = || stop.load(Ordering::Relaxed);
    while !is_stopped() {
        node.poll(&mut player, Duration::ZERO);
        if reported.is_none_or(|reported: Instant| reported.elapsed() >= REPORT_PERIOD) {
            reported = Some(now());
            let done = player.position().0 as f64 / schedule.ticks().1.0.max(1) as f64;
            terminal.status(done, &node.status(&player));
        }
        match player.next_action(node.wall_ns()) {
            PlayerAction::Play(tick) => {
                node.publish_tick(tick, &mut cursor, stop);
                player.played();
            }
            PlayerAction::Wait(wait_ns) => node.poll(&mut player, Duration::from_nanos(wait_ns)),
            PlayerAction::Idle => node.poll(&mut player, WAIT_MAX),
            PlayerAction::Rewind => {
                cursor = PlaybackCursor::new(recording, schedule);
                node.publish_initial(&mut cursor, stop);
            }
            PlayerAction::End => break,
        }
    }
    player.end();
    let is_interrupted = is_stopped() || player.is_quitting();
    if !is_interrupted {
        node.wait_for_acknowledgements(schedule, terminal, stop);
    }
    Ok(PlaybackSummary { messages: node.messages, sim_ticks: player.sim_ticks(), is_interrupted })
}

/// The node of a replay.
struct ReplayNode {
    inbox: Inbox<ServiceEvent>,
    services: Services,
    clock: BlockingPublisher,
    topics: Vec<ReplayTopic>,
    subscriptions: SubscriptionTracker,
    polled: Instant,
    /// When the next retransmission to late readers is due.
    next_retransmission: Instant,
    begun: Instant,
    messages: u64,
    node: Node,
    context: Context,
}

/// A topic with its publisher.
struct ReplayTopic {
    publisher: BlockingPublisher,
    cache: Option<LatchedCache>,
    /// Readers that have ever settled.
    arrivals: u64,
}

impl ReplayNode {
    fn new(schedule: &PlaybackSchedule, timing: PlaybackTiming, env: &RosEnv) -> Result<Self, RosError> {
        ros_node::allow_open_files(
            u32::try_from(schedule.topics().len().div_ceil(TOPICS_OF_AGENT)).unwrap_or(u32::MAX),
        )?;
        let (context, mut endpoints) = ros_node::join(env, true)?;
        let mut node = ros_node::node(&context, NODE)?;
        let clock = endpoints.blocking_publisher(&mut node, &topics::clock())?;
        let mut topics = Vec::new();
        for topic in schedule.topics() {
            let publisher = endpoints.blocking_publisher(&mut node, topic)?;
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
            polled: born,
            next_retransmission: born,
            begun: born,
            messages: 0,
            node,
            context,
        })
    }

    /// Waits until existing readers have settled. Requests queue up meanwhile.
    fn wait_for_readers(&mut self, stop: &AtomicBool) {
        let begun = now();
        let is_matched =
            |subscriptions: &SubscriptionTracker| begun.elapsed() >= MATCHING_TIME_MIN && subscriptions.all_settled();
        while !stop.load(Ordering::Relaxed) && !is_matched(&self.subscriptions) && begun.elapsed() < MATCHING_TIME_MAX {
            self.receive(WAIT_MAX);
            self.subscriptions.poll(&self.context);
        }
        self.note_new_readers(false);
        self.begun = now();
    }

    /// Waits until the readers have acknowledged everything, each as long as it acknowledges
    /// something.
    fn wait_for_acknowledgements(&mut self, schedule: &PlaybackSchedule, terminal: &mut Terminal, stop: &AtomicBool) {
        let mut waits: Vec<Acknowledgements> =
            self.topics.iter().map(|topic| topic.publisher.acknowledgements()).collect();
        let any = |waits: &mut Vec<Acknowledgements>| {
            // Of every topic, so that the time of each is noted.
            waits.iter_mut().map(Acknowledgements::are_awaited).fold(false, |any, awaited| any | awaited)
        };
        while any(&mut waits) && !stop.load(Ordering::Relaxed) {
            self.receive(POLL_PERIOD);
        }
        for (topic, wait) in schedule.topics().iter().zip(&waits) {
            match wait.missing_readers() {
                0 => {}
                readers => {
                    let text =
                        format!("{}: {readers} readers do not acknowledge the last messages any more", topic.name);
                    terminal.say(Level::Warn, &text);
                }
            }
        }
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

    /// Answers requests and serves late readers; waits up to `wait` for a request.
    fn poll(&mut self, player: &mut Player, wait: Duration) {
        if wait.is_zero() && self.polled.elapsed() < POLL_PERIOD {
            return;
        }
        self.polled = now();
        let mut wait = wait.min(WAIT_MAX);
        while self.services.has_room() && self.receive(std::mem::take(&mut wait)) {}
        while let Some(request) = self.services.next() {
            player.answer(request, self.wall_ns());
        }
        if self.subscriptions.poll(&self.context) {
            self.note_new_readers(true);
        }
        if now() >= self.next_retransmission {
            self.retransmit();
        }
    }

    fn note_new_readers(&mut self, are_late: bool) {
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

    /// Retransmits one message per topic that late readers have missed.
    fn retransmit(&mut self) {
        for topic in &mut self.topics {
            let Some(cache) = &mut topic.cache else { continue };
            if let Some(message) = cache.next_missing().cloned() {
                self.next_retransmission = now() + RETRANSMISSION_PERIOD;
                match topic.publisher.publish(&mut self.node, &message) {
                    PublishOutcome::Sent => cache.record_published(&message),
                    PublishOutcome::Retry => {}
                    PublishOutcome::Renewed => cache.publisher_replaced(),
                }
            }
        }
    }

    fn publish_initial(&mut self, cursor: &mut PlaybackCursor<'_>, stop: &AtomicBool) {
        while let Some(message) = cursor.next_initial() {
            self.publish(&message, stop);
        }
    }

    /// Publishes the messages of a tick, the clock first.
    fn publish_tick(&mut self, tick: Tick, cursor: &mut PlaybackCursor<'_>, stop: &AtomicBool) {
        let clock = Encoded::of(&Clock { clock: tick.into() });
        while self.clock.publish(&mut self.node, &clock) != PublishOutcome::Sent && !stop.load(Ordering::Relaxed) {
            self.receive(POLL_PERIOD);
        }
        while let Some(message) = cursor.next_until(tick) {
            self.publish(&message, stop);
        }
    }

    fn publish(&mut self, message: &ScheduledMessage, stop: &AtomicBool) {
        while !stop.load(Ordering::Relaxed) {
            let topic = &mut self.topics[message.topic];
            match topic.publisher.publish(&mut self.node, &message.message) {
                PublishOutcome::Sent => {
                    self.messages += 1;
                    return topic.cache.iter_mut().for_each(|cache| cache.record_published(&message.message));
                }
                PublishOutcome::Retry => {}
                PublishOutcome::Renewed => topic.cache.iter_mut().for_each(LatchedCache::publisher_replaced),
            }
            self.receive(POLL_PERIOD);
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
        // Who reads with best effort acknowledges nothing, and the published DDS library does not
        // report acknowledgements.
        linger(true);
    }
}
