//! Curves over sim time: the explored share, and the share of runs that have reached a milestone.

use super::super::estimates::{Estimate, Times};
use super::super::marks::{Mark, colour, pen};
use super::super::metrics::{MILESTONES, Milestone, TimeUnit, explored_at};
use super::super::plot::{Axis, Drawn, Layout, Panel, Sheet, room_for};
use super::super::study::{Condition, Study};
use super::super::svg::Pen;
use super::{Figure, Panels, legend, runs_note};
use experiments::rows::RunRecord;
use statistics::{StatisticsError, kaplan_meier};

/// Points of a curve: one per 10 s of half an hour.
const POINTS: usize = 180;
/// Bootstrap resamples per point of a band: fewer than for a number in a table, as it is only
/// drawn.
const RESAMPLES: usize = 1000;

/// Explored share over time: mean with its band, and every run.
pub(super) fn exploration(study: &Study) -> Result<Figure, StatisticsError> {
    let draw = |sheet: &mut Sheet, panel: &Panel, condition: &Condition, unit: TimeUnit| {
        let cells: Vec<_> = cells(study, condition).collect();
        for (variant, runs) in &cells {
            sheet.svg.begin_variant(*variant, false);
            for run in runs.iter().filter(|run| run.row.failure().is_none()) {
                let points: Vec<_> = run
                    .series
                    .iter()
                    .map(|sample| panel.at(sample.t_s / unit.seconds, 100.0 * sample.explored))
                    .collect();
                sheet.svg.begin_run(&run.row.id);
                sheet.svg.polyline(&points, &Pen { opacity: 0.3, ..Pen::solid(colour(*variant), 0.7) });
                sheet.svg.end_group();
            }
            sheet.svg.end_group();
        }
        for (variant, runs) in &cells {
            let (mean, band) = mean_and_band(runs, shown_until_s(study, condition))?;
            let position = |(time_s, share): &(f64, f64)| panel.at(time_s / unit.seconds, 100.0 * share);
            let band: Vec<_> = band.iter().map(position).collect();
            let mean: Vec<_> = mean.iter().map(position).collect();
            sheet.svg.begin_variant(*variant, true);
            sheet.svg.polygon(&band, colour(*variant), 0.18);
            sheet.svg.polyline(&mean, &pen(*variant));
            sheet.svg.end_group();
        }
        Ok(())
    };
    let sheet = SheetText {
        name: "exploration",
        title: "Exploration over time",
        note: "thick: mean; band: 95 % bootstrap interval of the mean; thin: single runs",
        y_label: "explored share of the free cells (%)",
        mark: Mark::Band,
    };
    let drawn = over_time(study, &sheet, draw)?;
    let caption = "Explored share of the free cells over sim time. Thick lines: mean over the runs of a cell. Bands: \
                   95 % bootstrap interval of the mean, pointwise. Thin lines: single runs; a run that has ended \
                   counts with its last value, and one that has failed with 0, without a line of its own.";
    let (name, title, caption) = (sheet.name.to_owned(), sheet.title.to_owned(), caption.to_owned());
    Ok(Figure { name, title, caption, legend: legend(study, sheet.mark), is_by_variant: true, drawn })
}

/// (Time in seconds, share).
type Points = Vec<(f64, f64)>;

/// The mean over the runs until a time, and the outline of its band.
fn mean_and_band(runs: &[&RunRecord], end_s: f64) -> Result<(Points, Points), StatisticsError> {
    let mut mean = Vec::with_capacity(POINTS + 1);
    let (mut lower, mut upper) = (Vec::with_capacity(2 * POINTS + 2), Vec::with_capacity(POINTS + 1));
    for i in 0..=POINTS {
        let time_s = end_s * i as f64 / POINTS as f64;
        let shares: Vec<f64> = runs.iter().map(|run| explored_at(run, time_s)).collect();
        let estimate = Estimate::of(&shares, RESAMPLES)?;
        mean.push((time_s, estimate.mean));
        if let Some(interval) = estimate.interval {
            lower.push((time_s, interval.low));
            upper.push((time_s, interval.high));
        }
    }
    lower.extend(upper.into_iter().rev());
    Ok((mean, lower))
}

/// The share of the runs that have reached each milestone, over time.
pub(super) fn times(study: &Study) -> Result<Vec<Figure>, StatisticsError> {
    MILESTONES.iter().map(|&milestone| time_to(study, milestone)).collect()
}

