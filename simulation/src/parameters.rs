//! ROS 2 parameters of the node `sim_server`: the keys of its scenario, and those of a replay.
//!
//! Descriptions and ranges are those of [`crate::scenario::keys`]. All parameters are read-only but
//! the real-time factor, which changes no result.

use msgs::parameters::DeclaredParameter;
use msgs::rcl_interfaces::ParameterValue;

use crate::scenario::keys::{self, Kind};
use crate::scenario::{Rtf, Scenario};

/// The parameter of a run that may be set: its real-time factor.
pub const RTF: &str = "execution.rtf";

/// The parameter of a replay that may be set.
pub const RATE: &str = "rate";

/// Bounds of a real-time factor other than "as fast as possible".
const RTF_MIN: f64 = 1e-3;
const RTF_MAX: f64 = 1e6;

/// The parameters of a server that runs this scenario.
///
/// # Panics
/// Never: a scenario has string keys and plain values.
#[must_use]
pub fn of(scenario: &Scenario) -> Vec<DeclaredParameter> {
    let table = toml::Table::try_from(scenario).expect("a scenario has string keys and plain values");
    let mut parameters = vec![use_sim_time()];
    flatten("", &table, &mut parameters);
    parameters
}

/// The parameters of a replay at this rate.
#[must_use]
pub fn of_replay(rate: Rtf) -> Vec<DeclaredParameter> {
    let meaning = "greatest real-time factor: sim seconds per second of wall time; 0: as fast as possible";
    let rate = DeclaredParameter::fixed(RATE, value_of(rate), meaning).with_range(0.0, RTF_MAX);
    let rate = rate.with_constraints("0, or 0.001 to 1e6; it may be set during playback").settable();
    vec![use_sim_time(), rate]
}

/// The server publishes /clock, so it does not follow it.
fn use_sim_time() -> DeclaredParameter {
    DeclaredParameter::fixed("use_sim_time", false, "whether this node follows /clock: no, it publishes it")
}

fn flatten(prefix: &str, table: &toml::Table, parameters: &mut Vec<DeclaredParameter>) {
    for (key, value) in table {
        let name = if prefix.is_empty() { key.clone() } else { format!("{prefix}.{key}") };
        match value {
            toml::Value::Table(table) => flatten(&name, table, parameters),
            value if name == RTF => {
                let rtf = described(RTF, value.as_float().unwrap_or(0.0).into()).with_range(0.0, RTF_MAX);
                let constraints = "0 (as fast as possible), or 0.001 to 1e6; it may be set during the run";
                parameters.push(rtf.with_constraints(constraints).settable());
            }
            value => parameters.push(described(&name, converted(value))),
        }
    }
}

/// A parameter with what the declaration of the keys says about it.
fn described(name: &str, value: ParameterValue) -> DeclaredParameter {
    let Some(key) = keys::find(name) else {
        return DeclaredParameter::fixed(name, value, meaning_of_table(name));
    };
    let parameter =
        DeclaredParameter::fixed(name, value, key.meaning).with_constraints(&key.allowed().replace('`', ""));
    match (key.kind, key.range) {
        (Kind::Seed, _) => parameter.with_range(0.0, i64::MAX as f64),
        (_, Some(range)) => parameter.with_range(range.low, range.high),
        (_, None) => parameter,
    }
}

/// What a parameter means that is no key of its own: the list of bodies, or a setting of the
/// controller.
fn meaning_of_table(name: &str) -> &'static str {
    match name {
        "agents.mix" => "agents with other controllers, as an array of tables",
        "bodies" => "bodies of some agents, as an array of tables",
        "lidars" => "LiDARs of all agents or of some, as an array of tables",
        "event" => "what happens at set times, as an array of tables",
        "obstacle" => "obstacles that move on given paths, as an array of tables",
        _ => "a setting of the controller",
    }
}

/// A TOML value as the value of a parameter; what a parameter cannot hold becomes a text.
fn converted(value: &toml::Value) -> ParameterValue {
    match value {
        toml::Value::Boolean(value) => (*value).into(),
        toml::Value::Integer(value) => (*value).into(),
        toml::Value::Float(value) => (*value).into(),
        toml::Value::String(value) => value.clone().into(),
        toml::Value::Array(values) => match values.iter().map(toml::Value::as_integer).collect::<Option<Vec<i64>>>() {
            Some(numbers) if !numbers.is_empty() => numbers.into(),
            _ => value.to_string().into(),
        },
        other => other.to_string().into(),
    }
}

