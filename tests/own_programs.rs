//! Programs from outside the workspace that run agents (`agents.command`): the template of
//! docs/controllers.md, built in a folder of its own, and the Python examples, in runs and in
//! plans.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

use msgs::ids::AgentId;
use msgs::maes_msgs::Join;
use tempfile::TempDir;

use crate::support::processes::Ended;
use crate::support::recordings::Recording;
use crate::support::runs::{Site, text};
use crate::support::{binaries, python, root};

/// The package that asks for the features which the workspace needs of foreign crates.
const FEATURES: &str = "tests/workspace_features";

/// The crates of this repository that the template needs, and those that depend on the copy of the
/// DDS library in it. Cargo builds them again: to it, a folder seen from another workspace is
/// another package.
const BUILT_AGAIN: [&str; 9] =
    ["agent", "agent_node", "controllers", "msgs", "protocol", "ros2-client", "ros_node", "rustdds", "voxels"];

/// The template, built outside of the workspace, with the foreign crates, their features and the
/// profile of the workspace, so that what is built already is not built again. What has to be is
/// not optimised, which saves a minute and a half of processor time.
fn own_controller() -> &'static Path {
    static BUILT: OnceLock<(TempDir, PathBuf)> = OnceLock::new();
    let (_, program) = BUILT.get_or_init(|| {
        let folder = tempfile::tempdir().expect("there is room for a folder");
        let mut new = Command::new(binaries::folder().join("maes"));
        let made = new.args(["new", "zigzag", "--sources"]).arg(root()).current_dir(folder.path()).output();
        let made = made.expect("maes starts");
        assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
        let path = |name: &str| folder.path().join("zigzag").join(name);
        // Foreign crates with the features of the workspace.
        let manifest = fs::read_to_string(path("Cargo.toml")).expect("it was made");
        let features = format!("[dependencies]\nworkspace_features = {{ path = {:?} }}", root().join(FEATURES));
        fs::write(path("Cargo.toml"), manifest.replace("[dependencies]", &features)).expect("a copy");
        let workspace = fs::read_to_string(root().join("Cargo.toml")).expect("the workspace has a manifest");
        let mut workspace: toml::Table = workspace.parse().expect("it is TOML");
        workspace.retain(|key, _| key == "profile");
        let profiles = workspace["profile"]["release"]["package"].as_table_mut().expect("packages have profiles");
        for package in BUILT_AGAIN {
            let level = toml::toml! { opt-level = 0 };
            profiles.insert(package.to_owned(), level.into());
        }
        fs::write(path("profile.toml"), workspace.to_string()).expect("a file");
        let mut cargo = Command::new(env!("CARGO"));
        let arguments = ["build", "--release", "--offline", "--features", "ros", "--config", "profile.toml"];
        cargo.args(arguments).current_dir(path(""));
        let fixes = root().join(".cargo/config.toml");
        if fixes.is_file() {
            cargo.arg("--config").arg(fixes);
        }
        cargo.env("CARGO_TARGET_DIR", binaries::target_folder());
        let built = cargo.output().expect("cargo runs");
        assert!(built.status.success(), "building the template:\n{}", String::from_utf8_lossy(&built.stderr));
        (folder, binaries::target_folder().join("release/zigzag"))
    });
    program
}

fn command(words: &[&str]) -> String {
    format!("agents.command={words:?}")
}

/// The controllers that the agents of a recording have joined with, by id.
fn controllers(recording: &Path, agents: u32) -> Vec<String> {
    let recording = Recording::read(recording);
    let of = |agent| recording.of::<Join>(&format!("/agent_{}/join", AgentId(agent)))[0].controller.clone();
    (0..agents).map(of).collect()
}

const CAVE: [&str; 6] = ["--size", "24", "--duration", "20", "--set", "stop_when_explored=false"];

fn verified(site: &Site, recording: &Path, flags: &[&str]) -> Ended {
    site.start(site.binary("maes").arg("verify").arg(recording).args(flags)).ended()
}

#[test]
fn own_controller_runs_alone_and_beside_a_built_in_one() {
    let program = text(own_controller());
    let site = Site::new();
    let all = command(&[program]);
    let run = |order: &str| {
        let own = ["--agents", "2", "--controller", "zigzag", "--agent-set", "turn_rad=2.5", "--order", order];
        site.record(&[&own[..], &["--set", &all], &CAVE].concat())
    };
    let first = run("forward");
    first.assert_same(&run("reverse"), "in another order of start");
    let own = ["--agents", "2", "--controller", "zigzag", "--agent-set", "turn_rad=2.5", "--transport", "memory"];
    first.assert_same(&site.record(&[&own[..], &["--set", &all], &CAVE].concat()), "over memory");
    let recording = site.file("own.mcap", &first.bytes);
    assert_eq!(controllers(&recording, 2), ["zigzag turn_rad=2.5"; 2]);
    let result = Recording::from_bytes(&first.bytes).result();
    assert!(result.distance_m.iter().all(|&distance_m| distance_m > 5.0), "{:?}", result.distance_m);

    let ended = verified(&site, &recording, &[]).with_code(0);
    let said = format!("not checked: agent 1: agents.command = [{program:?}] has decided, as \"zigzag turn_rad=2.5\"");
    assert!(ended.stdout.contains("of 0 agents") && ended.stdout.contains(&said), "{ended}");
    let strict = verified(&site, &recording, &["--controllers"]).with_code(1);
    assert!(strict.stderr.contains("--controllers: agent 0 cannot be checked: agents.command"), "{strict}");
    // What a recording names is not started unless it is repeated.
    let mut again = site.run_sh(&[text(&recording)]);
    let refused = site.start(&mut again).ended().with_code(2);
    assert!(refused.stderr.contains("if you trust it, repeat it: --set 'agents.command="), "{refused}");
    site.record(&[text(&recording), "--set", &all]).assert_same(&first, "from its recording");

    let one = command(&[program, "--controller", "zigzag"]);
    let mixed = ["--agents", "2", "--controller", "rbw", "--set", &one, "--set", "agents.command_ids=[1]"];
    let mixed = site.record(&[&mixed[..], &CAVE].concat());
    let recording = site.file("mixed.mcap", &mixed.bytes);
    assert_eq!(controllers(&recording, 2), ["rbw", "zigzag"]);
    let ended = verified(&site, &recording, &[]).with_code(0);
    let words = " of 1 agent are those that the controllers decide\nnot checked: agent 1: agents.command";
    assert!(ended.stdout.contains(words), "{ended}");
}

