//! Publishers of the visualisation topics.
//!
//! They exist from the start, so that tools find the topics; a topic without a reader is not
//! published to.

use std::collections::BTreeSet;

use msgs::diagnostic_msgs::DiagnosticArray;
use msgs::ids::AgentId;
use msgs::maes_msgs::{Digest, Result as Outcome};
use msgs::nav_msgs::{OccupancyGrid, Odometry, Path};
use msgs::octomap_msgs::Octomap;
use msgs::sensor_msgs::{BatteryState, CameraInfo, Image, LaserScan, PointCloud2};
use msgs::std_msgs;
use msgs::tf2_msgs::TFMessage;
use msgs::topics;
use msgs::visualization_msgs::Marker;
use ros_node::{Context, EndpointFactory, Node, Publisher, RosError, SubscriptionTracker};

use simulation::visualisation::{Equipment, SensorId, Subscribers, VisualisationMessage, VisualisationTopic};

/// Index of `/clock` in the subscription tracker; the views follow.
const CLOCK: usize = 0;

/// The visualisation topics with their publishers and subscriptions.
pub(super) struct VisualisationPublishers {
    teleoperated: BTreeSet<AgentId>,
    publishers: Vec<(VisualisationTopic, TopicPublisher)>,
    subscriptions: SubscriptionTracker,
    listeners: Subscribers,
}

enum TopicPublisher {
    Transforms(Publisher<TFMessage>),
    Odometry(Publisher<Odometry>),
    Points(Publisher<PointCloud2>),
    Scan(Publisher<LaserScan>),
    Image(Publisher<Image>),
    CameraInfo(Publisher<CameraInfo>),
    Battery(Publisher<BatteryState>),
    Path(Publisher<Path>),
    Marker(Publisher<Marker>),
    Info(Publisher<DiagnosticArray>),
    Text(Publisher<std_msgs::String>),
    Occupancy(Publisher<OccupancyGrid>),
    Octomap(Publisher<Octomap>),
    Digest(Publisher<Digest>),
    Result(Publisher<Outcome>),
}

impl VisualisationPublishers {
    /// Offers the visualisation topics of a run. Topics that feed an externally controlled agent
    /// are published with its observations, whatever their subscriptions.
    ///
    /// # Errors
    /// If the middleware fails to create a publisher.
    pub(super) fn new(
        endpoints: &mut EndpointFactory,
        node: &mut Node,
        equipment: &Equipment,
        teleoperated: &BTreeSet<AgentId>,
    ) -> Result<Self, RosError> {
        let mut publishers = Vec::new();
        let mut tracked = vec![topics::clock()];
        for view in VisualisationTopic::all(equipment) {
            let topic = view.topic();
            let publisher = match view {
                VisualisationTopic::Transforms | VisualisationTopic::StaticTransforms => {
                    TopicPublisher::Transforms(endpoints.publisher(node, &topic)?)
                }
                VisualisationTopic::Odometry(_) => TopicPublisher::Odometry(endpoints.publisher(node, &topic)?),
                VisualisationTopic::Points(_) | VisualisationTopic::MapPoints | VisualisationTopic::ExploredPoints => {
                    TopicPublisher::Points(endpoints.publisher(node, &topic)?)
                }
                VisualisationTopic::Scan(_) => TopicPublisher::Scan(endpoints.publisher(node, &topic)?),
                VisualisationTopic::DepthImage(_) => TopicPublisher::Image(endpoints.publisher(node, &topic)?),
                VisualisationTopic::CameraInfo(_) => TopicPublisher::CameraInfo(endpoints.publisher(node, &topic)?),
                VisualisationTopic::Battery(_) => TopicPublisher::Battery(endpoints.publisher(node, &topic)?),
                VisualisationTopic::Path(_) => TopicPublisher::Path(endpoints.publisher(node, &topic)?),
                VisualisationTopic::Map | VisualisationTopic::Unexplored | VisualisationTopic::Contacts => {
                    TopicPublisher::Marker(endpoints.publisher(node, &topic)?)
                }
                VisualisationTopic::Info | VisualisationTopic::Diagnostics => {
                    TopicPublisher::Info(endpoints.publisher(node, &topic)?)
                }
                VisualisationTopic::RobotDescription => TopicPublisher::Text(endpoints.publisher(node, &topic)?),
                VisualisationTopic::Occupancy | VisualisationTopic::ExploredOccupancy => {
                    TopicPublisher::Occupancy(endpoints.publisher(node, &topic)?)
                }
                VisualisationTopic::Octomap | VisualisationTopic::ExploredOctomap => {
                    TopicPublisher::Octomap(endpoints.publisher(node, &topic)?)
                }
                // The transport publishes it itself.
                VisualisationTopic::Clock => continue,
                VisualisationTopic::Digest => TopicPublisher::Digest(endpoints.publisher(node, &topic)?),
                VisualisationTopic::Result => TopicPublisher::Result(endpoints.publisher(node, &topic)?),
            };
            publishers.push((view, publisher));
            tracked.push(topic);
        }
        // Sorted by view, for binary search.
        let mut numbered: Vec<_> = publishers.into_iter().zip(tracked.split_off(1)).collect();
        numbered.sort_by_key(|((view, _), _)| *view);
        let (publishers, view_topics): (Vec<_>, Vec<_>) = numbered.into_iter().unzip();
        tracked.extend(view_topics);
        let teleoperated = teleoperated.clone();
        Ok(Self {
            teleoperated,
            publishers,
            subscriptions: SubscriptionTracker::new(&tracked),
            listeners: Subscribers::new(),
        })
    }

