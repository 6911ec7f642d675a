//! A run in this process: the server and its agents on threads, and no network.

use std::fs::{self, File};
#[cfg(feature = "ros")]
use std::path::Path;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use agent_node::stopwatch::{self, DecisionTimes};
use anyhow::Context;
use in_memory::in_process::{self, AgentOptions, InProcessError, ThreadLayout};
use recording::Recording;
use sim_server::exit;
use sim_server::profile::{Decision, Profile, Profiled, TraceFile};
use sim_server::setup;
use sim_server::terminal::{self, Terminal};
use simulation::scenario::Scenario;
use system::{diagnostics, wall_clock};

use super::RunArgs;
use crate::output::print;
use crate::signals;

pub(super) fn run(args: &RunArgs, scenario: &Scenario) -> anyhow::Result<ExitCode> {
    let mut file = args.log.clone();
    if let Some(folder) = &args.logs {
        if let Err(error) = fs::create_dir_all(folder) {
            tracing::error!("{}: {error}", folder.display());
            return Ok(ExitCode::from(exit::FAILED));
        }
        file.get_or_insert_with(|| folder.join("server.log"));
    }
    #[cfg(feature = "ros")]
    if !scenario.agents.command.is_empty() {
        args.check_command(scenario)?;
        supervisor::outside::check(scenario, Path::new("")).with_context(|| args.name())?;
    }
    let stop = signals::stop_flag()?;
    let log = file.map(|file| File::create(&file).context(file.display().to_string())).transpose()?;
    let mut terminal = Terminal::of(scenario).with_log(log);
    let chaos_delay = Duration::from_millis(args.chaos_delay_ms.unwrap_or(0));
    let threads = match args.together {
        true => ThreadLayout::Together,
        // An agent that waits keeps no other one waiting.
        false if !chaos_delay.is_zero() => ThreadLayout::PerAgent,
        false => ThreadLayout::Team,
    };
    let decision_times = (args.decision_times || args.profile.is_some()).then(|| DecisionTimes::new(wall_clock::now));
    let trace = args.profile.as_deref().map(TraceFile::create).transpose()?;
    let mut profile = trace.as_ref().map(|_| Profile::default());
    let options = AgentOptions {
        threads,
        chaos_delay,
        decision_times: decision_times.clone(),
        // Without ROS 2, nothing has checked it.
        programs_from: cfg!(feature = "ros").then(PathBuf::new),
        ..AgentOptions::default()
    };
    let mut observer = Profiled { inner: &mut terminal, profile: profile.as_mut() };
    let finished = match args.fork.point() {
        Some((file, at)) => {
            let recording = Recording::open(file)?;
            in_process::fork(&recording, at, scenario, &options, &mut observer, &stop)
        }
        None => in_process::run(scenario, &options, &mut observer, &stop),
    };
    terminal.clear();
    if let Some(times) = decision_times.as_ref().filter(|_| args.decision_times) {
        tracing::info!(target: diagnostics::REQUESTED, "{}", summary(&times.sorted()));
    }
    let mut traced = Ok(());
    if let (Some(profile), Some(trace), Some(times)) = (&profile, &trace, &decision_times) {
        let decisions: Vec<Decision> = times
            .all()
            .into_iter()
            .map(|stopwatch::Decision { agent, tick, start, duration }| Decision { agent, tick, start, duration })
            .collect();
        tracing::info!(target: diagnostics::REQUESTED, "{}", profile.table(&scenario.controllers_label(), &decisions));
        traced = trace.write(profile, &decisions).context("--profile");
    }
    let outcome = finished
        .map_err(|error| match error {
            InProcessError::Setup(error) => {
                anyhow::anyhow!("{}", setup::described(&error, args.keys.map.as_deref(), &args.name()))
            }
            InProcessError::OverRosOnly { .. } => anyhow::anyhow!("{}: {error}", args.name()),
            other => other.into(),
        })?
        .outcome;
    let text = terminal::result_text(&outcome);
    terminal.keep(&text);
    print(&text);
    traced?;
    Ok(exit::of_outcome(&outcome))
}

/// Of durations in ascending order.
fn summary(times: &[Duration]) -> String {
    let share = |permille: usize| {
        let place = (times.len() * permille / 1000).min(times.len().saturating_sub(1));
        times.get(place).copied().unwrap_or_default()
    };
    let (median, p99, longest) = (share(500), share(990), share(1000));
    format!("{} decisions: median {median:.1?}, p99 {p99:.1?}, longest {longest:.1?}", times.len())
}
