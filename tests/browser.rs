//! The viewer: its static checks and tests, in a real browser with real runs and recordings, and
//! the snapshots and movies made with it.

use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

use crate::support::binaries;
use crate::support::foxglove::Client;
use crate::support::processes::{Process, signal};
use crate::support::recordings::Recording;
use crate::support::runs::{Site, text};
use crate::support::{Slot, root};

/// Longest wall time for fetching packages, and for the tests of the viewer, seconds, for
/// `timeout`.
const LIMIT_S: &str = "3000";

/// Builds the viewer, once.
fn prepare() {
    static BUILT: OnceLock<()> = OnceLock::new();
    BUILT.get_or_init(|| {
        let maes = binaries::folder().join("maes");
        let view = ["view", "--build-only", "true"];
        done(Command::new("timeout").arg(LIMIT_S).arg(maes).args(view).current_dir(root()));
    });
}

/// The output of an npm command in the folder of the viewer. Servers that it starts have a ROS
/// domain of their own.
fn npm(arguments: &[&str]) -> String {
    prepare();
    let site = Site::new();
    done(site.command("timeout").args([LIMIT_S, "npm"]).args(arguments).current_dir(root().join("viewer")))
}

/// The output of a command that has to succeed.
fn done(command: &mut Command) -> String {
    let output = command.output().unwrap_or_else(|error| panic!("{command:?}: {error}"));
    let [printed, complaint] = [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned());
    assert!(output.status.success(), "{command:?} ({}):\n{printed}\n{complaint}", output.status);
    printed
}

#[test]
fn viewer_passes_static_checks() {
    npm(&["run", "check"]);
}

#[test]
fn viewer_unit_tests_pass() {
    npm(&["test"]);
}

#[test]
fn viewer_works_in_a_browser() {
    browser_tests("e2e:short");
}

#[test]
#[ignore = "takes minutes"]
fn all_browser_tests_of_the_viewer_pass() {
    browser_tests("e2e");
}

fn browser_tests(script: &str) {
    // A browser that draws in software, and the runs that it shows.
    let _slots = Slot::take_some(2);
    let played = npm(&["run", script]);
    assert!(played.contains(" passed"), "{played}");
}

/// A recording for snapshots and movies.
fn recording(site: &Site) -> PathBuf {
    let flags = ["--transport", "memory", "--agents", "2", "--size", "24", "--seed", "3", "--duration", "20"];
    let bytes = site.record(&[&flags[..], &["--set", "stop_when_explored=false"]].concat()).bytes;
    site.file("pictured.mcap", &bytes)
}

/// A recording as a program writes it again that copies messages alone.
fn without_attachments(file: &Path) -> Vec<u8> {
    let bytes = std::fs::read(file).expect("the recording is there");
    let mut writer = mcap::Writer::new(Cursor::new(Vec::new())).expect("memory can be written");
    for message in mcap::MessageStream::new(&bytes).expect("it is whole") {
        writer.write(&message.expect("it is whole")).expect("memory can be written");
    }
    writer.finish().expect("memory can be written");
    writer.into_inner().into_inner()
}

