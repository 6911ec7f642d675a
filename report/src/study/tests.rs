use super::super::fixture;
use super::*;

fn study(runs: Vec<RunRecord>, plan: &str) -> Study {
    let stored = runs.into_iter().map(|run| StoredRun::new(run, RunMetadata::default())).collect();
    Study::new(stored, (!plan.is_empty()).then(|| plan.to_owned()))
}

/// A run with these axes.
fn run_with(controller: &str, seed: u64, axes: &[(&str, &str)]) -> RunRecord {
    let mut run = fixture::run(controller, seed, 2);
    run.row.axes = axes.iter().map(|(key, value)| ((*key).to_owned(), (*value).to_owned())).collect();
    run.row.id = format!("{controller}-{seed}-{axes:?}");
    run
}

#[test]
fn determined_axes_make_no_panels() {
    let mut runs = Vec::new();
    for (seed, agents, range) in [(1, 2, "10"), (1, 2, "5"), (2, 2, "10"), (1, 5, "10")] {
        let mut run = fixture::run("dsvp", seed, agents);
        run.row.axes.insert("lidar.range_m".to_owned(), range.to_owned());
        run.row.axes.insert("agents.count".to_owned(), agents.to_string());
        runs.push(run);
    }
    let study = study(runs, "compare = \"agents.controller\"");
    assert_eq!(study.others, ["lidar.range_m"]);
    let names: Vec<_> = study.conditions.iter().map(|condition| study.condition_name(condition)).collect();
    assert_eq!(
        names,
        [
            "2 agents, 50³ cells, lidar.range_m = 5",
            "2 agents, 50³ cells, lidar.range_m = 10",
            "5 agents, 50³ cells, lidar.range_m = 10"
        ]
    );
    assert_eq!(study.missing().iter().map(|(_, count)| count).sum::<usize>(), 2);
}

#[test]
fn builds_are_separate_conditions() {
    let mut other = fixture::run("dsvp", 1, 2);
    other.row.build = "0.2.0".to_owned();
    let study = study(vec![fixture::run("dsvp", 1, 2), other], "");
    assert_eq!((study.others, study.conditions.len()), (vec!["build".to_owned()], 2));
}

#[test]
fn folder_without_runs_is_an_error() {
    let dir = tempfile::tempdir().unwrap();
    let error = Study::read(dir.path()).unwrap_err().to_string();
    assert!(error.contains("no folder of a plan"), "{error}");
    Store::create(dir.path()).unwrap();
    assert!(Study::read(dir.path()).unwrap_err().to_string().contains("no runs there"));
}

#[test]
fn plan_decides_what_is_compared() {
    let mut runs = Vec::new();
    for seed in 1..=2 {
        for (controller, range) in [("dsvp", "5"), ("dsvp", "10"), ("lvd", "5"), ("lvd", "10")] {
            runs.push(run_with(controller, seed, &[("agents.controller", controller), ("lidar.range_m", range)]));
        }
    }
    let of = |plan: &str| {
        let study = study(runs.clone(), plan);
        assert_eq!(study.missing(), []);
        (study.variants, study.others)
    };
    let owned = |texts: &[&str]| texts.iter().map(|text| (*text).to_owned()).collect::<Vec<_>>();
    assert_eq!(of(""), (owned(&["dsvp", "lvd"]), owned(&["lidar.range_m"])));
    assert_eq!(
        of("compare = \"lidar.range_m\"\naxes.\"lidar.range_m\" = [10, 5]"),
        (owned(&["range_m = 10", "range_m = 5"]), owned(&["agents.controller"]))
    );
    assert_eq!(
        of("compare = [\"agents.controller\", \"lidar.range_m\"]").0,
        ["dsvp (range_m = 5)", "dsvp (range_m = 10)", "lvd (range_m = 5)", "lvd (range_m = 10)"]
    );
}

