//! A run of a plan over ROS 2: the launch script in a domain of its own, and the row from its recording.

use std::fs::File;
use std::path::PathBuf;
use std::process::{Child, ExitStatus};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use msgs::ids::Tick;
use sim_server::exit;
use sim_server::info::{self, Info};

use super::{RunFailure, machine};
use crate::measure::{self, Trace};
use crate::plan::PlannedRun;
use crate::processes::{in_domain, pause, signal};
use crate::rows::RunRecord;

/// What the last lines of a server say before its wall time, in seconds.
const WALL_TIME: &str = "wall time ";

/// How processes are started.
#[derive(Debug, Clone)]
pub struct Launcher {
    /// `launch_scripts/run.sh`.
    pub script: PathBuf,
    /// The folder of the binaries.
    pub binaries: PathBuf,
    /// ROS domain of the first job; the others have the next ones.
    pub first_domain: u32,
}

impl Launcher {
    /// Carries out a run in the domain of a job.
    pub(super) fn carry_out(&self, run: &PlannedRun, job: usize, stop: &AtomicBool) -> Result<RunRecord, RunFailure> {
        let failed = |what: &str, error: &dyn std::fmt::Display| RunFailure::Failed(format!("{what}: {error}"));
        let folder = tempfile::tempdir().map_err(|error| failed("a folder for temporary files", &error))?;
        let [scenario, recording, said, complaints] =
            ["scenario.toml", "run.mcap", "said", "complaints"].map(|name| folder.path().join(name));
        let put = |file: &PathBuf| File::create(file).map_err(|error| failed(&file.display().to_string(), &error));
        std::fs::write(&scenario, run.scenario.to_toml())
            .map_err(|error| failed(&scenario.display().to_string(), &error))?;
        let child = in_domain(&self.script, self.first_domain + job as u32)
            .arg(&scenario)
            .arg("--record")
            .arg(&recording)
            .arg("--logs")
            .arg(folder.path().join("logs"))
            .env("MAES_BIN_DIR", &self.binaries)
            .stdout(put(&said)?)
            .stderr(put(&complaints)?)
            .spawn()
            .map_err(|error| failed(&self.script.display().to_string(), &error))?;
        let status = wait(child, stop).map_err(|error| failed("waiting for the run", &error))?;
        if stop.load(Ordering::Relaxed) || status.code() == Some(exit::BY_SIGNAL.into()) {
            return Err(RunFailure::Interrupted);
        }
        let text = |file: &PathBuf| std::fs::read_to_string(file).unwrap_or_default();
        if !status.success() {
            let complaints = text(&complaints);
            let last = complaints.lines().rfind(|line| line.starts_with("error")).or(complaints.lines().last());
            return Err(RunFailure::Failed(format!("{status}: {}", last.unwrap_or("nothing was said"))));
        }
        let wall =
            wall_time(&text(&said)).ok_or(RunFailure::Failed("the server did not say its wall time".to_owned()))?;
        let info = info::read(&recording).map_err(|error| RunFailure::Failed(error.to_string()))?;
        let Info { announced: Some(told), result: Some(result), progress, .. } = info else {
            return Err(RunFailure::Failed("the recording has no end".to_owned()));
        };
        let wall = measure::wall_row(Tick(result.tick), wall, &[], &machine());
        Ok(measure::record(run, Trace { size: told.size, progress: &progress, result: &result, wall }))
    }
}

/// Waits for the end of a process; asks it to end once `stop` is set.
fn wait(mut child: Child, stop: &AtomicBool) -> std::io::Result<ExitStatus> {
    let mut is_asked = false;
    loop {
        if let Some(status) = child.try_wait()? {
            return Ok(status);
        }
        if stop.load(Ordering::Relaxed) && !is_asked {
            is_asked = true;
            // The script tells the processes it has started.
            signal(&child, "TERM")?;
        }
        pause();
    }
}

/// The wall time in what a server has said.
fn wall_time(said: &str) -> Option<Duration> {
    let line = said.lines().rev().find_map(|line| line.strip_prefix(WALL_TIME))?;
    let seconds: f64 = line.split_whitespace().next()?.parse().ok()?;
    Duration::try_from_secs_f64(seconds).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_the_wall_time_in_what_a_server_says() {
        let said = "a table\nwall time 12.25 s, 146.9 x real time\ndigest: 00\n";
        assert_eq!(wall_time(said), Some(Duration::from_millis(12_250)));
        assert_eq!(wall_time("digest: 00\n"), None);
    }
}
