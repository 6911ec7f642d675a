//! The tables of a study: one row per cell. Estimates are over the independent runs.

use std::collections::BTreeMap;

use super::estimates::{Estimate, Quartiles, RESAMPLES, Times};
use super::metrics::{
    AREA, AT_BASE, ATTAINED, BELIEVED, COLLISIONS, CONTACT, COVERED, DISTANCE, DISTANCE_MAX, EXPLORED, FAILURES,
    IMBALANCE, KNOWN_AT_BASE, MILESTONES, Metric, Milestone, REAL_TIME_FACTOR, REDUNDANCY, STALENESS, TRAFFIC,
    TimeUnit, WALL,
};
use super::study::{Condition, Study};
use super::table::{Entry, Table, digits_for, mean_entry};
use experiments::rows::{Marks, OracleRow, RunRecord, RunRow};
use statistics::{StatisticsError, mean};

/// Decimals of shares in per cent and of minutes.
const DIGITS: usize = 1;

/// All tables except the pairwise comparisons.
pub(super) fn tables(study: &Study) -> Result<Vec<Table>, StatisticsError> {
    let mut tables = vec![outcome(study)?, times(study)?];
    tables.extend(oracle(study)?);
    tables.extend([effort(study)?, communication(study)?, endings(study)]);
    Ok(tables)
}

/// How far from possible: only if the plan has asked for it.
fn oracle(study: &Study) -> Result<Option<Table>, StatisticsError> {
    type Of = fn(&Marks) -> Option<f64>;
    type Reached = fn(&RunRow) -> Option<f64>;
    const MARKS: [(&str, Of, Reached); 3] = [
        ("90", |marks| marks.t90_s, |row| row.t90_s),
        ("99", |marks| marks.t99_s, |row| row.t99_s),
        ("100", |marks| marks.t100_s, |row| row.t100_s),
    ];
    if study.runs.iter().all(|run| run.row.oracle.is_none()) {
        return Ok(None);
    }
    let unit = TimeUnit::of(&study.runs);
    let mut columns = cell_columns(study);
    for (percent, ..) in MARKS {
        columns.push(column(&format!("times the reference plan, {percent} %"), &format!("times_oracle_{percent}")));
        columns.push(column(&format!("runs that reach {percent} %"), &format!("reached_{percent}")));
        let key = format!("oracle_{percent}_{}", unit.symbol);
        columns.push(column(&format!("reference plan, {percent} % ({})", unit.symbol), &key));
        let key = format!("bound_{percent}_{}", unit.symbol);
        columns.push(column(&format!("no team before, {percent} % ({})", unit.symbol), &key));
    }
    let mut faster = 0;
    let rows = rows(study, |runs| {
        let mut row = Vec::new();
        for (_, mark, reached) in MARKS {
            let with = |of: &dyn Fn(&RunRow, &OracleRow) -> Option<f64>| -> Vec<f64> {
                runs.iter().filter_map(|run| of(&run.row, run.row.oracle.as_ref()?)).collect()
            };
            let estimate = |values: Vec<f64>| -> Result<Option<Estimate>, StatisticsError> {
                if values.is_empty() { Ok(None) } else { Ok(Some(Estimate::of(&values, RESAMPLES)?)) }
            };
            let ratios = with(&|row, oracle| {
                let flown_s = mark(&oracle.flown).filter(|time_s| *time_s > 0.0)?;
                Some(reached(row).unwrap_or(row.duration_s) / flown_s)
            });
            faster += ratios.iter().filter(|ratio| **ratio < 1.0).count();
            row.push(Entry::Mean(estimate(ratios)?, 2));
            row.push(Entry::Share(runs.iter().filter(|run| reached(&run.row).is_some()).count(), runs.len()));
            let flown = estimate(with(&|_, oracle| mark(&oracle.flown)))?;
            row.push(Entry::Mean(flown.map(|flown| flown.in_unit(unit)), DIGITS));
            let bound = with(&|_, oracle| mark(&oracle.bound));
            let bound = if bound.is_empty() { None } else { Some(mean(&bound)? / unit.seconds) };
            // A bound of 0 is none, and none looks like 0.
            let bound = bound.filter(|bound| *bound > 0.0);
            row.push(Entry::Number(bound, bound.map_or(DIGITS, digits_for)));
        }
        Ok(row)
    })?;
    let below = match faster {
        0 => String::new(),
        1 => " One time here is below that of the reference plan: a ratio below 1.".to_owned(),
        more => format!(" {more} times here are below those of the reference plan: ratios below 1."),
    };
    let caption = format!(
        "Times against a reference plan: time of a run over that of the plan on the same map, mean [95 % CI]. The plan \
         was made with the map known in advance and flown by the same bodies; it is no optimum, and can be beaten.{below} \
         A run that does not reach a share counts with the duration, so its ratio is at least that large. The last \
         column of each share is the mean of a lower bound: no team sees as much before. It is empty where that bound \
         is 0."
    );
    Ok(Some(Table { name: "oracle", caption, columns, rows }))
}

