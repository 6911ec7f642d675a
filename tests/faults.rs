//! `maes faults`: runs that are disturbed are the undisturbed one, and the program can tell if they
//! are not.

use std::process::Command;

use fault_injection::plan::{At, Fault, Plan};

use crate::support::runs::{Site, text};

/// The first seed whose plan has at most two faults, one of them such a fault in the middle of the
/// run.
fn seed_with(fits: impl Fn(&Fault) -> bool) -> u64 {
    let has = |seed: &u64| {
        let Plan { faults, .. } = Plan::of_seed(*seed, 5, 60.0, 1000);
        let is_early = |at| matches!(at, At::Running(s) if (1.0..30.0).contains(&s));
        faults.len() <= 2 && faults.iter().any(|timed| is_early(timed.at) && fits(&timed.fault))
    };
    (1..).find(has).expect("all kinds of faults are drawn")
}

fn faults(site: &Site, flags: &[&str]) -> Command {
    let mut command = site.binary("maes");
    command.args(["faults", "--first-domain", &site.domain().id().to_string()]).args(flags);
    command
}

#[test]
fn disturbed_runs_equal_the_undisturbed_one() {
    let site = Site::new();
    for seed in [
        seed_with(|fault| matches!(fault, Fault::KillAgent { .. })),
        seed_with(|fault| matches!(fault, Fault::KillServer { .. })),
        seed_with(|fault| matches!(fault, Fault::Hang { for_ms: 1500.., .. })),
    ] {
        let ended = site.start(&mut faults(&site, &["--seed-only", &seed.to_string()])).ended().with_code(0);
        assert!(ended.stdout.contains(&format!("seed {seed}: ")), "{ended}");
        assert!(ended.stdout.contains(": same, "), "{ended}");
        assert!(ended.stdout.ends_with("1 seeds, 0 failures"), "{ended}");
    }
}

/// Shows that the test above can fail.
#[test]
fn different_run_fails_the_comparison() {
    let site = Site::new();
    let folder = site.path("other");
    site.start(&mut faults(&site, &["--seed", "8", "--seeds", "1", "--out", text(&folder)])).ended().with_code(0);
    let expected = folder.join("expected.mcap");
    let out = site.path("out");
    let flags = ["--seed-only", "1", "--expect", text(&expected), "--out", text(&out)];
    let ended = site.start(&mut faults(&site, &flags)).ended().with_code(1);
    assert!(ended.stdout.contains("FAILED: the digest is "), "{ended}");
    assert!(ended.stdout.contains("scenario.toml --seed-only 1"), "how to repeat it: {ended}");
    assert!(ended.stdout.ends_with("1 seeds, 1 failures"), "{ended}");
    assert!(out.join("seed-1/diary.log").is_file(), "the event log is kept");
}

#[test]
fn faults_require_waiting_for_lost_agents() {
    let site = Site::new();
    let ended = site.start(&mut faults(&site, &["--set", "faults.on_agent_loss=abort"])).ended().with_code(2);
    assert!(ended.stderr.contains("expected \"wait\""), "{ended}");
}
