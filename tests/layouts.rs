//! What other viewers open of a run: the file for Rerun of `maes view`, and the configurations of
//! RViz 2 and of Foxglove in `launch_scripts`.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

use mcap::MessageStream;
use msgs::topics::{self, Durability, Reliability, Topic};
use msgs::visualization_msgs::Marker;
use msgs::{maes_msgs, sensor_msgs, tf2_msgs};
use serde::Deserialize;
use serde_json::Value;

use crate::python_package;
use crate::support::processes::Process;
use crate::support::recordings::{Recording, counter};
use crate::support::runs::{Site, text};
use crate::support::{python, root};

/// Edge of the map, cells of 1 m.
const SIZE: u32 = 20;

/// When agent 1 leaves, ticks.
const LEAVES: u64 = 500;

const NS_PER_TICK: u64 = 20_000_000;

/// What `read_rerun.py` prints. Rows are by nanoseconds.
#[derive(Deserialize)]
struct Shown {
    columns: BTreeMap<String, Vec<(u64, Value)>>,
    faces: Vec<(u64, Vec<[[u32; 3]; 2]>)>,
    blueprint: BTreeSet<String>,
    origins: BTreeSet<String>,
}

impl Shown {
    #[track_caller]
    fn column<V: serde::de::DeserializeOwned>(&self, name: &str) -> Vec<(u64, V)> {
        let rows = self.columns.get(name).unwrap_or_else(|| panic!("no {name} in {:?}", self.columns.keys()));
        rows.iter().map(|(ns, value)| (*ns, serde_json::from_value(value.clone()).expect("of this type"))).collect()
    }

    /// Entities with something to show.
    fn entities(&self) -> BTreeSet<&str> {
        let names = self.columns.keys().filter_map(|name| name.split_once(' '));
        names.map(|(entity, _)| entity).chain((!self.faces.is_empty()).then_some("/world/explored/surface")).collect()
    }
}

/// The tick in which the team has first seen each cell.
fn first_seen(
    recording: &Recording,
    agents: u32,
    of: fn(&maes_msgs::Observation) -> &maes_msgs::CellRuns,
) -> BTreeMap<u32, u64> {
    let mut seen = BTreeMap::new();
    for agent in 0..agents {
        let observations: Vec<maes_msgs::Observation> = recording.of(&format!("/agent_{agent}/observation"));
        for observation in &observations {
            let runs = of(observation);
            for cell in voxels::runs::indices(&runs.start, &runs.length) {
                let first = seen.entry(cell).or_insert(observation.tick);
                *first = observation.tick.min(*first);
            }
        }
    }
    seen
}

/// Coordinates of a cell, from its index.
fn coordinates(cell: u32) -> [u32; 3] {
    [cell % SIZE, cell / SIZE % SIZE, cell / SIZE / SIZE]
}

/// Fails unless the rows have all of `seen`, each at most a second after its time and not before.
#[track_caller]
fn assert_shown_in_time<T: Ord + std::fmt::Debug>(rows: Vec<(u64, Vec<T>)>, seen: &BTreeMap<T, u64>) {
    assert!(!seen.is_empty());
    let mut shown = BTreeMap::new();
    for (ns, things) in rows {
        for thing in things {
            let tick = *seen.get(&thing).unwrap_or_else(|| panic!("{thing:?} was not seen"));
            let delay_ns = ns.checked_sub(tick * NS_PER_TICK);
            assert!(delay_ns.is_some_and(|delay_ns| delay_ns < 1_000_000_000), "{thing:?}: {ns} ns, tick {tick}");
            assert_eq!(shown.insert(thing, ()), None, "each once");
        }
    }
    assert_eq!(shown.len(), seen.len());
}

/// Saves the recording of a run for Rerun with `maes view`.
fn save_for_rerun(site: &Site, recording: &Path, saved: &Path) {
    let mut view = site.binary("maes");
    view.env("MAES_PYTHON", python::for_rerun()).env("PYTHONPATH", python_package::package());
    view.env("PYTHONDONTWRITEBYTECODE", "1").arg("view").arg(recording).arg("--rerun-save").arg(saved);
    Process::start(&mut view).ended().with_code(0);
}

