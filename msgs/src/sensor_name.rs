//! The name of one of several sensors of a body, which is part of its topics and frames.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Deserializer, Serialize, Serializer};
use thiserror::Error;

/// The name of a sensor: a token of a ROS topic, kept inline so that whatever names a topic is
/// copied.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct SensorName([u8; SensorName::BYTES_MAX]);

/// A text that is no name of a sensor.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("\"{0}\": expected {allowed}", allowed = SensorName::ALLOWED)]
pub struct SensorNameError(String);

impl SensorName {
    /// Longest name, bytes.
    pub const BYTES_MAX: usize = 32;

    /// What a name may be, for errors and documents.
    pub const ALLOWED: &'static str = "a to z first, then a to z, 0 to 9 and single \"_\" not at the end, \
                                       up to 32 characters; not base_link, map, odom or ..._optical_frame";

    /// Frames of an agent that are no sensors.
    const FRAMES: [&'static str; 3] = ["base_link", "map", "odom"];

    /// The name as a text.
    #[must_use]
    pub fn as_str(&self) -> &str {
        let length = self.0.iter().position(|&byte| byte == 0).unwrap_or(self.0.len());
        // A name is ASCII.
        str::from_utf8(&self.0[..length]).unwrap_or_default()
    }
}

impl FromStr for SensorName {
    type Err = SensorNameError;

    fn from_str(text: &str) -> Result<Self, SensorNameError> {
        let is_token = text.starts_with(|first: char| first.is_ascii_lowercase())
            && text.bytes().all(|byte| byte.is_ascii_lowercase() || byte.is_ascii_digit() || byte == b'_')
            && !text.ends_with('_')
            && !text.contains("__");
        let is_frame = Self::FRAMES.contains(&text) || text.ends_with("_optical_frame");
        if !is_token || is_frame || text.len() > Self::BYTES_MAX {
            return Err(SensorNameError(text.to_owned()));
        }
        let mut bytes = [0; Self::BYTES_MAX];
        bytes[..text.len()].copy_from_slice(text.as_bytes());
        Ok(Self(bytes))
    }
}

impl fmt::Display for SensorName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.as_str())
    }
}

impl fmt::Debug for SensorName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(self.as_str(), f)
    }
}

impl Serialize for SensorName {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.as_str())
    }
}

impl<'de> Deserialize<'de> for SensorName {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = String::deserialize(deserializer)?;
        text.parse().map_err(serde::de::Error::custom)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_tokens_of_topics() {
        let longest = "a".repeat(SensorName::BYTES_MAX);
        for name in ["front", "lidar_2", "a", &longest] {
            assert_eq!(name.parse::<SensorName>().unwrap().as_str(), name);
        }
        let too_long = "a".repeat(SensorName::BYTES_MAX + 1);
        for name in ["", "2nd", "Front", "up_", "up__down", "a/b", "a-b", "_a", "f\u{fc}r", &too_long] {
            assert_eq!(name.parse::<SensorName>(), Err(SensorNameError(name.to_owned())));
        }
        for frame in ["base_link", "map", "odom", "camera_optical_frame"] {
            let error = frame.parse::<SensorName>().unwrap_err().to_string();
            assert!(error.starts_with(&format!("\"{frame}\": expected a to z first")), "{error}");
        }
    }

    #[test]
    fn names_are_in_the_order_of_their_texts() {
        let names = ["a", "ab", "b"].map(|name| name.parse::<SensorName>().unwrap());
        assert!(names.is_sorted());
    }
}
