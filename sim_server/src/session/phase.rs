//! The phases of the loop of a run, and how long they take.
//!
//! Invariants: each moment between the start of the clock and the end of the last phase belongs to
//! one phase; no clock is read here.

use std::time::{Duration, Instant};

/// A phase of the loop of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Phase {
    /// Waiting for the real-time factor, and for requests while the clock is held.
    Pace,
    /// What is recorded besides observations and commands: poses, digest, progress.
    State,
    /// Publishing to observers, events, reports.
    Publish,
    /// Casting the scans of a tick, or handing them to helpers.
    Scan,
    /// Contacts, waiting for scans, and making observations.
    Observe,
    /// Signing and sending observations.
    Send,
    /// Waiting for the agents; those in this process learn, decide and share.
    Agents,
    /// Encoding and recording observations and commands.
    Record,
    /// Radio, bodies and the digest.
    Move,
}

impl Phase {
    pub const ALL: [Self; 9] = [
        Self::Pace,
        Self::State,
        Self::Publish,
        Self::Scan,
        Self::Observe,
        Self::Send,
        Self::Agents,
        Self::Record,
        Self::Move,
    ];

    /// What it is called in profiles.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Pace => "pace",
            Self::State => "record state",
            Self::Publish => "publish",
            Self::Scan => "scan",
            Self::Observe => "contacts and observations",
            Self::Send => "send",
            Self::Agents => "agents",
            Self::Record => "record",
            Self::Move => "radio and bodies",
        }
    }
}

/// The wall time of each phase.
#[derive(Debug, Clone, Default)]
pub struct PhaseTimes {
    /// When the clock started, and when the last phase ended; `None` while nothing is measured.
    clock: Option<(Instant, Instant)>,
    sums: [Duration; Phase::ALL.len()],
}

impl PhaseTimes {
    /// Starts the clock anew: the next phase begins now, and none has taken any time.
    pub fn start(&mut self, now: Instant) {
        *self = Self { clock: Some((now, now)), ..Self::default() };
    }

    /// Stops the clock; the times stay.
    pub fn stop(&mut self) {
        self.clock = None;
    }

    /// Whether phases are measured.
    #[must_use]
    pub fn is_running(&self) -> bool {
        self.clock.is_some()
    }

    /// When the clock started.
    #[must_use]
    pub fn started(&self) -> Option<Instant> {
        self.clock.map(|(started, _)| started)
    }

    /// Notes the end of a phase, and returns when it began and how long it took; nothing while the
    /// clock is stopped.
    pub fn end(&mut self, phase: Phase, now: Instant) -> Option<(Instant, Duration)> {
        let (_, last) = self.clock.as_mut()?;
        let start = std::mem::replace(last, now);
        let duration = now.duration_since(start);
        self.sums[phase as usize] += duration;
        Some((start, duration))
    }

    /// Time between the start of the clock and the end of the last phase.
    #[must_use]
    pub fn total(&self) -> Duration {
        self.clock.map_or(Duration::ZERO, |(started, last)| last.duration_since(started))
    }

    /// Time of a phase.
    #[must_use]
    pub fn of(&self, phase: Phase) -> Duration {
        self.sums[phase as usize]
    }
}
