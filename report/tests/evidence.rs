//! Plans that used to mislead, executed and reported: repetitions that look like evidence, and
//! variants that could not be compared.

use std::collections::BTreeMap;
use std::fs;
use std::num::NonZero;
use std::path::Path;

use agent_node::controllers::Registry;
use experiments::execute::{Options, Part, Stop, Transport, execute};
use experiments::plan::Plan;
use report::ReportSummary;

/// Executes a plan and makes its report.
fn reported(folder: &Path, plan: &str) -> ReportSummary {
    reported_with_failures(folder, plan, 0)
}

/// Executes a plan of which so many runs fail, and makes its report.
fn reported_with_failures(folder: &Path, plan: &str, failed: usize) -> ReportSummary {
    let plan = Plan::parse("plan.toml", plan, folder).unwrap_or_else(|error| panic!("{error}"));
    let options = Options {
        jobs: NonZero::new(2).expect("two is not zero"),
        transport: Transport::Memory,
        part: Part::WHOLE,
        registry: Registry::BUILT_IN,
        prune: false,
    };
    let out = folder.join("out");
    let summary = execute(&plan, out.clone(), &options, &mut (), &Stop::default()).expect("the folder can be used");
    assert_eq!((summary.done, summary.failed), (plan.runs.len() - failed, failed));
    report::write(&out).expect("a report")
}

/// The rows of a table of the report, by column.
fn rows(folder: &Path, table: &str) -> Vec<BTreeMap<String, String>> {
    let file = folder.join(format!("out/report/tables/{table}.csv"));
    let mut reader = csv::Reader::from_path(file).expect("a table of the report");
    let rows: Result<Vec<_>, _> = reader.deserialize().collect();
    rows.expect("rows with the columns of the head")
}

/// A map as text: a hall of 12 x 12 x 4 free cells with pillars, the first of them at `x`.
fn hall(x: usize) -> String {
    let solid = format!("{}\n", "#".repeat(14)).repeat(14);
    let row = |y: usize| {
        let cell = |at: usize| {
            let is_pillar = [3, 9].contains(&y) && [x, x + 4].contains(&at);
            if y == 0 || y == 13 || at == 0 || at == 13 || is_pillar { '#' } else { '.' }
        };
        (0..14).map(cell).chain(['\n']).collect::<String>()
    };
    let layer: String = (0..14).map(row).collect();
    let layers = [solid.clone(), layer.clone(), layer.clone(), layer.clone(), layer, solid];
    layers.join("\n")
}

const SCENARIO: &str =
    "[scenario]\nduration_s = 120.0\n[scenario.agents]\ncount = 2\n[scenario.lidar]\nrange_m = 3.0\n";

#[test]
fn failed_runs_are_reported() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let plan = "seeds = \"1..3\"\n[axes]\nspawn = [{ kind = \"nearest_origin\" }, { kind = \"scattered\", \
                min_distance_m = 100.0 }]\n[scenario]\nduration_s = 25.0\n[scenario.map]\nkind = \"spheres\"\n\
                size = 24\n[scenario.agents]\ncount = 2\n[scenario.lidar]\nrange_m = 3.0\n";
    let written = reported_with_failures(folder.path(), plan, 3);
    assert_eq!((written.runs, written.lacking), (6, 0));
    assert!(written.warnings.iter().any(|warning| warning.starts_with("3 of 6 runs have failed")));
    assert!(written.verdicts.iter().any(|verdict| verdict.contains("failed on 3 of 3 maps")), "{written:?}");
    let page = fs::read_to_string(&written.page).expect("the page of the report");
    assert!(page.contains("failed: ") && page.contains("bodies find room"));
}

