//! The scenarios of docs/gallery.md end as the page says.

use std::collections::BTreeSet;

use crate::support::processes::Process;
use crate::support::root;
use crate::support::runs::{Site, scenario, text};

/// The scenario that is left out, because it takes minutes.
const LEFT_OUT: &str = "fine-cave";

/// The scenarios of the page: name, end, digest.
fn scenarios() -> Vec<(String, String, String)> {
    let page = std::fs::read_to_string(root().join("docs/gallery.md")).expect("there is a page");
    let rows = page.lines().filter(|line| line.starts_with("| `"));
    rows.map(|row| {
        let cells: Vec<&str> = row.trim_matches('|').split('|').map(|cell| cell.trim().trim_matches('`')).collect();
        let [name, _, ends, digest] = cells[..] else { panic!("four columns: {row}") };
        (name.to_owned(), ends.to_owned(), digest.to_owned())
    })
    .collect()
}

#[test]
fn scenarios_end_as_documented() {
    let site = Site::new();
    let mut named = BTreeSet::new();
    for (name, ends, digest) in scenarios() {
        named.insert(format!("{name}.toml"));
        let file = scenario(&format!("{name}.toml"));
        if name == LEFT_OUT {
            continue;
        }
        let run = Process::start(site.binary("maes").args(["run", "--transport", "memory", text(&file)]))
            .ended()
            .with_code(0);
        assert_eq!(run.digest(), digest, "{name}");
        let (time, reason) = ends.split_once(", ").expect("a time and a reason");
        let end = format!("ended after {time} of sim time");
        let said = run.stdout.lines().find(|line| line.starts_with(&end)).unwrap_or_else(|| panic!("{name}: {run}"));
        assert!(said.ends_with(&format!(": {reason}")), "{name}: {said}");
    }
    let folder = root().join("launch_scripts/scenarios");
    let files = std::fs::read_dir(folder).expect("there is a folder");
    let files: BTreeSet<String> =
        files.map(|file| file.expect("it can be read").file_name().to_string_lossy().into_owned()).collect();
    let scenarios: BTreeSet<String> = files.into_iter().filter(|name| name.ends_with(".toml")).collect();
    assert_eq!(named, scenarios);
}

#[test]
fn maps_have_the_documented_hashes() {
    let site = Site::new();
    let page = std::fs::read_to_string(root().join("docs/gallery.md")).expect("there is a page");
    let mut made = String::new();
    let mut compared = 0;
    for line in page.lines() {
        let command = line.strip_prefix("maes ").filter(|command| command.starts_with("map "));
        if let Some(command) = command.filter(|command| !command.starts_with("map check ")) {
            let run = Process::start(site.binary("maes").args(command.split(' '))).ended().with_code(0);
            let hash = run.stdout.lines().find_map(|line| line.strip_prefix("blake3"));
            made = hash.unwrap_or_else(|| panic!("{command}: {run}")).trim().to_owned();
        } else if let Some(hash) = line.strip_prefix("Its hash is `") {
            assert_eq!(hash.trim_end_matches("`."), made);
            compared += 1;
        }
    }
    assert_eq!(compared, 5);
}
