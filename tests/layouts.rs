//! The configurations of RViz 2 and of Foxglove in `launch_scripts` name topics, types and plugins
//! that exist.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;

use mcap::MessageStream;
use msgs::topics::{self, Durability, Reliability, Topic};
use serde_json::Value;

use crate::support::processes::Process;
use crate::support::runs::Site;
use crate::support::{python, root};

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
