//! Rules of the documents: what they name exists, and every one is a chapter of the site.

use std::collections::BTreeSet;

use regex_lite::Regex;
use simulation::scenario::keys;

use crate::support::root;
use crate::tidy::{CRATES, documents, files, name, read, sources};

/// Every path of the workspace in a document exists.
#[test]
fn documents_name_files_that_exist() {
    let folders: Vec<String> =
        CRATES.into_iter().chain(["tests", "testing", "launch_scripts", "docs"]).map(str::to_owned).collect();
    let mut documents = files("docs", "md");
    documents.extend(files("launch_scripts/scenarios", "toml"));
    documents.extend(["README.md", "ARCHITECTURE.md"].map(|document| root().join(document)));
    let mut named = BTreeSet::new();
    for document in documents {
        let text = read(&document);
        for word in text.split(|c: char| c.is_whitespace() || "`()[]<>,;:\"'|*{}".contains(c)) {
            let file = word.split_once('#').map_or(word, |(file, _)| file);
            let path = file.trim_start_matches("./").trim_end_matches(['.', '/']);
            let is_ours = path.split_once('/').is_some_and(|(folder, _)| folders.iter().any(|ours| ours == folder));
            // Names of environments look like paths.
            let is_environment = path.ends_with("-v0");
            if is_ours && !is_environment {
                assert!(root().join(path).exists(), "{} names {path}, which does not exist", name(&document));
                named.insert(path.to_owned());
            }
        }
    }
    assert!(named.contains("launch_scripts/run.sh"), "the README says how to start a run: {named:?}");
}

/// Every link between documents, and from notebooks, leads to a file, and to a heading if it names
/// one.
#[test]
fn links_of_documents_lead_somewhere() {
    let link = Regex::new(r"\]\(([^)\s]+)\)").expect("it is written here");
    let mut checked = 0;
    let mut broken = Vec::new();
    let notebooks = files("docs/notebooks", "ipynb");
    assert!(!notebooks.is_empty(), "there are notebooks");
    for document in documents().into_iter().chain(notebooks) {
        for found in link.captures_iter(&read(&document)) {
            let target = &found[1];
            if target.contains("://") || target.starts_with("mailto:") {
                continue;
            }
            checked += 1;
            let (path, heading) = target.split_once('#').unwrap_or((target, ""));
            let file = if path.is_empty() {
                document.clone()
            } else {
                document.parent().expect("a document lies in a folder").join(path)
            };
            let is_whole = file.exists() && (heading.is_empty() || headings(&read(&file)).contains(heading));
            if !is_whole {
                broken.push(format!("{}: {target}", name(&document)));
            }
        }
    }
    assert!(broken.is_empty(), "links that lead nowhere: {broken:#?}");
    assert!(checked > 100, "{checked} links");
}

/// The anchors of the headings of a document, as forges and mdBook make them.
fn headings(text: &str) -> BTreeSet<String> {
    let mut is_code = false;
    let mut anchors = BTreeSet::new();
    for line in text.lines() {
        is_code ^= line.starts_with("```");
        if !is_code && line.starts_with('#') {
            let title = line.trim_start_matches('#').trim().to_lowercase();
            let kept = title.chars().filter(|c| c.is_alphanumeric() || " -_".contains(*c));
            anchors.insert(kept.map(|c| if c == ' ' { '-' } else { c }).collect());
        }
    }
    anchors
}

/// All documents are chapters of the site.
#[test]
fn documents_are_in_the_book() {
    let summary = read(&root().join("docs/SUMMARY.md"));
    for document in files("docs", "md") {
        let file = document.file_name().expect("it has a name").to_string_lossy().into_owned();
        assert!(file == "SUMMARY.md" || summary.contains(&format!("]({file})")), "docs/SUMMARY.md lacks {file}");
    }
}

/// Every key of a scenario that a document names in backticks is one.
#[test]
fn documented_keys_exist() {
    let code = Regex::new(r"`([a-z]+(?:\.[a-z_]+)+)(?: = [^`]*)?`").expect("it is written here");
    let mut checked = 0;
    let mut unknown = Vec::new();
    for document in documents() {
        for found in code.captures_iter(&read(&document)) {
            let path = &found[1];
            let (first, _) = path.split_once('.').expect("the pattern has a dot");
            let is_settings = path.contains(".set.");
            if keys::table(first).is_none() || is_settings || is_file(path) {
                continue;
            }
            checked += 1;
            if keys::find(path).is_none() && keys::table(path).is_none() {
                unknown.push(format!("{}: {path}", name(&document)));
            }
        }
    }
    assert!(unknown.is_empty(), "no keys of a scenario: {unknown:#?}");
    assert!(checked > 50, "{checked} keys");
}

/// Whether a word with dots is the name of a file rather than a key.
fn is_file(word: &str) -> bool {
    [".csv", ".json", ".md", ".mcap", ".parquet", ".py", ".rs", ".sh", ".toml", ".txt", ".yaml"]
        .iter()
        .any(|end| word.ends_with(end))
}

/// Messages of docs/troubleshooting.md that Python words.
const OF_PYTHON: [&str; 1] = ["ModuleNotFoundError: No module named 'maes'"];

/// Every message that docs/troubleshooting.md explains is printed by some source.
#[test]
fn explained_messages_exist() {
    let code = CRATES.into_iter().flat_map(sources).map(|(_, code)| unwrapped(&code));
    let scripts = files("launch_scripts", "sh").into_iter().map(|script| read(&script));
    let pictures = files("viewer/pictures", "mjs").into_iter().map(|script| read(&script));
    let compose = read(&root().join("launch_scripts/docker/compose.yaml"));
    let printed: String = code.chain(scripts).chain(pictures).chain([compose]).collect();
    let text = read(&root().join("docs/troubleshooting.md"));
    let message = Regex::new(r"`([^`]+)`").expect("it is written here");
    // A name or number of the example, where the source has a placeholder.
    let example = Regex::new(r"\.\.\.|\bN\b|\bM\b|\bT\b|\b\d+(?:\.\d+| s\b)").expect("it is written here");
    let (messages, _) = text.split_once("## Without a message").expect("the page ends with what has no message");
    let rows = messages.lines().filter(|line| line.starts_with("| `"));
    let mut checked = 0;
    let mut missing = Vec::new();
    for row in rows {
        let first = row.split('|').nth(1).expect("a row has cells");
        for found in message.captures_iter(first) {
            for part in example.split(&found[1]) {
                let part = part.trim();
                if part.chars().filter(char::is_ascii_alphabetic).count() < 8 {
                    continue;
                }
                checked += 1;
                let is_known = printed.contains(part) || OF_PYTHON.iter().any(|known| known.contains(part));
                if !is_known {
                    missing.push(part.to_owned());
                }
            }
        }
    }
    assert!(missing.is_empty(), "messages that nothing prints: {missing:#?}");
    assert!(checked > 20, "{checked} messages");
}

/// A source with the texts that go over several lines joined.
fn unwrapped(source: &str) -> String {
    Regex::new(r"\\\n\s*").expect("it is written here").replace_all(source, "").into_owned()
}
