//! Which recordings of a batch are kept.
//!
//! A run is a function of its scenario, so a recording that was not kept can be made later: the
//! runs that turn out to be of interest at the end of a batch are executed once more, recorded, and
//! compared with their rows. Nothing is recorded in advance to be thrown away.

use std::collections::{BTreeMap, BTreeSet};

use crate::plan::{MAP_FILE, Plan};
use crate::rows::{RunRecord, RunRow};
use statistics::{StatisticsError, quantile};

/// The recordings to keep.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Keep {
    #[default]
    None,
    /// Of every run.
    All,
    /// Of runs that fail, and of runs that do not reach 99 %.
    Failures,
    /// Of runs far from the others that differ in seed and map file alone: beyond the quartiles by
    /// more than 1.5 times their distance (Tukey), in the time to 99 %, the area under the curve,
    /// or the distance.
    Outliers,
}

/// Least number of runs among which one can be an outlier.
const RUNS_MIN: usize = 5;

/// How far an outlier is beyond the quartiles, in distances between these.
const REACH: f64 = 1.5;

/// The metrics in which a run can be an outlier. A time that is not reached counts as the duration.
const METRICS: [fn(&RunRow) -> f64; 3] =
    [|row| row.t99_s.unwrap_or(row.duration_s), |row| row.area_under_explored, |row| row.distance_m];

/// The ids of the runs of a plan with a record whose recordings are to be kept. Outliers are found
/// among complete sets of runs only, so that they do not depend on the order of execution.
///
/// # Errors
/// If a metric is not finite.
pub(crate) fn chosen(keep: Keep, plan: &Plan, records: &[RunRecord]) -> Result<BTreeSet<String>, StatisticsError> {
    let planned: BTreeSet<&str> = plan.runs.iter().map(|run| run.id.as_str()).collect();
    let records: Vec<&RunRecord> = records.iter().filter(|record| planned.contains(record.row.id.as_str())).collect();
    let ids = |rows: Vec<&RunRow>| rows.into_iter().map(|row| row.id.clone()).collect();
    match keep {
        Keep::None => Ok(BTreeSet::new()),
        Keep::All => Ok(ids(records.iter().map(|record| &record.row).collect())),
        Keep::Failures => Ok(ids(records.iter().map(|record| &record.row).filter(|row| row.t99_s.is_none()).collect())),
        Keep::Outliers => {
            let mut sets: BTreeMap<_, (usize, Vec<&RunRow>)> = BTreeMap::new();
            for run in &plan.runs {
                sets.entry(without_block(&run.axes)).or_default().0 += 1;
            }
            for record in records {
                sets.entry(without_block(&record.row.axes)).or_default().1.push(&record.row);
            }
            let mut chosen = BTreeSet::new();
            for (_, rows) in sets.into_values().filter(|(all, rows)| rows.len() == *all && *all >= RUNS_MIN) {
                for metric in METRICS {
                    chosen.extend(outliers(&rows, metric)?);
                }
            }
            Ok(chosen)
        }
    }
}

fn without_block(axes: &BTreeMap<String, String>) -> BTreeMap<String, String> {
    axes.iter().filter(|(key, _)| *key != MAP_FILE).map(|(key, value)| (key.clone(), value.clone())).collect()
}

fn outliers(rows: &[&RunRow], metric: fn(&RunRow) -> f64) -> Result<Vec<String>, StatisticsError> {
    let mut values: Vec<f64> = rows.iter().map(|row| metric(row)).collect();
    values.sort_by(f64::total_cmp);
    let (low, high) = (quantile(&values, 0.25)?, quantile(&values, 0.75)?);
    let reach = REACH * (high - low);
    let is_far = |row: &&&RunRow| !(low - reach..=high + reach).contains(&metric(row));
    Ok(rows.iter().filter(is_far).map(|row| row.id.clone()).collect())
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    /// A plan of eight seeds, and a record for each of its runs.
    fn batch() -> (Plan, Vec<RunRecord>) {
        let text = "seeds = \"1..8\"\n[scenario]\nduration_s = 60.0\nmap = { kind = \"spheres\", size = 20 }\n\
                    agents = { count = 2 }\n";
        let plan = Plan::parse("p.toml", text, Path::new(".")).unwrap();
        let record = |run: &crate::plan::PlannedRun| {
            let t99_s = Some(40.0 + run.scenario.seed as f64);
            let row = RunRow { id: run.id.clone(), t99_s, duration_s: 60.0, ..RunRow::default() };
            RunRecord { row, ..RunRecord::default() }
        };
        let records = plan.runs.iter().map(record).collect();
        (plan, records)
    }

    #[test]
    fn policies_choose_runs() {
        let (plan, mut records) = batch();
        (records[2].row.t99_s, records[5].row.distance_m) = (None, 400.0);
        let ids = |places: &[usize]| places.iter().map(|&place| records[place].row.id.clone()).collect::<BTreeSet<_>>();
        let chosen_of = |keep| chosen(keep, &plan, &records).unwrap();
        assert_eq!(chosen_of(Keep::None), BTreeSet::new());
        assert_eq!(chosen_of(Keep::All).len(), 8);
        assert_eq!(chosen_of(Keep::Failures), ids(&[2]));
        assert_eq!(chosen_of(Keep::Outliers), ids(&[2, 5]));
        // A set that is not complete has no outliers yet, and runs of other plans have none.
        assert_eq!(chosen(Keep::Outliers, &plan, &records[1..]).unwrap(), BTreeSet::new());
        records[2].row.id = "another".to_owned();
        assert_eq!(chosen(Keep::Failures, &plan, &records).unwrap(), BTreeSet::new());
    }
}
