//! The runs of a folder, put in order: cells of runs that differ in the seed alone.
//!
//! A cell is a place (map size, number of agents and the values of all other axes) and a controller. Invariants: cells hold at
//! least one run, and their runs are in ascending order of the seed. No statistics here.

use std::cmp::Ordering;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use thiserror::Error;

use crate::rows::{RunRecord, RunRow};
use crate::store::{PLAN, Store, StoreError};

/// Why there is nothing to report on.
#[derive(Debug, Error)]
pub enum StudyError {
    /// The folder cannot be read.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// There is no run.
    #[error("{folder}: no runs there; `experiments run` makes them", folder = folder.display())]
    Empty {
        /// The folder.
        folder: PathBuf,
    },
}

/// The value of an axis; numbers come first and in their order.
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

/// Everything but controller and seed.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Place {
    /// Values of [`Study::others`], in their order.
    pub(super) others: Vec<Value>,
    /// Cells of the map along x, y and z.
    pub(super) size: [u32; 3],
    /// How many agents.
    pub(super) agents: u32,
}

impl Place {
    /// The place without its number of agents: what panels over the number of agents are made for.
    pub(super) fn field(&self) -> Field {
        Field { others: self.others.clone(), size: self.size }
    }
}

/// A [`Place`] without its number of agents.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Field {
    /// See [`Place::others`].
    pub(super) others: Vec<Value>,
    /// See [`Place::size`].
    pub(super) size: [u32; 3],
}

/// Runs of a folder.
#[derive(Debug, Clone)]
pub(super) struct Study {
    /// The plan, as it was written.
    pub(super) plan: Option<String>,
    /// All runs.
    pub(super) runs: Vec<RunRecord>,
    /// Their controllers, in alphabetical order; the place of one is its colour.
    pub(super) controllers: Vec<String>,
    /// Axes beside map size, number of agents, controller and seed.
    pub(super) others: Vec<String>,
    /// All places that have a run.
    pub(super) places: Vec<Place>,
    cells: BTreeMap<(Place, usize), Vec<usize>>,
}

impl Study {
    /// Reads the runs of a folder, and its plan if there is one.
    ///
    /// # Errors
    /// If a file cannot be read or is not the file of a run, or if there is no run.
    pub(super) fn read(folder: &Path) -> Result<Self, StudyError> {
        let store = Store::open(folder)?;
        let runs = store.records()?;
        if runs.is_empty() {
            return Err(StudyError::Empty { folder: folder.to_owned() });
        }
        let plan = if folder.join(PLAN).exists() { Some(store.plan()?) } else { None };
        Ok(Self::new(runs, plan))
    }

    /// Puts runs in order.
    pub(super) fn new(runs: Vec<RunRecord>, plan: Option<String>) -> Self {
        let controllers: BTreeSet<&String> = runs.iter().map(|run| &run.row.controller).collect();
        let controllers: Vec<String> = controllers.into_iter().cloned().collect();
        let others = other_axes(&runs);
        let mut cells: BTreeMap<(Place, usize), Vec<usize>> = BTreeMap::new();
        for (i, RunRecord { row, .. }) in runs.iter().enumerate() {
            let values = others.iter().map(|key| Value(axis(row, key).to_owned())).collect();
            let place = Place { others: values, size: row.size, agents: row.agents };
            let controller = controllers.iter().position(|name| *name == row.controller);
            cells.entry((place, controller.expect("every controller is listed"))).or_default().push(i);
        }
        for cell in cells.values_mut() {
            cell.sort_by(|&a, &b| (runs[a].row.seed, &runs[a].row.id).cmp(&(runs[b].row.seed, &runs[b].row.id)));
        }
        let places: BTreeSet<Place> = cells.keys().map(|(place, _)| place.clone()).collect();
        Self { plan, runs, controllers, others, places: places.into_iter().collect(), cells }
    }

    /// The runs of a controller at a place, by seed; empty if there are none.
    pub(super) fn cell(&self, place: &Place, controller: usize) -> Vec<&RunRecord> {
        let runs = self.cells.get(&(place.clone(), controller));
        runs.into_iter().flatten().map(|&run| &self.runs[run]).collect()
    }

    /// All cells that have a run: place, controller, runs.
    pub(super) fn cells(&self) -> impl Iterator<Item = (&Place, usize, Vec<&RunRecord>)> {
        let runs = |cell: &Vec<usize>| cell.iter().map(|&run| &self.runs[run]).collect();
        self.cells.iter().map(move |((place, controller), cell)| (place, *controller, runs(cell)))
    }