#[test]
fn settings_and_transports_are_checked_before_anything_runs() {
    let program = text(own_controller());
    let site = Site::new();
    let own = command(&[program]);
    for (flags, expected) in [
        (
            &["--controller", "zigzag", "--agent-set", "turn_rad=9"][..],
            "controller zigzag: setting turn_rad = 9: expected a number from 0.1 to 3",
        ),
        (&["--controller", "zigzag", "--agent-set", "turn=1"], "setting `turn`: unknown; known are turn_rad"),
        (&["--controller", "zigzig"], "; did you mean `zigzag`?"),
    ] {
        let recording = site.path("refused.mcap");
        let arguments = [flags, &["--set", &own, "--record", text(&recording)]].concat();
        let refused = site.start(&mut site.run_sh(&arguments)).ended().with_code(2);
        assert!(refused.stderr.contains(expected) && refused.stderr.contains("agents.command"), "{refused}");
        assert_eq!(refused.stderr.trim_end().lines().count(), 1, "{refused}");
        assert!(!recording.exists());
    }
    let none = command(&["./none"]);
    let refused = site.start(&mut site.run_sh(&["--set", &none])).ended().with_code(2);
    assert!(refused.stderr.contains("/none: no such file; expected an executable file"), "{refused}");
    let listed = site.start(site.command(program).arg("--controllers")).ended().with_code(0);
    assert!(listed.stdout.contains("zigzag: zigzag: straight on"), "{listed}");
    assert!(listed.stdout.contains("\n  turn_rad = 2: expected a number from 0.1 to 3"), "{listed}");
}

/// The lines of `runs.csv` up to the digest: what follows is wall time.
fn rows(folder: &Path) -> Vec<String> {
    let table = fs::read_to_string(folder.join("runs.csv")).expect("there is a table");
    let is_digest =
        |cell: &str| cell == "digest" || (cell.len() == 64 && cell.bytes().all(|byte| byte.is_ascii_hexdigit()));
    let deterministic = |line: &str| {
        let cells: Vec<&str> = line.split(',').collect();
        let digest = cells.iter().position(|cell| is_digest(cell)).expect("every line has a digest");
        cells[..=digest].join(",")
    };
    table.lines().map(deterministic).collect()
}

#[test]
#[ignore = "takes minutes"]
fn plan_compares_programs_with_a_built_in_controller() {
    python::prepare_ros();
    let site = Site::new();
    fs::create_dir_all(site.path("mine/bin")).expect("a folder");
    fs::copy(own_controller(), site.path("mine/bin/own")).expect("a copy");
    for name in ["agent.py", "cmd_vel_agent.py"] {
        fs::copy(root().join("examples/python").join(name), site.path("mine").join(name)).expect("a copy");
    }
    let python = |script: &str| {
        let [flag, body, name] = python::in_ros();
        format!("{:?}", ["bash", &flag, &body, &name, "python3", script, "{id}"])
    };
    let plan = format!(
        "seeds = [1, 2]\n[axes]\nagents = [\n{{ count = 2, controller = \"rbw\" }},\n\
         {{ count = 2, controller = \"zigzag\", command = [\"bin/own\"] }},\n\
         {{ count = 2, command = {}, command_ids = [1], command_signs = false }},\n\
         {{ count = 2, command = {}, command_ids = [0], cmd_vel = [0] }},\n]\n\
         [scenario]\nduration_s = 10.0\nstop_when_explored = false\nmap = {{ kind = \"spheres\", size = 24 }}\n\
         agents = {{ count = 2 }}\nexecution = {{ join_timeout_s = 600.0, decision_timeout_s = 120.0 }}\n",
        python("agent.py"),
        python("cmd_vel_agent.py")
    );
    let plan = site.file("mine/plan.toml", plan);
    let batch = |plan: &Path, out: &str, flags: &[&str]| {
        let mut batch = site.binary("maes");
        batch.arg("batch").arg(plan).args(["--out", out]).args(flags).env("PYTHONDONTWRITEBYTECODE", "1");
        site.start(&mut batch).ended()
    };
    let refused = batch(&plan, "out", &[]).with_code(2);
    assert!(
        refused.stderr.contains("agents.command = ") && refused.stderr.contains("use --transport ros2"),
        "{refused}"
    );
    assert!(!site.path("out").exists());

    let domain = site.domain().id().to_string();
    let ros = ["--transport", "ros2", "--first-domain", &domain];
    batch(&plan, "out", &ros).with_code(0);
    let first = rows(&site.path("out"));
    assert_eq!(first.len(), 1 + 8);
    assert_eq!(first.iter().filter(|row| row.contains(",zigzag,")).count(), 2);
    // The folder of the results is all that is needed.
    fs::rename(site.path("out"), site.path("moved")).expect("a folder can be moved");
    fs::remove_dir_all(site.path("mine")).expect("a folder can be removed");
    batch(&site.path("moved/plan.toml"), "again", &ros).with_code(0);
    assert_eq!(rows(&site.path("again")), first);
}