/// Whether a parameter is the real-time factor of its node.
#[must_use]
pub fn is_pace(name: &str) -> bool {
    [RTF, RATE].contains(&name)
}

/// The real-time factor that a value of the parameter `name` stands for.
///
/// # Errors
/// If it is out of range.
pub fn pace(name: &str, value: f64) -> Result<Rtf, String> {
    if value == 0.0 {
        Ok(Rtf::MAX)
    } else if (RTF_MIN..=RTF_MAX).contains(&value) {
        Ok(Rtf::Limit(value))
    } else {
        Err(format!("{name} = {value}: expected 0 (as fast as possible), or {RTF_MIN} to {RTF_MAX}"))
    }
}

/// The value of a parameter that stands for this real-time factor.
#[must_use]
pub fn value_of(pace: Rtf) -> f64 {
    match pace {
        Rtf::Limit(limit) => limit,
        Rtf::Max(_) => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    fn scenario(rest: &str) -> Scenario {
        let text = format!(
            "seed = 1\nduration_s = 1.0\n{rest}\n[agents]\ncount = 2\ncmd_vel = [1]\nreserve = [1]\ncommand = [\"a\"]\n\
                    command_ids = [0]\nbase_stations = [0]\ncommand_signs = false\nset = {{ x = 1 }}\n"
        );
        Scenario::parse("s.toml", &text, &[]).unwrap()
    }

    /// Between them they have every key of a scenario.
    fn maximal_scenarios() -> Vec<Scenario> {
        let common = "execution = { record = \"a\", rtf = 2.0 }\nstop_when_covered = true\nstop_when_back = true\n\
                      stop_when_known_at_base = true\n\
                      bodies = [{ agents = [0], kind = \"aerial\" }]\n\
                      event = [{ kind = \"leave\", at_s = 0.5, agent = 0 }]\n\
                      obstacle = [{ kind = \"sphere\", radius_m = 0.5, path = [[2.0, 2.0, 2.0], [4.0, 2.0, 2.0]], \
                      speed_m_s = 1.0 }]\n\
                      sensor = { range_sigma_m = 0.1, missed_returns = 0.1, pose_bound_m = 1.0, pose_step_m = 0.1 }\n\
                      localisation = { position_noise_m = 0.1, position_bias = 0.1, heading_noise_rad = 0.1, \
                      heading_bias_rad_per_m = 0.1, turn_noise_rad = 0.1, turn_bias = 0.1, closure_range_m = 1.0, \
                      closure_gain_m = 9.0 }\n\
                      [communication]\nloss = 0.1\nbytes_per_s = 1e5\nqueue_bytes = 200000\nmodel = \"attenuated\"\n\
                      attenuation = { wall_exponent = 5.0 }\nrelays = { per_agent = 3 }";
        let import = "fill = \"shell\", inside = \"free\", unknown = \"free\", up = \"y\", scale = 0.001, margin_cells = 2, \
                      free_from = [1.0, 2.0, 3.0], height_cells = 3, threshold = 0.5, sensor = [1.0, 2.0, 3.0], cells_max = 1000, steps_max = 1000, \
                      crop = [0.0, 0.0, 0.0, 1.0, 1.0, 1.0], gap_cells = 2, voxel_min_points = 2, outliers = 3, \
                      classes = [2], drop_flags = [\"none\"], model_path = [\"models\"]";
        let places = ["stations = [[1.0, 2.0, 3.0]]", "trajectory = \"poses.txt\""];
        [
            (
                "{ kind = \"noise\", size = [30, 20, 10], seed = 3 }".to_owned(),
                "{ kind = \"list\", poses = [[1.5, 1.5, 1.5], [2.5, 1.5, 1.5]] }",
            ),
            (
                format!("{{ kind = \"file\", file = \"a.txt\", cell_m = 0.5, import = {{ {import} }} }}"),
                "{ kind = \"scattered\", seed = 3 }",
            ),
            (
                "{ kind = \"building\", size = 30, spheres = { random = \"unity\" } }".to_owned(),
                "{ kind = \"box\", low = [1.0, 1.0, 1.0], high = [9.0, 9.0, 9.0] }",
            ),
            ("{ kind = \"mine\", size = 30 }".to_owned(), "{ kind = \"scattered\" }"),
            ("{ kind = \"scene\", size = 30 }".to_owned(), "{ kind = \"scattered\" }"),
            (
                format!("{{ kind = \"file\", file = \"a.pcd\", import = {{ {} }} }}", places[0]),
                "{ kind = \"scattered\" }",
            ),
            (
                format!("{{ kind = \"file\", file = \"a.pcd\", import = {{ {} }} }}", places[1]),
                "{ kind = \"scattered\" }",
            ),
        ]
        .into_iter()
        .zip(
            [
                ("capacity_j", "pattern = \"ring\"", "kind = \"aerial\""),
                ("capacity_j", "pattern = \"ring\", elevations_rad = [0.0, 0.1]", "kind = \"aerial\""),
                (
                    "endurance_s",
                    "pattern = \"frustum\"",
                    "kind = \"ground\", drive = \"holonomic\", step_max_m = 0.2, slope_max_rad = 0.3",
                ),
            ]
            .into_iter()
            .cycle(),
        )
        .map(|((map, spawn), (capacity, lidar, body))| {
            let energy = format!("{{ {capacity} = 60.0, bases = [[1.0, 2.0, 3.0]] }}");
            scenario(&format!(
                "map = {map}\nspawn = {spawn}\nenergy = {energy}\nlidar = {{ {lidar}, sees_agents = true }}\n\
                 body = {{ {body} }}\n{common}"
            ))
        })
        .collect()
    }

    #[test]
    fn every_key_is_described_and_only_the_rtf_is_settable() {
        let mut seen = BTreeSet::new();
        for parameter in maximal_scenarios().iter().flat_map(of) {
            let name = parameter.descriptor.name.clone();
            let is_setting = name.starts_with("agents.set.");
            let is_described = parameter.descriptor.description != "a setting of the controller";
            assert_eq!(is_described, !is_setting, "{name} has no description of its own");
            assert!(
                is_setting
                    || ["use_sim_time", "agents.mix", "bodies", "lidars", "event", "obstacle"].contains(&name.as_str())
                    || keys::find(&name).is_some()
            );
            assert_eq!(parameter.descriptor.read_only, name != RTF, "{name}");
            seen.insert(name);
        }
        let declared = keys::TABLES.iter().filter(|table| !table.is_list());
        for key in declared.flat_map(|table| table.keys.iter().map(|key| table.path_of(key.name))) {
            assert!(
                seen.contains(&key) || ["agents.set", "lidar.preset"].contains(&key.as_str()),
                "{key} is no parameter of a maximal scenario"
            );
        }
    }

    #[test]
    fn ranges_are_those_of_the_keys() {
        let scenarios = maximal_scenarios();
        let parameters = of(&scenarios[0]);
        let named = |name: &str| &parameters.iter().find(|known| known.descriptor.name == name).unwrap().descriptor;
        let seeds = named("seed").integer_range[0];
        assert_eq!((seeds.from_value, seeds.to_value), (0, i64::MAX));
        let agents = named("agents.count").integer_range[0];
        assert_eq!((agents.from_value, agents.to_value), (1, 1000));
        let loss = named("communication.loss").floating_point_range[0];
        assert_eq!((loss.from_value, loss.to_value), (0.0, 1.0));
        assert_eq!(
            named("map.kind").additional_constraints,
            "\"spheres\", \"noise\", \"building\", \"mine\", \"scene\", \"file\""
        );
    }

    #[test]
    fn values_keep_their_types() {
        let parameters = of(&scenario("map = { kind = \"noise\", size = [30, 20, 10] }"));
        let value = |name: &str| &parameters.iter().find(|known| known.descriptor.name == name).unwrap().value;
        assert_eq!(*value("map.size"), vec![30_i64, 20, 10].into());
        assert_eq!(*value("agents.count"), 2_i64.into());
        assert_eq!(*value("lidar.range_m"), f64::INFINITY.into());
        assert_eq!(*value(RTF), 0.0.into());
        assert_eq!(*value("execution.paused"), false.into());
    }

    #[test]
    fn paces() {
        assert_eq!(pace(RTF, 0.0), Ok(Rtf::MAX));
        assert_eq!(pace(RATE, 2.5), Ok(Rtf::Limit(2.5)));
        for wrong in [-1.0, 1e-4, 1e7, f64::NAN] {
            assert!(pace(RTF, wrong).is_err(), "{wrong}");
        }
        for right in [Rtf::MAX, Rtf::Limit(0.5)] {
            assert_eq!(pace(RTF, value_of(right)), Ok(right));
        }
    }
}