    /// Numbers of agents.
    pub(super) fn team_sizes(&self) -> Vec<u32> {
        let agents: BTreeSet<u32> = self.places.iter().map(|place| place.agents).collect();
        agents.into_iter().collect()
    }

    /// Places without their number of agents.
    pub(super) fn fields(&self) -> Vec<Field> {
        let fields: BTreeSet<Field> = self.places.iter().map(Place::field).collect();
        fields.into_iter().collect()
    }

    /// What to call a place.
    pub(super) fn place_name(&self, place: &Place) -> String {
        format!("{}, {}", agents_name(place.agents), self.field_name(&place.field()))
    }

    /// What to call a field.
    pub(super) fn field_name(&self, field: &Field) -> String {
        let others = self.others.iter().zip(&field.others).map(|(key, Value(value))| format!(", {key} = {value}"));
        format!("{}{}", size_name(field.size), others.collect::<String>())
    }

    /// Seeds of all runs.
    pub(super) fn seeds(&self) -> BTreeSet<u64> {
        self.runs.iter().map(|run| run.row.seed).collect()
    }

    /// Cells that lack seeds that other cells have, or have no run at all, each with how many are lacking.
    pub(super) fn lacking(&self) -> Vec<(String, usize)> {
        let seeds = self.seeds();
        let mut lacking = Vec::new();
        for place in &self.places {
            for (controller, name) in self.controllers.iter().enumerate() {
                let there: BTreeSet<u64> = self.cell(place, controller).iter().map(|run| run.row.seed).collect();
                if there.len() < seeds.len() {
                    lacking.push((format!("{name}: {}", self.place_name(place)), seeds.len() - there.len()));
                }
            }
        }
        lacking
    }
}

/// Axes that tell runs apart which size, agents, controller and seed do not: those whose value none of these determines.
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

/// Taken for an axis if the runs are of several builds.
const BUILD: &str = "build";

fn axis<'a>(row: &'a RunRow, key: &str) -> &'a str {
    match row.axes.get(key) {
        Some(value) => value,
        None if key == BUILD => &row.build,
        None => "\u{2013}",
    }
}

/// What to call a number of agents.
pub(super) fn agents_name(agents: u32) -> String {
    format!("{agents} agent{}", if agents == 1 { "" } else { "s" })
}

/// What to call a map of a size in cells.
pub(super) fn size_name([x, y, z]: [u32; 3]) -> String {
    if x == y && y == z { format!("{x}\u{b3} cells") } else { format!("{x} \u{d7} {y} \u{d7} {z} cells") }
}

#[cfg(test)]
mod tests {
    use super::super::fixture;
    use super::*;

    #[test]
    fn axes_that_another_determines_make_no_panels() {
        let mut runs = Vec::new();
        for (seed, agents, range) in [(1, 2, "10"), (1, 2, "5"), (2, 2, "10"), (1, 5, "10")] {
            let mut run = fixture::run("dsvp", seed, agents);
            run.row.axes.insert("lidar.range_m".to_owned(), range.to_owned());
            run.row.axes.insert("agents.count".to_owned(), agents.to_string());
            runs.push(run);
        }
        let study = Study::new(runs, None);
        assert_eq!(study.others, ["lidar.range_m"]);
        let names: Vec<_> = study.places.iter().map(|place| study.place_name(place)).collect();
        assert_eq!(
            names,
            [
                "2 agents, 50³ cells, lidar.range_m = 5",
                "2 agents, 50³ cells, lidar.range_m = 10",
                "5 agents, 50³ cells, lidar.range_m = 10"
            ]
        );
        assert_eq!(study.lacking().iter().map(|(_, count)| count).sum::<usize>(), 2);
    }

    #[test]
    fn several_builds_are_kept_apart() {
        let mut other = fixture::run("dsvp", 1, 2);
        other.row.build = "0.2.0".to_owned();
        let study = Study::new(vec![fixture::run("dsvp", 1, 2), other], None);
        assert_eq!((study.others, study.places.len()), (vec!["build".to_owned()], 2));
    }

    #[test]
    fn a_folder_without_runs_is_an_error_that_names_it() {
        let dir = tempfile::tempdir().unwrap();
        let error = Study::read(dir.path()).unwrap_err().to_string();
        assert!(error.contains("runs"), "{error}");
        Store::create(dir.path()).unwrap();
        assert!(Study::read(dir.path()).unwrap_err().to_string().contains("no runs there"));
    }
}
