//! Rules of the documents: what they name exists, and every one is a chapter of the site.

use std::collections::BTreeSet;

use regex_lite::Regex;

use crate::support::root;
use crate::tidy::{CRATES, files, name, read};

/// Every path of the workspace in a document exists.
#[test]
fn documents_name_files_that_exist() {
    let folders: Vec<String> =
        CRATES.into_iter().chain(["tests", "launch_scripts", "docs"]).map(str::to_owned).collect();
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
            if is_ours {
                assert!(root().join(path).exists(), "{} names {path}, which does not exist", name(&document));
                named.insert(path.to_owned());
            }
        }
    }
    assert!(named.contains("launch_scripts/run.sh"), "the README says how to start a run: {named:?}");
}

/// Every link between documents leads to a file, and to a heading if it names one.
#[test]
fn links_of_documents_lead_somewhere() {
    let mut documents = files("docs", "md");
    let tops = ["README.md", "ARCHITECTURE.md", "CONTRIBUTING.md", "SECURITY.md", "CHANGELOG.md"];
    documents.extend(tops.map(|document| root().join(document)));
    let link = Regex::new(r"\]\(([^)\s]+)\)").expect("it is written here");
    let mut checked = 0;
    let mut broken = Vec::new();
    for document in documents {
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
