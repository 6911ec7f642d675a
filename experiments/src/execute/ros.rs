//! A run of a plan over ROS 2: its processes in a domain of their own, and the row from its
//! recording.

use std::cell::RefCell;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};

use agent_node::controllers;
use msgs::ids::Tick;
use sim_server::exit;
use sim_server::info::{self, Info};
use supervisor::run::{Console, Run, Source};
use supervisor::team::Team;

use super::{RunFailure, machine};
use crate::measure::{self, Trace};
use crate::plan::PlannedRun;
use crate::rows::RunRecord;

/// How processes are started.
#[derive(Debug, Clone)]
pub struct Launcher {
    /// The folder of the binaries.
    pub binaries: PathBuf,
    /// ROS domain of the first job; the others use the next ones.
    pub first_domain: u32,
}

impl Launcher {
    /// Executes a run in the domain of a job.
    pub(super) fn carry_out(&self, run: &PlannedRun, job: usize, stop: &AtomicBool) -> Result<RunRecord, RunFailure> {
        let failed = |error: &dyn std::fmt::Display| RunFailure::Failed(error.to_string());
        let agents = &run.scenario.agents;
        let setting = |(key, value): (&String, &toml::Value)| {
            format!("{key}={}", value.as_str().map_or_else(|| value.to_string(), str::to_owned))
        };
        let settings: Vec<String> = agents.set.iter().map(setting).collect();
        controllers::check(&agents.controller, &settings).map_err(|error| failed(&error))?;
        let folder = tempfile::tempdir().map_err(|error| failed(&error))?;
        let (recording, stderr) = (folder.path().join("run.mcap"), folder.path().join("stderr"));
        let supervised = Run {
            binaries: self.binaries.clone(),
            domain: Some(self.first_domain + job as u32),
            scenario: &run.scenario,
            source: Source::Text { name: "scenario.toml", toml: run.scenario.to_toml() },
            server_flags: vec!["--record".into(), recording.clone().into()],
            server_env: Vec::new(),
            team: Team::default(),
            logs: folder.path().join("logs"),
            console: Console::Quiet { stderr: stderr.clone() },
        };
        let said = RefCell::new(String::new());
        let say = |text: &str| *said.borrow_mut() += &format!("{text}\n");
        let interruptions = || u32::from(stop.load(Ordering::Relaxed));
        let ended = supervised.supervise(&interruptions, &say).map_err(|error| failed(&error))?;
        if stop.load(Ordering::Relaxed) || ended.code == exit::BY_SIGNAL {
            return Err(RunFailure::Interrupted);
        }
        if ended.code != 0 {
            let text = std::fs::read_to_string(&stderr).unwrap_or_default() + &said.borrow();
            let last = text.lines().rfind(|line| line.starts_with("error")).or(text.lines().last());
            let last = last.unwrap_or("nothing was printed");
            return Err(RunFailure::Failed(format!("exit code {}: {last}", ended.code)));
        }
        let Some(summary) = ended.summary else {
            return Err(RunFailure::Failed("the server has written no summary".to_owned()));
        };
        let info = info::read(&recording).map_err(|error| failed(&error))?;
        let Info { announced: Some(told), result: Some(result), progress, .. } = info else {
            return Err(RunFailure::Failed("the recording has no end".to_owned()));
        };
        let wall = measure::wall_row(Tick(result.tick), summary.wall(), &[], &machine());
        Ok(measure::record(run, Trace { size: told.size, progress: &progress, result: &result, wall }))
    }
}
