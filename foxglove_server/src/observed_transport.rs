//! A link that also serves the observers of the Foxglove server; messages pass through unchanged.
//!
//! Invariant: the log time of a message is its stamp, and where it has none the last clock.

use std::collections::{BTreeMap, BTreeSet};
use std::time::{Duration, Instant};

use msgs::builtin_interfaces::Time;
use msgs::ids::{AgentId, Tick};
use msgs::maes_msgs::{JoinReply, Observation, Progress, Scenario};
use msgs::nav_msgs::Odometry;
use msgs::rcl_interfaces::Log;
use msgs::rosgraph_msgs::Clock;
use msgs::sensor_msgs::PointCloud2;
use msgs::{cdr, topics};

use super::FoxgloveServer;
use super::services;
use simulation::scenario::{self, Rtf};
use simulation::visualisation::{SensorId, Subscribers, VisualisationMessage, VisualisationTopic};
use system::wall_clock::{now, since_epoch};
use transport::control::Request;
use transport::{AgentTransport, ControlInput, Incoming, Level, ObserverOutput, Signed, Transport};

/// The node in log messages.
const NODE: &str = "sim_server";

/// Minimum wall time between two broadcasts of the time, and two messages on `/clock`: a run makes
/// thousands of ticks in a second, which would displace everything else.
const CLOCK_PERIOD: Duration = Duration::from_millis(33);

/// A link with observers.
pub struct ObservedTransport<'v, L> {
    link: L,
    foxglove: &'v FoxgloveServer,
    scenario: &'v scenario::Scenario,
    view_of_topic: BTreeMap<String, VisualisationTopic>,
    /// Agents by the topics of their belief maps, if these can be relayed.
    belief_of_topic: BTreeMap<String, AgentId>,
    /// Subscriptions at the Foxglove server, as of `revision`.
    own: BTreeMap<VisualisationTopic, u64>,
    revision: u64,
    /// Subscriptions at the inner link, when last polled.
    inner: Subscribers,
    all: Subscribers,
    time_sent: Option<Instant>,
    tick: Tick,
    is_time_sent: bool,
}

impl<'v, L: Transport> ObservedTransport<'v, L> {
    /// Serves observers of a run over a link.
    pub fn new(link: L, foxglove: &'v FoxgloveServer, scenario: &'v scenario::Scenario) -> Self {
        Self {
            link,
            foxglove,
            scenario,
            view_of_topic: BTreeMap::new(),
            belief_of_topic: BTreeMap::new(),
            own: BTreeMap::new(),
            revision: 0,
            inner: Subscribers::new(),
            all: Subscribers::new(),
            time_sent: None,
            tick: Tick::ZERO,
            is_time_sent: true,
        }
    }

    /// Offers the topics of a run.
    fn open_topics(&mut self, run: u64) {
        let equipment = self.scenario.equipment();
        let views = VisualisationTopic::all(&equipment);
        self.view_of_topic = views.map(|view| (view.topic().name, view)).collect();
        let relayed = if self.link.relays_beliefs() { self.scenario.agents.count } else { 0 };
        self.belief_of_topic = (0..relayed).map(AgentId).map(|agent| (topics::belief(agent).name, agent)).collect();
        let views = self.view_of_topic.values().map(|view| view.topic());
        let beliefs = self.belief_of_topic.values().map(|&agent| topics::belief(agent));
        let of_session = [topics::scenario(), topics::progress(), topics::clock(), topics::rosout()];
        let topics = views.chain(beliefs).chain(of_session);
        self.foxglove.hub.start_session(run, self.scenario, topics);
    }

    /// Broadcasts the time unless that was done, or anything else a moment ago.
    fn broadcast_time(&mut self) {
        if !self.is_time_sent && self.time_sent.is_none_or(|sent| sent.elapsed() >= CLOCK_PERIOD) {
            self.time_sent = Some(now());
            self.is_time_sent = true;
            self.foxglove.hub.broadcast_time(self.tick);
            let clock = cdr::encode(&Clock { clock: self.tick.into() });
            self.foxglove.hub.publish(&topics::clock().name, &clock, self.tick.time_ns());
        }
    }

    /// Passes on what agents have published of their belief maps.
    fn relay_beliefs(&mut self) {
        while let Some((agent, marker)) = self.link.relayed_belief() {
            let time_ns = time_ns(&marker.header.stamp);
            let topic = topics::belief(agent).name;
            self.foxglove.hub.publish_latched_marker(&topic, &marker, time_ns);
        }
    }

    /// Updates the subscriptions; returns whether they may have changed.
    fn update_own(&mut self) -> bool {
        let Some(arrivals) = self.foxglove.hub.arrivals(&mut self.revision) else { return false };
        let beliefs: BTreeSet<AgentId> =
            arrivals.iter().filter_map(|(topic, _)| self.belief_of_topic.get(topic).copied()).collect();
        self.link.relay_beliefs(&beliefs);
        for (topic, agent) in &self.belief_of_topic {
            if !beliefs.contains(agent) {
                // The next subscriber gets it as it is then.
                self.foxglove.hub.forget_latched(topic);
            }
        }
        let view = |(topic, arrivals)| Some((*self.view_of_topic.get(&topic)?, arrivals));
        self.own = arrivals.into_iter().filter_map(view).collect();
        true
    }
}

