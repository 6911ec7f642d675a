//! What is wrong with a table that serde does not read as a scenario, in terms of the declared
//! keys.
//!
//! Whether a table is a scenario is decided by serde alone; this module only explains a refusal.
//! One problem is named, the first one; a text may come from a stranger, so finding it visits each
//! key once, and only its own words are made.

use toml::de::{DeTable, DeValue};
use toml::{Spanned, Value};

use super::keys::{self, DefaultValue, Key, Kind, TABLES, Table, nearest};

/// Longest value that is repeated in an error, in characters.
const VALUE_CHARS_MAX: usize = 60;

/// Longest key or word for which a similar one is looked up, bytes: no declared one is as long.
const MISSPELT_BYTES_MAX: usize = 64;

/// Something wrong with a key.
#[derive(Debug)]
pub(super) struct Problem {
    /// Where the text has it, a byte; `None` if there is no text, or nothing in it names the key.
    pub(super) at: Option<usize>,
    /// The message.
    pub(super) text: String,
}

/// Kinds of problems; the least is reported. A missing key may be a misspelt one, and a later flag
/// may correct a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Rank {
    /// An unknown key, or a value of another type.
    Unfit,
    /// A key is missing.
    Missing,
    /// A number is out of range.
    OutOfRange,
}

/// The cost of a diagnosis.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Work {
    /// Keys and entries of lists that were looked at.
    pub(super) visited: usize,
    /// Problems that were put into words.
    pub(super) worded: usize,
}

/// The first problem so far. Its words are made at the end.
struct First<'a> {
    order: (Rank, bool, usize),
    path: Vec<String>,
    at: Option<usize>,
    text: Box<dyn FnOnce(&str) -> String + 'a>,
}

/// The search for the first problem.
struct Search<'a> {
    /// Whether problems of this key come before others.
    prefers: &'a dyn Fn(&str) -> bool,
    first: Option<First<'a>>,
    work: Work,
}

impl<'a> Search<'a> {
    /// Takes note of a problem. `text` makes the message from the name of the key.
    fn found(&mut self, rank: Rank, path: &[String], at: Option<usize>, text: impl FnOnce(&str) -> String + 'a) {
        let order = (rank, !(self.prefers)(&name(path)), at.unwrap_or(0));
        if self.first.as_ref().is_none_or(|first| order < first.order) {
            self.first = Some(First { order, path: path.to_vec(), at, text: Box::new(text) });
        }
    }
}

/// What a text says where, beside its values.
#[derive(Clone, Copy)]
struct Spans<'a> {
    /// Where the table or entry begins; `None` for the whole text.
    start: Option<usize>,
    table: Option<&'a DeTable<'a>>,
}

impl<'a> Spans<'a> {
    /// Where a key of the table and its value are.
    fn of(&self, key: &str) -> (Option<usize>, Option<&'a Spanned<DeValue<'a>>>) {
        match self.table.and_then(|table| table.get_key_value(key)) {
            Some((key, value)) => (Some(key.span().start), Some(value)),
            None => (self.start, None),
        }
    }
}

fn name(path: &[String]) -> String {
    path.join(".").replace(".[", "[")
}

fn within(path: &[String], part: &str) -> Vec<String> {
    path.iter().cloned().chain([part.to_owned()]).collect()
}

/// The first thing wrong with the keys of a scenario: of the least kind, and of these the first one
/// whose key `prefers` holds for, and of these the first one in `text`, if that is given.
pub(super) fn first_problem(
    scenario: &toml::Table,
    text: Option<&DeTable<'_>>,
    prefers: &dyn Fn(&str) -> bool,
) -> (Option<Problem>, Work) {
    let mut search = Search { prefers, first: None, work: Work::default() };
    check_table(&[], &TABLES[0], scenario, Spans { start: None, table: text }, &mut search);
    let Search { first, mut work, .. } = search;
    let problem = first.map(|First { path, at, text, .. }| {
        work.worded += 1;
        Problem { at, text: text(&name(&path)) }
    });
    (problem, work)
}

