//! Who and when: the two numbers that everything else refers to.
//!
//! Invariant: sim time is `Tick::TICK_NS` times the tick, an exact integer; nothing here knows wall
//! time.

use std::fmt;

use serde::{Deserialize, Serialize};

/// The number of an agent: 0 .. number of agents - 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(transparent)]
pub struct AgentId(pub u32);

impl AgentId {
    /// The agent at this position of a list of all agents.
    ///
    /// # Panics
    /// If a list could not be that long: from 2^32 on.
    #[inline]
    pub fn from_index(index: usize) -> Self {
        Self(u32::try_from(index).expect("there are fewer than 2^32 agents"))
    }

    /// Its position in a list of all agents.
    #[inline]
    pub const fn index(self) -> usize {
        self.0 as usize
    }
}

impl fmt::Display for AgentId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// A fixed update, counted from the start of the run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Tick(pub u64);

impl Tick {
    /// Sim time of one fixed update, nanoseconds: the 20 ms of the reference simulator.
    pub const TICK_NS: u64 = 20_000_000;

    /// Sim time of one fixed update, seconds.
    pub const TICK_S: f64 = 0.02;

    /// The start of a run.
    pub const ZERO: Self = Self(0);

    /// Sim time at this tick, nanoseconds since the start. Stays at `u64::MAX` where it would be
    /// larger (584 years).
    ///
    /// ```
    /// assert_eq!(msgs::ids::Tick(50).time_ns(), 1_000_000_000);
    /// ```
    pub const fn time_ns(self) -> u64 {
        self.0.saturating_mul(Self::TICK_NS)
    }

    /// Sim time in seconds, rounded once.
    pub fn time_s(self) -> f64 {
        self.0 as f64 / (1e9 / Self::TICK_NS as f64)
    }

    /// The tick so many ticks after this one, or the last one that a `u64` holds.
    pub const fn after(self, ticks: u64) -> Self {
        Self(self.0.saturating_add(ticks))
    }

    /// The tick after this one. The last tick that a `u64` holds is its own successor.
    pub const fn next(self) -> Tick {
        Tick(self.0.saturating_add(1))
    }
}

impl fmt::Display for Tick {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::builtin_interfaces::Time;

    #[test]
    fn time_is_exact() {
        assert_eq!(Tick(0).time_ns(), 0);
        assert_eq!(Tick(90_000).time_ns(), 1_800_000_000_000);
        assert_eq!(Time::from(Tick(0)), Time { sec: 0, nanosec: 0 });
        assert_eq!(Time::from(Tick(49)), Time { sec: 0, nanosec: 980_000_000 });
        assert_eq!(Time::from(Tick(90_001)), Time { sec: 1800, nanosec: 20_000_000 });
    }

    #[test]
    fn the_end_of_the_numbers_is_no_panic() {
        assert_eq!(Tick(u64::MAX).time_ns(), u64::MAX);
        assert_eq!(Tick(u64::MAX).next(), Tick(u64::MAX));
        assert_eq!(Time::from(Tick(u64::MAX)).sec, i32::MAX);
    }

    #[test]
    fn displayed_as_bare_numbers() {
        assert_eq!(format!("{}/{:>4}", AgentId(7), Tick(20)), "7/  20");
    }
}
