//! The position of a run as seen from outside: the last stamp of its growing recording,
//! extrapolated by the real-time factor. It times faults; no verdict depends on it.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use recording::Recording;

use system::wall_clock::now;

/// Wall time between two reads of the recording.
const READ_PERIOD: Duration = Duration::from_millis(150);

/// Longest extrapolation, wall time: a server saves its recording twice a second.
const EXTRAPOLATION_MAX: Duration = Duration::from_millis(600);

/// Watches a recording.
#[derive(Debug)]
pub(super) struct Watch {
    file: PathBuf,
    /// Real-time factor.
    rtf: f64,
    /// The last stamp, seconds, and when it was first seen.
    seen: Option<(f64, Instant)>,
    read_at: Option<Instant>,
}

impl Watch {
    pub(super) fn new(file: &Path, rtf: f64) -> Self {
        Self { file: file.to_owned(), rtf, seen: None, read_at: None }
    }

    /// The approximate position, seconds of sim time; `None` before the first tick.
    pub(super) fn position_s(&mut self) -> Option<f64> {
        if self.read_at.is_none_or(|read_at| read_at.elapsed() >= READ_PERIOD) {
            self.read_at = Some(now());
            let stamp = last_stamp_s(&self.file);
            if let Some(stamp) = stamp
                && self.seen.is_none_or(|(seen, _)| stamp > seen)
            {
                self.seen = Some((stamp, now()));
            }
        }
        self.seen.map(|(stamp, since)| stamp + self.rtf * since.elapsed().min(EXTRAPOLATION_MAX).as_secs_f64())
    }
}

fn last_stamp_s(file: &Path) -> Option<f64> {
    // There is no file before the first tick.
    let recording = Recording::open(file).ok()?;
    recording.messages().map(|message| message.time_ns).max().map(|time_ns| time_ns as f64 * 1e-9)
}
