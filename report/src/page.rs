//! The HTML page: verdicts, evidence, figures, tables, and a list of all runs. It is well-formed
//! XML, and refers to nothing but the recordings beside it. Without its script, which adds values
//! at the pointer, it is complete.

mod runs;

use std::collections::BTreeSet;
use std::fmt::Write;

use super::Contents;
use super::evidence;
use super::figures::Figure;
use super::marks::{self, Mark};
use super::study::{Study, agents_name, size_name};
use super::svg::escape;
use super::table::Table;
use super::verdicts::{self, Verdict, Verdicts};
pub(super) use runs::RetainedRecordings;

/// The style sheet. Neutral colours of the figures follow the background.
const STYLE: &str = include_str!("page/style.css");
const SCRIPT: &str = include_str!("page/script.js");
/// Nothing is loaded, not even from the page's own place.
const POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'";
/// Number of names in the title of a report whose plan has none.
const NAMES_MAX: usize = 4;

/// What the page says about itself beside the runs.
#[derive(Debug, Clone, Default)]
pub struct Heading {
    /// Instead of the title of the plan.
    pub title: Option<String>,
    /// Instead of the days on which the runs were executed.
    pub date: Option<String>,
}

/// A page up to its heading and the line below it, which are escaped here; `policy` is its content
/// security policy.
pub(super) fn head(title: &str, line: &str, policy: &str) -> String {
    let title = escape(title);
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\" xmlns=\"http://www.w3.org/1999/xhtml\">\n<head>\n<meta charset=\"utf-8\"/>\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n\
         <meta http-equiv=\"Content-Security-Policy\" content=\"{policy}\"/>\n<title>{title}</title>\n\
         <style>\n{STYLE}</style>\n</head>\n<body>\n<h1>{title}</h1>\n<p class=\"meta\">{}</p>\n",
        escape(line)
    )
}

pub(super) fn html(study: &Study, contents: &Contents, heading: &Heading, kept: &RetainedRecordings) -> String {
    let title = heading.title.clone().or_else(|| study.design.title.clone()).unwrap_or_else(|| default_title(study));
    let mut text = head(&title, &meta(study, heading), POLICY);
    text.push_str(&warnings(study));
    text.push_str(&table_of_contents(study, contents));
    text.push_str(&verdict_list(study, &contents.verdicts));
    text.extend(contents.summary.iter().map(wide));
    let (first, further) = contents.figures.split_at(contents.figures.len().min(contents.shown));
    text.extend(first.iter().map(figure));
    text.push_str(&section("setup", "What was run"));
    text.push_str(&facts(study));
    text.push_str(&missing(study));
    text.push_str(&section("results", "All results"));
    text.push_str(
        "<p class=\"note\">Functions of scenario, seed and build: a repetition gives the same numbers. Intervals are \
         95 % bootstrap intervals (BCa) over the independent runs. Point at a curve for its values; a name in a legend \
         hides its lines; a click on the line or dot of a run leads to its row.</p>\n",
    );
    text.push_str(&folded("figures", "Figures", &further.iter().map(figure).collect::<String>()));
    text.push_str(&folded("tables", "Tables", &contents.tables.iter().map(wide).collect::<String>()));
    if !contents.pairs.is_empty() {
        let pairs: String = contents.pairs.iter().map(wide).collect();
        text.push_str(&folded("pairs", "Comparison pair by pair", &pairs));
    }
    let cost_figures: String = contents.cost_figures.iter().map(figure).collect();
    let about = "Wall time: differs between machines and repetitions, and is not part of the results.";
    let cost = format!("<p class=\"note\">{about}</p>\n{cost_figures}{}", wide(&contents.cost));
    text.push_str(&folded("cost", "Cost of the simulation", &cost));
    if let Some(plan) = &study.plan {
        text.push_str(&folded("plan", "Plan", &format!("<pre>{}</pre>\n", escape(plan))));
    }
    let about = "<p class=\"note\">Commands are for the folder of the plan, which holds plan.toml. <code>maes batch plan.toml \
         --out . --run ID --keep all</code> executes a run again, compares it with its row, and keeps its \
         recording.</p>\n";
    text.push_str(&folded(
        "runs",
        &format!("All {} runs", study.runs.len()),
        &format!("{about}{}", runs::html(study, kept)),
    ));
    text.push_str(&script(study));
    text.push_str("</body>\n</html>\n");
    text
}

fn default_title(study: &Study) -> String {
    match study.variants.as_slice() {
        [first @ .., last] if (1..NAMES_MAX).contains(&first.len()) => {
            format!("Comparison of {} and {last}", first.join(", "))
        }
        [_] => format!("Report on {} runs", study.runs.len()),
        variants => format!("Comparison of {} variants", variants.len()),
    }
}

