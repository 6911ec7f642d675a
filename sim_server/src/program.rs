//! The process of the world server: a run over ROS 2, or one run after the other.
//!
//! Both `sim_server` and `maes sim_server` are this process; its exit codes are made here.

#[cfg(feature = "view")]
mod requests;

use std::ffi::OsString;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
#[cfg(feature = "view")]
use std::sync::atomic::Ordering;

use crate::cli::{Cli, Command as CliCommand, RunArgs};
use crate::profile::{Profile, Profiled, TraceFile};
use crate::ros::RosTransport;
use crate::session::{self, JoinPolicy, Mode, Outcome, RecordingSinks, RunConfig, RunError};
use crate::terminal::{self, Terminal};
use crate::{exit, setup};
use anyhow::Context;
use clap::Parser;
#[cfg(feature = "view")]
use foxglove_server::{FoxgloveServer, FoxgloveServerError, ObservedTransport, Token};
use mapgen::MapReport;
use msgs::ids::{AgentId, Tick};
use msgs::printable;
use recording::Recording;
use recording::playback::{Horizon, Playback};
use ros_node::join_secret;
use ros_node::process_guard::{Limits, ProcessGuard, stop_on_signals};
use ros_node::ros_env::RosEnv;
use simulation::scenario::{Override, Scenario};
use system::diagnostics;
use system::memory;
use system::os;
use system::program::StartableAgents;
use system::results;
use system::summary::Summary;
use transport::{Level, Transport};
use world::World;

/// Runs cannot be observed.
#[cfg(not(feature = "view"))]
enum FoxgloveServer {}

/// The whole process, from its arguments without the name of the program to its exit code.
#[must_use]
pub fn main(arguments: impl IntoIterator<Item = OsString>) -> ExitCode {
    diagnostics::show(None);
    let name = OsString::from("sim_server");
    let CliCommand::Run(args) = Cli::parse_from([name].into_iter().chain(arguments)).command;
    let reported = os::report_full_files().and_then(|()| memory::report_lack());
    let done = reported.map_err(anyhow::Error::from).and_then(|()| run(&args));
    match done {
        Ok(code) => code,
        Err(error) => {
            tracing::error!("{}", printable::line(&exit::described(&error)));
            ExitCode::from(exit::BAD_INPUT)
        }
    }
}

/// A recording whose run is resumed, or forked at a tick.
struct Resumed {
    file: PathBuf,
    recording: Recording,
    fork: Option<Tick>,
}

impl Resumed {
    fn open(args: &RunArgs) -> anyhow::Result<Option<Self>> {
        let resumed = args.resume.as_deref().map(|file| (file, None));
        let Some((file, fork)) = resumed.or_else(|| args.fork.point().map(|(file, at)| (file, Some(at)))) else {
            return Ok(None);
        };
        Ok(Some(Self { file: file.to_owned(), recording: Recording::open(file)?, fork }))
    }

    /// What was said so far, of a run that has not ended; before the tick of a fork.
    fn playback(&self) -> anyhow::Result<Playback<'_>> {
        let playback = Playback::new(&self.recording)?;
        if let Some(at) = self.fork {
            return Ok(playback.until(at));
        }
        if let Horizon::Ended(tick) = playback.horizon() {
            let file = self.file.display();
            anyhow::bail!("{file}: its run has ended in tick {tick}: nothing to resume");
        }
        Ok(playback)
    }

    /// What the run is to be; one that is resumed completes the recording unless another one is
    /// named.
    fn scenario(&self, file: Option<&Path>, overrides: &[Override]) -> anyhow::Result<Scenario> {
        if let Some(at) = self.fork {
            return Ok(setup::fork(&self.recording, at, overrides)?);
        }
        let mut scenario = setup::load_recorded(&self.recording, file, overrides)?;
        scenario.execution.record.get_or_insert_with(|| self.file.clone());
        Ok(scenario)
    }
}

/// The flag that signals set, and the watch over the time and the memory of this process, which
/// makes endpoints for this many agents.
fn stop_and_guard(agents: u32) -> anyhow::Result<(Arc<AtomicBool>, ProcessGuard)> {
    let limits = Limits::from_vars(agents as usize, |name| std::env::var(name).ok())?;
    let stop = stop_on_signals(exit::BY_SIGNAL).context("handling signals")?;
    ros_node::suspension::exit_on_continue().context("handling signals")?;
    let guard = ProcessGuard::watch(limits, Arc::clone(&stop)).context("starting a thread")?;
    Ok((stop, guard))
}

