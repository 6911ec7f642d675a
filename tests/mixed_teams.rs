//! Teams whose agents run different controllers: over memory and ROS 2, by hand, forked, verified,
//! and in plans.

use msgs::ids::AgentId;
use msgs::maes_msgs::Join;

use crate::support::processes::{Ended, Process};
use crate::support::root;
use crate::support::runs::{Site, text};

const CAVE: [&str; 8] = ["--agents", "4", "--size", "25", "--seed", "5", "--duration", "40"];

/// Agents 0 and 1 run `lvd` with a setting, the others `rbw`.
const MIX: &str = "agents.mix=[{ share = 0.5, controller = \"lvd\", set = { visit_radius_m = 5.0 } }]";

fn flags<'a>(more: &[&'a str]) -> Vec<&'a str> {
    [&CAVE[..], &["--set", "stop_when_explored=false", "--set", MIX], more].concat()
}

fn maes(site: &Site, args: &[&str]) -> Ended {
    Process::start(site.binary("maes").args(args)).ended()
}

/// The controllers that the agents of a recording have joined with, by id.
fn controllers(site: &Site, recording: &str) -> Vec<String> {
    let recording = site.recording(recording);
    let of = |agent| recording.of::<Join>(&format!("/agent_{}/join", AgentId(agent)))[0].controller.clone();
    (0..4).map(of).collect()
}

#[test]
fn mixed_team_is_the_same_everywhere_and_verifies() {
    let site = Site::new();
    let over_memory = site.record(&flags(&["--transport", "memory"]));
    for more in [
        &["--transport", "memory", "--together"][..],
        &["--transport", "memory", "--look-ahead", "false", "--threads", "4"],
        &["--order", "shuffle"],
        &["--agents-per-process", "3"],
    ] {
        site.record(&flags(more)).assert_same(&over_memory, &more.join(" "));
    }
    let mut script = site.command(root().join("launch_scripts/spawn.sh"));
    // The script counts the agents itself.
    let by_hand = flags(&[]);
    site.record_with(script.arg("4").args(&by_hand[2..])).assert_same(&over_memory, "spawned by hand");

    site.file("run.mcap", &over_memory.bytes);
    assert_eq!(controllers(&site, "run.mcap"), ["lvd visit_radius_m=5.0", "lvd visit_radius_m=5.0", "rbw", "rbw"]);
    let verified = maes(&site, &["verify", "run.mcap", "--controllers"]).with_code(0);
    assert!(verified.stdout.contains("of 4 agents"), "{verified}");
    let uniform = site.record(&["--controller", "rbw", "--transport", "memory", "--agents", "4", "--size", "25"]);
    assert_ne!(uniform.digest(), over_memory.digest());
}

/// The bytes of a fork of `parent.mcap`.
fn fork(site: &Site, name: &str, change: &[&str]) -> Vec<u8> {
    let file = site.path(name);
    let of_fork = ["run", "--fork", "parent.mcap", "--at", "20", "--record", text(&file)];
    maes(site, &[&of_fork[..], change].concat()).with_code(0);
    std::fs::read(file).expect("there is a recording")
}

/// Agents get requests again while the commands of the parent are replayed to them, and answer some
/// of them twice.
#[test]
fn late_answers_do_not_change_a_fork() {
    let site = Site::new();
    site.file("parent.mcap", &site.record(&flags(&["--transport", "memory"])).bytes);
    let change = ["--transport", "memory", "--set", "agents.mix=[]"];
    let prompt = fork(&site, "prompt.mcap", &change);
    let late = fork(&site, "late.mcap", &[&change[..], &["--chaos-delay-ms", "150"]].concat());
    assert!(late == prompt, "late answers change the fork");
}

#[test]
fn forks_change_the_mix_and_the_others() {
    let site = Site::new();
    let parent = site.record(&flags(&["--transport", "memory"]));
    site.file("parent.mcap", &parent.bytes);
    let fork = |name: &str, change: &[&str]| fork(&site, name, change);
    assert!(fork("same.mcap", &["--transport", "memory"]) == parent.bytes, "a fork without a change differs");
    let all_walk = ["--set", "agents.mix=[]"];
    let others_plan = ["--controller", "nearest-frontier"];
    for change in [all_walk, others_plan] {
        let in_memory = fork("memory.mcap", &[&["--transport", "memory"][..], &change].concat());
        let over_ros = fork("ros.mcap", &change);
        assert!(in_memory == over_ros, "{change:?}: memory and ROS 2 differ");
        assert!(in_memory != parent.bytes, "{change:?} changes nothing");
        maes(&site, &["verify", "memory.mcap", "--controllers"]).with_code(0);
    }
}

#[test]
fn plans_compare_mixed_teams() {
    let site = Site::new();
    let plan = "seeds = [1, 2]\n[scenario]\nduration_s = 20.0\n[scenario.map]\nkind = \"spheres\"\nsize = 24\n\
                [scenario.agents]\ncount = 4\n\
                [[variant]]\nname = \"walkers\"\n\
                [[variant]]\nname = \"half\"\n[[variant.agents.mix]]\nshare = 0.5\ncontroller = \"lvd\"\n\
                [[variant]]\nname = \"a quarter\"\nagents.mix = [{ share = 0.25, controller = \"lvd\" }]\n";
    site.file("plan.toml", plan);
    maes(&site, &["batch", "plan.toml", "--out", "study", "--transport", "memory"]).with_code(0);
    let table = std::fs::read_to_string(site.path("study/runs.csv")).expect("a table");
    for controllers in ["50 % lvd, others rbw", "25 % lvd, others rbw"] {
        assert_eq!(table.lines().filter(|line| line.contains(controllers)).count(), 2, "{controllers}\n{table}");
    }
    assert_eq!(table.lines().count(), 7, "{table}");
    let wrong = plan.replace("share = 0.25, controller = \"lvd\"", "share = 0.25, controller = \"lvb\"");
    site.file("wrong.toml", wrong);
    let refused = maes(&site, &["batch", "wrong.toml", "--out", "none"]).with_code(2);
    assert!(refused.stderr.contains("agents.mix: controller lvb: unknown; known are"), "{refused}");
    assert!(refused.stderr.contains("did you mean `lvd`?"), "{refused}");
    assert!(!site.path("none").exists());
}

#[test]
fn unknown_controllers_of_a_mix_are_refused_before_anything_runs() {
    let site = Site::new();
    for transport in ["memory", "ros2"] {
        let mix = "agents.mix=[{ ids = [1], controller = \"lvd\", set = { visit = 1 } }]";
        let refused = maes(&site, &["run", "--agents", "2", "--transport", transport, "--set", mix]).with_code(2);
        assert!(refused.stderr.contains("controller lvd: setting `visit`: unknown"), "{refused}");
    }
}
