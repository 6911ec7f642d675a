//! The server's link over ROS 2: one participant with one node `sim_server`, and three topics for each agent.
//!
//! Invariants: what is sent to one agent never waits for another one, nor for onlookers (see [`msgs::ros`]); every message
//! says which process it came from. Who takes part, what is legal and when to send again is decided in `run.rs`. This file
//! is the only one here that knows the ROS client.

mod driven;

use std::cell::Cell;
use std::collections::BTreeMap;
use std::rc::Rc;
use std::time::{Duration, Instant};

use msgs::ids::{AgentId, Tick};
use msgs::maes_msgs::{Command, Join, JoinReply, Observation, Progress, Scenario};
use msgs::ros::{self, Inbox, Outlet, RosError, Sample, Workshop, linger, now};
use msgs::ros_env::RosEnv;
use msgs::rosgraph_msgs::Clock;
use msgs::topics;
use ros2_client::{Context, Node};

use crate::link::{Inbound, Incoming, Link, SourceId};
use crate::twist::Driver;
use driven::Driven;

/// Wall time for which a new server listens before it says anything: enough, on a machine that is not busy, to find another
/// server that was here first and to hear its scenario, so that the agents of that one do not hear of a second run. A server
/// that is found later is refused all the same. Agents take as long to start.
const LISTENING: Duration = Duration::from_millis(300);

/// Wall time between two looks at who listens to the clock; a look costs some ten microseconds.
const AUDIENCE_PERIOD: Duration = Duration::from_millis(50);

/// The server in a ROS network.
pub struct RosLink {
    inbox: Inbox<Option<Incoming>>,
    born: Instant,
    /// What is to be announced when this server has listened long enough.
    unannounced: Option<Scenario>,
    own_run: Rc<Cell<Option<u64>>>,
    other_run: Rc<Cell<Option<u64>>>,
    /// One for each agent that is a process of ours.
    observations: BTreeMap<AgentId, Outlet<Observation>>,
    driven: Driven,
    scenario: Outlet<Scenario>,
    join_reply: Outlet<JoinReply>,
    clock: Outlet<Clock>,
    progress: Outlet<Progress>,
    audience: Audience,
    node: Node,
    context: Context,
}

impl RosLink {
    /// Joins the network and offers the topics of a run with this many agents, of which some are driven by standard messages.
    ///
    /// # Errors
    /// If the network cannot be joined, or the system has not enough of something.
    pub fn new(agents: u32, drivers: Vec<(AgentId, Driver)>, env: &RosEnv) -> Result<Self, RosError> {
        ros::allow_open_files(agents)?;
        let context = ros::join(env, true)?;
        let mut node = ros::node(&context, "sim_server")?;
        let mut workshop = Workshop::default();
        let clock = workshop.outlet(&mut node, &topics::clock())?;
        let scenario = workshop.outlet(&mut node, &topics::scenario())?;
        let join_reply = workshop.outlet(&mut node, &topics::join_reply())?;
        let progress = workshop.outlet(&mut node, &topics::progress())?;
        let mut inbox = Inbox::default();
        let own_run = Rc::new(Cell::new(None));
        let other_run = Rc::new(Cell::new(None));
        let (own, other) = (Rc::clone(&own_run), Rc::clone(&other_run));
        workshop.inlet(&mut node, &topics::scenario(), &mut inbox, move |sample: Sample<Scenario>| {
            // What cannot be read is the scenario of another version.
            let run = sample.message.map_or(0, |scenario| scenario.run);
            if own.get() != Some(run) {
                other.set(Some(run));
            }
            None
        })?;
        let driven = Driven::new(drivers, &mut workshop, &mut node, &mut inbox, &own_run)?;
        let mut observations = BTreeMap::new();
        for agent in (0..agents).map(AgentId).filter(|&agent| !driven.has(agent)) {
            workshop.inlet(&mut node, &topics::join(agent), &mut inbox, move |sample: Sample<Join>| {
                Some(incoming(agent, sample, Inbound::Join))
            })?;
            workshop.inlet(&mut node, &topics::command(agent), &mut inbox, move |sample: Sample<Command>| {
                Some(incoming(agent, sample, Inbound::Command))
            })?;
            observations.insert(agent, workshop.outlet(&mut node, &topics::observation(agent))?);
        }
        let audience = Audience { topic: dds_name(&topics::clock()), listens: false, looked: None };
        Ok(RosLink {
            inbox,
            born: now(),
            unannounced: None,
            own_run,
            other_run,
            observations,
            driven,
            scenario,
            join_reply,
            clock,
            progress,
            audience,
            node,
            context,
        })
    }

    /// Says what is to be announced, once it may.
    fn announce_in_time(&mut self) {
        if self.other_run.get().is_none()
            && self.born.elapsed() >= LISTENING
            && let Some(scenario) = self.unannounced.take()
        {
            self.scenario.publish(&mut self.node, &scenario);
        }
    }
}

impl Link for RosLink {
    fn announce(&mut self, scenario: &Scenario) {
        self.own_run.set(Some(scenario.run));
        self.unannounced = Some(scenario.clone());
        self.announce_in_time();
    }

    fn reply_join(&mut self, reply: &JoinReply) {
        self.driven.note_reply(reply);
        self.join_reply.publish(&mut self.node, reply);
    }

    fn send(&mut self, agent: AgentId, part: &Observation) {
        match self.observations.get_mut(&agent) {
            Some(observations) => observations.publish(&mut self.node, part),
            None => self.driven.tell(&mut self.node, &mut self.clock, agent, part),
        }
    }

    fn clock(&mut self, tick: Tick) {
        if self.driven.are_any() || self.audience.listens(&self.context) {
            self.clock.publish(&mut self.node, &Clock { clock: tick.into() });
        }
    }

    fn progress(&mut self, progress: &Progress) {
        self.progress.publish(&mut self.node, progress);
    }

    fn receive(&mut self, timeout: Duration) -> Option<Incoming> {
        self.announce_in_time();
        match self.driven.next(&self.context, self.own_run.get()) {
            None => self.inbox.receive(timeout).flatten(),
            said => said,
        }
    }

    fn other_run(&self) -> Option<u64> {
        self.other_run.get()
    }
}

impl Drop for RosLink {
    fn drop(&mut self) {
        linger();
    }
}

fn incoming<M>(topic_agent: AgentId, sample: Sample<M>, inbound: impl Fn(M) -> Inbound) -> Incoming {
    let message = match sample.message {
        Ok(message) => inbound(message),
        Err(reason) => Inbound::Undecodable { reason },
    };
    Incoming { topic_agent, source: SourceId(sample.source), message }
}

/// Whether anybody listens to a topic. What nobody can hear need not be said: a fast run makes thousands of clock messages a
/// second, and each costs more than ten microseconds even if it is sent to nobody.
struct Audience {
    topic: String,
    listens: bool,
    looked: Option<Instant>,
}

impl Audience {
    fn listens(&mut self, context: &Context) -> bool {
        if self.looked.is_none_or(|looked| looked.elapsed() >= AUDIENCE_PERIOD) {
            self.looked = Some(now());
            let readers = context.domain_participant().discovered_readers();
            self.listens = readers.iter().any(|reader| *reader.subscription_topic_data.topic_name() == self.topic);
        }
        self.listens
    }
}

/// The name that ROS gives a topic in the middleware.
fn dds_name(topic: &topics::Topic) -> String {
    format!("rt{}", topic.name)
}
