//! The page of an entry of a benchmark: its scores, pictures of routes and curves of each world,
//! and the runs that have not seen everything, by cause, with their recordings.
//!
//! Names, settings and commands of an entry may be a stranger's: all text is escaped, and the page
//! has no script.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::path::{Path, PathBuf};

use experiments::benchmark::{Benchmark, Entry, ResultFile};
use experiments::rows::RunRecord;
use experiments::store::{self, Store};

use super::causes::Cause;
use super::figures::{self, Figure};
use super::page::{figure, head};
use super::study::{Study, StudyError};
use super::svg::escape;
use super::{ReportError, routes, write_file};

/// Nothing is loaded and nothing is executed.
const POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'";

/// The runs of a world that show its causes: of each cause the one that has seen the least. They
/// are among those whose recordings are of interest.
///
/// # Errors
/// If the folder of the world has no runs, or one cannot be read.
pub fn examples(world: &Path) -> Result<BTreeSet<String>, StudyError> {
    let study = Study::read(world)?;
    let mut least: BTreeMap<Cause, &RunRecord> = BTreeMap::new();
    for run in &study.runs {
        // A run that has failed would fail again.
        if let Some(cause) = Cause::of(run).filter(|cause| *cause != Cause::Failed) {
            let shown = least.entry(cause).or_insert(run);
            if run.row.explored < shown.row.explored {
                *shown = run;
            }
        }
    }
    Ok(least.into_values().map(|run| run.row.id.clone()).collect())
}

/// Writes the page of an entry into the folder of its runs. `viewer` is the address of the page
/// that shows recordings, relative to that folder, if there is one.
///
/// # Errors
/// If there is no run, one cannot be read, or the page cannot be written.
pub fn write(
    benchmark: &Benchmark,
    folder: &Path,
    entry: &Entry,
    results: Option<&ResultFile>,
    viewer: Option<&str>,
) -> Result<PathBuf, ReportError> {
    let has_runs = |world: &&str| folder.join(world).join(store::RUNS).is_dir();
    let mut studies = Vec::new();
    for world in benchmark.worlds().filter(has_runs) {
        studies.push((world, Study::read(&folder.join(world))?));
    }
    let mut text = head(&format!("{}: {}", benchmark.name, entry.controller), &about(entry, results), POLICY);
    if let Some(results) = results {
        text.push_str(&tracks(results));
    }
    text.push_str(&causes(&studies));
    for (world, study) in &studies {
        text.push_str(&section(benchmark, folder, world, study, viewer)?);
    }
    text.push_str("</body>\n</html>\n");
    let page = folder.join(format!("{}.html", benchmark.name));
    write_file(&page, text.as_bytes())?;
    Ok(page)
}

/// Score, build, settings and command, in one line.
fn about(entry: &Entry, results: Option<&ResultFile>) -> String {
    let mut parts = match results {
        Some(results) => {
            let part = if results.is_whole { "" } else { " of a part of the benchmark" };
            vec![format!("score{part} {:.2}", results.score), format!("build {}", results.build)]
        }
        None => vec!["runs are missing, so there is no score".to_owned()],
    };
    parts.extend(results.and_then(|results| Some(format!("seeds of the phrase {}", results.phrase.as_ref()?))));
    parts.extend(entry.set.iter().map(|(key, value)| format!("{key} = {value}")));
    parts.extend((!entry.command.is_empty()).then(|| format!("program {:?}", entry.command)));
    parts.join(" \u{b7} ")
}

/// A table with this head; cells are escaped here.
fn table(caption: &str, head: &[&str], rows: impl IntoIterator<Item = Vec<String>>) -> String {
    let line = |tag: &str, cells: &[String]| -> String {
        let cells: String = cells.iter().map(|cell| format!("<{tag}>{}</{tag}>", escape(cell))).collect();
        format!("<tr>{cells}</tr>\n")
    };
    let head: Vec<String> = head.iter().map(ToString::to_string).collect();
    let body: String = rows.into_iter().map(|row| line("td", &row)).collect();
    format!(
        "<p class=\"note\">{}</p>\n<div class=\"wide\">\n<table>\n<thead>{}</thead>\n<tbody>\n{body}</tbody>\n</table>\n</div>\n",
        escape(caption),
        line("th", &head)
    )
}

fn tracks(results: &ResultFile) -> String {
    let row = |track: &experiments::benchmark::Track| {
        vec![
            track.world.clone(),
            track.agents.to_string(),
            track.radio.clone(),
            track.localisation.clone().unwrap_or_else(|| "exact".to_owned()),
            format!("{:.1}", track.score),
            format!("{} of {}", track.reach_99, track.runs),
            format!("{:.1}", track.mean_99_s),
        ]
    };
    let caption = "Score: mean of the area under the explored share, in per cent. A run that does not reach 99 % counts \
                   with the duration in the mean time.";
    let head = ["world", "agents", "radio", "localisation", "score", "reach 99 %", "mean time to 99 % (s)"];
    let content = table(caption, &head, results.tracks.iter().map(row));
    format!("<details id=\"tracks\">\n<summary>Tracks</summary>\n{content}</details>\n")
}