fn time_ns(stamp: &Time) -> u64 {
    u64::try_from(stamp.sec).unwrap_or_default() * 1_000_000_000 + u64::from(stamp.nanosec)
}

/// Arrival counts that grow whenever one of the two does.
fn merge(all: &mut Subscribers, own: &BTreeMap<VisualisationTopic, u64>, inner: &Subscribers) {
    let sum = |view: &VisualisationTopic| own.get(view).unwrap_or(&0) + inner.get(view).unwrap_or(&0);
    all.retain(|view, _| own.contains_key(view) || inner.contains_key(view));
    for &view in own.keys().chain(inner.keys()) {
        all.insert(view, sum(&view));
    }
}

impl<L: Transport> AgentTransport for ObservedTransport<'_, L> {
    fn announce(&mut self, scenario: &Scenario) {
        self.open_topics(scenario.run);
        self.foxglove.hub.publish_latched(&topics::scenario().name, cdr::encode(scenario), Tick::ZERO);
        self.link.announce(scenario);
    }

    fn reply_join(&mut self, reply: &JoinReply) {
        self.link.reply_join(reply);
    }

    fn send(&mut self, agent: AgentId, part: Signed<Observation>) {
        self.link.send(agent, part);
    }

    fn is_open(&self) -> bool {
        self.link.is_open()
    }

    fn receive(&mut self, timeout: Duration) -> Option<Incoming> {
        // The last of many ticks in quick succession, when none comes any more.
        self.broadcast_time();
        self.link.receive(timeout)
    }

    fn set_sensors(&mut self, agent: AgentId, odometry: Odometry, points: Vec<(SensorId, PointCloud2)>) {
        self.link.set_sensors(agent, odometry, points);
    }

    fn now(&self) -> Instant {
        self.link.now()
    }

    fn other_run(&self) -> Option<u64> {
        self.link.other_run()
    }
}

impl<L: Transport> ObserverOutput for ObservedTransport<'_, L> {
    fn clock(&mut self, tick: Tick) {
        self.link.clock(tick);
        self.tick = tick;
        self.is_time_sent = false;
        self.broadcast_time();
    }

    fn progress(&mut self, progress: &Progress) {
        self.foxglove.hub.publish_latched(&topics::progress().name, cdr::encode(progress), Tick(progress.tick));
        self.link.progress(progress);
    }

    fn subscribers(&mut self) -> Option<&Subscribers> {
        let is_other_here = self.update_own();
        self.relay_beliefs();
        let there = self.link.subscribers();
        if self.own.is_empty() {
            return there;
        }
        // In almost every tick both are as before, and then there is nothing to do.
        let is_other_there = there.map_or(!self.inner.is_empty(), |there| *there != self.inner);
        if is_other_there {
            self.inner = there.cloned().unwrap_or_default();
        }
        if is_other_here || is_other_there {
            merge(&mut self.all, &self.own, &self.inner);
        }
        Some(&self.all)
    }

    fn publish(&mut self, view: VisualisationTopic, picture: &VisualisationMessage) {
        let is_last = view == VisualisationTopic::Result;
        if is_last || self.own.is_empty() || self.inner.contains_key(&view) {
            self.link.publish(view, picture);
        }
        if is_last {
            if let VisualisationMessage::Result(result) = picture {
                self.foxglove.hub.publish_latched(&view.topic().name, cdr::encode(picture), Tick(result.tick));
            }
        } else if self.own.contains_key(&view) {
            let time_ns = picture.stamp().map_or(self.tick.time_ns(), |stamp| time_ns(&stamp));
            self.foxglove.hub.publish(&view.topic().name, &cdr::encode(picture), time_ns);
        }
    }

    fn real_time_factor(&mut self, rtf: Rtf) {
        self.foxglove.hub.set_rtf(rtf);
        self.link.real_time_factor(rtf);
    }

    fn log(&mut self, level: Level, text: &str) {
        let log = cdr::encode(&Log::of_node(NODE, level, text, since_epoch().into()));
        self.foxglove.hub.publish_latched(&topics::rosout().name, log, self.tick);
        self.link.log(level, text);
    }
}

impl<L: Transport> ControlInput for ObservedTransport<'_, L> {
    fn request(&mut self) -> Option<Request> {
        self.link.request().or_else(|| self.foxglove.requests.try_iter().find_map(services::request))
    }

    fn accepts_requests(&self) -> bool {
        true
    }
}

impl<L> Drop for ObservedTransport<'_, L> {
    fn drop(&mut self) {
        for request in self.foxglove.requests.try_iter() {
            services::refuse(request, "the run has ended");
        }
        self.foxglove.wait_for_readers();
    }
}
