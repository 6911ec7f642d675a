//! The keys of the scenario as parameters of the node `sim_server`, as `docs/scenario.md` describes them, and those of a replay.
//!
//! All are read-only, save the pace: it changes no result. Nothing here decides anything.

use msgs::parameters::{Parameter, Value};

use crate::scenario::{Rtf, Scenario};

/// The parameter that people may set.
pub const RTF: &str = "execution.rtf";

/// The same of a replay.
pub const RATE: &str = "rate";

/// The least pace that is not "as fast as possible", and the greatest.
const RTF_MIN: f64 = 1e-3;
const RTF_MAX: f64 = 1e6;

/// A key: its name, what it means, and the range of its numbers.
type Key = (&'static str, &'static str, Option<(f64, f64)>);

/// What a number of metres, seconds or the like may be.
const POSITIVE: Option<(f64, f64)> = Some((0.0, 1e6));

/// What a number of ticks between two events may be.
const PERIOD: Option<(f64, f64)> = Some((1.0, 4_294_967_295.0));

/// The keys of a scenario. Those of tables that are free, such as `agents.set`, are not among them.
const KEYS: [Key; 66] = [
    ("seed", "seed of everything random", Some((0.0, 9_223_372_036_854_775_807.0))),
    ("duration_s", "sim time after which the run ends, s", Some((0.02, 2e8))),
    ("stop_when_explored", "whether the run ends once every free cell has been seen", None),
    ("stop_when_covered", "whether the run ends once a body has been in every free cell, and not before", None),
    ("map.kind", "which generator, or a file", None),
    ("map.size", "cells along each axis; one number for a cube", Some((5.0, 1024.0))),
    ("map.cell_m", "edge of a cell, m", POSITIVE),
    ("map.seed", "seed of the map alone", Some((0.0, 9_223_372_036_854_775_807.0))),
    ("map.file", "the map file", None),
    ("map.import.fill", "which cells of a mesh are wall: the solid ones, or the surface", None),
    ("map.import.inside", "what cells inside a mesh are", None),
    ("map.import.unknown", "what cells are of which an OctoMap file does not know", None),
    ("map.import.up", "axis of the file that points upwards", None),
    ("map.import.scale", "metres for each unit of the file", None),
    ("map.import.margin_cells", "layers of free cells around what the file holds", Some((0.0, 500.0))),
    ("map.import.free_from", "place of the file that free cells must be connected with", None),
    ("map.import.height_cells", "free cells from floor to ceiling of a floor plan", Some((1.0, 1022.0))),
    ("map.import.threshold", "brightness from which a pixel of a floor plan is free", Some((0.0, 1.0))),
    ("map.spheres.fill_ratio", "spheres are added until they have freed this share of the volume", Some((0.0, 1.0))),
    ("map.spheres.radius_min", "smallest radius of a sphere, and radius of every tunnel, cells", Some((0.0, 510.0))),
    ("map.spheres.radius_max", "largest radius of a sphere, cells", Some((0.0, 510.0))),
    ("map.spheres.connections", "to how many of its nearest spheres each sphere is joined", Some((0.0, 64.0))),
    ("map.spheres.smoothing", "smoothing passes", Some((0.0, 1000.0))),
    ("map.noise.fill", "probability that an inner cell starts as wall", Some((0.0, 1.0))),
    ("map.noise.smoothing", "smoothing passes", Some((0.0, 1000.0))),
    ("agents.count", "agents that take part", Some((1.0, 1000.0))),
    ("agents.controller", "what an agent runs if its own command line does not say", None),
    (
        "agents.share_period_ticks",
        "ticks between two tellings of what is new on a map; 0: never",
        Some((0.0, 4_294_967_295.0)),
    ),
    ("agents.cmd_vel", "agents that are driven by standard messages", Some((0.0, 999.0))),
    ("spawn.kind", "how starts are chosen", None),
    ("spawn.yaw_rad", "heading of all agents, rad", Some((-std::f64::consts::TAU, std::f64::consts::TAU))),
    ("spawn.poses", "one start for each agent, m and rad", None),
    ("body.radius_m", "radius of the sphere that collides, m", POSITIVE),
    ("body.speed_max_m_s", "top speed along the path, m/s", POSITIVE),
    ("body.acceleration_m_s2", "speeding up, m/s^2", POSITIVE),
    ("body.deceleration_m_s2", "braking, m/s^2", POSITIVE),
    ("body.turn_rate_max_rad_s", "top turn rate, rad/s", POSITIVE),
    ("body.turn_acceleration_rad_s2", "speeding up a turn, rad/s^2", POSITIVE),
    ("body.turn_deceleration_rad_s2", "braking a turn, rad/s^2", POSITIVE),
    ("lidar.pattern", "how rays are spread", None),
    ("lidar.rays", "rays of the lattice", Some((1.0, 1e6))),
    ("lidar.shell_radius_cells", "radius of the shell, cells", Some((1.0, 200.0))),
    ("lidar.range_m", "how far the lattice sees, m", Some((0.0, f64::INFINITY))),
    ("lidar.fov_rad", "full opening angle of the cone about the heading, rad", Some((0.0, std::f64::consts::TAU))),
    ("lidar.schedule", "who decides when to scan", None),
    ("lidar.period_ticks", "ticks between scans until an agent asks otherwise", PERIOD),
    ("communication.range_m", "greatest distance between two agents in contact, m", Some((0.0, f64::INFINITY))),
    (
        "recording.poses_period_ticks",
        "ticks between two recordings of all poses; 0: none",
        Some((0.0, 4_294_967_295.0)),
    ),
    ("faults.on_agent_loss", "what happens when an agent does not answer in time", None),
    ("execution.threads", "threads that cast scans; 0: as many as there are cores", Some((0.0, 1024.0))),
    ("execution.look_ahead", "whether agents are asked only when they are due", None),
    (RTF, "sim seconds for each second of wall time, at the most; 0: as fast as possible", Some((0.0, RTF_MAX))),
    ("execution.paused", "whether the run began paused", None),
    ("execution.join_timeout_s", "wall time to wait for all agents at the start, s", POSITIVE),
    ("execution.decision_timeout_s", "wall time to wait for an answer, s", POSITIVE),
    ("execution.record", "where the recording goes", None),
    ("views.max_hz", "messages of one topic in a second of wall time, at the most", Some((0.1, 1000.0))),
    ("views.tf_period_ticks", "ticks between two messages on /tf", PERIOD),
    ("views.odom_period_ticks", "ticks between two odometries of an agent", PERIOD),
    ("views.points_period_ticks", "ticks between two scans of an agent that are shown, at the least", PERIOD),
    ("views.path_period_ticks", "ticks between two looks at where an agent is going", PERIOD),
    ("views.unexplored_period_ticks", "ticks between two looks at what nobody has seen", PERIOD),
    ("views.contacts_period_ticks", "ticks between two looks at who is in contact", PERIOD),
    ("views.info_period_ticks", "ticks between two messages on how things are", PERIOD),
    ("views.record", "views that are recorded, too", None),
    ("use_sim_time", "whether this node goes by /clock: it makes it", None),
];

