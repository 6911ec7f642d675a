//! The keys of a scenario, declared once: type, unit, default, range, meaning and source of each.
//!
//! [`TABLES`] is the one place where a key is described. The range checks of a scenario, its error
//! messages, the ROS parameters and the help of the flags read it; the tables of docs/scenario.md,
//! the JSON schema beside the scenario files and the data of the start form in the viewer are
//! generated from it by the tests; and the tests compare it with the structs that serde reads.
//!
//! Conditions between several keys are checked in [`super::Scenario::check`], and the limits of a
//! map by the crate mapgen.

mod declaration;
#[cfg(test)]
mod tests;

use std::f64::consts::TAU;

pub use declaration::TABLES;

/// A table of a scenario and the keys that it holds, subtables left out.
#[derive(Debug)]
pub struct Table {
    /// Dotted path, such as `map.spheres`; empty for the top level.
    pub path: &'static str,
    /// Its keys, in the order of docs/scenario.md.
    pub keys: &'static [Key],
    /// Whether mapgen checks the ranges, since they depend on the size of the map.
    is_checked_by_mapgen: bool,
}

/// A key of a scenario.
#[derive(Debug, Clone, Copy)]
pub struct Key {
    /// Last part of its path.
    pub name: &'static str,
    /// Type and unit of its value.
    pub kind: Kind,
    /// The value of a scenario that leaves it out.
    pub default: DefaultValue,
    /// Range of its numbers.
    pub range: Option<Range>,
    /// What is allowed, in Markdown, where the range does not say it all.
    pub limits: &'static str,
    /// The values of the key `kind` in the same table that have this key; empty: all.
    pub only_with: &'static [&'static str],
    /// What it means, as plain text without a full stop.
    pub meaning: &'static str,
    /// Where the default comes from, in Markdown.
    pub source: &'static str,
    /// The document with more, relative to docs/; may be empty.
    pub see: &'static str,
    /// Whether an event or a fork may change it during a run.
    pub is_changeable: bool,
    is_checked_elsewhere: bool,
}