/// Date, number of runs and observations, build.
fn meta(study: &Study, heading: &Heading) -> String {
    let date = heading.date.clone().or_else(|| {
        let (first, last) = study.dates()?;
        Some(if first == last { format!("Runs of {first}") } else { format!("Runs of {first} to {last}") })
    });
    let builds: BTreeSet<&str> = study.runs.iter().map(|run| run.row.build.as_str()).collect();
    let builds = builds.into_iter().collect::<Vec<_>>().join(", ");
    let parts = date.into_iter().chain([format!("{} runs", study.runs.len()), format!("build {builds}")]);
    parts.collect::<Vec<_>>().join(" \u{b7} ")
}

fn section(id: &str, title: &str) -> String {
    format!("<h2 id=\"{id}\">{title}</h2>\n")
}

/// A section that is closed at first. A link to something in it opens it.
fn folded(id: &str, title: &str, content: &str) -> String {
    if content.is_empty() {
        return String::new();
    }
    format!("<details id=\"{id}\">\n<summary>{title}</summary>\n{content}</details>\n")
}

/// What a reader has to know before the results.
fn warnings(study: &Study) -> String {
    let warnings = evidence::warnings(study);
    if warnings.is_empty() {
        return String::new();
    }
    let paragraphs: String = warnings.iter().map(|warning| format!("<p>{}</p>\n", escape(warning))).collect();
    format!("<div class=\"warning\" role=\"note\">\n{paragraphs}</div>\n")
}

fn table_of_contents(study: &Study, contents: &Contents) -> String {
    let mut links = Vec::new();
    links.extend((!contents.verdicts.is_empty()).then(|| ("verdicts".to_owned(), "Verdicts".to_owned())));
    links.push(("setup".to_owned(), "What was run".to_owned()));
    let figures = |figures: &[Figure]| {
        let link = |figure: &Figure| (format!("figure-{}", figure.name), figure.title.clone());
        figures.iter().map(link).collect::<Vec<_>>()
    };
    links.extend(figures(&contents.figures));
    links.push(("table-outcome".to_owned(), "Tables of results".to_owned()));
    links.extend((!contents.pairs.is_empty()).then(|| ("pairs".to_owned(), "Comparison pair by pair".to_owned())));
    links.push(("cost".to_owned(), "Cost of the simulation".to_owned()));
    links.extend(study.plan.as_ref().map(|_| ("plan".to_owned(), "Plan".to_owned())));
    links.push(("runs".to_owned(), "Runs".to_owned()));
    let items = links.into_iter().map(|(id, name)| format!("<li><a href=\"#{id}\">{}</a></li>\n", escape(&name)));
    format!("<nav aria-label=\"Contents\">\n<ul>\n{}</ul>\n</nav>\n", items.collect::<String>())
}

fn verdict_list(study: &Study, of_panels: &[Verdicts]) -> String {
    if of_panels.is_empty() {
        return String::new();
    }
    let mut text = section("verdicts", "Verdicts");
    writeln!(text, "<p class=\"note\">{}</p>", escape(&verdicts::about(study))).expect("a String can be written");
    for Verdicts { panel, verdicts } in of_panels {
        if !panel.is_empty() && study.conditions.len() > 1 {
            writeln!(text, "<h3>{}</h3>", escape(panel)).expect("a String can be written");
        }
        let item = |Verdict { sentence, second, .. }: &Verdict| {
            let second = second
                .as_ref()
                .map_or_else(String::new, |second| format!("<br/><span class=\"note\">{}</span>", escape(second)));
            format!("<li>{}{second}</li>\n", escape(sentence))
        };
        let items: String = verdicts.iter().map(item).collect();
        write!(text, "<ul class=\"verdicts\">\n{items}</ul>\n").expect("a String can be written");
    }
    text.push_str(
        "<p class=\"note\">The effect with its 95 % interval comes first. Effect, interval and p-value are of the same \
         quantity. p-values are adjusted for all comparisons of a panel (Holm); there is none below 6 independent \
         pairs.</p>\n",
    );
    text
}

