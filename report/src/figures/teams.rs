//! Figures over the team size: scaling, and wall time of decisions.

use std::collections::BTreeSet;

use super::super::estimates::{Estimate, RESAMPLES, Times};
use super::super::marks::{Mark, colour, pen};
use super::super::metrics::{DISTANCE, EXPLORED, MILESTONES, Metric, TimeUnit};
use super::super::outcomes::{DECISION_TIMES, decision_us};
use super::super::plot::{Axis, Drawn, Layout, Panel, Sheet, room_for};
use super::super::study::{Condition, Environment, Study, agents_name};
use super::super::svg::Pen;
use super::super::table::digits_for;
use super::{Figure, columns, legend, runs_note};
use experiments::rows::RunRecord;
use statistics::StatisticsError;

/// Offset between the marks of two variants at the same team size, pixels.
const ASIDE: f64 = 5.0;
/// Maximum number of environments side by side.
const ENVIRONMENTS_ACROSS_MAX: usize = 4;

/// Titles of the figures.
const SCALING: &str = "Scaling with the number of agents";
const DECISIONS: &str = "Wall time of a decision";

fn figure(study: &Study, name: &str, title: &str, caption: &str, drawn: Drawn) -> Figure {
    let (name, title, caption) = (name.to_owned(), title.to_owned(), caption.to_owned());
    Figure { name, title, caption, legend: legend(study, Mark::Line), is_by_variant: true, drawn }
}

/// The estimate of a group of runs, `None` if there is none.
type EstimateOf<'a> = dyn Fn(&[&RunRecord]) -> Result<Option<Estimate>, StatisticsError> + 'a;

/// A metric over the team size.
struct Scaled<'a> {
    label: String,
    /// `None` if no run counts.
    estimate: &'a EstimateOf<'a>,
}

/// Explored share, time to 99 % and distance over the team size; `None` if there is only one size.
pub(super) fn scaling(study: &Study) -> Result<Option<Figure>, StatisticsError> {
    if study.team_sizes().len() < 2 {
        return Ok(None);
    }
    let unit = TimeUnit::of(&study.runs);
    let rows = [
        Scaled { label: EXPLORED.label(), estimate: &|runs| estimate_of(EXPLORED, runs) },
        Scaled {
            label: format!("restricted mean time to 99 % ({})", unit.symbol),
            estimate: &|runs| Ok(Some(Times::of(runs, MILESTONES[1]).estimate()?.in_unit(unit))),
        },
        Scaled { label: DISTANCE.label(), estimate: &|runs| estimate_of(DISTANCE, runs) },
    ];
    let environments = study.environments();
    // Environments side by side if there are several and they fit, otherwise below each other.
    let environments_across = (2..=ENVIRONMENTS_ACROSS_MAX).contains(&environments.len());
    let panels: Vec<(usize, usize)> = if environments_across {
        (0..rows.len()).flat_map(|row| (0..environments.len()).map(move |environment| (row, environment))).collect()
    } else {
        (0..environments.len()).flat_map(|environment| (0..rows.len()).map(move |row| (row, environment))).collect()
    };
    let mut lines = Vec::new();
    for &(row, environment) in &panels {
        lines.push(lines_of(study, &environments[environment], &rows[row])?);
    }
    let axis = |row: usize| {
        axis_from_zero(panels.iter().zip(&lines).filter(|(panel, _)| panel.0 == row).flat_map(|(_, lines)| lines))
    };
    let axes: Vec<Axis> = (0..rows.len()).map(axis).collect();
    let labels: Vec<String> = panels.iter().map(|&(row, _)| rows[row].label.clone()).collect();
    let layout = Layout {
        name: "scaling",
        title: SCALING,
        note: &format!("means with 95 % bootstrap intervals; {}", runs_note(study)),
        x_label: "agents",
        y_labels: &labels,
        legend: &legend(study, Mark::Line),
        panels: lines.len(),
        columns: if environments_across { environments.len() } else { rows.len() },
        left: room_for(&axes),
        tallness: 1.0,
    };
    let mut sheet = Sheet::new(layout);
    let x = agents_axis(study);
    for (i, (lines, &(row, environment))) in lines.iter().zip(&panels).enumerate() {
        let panel = sheet.panel(i, &study.environment_name(&environments[environment]), &x, &axes[row]);
        for Line { variant, points } in lines {
            sheet.svg.begin_variant(*variant, false);
            draw_line(&mut sheet, &panel, study, *variant, points);
            sheet.svg.end_group();
        }
    }
    let caption = "Means over the runs of a cell with 95 % bootstrap intervals, over the number of agents; the marks \
                   of variants are slightly offset. The restricted mean time uses the duration for runs that do \
                   not reach 99 %.";
    Ok(Some(figure(study, "scaling", SCALING, caption, sheet.finish())))
}

