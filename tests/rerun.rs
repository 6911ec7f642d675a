//! The viewer Rerun: what `maes view --rerun` shows of a run, also of one that is being recorded,
//! and that it opens recordings itself.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

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

/// Saves a recording for Rerun in parts, while a copy of it grows.
fn follow_for_rerun(site: &Site, recording: &Path, saved: &Path) {
    let mut follow = site.command(python::for_rerun());
    follow.env("PYTHONPATH", python_package::package()).env("PYTHONDONTWRITEBYTECODE", "1");
    follow.arg(root().join("tests/follow_rerun.py")).arg(recording).arg(site.path("growing.mcap")).arg(saved);
    let followed = Process::start(&mut follow).ended().with_code(0);
    let parts = followed.stdout.trim().strip_suffix(" parts").and_then(|number| number.parse().ok());
    assert!(parts.is_some_and(|parts: u32| parts >= 2), "{followed}");
}

/// What a file for Rerun has.
fn read(site: &Site, saved: &Path) -> Shown {
    let mut read = site.command(python::for_rerun());
    let read = Process::start(read.arg(root().join("tests/read_rerun.py")).arg(saved)).ended().with_code(0);
    serde_json::from_str(&read.stdout).expect("it prints JSON")
}

/// `maes view --rerun-save` has the numbers of the recording, also of an agent that leaves, and so
/// has what follows a recording under way.
#[test]
fn rerun_shows_the_run() {
    let site = Site::new();
    let leave = format!("event=[{{ kind = \"leave\", at_s = {}, agent = 1 }}]", LEAVES / 50);
    let size = SIZE.to_string();
    let run = ["--transport", "memory", "--agents", "2", "--size", &size, "--duration", "30", "--set"];
    let flags = [&leave, "--set", "stop_when_explored=false", "--record-topics", "points,contacts"];
    let (file, saved, followed) = (site.path("run.mcap"), site.path("run.rrd"), site.path("followed.rrd"));
    site.start(&mut site.run_sh(&[&run[..], &flags, &["--record", text(&file)]].concat())).ended().with_code(0);
    let recording = site.recording("run.mcap");
    save_for_rerun(&site, &file, &saved);
    let saved = read(&site, &saved);
    assert_layout_shows_what_is_there(&saved);
    assert_shows(&saved, &recording);
    follow_for_rerun(&site, &file, &followed);
    assert_shows(&read(&site, &followed), &recording);
}

/// Fails unless each view has something to show, and what it treats in a way of its own exists.
#[track_caller]
fn assert_layout_shows_what_is_there(shown: &Shown) {
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

#[track_caller]
fn assert_shows(shown: &Shown, recording: &Recording) {
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
        let tasks = commands.iter().filter(|command| command.motion.kind != maes_msgs::Motion::KEEP);
        let expected: Vec<(u64, Vec<usize>)> = tasks
            .map(|command| {
                let is_path = command.motion.kind == maes_msgs::Motion::PATH;
                (command.tick * NS_PER_TICK, if is_path { vec![command.motion.path.len() + 1] } else { vec![] })
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

    let free = first_seen(recording, 2, |observation| &observation.seen_free);
    let walls = first_seen(recording, 2, |observation| &observation.seen_wall);
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
}

/// An agent has the same colour as on the page.
#[test]
fn colours_are_those_of_the_page() {
    let listed = |file: &str, begin: &str, prefix: &str| -> Vec<String> {
        let source = fs::read_to_string(root().join(file)).expect("it can be read");
        let (_, list) = source.split_once(begin).expect("it has a list");
        let (list, _) = list.split_once("\n]").expect("the list ends");
        list.split(prefix).skip(1).map(|colour| colour[..6].to_lowercase()).collect()
    };
    let page = listed("viewer/src/scene/colours.ts", "const FIRST", "\"#");
    let rerun = listed("python/maes/rerun.py", "_COLOURS = [", "0x");
    assert_eq!(rerun, page);
    assert!(rerun.iter().all(|colour| colour.len() == 6) && rerun.len() > 10, "{rerun:?}");
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
    for wrong in [&["--rerun"][..], &["--rerun-save", "run.rrd"]] {
        let nothing = view(wrong).with_code(2);
        assert!(nothing.stderr.contains(&format!("{}: expected a recording", wrong[0])), "{nothing}");
    }
}

/// Points, frames, grids and bodies have their own types in Rerun, every other message its fields.
#[test]
#[ignore = "takes minutes"]
fn rerun_shows_all_topics() {
    let site = Site::new();
    let (file, shown) = (site.path("run.mcap"), site.path("run.rrd"));
    let flags =
        ["--transport", "memory", "--agents", "2", "--size", "30", "--duration", "30", "--record-topics", "all"];
    site.start(&mut site.run_sh(&[&flags[..], &["--record", text(&file)]].concat())).ended().with_code(0);
    let rerun = python::for_rerun().with_file_name("rerun");
    let mut convert = site.command(&rerun);
    convert.args(["mcap", "convert", "--timeline-type", "duration", text(&file), "-o", text(&shown)]);
    Process::start(&mut convert).ended().with_code(0);
    let mut print = site.command(&rerun);
    print.args(["rrd", "print", text(&shown)]);
    let printed = Process::start(&mut print).ended().with_code(0).stdout;
    for (topic, column) in [
        ("/agent_0/points", "Points3D:positions"),
        ("/agent_1/points", "Points3D:positions"),
        ("/tf", "Transform3D:translation"),
        ("/tf_static", "Transform3D:translation"),
        ("/map", "GridMap:data"),
        ("/sim/explored_map", "GridMap:data"),
        ("/sim/map_points", "Points3D:positions"),
        ("/sim/explored_points", "Points3D:positions"),
        ("/maes/visual_geometries/agent_1\\/base_link/visual_0", "Ellipsoids3D:half_sizes"),
        ("/sim/octomap", "octomap_msgs.msg.Octomap:message"),
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
