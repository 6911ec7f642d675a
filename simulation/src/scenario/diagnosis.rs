//! What is wrong with a table that serde does not read as a scenario, in terms of the declared
//! keys.
//!
//! Whether a table is a scenario is decided by serde alone; this module only explains a refusal.

use toml::Value;

use super::keys::{self, DefaultValue, Key, Kind, TABLES, Table, nearest};

/// Longest value that is repeated in an error, in characters.
const VALUE_CHARS_MAX: usize = 60;

/// Something wrong with a key.
#[derive(Debug)]
pub(super) struct Problem {
    /// Parts of the path; an entry of a list is `[0]`, `[1]`, and so on.
    pub(super) path: Vec<String>,
    /// What the message is about.
    pub(super) at: At,
    /// Which of several problems is reported: the least.
    pub(super) rank: Rank,
    /// The message.
    pub(super) text: String,
}

/// Kinds of problems. A missing key may be a misspelt one, and a later flag may correct a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Rank {
    /// An unknown key, or a value of another type.
    Unfit,
    /// A key is missing.
    Missing,
    /// A number is out of range.
    OutOfRange,
}

/// Part of a line `key = value`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum At {
    /// The key.
    Key,
    /// The value.
    Value,
}

impl Problem {
    /// The path as people write it.
    pub(super) fn name(&self) -> String {
        name(&self.path)
    }
}

fn name(path: &[String]) -> String {
    path.join(".").replace(".[", "[")
}

/// Everything wrong with the keys of a scenario; of a key, the first thing.
pub(super) fn problems(scenario: &toml::Table) -> Vec<Problem> {
    let mut found = Vec::new();
    check_table(&[], &TABLES[0], scenario, &mut found);
    found
}

fn check_table(path: &[String], declared: &Table, table: &toml::Table, found: &mut Vec<Problem>) {
    let kind = table.get("kind").and_then(Value::as_str);
    for (key, value) in table {
        let path: Vec<String> = path.iter().cloned().chain([key.clone()]).collect();
        if let Some(known) = declared.keys().find(|known| known.name == key) {
            found.extend(check_value(path, known, kind, value));
        } else if let Some(subtable) = keys::table(&declared.path_of(key)) {
            check_subtable(&path, subtable, value, found);
        } else {
            let text = unknown(declared, key, &name(&path));
            found.push(Problem { path, at: At::Key, rank: Rank::Unfit, text });
        }
    }
    let applies = |key: &&Key| key.only_with.is_empty() || kind.is_some_and(|kind| key.only_with.contains(&kind));
    for missing in declared.keys().filter(|key| !table.contains_key(key.name)).filter(applies) {
        let is_spawn_kind = declared.path == "spawn" && missing.name == "kind";
        let is_needed = matches!(missing.default, DefaultValue::Unset(words) if words.starts_with("required for"))
            && !missing.only_with.is_empty();
        if missing.default == DefaultValue::Required || is_spawn_kind || is_needed {
            let path_of_key: Vec<String> = path.iter().cloned().chain([missing.name.to_owned()]).collect();
            let text = format!("missing key `{}`: {}", name(&path_of_key), missing.expected());
            found.push(Problem { path: path_of_key, at: At::Key, rank: Rank::Missing, text });
        }
    }
    if declared.path.is_empty() {
        for required in ["map", "agents"].into_iter().filter(|name| !table.contains_key(*name)) {
            let text = format!("missing table `[{required}]`");
            found.push(Problem { path: vec![required.to_owned()], at: At::Key, rank: Rank::Missing, text });
        }
    }
}

fn check_subtable(path: &[String], declared: &Table, value: &Value, found: &mut Vec<Problem>) {
    let wrong = |path: &[String], value: &Value, expected: &str| {
        let text = format!("{} = {}: {expected}", name(path), shown(value));
        Problem { path: path.to_vec(), at: At::Value, rank: Rank::Unfit, text }
    };
    match value {
        Value::Array(entries) if declared.is_list() => {
            for (at, entry) in entries.iter().enumerate() {
                let path: Vec<String> = path.iter().cloned().chain([format!("[{at}]")]).collect();
                match entry.as_table() {
                    Some(table) => check_table(&path, declared, table, found),
                    None => {
                        let example = match declared.path {
                            "event" => "expected a table such as { kind = \"break_down\", at_s = 60.0, agent = 0 }",
                            "agents.mix" => "expected a table such as { share = 0.4, controller = \"lvd\" }",
                            _ => "expected a table such as { agents = [0], kind = \"aerial\" }",
                        };
                        found.push(wrong(&path, entry, example));
                    }
                }
            }
        }
        value if declared.is_list() => {
            found.push(wrong(path, value, &format!("expected a list of tables: [[{}]]", declared.path)));
        }
        Value::Table(table) => check_table(path, declared, table, found),
        value if declared.path == "spawn" => {
            let examples = "{ kind = \"nearest_origin\" } or { kind = \"list\", poses = [...] }";
            found.push(wrong(path, value, &format!("expected a table such as {examples}")));
        }
        value => found.push(wrong(path, value, &format!("expected a table: [{}]", declared.path))),
    }
}