/// The end of what the system does not allow.
fn failed(error: &dyn std::fmt::Display) -> anyhow::Result<ExitCode> {
    tracing::error!("{}", printable::line(&error.to_string()));
    Ok(ExitCode::from(exit::FAILED))
}

/// Serves a run over ROS 2, or one after the other.
fn run(args: &RunArgs) -> anyhow::Result<ExitCode> {
    let resumed = Resumed::open(args)?;
    let playback = resumed.as_ref().map(Resumed::playback).transpose()?;
    let overrides = args.keys.overrides();
    let env = RosEnv::from_vars(|name| std::env::var(name).ok())?;
    #[cfg(feature = "view")]
    if args.idle {
        return requests::idle(args, &env, &overrides);
    }
    let scenario = match (&resumed, args.scenario.as_deref()) {
        (Some(resumed), file) => resumed.scenario(file, &overrides)?,
        (None, Some(file)) => match &args.paths_from {
            Some(folder) => setup::load_with_paths_from(folder, file, &overrides)?,
            None => setup::load(file, &overrides)?,
        },
        (None, None) => unreachable!("one of the two is required"),
    };
    let recorded = resumed.as_ref().map(|resumed| resumed.file.as_path());
    let source = args.scenario.as_deref().or(recorded).unwrap_or(Path::new(""));
    let trace = args.profile.as_deref().map(TraceFile::create).transpose()?;
    let summary = args.summary.as_deref();
    let policy = join_policy(args)?;
    if let Some(agent) = policy.third_party.iter().find(|agent| agent.0 >= scenario.agents.count) {
        let last = scenario.agents.count - 1;
        anyhow::bail!("--external {agent}: agent {agent} is not in the run: ids are 0 to {last}");
    }
    let name = source.display().to_string();
    let map = args.keys.map.as_deref();
    let (resumed, trace, ready) = (resumed.as_ref(), trace.as_ref(), args.ready.as_deref());
    let job = Job { name, map, scenario: &scenario, resumed, summary, trace, ready, policy };
    // An error in the world is reported before anything is opened.
    let made = job.make()?;
    let (stop, guard) = stop_and_guard(scenario.agents.count)?;
    let viewing = match open_viewing(args)? {
        Ok(viewing) => viewing,
        Err(error) => return failed(&error),
    };
    match job.begin(made, &env, viewing.as_ref()) {
        Ok(begun) => {
            guard.started();
            say_ready(args.ready.as_deref(), &StartableAgents::OfStart)?;
            let log =
                args.log.as_ref().map(|file| File::create(file).context(file.display().to_string())).transpose()?;
            let mut terminal = Terminal::of(&scenario).with_log(log);
            tell_address(viewing.as_ref(), &mut terminal);
            let ending = || {
                if !stays(args) {
                    guard.shutting_down();
                }
            };
            let code = job.carry_out(begun, playback, &mut terminal, &stop, ending)?;
            #[cfg(feature = "view")]
            let code = match viewing.as_ref().filter(|_| stays(args)) {
                Some(viewing) => {
                    let has_result = [ExitCode::SUCCESS, ExitCode::from(exit::BY_SIGNAL)].contains(&code);
                    let code = if has_result && !stop.load(Ordering::Relaxed) {
                        tracing::info!("{}", requests::STAYS);
                        // The keys of the command line were those of the run that is over.
                        requests::serve_requests(args, &env, &[], viewing, &stop, Some(&job))?.unwrap_or(code)
                    } else {
                        code
                    };
                    guard.shutting_down();
                    code
                }
                None => code,
            };
            Ok(if guard.memory_exceeded() { exit::after_memory_limit(code) } else { code })
        }
        Err(error) => failed(&error),
    }
}

/// Writes which agents may start into the file of `--ready`, if there is one.
fn say_ready(file: Option<&Path>, agents: &StartableAgents) -> anyhow::Result<()> {
    match file {
        Some(file) => std::fs::write(file, format!("{agents}\n")).context(file.display().to_string()),
        None => Ok(()),
    }
}