fn outcome(study: &Study) -> Result<Table, StatisticsError> {
    let mut columns = cell_columns(study);
    columns.extend([column("runs", "runs"), column("independent", "independent")]);
    let has_failures = study.failed() > 0;
    columns.extend(has_failures.then(|| column("failed", "failed")));
    for metric in [EXPLORED, AREA] {
        columns.push(column(&format!("{}, mean [95 % CI]", metric.label()), metric.key));
        columns.push(column(&format!("{}, median (quartiles)", metric.label()), metric.key));
    }
    let has_wide_teams = study.runs.iter().any(|run| run.row.attainable.is_some());
    let at_base = has_base_stations(study).then_some(KNOWN_AT_BASE);
    let further = [has_wide_teams.then_some(ATTAINED), Some(BELIEVED), at_base, Some(COVERED)];
    for metric in further.iter().flatten() {
        columns.push(column(&format!("{}, mean [95 % CI]", metric.label()), metric.key));
    }
    let mut counts = study.cells().map(|(condition, variant, _)| study.all_of_cell(condition, variant).len());
    let rows = rows(study, |runs| {
        let mut row = vec![Entry::Count(counts.next().unwrap_or_default()), Entry::Count(runs.len())];
        let failed = runs.iter().filter(|run| run.row.failure().is_some()).count();
        row.extend(has_failures.then_some(Entry::Count(failed)));
        for metric in [EXPLORED, AREA] {
            let values = metric.values(runs);
            row.push(Entry::Mean(Some(Estimate::of(&values, RESAMPLES)?), DIGITS));
            row.push(Entry::Median(Some(Quartiles::of(&values)?), DIGITS));
        }
        for metric in further.iter().flatten() {
            row.push(Entry::Mean(Some(Estimate::of(&metric.values(runs), RESAMPLES)?), DIGITS));
        }
        Ok(row)
    })?;
    let caption = "Outcome: shares of the free cells, over the independent runs. The area under the curve is the mean of \
                   the explored share over the whole duration; the share is constant after the end of a run. A run that \
                   has failed counts with 0.";
    Ok(Table { name: "outcome", caption: caption.to_owned(), columns, rows })
}

