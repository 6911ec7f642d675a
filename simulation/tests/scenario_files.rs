//! What is generated from the declaration: the tables of docs/scenario.md, the JSON schema of
//! scenario files, and the data of the start form.
//!
//! A test fails when its file is stale; with the environment variable `UPDATE_DOCS` it writes the
//! file: `UPDATE_DOCS=1 cargo test -p simulation --test scenario_files`.

use std::fs;
use std::path::{Path, PathBuf};

use protocol::body_model::BodyModel;
use serde_json::{Value, json};
use simulation::scenario::Scenario;
use simulation::scenario::keys::{self, DefaultValue, Key, Kind, TABLES, Table};
use textwrap::{Options, WordSplitter};

const DOCUMENT: &str = "docs/scenario.md";
const SCHEMA: &str = "launch_scripts/scenarios/scenario.schema.json";
const FORM: &str = "viewer/src/app/scenario-keys.json";

/// The keys that the start form sets.
const FORM_KEYS: [&str; 20] = [
    "seed",
    "duration_s",
    "stop_when_explored",
    "stop_when_covered",
    "map.size",
    "map.file",
    "map.spheres.fill_ratio",
    "map.spheres.radius_min",
    "map.spheres.radius_max",
    "map.spheres.connections",
    "map.spheres.smoothing",
    "map.noise.fill",
    "map.noise.smoothing",
    "map.building.floors",
    "map.scene.name",
    "agents.count",
    "agents.controller",
    "agents.share_period_ticks",
    "lidar.fov_rad",
    "communication.range_m",
];

fn path(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(file)
}

fn read(file: &str) -> String {
    fs::read_to_string(path(file)).unwrap_or_else(|error| panic!("{file}: {error}"))
}

/// Fails unless a file holds what is generated, or writes it.
fn publish(file: &str, generated: &str) {
    if std::env::var_os("UPDATE_DOCS").is_some() {
        fs::write(path(file), generated).unwrap_or_else(|error| panic!("{file}: {error}"));
    }
    let hint = "run UPDATE_DOCS=1 cargo test -p simulation --test scenario_files";
    assert!(read(file) == generated, "{file} does not match the declaration of the keys: {hint}");
}

// The document.

const BEGIN: &str = "<!-- generated: keys of ";
const END: &str = "<!-- end of generated -->";

/// The document with every generated table replaced by that of the declaration.
fn with_tables(document: &str) -> String {
    let mut parts = document.split(BEGIN);
    let mut text = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let (name, rest) = part.split_once(" -->").expect("a marker ends");
        let (_, after) = rest.split_once(END).unwrap_or_else(|| panic!("the table of {name} ends"));
        let path = if name == "the top level" { "" } else { name };
        let table = keys::table(path).unwrap_or_else(|| panic!("there is no table {name}"));
        text.push_str(&format!("{BEGIN}{name} -->\n\n{}\n{END}{after}", markdown(table)));
    }
    text
}

/// The keys of a table as a list.
fn markdown(table: &Table) -> String {
    let options = Options::new(100).subsequent_indent("  ").word_splitter(WordSplitter::NoHyphenation);
    let options = options.break_words(false);
    let item = |key: &Key| {
        let see = if key.see.is_empty() { String::new() } else { format!(" ([{0}]({0}))", key.see) };
        let values = [type_and_unit(key), key.allowed()].into_iter().filter(|text| !text.is_empty());
        let values = values.collect::<Vec<_>>().join(": ");
        let facts = [values, default_text(table, key)].join("; ");
        let meaning = code(key.meaning);
        let item = format!("- `{}` ({facts}): {meaning}{see}{}", key.name, source(key));
        textwrap::fill(&item, &options) + "\n"
    };
    table.keys.iter().map(item).collect()
}

/// Where the default comes from, unless it is ours.
fn source(key: &Key) -> String {
    if ["", "ours"].contains(&key.source) { String::new() } else { format!("; *{}*", key.source) }
}