/// A list of variants, maps, team sizes, axes, seeds and builds.
fn facts(study: &Study) -> String {
    let rows = || study.runs.iter().map(|run| &run.row);
    let machines = || rows().map(|row| row.wall.machine.clone()).filter(|machine| !machine.is_empty());
    let unique = |texts: BTreeSet<String>| texts.into_iter().collect::<Vec<_>>().join("; ");
    let sizes: BTreeSet<[u32; 3]> = rows().map(|row| row.size).collect();
    let teams: BTreeSet<u32> = rows().map(|row| row.agents).collect();
    let mut compared = study.variant_title.clone();
    compared[..1].make_ascii_uppercase();
    let mut facts = vec![
        (compared, study.variants.join(", ")),
        ("Controllers".to_owned(), unique(rows().map(|row| row.controller.clone()).collect())),
        ("Maps".to_owned(), sizes.into_iter().map(size_name).collect::<Vec<_>>().join(", ")),
        ("Map files".to_owned(), study.map_files().into_iter().collect::<Vec<_>>().join(", ")),
        ("Team sizes".to_owned(), teams.into_iter().map(agents_name).collect::<Vec<_>>().join(", ")),
    ];
    if facts[0].0 == "Controller" {
        facts.remove(0);
    }
    for (i, key) in study.others.iter().enumerate() {
        let values: BTreeSet<_> = study.conditions.iter().map(|condition| &condition.others[i]).collect();
        facts.push((
            key.clone(),
            values.into_iter().map(|value| study.shown(key, value)).collect::<Vec<_>>().join(", "),
        ));
    }
    let independent = study.cells().map(|(_, _, runs)| runs.len()).collect::<BTreeSet<_>>();
    let each = match (independent.first(), independent.last()) {
        (Some(least), Some(most)) if least == most => format!("{most} for each variant and panel"),
        (Some(least), Some(most)) => format!("{least} to {most} for each variant and panel"),
        _ => String::new(),
    };
    facts.extend([
        ("Seeds".to_owned(), ranges(&study.seeds())),
        ("Independent observations".to_owned(), each),
        ("Longest sim time of a run".to_owned(), unique(rows().map(|row| format!("{} s", row.duration_s)).collect())),
        ("Sim time of all runs".to_owned(), format!("{:.2} h", rows().map(|row| row.end_s).sum::<f64>() / 3600.0)),
        ("Machine".to_owned(), unique(machines().collect())),
    ]);
    let mut text = "<dl>\n".to_owned();
    for (name, value) in facts.into_iter().filter(|(_, value)| !value.is_empty()) {
        writeln!(text, "<dt>{}</dt><dd>{}</dd>", escape(&name), escape(&value)).expect("a String can be written");
    }
    text.push_str("</dl>\n");
    text
}

/// A list of cells with missing blocks.
fn missing(study: &Study) -> String {
    let missing = study.missing();
    if missing.is_empty() {
        return String::new();
    }
    let blocks = study.blocks();
    let what = if study.map_files().is_empty() { "seeds" } else { "combinations of map file and seed" };
    let mut text = format!("<p>Some of the {blocks} {what} are missing:</p>\n<ul>\n");
    for (cell, count) in missing {
        writeln!(text, "<li>{}: {count} of {blocks} missing</li>", escape(&cell)).expect("a String can be written");
    }
    text.push_str("</ul>\n");
    text
}

pub(super) fn figure(figure: &Figure) -> String {
    let Figure { name, title, caption, legend, is_by_variant, drawn } = figure;
    let entry = |(place, (mark, name)): (usize, &(Mark, String))| {
        let (swatch, name) = (marks::swatch(*mark), escape(name));
        if *is_by_variant {
            format!(
                "<li><button type=\"button\" aria-pressed=\"true\" data-toggles=\"{place}\">{swatch}{name}</button></li>\n"
            )
        } else {
            format!("<li>{swatch}{name}</li>\n")
        }
    };
    let legend: String = legend.iter().enumerate().map(entry).collect();
    format!(
        "<figure id=\"figure-{name}\">\n<h3>{}</h3>\n<ul class=\"legend\">\n{legend}</ul>\n<div class=\"panels\">\n{}</div>\n\
         <figcaption>{}</figcaption>\n</figure>\n",
        escape(title),
        drawn.panels.concat(),
        escape(caption)
    )
}

fn wide(table: &Table) -> String {
    format!("<p class=\"note\">{}</p>\n<div class=\"wide\">\n{}</div>\n", escape(&table.caption), table.html())
}

/// The script, and the names of the variants for it.
fn script(study: &Study) -> String {
    // `<` cannot end the element, and the text is also XML.
    let names = serde_json::to_string(&study.variants).expect("names are texts");
    let names = names.replace('<', "\\u003c").replace('&', "\\u0026").replace("]]>", "]]\\u003e");
    format!(
        "<script type=\"application/json\" id=\"names\">{names}</script>\n<script>//<![CDATA[\n{SCRIPT}//]]></script>\n"
    )
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