fn check_table<'a>(
    path: &[String],
    declared: &'static Table,
    table: &'a toml::Table,
    spans: Spans<'a>,
    search: &mut Search<'a>,
) {
    // Of an unknown kind that is the problem, and not what goes with it.
    let is_kind = |kind: &&str| {
        let words = declared.keys().find(|key| key.name == "kind").map(|key| key.kind);
        !matches!(words, Some(Kind::Word(words)) if !words.contains(kind))
    };
    let kind = table.get("kind").and_then(Value::as_str).filter(is_kind);
    for (key, value) in table {
        search.work.visited += 1;
        let path = within(path, key);
        let (at, spanned) = spans.of(key);
        let at_value = spanned.map(|value| value.span().start).or(at);
        if let Some(known) = declared.keys().find(|known| known.name == key) {
            check_value(&path, known, kind, value, (at, at_value), search);
        } else if let Some(subtable) = keys::table(&declared.path_of(key)) {
            check_subtable(&path, subtable, value, (at, spanned), search);
        } else {
            search.found(Rank::Unfit, &path, at, move |name| unknown(declared, key, name));
        }
    }
    let applies = |key: &&Key| key.only_with.is_empty() || kind.is_some_and(|kind| key.only_with.contains(&kind));
    for missing in declared.keys().filter(|key| !table.contains_key(key.name)).filter(applies) {
        let is_spawn_kind = declared.path == "spawn" && missing.name == "kind";
        let is_needed = matches!(missing.default, DefaultValue::Unset(words) if words.starts_with("required for"))
            && !missing.only_with.is_empty();
        if missing.default == DefaultValue::Required || is_spawn_kind || is_needed {
            let text = move |name: &str| format!("missing key `{name}`: {}", missing.expected());
            search.found(Rank::Missing, &within(path, missing.name), spans.start, text);
        }
    }
    if declared.path.is_empty() {
        for required in ["map", "agents"].into_iter().filter(|name| !table.contains_key(*name)) {
            let text = move |_: &str| format!("missing table `[{required}]`");
            search.found(Rank::Missing, &within(path, required), None, text);
        }
    }
}

/// `at`: where the key is; `spanned`: its value in the text.
fn check_subtable<'a>(
    path: &[String],
    declared: &'static Table,
    value: &'a Value,
    (at, spanned): (Option<usize>, Option<&'a Spanned<DeValue<'a>>>),
    search: &mut Search<'a>,
) {
    fn wrong<'a>(value: &'a Value, expected: String) -> impl FnOnce(&str) -> String + 'a {
        move |name| format!("{name} = {}: {expected}", shown(value))
    }
    let at_value = spanned.map(|value| value.span().start).or(at);
    let spanned = spanned.map(Spanned::get_ref);
    match value {
        Value::Array(entries) if declared.is_list() => {
            let list = spanned.and_then(DeValue::as_array).map(|list| &list[..]);
            for (number, entry) in entries.iter().enumerate() {
                search.work.visited += 1;
                let path = within(path, &format!("[{number}]"));
                let spanned = list.and_then(|list| list.get(number));
                let at = spanned.map(|entry| entry.span().start).or(at);
                match entry.as_table() {
                    Some(table) => {
                        let spanned = spanned.and_then(|entry| entry.get_ref().as_table());
                        check_table(&path, declared, table, Spans { start: at, table: spanned }, search);
                    }
                    None => {
                        let example = match declared.path {
                            "event" => "expected a table such as { kind = \"break_down\", at_s = 60.0, agent = 0 }",
                            "agents.mix" => "expected a table such as { share = 0.4, controller = \"lvd\" }",
                            _ => "expected a table such as { agents = [0], kind = \"aerial\" }",
                        };
                        search.found(Rank::Unfit, &path, at, wrong(entry, example.to_owned()));
                    }
                }
            }
        }
        value if declared.is_list() => {
            let expected = format!("expected a list of tables: [[{}]]", declared.path);
            search.found(Rank::Unfit, path, at_value, wrong(value, expected));
        }
        Value::Table(table) => {
            check_table(path, declared, table, Spans { start: at, table: spanned.and_then(DeValue::as_table) }, search);
        }
        value if declared.path == "spawn" => {
            let examples = "{ kind = \"nearest_origin\" } or { kind = \"list\", poses = [...] }";
            let expected = format!("expected a table such as {examples}");
            search.found(Rank::Unfit, path, at_value, wrong(value, expected));
        }
        value => {
            let expected = format!("expected a table: [{}]", declared.path);
            search.found(Rank::Unfit, path, at_value, wrong(value, expected));
        }
    }
}

/// What to say of a dotted path that is no key of a scenario.
#[must_use]
pub fn unknown_key(path: &str) -> String {
    let (place, name) = path.rsplit_once('.').unwrap_or(("", path));
    let first = path.split('.').next().unwrap_or(path);
    match keys::table(place) {
        Some(declared) => unknown(declared, name, path),
        None if keys::table(first).is_none() => unknown(&TABLES[0], first, first),
        None => format!("unknown key `{path}`"),
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
        let is_entry = |table: &&Table| {
            table.inherited_from() == Some(declared.path) && table.keys.iter().any(|known| known.name == key)
        };
        let of_entries = TABLES.iter().find(is_entry).map(|table| table.path_of(key));
        of_entries.or_else(|| only(false)).or_else(|| only(true))
    };
    let meant = similar(key, names.iter().copied()).map(|near| declared.path_of(near)).or_else(elsewhere);
    match meant {
        Some(meant) => format!("unknown key `{path}`; did you mean `{meant}`?"),
        None => {
            let names: Vec<String> = names.iter().map(|name| format!("`{name}`")).collect();
            format!("unknown key `{path}`; expected one of {}", names.join(", "))
        }
    }
}

