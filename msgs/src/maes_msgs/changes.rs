//! Changes of a run, as a recording holds them.

use serde::{Deserialize, Serialize};

use crate::geometry_msgs::Point;
use crate::std_msgs::Header;

/// An intervention into the run by a control request.
///
/// It is part of the run: it takes effect at the beginning of its tick, before the scans, and is
/// covered by the digest.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Intervention {
    /// Sim time.
    pub header: Header,
    /// The tick at whose beginning it takes effect.
    pub tick: u64,
    /// One of the constants.
    pub kind: u8,
    /// The id of the agent.
    pub agent: u32,
    /// Position of the centre, for `PLACE` and `JOIN`; metres, frame "map".
    pub position: Point,
    /// Heading, for `PLACE` and `JOIN`.
    pub yaw_rad: f64,
}

impl Intervention {
    /// The body was put at a pose, at rest; its task has ended.
    pub const PLACE: u8 = 0;
    /// The agent has left the run: its body stops and stays. Recordings of earlier builds have it.
    pub const REMOVE: u8 = 1;
    /// The agent has left the world with its body.
    pub const LEAVE: u8 = 2;
    /// An agent of the reserve has entered the world at a pose, at rest.
    pub const JOIN: u8 = 3;
}

/// A change of the map during the run: the cells of a box have become free or wall.
///
/// It takes effect at the beginning of its tick, before the scans.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MapChange {
    /// Sim time.
    pub header: Header,
    /// The tick at whose beginning it takes effect.
    pub tick: u64,
    /// One of the constants.
    pub kind: u8,
    /// The lowest cell of the box: x, y, z.
    pub low: [u32; 3],
    /// The highest cell of the box, which belongs to it.
    pub high: [u32; 3],
}

impl MapChange {
    /// The cells have become free.
    pub const FREE: u8 = 0;
    /// The cells have become wall.
    pub const WALL: u8 = 1;
}
