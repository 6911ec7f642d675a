//! Clients and tools of others: what they read from recordings, or receive from topics, is what is
//! recorded.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;

use msgs::geometry_msgs::Transform;
use msgs::ids::Tick;
use msgs::simulation_interfaces::{SetSimulationStateRequest, SetSimulationStateResponse, SimulationState};
use msgs::tf2_msgs::TFMessage;

use crate::support::foxglove::Client;
use crate::support::processes::Process;
use crate::support::runs::Site;
use crate::support::{python, root};

/// The numbers of a transform: x, y, z, and the quaternion x, y, z, w.
type Numbers = [f64; 7];

fn numbers(transform: &Transform) -> Numbers {
    let (place, turn) = (&transform.translation, &transform.rotation);
    [place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w]
}

/// Where a buffer of tf2 finds a body at the stamp of its cloud is where the run says that it was,
/// at 1, 20 and 100 times real time.
#[test]
#[ignore = "takes a minute, and needs Debian 12, which has tf2"]
fn tf2_finds_the_recorded_poses_at_any_speed() {
    for (rtf, duration_s) in [("1", "15"), ("20", "120"), ("100", "300")] {
        let site = Site::new();
        python::prepare_ros();
        let mut observe = site.command("bash");
        observe.args(python::in_ros()).arg("python3").arg(root().join("tests/tf_observer.py"));
        let paced = ["--agents", "2", "--size", "40", "--duration", duration_s, "--rtf", rtf, "--paused", "true"];
        let every_pose = ["--set", "stop_when_explored=false", "--set", "recording.poses_period_ticks=1"];
        let shown = ["--view", "127.0.0.1:0", "--record", "run.mcap"];
        let mut run = site.start(&mut site.run_sh(&[&paced[..], &every_pose, &shown].concat()));
        let address = run.address();
        let mut observer = Process::start(&mut observe);
        observer.prints("ready");
        play(&mut Client::connect(&address));
        let arrived = site.file("arrived.txt", observer.ended().with_code(0).stdout);
        run.ended().with_code(0);

        let mut poses: BTreeMap<(u64, String), Numbers> = BTreeMap::new();
        for message in site.recording("run.mcap").of::<TFMessage>("/tf") {
            poses.extend(message.transforms.into_iter().map(|at| {
                let stamp = &at.header.stamp;
                let ns = u64::from(stamp.sec.unsigned_abs()) * 1_000_000_000 + u64::from(stamp.nanosec);
                ((ns, at.child_frame_id), numbers(&at.transform))
            }));
        }
        let mut look_up = site.command(root().join("tests/tf2_buffer.sh"));
        let found = Process::start(look_up.arg(&arrived)).ended().with_code(0).stdout;
        let clouds = fs::read_to_string(&arrived).expect("it was written").matches("\nat ").count();
        let mut lookups = 0;
        for line in found.lines() {
            let words: Vec<&str> = line.split(' ').collect();
            let [ns, frame, values @ ..] = &words[..] else { panic!("{line}") };
            let values: Vec<f64> = values.iter().map(|value| value.parse().expect("a number")).collect();
            let pose = poses[&(ns.parse().expect("nanoseconds"), (*frame).to_owned())];
            let largest = values.iter().zip(pose).map(|(found, truth)| (found - truth).abs()).fold(0.0, f64::max);
            assert!(values.len() == pose.len() && largest < 1e-9, "{rtf} x: {largest} at {ns} ns\n{line}\n{pose:?}");
            lookups += 1;
        }
        // The run may end before the last transforms have arrived.
        assert!(lookups > 20 && lookups + 3 >= clouds, "{rtf} x: {lookups} lookups of {clouds} clouds");
    }
}

/// The client library of Foxglove decodes all topics of a run, by both subprotocols: the stamps
/// that it finds are the log times, and what is recorded as well has the same bytes.
#[test]
#[ignore = "takes minutes: fetches packages of the npm registry"]
fn client_library_of_foxglove_receives_what_is_recorded() {
    let packages = Site::new();
    for name in ["package.json", "package-lock.json", "receive.mjs"] {
        let source = root().join("tests/ws_client").join(name);
        packages.file(name, fs::read(source).expect("it is part of the sources"));
    }
    let mut install = packages.command("npm");
    install.args(["ci", "--ignore-scripts", "--no-audit", "--no-fund"]);
    Process::start(&mut install).ended().with_code(0);
    for subprotocol in ["foxglove.websocket.v1", "foxglove.sdk.v1"] {
        assert_receives_what_is_recorded(&packages, subprotocol);
    }
}

