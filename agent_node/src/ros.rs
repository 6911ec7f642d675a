//! The ROS 2 transport of agents: one participant for the process, and one node `agent_<id>` for
//! each of its agents.
//!
//! Invariants: sending for one agent never blocks another one (see [`ros_node`]); messages on or
//! for another agent's topic are dropped, and so are observations and replies of any participant
//! but the one that sent the first scenario, since every participant can publish them. The protocol
//! itself is in `host.rs`. This is the only file here that knows the ROS client. Agents do not
//! subscribe to `/clock`: an observation includes its tick.

use std::cell::Cell;
use std::collections::BTreeMap;
use std::rc::Rc;
use std::time::Duration;

use msgs::ids::AgentId;
use msgs::maes_msgs::{Command, JoinReply, Scenario, SignedCommand, SignedJoin, SignedObservation};
use msgs::nav_msgs::OccupancyGrid;
use msgs::octomap_msgs::Octomap;
use msgs::parameters::DeclaredParameter;
use msgs::rcl_interfaces::Parameter;
use msgs::sensor_msgs::PointCloud2;
use msgs::topics;
use msgs::visualization_msgs::Marker;
use protocol::signed::{JoinRequest, Signed};
use ros_node::ros_env::RosEnv;
use ros_node::rosout::Rosout;
use ros_node::{
    Connected, Context, Inbox, MessageKind, Node, Publisher, RosError, Sample, SharedParameters, SocketSample, Sockets,
    SubscriptionTracker, ThrottledWarning, linger, own_source,
};
use serde::Serialize;
use system::wall_clock::now;

use crate::parameters;
use crate::transport::{Inbound, Level, MapView, MapViewMessage, ServerTransport};

/// Numbers of blocks in [`RosTransport::subscriptions`], after the maps.
const COMMANDS: usize = 1;
const JOINS: usize = 2;
const VIEWS: [(MapView, usize); 3] = [(MapView::Occupancy, 3), (MapView::Octomap, 4), (MapView::Points, 5)];

/// The agents of a process as nodes of a ROS 2 network.
pub struct RosTransport {
    /// Messages, and `None` for those handled already.
    inbox: Inbox<Result<Option<Inbound>, String>>,
    server: Server,
    /// Whether it was tried to connect to the server by a socket.
    has_tried_socket: bool,
    agents: Vec<AgentEndpoints>,
    /// On the node of the first agent.
    rosout: Option<Rosout>,
    ignored: ThrottledWarning,
    /// The subscriptions to the maps, commands and joins, in blocks in the order of `agents`.
    subscriptions: SubscriptionTracker,
    observers: BTreeMap<AgentId, u64>,
    observed_views: BTreeMap<(AgentId, MapView), u64>,
    context: Context,
}

/// The node of an agent with its publishers.
struct AgentEndpoints {
    agent: AgentId,
    join: Publisher<SignedJoin>,
    command: Publisher<SignedCommand>,
    belief: Publisher<Marker>,
    /// `None` in processes of many agents, whose nodes have few endpoints.
    views: Option<ViewPublishers>,
    parameters: SharedParameters,
    node: Node,
}

/// The publishers of an agent's map in standard messages.
struct ViewPublishers {
    occupancy: Publisher<OccupancyGrid>,
    octomap: Publisher<Octomap>,
    points: Publisher<PointCloud2>,
}

