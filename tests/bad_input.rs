//! Bad input: one line with the place, exit code 2, and no file.

use std::path::Path;

use mcap::records::op;
use rand::RngExt;
use recording::Message;
use sim_server::info;

use crate::support::memory::{Play, honest};
use crate::support::processes::{Ended, Process};
use crate::support::runs::{Site, scenario, text};
use crate::support::{bounded, root};

/// A valid scenario for three agents.
const LEGAL: &str = "seed = 7\nduration_s = 40.0\n[map]\nkind = \"spheres\"\nsize = 30\n[agents]\ncount = 3\n";

/// Number of recordings with a flipped byte.
const WRONG_BYTES: usize = 5_000;

/// Fails unless a process has ended for bad input, with one line that has all of `words`.
#[track_caller]
fn assert_bad_input(ended: &Ended, words: &[&str]) {
    assert_eq!(ended.code, Some(2), "exit code\n{ended}");
    assert_eq!(ended.stdout, "", "nothing on stdout\n{ended}");
    assert_eq!(ended.stderr.lines().count(), 1, "one line on stderr\n{ended}");
    assert!(ended.stderr.starts_with("error: "), "{ended}");
    for word in words {
        assert!(ended.stderr.contains(word), "no `{word}` in: {}", ended.stderr);
    }
}

/// Fails unless every command that starts a run refuses it and leaves no recording.
#[track_caller]
fn assert_no_run(site: &Site, scenario: &Path, flags: &[&str], words: &[&str]) {
    let file = site.path("run.mcap");
    let flags = [flags, &["--record", text(&file)]].concat();
    let mut server = site.binary("sim_server");
    let mut single = site.binary("maes");
    for command in [
        server.arg("run").arg(scenario).args(&flags),
        single.args(["run", "--transport", "memory"]).arg(scenario).args(&flags),
        &mut site.run_sh(&[&[text(scenario)][..], &flags].concat()),
    ] {
        assert_bad_input(&Process::start(command).ended(), words);
        assert!(!file.exists(), "{command:?} has left a recording");
    }
}

#[test]
fn scenarios() {
    let site = Site::new();
    let refuse = |content: &str, words: &[&str]| {
        assert_no_run(&site, &site.file("s.toml", content), &[], words);
    };
    refuse("seed = 7\nduration_s = [\n", &["s.toml:2:15: "]);
    refuse(
        &LEGAL.replace("count", "cuont"),
        &["s.toml:7:1: ", "unknown key `agents.cuont`; did you mean `agents.count`?"],
    );
    refuse(&format!("{LEGAL}[lidra]\n"), &["s.toml:8:2: ", "unknown key `lidra`; did you mean `lidar`?"]);
    refuse(
        &LEGAL.replace("count = 3", "count = \"three\""),
        &["s.toml:7:9: agents.count = \"three\": expected an integer, 1 to 1000"],
    );
    refuse(&LEGAL.replace("seed = 7\n", ""), &["s.toml", "missing key `seed`: expected a seed"]);
    refuse(&LEGAL.replace("40.0", "0.03"), &["s.toml:2: duration_s = 0.03: expected a multiple of 0.02"]);
    refuse(&LEGAL.replace("count = 3", "count = 0"), &["s.toml:7: agents.count = 0: expected 1 to 1000"]);
    refuse(
        &format!("{LEGAL}[body]\nradius_m = nan\n"),
        &["s.toml:9: body.radius_m = NaN: expected a number above 0, up to 1e6"],
    );
    refuse(&LEGAL.replace("size = 30", "size = 2000"), &["s.toml:5: map.size = 2000: expected 5 to 1024"]);
    refuse(&LEGAL.replace("size = 30", "size = 5"), &["s.toml: map.spheres: radius_min is 3"]);
    refuse(
        &LEGAL.replace("size = 30", "size = -3"),
        &["s.toml:5:8: map.size = -3: expected a number of cells from 1 to 1024"],
    );
    let latin = site.file("s.toml", [LEGAL.as_bytes(), b"# caf\xe9\n"].concat());
    assert_no_run(&site, &latin, &[], &["s.toml:8:6: a byte that is no UTF-8"]);
    assert_no_run(&site, &site.path("nowhere.toml"), &[], &["nowhere.toml: No such file"]);
}

