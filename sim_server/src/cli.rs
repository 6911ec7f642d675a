//! The command line of the server, and how its flags become overrides of the scenario.
//!
//! This module only declares; it opens nothing and runs nothing.

mod numbers;

use std::path::{Path, PathBuf};

use clap::builder::{PathBufValueParser, TypedValueParser};
use clap::{Args, Parser, Subcommand};

use msgs::ids::Tick;
pub use numbers::{of_key, positive, whole};
use recording::location::recording_at;
use recording::recorder::may_be_named;
use simulation::scenario::{MapKind, Override, keys};

/// World server of a deterministic simulator of multi-robot exploration.
#[derive(Debug, Parser)]
#[command(
    name = "sim_server",
    version,
    arg_required_else_help = true,
    after_help = "`maes run` starts a server with its agents; recordings, maps and scenarios are for `maes`, too."
)]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// What to do.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Serve a run over ROS 2; `maes run` also starts the agents
    Run(Box<RunArgs>),
}

/// Arguments of `run`.
#[derive(Debug, Args)]
pub struct RunArgs {
    /// The scenario (.toml), or a recording of it (.mcap); a resumed run and a fork have one
    #[arg(value_parser = recording_path())]
    #[cfg_attr(feature = "view", arg(required_unless_present_any = ["resume", "fork", "idle"]))]
    #[cfg_attr(not(feature = "view"), arg(required_unless_present_any = ["resume", "fork"]))]
    pub scenario: Option<PathBuf>,
    /// Show the run in a browser or in Foxglove: a page and a Foxglove WebSocket at this address
    #[cfg(feature = "view")]
    #[arg(long, value_name = "ADDR:PORT", num_args = 0..=1, default_missing_value = foxglove_server::DEFAULT_ADDRESS)]
    pub view: Option<String>,
    /// The folder of the page, if it is not the one that was built here
    #[cfg(feature = "view")]
    #[arg(long, value_name = "DIR", requires = "view")]
    pub page: Option<PathBuf>,
    /// Let pages of this origin connect as well, such as <https://app.foxglove.dev>; may be
    /// repeated
    #[cfg(feature = "view")]
    #[arg(long, value_name = "ORIGIN", requires = "view")]
    pub view_allow_origin: Vec<foxglove_server::PageOrigin>,
    /// Serve the runs that are started on the page, one after the other
    #[cfg(feature = "view")]
    #[arg(long, requires = "view", conflicts_with_all = ["resume", "fork", "scenario"])]
    pub idle: bool,
    /// Stay after the run: serve restarts of it, and the runs that are started on the page
    #[cfg(feature = "view")]
    #[arg(long, requires = "view", conflicts_with = "idle")]
    pub stay: bool,
    /// With --idle or --stay: the program that checks the controller of a run before it starts,
    /// called with `--check --id 0 --controller NAME --set KEY=VALUE...` [default: agent_node
    /// beside this program]; given again: a first argument of that program
    #[cfg(feature = "view")]
    #[arg(long, value_name = "PROGRAM", requires = "view")]
    pub check_agents: Vec<PathBuf>,
    /// With --idle or --stay: the folder of the recordings of requested runs, which the server
    /// names
    #[cfg(feature = "view")]
    #[arg(long, value_name = "DIR", requires = "view", default_value = crate::requested_run::RECORD_DIR)]
    pub record_dir: PathBuf,
    /// With --idle or --stay: the folder of the map files that requested runs may name [default:
    /// the folder of the project's scenarios, if it is here]
    #[cfg(feature = "view")]
    #[arg(long, value_name = "DIR", requires = "view")]
    pub map_dir: Option<PathBuf>,
    /// Resume the run of this recording, whose server was killed; completes it, or the file that
    /// --record names
    #[arg(long, value_name = "FILE.mcap", value_parser = recording_path())]
    pub resume: Option<PathBuf>,
    #[command(flatten)]
    pub fork: ForkArgs,
    /// The folder that paths in the scenario file start from [default: its own]
    #[arg(long, value_name = "DIR", conflicts_with_all = ["resume", "fork"])]
    pub paths_from: Option<PathBuf>,
    /// Write what is printed about the run to this file as well
    #[arg(long, value_name = "FILE")]
    pub log: Option<PathBuf>,
    /// Write a line to this file (or pipe) once agents may be started
    #[arg(long, value_name = "FILE")]
    pub ready: Option<PathBuf>,
    /// Write digest, reason, last tick and wall time to this file when the run has a result
    #[arg(long, value_name = "FILE.json")]
    pub summary: Option<PathBuf>,
    /// Print where the wall time went; with a name, also write a trace for Perfetto or
    /// chrome://tracing
    #[arg(long, value_name = "FILE.json", num_args = 0..=1, default_missing_value = "", value_parser = trace_file)]
    pub profile: Option<PathBuf>,
    /// File with the join secret of the run, readable by its owner only [default: the environment
    /// variable MAES_JOIN_SECRET, or none]
    #[arg(long, value_name = "FILE")]
    pub join_secret_file: Option<PathBuf>,
    /// Agents that foreign nodes run, which need not sign their commands; those of agents.cmd_vel
    /// are among them
    #[arg(long, value_name = "ID,...", value_delimiter = ',')]
    pub external: Vec<u32>,
    /// Keys of the scenario to override.
    #[command(flatten)]
    pub keys: KeyArgs,
}

