//! Box plots of the runs of each cell, grouped by team size.

use super::super::estimates::Quartiles;
use super::super::marks::{Mark, colour};
use super::super::metrics::{DISTANCE, EXPLORED, Metric, REAL_TIME_FACTOR, REDUNDANCY, STALENESS};
use super::super::plot::{Axis, Layout, Panel, Sheet, room_for};
use super::super::study::{Condition, Study};
use super::super::svg::{Area, Pen};
use super::super::table::digits_for;
use super::{Figure, columns, legend, runs_note};
use experiments::rows::RunRecord;
use statistics::StatisticsError;

/// Width of the boxes of a team size, relative to the width of its group.
const GROUP: f64 = 0.8;
/// Maximum width of a box, pixels.
const WIDTH_MAX: f64 = 46.0;
/// Whiskers extend to the farthest run within this many interquartile ranges of the box (Tukey).
const WHISKER: f64 = 1.5;

/// Metrics of exploration and communication.
pub(super) fn outcome(study: &Study) -> Result<Vec<Figure>, StatisticsError> {
    let several = study.runs.iter().any(|run| run.row.agents > 1);
    let mut metrics = vec![EXPLORED, DISTANCE];
    // Redundancy and staleness need a team.
    if several {
        metrics.extend([REDUNDANCY, STALENESS]);
    }
    metrics.into_iter().map(|metric| boxes(study, metric, false)).collect()
}

pub(super) fn real_time_factor(study: &Study) -> Result<Option<Figure>, StatisticsError> {
    let mut measured = study.runs.iter().filter(|run| run.row.failure().is_none());
    let positive = measured.all(|run| run.row.wall.real_time_factor > 0.0) && study.failed() < study.runs.len();
    if positive { boxes(study, REAL_TIME_FACTOR, true).map(Some) } else { Ok(None) }
}

fn boxes(study: &Study, metric: Metric, logarithmic: bool) -> Result<Figure, StatisticsError> {
    let environments = study.environments();
    let y = value_axis(study, metric, logarithmic);
    let name = format!("box-{}", metric.key.replace('_', "-"));
    let mut title = metric.title.to_owned();
    title[..1].make_ascii_uppercase();
    let marks = legend(study, Mark::Box);
    let has_teams = study.conditions.iter().any(|condition| condition.agents.is_some());
    let layout = Layout {
        name: &name,
        title: &title,
        note: &format!(
            "box: quartiles and median; whiskers: within 1.5 interquartile ranges; dots: single runs; {}",
            runs_note(study)
        ),
        x_label: if has_teams { "agents" } else { "" },
        y_labels: &[metric.label()],
        legend: &marks,
        panels: environments.len(),
        columns: columns(environments.len()),
        left: room_for([&y]),
        tallness: 1.15,
    };
    let mut sheet = Sheet::new(layout);
    for (i, environment) in environments.iter().enumerate() {
        let team_sizes: Vec<Option<u32>> = study
            .conditions
            .iter()
            .filter(|condition| condition.environment() == *environment)
            .map(|condition| condition.agents)
            .collect();
        let x =
            Axis::names(team_sizes.iter().map(|agents| agents.map_or_else(String::new, |agents| agents.to_string())));
        let panel = sheet.panel(i, &study.environment_name(environment), &x, &y);
        let slots = study.variants.len() as f64;
        let width = (panel.area.width / team_sizes.len() as f64 * GROUP / slots).min(WIDTH_MAX);
        for (group, &agents) in team_sizes.iter().enumerate() {
            let condition = Condition { others: environment.others.clone(), size: environment.size, agents };
            for variant in 0..study.variants.len() {
                let mut runs = study.cell(&condition, variant);
                runs.retain(|run| metric.value_of(run).is_some());
                if !runs.is_empty() {
                    let offset = (variant as f64 - (slots - 1.0) / 2.0) * width;
                    sheet.svg.begin_variant(variant, false);
                    let place = (group as f64, offset, width * 0.8);
                    draw_box(&mut sheet, &panel, place, (variant, &study.variants[variant]), (metric, &runs))?;
                    sheet.svg.end_group();
                }
            }
        }
    }
    let drawn = sheet.finish();
    let caption = format!(
        "{title}: boxes from the first to the third quartile with the median, whiskers to the farthest run within 1.5 \
         times the interquartile range, dots: single runs.{}",
        if logarithmic { " The axis is logarithmic. Wall time depends on the machine and its load." } else { "" }
    );
    Ok(Figure { name, title, caption, legend: marks, is_by_variant: true, drawn })
}

