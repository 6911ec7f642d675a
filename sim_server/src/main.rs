//! The world server. Start reading at [`run`]; every exit code is made here.

#[cfg(feature = "controllers")]
mod controllers;

use std::io::Write;
use std::process::ExitCode;

use clap::Parser;
use sim_server::cli::{Cli, Command, ScenarioArgs, VerifyArgs};
use sim_server::recording::{End, Recording};
use sim_server::{bag, exit, info, map_cli, setup, verify};

fn main() -> ExitCode {
    match dispatch(Cli::parse().command) {
        Ok(code) => code,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(exit::BAD_INPUT)
        }
    }
}

fn dispatch(command: Command) -> anyhow::Result<ExitCode> {
    match command {
        #[cfg(feature = "ros")]
        Command::Run(args) => serve::run(&args),
        #[cfg(feature = "ros")]
        Command::Replay(args) => serve::replay(&args),
        Command::Scenario(args) => scenario(&args),
        Command::Map(command) => {
            map_cli::run(command)?;
            Ok(ExitCode::SUCCESS)
        }
        Command::Info { file, metadata: true } => {
            let name = file.file_name().unwrap_or_default().to_string_lossy();
            print(&bag::metadata(&Recording::open(&file)?, &name));
            Ok(ExitCode::SUCCESS)
        }
        Command::Info { file, metadata: false } => {
            print(&info::text(&info::read(&file)?));
            Ok(ExitCode::SUCCESS)
        }
        Command::Verify(args) => check(&args),
    }
}

fn scenario(args: &ScenarioArgs) -> anyhow::Result<ExitCode> {
    let scenario = setup::load(&args.scenario, &args.keys.overrides())?;
    let text = scenario.to_toml();
    match &args.get {
        None => print(text.trim_end()),
        Some(key) => {
            let table: toml::Table = toml::from_str(&text)?;
            let table = toml::Value::Table(table);
            let value = key.split('.').try_fold(&table, |place, part| place.get(part));
            match value.ok_or_else(|| anyhow::anyhow!("--get {key}: the scenario has no such key"))? {
                toml::Value::Table(table) => {
                    table.iter().for_each(|(key, value)| print(&format!("{key}={}", word(value))));
                }
                value => print(&word(value)),
            }
        }
    }
    Ok(ExitCode::SUCCESS)
}

fn check(args: &VerifyArgs) -> anyhow::Result<ExitCode> {
    let recording = Recording::open(&args.file)?;
    let failed = |error: &dyn std::fmt::Display, code| {
        eprintln!("error: {error}");
        Ok(code)
    };
    let verified = match verify::verify(&recording) {
        Ok(verified) => verified,
        Err(error) => {
            // That a command is another one shows later in what comes of it.
            #[cfg(feature = "controllers")]
            if args.controllers
                && let Some(tick) = error.tick()
                && let Err(earlier) = verify::controllers::check(&recording, tick, &controllers::OfThisBuild)
            {
                return failed(&earlier, ExitCode::from(exit::DIFFERENT));
            }
            return failed(&error, exit::of_verify_error(&error));
        }
    };
    print(&verify::text(&verified));
    #[cfg(feature = "controllers")]
    if args.controllers {
        match verify::controllers::check(&recording, verified.ticks, &controllers::OfThisBuild) {
            Ok(checked) => print(&verify::controllers::text(&checked)),
            Err(error) => return failed(&error, ExitCode::from(exit::DIFFERENT)),
        }
    }
    print(&format!("digest: {}", verified.digest));
    if let End::Damage { .. } = verified.end {
        let damaged = format!("{}: {}", recording.file(), verified.end);
        return failed(&damaged, ExitCode::from(exit::DIFFERENT));
    }
    Ok(ExitCode::SUCCESS)
}

/// A value as an agent is told it: a text without its quotes.
fn word(value: &toml::Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}

/// Results go to stdout; that nobody listens is no failure.
fn print(text: &str) {
    drop(writeln!(std::io::stdout(), "{text}"));
}

#[cfg(feature = "ros")]
mod serve {
    use std::fs::File;
    use std::path::{Path, PathBuf};
    use std::process::ExitCode;
    use std::sync::Arc;
    use std::sync::atomic::AtomicBool;

    use anyhow::Context;
    use msgs::ids::Tick;
    use msgs::ros;
    use msgs::ros_env::RosEnv;
    use sim_server::cli::{ReplayArgs, RunArgs};
    use sim_server::playback::{Horizon, Playback};
    use sim_server::recording::Recording;
    use sim_server::replay::Programme;
    use sim_server::ros::{RosLink, replay};
    use sim_server::run::{self, RunError};
    use sim_server::scenario::{Override, Scenario};
    use sim_server::terminal::{self, Terminal};
    use sim_server::{exit, setup};

    /// A recording whose run goes on.
    struct Resumed {
        file: PathBuf,
        recording: Recording,
    }

    impl Resumed {
        fn open(file: &Path) -> anyhow::Result<Self> {
            Ok(Self { file: file.to_owned(), recording: Recording::open(file)? })
        }

        /// What was said so far, of a run that has not ended.
        fn playback(&self) -> anyhow::Result<Playback<'_>> {
            let playback = Playback::new(&self.recording)?;
            if let Horizon::Ended(tick) = playback.horizon() {
                let file = self.file.display();
                anyhow::bail!("{file}: its run has ended in tick {tick}; there is nothing to go on with");
            }
            Ok(playback)
        }