impl RosTransport {
    /// Creates the nodes of these agents, with parameter services and maps in standard messages, or
    /// without either.
    ///
    /// # Errors
    /// If the network cannot be joined, or a resource of the system is exhausted.
    pub fn new(ids: &[AgentId], has_parameters: bool, env: &RosEnv) -> Result<Self, RosError> {
        // Six services need three times what the protocol needs.
        let share = if has_parameters { 4 } else { 1 };
        ros_node::allow_open_files(u32::try_from(ids.len() * share).unwrap_or(u32::MAX))?;
        let (context, mut workshop) = ros_node::join(env, false)?;
        let mut inbox = Inbox::default();
        let mut agents = Vec::new();
        let mut rosout = None;
        let server = Server::default();
        for &agent in ids {
            let name = node_name(agent);
            let mut node = ros_node::node(&context, &name)?;
            if agents.is_empty() {
                let found = server.clone();
                workshop.subscribe(&mut node, &topics::scenario(), &mut inbox, move |sample: Sample<Scenario>| {
                    let source = sample.source;
                    // A replayed recording has no server.
                    let mut scenario = message(sample)?;
                    if scenario.run != Scenario::NO_RUN {
                        found.is(source);
                    }
                    // Only the server itself resets its run.
                    if !found.may_be(source) {
                        scenario.origin = scenario.run;
                    }
                    Ok(Some(Inbound::Scenario(scenario)))
                })?;
                let server = server.clone();
                workshop.subscribe(
                    &mut node,
                    &topics::join_reply(),
                    &mut inbox,
                    move |sample: Sample<JoinReply>| Ok(server.message(sample)?.map(Inbound::JoinReply)),
                )?;
            }
            let server = server.clone();
            let observations = topics::signed_observation(agent).unacknowledged();
            workshop.subscribe(&mut node, &observations, &mut inbox, move |sample| {
                server.message(sample)?.map(|signed| observation(agent, signed)).transpose()
            })?;
            let join = workshop.publisher(&mut node, &topics::signed_join(agent))?;
            let command = workshop.publisher(&mut node, &topics::signed_command(agent))?;
            let belief = workshop.publisher(&mut node, &topics::belief(agent))?;
            let views = match has_parameters {
                true => Some(ViewPublishers {
                    occupancy: workshop.publisher(&mut node, &topics::belief_occupancy(agent))?,
                    octomap: workshop.publisher(&mut node, &topics::belief_octomap(agent))?,
                    points: workshop.publisher(&mut node, &topics::belief_points(agent))?,
                }),
                false => None,
            };
            if rosout.is_none() {
                rosout = Some(Rosout::new(&mut workshop, &mut node)?);
            }
            let parameters = SharedParameters::default();
            parameters.borrow_mut().declare(parameters::of_agent(agent));
            if has_parameters {
                let name = format!("/agent_{agent}");
                let nothing_to_check = |_: &Parameter| Ok(());
                workshop.parameters(&mut node, &name, &mut inbox, &parameters, nothing_to_check, |set| match set {
                    Ok(_) => Ok(None),
                    Err(reason) => Err(reason),
                })?;
            }
            agents.push(AgentEndpoints { agent, join, command, belief, views, parameters, node });
        }
        let blocks = [
            topics::belief,
            topics::command,
            topics::join,
            topics::belief_occupancy,
            topics::belief_octomap,
            topics::belief_points,
        ];
        let tracked: Vec<_> = blocks.iter().flat_map(|topic| ids.iter().map(|&agent| topic(agent))).collect();
        let subscriptions = SubscriptionTracker::new(&tracked);
        let ignored = ThrottledWarning::new("message ignored".to_owned());
        Ok(RosTransport {
            inbox,
            server,
            has_tried_socket: false,
            agents,
            rosout,
            ignored,
            subscriptions,
            observers: BTreeMap::new(),
            observed_views: BTreeMap::new(),
            context,
        })
    }

    /// Connects to the server by a socket once it is known. A server that has none for this
    /// process, on another machine for example, has its topics.
    fn connect(&mut self) {
        let Some(server) = self.server.source.get().filter(|_| !self.has_tried_socket) else { return };
        self.has_tried_socket = true;
        let agents = self.agents.iter().map(|endpoints| endpoints.agent);
        if let Ok(sockets) = Sockets::connect(server, own_source(&self.context), agents, &self.server.connected)
            && let Err(error) = self.inbox.set_sockets(sockets, over_socket)
        {
            self.ignored.add(&error);
        }
    }

    fn poll_subscriptions(&mut self) {
        if self.subscriptions.poll(&self.context) {
            let numbered = self.agents.iter().enumerate();
            self.observers = numbered
                .filter_map(|(number, endpoints)| Some((endpoints.agent, self.subscriptions.arrivals(number)?)))
                .collect();
            let published = self.agents.iter().enumerate().filter(|(_, endpoints)| endpoints.views.is_some());
            let of_agent = |(number, endpoints): (usize, &AgentEndpoints)| {
                let (agent, agents) = (endpoints.agent, self.agents.len());
                VIEWS.map(|(view, block)| ((agent, view), self.subscriptions.arrivals(block * agents + number)))
            };
            let arrivals = published.flat_map(of_agent);
            self.observed_views = arrivals.filter_map(|(view, arrivals)| Some((view, arrivals?))).collect();
        }
    }

    fn endpoints(&mut self, agent: AgentId) -> Option<&mut AgentEndpoints> {
        let number = self.number(agent)?;
        self.agents.get_mut(number)
    }

    fn number(&self, agent: AgentId) -> Option<usize> {
        self.agents.iter().position(|endpoints| endpoints.agent == agent)
    }

    /// Sends a message of an agent over the socket, if there is one; returns whether it is to be
    /// published as well.
    fn send<M: Serialize>(&mut self, kind: MessageKind, number: usize, message: &M) -> bool {
        let agent = self.agents[number].agent;
        if !self.inbox.sockets().is_some_and(|sockets| sockets.send(kind, agent, message)) {
            return true;
        }
        self.poll_subscriptions();
        let block = if kind == MessageKind::Join { JOINS } else { COMMANDS };
        self.subscriptions.has_other_subscribers(block * self.agents.len() + number, &self.server.connected)
    }
}

impl ServerTransport for RosTransport {
    fn send_join(&mut self, join: &Signed<JoinRequest>) {
        let Some(number) = self.number(AgentId(join.claimed().join.agent)) else { return };
        let signed = SignedJoin::from(join.clone());
        if self.send(MessageKind::Join, number, &signed) {
            let endpoints = &mut self.agents[number];
            endpoints.join.publish(&mut endpoints.node, &signed);
        }
    }

