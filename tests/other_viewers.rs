//! Rerun, Foxglove and RViz: what ships for them fits the recordings, and Rerun gets a whole run.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use mcap::Summary;
use msgs::maes_msgs::Progress;
use regex_lite::Regex;

use crate::support::processes::Process;
use crate::support::recordings::Recording;
use crate::support::runs::{Site, text};
use crate::support::{python, root};
use crate::{python_package, tidy};

/// A recording of two agents with all visualisation topics.
fn recording(site: &Site) -> PathBuf {
    let file = site.path("run.mcap");
    let topics = "points,odom,path,map,unexplored,contacts,info,tf_static";
    let flags =
        ["--transport", "memory", "--agents", "2", "--size", "30", "--duration", "30", "--record-topics", topics];
    site.start(&mut site.run_sh(&[&flags[..], &["--record", text(&file)]].concat())).ended().with_code(0);
    file
}

/// The standard output of the program of Rerun.
fn rerun(site: &Site, arguments: &[&str]) -> String {
    let mut command = site.command(python::for_rerun().with_file_name("rerun"));
    Process::start(command.args(arguments)).ended().with_code(0).stdout
}

/// Points and frames have their own types in Rerun, every other message its fields.
#[test]
fn rerun_shows_all_topics() {
    let site = Site::new();
    let (file, shown) = (recording(&site), site.path("run.rrd"));
    rerun(&site, &["mcap", "convert", text(&file), "-o", text(&shown)]);
    let printed = rerun(&site, &["rrd", "print", text(&shown)]);
    for (topic, column) in [
        ("/agent_0/points", "Points3D:positions"),
        ("/agent_1/points", "Points3D:positions"),
        ("/tf", "Transform3D:translation"),
        ("/tf_static", "Transform3D:translation"),
        ("/agent_0/odom", "nav_msgs.msg.Odometry:message"),
        ("/agent_0/path", "nav_msgs.msg.Path:message"),
        ("/sim/map", "visualization_msgs.msg.Marker:message"),
        ("/agent_0/observation", "maes_msgs.msg.Observation:message"),
        ("/sim/result", "maes_msgs.msg.Result:message"),
    ] {
        let topic = format!(" - {topic} - ");
        let is_there = printed.lines().any(|line| line.contains(&topic) && line.contains(column));
        assert!(is_there, "{topic}: no {column}");
    }
}

/// `maes view --rerun` with a Python in which Rerun and the package are, or one of them is not.
fn view(site: &Site, arguments: &[&str], package: &Path) -> crate::support::processes::Ended {
    let mut command = site.binary("maes");
    let folder = python::for_rerun().parent().expect("programs are in a folder");
    let path = format!("{}:{}", folder.display(), std::env::var("PATH").expect("there are programs"));
    command.args(["view", "--rerun"]).args(arguments).env("PATH", path).env("PYTHONPATH", package);
    site.start(&mut command).ended()
}

#[test]
fn rerun_gets_the_whole_run() {
    let site = Site::new();
    let (file, shown) = (recording(&site), site.path("run.rrd"));
    view(&site, &[text(&file), "--rerun-save", text(&shown)], python_package::package()).with_code(0);
    let printed = rerun(&site, &["rrd", "print", text(&shown)]);
    let chunk = Regex::new(r"with (\d+) rows .* - (\S+) - data columns: \[(.*)\]").expect("it is written here");
    let mut rows: BTreeMap<(String, String), usize> = BTreeMap::new();
    for found in printed.lines().filter_map(|line| chunk.captures(line)) {
        for column in found[3].split(' ') {
            let count: usize = found[1].parse().expect("a number");
            *rows.entry((found[2].to_owned(), column.to_owned())).or_default() += count;
        }
    }
    let rows = |entity: &str, column: &str| rows.get(&(entity.to_owned(), column.to_owned())).copied().unwrap_or(0);
    let recording = Recording::read(&file);
    let messages = |topic: &str| recording.messages.iter().filter(|message| message.topic == topic).count();
    for agent in ["/world/agents/0", "/world/agents/1"] {
        assert_eq!(rows(agent, "Points3D:positions"), messages("/tf"), "{agent}");
        assert_eq!(rows(&format!("{agent}/heading"), "Arrows3D:vectors"), messages("/tf"), "{agent}");
        assert!(rows(&format!("{agent}/trail"), "LineStrips3D:strips") > 0, "{agent} has moved");
    }
    assert!((2..=31).contains(&rows("/world/walls", "Points3D:positions")), "walls come second by second");
    assert_eq!(rows("/plots/shares/explored", "Scalars:scalars"), messages("/sim/progress"));
    let values = rerun(&site, &["rrd", "print", "-vvv", "--entity", "/plots/shares/explored", text(&shown)]);
    let last = recording.of::<Progress>("/sim/progress").last().expect("there is a last one").explored;
    assert!(values.contains(&format!("{}", last * 100.0)), "{last}: {values}");
    assert!(printed.contains("VisibleTimeRanges:ranges"), "the blueprint comes with them");
}

