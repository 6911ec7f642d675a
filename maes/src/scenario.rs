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
    match value_at(&table, key).ok_or_else(|| without_value(&table, key))? {
        toml::Value::Table(table) => {
            table.iter().for_each(|(key, value)| output::print(&format!("{key}={}", word(value))));
        }
        value => output::print(&word(value)),
    }
    Ok(ExitCode::SUCCESS)
}

/// The value of a key in a table, by its dotted path.
fn value_at<'t>(table: &'t toml::Value, path: &str) -> Option<&'t toml::Value> {
    path.split('.').try_fold(table, |place, part| place.get(part))
}

/// Why a scenario, all of whose keys are written out, has no value of a key.
fn without_value(scenario: &toml::Value, key: &str) -> anyhow::Error {
    let Some(declared) = keys::find(key) else {
        return match keys::table(key) {
            Some(_) => anyhow!("--get {key}: the table is not set"),
            None => anyhow!("--get {key}: {}", unknown_key(key)),
        };
    };
    let table = key.rsplit_once('.').map_or(Some(scenario), |(table, _)| value_at(scenario, table));
    let kind = table.and_then(|table| table.get("kind")).and_then(toml::Value::as_str);
    match (kind.filter(|kind| !declared.only_with.is_empty() && !declared.only_with.contains(kind)), declared.default) {
        (Some(kind), _) => {
            let kinds: Vec<String> = declared.only_with.iter().map(|kind| format!("{kind:?}")).collect();
            anyhow!("--get {key}: it is not set with kind = {kind:?}, only with {}", kinds.join(" or "))
        }
        (None, DefaultValue::Unset(meaning)) => anyhow!("--get {key}: it is not set, which stands for {meaning}"),
        (None, _) => anyhow!("--get {key}: its table is not set"),
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
        let scenario: toml::Table = "spawn = { kind = \"list\" }".parse().unwrap();
        let scenario = toml::Value::Table(scenario);
        for (key, expected) in [
            ("map.seed", "--get map.seed: it is not set, which stands for that of the run"),
            ("energy.reserve", "--get energy.reserve: its table is not set"),
            (
                "spawn.min_distance_m",
                "--get spawn.min_distance_m: it is not set with kind = \"list\", only with \"scattered\"",
            ),
            ("energy", "--get energy: the table is not set"),
            ("body.knd", "--get body.knd: unknown key `body.knd`; did you mean `body.kind`?"),
            ("bdy.kind", "--get bdy.kind: unknown key `bdy`; did you mean `body`?"),
            ("agents.set.turn_rad", "--get agents.set.turn_rad: unknown key `agents.set.turn_rad`"),
        ] {
            assert_eq!(without_value(&scenario, key).to_string(), expected);
        }
    }
}