    fn send_command(&mut self, command: &Signed<Command>) {
        let Some(number) = self.number(AgentId(command.claimed().agent)) else { return };
        let signed = SignedCommand::from(command.clone());
        if self.send(MessageKind::Command, number, &signed) {
            let endpoints = &mut self.agents[number];
            endpoints.command.publish(&mut endpoints.node, &signed);
        }
    }

    fn source(&self) -> [u8; 16] {
        own_source(&self.context)
    }

    fn observers(&mut self) -> Option<&BTreeMap<AgentId, u64>> {
        self.poll_subscriptions();
        (!self.observers.is_empty()).then_some(&self.observers)
    }

    fn publish_map(&mut self, agent: AgentId, part: &Marker) {
        if let Some(endpoints) = self.endpoints(agent) {
            endpoints.belief.publish(&mut endpoints.node, part);
        }
    }

    fn observed_views(&mut self) -> Option<&BTreeMap<(AgentId, MapView), u64>> {
        self.poll_subscriptions();
        (!self.observed_views.is_empty()).then_some(&self.observed_views)
    }

    fn publish_view(&mut self, agent: AgentId, message: &MapViewMessage) {
        let Some(AgentEndpoints { node, views: Some(views), .. }) = self.endpoints(agent) else { return };
        match message {
            MapViewMessage::Occupancy(grid) => views.occupancy.publish(node, grid),
            MapViewMessage::Octomap(tree) => views.octomap.publish(node, tree),
            MapViewMessage::Points(cloud) => views.points.publish(node, cloud),
        }
    }

    fn log(&mut self, agent: AgentId, level: Level, text: &str) {
        if let (Some(rosout), Some(first)) = (&mut self.rosout, self.agents.first_mut()) {
            rosout.log(&mut first.node, &node_name(agent), level, text);
        }
    }

    fn declare_parameters(&mut self, agent: AgentId, parameters: Vec<DeclaredParameter>) {
        if let Some(endpoints) = self.endpoints(agent) {
            endpoints.parameters.borrow_mut().declare(parameters);
        }
    }

    fn receive(&mut self, timeout: Duration) -> Option<Inbound> {
        let begun = now();
        loop {
            let left = timeout.saturating_sub(begun.elapsed());
            match self.inbox.receive(left)? {
                Ok(None) => {}
                Ok(Some(Inbound::JoinReply(reply))) if self.endpoints(AgentId(reply.agent)).is_none() => {}
                Ok(Some(message)) => {
                    self.connect();
                    return Some(message);
                }
                Err(reason) => self.ignored.add(&reason),
            }
            if left.is_zero() {
                return None;
            }
        }
    }
}

impl Drop for RosTransport {
    fn drop(&mut self) {
        linger(false);
    }
}

/// The message of a sample, or the sender of undecodable bytes and the reason.
fn message<M>(sample: Sample<M>) -> Result<M, String> {
    sample.message.map_err(|reason| format!("{reason}, sent by participant {:02x?}", sample.source))
}

/// The participant that sent the first scenario, which is taken to be the server.
#[derive(Clone, Default)]
struct Server {
    source: Rc<Cell<Option<[u8; 16]>>>,
    /// The server, while it is connected by a socket.
    connected: Connected,
}

impl Server {
    /// Sets the server, unless it is known.
    fn is(&self, source: [u8; 16]) {
        self.source.set(self.source.get().or(Some(source)));
    }

    /// Whether a participant is the server, as far as is known.
    fn may_be(&self, source: [u8; 16]) -> bool {
        self.source.get().is_none_or(|server| server == source)
    }

    /// The message of a sample, if the server sent it; `None` if it comes over the socket as well.
    fn message<M>(&self, sample: Sample<M>) -> Result<Option<M>, String> {
        let source = sample.source;
        if self.connected.contains(&source) {
            return Ok(None);
        }
        if !self.may_be(source) {
            return Err(format!("participant {source:02x?} is not the server of this run"));
        }
        message(sample).map(Some)
    }
}

fn node_name(agent: AgentId) -> String {
    format!("agent_{agent}")
}

/// A message that has come over the socket of the server.
fn over_socket(sample: SocketSample<'_>) -> Result<Option<Inbound>, String> {
    match sample.kind {
        MessageKind::JoinReply => message(sample.decode()).map(Inbound::JoinReply).map(Some),
        MessageKind::Observation => observation(sample.agent, message(sample.decode())?).map(Some),
        MessageKind::Join | MessageKind::Command => Ok(None),
    }
}

fn observation(agent: AgentId, signed: SignedObservation) -> Result<Inbound, String> {
    let named = signed.observation.agent;
    if named == agent.0 {
        Ok(Inbound::Observation(signed.into()))
    } else {
        Err(format!("an observation for agent {named} on the topic of agent {agent}"))
    }
}