/// A meaning with keys, topics and values set as code.
fn code(meaning: &str) -> String {
    let is_key = |word: &str| word.contains('.') && keys::find(word).is_some();
    let is_code =
        |word: &str| word.contains('_') || word.starts_with('/') || ["inf", "max"].contains(&word) || is_key(word);
    let word = |word: &str| {
        let core = word.trim_matches(['(', ')', ',', ';', ':', '.']);
        if is_code(core) { word.replace(core, &format!("`{core}`")) } else { word.to_owned() }
    };
    meaning.split(' ').map(word).collect::<Vec<_>>().join(" ")
}

fn type_and_unit(key: &Key) -> String {
    let of = |name: &str, unit: &str| if unit.is_empty() { name.to_owned() } else { format!("{name}, {unit}") };
    match key.kind {
        Kind::Boolean => "boolean".to_owned(),
        Kind::Integer(unit) => of("integer", unit),
        Kind::Number("") => "number".to_owned(),
        Kind::Number(unit) => unit.to_owned(),
        Kind::NumberOrMax => "number or `\"max\"`".to_owned(),
        Kind::Seed => "integer".to_owned(),
        Kind::Word(_) => String::new(),
        Kind::Name => "word".to_owned(),
        Kind::Words(_) => "list of words".to_owned(),
        Kind::Texts => "list of texts".to_owned(),
        Kind::Path => "path".to_owned(),
        Kind::Ids => "list of ids".to_owned(),
        Kind::Position(unit) => of("[x, y, z]", unit),
        Kind::Positions(unit) => of("list of [x, y, z]", unit),
        Kind::Corners(unit) => of("[x, y, z, x, y, z]", unit),
        Kind::Numbers(unit) => of("list of numbers", unit),
        Kind::Bytes => "list of integers".to_owned(),
        Kind::Poses => "list of poses, m and rad".to_owned(),
        Kind::Size => "integer or [x, y, z], cells".to_owned(),
        Kind::Settings | Kind::Keys => "table".to_owned(),
    }
}

fn default_text(table: &Table, key: &Key) -> String {
    match key.default {
        DefaultValue::Required => "required".to_owned(),
        DefaultValue::Unset(words) if words.starts_with("required") => words.to_owned(),
        DefaultValue::Unset(words) => format!("default: {words}"),
        DefaultValue::Is(value) => {
            let of = |body: BodyModel| body.numbers().into_iter().find(|(name, _)| *name == key.name);
            match of(BodyModel::AERIAL).zip(of(BodyModel::GROUND)).filter(|_| table.path == "body") {
                Some(((_, aerial), (_, ground))) => {
                    format!("default `{value}`; aerial: `{aerial:?}`; ground: `{ground:?}`")
                }
                None => format!("default `{value}`"),
            }
        }
    }
}

#[test]
fn the_document_has_the_declared_tables() {
    let document = read(DOCUMENT);
    publish(DOCUMENT, &with_tables(&document));
    for table in &TABLES {
        let name = if table.path.is_empty() { "the top level" } else { table.path };
        assert!(document.contains(&format!("{BEGIN}{name} -->")), "{DOCUMENT} has no table of {name}");
    }
}

// The JSON schema.

fn schema() -> Value {
    let mut root = schema_of(&TABLES[0]);
    root["$schema"] = json!("http://json-schema.org/draft-07/schema#");
    root["title"] = json!("Scenario of the multi-agent exploration simulator");
    root["description"] =
        json!("Everything that determines a run. Generated; the keys are described in docs/scenario.md.");
    root
}

