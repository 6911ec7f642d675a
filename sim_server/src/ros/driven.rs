//! Agents that are driven by standard messages, at the edge to ROS: who drives them, and what they are told.
//!
//! The first process that is found to publish velocities for such an agent drives it for the whole run; it is not asked whether it
//! wants to. Of its twists, commands are made in [`simulation::twist`].

use std::cell::Cell;
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::rc::Rc;
use std::time::{Duration, Instant};

use msgs::geometry_msgs::TwistStamped;
use msgs::ids::{AgentId, Tick};
use msgs::maes_msgs::{JoinReply, Observation as Part};
use msgs::nav_msgs::Odometry;
use msgs::rosgraph_msgs::Clock;
use msgs::sensor_msgs::PointCloud2;
use msgs::topics;
use ros_node::audience::dds_name;
use ros_node::{Inbox, Outlet, RosError, Sample, Workshop, now, source_of};
use ros2_client::{Context, Node};

use super::Item;
use super::views::Gallery;
use crate::transport::{Inbound, Incoming};
use simulation::lockstep::SourceId;
use simulation::twist;
use simulation::visualisation::{VisualisationMessage, VisualisationTopic};

/// Wall time between two looks for a process that drives an agent.
const LOOK_PERIOD: Duration = Duration::from_millis(50);

/// The agents of a run that are driven by standard messages.
pub(super) struct Driven {
    agents: BTreeMap<AgentId, DrivenAgent>,
    /// Messages on behalf of the nodes.
    said: VecDeque<Incoming>,
    looked: Option<Instant>,
}

#[derive(Default)]
struct DrivenAgent {
    /// What it is told in this tick.
    pictures: Vec<(VisualisationTopic, VisualisationMessage)>,
    /// Who drives it, once that is known.
    source: Option<SourceId>,
    is_accepted: bool,
    /// The tick that it was asked last: what comes before the first is no answer.
    asked: Rc<Cell<Option<Tick>>>,
}

impl Driven {
    /// Listens to the velocities for these agents. `own_run` will have the number of the run once it is known.
    ///
    /// # Errors
    /// If the middleware refuses an endpoint.
    pub(super) fn new(
        agents: &BTreeSet<AgentId>,
        workshop: &mut Workshop,
        node: &mut Node,
        inbox: &mut Inbox<Item>,
        own_run: &Rc<Cell<Option<u64>>>,
    ) -> Result<Self, RosError> {
        let mut driven = BTreeMap::new();
        for &agent in agents {
            let entry = DrivenAgent::default();
            let (asked, own_run) = (Rc::clone(&entry.asked), Rc::clone(own_run));
            workshop.inlet(node, &topics::cmd_vel(agent), inbox, move |sample: Sample<TwistStamped>| {
                let Some(run) = own_run.get().filter(|_| asked.get().is_some()) else { return Item::Nothing };
                let command = sample.message.and_then(|twist| twist::command(run, agent, &twist));
                let message = command.map_or_else(|reason| Inbound::Undecodable { reason }, Inbound::Command);
                Item::Agent(Incoming { topic_agent: agent, source: SourceId(sample.source), message })
            })?;
            driven.insert(agent, entry);
        }
        Ok(Self { agents: driven, said: VecDeque::new(), looked: None })
    }

    /// Nobody has been asked anything yet: a run begins.
    pub(super) fn begin_again(&mut self) {
        self.said.clear();
        for agent in self.agents.values_mut() {
            agent.pictures.clear();
            agent.is_accepted = false;
            agent.asked.set(None);
        }
    }

    /// Whether there are any: they need the clock, whether it is heard already or not.
    pub(super) fn are_any(&self) -> bool {
        !self.agents.is_empty()
    }

    /// What is said on behalf of a node: a join once it has been found, and a receipt at the end.
    pub(super) fn next(&mut self, context: &Context, run: Option<u64>) -> Option<Incoming> {
        if let Some(run) = run
            && self.agents.values().any(|agent| !agent.is_accepted)
            && self.looked.is_none_or(|looked| looked.elapsed() >= LOOK_PERIOD)
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
                let message = Inbound::Join(twist::join(run, agent));
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

    /// Keeps what an agent is told in this tick.
    pub(super) fn drive(&mut self, agent: AgentId, odometry: Odometry, points: Option<PointCloud2>) {
        if let Some(driven) = self.agents.get_mut(&agent) {
            let points = points.map(|points| (VisualisationTopic::Points(agent), VisualisationMessage::Points(points)));
            let odometry = (VisualisationTopic::Odometry(agent), VisualisationMessage::Odometry(Box::new(odometry)));
            driven.pictures = points.into_iter().chain([odometry]).collect();
        }
    }

    /// Asks an agent, or asks it again, with what was kept, once its observation is complete.
    pub(super) fn ask(
        &mut self,
        node: &mut Node,
        clock: &mut Outlet<Clock>,
        gallery: &mut Gallery,
        agent: AgentId,
        part: &Part,
    ) {
        let Some(driven) = self.agents.get_mut(&agent).filter(|_| part.part + 1 == part.parts) else { return };
        let tick = Tick(part.tick);
        if part.phase == Part::ENDED {
            if let Some(source) = driven.source {
                let message = Inbound::Command(twist::acknowledgement(part.run, agent, tick));
                self.said.push_back(Incoming { topic_agent: agent, source, message });
            }
            return;
        }
        for (view, picture) in &driven.pictures {
            gallery.show(node, *view, picture);
        }
        if driven.asked.replace(Some(tick)) == Some(tick) {
            // Something of it may have been lost, perhaps the clock.
            clock.publish(node, &Clock { clock: tick.into() });
        }
    }
}