/// Type of a value; a text is its unit, empty for a plain number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// `true` or `false`.
    Boolean,
    /// An integer that is not negative.
    Integer(&'static str),
    /// A number, with or without a decimal point.
    Number(&'static str),
    /// A number, or the word `max`.
    NumberOrMax,
    /// A seed: every integer of TOML that is not negative.
    Seed,
    /// One of these words.
    Word(&'static [&'static str]),
    /// A list of these words.
    Words(&'static [&'static str]),
    /// A text.
    Name,
    /// A list of texts.
    Texts,
    /// Path of a file.
    Path,
    /// A list of ids of agents.
    Ids,
    /// `[x, y, z]`.
    Position(&'static str),
    /// A list of `[x, y, z]`.
    Positions(&'static str),
    /// `[x, y, z, x, y, z]`, the lowest corner of a box and its highest one.
    Corners(&'static str),
    /// A list of numbers.
    Numbers(&'static str),
    /// A list of numbers from 0 to 255.
    Bytes,
    /// A list of `[x, y, z]` and `[x, y, z, yaw]`, metres and radians.
    Poses,
    /// Cells along each axis: an integer, or `[x, y, z]`.
    Size,
    /// A table whose keys belong to the controller.
    Settings,
    /// A table of dotted keys of the scenario with their values.
    Keys,
}

/// What holds if a key is left out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DefaultValue {
    /// It must not be left out.
    Required,
    /// This value, as TOML.
    Is(&'static str),
    /// No value of its own; the Markdown says what that means.
    Unset(&'static str),
}

/// An interval of numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Range {
    /// The lower end.
    pub low: f64,
    /// The upper end, included; may be infinite.
    pub high: f64,
    /// Whether the lower end is excluded.
    pub is_low_excluded: bool,
}

/// Finite lengths, speeds and durations.
const POSITIVE: Option<Range> = above(0.0, 1e6);

const fn between(low: f64, high: f64) -> Option<Range> {
    Some(Range { low, high, is_low_excluded: false })
}

/// `high` is the greatest value of the type.
const fn at_least(low: f64, high: f64) -> Option<Range> {
    between(low, high)
}

const fn above(low: f64, high: f64) -> Option<Range> {
    Some(Range { low, high, is_low_excluded: true })
}

const fn key(
    name: &'static str,
    kind: Kind,
    default: DefaultValue,
    range: Option<Range>,
    meaning: &'static str,
    source: &'static str,
) -> Key {
    Key {
        name,
        kind,
        default,
        range,
        limits: "",
        only_with: &[],
        meaning,
        source,
        see: "",
        is_changeable: false,
        is_checked_elsewhere: false,
    }
}

impl Range {
    /// Whether a number lies in it; NaN does not.
    #[must_use]
    pub fn contains(&self, number: f64) -> bool {
        let is_above = if self.is_low_excluded { number > self.low } else { number >= self.low };
        is_above && number <= self.high
    }

    /// In words, such as `0 to 1` or `above 0, up to 1e6`.
    #[must_use]
    pub fn text(&self) -> String {
        let (low, high) = (number_text(self.low), number_text(self.high));
        match (self.is_low_excluded, self.high) {
            (true, f64::INFINITY) => format!("above {low}, or inf"),
            (true, _) => format!("above {low}, up to {high}"),
            (false, f64::INFINITY) => format!("at least {low}, or inf"),
            (false, _) if self.high >= f64::from(u32::MAX) => format!("at least {low}"),
            (false, _) => format!("{low} to {high}"),
        }
    }
}

/// A bound as people write it.
fn number_text(number: f64) -> String {
    match number {
        TAU => "2 pi".to_owned(),
        number if number == -TAU => "-2 pi".to_owned(),
        number if number >= 1e6 && number % 1e6 == 0.0 && number <= 1e10 => format!("{number:e}"),
        number => number.to_string(),
    }
}

impl Table {
    const fn new(path: &'static str, keys: &'static [Key]) -> Self {
        Self { path, keys, is_checked_by_mapgen: false }
    }

    const fn checked_by_mapgen(self) -> Self {
        Self { is_checked_by_mapgen: true, ..self }
    }

    /// Whether it is a list of tables, such as `[[bodies]]`.
    #[must_use]
    pub fn is_list(&self) -> bool {
        ["agents.mix", "bodies", "lidars", "event", "obstacle"].contains(&self.path)
    }

    /// The dotted path of a key of this table.
    #[must_use]
    pub fn path_of(&self, name: &str) -> String {
        if self.path.is_empty() { name.to_owned() } else { format!("{}.{name}", self.path) }
    }

    /// The keys that it may hold: its own, and for an entry of `[[bodies]]` or `[[lidars]]` those
    /// of `[body]` or `[lidar]`.
    pub fn keys(&self) -> impl Iterator<Item = &'static Key> {
        let inherited = self.inherited_from().and_then(table);
        self.keys.iter().chain(inherited.into_iter().flat_map(|table| table.keys))
    }

    /// The table whose keys its entries have as well.
    #[must_use]
    pub fn inherited_from(&self) -> Option<&'static str> {
        match self.path {
            "bodies" => Some("body"),
            "lidars" => Some("lidar"),
            _ => None,
        }
    }

    /// The last parts of the paths of the tables in it.
    pub fn subtables(&self) -> impl Iterator<Item = &'static str> {
        let parent = self.path;
        TABLES.iter().filter(|table| !table.path.is_empty()).filter_map(move |table| {
            let (before, name) = table.path.rsplit_once('.').unwrap_or(("", table.path));
            (before == parent).then_some(name)
        })
    }
}

impl Key {
    const fn limits(self, limits: &'static str) -> Self {
        Self { limits, ..self }
    }

