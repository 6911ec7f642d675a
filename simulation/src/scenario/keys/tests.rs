//! The declaration against the structs that serde reads, in both directions.

use std::collections::BTreeSet;

use mapgen::MapSpec;
use protocol::body_model::{BodyKind, BodyModel};
use voxels::Extent;

use super::*;
use crate::scenario::{MapKind, Override, Scenario};

/// A scenario whose table `spawn` has this kind; its lists have one entry.
fn base(spawn: &str) -> toml::Table {
    let spawn = match spawn {
        "list" => "{ kind = \"list\", poses = [] }".to_owned(),
        "box" => "{ kind = \"box\", low = [1.0, 1.0, 1.0], high = [2.0, 2.0, 2.0] }".to_owned(),
        kind => format!("{{ kind = \"{kind}\" }}"),
    };
    let text = format!(
        "seed = 7\nduration_s = 60.0\nmap = {{ kind = \"spheres\", size = 50 }}\nagents = {{ count = 3, mix = [{{ controller = \"lvd\", share = 0.5 }}] }}\n\
         spawn = {spawn}\nbodies = [{{ agents = [0] }}]\nlidars = [{{ name = \"eye\" }}]\n\
         event = [{{ kind = \"leave\", at_s = 1.0, agent = 0 }}]\n\
         obstacle = [{{ kind = \"sphere\", radius_m = 1.0, speed_m_s = 1.0, path = [[2, 2, 2], [3, 2, 2]] }}]\n"
    );
    toml::from_str(&text).unwrap()
}

/// The scenario with another value at a path; that of `bodies` is its first entry.
fn with(mut scenario: toml::Table, path: &str, value: toml::Value) -> toml::Table {
    let (table, name) = path.rsplit_once('.').unwrap_or(("", path));
    if table == "lidar" {
        scenario.remove("lidars");
    }
    let mut place = &mut scenario;
    for part in table.split('.').filter(|part| !part.is_empty()) {
        let entry = place.entry(part).or_insert_with(|| toml::Value::Table(toml::Table::new()));
        place = match entry {
            toml::Value::Array(entries) => entries[0].as_table_mut().unwrap(),
            other => other.as_table_mut().unwrap(),
        };
    }
    place.insert(name.to_owned(), value);
    scenario
}

/// The names in backticks that a message of serde expects.
fn expected_names(message: &str) -> BTreeSet<String> {
    let (_, expected) = message.split_once("expected").unwrap_or_else(|| panic!("{message}"));
    expected.split('`').skip(1).step_by(2).map(str::to_owned).collect()
}

fn serde_error(scenario: toml::Table) -> String {
    scenario.try_into::<Scenario>().unwrap_err().message().to_owned()
}

#[test]
fn structs_have_the_declared_keys_and_no_others() {
    for table in TABLES.iter().filter(|table| table.path != "spawn") {
        let read = expected_names(&serde_error(with(base("scattered"), &table.path_of("__none"), 1.into())));
        // Serde reports an entry of `bodies` or `lidars` without its own keys.
        let has_own = ["bodies", "lidars"].contains(&table.path);
        let own = if has_own { table.keys } else { &[] };
        let declared = table.keys().map(|key| key.name).chain(table.subtables());
        let declared = declared.filter(|name| own.iter().all(|own| own.name != *name));
        assert_eq!(read, declared.map(str::to_owned).collect(), "[{}]", table.path);
    }
}

#[test]
fn each_kind_of_spawn_has_the_declared_keys() {
    let spawn = table("spawn").unwrap();
    let Kind::Word(kinds) = find("spawn.kind").unwrap().kind else { panic!("spawn.kind is a word") };
    for &kind in kinds {
        let error = serde_error(with(base(kind), "spawn.__none", 1.into()));
        let read = if error.contains("there are no fields") { BTreeSet::new() } else { expected_names(&error) };
        let has = |key: &&Key| key.name != "kind" && (key.only_with.is_empty() || key.only_with.contains(&kind));
        assert_eq!(read, spawn.keys.iter().filter(has).map(|key| key.name.to_owned()).collect(), "{kind}: {error}");
    }
}

