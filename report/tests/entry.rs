//! The page of an entry of a benchmark: what it says of its runs, and nothing of a stranger's text.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use experiments::benchmark::{EXPLORATION_1, Entry};
use experiments::rows::{FailedRun, RunMetadata};
use experiments::store::Store;
use report::entry;
use resvg::usvg::roxmltree::{Document, ParsingOptions};

/// The folder of an entry: a world with the synthetic runs of the other test, and one that has
/// failed with a message.
fn folder() -> tempfile::TempDir {
    let site = tempfile::tempdir().expect("a temporary folder");
    let runs = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/report/runs");
    let world = site.path().join("cave-50");
    let store = Store::create(&world).expect("a new folder");
    for entry in fs::read_dir(runs).expect("the synthetic runs") {
        let path = entry.expect("a readable folder").path();
        fs::copy(&path, world.join("runs").join(path.file_name().expect("a file has a name"))).expect("a copy");
    }
    let failed = FailedRun {
        id: "00000000000000ff".to_owned(),
        build: "0.1.0".to_owned(),
        controller: "dsvp".to_owned(),
        seed: 9,
        size: Some([50; 3]),
        agents: 5,
        axes: BTreeMap::new(),
        duration_s: 600.0,
        reason: "<script>alert(1)</script> & 'more'".to_owned(),
        made: RunMetadata::default(),
    };
    store.save_failure(&failed).expect("a file");
    site
}

#[test]
fn entry_has_a_page_that_escapes_everything() {
    let site = folder();
    let world = site.path().join("cave-50");
    let entry = Entry {
        controller: "\"><img src=x onerror=alert(1)>".to_owned(),
        set: BTreeMap::from([("a</style>".to_owned(), toml::Value::from("b & <c>"))]),
        command: vec!["./own".to_owned(), "</title><b>".to_owned()],
        files: BTreeMap::new(),
    };
    let examples = entry::examples(&world).unwrap();
    assert!(!examples.is_empty() && !examples.contains("00000000000000ff"), "{examples:?}");
    let kept = examples.first().unwrap();
    fs::create_dir(world.join("recordings")).unwrap();
    fs::write(world.join(format!("recordings/{kept}.mcap")), "").unwrap();
    let page = entry::write(&EXPLORATION_1, site.path(), &entry, None, Some("page/index.html")).unwrap();
    let text = fs::read_to_string(page).unwrap();
    let options = ParsingOptions { allow_dtd: true, ..ParsingOptions::default() };
    let tree = Document::parse_with_options(&text, options).unwrap();
    let mut links = Vec::new();
    let mut ids = BTreeMap::new();
    for node in tree.descendants().filter(|node| node.is_element()) {
        let name = node.tag_name().name();
        assert!(!["script", "link", "img", "b", "iframe", "object"].contains(&name), "{name}");
        for attribute in node.attributes() {
            assert!(!attribute.name().starts_with("on") && attribute.name() != "src", "{name} {attribute:?}");
            if attribute.name() == "href" {
                links.push(attribute.value());
            }
            if attribute.name() == "id" {
                assert_eq!(ids.insert(attribute.value(), name), None, "{attribute:?} is there twice");
            }
            if let Some(target) = attribute.value().strip_prefix("url(#") {
                assert!(text.contains(&format!("id=\"{}\"", target.trim_end_matches(')'))), "{attribute:?}");
            }
        }
    }
    assert_eq!(links, [format!("page/index.html?recording=../cave-50/recordings/{kept}.mcap")]);
    let read: String = tree.descendants().filter(|node| node.is_text()).filter_map(|node| node.text()).collect();
    for expected in [
        "exploration-1: \"><img src=x onerror=alert(1)>",
        "a</style> = \"b & <c>\"",
        "<script>alert(1)</script> & 'more'",
        "runs are missing, so there is no score",
        "Exploration over time",
    ] {
        assert!(read.contains(expected), "{expected}");
    }
    // Of the twelve runs three reach 99 %, and one has failed.
    let row: Vec<&str> = tree
        .descendants()
        .filter(|node| node.has_tag_name("tr"))
        .map(|row| row.children().filter_map(|cell| cell.text()).collect::<Vec<_>>())
        .find(|cells| cells.first() == Some(&"cave-50"))
        .unwrap();
    assert_eq!(row[..4], ["cave-50", "12", "3", "1"]);
    let counts: usize = row[3..].iter().map(|count| count.parse::<usize>().unwrap()).sum();
    assert_eq!(counts, 9, "each run has one cause");
}
