//! Every controller in complete runs: deterministic, on every kind of map, without a refused
//! command.

use std::process::Command;

use agent_node::controllers::NAMES;

use crate::support::recordings::{Recording, counter, refusals};
use crate::support::root;
use crate::support::runs::{Outcome, Site, scenario, text};

/// A team with contacts, shared maps and collisions, in a cave too large for the duration.
const TEAM: [&str; 8] = ["--agents", "4", "--size", "45", "--seed", "3", "--duration", "60"];

fn in_memory(site: &Site, arguments: &[&str]) -> Command {
    let mut command = site.binary("maes");
    command.args(["run", "--transport", "memory"]).arg(scenario("default.toml")).args(TEAM).args(arguments);
    command
}

#[track_caller]
fn assert_sound(outcome: &Outcome, what: &str) {
    let result = Recording::from_bytes(&outcome.bytes).result();
    assert!(refusals(&result).is_empty(), "{what}: {:?}", refusals(&result));
    assert!(result.explored > 0.05, "{what}: {result:?}");
    let by_kind = result.counters.iter().filter(|one| one.name.starts_with("message_bytes_delivered_kind_"));
    assert_eq!(by_kind.map(|one| one.value).sum::<u64>(), counter(&result, "message_bytes_delivered"), "{what}");
}

#[track_caller]
fn assert_deterministic(flags: &[&str]) {
    let site = Site::new();
    let first = site.record_with(&mut in_memory(&site, flags));
    assert_sound(&first, &flags.join(" "));
    for variant in [&["--together", "--threads", "8"][..], &["--look-ahead", "false"], &["--chaos-delay-ms", "3"]] {
        let again = site.record_with(in_memory(&site, flags).args(variant));
        again.assert_same(&first, &format!("{} {}", flags.join(" "), variant.join(" ")));
    }
    let over_ros = site.record(&[&TEAM[..], flags, &["--order", "shuffle"]].concat());
    over_ros.assert_same(&first, &format!("{} over ROS 2", flags.join(" ")));
}

#[test]
fn every_controller_is_deterministic() {
    for name in NAMES {
        assert_deterministic(&["--controller", name]);
    }
}

#[test]
fn search_time_is_deterministic() {
    for time in ["budgeted", "background"] {
        let setting = format!("agents.set.search_time={time}");
        assert_deterministic(&["--controller", "nearest-frontier", "--set", &setting]);
    }
}

#[test]
fn every_controller_explores_every_kind_of_map() {
    let site = Site::new();
    let imported = site.path("cave.m3dm");
    let generate = ["map", "generate", "--size", "40", "--seed", "5", "-o", text(&imported)];
    let made = site.binary("maes").args(generate).status().expect("the server is there");
    assert!(made.success());
    let run = |name: &str, map: &[&str]| {
        let mut command = site.binary("maes");
        command.args(["run", "--transport", "memory"]).arg(scenario("default.toml"));
        command.args(["--controller", name, "--agents", "3", "--duration", "60"]).args(map);
        site.record_with(&mut command)
    };
    for name in NAMES {
        for map in [
            &["--map", "spheres", "--size", "40"][..],
            &["--map", "noise", "--size", "40"],
            &["--map", text(&imported)],
        ] {
            assert_sound(&run(name, map), &format!("{name} {}", map.join(" ")));
        }
    }
}

#[test]
fn scans_near_frontiers_only_see_everything_with_fewer_scans() {
    let site = Site::new();
    let scans = |(start_m, stop_m): (u32, u32)| {
        let mut command = site.binary("maes");
        command.args(["run", "--transport", "memory"]).arg(scenario("default.toml"));
        command.args(["--agents", "4", "--size", "50", "--seed", "2", "--duration", "1800"]);
        command.args(["--controller", "dsvp-team", "--set", &format!("agents.set.scan_start_m={start_m}")]);
        command.args(["--set", &format!("agents.set.scan_stop_m={stop_m}")]);
        let result = Recording::from_bytes(&site.record_with(&mut command).bytes).result();
        assert!(refusals(&result).is_empty(), "{:?}", refusals(&result));
        assert_eq!(result.explored, 1.0, "from {start_m} m on, up to {stop_m} m");
        counter(&result, "scans")
    };
    let [always, default, near] = [(0, 12), (1, 12), (3, 3)].map(scans);
    assert!(2 * near < always, "{near} of {always} scans");
    assert!(4 * default < 3 * always, "{default} of {always} scans");
}

/// The figures are in docs/benchmarks.md.
#[test]
fn planners_explore_faster_than_random_walk() {
    let site = Site::new();
    let t99 = |name: &str| {
        let mut command = site.binary("maes");
        command.args(["run", "--transport", "memory"]).arg(scenario("default.toml"));
        command.args(["--controller", name, "--agents", "5", "--size", "50", "--seed", "2", "--duration", "1800"]);
        let outcome = site.record_with(&mut command);
        let result = Recording::from_bytes(&outcome.bytes).result();
        counter(&result, "tick_explored_permille_990")
    };
    let [walk, voronoi, viewpoints, auction] = ["rbw", "lvd", "dsvp", "dsvp-auction"].map(t99);
    assert!(viewpoints < walk && voronoi < walk && auction < walk, "{walk} {voronoi} {viewpoints} {auction}");
}

/// docs/controllers.md lists every controller.
#[test]
fn every_controller_is_documented() {
    let page = std::fs::read_to_string(root().join("docs/controllers.md")).expect("there is such a page");
    for name in NAMES {
        assert!(page.contains(&format!("| `{name}` |")), "{name}");
    }
}