/// How many runs of each world have not seen 99 %, by cause.
fn causes(studies: &[(&str, Study)]) -> String {
    let count = |study: &Study, cause: Cause| study.runs.iter().filter(|run| Cause::of(run) == Some(cause)).count();
    let row = |(world, study): &(&str, Study)| {
        let mut cells = vec![(*world).to_owned(), study.runs.len().to_string()];
        cells.push(study.runs.iter().filter(|run| Cause::of(run).is_none()).count().to_string());
        cells.extend(Cause::ALL.map(|cause| count(study, cause).to_string()));
        cells
    };
    let mut head = vec!["world", "runs", "reach 99 %"];
    head.extend(Cause::ALL.map(Cause::name));
    let caption = "Runs that have not seen 99 % of the free cells, each with the first cause that holds.";
    let mut text = "<h2 id=\"causes\">What went wrong</h2>\n".to_owned();
    text.push_str(&table(caption, &head, studies.iter().map(row)));
    text.push_str("<dl>\n");
    for cause in Cause::ALL {
        writeln!(text, "<dt>{}</dt><dd>{}</dd>", cause.name(), cause.meaning()).expect("a String can be written");
    }
    text.push_str("</dl>\n");
    text
}

/// A world: routes, curves, and its runs that have not seen everything.
fn section(
    benchmark: &Benchmark,
    folder: &Path,
    world: &str,
    study: &Study,
    viewer: Option<&str>,
) -> Result<String, ReportError> {
    let dir = folder.join(world);
    let (routes, notes) = routes::pictures(&dir, study)?;
    let mut text = format!("<h2 id=\"{world}\">{world}</h2>\n");
    for note in notes {
        writeln!(text, "<p class=\"warning\">{}</p>", escape(&note)).expect("a String can be written");
    }
    text.push_str(&figure(&of_world(world, figures::exploration(study)?)));
    let pictures: String = routes.into_iter().map(|picture| figure(&of_world(world, picture))).collect();
    if !pictures.is_empty() {
        write!(text, "<details>\n<summary>Routes</summary>\n{pictures}</details>\n").expect("a String can be written");
    }
    let store = Store::open(&dir).map_err(StudyError::from)?;
    text.push_str(&incomplete(benchmark, &store, world, study, viewer));
    Ok(text)
}

/// A figure among those of other worlds: with ids of its own, and without what needs a script.
fn of_world(world: &str, mut figure: Figure) -> Figure {
    let (before, after) = (format!("{}-clip-", figure.name), format!("{world}-{}-clip-", figure.name));
    figure.drawn.panels.iter_mut().for_each(|panel| *panel = panel.replace(&before, &after));
    figure.name = format!("{world}-{}", figure.name);
    figure.is_by_variant = false;
    figure
}

/// The runs of a world that have not seen 99 %, by cause, with links to their recordings.
fn incomplete(benchmark: &Benchmark, store: &Store, world: &str, study: &Study, viewer: Option<&str>) -> String {
    let mut runs: Vec<(Cause, &RunRecord)> = study.runs.iter().filter_map(|run| Some((Cause::of(run)?, run))).collect();
    if runs.is_empty() {
        return String::new();
    }
    let order = |(cause, run): &(Cause, &RunRecord)| (*cause, run.row.agents, run.row.seed, run.row.id.clone());
    runs.sort_by_key(order);
    let head: String =
        ["cause", "agents", "radio", "localisation", "seed", "explored (%)", "end (s)", "end reason", "look at it"]
            .map(|name| format!("<th scope=\"col\">{name}</th>"))
            .concat();
    let mut text = format!(
        "<details>\n<summary>{} runs that have not seen 99 %</summary>\n<div class=\"wide\">\n<table>\n\
         <thead><tr>{head}</tr></thead>\n<tbody>\n",
        runs.len()
    );
    for (cause, RunRecord { row, .. }) in runs {
        // A failed run has the conditions of its plan as well; one of another plan has none.
        let (radio, localisation) = benchmark.conditions_of(row).unwrap_or_else(|_| ("\u{2013}".to_owned(), None));
        let cells = [
            cause.name().to_owned(),
            row.agents.to_string(),
            radio,
            localisation.unwrap_or_else(|| "exact".to_owned()),
            row.seed.to_string(),
            format!("{:.1}", 100.0 * row.explored),
            format!("{:.1}", row.end_s),
            row.failure().map_or_else(|| row.reason.to_string(), str::to_owned),
        ];
        let cells: String = cells.iter().map(|cell| format!("<td>{}</td>", escape(cell))).collect();
        let look = look(store, world, &row.id, viewer);
        writeln!(text, "<tr>{cells}<td>{look}</td></tr>").expect("a String can be written");
    }
    text.push_str("</tbody>\n</table>\n</div>\n</details>\n");
    text
}

/// How to look at a run: in the page beside, or with a command, if it was recorded; else the
/// command that executes it.
fn look(store: &Store, world: &str, id: &str, viewer: Option<&str>) -> String {
    // Of other letters, an id of a stranger's file is no part of a link.
    let is_plain = !id.is_empty() && id.bytes().all(|byte| byte.is_ascii_alphanumeric());
    if !is_plain {
        return "\u{2013}".to_owned();
    }
    let recording = format!("{world}/recordings/{id}.mcap");
    match (store.recording_file(id).exists(), viewer) {
        (true, Some(viewer)) => {
            let viewer = escape(viewer);
            format!("<a href=\"{viewer}?recording=../{recording}\">open</a> <code>maes view {recording}</code>")
        }
        (true, None) => format!("<a href=\"{recording}\">recording</a> <code>maes view {recording}</code>"),
        (false, _) if store.has_scenario(id) => format!("<code>maes view {world}/runs/{id}.toml</code>"),
        (false, _) => "\u{2013}".to_owned(),
    }
}
