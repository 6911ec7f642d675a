//! What counts as an observation, found out from the runs themselves.
//!
//! A seed makes a new observation only if something is drawn from it: the map, start poses, noise,
//! lost messages, or the decisions of a controller. Two runs of one cell on the same map that are
//! equal in every metric and at every sample are one observation, however many seeds there are.
//! Observations that share a map are independent given the map, and say nothing about other maps.

use super::study::Study;
use experiments::plan::ALPHA;
use experiments::rows::{RunMetadata, RunRecord, RunRow};
use statistics::pairs_needed;

/// Least number of pairs for a p-value: five cannot give less than 0.0625.
pub(super) const PAIRS_MIN: usize = 6;

/// For each of these runs, the place of the first one that it repeats; its own if it repeats none.
pub(super) fn first_of_each(of: &[usize], runs: &[RunRecord], made: &[RunMetadata]) -> Vec<usize> {
    let key = |i: usize| (map_of(&runs[i].row, &made[i]), outcome(&runs[i]));
    let keys: Vec<_> = of.iter().map(|&i| key(i)).collect();
    // How it would have ended is not known of a run that has failed, so it repeats none.
    let has_failed = |place: usize| runs[of[place]].row.failure().is_some();
    let first = |(place, own): (usize, &_)| {
        let same = keys[..place].iter().position(|other| other == own);
        same.filter(|_| !has_failed(place)).unwrap_or(place)
    };
    keys.iter().enumerate().map(first).collect()
}

/// What identifies the map of a run. For folders of earlier builds, which do not say: the metrics
/// that are the same on the same map, and hardly ever on two maps.
pub(super) fn map_of(row: &RunRow, made: &RunMetadata) -> String {
    let measured = || format!("{:?} {} {:?}", row.size, row.free_cells, row.axes.get(experiments::plan::MAP_FILE));
    made.map.clone().unwrap_or_else(measured)
}

/// The run without its name, its seed and its cost. The digest is left out because it covers the
/// scenario, and so the seed.
fn outcome(run: &RunRecord) -> RunRecord {
    let mut outcome = run.clone();
    let row = &mut outcome.row;
    (row.id, row.digest, row.seed) = (String::new(), String::new(), 0);
    row.axes.clear();
    row.oracle = None;
    row.wall = experiments::rows::WallRow {
        wall_s: 0.0,
        real_time_factor: 0.0,
        decision_p50_us: None,
        decision_p95_us: None,
        decision_p99_us: None,
        machine: String::new(),
    };
    outcome
}

/// What a reader has to know before the results, one sentence each; empty if every run is an
/// observation of its own and no two of a cell share a map.
pub(super) fn warnings(study: &Study) -> Vec<String> {
    let mut warnings = Vec::new();
    let (mut runs, mut independent) = (0, 0);
    for (condition, variant, cell) in study.cells() {
        runs += study.all_of_cell(condition, variant).len();
        independent += cell.len();
    }
    let failed = study.failed();
    if failed > 0 {
        let plural = if failed == 1 { "run has" } else { "runs have" };
        warnings.push(format!(
            "{failed} of {} {plural} failed. They count as runs that explore nothing and reach no share within the \
             duration; distance, redundancy, communication, collisions and wall time are over the others, which may \
             be those on easier maps.",
            study.runs.len()
        ));
    }
    let missing = study.missing();
    if !missing.is_empty() {
        let blocks = study.blocks();
        let cells: Vec<String> = missing.iter().map(|(cell, count)| format!("{cell} {count} of {blocks}")).collect();
        warnings.push(format!(
            "Runs are missing ({}). Verdicts are about the maps that both variants have, which may be the easier ones.",
            cells.join("; ")
        ));
    }
    if independent < runs {
        warnings.push(format!(
            "{runs} runs are {independent} independent observations: the others repeat a run on the same map in \
             every metric, because nothing that the seed decides has an effect on them. Repetitions are left out of \
             all intervals and tests. More maps make more observations; more seeds of the same map do not."
        ));
    }
    let (mut lacking, mut shared) = (None::<(usize, usize)>, None::<(usize, usize)>);
    for condition in &study.conditions {
        let (mut fewest, mut comparisons) = (usize::MAX, 0);
        for a in 0..study.variants.len() {
            for b in a + 1..study.variants.len() {
                let pairs = study.pairs(condition, a, b);
                if pairs.a.is_empty() {
                    continue;
                }
                comparisons += 1;
                fewest = fewest.min(pairs.a.len());
                if pairs.maps < pairs.a.len() {
                    let least = shared.is_none_or(|(_, maps)| pairs.maps < maps);
                    shared = if least { Some((pairs.a.len(), pairs.maps)) } else { shared };
                }
            }
        }
        let is_few = comparisons > 0 && fewest < pairs_needed(comparisons, ALPHA);
        if is_few && lacking.is_none_or(|(least, _)| fewest < least) {
            lacking = Some((fewest, comparisons));
        }
    }
    if let Some((pairs, maps)) = shared {
        let plural = if maps == 1 { "map" } else { "maps" };
        warnings.push(format!(
            "Pairs share a map: {pairs} pairs are on {maps} {plural}. Intervals and p-values of such pairs are about \
             {}, not about maps in general.",
            if maps == 1 { "this map" } else { "these maps" }
        ));
    }
    if let Some((pairs, comparisons)) = lacking {
        let plural = |count: usize, name: &str| format!("{count} {name}{}", if count == 1 { "" } else { "s" });
        warnings.push(format!(
            "Some comparisons have {} only: a panel of {} needs {} for any p-value below 5 % after the correction. \
             Below {PAIRS_MIN} there is no p-value.",
            plural(pairs, "independent pair"),
            plural(comparisons, "comparison"),
            pairs_needed(comparisons, ALPHA)
        ));
    }
    warnings
}
