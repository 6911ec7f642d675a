//! A study: the runs of a folder, grouped into cells of runs that differ only in the seed.
//!
//! A cell is a condition (map size, team size and the values of all other axes) and a controller.
//! Invariants: a cell has at least one run, and its runs are sorted by seed. No statistics here.

use std::cmp::Ordering;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use thiserror::Error;

use crate::rows::{RunRecord, RunRow};
use crate::store::{PLAN, Store, StoreError};

#[derive(Debug, Error)]
pub enum StudyError {
    #[error(transparent)]
    Store(#[from] StoreError),
    #[error("{folder}: no runs there; `maes batch` makes them", folder = folder.display())]
    Empty { folder: PathBuf },
}

/// The value of an axis. Numbers sort first, by value.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Value(pub(super) String);

impl Ord for Value {
    fn cmp(&self, other: &Self) -> Ordering {
        let number = |value: &Self| value.0.parse::<f64>().unwrap_or(f64::INFINITY);
        number(self).total_cmp(&number(other)).then_with(|| self.0.cmp(&other.0))
    }
}

impl PartialOrd for Value {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

/// The parameters of a run except controller and seed.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Condition {
    /// Values of [`Study::others`], in that order.
    pub(super) others: Vec<Value>,
    /// Cells of the map along x, y and z.
    pub(super) size: [u32; 3],
    pub(super) agents: u32,
}

impl Condition {
    /// The condition without the team size, for panels over the team size.
    pub(super) fn environment(&self) -> Environment {
        Environment { others: self.others.clone(), size: self.size }
    }
}

/// A [`Condition`] without the team size.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Environment {
    /// See [`Condition::others`].
    pub(super) others: Vec<Value>,
    /// See [`Condition::size`].
    pub(super) size: [u32; 3],
}

#[derive(Debug, Clone)]
pub(super) struct Study {
    /// The text of the plan.
    pub(super) plan: Option<String>,
    pub(super) runs: Vec<RunRecord>,
    /// In alphabetical order; the index determines the colour.
    pub(super) controllers: Vec<String>,
    /// Axes other than map size, team size, controller and seed.
    pub(super) others: Vec<String>,
    /// Conditions that have a run.
    pub(super) conditions: Vec<Condition>,
    cells: BTreeMap<(Condition, usize), Vec<usize>>,
}

impl Study {
    /// Reads the runs of a folder, and its plan if it has one.
    pub(super) fn read(folder: &Path) -> Result<Self, StudyError> {
        let store = Store::open(folder)?;
        let runs = store.records()?;
        if runs.is_empty() {
            return Err(StudyError::Empty { folder: folder.to_owned() });
        }
        let plan = if folder.join(PLAN).exists() { Some(store.plan()?) } else { None };
        Ok(Self::new(runs, plan))
    }

    /// Groups runs into cells.
    pub(super) fn new(runs: Vec<RunRecord>, plan: Option<String>) -> Self {
        let controllers: BTreeSet<&String> = runs.iter().map(|run| &run.row.controller).collect();
        let controllers: Vec<String> = controllers.into_iter().cloned().collect();
        let others = other_axes(&runs);
        let mut cells: BTreeMap<(Condition, usize), Vec<usize>> = BTreeMap::new();
        for (i, RunRecord { row, .. }) in runs.iter().enumerate() {
            let values = others.iter().map(|key| Value(axis(row, key).to_owned())).collect();
            let condition = Condition { others: values, size: row.size, agents: row.agents };
            let controller = controllers.iter().position(|name| *name == row.controller);
            cells.entry((condition, controller.expect("every controller is listed"))).or_default().push(i);
        }
        for cell in cells.values_mut() {
            cell.sort_by(|&a, &b| (runs[a].row.seed, &runs[a].row.id).cmp(&(runs[b].row.seed, &runs[b].row.id)));
        }
        let conditions: BTreeSet<Condition> = cells.keys().map(|(condition, _)| condition.clone()).collect();
        Self { plan, runs, controllers, others, conditions: conditions.into_iter().collect(), cells }
    }

    /// The runs of a controller under a condition, by seed; may be empty.
    pub(super) fn cell(&self, condition: &Condition, controller: usize) -> Vec<&RunRecord> {
        let runs = self.cells.get(&(condition.clone(), controller));
        runs.into_iter().flatten().map(|&run| &self.runs[run]).collect()
    }

    /// Condition, controller and runs of every cell.
    pub(super) fn cells(&self) -> impl Iterator<Item = (&Condition, usize, Vec<&RunRecord>)> {
        let runs = |cell: &Vec<usize>| cell.iter().map(|&run| &self.runs[run]).collect();
        self.cells.iter().map(move |((condition, controller), cell)| (condition, *controller, runs(cell)))
    }

    /// Ascending.
    pub(super) fn team_sizes(&self) -> Vec<u32> {
        let agents: BTreeSet<u32> = self.conditions.iter().map(|condition| condition.agents).collect();
        agents.into_iter().collect()
    }

