//! Runs with radios, relays and sensors that err are as repeatable as all others, and their recordings hold.

use msgs::maes_msgs::Progress;

use crate::support::processes::Process;
use crate::support::recordings::Recording;
use crate::support::runs::{Outcome, Site, scenario, text};

/// Flags that make runs short.
const SHORT: [&str; 4] = ["--size", "30", "--duration", "60"];

/// Runs a scenario over memory, with a recording.
#[track_caller]
fn record(site: &Site, name: &str, flags: &[&str]) -> Outcome {
    let file = scenario(name);
    let mut single = site.binary("maes");
    single.args(["run", "--transport", "memory", text(&file)]).args(flags);
    site.record_with(&mut single)
}

/// Flags by which sensors err.
const ERRING: [&str; 8] = [
    "--set",
    "sensor.range_sigma_m=0.2",
    "--set",
    "sensor.missed_returns=0.1",
    "--set",
    "sensor.pose_bound_m=0.3",
    "--agents",
    "3",
];

#[test]
fn the_same_scenario_gives_the_same_bytes_and_they_hold() {
    let site = Site::new();
    for (name, flags) in [("attenuated.toml", &[][..]), ("relays.toml", &[]), ("default.toml", &ERRING)] {
        let flags = [&SHORT[..], flags].concat();
        let run = record(&site, name, &flags);
        record(&site, name, &flags).assert_same(&run, name);
        for change in [["--threads", "1"], ["--look-ahead", "false"]] {
            let changed = [&flags[..], &change].concat();
            record(&site, name, &changed).assert_same(&run, &format!("{name} {change:?}"));
        }
        let file = site.file("run.mcap", &run.bytes);
        let verified = Process::start(site.binary("maes").args(["verify", text(&file), "--controllers"])).ended();
        assert_eq!(verified.with_code(0).digest(), run.digest(), "{name}");
    }
}

/// What the agents have on their maps, all together and added up over the run, in shares of the free cells.
fn shared(run: &Outcome) -> f64 {
    let progress: Vec<Progress> = Recording::from_bytes(&run.bytes).of("/sim/progress");
    progress.iter().flat_map(|progress| &progress.believed_by).sum()
}

#[test]
fn relays_make_agents_know_more_of_what_the_others_have_seen() {
    let site = Site::new();
    let flags = ["--duration", "240", "--set", "stop_when_explored=false"];
    let with = record(&site, "relays.toml", &flags);
    let without = record(&site, "relays.toml", &[&flags[..], &["--set", "agents.set.relays=\"off\""]].concat());
    assert!(shared(&with) > shared(&without), "{} with relays, {} without", shared(&with), shared(&without));
}