#[test]
fn variants_that_differ_in_the_team_are_in_one_panel() {
    let mut runs = Vec::new();
    for seed in 1..=3 {
        for (name, agents) in [("small", 2), ("large", 5)] {
            let mut run = run_with("dsvp", seed, &[(VARIANT, name)]);
            run.row.agents = agents;
            runs.push(run);
        }
    }
    let plan = "[[variant]]\nname = \"small\"\nagents.count = 2\n[[variant]]\nname = \"large\"\nagents.count = 5";
    let study = study(runs, plan);
    assert_eq!(study.variants, ["small", "large"]);
    assert_eq!(study.conditions, [Condition { others: vec![], size: Some([50; 3]), agents: None }]);
    assert_eq!(study.pairs(&study.conditions[0], 0, 1).a.len(), 3);
}

#[test]
fn controllers_without_a_setting_are_in_every_panel_of_it() {
    let setting = "agents.set.visit_radius_m";
    let mut runs = Vec::new();
    for seed in 1..=2 {
        runs.push(run_with("rbw", seed, &[("agents.controller", "rbw")]));
        for value in ["2.0", "4.0"] {
            runs.push(run_with("lvd", seed, &[("agents.controller", "lvd"), (setting, value)]));
        }
    }
    let study = study(runs, "compare = \"agents.controller\"");
    assert_eq!(study.conditions.len(), 2);
    assert_eq!(study.missing(), []);
    for condition in &study.conditions {
        assert_eq!(study.pairs(condition, 0, 1).a.len(), 2, "{}", study.condition_name(condition));
    }
}

#[test]
fn map_files_are_blocks() {
    let mut runs = Vec::new();
    for (map, size, cells) in [("a.m3dm", 20, 100), ("b.m3dm", 30, 200)] {
        for (controller, seed) in [("rbw", 1), ("rbw", 2), ("dsvp", 1), ("dsvp", 2)] {
            let mut run = run_with(controller, seed, &[("agents.controller", controller), (MAP_FILE, map)]);
            (run.row.size, run.row.free_cells) = ([size; 3], cells);
            // The random walk depends on the seed.
            if controller == "rbw" {
                run.row.explored -= 0.01 * seed as f64;
            }
            runs.push(run);
        }
    }
    let study = study(runs, "");
    assert_eq!((study.conditions.len(), study.blocks(), study.missing()), (1, 4, vec![]));
    let condition = &study.conditions[0];
    assert_eq!(study.condition_name(condition), "2 agents");
    // `dsvp` is the same with both seeds: one observation on each map.
    let counts =
        [0, 1].map(|variant| (study.all_of_cell(condition, variant).len(), study.cell(condition, variant).len()));
    assert_eq!(
        (study.variants.as_slice(), counts),
        (["dsvp".to_owned(), "rbw".to_owned()].as_slice(), [(4, 2), (4, 4)])
    );
    let pairs = study.pairs(condition, 0, 1);
    assert_eq!((pairs.all, pairs.a.len(), pairs.maps), (4, 4, 2));
    // A pair of runs that both repeat others is no pair of its own.
    let pairs = study.pairs(condition, 0, 0);
    assert_eq!((pairs.all, pairs.a.len(), pairs.maps), (4, 2, 2));
}

#[test]
fn runs_are_paired_by_seed() {
    let runs = [1, 2, 5].map(|seed| fixture::run("dsvp", seed, 2));
    let others = [2, 3, 5].map(|seed| fixture::run("lvd", seed, 2));
    let study = study(runs.into_iter().chain(others).collect(), "");
    let pairs = study.pairs(&study.conditions[0], 0, 1);
    let seeds = |runs: Vec<&RunRecord>| runs.iter().map(|run| run.row.seed).collect::<Vec<_>>();
    assert_eq!((seeds(pairs.a), seeds(pairs.b), pairs.maps), (vec![2, 5], vec![2, 5], 2));
}
