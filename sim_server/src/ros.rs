//! The server's link over ROS 2: one participant with one node `sim_server`, its services, and three topics for each agent.
//!
//! Invariants: what is sent to one agent never waits for another one, nor for onlookers (see [`msgs::ros`]); every message
//! says which process it came from. Who takes part, what is legal and when to send again is decided in `run.rs`. This file
//! is the only one here that knows the ROS client.

mod services;

use std::cell::Cell;
use std::collections::VecDeque;
use std::rc::Rc;
use std::time::{Duration, Instant};

use msgs::ids::{AgentId, Tick};
use msgs::maes_msgs::{Command, Join, JoinReply, Observation, Progress, Scenario};
use msgs::ros::{self, Inbox, Outlet, RosError, Sample, Workshop, linger, now};
use msgs::ros_env::RosEnv;
use msgs::rosgraph_msgs::Clock;
use msgs::topics;
use ros2_client::{Context, Node};

use crate::control::Request;
use crate::link::{Inbound, Incoming, Link, SourceId};
use crate::{parameters, scenario};
use services::{Asked, Services};

/// Wall time for which a new server listens before it says anything: enough, on a machine that is not busy, to find another
/// server that was here first and to hear its scenario, so that the agents of that one do not hear of a second run. A server
/// that is found later is refused all the same. Agents take as long to start.
const LISTENING: Duration = Duration::from_millis(300);

/// Wall time between two looks at who listens to the clock; a look costs some ten microseconds.
const AUDIENCE_PERIOD: Duration = Duration::from_millis(50);

/// Wall time between two looks for requests while a run does not wait for anything.
const REQUEST_PERIOD: Duration = Duration::from_millis(5);

/// Messages of agents that are kept at the most while requests are looked for; more stay where they are.
const KEPT_MAX: usize = 256;

/// What comes in.
enum Item {
    /// From an agent.
    Agent(Incoming),
    /// From somebody else.
    Asked(Asked),
    /// Something that has been dealt with.
    Nothing,
}

impl From<Asked> for Item {
    fn from(asked: Asked) -> Self {
        Item::Asked(asked)
    }
}

/// The server in a ROS network.
pub struct RosLink {
    inbox: Inbox<Item>,
    /// Messages of agents that came in while requests were looked for.
    kept: VecDeque<Incoming>,
    services: Services,
    asked_last: Instant,
    born: Instant,
    /// What is to be announced when this server has listened long enough.
    unannounced: Option<Scenario>,
    own_run: Rc<Cell<Option<u64>>>,
    other_run: Rc<Cell<Option<u64>>>,
    observations: Vec<Outlet<Observation>>,
    scenario: Outlet<Scenario>,
    join_reply: Outlet<JoinReply>,
    clock: Outlet<Clock>,
    progress: Outlet<Progress>,
    audience: Audience,
    node: Node,
    context: Context,
}

impl RosLink {
    /// Joins the network and offers the topics, services and parameters of a run.
    ///
    /// # Errors
    /// If the network cannot be joined, or the system has not enough of something.
    pub fn new(run: &scenario::Scenario, env: &RosEnv) -> Result<Self, RosError> {
        let agents = run.agents.count;
        ros::allow_open_files(agents)?;
        let context = ros::join(env, true)?;
        let mut node = ros::node(&context, "sim_server")?;
        let mut workshop = Workshop::of(&context);
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
            Item::Nothing
        })?;
        let mut observations = Vec::new();
        for agent in (0..agents).map(AgentId) {
            workshop.inlet(&mut node, &topics::join(agent), &mut inbox, move |sample: Sample<Join>| {
                Item::Agent(incoming(agent, sample, Inbound::Join))
            })?;
            workshop.inlet(&mut node, &topics::command(agent), &mut inbox, move |sample: Sample<Command>| {
                Item::Agent(incoming(agent, sample, Inbound::Command))
            })?;
            observations.push(workshop.outlet(&mut node, &topics::observation(agent))?);
        }
        let services = Services::new(&mut node, &mut workshop, &mut inbox, parameters::of(run))?;
        let audience = Audience { topic: dds_name(&topics::clock()), listens: false, looked: None };
        Ok(RosLink {
            inbox,
            kept: VecDeque::new(),
            services,
            asked_last: now(),
            born: now(),
            unannounced: None,
            own_run,
            other_run,
            observations,
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
        self.join_reply.publish(&mut self.node, reply);
    }

    fn send(&mut self, agent: AgentId, part: &Observation) {
        if let Some(observations) = self.observations.get_mut(agent.index()) {
            observations.publish(&mut self.node, part);
        }
    }

    fn clock(&mut self, tick: Tick) {
        if self.audience.listens(&self.context) {
            self.clock.publish(&mut self.node, &Clock { clock: tick.into() });
        }
    }

    fn progress(&mut self, progress: &Progress) {
        self.progress.publish(&mut self.node, progress);
    }

    fn receive(&mut self, timeout: Duration) -> Option<Incoming> {
        self.announce_in_time();
        if let Some(kept) = self.kept.pop_front() {
            return Some(kept);
        }
        match self.inbox.receive(timeout)? {
            Item::Agent(incoming) => Some(incoming),
            Item::Asked(asked) => {
                self.services.take_in(&mut self.node, asked);
                None
            }
            Item::Nothing => None,
        }
    }

    fn request(&mut self) -> Option<Request> {
        if self.asked_last.elapsed() >= REQUEST_PERIOD {
            while self.kept.len() < KEPT_MAX
                && self.services.has_room()
                && let Some(item) = self.inbox.receive(Duration::ZERO)
            {
                match item {
                    Item::Agent(incoming) => self.kept.push_back(incoming),
                    Item::Asked(asked) => self.services.take_in(&mut self.node, asked),
                    Item::Nothing => {}
                }
            }
            self.asked_last = now();
        }
        self.services.next()
    }

    fn takes_requests(&self) -> bool {
        true
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
