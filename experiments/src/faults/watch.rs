//! How far a run is, from outside: what its growing recording says, and the pace since then.
//!
//! It says where a fault comes, and nothing else: no verdict hangs on it.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use sim_server::recording::Recording;

use crate::processes::now;

/// Wall time between two looks into the recording.
const LOOK_PERIOD: Duration = Duration::from_millis(150);

/// Wall time for which a run is believed to go on at its pace without a word of it: a server saves
/// its recording twice a second.
const TRUST: Duration = Duration::from_millis(600);

/// Watches a recording.
#[derive(Debug)]
pub(super) struct Watch {
    file: PathBuf,
    /// Sim seconds for each second of wall time.
    pace: f64,
    /// The last stamp that was seen, seconds, and when it was new.
    seen: Option<(f64, Instant)>,
    looked: Option<Instant>,
}

impl Watch {
    pub(super) fn new(file: &Path, pace: f64) -> Self {
        Self { file: file.to_owned(), pace, seen: None, looked: None }
    }

    /// About how far the run is, seconds of sim time; nothing if it has not begun.
    pub(super) fn position_s(&mut self) -> Option<f64> {
        if self.looked.is_none_or(|looked| looked.elapsed() >= LOOK_PERIOD) {
            self.looked = Some(now());
            let stamp = last_stamp_s(&self.file);
            if let Some(stamp) = stamp
                && self.seen.is_none_or(|(seen, _)| stamp > seen)
            {
                self.seen = Some((stamp, now()));
            }
        }
        self.seen.map(|(stamp, since)| stamp + self.pace * since.elapsed().min(TRUST).as_secs_f64())
    }
}

fn last_stamp_s(file: &Path) -> Option<f64> {
    // It is not there before the run begins.
    let recording = Recording::open(file).ok()?;
    recording.messages().map(|message| message.time_ns).max().map(|time_ns| time_ns as f64 * 1e-9)
}
