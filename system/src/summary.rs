//! The result of a run for the program that has started the server: a small JSON file.

use std::fs;
use std::io;
use std::path::Path;
use std::time::Duration;

use serde::{Deserialize, Serialize};

/// What `sim_server run --summary FILE.json` writes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// The digest of the run, 64 hexadecimal digits.
    pub digest: String,
    /// Why the run has ended.
    pub reason: String,
    /// The last tick; 50 are a second of sim time.
    pub tick: u64,
    /// Wall time between the first tick and the last, seconds.
    pub wall_s: f64,
    /// Agent processes that have started themselves again because their start stalled.
    #[serde(default)]
    pub restarted_processes: usize,
    /// Area of the walls around what the team has seen, m^2; missing in files of earlier builds.
    #[serde(default)]
    pub explored_m2: Option<f64>,
}

impl Summary {
    /// Wall time between the first tick and the last.
    #[must_use]
    pub fn wall(&self) -> Duration {
        Duration::try_from_secs_f64(self.wall_s).unwrap_or_default()
    }

    /// Writes it under a temporary name, which is then renamed: a reader finds all of it or
    /// nothing.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write(&self, file: &Path) -> io::Result<()> {
        let mut name = file.file_name().unwrap_or_default().to_owned();
        name.push(".tmp");
        let temporary = file.with_file_name(name);
        fs::write(&temporary, serde_json::to_string_pretty(self)? + "\n")?;
        fs::rename(&temporary, file)
    }

    /// Reads it, if it is there.
    #[must_use]
    pub fn read(file: &Path) -> Option<Self> {
        serde_json::from_slice(&fs::read(file).ok()?).ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("summary.json");
        assert_eq!(Summary::read(&file), None);
        let (digest, reason) = ("0f".repeat(32), "duration".to_owned());
        let summary = Summary { digest, reason, tick: 7, wall_s: 1.25, restarted_processes: 1, explored_m2: Some(2.5) };
        summary.write(&file).unwrap();
        assert_eq!(Summary::read(&file), Some(summary.clone()));
        assert_eq!(summary.wall(), Duration::from_millis(1250));
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
