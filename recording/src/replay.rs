//! Scheduling of a replay: which recorded message is due when.
//!
//! [`PlaybackSchedule`] selects topics and ticks, [`PlaybackCursor`] yields the messages tick by
//! tick, [`LatchedCache`] holds what late readers of latched topics need, and [`Player`] decides
//! which tick is due, given rate, pauses, steps and looping.
//!
//! Invariants: messages come in the tick of their stamp, those of a tick in the order of the file,
//! byte for byte as recorded; pauses, steps and the rate affect only their timing. A stamp after
//! the duration of the run is refused, and long gaps are skipped, so that no stamp can make a
//! replay endless.
//!
//! This module knows no transport and no clock: wall time is an argument, in nanoseconds since an
//! arbitrary epoch. The crate `sim_server` publishes what is due.

mod cursor;
mod latched_cache;
mod schedule;

#[cfg(test)]
mod tests;

use msgs::ids::Tick;
use msgs::simulation_interfaces::SimulatorFeatures;

use simulation::scenario::Rtf;
use transport::control::{Request, SimulationControl};

pub use cursor::{PlaybackCursor, ScheduledMessage};
pub use latched_cache::LatchedCache;
use schedule::Gap;
pub use schedule::{PlaybackOptions, PlaybackSchedule, ReplayError};

/// Rate and mode of a replay.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlaybackTiming {
    /// Maximum sim seconds per second of wall time.
    pub rate: Rtf,
    /// Whether it restarts after its end.
    pub is_loop: bool,
    /// Whether it starts paused.
    pub is_paused: bool,
}

/// The features of `GetSimulatorFeatures` that a replay supports.
#[must_use]
pub fn features() -> SimulatorFeatures {
    SimulatorFeatures {
        features: [
            SimulatorFeatures::SIMULATION_STATE_GETTING,
            SimulatorFeatures::SIMULATION_STATE_SETTING,
            SimulatorFeatures::SIMULATION_STATE_PAUSE,
            SimulatorFeatures::STEP_SIMULATION_SINGLE,
            SimulatorFeatures::STEP_SIMULATION_MULTIPLE,
            SimulatorFeatures::STEP_SIMULATION_ACTION,
        ]
        .map(u16::from)
        .to_vec(),
        spawn_formats: Vec::new(),
        custom_info: "replay of a recording: a step is a tick of 20 ms of sim time, and nothing can be changed"
            .to_owned(),
    }
}

/// The next action of a replay.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PlayerAction {
    /// Publish the messages of this tick.
    Play(Tick),
    /// Wait this long, wall time in ns, or until a request arrives.
    Wait(u64),
    /// Wait for a request: the replay is paused.
    Idle,
    /// Restart the cursor, then ask for the next action.
    Rewind,
    /// The replay has ended or was asked to quit.
    End,
}

/// Decides which tick is due when.
pub struct Player {
    control: SimulationControl,
    first: Tick,
    last: Tick,
    next: Tick,
    gaps: Vec<Gap>,
    /// Whether the next tick comes after a gap.
    has_skipped: bool,
    is_loop: bool,
    sim_ticks: u64,
}

impl Player {
    /// Plays the ticks of a schedule; the first one is due at `wall_ns`.
    #[must_use]
    pub fn new(schedule: &PlaybackSchedule, timing: PlaybackTiming, wall_ns: u64) -> Self {
        let (first, last) = schedule.ticks();
        let mut control = SimulationControl::new(timing.is_paused, timing.rate, features());
        control.restart_pacing(first, wall_ns);
        let gaps = schedule.gaps().to_vec();
        Self { control, first, last, next: first, gaps, has_skipped: false, is_loop: timing.is_loop, sim_ticks: 0 }
    }

    /// The next action. At the end of the recording, a paused replay stays open.
    pub fn next_action(&mut self, wall_ns: u64) -> PlayerAction {
        if self.control.is_quitting() {
            return PlayerAction::End;
        }
        if !self.control.may_tick() {
            return PlayerAction::Idle;
        }
        if self.next > self.last {
            if self.is_loop {
                // The last tick lasts as long as any other.
                if let Some(wait_ns) = self.control.wait_ns(self.next, wall_ns) {
                    return PlayerAction::Wait(wait_ns);
                }
                self.next = self.first;
                self.control.restart_pacing(self.first, wall_ns);
                return PlayerAction::Rewind;
            }
            if self.control.is_stepping() {
                self.control.end_steps("the recording is at its end");
                return PlayerAction::Idle;
            }
            return PlayerAction::End;
        }
        if std::mem::take(&mut self.has_skipped) {
            self.control.restart_pacing(self.next, wall_ns);
        }
        match self.control.wait_ns(self.next, wall_ns) {
            Some(wait_ns) => PlayerAction::Wait(wait_ns),
            None => PlayerAction::Play(self.next),
        }
    }

    /// Call after the tick was published, the clock included.
    pub fn played(&mut self) {
        self.sim_ticks += u64::from(self.next > self.first);
        self.next = self.next.next();
        let after = self.gaps.partition_point(|gap| gap.to <= self.next);
        if let Some(gap) = self.gaps.get(after).filter(|gap| gap.from < self.next) {
            (self.next, self.has_skipped) = (gap.to, true);
        }
        self.control.ticked();
        self.control.report_steps();
    }

    /// Answers a request; the services of a replay offer no others.
    pub fn answer(&mut self, request: Request, wall_ns: u64) {
        drop(self.control.answer(request, self.next, wall_ns));
    }

    /// Ends pending steps with an error.
    pub fn end(&mut self) {
        self.control.end_steps("the replay has ended");
    }

    /// The tick played last, or the first one; behind a gap the last tick of the gap.
    #[must_use]
    pub fn position(&self) -> Tick {
        Tick(self.next.0.saturating_sub(1)).clamp(self.first, self.last)
    }

    /// Whether quitting was requested.
    #[must_use]
    pub fn is_quitting(&self) -> bool {
        self.control.is_quitting()
    }

    /// Sim time that has passed, in ticks, over all rounds of a loop.
    #[must_use]
    pub fn sim_ticks(&self) -> u64 {
        self.sim_ticks
    }
}
