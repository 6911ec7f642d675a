//! Verification of a recording by re-executing its run: everything that follows from its map,
//! commands and interventions is compared with what it holds.
//!
//! Invariants: a recording that is damaged or has no end is checked up to its last complete tick,
//! which is less than the whole ([`Verified::lack`]); an unchanged recording of this build
//! verifies.
//!
//! This proves that the world has answered the recorded commands as it had to, and not who has
//! given them: a command is an input of the run. One that was changed in the file shows in its
//! consequences, in the next digest at the latest; one that a stranger has sent during the run does
//! not. [`controllers`] finds both, because it lets the agents decide again.

pub mod controllers;

use std::sync::atomic::AtomicBool;

use msgs::ids::Tick;
use msgs::printable;
use thiserror::Error;

use crate::session::{self, Mode, NullObserver, NullTransport, RecordingSinks, RunConfig, RunError};
use crate::setup::{self, SetupError};
use recording::comparison::{Checker, Comparison, Difference};
use recording::playback::{Playback, PlaybackError};
use recording::{End, Recording};
use simulation::digest::Digest;
use simulation::end_reason::EndReason;

/// A verified recording.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Verified {
    /// Re-executed ticks.
    pub ticks: Tick,
    /// Number of equal messages.
    pub messages: u64,
    /// Number of messages for observers, which were not compared.
    pub left_out: u64,
    /// Digest after these ticks.
    pub digest: Digest,
    /// Reason of the result, if the recording has one.
    pub reason: Option<EndReason>,
    /// Where the file ends.
    pub end: End,
}

impl Verified {
    /// Why this is less than a run that was verified up to its recorded end; `None` if it is not.
    /// A file that is cut is enough if `up_to_cut`.
    #[must_use]
    pub fn lack(&self, up_to_cut: bool) -> Option<String> {
        let ticks = self.ticks;
        match &self.end {
            end @ End::Damage { .. } => Some(format!("{end}; verified up to tick {ticks}")),
            end if ticks == Tick::ZERO => Some(match end {
                End::Whole => "it has no tick, so that nothing was verified".to_owned(),
                end => format!("{end}, before the end of the first tick, so that nothing was verified"),
            }),
            _ if up_to_cut => None,
            End::Whole if self.reason.is_some() => None,
            end => {
                let end = if *end == End::Whole { "without a result".to_owned() } else { end.to_string() };
                Some(format!("{end}; verified up to tick {ticks}, which is enough with --up-to-cut"))
            }
        }
    }
}

/// Why a recording does not verify.
#[derive(Debug, Error)]
pub enum VerifyError {
    /// Its scenario is not legal, or it has no map.
    #[error(transparent)]
    Scenario(Box<SetupError>),
    /// Its world cannot be made.
    #[error("{file}: {source}")]
    World { file: String, source: Box<SetupError> },
    /// A message cannot be decoded.
    #[error(transparent)]
    Playback(#[from] PlaybackError),
    /// It holds another message than re-execution yields.
    #[error("{file}: {difference}{}", file_end(end))]
    Different {
        file: String,
        /// The first difference.
        difference: Box<Difference>,
        /// Where the file ends.
        end: End,
    },
    /// Its run cannot be re-executed.
    #[error("{file}: {source}{}", file_end(end))]
    Run {
        file: String,
        source: Box<RunError>,
        /// Where the file ends.
        end: End,
    },
}

impl VerifyError {
    /// The tick up to which everything holds, if known.
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

/// A note on the end of a file that is not whole.
fn file_end(end: &End) -> String {
    match end {
        End::Whole => String::new(),
        end => format!(" (the file is {end})"),
    }
}

/// Verifies a recording.
///
/// # Errors
/// If it does not verify, or cannot be checked.
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
    let end = playback.end().clone();
    let mut comparison = Comparison::new(recording);
    let stop = AtomicBool::new(false);
    let outcome = RunConfig::new(&scenario, Mode::Verify(playback, &mut comparison)).and_then(|config| {
        session::run(config, world, &mut NullTransport, RecordingSinks::default(), &mut NullObserver, &stop)
    });
    if outcome.is_ok() && !comparison.is_done() {
        comparison.end();
    }
    // A difference precedes the error that follows from it.
    if let Some(difference) = comparison.difference() {
        return Err(VerifyError::Different { file: file(), difference: Box::new(difference.clone()), end });
    }
    match outcome {
        Ok(outcome) => Ok(Verified {
            ticks: Tick(outcome.result.tick),
            messages: comparison.compared(),
            left_out: comparison.left_out(),
            digest: outcome.digest,
            reason,
            end,
        }),
        Err(source) => Err(VerifyError::Run { file: file(), source: Box::new(source), end }),
    }
}

/// The report for the user, without the digest.
#[must_use]
pub fn text(verified: &Verified) -> String {
    let Verified { ticks, messages, left_out, reason, .. } = verified;
    let ending = match reason {
        Some(reason) => format!("up to the end of the run: {}", printable::line(reason.text())),
        None => "up to the end of the file, before the end of the run".to_owned(),
    };
    let mut text = format!("verified {ticks} ticks and {messages} messages, {ending}");
    if *left_out > 0 {
        text +=
            &format!("\n{left_out} messages of views.record, such as poses and maps for observers, were not compared");
    }
    match &verified.end {
        End::Whole => text,
        end => format!("{text}\nthe file is {}", printable::line(&end.to_string())),
    }
}
