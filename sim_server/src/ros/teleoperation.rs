//! Agents that are controlled with standard messages (`cmd_vel`): their controller process, and the
//! odometry and scans they receive.
//!
//! The first process found to publish velocities for such an agent controls it for the whole run.
//! [`simulation::twist`] converts its twists into commands.

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
use ros_node::{Context, EndpointFactory, Inbox, Node, Publisher, RosError, Sample};

use super::Item;
use super::visualisation::VisualisationPublishers;
use protocol::lockstep::SourceId;
use protocol::signed::Signed;
use simulation::twist;
use simulation::visualisation::{SensorId, VisualisationMessage, VisualisationTopic};
use system::wall_clock::now;
use transport::{Inbound, Incoming};

/// Wall time between two polls for publishers of velocities.
const POLL_PERIOD: Duration = Duration::from_millis(50);

/// The externally controlled agents of a run.
pub(super) struct TeleoperatedAgents {
    agents: BTreeMap<AgentId, ExternalAgent>,
    /// Messages on behalf of their controllers.
    outgoing: VecDeque<Incoming>,
    polled: Option<Instant>,
}

#[derive(Default)]
struct ExternalAgent {
    /// What it receives in this tick.
    pictures: Vec<(VisualisationTopic, VisualisationMessage)>,
    /// The participant that controls it, once known.
    source: Option<SourceId>,
    is_accepted: bool,
    /// The tick of the last observation; velocities before the first one are ignored.
    requested: Rc<Cell<Option<Tick>>>,
}

impl TeleoperatedAgents {
    /// Subscribes to the velocities of these agents. `own_run` holds the number of the run once it
    /// is known.
    ///
    /// # Errors
    /// If the middleware fails to create an endpoint.
    pub(super) fn new(
        agents: &BTreeSet<AgentId>,
        endpoints: &mut EndpointFactory,
        node: &mut Node,
        inbox: &mut Inbox<Item>,
        own_run: &Rc<Cell<Option<u64>>>,
    ) -> Result<Self, RosError> {
        let mut teleoperated = BTreeMap::new();
        for &agent in agents {
            let entry = ExternalAgent::default();
            let (requested, own_run) = (Rc::clone(&entry.requested), Rc::clone(own_run));
            endpoints.subscribe(node, &topics::cmd_vel(agent), inbox, move |sample: Sample<TwistStamped>| {
                let Some(run) = own_run.get().filter(|_| requested.get().is_some()) else { return Item::Handled };
                let command = sample.message.and_then(|twist| twist::command(run, agent, &twist));
                let message = command.map_or_else(
                    |reason| Inbound::Undecodable { reason },
                    |command| Inbound::Command(Signed::unsigned(command)),
                );
                let source = SourceId(sample.source);
                Item::Agent(Box::new(Incoming { topic_agent: agent, source, message }))
            })?;
            teleoperated.insert(agent, entry);
        }
        Ok(Self { agents: teleoperated, outgoing: VecDeque::new(), polled: None })
    }

    /// Forgets the previous run.
    pub(super) fn reset(&mut self) {
        self.outgoing.clear();
        for agent in self.agents.values_mut() {
            agent.pictures.clear();
            agent.is_accepted = false;
            agent.requested.set(None);
        }
    }

    /// Whether there are none. They need the clock even before its subscription is discovered.
    pub(super) fn is_empty(&self) -> bool {
        self.agents.is_empty()
    }

    /// The next message on behalf of a controller: a join once it is found, an acknowledgement at
    /// the end.
    pub(super) fn next(&mut self, context: &Context, run: Option<u64>) -> Option<Incoming> {
        if let Some(run) = run
            && self.agents.values().any(|agent| !agent.is_accepted)
            && self.polled.is_none_or(|polled| polled.elapsed() >= POLL_PERIOD)
        {
            self.polled = Some(now());
            self.find_controllers(context, run);
        }
        self.outgoing.pop_front()
    }

    fn find_controllers(&mut self, context: &Context, run: u64) {
        for (&agent, teleoperated) in self.agents.iter_mut().filter(|(_, teleoperated)| !teleoperated.is_accepted) {
            let sources = context.publishers(&topics::cmd_vel(agent)).into_iter().map(SourceId);
            teleoperated.source = teleoperated.source.or(sources.min());
            if let Some(source) = teleoperated.source {
                let message = Inbound::Join(Signed::unsigned(twist::join(run, agent)));
                self.outgoing.push_back(Incoming { topic_agent: agent, source, message });
            }
        }
    }

    /// Handles the reply to a join.
    pub(super) fn receive_reply(&mut self, reply: &JoinReply) {
        if let Some(teleoperated) = self.agents.get_mut(&AgentId(reply.agent)) {
            teleoperated.is_accepted |= reply.accepted;
        }
    }

    /// Keeps what an agent receives in this tick.
    pub(super) fn drive(&mut self, agent: AgentId, odometry: Odometry, points: Vec<(SensorId, PointCloud2)>) {
        if let Some(teleoperated) = self.agents.get_mut(&agent) {
            let picture = |(sensor, points)| (VisualisationTopic::Points(sensor), VisualisationMessage::Points(points));
            let points = points.into_iter().map(picture);
            let odometry = (VisualisationTopic::Odometry(agent), VisualisationMessage::Odometry(Box::new(odometry)));
            teleoperated.pictures = points.chain([odometry]).collect();
        }
    }

    /// Sends or resends what was kept, once all fragments of the observation have arrived here.
    pub(super) fn send(
        &mut self,
        node: &mut Node,
        clock: &mut Publisher<Clock>,
        visualisation: &mut VisualisationPublishers,
        agent: AgentId,
        part: &Part,
    ) {
        let Some(teleoperated) = self.agents.get_mut(&agent).filter(|_| part.is_last()) else { return };
        let tick = Tick(part.tick);
        if part.phase == Part::ENDED {
            if let Some(source) = teleoperated.source {
                let acknowledgement = Signed::unsigned(twist::acknowledgement(part.run, agent, tick));
                let message = Inbound::Command(acknowledgement);
                self.outgoing.push_back(Incoming { topic_agent: agent, source, message });
            }
            return;
        }
        for (view, picture) in &teleoperated.pictures {
            visualisation.show(node, *view, picture);
        }
        if teleoperated.requested.replace(Some(tick)) == Some(tick) {
            // A resend: some of it may have been lost, perhaps the clock.
            clock.publish(node, &Clock { clock: tick.into() });
        }
    }
}
