//! The parser of plan files, which knows the line of each key.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use msgs::ids::Tick;
use serde::Deserialize;
use sim_server::setup;
use simulation::scenario::{Scenario, ScenarioError, syntax_text};
use system::input_file::{self, TEXT_BYTES_MAX};
use toml::Spanned;

use super::dimensions::{Change, VARIANT};
use super::maps::{self, MapFile};
use super::{Axis, AxisValue, Measure, PlanError, RUNS_MAX, Variant, files};

/// Tables of the scenario whose keys belong together: a variant replaces them as a whole.
const WHOLE_TABLES: [&str; 1] = ["spawn"];

/// Most axes of a plan: each is part of the name of every run.
const AXES_MAX: usize = 100;

/// The keys that every scenario has, tables before their keys.
const REQUIRED: [&str; 6] = ["duration_s", "map", "map.kind", "map.size", "agents", "agents.count"];

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
    /// The same as a table.
    pub(super) base: toml::Table,
    /// Line of the plan that names or begins the base scenario, counted from 1.
    pub(super) scenario_line: usize,
    /// See [`super::Plan::compare`].
    pub(super) compare: Vec<String>,
    /// See [`super::Plan::primary`].
    pub(super) primary: Measure,
    /// In the order of the file; their names differ.
    pub(super) variants: Vec<Variant>,
    /// In the order of the file; no axis is empty.
    pub(super) axes: Vec<Axis>,
    /// The map files that `maps` names.
    pub(super) maps: Vec<MapFile>,
    /// Line of the plan with `maps`.
    maps_line: usize,
    /// Distinct, and at least one.
    pub(super) seeds: Vec<u64>,
    /// When what is compared begins to differ; empty: at the start.
    pub(super) forks: Vec<Fork>,
    /// See [`super::Plan::oracle`].
    pub(super) oracle: bool,
}

/// A time from which on what is compared differs.
pub(super) struct Fork {
    pub(super) at_s: f64,
    pub(super) tick: Tick,
    /// Line of the plan, counted from 1.
    pub(super) line: usize,
}

impl Draft {
    /// Whether a change belongs to what the plan compares.
    pub(super) fn is_compared(&self, change: &Change) -> bool {
        let is_set_by = |key: &str| change.key == key || change.key.starts_with(&format!("{key}."));
        self.compare.iter().any(|key| is_set_by(key))
            || self.variants.iter().any(|variant| variant.changes.contains(change))
    }

