//! Playing a recording: which message is due when.
//!
//! [`PlaybackSchedule`] says what of a recording is played, [`PlaybackCursor`] gives it out tick by tick, [`LatchedCache`] keeps what late readers have to
//! be told, and [`Player`] says which tick comes when: by its rate, by pauses and steps, and over and over again.
//!
//! Invariants: messages come out in the order of the file, each in the tick of its stamp; what comes out is what stands in the
//! file, byte for byte; pauses, steps and the rate change when something comes, and nothing else.
//!
//! This module knows no transport and no clock: the wall time is an argument, nanoseconds since some moment. `ros/replay.rs`
//! publishes.

mod cursor;
mod latched_cache;
mod schedule;

#[cfg(test)]
mod tests;

use msgs::ids::Tick;
use msgs::simulation_interfaces::SimulatorFeatures;

use crate::control::{Request, SimulationControl};
use simulation::scenario::Rtf;

pub use cursor::{PlaybackCursor, ScheduledMessage};
pub use latched_cache::LatchedCache;
pub use schedule::{PlaybackOptions, PlaybackSchedule, ReplayError};

/// How a recording is played.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlaybackTiming {
    /// Sim seconds for each second of wall time, at the most.
    pub rate: Rtf,
    /// Whether it begins again after its end.
    pub is_loop: bool,
    /// Whether it waits at its beginning.
    pub is_paused: bool,
}

/// What a replay can do, and nothing else.
#[must_use]
pub fn features() -> SimulatorFeatures {
    SimulatorFeatures {
        features: vec![
            SimulatorFeatures::SIMULATION_STATE_GETTING,
            SimulatorFeatures::SIMULATION_STATE_SETTING,
            SimulatorFeatures::SIMULATION_STATE_PAUSE,
            SimulatorFeatures::STEP_SIMULATION_SINGLE,
            SimulatorFeatures::STEP_SIMULATION_MULTIPLE,
            SimulatorFeatures::STEP_SIMULATION_ACTION,
        ],
        spawn_formats: Vec::new(),
        custom_info: "a recording is played: a step is a tick of 20 ms of sim time, and nothing can be changed"
            .to_owned(),
    }
}

/// What is to be done now.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PlayerAction {
    /// Say what belongs to this tick.
    Play(Tick),
    /// Wait for so long, wall time in ns, or until somebody asks something.
    Wait(u64),
    /// Wait until somebody asks something: time stands still.
    Idle,
    /// Go back to the beginning, and ask again.
    Rewind,
    /// Everything has been played, or somebody has asked for the end.
    End,
}

/// Says which tick comes when.
pub struct Player {
    control: SimulationControl,
    first: Tick,
    last: Tick,
    next: Tick,
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
        Self { control, first, last, next: first, is_loop: timing.is_loop, sim_ticks: 0 }
    }

    /// What is to be done now. At the end of the recording a replay that does not play waits, so that one can look at the end.
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
        match self.control.wait_ns(self.next, wall_ns) {
            Some(wait_ns) => PlayerAction::Wait(wait_ns),
            None => PlayerAction::Play(self.next),
        }
    }

    /// The tick that was to be played has been, and the clock has told of it.
    pub fn played(&mut self) {
        self.sim_ticks += u64::from(self.next > self.first);
        self.next = self.next.next();
        self.control.ticked();
        self.control.report_steps();
    }

    /// Answers a request; nobody can ask for anything that a replay does not offer.
    pub fn answer(&mut self, request: Request, wall_ns: u64) {
        drop(self.control.answer(request, self.next, wall_ns));
    }

    /// Answers whoever waits for steps that will not be made any more.
    pub fn end(&mut self) {
        self.control.end_steps("the replay has ended");
    }

    /// How far it is: the tick that was played last, or the first one.
    #[must_use]
    pub fn position(&self) -> Tick {
        Tick(self.next.0.saturating_sub(1)).max(self.first)
    }

    /// Whether somebody has asked for the end.
    #[must_use]
    pub fn is_quitting(&self) -> bool {
        self.control.is_quitting()
    }

    /// Sim time that has passed, ticks: what is played again counts again.
    #[must_use]
    pub fn sim_ticks(&self) -> u64 {
        self.sim_ticks
    }
}