/// The parameters of a server that carries out this scenario.
///
/// # Panics
/// Never: a scenario has string keys and plain values.
#[must_use]
pub fn of(scenario: &Scenario) -> Vec<Parameter> {
    let table = toml::Table::try_from(scenario).expect("a scenario has string keys and plain values");
    let mut parameters = vec![described("use_sim_time", false.into())];
    flatten("", &table, &mut parameters);
    parameters
}

/// The parameters of a replay at this pace.
#[must_use]
pub fn of_replay(rate: Rtf) -> Vec<Parameter> {
    let words = "sim seconds for each second of wall time, at the most; 0: as fast as possible";
    let rate = Parameter::fixed(RATE, value_of(rate), words).with_range(0.0, RTF_MAX);
    let rate = rate.with_constraints("0, or 0.001 to 1e6; it may be set while the recording is played").settable();
    vec![described("use_sim_time", false.into()), rate]
}

fn flatten(prefix: &str, table: &toml::Table, parameters: &mut Vec<Parameter>) {
    for (key, value) in table {
        let name = if prefix.is_empty() { key.clone() } else { format!("{prefix}.{key}") };
        match value {
            toml::Value::Table(table) => flatten(&name, table, parameters),
            _ if name == RTF => {
                let rtf = described(RTF, value.as_float().unwrap_or(0.0).into());
                let words = "0, or 0.001 to 1e6; it may be set while the run is under way";
                parameters.push(rtf.with_constraints(words).settable());
            }
            value => parameters.push(described(&name, converted(value))),
        }
    }
}

