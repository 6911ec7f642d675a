//! The agents' link over ROS 2: one participant for the process, and one node `agent_<id>` for each of its agents.
//!
//! Invariants: what is sent for one agent never waits for another one (see [`msgs::ros`]); what is on a topic of another agent,
//! or addressed to one, does not come out. When to say something is decided in `run.rs`. This file is the only one here
//! that knows the ROS client. Agents do not listen to `/clock`: an observation says what time it is.

use std::time::Duration;

use msgs::ids::AgentId;
use msgs::maes_msgs::{Command, Join, JoinReply, Observation, Scenario};
use msgs::parameters::{Named, Parameter};
use msgs::ros::{self, Inbox, Outlet, RosError, Sample, SharedParameters, Tally, Workshop, linger, now};
use msgs::ros_env::RosEnv;
use msgs::topics;
use ros2_client::Node;

use crate::link::{Inbound, Link};
use crate::parameters;

/// The agents of a process in a ROS network.
pub struct RosLink {
    /// Messages, and `None` for what has been dealt with.
    inbox: Inbox<Result<Option<Inbound>, String>>,
    seats: Vec<Seat>,
    ignored: Tally,
}

/// An agent of this process.
struct Seat {
    agent: AgentId,
    join: Outlet<Join>,
    command: Outlet<Command>,
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
        ros::allow_open_files(u32::try_from(agents.len() * share).unwrap_or(u32::MAX))?;
        let context = ros::join(env, false)?;
        let mut workshop = Workshop::of(&context);
        let mut inbox = Inbox::default();
        let mut seats = Vec::new();
        for &agent in agents {
            let mut node = ros::node(&context, &format!("agent_{agent}"))?;
            if seats.is_empty() {
                workshop.inlet(&mut node, &topics::scenario(), &mut inbox, |sample: Sample<Scenario>| {
                    message(sample).map(Inbound::Scenario).map(Some)
                })?;
                workshop.inlet(&mut node, &topics::join_reply(), &mut inbox, |sample: Sample<JoinReply>| {
                    message(sample).map(Inbound::JoinReply).map(Some)
                })?;
            }
            workshop.inlet(&mut node, &topics::observation(agent), &mut inbox, move |sample| {
                observation(agent, sample).map(Inbound::Observation).map(Some)
            })?;
            let join = workshop.outlet(&mut node, &topics::join(agent))?;
            let command = workshop.outlet(&mut node, &topics::command(agent))?;
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
            seats.push(Seat { agent, join, command, parameters, node });
        }
        Ok(RosLink { inbox, seats, ignored: Tally::new("message ignored".to_owned()) })
    }

    fn seat(&mut self, agent: u32) -> Option<&mut Seat> {
        self.seats.iter_mut().find(|seat| seat.agent == AgentId(agent))
    }
}

impl Link for RosLink {
    fn join(&mut self, join: &Join) {
        if let Some(seat) = self.seat(join.agent) {
            seat.join.publish(&mut seat.node, join);
        }
    }

    fn answer(&mut self, command: &Command) {
        if let Some(seat) = self.seat(command.agent) {
            seat.command.publish(&mut seat.node, command);
        }
    }

    fn describe(&mut self, agent: AgentId, parameters: Vec<Parameter>) {
        if let Some(seat) = self.seat(agent.0) {
            seat.parameters.borrow_mut().declare(parameters);
        }
    }

    fn receive(&mut self, timeout: Duration) -> Option<Inbound> {
        let begun = now();
        loop {
            let left = timeout.saturating_sub(begun.elapsed());
            match self.inbox.receive(left)? {
                Ok(None) => {}
                Ok(Some(Inbound::JoinReply(reply))) if self.seat(reply.agent).is_none() => {}
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
        linger();
    }
}

/// The message of a sample, or whose bytes could not be read and why.
fn message<M>(sample: Sample<M>) -> Result<M, String> {
    sample.message.map_err(|reason| format!("{reason}, sent by participant {:02x?}", sample.source))
}

fn observation(agent: AgentId, sample: Sample<Observation>) -> Result<Observation, String> {
    let observation = message(sample)?;
    if observation.agent == agent.0 {
        Ok(observation)
    } else {
        Err(format!("an observation for agent {} on the topic of agent {agent}", observation.agent))
    }
}