/// The fork of a recorded run.
#[derive(Debug, Args, Default)]
pub struct ForkArgs {
    /// Take the run of this recording up to --at, and continue there with the keys that are given
    /// (docs/what-if.md)
    #[arg(
        long,
        value_name = "FILE.mcap",
        requires = "at",
        conflicts_with_all = ["scenario", "resume"],
        value_parser = recording_path()
    )]
    pub fork: Option<PathBuf>,
    /// Sim time of the fork, such as 90, 90s or 1:30
    #[arg(long, value_name = "TIME", requires = "fork", value_parser = fork_time)]
    pub at: Option<Tick>,
}

impl ForkArgs {
    /// The recording, and the first tick that is not taken from it.
    #[must_use]
    pub fn point(&self) -> Option<(&Path, Tick)> {
        Some((self.fork.as_deref()?, self.at?))
    }
}

fn fork_time(text: &str) -> Result<Tick, String> {
    time_s(text).and_then(crate::setup::tick_at)
}

/// Flags that override keys of the scenario. The help of a flag with a key of its own is the
/// declaration of that key.
#[derive(Debug, Args, Default)]
pub struct KeyArgs {
    #[arg(long, value_name = "N", value_parser = of_key::<u32>("agents.count"), allow_negative_numbers = true, help = meaning("agents.count"))]
    pub agents: Option<u32>,
    #[arg(long, value_name = "NAME", help = meaning("agents.controller"))]
    pub controller: Option<String>,
    #[arg(
        long,
        value_name = "TICKS",
        value_parser = of_key::<u32>("agents.share_period_ticks"),
        allow_negative_numbers = true,
        help = meaning("agents.share_period_ticks")
    )]
    pub share_period: Option<u32>,
    /// map.kind and map.file: spheres, noise, building, mine, scene, or a map file (docs/maps.md)
    #[arg(long, value_name = "spheres|noise|building|mine|scene|FILE")]
    pub map: Option<String>,
    /// map.size: cells along each axis, for example 100 or 100x80x30
    #[arg(long, value_name = "S|XxYxZ", value_parser = size, allow_negative_numbers = true)]
    pub size: Option<toml::Value>,
    #[arg(long, value_name = "K", value_parser = of_key::<u64>("seed"), allow_negative_numbers = true, help = meaning("seed"))]
    pub seed: Option<u64>,
    #[arg(long, value_name = "TIME", value_parser = time_s, allow_negative_numbers = true, help = timed("duration_s"))]
    pub duration: Option<f64>,
    #[arg(long, value_name = "FILE.mcap|DIR/", value_parser = recording_file, help = meaning("execution.record"))]
    pub record: Option<String>,
    /// views.record: visualisation topics that the recording holds as well, for example
    /// map,odom,points, or all
    #[arg(long, value_name = "WORD,...", value_delimiter = ',')]
    pub record_topics: Vec<String>,
    #[arg(long, value_name = "X|max", value_parser = rtf, allow_negative_numbers = true, help = meaning("execution.rtf"))]
    pub rtf: Option<toml::Value>,
    #[arg(
        long,
        value_name = "N",
        value_parser = of_key::<u32>("execution.threads"),
        allow_negative_numbers = true,
        help = meaning("execution.threads")
    )]
    pub threads: Option<u32>,
    #[arg(long, value_name = "true|false", help = meaning("execution.look_ahead"))]
    pub look_ahead: Option<bool>,
    #[arg(
        long,
        value_name = "true|false",
        num_args = 0..=1,
        default_missing_value = "true",
        help = meaning("execution.unix_sockets")
    )]
    pub unix_sockets: Option<bool>,
    #[arg(
        long,
        value_name = "true|false",
        num_args = 0..=1,
        default_missing_value = "true",
        help = meaning("execution.paused")
    )]
    pub paused: Option<bool>,
    #[arg(long, value_name = "TIME", value_parser = time_s, allow_negative_numbers = true, help = timed("execution.join_timeout_s"))]
    pub join_timeout: Option<f64>,
    #[arg(long, value_name = "TIME", value_parser = time_s, allow_negative_numbers = true, help = timed("execution.decision_timeout_s"))]
    pub decision_timeout: Option<f64>,
    /// Any key of the scenario, for example lidar.range_m=20; may be repeated (docs/scenario.md)
    #[arg(long, value_name = "KEY=VALUE", value_parser = assignment)]
    pub set: Vec<(String, toml::Value)>,
}