#[test]
fn seeds_of_one_map_are_one_observation() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    fs::write(folder.path().join("hall.txt"), hall(4)).expect("a new file");
    let path = folder.path().join("hall.txt");
    let plan = format!(
        "seeds = \"1..10\"\n[axes]\n\"agents.controller\" = [\"nearest-frontier\", \"lvd\"]\n{SCENARIO}\
         [scenario.map]\nkind = \"file\"\nfile = {path:?}\n"
    );
    let written = reported(folder.path(), &plan);
    assert_eq!((written.runs, written.lacking), (20, 0));
    for row in rows(folder.path(), "pairs-area") {
        let of = |key: &str| row[key].as_str();
        assert_eq!((of("all_pairs"), of("pairs"), of("maps")), ("10", "1", "1"));
        assert_eq!((of("p"), of("p_holm"), of("ratio_low")), ("", "", ""));
    }
    for row in rows(folder.path(), "outcome") {
        assert_eq!((row["runs"].as_str(), row["independent"].as_str()), ("10", "1"));
        assert_eq!(row["explored_low"], "", "one observation has no interval");
    }
    assert!(written.warnings[0].starts_with("20 runs are 2 independent observations"), "{:?}", written.warnings);
    let [verdict] = written.verdicts.as_slice() else { panic!("{:?}", written.verdicts) };
    assert!(verdict.contains("n = 1 map (10 pairs of runs, 9 of them repetitions)"), "{verdict}");
    assert!(!verdict.contains("p ="), "{verdict}");
}

#[test]
fn map_files_make_observations_where_seeds_do_not() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    fs::create_dir(folder.path().join("maps")).expect("a new folder");
    for x in 2..9 {
        fs::write(folder.path().join(format!("maps/hall-{x}.txt")), hall(x)).expect("a new file");
    }
    let plan = format!(
        "seeds = [1, 2]\nmaps = \"maps/*.txt\"\n[axes]\n\"agents.share_period_ticks\" = [0, 251]\n\
         \"agents.controller\" = [\"lvd-maes3d\"]\n{SCENARIO}"
    );
    let written = reported(folder.path(), &plan);
    assert_eq!((written.runs, written.lacking), (28, 0));
    let rows = rows(folder.path(), "pairs-area");
    let [row] = rows.as_slice() else { panic!("{rows:?}") };
    let of = |key: &str| row[key].as_str();
    assert_eq!((of("all_pairs"), of("pairs"), of("maps")), ("14", "7", "7"));
    assert!((0.0..=1.0).contains(&of("p_holm").parse::<f64>().expect("a p-value")), "{row:?}");
    assert!(written.verdicts[0].contains("n = 7 maps (14 pairs of runs, 7 of them repetitions)"));
}

#[test]
fn variants_of_settings_are_compared() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    // Tables as values of an axis: each was a panel of its own, with nothing to compare.
    let plan = "seeds = \"1..7\"\n[axes]\nagents = [\n\
                { count = 2, controller = \"lvd\", set = { visit_radius_m = 2.0 } },\n\
                { count = 2, controller = \"lvd\", set = { visit_radius_m = 5.0 } },\n\
                { count = 2, controller = \"nearest-frontier\" },\n]\n\
                [scenario]\nduration_s = 60.0\nmap = { kind = \"spheres\", size = 20 }\nagents = { count = 2 }\n\
                lidar = { range_m = 4.0 }\n";
    let written = reported(folder.path(), plan);
    assert_eq!((written.runs, written.lacking), (21, 0));
    let named: Vec<_> =
        rows(folder.path(), "pairs-area").iter().map(|row| format!("{} | {}", row["a"], row["b"])).collect();
    let [short, long, nearest] = ["lvd (visit_radius_m = 2.0)", "lvd (visit_radius_m = 5.0)", "nearest-frontier"];
    assert_eq!(named, [format!("{short} | {long}"), format!("{short} | {nearest}"), format!("{long} | {nearest}")]);
    for row in rows(folder.path(), "pairs-area") {
        assert_eq!((row["pairs"].as_str(), row["maps"].as_str(), row["p_holm"].is_empty()), ("7", "7", false));
    }
    assert_eq!(written.warnings, Vec::<String>::new());
    let page = fs::read_to_string(written.page).expect("the page");
    let titles = page.lines().filter(|line| line.starts_with("<title>") || line.starts_with("<h3>"));
    titles.for_each(|title| assert!(!title.contains('{'), "raw TOML in {title}"));

    // A run that is gone is named beside the verdicts.
    let files = fs::read_dir(folder.path().join("out/runs")).expect("a folder of runs").flatten();
    let mut records = files.map(|file| file.path()).filter(|file| file.extension().is_some_and(|name| name == "json"));
    fs::remove_file(records.next().expect("it has runs")).expect("its file");
    let written = report::write(&folder.path().join("out")).expect("a report of the others");
    let warning = &written.warnings[0];
    assert!(
        written.lacking == 1 && warning.starts_with("Runs are missing (") && warning.contains("1 of 7"),
        "{warning}"
    );
}

