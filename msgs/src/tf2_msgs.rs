//! The package `tf2_msgs`: the message of the topic `/tf`.

use serde::{Deserialize, Serialize};

use crate::geometry_msgs::TransformStamped;

/// Where some frames are, each with a time of its own.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TFMessage {
    /// One entry for each frame.
    pub transforms: Vec<TransformStamped>,
}