#[test]
fn maps_larger_than_memory() {
    let site = Site::new();
    let scenario = site.file("s.toml", LEGAL);
    let mut server = site.binary("sim_server");
    server.arg("run").arg(&scenario).args(["--size", "1024"]);
    let generate = |size: &str| {
        let mut generate = site.binary("maes");
        generate.args(["map", "generate", "--size", size, "--output", "large.txt"]);
        generate
    };
    let map = ["a map of 1024x1024x1024 cells", "MiB of memory, which cannot be had"];
    // The map takes 128 MiB, and so does the text: the first fits beside the program and what the
    // allocator reserves for a thread, 64 MiB, and both do not.
    let text = ["large.txt", "a map of 134217728 cells takes more memory than can be had"];
    for (command, limit_kib, words) in
        [(server, 4_000_000, map), (generate("1024"), 1_000_000, map), (generate("512"), 265_000, text)]
    {
        let mut limited = site.command("bash");
        limited.args(["-c", &format!("ulimit -v {limit_kib}; exec \"$@\""), "bash"]);
        limited.arg(command.get_program()).args(command.get_args());
        assert_bad_input(&Process::start(&mut limited).ended(), &words);
    }
}

#[test]
fn scenario_flags() {
    let site = Site::new();
    let legal = site.file("s.toml", LEGAL);
    for (flags, words) in [
        (&["--agents", "0"][..], &["--agents 0: agents.count = 0: expected 1 to 1000"][..]),
        (&["--set", "lidar.range_m=-3"], &["--set lidar.range_m=-3: lidar.range_m = -3: expected a number above 0"]),
        (&["--set", "map.kind=noize"], &["map.kind = \"noize\": expected", "did you mean \"noise\"?"]),
        (&["--set", "duration_s=-1.0"], &["--set duration_s=-1.0: duration_s = -1: expected"]),
        (&["--seed", "9223372036854775808"], &["--seed ", "expected a seed from 0 to 9223372036854775807"]),
        (&["--set", "spawn=foo"], &["--set spawn=foo: spawn = \"foo\": ", "{ kind = \"nearest_origin\" }"]),
        (
            &["--map", "a.m3dm", "--size", "30"],
            &["--size 30: map.size = [30, 30, 30]: a map from a file has the size of the file"],
        ),
        (
            &["--set", "agents.cuont=1"],
            &["--set agents.cuont=1: unknown key `agents.cuont`; did you mean `agents.count`?"],
        ),
        (&["--set", "seed.x=1"], &["--set seed.x=1: `seed` in `seed.x` is not a table"]),
        (
            &["--set", "faults.on_agent_loss=panic"],
            &["--set faults.on_agent_loss=panic: ", "expected \"abort\", \"drop\" or \"wait\""],
        ),
    ] {
        assert_no_run(&site, &legal, flags, words);
    }
}

#[test]
fn maps() {
    let site = Site::new();
    let legal = site.file("s.toml", LEGAL);
    let refuse = |map: &str, words: &[&str]| assert_no_run(&site, &legal, &["--map", map], words);
    refuse("nowhere.m3dm", &["nowhere.m3dm: No such file"]);
    // The flag is at fault, and not the scenario, which may be the default one.
    refuse(".", &["error: --map .: a folder without .png files; expected one for each layer of cells"]);
    site.file("hole.obj", "f 1 2 3\n");
    refuse("hole.obj", &["error: --map hole.obj: line 1: \"3\" is none of the 0 vertices"]);

    let made = site.path("good.m3dm");
    let mut generate = site.binary("maes");
    generate.args(["map", "generate", "--size", "20", "--seed", "1", "--output"]).arg(&made);
    Process::start(&mut generate).ended().with_code(0);
    let good = std::fs::read(&made).expect("the map was written");
    assert_eq!(good.len(), 1003, "three bytes of header and a bit for each cell");

    site.file("short.m3dm", &good[..100]);
    refuse("short.m3dm", &["short.m3dm: byte 100: ", "expected length 1003 bytes"]);
    site.file("long.m3dm", [&good[..], &[0]].concat());
    refuse("long.m3dm", &["long.m3dm: ", "expected length 1003 bytes"]);
    site.file("header.m3dm", b"no map at all");
    refuse("header.m3dm", &["header.m3dm: byte ", "expected length"]);
    site.file("empty.m3dm", b"");
    refuse("empty.m3dm", &["empty.m3dm: byte 0"]);
    site.file("solid.m3dm", [&good[..3], &[0xff; 1000]].concat());
    refuse("solid.m3dm", &["solid.m3dm", "free"]);
    site.file("letters.txt", "##\n#x\n");
    refuse("letters.txt", &["letters.txt: line 2, column 2: 'x' is no cell"]);
    site.file("map.tiff", &good);
    refuse("map.tiff", &["map.tiff", ".m3dm", ".txt"]);
}