    /// Makes the next poll effective at once, because a reader may have just joined.
    pub(super) fn poll_immediately(&mut self) {
        self.subscriptions.poll_immediately();
    }

    /// The topics that have readers, or `None` without any.
    pub(super) fn listeners(&mut self, context: &Context) -> Option<&Subscribers> {
        self.poll(context);
        (!self.listeners.is_empty()).then_some(&self.listeners)
    }

    /// Whether any topic had a reader at the last poll.
    pub(super) fn has_listeners(&self) -> bool {
        !self.listeners.is_empty()
    }

    /// Whether the clock has a reader.
    pub(super) fn clock_has_subscribers(&mut self, context: &Context) -> bool {
        self.poll(context);
        self.subscriptions.has_subscribers(CLOCK)
    }

    fn poll(&mut self, context: &Context) {
        if self.subscriptions.poll(context) {
            let arrivals = |(number, (view, _)): (usize, &(VisualisationTopic, TopicPublisher))| {
                let (VisualisationTopic::Odometry(agent) | VisualisationTopic::Points(SensorId { agent, .. })) = *view
                else {
                    return self.arrivals(number, *view);
                };
                if self.teleoperated.contains(&agent) { None } else { self.arrivals(number, *view) }
            };
            self.listeners = self.publishers.iter().enumerate().filter_map(arrivals).collect();
        }
    }

    fn arrivals(&self, number: usize, view: VisualisationTopic) -> Option<(VisualisationTopic, u64)> {
        Some((view, self.subscriptions.arrivals(CLOCK + 1 + number)?))
    }

    /// Publishes a message of a view.
    pub(super) fn show(&mut self, node: &mut Node, view: VisualisationTopic, picture: &VisualisationMessage) {
        let Ok(number) = self.publishers.binary_search_by_key(&view, |(view, _)| *view) else { return };
        match (&mut self.publishers[number].1, picture) {
            (TopicPublisher::Transforms(publisher), VisualisationMessage::Transforms(message)) => {
                publisher.publish(node, message)
            }
            (TopicPublisher::Odometry(publisher), VisualisationMessage::Odometry(message)) => {
                publisher.publish(node, message)
            }
            (TopicPublisher::Points(publisher), VisualisationMessage::Points(message)) => {
                publisher.publish(node, message)
            }
            (TopicPublisher::Scan(publisher), VisualisationMessage::Scan(message)) => publisher.publish(node, message),
            (TopicPublisher::Image(publisher), VisualisationMessage::Image(message)) => {
                publisher.publish(node, message)
            }
            (TopicPublisher::CameraInfo(publisher), VisualisationMessage::CameraInfo(message)) => {
                publisher.publish(node, message)
            }
            (TopicPublisher::Battery(publisher), VisualisationMessage::Battery(message)) => {
                publisher.publish(node, message)
            }
            (TopicPublisher::Path(publisher), VisualisationMessage::Path(message)) => publisher.publish(node, message),
            (TopicPublisher::Marker(publisher), VisualisationMessage::Marker(message)) => {
                publisher.publish(node, message)
            }
            (TopicPublisher::Info(publisher), VisualisationMessage::Info(message)) => publisher.publish(node, message),
            (TopicPublisher::Text(publisher), VisualisationMessage::Text(message)) => publisher.publish(node, message),
            (TopicPublisher::Occupancy(publisher), VisualisationMessage::Occupancy(message)) => {
                publisher.publish(node, message)
            }
            (TopicPublisher::Octomap(publisher), VisualisationMessage::Octomap(message)) => {
                publisher.publish(node, message)
            }
            (TopicPublisher::Digest(publisher), VisualisationMessage::Digest(message)) => {
                publisher.publish(node, message)
            }
            (TopicPublisher::Result(publisher), VisualisationMessage::Result(message)) => {
                publisher.publish(node, message)
            }
            (_, picture) => unreachable!("a view has pictures of one type, not {picture:?}"),
        }
    }
}
