//! Recordings of runs: MCAP files that hold what a run was made of and every message of it.
//!
//! [`recorder`] writes a recording, and [`live_stream`] one that observers read while it grows;
//! [`Recording`] reads it as a stream, [`Follower`] while it is written, [`index`] what its index
//! says of it, and [`map`] its map; [`recovery`] repairs a file without an end, [`bag`] makes
//! the metadata of a rosbag2 folder, and [`location`] finds the recording in one. [`playback`] has
//! the inputs of a run by tick, and [`replay`] decides which message is due when; [`comparison`]
//! finds the first message in which two runs differ, and [`difference`] its field; [`routes`] says
//! where the bodies were.
//!
//! This crate knows no session, no agent and no ROS client.

pub mod bag;
pub mod comparison;
pub mod difference;
pub mod live_stream;
pub mod location;
pub mod map;
pub mod playback;
mod reader;
pub mod recorder;
pub mod replay;
pub mod routes;

pub use reader::{
    Channel, End, Follower, MAP_ATTACHMENT, Message, Messages, Recording, RecordingError, SCENARIO_ATTACHMENT,
    TEXT_MAP_ATTACHMENT, index, recovery,
};