#[track_caller]
fn assert_receives_what_is_recorded(packages: &Site, subprotocol: &str) {
    let site = Site::new();
    let paced = ["--agents", "2", "--size", "20", "--duration", "20", "--rtf", "5", "--paused", "true"];
    let recorded = ["--set", "stop_when_explored=false", "--record-topics", "all", "--record", "run.mcap"];
    let mut run = site.start(&mut site.run_sh(&[&paced[..], &recorded, &["--view", "127.0.0.1:0"]].concat()));
    let address = run.address();
    let mut control = Client::connect(&address);
    control.read_until(|client| client.offered().contains(&"/agent_1/points"));
    let mut receive = packages.command("node");
    receive.arg("receive.mjs").arg(format!("ws://{address}")).args([subprotocol, &control.offered().len().to_string()]);
    let mut receiver = Process::start(&mut receive);
    receiver.prints("ready");
    play(&mut control);
    let received = receiver.ended().with_code(0).stdout;
    run.ended().with_code(0);

    let mut of_topic: BTreeMap<&str, BTreeSet<String>> = BTreeMap::new();
    let recording = site.recording("run.mcap");
    for message in &recording.messages {
        let digits: String = message.data.iter().map(|byte| format!("{byte:02x}")).collect();
        of_topic.entry(&message.topic).or_default().insert(digits);
    }
    // The others have wall times, or are made for each subscriber; transforms are thinned in
    // another way.
    let mut is_same: BTreeMap<&str, u64> =
        ["/agent_0/odom", "/agent_1/odom", "/agent_0/points", "/agent_1/points", "/clock", "/sim/contacts"]
            .into_iter()
            .chain(["/sim/digest", "/sim/progress", "/sim/result"])
            .map(|topic| (topic, 0))
            .collect();
    let mut topics = BTreeSet::new();
    for line in received.lines().filter(|line| line.starts_with('/')) {
        let words: Vec<&str> = line.split(' ').collect();
        let [topic, log_time, stamp, data] = words[..] else { panic!("{line}") };
        topics.insert(topic);
        assert!(stamp == "-" || stamp == log_time, "{subprotocol}: {topic} has the stamp {stamp} at {log_time}");
        let Some(count) = is_same.get_mut(topic) else { continue };
        // A new subscriber gets the present state at once.
        if log_time.parse::<u64>().expect("nanoseconds") >= Tick(50).time_ns() {
            assert!(of_topic[topic].contains(data), "{subprotocol}: {topic} of {log_time} ns is not recorded");
            *count += 1;
        }
    }
    assert!(is_same.values().all(|count| *count > 0), "{subprotocol}: {is_same:?}");
    assert!(topics.len() > 20, "{subprotocol}: {topics:?}");
}

/// The reader of datasets of foxglove-sdk, baglint and tracecheck find in a recording what is in
/// it, and kappe writes it again. That has lost its attachments, and is refused for that.
#[test]
#[ignore = "takes a minute: installs packages of PyPI"]
fn recording_is_read_checked_and_converted_by_others() {
    let site = Site::new();
    let flags =
        ["--transport", "memory", "--agents", "2", "--size", "20", "--duration", "60", "--record-topics", "all"];
    // To the end of the duration: tracecheck takes no topic whose messages have one time.
    let whole = ["--set", "stop_when_explored=false", "--record", "run.mcap"];
    site.start(&mut site.run_sh(&[&flags[..], &whole].concat())).ended().with_code(0);
    let mut check = site.command(python::for_clients());
    check.arg(root().join("tests/check_clients.py")).args(["run.mcap", "converted"]);
    let checked = Process::start(&mut check).ended().with_code(0);
    for name in ["foxglove-sdk: ", "baglint: ", "tracecheck: ", "kappe: "] {
        assert!(checked.stdout.lines().any(|line| line.starts_with(name)), "{name}\n{checked}");
    }
    let maes = |command| Process::start(site.binary("maes").args([command, "converted/run.mcap"])).ended();
    let refused = maes("verify").with_code(2);
    assert!(refused.stderr.contains("its attachments scenario.toml and map.m3dm are missing"), "{refused}");
    let listed = maes("info").with_code(0);
    assert!(listed.stdout.contains("/agent_1/points"), "{listed}");
}

/// Lets a paused run go on.
fn play(client: &mut Client) {
    let request = SetSimulationStateRequest { state: SimulationState { state: SimulationState::STATE_PLAYING } };
    let response = client.call::<SetSimulationStateResponse>("/sim_server/set_simulation_state", &request);
    assert_eq!(response.result.result, 1);
}
