//! The agents' link over ROS 2: one participant for the process, and one node `agent_<id>` for each of its agents.
//!
//! Invariants: what is sent for one agent never waits for another one (see [`ros_node`]); what is on a topic of another agent,
//! or addressed to one, does not come out; nor does an observation or a reply that another process sends than the one that sent the
//! first scenario, for everybody in the network can publish them. When to say something is decided in `run.rs`. This file is the only one here
//! that knows the ROS client. Agents do not listen to `/clock`: an observation says what time it is.

use std::cell::Cell;
use std::collections::BTreeMap;
use std::rc::Rc;
use std::time::Duration;

use msgs::ids::AgentId;
use msgs::maes_msgs::{Command, Join, JoinReply, Observation, Scenario};
use msgs::parameters::{Named, Parameter};
use msgs::topics;
use msgs::visualization_msgs::Marker;
use ros_node::audience::Audience;
use ros_node::ros_env::RosEnv;
use ros_node::rosout::Rosout;
use ros_node::{Inbox, Outlet, RosError, Sample, SharedParameters, Tally, Workshop, linger, now};
use ros2_client::{Context, Node};

use crate::link::{Inbound, Level, Link};
use crate::parameters;

/// The agents of a process in a ROS network.
pub struct RosLink {
    /// Messages, and `None` for what has been dealt with.
    inbox: Inbox<Result<Option<Inbound>, String>>,
    seats: Vec<Seat>,
    ignored: Tally,
    /// Who looks at what the agents believe, by seat.
    audience: Audience,
    onlookers: BTreeMap<AgentId, u64>,
    context: Context,
}

/// An agent of this process.
struct Seat {
    agent: AgentId,
    join: Outlet<Join>,
    command: Outlet<Command>,
    belief: Outlet<Marker>,
    rosout: Rosout,
    parameters: SharedParameters,
    node: Node,
}

impl RosLink {
    /// Joins the network as these agents, with services by which people read their parameters, or without.
    ///
    /// # Errors
    /// If the network cannot be joined, or the system has not enough of something.
    pub fn new(agents: &[AgentId], has_parameters: bool, env: &RosEnv) -> Result<Self, RosError> {
        // Six services need three times what the protocol needs.
        let share = if has_parameters { 4 } else { 1 };
        ros_node::allow_open_files(u32::try_from(agents.len() * share).unwrap_or(u32::MAX))?;
        let context = ros_node::join(env, false)?;
        let mut workshop = Workshop::of(&context);
        let mut inbox = Inbox::default();
        let mut seats = Vec::new();
        let server = Server::default();
        for &agent in agents {
            let name = format!("agent_{agent}");
            let mut node = ros_node::node(&context, &name)?;
            if seats.is_empty() {
                let found = server.clone();
                workshop.inlet(&mut node, &topics::scenario(), &mut inbox, move |sample: Sample<Scenario>| {
                    let source = sample.source;
                    // Who plays a recording is no server.
                    let mut scenario = message(sample)?;
                    if scenario.run != Scenario::NO_RUN {
                        found.is(source);
                    }
                    // Only the server itself begins its run again.
                    if !found.may_be(source) {
                        scenario.origin = scenario.run;
                    }
                    Ok(Some(Inbound::Scenario(scenario)))
                })?;
                let server = server.clone();
                workshop.inlet(&mut node, &topics::join_reply(), &mut inbox, move |sample: Sample<JoinReply>| {
                    server.message(sample).map(Inbound::JoinReply).map(Some)
                })?;
            }
            let server = server.clone();
            workshop.inlet(&mut node, &topics::observation(agent), &mut inbox, move |sample| {
                observation(agent, server.message(sample)?).map(Inbound::Observation).map(Some)
            })?;
            let join = workshop.outlet(&mut node, &topics::join(agent))?;
            let command = workshop.outlet(&mut node, &topics::command(agent))?;
            let belief = workshop.outlet(&mut node, &topics::belief(agent))?;
            let rosout = Rosout::new(&mut workshop, &mut node, &name)?;
            let parameters = SharedParameters::default();
            parameters.borrow_mut().declare(parameters::of_agent(agent));
            if has_parameters {
                let name = format!("/agent_{agent}");
                let nothing_to_check = |_: &Named| Ok(());
                workshop.parameters(&mut node, &name, &mut inbox, &parameters, nothing_to_check, |set| match set {
                    Ok(_) => Ok(None),
                    Err(reason) => Err(reason),
                })?;
            }
            seats.push(Seat { agent, join, command, belief, rosout, parameters, node });
        }
        let beliefs: Vec<_> = agents.iter().map(|&agent| topics::belief(agent)).collect();
        let audience = Audience::new(&beliefs);
        let ignored = Tally::new("message ignored".to_owned());
        Ok(RosLink { inbox, seats, ignored, audience, onlookers: BTreeMap::new(), context })
    }