#[test]
fn spawns() {
    let site = Site::new();
    let list = |poses: &str| site.file("s.toml", format!("{LEGAL}[spawn]\nkind = \"list\"\nposes = {poses}\n"));
    let refuse = |poses: &str, words: &[&str]| assert_no_run(&site, &list(poses), &[], words);
    refuse(
        "[[0.5, 0.5, 0.5], [1, 2, 3], [1, 2, 3]]",
        &["s.toml: spawn.poses[0]: a body of radius 0.4 m does not fit at [0.5"],
    );
    refuse("[[15.5, 15.5, 15.5]]", &["spawn.poses: 1 poses for 3 agents"]);
    refuse("[[1], [1], [1]]", &["spawn.poses[0]: expected [x, y, z]"]);
    let legal = site.file("s.toml", LEGAL);
    assert_no_run(
        &site,
        &legal,
        &["--agents", "200", "--size", "16", "--seed", "1", "--set", "map.spheres.radius_max=4"],
        &["spawn: no free cube of 6 x 6 x 6 cells for 200 agents"],
    );
}

#[test]
fn controller_settings() {
    let site = Site::new();
    let legal = site.file("s.toml", LEGAL);
    for transport in ["ros2", "memory"] {
        let run = |flags: &[&str]| {
            let flags = [&[text(&legal), "--transport", transport][..], flags].concat();
            site.start(&mut site.run_sh(&flags)).ended().with_code(2)
        };
        let unknown = run(&["--controller", "rwb"]).stderr;
        assert!(
            unknown.contains("error: controller rwb: unknown; known are rbw, rbw-maes3d"),
            "{transport}: {unknown}"
        );
        for setting in [["--set", "agents.set.pitch_max_rad=9"], ["--agent-set", "pitch_max_rad=9"]] {
            let refused = run(&setting).stderr;
            let expected = "error: controller rbw: setting pitch_max_rad = 9: expected";
            assert!(refused.contains(expected), "{transport} {setting:?}: {refused}");
        }
    }
}

#[test]
fn refused_settings_leave_no_files() {
    let site = Site::new();
    let file = site.path("run.mcap");
    let good = site.file("good.toml", LEGAL);
    let bad = site.file("bad.toml", format!("{LEGAL}set = {{ pitch_max_rad = 1.5, mood = \"brisk\" }}\n"));
    for transport in ["ros2", "memory"] {
        for (scenario, flags, words) in [
            (&good, &["--controller", "rwb"][..], "controller rwb: unknown; known are rbw, rbw-maes3d"),
            (&good, &["--agent-set", "speed=1"], "controller rbw: setting `speed`: unknown"),
            (&good, &["--set", "agents.set.pitch_max_rad=9"], "controller rbw: setting pitch_max_rad = 9: expected"),
            (&bad, &[], "controller rbw: setting `mood`: unknown"),
        ] {
            let common = [text(scenario), "--transport", transport, "--record", text(&file)];
            let ended = Process::start(&mut site.run_sh(&[&common[..], flags].concat())).ended();
            assert_bad_input(&ended, &[words]);
            assert!(!file.exists() && !site.path("logs").exists(), "{transport} {words}");
        }
    }
}