fn schema_of(table: &Table) -> Value {
    let mut properties = serde_json::Map::new();
    let mut required = Vec::new();
    for key in table.keys() {
        properties.insert(key.name.to_owned(), schema_of_key(key));
        if key.default == DefaultValue::Required || (table.path, key.name) == ("spawn", "kind") {
            required.push(key.name);
        }
    }
    for name in table.subtables() {
        let subtable = keys::table(&table.path_of(name)).expect("a subtable is a table");
        let of_subtable = schema_of(subtable);
        let value = if subtable.is_list() { json!({ "type": "array", "items": of_subtable }) } else { of_subtable };
        properties.insert(name.to_owned(), value);
        if ["map", "agents"].contains(&subtable.path) {
            required.push(name);
        }
    }
    json!({ "type": "object", "additionalProperties": false, "required": required, "properties": properties })
}

fn schema_of_key(key: &Key) -> Value {
    let numbers =
        |count: u32| json!({ "type": "array", "items": { "type": "number" }, "minItems": count, "maxItems": count });
    let mut schema = match key.kind {
        Kind::Boolean => json!({ "type": "boolean" }),
        Kind::Integer(_) => bounded("integer", key),
        Kind::Number(_) => bounded("number", key),
        Kind::NumberOrMax => json!({ "anyOf": [bounded("number", key), { "type": "string", "enum": ["max"] }] }),
        Kind::Seed => json!({ "type": "integer", "minimum": 0 }),
        Kind::Word(words) => json!({ "type": "string", "enum": words }),
        Kind::Words(words) => json!({ "type": "array", "items": { "type": "string", "enum": words } }),
        Kind::Name | Kind::Path => json!({ "type": "string" }),
        Kind::Texts => json!({ "type": "array", "items": { "type": "string" } }),
        Kind::Ids => json!({ "type": "array", "items": { "type": "integer", "minimum": 0 } }),
        Kind::Position(_) => numbers(3),
        Kind::Positions(_) => json!({ "type": "array", "items": numbers(3) }),
        Kind::Corners(_) => numbers(6),
        Kind::Numbers(_) => json!({ "type": "array", "items": { "type": "number" } }),
        Kind::Bytes => json!({ "type": "array", "items": { "type": "integer", "minimum": 0, "maximum": 255 } }),
        Kind::Poses => {
            let pose = json!({ "type": "array", "items": { "type": "number" }, "minItems": 3, "maxItems": 4 });
            json!({ "type": "array", "items": pose })
        }
        Kind::Size => {
            let cells = bounded("integer", key);
            json!({ "anyOf": [cells, { "type": "array", "items": cells, "minItems": 3, "maxItems": 3 }] })
        }
        Kind::Settings | Kind::Keys => json!({ "type": "object" }),
    };
    schema["description"] = json!(description(key));
    if let DefaultValue::Is(value) = key.default {
        let value = toml::from_str::<toml::Table>(&format!("value = {value}")).expect("a default is TOML");
        let value = serde_json::to_value(&value["value"]).expect("a default has plain values");
        if !value.is_null() {
            schema["default"] = value;
        }
    }
    schema
}

/// A numeric type with its bounds. An editor reads the TOML value `inf` as null.
fn bounded(type_name: &str, key: &Key) -> Value {
    let Some(range) = key.range else { return json!({ "type": type_name }) };
    let is_unlimited = range.high == f64::INFINITY;
    let mut schema = if is_unlimited { json!({ "type": [type_name, "null"] }) } else { json!({ "type": type_name }) };
    schema[if range.is_low_excluded { "exclusiveMinimum" } else { "minimum" }] = bound(range.low);
    if range.high < f64::MAX {
        schema["maximum"] = bound(range.high);
    }
    schema
}

/// A number without a decimal point if it needs none.
fn bound(number: f64) -> Value {
    if number.fract() == 0.0 { json!(number as i64) } else { json!(number) }
}

/// The meaning as a sentence, with unit and limits.
fn description(key: &Key) -> String {
    let mut letters = key.meaning.chars();
    let meaning: String = letters.next().into_iter().flat_map(char::to_uppercase).chain(letters).collect();
    let unit = match key.kind {
        Kind::Integer(unit) | Kind::Number(unit) | Kind::Position(unit) if !unit.is_empty() => {
            format!(" Unit: {unit}.")
        }
        _ => String::new(),
    };
    let allowed = match key.allowed() {
        allowed if allowed.is_empty() || allowed.contains("](") => String::new(),
        allowed => format!(" Allowed: {}.", allowed.replace('`', "")),
    };
    format!("{meaning}.{unit}{allowed}")
}