#[test]
fn words_are_the_variants_of_the_enums() {
    for table in &TABLES {
        for key in table.keys() {
            let (words, none) = match key.kind {
                Kind::Word(words) => (words, "__none".into()),
                Kind::Words(words) => (words, vec!["__none"].into()),
                _ => continue,
            };
            let error = serde_error(with(base("scattered"), &table.path_of(key.name), none));
            assert_eq!(expected_names(&error), words.iter().map(|&word| word.to_owned()).collect(), "{error}");
        }
    }
}

fn parsed(scenario: &toml::Table) -> Scenario {
    Scenario::parse("s.toml", &toml::to_string(scenario).unwrap(), &[]).unwrap_or_else(|error| panic!("{error}"))
}

fn toml_value(text: &str) -> toml::Value {
    toml::from_str::<toml::Table>(&format!("value = {text}")).unwrap()["value"].clone()
}

#[test]
fn defaults_are_those_of_the_structs() {
    for table in &TABLES {
        for key in table.keys().filter(|key| !(table.path == "spawn" && key.name == "kind")) {
            let kind = key.only_with.first().copied().unwrap_or("scattered");
            let mut without = base(kind);
            if table.path == "map.building" {
                without = with(without, "map.kind", "building".into());
            }
            if table.path == "map.mine" {
                without = with(without, "map.kind", "mine".into());
            }
            if table.path == "map.scene" {
                without = with(without, "map.kind", "scene".into());
            }
            if table.path == "lidar" {
                without.remove("lidars");
            }
            if table.path == "energy" {
                without = with(without, "energy.capacity_j", 600.0.into());
            }
            let path = table.path_of(key.name);
            match key.default {
                DefaultValue::Is(value) => {
                    assert_eq!(parsed(&with(without.clone(), &path, toml_value(value))), parsed(&without), "{path}");
                }
                DefaultValue::Required => {
                    let origin = Override { origin: String::new(), key: path.clone(), value: None };
                    let text = toml::to_string(&without).unwrap();
                    assert!(Scenario::parse("s.toml", &text, &[origin]).is_err() || table.is_list(), "{path}");
                }
                DefaultValue::Unset(_) => {}
            }
        }
    }
    let mut without = base("nearest_origin");
    without.remove("spawn");
    assert_eq!(parsed(&without), parsed(&base("nearest_origin")));
    assert_eq!(find("spawn.kind").unwrap().default, DefaultValue::Is("\"nearest_origin\""));
    assert_eq!(BodyModel::default(), BodyModel::of(BodyKind::Submarine));
}

#[test]
fn numbers_out_of_range_are_refused_and_the_ends_are_not() {
    for table in TABLES.iter().filter(|table| !table.is_list()) {
        for key in table.keys.iter().filter(|key| key.is_checked_here(table)) {
            let Some(range) = key.range.filter(|_| !matches!(key.kind, Kind::Size)) else { continue };
            let kind = key.only_with.first().copied().unwrap_or("scattered");
            let path = table.path_of(key.name);
            let refusal = |number: f64| {
                let value = match key.kind {
                    Kind::Integer(_) => toml::Value::Integer(number as i64),
                    _ => toml::Value::Float(number),
                };
                let text = toml::to_string(&with(base(kind), &path, value)).unwrap();
                Scenario::parse("s.toml", &text, &[]).err().map(|error| error.to_string())
            };
            for wrong in [range.low - 1.0, range.high + 1.0, f64::NAN] {
                let has_no_such_value = wrong.is_infinite() || wrong.is_nan() && matches!(key.kind, Kind::Integer(_));
                assert!(
                    has_no_such_value || refusal(wrong).is_some_and(|error| error.contains(&path)),
                    "{path} = {wrong}"
                );
            }
            let ends = [(range.low, range.is_low_excluded), (range.high, false)];
            for (end, is_excluded) in ends {
                let of_range = refusal(end).filter(|error| error.contains(&key.expected_range()));
                assert_eq!(of_range.is_some(), is_excluded, "{path} = {end}: {of_range:?}");
            }
        }
    }
}

