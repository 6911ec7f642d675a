//! The HTML page: facts about the study, figures, tables, and a list of all runs. It is well-formed
//! XML, and refers to no other file.

use std::collections::BTreeSet;
use std::fmt::Write;

use super::Contents;
use super::figures::Figure;
use super::metrics::{DISTANCE, EXPLORED};
use super::outcomes::column;
use super::study::{Study, agents_name, size_name};
use super::svg::escape;
use super::table::{Entry, Table};

/// The style sheet. Neutral colours of the figures follow the background.
const STYLE: &str = "
:root { color-scheme: light dark; --ink: #1a1a1a; --soft: #5a5a5a; --paper: #ffffff; --rule: #d8d8d8; --head: #f4f5f7; }
body { margin: 2rem auto; padding: 0 1.2rem; max-width: 72rem; background: var(--paper); color: var(--ink);
  font: 15px/1.5 'DejaVu Sans', Verdana, 'Noto Sans', sans-serif; }
h1 { font-size: 1.7rem; } h2 { margin-top: 2.5rem; border-bottom: 1px solid var(--rule); }
figure { margin: 1.6rem 0; overflow-x: auto; } figure svg { max-width: 100%; height: auto; }
figcaption, caption, .note { color: var(--soft); font-size: 0.87rem; text-align: left; max-width: 60rem; }
caption { padding-bottom: 0.5rem; }
.wide { overflow-x: auto; margin: 1.4rem 0; }
table { border-collapse: collapse; font-size: 0.82rem; font-variant-numeric: tabular-nums; }
th, td { padding: 0.25rem 0.6rem; border-bottom: 1px solid var(--rule); text-align: left; vertical-align: top; }
th { background: var(--head); vertical-align: bottom; } td { white-space: nowrap; } td.number { text-align: right; }
dt { font-weight: bold; } dd { margin: 0 0 0.4rem 1.2rem; }
pre { background: var(--head); padding: 0.8rem; overflow-x: auto; font-size: 0.82rem; } summary { cursor: pointer; }
@media (prefers-color-scheme: dark) {
  :root { --ink: #e8e8e8; --soft: #a8a8a8; --paper: #14161a; --rule: #3a3f47; --head: #1e2127; }
  svg .paper { fill: #14161a; } svg .ink { fill: #e8e8e8; } svg .ink-line { stroke: #e8e8e8; }
  svg .soft { fill: #a8a8a8; } svg .rule-line { stroke: #30343b; }
  svg .blue { fill: #3f9bd8; } svg .blue-line { stroke: #3f9bd8; }
  svg .vermillion { fill: #f0782a; } svg .vermillion-line { stroke: #f0782a; }
  svg .green { fill: #1fc795; } svg .green-line { stroke: #1fc795; }
}
";

pub(super) fn html(study: &Study, contents: &Contents) -> String {
    let title = format!("Report on {} runs", study.runs.len());
    let mut text = format!(
        "<!DOCTYPE html>\n<html lang=\"en\" xmlns=\"http://www.w3.org/1999/xhtml\">\n<head>\n<meta charset=\"utf-8\"/>\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n<title>{title}</title>\n\
         <style>{STYLE}</style>\n</head>\n<body>\n<h1>{title}</h1>\n"
    );
    text.push_str(&facts(study));
    text.push_str(&missing(study));
    text.push_str("<h2>Results</h2>\n");
    text.push_str(
        "<p class=\"note\">Functions of scenario, seed and build: a repetition gives the same numbers. Intervals are \
         95 % bootstrap intervals (BCa) over the runs of a cell, which differ in the seed and therefore in the \
         map.</p>\n",
    );
    text.extend(contents.figures.iter().map(figure));
    text.extend(contents.tables.iter().map(wide));
    if !contents.pairs.is_empty() {
        text.push_str("<h2>Pairwise comparison of controllers, seed by seed</h2>\n");
        text.extend(contents.pairs.iter().map(wide));
    }
    text.push_str("<h2>Cost of the simulation</h2>\n");
    text.push_str(
        "<p class=\"note\">Wall time: differs between machines and repetitions, and is not part of the results.</p>\n",
    );
    text.extend(contents.cost_figures.iter().map(figure));
    text.push_str(&wide(&contents.cost));
    if let Some(plan) = &study.plan {
        write!(text, "<h2>Plan</h2>\n<pre>{}</pre>\n", escape(plan)).expect("a String can be written");
    }
    write!(text, "<h2>Runs</h2>\n<details>\n<summary>All {} runs</summary>\n", study.runs.len())
        .expect("a String can be written");
    text.push_str(&wide(&runs(study)));
    text.push_str("</details>\n</body>\n</html>\n");
    text
}

/// A list of controllers, maps, team sizes, axes, seeds and builds.
fn facts(study: &Study) -> String {
    let rows = || study.runs.iter().map(|run| &run.row);
    let unique = |texts: BTreeSet<String>| texts.into_iter().collect::<Vec<_>>().join("; ");
    let sizes: BTreeSet<[u32; 3]> = rows().map(|row| row.size).collect();
    let mut facts = vec![
        ("Controllers".to_owned(), study.controllers.join(", ")),
        ("Maps".to_owned(), sizes.into_iter().map(size_name).collect::<Vec<_>>().join(", ")),
        ("Team sizes".to_owned(), study.team_sizes().into_iter().map(agents_name).collect::<Vec<_>>().join(", ")),
    ];
    for (i, key) in study.others.iter().enumerate() {
        let values: BTreeSet<_> = study.conditions.iter().map(|condition| &condition.others[i]).collect();
        facts.push((key.clone(), values.into_iter().map(|value| value.0.clone()).collect::<Vec<_>>().join(", ")));
    }
    facts.extend([
        ("Seeds".to_owned(), ranges(&study.seeds())),
        ("Longest sim time of a run".to_owned(), unique(rows().map(|row| format!("{} s", row.duration_s)).collect())),
        ("Sim time of all runs".to_owned(), format!("{:.2} h", rows().map(|row| row.end_s).sum::<f64>() / 3600.0)),
        ("Build".to_owned(), unique(rows().map(|row| row.build.clone()).collect())),
        ("Machine".to_owned(), unique(rows().map(|row| row.wall.machine.clone()).collect())),
    ]);
    let mut text = "<dl>\n".to_owned();
    for (name, value) in facts {
        writeln!(text, "<dt>{}</dt><dd>{}</dd>", escape(&name), escape(&value)).expect("a String can be written");
    }
    text.push_str("</dl>\n");
    text
}

/// A list of cells with missing seeds.
fn missing(study: &Study) -> String {
    let missing = study.missing();
    if missing.is_empty() {
        return String::new();
    }
    let seeds = study.seeds().len();
    let mut text = format!("<p>Some of the {seeds} seeds are missing in these cells:</p>\n<ul>\n");
    for (cell, count) in missing {
        writeln!(text, "<li>{}: {count} of {seeds} missing</li>", escape(&cell)).expect("a String can be written");
    }
    text.push_str("</ul>\n");
    text
}

fn figure(figure: &Figure) -> String {
    let Figure { name, caption, svg } = figure;
    format!("<figure id=\"figure-{name}\">\n{svg}<figcaption>{}</figcaption>\n</figure>\n", escape(caption))
}

fn wide(table: &Table) -> String {
    format!("<div class=\"wide\">\n{}</div>\n", table.html())
}

/// The table of all runs.
fn runs(study: &Study) -> Table {
    let mut columns = vec![column("run", "id"), column("controller", "controller"), column("map (cells)", "map")];
    columns.extend(study.others.iter().map(|key| column(key, key)));
    columns.extend([column("agents", "agents"), column("seed", "seed"), column("end reason", "reason")]);
    columns.push(column("end (s)", "end_s"));
    columns.push(column(&EXPLORED.label(), EXPLORED.key));
    columns.push(column("time to 99 % (s)", "t99_s"));
    columns.push(column(&DISTANCE.label(), DISTANCE.key));
    columns.push(column("digest", "digest"));
    let mut rows = Vec::new();
    for (condition, controller, cell) in study.cells() {
        for run in cell {
            let row = &run.row;
            let mut entries = vec![
                Entry::Text(row.id.clone()),
                Entry::Text(study.controllers[controller].clone()),
                Entry::Size(row.size),
            ];
            entries.extend(condition.others.iter().map(|value| Entry::Text(value.0.clone())));
            entries.extend([
                Entry::Count(row.agents as usize),
                Entry::Text(row.seed.to_string()),
                Entry::Text(row.reason.clone()),
                Entry::Number(Some(row.end_s), 2),
                Entry::Number(Some((EXPLORED.value)(row)), 2),
                Entry::Number(row.t99_s, 2),
                Entry::Number(Some(row.distance_m), 1),
                Entry::Text(row.digest.clone()),
            ]);
            rows.push(entries);
        }
    }
    Table { name: "runs", caption: "All runs.".to_owned(), columns, rows }
}

/// Numbers as ranges, such as 1–10, 12.
fn ranges(numbers: &BTreeSet<u64>) -> String {
    let mut ranges: Vec<(u64, u64)> = Vec::new();
    for &number in numbers {
        match ranges.last_mut() {
            Some((_, last)) if last.checked_add(1) == Some(number) => *last = number,
            _ => ranges.push((number, number)),
        }
    }
    let text = |(first, last): (u64, u64)| {
        if first == last { first.to_string() } else { format!("{first}\u{2013}{last}") }
    };
    ranges.into_iter().map(text).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seeds_are_shown_as_ranges() {
        assert_eq!(ranges(&[1, 2, 3, 7, 9, 10].into()), "1–3, 7, 9–10");
        assert_eq!(ranges(&[u64::MAX].into()), u64::MAX.to_string());
    }
}
