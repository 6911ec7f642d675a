//! The package `diagnostic_msgs`: how things are, in words.

use serde::{Deserialize, Serialize};

use crate::std_msgs::Header;

/// How several things are.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DiagnosticArray {
    /// Sim time.
    pub header: Header,
    /// The things.
    pub status: Vec<DiagnosticStatus>,
}

/// How one thing is.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct DiagnosticStatus {
    /// Whether it is well; one of the constants.
    pub level: u8,
    /// What it is called.
    pub name: String,
    /// How it is.
    pub message: String,
    /// Not used here.
    pub hardware_id: String,
    /// The state in numbers.
    pub values: Vec<KeyValue>,
}

impl DiagnosticStatus {
    /// `level`: well.
    pub const OK: u8 = 0;
    /// `level`: not quite.
    pub const WARN: u8 = 1;
    /// `level`: broken.
    pub const ERROR: u8 = 2;
    /// `level`: not heard of for long.
    pub const STALE: u8 = 3;
}

/// A named value.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct KeyValue {
    /// What it is.
    pub key: String,
    /// How much.
    pub value: String,
}
