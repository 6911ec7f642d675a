//! The report of synthetic runs, compared with hand calculation.
//!
//! `report/runs` has eleven runs of up to 600 s: `dsvp` with seeds 1 to 4, `lvd` and `rbw` with
//! seeds 1 to 3, five agents each, and one run of `dsvp` with ten agents. `report/expected` has
//! expected tables.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use resvg::tiny_skia::Pixmap;
use resvg::usvg::roxmltree::{Document, ParsingOptions};
use tempfile::TempDir;

fn fixture() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/report")
}

/// A copy of the runs and the plan.
fn folder() -> TempDir {
    let dir = tempfile::tempdir().expect("a temporary folder");
    fs::create_dir(dir.path().join("runs")).expect("a new folder");
    for entry in fs::read_dir(fixture().join("runs")).expect("the synthetic runs") {
        let path = entry.expect("a readable folder").path();
        let name = path.file_name().expect("a file has a name");
        fs::copy(&path, dir.path().join("runs").join(name)).expect("a copy");
    }
    fs::copy(fixture().join("plan.toml"), dir.path().join("plan.toml")).expect("a copy");
    dir
}

/// All files of a report by name.
fn files(dir: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut files = BTreeMap::new();
    for folder in ["report", "report/figures", "report/tables"] {
        for entry in fs::read_dir(dir.join(folder)).expect("a folder of the report") {
            let path = entry.expect("a readable folder").path();
            if path.is_file() {
                let name = path.strip_prefix(dir).expect("it was found below").display().to_string();
                files.insert(name, fs::read(&path).expect("a readable file"));
            }
        }
    }
    files
}

/// The value in a column of a table, in the row that begins with these entries after the map.
fn value(dir: &Path, table: &str, row: &[&str], column: &str) -> f64 {
    let text = fs::read_to_string(dir.join(format!("report/tables/{table}.csv"))).expect("a table of the report");
    let mut lines = text.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let header = lines.next().expect("a header");
    let at = header.iter().position(|key| *key == column).unwrap_or_else(|| panic!("{column} in {header:?}"));
    let line = lines.find(|line| line[1..].starts_with(row)).unwrap_or_else(|| panic!("{row:?} in {table}"));
    line[at].parse().unwrap_or(f64::NAN)
}

#[test]
fn numbers_match_hand_calculation() {
    let dir = folder();
    report::write(dir.path()).unwrap();
    let is = |table: &str, row: &[&str], column: &str, expected: f64| {
        let got = value(dir.path(), table, row, column);
        assert!((got - expected).abs() < 1e-9, "{table} {row:?} {column}: {got} instead of {expected}");
    };
    let dsvp: &[&str] = &["5", "dsvp"];
    // 0.96, 0.98, 1, 1: the quartiles at positions 0.75 and 2.25 of 0 to 3.
    is("outcome", dsvp, "runs", 4.0);
    is("outcome", dsvp, "independent", 4.0);
    is("outcome", dsvp, "explored_mean", 98.5);
    is("outcome", dsvp, "explored_median", 99.0);
    is("outcome", dsvp, "explored_q1", 97.5);
    is("outcome", dsvp, "explored_q3", 100.0);
    // (0.8 + 0.7 + 0.6 + 0.7) / 4.
    is("outcome", dsvp, "area_mean", 70.0);
    // 0.9, 0.8, 0.7.
    is("outcome", &["5", "lvd"], "explored_median", 80.0);
    is("outcome", &["5", "lvd"], "explored_q1", 75.0);
    // 200, 250, 500 and 450 s.
    is("times", dsvp, "success_90", 1.0);
    is("times", dsvp, "time_90_min_mean", 1400.0 / 4.0 / 60.0);
    // 300 and 400 s, and two censored at 600 s; half of the runs have reached it at 400 s.
    is("times", dsvp, "reached_99_some", 2.0);
    is("times", dsvp, "success_99", 0.5);
    is("times", dsvp, "time_99_min_mean", (300.0 + 400.0 + 600.0 + 600.0) / 4.0 / 60.0);
    is("times", dsvp, "time_99_min_median", 400.0 / 60.0);
    is("times", dsvp, "time_100_min_mean", (330.0 + 480.0 + 600.0 + 600.0) / 4.0 / 60.0);
    // 590 s, and two censored.
    is("times", &["5", "lvd"], "success_90", 1.0 / 3.0);
    is("times", &["5", "lvd"], "time_90_min_mean", (590.0 + 600.0 + 600.0) / 3.0 / 60.0);
    is("times", &["5", "lvd"], "time_99_min_mean", 10.0);
    assert!(value(dir.path(), "times", &["5", "lvd"], "time_90_min_median").is_nan());
    // A single run has no interval.
    is("times", &["10", "dsvp"], "time_99_min_mean", 2.5);
    assert!(value(dir.path(), "times", &["10", "dsvp"], "time_99_min_low").is_nan());
    // 400, 800, 1200 and 1600 kB.
    is("communication", dsvp, "traffic_mean", 1000.0);
    is("effort", dsvp, "distance_mean", 1300.0);
    is("cost", dsvp, "decision_p95_us", 500.0);
}

