//! A run of a plan over ROS 2: its processes in a domain of their own, and the row from its
//! recording.

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use msgs::ids::Tick;
use msgs::printable;
use sim_server::exit;
use sim_server::info::{self, Info};
use supervisor::run::{Console, Run, Source};
use supervisor::team::Team;
use supervisor::{SupervisorError, outside};

use super::{ExecuteError, RunFailure, machine};
use crate::measure::{self, Trace};
use crate::plan::{Plan, PlannedRun};
use crate::rows::RunRecord;
use in_memory::stages::StageTimes;

/// How processes are started.
#[derive(Debug, Clone)]
pub struct Launcher {
    /// The folder of the binaries.
    pub binaries: PathBuf,
    /// ROS domain of the first job; the others use the next ones. Where another run has a domain,
    /// later ones are tried.
    pub first_domain: u32,
}

/// Greatest ROS domain whose ports are free on every system.
const DOMAIN_MAX: u32 = 101;

/// Checks whether the programs that a plan names can run its agents; each one once.
pub(super) fn check(plan: &Plan) -> Result<(), ExecuteError> {
    let mut checked = BTreeSet::new();
    for run in &plan.runs {
        let agents = &run.scenario.agents;
        if agents.of_ros_only(false).is_none() {
            continue;
        }
        if let Some(agent) = agents.cmd_vel.iter().find(|&&agent| !agents.is_commanded(agent)) {
            let reason = "nothing in a plan starts the node of this agent; name its program in agents.command";
            return Err(ExecuteError::Transport { key: "agents.cmd_vel", value: agent.to_string(), reason });
        }
        let choices = agents.controllers_of(|agent| agents.is_commanded(agent));
        if checked.insert((&agents.command, format!("{choices:?}"))) {
            outside::check(&run.scenario, &run.folder)?;
        }
    }
    Ok(())
}

impl Launcher {
    /// Executes a run in the domain of a job, one of `jobs`. Its recording becomes the file `kept`,
    /// also if it fails after its start.
    pub(super) fn carry_out(
        &self,
        run: &PlannedRun,
        (job, jobs): (usize, usize),
        kept: Option<&Path>,
        stop: &AtomicBool,
    ) -> Result<RunRecord, RunFailure> {
        let failed = |error: &dyn std::fmt::Display| RunFailure::Failed(error.to_string());
        let folder = tempfile::tempdir().map_err(|error| failed(&error))?;
        let (recording, stderr) = (folder.path().join("run.mcap"), folder.path().join("stderr"));
        let first = self.first_domain + job as u32;
        let supervised = |domain: u32| Run {
            binaries: self.binaries.clone(),
            domain: Some(domain),
            scenario: &run.scenario,
            source: Source::Text { name: "scenario.toml", toml: run.scenario.to_toml() },
            server_flags: vec!["--record".into(), recording.clone().into()],
            server_env: Vec::new(),
            team: Team::default(),
            hosts: None,
            folder: run.folder.clone(),
            logs: folder.path().join("logs"),
            console: Console::Quiet { stderr: stderr.clone() },
        };
        let said = RefCell::new(String::new());
        let say = |text: &str| *said.borrow_mut() += &format!("{text}\n");
        let interruptions = || u32::from(stop.load(Ordering::Relaxed));
        let mut ended = supervised(first).supervise(&interruptions, &say);
        for domain in (first..=DOMAIN_MAX).step_by(jobs).skip(1) {
            if !matches!(ended, Err(SupervisorError::DomainTaken(_))) {
                break;
            }
            ended = supervised(domain).supervise(&interruptions, &say);
        }
        let ended = ended.map_err(|error| failed(&error))?;
        if stop.load(Ordering::Relaxed) || ended.code == exit::BY_SIGNAL {
            return Err(RunFailure::Interrupted);
        }
        if let Some(kept) = kept.filter(|_| recording.exists()) {
            // The temporary folder may be on another disk.
            std::fs::copy(&recording, kept).map_err(|error| failed(&error))?;
        }
        if ended.code != 0 {
            let text = std::fs::read_to_string(&stderr).unwrap_or_default() + &said.borrow();
            let last = text.lines().rfind(|line| line.starts_with("error")).or(text.lines().last());
            let last = last.unwrap_or("nothing was printed");
            let printed = last_words(run, &folder.path().join("logs"));
            return Err(RunFailure::Failed(format!("exit code {}: {last}{printed}", ended.code)));
        }
        let Some(summary) = ended.summary else {
            return Err(RunFailure::Failed("the server has written no summary".to_owned()));
        };
        let info = info::read(&recording).map_err(|error| failed(&error))?;
        let Info { announced: Some(scenario), result: Some(result), progress, stages: named, .. } = info else {
            return Err(RunFailure::Failed("the recording has no end".to_owned()));
        };
        let wall = measure::wall_row(Tick(result.tick), summary.wall(), &[], &machine());
        let mut stages = StageTimes::default();
        named.into_iter().for_each(|(agent, tick, stage)| stages.enter(agent, tick, stage));
        let (stages, progress, result) = (&stages, &progress, &result);
        let (size, cell_m, explored_m2) = (scenario.size, scenario.cell_m, summary.explored_m2);
        Ok(measure::record(run, Trace { size, cell_m, progress, result, stages, seen_again: None, explored_m2, wall }))
    }
}

/// What a program of the user has printed last, since its log is removed with the run.
fn last_words(run: &PlannedRun, logs: &Path) -> String {
    let words = |agent: u32| {
        let log = std::fs::read_to_string(logs.join(format!("agent_{agent}.log"))).ok()?;
        let line = log.lines().rfind(|line| !line.trim().is_empty())?;
        Some(format!("; agent {agent} printed last: {}", printable::line(line)))
    };
    run.scenario.agents.with_own_command().find_map(words).unwrap_or_default()
}
