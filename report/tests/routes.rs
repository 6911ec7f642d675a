//! Pictures of routes: of the right runs, where the bodies were, and the same bytes.

use std::fs;
use std::num::NonZero;
use std::path::{Path, PathBuf};

use agent_node::controllers::Registry;
use experiments::execute::{Options, Part, Stop, Transport, execute};
use experiments::plan::Plan;
use experiments::store::Store;
use report::routes;
use resvg::usvg::roxmltree::Document;
use tempfile::TempDir;

/// A map as text, x to the right, y upwards: a ring of lanes around a block, three cells high.
const RING: [&str; 9] = [
    "##########",
    "#........#",
    "#........#",
    "#..####..#",
    "#..####..#",
    "#..####..#",
    "#........#",
    "#........#",
    "##########",
];

const PLAN: &str = "seeds = \"1..5\"\ncompare = \"agents.controller\"\n\
    [axes]\n\"agents.controller\" = [\"rbw\", \"nearest-frontier\"]\n\
    [scenario]\nduration_s = 40.0\nmap = { kind = \"file\", file = \"ring.txt\" }\nlidar = { range_m = 3.0 }\n\
    spawn = { kind = \"scattered\", min_distance_m = 1.0 }\n\
    agents = { count = 2 }\n";

fn options() -> Options {
    Options {
        jobs: NonZero::new(2).expect("two is not zero"),
        transport: Transport::Memory,
        part: Part::WHOLE,
        registry: Registry::BUILT_IN,
        prune: false,
    }
}

/// The folder of an executed plan, and what was executed.
fn executed() -> (TempDir, PathBuf, Plan) {
    let site = tempfile::tempdir().expect("a temporary folder");
    let layer = |rows: &[&str]| format!("{}\n", rows.join("\n"));
    let solid = layer(&["##########"; 9]);
    let map = [solid.clone(), layer(&RING), layer(&RING), layer(&RING), solid].join("\n");
    fs::write(site.path().join("ring.txt"), map).expect("a map");
    let plan = Plan::parse("plan.toml", PLAN, site.path()).unwrap_or_else(|error| panic!("{error}"));
    let out = site.path().join("out");
    let summary = execute(&plan, out.clone(), &options(), &mut (), &Stop::default()).expect("the folder can be used");
    assert_eq!(summary.done, 10, "runs that have a result");
    (site, out, plan)
}

fn record(out: &Path, plan: &Plan) -> Result<(), report::routes::RecordError> {
    let lacking = routes::without_recording(out).expect("a folder of runs");
    routes::record(out, plan, lacking, &options(), &mut (), &Stop::default())
}

/// The id of the run with the median area of a controller.
fn median(out: &Path, controller: &str) -> String {
    let mut rows: Vec<_> =
        Store::open(out).expect("a folder").records().expect("runs").into_iter().map(|run| run.row).collect();
    rows.retain(|row| row.controller == controller);
    rows.sort_by(|one, other| other.area_under_explored.total_cmp(&one.area_under_explored));
    assert_eq!(rows.len(), 5);
    rows[2].id.clone()
}

#[test]
fn routes_are_those_of_the_median_runs() {
    let (_site, out, plan) = executed();
    let written = report::write(&out).unwrap();
    assert!(!out.join("report/figures/routes.svg").exists(), "without recordings there is no picture");
    let lacking = routes::without_recording(&out).unwrap();
    let expected = ["nearest-frontier", "rbw"].map(|controller| median(&out, controller));
    assert_eq!(lacking, expected.clone().into());
    record(&out, &plan).unwrap();
    assert!(routes::without_recording(&out).unwrap().is_empty());
    assert_eq!(report::write(&out).unwrap().warnings, written.warnings);
    let read = || ["svg", "png"].map(|kind| fs::read(out.join(format!("report/figures/routes.{kind}"))).unwrap());
    let first = read();
    report::write(&out).unwrap();
    assert!(first == read(), "the same recordings make the same bytes");
    let svg = String::from_utf8(first[0].clone()).unwrap();
    let page = fs::read_to_string(&written.page).unwrap();
    for id in &expected {
        assert!(svg.contains(&format!("run {id}")) && page.contains(&format!("run {id}")), "{id} is not named");
    }
    assert_eq!(page.matches("id=\"figure-routes\"").count(), 1);
    // The first of two plans: every corner of a route is above free cells.
    let tree = Document::parse(&svg).unwrap();
    let numbers = |text: &str| {
        let numbers =
            text.split(|c: char| !(c.is_ascii_digit() || c == '.' || c == '-')).filter(|part| !part.is_empty());
        numbers.map(|number| number.parse::<f64>().unwrap()).collect::<Vec<_>>()
    };
    let place = tree.descendants().find(|node| node.has_tag_name("path")).unwrap().attribute("transform").unwrap();
    let [left, bottom, side, down] = numbers(place)[..] else { panic!("{place}") };
    assert_eq!(side, -down);
    let mut corners = 0;
    for line in tree.descendants().filter(|node| node.has_tag_name("polyline")) {
        for point in numbers(line.attribute("points").unwrap()).chunks_exact(2) {
            let (x, y) = ((point[0] - left) / side, (bottom - point[1]) / side);
            // The second plan lies to the right of the first one.
            let Some(row) = RING.iter().rev().nth(y as usize).filter(|row| x < row.len() as f64) else { continue };
            assert_eq!(row.as_bytes()[x as usize], b'.', "a body at {x} {y}");
            corners += 1;
        }
    }
    assert!(corners > 8, "only {corners} corners");
}

#[test]
fn runs_that_cannot_be_executed_again_are_named() {
    let (_site, out, plan) = executed();
    let other = Plan::parse("plan.toml", &PLAN.replace("40.0", "42.0"), &out.join("..")).unwrap();
    let refused = record(&out, &other).unwrap_err().to_string();
    assert!(refused.contains("not of the plan in the folder and this build"), "{refused}");
    // The plan of a stranger may name a program.
    let mut with_program = plan.clone();
    for run in &mut with_program.runs {
        run.scenario.agents.command = vec!["touch".to_owned(), "{id}".to_owned()];
    }
    let refused = record(&out, &with_program).unwrap_err().to_string();
    assert!(refused.contains("agents.command = [\"touch\", \"{id}\"]: a report starts no program"), "{refused}");
    assert!(!out.join("recordings").exists());
    // A recording that is none is said, and the report is made.
    fs::create_dir(out.join("recordings")).unwrap();
    let id = median(&out, "rbw");
    fs::write(out.join(format!("recordings/{id}.mcap")), "no recording").unwrap();
    let warnings = report::write(&out).unwrap().warnings;
    assert!(
        warnings.iter().any(|warning| warning.contains(&format!("The routes of run {id} are not shown"))),
        "{warnings:?}"
    );
}