    /// The change that gives the base scenario one of the map files: its own map goes, except for
    /// the options of an importer and the length of a cell.
    pub(super) fn map_change(&self, file: &str, map: &MapFile) -> Change {
        let mut table = toml::Table::new();
        if let Some(of_file) =
            self.base.get("map").filter(|map| map.get("kind").and_then(toml::Value::as_str) == Some("file"))
        {
            let kept = |key: &str| Some((key.to_owned(), of_file.get(key)?.clone()));
            table.extend(["cell_m", "import"].into_iter().filter_map(kept));
        }
        let path = map.path.to_string_lossy().into_owned();
        table.extend([("kind".to_owned(), "file".into()), ("file".to_owned(), path.clone().into())]);
        Change {
            origin: format!("{file}:{}: maps: {path:?}", self.maps_line),
            line: self.maps_line,
            key: "map".to_owned(),
            value: Some(toml::Value::Table(table)),
        }
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PlanFile {
    scenario: Spanned<toml::Value>,
    seeds: Spanned<toml::Value>,
    folder: Option<Spanned<String>>,
    #[serde(default)]
    axes: BTreeMap<Spanned<String>, Vec<Spanned<toml::Value>>>,
    #[serde(default)]
    compare: Option<Spanned<toml::Value>>,
    #[serde(default)]
    primary: Option<Spanned<toml::Value>>,
    #[serde(default)]
    variant: Vec<BTreeMap<Spanned<String>, Spanned<toml::Value>>>,
    #[serde(default)]
    maps: Option<Spanned<toml::Value>>,
    #[serde(default)]
    fork: Option<ForkTable>,
    #[serde(default)]
    oracle: bool,
    /// For the report.
    #[expect(dead_code, reason = "read for its type")]
    #[serde(default)]
    title: Option<String>,
}

/// `[fork]`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ForkTable {
    at_s: Spanned<Vec<f64>>,
}

/// The base scenario of a plan alone, parsed for errors with a line.
#[derive(Deserialize)]
struct Base {
    #[expect(dead_code, reason = "read for its errors")]
    scenario: Scenario,
}

pub(super) fn read(file: &str, text: &str, folder: &Path) -> Result<Draft, PlanError> {
    // Looked up for every value of an axis, so it must not count the lines each time.
    let breaks: Vec<usize> = text.match_indices('\n').map(|(at, _)| at).collect();
    let line_at = |at: usize| breaks.partition_point(|line_break| *line_break < at) + 1;
    let at_line = |line: usize, reason: String| PlanError::Line { file: file.to_owned(), line, reason };
    let syntax = |error: toml::de::Error| {
        let line = line_at(error.span().map_or(0, |span| span.start));
        at_line(line, syntax_text(&error, text).lines().map(str::trim).collect::<Vec<_>>().join("; "))
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
    let variants = variants(file, plan.variant, line_at).map_err(|(line, reason)| at_line(line, reason))?;
    check_overlaps(&variants, &axes, plan.maps.is_some()).map_err(|(line, reason)| at_line(line, reason))?;
    let compare = compare(plan.compare.as_ref().map(Spanned::get_ref), &variants, &axes).map_err(|reason| {
        at_line(plan.compare.as_ref().map_or(1, |compare| line_at(compare.span().start)), format!("compare: {reason}"))
    })?;
    let primary = match &plan.primary {
        Some(named) => named.get_ref().as_str().and_then(Measure::named).ok_or_else(|| {
            let reason = format!("primary = {}: {}", named.get_ref(), Measure::expected());
            at_line(line_at(named.span().start), reason)
        })?,
        None => Measure::default(),
    };
    let forks = match &plan.fork {
        Some(fork) => {
            let line = line_at(fork.at_s.span().start);
            forks(fork.at_s.get_ref(), line, !compare.is_empty()).map_err(|reason| at_line(line, reason))?
        }
        None => Vec::new(),
    };
    let maps_line = plan.maps.as_ref().map_or(1, |maps| line_at(maps.span().start));
    let maps = match &plan.maps {
        Some(named) => {
            let start = copies.as_ref().map_or(folder.to_owned(), |copies| folder.join(copies));
            maps::files(named.get_ref(), &start).map_err(|reason| at_line(maps_line, format!("maps: {reason}")))?
        }
        None => Vec::new(),
    };
    let counts =
        axes.iter().map(|axis| axis.values.len()).chain([variants.len().max(1), maps.len().max(1), forks.len().max(1)]);
    let runs = counts.into_iter().try_fold(seeds.len(), usize::checked_mul);
    if runs.is_none_or(|runs| runs > RUNS_MAX) {
        return Err(at_line(1, format!("axes and seeds make more runs than the {RUNS_MAX} that are allowed")));
    }
    let mut edits = Vec::new();
    if let Some(named) = &plan.maps {
        edits.push((named.span(), listed(&maps)));
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
            let line = text[..plan.scenario.span().start].rfind('\n').map_or(0, |at| at + 1);
            edits.push((line..line, "# ".to_owned()));
            (name, base.clone(), edited(text, edits) + "\n" + &as_scenario(&base))
        }
        toml::Value::Table(base) => (file.to_owned(), base.clone(), edited(text, edits)),
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
    if let Some(map) = maps.first()
        && !base.contains_key("map")
    {
        let file = map.path.to_string_lossy().into_owned();
        let map = [("kind".to_owned(), "file".into()), ("file".to_owned(), file.into())];
        base.insert("map".to_owned(), toml::Value::Table(map.into_iter().collect()));
    }
    complete(&mut base, &axes, &variants);
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
    let text = self_contained;
    Ok(Draft {
        text,
        folder: copies,
        scenario_name,
        scenario_text,
        base,
        scenario_line,
        compare,
        primary,
        variants,
        axes,
        maps,
        maps_line,
        seeds,
        forks,
        oracle: plan.oracle,
    })
}

/// Gives the base scenario the keys that every scenario has, where it leaves them to an axis or to
/// each of the variants: they have a value in every combination.
fn complete(base: &mut toml::Table, axes: &[Axis], variants: &[Variant]) {
    for key in REQUIRED {
        let of_axes = axes.iter().find(|axis| axis.key == key).map(|axis| axis.values[0].value.clone());
        let of_variant = |variant: &Variant| {
            let change = variant.changes.iter().find(|change| change.key == key);
            change.and_then(|change| change.value.clone())
        };
        let of_variants = variants.iter().map(of_variant).collect::<Option<Vec<_>>>();
        let value = of_axes.or_else(|| of_variants?.into_iter().next());
        let (table, leaf) = match key.split_once('.') {
            Some((section, leaf)) if value.is_some() => {
                let section = base.entry(section).or_insert_with(|| toml::Value::Table(toml::Table::new()));
                (section.as_table_mut(), leaf)
            }
            _ => (Some(&mut *base), key),
        };
        if let (Some(table), Some(value)) = (table, value) {
            table.entry(leaf).or_insert(value);
        }
    }
}

/// The times of `[fork]`.
fn forks(times_s: &[f64], line: usize, is_compared: bool) -> Result<Vec<Fork>, String> {
    if !is_compared {
        return Err(
            "fork: expected `compare` or `[[variant]]` beside it, which say what differs from then on".to_owned()
        );
    }
    let mut forks: Vec<Fork> = Vec::new();
    let mut ticks = BTreeSet::new();
    for &at_s in times_s {
        let tick = setup::tick_at(at_s).map_err(|expected| format!("fork.at_s = {at_s}: {expected}"))?;
        if !ticks.insert(tick) {
            return Err(format!("fork.at_s: {at_s} is listed twice"));
        }
        forks.push(Fork { at_s, tick, line });
    }
    if forks.is_empty() { Err("fork.at_s = []: expected at least one time".to_owned()) } else { Ok(forks) }
}

/// A list of the files as a value of TOML.
fn listed(maps: &[MapFile]) -> String {
    let texts = maps.iter().map(|map| toml::Value::from(map.path.to_string_lossy().into_owned()));
    toml::Value::Array(texts.collect()).to_string()
}

/// A text in which each range is replaced; ranges do not overlap.
fn edited(text: &str, mut edits: Vec<(std::ops::Range<usize>, String)>) -> String {
    edits.sort_by_key(|(range, _)| std::cmp::Reverse(range.start));
    let mut edited = text.to_owned();
    for (range, new) in edits {
        edited.replace_range(range, &new);
    }
    edited
}

/// The base scenario as the table of a plan.
fn as_scenario(base: &toml::Table) -> String {
    let table = toml::Table::from_iter([("scenario".to_owned(), toml::Value::Table(base.clone()))]);
    toml::to_string(&table).expect("a table that was read can be written")
}

/// The keys that `compare` names, or the variants.
fn compare(value: Option<&toml::Value>, variants: &[Variant], axes: &[Axis]) -> Result<Vec<String>, String> {
    let known = axes.iter().map(|axis| format!("`{}`", axis.key)).collect::<Vec<_>>().join(", ");
    let expected = || format!("expected an axis of the plan, or a list of them; the axes are {known}");
    let keys: Vec<String> = match value {
        None if variants.is_empty() => return Ok(Vec::new()),
        None => return Ok(vec![VARIANT.to_owned()]),
        Some(_) if !variants.is_empty() => {
            return Err("expected either `compare` or `[[variant]]`: variants are what is compared".to_owned());
        }
        Some(toml::Value::String(key)) => vec![key.clone()],
        Some(toml::Value::Array(list)) if !list.is_empty() => {
            let keys: Option<_> = list.iter().map(|key| key.as_str().map(str::to_owned)).collect();
            keys.ok_or_else(expected)?
        }
        Some(_) => return Err(expected()),
    };
    if let Some(twice) = keys.iter().enumerate().find(|(at, key)| keys[..*at].contains(key)) {
        return Err(format!("{:?} is listed twice", twice.1));
    }
    match keys.iter().find(|key| axes.iter().all(|axis| axis.key != **key)) {
        Some(key) => Err(format!("{key:?}: {}{}", expected(), nearest(key, axes))),
        None => Ok(keys),
    }
}

/// A suggestion for a key that is no axis, or nothing.
fn nearest(key: &str, axes: &[Axis]) -> String {
    let last = |key: &str| key.rsplit('.').next().unwrap_or_default().to_owned();
    let same = axes.iter().find(|axis| last(&axis.key) == last(key));
    same.map_or_else(String::new, |axis| format!("; did you mean `{}`?", axis.key))
}

/// A key has one place in a plan: an axis, the variants, or `maps`.
fn check_overlaps(variants: &[Variant], axes: &[Axis], has_maps: bool) -> Result<(), (usize, String)> {
    let overlap = |one: &str, other: &str| {
        let within = |inner: &str, outer: &str| inner == outer || inner.starts_with(&format!("{outer}."));
        within(one, other) || within(other, one)
    };
    for axis in axes {
        let line = axis.values[0].line;
        if has_maps && overlap(&axis.key, "map") {
            return Err((line, format!("axes.\"{}\": `maps` gives the maps; leave one of them out", axis.key)));
        }
        for variant in variants {
            if let Some(change) = variant.changes.iter().find(|change| overlap(&change.key, &axis.key)) {
                let (key, name) = (&axis.key, &variant.name);
                let reason = format!("axes.\"{key}\": variant {name:?} sets {}; leave one of them out", change.key);
                return Err((line, reason));
            }
        }
    }
    let change = variants.iter().flat_map(|variant| &variant.changes).find(|change| overlap(&change.key, "map"));
    match change.filter(|_| has_maps) {
        Some(change) => Err((change.line, format!("{}: `maps` gives the maps; leave one of them out", change.key))),
        None => Ok(()),
    }
}

/// The variants; each value is one change of the base scenario.
fn variants(
    file: &str,
    tables: Vec<BTreeMap<Spanned<String>, Spanned<toml::Value>>>,
    line_at: impl Fn(usize) -> usize,
) -> Result<Vec<Variant>, (usize, String)> {
    const EXPECTED: &str = "expected a name of its own for each [[variant]], such as name = \"far\"";
    let mut variants: Vec<Variant> = Vec::new();
    let mut names = BTreeSet::new();
    for table in tables {
        let mut keys: Vec<_> =
            table.into_iter().map(|(key, value)| (key.span().start, key.into_inner(), value)).collect();
        keys.sort_by_key(|(place, ..)| *place);
        let first = keys.first().map_or(1, |(place, ..)| line_at(*place));
        let name = keys.iter().find(|(_, key, _)| key == "name");
        let (line, name) = match name.map(|(place, _, value)| (line_at(*place), value.get_ref())) {
            Some((line, toml::Value::String(name))) => (line, name.trim().to_owned()),
            Some((line, _)) => return Err((line, format!("variant: name: {EXPECTED}"))),
            None => return Err((first, format!("variant: {EXPECTED}"))),
        };
        if name.is_empty() || !names.insert(name.clone()) {
            return Err((line, format!("variant: name = {name:?}: {EXPECTED}")));
        }
        let mut changes = Vec::new();
        for (place, key, value) in keys.into_iter().filter(|(_, key, _)| key != "name") {
            let line = line_at(place);
            for (key, value) in leaves(key, value.into_inner()) {
                let origin = format!("{file}:{line}: variant {name:?}: {key} = {value}");
                changes.push(Change { origin, line, key, value: Some(value) });
            }
        }
        variants.push(Variant { name, line, changes });
    }
    Ok(variants)
}

/// The values within a table with their dotted paths.
fn leaves(key: String, value: toml::Value) -> Vec<(String, toml::Value)> {
    match value {
        toml::Value::Table(table) if !WHOLE_TABLES.contains(&key.as_str()) => {
            table.into_iter().flat_map(|(inner, value)| leaves(format!("{key}.{inner}"), value)).collect()
        }
        value => vec![(key, value)],
    }
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
    // Every run has a value of every axis.
    if let Some((key, _)) = placed.get(AXES_MAX) {
        return Err((line_at(key.span().start), format!("axes: {}: expected at most {AXES_MAX}", placed.len())));
    }
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
            let mut texts = BTreeSet::new();
            match values.iter().find(|value| !texts.insert(value.value.to_string())) {
                Some(value) => Err((value.line, format!("axes.\"{key}\": {} is listed twice", value.value))),
                None => Ok(Axis { key, values }),
            }
        })
        .collect()
}