#[test]
fn rerun_that_is_missing_is_named() {
    let site = Site::new();
    let file = site.path("run.mcap");
    let flags = ["--transport", "memory", "--agents", "1", "--size", "20", "--duration", "2", "--record", text(&file)];
    site.start(&mut site.run_sh(&flags)).ended().with_code(0);
    for (arguments, reason) in [
        (&[text(&file)][..], "No module named 'maes'; --rerun needs the Python packages"),
        (&[], "--rerun: expected one recording"),
        (&[text(&file), "--beside", text(&file)], "--rerun: expected one recording"),
    ] {
        // In a folder without packages.
        let ended = view(&site, arguments, &site.path("")).with_code(2);
        assert!(ended.stderr.contains(reason), "{reason}: {ended}");
    }
}

/// Type of each topic of a recording, with the fields of that type.
fn topics(file: &Path) -> BTreeMap<String, (String, String)> {
    let bytes = fs::read(file).expect("it was recorded");
    let summary = Summary::read(&bytes).expect("it is whole").expect("it has a summary");
    let described = |channel: &mcap::Channel<'_>| {
        let schema = channel.schema.as_ref().expect("channels have schemas");
        (schema.name.clone(), String::from_utf8_lossy(&schema.data).into_owned())
    };
    summary.channels.values().map(|channel| (channel.topic.clone(), described(channel))).collect()
}

/// The name of a topic as a recording of two agents has it.
fn of_two_agents(topic: &str) -> String {
    Regex::new(r"^/agent_\d+/").expect("it is written here").replace(topic, "/agent_0/").into_owned()
}

#[test]
fn layouts_fit_the_recordings() {
    let site = Site::new();
    let mut topics = topics(&recording(&site));
    // Agents publish their maps themselves, to whoever reads them; no recording has them.
    let documented = tidy::read(&root().join("docs/ros2.md"));
    assert!(documented.contains("| `/agent_<id>/map` | `visualization_msgs/Marker` |"), "what agents publish");
    topics.insert("/agent_0/map".to_owned(), ("visualization_msgs/msg/Marker".to_owned(), String::new()));
    let has = |topic: &str, types: &[&str]| {
        let (of_type, _) = topics.get(&of_two_agents(topic)).unwrap_or_else(|| panic!("{topic}: no such topic"));
        assert!(types.iter().any(|one| of_type == one), "{topic} is {of_type}, not one of {types:?}");
    };
    let drawn = ["visualization_msgs/msg/Marker", "nav_msgs/msg/Path", "sensor_msgs/msg/PointCloud2"];

    let layout = tidy::read(&root().join("launch_scripts/maes.foxglove.json"));
    let layout: serde_json::Value = serde_json::from_str(&layout).expect("it is JSON");
    let panels = layout["configById"].as_object().expect("it has panels");
    let kind = |name: &str| name.split('!').next().map(str::to_owned);
    for (name, panel) in panels {
        match kind(name).as_deref() {
            Some("3D") => panel["topics"].as_object().expect("topics").keys().for_each(|topic| has(topic, &drawn)),
            Some("Plot") => {
                for path in panel["paths"].as_array().expect("paths") {
                    let (topic, field) = path["value"].as_str().and_then(|path| path.split_once('.')).expect("a path");
                    let line = format!("float64 {field} ");
                    assert!(topics[topic].1.lines().any(|of_type| of_type.starts_with(&line)), "{topic}.{field}");
                }
            }
            Some("DiagnosticSummary") => {
                let topic = panel["topicToRender"].as_str().expect("a topic");
                has(topic, &["diagnostic_msgs/msg/DiagnosticArray"]);
            }
            // The log is not recorded.
            Some("RosOut") => assert_eq!(panel["topicToRender"], "/rosout"),
            _ => panic!("{name}: what does this panel need?"),
        }
    }

    let layout = tidy::read(&root().join("launch_scripts/maes.rviz"));
    let displays = Regex::new(r"Class: (\S+)|Value: (/\S+)").expect("it is written here");
    let mut class = String::new();
    let mut shown = 0;
    for found in displays.captures_iter(&layout) {
        match (found.get(1), found.get(2)) {
            (Some(named), _) => named.as_str().clone_into(&mut class),
            (_, Some(topic)) => {
                let of_type = match class.as_str() {
                    "rviz_default_plugins/Marker" => drawn[0],
                    "rviz_default_plugins/Path" => drawn[1],
                    "rviz_default_plugins/PointCloud2" => drawn[2],
                    other => panic!("{other} shows {}", topic.as_str()),
                };
                has(topic.as_str(), &[of_type]);
                shown += 1;
            }
            _ => unreachable!("one of the two has matched"),
        }
    }
    assert!(shown >= 3, "it shows something");
}