fn time_to(study: &Study, milestone: Milestone) -> Result<Figure, StatisticsError> {
    let percent = milestone.percent;
    let draw = |sheet: &mut Sheet, panel: &Panel, condition: &Condition, unit: TimeUnit| {
        for (variant, runs) in cells(study, condition) {
            let times = Times::of(&runs, milestone);
            let mut points = Vec::new();
            let mut reached = 0.0;
            for (time_s, share) in kaplan_meier(&times.runs)? {
                points.push(panel.at(time_s / unit.seconds, reached));
                reached = 100.0 * (1.0 - share);
                points.push(panel.at(time_s / unit.seconds, reached));
            }
            points.push(panel.at(times.horizon_s / unit.seconds, reached));
            sheet.svg.begin_variant(variant, true);
            sheet.svg.polyline(&points, &pen(variant));
            sheet.svg.end_group();
        }
        Ok(())
    };
    let name = format!("time-to-{percent}");
    let title = format!("Time to {percent} % explored");
    let sheet = SheetText {
        name: &name,
        title: &title,
        note: "share of the runs that have reached it (Kaplan-Meier)",
        y_label: &format!("runs with {percent} % explored (% of runs)"),
        mark: Mark::Line,
    };
    let drawn = over_time(study, &sheet, draw)?;
    let legend = legend(study, sheet.mark);
    let caption = format!(
        "Share of the runs of a cell that have explored {percent} % of the free cells, over sim time (1 minus the \
         Kaplan-Meier estimate). A line that ends below 100 % has runs that did not reach it within the duration."
    );
    Ok(Figure { name: name.clone(), title: title.clone(), caption, legend, is_by_variant: true, drawn })
}

/// The texts of a sheet of curves.
struct SheetText<'a> {
    name: &'a str,
    title: &'a str,
    note: &'a str,
    y_label: &'a str,
    mark: fn(usize) -> Mark,
}

/// Panels of shares in per cent over sim time. `draw` is called for panels with runs only.
fn over_time(
    study: &Study,
    text: &SheetText,
    draw: impl Fn(&mut Sheet, &Panel, &Condition, TimeUnit) -> Result<(), StatisticsError>,
) -> Result<Drawn, StatisticsError> {
    let unit = TimeUnit::of(&study.runs);
    let panels = Panels::of(study);
    let y = Axis::shares();
    let layout = Layout {
        name: text.name,
        title: text.title,
        note: &format!("{}; {}", text.note, runs_note(study)),
        x_label: &format!("sim time ({})", unit.symbol),
        y_labels: &[text.y_label.to_owned()],
        legend: &legend(study, text.mark),
        panels: panels.conditions.len(),
        columns: panels.columns,
        left: room_for([&y]),
        tallness: 1.0,
    };
    let mut sheet = Sheet::new(layout);
    for (i, (environment, agents, condition)) in panels.conditions.iter().enumerate() {
        let end_s = match condition {
            Some(condition) => shown_until_s(study, condition),
            None => study.runs.iter().map(|run| run.row.duration_s).fold(0.0, f64::max),
        };
        let x = Axis::linear(0.0, end_s / unit.seconds, 6);
        let panel = sheet.panel(i, &Panels::title(study, environment, *agents), &x, &y);
        match condition {
            Some(condition) => {
                sheet.svg.begin_clip(panel.with_margin(2.0));
                draw(&mut sheet, &panel, condition, unit)?;
                sheet.svg.end_clip();
            }
            None => sheet.empty(&panel, "no runs"),
        }
    }
    Ok(sheet.finish())
}

/// The sim time at which the axis of a condition ends, s: a little after the last run has ended, at
/// most with the duration.
fn shown_until_s(study: &Study, condition: &Condition) -> f64 {
    let rows = || cells(study, condition).flat_map(|(_, runs)| runs).map(|run| &run.row);
    let duration_s = rows().map(|row| row.duration_s).fold(0.0, f64::max);
    let end_s = rows().map(|row| if row.failure().is_some() { row.duration_s } else { row.end_s }).fold(0.0, f64::max);
    if end_s > 0.0 { duration_s.min(1.05 * end_s) } else { duration_s }
}

/// The variants that have runs under a condition, with these runs.
fn cells<'a>(study: &'a Study, condition: &'a Condition) -> impl Iterator<Item = (usize, Vec<&'a RunRecord>)> {
    let runs = move |variant| (variant, study.cell(condition, variant));
    (0..study.variants.len()).map(runs).filter(|(_, runs)| !runs.is_empty())
}