#[cfg(feature = "view")]
fn open_viewing(args: &RunArgs) -> anyhow::Result<Result<Option<FoxgloveServer>, FoxgloveServerError>> {
    let Some(address) = &args.view else { return Ok(Ok(None)) };
    let page = foxglove_server::page(args.page.as_deref())?;
    let token = match Token::of_environment() {
        Err(FoxgloveServerError::System(error)) => return Ok(Err(error.into())),
        token => token?,
    };
    Ok(FoxgloveServer::open(address, page.as_deref(), args.idle || args.stay, token, &args.view_allow_origin).map(Some))
}

#[cfg(not(feature = "view"))]
fn open_viewing(_: &RunArgs) -> anyhow::Result<Result<Option<FoxgloveServer>, std::convert::Infallible>> {
    Ok(Ok(None))
}

#[cfg(feature = "view")]
fn tell_address(viewing: Option<&FoxgloveServer>, terminal: &mut Terminal) {
    if let Some(viewing) = viewing {
        let note = viewing.address().note().map(|note| format!("; {note}")).unwrap_or_default();
        let text = |page: &str, socket: &str| format!("observe at {page} (Foxglove WebSocket: {socket}){note}");
        // Others may read the log: it does not have the token. Who reads the terminal finds it
        // there.
        terminal.keep(&text(&format!("http://{}", viewing.address()), &format!("ws://{}", viewing.address())));
        tracing::info!(target: diagnostics::REQUESTED, "{}", text(&viewing.url(), &viewing.websocket_url()));
    }
}

#[cfg(not(feature = "view"))]
fn tell_address(_: Option<&FoxgloveServer>, _: &mut Terminal) {}

/// Whether the page stays after the run.
fn stays(args: &RunArgs) -> bool {
    #[cfg(feature = "view")]
    return args.stay;
    #[cfg(not(feature = "view"))]
    return false;
}

/// A run that is to be served.
struct Job<'a> {
    /// What its scenario is called in errors.
    name: String,
    /// What `--map` has named.
    map: Option<&'a str>,
    scenario: &'a Scenario,
    resumed: Option<&'a Resumed>,
    /// Where the summary of its result is written.
    summary: Option<&'a Path>,
    /// Where the trace of its profile goes; `None`: it is not profiled.
    trace: Option<&'a TraceFile>,
    /// The file of `--ready`.
    ready: Option<&'a Path>,
    /// Which processes may join.
    policy: JoinPolicy,
}

/// Which processes may join, by the flags and the environment.
fn join_policy(args: &RunArgs) -> anyhow::Result<JoinPolicy> {
    let secret = join_secret::read(args.join_secret_file.as_deref(), |name| std::env::var_os(name))?;
    Ok(JoinPolicy { secret, third_party: args.external.iter().copied().map(AgentId).collect() })
}

/// A world, and where its map comes from.
type GeneratedWorld = (World, MapReport);

/// Everything that a run needs.
struct StartedRun<'a> {
    world: World,
    map: MapReport,
    link: Box<dyn Transport + 'a>,
    records: RecordingSinks,
    viewing: Option<&'a FoxgloveServer>,
}

impl<'a> Job<'a> {
    fn make(&self) -> anyhow::Result<GeneratedWorld> {
        setup::check_destination(self.scenario)?;
        let built = match self.resumed {
            Some(resumed) => setup::rebuild(&resumed.recording, self.scenario),
            None => setup::build(self.scenario),
        };
        built.map_err(|error| anyhow::anyhow!("{}", setup::described(&error, self.map, &self.name)))
    }

    fn records(&self, world: &World, viewing: Option<&FoxgloveServer>) -> anyhow::Result<RecordingSinks> {
        let file = self.scenario.execution.record.as_deref();
        let recorder = file.map(|file| setup::record(file, self.scenario, world)).transpose()?;
        #[cfg(feature = "view")]
        let live = viewing
            .map(|viewing| setup::with_documents(self.scenario, world, |documents| viewing.live_stream(documents)))
            .transpose()
            .context("viewing")?;
        #[cfg(not(feature = "view"))]
        let (live, _) = (None, viewing);
        Ok(RecordingSinks { recorder, live })
    }

