//! Playing a recording: which message is due when.
//!
//! [`Programme`] says what of a recording is played, [`Pass`] gives it out tick by tick, [`Shelf`] keeps what late readers have to
//! be told, and [`Player`] says which tick comes when: by its rate, by pauses and steps, and over and over again.
//!
//! Invariants: messages come out in the order of the file, each in the tick of its stamp; what comes out is what stands in the
//! file, byte for byte; pauses, steps and the rate change when something comes, and nothing else.
//!
//! This module knows no transport and no clock: the wall time is an argument, nanoseconds since some moment. `ros/replay.rs`
//! publishes.

mod pass;
mod programme;
mod shelf;

#[cfg(test)]
mod tests;

use msgs::ids::Tick;
use msgs::simulation_interfaces::SimulatorFeatures;

use crate::control::Request;
use crate::control::desk::Desk;
use simulation::scenario::Rtf;

pub use pass::{Cue, Pass};
pub use programme::{Programme, ReplayError, Wishes};
pub use shelf::Shelf;

/// How a recording is played.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Manner {
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
pub enum Turn {
    /// Say what belongs to this tick.
    Play(Tick),
    /// Wait for so long, wall time in ns, or until somebody asks something.
    Wait(u64),
    /// Wait until somebody asks something: time stands still.
    Rest,
    /// Go back to the beginning, and ask again.
    Rewind,
    /// Everything has been played, or somebody has asked for the end.
    End,
}

/// Says which tick comes when.
pub struct Player {
    desk: Desk,
    first: Tick,
    last: Tick,
    next: Tick,
    is_loop: bool,
    sim_ticks: u64,
}

impl Player {
    /// Plays the ticks of a programme; the first one is due at `wall_ns`.
    #[must_use]
    pub fn new(programme: &Programme, manner: Manner, wall_ns: u64) -> Self {
        let (first, last) = programme.ticks();
        let mut desk = Desk::new(manner.is_paused, manner.rate, features());
        desk.go_on(first, wall_ns);
        Self { desk, first, last, next: first, is_loop: manner.is_loop, sim_ticks: 0 }
    }

    /// What is to be done now. At the end of the recording a replay that does not play waits, so that one can look at the end.
    pub fn turn(&mut self, wall_ns: u64) -> Turn {
        if self.desk.is_quitting() {
            return Turn::End;
        }
        if !self.desk.control().may_tick() {
            return Turn::Rest;
        }
        if self.next > self.last {
            if self.is_loop {
                // The last tick lasts as long as any other.
                if let Some(wait_ns) = self.desk.wait_ns(self.next, wall_ns) {
                    return Turn::Wait(wait_ns);
                }
                self.next = self.first;
                self.desk.go_on(self.first, wall_ns);
                return Turn::Rewind;
            }
            if self.desk.control().is_stepping() {
                self.desk.end_steps("the recording is at its end");
                return Turn::Rest;
            }
            return Turn::End;
        }
        match self.desk.wait_ns(self.next, wall_ns) {
            Some(wait_ns) => Turn::Wait(wait_ns),
            None => Turn::Play(self.next),
        }
    }

    /// The tick that was to be played has been, and the clock has told of it.
    pub fn played(&mut self) {
        self.sim_ticks += u64::from(self.next > self.first);
        self.next = self.next.next();
        self.desk.ticked();
        self.desk.steps_are_visible();
    }

    /// Answers a request; nobody can ask for anything that a replay does not offer.
    pub fn answer(&mut self, request: Request, wall_ns: u64) {
        drop(self.desk.answer(request, self.next, wall_ns));
    }

    /// Answers whoever waits for steps that will not be made any more.
    pub fn end(&mut self) {
        self.desk.end_steps("the replay has ended");
    }

    /// How far it is: the tick that was played last, or the first one.
    #[must_use]
    pub fn position(&self) -> Tick {
        Tick(self.next.0.saturating_sub(1)).max(self.first)
    }

    /// Whether somebody has asked for the end.
    #[must_use]
    pub fn is_quitting(&self) -> bool {
        self.desk.is_quitting()
    }

    /// Sim time that has passed, ticks: what is played again counts again.
    #[must_use]
    pub fn sim_ticks(&self) -> u64 {
        self.sim_ticks
    }
}
