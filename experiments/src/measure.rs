//! The metrics of a run: its row and its time series.
//!
//! All metrics derive from recorded messages: the progress, every ten seconds of sim time, the
//! stages of the agents, and the result. The row of a run is therefore the same with every
//! transport. Wall times are not, and the split of the redundancy needs the maps of the agents,
//! which only runs in this process show.

use std::collections::BTreeMap;
use std::time::Duration;

use msgs::counters::CounterName;
use msgs::ids::Tick;
use msgs::maes_msgs::{Progress, Result as RunResult};
use simulation::digest::Digest;
use simulation::end_reason::EndReason;
use simulation::scenario::Scenario;

use crate::plan::{BUILD, PlannedRun};
use crate::rows::{AgentSample, RunRecord, RunRow, SAMPLE_PERIOD_S, Sample, WallRow};
use in_memory::stages::StageTimes;

/// The data of a completed run.
#[derive(Debug, Clone)]
pub struct Trace<'a> {
    /// Cells of the map along x, y and z.
    pub size: [u32; 3],
    /// Edge of a cell, metres.
    pub cell_m: f64,
    /// From the start on, every ten seconds of sim time, and at the end.
    pub progress: &'a [Progress],
    pub result: &'a RunResult,
    pub stages: &'a StageTimes,
    /// Cells that agents saw with their own sensors and had on their maps before, summed over the
    /// agents; `None` if their maps are not known.
    pub seen_again: Option<u64>,
    /// Area of the walls around what the team has seen, m^2; `None` if a server of an earlier build
    /// does not say.
    pub explored_m2: Option<f64>,
    pub wall: WallRow,
}

/// The record of a planned run.
#[must_use]
pub fn record(run: &PlannedRun, trace: Trace<'_>) -> RunRecord {
    let Trace { size, cell_m, progress, result, stages, seen_again, explored_m2, wall } = trace;
    let scenario = &run.scenario;
    let counters: BTreeMap<CounterName, u64> = result.known_counters().collect();
    let count = |name| counters.get(&name).copied().unwrap_or(0);
    let reached = |permille| counters.get(&CounterName::TickExplored { permille }).map(|&tick| seconds(tick));
    let of_type = |(name, &bytes): (&CounterName, _)| match name {
        CounterName::MessageBytesOfType(message_type) => Some((*message_type, bytes)),
        _ => None,
    };
    let series: Vec<Sample> = progress.iter().map(|progress| sample(progress, scenario)).collect();
    let (seen_mean, seen_deviation) = mean_and_deviation(&result.explored_by);
    let stages = stages.until(Tick(result.tick));
    let free_cells = count(CounterName::FreeCells);
    let energy_j = counters.get(&CounterName::EnergyUsed).map(|&millijoules| millijoules as f64 / 1e3);
    let of_map_cells = |name| {
        let cells = counters.get(&CounterName::MapCells)?;
        ratio(count(name) as f64, *cells as f64)
    };
    let redundancy = redundancy(&result.explored_by, result.explored);
    let known = seen_again.map(|cells| ratio(cells as f64, free_cells as f64 * result.explored).unwrap_or(0.0));
    let row = RunRow {
        id: run.id.clone(),
        build: BUILD.to_owned(),
        controller: scenario.controllers_label(),
        seed: scenario.seed,
        size,
        agents: scenario.agents.count,
        axes: run.axes.clone(),
        duration_s: scenario.duration_s,
        end_s: seconds(result.tick),
        reason: EndReason::from(result.reason.as_str()),
        free_cells,
        explored: result.explored,
        explored_m3: Some(result.explored * free_cells as f64 * cell_m.powi(3)),
        explored_m2,
        attainable: counters.get(&CounterName::AttainablePpm).map(|&millionths| millionths as f64 / 1e6),
        covered: result.covered,
        believed_mean: mean_and_deviation(&result.believed_by).0,
        believed_min: result.believed_by.iter().copied().reduce(f64::min).unwrap_or(0.0),
        t50_s: reached(500),
        t90_s: reached(900),
        t99_s: reached(990),
        t99_9_s: reached(999),
        t100_s: reached(1000),
        area_under_explored: area_under(&series, scenario.duration_s),
        distance_m: result.distance_m.iter().sum(),
        distance_max_m: result.distance_m.iter().copied().fold(0.0, f64::max),
        energy_j,
        energy_per_cell_j: energy_j.and_then(|energy_j| ratio(energy_j, result.explored * free_cells as f64)),
        ran_empty: counters.get(&CounterName::RanEmpty).copied(),
        t_home_s: counters.get(&CounterName::TickHome).map(|&tick| seconds(tick)),
        known_at_base: known_at_base(scenario, &result.believed_by),
        t_base_99_s: counters.get(&CounterName::TickKnownAtBase).map(|&tick| seconds(tick)),
        position_error_m: counters.get(&CounterName::PositionError).map(|&micrometres| micrometres as f64 / 1e6),
        map_off_by_1: of_map_cells(CounterName::MapCellsOffBy1),
        map_off_by_2: of_map_cells(CounterName::MapCellsOffBy2),
        map_off_by_more: of_map_cells(CounterName::MapCellsOffByMore),
        redundancy,
        redundancy_known: known,
        redundancy_unknown: known.map(|known| (redundancy - known).max(0.0)),
        redundancy_first_minute: first_minute(progress).map(|at| self::redundancy(&at.explored_by, at.explored)),
        exploring_s: stages.exploring_s,
        relocating_s: stages.relocating_s,
        carrying_s: stages.carrying_s,
        waiting_s: stages.waiting_s,
        imbalance: ratio(seen_deviation, seen_mean).unwrap_or(0.0),
        contact_share: contact_share(progress, scenario.agents.count),
        messages: count(CounterName::MessagesDelivered),
        message_bytes: count(CounterName::MessageBytesDelivered),
        bytes_by_kind: counters.iter().filter_map(of_type).collect(),
        staleness: staleness(progress),
        decisions: count(CounterName::Decisions),
        collisions: count(CounterName::Collisions),
        search_failures: count(CounterName::FailedSearches),
        refusals: counters.iter().filter(|(name, _)| name.is_refusal()).map(|(_, count)| count).sum(),
        digest: Digest(result.digest).to_string(),
        oracle: None,
        wall,
    };
    RunRecord { row, series }
}