/// Path and meaning of a key, as the help of its flag.
fn meaning(key: &str) -> String {
    let known = keys::find(key).expect("a flag sets a key of the scenario");
    format!("{key}: {}", known.meaning)
}

/// Path and meaning of a key that is a time in seconds, and how else it may be given.
fn timed(key: &str) -> String {
    format!("{}; seconds, or a time such as 30min or 1:30", meaning(key))
}

impl KeyArgs {
    /// The overrides of these flags; those of `--set` come last.
    #[must_use]
    pub fn overrides(&self) -> Vec<Override> {
        let mut overrides = self.map.as_deref().map(map_overrides).unwrap_or_default();
        let mut set = |flag: &str, key: &str, value: Option<toml::Value>| {
            overrides.extend(value.map(|value| Override {
                origin: format!("{flag} {}", typed(&value)),
                key: key.to_owned(),
                value: Some(value),
            }));
        };
        set("--agents", "agents.count", self.agents.map(Into::into));
        set("--controller", "agents.controller", self.controller.clone().map(Into::into));
        set("--share-period", "agents.share_period_ticks", self.share_period.map(Into::into));
        set("--size", "map.size", self.size.clone());
        // A u64 that TOML cannot hold becomes a text, which the scenario refuses with the range of
        // seeds.
        let seed = self.seed.map(|seed| i64::try_from(seed).map_or_else(|_| seed.to_string().into(), Into::into));
        set("--seed", "seed", seed);
        set("--duration", "duration_s", self.duration.map(Into::into));
        set("--record", "execution.record", self.record.clone().map(Into::into));
        let topics = (!self.record_topics.is_empty()).then(|| self.record_topics.clone().into());
        set("--record-topics", "views.record", topics);
        set("--rtf", "execution.rtf", self.rtf.clone());
        set("--threads", "execution.threads", self.threads.map(Into::into));
        set("--look-ahead", "execution.look_ahead", self.look_ahead.map(Into::into));
        set("--unix-sockets", "execution.unix_sockets", self.unix_sockets.map(Into::into));
        set("--paused", "execution.paused", self.paused.map(Into::into));
        set("--join-timeout", "execution.join_timeout_s", self.join_timeout.map(Into::into));
        set("--decision-timeout", "execution.decision_timeout_s", self.decision_timeout.map(Into::into));
        overrides.extend(self.set.iter().map(|(key, value)| Override {
            origin: format!("--set {key}={}", value.as_str().map_or_else(|| value.to_string(), str::to_owned)),
            key: key.clone(),
            value: Some(value.clone()),
        }));
        overrides
    }
}

/// A value as the argument of its flag: words without quotes, the cells of a size joined by x, the
/// words of a list by commas.
fn typed(value: &toml::Value) -> String {
    match value {
        toml::Value::String(word) => word.clone(),
        toml::Value::Array(values) => {
            let separator = if values.iter().all(toml::Value::is_integer) { "x" } else { "," };
            values.iter().map(typed).collect::<Vec<_>>().join(separator)
        }
        other => other.to_string(),
    }
}

/// `--map` sets the kind and the file of the map; the length of a cell and the seed stay. A map
/// file removes the size and the parameters of the generators, and both remove the options of an
/// importer.
fn map_overrides(map: &str) -> Vec<Override> {
    let change = |key: &str, value: Option<&str>| Override {
        origin: format!("--map {map}"),
        key: key.to_owned(),
        value: value.map(Into::into),
    };
    let is_generator = toml::Value::from(map).try_into::<MapKind>().is_ok_and(|kind| kind != MapKind::File);
    // A misspelt generator is no missing file: the error says which there are.
    if is_generator || (MapKind::is_misspelt_generator(map) && !Path::new(map).exists()) {
        return vec![change("map.kind", Some(map)), change("map.file", None), change("map.import", None)];
    }
    let mut overrides: Vec<_> =
        ["map.size", "map.spheres", "map.noise", "map.building", "map.mine", "map.scene", "map.import"]
            .map(|key| change(key, None))
            .into();
    overrides.extend([change("map.kind", Some("file")), change("map.file", Some(map))]);
    overrides
}

