//! Values that a table has because it names all its keys, as recordings and the output of `maes
//! scenario` do, and that were not given.
//!
//! Such a value cannot be told from one that was given. So where a change decides the defaults of
//! other keys (a kind of body, of map or of start poses, a pattern or a preset of a LiDAR), the
//! values that equal the defaults before it are taken for filled in, and those after it hold
//! instead. A table without some of its keys was written by hand, and keeps all its values; only
//! what cannot go with the new kind of map or of start poses leaves it.

use mapgen::{BuildingSpec, MineSpec, SceneSpec};
use protocol::body_model::{BodyKeys, BodyModel};
use serde::Serialize;

use super::changes::Change;
use super::{LidarPattern, LidarSection};

/// Drops the values of a scenario that were filled in and that the changes of other keys decide.
pub(super) fn drop_filled_in(scenario: &mut toml::Table, changes: &[Change<'_>]) {
    let change_of = |key: &str| changes.iter().rev().find(|(changed, _)| *changed == key).map(|(_, value)| *value);
    let is_changed = |key: &str| change_of(key).is_some();
    if changes.iter().any(|(key, _)| *key == "body" || key.starts_with("body.")) {
        drop_of_bodies(scenario, is_changed("body.kind"));
    }
    if (is_changed("lidar.pattern") || is_changed("lidar.preset"))
        && let Some(lidar) = table_in(scenario, "lidar")
    {
        drop_of_lidar(lidar);
    }
    if is_changed("spawn.kind")
        && let Some(spawn) = table_in(scenario, "spawn")
    {
        for key in ["yaw_rad", "min_distance_m"] {
            drop_equal(spawn, key, &toml::Value::Float(0.0));
        }
    }
    if let Some(kind) = change_of("map.kind")
        && let Some(map) = table_in(scenario, "map")
    {
        drop_of_map(map, kind.and_then(toml::Value::as_str));
    }
    // A battery has one of them.
    for (given, other) in [("capacity_j", "endurance_s"), ("endurance_s", "capacity_j")] {
        let is_given = |key: &str| change_of(&format!("energy.{key}")).flatten().is_some();
        if is_given(given)
            && !is_given(other)
            && let Some(energy) = table_in(scenario, "energy")
        {
            energy.remove(other);
        }
    }
}

fn table_in<'t>(scenario: &'t mut toml::Table, name: &str) -> Option<&'t mut toml::Table> {
    scenario.get_mut(name)?.as_table_mut()
}

/// The keys that a section has once all are filled in.
fn keys_of(section: impl Serialize) -> toml::Table {
    toml::Table::try_from(section).unwrap_or_default()
}

fn is_equal(one: &toml::Value, other: &toml::Value) -> bool {
    let number = |value: &toml::Value| value.as_float().or_else(|| value.as_integer().map(|integer| integer as f64));
    one == other || number(one).is_some_and(|one| number(other) == Some(one))
}

fn drop_equal(table: &mut toml::Table, key: &str, filled_in: &toml::Value) {
    if table.get(key).is_some_and(|value| is_equal(value, filled_in)) {
        table.remove(key);
    }
}

/// Drops from a table that names all keys those that have the values of one of several ways to fill
/// it in: the one that explains most of them.
fn drop_explained(table: &mut toml::Table, ways: &[toml::Table]) {
    let explained = |way: &&toml::Table| {
        way.iter().filter(|(key, filled_in)| table.get(*key).is_some_and(|value| is_equal(value, filled_in))).count()
    };
    let complete = ways.iter().filter(|way| way.keys().all(|key| table.contains_key(key)));
    // The first of equals.
    let best = complete.rev().max_by_key(explained).cloned().unwrap_or_default();
    for (key, filled_in) in &best {
        drop_equal(table, key, filled_in);
    }
}

/// `[body]` before a change of its kind, and the entries of `[[bodies]]` before any change of it.
fn drop_of_bodies(scenario: &mut toml::Table, is_other_kind: bool) {
    let body = scenario.get("body").cloned().map_or(Ok(BodyModel::default()), toml::Value::try_into);
    let Ok(body): Result<BodyModel, _> = body else { return };
    let entries = scenario.get_mut("bodies").and_then(toml::Value::as_array_mut);
    for entry in entries.into_iter().flatten().filter_map(toml::Value::as_table_mut) {
        let kind: toml::Table = entry.get("kind").map(|kind| ("kind".to_owned(), kind.clone())).into_iter().collect();
        let Ok(alone): Result<BodyKeys, _> = kind.try_into() else { continue };
        let mut filled_in = keys_of(BodyKeys::all(alone.over(&body)));
        if alone.over(&body).kind != body.kind {
            filled_in.remove("kind");
        }
        drop_explained(entry, &[filled_in]);
    }
    if is_other_kind && let Some(table) = table_in(scenario, "body") {
        drop_explained(table, &[keys_of(BodyModel::of(body.kind))]);
    }
}

/// `[lidar]` before a change of its pattern or its preset.
fn drop_of_lidar(lidar: &mut toml::Table) {
    let pattern: Option<LidarPattern> = lidar.get("pattern").cloned().and_then(|pattern| pattern.try_into().ok());
    if let Some(pattern) = pattern {
        let ways: Vec<toml::Table> = LidarSection::with_pattern(pattern).map(keys_of).collect();
        drop_explained(lidar, &ways);
    }
}

/// `[map]` before a change to another kind, if that is named.
fn drop_of_map(map: &mut toml::Table, kind: Option<&str>) {
    let was_file = map.get("kind").and_then(toml::Value::as_str) == Some("file");
    match (was_file, kind == Some("file")) {
        // The file decides them.
        (false, true) => {
            for key in ["size", "spheres", "noise", "building", "mine", "scene"] {
                map.remove(key);
            }
            drop_equal(map, "cell_m", &toml::Value::Float(1.0));
        }
        (true, false) => {
            map.remove("file");
            map.remove("import");
        }
        (true, true) => {}
        (false, false) => {
            let generators = [
                ("building", keys_of(BuildingSpec::default())),
                ("mine", keys_of(MineSpec::default())),
                ("scene", keys_of(SceneSpec::default())),
            ];
            for (generator, filled_in) in generators.into_iter().filter(|(generator, _)| kind != Some(*generator)) {
                if map.get(generator).is_some_and(|table| *table == toml::Value::Table(filled_in)) {
                    map.remove(generator);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests;
