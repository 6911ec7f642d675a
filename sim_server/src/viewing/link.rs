//! A link with people who look on through the WebSocket: everything goes the same way as without them, and to them as well.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

use foxglove::{ChannelBuilder, Context, PartialMetadata, RawChannel, Schema};
use msgs::ids::{AgentId, Tick};
use msgs::maes_msgs::{JoinReply, Observation, Progress, Scenario};
use msgs::nav_msgs::Odometry;
use msgs::sensor_msgs::PointCloud2;
use msgs::topics::{self, Topic};
use msgs::{cdr, schema};

use super::Viewing;
use super::services;
use crate::control::Request;
use crate::transport::{AgentTransport, ControlInput, Incoming, Level, ObserverOutput, Transport};
use crate::wall_clock::now;
use simulation::scenario::{self, Rtf};
use simulation::visualisation::{Subscribers, VisualisationMessage, VisualisationTopic};

/// Wall time between two tellings of the time.
const CLOCK_PERIOD: Duration = Duration::from_millis(33);

/// A link that is looked at.
pub struct Watched<'v, L> {
    link: L,
    viewing: &'v Viewing,
    scenario: &'v scenario::Scenario,
    channels: BTreeMap<VisualisationTopic, Arc<RawChannel>>,
    view_of_topic: BTreeMap<String, VisualisationTopic>,
    /// Who looks on here, as of `revision`.
    here: BTreeMap<VisualisationTopic, u64>,
    revision: u64,
    /// Those of the link, when they were last asked for.
    there: Subscribers,
    all: Subscribers,
    clock_told: Option<Instant>,
    tick: Tick,
    is_time_told: bool,
}

impl<'v, L: Transport> Watched<'v, L> {
    /// Shows the run of a scenario over a link.
    pub fn new(link: L, viewing: &'v Viewing, scenario: &'v scenario::Scenario) -> Self {
        Self {
            link,
            viewing,
            scenario,
            channels: BTreeMap::new(),
            view_of_topic: BTreeMap::new(),
            here: BTreeMap::new(),
            revision: 0,
            there: Subscribers::new(),
            all: Subscribers::new(),
            clock_told: None,
            tick: Tick::ZERO,
            is_time_told: true,
        }
    }

    /// Offers what there is to see of a run, anew.
    fn open_channels(&mut self, run: u64) {
        self.channels.clear();
        let context = &self.viewing.context;
        for view in VisualisationTopic::all(self.scenario.agents.count) {
            let channel = channel(context, &view.topic());
            self.view_of_topic.insert(channel.topic().to_owned(), view);
            self.channels.insert(view, channel);
        }
        let others = [topics::scenario(), topics::progress()].map(|topic| channel(context, &topic));
        self.viewing.hall.begin(run, self.scenario, self.channels.values().cloned().chain(others));
    }

    /// Tells what time it is, unless that was told, or something else just before.
    fn tell_time(&mut self) {
        if !self.is_time_told && self.clock_told.is_none_or(|told| told.elapsed() >= CLOCK_PERIOD) {
            self.clock_told = Some(now());
            self.is_time_told = true;
            self.viewing.server.broadcast_time(self.tick.time_ns());
        }
    }

    /// Finds out who looks on here now; says whether that may have changed.
    fn look_here(&mut self) -> bool {
        let Some(arrivals) = self.viewing.hall.arrivals(&mut self.revision) else { return false };
        let view = |(topic, arrivals)| Some((*self.view_of_topic.get(&topic)?, arrivals));
        self.here = arrivals.into_iter().filter_map(view).collect();
        true
    }
}

/// Numbers of arrivals that grow whenever one of both does.
fn merge(all: &mut Subscribers, here: &BTreeMap<VisualisationTopic, u64>, there: &Subscribers) {
    let sum = |view: &VisualisationTopic| here.get(view).unwrap_or(&0) + there.get(view).unwrap_or(&0);
    all.retain(|view, _| here.contains_key(view) || there.contains_key(view));
    for &view in here.keys().chain(there.keys()) {
        all.insert(view, sum(&view));
    }
}

