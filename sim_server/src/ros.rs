//! The server's ROS 2 transport: one participant with one node `sim_server`, its services, and
//! three topics per agent. [`replay`] plays recordings.
//!
//! Invariants: messages to one agent never wait for another agent or for observers (see
//! [`ros_node`]); every message carries the participant that sent it. The run loop decides about
//! membership, legality and resending. This file and its folder are the only ones of this crate
//! that name [`ros_node`].

mod join;
mod links;
mod relayed_beliefs;
mod services;
mod teleoperation;
mod visualisation;

pub mod replay;

use std::cell::Cell;
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::rc::Rc;
use std::time::{Duration, Instant};

use msgs::ids::{AgentId, Tick};
use msgs::maes_msgs::{JoinReply, Observation, Progress, Scenario, SignedCommand, SignedObservation};
use msgs::nav_msgs::Odometry;
use msgs::rosgraph_msgs::Clock;
use msgs::sensor_msgs::PointCloud2;
use msgs::service::ANSWER_BYTES_MAX;
use msgs::topics;
use msgs::visualization_msgs::Marker;
use protocol::limits::OBSERVATION_BYTES_MAX;
use protocol::signed::Signed;
use ros_node::ros_env::RosEnv;
use ros_node::rosout::Rosout;
use ros_node::{Connected, Context, Inbox, Node, Publisher, RosError, Sample, linger, own_source};

use protocol::lockstep::SourceId;
use simulation::parameters;
use simulation::scenario::{self, Rtf};
use simulation::visualisation::{SensorId, Subscribers, VisualisationMessage, VisualisationTopic};
use system::wall_clock::now;
use transport::control::Request;
use transport::{AgentTransport, ControlInput, Inbound, Incoming, Level, ObserverOutput};

use join::JoinOfAnyVersion;
use links::Links;
use relayed_beliefs::RelayedBeliefs;
use services::{ServiceEvent, Services};
use teleoperation::TeleoperatedAgents;
use visualisation::VisualisationPublishers;

/// Wall time for which a new server listens before it announces its run: enough, on an idle
/// machine, to discover a server that is already running and receive its scenario, so that agents
/// of that run do not see a second one. A server that is discovered later is rejected all the same.
/// Agents take as long to start.
const LISTENING_TIME: Duration = Duration::from_millis(300);

const NODE: &str = "sim_server";

/// Minimum wall time between two polls for requests while the run loop does not wait for anything.
const REQUEST_PERIOD: Duration = Duration::from_millis(5);

/// Maximum agent messages queued while polling for requests; more stay with the middleware.
const QUEUED_MAX: usize = 256;

/// An item of the inbox.
enum Item {
    Agent(Box<Incoming>),
    Service(ServiceEvent),
    /// Already handled.
    Handled,
}

impl From<ServiceEvent> for Item {
    fn from(event: ServiceEvent) -> Self {
        Item::Service(event)
    }
}

/// The server in a ROS network.
pub struct RosTransport {
    inbox: Inbox<Item>,
    /// Agent messages that arrived while polling for requests.
    queued: VecDeque<Incoming>,
    services: Services,
    requests_polled: Instant,
    created: Instant,
    /// The scenario that is still to be announced.
    unannounced: Option<Scenario>,
    own_run: Rc<Cell<Option<u64>>>,
    other_run: Rc<Cell<Option<u64>>>,
    /// Publishers for agents of this protocol, by agent.
    observations: BTreeMap<AgentId, Publisher<SignedObservation>>,
    links: Links,
    /// Agents that are controlled with standard messages.
    teleoperated: TeleoperatedAgents,
    scenario: Publisher<Scenario>,
    join_reply: Publisher<JoinReply>,
    clock: Publisher<Clock>,
    progress: Publisher<Progress>,
    visualisation: VisualisationPublishers,
    beliefs: RelayedBeliefs,
    rosout: Rosout,
    node: Node,
    context: Context,
}

