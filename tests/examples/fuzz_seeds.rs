//! Makes the seeds of the corpora of fuzzing, from a real run and from what comes with the project:
//! `cargo run --release -p tests --example fuzz_seeds`. The other files there were found by fuzzing.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use experiments::single::{Grouping, Team};
use msgs::cdr;
use msgs::geometry_msgs::TwistStamped;
use msgs::maes_msgs::JoinReply;
use msgs::parameters::{ListRequest, Named, NamesRequest, SetRequest, Value};
use msgs::simulation_interfaces::{
    EntityRequest, EntityState, FilterRequest, SetEntityStateRequest, SpawnEntityRequest, StepRequest,
};
use sim_server::recording::Recording;
use sim_server::run::Nobody;
use sim_server::scenario::Scenario;
use sim_server::setup;
use voxels::m3dm;

/// A run of two agents that tell each other what they see, long enough for two chunks of the recording.
const RUN: &str = "seed = 7\nduration_s = 11.0\nstop_when_explored = false\n[map]\nkind = \"spheres\"\nsize = 14\n\
                   spheres = { radius_min = 2, radius_max = 4 }\n[agents]\ncount = 2\n[lidar]\nrays = 16\nperiod_ticks = 100\n[recording]\nposes_period_ticks = 250\n";

/// Messages of each topic that are kept.
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
        ("names", cdr::encode(&NamesRequest { names: names() })),
        ("list", cdr::encode(&ListRequest { prefixes: names(), depth: 2 })),
        (
            "set",
            cdr::encode(&SetRequest { parameters: vec![Named { name: "rtf".to_owned(), value: Value::default() }] }),
        ),
        ("entity", cdr::encode(&EntityRequest::default())),
        ("filter", cdr::encode(&FilterRequest::default())),
        ("set_state", cdr::encode(&set_state)),
        ("spawn", cdr::encode(&SpawnEntityRequest::default())),
        ("step", cdr::encode(&StepRequest::default())),
    ] {
        seed("messages", &format!("request_{name}"), &bytes);
    }
}

/// A scenario as the table `scenario` of a plan.
fn inside(scenario: &str) -> String {
    let table: toml::Table = scenario.parse().expect("a legal scenario");
    let plan = toml::Table::from_iter([("scenario".to_owned(), toml::Value::Table(table))]);
    toml::to_string(&plan).expect("a table can be written").replace("seed = 7\n", "")
}

/// The recording of a run over memory.
fn recorded(mut scenario: Scenario) -> Vec<u8> {
    let file = corpus().join("seeds.mcap");
    scenario.execution.record = Some(file.clone());
    let team = Team { grouping: Grouping::Apart, chaos_delay: Duration::ZERO, decision_times: None };
    experiments::single::run(&scenario, &team, &mut Nobody, &AtomicBool::new(false)).expect("the run has a result");
    let bytes = fs::read(&file).expect("there is a recording");
    fs::remove_file(&file).expect("it can be removed");
    bytes
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn corpus() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../fuzz/corpus")
}
