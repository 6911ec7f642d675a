//! Which ROS type each struct is, and what its definition says.
//!
//! The structs are made by the build script of the `.msg` files, whose texts are the definitions;
//! those under `src/standard` are the field lists of the packages that come with ROS 2. The script
//! refuses a definition that mentions a type without a file, so a definition can always be
//! completed from [`ALL`].

use std::fmt;

use serde::Serialize;
use serde::de::DeserializeOwned;

/// A ROS message type.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct MessageType {
    /// The package it belongs to.
    pub package: &'static str,
    /// Its name in the package.
    pub name: &'static str,
    /// Its definition: the text of its `.msg` file.
    pub definition: &'static str,
}

impl fmt::Display for MessageType {
    /// The full name, as `ros2 topic list -t` shows it: `geometry_msgs/msg/Point`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/msg/{}", self.package, self.name)
    }
}

/// A struct that is a ROS message.
pub trait Message: Serialize + DeserializeOwned {
    /// The ROS type that it is.
    const TYPE: MessageType;
}

/// Every type of this crate, by package and name.
pub const ALL: &[MessageType] = include!(concat!(env!("OUT_DIR"), "/all.rs"));

/// The type of this name in a package.
pub(crate) fn find(package: &str, name: &str) -> Option<MessageType> {
    ALL.iter().copied().find(|message| message.package == package && message.name == name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn named_as_ros_names_them() {
        assert_eq!(crate::maes_msgs::Observation::TYPE.to_string(), "maes_msgs/msg/Observation");
        assert_eq!(crate::tf2_msgs::TFMessage::TYPE.to_string(), "tf2_msgs/msg/TFMessage");
    }

    #[test]
    fn the_list_is_sorted_and_without_doubles() {
        assert!(ALL.is_sorted_by(|a, b| (a.package, a.name) < (b.package, b.name)));
    }
}
