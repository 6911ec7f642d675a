//! The package `builtin_interfaces`: time as ROS 2 writes it. Here times are always sim time: what
//! has passed since the start of the run.

use crate::ids::Tick;

include!(concat!(env!("OUT_DIR"), "/builtin_interfaces.rs"));

const NS_PER_S: u64 = 1_000_000_000;

impl From<Tick> for Time {
    /// The sim time of `tick`, exactly. Seconds beyond the range of the field (68 years) stay at
    /// its largest value.
    fn from(tick: Tick) -> Self {
        let ns = tick.time_ns();
        Time { sec: i32::try_from(ns / NS_PER_S).unwrap_or(i32::MAX), nanosec: (ns % NS_PER_S) as u32 }
    }
}

impl From<std::time::Duration> for Time {
    /// What has passed since an epoch. Seconds beyond the range of the field (68 years) stay at its
    /// largest value.
    fn from(passed: std::time::Duration) -> Self {
        Time { sec: i32::try_from(passed.as_secs()).unwrap_or(i32::MAX), nanosec: passed.subsec_nanos() }
    }
}