#[test]
fn agent_settings_are_scenario_keys() {
    let site = Site::new();
    let digest = |flags: &[&str]| {
        let short = ["--agents", "2", "--size", "20", "--duration", "20", "--set", "stop_when_explored=false"];
        let outcome = site.record(&[&short[..], flags].concat());
        assert!(site.path("logs/server.log").exists(), "{flags:?}");
        outcome.digest()
    };
    let set = digest(&["--transport", "memory", "--set", "agents.set.pitch_max_rad=0.7"]);
    assert_eq!(digest(&["--transport", "memory", "--agent-set", "pitch_max_rad=0.7"]), set);
    assert_eq!(digest(&["--agent-set", "pitch_max_rad=0.7"]), set);
    assert_ne!(digest(&["--transport", "memory"]), set);
    let silent = digest(&["--transport", "memory", "--share-period", "0"]);
    assert_eq!(digest(&["--transport", "memory", "--set", "agents.share_period_ticks=0"]), silent);
    assert_eq!(digest(&["--share-period", "0"]), silent);
}

#[test]
fn ros_environment() {
    let site = Site::new();
    let file = site.path("run.mcap");
    let mut server = site.binary("sim_server");
    server.arg("run").arg(scenario("default.toml")).arg("--record").arg(&file).env("ROS_DOMAIN_ID", "233");
    assert_bad_input(&Process::start(&mut server).ended(), &["ROS_DOMAIN_ID is \"233\"; allowed are 0 to 232"]);
    assert!(!file.exists());
}

/// Of programs that are built without the feature `zenoh`.
#[cfg(not(feature = "zenoh"))]
#[test]
fn zenoh_without_the_feature() {
    let site = Site::new();
    let file = site.path("run.mcap");
    let mut server = site.binary("sim_server");
    let mut maes = site.binary("maes");
    server.arg("run").arg(scenario("default.toml")).arg("--record").arg(&file);
    maes.arg("run").arg(scenario("default.toml")).arg("--record").arg(&file);
    let words =
        ["RMW_IMPLEMENTATION is \"rmw_zenoh_cpp\"; allowed are those of DDS", "cargo build --release --features zenoh"];
    for command in [&mut server, &mut maes] {
        assert_bad_input(&Process::start(command.env("RMW_IMPLEMENTATION", "rmw_zenoh_cpp")).ended(), &words);
        assert!(!file.exists());
    }
}

#[test]
fn launcher_arguments() {
    let site = Site::new();
    for (arguments, words) in [
        (&["--external", "two"][..], "--external two: expected ids of agents, such as 0,3"),
        (&["--external", "7", "--agents", "2"], "agent 7 is not in the run: ids are 0 to 1"),
        (&["--external", "0", "--agents-per-process", "2"], "--agents-per-process 2: expected 1"),
        (&["--order", "sideways"], "--order sideways: expected forward, reverse or shuffle"),
        (&["--transport", "pigeon"], "--transport pigeon: expected ros2 or memory"),
        (&["--agents-per-process", "0"], "--agents-per-process 0: expected a number from 1, or auto"),
        (
            &["--transport", "memory", "--agents-per-process", "2"],
            "--agents-per-process 2: over memory there is one process",
        ),
        (&["--order", "shuffle", "--transport", "memory"], "--order shuffle: over memory no processes are started"),
        (&["--agent-set", "speed"], "--agent-set speed: expected KEY=VALUE"),
        (&["a.toml", "b.toml"], "unexpected argument: b.toml"),
        (&["--controller", "dspv"], "; did you mean `dsvp`?"),
    ] {
        let mut command = site.command(root().join("launch_scripts/run.sh"));
        assert_bad_input(&Process::start(command.args(arguments)).ended(), &[words]);
    }
    let mut command = site.command(root().join("launch_scripts/run.sh"));
    assert_bad_input(&Process::start(command.arg("--seed")).ended(), &["--seed needs a value"]);
}

/// The recording of a short run, with several chunks.
fn short_recording(site: &Site) -> Vec<u8> {
    let file = site.path("short.mcap");
    let mut play = Play::new(&LEGAL.replace("40.0", "20.0\nstop_when_explored = false"));
    play.record = Some(file.clone());
    let played = play.with(|mut end, ids, is_over| {
        agent_node::host::run(&mut end, &honest(u64::from(ids[0].0), ids), is_over).expect("agents are welcome");
    });
    played.outcome();
    std::fs::read(&file).expect("there is a recording")
}

