//! Checks a recording by carrying out its run again: everything that comes of its map, commands and interventions is compared with
//! what it holds.
//!
//! Invariants: a recording that is damaged or has no end is checked up to the last tick that it has in whole; what was recorded by
//! this build and was not changed since holds.
//!
//! A command is an input of the run: that one was changed shows in what comes of it, in the next digest at the latest. Whether the
//! agents decide so is asked by [`controllers`].

pub mod controllers;

use std::sync::atomic::AtomicBool;

use msgs::ids::Tick;
use thiserror::Error;

use crate::comparison::{Comparison, Difference};
use crate::playback::{Playback, PlaybackError};
use crate::recording::{End, Recording};
use crate::session::{self, Checker, Mode, NullObserver, NullTransport, RecordingSinks, RunConfig, RunError};
use crate::setup::{self, SetupError};
use simulation::digest::Digest;

/// What was found to hold.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Verified {
    /// The ticks from the start on that were made again.
    pub ticks: Tick,
    /// How many messages are the same.
    pub messages: u64,
    /// The digest after these ticks.
    pub digest: Digest,
    /// Why the run has ended, if the recording has its result.
    pub reason: Option<String>,
    /// Where the file has ended.
    pub end: End,
}

/// Why a recording does not hold, or cannot be checked.
#[derive(Debug, Error)]
pub enum VerifyError {
    /// It says no scenario that there can be, or has no map.
    #[error(transparent)]
    Scenario(Box<SetupError>),
    /// There is no such world.
    #[error("{file}: {source}")]
    World {
        /// The recording.
        file: String,
        /// What is wrong.
        source: Box<SetupError>,
    },
    /// A message cannot be read.
    #[error(transparent)]
    Playback(#[from] PlaybackError),
    /// It holds something else than what comes of it.
    #[error("{file}: {difference}{}", said(end))]
    Different {
        /// The recording.
        file: String,
        /// The first message that is different.
        difference: Box<Difference>,
        /// Where the file has ended.
        end: End,
    },
    /// Its run cannot be carried out again.
    #[error("{file}: {source}{}", said(end))]
    Run {
        /// The recording.
        file: String,
        /// Why not.
        source: Box<RunError>,
        /// Where the file has ended.
        end: End,
    },
}

impl VerifyError {
    /// The tick before which everything holds, if that is known.
    #[must_use]
    pub fn tick(&self) -> Option<Tick> {
        match self {
            Self::Different { difference, .. } => Some(difference.tick),
            Self::Run { source, .. } => match **source {
                RunError::OtherRun { tick, .. } => Some(tick),
                _ => None,
            },
            Self::Scenario(_) | Self::World { .. } | Self::Playback(_) => None,
        }
    }
}

/// What is said about the end of a file, if there is something to say.
fn said(end: &End) -> String {
    match end {
        End::Whole => String::new(),
        end => format!(" (the file is {end})"),
    }
}

/// Checks a recording.
///
/// # Errors
/// If it does not hold, or cannot be checked.
pub fn verify(recording: &Recording) -> Result<Verified, VerifyError> {
    let file = || recording.file().to_owned();
    let scenario =
        setup::load_recorded(recording, None, &[]).map_err(|error| VerifyError::Scenario(Box::new(error)))?;
    let (world, _report) = setup::rebuild(recording, &scenario).map_err(|error| match error {
        SetupError::NoMap { .. } => VerifyError::Scenario(Box::new(error)),
        error => VerifyError::World { file: file(), source: Box::new(error) },
    })?;
    let playback = Playback::new(recording)?;
    let reason = playback.ending().map(|ending| ending.reason.clone());
    let end = end_of(recording);
    let mut comparison = Comparison::new(recording);
    let stop = AtomicBool::new(false);
    let outcome = RunConfig::new(&scenario, Mode::Verify(playback, &mut comparison)).and_then(|config| {
        session::run(config, world, &mut NullTransport, RecordingSinks::default(), &mut NullObserver, &stop)
    });
    if outcome.is_ok() && !comparison.is_done() {
        comparison.end();
    }
    // What is found first comes first: an error is of what comes of it.
    if let Some(difference) = comparison.difference() {
        return Err(VerifyError::Different { file: file(), difference: Box::new(difference.clone()), end });
    }
    match outcome {
        Ok(outcome) => Ok(Verified {
            ticks: Tick(outcome.result.tick),
            messages: comparison.compared(),
            digest: outcome.digest,
            reason,
            end,
        }),
        Err(source) => Err(VerifyError::Run { file: file(), source: Box::new(source), end }),
    }
}

/// Where a file ends that was read to its end.
fn end_of(recording: &Recording) -> End {
    let mut messages = recording.messages();
    messages.by_ref().for_each(drop);
    messages.end().cloned().unwrap_or(End::Missing)
}

/// What people are told; the last line, the digest, comes by itself.
#[must_use]
pub fn text(verified: &Verified) -> String {
    let Verified { ticks, messages, reason, .. } = verified;
    let ending = match reason {
        Some(reason) => format!("up to the end of the run: {reason}"),
        None => "up to where the recording leaves off, before the end of its run".to_owned(),
    };
    let text = format!("verified {ticks} ticks and {messages} messages, {ending}");
    match &verified.end {
        End::Whole => text,
        end => format!("{text}\nthe file is {end}"),
    }
}
