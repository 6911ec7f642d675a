//! The package `std_msgs`: the header that stamped messages begin with, colours, and texts.

use serde::{Deserialize, Serialize};

use crate::builtin_interfaces::Time;

/// When and in which frame the rest of a message holds.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Header {
    /// Sim time.
    pub stamp: Time,
    /// Name of the frame that coordinates are given in.
    pub frame_id: std::string::String,
}

/// A text.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct String {
    /// The text.
    pub data: std::string::String,
}

/// A colour; each part from 0 to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ColorRGBA {
    /// Red.
    pub r: f32,
    /// Green.
    pub g: f32,
    /// Blue.
    pub b: f32,
    /// 0: not to be seen; 1: opaque.
    pub a: f32,
}
