//! Points, vectors and headers as messages.

use msgs::geometry_msgs;
use msgs::ids::Tick;
use msgs::std_msgs::Header;
use nalgebra::{Point3, Vector3};

/// The frame of the world.
pub const MAP_FRAME: &str = "map";

/// The header of a message of a tick in the frame `map`.
#[must_use]
pub fn header(tick: Tick) -> Header {
    Header { stamp: tick.into(), frame_id: MAP_FRAME.to_owned() }
}

/// A point in metres as a message.
#[must_use]
pub fn point(point: &Point3<f64>) -> geometry_msgs::Point {
    geometry_msgs::Point { x: point.x, y: point.y, z: point.z }
}

/// A vector as a message.
#[must_use]
pub fn vector(vector: &Vector3<f64>) -> geometry_msgs::Vector3 {
    geometry_msgs::Vector3 { x: vector.x, y: vector.y, z: vector.z }
}

/// The point of a message, metres.
pub(crate) fn point_of(point: &geometry_msgs::Point) -> Point3<f64> {
    Point3::new(point.x, point.y, point.z)
}

/// Bound of lengths and rates in commands, beyond which precision would suffer.
const COORDINATE_MAX: f64 = 1e6;

/// A length or rate of a command.
///
/// # Errors
/// If it is beyond the bound, or no number.
pub(crate) fn coordinate(field: &str, value: f64) -> Result<f64, String> {
    within(field, value, -COORDINATE_MAX, COORDINATE_MAX)
}

/// A number of a command.
///
/// # Errors
/// If it is not in this range, both ends included.
pub(crate) fn within(field: &str, value: f64, low: f64, high: f64) -> Result<f64, String> {
    if value >= low && value <= high {
        Ok(value)
    } else {
        Err(format!("{field} = {value}, {low} to {high} is allowed"))
    }
}