/// Whether a value satisfies a schema of the subset of JSON Schema that is generated here;
/// otherwise, where not.
fn satisfies(value: &toml::Value, schema: &Value, place: &str) -> Result<(), String> {
    let wrong = |what: &str| Err(format!("{place} = {value}: {what}"));
    if let Some(choices) = schema["anyOf"].as_array() {
        let fits = choices.iter().any(|choice| satisfies(value, choice, place).is_ok());
        return if fits { Ok(()) } else { wrong("none of the choices") };
    }
    let number = value.as_float().or_else(|| value.as_integer().map(|integer| integer as f64));
    let is_of = |name: &str| match name {
        "boolean" => value.is_bool(),
        "integer" => value.is_integer(),
        "number" => number.is_some(),
        "null" => number == Some(f64::INFINITY),
        "string" => value.is_str(),
        "array" => value.is_array(),
        "object" => value.is_table(),
        other => panic!("the type {other} is not generated"),
    };
    let types = schema["type"].as_array().cloned().unwrap_or_else(|| vec![schema["type"].clone()]);
    if !types.iter().any(|name| is_of(name.as_str().expect("a type is a name"))) {
        return wrong("another type");
    }
    let has = |bound: &str, holds: fn(f64, f64) -> bool| match (number, schema[bound].as_f64()) {
        (Some(number), Some(bound)) => holds(number, bound),
        _ => true,
    };
    if !(has("minimum", |number, bound| number >= bound)
        && has("maximum", |number, bound| number <= bound)
        && has("exclusiveMinimum", |number, bound| number > bound))
    {
        return wrong("out of range");
    }
    if schema["enum"].as_array().is_some_and(|words| !words.iter().any(|word| word.as_str() == value.as_str())) {
        return wrong("another word");
    }
    if let Some(entries) = value.as_array() {
        let least = schema["minItems"].as_u64().unwrap_or(0) as usize;
        let most = schema["maxItems"].as_u64().map_or(usize::MAX, |most| most as usize);
        if !(least..=most).contains(&entries.len()) {
            return wrong("another length");
        }
        entries.iter().try_for_each(|entry| satisfies(entry, &schema["items"], place))?;
    }
    let (Some(table), Some(properties)) = (value.as_table(), schema["properties"].as_object()) else { return Ok(()) };
    for name in schema["required"].as_array().into_iter().flatten().filter_map(Value::as_str) {
        if !table.contains_key(name) {
            return wrong(&format!("no {name}"));
        }
    }
    for (name, value) in table {
        let Some(schema) = properties.get(name) else { return wrong(&format!("unknown {name}")) };
        satisfies(value, schema, &format!("{place}.{name}"))?;
    }
    Ok(())
}

#[test]
fn the_schema_is_published() {
    let generated = schema();
    let mut text = serde_json::to_string_pretty(&generated).unwrap();
    text.push('\n');
    // Builds differ in the order of the keys, which means nothing.
    if serde_json::from_str::<Value>(&read(SCHEMA)).ok() != Some(generated) {
        publish(SCHEMA, &text);
    }
}

#[test]
fn scenario_files_name_and_satisfy_the_schema() {
    let schema = schema();
    let folder = path("launch_scripts/scenarios");
    let files = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let files: Vec<PathBuf> = files.filter(|file| file.extension().is_some_and(|name| name == "toml")).collect();
    assert!(files.len() >= 11, "{files:?}");
    for file in files {
        let text = fs::read_to_string(&file).unwrap();
        assert!(text.starts_with("#:schema scenario.schema.json\n"), "{} names no schema", file.display());
        let scenario = toml::Value::Table(toml::from_str(&text).unwrap());
        satisfies(&scenario, &schema, "scenario").unwrap_or_else(|wrong| panic!("{}: {wrong}", file.display()));
    }
}