fn unknown(declared: &Table, key: &str, path: &str) -> String {
    let names: Vec<&str> = declared.keys().map(|known| known.name).chain(declared.subtables()).collect();
    let elsewhere = || {
        let only = |is_list: bool| {
            let has = |table: &&Table| table.is_list() == is_list && table.keys.iter().any(|known| known.name == key);
            let mut homes = TABLES.iter().filter(has);
            homes.next().filter(|_| homes.next().is_none()).map(|table| table.path_of(key))
        };
        only(false).or_else(|| only(true))
    };
    let meant = nearest(key, names.iter().copied()).map(|near| declared.path_of(near)).or_else(elsewhere);
    match meant {
        Some(meant) => format!("unknown key `{path}`; did you mean `{meant}`?"),
        None => {
            let names: Vec<String> = names.iter().map(|name| format!("`{name}`")).collect();
            format!("unknown key `{path}`; expected one of {}", names.join(", "))
        }
    }
}

fn check_value(path: Vec<String>, key: &Key, kind: Option<&str>, value: &Value) -> Option<Problem> {
    let at_key = |path, text| Some(Problem { path, at: At::Key, rank: Rank::Unfit, text });
    if let Some(kind) = kind.filter(|kind| !key.only_with.is_empty() && !key.only_with.contains(kind)) {
        let allowed = key.only_with.iter().map(|kind| format!("\"{kind}\"")).collect::<Vec<_>>().join(", ");
        let text = format!("key `{}` does not go with kind = \"{kind}\", only with {allowed}", name(&path));
        return at_key(path, text);
    }
    let (rank, expected) = match fits(key, value) {
        Fit::Yes => return None,
        Fit::OutOfRange => (Rank::OutOfRange, key.expected_range()),
        Fit::OtherType => (Rank::Unfit, key.expected()),
    };
    let meant = match (key.kind, value) {
        (Kind::Word(words), Value::String(word)) => nearest(word, words.iter().copied()),
        (Kind::Words(words), Value::Array(given)) => given
            .iter()
            .filter_map(Value::as_str)
            .filter(|word| !words.contains(word))
            .find_map(|word| nearest(word, words.iter().copied())),
        _ => None,
    };
    let hint = meant.map(|meant| format!("; did you mean \"{meant}\"?")).unwrap_or_default();
    let text = format!("{} = {}: {expected}{hint}", name(&path), shown(value));
    Some(Problem { path, at: At::Value, rank, text })
}

enum Fit {
    Yes,
    OutOfRange,
    OtherType,
}

fn fits(key: &Key, value: &Value) -> Fit {
    let is_cell_count = |value: &Value| value.as_integer().is_some_and(|cells| u32::try_from(cells).is_ok());
    let is_number = |value: &Value| value.is_float() || value.is_integer();
    let are = |list: &Value, holds: &dyn Fn(&Value) -> bool| list.as_array().is_some_and(|list| list.iter().all(holds));
    let is_triple = |list: &Value| list.as_array().is_some_and(|list| list.len() == 3);
    let in_range = |number: f64| match key.range {
        Some(range) if !range.contains(number) => Fit::OutOfRange,
        _ => Fit::Yes,
    };
    let fits = match key.kind {
        Kind::Integer(_) => match value.as_integer() {
            // Integers that serde has no room for are refused as those of another type are.
            Some(integer) if integer < 0 => false,
            Some(integer) => return in_range(integer as f64),
            None => false,
        },
        Kind::Number(_) => match (value, value.as_float()) {
            (_, Some(number)) => return in_range(number),
            (Value::Integer(integer), _) => return in_range(*integer as f64),
            _ => false,
        },
        Kind::Boolean => value.is_bool(),
        Kind::NumberOrMax => is_number(value) || value.as_str() == Some("max"),
        Kind::Seed => value.as_integer().is_some_and(|seed| seed >= 0),
        Kind::Word(words) => value.as_str().is_some_and(|word| words.contains(&word)),
        Kind::Words(words) => are(value, &|word| word.as_str().is_some_and(|word| words.contains(&word))),
        Kind::Name | Kind::Path => value.is_str(),
        Kind::Texts => are(value, &Value::is_str),
        Kind::Ids => are(value, &is_cell_count),
        Kind::Position(_) => is_triple(value) && are(value, &is_number),
        Kind::Poses => are(value, &|pose| are(pose, &is_number)),
        Kind::Size => is_cell_count(value) || is_triple(value) && are(value, &is_cell_count),
        Kind::Settings | Kind::Keys => value.is_table(),
    };
    if fits { Fit::Yes } else { Fit::OtherType }
}

/// A value as part of a message.
fn shown(value: &Value) -> String {
    let text = value.to_string();
    match text.char_indices().nth(VALUE_CHARS_MAX) {
        Some((end, _)) => format!("{}...", &text[..end]),
        None => text,
    }
}