fn times(study: &Study) -> Result<Table, StatisticsError> {
    let unit = TimeUnit::of(&study.runs);
    let mut columns = cell_columns(study);
    let of_team = MILESTONES.map(|milestone| (milestone, "", ""));
    let at_base = has_base_stations(study).then_some((AT_BASE, " at the base", "base_"));
    let milestones: Vec<_> = of_team.into_iter().chain(at_base).collect();
    for (Milestone { percent, .. }, place, prefix) in &milestones {
        let (share, key, symbol) = (format!("{percent} %{place}"), format!("{prefix}{percent}"), unit.symbol);
        columns.push(column(&format!("runs that reach {share}"), &format!("reached_{key}")));
        columns.push(column(&format!("share that reaches {share}"), &format!("success_{key}")));
        let title = format!("restricted mean time to {share} ({symbol}), [95 % CI]");
        columns.push(column(&title, &format!("time_{key}_{symbol}")));
        let title = format!("median time to {share} ({symbol})");
        columns.push(column(&title, &format!("time_{key}_{symbol}_median")));
    }
    let rows = rows(study, |runs| {
        let mut row = Vec::new();
        for &(milestone, ..) in &milestones {
            let times = Times::of(runs, milestone);
            row.push(Entry::Share(times.reached(), runs.len()));
            row.push(Entry::Number(Some(times.success()?), 2));
            row.push(Entry::Mean(Some(times.estimate()?.in_unit(unit)), DIGITS));
            row.push(Entry::Number(times.median_s()?.map(|time| time / unit.seconds), DIGITS));
        }
        Ok(row)
    })?;
    let caption = "Time until the team has seen 90, 99 and 100 % of the free cells. A run that does not reach a \
                   share is right-censored at the duration, as is one that has failed: the restricted mean uses the duration as its time, and \
                   the median (Kaplan-Meier) is missing where fewer than half of the runs reach the share.";
    Ok(Table { name: "times", caption: caption.to_owned(), columns, rows })
}

fn has_base_stations(study: &Study) -> bool {
    study.runs.iter().any(|run| run.row.known_at_base.is_some())
}

fn effort(study: &Study) -> Result<Table, StatisticsError> {
    let metrics = [DISTANCE, DISTANCE_MAX, REDUNDANCY, IMBALANCE, COLLISIONS, FAILURES];
    let caption = "Effort, mean [95 % CI]. Redundancy: cells seen by each agent itself, summed over the agents, \
                   divided by the cells seen by the team, minus 1. Imbalance: coefficient of variation of the cells \
                   that each agent has seen itself.";
    Ok(Table {
        name: "effort",
        caption: caption.to_owned(),
        columns: mean_columns(study, &metrics),
        rows: means(study, &metrics)?,
    })
}

fn communication(study: &Study) -> Result<Table, StatisticsError> {
    let metrics = [TRAFFIC, CONTACT, STALENESS];
    let caption = "Communication, mean [95 % CI]. Pairs in contact: share of the pairs of agents, mean over the run. \
                   Staleness: share of the cells seen by the team that an agent's map lacks, mean over agents and \
                   the run.";
    let columns = mean_columns(study, &metrics);
    Ok(Table { name: "communication", caption: caption.to_owned(), columns, rows: means(study, &metrics)? })
}

/// The table of wall time.
pub(super) fn cost(study: &Study) -> Result<Table, StatisticsError> {
    let mut columns = cell_columns(study);
    for metric in [REAL_TIME_FACTOR, WALL] {
        columns.push(column(&format!("{}, median (quartiles)", metric.label()), metric.key));
    }
    for percent in ["50", "95", "99"] {
        columns.push(column(&format!("decision, {percent}th percentile (µs)"), &format!("decision_p{percent}_us")));
    }
    let rows = rows(study, |runs| {
        let mut row = Vec::new();
        for metric in [REAL_TIME_FACTOR, WALL] {
            let values = metric.values(runs);
            let quartiles = if values.is_empty() { None } else { Some(Quartiles::of(&values)?) };
            row.push(Entry::Median(quartiles, quartiles.map_or(0, |quartiles| digits_for(quartiles.median))));
        }
        for time_us in DECISION_TIMES {
            let median_us = decision_us(runs, time_us)?;
            row.push(Entry::Number(median_us, median_us.map_or(0, digits_for)));
        }
        Ok(row)
    })?;
    let caption = "Wall time of the simulation, over the runs of a cell; it depends on the machine and its load. \
                   Decision times: percentiles of each run, of which the median over the runs is shown.";
    Ok(Table { name: "cost", caption: caption.to_owned(), columns, rows })
}

/// The 50th, 95th and 99th percentile of the decision times of a run, µs.
pub(super) const DECISION_TIMES: [fn(&RunRecord) -> Option<f64>; 3] =
    [|run| run.row.wall.decision_p50_us, |run| run.row.wall.decision_p95_us, |run| run.row.wall.decision_p99_us];

