//! The page: its own checks and tests, in a real browser against real runs and recordings, and the pictures that are taken with it.

use std::process::Command;
use std::sync::OnceLock;

use crate::support::binaries;
use crate::support::foxglove::Client;
use crate::support::processes::{Process, signal};
use crate::support::recordings::Recording;
use crate::support::runs::{Site, text};
use crate::support::{Slot, root};

/// Wall time that packages may take to be fetched, and all tests of the page to run, as an argument of `timeout`.
const PATIENCE: &str = "1200";

/// Builds the page, once.
fn prepare() {
    static BUILT: OnceLock<()> = OnceLock::new();
    BUILT.get_or_init(|| {
        let maes = binaries::folder().join("maes");
        let view = ["view", "--build-only", "true"];
        done(Command::new("timeout").arg(PATIENCE).arg(maes).args(view).current_dir(root()));
    });
}

/// Carries out a command of npm in the folder of the page, alone, for browsers that draw in software leave nothing to others. Servers
/// that it starts are in a ROS domain of their own.
fn npm(arguments: &[&str]) -> String {
    prepare();
    let site = Site::new();
    let _slots = Slot::take_all();
    done(site.command("timeout").args([PATIENCE, "npm"]).args(arguments).current_dir(root().join("viewer")))
}

/// What a command prints that has to succeed.
fn done(command: &mut Command) -> String {
    let output = command.output().unwrap_or_else(|error| panic!("{command:?}: {error}"));
    let [printed, complaint] = [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned());
    assert!(output.status.success(), "{command:?} ({}):\n{printed}\n{complaint}", output.status);
    printed
}

#[test]
fn the_page_is_as_it_should_be_written() {
    npm(&["run", "check"]);
}

#[test]
fn the_parts_of_the_page_do_what_they_should() {
    npm(&["test"]);
}

#[test]
fn the_page_does_what_it_should_in_a_browser() {
    let played = npm(&["run", "e2e"]);
    assert!(played.contains(" passed"), "{played}");
}

/// A recording to take pictures of.
fn recording(site: &Site) -> std::path::PathBuf {
    let flags = ["--transport", "memory", "--agents", "2", "--size", "24", "--seed", "3", "--duration", "20"];
    let bytes = site.record(&[&flags[..], &["--set", "stop_when_explored=false"]].concat()).bytes;
    site.file("pictured.mcap", &bytes)
}

#[test]
fn a_picture_of_a_moment_is_the_same_every_time() {
    prepare();
    let site = Site::new();
    let file = recording(&site);
    let snapshot = |arguments: &[&str]| {
        let mut command = site.binary("maes");
        site.start(command.arg("snapshot").arg(&file).args(["--size", "320x200"]).args(arguments)).ended()
    };
    let taken = |at: &str, name: &str| {
        snapshot(&["--at", at, "--out", name]).with_code(0);
        let bytes = std::fs::read(site.path(name)).expect("there is a picture");
        assert!(bytes.starts_with(b"\x89PNG"));
        bytes
    };
    let early = taken("2", "early.png");
    assert!(early == taken("2", "again.png"), "the same moment is the same picture");
    assert!(early != taken("18.5", "late.png"), "another moment is another picture");
    for (wrong, words) in [
        (&["--at", "100", "--out", "no.png"][..], "20"),
        (&["--at", "2", "--out", "no.png", "--agent", "7"], "0 to 1"),
        (&["--at", "2", "--out", "no.png", "--layers", "walls,roofs"], "roofs"),
        (&["--at", "2", "--out", "no.jpg"], ".png"),
    ] {
        let ended = snapshot(wrong).with_code(2);
        assert!(ended.stderr.contains(words), "{wrong:?}: {ended}");
    }
    assert!(!site.path("no.png").exists());
}

#[test]
fn a_movie_has_all_its_pictures() {
    prepare();
    let site = Site::new();
    let file = recording(&site);
    let movie = |arguments: &[&str]| {
        let mut command = site.binary("maes");
        site.start(command.arg("movie").arg(&file).args(["--size", "160x120", "--fps", "5"]).args(arguments)).ended()
    };
    for name in ["run.mp4", "run.gif"] {
        movie(&["--seconds", "2", "--out", name]).with_code(0);
        let count = "-v error -count_frames -show_entries stream=nb_read_frames,width,height -of csv=p=0";
        let mut probe = site.command("ffprobe");
        let probed = Process::start(probe.args(count.split(' ')).arg(text(&site.path(name)))).ended().with_code(0);
        assert_eq!(probed.stdout.trim(), "160,120,10", "{name}");
    }
    let ended = movie(&["--from", "9", "--to", "3", "--out", "no.gif"]).with_code(2);
    assert!(ended.stderr.contains("--from 9"), "{ended}");
    assert!(!site.path("no.gif").exists());
}

#[test]
fn the_script_starts_the_agents_of_what_is_started_on_the_page() {
    prepare();
    let site = Site::new();
    let mut script = site.command(root().join("launch_scripts/view.sh"));
    let mut script = site.start(script.args(["--address", "127.0.0.1:0", "--browser", "false"]));
    let mut client = Client::connect(&script.address());
    let scenario = "seed = 1\nduration_s = 2\n[map]\nkind = \"spheres\"\nsize = 20\n[agents]\ncount = 3";
    let request = serde_json::json!({ "scenario": scenario }).to_string();
    client.call_raw("/sim_server/start_run", "json", request.as_bytes()).expect("it answers");
    let session = client.next_session();
    assert_eq!(Recording::from_bytes(&client.journal(&session)).result().explored_by.len(), 3);
    script.process().prints("digest: ");
    signal(script.process().pid(), "INT");
    script.ended().with_code(0);
}