#[test]
fn named_variants_differ_in_anything() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let plan = "title = \"What a team needs\"\nseeds = \"1..6\"\n\
                [[variant]]\nname = \"plain\"\n\
                [[variant]]\nname = \"silent\"\nagents.share_period_ticks = 0\n\
                [[variant]]\nname = \"short-sighted\"\nlidar.range_m = 3.0\n\
                [[variant]]\nname = \"three\"\nagents.count = 3\n\
                [[variant]]\nname = \"with a flyer\"\nbodies = [{ agents = [0], kind = \"aerial\" }]\n\
                [scenario]\nduration_s = 60.0\nmap = { kind = \"spheres\", size = 20 }\n\
                agents = { count = 2, controller = \"nearest-frontier\" }\nlidar = { range_m = 5.0 }\n";
    let written = reported(folder.path(), plan);
    assert_eq!((written.runs, written.lacking, written.verdicts.len()), (30, 0, 10));
    // Ten comparisons on six maps: the warning and each verdict say that this cannot show anything.
    assert!(
        written.warnings.iter().any(|warning| warning.contains("a panel of 10 comparisons needs 9")),
        "{written:?}"
    );
    let is_said = |verdict: &String| verdict.contains("could be shown") || verdict.contains(" are equal in ");
    assert!(written.verdicts.iter().all(is_said), "{written:?}");
    let outcome: Vec<_> = rows(folder.path(), "outcome").into_iter().map(|row| row["variant"].clone()).collect();
    assert_eq!(outcome, ["plain", "silent", "short-sighted", "three", "with a flyer"]);
    let page = fs::read_to_string(written.page).expect("the page");
    assert!(page.contains("<h1>What a team needs</h1>"));
}

#[test]
fn forked_pairs_share_everything_before_the_fork() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let plan = "seeds = \"1..6\"\ncompare = \"agents.controller\"\n\
                [axes]\n\"agents.controller\" = [\"rbw\", \"nearest-frontier\"]\n[fork]\nat_s = [30.0, 60.0]\n\
                [scenario]\nduration_s = 120.0\nstop_when_explored = false\nmap = { kind = \"spheres\", size = 30 }\n\
                agents = { count = 2 }\nlidar = { range_m = 3.0 }\n";
    let written = reported(folder.path(), plan);
    assert_eq!((written.runs, written.lacking), (18, 0));
    let store = experiments::store::Store::open(&folder.path().join("out")).expect("the folder of a plan");
    let records = store.records().expect("records");
    let (parents, forks): (Vec<_>, Vec<_>) =
        records.iter().partition(|record| !record.row.axes.contains_key("fork.at_s"));
    assert_eq!((parents.len(), forks.len()), (6, 12));
    for fork in forks {
        let parent = parents.iter().find(|parent| parent.row.seed == fork.row.seed).expect("a parent");
        let at_s: f64 = fork.row.axes["fork.at_s"].parse().expect("a time");
        let before = |record: &experiments::rows::RunRecord| -> Vec<_> {
            record.series.iter().filter(|sample| sample.t_s < at_s).cloned().collect()
        };
        assert_eq!(before(parent), before(fork));
        assert_ne!(parent.row.digest, fork.row.digest);
        assert_ne!(parent.series.last(), fork.series.last());
    }
    // Each time is a panel, and the parents are in both of them.
    let pairs = rows(folder.path(), "pairs-area");
    assert_eq!(pairs.len(), 2, "{pairs:?}");
    assert!(pairs.iter().all(|row| row["pairs"] == "6"), "{pairs:?}");
    let panels: Vec<&str> = pairs.iter().map(|row| row["fork.at_s"].as_str()).collect();
    assert_eq!(panels, ["30", "60"]);
}

#[test]
fn report_compares_with_the_oracle() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let plan = "seeds = \"1..2\"\noracle = true\n[scenario]\nduration_s = 300.0\n\
                map = { kind = \"spheres\", size = 24 }\nagents = { count = 2, controller = \"lvd\" }\n";
    reported(folder.path(), plan);
    let oracle = rows(folder.path(), "oracle");
    assert!(oracle.iter().any(|row| row.keys().any(|column| column.contains("times_oracle_90"))), "{oracle:?}");
    let page = fs::read_to_string(folder.path().join("out/report/report.html")).expect("the page");
    assert!(page.contains("times the reference plan, 99 %"));
}