    const fn only_with(self, only_with: &'static [&'static str]) -> Self {
        Self { only_with, ..self }
    }

    const fn see(self, see: &'static str) -> Self {
        Self { see, ..self }
    }

    const fn checked_elsewhere(self) -> Self {
        Self { is_checked_elsewhere: true, ..self }
    }

    const fn changeable(self) -> Self {
        Self { is_changeable: true, ..self }
    }

    /// What is allowed, in Markdown; empty if the type says it all.
    #[must_use]
    pub fn allowed(&self) -> String {
        let values = match (self.limits, self.kind, self.range) {
            ("", Kind::Word(words) | Kind::Words(words), _) => {
                words.iter().map(|word| format!("`\"{word}\"`")).collect::<Vec<_>>().join(", ")
            }
            ("", Kind::Seed, _) => SEEDS.to_owned(),
            ("", _, range) => range.map(|range| range.text()).unwrap_or_default(),
            (limits, ..) => limits.to_owned(),
        };
        match self.only_with {
            [] => values,
            kinds => {
                let separator = if values.is_empty() { "" } else { "; " };
                format!("{values}{separator}only with {}", listed(kinds, "and", |kind| format!("`\"{kind}\"`")))
            }
        }
    }

    /// What an error says about a number out of range.
    #[must_use]
    pub fn expected_range(&self) -> String {
        match self.range {
            Some(range) if self.kind == Kind::NumberOrMax => format!("expected {}, or \"max\"", range.text()),
            Some(range) if range.is_low_excluded => format!("expected a number {}", range.text()),
            Some(range) => format!("expected {}", range.text()),
            None => self.expected(),
        }
    }

    /// What an error says about a value of another type.
    #[must_use]
    pub fn expected(&self) -> String {
        let of_unit = |unit: &str| if unit.is_empty() { String::new() } else { format!(" ({unit})") };
        let in_range = |separator| self.range.map(|range| format!("{separator}{}", range.text())).unwrap_or_default();
        let quoted = |word: &&str| format!("\"{word}\"");
        match self.kind {
            Kind::Boolean => "expected true or false".to_owned(),
            Kind::Integer(unit) => format!("expected an integer{}{}", of_unit(unit), in_range(", ")),
            Kind::Number(unit) => format!("expected a number{}{}", of_unit(unit), in_range(", ")),
            Kind::NumberOrMax => format!("expected a number{}, or \"max\"", in_range(", ")),
            Kind::Seed => format!("expected a seed from {SEEDS}"),
            Kind::Word(words) => format!("expected {}", listed(words, "or", quoted)),
            Kind::Words(words) => format!("expected a list of the words {}", listed(words, "and", quoted)),
            Kind::Name => "expected a text in quotes".to_owned(),
            Kind::Texts => "expected a list of texts such as [\"./my_agent\", \"--fast\"]".to_owned(),
            Kind::Path => "expected the path of a file in quotes".to_owned(),
            Kind::Ids => "expected a list of ids of agents such as [0, 2]".to_owned(),
            Kind::Position(unit) => format!("expected [x, y, z]{}", of_unit(unit)),
            Kind::Positions(unit) => format!("expected a list of [x, y, z]{}", of_unit(unit)),
            Kind::Corners(unit) => format!("expected [x, y, z, x, y, z]{}", of_unit(unit)),
            Kind::Numbers(unit) => format!("expected a list of numbers{} such as [-0.1, 0.0]", of_unit(unit)),
            Kind::Bytes => "expected a list of numbers from 0 to 255 such as [2, 6]".to_owned(),
            Kind::Poses => "expected a list of [x, y, z] or [x, y, z, yaw] (m and rad)".to_owned(),
            Kind::Size => "expected a number of cells from 1 to 1024, or three such as [100, 80, 30]".to_owned(),
            Kind::Settings => "expected a table of settings such as { search_time = \"budgeted\" }".to_owned(),
            Kind::Keys => "expected a table of keys such as { \"agents.controller\" = \"lvd\" }".to_owned(),
        }
    }

    /// Whether the range holds for every scenario and is checked when it is read.
    fn is_checked_here(&self, table: &Table) -> bool {
        !self.is_checked_elsewhere && !table.is_checked_by_mapgen
    }
}

/// The seeds that TOML has room for.
const SEEDS: &str = "0 to 9223372036854775807";

/// `a, b or c`.
fn listed<T>(words: &[T], conjunction: &str, text: impl Fn(&T) -> String) -> String {
    match words {
        [] => String::new(),
        [only] => text(only),
        [most @ .., last] => {
            let most: Vec<String> = most.iter().map(&text).collect();
            format!("{} {conjunction} {}", most.join(", "), text(last))
        }
    }
}

/// The table with this path.
#[must_use]
pub fn table(path: &str) -> Option<&'static Table> {
    TABLES.iter().find(|table| table.path == path)
}

