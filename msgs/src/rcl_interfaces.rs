//! The package `rcl_interfaces`: the message of the topic `/rosout`.

use serde::{Deserialize, Serialize};

use crate::builtin_interfaces::Time;
use crate::printable;

/// Something that a node says to people.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Log {
    /// When it was said: wall time, as ROS does it whatever clock a node goes by.
    pub stamp: Time,
    /// How bad it is, one of the constants.
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

impl Log {
    /// `level`: for those who look for a mistake.
    pub const DEBUG: u8 = 10;
    /// `level`: as expected.
    pub const INFO: u8 = 20;
    /// `level`: not as expected.
    pub const WARN: u8 = 30;
    /// `level`: something failed.
    pub const ERROR: u8 = 40;
    /// `level`: the node ends of it.
    pub const FATAL: u8 = 50;

    /// A line of the node of this name, said at this wall time.
    #[must_use]
    pub fn of_node(name: &str, level: Level, text: &str, stamp: Time) -> Self {
        // Tools print it on terminals.
        let (name, msg) = (name.to_owned(), printable::text(text).into_owned());
        Self { stamp, level: level as u8, name, msg, ..Self::default() }
    }
}

/// Severity of a log line: the levels of [`Log`] that are used here.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum Level {
    /// As expected.
    Info = Log::INFO,
    /// Not as expected.
    Warn = Log::WARN,
    /// Something failed.
    Error = Log::ERROR,
}