#[test]
fn complete_scenarios_have_all_keys_and_are_the_same() {
    let folder = path("launch_scripts/scenarios");
    let files = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    for file in files.filter(|file| file.extension().is_some_and(|name| name == "toml")) {
        let text = fs::read_to_string(&file).unwrap();
        let name = file.display().to_string();
        let scenario = Scenario::parse(&name, &text, &[]).unwrap();
        let complete = scenario.to_complete();
        let again = Scenario::parse(&name, &toml::to_string(&complete).unwrap(), &[]);
        assert_eq!(again.unwrap_or_else(|error| panic!("{error}")), scenario, "{name}");
        for (table, keys) in
            [("agents", &["base_stations", "cmd_vel"][..]), ("body", &["kind"]), ("communication", &["model", "loss"])]
        {
            for key in keys {
                assert!(complete[table].get(key).is_some(), "{name}: {table}.{key}");
            }
        }
        assert!(complete.contains_key("stop_when_covered") && complete.contains_key("stop_when_back"), "{name}");
    }
}

#[test]
fn the_schema_tells_scenarios_from_others() {
    let legal = "seed = 1\nduration_s = 2.0\nmap = { kind = \"noise\", size = 30 }\nagents = { count = 2 }\n";
    let result = |rest: &str| {
        let scenario = toml::Value::Table(toml::from_str(&format!("{legal}{rest}")).unwrap());
        satisfies(&scenario, &schema(), "scenario")
    };
    for right in [
        "",
        "lidar = { range_m = inf, rays = 12 }",
        "spawn = { kind = \"list\", poses = [[1, 2, 3], [1.0, 2.0, 3.0, 0.5]] }",
        "bodies = [{ agents = [0], kind = \"aerial\", radius_m = 1 }]",
        "execution = { rtf = \"max\" }",
        "execution = { rtf = 2 }",
        "views = { record = [\"map\", \"odom\"] }",
    ] {
        assert_eq!(result(right), Ok(()), "{right}");
    }
    for wrong in [
        "lidra = {}",
        "lidar = { rays = 0 }",
        "lidar = { rays = 1.5 }",
        "lidar = { range_m = 0.0 }",
        "lidar = { fov_rad = inf }",
        "spawn = { yaw_rad = 1.0 }",
        "spawn = { kind = \"list\", poses = [[1, 2]] }",
        "bodies = [{ kind = \"aerial\" }]",
        "body = { agents = [0] }",
        "execution = { rtf = \"fast\" }",
        "execution = { rtf = 0 }",
        "views = { record = [\"tf\"] }",
        "stop_when_covered = 1",
    ] {
        assert!(result(wrong).is_err(), "{wrong}");
    }
}

// The start form.

#[test]
fn the_start_form_has_its_keys() {
    let mut form = serde_json::Map::new();
    for path in FORM_KEYS {
        let key = keys::find(path).unwrap_or_else(|| panic!("there is no key {path}"));
        let mut entry = serde_json::Map::new();
        entry.insert("help".to_owned(), json!(description(key)));
        if let Some(default) = schema_of_key(key).get("default") {
            entry.insert("default".to_owned(), default.clone());
        }
        if let Some(range) = key.range {
            entry.insert("min".to_owned(), bound(range.low));
            if range.high.is_finite() {
                entry.insert("max".to_owned(), bound(range.high));
            }
        }
        form.insert(path.to_owned(), Value::Object(entry));
    }
    let form = Value::Object(form);
    let mut text = serde_json::to_string_pretty(&form).unwrap();
    text.push('\n');
    if serde_json::from_str::<Value>(&read(FORM)).ok() != Some(form) {
        publish(FORM, &text);
    }
}