/// The ranges that mapgen checks are those that are declared.
#[test]
fn generators_refuse_numbers_out_of_range() {
    for table in TABLES.iter().filter(|table| table.is_checked_by_mapgen && table.path != "map.import") {
        let generator = table.path.trim_start_matches("map.");
        for key in table.keys {
            let Some(range) = key.range else { continue };
            for wrong in [range.low - 1.0, range.high + 1.0].into_iter().filter(|number| *number >= 0.0) {
                let value = match key.kind {
                    Kind::Integer(_) => toml::Value::Integer(wrong as i64),
                    _ => toml::Value::Float(wrong),
                };
                let scenario =
                    with(with(base("scattered"), "map.kind", generator.into()), &table.path_of(key.name), value);
                let map = parsed(&scenario).map;
                let spec = match map.kind {
                    MapKind::Spheres => MapSpec::Spheres(map.spheres),
                    MapKind::Noise => MapSpec::Noise(map.noise),
                    MapKind::Mine => MapSpec::Mine(map.mine.unwrap()),
                    MapKind::Scene => MapSpec::Scene(map.scene.unwrap()),
                    _ => MapSpec::Building(map.building.unwrap()),
                };
                let error = mapgen::generate(&spec, Extent::new([30; 3], 1.0).unwrap(), 1).unwrap_err().to_string();
                let names_it = error.contains(key.name) || error.contains(&wrong.to_string());
                assert!(names_it, "{} = {wrong}: {error}", key.name);
            }
        }
    }
}

#[test]
fn importers_refuse_numbers_out_of_range() {
    for key in table("map.import").unwrap().keys {
        let Some(range) = key.range.filter(|range| range.high < f64::MAX) else { continue };
        for number in [range.low - 1.0, range.high + 1.0] {
            let value = match key.kind {
                Kind::Integer(_) => toml::Value::Integer(number as i64),
                _ => toml::Value::Float(number),
            };
            let text = toml::to_string(&with(base("scattered"), &format!("map.import.{}", key.name), value)).unwrap();
            let error = Scenario::parse("s.toml", &text, &[]).unwrap_err().to_string();
            assert!(error.contains(&format!("map.import.{} = ", key.name)), "{error}");
        }
    }
}

#[test]
fn meanings_are_plain_sentences_without_a_full_stop() {
    for key in TABLES.iter().flat_map(|table| table.keys) {
        assert!(!key.meaning.is_empty() && !key.meaning.ends_with('.'), "{}", key.name);
        assert!(!key.meaning.contains(['`', '|', '\n']), "{}: {}", key.name, key.meaning);
    }
}

#[test]
fn paths_find_their_keys() {
    assert_eq!(find("lidar.range_m").unwrap().name, "range_m");
    assert_eq!(find("bodies[3].radius_m").unwrap().meaning, find("body.radius_m").unwrap().meaning);
    assert_eq!(find("bodies[3].agents").unwrap().kind, Kind::Ids);
    assert!(find("lidar").is_none() && find("lidar.x").is_none() && find("x.range_m").is_none());
}

#[test]
fn ranges_in_words() {
    let text = |range: Option<Range>| range.unwrap().text();
    assert_eq!(text(between(0.0, 1.0)), "0 to 1");
    assert_eq!(text(POSITIVE), "above 0, up to 1e6");
    assert_eq!(text(above(0.0, f64::INFINITY)), "above 0, or inf");
    assert_eq!(text(at_least(1.0, f64::from(u32::MAX))), "at least 1");
    assert_eq!(text(between(-TAU, TAU)), "-2 pi to 2 pi");
    assert_eq!(text(between(0.02, 2e8)), "0.02 to 2e8");
    assert_eq!(find("lidar.pattern").unwrap().expected(), "expected \"lattice\", \"shell\", \"ring\" or \"frustum\"");
}

#[test]
fn the_nearest_name_is_near() {
    assert_eq!(nearest("noize", ["spheres", "noise"]), Some("noise"));
    assert_eq!(nearest("x", ["spheres", "noise"]), None);
    assert_eq!(nearest("cuont", ["count", "controller"]), Some("count"));
}