/// The common vertical axis of all panels.
fn value_axis(study: &Study, metric: Metric, logarithmic: bool) -> Axis {
    let values: Vec<f64> = study.cells().flat_map(|(_, _, runs)| metric.values(&runs)).collect();
    let low = values.iter().copied().fold(f64::INFINITY, f64::min);
    let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    match () {
        () if values.is_empty() => Axis::rounded(0.0, 1.0, 5),
        () if logarithmic => Axis::logarithmic(low, high),
        // Shares that are all close to 100 % get a magnified axis.
        () if metric.key == EXPLORED.key => {
            let floor = [95.0, 90.0, 80.0, 60.0, 40.0, 20.0].into_iter().find(|floor| low > floor + 0.5);
            Axis::rounded(floor.unwrap_or(0.0), 100.0, 5)
        }
        () => Axis::rounded(0.0, high, 5),
    }
}

/// Draws a box in the group at `place`, `offset` pixels beside its centre and `width` pixels wide.
fn draw_box(
    sheet: &mut Sheet,
    panel: &Panel,
    (place, offset, width): (f64, f64, f64),
    (variant, name): (usize, &str),
    (metric, runs): (Metric, &[&RunRecord]),
) -> Result<(), StatisticsError> {
    let values = &metric.values(runs);
    let Quartiles { low, median, high } = Quartiles::of(values)?;
    let digits = digits_for(median).max(1);
    let shown = |value: f64| format!("{value:.digits$}");
    let unit = if metric.unit.is_empty() { String::new() } else { format!(" {}", metric.unit) };
    let reach = WHISKER * (high - low);
    let within = |value: &&f64| (low - reach..=high + reach).contains(*value);
    let bottom = values.iter().filter(within).copied().fold(low, f64::min);
    let top = values.iter().filter(within).copied().fold(high, f64::max);
    let x = panel.at(place, 0.0).0 + offset;
    let y = |value| panel.at(place, value).1;
    let pen = Pen::solid(colour(variant), 1.3);
    let area = Area { left: x - width / 2.0, top: y(high), width, height: y(low) - y(high) };
    sheet.svg.begin_value(&format!(
        "{name}: median {}{unit}, quartiles {} to {}",
        shown(median),
        shown(low),
        shown(high)
    ));
    sheet.svg.line((x, y(bottom)), (x, y(low)), &pen);
    sheet.svg.line((x, y(high)), (x, y(top)), &pen);
    sheet.svg.fill(area, colour(variant), 0.25);
    sheet.svg.frame(area, &pen);
    sheet.svg.line((area.left, y(median)), (area.left + width, y(median)), &Pen::solid(colour(variant), 2.6));
    sheet.svg.end_group();
    for (i, (value, run)) in values.iter().zip(runs).enumerate() {
        // Spread over the box, so that equal values do not overlap.
        let aside = ((i * 5) % 8) as f64 / 7.0 - 0.5;
        sheet.svg.begin_run(&run.row.id);
        sheet.svg.begin_value(&format!("{name}, seed {}: {}{unit}", run.row.seed, shown(*value)));
        sheet.svg.disc((x + 0.6 * width * aside, y(*value)), 1.8, colour(variant), 0.75);
        sheet.svg.end_group();
        sheet.svg.end_group();
    }
    Ok(())
}