#[test]
fn pairs_match_hand_calculation() {
    let dir = folder();
    report::write(dir.path()).unwrap();
    let is = |table: &str, row: &[&str], column: &str, expected: f64| {
        let got = value(dir.path(), table, row, column);
        assert!((got - expected).abs() < 1e-9, "{table} {row:?} {column}: {got} instead of {expected}");
    };
    let row: &[&str] = &["5", "dsvp", "lvd"];
    // Seeds 1 to 3: 300, 400 and 600 s against 600 s each.
    is("pairs-time-99", row, "pairs", 3.0);
    is("pairs-time-99", row, "maps", 3.0);
    is("pairs-time-99", row, "mean_a", 1300.0 / 3.0 / 60.0);
    is("pairs-time-99", row, "ratio_mean", 1300.0 / 1800.0);
    // Three of nine comparisons are ties, the others are lost.
    is("pairs-time-99", row, "a12", 1.5 / 9.0);
    // Three pairs in the same direction: p = 2 / 2^3 at the least, which is no evidence.
    for column in ["p", "p_holm", "detectable"] {
        assert!(value(dir.path(), "pairs-area", row, column).is_nan(), "{column}");
    }
    // Areas of 0.7 and 0.4 on average: 0.3 and 0.6 of ten minutes until a cell is seen.
    is("pairs-area", row, "a12", 0.0);
    is("pairs-area", row, "mean_a", 3.0);
    is("pairs-area", row, "ratio_mean", 0.3 / 0.6);
    is("pairs-explored", row, "difference_mean", 296.0 / 3.0 - 80.0);
}

#[test]
fn tables_match_the_expected_files() {
    let dir = folder();
    report::write(dir.path()).unwrap();
    for entry in fs::read_dir(fixture().join("expected")).unwrap() {
        let expected = entry.unwrap().path();
        let name = expected.file_name().unwrap();
        let written = fs::read_to_string(dir.path().join("report/tables").join(name)).unwrap();
        assert_eq!(written, fs::read_to_string(&expected).unwrap(), "{}", name.display());
    }
}

