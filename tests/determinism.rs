//! Equal scenarios give equal bytes.
//!
//! Complete recordings are compared, so that a difference in any message, stamp, counter or order
//! is found. The runs: five agents in a cave of 50 x 50 x 50 cells, and the scenarios with the
//! settings of the reference simulator.

use std::collections::BTreeSet;
use std::process::Command;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use crate::support::recordings::Recording;
use crate::support::runs::{Outcome, Site, scenario, text};

/// The run of most tests.
const FIVE: [&str; 10] = ["--agents", "5", "--controller", "rbw", "--size", "50", "--seed", "7", "--duration", "300"];

/// A run short enough for delays.
const SHORT: [&str; 8] = ["--agents", "3", "--size", "30", "--seed", "7", "--duration", "40"];

/// The run [`FIVE`] over ROS 2 with one process for each agent, executed once for all tests.
fn reference() -> &'static Outcome {
    static REFERENCE: OnceLock<Outcome> = OnceLock::new();
    REFERENCE.get_or_init(|| Site::new().record(&FIVE))
}

#[track_caller]
fn assert_five_agents_give_the_same(variants: &[&[&str]]) {
    let site = Site::new();
    for variant in variants {
        let arguments = [&FIVE[..], variant].concat();
        site.record(&arguments).assert_same(reference(), &variant.join(" "));
    }
}

/// `maes run --transport memory` with a scenario.
fn in_memory(site: &Site, name: &str, arguments: &[&str]) -> Command {
    let mut command = site.binary("maes");
    command.args(["run", "--transport", "memory"]).arg(scenario(name)).args(arguments);
    command
}

#[test]
fn repeated_run() {
    assert_five_agents_give_the_same(&[&[]]);
    let result = crate::support::recordings::Recording::from_bytes(&reference().bytes).result();
    assert!(result.tick > 1000 && result.explored > 0.9, "the run that is compared is a run: {result:?}");
}

#[test]
fn start_order_is_irrelevant() {
    assert_five_agents_give_the_same(&[&["--order", "reverse"], &["--order", "shuffle"], &["--order", "shuffle"]]);
}

#[test]
fn delayed_replies() {
    assert_five_agents_give_the_same(&[&["--chaos-delay-ms", "20"]]);
}

#[test]
fn worker_threads() {
    assert_five_agents_give_the_same(&[&["--threads", "1"], &["--threads", "2"], &["--threads", "8"]]);
}

#[test]
fn without_look_ahead() {
    // More requests, but the same committed decisions.
    assert_five_agents_give_the_same(&[&["--look-ahead", "false"]]);
}

#[test]
fn several_agents_in_a_process() {
    assert_five_agents_give_the_same(&[&["--agents-per-process", "5"], &["--agents-per-process", "2"]]);
}

#[test]
fn map_beside_the_scenario() {
    let site = Site::new();
    std::fs::create_dir(site.path("hall")).expect("a new folder");
    let toml = "seed = 1\nduration_s = 20.0\nmap = { kind = \"file\", file = \"hall.txt\" }\nagents = { count = 2 }\n";
    site.file("hall/hall.toml", toml);
    let (rock, room) = ("#######\n".repeat(7), format!("#######\n{}#######\n", "#.....#\n".repeat(5)));
    site.file("hall/hall.txt", [&rock[..], &room, &room, &room, &rock].join("\n"));
    let from_outside = site.record(&["hall/hall.toml"]);
    let (scenario, memory) = (site.path("hall/hall.toml"), ["--transport", "memory"]);
    let absolute = [&[text(&scenario)][..], &memory].concat();
    site.record(&absolute).assert_same(&from_outside, "over memory, by its whole path");
    let mut from_inside = site.run_sh(&["hall.toml", "--record", text(&site.path("inside.mcap"))]);
    site.start(from_inside.current_dir(site.path("hall"))).ended().with_code(0);
    let inside = std::fs::read(site.path("inside.mcap")).expect("it is recorded");
    assert!(inside == from_outside.bytes, "the folder that a run is started from changes nothing");
}

#[test]
fn recorded_visualisation_topics() {
    let site = Site::new();
    let record = r#"views.record=["tf_static", "odom", "points", "path", "map", "unexplored", "contacts", "info"]"#;
    let flags = [&SHORT[..], &["--set", record]].concat();
    let over_ros = site.record(&flags);
    for variant in
        [&["--transport", "memory"][..], &["--look-ahead", "false", "--threads", "1"], &["--set", "views.max_hz=0.5"]]
    {
        site.record(&[&flags[..], variant].concat()).assert_same(&over_ros, &variant.join(" "));
    }
    let bare = site.record(&[&SHORT[..], &["--transport", "memory"]].concat());
    assert_eq!(bare.digest(), over_ros.digest());
    let mut recording = Recording::from_bytes(&over_ros.bytes);
    let topics: BTreeSet<String> = recording.messages.iter().map(|message| message.topic.clone()).collect();
    let bare = Recording::from_bytes(&bare.bytes);
    let protocol: BTreeSet<String> = bare.messages.iter().map(|message| message.topic.clone()).collect();
    // Five topics of the run and three of each agent.
    assert_eq!(topics.difference(&protocol).count(), 5 + 3 * 3, "{topics:?}");
    // Transforms of further ticks come before what has their stamps.
    let poses: BTreeSet<u64> = bare.messages.iter().filter(|it| it.topic == "/tf").map(|it| it.tick).collect();
    recording.messages.retain(|message| {
        protocol.contains(&message.topic) && (message.topic != "/tf" || poses.contains(&message.tick))
    });
    assert!(recording == bare, "the same but for the visualisation topics: {}", recording.first_difference(&bare));
}

