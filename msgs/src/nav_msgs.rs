//! The package `nav_msgs`: where a body is, where it is going, and maps of the plane.

include!(concat!(env!("OUT_DIR"), "/nav_msgs.rs"));

/// Values of `data`.
impl OccupancyGrid {
    /// A place that is free.
    pub const FREE: i8 = 0;
    /// A place that is occupied.
    pub const OCCUPIED: i8 = 100;
    /// A place of which nothing is known.
    pub const UNKNOWN: i8 = -1;
}