#[test]
fn page_is_well_formed_and_self_contained() {
    let dir = folder();
    let written = report::write(dir.path()).unwrap();
    // Of four seeds, `lvd` and `rbw` lack one with five agents and all with ten, where `dsvp` lacks
    // three.
    assert_eq!((written.runs, written.lacking), (11, 1 + 1 + 4 + 4 + 3));
    let page = fs::read_to_string(&written.page).unwrap();
    let options = ParsingOptions { allow_dtd: true, ..ParsingOptions::default() };
    let tree = Document::parse_with_options(&page, options).unwrap();
    let (mut ids, mut links) = (BTreeMap::new(), Vec::new());
    for node in tree.descendants().filter(|node| node.is_element()) {
        let name = node.tag_name().name();
        assert!(!["link", "img", "image", "iframe", "use", "object"].contains(&name), "{name}");
        for attribute in node.attributes() {
            assert!(!["src", "data", "action"].contains(&attribute.name()), "{name} {attribute:?}");
            if attribute.name() == "href" {
                let target = attribute.value().strip_prefix('#').expect("a link within the page");
                links.push(target);
            }
            let reference = attribute.value().strip_prefix("url(");
            assert!(reference.is_none_or(|rest| rest.starts_with('#')), "{name} {attribute:?}");
            if attribute.name() == "id" {
                assert_eq!(ids.insert(attribute.value(), name), None, "{attribute:?} is there twice");
            }
        }
    }
    for target in links {
        assert!(ids.contains_key(target), "#{target} leads nowhere");
    }
    assert!(!page.contains("@import"));
    assert!(page.contains("default-src 'none'"), "the browser loads nothing");
    let text: String = tree.descendants().filter(|node| node.is_text()).filter_map(|node| node.text()).collect();
    for expected in [
        "<every> seed & controller",
        "0.1.0",
        "a machine with 2 cores",
        "1\u{2013}4",
        "rbw: 5 agents, 50\u{b3} cells",
        "Comparison of dsvp, lvd and rbw",
        "Runs of 2026-11-20 to 2026-11-21",
        "dsvp was ahead of lvd in the area under the explored share (70.0 against 40.0 %): a cell is seen 50 % sooner on \
         average",
        "n = 3 maps: too few for a test, which needs 7.",
        "reaches 99 % first or alone in 2 of 3 pairs, lvd in 0; too few for a test",
        "The verdicts are about the area under the explored share",
    ] {
        assert!(text.contains(expected), "{expected}");
    }
}

#[test]
fn page_leads_from_runs_to_their_commands() {
    let dir = folder();
    let (with, kept) = ("00000000000000d1", "00000000000000d2");
    fs::create_dir(dir.path().join("recordings")).unwrap();
    fs::write(dir.path().join(format!("runs/{with}.toml")), "").unwrap();
    fs::write(dir.path().join(format!("recordings/{kept}.mcap")), "").unwrap();
    let heading = report::Heading { title: Some("Caves & <more>".to_owned()), date: Some("May".to_owned()) };
    let written = report::write_with(dir.path(), &heading).unwrap();
    let page = fs::read_to_string(&written.page).unwrap();
    for expected in [
        "<h1>Caves &amp; &lt;more&gt;</h1>".to_owned(),
        "<p class=\"meta\">May".to_owned(),
        format!("<tr id=\"run-{with}\">"),
        format!("<code>maes run runs/{with}.toml</code>"),
        format!("<code>maes view recordings/{kept}.mcap</code>"),
        format!("data-run=\"{with}\""),
    ] {
        assert!(page.contains(&expected), "{expected}");
    }
    assert!(!page.contains(&format!("maes run runs/{kept}.toml")));
}

#[test]
fn figures_are_rendered_and_reproducible() {
    let (one, other) = (folder(), folder());
    report::write(one.path()).unwrap();
    report::write(other.path()).unwrap();
    let (one, other) = (files(one.path()), files(other.path()));
    assert_eq!(one.keys().collect::<Vec<_>>(), other.keys().collect::<Vec<_>>());
    for (name, bytes) in &one {
        assert!(other[name] == *bytes, "{name} differs");
    }
    let figures: Vec<_> =
        one.keys().filter_map(|name| name.strip_prefix("report/figures/")?.strip_suffix(".png")).collect();
    for name in [
        "exploration",
        "time-to-90",
        "time-to-99",
        "time-to-100",
        "box-explored",
        "scaling",
        "communication",
        "data-against-time",
    ] {
        assert!(figures.contains(&name), "{name} in {figures:?}");
    }
    for name in figures {
        let svg = std::str::from_utf8(&one[&format!("report/figures/{name}.svg")]).unwrap();
        let tree = Document::parse(svg).unwrap();
        let width: u32 = tree.root_element().attribute("width").unwrap().parse().unwrap();
        let picture = Pixmap::decode_png(&one[&format!("report/figures/{name}.png")]).unwrap();
        assert_eq!(picture.width(), 2 * width, "{name}");
        // Text is dark: without its font an image would have hardly any dark pixels.
        let ink = picture.pixels().iter().filter(|pixel| pixel.red() < 60 && pixel.green() < 60 && pixel.blue() < 60);
        assert!(ink.count() > 5000, "{name} has no text");
    }
}