#[test]
fn files_that_are_not_recordings() {
    let site = Site::new();
    let whole = short_recording(&site);
    let info = |name: &str| Process::start(site.binary("maes").arg("info").arg(site.path(name))).ended();
    assert_bad_input(&info("nowhere.mcap"), &["nowhere.mcap: No such file"]);
    site.file("text.mcap", "not a recording");
    assert_bad_input(&info("text.mcap"), &["text.mcap: no MCAP recording"]);
    site.file("empty.mcap", "");
    assert_bad_input(&info("empty.mcap"), &["empty.mcap: "]);
    site.file("start.mcap", &whole[..40]);
    assert_bad_input(&info("start.mcap"), &["start.mcap: "]);

    let mut other = mcap::Writer::new(std::io::Cursor::new(Vec::new())).expect("memory can be written");
    other.finish().expect("memory can be written");
    site.file("other.mcap", other.into_inner().into_inner());
    assert_bad_input(&info("other.mcap"), &["other.mcap: not a recording of this simulator"]);
}

/// The messages of a recording up to its end or its damage, or the refusal.
fn messages(bytes: Vec<u8>) -> Result<Vec<Message>, String> {
    let recording = recording::Recording::from_bytes("r.mcap".to_owned(), bytes).map_err(|error| error.to_string())?;
    let _text = info::text(&info::of(&recording).into());
    Ok(recording.messages().collect())
}

#[test]
fn cut_recordings_are_read_up_to_the_last_whole_chunk() {
    let whole = short_recording(&Site::new());
    let all = messages(whole.clone()).expect("the recording is whole");
    let ends = ends_of_chunks(&whole);
    bounded("reading recordings that are cut off", move || {
        let counts = ends.iter().map(|&end| messages(whole[..end].to_vec()).expect("a chunk is whole").len());
        let counts: Vec<usize> = counts.collect();
        assert!(counts.len() >= 2 && counts.is_sorted_by(|a, b| a < b), "each chunk has messages: {counts:?}");
        for length in 0..whole.len() {
            let chunks = ends.iter().filter(|&&end| end <= length).count();
            match messages(whole[..length].to_vec()) {
                Ok(read) => {
                    let expected = chunks.checked_sub(1).map_or(0, |last| counts[last]);
                    assert_eq!(read.len(), expected, "cut off at byte {length}");
                    assert!(all.starts_with(&read), "cut off at byte {length}");
                }
                Err(refusal) => {
                    assert_eq!(chunks, 0, "cut off at byte {length}");
                    assert!(refusal.starts_with("r.mcap: no"), "cut off at byte {length}: {refusal}");
                }
            }
        }
        assert_eq!(counts.last(), Some(&all.len()));
    });
}

/// Where the chunks of a recording end.
fn ends_of_chunks(whole: &[u8]) -> Vec<usize> {
    let mut ends = Vec::new();
    let mut at = mcap::MAGIC.len();
    while whole[at] != op::DATA_END {
        let length = whole[at + 1..].first_chunk().expect("a record has a length");
        let end = at + 9 + u64::from_le_bytes(*length) as usize;
        if whole[at] == op::CHUNK {
            ends.push(end);
        }
        at = end;
    }
    ends
}

#[test]
fn flipped_bytes_yield_no_wrong_message() {
    let whole = short_recording(&Site::new());
    let all = messages(whole.clone()).expect("the recording is whole");
    bounded("reading recordings with a wrong byte", move || {
        let mut rng = voxels::random_streams::stream(1, 0, "wrong bytes");
        let mut refused = 0;
        for number in 0..WRONG_BYTES {
            // Record headers are few among all bytes, so the first positions are theirs.
            let framing = ends_of_chunks(&whole).len() * 9;
            let position = match number {
                number if number < framing => ends_of_chunks(&whole)[number / 9] + number % 9,
                _ => rng.random_range(0..whole.len()),
            };
            let flip = rng.random_range(1..=u8::MAX);
            let mut wrong = whole.clone();
            wrong[position] ^= flip;
            match messages(wrong) {
                Ok(read) => assert!(all.starts_with(&read), "byte {position} ^ {flip:#04x}"),
                Err(_) => refused += 1,
            }
        }
        assert!(refused > 0, "some bytes are those of the attachments");
    });
}