fn estimate_of(metric: Metric, runs: &[&RunRecord]) -> Result<Option<Estimate>, StatisticsError> {
    let values = metric.values(runs);
    if values.is_empty() { Ok(None) } else { Estimate::of(&values, RESAMPLES).map(Some) }
}

/// The estimates of a variant over the team size.
struct Line {
    variant: usize,
    points: Vec<(u32, Estimate)>,
}

fn lines_of(study: &Study, environment: &Environment, scaled: &Scaled) -> Result<Vec<Line>, StatisticsError> {
    let mut lines = Vec::new();
    for variant in 0..study.variants.len() {
        let mut points = Vec::new();
        for (agents, runs) in team_cells(study, environment, variant) {
            points.extend(agents.zip((scaled.estimate)(&runs)?));
        }
        lines.push(Line { variant, points });
    }
    Ok(lines)
}

/// The cells of an environment and a variant that have runs, by team size.
fn team_cells<'a>(
    study: &'a Study,
    environment: &Environment,
    variant: usize,
) -> impl Iterator<Item = (Option<u32>, Vec<&'a RunRecord>)> {
    let conditions = study.conditions.iter().filter(|condition| condition.environment() == *environment);
    let cell = move |condition: &'a Condition| (condition.agents, study.cell(condition, variant));
    conditions.map(cell).filter(|(_, runs)| !runs.is_empty())
}

fn draw_line(sheet: &mut Sheet, panel: &Panel, study: &Study, variant: usize, points: &[(u32, Estimate)]) {
    let aside = (variant as f64 - (study.variants.len() as f64 - 1.0) / 2.0) * ASIDE;
    let at = |agents: u32, value: f64| {
        let (x, y) = panel.at(agents.into(), value);
        (x + aside, y)
    };
    let means: Vec<_> = points.iter().map(|(agents, estimate)| at(*agents, estimate.mean)).collect();
    sheet.svg.polyline(&means, &pen(variant));
    for (agents, estimate) in points {
        let digits = digits_for(estimate.mean).max(1);
        let interval = estimate
            .interval
            .map_or_else(String::new, |interval| format!(" [{:.digits$}, {:.digits$}]", interval.low, interval.high));
        let name = &study.variants[variant];
        sheet.svg.begin_value(&format!("{name}, {}: {:.digits$}{interval}", agents_name(*agents), estimate.mean));
        if let Some(interval) = estimate.interval {
            let (low, high) = (at(*agents, interval.low), at(*agents, interval.high));
            let bar = Pen::solid(colour(variant), 1.3);
            sheet.svg.line(low, high, &bar);
            for (x, y) in [low, high] {
                sheet.svg.line((x - 3.0, y), (x + 3.0, y), &bar);
            }
        }
        sheet.svg.disc(at(*agents, estimate.mean), 3.2, colour(variant), 1.0);
        sheet.svg.end_group();
    }
}

fn axis_from_zero<'a>(lines: impl IntoIterator<Item = &'a Line>) -> Axis {
    let points = lines.into_iter().flat_map(|line| &line.points);
    let ends = points.map(|(_, estimate)| estimate.high());
    Axis::rounded(0.0, ends.fold(0.0, f64::max), 5)
}

