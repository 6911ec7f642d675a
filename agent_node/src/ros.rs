//! The agents' link over ROS 2: one participant for the process, and one node `agent_<id>` for each of its agents.
//!
//! Invariants: what is sent for one agent never waits for another one (see `ros/endpoints.rs`); what is on a topic of another agent,
//! or addressed to one, does not come out. When to say something is decided in `run.rs`. This file and its folder are the only
//! ones here that know the ROS client. Agents do not listen to `/clock`: an observation says what time it is.

mod endpoints;

use std::time::Duration;

use msgs::ids::AgentId;
use msgs::maes_msgs::{Command, Join, JoinReply, Observation, Scenario};
use msgs::ros_env::RosEnv;
use msgs::topics;
use ros2_client::Node;

pub use endpoints::RosError;

use crate::link::{Inbound, Link};
use endpoints::{Inbox, Outlet, Sample, Tally, Workshop, linger, now};

/// The agents of a process in a ROS network.
pub struct RosLink {
    inbox: Inbox<Result<Inbound, String>>,
    seats: Vec<Seat>,
    ignored: Tally,
}

/// An agent of this process.
struct Seat {
    agent: AgentId,
    join: Outlet<Join>,
    command: Outlet<Command>,
    node: Node,
}

impl RosLink {
    /// Joins the network as these agents.
    ///
    /// # Errors
    /// If the network cannot be joined, or the system has not enough of something.
    pub fn new(agents: &[AgentId], env: &RosEnv) -> Result<Self, RosError> {
        let context = endpoints::join(env, false)?;
        let mut workshop = Workshop::default();
        let mut inbox = Inbox::new();
        let mut seats = Vec::new();
        for &agent in agents {
            let mut node = endpoints::node(&context, &format!("agent_{agent}"))?;
            if seats.is_empty() {
                workshop.inlet(&mut node, &topics::scenario(), &mut inbox, |sample: Sample<Scenario>| {
                    message(sample).map(Inbound::Scenario)
                })?;
                workshop.inlet(&mut node, &topics::join_reply(), &mut inbox, |sample: Sample<JoinReply>| {
                    message(sample).map(Inbound::JoinReply)
                })?;
            }
            workshop.inlet(&mut node, &topics::observation(agent), &mut inbox, move |sample| {
                observation(agent, sample).map(Inbound::Observation)
            })?;
            let join = workshop.outlet(&mut node, &topics::join(agent))?;
            let command = workshop.outlet(&mut node, &topics::command(agent))?;
            seats.push(Seat { agent, join, command, node });
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

    fn receive(&mut self, timeout: Duration) -> Option<Inbound> {
        let begun = now();
        loop {
            let left = timeout.saturating_sub(begun.elapsed());
            match self.inbox.receive(left)? {
                Ok(Inbound::JoinReply(reply)) if self.seat(reply.agent).is_none() => {}
                Ok(message) => return Some(message),
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

#[cfg(test)]
mod tests {
    #[test]
    fn both_binaries_have_the_same_endpoints() {
        assert_eq!(include_str!("ros/endpoints.rs"), include_str!("../../sim_server/src/ros/endpoints.rs"));
    }
}