/// Reads a time: seconds, a number with the unit `s`, `min` or `h`, or `M:S` and `H:M:S`.
///
/// # Errors
/// What is expected.
pub fn time_s(text: &str) -> Result<f64, String> {
    const EXPECTED: &str =
        "expected a time: seconds such as 90, or 90s, 30min, 2h, 1:30 (minutes and seconds) or 1:30:00";
    let number = |text: &str| text.parse::<f64>().ok().filter(|number| number.is_finite());
    let units = [("min", 60.0), ("m", 60.0), ("h", 3600.0), ("s", 1.0)];
    let with_unit =
        units.iter().find_map(|(unit, seconds)| Some(number(text.strip_suffix(unit)?.trim_end())? * seconds));
    let sixtieth = |text: &str| {
        (text.len() == 2 || text.contains('.'))
            .then(|| number(text))
            .flatten()
            .filter(|part| (0.0..60.0).contains(part))
    };
    let whole = |text: &str| text.parse::<u32>().ok().map(f64::from);
    let clock = || match text.split(':').collect::<Vec<_>>().as_slice() {
        [minutes, seconds] => Some(60.0 * whole(minutes)? + sixtieth(seconds)?),
        [hours, minutes, seconds] => {
            Some(3600.0 * whole(hours)? + 60.0 * sixtieth(minutes)?.floor() + sixtieth(seconds)?)
        }
        _ => None,
    };
    number(text).or(with_unit).or_else(clock).ok_or_else(|| EXPECTED.to_owned())
}

fn size(text: &str) -> Result<toml::Value, String> {
    let cells: Result<Vec<toml::Value>, _> =
        text.split('x').map(|part| part.parse::<u32>().map(|cells| i64::from(cells).into())).collect();
    match cells.as_deref() {
        Ok([edge]) => Ok(edge.clone()),
        Ok([_, _, _]) => Ok(toml::Value::Array(cells.unwrap_or_default())),
        _ => Err("expected a number of cells, or three joined by x, such as 100x80x30".to_owned()),
    }
}

fn rtf(text: &str) -> Result<toml::Value, String> {
    match text.parse::<f64>() {
        Ok(limit) => Ok(limit.into()),
        Err(_) if text == "max" => Ok(text.into()),
        Err(_) => Err("expected a number or max".to_owned()),
    }
}

/// Reads `KEY=VALUE`; the value is TOML, or a plain word.
///
/// # Errors
/// If there is no `=`, or no key before it.
pub fn assignment(text: &str) -> Result<(String, toml::Value), String> {
    let (key, value) = text.split_once('=').filter(|(key, _)| !key.trim().is_empty()).ok_or("expected KEY=VALUE")?;
    let parsed = toml::from_str::<toml::Table>(&format!("value = {value}"));
    let value = parsed.ok().and_then(|mut table| table.remove("value")).unwrap_or_else(|| value.into());
    Ok((key.trim().to_owned(), value))
}

/// The parser of arguments that name a recording, or the rosbag2 folder of one.
#[must_use]
pub fn recording_path() -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().try_map(recording_at)
}

/// The file of a recording.
fn recording_file(text: &str) -> Result<String, String> {
    if may_be_named(Path::new(text)) {
        Ok(text.to_owned())
    } else {
        Err("expected a name that ends in .mcap, or in / for a rosbag2 folder".to_owned())
    }
}