impl RosTransport {
    /// Joins the network and offers the topics, services and parameters of a run.
    ///
    /// # Errors
    /// If the network cannot be joined or a system limit is reached.
    pub fn new(run: &scenario::Scenario, env: &RosEnv) -> Result<Self, RosError> {
        let (agents, teleoperated_ids) = (run.agents.count, run.teleoperated());
        ros_node::allow_open_files(agents)?;
        let (context, mut endpoints) = ros_node::join(env, true)?;
        let mut node = ros_node::node(&context, NODE)?;
        let clock = endpoints.publisher(&mut node, &topics::clock())?;
        let scenario = endpoints.publisher(&mut node, &topics::scenario())?;
        let join_reply = endpoints.publisher(&mut node, &topics::join_reply())?;
        let progress = endpoints.publisher(&mut node, &topics::progress())?;
        let mut inbox = Inbox::default();
        let own_run = Rc::new(Cell::new(None));
        let other_run = Rc::new(Cell::new(None));
        let (own, other) = (own_source(&context), Rc::clone(&other_run));
        endpoints.subscribe(&mut node, &topics::scenario(), &mut inbox, move |sample: Sample<Scenario>| {
            match sample.message.map(|scenario| scenario.run) {
                // Its own scenario, of the present run or an earlier one, and that of a replay.
                Ok(_) if sample.source == own => {}
                Ok(Scenario::NO_RUN) => {}
                Ok(run) => other.set(Some(run)),
                // An undecodable scenario is that of another version.
                Err(_) => other.set(Some(0)),
            }
            Item::Handled
        })?;
        let links = Links::open(run.execution.unix_sockets, agents, &teleoperated_ids, own, &mut inbox);
        let teleoperated = TeleoperatedAgents::new(&teleoperated_ids, &mut endpoints, &mut node, &mut inbox, &own_run)?;
        let mut observations = BTreeMap::new();
        for agent in (0..agents).map(AgentId).filter(|agent| !teleoperated_ids.contains(agent)) {
            let joins = topics::signed_join(agent);
            let connected = links.connected().clone();
            endpoints.subscribe(&mut node, &joins, &mut inbox, move |sample: Sample<JoinOfAnyVersion>| {
                item_over_ros(agent, sample, &connected, join)
            })?;
            let commands = topics::signed_command(agent).unacknowledged();
            let connected = links.connected().clone();
            endpoints.subscribe(&mut node, &commands, &mut inbox, move |sample: Sample<SignedCommand>| {
                item_over_ros(agent, sample, &connected, command)
            })?;
            observations.insert(agent, endpoints.publisher(&mut node, &topics::signed_observation(agent))?);
        }
        let rosout = Rosout::new(&mut endpoints, &mut node)?;
        // Created last, so that agents do not wait for visualisation topics.
        let visualisation =
            VisualisationPublishers::new(&mut endpoints, &mut node, &run.equipment(), &teleoperated_ids)?;
        let services = Services::of_run(&mut node, &mut endpoints, &mut inbox, parameters::of(run))?;
        Ok(RosTransport {
            inbox,
            queued: VecDeque::new(),
            services,
            requests_polled: now(),
            created: now(),
            unannounced: None,
            own_run,
            other_run,
            observations,
            links,
            teleoperated,
            scenario,
            join_reply,
            clock,
            progress,
            visualisation,
            beliefs: RelayedBeliefs::new(endpoints),
            rosout,
            node,
            context,
        })
    }

    /// Announces the scenario once the listening time is over.
    fn announce_if_due(&mut self) {
        if self.other_run.get().is_none()
            && self.created.elapsed() >= LISTENING_TIME
            && let Some(scenario) = self.unannounced.take()
        {
            self.scenario.publish(&mut self.node, &scenario);
        }
    }
}

impl AgentTransport for RosTransport {
    fn announce(&mut self, scenario: &Scenario) {
        self.own_run.set(Some(scenario.run));
        self.teleoperated.reset();
        self.unannounced = Some(scenario.clone());
        self.announce_if_due();
    }

    fn reply_join(&mut self, reply: &JoinReply) {
        self.teleoperated.receive_reply(reply);
        if self.links.reply(reply, &mut self.inbox, &self.context) {
            self.join_reply.publish(&mut self.node, reply);
        }
    }

    fn send(&mut self, agent: AgentId, part: Signed<Observation>) {
        match self.observations.get_mut(&agent) {
            Some(observations) => {
                let part = SignedObservation::from(part);
                if self.links.observe(agent, &part, &mut self.inbox, &self.context) {
                    observations.publish(&mut self.node, &part);
                }
            }
            None => {
                let (node, clock, part) = (&mut self.node, &mut self.clock, part.claimed());
                self.teleoperated.send(node, clock, &mut self.visualisation, agent, part);
            }
        }
    }