    /// Joins the network and opens what is to be written.
    fn begin(
        &self,
        (world, map): GeneratedWorld,
        env: &RosEnv,
        viewing: Option<&'a FoxgloveServer>,
    ) -> anyhow::Result<StartedRun<'a>> {
        let link = RosTransport::new(self.scenario, env)?;
        #[cfg(feature = "view")]
        let link: Box<dyn Transport + 'a> = match viewing {
            Some(viewing) => Box::new(ObservedTransport::new(link, viewing, self.scenario)),
            None => Box::new(link),
        };
        #[cfg(not(feature = "view"))]
        let link: Box<dyn Transport + 'a> = Box::new(link);
        let records = self.records(&world, viewing)?;
        Ok(StartedRun { world, map, link, records, viewing })
    }

    /// The run, again after each reset. `ending` is called before anything is closed.
    fn carry_out(
        &self,
        begun: StartedRun<'_>,
        playback: Option<Playback<'_>>,
        terminal: &mut Terminal,
        stop: &AtomicBool,
        ending: impl FnOnce(),
    ) -> anyhow::Result<ExitCode> {
        let StartedRun { world, map, mut link, records, viewing } = begun;
        let scenario = self.scenario;
        let origin = match &scenario.map.file {
            Some(file) => printable::line(&file.display().to_string()).into_owned(),
            None => format!("seed {}", map.seed),
        };
        let (free_cells, percent) = (map.free_cells, map.free_fraction * 100.0);
        terminal.say(Level::Info, &format!("map {origin}: {free_cells} free cells, {percent:.1} % of the volume"));
        for warning in &map.warnings {
            terminal.say(Level::Warn, &printable::line(warning));
        }
        let config = RunConfig::new(scenario, playback.map_or(Mode::Live, Mode::Resume));
        let config = config.map(|config| config.with_policy(self.policy.clone()));
        let mut profile = self.trace.map(|_| Profile::default());
        let mut ended = config.and_then(|config| {
            let mut observer = Profiled { inner: terminal, profile: profile.as_mut() };
            session::run(config, world, &mut *link, records, &mut observer, stop)
        });
        while let Err(RunError::Reset { start, departed }) = ended {
            terminal.say(Level::Info, "the run begins again: a service call has reset it");
            if !departed.is_empty() {
                let departed = departed.iter().map(|agent| agent.0).collect();
                say_ready(self.ready, &StartableAgents::Restarted(departed))?;
            }
            let (world, _) = self.make()?;
            ended = match self.records(&world, viewing) {
                Ok(records) => {
                    let config = RunConfig::after_reset(scenario, start).with_policy(self.policy.clone());
                    profile = self.trace.map(|_| Profile::default());
                    let mut observer = Profiled { inner: terminal, profile: profile.as_mut() };
                    session::run(config, world, &mut *link, records, &mut observer, stop)
                }
                Err(error) => return failed(&error),
            };
        }
        ending();
        terminal.clear();
        let mut traced = Ok(());
        if let (Some(profile), Some(trace)) = (&profile, self.trace) {
            tracing::info!(target: diagnostics::REQUESTED, "{}", profile.table("", &[]));
            traced = trace.write(profile, &[]);
        }
        Ok(match ended {
            Ok(outcome) => {
                let text = terminal::result_text(&outcome);
                terminal.keep(&text);
                if let Err(error) = results::write_line(&text) {
                    return failed(&format!("stdout: {error}"));
                }
                if let Some(file) = self.summary
                    && let Err(error) = summary(&outcome).write(file)
                {
                    return failed(&format!("--summary {}: {error}", file.display()));
                }
                if let Err(error) = traced {
                    return failed(&format!("--profile: {error}"));
                }
                exit::of_outcome(&outcome)
            }
            Err(error) => {
                terminal.say(Level::Error, &printable::line(&error.to_string()));
                exit::of_error(&error)
            }
        })
    }
}

/// The summary of a run with a result.
fn summary(outcome: &Outcome) -> Summary {
    Summary {
        digest: outcome.digest.to_string(),
        reason: outcome.result.reason.clone(),
        tick: outcome.result.tick,
        wall_s: outcome.wall.as_secs_f64(),
        restarted_processes: outcome.restarted,
        explored_m2: Some(outcome.explored_m2),
    }
}