#[test]
fn without_network() {
    assert_five_agents_give_the_same(&[&["--transport", "memory"]]);
    let site = Site::new();
    let together = site.record_with(in_memory(&site, "default.toml", &FIVE).arg("--together"));
    together.assert_same(reference(), "--together");
}

#[test]
fn with_a_profile() {
    let site = Site::new();
    let traces = ["memory.json", "ros2.json"].map(|name| site.path(name));
    let flags = traces.each_ref().map(|file| format!("--profile={}", file.display()));
    let profiled = site.record_with(in_memory(&site, "default.toml", &FIVE).arg(&flags[0]));
    profiled.assert_same(reference(), "--profile in memory");
    assert_five_agents_give_the_same(&[&[flags[1].as_str()]]);
    for trace in traces {
        let trace: serde_json::Value = serde_json::from_slice(&std::fs::read(trace).unwrap()).unwrap();
        let events = trace["traceEvents"].as_array().expect("events");
        let names: BTreeSet<&str> = events.iter().filter_map(|event| event["name"].as_str()).collect();
        assert!(names.contains("agents") && names.contains("thread_name"), "{names:?}");
        let end = |event: &serde_json::Value| Some(event["ts"].as_f64()? + event["dur"].as_f64()?);
        assert!(events.iter().filter(|event| event["ph"] == "X").all(|event| end(event).is_some_and(f64::is_finite)));
    }
}

#[test]
fn at_limited_real_time_factor() {
    assert_five_agents_give_the_same(&[&["--rtf", "100"]]);
}

#[test]
fn on_a_busy_machine() {
    let is_over = AtomicBool::new(false);
    thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(|| {
                while !is_over.load(Ordering::Relaxed) {
                    std::hint::spin_loop();
                }
            });
        }
        let same = std::panic::catch_unwind(|| assert_five_agents_give_the_same(&[&[], &["--threads", "8"]]));
        is_over.store(true, Ordering::Relaxed);
        if let Err(panic) = same {
            std::panic::resume_unwind(panic);
        }
    });
}

#[test]
fn retransmitted_requests() {
    let site = Site::new();
    let prompt = site.record_with(&mut in_memory(&site, "default.toml", &SHORT));
    for _ in 0..2 {
        let late = site.record_with(in_memory(&site, "default.toml", &SHORT).args(["--chaos-delay-ms", "400"]));
        late.assert_same(&prompt, "in memory");
    }
    let late = site.record(&[&SHORT[..], &["--chaos-delay-ms", "400"]].concat());
    late.assert_same(&prompt, "over ROS 2");
}

#[test]
fn reference_settings() {
    let site = Site::new();
    for (name, flags) in [
        ("maes3d.toml", &["--duration", "60"][..]),
        ("shell.toml", &["--duration", "300"]),
        ("default.toml", &["--controller", "rbw-maes3d", "--duration", "60", "--seed", "3"]),
    ] {
        let first = site.record_with(&mut in_memory(&site, name, flags));
        for variant in [&[][..], &["--together"], &["--threads", "1"], &["--threads", "8"], &["--look-ahead", "false"]]
        {
            let again = site.record_with(in_memory(&site, name, flags).args(variant));
            again.assert_same(&first, &format!("{name} {variant:?}"));
        }
        let path = scenario(name);
        let over_ros = site.record(&[&[text(&path)][..], flags].concat());
        over_ros.assert_same(&first, &format!("{name} over ROS 2"));
    }
}

/// Shows that the tests above can fail.
#[test]
fn inputs_change_the_digest() {
    let site = Site::new();
    let digest = |flags: &[&str]| {
        let arguments = [&["--transport", "memory"][..], &SHORT, flags].concat();
        site.record(&arguments).digest()
    };
    let mut digests = vec![digest(&[])];
    for flags in [
        &["--set", "seed=8"][..],
        &["--set", "agents.count=2"],
        &["--set", "map.size=31"],
        &["--set", "duration_s=39"],
        &["--set", "map.seed=8"],
        &["--set", "agents.controller=rbw-maes3d"],
        &["--set", "agents.set.pitch_max_rad=0.7"],
        &["--share-period", "100"],
        &["--set", "lidar.rays=5123"],
    ] {
        let other = digest(flags);
        assert!(!digests.contains(&other), "{flags:?} changes nothing");
        digests.push(other);
    }
}
