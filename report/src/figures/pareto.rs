//! The volume of messages against the time to explore.

use super::super::estimates::{Estimate, Times};
use super::super::marks::{Mark, colour, draw_point};
use super::super::metrics::{MILESTONES, Milestone, TimeUnit};
use super::super::plot::{Axis, Layout, Panel, Sheet, room_for};
use super::super::study::{Condition, Study};
use super::super::svg::{Pen, SOFT};
use super::super::table::digits_for;
use super::traffic::{self, Unit};
use super::{Figure, Panels, legend, runs_note};
use statistics::StatisticsError;

const TITLE: &str = "Data delivered against time to explore";

/// A variant under a condition.
#[derive(Debug, Clone, Copy)]
struct ParetoPoint {
    variant: usize,
    time: Estimate,
    data: Estimate,
}

/// Bytes delivered in a run over the time to explore, means of each cell, with the Pareto front;
/// `None` if nothing is delivered or there is only one variant.
pub(super) fn data_against_time(study: &Study) -> Result<Option<Figure>, StatisticsError> {
    if study.variants.len() < 2 || study.runs.iter().all(|run| run.row.message_bytes == 0) {
        return Ok(None);
    }
    let milestone = greatest_that_most_reach(study);
    let (time_unit, data_unit) = (TimeUnit::of(&study.runs), Unit::of(&study.runs));
    let panels = Panels::of(study);
    let places: Vec<Vec<ParetoPoint>> = panels
        .conditions
        .iter()
        .map(|(_, _, condition)| {
            condition
                .as_ref()
                .map_or(Ok(Vec::new()), |condition| places(study, condition, milestone, (time_unit, data_unit)))
        })
        .collect::<Result<_, _>>()?;
    let axis = |of: fn(&ParetoPoint) -> Estimate, places: &[ParetoPoint]| {
        Axis::rounded(0.0, places.iter().map(|place| of(place).high()).fold(0.0, f64::max), 5)
    };
    let y_axes: Vec<Axis> = places.iter().map(|places| axis(|place| place.data, places)).collect();
    let marks = legend(study, Mark::Point);
    let layout = Layout {
        name: "data-against-time",
        title: TITLE,
        note: &format!(
            "means with 95 % bootstrap intervals; line: Pareto front; every panel has its own axes; {}",
            runs_note(study)
        ),
        x_label: &format!("restricted mean time to {} % ({})", milestone.percent, time_unit.symbol),
        y_labels: &[format!("data delivered in a run ({})", data_unit.symbol)],
        legend: &marks,
        panels: panels.conditions.len(),
        columns: panels.columns,
        left: room_for(&y_axes),
        tallness: 1.0,
    };
    let mut sheet = Sheet::new(layout);
    for (i, (environment, agents, condition)) in panels.conditions.iter().enumerate() {
        let x = axis(|place| place.time, &places[i]);
        let panel = sheet.panel(i, &Panels::title(study, environment, *agents), &x, &y_axes[i]);
        if condition.is_none() {
            sheet.empty(&panel, "no runs");
            continue;
        }
        draw_front(&mut sheet, &panel, &places[i]);
        for place in &places[i] {
            sheet.svg.begin_variant(place.variant, false);
            draw_place(&mut sheet, &panel, &study.variants[place.variant], place, (time_unit, data_unit));
            sheet.svg.end_group();
        }
    }
    let caption = format!(
        "Data delivered to other agents in a run, over the restricted mean time to {} % explored: means over the runs \
         of a cell with 95 % bootstrap intervals. The line is the Pareto front: the variants on it are those to which \
         no other variant is better in one mean and at least as good in the other. Every panel has its own axes.",
        milestone.percent
    );
    let drawn = sheet.finish();
    let (name, title) = ("data-against-time".to_owned(), TITLE.to_owned());
    Ok(Some(Figure { name, title, caption, legend: marks, is_by_variant: true, drawn }))
}