/// `maes view --rerun-save` with the numbers of the recording, also of an agent that leaves.
#[test]
fn rerun_shows_the_run() {
    let site = Site::new();
    let leave = format!("event=[{{ kind = \"leave\", at_s = {}, agent = 1 }}]", LEAVES / 50);
    let size = SIZE.to_string();
    let run = ["--transport", "memory", "--agents", "2", "--size", &size, "--duration", "20", "--set"];
    let flags = [&leave, "--set", "stop_when_explored=false", "--record-topics", "points,contacts"];
    let (file, saved) = (site.path("run.mcap"), site.path("run.rrd"));
    site.start(&mut site.run_sh(&[&run[..], &flags, &["--record", text(&file)]].concat())).ended().with_code(0);
    save_for_rerun(&site, &file, &saved);
    let mut read = site.command(python::for_rerun());
    let read = Process::start(read.arg(root().join("tests/read_rerun.py")).arg(&saved)).ended().with_code(0);
    let shown: Shown = serde_json::from_str(&read.stdout).expect("it prints JSON");
    let recording = site.recording("run.mcap");

    let frames = recording.messages.iter().filter(|message| message.topic == "/tf");
    let mut poses: [Vec<(u64, [[f32; 3]; 1])>; 2] = Default::default();
    let mut turns: [Vec<(u64, [[f32; 4]; 1])>; 2] = Default::default();
    for message in frames {
        let frame: tf2_msgs::TFMessage = msgs::cdr::decode(&message.data).expect("it can be decoded");
        for placed in frame.transforms {
            let agent = usize::from(placed.child_frame_id == "agent_1/base_link");
            let (place, turn) = (placed.transform.translation, placed.transform.rotation);
            let ns = message.tick * NS_PER_TICK;
            poses[agent].push((ns, [[place.x, place.y, place.z].map(|length| length as f32)]));
            turns[agent].push((ns, [[turn.x, turn.y, turn.z, turn.w].map(|part| part as f32)]));
        }
    }
    assert!(poses[1].len() > 10 && poses[1].len() < poses[0].len(), "agent 1 leaves");
    for (agent, (poses, turns)) in poses.iter().zip(&turns).enumerate() {
        let body = format!("/world/agents/agent_{agent}");
        assert_eq!(&shown.column::<[[f32; 3]; 1]>(&format!("{body} Transform3D:translation")), poses);
        assert_eq!(&shown.column::<[[f32; 4]; 1]>(&format!("{body} Transform3D:quaternion")), turns);
        let cleared = shown.columns.get(&format!("{body} Clear:is_recursive"));
        let after = cleared.map(|rows| rows.iter().map(|(ns, _)| *ns).collect::<Vec<_>>());
        let last_ns = poses.last().map(|(ns, _)| *ns).expect("there are poses");
        assert_eq!(after, (agent == 1).then(|| vec![last_ns + 1]), "only what left is cleared");

        let trail: Vec<(u64, [Vec<[f32; 3]>; 1])> =
            shown.column(&format!("/world/trails/agent_{agent} LineStrips3D:strips"));
        let mut places = vec![];
        for (ns, [strip]) in &trail {
            let is_continued = places.last().is_none_or(|last| strip.first() == Some(last));
            assert!(is_continued, "no gap before {ns} ns");
            places.extend(&strip[usize::from(!places.is_empty())..]);
        }
        assert_eq!(places, poses.iter().map(|&(_, [place])| place).collect::<Vec<_>>());

        let commands: Vec<maes_msgs::Command> = recording.of(&format!("/agent_{agent}/command"));
        let tasks = commands.iter().filter(|command| command.task.kind != maes_msgs::Task::KEEP);
        let expected: Vec<(u64, Vec<usize>)> = tasks
            .map(|command| {
                let is_path = command.task.kind == maes_msgs::Task::PATH;
                (command.tick * NS_PER_TICK, if is_path { vec![command.task.path.len() + 1] } else { vec![] })
            })
            .collect();
        let paths: Vec<(u64, Vec<Vec<[f32; 3]>>)> =
            shown.column(&format!("/world/paths/agent_{agent} LineStrips3D:strips"));
        let lengths = |(ns, strips): &(u64, Vec<Vec<[f32; 3]>>)| (*ns, strips.iter().map(Vec::len).collect());
        assert_eq!(paths.iter().map(lengths).collect::<Vec<_>>(), expected);

        let clouds: Vec<sensor_msgs::PointCloud2> = recording.of(&format!("/agent_{agent}/points"));
        let clouds = clouds.iter().filter(|cloud| cloud.width > 0);
        let ns = |cloud: &sensor_msgs::PointCloud2| {
            u64::try_from(cloud.header.stamp.sec).expect("after the start") * 1_000_000_000
                + u64::from(cloud.header.stamp.nanosec)
        };
        let hits: Vec<(u64, Vec<[f32; 3]>)> = shown.column(&format!("{body}/lidar Points3D:positions"));
        let bytes = |points: &[[f32; 3]]| points.as_flattened().iter().flat_map(|one| one.to_le_bytes()).collect();
        assert_eq!(
            hits.iter().map(|(ns, points)| (*ns, bytes(points))).collect::<Vec<(u64, Vec<u8>)>>(),
            clouds.map(|cloud| (ns(cloud), cloud.data.clone())).collect::<Vec<_>>()
        );
    }

    let free = first_seen(&recording, 2, |observation| &observation.seen_free);
    let walls = first_seen(&recording, 2, |observation| &observation.seen_wall);
    let centre = |[x, y, z]: [f32; 3]| [x, y, z].map(|length| length.floor() as u32);
    for (name, seen) in [("free", &free), ("walls", &walls)] {
        let rows = shown.column::<Vec<[f32; 3]>>(&format!("/world/explored/{name} Points3D:positions"));
        assert!(rows.iter().flat_map(|(_, points)| points.as_flattened()).all(|length| length.fract() == 0.5));
        let rows = rows.into_iter().map(|(ns, points)| (ns, points.into_iter().map(centre).collect()));
        let seen = seen.iter().map(|(&cell, &tick)| (coordinates(cell), tick)).collect();
        assert_shown_in_time(rows.collect(), &seen);
    }
    let result = recording.result();
    assert_eq!(free.len() as f64 / counter(&result, "free_cells") as f64, result.explored);
    let mut faces = BTreeMap::new();
    for (&cell, &tick) in &free {
        for step in [1, SIZE, SIZE * SIZE] {
            // The outermost cells of a map are walls, so that there is no neighbour beyond an edge.
            for neighbour in [cell - step, cell + step] {
                if let Some(&wall_tick) = walls.get(&neighbour) {
                    faces.insert([coordinates(cell), coordinates(neighbour)], tick.max(wall_tick));
                }
            }
        }
    }
    assert_shown_in_time(shown.faces.clone(), &faces);

    let progress: Vec<maes_msgs::Progress> = recording.of("/sim/progress");
    let curve = |of: fn(&maes_msgs::Progress) -> f64| {
        progress.iter().map(|one| (one.tick * NS_PER_TICK, of(one))).collect::<Vec<_>>()
    };
    for (name, expected) in [
        ("team/explored", curve(|one| one.explored)),
        ("team/covered", curve(|one| one.covered)),
        ("explored_by/agent_0", curve(|one| one.explored_by[0])),
        ("explored_by/agent_1", curve(|one| one.explored_by[1])),
    ] {
        let rows = shown.column::<[String; 1]>(&format!("/progress/{name} Scalars:scalars")).into_iter();
        let rows = rows.map(|(ns, [share])| (ns, share.parse().expect("a number")));
        assert_eq!(rows.collect::<Vec<(u64, f64)>>(), expected);
    }

    let contacts: Vec<(u64, Vec<[[f32; 3]; 2]>)> = shown.column("/world/contacts LineStrips3D:strips");
    let markers = recording.messages.iter().filter(|message| message.topic == "/sim/contacts");
    let expected: Vec<(u64, usize)> = markers
        .map(|message| {
            let marker: Marker = msgs::cdr::decode(&message.data).expect("it can be decoded");
            (message.tick * NS_PER_TICK, marker.points.len() / 2)
        })
        .collect();
    assert!(expected.iter().any(|(_, lines)| *lines > 0), "the agents start beside each other");
    assert_eq!(contacts.iter().map(|(ns, lines)| (*ns, lines.len())).collect::<Vec<_>>(), expected);

    let entities = shown.entities();
    for entity in &shown.blueprint {
        assert!(entities.contains(entity.as_str()), "{entity} of the layout is not in {entities:?}");
    }
    for origin in &shown.origins {
        let below = format!("/{}/", origin.trim_matches('/'));
        assert!(entities.iter().any(|entity| entity.starts_with(&below)), "{origin} of the layout is empty");
    }
    assert_eq!((shown.origins.len(), shown.blueprint.len()), (3, 5));
}

