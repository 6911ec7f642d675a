//! Writes the seeds of the fuzzing corpora, from a real run and the files of the project:
//! `cargo run --release -p tests --example fuzz_seeds`. Fuzzing has found the other files there.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use in_memory::in_process::{self, AgentOptions};
use map_files::export;
use msgs::cdr;
use msgs::geometry_msgs::TwistStamped;
use msgs::maes_msgs::JoinReply;
use msgs::rcl_interfaces::{
    GetParametersRequest, ListParametersRequest, Parameter, ParameterValue, SetParametersRequest,
};
use msgs::simulation_interfaces::{
    EntityState, GetEntitiesRequest, GetEntityStateRequest, SetEntityStateRequest, SimulateStepsGoal,
    SpawnEntityRequest,
};
use recording::Recording;
use sim_server::session::NullObserver;
use sim_server::setup;
use simulation::scenario::Scenario;
use voxels::{m3dm, packed};

/// A run of two agents with map sharing, long enough for two chunks of the recording.
const RUN: &str = "seed = 7\nduration_s = 11.0\nstop_when_explored = false\n[map]\nkind = \"spheres\"\nsize = 14\n\
                   spheres = { radius_min = 2, radius_max = 4 }\n[agents]\ncount = 2\n[lidar]\nrays = 16\nperiod_ticks = 100\n[recording]\nposes_period_ticks = 250\n";

/// Messages for each topic.
const MESSAGES_MAX: usize = 3;

fn main() {
    let seed = |target: &str, name: &str, bytes: &[u8]| {
        let folder = corpus().join(target);
        fs::create_dir_all(&folder).expect("the folder can be written to");
        fs::write(folder.join(name), bytes).expect("the folder can be written to");
    };
    let scenario = Scenario::parse("run", RUN, &[]).expect("a legal scenario");
    let (world, _) = setup::build(&scenario).expect("there is such a world");
    seed("m3dm", "cave", &m3dm::write(world.terrain()).expect("a small map"));
    seed("m3dm", "small", &[0b0000_0100, 0b0000_0100, 0b0001_1010, 0b0010_1010]);
    seed("m3dm", "text", b"#..\n.#.\n\n..#\n###\n");
    seed("packed", "cave", &packed::write(world.terrain()));
    seed("bt", "cave", &export::octomap(world.terrain(), [0; 3]));
    seed("obj", "cave", &export::obj(world.terrain()));
    seed("stl", "cave", &export::stl(world.terrain()));
    for (target, name, bytes) in small_maps() {
        seed(target, name, &bytes);
    }
    seed("scenario", "short", RUN.as_bytes());
    seed("scenario", "all_keys", scenario.to_toml().as_bytes());
    seed("plan", "inside", format!("seeds = \"1..3\"\n[axes]\n\"agents.count\" = [1, 2]\n{}", inside(RUN)).as_bytes());
    for (target, folder) in [("scenario", "launch_scripts/scenarios"), ("plan", "experiments/plans")] {
        for entry in fs::read_dir(root().join(folder)).expect("the folder can be listed") {
            let path = entry.expect("the folder can be listed").path();
            let name = path.file_stem().and_then(|name| name.to_str()).expect("names are texts").to_owned();
            seed(target, &name, &fs::read(&path).expect("the file can be read"));
        }
    }
    let bytes = recorded(scenario);
    seed("recording", "short_run", &bytes);
    let recording = Recording::from_bytes("the run".to_owned(), bytes).expect("it was just written");
    let mut kept: BTreeMap<String, usize> = BTreeMap::new();
    for message in recording.messages() {
        let topic = message.channel.topic.trim_start_matches('/').replace('/', "_");
        let count = kept.entry(topic.clone()).or_default();
        *count += 1;
        if *count <= MESSAGES_MAX {
            seed("messages", &format!("{topic}_{count}"), &message.data);
        }
    }
    let (entity, state) = (String::new(), EntityState::default());
    let set_state = SetEntityStateRequest { entity, state, set_pose: true, set_twist: false, set_acceleration: false };
    let names = || vec!["rtf".to_owned(), "seed".to_owned()];
    for (name, bytes) in [
        ("join_reply", cdr::encode(&JoinReply { reason: "no".to_owned(), ..JoinReply::default() })),
        ("twist", cdr::encode(&TwistStamped::default())),
        ("names", cdr::encode(&GetParametersRequest { names: names() })),
        ("list", cdr::encode(&ListParametersRequest { prefixes: names(), depth: 2 })),
        (
            "set",
            cdr::encode(&SetParametersRequest {
                parameters: vec![Parameter { name: "rtf".to_owned(), value: ParameterValue::default() }],
            }),
        ),
        ("entity", cdr::encode(&GetEntityStateRequest::default())),
        ("filter", cdr::encode(&GetEntitiesRequest::default())),
        ("set_state", cdr::encode(&set_state)),
        ("spawn", cdr::encode(&SpawnEntityRequest::default())),
        ("step", cdr::encode(&SimulateStepsGoal::default())),
    ] {
        seed("messages", &format!("request_{name}"), &bytes);
    }
}