/// `at`: where the key and its value are.
fn check_value<'a>(
    path: &[String],
    key: &'static Key,
    kind: Option<&'a str>,
    value: &'a Value,
    (at, at_value): (Option<usize>, Option<usize>),
    search: &mut Search<'a>,
) {
    if let Some(kind) = kind.filter(|kind| !key.only_with.is_empty() && !key.only_with.contains(kind)) {
        search.found(Rank::Unfit, path, at, move |name| {
            let allowed = key.only_with.iter().map(|kind| format!("\"{kind}\"")).collect::<Vec<_>>().join(", ");
            format!("key `{name}` does not go with kind = \"{kind}\", only with {allowed}")
        });
        return;
    }
    let fit = fits(key, value);
    let rank = match fit {
        Fit::Yes => return,
        Fit::OutOfRange => Rank::OutOfRange,
        Fit::OtherType => Rank::Unfit,
    };
    search.found(rank, path, at_value, move |name| {
        let expected = if rank == Rank::OutOfRange { key.expected_range() } else { key.expected() };
        let meant = match (key.kind, value) {
            (Kind::Word(words), Value::String(word)) => similar(word, words.iter().copied()),
            (Kind::Words(words), Value::Array(given)) => given
                .iter()
                .filter_map(Value::as_str)
                .find(|word| !words.contains(word))
                .and_then(|word| similar(word, words.iter().copied())),
            _ => None,
        };
        let hint = meant.map(|meant| format!("; did you mean \"{meant}\"?")).unwrap_or_default();
        format!("{name} = {}: {expected}{hint}", shown(value))
    });
}

/// The nearest name to a text that may have any length.
fn similar<'n>(given: &str, names: impl IntoIterator<Item = &'n str>) -> Option<&'n str> {
    if given.len() > MISSPELT_BYTES_MAX { None } else { nearest(given, names) }
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
        Kind::Positions(_) => are(value, &|place| is_triple(place) && are(place, &is_number)),
        Kind::Corners(_) => value.as_array().is_some_and(|list| list.len() == 6) && are(value, &is_number),
        Kind::Numbers(_) => are(value, &is_number),
        Kind::Bytes => are(value, &|byte| byte.as_integer().is_some_and(|byte| (0..=255).contains(&byte))),
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

#[cfg(test)]
mod tests {
    use super::*;

    /// The first problem of a text, with its line, and the work to find it.
    fn diagnosed(text: &str) -> (usize, String, Work) {
        let table: toml::Table = toml::from_str(text).unwrap();
        let spans = DeTable::parse(text).unwrap();
        let (problem, work) = first_problem(&table, Some(spans.get_ref()), &|_| true);
        let problem = problem.unwrap();
        let line = 1 + text[..problem.at.unwrap_or(0)].matches('\n').count();
        (line, problem.text, work)
    }

    const LEGAL: &str = "seed = 7\nduration_s = 1.0\nmap = { kind = \"spheres\", size = 50 }\nagents = { count = 3 }\n";

    #[test]
    fn unknown_keys_are_visited_once_and_one_is_put_into_words() {
        type Text = fn(usize) -> String;
        let keys: [(&str, Text); 5] = [
            ("at the top, the last one by name first", |number| format!("k{:05} = 1\n", 99_999 - number)),
            ("in inline tables", |number| format!("k{number} = {{ a = 1 }}\n")),
            ("in a table", |number| format!("lidar.k{number} = 1\n")),
            ("in lists of tables", |number| format!("[[bodies]]\nk{number} = 1\n")),
            ("entries that are no tables", |_| "1, ".to_owned()),
        ];
        for (what, key) in keys {
            let work = |count: usize| {
                let keys: String = (0..count).map(key).collect();
                let keys = if keys.starts_with('1') { format!("event = [{keys}]\n") } else { keys };
                let (line, said, work) = diagnosed(&format!("{LEGAL}{keys}"));
                assert!((5..=6).contains(&line), "{what}: the first one is named: {line}: {said}");
                assert_eq!(work.worded, 1, "{what}: {said}");
                work.visited
            };
            let (base, once, twice) = (work(1), work(501), work(1001));
            assert_eq!(twice - base, 2 * (once - base), "{what}");
            assert!(once - base <= 2 * 500, "{what}: {once}");
        }
    }

    #[test]
    fn problems_are_ordered_by_kind_and_place() {
        let said = |keys: &str| diagnosed(&format!("{LEGAL}{keys}")).1;
        assert!(said("lidra = 1\nadgents = 2\n").starts_with("unknown key `lidra`; did you mean `lidar`?"));
        assert!(said("lidar.range_m = -1\nlidra = 1\n").starts_with("unknown key `lidra`"));
        // No name is as long, and none is looked for.
        let long = "x".repeat(5000);
        assert!(said(&format!("{long} = 1\n")).contains("; expected one of `seed`"));
    }
}