/// The viewer itself draws the file.
#[test]
#[ignore = "needs a driver for Vulkan, such as that of mesa-vulkan-drivers"]
fn rerun_draws_the_run() {
    let site = Site::new();
    let (file, saved) = (site.path("run.mcap"), site.path("run.rrd"));
    let flags = ["--transport", "memory", "--agents", "2", "--size", "40", "--duration", "60", "--record", text(&file)];
    site.start(&mut site.run_sh(&flags)).ended().with_code(0);
    save_for_rerun(&site, &file, &saved);
    let mut viewer = site.command(python::for_rerun());
    viewer.arg(root().join("tests/view_rerun.py")).arg(&saved).arg("60");
    let viewed = Process::start(&mut viewer).ended().with_code(0);
    assert!(viewed.stdout.contains("bright pixels"), "{viewed}");
}

/// What is there without the packages: one line that says how to get them.
#[test]
fn rerun_without_the_packages() {
    let site = Site::new();
    let flags = ["--transport", "memory", "--agents", "1", "--size", "20", "--duration", "1", "--record", "run.mcap"];
    site.start(&mut site.run_sh(&flags)).ended().with_code(0);
    let view = |arguments: &[&str]| {
        let mut view = site.binary("maes");
        // It has neither.
        view.env("MAES_PYTHON", python::for_recordings()).arg("view").args(arguments);
        Process::start(&mut view).ended()
    };
    let missing = view(&["run.mcap", "--rerun"]).with_code(1);
    for words in ["No module named 'maes'", "pip install", "MAES_PYTHON"] {
        assert!(missing.stderr.contains(words) && missing.stderr.lines().count() == 1, "{missing}");
    }
    let nothing = view(&["--rerun"]).with_code(2);
    assert!(nothing.stderr.contains("expected a recording"), "{nothing}");
}

