//! `maes scenario`: a scenario with all its keys, or one of them.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::anyhow;
use clap::Args;
use sim_server::cli::{KeyArgs, recording_path};
use sim_server::setup;

use crate::output;

/// Arguments of `scenario`.
#[derive(Debug, Args)]
pub(crate) struct ScenarioArgs {
    /// The scenario (.toml), or a recording of it (.mcap)
    #[arg(value_parser = recording_path())]
    scenario: PathBuf,
    /// Print only the value of this key, for example agents.count; of a table, a line KEY=VALUE for
    /// each of its keys
    #[arg(long, value_name = "KEY")]
    get: Option<String>,
    #[command(flatten, next_help_heading = "Keys of the scenario")]
    keys: KeyArgs,
}

/// Prints a scenario.
pub(crate) fn print(args: &ScenarioArgs) -> anyhow::Result<ExitCode> {
    let scenario = setup::load(&args.scenario, &args.keys.overrides())?;
    let text = scenario.to_toml();
    let Some(key) = &args.get else {
        output::print(text.trim_end());
        return Ok(ExitCode::SUCCESS);
    };
    let table = toml::Value::Table(toml::from_str(&text)?);
    let value = key.split('.').try_fold(&table, |place, part| place.get(part));
    match value.ok_or_else(|| anyhow!("--get {key}: the scenario has no such key"))? {
        toml::Value::Table(table) => {
            table.iter().for_each(|(key, value)| output::print(&format!("{key}={}", word(value))));
        }
        value => output::print(&word(value)),
    }
    Ok(ExitCode::SUCCESS)
}

/// A value as an agent reads it: a text without its quotes.
fn word(value: &toml::Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}
