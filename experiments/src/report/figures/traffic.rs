//! Bytes that agents have sent each other, by kind.

use std::collections::BTreeSet;

use agent_node::sharing::MAP_PARCEL;

use super::super::numbers::{Estimate, RESAMPLES, TRAFFIC};
use super::super::plot::{Axis, Layout, Mark, SMALL, Sheet, colour, room_for};
use super::super::study::{Place, Study};
use super::super::svg::{Anchor, Area, INK, Label, Pen, SOFT};
use super::super::table::digits_for;
use super::{Figure, Panels, runs_told};
use crate::statistics::StatisticsError;

/// What `dsvp-auction` marks its claims with.
const CLAIMS_PARCEL: u8 = 2;
/// Height of a bar over the room that it has.
const BAR: f64 = 0.62;
/// Room beyond the longest bar, for what stands there.
const BEYOND: f64 = 1.4;

/// Bytes delivered in a run by kind of parcel, mean over the runs of each cell; `None` if there are none.
pub(super) fn by_kind(study: &Study) -> Result<Option<Figure>, StatisticsError> {
    let kinds: BTreeSet<u8> = study.runs.iter().flat_map(|run| run.row.bytes_by_kind.keys().copied()).collect();
    let kinds: Vec<u8> = kinds.into_iter().collect();
    if study.runs.iter().all(|run| run.row.parcel_bytes == 0) {
        return Ok(None);
    }
    let panels = Panels::of(study);
    let names = study.controllers.iter().rev().cloned();
    let y = Axis::names(names);
    // Counted from the other end, so that kinds do not look like the first controllers.
    let legend: Vec<_> = kinds.iter().enumerate().map(|(i, kind)| (Mark::Box(swatch(i)), kind_name(*kind))).collect();
    let layout = Layout {
        name: "communication",
        title: "Data delivered between agents in a run",
        note: &format!(
            "mean, with the 95 % bootstrap interval of the sum; every panel has its own axis; {}",
            runs_told(study)
        ),
        x_label: "data delivered in a run (MB)",
        y_labels: &[],
        legend: &legend,
        panels: panels.places.len(),
        columns: panels.columns,
        left: room_for([&y]),
        tallness: 0.35 + 0.1 * study.controllers.len() as f64,
    };
    let mut sheet = Sheet::new(layout);
    for (i, (field, agents, place)) in panels.places.iter().enumerate() {
        let title = Panels::title(study, field, *agents);
        let totals = match place {
            Some(place) => totals(study, place)?,
            None => Vec::new(),
        };
        let ends = totals.iter().map(|(_, total)| total.interval.map_or(total.mean, |interval| interval.high));
        let most = ends.fold(0.0, f64::max);
        let x = Axis::linear(0.0, if most > 0.0 { most * BEYOND } else { 1.0 }, 6);
        let panel = sheet.panel(i, &title, &x, &y);
        let Some(place) = place else {
            sheet.empty(&panel, "no runs");
            continue;
        };
        let room = panel.area.height / study.controllers.len() as f64;
        for controller in (0..study.controllers.len()).filter(|i| totals.iter().all(|(there, _)| there != i)) {
            let (x, y) = panel.at(0.0, (study.controllers.len() - 1 - controller) as f64);
            let label = Label { paint: SOFT, ..Label::new("no runs", SMALL, Anchor::Start) };
            sheet.svg.text((x + 6.0, y + 0.36 * SMALL), &label);
        }
        for (controller, total) in totals {
            let line = (study.controllers.len() - 1 - controller) as f64;
            let runs = study.cell(place, controller);
            let mut from = 0.0;
            for (i, kind) in kinds.iter().enumerate() {
                let bytes: u64 = runs.iter().map(|run| run.row.bytes_by_kind.get(kind).copied().unwrap_or(0)).sum();
                let to = from + bytes as f64 / 1e6 / runs.len() as f64;
                let ((left, middle), (right, _)) = (panel.at(from, line), panel.at(to, line));
                let (top, height) = (middle - room * BAR / 2.0, room * BAR);
                sheet.svg.fill(Area { left, top, width: right - left, height }, colour(swatch(i)), 0.75);
                from = to;
            }
            let mut end = panel.at(total.mean, line);
            if let Some(interval) = total.interval {
                let (low, high) = (panel.at(interval.low, line), panel.at(interval.high, line));
                sheet.svg.line(low, high, &Pen::solid(INK, 1.2));
                for (x, y) in [low, high] {
                    sheet.svg.line((x, y - 3.0), (x, y + 3.0), &Pen::solid(INK, 1.2));
                }
                end = high;
            }
            let text = format!("{:.*} MB", digits_for(total.mean), total.mean);
            sheet.svg.text((end.0 + 6.0, end.1 + 0.36 * SMALL), &Label::new(&text, SMALL, Anchor::Start));
        }
    }
    let caption = "Data that reached other agents in a run, by kind of parcel: mean over the runs of a cell, with the 95 % bootstrap \
                   interval of the sum. Every panel has its own axis.";
    Ok(Some(Figure { name: "communication".to_owned(), caption: caption.to_owned(), svg: sheet.finish() }))
}

/// Megabytes in a run of each controller that has runs at a place.
fn totals(study: &Study, place: &Place) -> Result<Vec<(usize, Estimate)>, StatisticsError> {
    let mut totals = Vec::new();
    for controller in 0..study.controllers.len() {
        let runs = study.cell(place, controller);
        if !runs.is_empty() {
            totals.push((controller, Estimate::of(&TRAFFIC.values(&runs), RESAMPLES)?));
        }
    }
    Ok(totals)
}

/// Colour of the kind at a place in the list of kinds: sky blue first.
fn swatch(place: usize) -> usize {
    [5, 4, 3, 6, 2, 1, 0][place % 7]
}

/// What to call a kind of parcel.
fn kind_name(kind: u8) -> String {
    match kind {
        MAP_PARCEL => format!("maps (kind {kind})"),
        CLAIMS_PARCEL => format!("claims (kind {kind})"),
        other => format!("kind {other}"),
    }
}
