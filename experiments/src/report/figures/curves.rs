//! Shares over sim time: what was explored, and how many runs have got how far.

use super::super::numbers::{Estimate, MARKS, Mark as Milestone, TimeUnit, Times, explored_at};
use super::super::plot::{Axis, Layout, Mark, Panel, Sheet, colour, pen, room_for};
use super::super::study::{Place, Study};
use super::super::svg::Pen;
use super::{Figure, Panels, legend, runs_told};
use crate::rows::RunRecord;
use crate::statistics::{StatisticsError, kaplan_meier};

/// Points of a curve: one every 10 s of half an hour.
const POINTS: usize = 180;
/// Bootstrap resamples for a point of a band: its edge is drawn, not read off.
const RESAMPLES: usize = 1000;

/// Explored share over time, mean and band, with every run.
pub(super) fn exploration(study: &Study) -> Result<Figure, StatisticsError> {
    let draw = |sheet: &mut Sheet, panel: &Panel, place: &Place, unit: TimeUnit| {
        let cells: Vec<_> = cells(study, place).collect();
        for (controller, runs) in &cells {
            for run in runs {
                let points: Vec<_> = run
                    .series
                    .iter()
                    .map(|sample| panel.at(sample.t_s / unit.seconds, 100.0 * sample.explored))
                    .collect();
                sheet.svg.polyline(&points, &Pen { opacity: 0.3, ..Pen::solid(colour(*controller), 0.7) });
            }
        }
        for (controller, runs) in &cells {
            let (mean, band) = mean_and_band(runs)?;
            let place = |(time_s, share): &(f64, f64)| panel.at(time_s / unit.seconds, 100.0 * share);
            let band: Vec<_> = band.iter().map(place).collect();
            let mean: Vec<_> = mean.iter().map(place).collect();
            sheet.svg.polygon(&band, colour(*controller), 0.18);
            sheet.svg.polyline(&mean, &pen(*controller));
        }
        Ok(())
    };
    let sheet = Told {
        name: "exploration",
        title: "Exploration over time",
        note: "thick: mean; band: 95 % bootstrap interval of the mean; thin: single runs",
        y_label: "explored share of the free cells (%)",
        mark: Mark::Band,
    };
    let svg = over_time(study, &sheet, draw)?;
    let caption = "Explored share of the free cells over sim time. Thick lines: mean over the runs of a cell. Bands: 95 % bootstrap \
                   interval of the mean, point by point. Thin lines: single runs; a run that has ended stays in the mean as it was.";
    Ok(Figure { name: "exploration".to_owned(), caption: caption.to_owned(), svg })
}

/// Seconds and shares.
type Points = Vec<(f64, f64)>;

/// Mean over the runs, and the outline of its band.
fn mean_and_band(runs: &[&RunRecord]) -> Result<(Points, Points), StatisticsError> {
    let end_s = runs.iter().map(|run| run.row.duration_s).fold(0.0, f64::max);
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

/// Share of the runs that have reached each mark, over time.
pub(super) fn times(study: &Study) -> Result<Vec<Figure>, StatisticsError> {
    MARKS.iter().map(|&milestone| time_to(study, milestone)).collect()
}

fn time_to(study: &Study, milestone: Milestone) -> Result<Figure, StatisticsError> {
    let percent = milestone.percent;
    let draw = |sheet: &mut Sheet, panel: &Panel, place: &Place, unit: TimeUnit| {
        for (controller, runs) in cells(study, place) {
            let times = Times::of(&runs, milestone);
            let mut points = Vec::new();
            let mut reached = 0.0;
            for (time_s, share) in kaplan_meier(&times.runs)? {
                points.push(panel.at(time_s / unit.seconds, reached));
                reached = 100.0 * (1.0 - share);
                points.push(panel.at(time_s / unit.seconds, reached));
            }
            points.push(panel.at(times.horizon_s / unit.seconds, reached));
            sheet.svg.polyline(&points, &pen(controller));
        }
        Ok(())
    };
    let name = format!("time-to-{percent}");
    let title = format!("Time to {percent} % explored");
    let sheet = Told {
        name: &name,
        title: &title,
        note: "share of the runs that have got there (Kaplan-Meier)",
        y_label: &format!("runs with {percent} % explored (% of runs)"),
        mark: Mark::Line,
    };
    let svg = over_time(study, &sheet, draw)?;
    let caption = format!(
        "Share of the runs of a cell that have explored {percent} % of the free cells, over sim time (1 minus the Kaplan-Meier \
         estimate). A line that ends below 100 % leaves the runs that have not got there by the end of the duration."
    );
    Ok(Figure { name, caption, svg })
}

/// What a sheet of curves says.
struct Told<'a> {
    name: &'a str,
    title: &'a str,
    note: &'a str,
    y_label: &'a str,
    mark: fn(usize) -> Mark,
}

/// Panels of shares in per cent over sim time. `draw` may assume that its panel has runs.
fn over_time(
    study: &Study,
    told: &Told,
    draw: impl Fn(&mut Sheet, &Panel, &Place, TimeUnit) -> Result<(), StatisticsError>,
) -> Result<String, StatisticsError> {
    let unit = TimeUnit::of(&study.runs);
    let panels = Panels::of(study);
    let y = Axis::shares();
    let layout = Layout {
        name: told.name,
        title: told.title,
        note: &format!("{}; {}", told.note, runs_told(study)),
        x_label: &format!("sim time ({})", unit.symbol),
        y_labels: &[told.y_label.to_owned()],
        legend: &legend(study, told.mark),
        panels: panels.places.len(),
        columns: panels.columns,
        left: room_for([&y]),
        tallness: 1.0,
    };
    let mut sheet = Sheet::new(layout);
    for (i, (field, agents, place)) in panels.places.iter().enumerate() {
        let end_s = match place {
            Some(place) => {
                cells(study, place).flat_map(|(_, runs)| runs).map(|run| run.row.duration_s).fold(0.0, f64::max)
            }
            None => study.runs.iter().map(|run| run.row.duration_s).fold(0.0, f64::max),
        };
        let x = Axis::linear(0.0, end_s / unit.seconds, 6);
        let panel = sheet.panel(i, &Panels::title(study, field, *agents), &x, &y);
        match place {
            Some(place) => {
                sheet.svg.begin_clip(panel.with_margin(2.0));
                draw(&mut sheet, &panel, place, unit)?;
                sheet.svg.end_clip();
            }
            None => sheet.empty(&panel, "no runs"),
        }
    }
    Ok(sheet.finish())
}

/// Controllers that have runs at a place, and these runs.
fn cells<'a>(study: &'a Study, place: &'a Place) -> impl Iterator<Item = (usize, Vec<&'a RunRecord>)> {
    let runs = move |controller| (controller, study.cell(place, controller));
    (0..study.controllers.len()).map(runs).filter(|(_, runs)| !runs.is_empty())
}
