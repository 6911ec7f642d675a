//! The site that `launch_scripts/site.sh` builds: what a chapter links to is on it.
//!
//! The script builds the site and checks each link of its pages; this test needs no mdBook.

use std::collections::BTreeSet;
use std::path::{Component, Path, PathBuf};

use regex_lite::Regex;

use crate::support::root;
use crate::tidy::{name, read};

/// The chapters of the site, as files.
fn chapters() -> BTreeSet<PathBuf> {
    let link = Regex::new(r"\]\(([^)]+\.md)\)").expect("it is written here");
    let summary = read(&root().join("docs/SUMMARY.md"));
    link.captures_iter(&summary).map(|found| resolved(&root().join("docs").join(&found[1]))).collect()
}

/// The files and folders that the script copies beside the chapters.
fn copied() -> Vec<PathBuf> {
    let script = read(&root().join("launch_scripts/site.sh"));
    let (_, list) = script.split_once("\ncopied=(").expect("the script has a list");
    let (list, _) = list.split_once(')').expect("the list has an end");
    list.split_whitespace().map(|path| root().join(path)).collect()
}

/// A path without `..`.
fn resolved(path: &Path) -> PathBuf {
    let mut plain = PathBuf::new();
    for part in path.components() {
        if part == Component::ParentDir {
            plain.pop();
        } else {
            plain.push(part);
        }
    }
    plain
}

#[test]
fn links_of_chapters_lead_to_what_is_on_the_site() {
    let link = Regex::new(r"\]\(([^)\s#]+)[^)]*\)").expect("it is written here");
    let (chapters, copied) = (chapters(), copied());
    let mut checked = 0;
    let mut missing = Vec::new();
    for chapter in &chapters {
        for found in link.captures_iter(&read(chapter)) {
            let target = &found[1];
            if target.contains("://") || target.starts_with("mailto:") {
                continue;
            }
            checked += 1;
            let file = resolved(&chapter.parent().expect("a chapter lies in a folder").join(target));
            // A page that is no chapter is not rendered, and mdBook copies no Markdown.
            let is_page = file.extension().is_some_and(|extension| extension == "md");
            let is_there = file.is_file() && !is_page && copied.iter().any(|copied| file.starts_with(copied));
            if !is_there && !chapters.contains(&file) {
                missing.push(format!("{}: {target}", name(chapter)));
            }
        }
    }
    assert!(missing.is_empty(), "neither a chapter nor copied by launch_scripts/site.sh: {missing:#?}");
    assert!(chapters.len() > 40 && checked > 300, "{} chapters with {checked} links", chapters.len());
    for path in copied {
        assert!(path.exists(), "{} is copied", name(&path));
    }
}