/// The figures of wall time. `decisions` are the wall times of decisions, ascending.
#[must_use]
pub fn wall_row(end: Tick, wall: Duration, decisions: &[Duration], machine: &str) -> WallRow {
    let quantile = |percent: usize| {
        // Nearest rank: the least value that `percent` per cent do not exceed.
        let place = (decisions.len() * percent).div_ceil(100).max(1) - 1;
        decisions.get(place).map(|time| time.as_secs_f64() * 1e6)
    };
    let wall_s = wall.as_secs_f64();
    WallRow {
        wall_s,
        real_time_factor: ratio(seconds(end.0), wall_s).unwrap_or(0.0),
        decision_p50_us: quantile(50),
        decision_p95_us: quantile(95),
        decision_p99_us: quantile(99),
        machine: machine.to_owned(),
    }
}

/// Sim time of a tick, s. Ticks per second are whole: the division rounds at most once.
fn seconds(tick: u64) -> f64 {
    Tick(tick).time_s()
}

/// The share that the base station with most of the map knows; `None` without any.
fn known_at_base(scenario: &Scenario, believed_by: &[f64]) -> Option<f64> {
    let stations = scenario.base_stations().into_iter();
    stations.filter_map(|agent| believed_by.get(agent.index()).copied()).reduce(f64::max)
}

fn sample(progress: &Progress, scenario: &Scenario) -> Sample {
    Sample {
        t_s: seconds(progress.tick),
        explored: progress.explored,
        covered: progress.covered,
        believed_mean: mean_and_deviation(&progress.believed_by).0,
        known_at_base: known_at_base(scenario, &progress.believed_by),
        distance_m: progress.distance_m.iter().sum(),
        message_bytes: progress.message_bytes,
        pairs_in_contact: progress.pairs_in_contact,
        agents: agents(progress),
    }
}

fn agents(progress: &Progress) -> Vec<AgentSample> {
    let Progress { explored_by, covered_by, believed_by, distance_m, .. } = progress;
    let figures = explored_by.iter().zip(covered_by).zip(believed_by).zip(distance_m);
    figures
        .map(|(((&explored, &covered), &believed), &distance_m)| AgentSample {
            explored,
            covered,
            believed,
            distance_m,
        })
        .collect()
}

fn ratio(numerator: f64, denominator: f64) -> Option<f64> {
    (denominator > 0.0).then(|| numerator / denominator)
}

/// The sum of what the agents have seen over what the team has, less 1.
fn redundancy(explored_by: &[f64], explored: f64) -> f64 {
    ratio(explored_by.iter().sum(), explored).map_or(0.0, |times| times - 1.0)
}

/// The progress after a minute, if the run was that long.
fn first_minute(progress: &[Progress]) -> Option<&Progress> {
    progress.iter().find(|progress| progress.tick == 60_000_000_000 / Tick::TICK_NS)
}

/// Mean and standard deviation of a population; 0 and 0 for an empty one.
fn mean_and_deviation(values: &[f64]) -> (f64, f64) {
    let count = values.len().max(1) as f64;
    // Not `sum`, which is -0 for an empty slice.
    let mean = values.iter().fold(0.0, |sum, value| sum + value) / count;
    let variance = values.iter().fold(0.0, |sum, value| sum + (value - mean) * (value - mean)) / count;
    (mean, variance.sqrt())
}

/// Mean of the explored share over the duration: linear between samples, constant after the last.
///
/// Not [`statistics::area_under`]: its rounding differs, and rows keep their bytes.
fn area_under(series: &[Sample], duration_s: f64) -> f64 {
    let between: f64 =
        series.windows(2).map(|pair| (pair[1].t_s - pair[0].t_s) * (pair[0].explored + pair[1].explored) * 0.5).sum();
    let after = series.last().map_or(0.0, |last| (duration_s - last.t_s).max(0.0) * last.explored);
    (between + after) / duration_s
}

/// The messages that are [`SAMPLE_PERIOD_S`] apart; the one at the end may follow sooner.
fn regular(progress: &[Progress]) -> impl Iterator<Item = &Progress> {
    let period_ticks = (SAMPLE_PERIOD_S * 1e9) as u64 / Tick::TICK_NS;
    progress.iter().filter(move |progress| progress.tick.is_multiple_of(period_ticks))
}

fn contact_share(progress: &[Progress], agents: u32) -> f64 {
    let pairs = f64::from(agents) * (f64::from(agents) - 1.0) / 2.0;
    let shares: Vec<f64> =
        regular(progress).filter_map(|progress| ratio(f64::from(progress.pairs_in_contact), pairs)).collect();
    mean_and_deviation(&shares).0
}

fn staleness(progress: &[Progress]) -> f64 {
    let shares: Vec<f64> = regular(progress)
        .flat_map(|progress| {
            let union = progress.explored;
            progress.believed_by.iter().filter_map(move |believed| ratio((union - believed).max(0.0), union))
        })
        .collect();
    mean_and_deviation(&shares).0
}

#[cfg(test)]
mod tests;
