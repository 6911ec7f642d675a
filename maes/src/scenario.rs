//! `maes scenario`: a scenario with all its keys, or one of them.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::anyhow;
use clap::Args;
use sim_server::cli::{KeyArgs, recording_path};
use sim_server::setup;
use simulation::scenario::keys::{self, DefaultValue};
use simulation::scenario::unknown_key;

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
    let complete = scenario.to_complete();
    let Some(key) = &args.get else {
        output::print(toml::to_string(&complete)?.trim_end());
        return Ok(ExitCode::SUCCESS);
    };
    let table = toml::Value::Table(complete);
    let value = key.split('.').try_fold(&table, |place, part| place.get(part));
    match value.ok_or_else(|| without_value(key))? {
        toml::Value::Table(table) => {
            table.iter().for_each(|(key, value)| output::print(&format!("{key}={}", word(value))));
        }
        value => output::print(&word(value)),
    }
    Ok(ExitCode::SUCCESS)
}

/// Why a scenario has no value of a key.
fn without_value(key: &str) -> anyhow::Error {
    match keys::find(key).map(|declared| declared.default) {
        Some(DefaultValue::Unset(meaning)) => anyhow!("--get {key}: it is not set, which stands for {meaning}"),
        Some(_) => anyhow!("--get {key}: its table is not set"),
        None if keys::table(key).is_some() => anyhow!("--get {key}: the table is not set"),
        None => anyhow!("--get {key}: {}", unknown_key(key)),
    }
}

/// A value as an agent reads it: a text without its quotes.
fn word(value: &toml::Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_without_a_value_are_told_from_unknown_ones() {
        for (key, expected) in [
            ("map.seed", "--get map.seed: it is not set, which stands for that of the run"),
            ("energy.reserve", "--get energy.reserve: its table is not set"),
            ("energy", "--get energy: the table is not set"),
            ("body.knd", "--get body.knd: unknown key `body.knd`; did you mean `body.kind`?"),
            ("bdy.kind", "--get bdy.kind: unknown key `bdy`; did you mean `body`?"),
            ("agents.set.turn_rad", "--get agents.set.turn_rad: unknown key `agents.set.turn_rad`"),
        ] {
            assert_eq!(without_value(key).to_string(), expected);
        }
    }
}
