//! Plans of many runs with the installed command: interrupted and completed, on a cluster, over ROS
//! 2, and reported.

use std::fs;
use std::path::{Path, PathBuf};

use crate::support::processes::signal;
use crate::support::root;
use crate::support::runs::{Run, Site, text};

/// Number of runs of the plan `quick`.
const QUICK_RUNS: usize = 48;

const SMALL: &str = r#"
seeds = "1..3"
[axes]
"agents.controller" = ["rbw", "dsvp"]
[scenario]
duration_s = 60.0
map = { kind = "spheres", size = 20 }
agents = { count = 2 }
"#;

/// A CSV table of a report or of a folder of runs.
struct Table {
    heads: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl Table {
    fn read(file: &Path) -> Self {
        let content = fs::read_to_string(file).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
        // The only quoted cell is the last one, of the machine.
        let cells = |line: &str| line.split(',').map(str::to_owned).collect::<Vec<_>>();
        let mut lines = content.lines();
        let heads = cells(lines.next().expect("a table has a head"));
        Self { heads, rows: lines.map(cells).collect() }
    }

    fn place(&self, head: &str) -> usize {
        self.heads.iter().position(|is| is == head).unwrap_or_else(|| panic!("no column {head}"))
    }

    /// The cells of some columns by row, sorted.
    fn columns(&self, heads: &[&str]) -> Vec<Vec<&str>> {
        let places: Vec<usize> = heads.iter().map(|head| self.place(head)).collect();
        let mut rows: Vec<Vec<&str>> =
            self.rows.iter().map(|row| places.iter().map(|&place| row[place].as_str()).collect()).collect();
        rows.sort();
        rows
    }

    /// The cells that do not depend on the machine.
    fn deterministic(&self) -> Vec<Vec<&str>> {
        self.columns_but(&["wall_"])
    }

    /// The deterministic columns that runs over ROS 2 have as well.
    fn of_every_transport(&self) -> Vec<Vec<&str>> {
        self.columns_but(&["wall_", "redundancy_known", "redundancy_unknown"])
    }

    /// The columns whose names begin otherwise.
    fn columns_but(&self, others: &[&str]) -> Vec<Vec<&str>> {
        let is_other = |head: &&str| others.iter().any(|other| head.starts_with(other));
        let heads: Vec<&str> = self.heads.iter().map(String::as_str).filter(|head| !is_other(head)).collect();
        self.columns(&heads)
    }
}

fn experiments(site: &Site, arguments: &[&str]) -> Run {
    site.start(site.binary("maes").args(arguments))
}

/// Executes a plan to its end; its table of runs.
fn executed(site: &Site, plan: &Path, folder: &str, flags: &[&str]) -> Table {
    let arguments = [&["batch", text(plan), "--out", folder][..], flags].concat();
    experiments(site, &arguments).ended().with_code(0);
    Table::read(&site.path(folder).join("runs.csv"))
}

fn files_of(folder: &Path) -> usize {
    fs::read_dir(folder).map_or(0, |files| {
        files
            .filter(|file| file.as_ref().is_ok_and(|file| file.path().extension().is_some_and(|is| is == "json")))
            .count()
    })
}

fn quick() -> PathBuf {
    root().join("experiments/plans/quick.toml")
}

#[test]
fn interrupted_plan_is_completed_and_reported() {
    let site = Site::new();
    let whole = executed(&site, &quick(), "whole", &[]);
    assert_eq!(whole.rows.len(), QUICK_RUNS);

    let plan = quick();
    let arguments = ["batch", text(&plan), "--out", "pieces"];
    let runs = site.path("pieces").join("runs");
    for (end, done) in [("KILL", 3), ("INT", 8)] {
        let mut run = experiments(&site, &arguments);
        run.process().waits_until(|| files_of(&runs) >= done);
        signal(run.process().pid(), end);
        let code = run.ended().code;
        assert_eq!(code, (end == "INT").then_some(130), "{end}");
        let kept = files_of(&runs);
        assert!((done..QUICK_RUNS).contains(&kept), "{kept} runs are there after {end}");
    }
    let pieces = executed(&site, &plan, "pieces", &[]);
    assert_eq!(pieces.deterministic(), whole.deterministic());

    experiments(&site, &["report", "whole"]).ended().with_code(0);
    let outcome = Table::read(&site.path("whole/report/tables/outcome.csv"));
    assert_eq!(outcome.rows.len(), 6);
    for cell in outcome.columns(&["agents", "controller", "runs", "explored_mean", "area_mean"]) {
        let [agents, controller, runs, explored, area] = cell[..] else { unreachable!("five columns were asked for") };
        let rows = whole.columns(&["agents", "controller", "explored", "area_under_explored"]);
        let rows: Vec<_> = rows.into_iter().filter(|row| row[..2] == [agents, controller]).collect();
        assert_eq!(runs, rows.len().to_string());
        let number = |text: &str| text.parse::<f64>().unwrap_or_else(|error| panic!("{text}: {error}"));
        for (place, mean) in [(2, explored), (3, area)] {
            let expected = 100.0 * rows.iter().map(|row| number(row[place])).sum::<f64>() / rows.len() as f64;
            assert!((number(mean) - expected).abs() < 1e-9, "{controller}, {agents} agents: {mean}, not {expected}");
        }
    }
    for name in ["report.html", "figures/exploration.svg", "figures/exploration.png", "tables/times.tex"] {
        assert!(fs::metadata(site.path("whole/report").join(name)).is_ok_and(|file| file.len() > 1000), "{name}");
    }
}

#[test]
fn cluster_jobs_and_ros_processes_give_the_same_rows() {
    let site = Site::new();
    let plan = site.file("small.toml", SMALL);
    let whole = executed(&site, &plan, "whole", &[]);

    let emit = ["batch", text(&plan), "--out", "cluster", "--emit", "slurm", "--parts", "4"];
    experiments(&site, &emit).ended().with_code(0);
    assert_eq!(files_of(&site.path("cluster/runs")), 0);
    // As a Slurm that cannot be asked for the script's place runs them, one after the other.
    for job in ["0", "1", "2", "3"] {
        let mut script = site.command("bash");
        script.arg("plan.slurm.sh").current_dir(site.path("cluster")).env("SLURM_SUBMIT_DIR", site.path("cluster"));
        script.env("SLURM_ARRAY_JOB_ID", "1").env("SLURM_ARRAY_TASK_ID", job);
        site.start(&mut script).ended().with_code(0);
    }
    let cluster = Table::read(&site.path("cluster/runs.csv"));
    assert_eq!(cluster.deterministic(), whole.deterministic());

    let domain = site.domain().id().to_string();
    let flags = ["--transport", "ros2", "--first-domain", &domain];
    let over_ros = executed(&site, &plan, "over-ros", &flags);
    assert_eq!(over_ros.of_every_transport(), whole.of_every_transport());
}

/// The ids of the recordings that a folder has kept.
fn recordings(folder: &Path) -> Vec<String> {
    let files = fs::read_dir(folder.join("recordings")).into_iter().flatten().filter_map(Result::ok);
    let mut ids: Vec<String> =
        files.filter_map(|file| file.file_name().to_str()?.strip_suffix(".mcap").map(str::to_owned)).collect();
    ids.sort();
    ids
}

#[test]
fn kept_recordings_are_those_of_the_rows_and_verify() {
    let site = Site::new();
    // Short enough that some runs reach 99 % and some do not.
    let text = SMALL.replace("60.0", "20.0").replace("1..3", "1..4") + "lidar = { range_m = 8.0 }\n";
    let plan = site.file("small.toml", text);
    let table = executed(&site, &plan, "all", &["--keep", "all"]);
    let rows = table.columns(&["id", "t99_s", "digest"]);
    let ids = |rows: &[Vec<&str>]| rows.iter().map(|row| row[0].to_owned()).collect::<Vec<_>>();
    assert_eq!(recordings(&site.path("all")), ids(&rows));
    for row in rows.iter().step_by(3) {
        let file = format!("all/recordings/{}.mcap", row[0]);
        let verified = experiments(&site, &["verify", &file]).ended().with_code(0);
        assert!(verified.stdout.contains(row[2]), "{verified}, not {}", row[2]);
    }
    let failures: Vec<Vec<&str>> = rows.iter().filter(|row| row[1].is_empty()).cloned().collect();
    assert!((1..rows.len()).contains(&failures.len()), "{rows:?}");
    let same = executed(&site, &plan, "failures", &["--keep", "failures"]);
    assert_eq!(same.deterministic(), table.deterministic());
    assert_eq!(recordings(&site.path("failures")), ids(&failures));
    executed(&site, &plan, "outliers", &["--keep", "outliers"]);
    assert!(recordings(&site.path("outliers")).len() < rows.len());
    executed(&site, &plan, "none", &["--report"]);
    assert!(site.path("none/report/report.html").is_file());
    // Those of the routes: one run of each variant.
    assert_eq!(recordings(&site.path("none")).len(), 2);
    // The page of the report leads to the recording and to its command.
    experiments(&site, &["report", "failures"]).ended().with_code(0);
    let page = fs::read_to_string(site.path("failures/report/report.html")).expect("the report has a page");
    assert!(failures.iter().all(|row| page.contains(&format!("recordings/{}.mcap", row[0]))));
}

#[test]
fn results_of_a_benchmark_are_verified_by_others() {
    let site = Site::new();
    let bench = ["bench", "exploration-1", "--controller", "nearest-frontier", "--world", "station", "--seeds", "1"];
    let done = experiments(&site, &[&bench[..], &["--out", "out"]].concat()).ended().with_code(0);
    assert!(done.stdout.contains("| station | lossy |") && done.stdout.contains("score of a part"), "{done}");
    let file = "out/exploration-1.json";
    let verified = experiments(&site, &["bench", "verify", file, "--draw", "3"]).ended().with_code(0);
    assert!(verified.stdout.contains("1 of 10 runs executed again, all as in the file"), "{verified}");
    let text = fs::read_to_string(site.path(file)).expect("the result file");
    let place = text.find("\"score\": ").expect("a score") + "\"score\": ".len();
    let forged = format!("{}1{}", &text[..place], &text[place..]);
    site.file("forged.json", forged);
    let refused = experiments(&site, &["bench", "verify", "forged.json", "--draw", "3"]).ended().with_code(1);
    assert!(refused.stdout.contains("differs: score"), "{refused}");
    // A program that the file names is not started by itself.
    let mut entry: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    entry["entry"]["command"] = serde_json::json!(["sh", "-c", "touch started", "{id}"]);
    site.file("stranger.json", entry.to_string());
    let verify = ["bench", "verify", "stranger.json", "--draw", "3"];
    let typed = ["--command", "sh", "--command", "-c", "--command", "touch other", "--command", "{id}"];
    for flags in [&[][..], &typed] {
        let refused = experiments(&site, &[&verify[..], flags].concat()).ended().with_code(2);
        let repeat = "--command sh --command -c --command 'touch started' --command '{id}'";
        assert!(refused.stderr.contains("entry.command = [\"sh\"") && refused.stderr.contains(repeat), "{refused}");
        assert!(!site.path("started").exists());
    }
    let unknown = experiments(&site, &["bench", "exploration-1", "--controller", "x", "--out", "none"]).ended();
    let unknown = unknown.with_code(2);
    assert!(unknown.stderr.contains("agents.controller"), "{unknown}");
}
