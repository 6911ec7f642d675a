//! Agents that are driven by standard messages, at the edge to ROS: their topics, and who drives them.
//!
//! The first process that is found to publish velocities for such an agent drives it for the whole run; it is not asked whether it
//! wants to. What is said and heard is made in [`crate::twist`].

use std::cell::{Cell, RefCell};
use std::collections::{BTreeMap, VecDeque};
use std::rc::Rc;
use std::time::Instant;

use msgs::geometry_msgs::TwistStamped;
use msgs::ids::{AgentId, Tick};
use msgs::maes_msgs::{JoinReply, Observation as Part};
use msgs::nav_msgs::Odometry;
use msgs::ros::{Inbox, Outlet, RosError, Sample, Workshop, now, source_of};
use msgs::rosgraph_msgs::Clock;
use msgs::sensor_msgs::PointCloud2;
use msgs::topics;
use ros2_client::{Context, Node};

use super::{AUDIENCE_PERIOD, dds_name};
use crate::link::{Inbound, Incoming, SourceId};
use crate::twist::Driver;

/// The agents of a run that are driven by standard messages.
pub(super) struct Driven {
    agents: BTreeMap<AgentId, DrivenAgent>,
    /// Messages on behalf of the nodes.
    said: VecDeque<Incoming>,
    looked: Option<Instant>,
}

struct DrivenAgent {
    driver: Rc<RefCell<Driver>>,
    odom: Outlet<Odometry>,
    points: Outlet<PointCloud2>,
    /// Who drives it, once that is known.
    source: Option<SourceId>,
    is_accepted: bool,
    /// The tick that it was asked last: what comes before the first is no answer.
    asked: Rc<Cell<Option<Tick>>>,
}

impl Driven {
    /// Makes the topics of these agents. `own_run` will have the number of the run once it is known.
    ///
    /// # Errors
    /// If the middleware refuses an endpoint.
    pub(super) fn new(
        drivers: Vec<(AgentId, Driver)>,
        workshop: &mut Workshop,
        node: &mut Node,
        inbox: &mut Inbox<Option<Incoming>>,
        own_run: &Rc<Cell<Option<u64>>>,
    ) -> Result<Self, RosError> {
        let mut agents = BTreeMap::new();
        for (agent, driver) in drivers {
            let odom = workshop.outlet(node, &topics::odom(agent))?;
            let points = workshop.outlet(node, &topics::points(agent))?;
            let driver = Rc::new(RefCell::new(driver));
            let asked = Rc::new(Cell::new(None));
            let heard = (Rc::clone(&driver), Rc::clone(&asked), Rc::clone(own_run));
            workshop.inlet(node, &topics::cmd_vel(agent), inbox, move |sample: Sample<TwistStamped>| {
                let (driver, asked, own_run) = &heard;
                let run = own_run.get().filter(|_| asked.get().is_some())?;
                let command = sample.message.and_then(|twist| driver.borrow().command(run, &twist));
                let message =
                    command.map_or_else(|reason| Inbound::Undecodable { reason }, |command| Inbound::Command(command));
                Some(Incoming { topic_agent: agent, source: SourceId(sample.source), message })
            })?;
            let (source, is_accepted) = (None, false);
            agents.insert(agent, DrivenAgent { driver, odom, points, source, is_accepted, asked });
        }
        Ok(Self { agents, said: VecDeque::new(), looked: None })
    }

    /// What is said on behalf of a node: a join once it has been found, and a receipt at the end.
    pub(super) fn next(&mut self, context: &Context, run: Option<u64>) -> Option<Incoming> {
        if let Some(run) = run
            && self.agents.values().any(|agent| !agent.is_accepted)
            && self.looked.is_none_or(|looked| looked.elapsed() >= AUDIENCE_PERIOD)
        {
            self.looked = Some(now());
            self.find(context, run);
        }
        self.said.pop_front()
    }

    fn find(&mut self, context: &Context, run: u64) {
        let writers = context.domain_participant().discovered_writers();
        for (&agent, driven) in self.agents.iter_mut().filter(|(_, driven)| !driven.is_accepted) {
            let topic = dds_name(&topics::cmd_vel(agent));
            let of_agent = writers.iter().filter(|writer| *writer.publication_topic_data.topic_name() == topic);
            let sources = of_agent.map(|writer| SourceId(source_of(writer.publication_topic_data.key)));
            driven.source = driven.source.or(sources.min());
            if let Some(source) = driven.source {
                let message = Inbound::Join(driven.driver.borrow().join(run));
                self.said.push_back(Incoming { topic_agent: agent, source, message });
            }
        }
    }

    /// Takes note of the answer to a join.
    pub(super) fn note_reply(&mut self, reply: &JoinReply) {
        if let Some(driven) = self.agents.get_mut(&AgentId(reply.agent)) {
            driven.is_accepted |= reply.accepted;
        }
    }

    /// Whether there are any: they need the clock, whether it is heard already or not.
    pub(super) fn are_any(&self) -> bool {
        !self.agents.is_empty()
    }

    /// Whether an agent is driven so.
    pub(super) fn has(&self, agent: AgentId) -> bool {
        self.agents.contains_key(&agent)
    }

    /// Tells the node of an agent what is in a part of an observation, once it has the last one.
    pub(super) fn tell(&mut self, node: &mut Node, clock: &mut Outlet<Clock>, agent: AgentId, part: &Part) {
        let Some(driven) = self.agents.get_mut(&agent) else { return };
        let Some(told) = driven.driver.borrow_mut().tell(part) else { return };
        if let Some(points) = &told.points {
            driven.points.publish(node, points);
        }
        driven.odom.publish(node, &told.odom);
        if driven.asked.replace(Some(told.tick)) == Some(told.tick) {
            // Asked again: something of it may have been lost, perhaps the clock.
            clock.publish(node, &Clock { clock: told.tick.into() });
        }
        if part.phase == Part::ENDED
            && let Some(source) = driven.source
        {
            let message = Inbound::Command(driven.driver.borrow().receipt(part.run, Tick(part.tick)));
            self.said.push_back(Incoming { topic_agent: agent, source, message });
        }
    }
}
