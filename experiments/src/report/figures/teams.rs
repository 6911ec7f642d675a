//! What more agents bring, and how long their decisions take.

use super::super::numbers::{DISTANCE, EXPLORED, Estimate, MARKS, RESAMPLES, TimeUnit, Times};
use super::super::outcomes::{DECISION_TIMES, decision_us};
use super::super::plot::{Axis, Layout, Mark, Panel, Sheet, colour, pen, room_for};
use super::super::study::{Field, Place, Study};
use super::super::svg::Pen;
use super::{Figure, columns, legend, runs_told};
use crate::rows::RunRecord;
use crate::statistics::StatisticsError;

/// Space between the marks of two controllers at the same number of agents, pixels.
const ASIDE: f64 = 5.0;
/// Up to so many maps stand side by side.
const FIELDS_ACROSS_MAX: usize = 4;

/// A figure over the number of agents.
struct Scaled<'a> {
    label: String,
    estimate: &'a dyn Fn(&[&RunRecord]) -> Result<Estimate, StatisticsError>,
}

/// Explored share, time to 99 % and distance over the number of agents; `None` if all teams are equally large.
pub(super) fn scaling(study: &Study) -> Result<Option<Figure>, StatisticsError> {
    if study.team_sizes().len() < 2 {
        return Ok(None);
    }
    let unit = TimeUnit::of(&study.runs);
    let rows = [
        Scaled { label: EXPLORED.label(), estimate: &|runs| Estimate::of(&EXPLORED.values(runs), RESAMPLES) },
        Scaled {
            label: format!("restricted mean time to 99 % ({})", unit.symbol),
            estimate: &|runs| Ok(unit.estimate(Times::of(runs, MARKS[1]).estimate()?)),
        },
        Scaled { label: DISTANCE.label(), estimate: &|runs| Estimate::of(&DISTANCE.values(runs), RESAMPLES) },
    ];
    let fields = study.fields();
    // Fields side by side while there are several and they fit, else below each other.
    let fields_across = (2..=FIELDS_ACROSS_MAX).contains(&fields.len());
    let panels: Vec<(usize, usize)> = if fields_across {
        (0..rows.len()).flat_map(|row| (0..fields.len()).map(move |field| (row, field))).collect()
    } else {
        (0..fields.len()).flat_map(|field| (0..rows.len()).map(move |row| (row, field))).collect()
    };
    let mut lines = Vec::new();
    for &(row, field) in &panels {
        lines.push(lines_of(study, &fields[field], &rows[row])?);
    }
    let axis = |row: usize| {
        axis_from_zero(panels.iter().zip(&lines).filter(|(panel, _)| panel.0 == row).flat_map(|(_, lines)| lines))
    };
    let axes: Vec<Axis> = (0..rows.len()).map(axis).collect();
    let labels: Vec<String> = panels.iter().map(|&(row, _)| rows[row].label.clone()).collect();
    let layout = Layout {
        name: "scaling",
        title: "Scaling with the number of agents",
        note: &format!("means with 95 % bootstrap intervals; {}", runs_told(study)),
        x_label: "agents",
        y_labels: &labels,
        legend: &legend(study, Mark::Line),
        panels: lines.len(),
        columns: if fields_across { fields.len() } else { rows.len() },
        left: room_for(&axes),
        tallness: 1.0,
    };
    let mut sheet = Sheet::new(layout);
    let x = agents_axis(study);
    for (i, (lines, &(row, field))) in lines.iter().zip(&panels).enumerate() {
        let panel = sheet.panel(i, &study.field_name(&fields[field]), &x, &axes[row]);
        for Line { controller, points } in lines {
            draw_line(&mut sheet, &panel, study, *controller, points);
        }
    }
    let caption = "Means over the runs of a cell with 95 % bootstrap intervals, over the number of agents; the marks of controllers \
                   are moved aside a little. The restricted mean time takes the duration in place of a time that was not reached.";
    Ok(Some(Figure { name: "scaling".to_owned(), caption: caption.to_owned(), svg: sheet.finish() }))
}

/// Estimates of a controller over the number of agents.
struct Line {
    controller: usize,
    points: Vec<(u32, Estimate)>,
}

fn lines_of(study: &Study, field: &Field, scaled: &Scaled) -> Result<Vec<Line>, StatisticsError> {
    let mut lines = Vec::new();
    for controller in 0..study.controllers.len() {
        let mut points = Vec::new();
        for (place, runs) in team_cells(study, field, controller) {
            points.push((place.agents, (scaled.estimate)(&runs)?));
        }
        lines.push(Line { controller, points });
    }
    Ok(lines)
}

