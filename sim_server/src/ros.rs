//! The server's link over ROS 2: one participant with one node `sim_server`, its services, and three topics for each agent. What
//! plays recordings is in [`replay`].
//!
//! Invariants: what is sent to one agent never waits for another one, nor for onlookers (see [`ros_node`]); every message
//! says which process it came from. Who takes part, what is legal and when to send again is decided in `run.rs`. This file
//! and its folder are the only ones here that know the ROS client.

mod driven;
mod services;
mod views;

pub mod replay;

use std::cell::Cell;
use std::collections::{BTreeMap, VecDeque};
use std::rc::Rc;
use std::time::{Duration, Instant};

use msgs::ids::{AgentId, Tick};
use msgs::maes_msgs::{Command, Join, JoinReply, Observation, Progress, Scenario};
use msgs::nav_msgs::Odometry;
use msgs::rosgraph_msgs::Clock;
use msgs::sensor_msgs::PointCloud2;
use msgs::topics;
use ros_node::ros_env::RosEnv;
use ros_node::rosout::Rosout;
use ros_node::{Inbox, Outlet, RosError, Sample, Workshop, linger, now, own_source};
use ros2_client::{Context, Node};

use crate::control::Request;
use crate::transport::{AgentTransport, ControlInput, Inbound, Incoming, Level, ObserverOutput};
use simulation::lockstep::SourceId;
use simulation::parameters;
use simulation::scenario::{self, Rtf};
use simulation::visualisation::{Subscribers, VisualisationMessage, VisualisationTopic};

use driven::Driven;
use services::{Asked, Services};
use views::Gallery;

/// Wall time for which a new server listens before it says anything: enough, on a machine that is not busy, to find another
/// server that was here first and to hear its scenario, so that the agents of that one do not hear of a second run. A server
/// that is found later is refused all the same. Agents take as long to start.
const LISTENING: Duration = Duration::from_millis(300);

/// The name of the node.
const NODE: &str = "sim_server";

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
    /// One for each agent that is a process of ours.
    observations: BTreeMap<AgentId, Outlet<Observation>>,
    /// Those of the agents that are driven by standard messages.
    nodes: Driven,
    scenario: Outlet<Scenario>,
    join_reply: Outlet<JoinReply>,
    clock: Outlet<Clock>,
    progress: Outlet<Progress>,
    gallery: Gallery,
    rosout: Rosout,
    node: Node,
    context: Context,
}