/// Topics of the configurations that are in no recording: those of the agents' own processes, and
/// the log.
fn is_live_only(topic: &str) -> bool {
    topic == "/rosout" || topics::split(topic).is_some_and(|(_, rest)| rest == "map")
}

/// The types of the topics of a recording with all that `views.record` can add.
fn recorded_types() -> BTreeMap<String, String> {
    let site = Site::new();
    let added = "points,odom,path,map,unexplored,contacts,info,tf_static";
    let run = ["--transport", "memory", "--agents", "10", "--size", "30", "--duration", "1"];
    let bytes = site.record(&[&run[..], &["--record-topics", added]].concat()).bytes;
    let messages = MessageStream::new(&bytes).expect("it is MCAP").map(|message| message.expect("it is whole").channel);
    let type_of = |channel: &mcap::Channel| channel.schema.as_ref().expect("messages have a type").name.clone();
    messages.map(|channel| (channel.topic.clone(), type_of(&channel))).collect()
}

/// The topic of this name; fails unless it exists, and in a recording with its type.
#[track_caller]
fn existing(name: &str, recorded: &BTreeMap<String, String>) -> Topic {
    let topic = topics::named(name).unwrap_or_else(|| panic!("{name}: runs have no such topic"));
    if is_live_only(name) {
        assert_eq!(recorded.get(name), None);
    } else {
        assert_eq!(recorded.get(name), Some(&topic.message.to_string()), "{name} in a recording");
    }
    topic
}