#[test]
fn snapshots_are_reproducible() {
    prepare();
    let site = Site::new();
    let file = recording(&site);
    let snapshot_of = |file: &Path, arguments: &[&str]| {
        let mut command = site.binary("maes");
        site.start(command.arg("snapshot").arg(file).args(["--size", "320x200"]).args(arguments)).ended()
    };
    let snapshot = |arguments: &[&str]| snapshot_of(&file, arguments);
    let taken = |at: &str, name: &str| {
        snapshot(&["--at", at, "--out", name]).with_code(0);
        let bytes = std::fs::read(site.path(name)).expect("there is a picture");
        assert!(bytes.starts_with(b"\x89PNG"));
        bytes
    };
    let early = taken("2", "early.png");
    assert!(early == taken("2", "again.png"), "the same moment is the same picture");
    assert!(early != taken("18.5", "late.png"), "another moment is another picture");
    // Of a file that has lost its attachments, the page draws what the team has seen.
    let stripped = site.file("stripped.mcap", without_attachments(&file));
    snapshot_of(&stripped, &["--at", "18", "--out", "stripped.png"]).with_code(0);
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
fn pictures_of_maps_are_reproducible() {
    prepare();
    let site = Site::new();
    let maes = |arguments: &[&str]| site.start(site.binary("maes").arg("map").args(arguments)).ended();
    maes(&["generate", "--kind", "building", "--size", "30x30x13", "--seed", "1", "-o", "house.m3dm"]).with_code(0);
    let picture = |name: &str, more: &[&str]| {
        let arguments = ["check", "house.m3dm", "--picture", name, "--picture-size", "320x200"];
        let ended = maes(&[&arguments[..], more].concat());
        (ended, std::fs::read(site.path(name)).unwrap_or_default())
    };
    let (ended, first) = picture("a.png", &[]);
    assert!(ended.with_code(0).stdout.lines().any(|line| line == "picture    a.png"));
    assert_eq!(first[16..24], [0, 0, 1, 64, 0, 0, 0, 200], "width and height");
    assert!(picture("b.png", &[]).1 == first, "the same map has the same picture");
    assert!(picture("c.png", &["--cut", "z=4"]).1 != first, "without the upper floors it is another one");
    for (name, more, reason) in [
        ("d.png", &["--cut", "z=13"][..], "--cut z=13: allowed is z=1 to z=12"),
        ("d.png", &["--page", "."], "--picture d.png: "),
        ("no/d.png", &[], "the folder "),
    ] {
        let (ended, bytes) = picture(name, more);
        assert!(ended.with_code(2).stderr.contains(reason) && bytes.is_empty(), "{reason}");
    }
}

#[test]
#[ignore = "takes minutes"]
fn movies_have_all_frames() {
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
fn exported_folders_are_complete() {
    prepare();
    let site = Site::new();
    let file = recording(&site);
    let export = |folder: &str| {
        let mut command = site.binary("maes");
        let command = command.arg("view").arg(&file).arg("--beside").arg(&file).args(["--export", folder]);
        site.start(command).ended()
    };
    let output = export("shared").with_code(0).stdout;
    assert!(output.contains("\nto try it: python3 -m http.server --directory shared\n"), "{output}");
    let query = "recording=recording/pictured.mcap&beside=beside/pictured.mcap";
    assert_eq!(output.lines().last(), Some(&*format!("http://127.0.0.1:8000/?{query}")));
    let read = |path: PathBuf| std::fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    for folder in ["recording", "beside"] {
        assert!(read(site.path(&format!("shared/{folder}/pictured.mcap"))) == read(file.clone()), "{folder}");
    }
    let page = root().join("viewer/dist");
    for asset in std::fs::read_dir(page.join("assets")).expect("the page is built") {
        let asset = Path::new("assets").join(asset.expect("it is readable").file_name());
        assert!(read(site.path("shared").join(&asset)) == read(page.join(&asset)), "{}", asset.display());
    }
    let index = String::from_utf8(read(site.path("shared/index.html"))).expect("it is text");
    assert!(index.contains(&query.replace('&', "&amp;")), "{index}");

    let again = export("shared").with_code(2);
    assert!(again.stderr.contains("--export shared: not empty; expected a new or an empty folder"), "{again}");
}

#[test]
fn view_script_starts_agents_of_browser_runs() {
    prepare();
    let site = Site::new();
    let mut script = site.command(root().join("launch_scripts/view.sh"));
    let mut script = site.start(script.args(["--address", "127.0.0.1:0", "--browser", "false"]));
    let mut client = Client::connect(&script.address());
    let scenario = "seed = 1\nduration_s = 2\n[map]\nkind = \"spheres\"\nsize = 20\n[agents]\ncount = 3";
    let request = serde_json::json!({ "scenario": scenario }).to_string();
    client.call_raw("/sim_server/start_run", "json", request.as_bytes()).expect("it answers");
    let session = client.next_session();
    assert_eq!(Recording::from_bytes(&client.live_stream(&session)).result().explored_by.len(), 3);
    script.process().prints("digest: ");
    signal(script.process().pid(), "INT");
    script.ended().with_code(0);
}