impl RosLink {
    /// Joins the network and offers the topics, services and parameters of a run.
    ///
    /// # Errors
    /// If the network cannot be joined, or the system has not enough of something.
    pub fn new(run: &scenario::Scenario, env: &RosEnv) -> Result<Self, RosError> {
        let (agents, driven) = (run.agents.count, run.driven());
        ros_node::allow_open_files(agents)?;
        let context = ros_node::join(env, true)?;
        let mut node = ros_node::node(&context, NODE)?;
        let mut workshop = Workshop::of(&context);
        let clock = workshop.outlet(&mut node, &topics::clock())?;
        let scenario = workshop.outlet(&mut node, &topics::scenario())?;
        let join_reply = workshop.outlet(&mut node, &topics::join_reply())?;
        let progress = workshop.outlet(&mut node, &topics::progress())?;
        let mut inbox = Inbox::default();
        let own_run = Rc::new(Cell::new(None));
        let other_run = Rc::new(Cell::new(None));
        let (own, other) = (own_source(&context), Rc::clone(&other_run));
        workshop.inlet(&mut node, &topics::scenario(), &mut inbox, move |sample: Sample<Scenario>| {
            match sample.message.map(|scenario| scenario.run) {
                // What this server says itself, of the present run or one before it, and a recording that is played.
                Ok(_) if sample.source == own => {}
                Ok(Scenario::NO_RUN) => {}
                Ok(run) => other.set(Some(run)),
                // What cannot be read is the scenario of another version.
                Err(_) => other.set(Some(0)),
            }
            Item::Nothing
        })?;
        let nodes = Driven::new(&driven, &mut workshop, &mut node, &mut inbox, &own_run)?;
        let mut observations = BTreeMap::new();
        for agent in (0..agents).map(AgentId).filter(|agent| !driven.contains(agent)) {
            workshop.inlet(&mut node, &topics::join(agent), &mut inbox, move |sample: Sample<Join>| {
                Item::Agent(incoming(agent, sample, Inbound::Join))
            })?;
            workshop.inlet(&mut node, &topics::command(agent), &mut inbox, move |sample: Sample<Command>| {
                Item::Agent(incoming(agent, sample, Inbound::Command))
            })?;
            observations.insert(agent, workshop.outlet(&mut node, &topics::observation(agent))?);
        }
        let rosout = Rosout::new(&mut workshop, &mut node, NODE)?;
        // What is needed comes first, so that nobody waits for what is only looked at.
        let gallery = Gallery::new(&mut workshop, &mut node, agents, &driven)?;
        let services = Services::of_run(&mut node, &mut workshop, &mut inbox, parameters::of(run))?;
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
            nodes,
            scenario,
            join_reply,
            clock,
            progress,
            gallery,
            rosout,
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

impl AgentTransport for RosLink {
    fn announce(&mut self, scenario: &Scenario) {
        self.own_run.set(Some(scenario.run));
        self.nodes.begin_again();
        self.unannounced = Some(scenario.clone());
        self.announce_in_time();
    }

    fn reply_join(&mut self, reply: &JoinReply) {
        self.nodes.note_reply(reply);
        self.join_reply.publish(&mut self.node, reply);
    }

    fn send(&mut self, agent: AgentId, part: &Observation) {
        match self.observations.get_mut(&agent) {
            Some(observations) => observations.publish(&mut self.node, part),
            None => self.nodes.ask(&mut self.node, &mut self.clock, &mut self.gallery, agent, part),
        }
    }

    fn receive(&mut self, timeout: Duration) -> Option<Incoming> {
        self.announce_in_time();
        if let Some(said) = self.nodes.next(&self.context, self.own_run.get()) {
            return Some(said);
        }
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

    fn set_sensors(&mut self, agent: AgentId, odometry: Odometry, points: Option<PointCloud2>) {
        self.nodes.drive(agent, odometry, points);
    }

    fn other_run(&self) -> Option<u64> {
        self.other_run.get()
    }
}

impl ObserverOutput for RosLink {
    fn clock(&mut self, tick: Tick) {
        if self.nodes.are_any() || self.gallery.hears_the_clock(&self.context) {
            self.clock.publish(&mut self.node, &Clock { clock: tick.into() });
        }
    }

    fn progress(&mut self, progress: &Progress) {
        self.progress.publish(&mut self.node, progress);
    }

    fn subscribers(&mut self) -> Option<&Subscribers> {
        self.gallery.listeners(&self.context)
    }

    fn publish(&mut self, view: VisualisationTopic, picture: &VisualisationMessage) {
        self.gallery.show(&mut self.node, view, picture);
    }

    fn real_time_factor(&mut self, rtf: Rtf) {
        self.services.tell_pace(&mut self.node, rtf);
    }

    fn log(&mut self, level: Level, text: &str) {
        self.rosout.say(&mut self.node, level, text);
    }
}

impl ControlInput for RosLink {
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
        let request = self.services.next();
        if request.is_some() {
            // Who has a tick made that is all it waits for hears of it.
            self.gallery.look_anew();
        }
        request
    }

    fn accepts_requests(&self) -> bool {
        true
    }
}

impl Drop for RosLink {
    fn drop(&mut self) {
        linger(!self.gallery.is_deserted() || self.services.were_asked());
    }
}

fn incoming<M>(topic_agent: AgentId, sample: Sample<M>, inbound: impl Fn(M) -> Inbound) -> Incoming {
    let message = match sample.message {
        Ok(message) => inbound(message),
        Err(reason) => Inbound::Undecodable { reason },
    };
    Incoming { topic_agent, source: SourceId(sample.source), message }
}
