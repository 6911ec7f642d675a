//! Limits of a process: a start that stalls is begun again, a shutdown that hangs and memory beyond
//! its limit end the process.

use crate::support::processes::signal;
use crate::support::runs::{Run, Site, text};

const SCENARIO: &str = "seed = 5\nduration_s = 20\nstop_when_explored = false\n\
                        [map]\nkind = \"spheres\"\nsize = 20\n[agents]\ncount = 2\n";

fn agent(site: &Site, id: &str, flags: &[&str], limits: &[(&str, &str)]) -> Run {
    let mut command = site.binary("agent_node");
    site.start(command.args(["--id", id]).args(flags).envs(limits.iter().copied()))
}

fn server(site: &Site, flags: &[&str], limits: &[(&str, &str)]) -> Run {
    let scenario = site.file("limits.toml", SCENARIO);
    let mut command = site.binary("sim_server");
    site.start(command.arg("run").arg(scenario).args(flags).envs(limits.iter().copied()))
}

/// A stalled start stands for the start deadlock of the middleware.
#[test]
fn a_stalled_start_is_begun_again_and_the_run_is_the_same() {
    let site = Site::new();
    let file = site.path("stalled.mcap");
    let scenario = site.file("limits.toml", SCENARIO);
    let mut script = site.command("bash");
    // Slots are few: the processes of one run share that of the server. Only the process that
    // stalls has the short limit, which a busy machine could make the others exceed.
    script.args([
        "-c",
        "MAES_START_LIMIT_S=1 agent_node --id 0 --stalled-starts 2 2>stalled.log & stalled=$!
         agent_node --id 1 & other=$!
         sim_server \"$@\" && wait $stalled && wait $other",
        "bash",
    ]);
    let summary = site.path("summary.json");
    script.args(["run", text(&scenario), "--record", text(&file), "--summary", text(&summary)]);
    let path = format!("{}:{}", crate::support::binaries::folder().display(), std::env::var("PATH").unwrap());
    let ended = site.start(script.env("PATH", path)).ended().with_code(0);
    let reported = "the process of agent 0 has stalled at its start, and began again (";
    let again = ended.stderr.split_once(reported).and_then(|(_, rest)| rest.split_once("x)"));
    let again: u32 = again.and_then(|(again, _)| again.parse().ok()).unwrap_or_else(|| panic!("{ended}"));
    assert!(again >= 2, "{ended}");
    let summary = system::summary::Summary::read(&summary).expect("there is a summary");
    assert_eq!(summary.restarted_processes, 1);
    let said = std::fs::read_to_string(site.path("stalled.log")).unwrap();
    assert!(said.contains("start 2 of 5") && said.contains("start 3 of 5"), "{said}");
    let undisturbed = site.record_with(site.command(crate::support::binaries::folder().join("maes")).args([
        "run",
        text(&scenario),
        "--transport",
        "memory",
    ]));
    assert!(std::fs::read(&file).unwrap() == undisturbed.bytes, "the same recording, byte for byte");
}

#[test]
fn starts_that_stall_again_and_again_end_the_process() {
    let site = Site::new();
    let stalled = agent(&site, "0", &["--stalled-starts", "99"], &[("MAES_START_LIMIT_S", "1"), ("MAES_START", "5")]);
    let ended = stalled.ended().with_code(1);
    assert!(ended.stderr.contains("for the 5th time"), "{ended}");
}

#[test]
fn a_process_that_does_not_end_when_told_to_is_ended() {
    let site = Site::new();
    let mut stalled = agent(&site, "0", &["--stalled-starts", "1"], &[("MAES_SHUTDOWN_LIMIT_S", "1")]);
    stalled.process().handles("TERM");
    signal(stalled.process().pid(), "TERM");
    let ended = stalled.ended().with_code(1);
    assert!(ended.stderr.contains("MAES_SHUTDOWN_LIMIT_S"), "{ended}");
}

#[test]
fn memory_beyond_its_limit_ends_a_process() {
    let site = Site::new();
    let limits = [("MAES_MEMORY_LIMIT_MB", "1")];
    for run in [server(&site, &[], &limits), agent(&site, "0", &[], &limits)] {
        let ended = run.ended().with_code(1);
        assert!(ended.stderr.contains("its limit is 1 MB (MAES_MEMORY_LIMIT_MB)"), "{ended}");
    }
}

#[test]
fn limits_that_are_no_numbers_are_refused() {
    let site = Site::new();
    for (variable, run) in [
        ("MAES_START_LIMIT_S", agent(&site, "0", &[], &[("MAES_START_LIMIT_S", "soon")])),
        ("MAES_MEMORY_LIMIT_MB", server(&site, &[], &[("MAES_MEMORY_LIMIT_MB", "-1")])),
    ] {
        let ended = run.ended();
        assert!(ended.code != Some(0) && ended.stderr.contains(variable), "{ended}");
        assert!(ended.stderr.contains("a whole number from 1"), "{ended}");
    }
}

/// A limit below what a map of 200^3 cells takes, and above what the program takes.
#[cfg(target_os = "linux")]
#[test]
fn memory_that_the_system_refuses_ends_a_command_in_order() {
    let site = Site::new();
    let map = text(&site.path("large.m3dm")).to_owned();
    let mut generate = site.binary("maes");
    site.start(generate.args(["map", "generate", "--size", "200", "--seed", "1", "-o", &map])).ended().with_code(0);
    let maes = crate::support::binaries::folder().join("maes");
    let mut limited = site.command("bash");
    limited.args(["-c", "ulimit -v 90000; exec \"$@\"", "bash", text(&maes)]);
    let ended = site.start(limited.args(["map", "check", &map, "--agents", "5"])).ended().with_code(1);
    assert!(ended.stderr.contains("error: out of memory: the system refuses "), "{ended}");
}

/// What cannot be printed is a failure of the system, not of the user.
#[cfg(target_os = "linux")]
#[test]
fn full_disk_behind_stdout_is_a_failure() {
    let site = Site::new();
    let map = text(&site.path("small.m3dm")).to_owned();
    let mut generate = site.binary("maes");
    site.start(generate.args(["map", "generate", "--size", "20", "--seed", "1", "-o", &map])).ended().with_code(0);
    let programs = crate::support::binaries::folder();
    for (program, arguments) in [
        ("maes", &["map", "info", &map][..]),
        ("maes", &["map", "check", &map]),
        ("maes", &["--help"]),
        ("maes", &["agent_node", "--controllers"]),
        ("agent_node", &["--controllers"]),
    ] {
        let mut full = site.command("bash");
        full.args(["-c", "exec \"$@\" >/dev/full", "bash", text(&programs.join(program))]).args(arguments);
        let ended = site.start(&mut full).ended().with_code(1);
        assert!(ended.stderr.contains("error: stdout: No space left on device"), "{program} {arguments:?}: {ended}");
    }
}