/// The key with this dotted path; an entry of a list may have its number, as in `bodies[1].agents`.
#[must_use]
pub fn find(path: &str) -> Option<&'static Key> {
    let (table_path, name) = path.rsplit_once('.').unwrap_or(("", path));
    let table_path = table_path.split_once('[').map_or(table_path, |(list, _)| list);
    table(table_path)?.keys().find(|key| key.name == name)
}

/// Adds the keys that a scenario leaves out, with their defaults, to the tables that it has.
pub(super) fn complete(scenario: &mut toml::Table) {
    for declared in TABLES.iter().filter(|table| !table.is_list()) {
        let parts = declared.path.split('.').filter(|part| !part.is_empty());
        let found = parts.into_iter().try_fold(&mut *scenario, |table, part| table.get_mut(part)?.as_table_mut());
        let Some(table) = found else { continue };
        let default_kind = declared.keys.iter().find(|key| key.name == "kind").map(|key| key.default);
        let default_kind = if let Some(DefaultValue::Is(kind)) = default_kind { kind.trim_matches('"') } else { "" };
        let kind = table.get("kind").and_then(toml::Value::as_str).unwrap_or(default_kind).to_owned();
        for key in declared.keys.iter().filter(|key| key.only_with.is_empty() || key.only_with.contains(&&*kind)) {
            if let DefaultValue::Is(value) = key.default
                && !table.contains_key(key.name)
            {
                let line = format!("value = {value}").parse::<toml::Table>();
                table.extend(line.into_iter().flatten().map(|(_, value)| (key.name.to_owned(), value)));
            }
        }
    }
}

/// The dotted paths of all keys that may change during a run.
#[must_use]
pub fn changeable_paths() -> Vec<String> {
    let keys = TABLES.iter().flat_map(|table| table.keys.iter().map(move |key| (table, key)));
    keys.filter(|(_, key)| key.is_changeable).map(|(table, key)| table.path_of(key.name)).collect()
}

/// The name nearest to a misspelt one, if there is one so near that a person may have meant it.
pub(super) fn nearest<'n>(misspelt: &str, names: impl IntoIterator<Item = &'n str>) -> Option<&'n str> {
    let tolerated = (misspelt.chars().count() / 3).max(1);
    let distances = names.into_iter().map(|name| (strsim::osa_distance(misspelt, name), name));
    distances.filter(|(distance, _)| *distance <= tolerated).min_by_key(|(distance, _)| *distance).map(|(_, name)| name)
}

/// The first number of a scenario that is out of its range, in the order of the declaration: the
/// path of its key, the value, and what is expected.
pub(super) fn first_out_of_range(scenario: &toml::Table) -> Option<(String, String, String)> {
    for table in &TABLES {
        for (place, values) in instances(scenario, table) {
            for key in table.keys() {
                let Some(range) = key.range.filter(|_| key.is_checked_here(table)) else { continue };
                let Some(number) = values.get(key.name).and_then(number) else { continue };
                if !range.contains(number) {
                    let path = if place.is_empty() { key.name.to_owned() } else { format!("{place}.{}", key.name) };
                    return Some((path, number.to_string(), key.expected_range()));
                }
            }
        }
    }
    None
}

/// The tables of a scenario that a declared one describes, with their paths: none, one, or one for
/// each entry of a list.
fn instances<'t>(scenario: &'t toml::Table, declared: &Table) -> Vec<(String, &'t toml::Table)> {
    if declared.path.is_empty() {
        return vec![(String::new(), scenario)];
    }
    let mut parts = declared.path.split('.');
    let first = parts.next().and_then(|part| scenario.get(part));
    match parts.try_fold(first, |value, part| Some(value?.get(part))).flatten() {
        Some(toml::Value::Table(table)) => vec![(declared.path.to_owned(), table)],
        Some(toml::Value::Array(entries)) => {
            let entries = entries.iter().enumerate();
            entries.filter_map(|(at, entry)| Some((format!("{}[{at}]", declared.path), entry.as_table()?))).collect()
        }
        _ => Vec::new(),
    }
}

fn number(value: &toml::Value) -> Option<f64> {
    value.as_float().or_else(|| value.as_integer().map(|integer| integer as f64))
}
