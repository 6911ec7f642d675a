//! Bytes that agents have sent each other, by kind.

use std::collections::BTreeSet;

use agent_node::controllers::dsvp::CLAIMS_MESSAGE;
use agent_node::sharing::MAP_MESSAGE;

use super::super::numbers::{Estimate, RESAMPLES};
use super::super::plot::{Axis, Layout, Mark, Panel, SMALL, Sheet, colour, room_for};
use super::super::study::{Place, Study};
use super::super::svg::{Anchor, Area, INK, Label, Pen, SOFT};
use super::super::table::digits_for;
use super::{Figure, Panels, runs_told};
use crate::rows::RunRecord;
use crate::statistics::StatisticsError;

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
    let unit = Unit::of(&study.runs);
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
        x_label: &format!("data delivered in a run ({})", unit.symbol),
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
            Some(place) => totals(study, place, unit)?,
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
            draw_bar(
                &mut sheet,
                &panel,
                (line, room * BAR),
                &shares(&study.cell(place, controller), &kinds, unit),
                total,
            );
            let end = total.interval.map_or(total.mean, |interval| interval.high);
            let (x, y) = panel.at(end, line);
            let text = format!("{:.*} {}", digits_for(total.mean), total.mean, unit.symbol);
            sheet.svg.text((x + 6.0, y + 0.36 * SMALL), &Label::new(&text, SMALL, Anchor::Start));
        }
    }
    let caption = "Data that reached other agents in a run, by kind of parcel: mean over the runs of a cell, with the 95 % bootstrap \
                   interval of the sum. Every panel has its own axis.";
    Ok(Some(Figure { name: "communication".to_owned(), caption: caption.to_owned(), svg: sheet.finish() }))
}

/// A bar at a line of the panel, so many pixels high: what each kind takes, and the interval of the sum.
fn draw_bar(sheet: &mut Sheet, panel: &Panel, (line, height): (f64, f64), shares: &[f64], total: Estimate) {
    let mut from = 0.0;
    for (i, share) in shares.iter().enumerate() {
        let ((left, middle), (right, _)) = (panel.at(from, line), panel.at(from + share, line));
        let area = Area { left, top: middle - height / 2.0, width: right - left, height };
        sheet.svg.fill(area, colour(swatch(i)), 0.75);
        from += share;
    }
    if let Some(interval) = total.interval {
        let (low, high) = (panel.at(interval.low, line), panel.at(interval.high, line));
        sheet.svg.line(low, high, &Pen::solid(INK, 1.2));
        for (x, y) in [low, high] {
            sheet.svg.line((x, y - 3.0), (x, y + 3.0), &Pen::solid(INK, 1.2));
        }
    }
}

/// What each kind takes in a run: mean over runs.
fn shares(runs: &[&RunRecord], kinds: &[u8], unit: Unit) -> Vec<f64> {
    let bytes = |kind| runs.iter().map(|run| run.row.bytes_by_kind.get(kind).copied().unwrap_or(0)).sum::<u64>();
    kinds.iter().map(|kind| bytes(kind) as f64 / runs.len() as f64 / unit.bytes).collect()
}

/// Unit of data.
#[derive(Debug, Clone, Copy)]
struct Unit {
    symbol: &'static str,
    bytes: f64,
}

impl Unit {
    /// Megabytes once there is one in a run.
    fn of(runs: &[RunRecord]) -> Self {
        let most = runs.iter().map(|run| run.row.parcel_bytes).max().unwrap_or(0);
        if most >= 1_000_000 { Self { symbol: "MB", bytes: 1e6 } } else { Self { symbol: "kB", bytes: 1e3 } }
    }
}

/// What is delivered in a run of each controller that has runs at a place.
fn totals(study: &Study, place: &Place, unit: Unit) -> Result<Vec<(usize, Estimate)>, StatisticsError> {
    let mut totals = Vec::new();
    for controller in 0..study.controllers.len() {
        let runs = study.cell(place, controller);
        if !runs.is_empty() {
            let values: Vec<f64> = runs.iter().map(|run| run.row.parcel_bytes as f64 / unit.bytes).collect();
            totals.push((controller, Estimate::of(&values, RESAMPLES)?));
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
        MAP_MESSAGE => format!("maps (kind {kind})"),
        CLAIMS_MESSAGE => format!("claims (kind {kind})"),
        other => format!("kind {other}"),
    }
}