/// The displays of RViz 2 for messages of runs, from `plugins_description.xml` of
/// `rviz_default_plugins`, and what they show.
const RVIZ_DISPLAYS: [(&str, &str); 5] = [
    ("rviz_default_plugins/Marker", "visualization_msgs/msg/Marker"),
    ("rviz_default_plugins/Odometry", "nav_msgs/msg/Odometry"),
    ("rviz_default_plugins/Path", "nav_msgs/msg/Path"),
    ("rviz_default_plugins/PointCloud2", "sensor_msgs/msg/PointCloud2"),
    ("rviz_default_plugins/TF", "tf2_msgs/msg/TFMessage"),
];

/// Its other plugins, by the place in the configuration.
const RVIZ_PANELS: [&str; 6] = [
    "rviz_common/Displays",
    "rviz_common/Selection",
    "rviz_common/Time",
    "rviz_common/Tool Properties",
    "rviz_common/Transformation",
    "rviz_common/Views",
];
const RVIZ_TOOLS: [&str; 8] = [
    "rviz_default_plugins/FocusCamera",
    "rviz_default_plugins/Interact",
    "rviz_default_plugins/Measure",
    "rviz_default_plugins/MoveCamera",
    "rviz_default_plugins/PublishPoint",
    "rviz_default_plugins/Select",
    "rviz_default_plugins/SetGoal",
    "rviz_default_plugins/SetInitialPose",
];
const RVIZ_VIEWS: [&str; 4] = [
    "rviz_default_plugins/FPS",
    "rviz_default_plugins/Orbit",
    "rviz_default_plugins/TopDownOrtho",
    "rviz_default_plugins/XYOrbit",
];

/// The displays of a list, those of groups included.
fn displays<'a>(list: &'a Value, found: &mut Vec<&'a Value>) {
    for display in list.as_array().expect("a list of displays") {
        if display["Class"] == "rviz_common/Group" {
            displays(&display["Displays"], found);
        } else {
            found.push(display);
        }
    }
}

#[test]
fn rviz_configuration_names_what_exists() {
    let site = Site::new();
    let mut convert = site.command(python::for_recordings());
    let script = "import json, sys; from ruamel.yaml import YAML\n\
                  print(json.dumps(YAML(typ='safe', pure=True).load(open(sys.argv[1]))))";
    convert.args(["-c", script]).arg(root().join("launch_scripts/maes.rviz"));
    let read = Process::start(&mut convert).ended().with_code(0);
    let configuration: Value = serde_json::from_str(&read.stdout).expect("it prints JSON");
    let recorded = recorded_types();
    let manager = &configuration["Visualization Manager"];
    assert_eq!(manager["Global Options"]["Fixed Frame"], "map");

    let class = |plugin: &Value| plugin["Class"].as_str().expect("each plugin has a class").to_owned();
    for (list, known) in [(&configuration["Panels"], &RVIZ_PANELS[..]), (&manager["Tools"], &RVIZ_TOOLS[..])] {
        for plugin in list.as_array().expect("a list of plugins") {
            assert!(known.contains(&class(plugin).as_str()), "{plugin}");
        }
    }
    assert!(RVIZ_VIEWS.contains(&class(&manager["Views"]["Current"]).as_str()));

    let mut shown = vec![];
    displays(&manager["Displays"], &mut shown);
    let mut names = BTreeSet::new();
    for display in shown {
        let (class, settings) = (class(display), &display["Topic"]);
        let message = RVIZ_DISPLAYS.iter().find(|(name, _)| *name == class).map(|(_, message)| *message);
        let message = message.unwrap_or_else(|| panic!("{class} is no display for messages of runs"));
        // Transforms have no setting for their topic.
        let name =
            if class == "rviz_default_plugins/TF" { "/tf" } else { settings["Value"].as_str().expect("a topic") };
        let topic = existing(name, &recorded);
        assert_eq!(topic.message.to_string(), message, "{class} for {name}");
        assert!(names.insert(name.to_owned()), "{name} is shown twice");
        // A subscription that requests more than is offered receives nothing.
        let is_latched = settings["Durability Policy"] == "Transient Local";
        assert!(!is_latched || topic.qos.durability == Durability::TransientLocal, "{name} is not latched");
        let is_reliable = settings["Reliability Policy"] == "Reliable";
        assert!(!is_reliable || topic.qos.reliability == Reliability::Reliable, "{name} is not reliable");
    }
    for topic in ["/tf", "/sim/map", "/sim/unexplored", "/sim/contacts", "/agent_0/path", "/agent_9/points"] {
        assert!(names.contains(topic), "{topic} is not shown");
    }
}