/// The median over the runs that have measured it, µs.
pub(super) fn decision_us(
    runs: &[&RunRecord],
    time_us: fn(&RunRecord) -> Option<f64>,
) -> Result<Option<f64>, StatisticsError> {
    let times: Vec<f64> = runs.iter().filter_map(|run| time_us(run)).collect();
    if times.is_empty() { Ok(None) } else { Ok(Some(Quartiles::of(&times)?.median)) }
}

fn endings(study: &Study) -> Table {
    let mut columns = cell_columns(study);
    columns.push(column("end reason", "reason"));
    columns.push(column("runs", "runs"));
    let mut rows = Vec::new();
    for (condition, variant, _) in study.cells() {
        let runs = study.all_of_cell(condition, variant);
        let mut reasons: BTreeMap<&str, usize> = BTreeMap::new();
        for run in &runs {
            *reasons.entry(run.row.reason.text()).or_default() += 1;
        }
        for (reason, count) in reasons {
            let mut row = cell_entries(study, condition, variant);
            row.extend([Entry::Text(reason.to_owned()), Entry::Share(count, runs.len())]);
            rows.push(row);
        }
    }
    Table { name: "endings", caption: "Reasons for the end of runs.".to_owned(), columns, rows }
}

fn rows(
    study: &Study,
    mut entries: impl FnMut(&[&RunRecord]) -> Result<Vec<Entry>, StatisticsError>,
) -> Result<Vec<Vec<Entry>>, StatisticsError> {
    let row = |(condition, variant, runs): (&Condition, usize, Vec<&RunRecord>)| {
        let mut row = cell_entries(study, condition, variant);
        row.extend(entries(&runs)?);
        Ok(row)
    };
    study.cells().map(row).collect()
}

fn mean_columns(study: &Study, metrics: &[Metric]) -> Vec<(String, String)> {
    let mut columns = cell_columns(study);
    columns.extend(metrics.iter().map(|metric| column(&metric.label(), metric.key)));
    columns
}

fn means(study: &Study, metrics: &[Metric]) -> Result<Vec<Vec<Entry>>, StatisticsError> {
    rows(study, |runs| {
        let entry = |metric: &Metric| match metric.values(runs).as_slice() {
            [] => Ok(Entry::Mean(None, 0)),
            values => Ok(mean_entry(Estimate::of(values, RESAMPLES)?)),
        };
        metrics.iter().map(entry).collect()
    })
}

/// The columns that identify a cell.
fn cell_columns(study: &Study) -> Vec<(String, String)> {
    let mut columns = condition_columns(study);
    columns.push(column(&study.variant_title, &study.variant_title));
    columns
}

/// The columns that identify a condition.
pub(super) fn condition_columns(study: &Study) -> Vec<(String, String)> {
    let mut columns: Vec<_> = study.others.iter().map(|key| column(key, key)).collect();
    let first = study.conditions.first();
    columns.extend(first.and_then(|condition| condition.size).map(|_| column("map (cells)", "map")));
    columns.extend(first.and_then(|condition| condition.agents).map(|_| column("agents", "agents")));
    columns
}

fn cell_entries(study: &Study, condition: &Condition, variant: usize) -> Vec<Entry> {
    let mut entries = condition_entries(study, condition);
    entries.push(Entry::Text(study.variants[variant].clone()));
    entries
}

/// The entries of [`condition_columns`].
pub(super) fn condition_entries(study: &Study, condition: &Condition) -> Vec<Entry> {
    let values = study.others.iter().zip(&condition.others);
    let mut entries: Vec<_> = values.map(|(key, value)| Entry::Text(study.shown(key, value))).collect();
    entries.extend(condition.size.map(Entry::Size));
    entries.extend(condition.agents.map(|agents| Entry::Count(agents as usize)));
    entries
}

/// A title for readers, and a column name for programs.
pub(super) fn column(title: &str, key: &str) -> (String, String) {
    (title.to_owned(), key.to_owned())
}
