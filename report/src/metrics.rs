//! Metrics of a run, the milestones of exploration, and the unit of sim time of a report.

use experiments::rows::{RunRecord, RunRow};

/// A share of the free cells to explore.
#[derive(Debug, Clone, Copy)]
pub(super) struct Milestone {
    /// The share, per cent.
    pub(super) percent: &'static str,
    /// When a run reached it, s.
    pub(super) time_s: fn(&RunRow) -> Option<f64>,
}

/// 90, 99 and 100 % of the free cells.
pub(super) const MILESTONES: [Milestone; 3] = [
    Milestone { percent: "90", time_s: |row| row.t90_s },
    Milestone { percent: "99", time_s: |row| row.t99_s },
    Milestone { percent: "100", time_s: |row| row.t100_s },
];

/// 99 % of the free cells on the map of a base station.
pub(super) const AT_BASE: Milestone = Milestone { percent: "99", time_s: |row| row.t_base_99_s };

/// A metric of a run.
#[derive(Debug, Clone, Copy)]
pub(super) struct Metric {
    /// Stem of column and file names.
    pub(super) key: &'static str,
    pub(super) title: &'static str,
    /// Empty for a plain number.
    pub(super) unit: &'static str,
    pub(super) value: fn(&RunRow) -> f64,
    /// What a failed run counts with; `None`: the metric is over the runs that have not failed.
    pub(super) of_failed: Option<f64>,
}

impl Metric {
    /// Title and unit.
    pub(super) fn label(&self) -> String {
        if self.unit.is_empty() { self.title.to_owned() } else { format!("{} ({})", self.title, self.unit) }
    }

    /// The value of each run that counts.
    pub(super) fn values(&self, runs: &[&RunRecord]) -> Vec<f64> {
        runs.iter().filter_map(|run| self.value_of(run)).collect()
    }

    /// The value of a run; `None` if the run has failed and does not count.
    pub(super) fn value_of(&self, run: &RunRecord) -> Option<f64> {
        if run.row.failure().is_some() { self.of_failed } else { Some((self.value)(&run.row)) }
    }
}

pub(super) const EXPLORED: Metric = Metric {
    key: "explored",
    title: "explored at the end",
    unit: "%",
    value: |row| 100.0 * row.explored,
    of_failed: Some(0.0),
};
/// Of runs whose teams cannot see every free cell: what they could see is the whole.
pub(super) const ATTAINED: Metric = Metric {
    key: "attained",
    title: "explored of what bodies can see",
    unit: "%",
    value: |row| 100.0 * (row.explored / row.attainable.unwrap_or(1.0)).min(1.0),
    of_failed: Some(0.0),
};
pub(super) const AREA: Metric = Metric {
    key: "area",
    title: "area under the curve",
    unit: "%",
    value: |row| 100.0 * row.area_under_explored,
    of_failed: Some(0.0),
};
pub(super) const BELIEVED: Metric = Metric {
    key: "believed",
    title: "on an agent's map",
    unit: "%",
    value: |row| 100.0 * row.believed_mean,
    of_failed: Some(0.0),
};
/// Of runs with base stations.
pub(super) const KNOWN_AT_BASE: Metric = Metric {
    key: "known_at_base",
    title: "known at the base",
    unit: "%",
    value: |row| 100.0 * row.known_at_base.unwrap_or(0.0),
    of_failed: Some(0.0),
};
pub(super) const COVERED: Metric =
    Metric { key: "covered", title: "covered", unit: "%", value: |row| 100.0 * row.covered, of_failed: Some(0.0) };
pub(super) const DISTANCE: Metric =
    Metric { key: "distance", title: "distance of the team", unit: "m", value: |row| row.distance_m, of_failed: None };
pub(super) const DISTANCE_MAX: Metric = Metric {
    key: "distance_max",
    title: "longest distance of an agent",
    unit: "m",
    value: |row| row.distance_max_m,
    of_failed: None,
};
pub(super) const REDUNDANCY: Metric =
    Metric { key: "redundancy", title: "redundancy", unit: "%", value: |row| 100.0 * row.redundancy, of_failed: None };
pub(super) const IMBALANCE: Metric =
    Metric { key: "imbalance", title: "imbalance", unit: "%", value: |row| 100.0 * row.imbalance, of_failed: None };
pub(super) const CONTACT: Metric = Metric {
    key: "contact",
    title: "pairs in contact",
    unit: "%",
    value: |row| 100.0 * row.contact_share,
    of_failed: None,
};
pub(super) const STALENESS: Metric =
    Metric { key: "staleness", title: "staleness", unit: "%", value: |row| 100.0 * row.staleness, of_failed: None };
pub(super) const TRAFFIC: Metric = Metric {
    key: "traffic",
    title: "data delivered",
    unit: "kB",
    value: |row| row.message_bytes as f64 / 1e3,
    of_failed: None,
};
pub(super) const COLLISIONS: Metric =
    Metric { key: "collisions", title: "collisions", unit: "", value: |row| row.collisions as f64, of_failed: None };
pub(super) const FAILURES: Metric = Metric {
    key: "search_failures",
    title: "failed path searches",
    unit: "",
    value: |row| row.search_failures as f64,
    of_failed: None,
};
pub(super) const REAL_TIME_FACTOR: Metric = Metric {
    key: "real_time_factor",
    title: "real-time factor",
    unit: "sim s / wall s",
    value: |row| row.wall.real_time_factor,
    of_failed: None,
};
pub(super) const WALL: Metric =
    Metric { key: "wall", title: "wall time", unit: "s", value: |row| row.wall.wall_s, of_failed: None };

/// Unit of sim time in a report.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct TimeUnit {
    pub(super) symbol: &'static str,
    pub(super) seconds: f64,
}

impl TimeUnit {
    pub(super) const SECONDS: Self = Self { symbol: "s", seconds: 1.0 };

    /// Minutes if a run may take ten minutes or more.
    pub(super) fn of(runs: &[RunRecord]) -> Self {
        let longest_s = runs.iter().map(|run| run.row.duration_s).fold(0.0, f64::max);
        if longest_s >= 600.0 { Self { symbol: "min", seconds: 60.0 } } else { Self::SECONDS }
    }
}

/// The explored share of a run at a time, 0 to 1: linear between samples, constant after the last.
pub(super) fn explored_at(run: &RunRecord, time_s: f64) -> f64 {
    let series = &run.series;
    let next = series.partition_point(|sample| sample.t_s < time_s);
    match (next.checked_sub(1).map(|last| &series[last]), series.get(next)) {
        (Some(last), Some(next)) => {
            let part = (time_s - last.t_s) / (next.t_s - last.t_s);
            last.explored + part * (next.explored - last.explored)
        }
        (Some(only), None) | (None, Some(only)) => only.explored,
        (None, None) => run.row.explored,
    }
}

#[cfg(test)]
mod tests {
    use super::super::fixture;
    use super::*;

    #[test]
    fn explored_share_is_interpolated_and_constant_after_the_end() {
        let run = fixture::run("dsvp", 1, 2);
        // Samples at 0, 10 and 20 s: 0, 0.5 and 0.9.
        let at = |time_s| explored_at(&run, time_s);
        assert_eq!([at(0.0), at(5.0), at(10.0), at(20.0), at(35.0)], [0.0, 0.25, 0.5, 0.9, 0.9]);
    }
}