/// What the panels of the layout show: their types are those of the catalogue of Lichtblick
/// (packages/suite-base/src/panels/index.ts), and of Foxglove.
fn panel_shows(panel: &str, message: &str) -> bool {
    match panel {
        "3D" => RVIZ_DISPLAYS.iter().any(|(_, shown)| *shown == message),
        "DiagnosticSummary" => message == "diagnostic_msgs/msg/DiagnosticArray",
        "RosOut" => message == "rcl_interfaces/msg/Log",
        "Plot" | "RawMessages" => true,
        _ => false,
    }
}

/// The panels of a layout, from left to right.
fn panels(layout: &Value, found: &mut Vec<String>) {
    if let Some(panel) = layout.as_str() {
        found.push(panel.to_owned());
    } else {
        for side in ["first", "second"] {
            panels(&layout[side], found);
        }
    }
}

#[test]
fn foxglove_layout_names_what_exists() {
    let file = root().join("launch_scripts/maes.foxglove.json");
    let content = fs::read_to_string(&file).expect("the layout can be read");
    let layout: Value = serde_json::from_str(&content).expect("it is JSON");
    let recorded = recorded_types();
    let configurations = layout["configById"].as_object().expect("panels have settings");
    let mut placed = vec![];
    panels(&layout["layout"], &mut placed);
    assert_eq!(placed.iter().collect::<BTreeSet<_>>(), configurations.keys().collect(), "placed panels");

    let mut plotted = vec![];
    for (id, settings) in configurations {
        let (panel, _) = id.split_once('!').expect("a type and a name");
        let topic_of = |value: &Value| value.as_str().expect("a topic").to_owned();
        let mut names = vec![];
        match panel {
            "3D" => {
                assert_eq!(settings["followTf"], "map");
                names.extend(settings["topics"].as_object().expect("topics").keys().cloned());
            }
            "Plot" => {
                for curve in settings["paths"].as_array().expect("curves") {
                    let path = topic_of(&curve["value"]);
                    let (name, field) = path.split_once('.').expect("a topic and a field");
                    let definition = existing(name, &recorded).message.definition;
                    let is_number = definition.lines().any(|line| {
                        let mut words = line.split_whitespace();
                        words.next() == Some("float64") && words.next() == Some(field)
                    });
                    assert!(is_number, "{path}: no such number");
                    assert_eq!(curve["timestampMethod"], "headerStamp");
                    assert!(definition.contains("std_msgs/Header header"), "{path}: no stamp");
                    names.push(name.to_owned());
                    plotted.push(field.to_owned());
                }
            }
            "RawMessages" => names.push(topic_of(&settings["topicPath"])),
            _ => names.push(topic_of(&settings["topicToRender"])),
        }
        assert!(!names.is_empty(), "{id} shows nothing");
        for name in names {
            let message = existing(&name, &recorded).message.to_string();
            assert!(panel_shows(panel, &message), "{id}: {name} has the type {message}");
        }
    }
    assert_eq!(plotted, ["explored", "covered"]);
    let kinds: BTreeSet<&str> = configurations.keys().filter_map(|id| Some(id.split_once('!')?.0)).collect();
    assert!(["3D", "Plot", "RawMessages"].iter().all(|kind| kinds.contains(kind)), "{kinds:?}");
}
