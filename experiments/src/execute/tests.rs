use std::path::Path;

use super::*;
use crate::merge::{MergeError, is_same_run, merge};
use crate::store::PLAN;

const PLAN_TEXT: &str = "seeds = \"1..3\"\n[axes]\n\"agents.controller\" = [\"rbw\", \"nearest-frontier\"]\n\
                         [scenario]\nduration_s = 25.0\n[scenario.map]\nkind = \"spheres\"\nsize = 24\n\
                         [scenario.agents]\ncount = 2\n[scenario.lidar]\nrange_m = 3.0\n";

fn plan() -> Plan {
    Plan::parse("p.toml", PLAN_TEXT, Path::new(".")).unwrap()
}

fn options(part: Part) -> Options {
    Options { jobs: NonZero::new(2).unwrap(), transport: Transport::Memory, part, prune: false }
}

fn run_part(folder: &Path, part: Part) -> Summary {
    execute(&plan(), folder.to_owned(), &options(part), &mut (), &Stop::default()).unwrap()
}

fn records(folder: &Path) -> Vec<RunRecord> {
    Store::open(folder).unwrap().records().unwrap()
}

fn are_same(one: &Path, other: &Path) -> bool {
    let (one, other) = (records(one), records(other));
    one.len() == other.len() && one.iter().zip(&other).all(|(one, other)| is_same_run(one, other))
}

#[test]
fn rows_are_reproducible_and_an_interrupted_plan_resumes_to_them() {
    let site = tempfile::tempdir().unwrap();
    let [whole, repeated, cut] = ["whole", "repeated", "cut"].map(|name| site.path().join(name));
    let done = Summary { done: 6, ..Summary::default() };
    assert_eq!(run_part(&whole, Part::WHOLE), done);
    assert_eq!(run_part(&repeated, Part::WHOLE), done);
    assert!(are_same(&whole, &repeated));
    // Two runs have a record, and writing a third one was interrupted.
    let store = Store::create(&cut).unwrap();
    for record in &records(&whole)[..2] {
        store.save(record).unwrap();
    }
    std::fs::write(cut.join("runs/.half.part"), "{").unwrap();
    assert_eq!(run_part(&cut, Part::WHOLE), Summary { done: 4, skipped: 2, ..Summary::default() });
    assert!(are_same(&whole, &cut));
    for name in ["series.csv", "agents.csv"] {
        let table = |folder: &Path| std::fs::read(folder.join(name)).unwrap();
        assert_eq!(table(&whole), table(&cut), "{name}");
    }
    let series = records(&whole).remove(0).series;
    assert!(series.windows(2).all(|pair| pair[0].t_s < pair[1].t_s && pair[0].explored <= pair[1].explored));
}

#[test]
fn stop_leaves_pending_runs() {
    let site = tempfile::tempdir().unwrap();
    let stop = Stop { soon: AtomicBool::new(true), at_once: AtomicBool::new(false) };
    let summary = execute(&plan(), site.path().to_owned(), &options(Part::WHOLE), &mut (), &stop).unwrap();
    assert_eq!(summary, Summary { left: 6, ..Summary::default() });
    let run = &plan().runs[0];
    let abandoned = memory::carry_out(run, &AtomicBool::new(true));
    assert!(matches!(abandoned, Err(RunFailure::Interrupted)));
}

#[test]
fn merged_parts_are_the_whole_and_contradictions_are_refused() {
    let site = tempfile::tempdir().unwrap();
    let [whole, first, second, joined] = ["whole", "first", "second", "joined"].map(|name| site.path().join(name));
    run_part(&whole, Part::WHOLE);
    let parts = NonZero::new(2).unwrap();
    run_part(&first, Part { index: 0, parts });
    run_part(&second, Part { index: 1, parts });
    assert_eq!(merge(&[first.clone(), second.clone()], &joined).unwrap(), 6);
    assert!(are_same(&whole, &joined));
    let mut altered = records(&second).remove(0);
    altered.row.explored *= 0.5;
    Store::open(&second).unwrap().save(&altered).unwrap();
    let refused = merge(&[joined.clone(), second], &site.path().join("other")).unwrap_err();
    assert!(matches!(refused, MergeError::OtherOutcome { .. }), "{refused}");
    std::fs::write(first.join(PLAN), "another").unwrap();
    assert!(matches!(merge(&[joined, first], &site.path().join("third")), Err(MergeError::OtherPlan { .. })));
}

#[test]
fn runs_of_another_plan_are_refused_or_pruned() {
    let site = tempfile::tempdir().unwrap();
    let small = Plan { runs: plan().runs.split_off(5), ..plan() };
    let begin = |plan: &Plan, prune: bool| {
        let options = Options { prune, ..options(Part::WHOLE) };
        execute(plan, site.path().to_owned(), &options, &mut (), &Stop::default())
    };
    begin(&plan(), false).unwrap();
    assert!(matches!(begin(&small, false), Err(ExecuteError::OtherRuns { count: 5, .. })));
    assert_eq!(begin(&small, true).unwrap(), Summary { skipped: 1, ..Summary::default() });
    assert_eq!(records(site.path()).len(), 1);
}
