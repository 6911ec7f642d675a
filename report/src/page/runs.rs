//! The table of all runs on the page: each with its metrics and the commands that lead to it.

use std::collections::BTreeSet;
use std::fmt::Write;

use super::super::metrics::{DISTANCE, EXPLORED};
use super::super::outcomes::column;
use super::super::study::{Study, Value};
use super::super::svg::escape;
use super::super::table::{Entry, Table};
use experiments::plan::MAP_FILE;

/// What the folder has of its runs, by id.
#[derive(Debug, Default)]
pub(in super::super) struct RetainedRecordings {
    /// Runs with a scenario.
    pub(in super::super) scenarios: BTreeSet<String>,
    /// Runs with a recording.
    pub(in super::super) recordings: BTreeSet<String>,
}

/// All runs in the order of the study, each once, with an anchor `run-<id>`.
pub(super) fn html(study: &Study, kept: &RetainedRecordings) -> String {
    let has_maps = !study.map_files().is_empty();
    let mut columns = vec![column("run", "id"), column(&study.variant_title, "variant")];
    columns.extend(has_maps.then(|| column("map file", MAP_FILE)));
    columns.push(column("map (cells)", "map"));
    columns.extend(study.others.iter().map(|key| column(key, key)));
    columns.extend([column("agents", "agents"), column("seed", "seed"), column("end reason", "reason")]);
    columns.push(column("end (s)", "end_s"));
    columns.push(column(&EXPLORED.label(), EXPLORED.key));
    columns.push(column("time to 99 % (s)", "t99_s"));
    columns.push(column(&DISTANCE.label(), DISTANCE.key));
    columns.push(column("digest", "digest"));
    let mut head = String::new();
    for (title, _) in &columns {
        write!(head, "<th scope=\"col\">{}</th>", escape(title)).expect("a String can be written");
    }
    head.push_str("<th scope=\"col\">run it again</th><th scope=\"col\">look at it</th>");
    let mut text =
        format!("<div class=\"wide\">\n<table id=\"table-runs\">\n<thead><tr>{head}</tr></thead>\n<tbody>\n");
    let mut listed = BTreeSet::new();
    for condition in &study.conditions {
        for (variant, name) in study.variants.iter().enumerate() {
            let independent: BTreeSet<&str> =
                study.cell(condition, variant).iter().map(|run| run.row.id.as_str()).collect();
            for run in study.all_of_cell(condition, variant) {
                let row = &run.row;
                if !listed.insert(&row.id) {
                    continue;
                }
                let mut entries = vec![Entry::Text(name.clone())];
                entries.extend(row.axes.get(MAP_FILE).filter(|_| has_maps).cloned().map(Entry::Text));
                entries.push(Entry::Size(row.size));
                let others = study.others.iter().map(|key| {
                    let value = row.axes.get(key).map_or("\u{2013}", String::as_str);
                    Entry::Text(study.shown(key, &Value(value.to_owned())))
                });
                entries.extend(others);
                let reason = if independent.contains(row.id.as_str()) {
                    row.failure().map_or_else(|| row.reason.to_string(), |why| format!("failed: {why}"))
                } else {
                    format!("{} (repeats a run)", row.reason)
                };
                entries.extend([
                    Entry::Count(row.agents as usize),
                    Entry::Text(row.seed.to_string()),
                    Entry::Text(reason),
                    Entry::Number(Some(row.end_s), 2),
                    Entry::Number(Some((EXPLORED.value)(row)), 2),
                    Entry::Number(row.t99_s, 2),
                    Entry::Number(Some(row.distance_m), 1),
                    Entry::Text(row.digest.get(..16).unwrap_or(&row.digest).to_owned()),
                ]);
                let id = escape(&row.id);
                write!(text, "<tr id=\"run-{id}\"><td><a href=\"#run-{id}\"><code>{id}</code></a></td>")
                    .expect("a String can be written");
                text.extend(entries.iter().map(Table::cell));
                text.push_str(&commands(&row.id, kept));
                text.push_str("</tr>\n");
            }
        }
    }
    text.push_str("</tbody>\n</table>\n</div>\n");
    text
}

/// The commands of a run, from the folder of the plan.
fn commands(id: &str, kept: &RetainedRecordings) -> String {
    let id_text = escape(id);
    let again = if kept.scenarios.contains(id) {
        format!("<code>maes run runs/{id_text}.toml</code>")
    } else {
        "\u{2013}".to_owned()
    };
    let look = if kept.recordings.contains(id) {
        format!(
            "<code>maes view recordings/{id_text}.mcap</code> (<a href=\"../recordings/{id_text}.mcap\">recording</a>)"
        )
    } else if kept.scenarios.contains(id) {
        format!("<code>maes view runs/{id_text}.toml</code>")
    } else {
        "\u{2013}".to_owned()
    };
    format!("<td>{again}</td><td>{look}</td>")
}
