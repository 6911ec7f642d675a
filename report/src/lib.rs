//! Reports: an HTML page, figures and tables of the runs of a folder.
//!
//! [`write()`] reads `DIR/runs/*.json` and `DIR/plan.toml`, and writes `DIR/report/report.html`,
//! which is self-contained, `DIR/report/figures/*.{svg,png}`, without the feature `png` SVG alone,
//! and `DIR/report/tables/*.{md,tex,csv}`.
//!
//! Invariants: the same folder makes the same bytes; no run is excluded because of its outcome. A
//! run that repeats another one is no observation of its own. An incomplete plan is reported as it
//! is, with a list of the missing runs. Nothing is executed, but by [`routes::record`].
//!
//! Plots and SVG are our own code: no plotting library guarantees the same bytes across its
//! versions.

mod causes;
mod design;
pub mod entry;
mod estimates;
mod evidence;
mod figures;
#[cfg(test)]
pub(crate) mod fixture;
mod floor_plan;
mod marks;
mod measure;
mod metrics;
mod outcomes;
mod page;
mod pairs;
mod plot;
#[cfg(feature = "png")]
mod png;
pub mod regression;
pub mod routes;
mod study;
mod svg;
mod table;
mod verdict_table;
mod verdicts;

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use thiserror::Error;

use self::figures::Figure;
pub use self::page::Heading;
use self::page::RetainedRecordings;
#[cfg(feature = "png")]
pub use self::png::PngError;
#[cfg(feature = "png")]
use self::png::Renderer;
use self::study::Study;
pub use self::study::StudyError;
use self::table::Table;
pub use self::verdict_table::verdict_table;
use self::verdicts::{Verdict, Verdicts};
use experiments::store::Store;
use statistics::StatisticsError;

#[derive(Debug, Error)]
pub enum ReportError {
    #[error(transparent)]
    Study(#[from] StudyError),
    /// A run has a metric that is not finite, or too large.
    #[error("the runs have an invalid metric: {0}")]
    Statistics(#[from] StatisticsError),
    #[cfg(feature = "png")]
    #[error("figure {figure}: {error}")]
    Png { figure: String, error: PngError },
    #[error("cannot write {path}: {error}", path = path.display())]
    Write { path: PathBuf, error: io::Error },
}

/// A report that has been written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ReportSummary {
    pub page: PathBuf,
    pub runs: usize,
    /// Number of runs that are missing for a complete comparison.
    pub lacking: usize,
    /// What a reader has to know about the evidence, one sentence each.
    pub warnings: Vec<String>,
    /// The verdicts, each with its panel, and below it in a line of its own what the second test
    /// says.
    pub verdicts: Vec<String>,
}

/// The content of a report.
struct Contents {
    verdicts: Vec<Verdicts>,
    /// The table for a paper.
    summary: Option<Table>,
    figures: Vec<Figure>,
    /// Of the figures, those that are not folded.
    shown: usize,
    /// What to know about them, one sentence each.
    notes: Vec<String>,
    tables: Vec<Table>,
    pairs: Vec<Table>,
    cost_figures: Vec<Figure>,
    cost: Table,
}

impl Contents {
    fn of(dir: &Path, study: &Study) -> Result<Self, ReportError> {
        let (routes, notes) = routes::pictures(dir, study)?;
        let mut figures = figures::deterministic(study)?;
        let shown = 1 + usize::from(!routes.is_empty());
        // Behind the curves of exploration.
        figures.splice(1..1, routes);
        Ok(Self {
            verdicts: verdicts::verdicts(study)?,
            summary: pairs::summary(study)?,
            figures,
            shown,
            notes,
            tables: outcomes::tables(study)?,
            pairs: pairs::tables(study)?,
            cost_figures: figures::of_wall_time(study)?,
            cost: outcomes::cost(study)?,
        })
    }
}

/// Writes the report of a folder of runs into its folder `report`, over an earlier one.
///
/// # Errors
/// If there are no runs, one cannot be read or has a metric that is not finite, or a file cannot be
/// written.
pub fn write(dir: &Path) -> Result<ReportSummary, ReportError> {
    write_with(dir, &Heading::default())
}

/// Writes the report with a title and a date that are given, see [`write()`].
///
/// # Errors
/// As [`write()`].
pub fn write_with(dir: &Path, heading: &Heading) -> Result<ReportSummary, ReportError> {
    let study = Study::read(dir)?;
    let kept = kept(dir, &study)?;
    let contents = Contents::of(dir, &study)?;
    let report = dir.join("report");
    for folder in ["figures", "tables"] {
        let path = report.join(folder);
        fs::create_dir_all(&path).map_err(|error| ReportError::Write { path, error })?;
    }
    #[cfg(feature = "png")]
    let renderer = Renderer::new();
    contents.figures.par_iter().chain(&contents.cost_figures).try_for_each(|figure| {
        let Figure { name, drawn, .. } = figure;
        let svg = &drawn.svg;
        #[cfg(feature = "png")]
        {
            let png = renderer.png(svg).map_err(|error| ReportError::Png { figure: name.clone(), error })?;
            write_file(&report.join(format!("figures/{name}.png")), &png)?;
        }
        write_file(&report.join(format!("figures/{name}.svg")), svg.as_bytes())
    })?;
    for table in contents.summary.iter().chain(&contents.tables).chain(&contents.pairs).chain([&contents.cost]) {
        let name = table.name;
        write_file(&report.join(format!("tables/{name}.md")), table.markdown().as_bytes())?;
        write_file(&report.join(format!("tables/{name}.tex")), table.latex().as_bytes())?;
        write_file(&report.join(format!("tables/{name}.csv")), &table.csv())?;
    }
    let page = report.join("report.html");
    write_file(&page, page::html(&study, &contents, heading, &kept).as_bytes())?;
    let missing = study.missing().iter().map(|(_, count)| count).sum();
    let said = |of_panel: &Verdicts| {
        let panel = if study.conditions.len() > 1 { format!("{}: ", of_panel.panel) } else { String::new() };
        let of = move |said: &Verdict| {
            let second = said.second.as_ref().map_or_else(String::new, |second| format!("\n    {second}"));
            format!("{panel}{}{second}", said.sentence)
        };
        of_panel.verdicts.iter().map(of).collect::<Vec<_>>()
    };
    Ok(ReportSummary {
        page,
        runs: study.runs.len(),
        lacking: missing,
        warnings: evidence::warnings(&study).into_iter().chain(contents.notes).collect(),
        verdicts: contents.verdicts.iter().flat_map(said).collect(),
    })
}

/// The scenarios and recordings that the folder has of the runs.
fn kept(dir: &Path, study: &Study) -> Result<RetainedRecordings, StudyError> {
    let store = Store::open(dir)?;
    let mut kept = RetainedRecordings::default();
    for run in &study.runs {
        let id = &run.row.id;
        kept.scenarios.extend(store.has_scenario(id).then(|| id.clone()));
        kept.recordings.extend(store.recording_file(id).exists().then(|| id.clone()));
    }
    Ok(kept)
}

fn write_file(path: &Path, bytes: &[u8]) -> Result<(), ReportError> {
    fs::write(path, bytes).map_err(|error| ReportError::Write { path: path.to_owned(), error })
}