fn described(name: &str, value: Value) -> Parameter {
    let known = KEYS.iter().find(|(key, ..)| *key == name);
    let (description, range) =
        known.map_or(("a setting of the controller", None), |(_, words, range)| (*words, *range));
    let parameter = Parameter::fixed(name, value, description);
    match range {
        Some((low, high)) => parameter.with_range(low, high),
        None => parameter,
    }
}

/// A value of the scenario as one of a parameter; what a parameter cannot hold becomes a text.
fn converted(value: &toml::Value) -> Value {
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

/// Whether a parameter is the pace of its node.
#[must_use]
pub fn is_pace(name: &str) -> bool {
    [RTF, RATE].contains(&name)
}

/// The pace that a value of the parameter `name` means.
///
/// # Errors
/// If there is no such pace.
pub fn pace(name: &str, value: f64) -> Result<Rtf, String> {
    if value == 0.0 {
        Ok(Rtf::MAX)
    } else if (RTF_MIN..=RTF_MAX).contains(&value) {
        Ok(Rtf::Limit(value))
    } else {
        Err(format!("{name} = {value}: expected 0 (as fast as possible), or {RTF_MIN} to {RTF_MAX}"))
    }
}

/// The value of a parameter that means this pace.
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
        let text =
            format!("seed = 1\nduration_s = 1.0\n{rest}\n[agents]\ncount = 2\ncmd_vel = [1]\nset = {{ x = 1 }}\n");
        Scenario::parse("s.toml", &text, &[]).unwrap()
    }

    #[test]
    fn every_key_is_described_and_only_the_pace_may_be_set() {
        let whole = "spawn = { kind = \"list\", poses = [[1.5, 1.5, 1.5], [2.5, 1.5, 1.5]] }\n\
                     execution = { record = \"a\", rtf = 2.0 }\n\
                     stop_when_covered = true\n\
                     map = { kind = \"noise\", size = [30, 20, 10], seed = 3 }";
        let import = "fill = \"shell\", inside = \"free\", unknown = \"free\", up = \"y\", scale = 0.001, margin_cells = 2, \
                      free_from = [1.0, 2.0, 3.0], height_cells = 3, threshold = 0.5";
        let file = format!("map = {{ kind = \"file\", file = \"a.txt\", import = {{ {import} }} }}");
        let others = [file.as_str(), "map = { kind = \"spheres\", size = 30 }"];
        let mut seen = BTreeSet::new();
        for text in [whole, others[0], others[1]] {
            for parameter in of(&scenario(text)) {
                let name = parameter.descriptor.name.clone();
                let is_setting = name.starts_with("agents.set.");
                assert!(is_setting || KEYS.iter().any(|(key, ..)| *key == name), "{name} has no description");
                assert_eq!(parameter.descriptor.read_only, name != RTF, "{name}");
                seen.insert(name);
            }
        }
        for (key, ..) in KEYS {
            assert!(seen.contains(key), "{key} is no key of a scenario");
        }
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
