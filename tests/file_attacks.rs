//! Attacks with files: what is read is a regular file of bounded size, what is written replaces
//! nothing but a recording, and nothing steers the terminal or makes a replay endless.

use std::fs;
use std::os::unix::fs::{PermissionsExt, symlink};
use std::path::Path;
use std::process::Command;

use msgs::cdr;
use msgs::ids::Tick;
use msgs::maes_msgs::{Progress, Result as RunResult};
use msgs::topics;
use recording::SCENARIO_ATTACHMENT;
use recording::recorder::{Document, Recorder};

use crate::support::processes::{Ended, Process};
use crate::support::runs::{Site, text};

/// A valid scenario that ends at once.
const SHORT: &str = "seed = 7\nduration_s = 1.0\n[map]\nkind = \"spheres\"\nsize = 30\n[agents]\ncount = 1\n";

/// Sets the title of a terminal.
const TITLE: &str = "\u{1b}]0;owned\u{7}";

fn maes(site: &Site, arguments: &[&str]) -> Ended {
    Process::start(site.binary("maes").args(arguments)).ended()
}

/// Fails unless a command is refused as bad input, with one line that has `words`.
#[track_caller]
fn assert_refused(ended: &Ended, words: &str) {
    assert_eq!(ended.code, Some(2), "{ended}");
    assert_eq!(ended.stderr.lines().count(), 1, "{ended}");
    assert!(ended.stderr.starts_with("error: ") && ended.stderr.contains(words), "{words}: {ended}");
}

fn fifo(site: &Site, name: &str) {
    assert!(Command::new("mkfifo").arg(site.path(name)).status().expect("mkfifo is there").success());
}

#[test]
fn only_regular_files_are_read() {
    let site = Site::new();
    for (name, what) in [("pipe", "a FIFO"), ("zeros", "a device")] {
        for extension in ["toml", "mcap", "m3dm", "bt"] {
            let name = format!("{name}.{extension}");
            if what == "a FIFO" {
                fifo(&site, &name);
            } else {
                symlink("/dev/zero", site.path(&name)).expect("links can be made");
            }
        }
        let refused = format!("{what}; expected a regular file");
        let file = |extension: &str| format!("{name}.{extension}");
        site.file("legal.toml", SHORT);
        for arguments in [
            &["run", "--transport", "memory", &file("toml")][..],
            &["run", "--transport", "memory", &file("mcap")],
            &["run", "--transport", "memory", "legal.toml", "--map", &file("m3dm")],
            &["run", "--transport", "memory", "legal.toml", "--map", &file("bt")],
            &["batch", &file("toml"), "--out", "runs"],
            &["info", &file("mcap")],
            &["verify", &file("mcap")],
            &["diff", &file("mcap"), &file("mcap")],
            &["replay", &file("mcap")],
            &["map", "info", &file("m3dm")],
        ] {
            assert_refused(&maes(&site, arguments), &refused);
        }
    }
}

#[test]
fn files_and_maps_have_a_largest_size() {
    let site = Site::new();
    let large = |name: &str| {
        fs::File::create(site.path(name)).and_then(|file| file.set_len(1 << 40)).expect("holes take no room");
        name.to_owned()
    };
    for (arguments, limit) in [
        (&["info", &large("large.mcap")][..], "no MCAP recording: it does not begin as MCAP does"),
        (&["batch", &large("large.toml"), "--out", "runs"], "allowed are 16777216"),
    ] {
        assert_refused(&maes(&site, arguments), limit);
    }
    // A tree of 261 bytes that describes a cube of 1024 cells along each edge.
    let path = |child: u16| [0b11 << (2 * child)].repeat(5).into_iter().chain([0b10 << (2 * child)]);
    let tree = [0b11 | 0b11 << 14].into_iter().chain(path(7)).chain(path(0)).flat_map(u16::to_le_bytes);
    let comment = [b"#".repeat(184), b"\n".to_vec()].concat();
    let header = [&b"# Octomap OcTree binary file\n"[..], &comment, b"id OcTree\nres 1\ndata\n"].concat();
    site.file("bomb.bt", [header, tree.collect()].concat());
    site.file("legal.toml", SHORT);
    for arguments in
        [&["map", "info", "bomb.bt"][..], &["run", "--transport", "memory", "legal.toml", "--map", "bomb.bt"]]
    {
        assert_refused(&maes(&site, arguments), "bomb.bt: the map has 1073741824 cells, allowed are 16777216");
    }
}