fn agents_axis(study: &Study) -> Axis {
    let team_sizes = study.team_sizes();
    let most = f64::from(team_sizes.last().copied().unwrap_or(1));
    Axis::at(0.0, most * 1.08, team_sizes.iter().map(|&agents| (agents.into(), agents.to_string())))
}

/// Wall time of a decision: median, 95th and 99th percentile; `None` if it was not measured.
pub(super) fn decisions(study: &Study) -> Result<Option<Figure>, StatisticsError> {
    let environments = study.environments();
    let mut panels = Vec::new();
    for environment in &environments {
        let mut ranges = Vec::new();
        for variant in 0..study.variants.len() {
            for (agents, runs) in team_cells(study, environment, variant) {
                let times: Result<Vec<_>, _> = DECISION_TIMES.iter().map(|&time| decision_us(&runs, time)).collect();
                if let Some(times) = times?.into_iter().collect::<Option<Vec<f64>>>()
                    && times.iter().all(|&time| time > 0.0)
                {
                    ranges.push((variant, agents, times));
                }
            }
        }
        panels.push(ranges);
    }
    let all = || panels.iter().flatten().flat_map(|(_, _, times)| times).copied();
    if all().next().is_none() {
        return Ok(None);
    }
    let y = Axis::logarithmic(all().fold(f64::INFINITY, f64::min), all().fold(0.0, f64::max));
    let layout = Layout {
        name: "decision-times",
        title: DECISIONS,
        note: "dot: median; long bar: 95th percentile; short bar: 99th percentile; of each, the median over the runs",
        x_label: "agents",
        y_labels: &["wall time of a decision (µs)".to_owned()],
        legend: &legend(study, Mark::Line),
        panels: environments.len(),
        columns: columns(environments.len()),
        left: room_for([&y]),
        tallness: 1.0,
    };
    let mut sheet = Sheet::new(layout);
    let team_sizes: BTreeSet<Option<u32>> = study.conditions.iter().map(|condition| condition.agents).collect();
    let team_sizes: Vec<_> = team_sizes.into_iter().collect();
    let name = |agents: &Option<u32>| agents.map_or_else(String::new, |agents| agents.to_string());
    let x = Axis::names(team_sizes.iter().map(name));
    for (i, (environment, ranges)) in environments.iter().zip(&panels).enumerate() {
        let panel = sheet.panel(i, &study.environment_name(environment), &x, &y);
        let slots = study.variants.len() as f64;
        let step = (panel.area.width / team_sizes.len() as f64 * 0.8 / slots).min(40.0);
        for (variant, agents, times) in ranges {
            let group = team_sizes.iter().position(|size| size == agents).unwrap_or_default();
            let aside = (*variant as f64 - (slots - 1.0) / 2.0) * step;
            let at = |value: f64| {
                let (x, y) = panel.at(group as f64, value);
                (x + aside, y)
            };
            let [median, high, highest] = [0, 1, 2].map(|i| at(times[i]));
            sheet.svg.begin_variant(*variant, false);
            sheet.svg.begin_value(&format!(
                "{}: median {:.1} µs, 95 % {:.1} µs, 99 % {:.1} µs",
                study.variants[*variant], times[0], times[1], times[2]
            ));
            sheet.svg.line(median, highest, &Pen { width: 1.5, ..pen(*variant) });
            sheet.svg.disc(median, 3.5, colour(*variant), 1.0);
            for ((x, y), half) in [(high, 6.0), (highest, 3.5)] {
                let bar = Pen::solid(colour(*variant), 2.0);
                sheet.svg.line((x - half, y), (x + half, y), &bar);
            }
            sheet.svg.end_group();
            sheet.svg.end_group();
        }
    }
    let caption = "Wall time of a decision of an agent: dot: median, long bar: 95th percentile, short bar: 99th \
                   percentile; of each, the median over the runs of a cell. The axis is logarithmic.";
    Ok(Some(figure(study, "decision-times", DECISIONS, caption, sheet.finish())))
}
