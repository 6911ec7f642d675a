//! The package `rcl_interfaces`: the message of the topic `/rosout`.

use serde::{Deserialize, Serialize};

use crate::builtin_interfaces::Time;

/// Something that a node says to people.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Log {
    /// When it was said: wall time, as ROS does it whatever clock a node goes by.
    pub stamp: Time,
    /// How bad it is, as a number: see [`Level`].
    pub level: u8,
    /// Who says so: the node.
    pub name: String,
    /// What.
    pub msg: String,
    /// Not used here.
    pub file: String,
    /// Not used here.
    pub function: String,
    /// Not used here.
    pub line: u32,
}

/// How bad something is that people are told, of the levels of [`Log`] those that are used here.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum Level {
    /// As expected.
    Info = 20,
    /// Not as expected.
    Warn = 30,
    /// Something failed.
    Error = 40,
}