#[test]
fn recordings_replace_only_recordings() {
    let site = Site::new();
    site.file("legal.toml", SHORT);
    let keys = site.file("keys.mcap", "ssh-ed25519 AAAA");
    symlink("keys.mcap", site.path("link.mcap")).expect("links can be made");
    symlink("nowhere", site.path("dangling.mcap")).expect("links can be made");
    fifo(&site, "pipe.mcap");
    for transport in ["ros2", "memory"] {
        for (file, what) in [
            ("keys.mcap", "a file that is no recording; nothing was written"),
            ("link.mcap", "a symbolic link; nothing was written"),
            ("dangling.mcap", "a symbolic link; nothing was written"),
            ("pipe.mcap", "a FIFO; nothing was written"),
            ("/dev/full", "a device; nothing was written"),
        ] {
            let record = format!("execution.record=\"{file}\"");
            let flags = ["legal.toml", "--transport", transport, "--set", &record];
            let ended = site.start(&mut site.run_sh(&flags)).ended();
            assert_refused(&ended, &format!("recording {file}: {what}"));
        }
    }
    assert_eq!(fs::read(&keys).expect("it is there"), b"ssh-ed25519 AAAA");
    assert!(!site.path("nowhere").exists());

    let run = |file: &str| {
        let flags = ["run", "legal.toml", "--transport", "memory", "--record", file];
        maes(&site, &flags).with_code(0);
        fs::read(site.path(file)).expect("there is a recording")
    };
    let first = run("run.mcap");
    fs::set_permissions(site.path("run.mcap"), fs::Permissions::from_mode(0o640)).expect("it is ours");
    // What a killed server has left, with a process id that Linux never gives.
    let left = site.file(".run.mcap.4294967295.tmp", &first[..100]);
    assert_eq!(run("run.mcap"), first);
    let mode = fs::metadata(site.path("run.mcap")).expect("it is there").permissions().mode();
    assert_eq!(mode & 0o7777, 0o640);
    assert!(!left.exists());
}

/// A recording with hostile texts and stamps.
fn hostile_recording(file: &Path, scenario: &str, last: Tick) {
    let document = Document { name: SCENARIO_ATTACHMENT, media_type: "", data: scenario.as_bytes() };
    let mut recorder = Recorder::create(file, &[document]).expect("the folder can be written to");
    let progress = |tick: Tick| cdr::encode(&Progress { tick: tick.0, ..Progress::default() });
    for tick in [Tick(0), Tick(1), last] {
        recorder.write(&topics::progress(), tick, &progress(tick)).expect("there is room");
    }
    let topic = topics::Topic { name: format!("/{TITLE}\ndigest: 00"), ..topics::progress() };
    recorder.write(&topic, last, &progress(last)).expect("there is room");
    let reason = format!("explored{TITLE}\ndigest: 00");
    let result = RunResult { reason, ..RunResult::default() };
    recorder.write(&topics::result(), last, &cdr::encode(&result)).expect("there is room");
    recorder.finish().expect("there is room");
}

#[test]
fn control_characters_do_not_reach_the_terminal() {
    let site = Site::new();
    hostile_recording(&site.path("hostile.mcap"), &format!("# {TITLE}\n{SHORT}"), Tick(3));
    let info = maes(&site, &["info", "hostile.mcap"]).with_code(0);
    assert!(info.stdout.contains(r"\u{1b}]0;owned\u{7}"), "{info}");
    assert_eq!(info.stdout.lines().filter(|line| line.starts_with("digest: ")).count(), 1, "{info}");
    let bytes = maes(&site, &["verify", "hostile.mcap"]);
    let missing = format!("{TITLE}.mcap");
    let scenario = format!("--set=agents.controller={TITLE}");
    for ended in [
        info,
        bytes,
        maes(&site, &["replay", "hostile.mcap", "--topics", &missing]),
        maes(&site, &["info", &missing]),
        maes(&site, &["diff", &missing, &missing]),
        maes(&site, &["run", "--transport", "memory", &scenario]),
        Process::start(site.binary("sim_server").args(["run", &missing])).ended(),
    ] {
        assert!(!ended.stdout.contains('\u{1b}') && !ended.stderr.contains('\u{1b}'), "{ended}");
    }
}

#[test]
fn replay_ends_whatever_the_stamps() {
    let site = Site::new();
    // Sim time of six years, and of five hundred years.
    for (name, duration_s, last) in [("gap.mcap", 2e8, 10_000_000_000), ("late.mcap", 1.0, 900_000_000_000)] {
        let scenario = SHORT.replace("1.0", &format!("{duration_s:?}"));
        hostile_recording(&site.path(name), &scenario, Tick(last));
        let ended = site.start(site.binary("maes").args(["replay", text(&site.path(name))])).ended().with_code(0);
        assert!(ended.stdout.contains("replayed "), "{ended}");
        let warned = ended.stderr.contains("stamped after 1 s, the duration of its run");
        assert_eq!(warned, name == "late.mcap", "{ended}");
    }
}
