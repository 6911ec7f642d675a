//! The parser of plan files, which knows the line of each key.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Deserialize;
use sim_server::input_file::{self, TEXT_BYTES_MAX};
use simulation::scenario::{Scenario, ScenarioError};
use toml::Spanned;

use super::{Axis, AxisValue, PlanError, RUNS_MAX, files};

/// The allowed values of `seeds`, for error messages.
pub const SEEDS_EXPECTED: &str = "expected seeds from 0 to 9223372036854775807: a range such as \"1..30\", which \
                                  includes both ends, or a list such as [1, 2, 7]";

/// A plan before its expansion.
pub(super) struct Draft {
    /// See [`super::Plan::text`].
    pub(super) text: String,
    /// See [`super::files`].
    pub(super) folder: Option<String>,
    /// Name of the base scenario for error messages.
    pub(super) scenario_name: String,
    pub(super) scenario_text: String,
    /// Line of the plan that names or begins the base scenario, counted from 1.
    pub(super) scenario_line: usize,
    /// In the order of the file; no axis is empty.
    pub(super) axes: Vec<Axis>,
    /// Distinct, and at least one.
    pub(super) seeds: Vec<u64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PlanFile {
    scenario: Spanned<toml::Value>,
    seeds: Spanned<toml::Value>,
    folder: Option<Spanned<String>>,
    #[serde(default)]
    axes: BTreeMap<Spanned<String>, Vec<Spanned<toml::Value>>>,
}

/// The base scenario of a plan alone, parsed for errors with a line.
#[derive(Deserialize)]
struct Base {
    #[expect(dead_code, reason = "read for its errors")]
    scenario: Scenario,
}

pub(super) fn read(file: &str, text: &str, folder: &Path) -> Result<Draft, PlanError> {
    let line_at = |at: usize| text[..at.min(text.len())].matches('\n').count() + 1;
    let at_line = |line: usize, reason: String| PlanError::Line { file: file.to_owned(), line, reason };
    let syntax = |error: toml::de::Error| {
        let line = line_at(error.span().map_or(0, |span| span.start));
        at_line(line, error.message().lines().map(str::trim).collect::<Vec<_>>().join("; "))
    };
    let plan: PlanFile = toml::from_str(text).map_err(syntax)?;
    let scenario_line = line_at(plan.scenario.span().start);
    let seeds = seeds(plan.seeds.get_ref())
        .map_err(|reason| at_line(line_at(plan.seeds.span().start), format!("seeds: {reason}")))?;
    if let Some(wrong) = plan.folder.as_ref().filter(|folder| !files::is_folder(folder.get_ref())) {
        let reason = format!("folder = {:?}: {}", wrong.get_ref(), files::FOLDER_EXPECTED);
        return Err(at_line(line_at(wrong.span().start), reason));
    }
    let copies = plan.folder.map(Spanned::into_inner);
    let axes = axes(plan.axes, line_at).map_err(|(line, reason)| at_line(line, reason))?;
    let runs = axes.iter().try_fold(seeds.len(), |runs, axis| runs.checked_mul(axis.values.len()));
    if runs.is_none_or(|runs| runs > RUNS_MAX) {
        return Err(at_line(1, format!("axes and seeds make more runs than the {RUNS_MAX} that are allowed")));
    }
    let (scenario_name, mut base, self_contained) = match plan.scenario.get_ref() {
        toml::Value::String(named) => {
            let path = folder.join(named);
            let name = path.display().to_string();
            let base_text = input_file::read_text(&path, TEXT_BYTES_MAX)
                .map_err(|source| at_line(scenario_line, format!("scenario = {named:?}: {name}: {source}")))?;
            // For errors with a line of that file.
            Scenario::parse(&name, &base_text, &[])?;
            let base: toml::Table = toml::from_str(&base_text).map_err(syntax)?;
            let contained = with_base(text, &plan.scenario, &base);
            (name, base, contained)
        }
        toml::Value::Table(base) => (file.to_owned(), base.clone(), text.to_owned()),
        _ => {
            return Err(at_line(
                scenario_line,
                "scenario: expected the name of a scenario file, or a table".to_owned(),
            ));
        }
    };
    if !base.contains_key("seed") {
        base.insert("seed".to_owned(), 0.into());
    }
    if plan.scenario.get_ref().is_table()
        && let Err(error) = base.clone().try_into::<Scenario>()
    {
        let placed = toml::from_str::<Base>(text).err().filter(|placed| !placed.message().contains("`seed`"));
        return Err(placed.map_or_else(|| at_line(scenario_line, format!("scenario: {}", error.message())), syntax));
    }
    let scenario_text = toml::to_string(&base).map_err(|error| at_line(scenario_line, error.to_string()))?;
    if let Err(ScenarioError::Value { key, value, allowed, .. }) = Scenario::parse(&scenario_name, &scenario_text, &[])
    {
        return Err(at_line(scenario_line, format!("scenario: {key} = {value}: {allowed}")));
    }
    Ok(Draft { text: self_contained, folder: copies, scenario_name, scenario_text, scenario_line, axes, seeds })
}

/// The text of a plan in which the base scenario, appended as a table, replaces the name of its
/// file.
fn with_base(text: &str, scenario: &Spanned<toml::Value>, base: &toml::Table) -> String {
    let span = scenario.span();
    let start = text[..span.start].rfind('\n').map_or(0, |at| at + 1);
    let end = text[span.end..].find('\n').map_or(text.len(), |at| span.end + at + 1);
    let table = toml::Table::from_iter([("scenario".to_owned(), toml::Value::Table(base.clone()))]);
    let base = toml::to_string(&table).expect("a table that was read can be written");
    format!("{}# {}{}\n{base}", &text[..start], &text[start..end], &text[end..])
}

fn seeds(value: &toml::Value) -> Result<Vec<u64>, String> {
    let expected = || SEEDS_EXPECTED.to_owned();
    let seeds: Vec<u64> = match value {
        toml::Value::String(range) => {
            let (first, last) = range.split_once("..").ok_or_else(expected)?;
            let number = |text: &str| text.trim().parse::<u64>().ok().filter(|&seed| i64::try_from(seed).is_ok());
            let (first, last) = number(first).zip(number(last)).ok_or_else(expected)?;
            if last < first || last - first >= RUNS_MAX as u64 {
                return Err(format!("the range \"{range}\" has no seeds, or more than {RUNS_MAX}"));
            }
            (first..=last).collect()
        }
        toml::Value::Array(list) => {
            let number = |value: &toml::Value| value.as_integer().and_then(|seed| u64::try_from(seed).ok());
            list.iter().map(number).collect::<Option<_>>().ok_or_else(expected)?
        }
        _ => return Err(expected()),
    };
    if seeds.is_empty() {
        return Err(format!("no seeds; {SEEDS_EXPECTED}"));
    }
    let mut sorted = seeds.clone();
    sorted.sort_unstable();
    match sorted.windows(2).find(|pair| pair[0] == pair[1]) {
        Some(pair) => Err(format!("{} is listed twice", pair[0])),
        None => Ok(seeds),
    }
}

fn axes(
    axes: BTreeMap<Spanned<String>, Vec<Spanned<toml::Value>>>,
    line_at: impl Fn(usize) -> usize,
) -> Result<Vec<Axis>, (usize, String)> {
    let mut placed: Vec<_> = axes.into_iter().collect();
    placed.sort_by_key(|(key, _)| key.span().start);
    placed
        .into_iter()
        .map(|(key, values)| {
            let line = line_at(key.span().start);
            let key = key.into_inner();
            if values.is_empty() {
                return Err((line, format!("axes.\"{key}\" = []: expected at least one value")));
            }
            let values: Vec<AxisValue> = values
                .into_iter()
                .map(|value| AxisValue { line: line_at(value.span().start), value: value.into_inner() })
                .collect();
            let twice = values
                .iter()
                .enumerate()
                .find(|(at, value)| values[..*at].iter().any(|other| other.value == value.value));
            match twice {
                Some((_, value)) => Err((value.line, format!("axes.\"{key}\": {} is listed twice", value.value))),
                None => Ok(Axis { key, values }),
            }
        })
        .collect()
}