    fn is_open(&self) -> bool {
        true
    }

    fn receive(&mut self, timeout: Duration) -> Option<Incoming> {
        self.announce_if_due();
        if let Some(incoming) = self.teleoperated.next(&self.context, self.own_run.get()) {
            return Some(incoming);
        }
        if let Some(queued) = self.queued.pop_front() {
            return Some(queued);
        }
        match self.inbox.receive(timeout)? {
            Item::Agent(incoming) => Some(*incoming),
            Item::Service(event) => {
                self.services.receive(&mut self.node, event);
                None
            }
            Item::Handled => None,
        }
    }

    fn set_sensors(&mut self, agent: AgentId, odometry: Odometry, points: Vec<(SensorId, PointCloud2)>) {
        self.teleoperated.drive(agent, odometry, points);
    }

    fn other_run(&self) -> Option<u64> {
        self.other_run.get()
    }
}

impl ObserverOutput for RosTransport {
    fn clock(&mut self, tick: Tick) {
        if !self.teleoperated.is_empty() || self.visualisation.clock_has_subscribers(&self.context) {
            self.clock.publish(&mut self.node, &Clock { clock: tick.into() });
        }
    }

    fn progress(&mut self, progress: &Progress) {
        self.progress.publish(&mut self.node, progress);
    }

    fn subscribers(&mut self) -> Option<&Subscribers> {
        self.visualisation.listeners(&self.context)
    }

    fn publish(&mut self, view: VisualisationTopic, picture: &VisualisationMessage) {
        self.visualisation.show(&mut self.node, view, picture);
    }

    fn real_time_factor(&mut self, rtf: Rtf) {
        self.services.set_rtf(&mut self.node, rtf);
    }

    fn log(&mut self, level: Level, text: &str) {
        self.rosout.log(&mut self.node, NODE, level, text);
    }

    fn relays_beliefs(&self) -> bool {
        true
    }

    fn relay_beliefs(&mut self, agents: &BTreeSet<AgentId>) {
        self.beliefs.select(agents, &mut self.node, &mut self.inbox);
    }

    fn relayed_belief(&mut self) -> Option<(AgentId, Marker)> {
        self.beliefs.next()
    }
}

impl ControlInput for RosTransport {
    fn request(&mut self) -> Option<Request> {
        if self.requests_polled.elapsed() >= REQUEST_PERIOD {
            while self.queued.len() < QUEUED_MAX
                && self.services.has_room()
                && let Some(item) = self.inbox.receive(Duration::ZERO)
            {
                match item {
                    Item::Agent(incoming) => self.queued.push_back(*incoming),
                    Item::Service(event) => self.services.receive(&mut self.node, event),
                    Item::Handled => {}
                }
            }
            self.requests_polled = now();
        }
        let request = self.services.next();
        if request.is_some() {
            // A caller that requested a tick must see its messages at once.
            self.visualisation.poll_immediately();
        }
        request
    }

    fn accepts_requests(&self) -> bool {
        true
    }

    fn answer_bytes_max(&self) -> usize {
        if self.context.sends_long_answers() { OBSERVATION_BYTES_MAX } else { ANSWER_BYTES_MAX }
    }
}

impl Drop for RosTransport {
    fn drop(&mut self) {
        linger(self.visualisation.has_listeners() || self.services.was_called());
    }
}

/// What came over ROS, unless its sender is connected by a socket: then it comes over that as well.
fn item_over_ros<M>(agent: AgentId, sample: Sample<M>, connected: &Connected, inbound: impl Fn(M) -> Inbound) -> Item {
    if connected.contains(&sample.source) {
        return Item::Handled;
    }
    Item::Agent(Box::new(incoming(agent, sample, inbound)))
}

fn join(JoinOfAnyVersion(join): JoinOfAnyVersion) -> Inbound {
    Inbound::Join(join.into())
}

fn command(signed: SignedCommand) -> Inbound {
    Inbound::Command(signed.into())
}

fn incoming<M>(topic_agent: AgentId, sample: Sample<M>, inbound: impl Fn(M) -> Inbound) -> Incoming {
    let message = match sample.message {
        Ok(message) => inbound(message),
        Err(reason) => Inbound::Undecodable { reason },
    };
    Incoming { topic_agent, source: SourceId(sample.source), message }
}