/// The file of a trace; empty: none. Files of other kinds are not taken for it, because it
/// replaces them.
///
/// # Errors
/// If the name does not end in `.json`.
pub fn trace_file(text: &str) -> Result<PathBuf, String> {
    let file = PathBuf::from(text);
    let is_json = file.extension().is_some_and(|extension| extension == "json");
    if text.is_empty() || is_json { Ok(file) } else { Err("expected a name that ends in .json".to_owned()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_declaration_is_consistent() {
        use clap::CommandFactory;
        Cli::command().debug_assert();
    }

    #[test]
    fn a_map_file_takes_the_place_of_a_generator_and_nothing_else() {
        const TEXT: &str = "seed = 7\nduration_s = 60.0\n[map]\nkind = \"spheres\"\nsize = 50\ncell_m = 0.5\nseed = 3\n\
                            [map.spheres]\nsmoothing = 1\n[agents]\ncount = 3\n";
        let parse =
            |text: &str, args: KeyArgs| simulation::scenario::Scenario::parse("s.toml", text, &args.overrides());
        let map = |map: &str, size: Option<i64>| KeyArgs {
            map: Some(map.to_owned()),
            size: size.map(Into::into),
            ..KeyArgs::default()
        };
        let from_file = parse(TEXT, map("a.m3dm", None)).unwrap();
        assert_eq!(from_file.map.file.as_deref(), Some(std::path::Path::new("a.m3dm")));
        assert_eq!((from_file.map.cell_m, from_file.map.seed, from_file.map.size), (Some(0.5), Some(3), None));
        assert_eq!(from_file.map.spheres, mapgen::SpheresSpec::default());
        let refused = parse(TEXT, map("a.m3dm", Some(30))).unwrap_err().to_string();
        assert!(refused.contains("map.size = [30, 30, 30]: a map from a file has the size of the file"), "{refused}");
        let again = parse(&from_file.to_toml(), map("noise", Some(30))).unwrap();
        assert_eq!((again.map.file, again.map.cell_m, again.map.seed), (None, Some(0.5), Some(3)));
    }

    #[test]
    fn origins_are_the_flags_as_typed() {
        use clap::Parser;
        #[derive(Parser)]
        struct Flags {
            #[command(flatten)]
            keys: KeyArgs,
        }
        for typed in [
            "--agents 5",
            "--controller dsvp",
            "--map cave.m3dm",
            "--size 100x80x30",
            "--seed 9223372036854775808",
            "--record-topics map,odom",
            "--rtf max",
            "--rtf 2.5",
            "--paused true",
            "--set lidar.range_m=-3",
            "--set spawn.kind=box",
            "--set agents.cmd_vel=[1, 2]",
        ] {
            let (flag, value) = typed.split_once(' ').unwrap();
            let flags = Flags::try_parse_from(["maes", flag, value]).unwrap_or_else(|error| panic!("{error}"));
            assert_eq!(flags.keys.overrides().last().unwrap().origin, typed);
        }
    }

    #[test]
    fn help_is_that_of_the_declared_keys() {
        use clap::Args;
        let command = KeyArgs::augment_args(clap::Command::new("maes"));
        for argument in command.get_arguments().filter(|argument| argument.get_id() != "set") {
            let help = argument.get_help().expect("a flag has a help").to_string();
            let (keys_of_flag, _) = help.split_once(':').unwrap();
            assert!(keys_of_flag.split(" and ").all(|key| keys::find(key).is_some()), "{help}");
        }
    }

    #[test]
    fn sizes_paces_and_assignments() {
        assert_eq!(size("50"), Ok(50.into()));
        assert_eq!(size("50x40x30"), Ok(toml::Value::Array(vec![50.into(), 40.into(), 30.into()])));
        assert!(size("50x40").is_err());
        assert!(size("-1").is_err());
        assert_eq!(rtf("max"), Ok("max".into()));
        assert_eq!(rtf("2.5"), Ok(2.5.into()));
        assert!(rtf("fast").is_err());
        for (text, seconds) in [
            ("90", 90.0),
            ("0.5", 0.5),
            ("-1", -1.0),
            ("90s", 90.0),
            ("30min", 1800.0),
            ("1.5 min", 90.0),
            ("2h", 7200.0),
            ("1:30", 90.0),
            ("1:30:00", 5400.0),
            ("0:00.02", 0.02),
        ] {
            assert_eq!(time_s(text), Ok(seconds), "{text}");
        }
        for wrong in
            ["", "s", "min", "five", "1:5", "1:60", "1:-1", "1:2:3:4", "1:30min", "NaN", "inf", "1e999", "3 days"]
        {
            assert!(time_s(wrong).is_err(), "{wrong}");
        }
        assert_eq!(assignment("lidar.range_m=20.5"), Ok(("lidar.range_m".into(), 20.5.into())));
        assert_eq!(assignment("agents.controller=rbw"), Ok(("agents.controller".into(), "rbw".into())));
        assert_eq!(assignment("a=[1, 2]").unwrap().1, toml::Value::Array(vec![1.into(), 2.into()]));
        assert!(assignment("a").is_err());
    }
}