/// Small maps in the formats that are only read, and in the text variants of the others.
fn small_maps() -> Vec<(&'static str, &'static str, Vec<u8>)> {
    let floats = |numbers: &[f32]| -> Vec<u8> { numbers.iter().flat_map(|number| number.to_le_bytes()).collect() };
    let points = floats(&[0.5, 0.5, 0.5, 3.5, 0.5, 0.5, 3.5, 2.5, 1.5]);
    let pcd = |data: &str, bytes: &[u8]| {
        let header = format!(
            "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nPOINTS 3\nDATA {data}\n"
        );
        [header.as_bytes(), bytes].concat()
    };
    let ply = |format: &str, bytes: &[u8]| {
        let header = format!(
            "ply\nformat {format} 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
             element face 1\nproperty list uchar int vertex_indices\nend_header\n"
        );
        [header.as_bytes(), bytes].concat()
    };
    let by_field = floats(&[0.5, 3.5, 3.5, 0.5, 0.5, 2.5, 0.5, 0.5, 0.5]);
    // LZF: 32 bytes that are copied, and the last four of them again.
    let pieces = [&[31], &by_field[..32], &[2 << 5, 3]].concat();
    let lengths = [pieces.len() as u32, by_field.len() as u32].map(u32::to_le_bytes).concat();
    let chunk = |name: &str, content: &[u32]| -> Vec<u8> {
        let content: Vec<u8> = content.iter().flat_map(|number| number.to_le_bytes()).collect();
        [name.as_bytes(), &(content.len() as u32).to_le_bytes(), &[0; 4], &content].concat()
    };
    let model = [chunk("SIZE", &[3, 2, 1]), chunk("XYZI", &[2, 0, 0x0700_0102])].concat();
    // A group of the model as it is, and shifted.
    let mut moved = chunk("nTRN", &[2, 0, 3, u32::MAX, 0, 1]);
    moved.extend([&1u32.to_le_bytes()[..], &2u32.to_le_bytes(), b"_t", &5u32.to_le_bytes(), b"5 6 7"].concat());
    let length = (moved.len() - 12) as u32;
    moved[4..8].copy_from_slice(&length.to_le_bytes());
    let scene = [chunk("nGRP", &[0, 0, 2, 2, 3]), moved, chunk("nSHP", &[3, 0, 1, 0, 0])].concat();
    let vox = |chunks: &[u8]| [b"VOX \x96\0\0\0MAIN\0\0\0\0\0\0\0\0".as_slice(), chunks].concat();
    vec![
        ("pcd", "ascii", pcd("ascii", b"0.5 0.5 0.5\n3.5 0.5 0.5\n3.5 2.5 1.5\n")),
        ("pcd", "binary", pcd("binary", &points)),
        ("pcd", "compressed", pcd("binary_compressed", &[lengths, pieces].concat())),
        ("ply", "ascii", ply("ascii", b"0.5 0.5 0.5\n3.5 0.5 0.5\n3.5 2.5 1.5\n3 0 1 2\n")),
        ("ply", "binary", ply("binary_little_endian", &points)),
        ("obj", "pyramid", b"v 0 0 0\nv 4 0 0\nv 4 4 0\nv 0 4 0\nv 2 2 4\nf 4 3 2 1\nf 1 2 5\nf 2/1 3/1 5/1\nf -3 -2 -1\nf 4 1 5\n".into()),
        (
            "stl",
            "ascii",
            b"solid\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 4 0 0\nvertex 0 4 1\nendloop\nendfacet\nendsolid\n".into(),
        ),
        ("vox", "model", vox(&model)),
        ("vox", "scene", vox(&[model, scene].concat())),
        ("pgm", "words", b"P2\n# a plan\n4 3\n9\n9 9 0 9\n9 0 0 9\n9 9 9 9\n".into()),
        ("pgm", "bytes", b"P5 3 2 255\n\xff\x00\xff\xff\xff\x7f".into()),
    ]
}

/// A scenario as the table `scenario` of a plan.
fn inside(scenario: &str) -> String {
    let table: toml::Table = scenario.parse().expect("a legal scenario");
    let plan = toml::Table::from_iter([("scenario".to_owned(), toml::Value::Table(table))]);
    toml::to_string(&plan).expect("a table can be written").replace("seed = 7\n", "")
}

/// The recording of an in-memory run.
fn recorded(mut scenario: Scenario) -> Vec<u8> {
    let file = corpus().join("seeds.mcap");
    scenario.execution.record = Some(file.clone());
    let options = AgentOptions::default();
    in_process::run(&scenario, &options, &mut NullObserver, &AtomicBool::new(false)).expect("the run has a result");
    let bytes = fs::read(&file).expect("there is a recording");
    fs::remove_file(&file).expect("it can be removed");
    bytes
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn corpus() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../testing/fuzz/corpus")
}
