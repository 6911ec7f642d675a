use std::path::Path;

use super::*;
use crate::merge::{MergeError, is_same_run, merge};
use crate::plan::KnownControllers;
use crate::store::PLAN;

const PLAN_TEXT: &str = "seeds = \"1..3\"\n[axes]\n\"agents.controller\" = [\"rbw\", \"nearest-frontier\"]\n\
                         [scenario]\nduration_s = 25.0\n[scenario.map]\nkind = \"spheres\"\nsize = 24\n\
                         [scenario.agents]\ncount = 2\n[scenario.lidar]\nrange_m = 3.0\n";

fn plan() -> Plan {
    Plan::parse("p.toml", PLAN_TEXT, Path::new(".")).unwrap()
}

fn options(part: Part) -> Options {
    Options {
        jobs: NonZero::new(2).unwrap(),
        transport: Transport::Memory,
        part,
        registry: Registry::BUILT_IN,
        prune: false,
    }
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
fn rows_tell_stages_and_parts_of_the_redundancy() {
    let site = tempfile::tempdir().unwrap();
    let folder = site.path().join("stages");
    let text = PLAN_TEXT.replace("rbw", "dsvp");
    let plan = Plan::parse("p.toml", &text, Path::new(".")).unwrap();
    execute(&plan, folder.clone(), &options(Part::WHOLE), &mut (), &Stop::default()).unwrap();
    for RunRecord { row, .. } in records(&folder) {
        let [known, unknown] = [row.redundancy_known, row.redundancy_unknown].map(Option::unwrap);
        assert!((known + unknown - row.redundancy).abs() < 1e-9 || unknown == 0.0, "{known} {unknown}");
        assert!(known > 0.0, "two agents in one small cave meet");
        let stages = row.exploring_s + row.relocating_s + row.carrying_s + row.waiting_s;
        assert!(stages > 0.8 * row.end_s && stages <= 2.0 * row.end_s + 1e-9, "{stages} s of 2 times {} s", row.end_s);
    }
}

#[test]
fn stop_leaves_pending_runs() {
    let site = tempfile::tempdir().unwrap();
    let stop = Stop { soon: AtomicBool::new(true), at_once: AtomicBool::new(false) };
    let summary = execute(&plan(), site.path().to_owned(), &options(Part::WHOLE), &mut (), &stop).unwrap();
    assert_eq!(summary, Summary { left: 6, ..Summary::default() });
    let run = &plan().runs[0];
    let abandoned = memory::carry_out(run, None, Registry::BUILT_IN, &AtomicBool::new(true));
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
fn failed_runs_are_kept_and_merged() {
    let site = tempfile::tempdir().unwrap();
    let [folder, joined] = ["folder", "joined"].map(|name| site.path().join(name));
    let axes = "[axes]\nspawn = [{ kind = \"nearest_origin\" }, { kind = \"scattered\", min_distance_m = 100.0 }]\n";
    let text = PLAN_TEXT.replace("[axes]\n\"agents.controller\" = [\"rbw\", \"nearest-frontier\"]\n", axes);
    let plan = Plan::parse("p.toml", &text, Path::new(".")).unwrap();
    let go = || execute(&plan, folder.clone(), &options(Part::WHOLE), &mut (), &Stop::default()).unwrap();
    assert_eq!(go(), Summary { done: 3, failed: 3, ..Summary::default() });
    assert_eq!(go(), Summary { skipped: 3, failed: 3, ..Summary::default() });
    let failures = Store::open(&folder).unwrap().failures().unwrap();
    assert_eq!(failures.len(), 3);
    assert!(failures[0].reason.contains("of 2 bodies find room"), "{failures:?}");
    assert_eq!(merge(std::slice::from_ref(&folder), &joined).unwrap(), 3);
    assert_eq!(Store::open(&joined).unwrap().failures().unwrap().len(), 3);
    // One that succeeds later is no failure any more.
    let mut record = records(&folder).remove(0);
    record.row.id = failures[0].id.clone();
    let store = Store::open(&folder).unwrap();
    store.save(&record).unwrap();
    assert_eq!(store.failures().unwrap().len(), 2);
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
    let refused = begin(&small, false).unwrap_err();
    assert!(matches!(refused, ExecuteError::OtherRuns { count: 5, .. }));
    assert!(!refused.to_string().contains("--prune"), "not every command has the flag: {refused}");
    let file = site.path().join("plan.toml");
    let refused = execute(&small, file, &options(Part::WHOLE), &mut (), &Stop::default()).unwrap_err();
    assert!(matches!(refused, ExecuteError::Store(StoreError::NoFolder { .. })), "{refused}");
    assert_eq!(begin(&small, true).unwrap(), Summary { skipped: 1, ..Summary::default() });
    assert_eq!(records(site.path()).len(), 1);
}

#[test]
fn runs_without_a_version_are_replaced_by_the_part_that_has_them() {
    let folder = tempfile::tempdir().unwrap();
    run_part(folder.path(), Part::WHOLE);
    let versions = BTreeMap::from([("rbw".to_owned(), None)]);
    let known = KnownControllers { versions: &versions, ..KnownControllers::BUILT_IN };
    let plan = Plan::parse_with("p.toml", PLAN_TEXT, Path::new("."), known).unwrap();
    let part = Part { index: 1, parts: NonZero::new(3).unwrap() };
    let mine = part.of(&plan.runs);
    let replaced: BTreeSet<&String> = mine.iter().filter(|run| !run.is_versioned).map(|run| &run.id).collect();
    assert_eq!((mine.len(), replaced.len()), (2, 1), "one of each controller");
    let opened = open(&plan, folder.path(), &options(part)).unwrap();
    let missing = |run: &&PlannedRun| !opened.store.done().unwrap().contains(&run.id);
    assert_eq!(plan.runs.iter().filter(missing).map(|run| &run.id).collect::<BTreeSet<_>>(), replaced);
    assert!(replaced.iter().all(|id| !opened.store.has_scenario(id)));
    let selection = Selection::default();
    let summary = execute_in(&opened, &plan, &options(part), &selection, &mut (), &Stop::default()).unwrap();
    assert_eq!((summary.done, opened.store.done().unwrap().len()), (replaced.len(), 6));
}

#[test]
fn recordings_are_kept_and_runs_that_are_repeated_equal_their_records() {
    let site = tempfile::tempdir().unwrap();
    let folder = site.path().join("kept");
    assert_eq!(run_part(&folder, Part::WHOLE).done, 6);
    let store = Store::open(&folder).unwrap();
    let before = records(&folder);
    let selected = |only: &[&str], keep| {
        let selection = Selection { only: only.iter().map(|id| (*id).to_owned()).collect(), keep };
        let options = options(Part::WHOLE);
        execute_selected(&plan(), folder.clone(), &options, &selection, &mut (), &Stop::default())
    };
    let id = before[0].row.id.as_str();
    assert_eq!(selected(&[id], Keep::All).unwrap(), Summary { recorded: 1, ..Summary::default() });
    assert_eq!(selected(&[id], Keep::All).unwrap(), Summary { skipped: 1, ..Summary::default() });
    let info = sim_server::info::read(&store.recording_file(id)).unwrap();
    assert_eq!(simulation::digest::Digest(info.result.unwrap().digest).to_string(), before[0].row.digest);
    // Few of these short runs reach 99 %: the others are kept as failures.
    let late = before.iter().filter(|record| record.row.t99_s.is_none()).count();
    assert!(late > 0, "some run does not reach 99 %");
    selected(&[], Keep::Failures).unwrap();
    for record in &before {
        let is_kept = store.recording_file(&record.row.id).exists();
        assert_eq!(is_kept, record.row.id == id || record.row.t99_s.is_none(), "{}", record.row.id);
    }
    assert_eq!(records(&folder), before, "records are not replaced");
    let error = selected(&["0"], Keep::None).unwrap_err();
    assert!(error.to_string().contains("run 0: not of this plan"), "{error}");
    // A record that was changed is found.
    let mut changed = before[1].clone();
    changed.row.distance_m += 1.0;
    store.save(&changed).unwrap();
    std::fs::remove_file(store.recording_file(&changed.row.id)).ok();
    let error = selected(&[&changed.row.id], Keep::All).unwrap_err();
    assert!(matches!(error, ExecuteError::OtherOutcome { .. }), "{error}");
}

#[test]
fn runs_have_a_scenario_a_map_and_a_date() {
    let site = tempfile::tempdir().unwrap();
    run_part(site.path(), Part::WHOLE);
    let store = Store::open(site.path()).unwrap();
    let planned = plan();
    for run in store.stored_runs().unwrap() {
        let of_plan = planned.runs.iter().find(|planned| planned.id == run.row.id).unwrap();
        let text = store.scenario(&run.row.id).unwrap().unwrap();
        let scenario = simulation::scenario::Scenario::parse("run.toml", &text, &[]).unwrap();
        assert_eq!(scenario.identity(), of_plan.scenario.identity());
        assert_eq!(run.made.map.as_ref(), Some(&of_plan.map));
        assert_eq!(run.made.date.unwrap().len(), "2026-11-22".len());
    }
}

/// The folder that is published: what its report prints works there, wherever it is.
#[test]
fn a_merged_folder_has_all_that_its_runs_need() {
    let site = tempfile::tempdir().unwrap();
    let (wall, row) = ("#######\n", "#.....#\n");
    let [solid, hall] = [wall.repeat(7), format!("{wall}{}{wall}", row.repeat(5))];
    let map = [&solid, &hall, &hall, &hall, &solid].map(String::as_str).join("\n");
    for name in ["maps", "plans"] {
        std::fs::create_dir(site.path().join(name)).unwrap();
    }
    std::fs::write(site.path().join("maps/a.txt"), &map).unwrap();
    let text = "seeds = \"1..2\"\n[scenario]\nduration_s = 1.0\nmap = { kind = \"file\", file = \"../maps/a.txt\" }\n\
                agents = { count = 1 }\n";
    let plan = Plan::parse("p.toml", text, &site.path().join("plans")).unwrap();
    let parts = ["p0", "p1"].map(|name| site.path().join(name));
    for (number, folder) in parts.iter().enumerate() {
        let part = Part { index: number, parts: NonZero::new(2).unwrap() };
        let summary = execute(&plan, folder.clone(), &options(part), &mut (), &Stop::default()).unwrap();
        assert_eq!((summary.done, summary.failed), (1, 0));
    }
    let kept = Store::open(&parts[1]).unwrap().done().unwrap().pop_first().unwrap();
    let recording = Store::open(&parts[1]).unwrap().recording_file(&kept);
    std::fs::create_dir_all(recording.parent().unwrap()).unwrap();
    std::fs::write(&recording, "a recording").unwrap();
    let all = site.path().join("all");
    merge(&parts, &all).unwrap();
    let moved = site.path().join("elsewhere/all");
    std::fs::create_dir(site.path().join("elsewhere")).unwrap();
    std::fs::rename(&all, &moved).unwrap();
    for gone in ["maps", "plans", "p0", "p1"] {
        std::fs::remove_dir_all(site.path().join(gone)).unwrap();
    }

    let text = std::fs::read_to_string(moved.join(PLAN)).unwrap();
    assert_eq!(Plan::parse(PLAN, &text, &moved).unwrap().runs.len(), 2);
    let store = Store::open(&moved).unwrap();
    for id in store.done().unwrap() {
        let text = store.scenario(&id).unwrap().unwrap();
        let scenario = simulation::scenario::Scenario::parse("run.toml", &text, &[]).unwrap();
        let file = moved.join(store::RUNS).join(scenario.map.file.unwrap());
        assert_eq!(std::fs::read_to_string(&file).unwrap(), map, "{}", file.display());
    }
    assert_eq!(std::fs::read_to_string(store.recording_file(&kept)).unwrap(), "a recording");
}

#[test]
fn dates_are_of_the_gregorian_calendar() {
    for (days, expected) in
        [(0, "1970-01-01"), (58, "1970-02-28"), (59, "1970-03-01"), (11_016, "2000-02-29"), (20_779, "2026-11-22")]
    {
        assert_eq!(date(days), expected);
    }
}

#[test]
fn folder_is_for_one_execution_or_for_parts() {
    let site = tempfile::tempdir().unwrap();
    let store = Store::create(site.path()).unwrap();
    let whole = store.lock(false).unwrap();
    for is_part in [false, true] {
        let busy = store.lock(is_part).unwrap_err().to_string();
        assert!(
            busy.ends_with("another `maes batch` is at work there; wait for its end, or choose another folder (--out)")
        );
    }
    let refused = execute(&plan(), site.path().to_owned(), &options(Part::WHOLE), &mut (), &Stop::default());
    assert!(matches!(refused, Err(ExecuteError::Store(StoreError::Busy { .. }))), "{refused:?}");
    drop(whole);
    let parts = [(); 2].map(|()| store.lock(true).unwrap());
    assert!(store.lock(false).is_err());
    drop(parts);
    assert!(store.lock(false).is_ok());
}