    fn seat(&mut self, agent: AgentId) -> Option<&mut Seat> {
        self.seats.iter_mut().find(|seat| seat.agent == agent)
    }
}

impl Link for RosLink {
    fn join(&mut self, join: &Join) {
        if let Some(seat) = self.seat(AgentId(join.agent)) {
            seat.join.publish(&mut seat.node, join);
        }
    }

    fn answer(&mut self, command: &Command) {
        if let Some(seat) = self.seat(AgentId(command.agent)) {
            seat.command.publish(&mut seat.node, command);
        }
    }

    fn onlookers(&mut self) -> Option<&BTreeMap<AgentId, u64>> {
        if self.audience.look(&self.context) {
            let numbered = self.seats.iter().enumerate();
            self.onlookers =
                numbered.filter_map(|(number, seat)| Some((seat.agent, self.audience.arrivals(number)?))).collect();
        }
        (!self.onlookers.is_empty()).then_some(&self.onlookers)
    }

    fn show(&mut self, agent: AgentId, part: &Marker) {
        if let Some(seat) = self.seat(agent) {
            seat.belief.publish(&mut seat.node, part);
        }
    }

    fn log(&mut self, agent: AgentId, level: Level, text: &str) {
        if let Some(seat) = self.seat(agent) {
            seat.rosout.say(&mut seat.node, level, text);
        }
    }

    fn describe(&mut self, agent: AgentId, parameters: Vec<Parameter>) {
        if let Some(seat) = self.seat(agent) {
            seat.parameters.borrow_mut().declare(parameters);
        }
    }

    fn receive(&mut self, timeout: Duration) -> Option<Inbound> {
        let begun = now();
        loop {
            let left = timeout.saturating_sub(begun.elapsed());
            match self.inbox.receive(left)? {
                Ok(None) => {}
                Ok(Some(Inbound::JoinReply(reply))) if self.seat(AgentId(reply.agent)).is_none() => {}
                Ok(Some(message)) => return Some(message),
                Err(reason) => self.ignored.add(&reason),
            }
            if left.is_zero() {
                return None;
            }
        }
    }
}

impl Drop for RosLink {
    fn drop(&mut self) {
        linger(false);
    }
}

/// The message of a sample, or whose bytes could not be read and why.
fn message<M>(sample: Sample<M>) -> Result<M, String> {
    sample.message.map_err(|reason| format!("{reason}, sent by participant {:02x?}", sample.source))
}

/// The process whose scenario came in first: the one that is listened to.
#[derive(Clone, Default)]
struct Server(Rc<Cell<Option<[u8; 16]>>>);

impl Server {
    /// It is this one, unless it is known already.
    fn is(&self, source: [u8; 16]) {
        self.0.set(self.0.get().or(Some(source)));
    }

    /// Whether it is this one, as far as is known.
    fn may_be(&self, source: [u8; 16]) -> bool {
        self.0.get().is_none_or(|server| server == source)
    }

    /// The message of a sample that it has sent.
    fn message<M>(&self, sample: Sample<M>) -> Result<M, String> {
        let source = sample.source;
        if !self.may_be(source) {
            return Err(format!("participant {source:02x?} is not the server, whose words these would be"));
        }
        message(sample)
    }
}

fn observation(agent: AgentId, observation: Observation) -> Result<Observation, String> {
    if observation.agent == agent.0 {
        Ok(observation)
    } else {
        Err(format!("an observation for agent {} on the topic of agent {agent}", observation.agent))
    }
}