impl<L: Transport> AgentTransport for Watched<'_, L> {
    fn announce(&mut self, scenario: &Scenario) {
        self.open_channels(scenario.run);
        self.viewing.hall.say_latched(&topics::scenario().name, cdr::encode(scenario), Tick::ZERO);
        self.link.announce(scenario);
    }

    fn reply_join(&mut self, reply: &JoinReply) {
        self.link.reply_join(reply);
    }

    fn send(&mut self, agent: AgentId, part: &Observation) {
        self.link.send(agent, part);
    }

    fn receive(&mut self, timeout: Duration) -> Option<Incoming> {
        // The last of many ticks in quick succession, when none comes any more.
        self.tell_time();
        self.link.receive(timeout)
    }

    fn set_sensors(&mut self, agent: AgentId, odometry: Odometry, points: Option<PointCloud2>) {
        self.link.set_sensors(agent, odometry, points);
    }

    fn other_run(&self) -> Option<u64> {
        self.link.other_run()
    }
}

impl<L: Transport> ObserverOutput for Watched<'_, L> {
    fn clock(&mut self, tick: Tick) {
        self.link.clock(tick);
        self.tick = tick;
        self.is_time_told = false;
        self.tell_time();
    }

    fn progress(&mut self, progress: &Progress) {
        self.viewing.hall.say_latched(&topics::progress().name, cdr::encode(progress), Tick(progress.tick));
        self.link.progress(progress);
    }

    fn subscribers(&mut self) -> Option<&Subscribers> {
        let is_other_here = self.look_here();
        let there = self.link.subscribers();
        if self.here.is_empty() {
            return there;
        }
        // In almost every tick both are as before, and then there is nothing to do.
        let is_other_there = there.map_or(!self.there.is_empty(), |there| *there != self.there);
        if is_other_there {
            self.there = there.cloned().unwrap_or_default();
        }
        if is_other_here || is_other_there {
            merge(&mut self.all, &self.here, &self.there);
        }
        Some(&self.all)
    }

    fn publish(&mut self, view: VisualisationTopic, picture: &VisualisationMessage) {
        let is_last = view == VisualisationTopic::Result;
        if is_last || self.here.is_empty() || self.there.contains_key(&view) {
            self.link.publish(view, picture);
        }
        if is_last {
            if let VisualisationMessage::Result(result) = picture {
                self.viewing.hall.say_latched(&view.topic().name, cdr::encode(picture), Tick(result.tick));
            }
        } else if self.here.contains_key(&view)
            && let Some(channel) = self.channels.get(&view)
        {
            let time_ns = self.tick.time_ns();
            channel.log_with_meta(&cdr::encode(picture), PartialMetadata::with_log_time(time_ns));
        }
    }

    fn real_time_factor(&mut self, rtf: Rtf) {
        self.viewing.hall.tell_pace(rtf);
        self.link.real_time_factor(rtf);
    }

    fn log(&mut self, level: Level, text: &str) {
        self.link.log(level, text);
    }
}

impl<L: Transport> ControlInput for Watched<'_, L> {
    fn request(&mut self) -> Option<Request> {
        self.link.request().or_else(|| self.viewing.wishes.try_iter().find_map(services::request))
    }

    fn accepts_requests(&self) -> bool {
        true
    }
}

impl<L> Drop for Watched<'_, L> {
    fn drop(&mut self) {
        for wish in self.viewing.wishes.try_iter() {
            services::refuse(wish, "the run has ended");
        }
        self.viewing.farewell();
    }
}

fn channel(context: &Arc<Context>, topic: &Topic) -> Arc<RawChannel> {
    let schema = Schema::new(topic.message.to_string(), "ros2msg", schema::text(topic.message).into_bytes());
    ChannelBuilder::new(topic.name.as_str())
        .context(context)
        .message_encoding("cdr")
        .schema(schema)
        .build_raw()
        .expect("a channel of its own is refused only where the schema's encoding is none")
}
