//! The package `rcl_interfaces`: the message of the topic `/rosout`, and parameters.

use crate::builtin_interfaces::Time;
use crate::printable;

include!(concat!(env!("OUT_DIR"), "/rcl_interfaces.rs"));

impl Log {
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
