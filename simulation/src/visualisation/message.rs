//! The messages of visualisation topics.

use msgs::builtin_interfaces::Time;
use msgs::diagnostic_msgs::DiagnosticArray;
use msgs::maes_msgs;
use msgs::nav_msgs::{OccupancyGrid, Odometry, Path};
use msgs::octomap_msgs::Octomap;
use msgs::rosgraph_msgs::Clock;
use msgs::sensor_msgs::{BatteryState, CameraInfo, Image, LaserScan, PointCloud2};
use msgs::std_msgs;
use msgs::tf2_msgs::TFMessage;
use msgs::visualization_msgs::Marker;
use serde::{Serialize, Serializer};

#[cfg(doc)]
use super::VisualisationTopic;

/// A message of a visualisation topic.
#[derive(Debug, Clone, PartialEq)]
pub enum VisualisationMessage {
    /// Of [`VisualisationTopic::Transforms`] and [`VisualisationTopic::StaticTransforms`].
    Transforms(TFMessage),
    /// Of [`VisualisationTopic::Odometry`].
    Odometry(Box<Odometry>),
    /// Of [`VisualisationTopic::Points`], [`VisualisationTopic::MapPoints`] and
    /// [`VisualisationTopic::ExploredPoints`].
    Points(PointCloud2),
    /// Of [`VisualisationTopic::Scan`].
    Scan(LaserScan),
    /// Of [`VisualisationTopic::DepthImage`].
    Image(Image),
    /// Of [`VisualisationTopic::CameraInfo`].
    CameraInfo(Box<CameraInfo>),
    /// Of [`VisualisationTopic::Battery`].
    Battery(Box<BatteryState>),
    /// Of [`VisualisationTopic::Path`].
    Path(Path),
    /// Of [`VisualisationTopic::Map`], [`VisualisationTopic::Unexplored`] and
    /// [`VisualisationTopic::Contacts`].
    Marker(Box<Marker>),
    /// Of [`VisualisationTopic::Info`] and [`VisualisationTopic::Diagnostics`].
    Info(DiagnosticArray),
    /// Of [`VisualisationTopic::RobotDescription`].
    Text(std_msgs::String),
    /// Of [`VisualisationTopic::Occupancy`] and [`VisualisationTopic::ExploredOccupancy`].
    Occupancy(Box<OccupancyGrid>),
    /// Of [`VisualisationTopic::Octomap`] and [`VisualisationTopic::ExploredOctomap`].
    Octomap(Box<Octomap>),
    /// Of [`VisualisationTopic::Clock`].
    Clock(Clock),
    /// Of [`VisualisationTopic::Digest`].
    Digest(maes_msgs::Digest),
    /// Of [`VisualisationTopic::Result`].
    Result(Box<maes_msgs::Result>),
}

impl VisualisationMessage {
    /// Its stamp, if it has one; of transforms, that of the first.
    #[must_use]
    pub fn stamp(&self) -> Option<Time> {
        let header = match self {
            Self::Transforms(message) => &message.transforms.first()?.header,
            Self::Odometry(message) => &message.header,
            Self::Points(message) => &message.header,
            Self::Scan(message) => &message.header,
            Self::Image(message) => &message.header,
            Self::CameraInfo(message) => &message.header,
            Self::Battery(message) => &message.header,
            Self::Path(message) => &message.header,
            Self::Marker(message) => &message.header,
            Self::Info(message) => &message.header,
            Self::Occupancy(message) => &message.header,
            Self::Octomap(message) => &message.header,
            Self::Digest(message) => &message.header,
            Self::Clock(message) => return Some(message.clock),
            Self::Text(_) | Self::Result(_) => return None,
        };
        Some(header.stamp)
    }
}

/// Serialises as the message that it holds.
impl Serialize for VisualisationMessage {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Transforms(message) => message.serialize(serializer),
            Self::Odometry(message) => message.serialize(serializer),
            Self::Points(message) => message.serialize(serializer),
            Self::Scan(message) => message.serialize(serializer),
            Self::Image(message) => message.serialize(serializer),
            Self::CameraInfo(message) => message.serialize(serializer),
            Self::Battery(message) => message.serialize(serializer),
            Self::Path(message) => message.serialize(serializer),
            Self::Marker(message) => message.serialize(serializer),
            Self::Info(message) => message.serialize(serializer),
            Self::Text(message) => message.serialize(serializer),
            Self::Occupancy(message) => message.serialize(serializer),
            Self::Octomap(message) => message.serialize(serializer),
            Self::Clock(message) => message.serialize(serializer),
            Self::Digest(message) => message.serialize(serializer),
            Self::Result(message) => message.serialize(serializer),
        }
    }
}
