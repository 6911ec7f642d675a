//! The options of `map generate` as a spec of the map.

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::{GenerateArgs, MapCliError, MapKind};
use mapgen::{BuildingSpec, MapSpec, MineSpec, NoiseSpec, SceneSpec, SpheresSpec};
use simulation::scenario::one_line;

/// What the options say, with the generator's defaults for what they leave out.
pub(super) fn of(args: &GenerateArgs) -> Result<MapSpec, MapCliError> {
    match args.kind {
        MapKind::Spheres => {
            let default = SpheresSpec::default();
            let spec = SpheresSpec {
                fill_ratio: args.fill.unwrap_or(default.fill_ratio),
                radius_min: args.radius_min.unwrap_or(default.radius_min),
                radius_max: args.radius_max.unwrap_or(default.radius_max),
                connections: args.connections.unwrap_or(default.connections),
                smoothing: args.smoothing.unwrap_or(default.smoothing),
                random: default.random,
            };
            changed(spec, &args.set).map(MapSpec::Spheres)
        }
        MapKind::Noise => {
            refuse_options(args, "noise", "--fill and --smoothing", &["fill", "smoothing"])?;
            let default = NoiseSpec::default();
            let spec = NoiseSpec {
                fill: args.fill.unwrap_or(default.fill),
                smoothing: args.smoothing.unwrap_or(default.smoothing),
            };
            changed(spec, &args.set).map(MapSpec::Noise)
        }
        MapKind::Mine => {
            refuse_options(args, "mine", "--set KEY=VALUE", &[])?;
            changed(MineSpec::default(), &args.set).map(MapSpec::Mine)
        }
        MapKind::Scene => {
            refuse_options(args, "scene", "--set KEY=VALUE", &[])?;
            changed(SceneSpec::default(), &args.set).map(MapSpec::Scene)
        }
        MapKind::Building => {
            refuse_options(args, "building", "--set KEY=VALUE", &[])?;
            changed(BuildingSpec::default(), &args.set).map(MapSpec::Building)
        }
    }
}

/// Refuses the first option that is given and not known to the kind.
fn refuse_options(
    args: &GenerateArgs,
    kind: &'static str,
    has: &'static str,
    known: &[&str],
) -> Result<(), MapCliError> {
    let given = [
        ("fill", args.fill.is_some()),
        ("radius-min", args.radius_min.is_some()),
        ("radius-max", args.radius_max.is_some()),
        ("connections", args.connections.is_some()),
        ("smoothing", args.smoothing.is_some()),
    ];
    match given.into_iter().find(|(option, is_given)| *is_given && !known.contains(option)) {
        Some((option, _)) => Err(MapCliError::NotForKind { option, kind, has }),
        None => Ok(()),
    }
}

/// A spec with some of its parameters set by their names.
fn changed<T: Serialize + DeserializeOwned>(spec: T, set: &[(String, toml::Value)]) -> Result<T, MapCliError> {
    let mut spec = spec;
    for (key, value) in set {
        let unfit = |reason: &str| MapCliError::Set {
            assignment: one_line(&format!("{key}={value}")),
            reason: one_line(reason),
        };
        let mut table = toml::Table::try_from(&spec).map_err(|error| unfit(&error.to_string()))?;
        table.insert(key.clone(), value.clone());
        spec = table.try_into().map_err(|error: toml::de::Error| unfit(error.message()))?;
    }
    Ok(spec)
}
