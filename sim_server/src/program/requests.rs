//! A server that serves the runs that clients request, one after the other: without a run of its
//! own, or after it.

use std::fs::File;
use std::path::PathBuf;
use std::process::{Command, ExitCode, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use anyhow::Context;
use foxglove_server::{FoxgloveServer, IdleRequest};
use msgs::ids::Tick;
use ros_node::ros_env::RosEnv;
use simulation::scenario::{Override, Scenario};
use system::diagnostics;
use system::program::StartableAgents;

use super::{Job, failed, join_policy, open_viewing, say_ready, stop_and_guard, tell_address};
use crate::cli::RunArgs;
use crate::exit;
use crate::profile::TraceFile;
use crate::requested_run::{RequestedRun, RequestedRuns, RunFolders};
use crate::terminal::Terminal;

/// Wall time between two looks at whether an idle server is to end.
const IDLE_PERIOD: Duration = Duration::from_millis(100);

/// What requested scenarios are called in errors.
const REQUESTED: &str = "the scenario";

/// Why a restart is refused.
const NO_RUN: &str = "there is no run to restart; /sim_server/start_run starts one";

/// What is said when the page stays after a run.
pub(super) const STAYS: &str = "the page stays for a restart and for new runs; Ctrl-C ends it";

/// Serves the runs that people start on the page, one after the other, until it is interrupted.
pub(super) fn idle(args: &RunArgs, env: &RosEnv, overrides: &[Override]) -> anyhow::Result<ExitCode> {
    let (stop, guard) = stop_and_guard(0)?;
    let viewing = match open_viewing(args)? {
        Ok(viewing) => viewing.expect("an idle server is looked at"),
        Err(error) => return failed(&error),
    };
    if let Some(file) = &args.log {
        File::create(file).context(file.display().to_string())?;
    }
    tell_address(Some(&viewing), &mut Terminal::new(Tick::ZERO).with_log(open_log(args)?));
    guard.started();
    let code = serve_requests(args, env, overrides, &viewing, &stop, None)?.unwrap_or(ExitCode::SUCCESS);
    guard.shutting_down();
    Ok(if guard.memory_exceeded() { exit::after_memory_limit(code) } else { code })
}

/// The log, to write at its end.
fn open_log(args: &RunArgs) -> anyhow::Result<Option<File>> {
    let open = |file: &PathBuf| File::options().append(true).open(file).context(file.display().to_string());
    args.log.as_ref().map(open).transpose()
}

/// Serves the runs that clients request, one after the other, until `stop` is set; the exit code of
/// the last one. The run of `first` is the one that a restart repeats until there is another one.
pub(super) fn serve_requests(
    args: &RunArgs,
    env: &RosEnv,
    overrides: &[Override],
    viewing: &FoxgloveServer,
    stop: &AtomicBool,
    first: Option<&Job<'_>>,
) -> anyhow::Result<Option<ExitCode>> {
    let maps = args.map_dir.clone().or_else(scenarios_folder);
    let mut requested = RequestedRuns::new(RunFolders { recordings: args.record_dir.clone(), maps });
    let policy = join_policy(args)?;
    let trace = args.profile.as_deref().map(TraceFile::create).transpose()?;
    let summary = args.summary.as_deref();
    // The recording of a run is not written again.
    let unrecorded = |scenario: &Scenario| {
        let mut scenario = scenario.clone();
        scenario.execution.record = None;
        scenario
    };
    let mut latest = first.map(|job| (job.name.as_str(), unrecorded(job.scenario), job.resumed, Team::OfStart));
    let mut code = None;
    let mut runs = 0;
    while !stop.load(Ordering::Relaxed) {
        let Some(request) = viewing.next_request(IDLE_PERIOD) else { continue };
        let next = match &request {
            IdleRequest::Start(start) => requested
                .scenario(start, overrides)
                .map_err(|error| error.to_string())
                .and_then(|RequestedRun { scenario, recording }| {
                    let of_agents = |reason| format!("{REQUESTED}: agents.controller, agents.set: {reason}");
                    check_agents(&args.check_agents, &scenario).map_err(of_agents)?;
                    Ok(((REQUESTED, scenario, None, Team::Requested), recording))
                }),
            IdleRequest::Restart(_) => latest.clone().map(|run| (run, None)).ok_or_else(|| NO_RUN.to_owned()),
        };
        let ((name, scenario, resumed, team), recording) = match next {
            Ok(next) => next,
            Err(reason) => {
                request.answer(Err(&reason));
                continue;
            }
        };
        let job = Job {
            name: name.to_owned(),
            map: None,
            scenario: &scenario,
            resumed,
            summary,
            trace: trace.as_ref(),
            ready: args.ready.as_deref(),
            policy: policy.clone(),
        };
        let begun = job.make().and_then(|made| job.begin(made, env, Some(viewing)));
        let begun = match begun.and_then(|begun| tell_agents(args, runs + 1, team, &scenario).map(|()| begun)) {
            Ok(begun) => begun,
            Err(error) => {
                request.answer(Err(&format!("{error:#}")));
                continue;
            }
        };
        runs += 1;
        request.answer(Ok(recording.as_deref()));
        let mut terminal = Terminal::of(&scenario).with_log(open_log(args)?);
        code = Some(job.carry_out(begun, None, &mut terminal, stop, || ())?);
        latest = Some((name, unrecorded(&scenario), resumed, team));
    }
    Ok(code)
}

/// Whose agents a run without an end of the server has.
#[derive(Clone, Copy)]
enum Team {
    /// Those with which the server was started.
    OfStart,
    /// Those of a requested scenario.
    Requested,
}

/// The folder of the project's scenarios, if this is a build of the workspace.
fn scenarios_folder() -> Option<PathBuf> {
    let binary = std::env::current_exe().ok()?;
    let folder = binary.parent()?.join("../../launch_scripts/scenarios");
    folder.is_dir().then_some(folder)
}

/// Whether there are the controllers that a scenario names, with their settings. The server does
/// not know the controllers: it asks a program that does, and refuses nothing if there is none.
fn check_agents(program: &[PathBuf], scenario: &Scenario) -> Result<(), String> {
    let sibling = || {
        let program = std::env::current_exe().ok()?.with_file_name("agent_node");
        program.is_file().then_some(program)
    };
    let (program, first) = match program {
        [] => match sibling() {
            Some(program) => (program, &[][..]),
            None => return Ok(()),
        },
        [program, first @ ..] => (program.clone(), first),
    };
    for choice in scenario.agents.controllers_of(|_| true) {
        let mut check = Command::new(&program);
        check.args(first);
        check.args(["--check", "--id", "0", "--controller", choice.controller]);
        for setting in simulation::wire::settings(choice.set) {
            check.arg("--set").arg(setting);
        }
        diagnostics::as_read(&mut check);
        let checked = check.stdin(Stdio::null()).output();
        let checked = checked.map_err(|error| format!("{}: {error}", program.display()))?;
        if !checked.status.success() {
            let reason = String::from_utf8_lossy(&checked.stderr);
            return Err(reason.trim().trim_start_matches("error: ").to_owned());
        }
    }
    Ok(())
}

/// Says which agents may start: those of a requested scenario by a file beside that of `--ready`.
fn tell_agents(args: &RunArgs, number: u32, team: Team, scenario: &Scenario) -> anyhow::Result<()> {
    let Some(ready) = &args.ready else { return Ok(()) };
    let agents = match team {
        Team::OfStart => StartableAgents::OfStart,
        Team::Requested => {
            let file = ready.with_file_name(format!("run_{number}.toml"));
            std::fs::write(&file, scenario.to_toml()).context(file.display().to_string())?;
            StartableAgents::OfScenario(file)
        }
    };
    say_ready(Some(ready), &agents)
}