/// The greatest milestone that at least half of all runs reach, otherwise the first: a mark that
/// hardly any run reaches would place every variant at the duration.
fn greatest_that_most_reach(study: &Study) -> Milestone {
    let reached = |milestone: &&Milestone| {
        let reached = study.runs.iter().filter(|run| (milestone.time_s)(&run.row).is_some()).count();
        2 * reached >= study.runs.len()
    };
    MILESTONES.iter().rfind(reached).copied().unwrap_or(MILESTONES[0])
}

fn places(
    study: &Study,
    condition: &Condition,
    milestone: Milestone,
    (time_unit, data_unit): (TimeUnit, Unit),
) -> Result<Vec<ParetoPoint>, StatisticsError> {
    let totals = traffic::totals(study, condition, data_unit)?;
    let place = |(variant, data)| {
        let time = Times::of(&study.cell(condition, variant), milestone).estimate()?.in_unit(time_unit);
        Ok(ParetoPoint { variant, time, data })
    };
    totals.into_iter().map(place).collect()
}

/// The corners of the staircase over the Pareto front: (time, data), in the order of time.
fn front(places: &[ParetoPoint]) -> Vec<(f64, f64)> {
    let mut sorted: Vec<(f64, f64)> = places.iter().map(|place| (place.time.mean, place.data.mean)).collect();
    sorted.sort_by(|one, other| one.0.total_cmp(&other.0).then(one.1.total_cmp(&other.1)));
    let mut corners: Vec<(f64, f64)> = Vec::new();
    for (time, data) in sorted {
        match corners.last() {
            Some(&(_, least)) if data >= least => {}
            Some(&(_, least)) => corners.extend([(time, least), (time, data)]),
            None => corners.push((time, data)),
        }
    }
    corners
}

/// Draws the front from the upper to the right edge of the panel.
fn draw_front(sheet: &mut Sheet, panel: &Panel, places: &[ParetoPoint]) {
    let corners: Vec<_> = front(places).into_iter().map(|(time, data)| panel.at(time, data)).collect();
    if let (Some(&(first, _)), Some(&(_, last))) = (corners.first(), corners.last()) {
        let (top, right) = (panel.area.top, panel.area.left + panel.area.width);
        let points: Vec<_> = [(first, top)].into_iter().chain(corners).chain([(right, last)]).collect();
        sheet.svg.polyline(&points, &Pen { dash: "4 3", ..Pen::solid(SOFT, 1.2) });
    }
}

fn draw_place(
    sheet: &mut Sheet,
    panel: &Panel,
    name: &str,
    place: &ParetoPoint,
    (time_unit, data_unit): (TimeUnit, Unit),
) {
    let ParetoPoint { variant, time, data } = *place;
    sheet.svg.begin_value(&format!(
        "{name}: {:.*} {}, {:.*} {}",
        digits_for(time.mean).max(1),
        time.mean,
        time_unit.symbol,
        digits_for(data.mean),
        data.mean,
        data_unit.symbol
    ));
    let bar = Pen::solid(colour(variant), 1.3);
    if let Some(interval) = time.interval {
        let (low, high) = (panel.at(interval.low, data.mean), panel.at(interval.high, data.mean));
        sheet.svg.line(low, high, &bar);
    }
    if let Some(interval) = data.interval {
        let (low, high) = (panel.at(time.mean, interval.low), panel.at(time.mean, interval.high));
        sheet.svg.line(low, high, &bar);
    }
    draw_point(&mut sheet.svg, variant, panel.at(time.mean, data.mean));
    sheet.svg.end_group();
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn front_has_no_variant_to_which_another_is_better() {
        let only = |mean| Estimate { mean, interval: None };
        let place = |(time, data)| ParetoPoint { variant: 0, time: only(time), data: only(data) };
        // (3, 5) and (5, 4) lose to (2, 4), (2, 6) to it at the same time; (4, 1) costs least.
        let places = [(4.0, 1.0), (3.0, 5.0), (2.0, 6.0), (2.0, 4.0), (1.0, 9.0), (5.0, 4.0)].map(place);
        assert_eq!(front(&places), [(1.0, 9.0), (2.0, 9.0), (2.0, 4.0), (4.0, 4.0), (4.0, 1.0)]);
        assert!(front(&[]).is_empty());
    }
}
