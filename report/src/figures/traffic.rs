//! The volume of agent-to-agent messages, by kind.

use std::collections::BTreeSet;

use agent_node::command::MessageType;

use super::super::estimates::{Estimate, RESAMPLES};
use super::super::marks::{Mark, colour};
use super::super::plot::{Axis, Layout, Panel, SMALL, Sheet, room_for};
use super::super::study::{Condition, Study};
use super::super::svg::{Anchor, Area, INK, Label, Pen, SOFT};
use super::super::table::digits_for;
use super::{Figure, Panels, runs_note};
use experiments::rows::RunRecord;
use statistics::StatisticsError;

const TITLE: &str = "Data delivered between agents in a run";
/// Height of a bar, relative to its row.
const BAR: f64 = 0.62;
/// Length of the axis relative to the longest bar, with space for its label.
const BEYOND: f64 = 1.4;

/// Bytes delivered in a run by kind of message, mean over the runs of each cell; `None` if there
/// are none.
pub(super) fn by_kind(study: &Study) -> Result<Option<Figure>, StatisticsError> {
    let kinds: BTreeSet<u8> = study.runs.iter().flat_map(|run| run.row.bytes_by_kind.keys().copied()).collect();
    let kinds: Vec<u8> = kinds.into_iter().collect();
    if study.runs.iter().all(|run| run.row.message_bytes == 0) {
        return Ok(None);
    }
    let unit = Unit::of(&study.runs);
    let panels = Panels::of(study);
    let names = study.variants.iter().rev().cloned();
    let y = Axis::names(names);
    // Colours from the other end of the palette, so that kinds do not look like variants.
    let legend: Vec<_> = kinds.iter().enumerate().map(|(i, kind)| (Mark::Box(swatch(i)), kind_name(*kind))).collect();
    let layout = Layout {
        name: "communication",
        title: TITLE,
        note: &format!(
            "mean, with the 95 % bootstrap interval of the sum; every panel has its own axis; {}",
            runs_note(study)
        ),
        x_label: &format!("data delivered in a run ({})", unit.symbol),
        y_labels: &[],
        legend: &legend,
        panels: panels.conditions.len(),
        columns: panels.columns,
        left: room_for([&y]),
        tallness: 0.35 + 0.1 * study.variants.len() as f64,
    };
    let mut sheet = Sheet::new(layout);
    for (i, (environment, agents, condition)) in panels.conditions.iter().enumerate() {
        let title = Panels::title(study, environment, *agents);
        let totals = match condition {
            Some(condition) => totals(study, condition, unit)?,
            None => Vec::new(),
        };
        let ends = totals.iter().map(|(_, total)| total.high());
        let most = ends.fold(0.0, f64::max);
        let x = Axis::linear(0.0, if most > 0.0 { most * BEYOND } else { 1.0 }, 6);
        let panel = sheet.panel(i, &title, &x, &y);
        let Some(condition) = condition else {
            sheet.empty(&panel, "no runs");
            continue;
        };
        let room = panel.area.height / study.variants.len() as f64;
        for variant in (0..study.variants.len()).filter(|i| totals.iter().all(|(present, _)| present != i)) {
            let (x, y) = panel.at(0.0, (study.variants.len() - 1 - variant) as f64);
            let label = Label { paint: SOFT, ..Label::new("no runs", SMALL, Anchor::Start) };
            sheet.svg.text((x + 6.0, y + 0.36 * SMALL), &label);
        }
        for (variant, total) in totals {
            let line = (study.variants.len() - 1 - variant) as f64;
            sheet.svg.begin_variant(variant, false);
            sheet.svg.begin_value(&format!(
                "{}: {:.*} {}",
                study.variants[variant],
                digits_for(total.mean),
                total.mean,
                unit.symbol
            ));
            draw_bar(
                &mut sheet,
                &panel,
                (line, room * BAR),
                &shares(&study.measured(condition, variant), &kinds, unit),
                total,
            );
            let end = total.high();
            let (x, y) = panel.at(end, line);
            let text = format!("{:.*} {}", digits_for(total.mean), total.mean, unit.symbol);
            sheet.svg.text((x + 6.0, y + 0.36 * SMALL), &Label::new(&text, SMALL, Anchor::Start));
            sheet.svg.end_group();
            sheet.svg.end_group();
        }
    }
    let caption = "Data delivered to other agents in a run, by kind of message: mean over the runs of a cell, with \
                   the 95 % bootstrap interval of the sum. Every panel has its own axis.";
    let drawn = sheet.finish();
    let (name, title, caption) = ("communication".to_owned(), TITLE.to_owned(), caption.to_owned());
    Ok(Some(Figure { name, title, caption, legend, is_by_variant: false, drawn }))
}

/// Draws a stacked bar in a row of the panel, `height` pixels high, with the interval of the sum.
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

/// The volume of each kind in a run: mean over runs.
fn shares(runs: &[&RunRecord], kinds: &[u8], unit: Unit) -> Vec<f64> {
    let bytes = |kind| runs.iter().map(|run| run.row.bytes_by_kind.get(kind).copied().unwrap_or(0)).sum::<u64>();
    kinds.iter().map(|kind| bytes(kind) as f64 / runs.len() as f64 / unit.bytes).collect()
}

/// Unit of data in a report.
#[derive(Debug, Clone, Copy)]
pub(super) struct Unit {
    pub(super) symbol: &'static str,
    bytes: f64,
}

impl Unit {
    /// Megabytes if a run delivers one or more.
    pub(super) fn of(runs: &[RunRecord]) -> Self {
        let most = runs.iter().map(|run| run.row.message_bytes).max().unwrap_or(0);
        if most >= 1_000_000 { Self { symbol: "MB", bytes: 1e6 } } else { Self { symbol: "kB", bytes: 1e3 } }
    }
}

/// The volume delivered in a run, for each variant that has runs under a condition.
pub(super) fn totals(
    study: &Study,
    condition: &Condition,
    unit: Unit,
) -> Result<Vec<(usize, Estimate)>, StatisticsError> {
    let mut totals = Vec::new();
    for variant in 0..study.variants.len() {
        let runs = study.measured(condition, variant);
        if !runs.is_empty() {
            let values: Vec<f64> = runs.iter().map(|run| run.row.message_bytes as f64 / unit.bytes).collect();
            totals.push((variant, Estimate::of(&values, RESAMPLES)?));
        }
    }
    Ok(totals)
}

/// The colour of the kind with an index: sky blue first.
fn swatch(index: usize) -> usize {
    [5, 4, 3, 6, 2, 1, 0][index % 7]
}

fn kind_name(kind: u8) -> String {
    match MessageType::of(kind) {
        Some(MessageType::Map) => format!("maps (kind {kind})"),
        Some(MessageType::Claims) => format!("claims (kind {kind})"),
        Some(MessageType::Finished) => format!("nothing left (kind {kind})"),
        Some(MessageType::Meeting) => format!("meetings (kind {kind})"),
        Some(MessageType::Parts) => format!("parts (kind {kind})"),
        Some(MessageType::AtBase) => format!("reports to bases (kind {kind})"),
        None => format!("kind {kind}"),
    }
}
