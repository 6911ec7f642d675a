//! The world server. Start reading at `serve.rs`; every exit code is made here and there.

#[cfg(feature = "controllers")]
mod controllers;
#[cfg(feature = "ros")]
mod serve;

use std::io::Write;
use std::process::ExitCode;

use clap::Parser;
use sim_server::cli::{Cli, Command, ScenarioArgs, VerifyArgs};
#[cfg(feature = "view")]
use sim_server::foxglove;
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
        #[cfg(feature = "view")]
        Command::View(args) => view(&args),
        #[cfg(feature = "view")]
        Command::Snapshot(args) => snapshot(&args),
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

/// Shows a recording in a browser until it is interrupted.
#[cfg(feature = "view")]
fn view(args: &sim_server::cli::ViewArgs) -> anyhow::Result<ExitCode> {
    // What is no recording is told here, and not in the browser.
    Recording::open(&args.file)?;
    let page = foxglove::page(args.page.as_deref())?.ok_or_else(|| anyhow::anyhow!("{}", foxglove::NO_PAGE_HERE))?;
    let shelf = match foxglove::StaticFileServer::open(&args.address, &page, &args.file) {
        Ok(shelf) => shelf,
        Err(error) => {
            eprintln!("error: {error}");
            return Ok(ExitCode::from(exit::FAILED));
        }
    };
    // Before the address is printed: whoever reads it may send a signal at once.
    let mut signals = signal_hook::iterator::Signals::new([signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM])?;
    print(&shelf.url());
    signals.forever().next();
    Ok(ExitCode::SUCCESS)
}

/// Takes a picture of a recording.
#[cfg(feature = "view")]
fn snapshot(args: &sim_server::cli::SnapshotArgs) -> anyhow::Result<ExitCode> {
    use sim_server::foxglove::capture::{self, CaptureTime};

    Recording::open(&args.subject.file)?;
    if let Err(error) = capture::take(&args.subject, CaptureTime::Snapshot { at: args.at }, &args.out) {
        eprintln!("error: {error}");
        return Ok(ExitCode::from(capture::exit_code(&error)));
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
