//! Commands that are part of `maes` now: the old names print the new ones on stderr, and print and
//! return what they did.

use crate::support::processes::{Ended, Process};
use crate::support::runs::{Site, scenario, text};

fn ended(site: &Site, program: &str, arguments: &[&str]) -> Ended {
    Process::start(site.binary(program).args(arguments)).ended()
}

/// Fails unless the old command does what the new one does, and prints its name first.
#[track_caller]
fn assert_renamed(site: &Site, old: (&str, &[&str]), new: &[&str], renamed: &str) -> Ended {
    let (before, now) = (ended(site, old.0, old.1), ended(site, "maes", new));
    let mut lines = before.stderr.lines();
    assert_eq!(lines.next(), Some(renamed), "{before}");
    assert_eq!(lines.collect::<Vec<_>>(), now.stderr.lines().collect::<Vec<_>>(), "{renamed}");
    assert_eq!((before.code, &before.stdout), (now.code, &now.stdout), "{renamed}");
    now
}

#[test]
fn old_commands_of_the_server_become_maes() {
    let site = Site::new();
    let scenario = scenario("default.toml");
    let short = ["--agents", "1", "--size", "20", "--duration", "2", "--transport", "memory"];
    let recorded = ended(&site, "maes", &[&["run", text(&scenario)][..], &short, &["--record", "a.mcap"]].concat());
    recorded.with_code(0);
    for (command, arguments, code) in [
        ("info", &["a.mcap"][..], 0),
        ("verify", &["a.mcap", "--controllers"], 0),
        ("scenario", &[text(&scenario), "--agents", "7", "--get", "agents.count"], 0),
        ("map", &["generate", "--size", "20", "--seed", "1", "-o", "a.m3dm"], 0),
        ("replay", &["none.mcap"], 2),
        ("snapshot", &["none.mcap", "--at", "1", "--out", "a.png"], 2),
        ("view", &["none.mcap"], 2),
    ] {
        let arguments = [&[command], arguments].concat();
        let renamed = format!("note: `sim_server {command}` is now `maes {command}`");
        let now = assert_renamed(&site, ("sim_server", &arguments), &arguments, &renamed);
        assert_eq!(now.code, Some(code), "{now}");
    }
}

#[test]
fn experiments_becomes_maes() {
    let site = Site::new();
    let scenario = scenario("default.toml");
    let folder = |name: &str| site.path(name).display().to_string();
    let plan = site.file(
        "plan.toml",
        "seeds = \"1..1\"\n[scenario]\nduration_s = 2.0\nmap = { kind = \"spheres\", size = 20 }\n\
         agents = { count = 1, controller = \"rbw\" }\n",
    );
    let short = ["--agents", "1", "--size", "20", "--duration", "2", "--record", "a.mcap"];
    let single = ended(&site, "experiments", &[&["single", text(&scenario)][..], &short].concat()).with_code(0);
    let note = "note: `experiments single` is now `maes run --transport memory`";
    assert_eq!(single.stderr.lines().next(), Some(note), "{single}");
    let over_memory = [&["run", "--transport", "memory", text(&scenario)][..], &short].concat();
    assert_eq!(ended(&site, "maes", &over_memory).with_code(0).digest(), single.digest());

    let batch = ended(&site, "experiments", &["run", text(&plan), "--out", "runs"]).with_code(0);
    let note = "note: `experiments run` is now `maes batch`";
    assert_eq!(batch.stderr.lines().next(), Some(note), "{batch}");
    assert!(std::path::Path::new(&folder("runs")).join("runs.csv").is_file());
    for (command, arguments, code) in [
        ("diff", &["a.mcap", "a.mcap"][..], 0),
        ("merge", &["runs", "--out", "all"], 0),
        ("report", &["none"], 2),
        ("movie", &["none.mcap", "--out", "a.gif"], 2),
        ("faults", &["--seeds", "2", "--list"], 0),
    ] {
        let arguments = [&[command], arguments].concat();
        let renamed = format!("note: `experiments {command}` is now `maes {command}`");
        let now = assert_renamed(&site, ("experiments", &arguments), &arguments, &renamed);
        assert_eq!(now.code, Some(code), "{now}");
    }
}