    /// The environments of all conditions.
    pub(super) fn environments(&self) -> Vec<Environment> {
        let environments: BTreeSet<Environment> = self.conditions.iter().map(Condition::environment).collect();
        environments.into_iter().collect()
    }

    pub(super) fn condition_name(&self, condition: &Condition) -> String {
        format!("{}, {}", agents_name(condition.agents), self.environment_name(&condition.environment()))
    }

    pub(super) fn environment_name(&self, environment: &Environment) -> String {
        let others =
            self.others.iter().zip(&environment.others).map(|(key, Value(value))| format!(", {key} = {value}"));
        format!("{}{}", size_name(environment.size), others.collect::<String>())
    }

    pub(super) fn seeds(&self) -> BTreeSet<u64> {
        self.runs.iter().map(|run| run.row.seed).collect()
    }

    /// The cells in which seeds of other cells are missing, each with the number of missing seeds.
    pub(super) fn missing(&self) -> Vec<(String, usize)> {
        let seeds = self.seeds();
        let mut missing = Vec::new();
        for condition in &self.conditions {
            for (controller, name) in self.controllers.iter().enumerate() {
                let present: BTreeSet<u64> = self.cell(condition, controller).iter().map(|run| run.row.seed).collect();
                if present.len() < seeds.len() {
                    missing.push((format!("{name}: {}", self.condition_name(condition)), seeds.len() - present.len()));
                }
            }
        }
        missing
    }
}

/// The axes whose value is determined by neither size, team size, controller nor seed.
fn other_axes(runs: &[RunRecord]) -> Vec<String> {
    let builds: BTreeSet<&str> = runs.iter().map(|run| run.row.build.as_str()).collect();
    let keys: BTreeSet<&str> = runs.iter().flat_map(|run| run.row.axes.keys().map(String::as_str)).collect();
    let candidates = keys.into_iter().chain((builds.len() > 1).then_some(BUILD));
    let named: [fn(&RunRow) -> String; 4] = [
        |row| format!("{:?}", row.size),
        |row| row.agents.to_string(),
        |row| row.controller.clone(),
        |row| row.seed.to_string(),
    ];
    let determined = |key: &str, by: fn(&RunRow) -> String| {
        let mut values = BTreeMap::new();
        runs.iter().all(|run| *values.entry(by(&run.row)).or_insert_with(|| axis(&run.row, key)) == axis(&run.row, key))
    };
    candidates.filter(|key| !named.iter().any(|by| determined(key, *by))).map(str::to_owned).collect()
}

/// Treated as an axis if the runs are of several builds.
const BUILD: &str = "build";

fn axis<'a>(row: &'a RunRow, key: &str) -> &'a str {
    match row.axes.get(key) {
        Some(value) => value,
        None if key == BUILD => &row.build,
        None => "\u{2013}",
    }
}

pub(super) fn agents_name(agents: u32) -> String {
    format!("{agents} agent{}", if agents == 1 { "" } else { "s" })
}

pub(super) fn size_name([x, y, z]: [u32; 3]) -> String {
    if x == y && y == z { format!("{x}\u{b3} cells") } else { format!("{x} \u{d7} {y} \u{d7} {z} cells") }
}

#[cfg(test)]
mod tests {
    use super::super::fixture;
    use super::*;

    #[test]
    fn determined_axes_make_no_panels() {
        let mut runs = Vec::new();
        for (seed, agents, range) in [(1, 2, "10"), (1, 2, "5"), (2, 2, "10"), (1, 5, "10")] {
            let mut run = fixture::run("dsvp", seed, agents);
            run.row.axes.insert("lidar.range_m".to_owned(), range.to_owned());
            run.row.axes.insert("agents.count".to_owned(), agents.to_string());
            runs.push(run);
        }
        let study = Study::new(runs, None);
        assert_eq!(study.others, ["lidar.range_m"]);
        let names: Vec<_> = study.conditions.iter().map(|condition| study.condition_name(condition)).collect();
        assert_eq!(
            names,
            [
                "2 agents, 50³ cells, lidar.range_m = 5",
                "2 agents, 50³ cells, lidar.range_m = 10",
                "5 agents, 50³ cells, lidar.range_m = 10"
            ]
        );
        assert_eq!(study.missing().iter().map(|(_, count)| count).sum::<usize>(), 2);
    }

    #[test]
    fn builds_are_separate_conditions() {
        let mut other = fixture::run("dsvp", 1, 2);
        other.row.build = "0.2.0".to_owned();
        let study = Study::new(vec![fixture::run("dsvp", 1, 2), other], None);
        assert_eq!((study.others, study.conditions.len()), (vec!["build".to_owned()], 2));
    }

    #[test]
    fn folder_without_runs_is_an_error() {
        let dir = tempfile::tempdir().unwrap();
        let error = Study::read(dir.path()).unwrap_err().to_string();
        assert!(error.contains("runs"), "{error}");
        Store::create(dir.path()).unwrap();
        assert!(Study::read(dir.path()).unwrap_err().to_string().contains("no runs there"));
    }
}