        /// What the run is to be; it completes the recording unless another one is named.
        fn scenario(&self, file: Option<&Path>, overrides: &[Override]) -> anyhow::Result<Scenario> {
            let mut scenario = setup::load_recorded(&self.recording, file, overrides)?;
            scenario.execution.record.get_or_insert_with(|| self.file.clone());
            Ok(scenario)
        }
    }

    /// Plays a recording over ROS 2.
    pub(super) fn replay(args: &ReplayArgs) -> anyhow::Result<ExitCode> {
        let env = RosEnv::from_vars(|name| std::env::var(name).ok())?;
        let recording = Recording::open(&args.file)?;
        let programme = Programme::new(&recording, &args.wishes())?;
        let stop = stopped_by_signals()?;
        let mut terminal = Terminal::new(programme.ticks().1, 0);
        programme.notes().iter().for_each(|note| terminal.say(&format!("warning: {note}")));
        let played = replay::play(&recording, &programme, args.manner(), &env, &mut terminal, &stop);
        terminal.clear();
        let played = match played {
            Ok(played) => played,
            Err(error) => return failed(&error),
        };
        let sim_s = Tick(played.sim_ticks).time_ns() as f64 * 1e-9;
        super::print(&format!("replayed {} messages, {sim_s:.2} s", played.messages));
        Ok(ExitCode::from(if played.is_interrupted { exit::BY_SIGNAL } else { 0 }))
    }

    /// A flag that SIGINT and SIGTERM set; a second signal ends the process.
    fn stopped_by_signals() -> anyhow::Result<Arc<AtomicBool>> {
        let stop = Arc::new(AtomicBool::new(false));
        for signal in [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM] {
            signal_hook::flag::register_conditional_shutdown(signal, exit::BY_SIGNAL.into(), Arc::clone(&stop))
                .and_then(|_| signal_hook::flag::register(signal, Arc::clone(&stop)))
                .context("handling signals")?;
        }
        Ok(stop)
    }

    /// The end of what the system does not allow.
    fn failed(error: &dyn std::fmt::Display) -> anyhow::Result<ExitCode> {
        eprintln!("error: {error}");
        Ok(ExitCode::from(exit::FAILED))
    }

    /// Serves a run over ROS 2.
    pub(super) fn run(args: &RunArgs) -> anyhow::Result<ExitCode> {
        let resumed = args.resume.as_deref().map(Resumed::open).transpose()?;
        let playback = resumed.as_ref().map(Resumed::playback).transpose()?;
        let overrides = args.keys.overrides();
        let scenario = match (&resumed, args.scenario.as_deref()) {
            (Some(resumed), file) => resumed.scenario(file, &overrides)?,
            (None, Some(file)) => setup::load(file, &overrides)?,
            (None, None) => unreachable!("one of the two is required"),
        };
        let env = RosEnv::from_vars(|name| std::env::var(name).ok())?;
        let source = args.scenario.as_deref().or(args.resume.as_deref()).unwrap_or(Path::new(""));
        let build = || {
            let built = match &resumed {
                Some(resumed) => setup::rebuild(&resumed.recording, &scenario),
                None => setup::build(&scenario),
            };
            built.map_err(|error| anyhow::anyhow!("{}: {error}", source.display()))
        };
        let (world, map) = build()?;
        let stop = stopped_by_signals()?;
        ros::stopped::end_when_continued().context("handling signals")?;
        let mut link = match RosLink::new(&scenario, &env) {
            Ok(link) => link,
            Err(error) => return failed(&error),
        };
        let record = |world: &_| {
            scenario.execution.record.as_deref().map(|file| setup::record(file, &scenario, world)).transpose()
        };
        let recorder = match record(&world) {
            Ok(recorder) => recorder,
            Err(error) => return failed(&error),
        };
        if let Some(file) = &args.ready {
            std::fs::write(file, "ready\n").context(file.display().to_string())?;
        }
        let log = args.log.as_ref().map(|file| File::create(file).context(file.display().to_string())).transpose()?;
        let mut terminal = Terminal::new(scenario.duration_ticks(), scenario.agents.count).with_log(log);
        terminal.say(&format!(
            "map seed {}: {} free cells, {:.1} % of the volume",
            map.seed,
            map.free_cells,
            map.free_fraction * 100.0
        ));
        let mut ended = match playback {
            None => run::run(&scenario, world, &mut link, recorder, &mut terminal, &stop),
            Some(playback) => run::resume(&scenario, world, &mut link, recorder, &mut terminal, &stop, playback),
        };
        while let Err(RunError::Reset(start)) = ended {
            terminal.say("begins again, as somebody has asked for");
            let (world, _) = build()?;
            ended = match record(&world) {
                Ok(recorder) => run::begin_again(start, &scenario, world, &mut link, recorder, &mut terminal, &stop),
                Err(error) => return failed(&error),
            };
        }
        terminal.clear();
        Ok(match ended {
            Ok(outcome) => {
                let text = terminal::result_text(&outcome);
                terminal.keep(&text);
                super::print(&text);
                exit::of_outcome(&outcome)
            }
            Err(error) => {
                terminal.say(&format!("error: {error}"));
                exit::of_error(&error)
            }
        })
    }
}
