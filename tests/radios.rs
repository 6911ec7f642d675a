//! Runs with radio models, relays and sensor noise are deterministic, and their recordings verify.

use msgs::maes_msgs::Progress;

use crate::support::processes::Process;
use crate::support::recordings::Recording;
use crate::support::runs::{Outcome, Site, scenario, text};

/// Flags for a short run.
const SHORT: [&str; 4] = ["--size", "30", "--duration", "60"];

/// Executes and records a scenario over the in-memory transport.
#[track_caller]
fn record(site: &Site, name: &str, flags: &[&str]) -> Outcome {
    let file = scenario(name);
    let mut single = site.binary("maes");
    single.args(["run", "--transport", "memory", text(&file)]).args(flags);
    site.record_with(&mut single)
}

/// Flags for sensor noise.
const NOISY: [&str; 8] = [
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
fn radio_relay_and_noise_runs_are_deterministic() {
    let site = Site::new();
    for (name, flags) in [("attenuated.toml", &[][..]), ("relays.toml", &[]), ("default.toml", &NOISY)] {
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

/// Known fraction of the free cells, summed over agents and progress reports.
fn shared(run: &Outcome) -> f64 {
    let progress: Vec<Progress> = Recording::from_bytes(&run.bytes).of("/sim/progress");
    progress.iter().flat_map(|progress| &progress.believed_by).sum()
}

#[test]
fn relays_spread_map_knowledge() {
    let site = Site::new();
    let flags = ["--duration", "240", "--set", "stop_when_explored=false"];
    let with = record(&site, "relays.toml", &flags);
    let without = record(&site, "relays.toml", &[&flags[..], &["--set", "agents.set.relays=\"off\""]].concat());
    assert!(shared(&with) > shared(&without), "{} with relays, {} without", shared(&with), shared(&without));
}
