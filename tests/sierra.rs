//! The plug-in of examples/sierra in a real SIERRA, through all five stages: its tables are those
//! of `maes batch`.

use std::fs;
use std::path::Path;

use crate::support::python;
use crate::support::root;
use crate::support::runs::{Site, text};

/// Four rows of series.csv, at 0, 10, 20 and 30 s.
const TEMPLATE: &str = "seed: 5\nduration_s: 30.0\nstop_when_explored: false\nmap: {kind: spheres, size: 10}\n\
                        agents: {count: 1, controller: rbw}\n";

/// The same runs as a plan.
const PLAN: &str = "seeds = [5, 6]\n[axes]\n\"agents.controller\" = [\"rbw\", \"lvd\"]\n\"agents.count\" = [1, 2]\n\
                    [scenario]\nduration_s = 30.0\nstop_when_explored = false\n\
                    map = { kind = \"spheres\", size = 40 }\nagents = { count = 1 }\n";

/// A CSV file.
struct Table {
    heads: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl Table {
    #[track_caller]
    fn read(file: &Path) -> Self {
        let content = fs::read_to_string(file).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
        let mut lines = content.lines().map(|line| line.split(',').map(str::to_owned).collect());
        Self { heads: lines.next().expect("a head"), rows: lines.collect() }
    }

    /// The texts of a column.
    fn texts(&self, head: &str) -> Vec<&str> {
        let found = self.heads.iter().position(|found| found == head);
        let index = found.unwrap_or_else(|| panic!("no column {head} in {:?}", self.heads));
        self.rows.iter().map(|row| row[index].as_str()).collect()
    }

    /// The numbers of a column.
    fn numbers(&self, head: &str) -> Vec<f64> {
        self.texts(head).into_iter().map(|text| text.parse().expect("a number")).collect()
    }
}

/// The explored shares of the run of PLAN with these values.
fn planned(folder: &Path, controller: &str, agents: &str, seed: &str) -> Vec<f64> {
    let runs = Table::read(&folder.join("runs.csv"));
    let keys = runs.texts("controller").into_iter().zip(runs.texts("agents")).zip(runs.texts("seed"));
    let index = keys.into_iter().position(|key| key == ((controller, agents), seed)).expect("it is in the plan");
    let id = runs.texts("id")[index];
    let series = Table::read(&folder.join("series.csv"));
    let rows = series.texts("id").into_iter().zip(series.numbers("explored"));
    rows.filter_map(|(of, explored)| (of == id).then_some(explored)).collect()
}

/// SIERRA writes eight digits.
#[track_caller]
fn assert_close(found: &[f64], expected: &[f64], what: &str) {
    let close =
        found.len() == expected.len() && found.iter().zip(expected).all(|(one, other)| (one - other).abs() < 1e-7);
    assert!(close, "{what}: {found:?} instead of {expected:?}");
}

#[test]
#[ignore = "installs SIERRA, with more than 150 packages; needs GNU parallel"]
fn sierra_compares_controllers() {
    let site = Site::new();
    site.file("plan.toml", PLAN);
    site.start(site.binary("maes").args(["batch", "plan.toml", "--out", "plan"])).ended().with_code(0);

    let template = site.file("template.yaml", TEMPLATE);
    let programs = python::for_sierra().parent().expect("the interpreter is in a folder");
    let path = format!("{}:{}", text(programs), std::env::var("PATH").unwrap_or_default());
    let mut sierra = site.command(root().join("examples/sierra/run.sh"));
    sierra.env("PATH", path).args(["out", "--expdef-template", text(&template), "--scenario", "spheres.40"]);
    sierra.args(["--batch-criteria", "population_size.Linear2.C2", "--n-runs", "2"]);
    site.start(&mut sierra).ended().with_code(0);

    let project = site.path("out/maes_sierra.exploration");
    let mut ends = Vec::new();
    for controller in ["rbw", "lvd"] {
        let batch = project.join(format!("explore.{controller}/spheres.40/template-population_size.Linear2.C2"));
        for (experiment, agents) in [("c1-exp0", "1"), ("c1-exp1", "2")] {
            let runs = [("template_run0", "5"), ("template_run1", "6")].map(|(run, seed)| {
                let series = batch.join(format!("exp-outputs/{experiment}/{run}_output/output/series.csv"));
                let series = Table::read(&series);
                assert_eq!(series.numbers("t_s"), [0.0, 10.0, 20.0, 30.0]);
                let expected = planned(&site.path("plan"), controller, agents, seed);
                assert_close(&series.numbers("explored"), &expected, &format!("{controller} {experiment} {run}"));
                expected
            });
            let mean: Vec<f64> = runs[0].iter().zip(&runs[1]).map(|(one, other)| (one + other) / 2.0).collect();
            let statistics = Table::read(&batch.join(format!("statistics/{experiment}/series.mean")));
            assert_close(&statistics.numbers("explored"), &mean, &format!("{controller} {experiment}"));
            ends.push(mean[3]);
            assert!(batch.join(format!("graphs/{experiment}/SLN-explored.html")).exists());
        }
        for graph in ["SM-explored-by-size.html", "SLN-explored-curves.html"] {
            assert!(batch.join("graphs/inter-exp").join(graph).exists(), "{graph}");
        }
    }
    assert!(ends[..2] != ends[2..], "the controllers differ: {ends:?}");

    let name = "explored-compared-template-population_size.Linear2.C2";
    let compared = Table::read(&project.join(format!("explore.rbw+explore.lvd-cc-csvs/{name}.mean")));
    assert_close(&compared.numbers("explore.rbw"), &ends[..2], "rbw");
    assert_close(&compared.numbers("explore.lvd"), &ends[2..], "lvd");
    let graph = fs::read_to_string(project.join(format!("explore.rbw+explore.lvd-cc-graphs/SM-{name}.html")));
    let graph = graph.expect("stage 5 draws a graph");
    assert!(
        ["\"explore.rbw\"", "\"explore.lvd\""].iter().all(|label| graph.contains(label)),
        "the legend names the controllers"
    );
}
