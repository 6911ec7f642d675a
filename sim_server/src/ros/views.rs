//! The publishers of what people look at.
//!
//! They are there from the start, so that people find the topics; but nothing is published that nobody listens to.

use std::collections::BTreeSet;

use msgs::diagnostic_msgs::DiagnosticArray;
use msgs::ids::AgentId;
use msgs::maes_msgs::{Digest, Result as Outcome};
use msgs::nav_msgs::{Odometry, Path};
use msgs::sensor_msgs::PointCloud2;
use msgs::tf2_msgs::TFMessage;
use msgs::topics;
use msgs::visualization_msgs::Marker;
use ros_node::audience::Audience;
use ros_node::{Outlet, RosError, Workshop};
use ros2_client::{Context, Node};

use simulation::visualisation::{Subscribers, VisualisationMessage, VisualisationTopic};

/// The number of `/clock` in the audience; the views come after it.
const CLOCK: usize = 0;

/// The views, and who looks at them.
pub(super) struct Gallery {
    driven: BTreeSet<AgentId>,
    stages: Vec<(VisualisationTopic, Stage)>,
    audience: Audience,
    listeners: Subscribers,
}

/// The publisher of a view.
enum Stage {
    Transforms(Outlet<TFMessage>),
    Odometry(Outlet<Odometry>),
    Points(Outlet<PointCloud2>),
    Path(Outlet<Path>),
    Marker(Outlet<Marker>),
    Info(Outlet<DiagnosticArray>),
    Digest(Outlet<Digest>),
    Result(Outlet<Outcome>),
}

impl Gallery {
    /// Offers the views of a run with this many agents. Those that drive an agent are shown in their own time: who listens to them
    /// does not matter.
    ///
    /// # Errors
    /// If the middleware refuses a publisher.
    pub(super) fn new(
        workshop: &mut Workshop,
        node: &mut Node,
        agents: u32,
        driven: &BTreeSet<AgentId>,
    ) -> Result<Self, RosError> {
        let mut stages = Vec::new();
        let mut looked_at = vec![topics::clock()];
        for view in VisualisationTopic::all(agents) {
            let topic = view.topic();
            let stage = match view {
                VisualisationTopic::Transforms | VisualisationTopic::StaticTransforms => {
                    Stage::Transforms(workshop.outlet(node, &topic)?)
                }
                VisualisationTopic::Odometry(_) => Stage::Odometry(workshop.outlet(node, &topic)?),
                VisualisationTopic::Points(_) => Stage::Points(workshop.outlet(node, &topic)?),
                VisualisationTopic::Path(_) => Stage::Path(workshop.outlet(node, &topic)?),
                VisualisationTopic::Map | VisualisationTopic::Unexplored | VisualisationTopic::Contacts => {
                    Stage::Marker(workshop.outlet(node, &topic)?)
                }
                VisualisationTopic::Info => Stage::Info(workshop.outlet(node, &topic)?),
                VisualisationTopic::Digest => Stage::Digest(workshop.outlet(node, &topic)?),
                VisualisationTopic::Result => Stage::Result(workshop.outlet(node, &topic)?),
            };
            stages.push((view, stage));
            looked_at.push(topic);
        }
        // In the order of the views, so that a stage can be found.
        let mut numbered: Vec<_> = stages.into_iter().zip(looked_at.split_off(1)).collect();
        numbered.sort_by_key(|((view, _), _)| *view);
        let (stages, view_topics): (Vec<_>, Vec<_>) = numbered.into_iter().unzip();
        looked_at.extend(view_topics);
        let driven = driven.clone();
        Ok(Self { driven, stages, audience: Audience::new(&looked_at), listeners: Subscribers::new() })
    }

    /// Who has just come is seen, too, when it is next asked who listens.
    pub(super) fn look_anew(&mut self) {
        self.audience.look_anew();
    }

    /// What somebody listens to.
    pub(super) fn listeners(&mut self, context: &Context) -> Option<&Subscribers> {
        self.look(context);
        (!self.listeners.is_empty()).then_some(&self.listeners)
    }

    /// Whether nobody has listened to anything when it was last looked.
    pub(super) fn is_deserted(&self) -> bool {
        self.listeners.is_empty()
    }

    /// Whether somebody listens to the clock.
    pub(super) fn hears_the_clock(&mut self, context: &Context) -> bool {
        self.look(context);
        self.audience.listens(CLOCK)
    }

    fn look(&mut self, context: &Context) {
        if self.audience.look(context) {
            let arrivals = |(number, (view, _)): (usize, &(VisualisationTopic, Stage))| {
                let (VisualisationTopic::Odometry(agent) | VisualisationTopic::Points(agent)) = *view else {
                    return self.arrivals(number, *view);
                };
                if self.driven.contains(&agent) { None } else { self.arrivals(number, *view) }
            };
            self.listeners = self.stages.iter().enumerate().filter_map(arrivals).collect();
        }
    }

    fn arrivals(&self, number: usize, view: VisualisationTopic) -> Option<(VisualisationTopic, u64)> {
        Some((view, self.audience.arrivals(CLOCK + 1 + number)?))
    }

    /// Publishes something.
    pub(super) fn show(&mut self, node: &mut Node, view: VisualisationTopic, picture: &VisualisationMessage) {
        let Ok(number) = self.stages.binary_search_by_key(&view, |(view, _)| *view) else { return };
        match (&mut self.stages[number].1, picture) {
            (Stage::Transforms(outlet), VisualisationMessage::Transforms(message)) => outlet.publish(node, message),
            (Stage::Odometry(outlet), VisualisationMessage::Odometry(message)) => outlet.publish(node, message),
            (Stage::Points(outlet), VisualisationMessage::Points(message)) => outlet.publish(node, message),
            (Stage::Path(outlet), VisualisationMessage::Path(message)) => outlet.publish(node, message),
            (Stage::Marker(outlet), VisualisationMessage::Marker(message)) => outlet.publish(node, message),
            (Stage::Info(outlet), VisualisationMessage::Info(message)) => outlet.publish(node, message),
            (Stage::Digest(outlet), VisualisationMessage::Digest(message)) => outlet.publish(node, message),
            (Stage::Result(outlet), VisualisationMessage::Result(message)) => outlet.publish(node, message),
            (_, picture) => unreachable!("a view has pictures of one type, not {picture:?}"),
        }
    }
}