/// The cells of a field and a controller that have runs, by the number of agents.
fn team_cells<'a>(
    study: &'a Study,
    field: &Field,
    controller: usize,
) -> impl Iterator<Item = (&'a Place, Vec<&'a RunRecord>)> {
    let places = study.places.iter().filter(|place| place.field() == *field);
    places.map(move |place| (place, study.cell(place, controller))).filter(|(_, runs)| !runs.is_empty())
}

fn draw_line(sheet: &mut Sheet, panel: &Panel, study: &Study, controller: usize, points: &[(u32, Estimate)]) {
    let aside = (controller as f64 - (study.controllers.len() as f64 - 1.0) / 2.0) * ASIDE;
    let at = |agents: u32, value: f64| {
        let (x, y) = panel.at(agents.into(), value);
        (x + aside, y)
    };
    let means: Vec<_> = points.iter().map(|(agents, estimate)| at(*agents, estimate.mean)).collect();
    sheet.svg.polyline(&means, &pen(controller));
    for (agents, estimate) in points {
        if let Some(interval) = estimate.interval {
            let (low, high) = (at(*agents, interval.low), at(*agents, interval.high));
            let bar = Pen::solid(colour(controller), 1.3);
            sheet.svg.line(low, high, &bar);
            for (x, y) in [low, high] {
                sheet.svg.line((x - 3.0, y), (x + 3.0, y), &bar);
            }
        }
        sheet.svg.disc(at(*agents, estimate.mean), 3.2, colour(controller), 1.0);
    }
}

fn axis_from_zero<'a>(lines: impl IntoIterator<Item = &'a Line>) -> Axis {
    let points = lines.into_iter().flat_map(|line| &line.points);
    let ends = points.map(|(_, estimate)| estimate.interval.map_or(estimate.mean, |interval| interval.high));
    Axis::rounded(0.0, ends.fold(0.0, f64::max), 5)
}

fn agents_axis(study: &Study) -> Axis {
    let team_sizes = study.team_sizes();
    let most = f64::from(team_sizes.last().copied().unwrap_or(1));
    Axis::at(0.0, most * 1.08, team_sizes.iter().map(|&agents| (agents.into(), agents.to_string())))
}

/// Wall time of a decision: median, 95th and 99th percentile; `None` if nobody has measured it.
pub(super) fn decisions(study: &Study) -> Result<Option<Figure>, StatisticsError> {
    let fields = study.fields();
    let mut panels = Vec::new();
    for field in &fields {
        let mut ranges = Vec::new();
        for controller in 0..study.controllers.len() {
            for (place, runs) in team_cells(study, field, controller) {
                let times: Result<Vec<_>, _> = DECISION_TIMES.iter().map(|&time| decision_us(&runs, time)).collect();
                if let Some(times) = times?.into_iter().collect::<Option<Vec<f64>>>()
                    && times.iter().all(|&time| time > 0.0)
                {
                    ranges.push((controller, place.agents, times));
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
        title: "Wall time of a decision",
        note: "dot: median; long bar: 95th percentile; short bar: 99th percentile; of each, the median over the runs",
        x_label: "agents",
        y_labels: &["wall time of a decision (µs)".to_owned()],
        legend: &legend(study, Mark::Line),
        panels: fields.len(),
        columns: columns(fields.len()),
        left: room_for([&y]),
        tallness: 1.0,
    };
    let mut sheet = Sheet::new(layout);
    let team_sizes = study.team_sizes();
    let x = Axis::names(team_sizes.iter().map(u32::to_string));
    for (i, (field, ranges)) in fields.iter().zip(&panels).enumerate() {
        let panel = sheet.panel(i, &study.field_name(field), &x, &y);
        let slots = study.controllers.len() as f64;
        let step = (panel.area.width / team_sizes.len() as f64 * 0.8 / slots).min(40.0);
        for (controller, agents, times) in ranges {
            let group = team_sizes.iter().position(|size| size == agents).unwrap_or_default();
            let aside = (*controller as f64 - (slots - 1.0) / 2.0) * step;
            let at = |value: f64| {
                let (x, y) = panel.at(group as f64, value);
                (x + aside, y)
            };
            let [median, high, highest] = [0, 1, 2].map(|i| at(times[i]));
            sheet.svg.line(median, highest, &Pen { width: 1.5, ..pen(*controller) });
            sheet.svg.disc(median, 3.5, colour(*controller), 1.0);
            for (place, half) in [(high, 6.0), (highest, 3.5)] {
                let bar = Pen::solid(colour(*controller), 2.0);
                sheet.svg.line((place.0 - half, place.1), (place.0 + half, place.1), &bar);
            }
        }
    }
    let caption = "Wall time of a decision of an agent: dot: median, long bar: 95th percentile, short bar: 99th percentile; of each, \
                   the median over the runs of a cell. The axis is logarithmic.";
    Ok(Some(Figure { name: "decision-times".to_owned(), caption: caption.to_owned(), svg: sheet.finish() }))
}
