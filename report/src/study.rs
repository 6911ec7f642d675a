//! A study: the runs of a folder, grouped into cells of runs that differ only in the block.
//!
//! A *variant* is a value of what the plan compares: the lines of the figures and the rows of the
//! tables. A *condition* is the values of everything else, such as map size and team size: the
//! panels. A *block* is a map file and a seed: what all variants share, and pairs are formed by. A
//! cell is a condition and a variant.
//!
//! A run that repeats another one of its cell is no observation of its own ([`super::evidence`]):
//! [`Study::cell`] leaves it out.
//!
//! Invariants: a cell has at least one run, and its runs are sorted by block. No statistics here.

mod variants;

use std::cmp::Ordering;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use thiserror::Error;

use super::design::{Design, short_table};
use super::evidence;
use experiments::plan::{CONTROLLER, MAP_FILE, VARIANT};
use experiments::rows::{FailedRun, RunMetadata, RunRecord, RunRow, StoredRun};
use experiments::store::{PLAN, Store, StoreError};
use variants::Variants;

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

/// The parameters of a run except variant and block.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Condition {
    /// Values of [`Study::others`], in that order.
    pub(super) others: Vec<Value>,
    /// Cells of the map along x, y and z; `None` if variants or map files differ in it.
    pub(super) size: Option<[u32; 3]>,
    /// Size of the team; `None` if variants differ in it.
    pub(super) agents: Option<u32>,
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
    pub(super) size: Option<[u32; 3]>,
}

/// The runs of a cell.
#[derive(Debug, Clone, Default)]
struct RunGroup {
    /// Indices of all runs, by block.
    runs: Vec<usize>,
    /// For each of them, the place of the first run that it repeats; its own if it repeats none.
    first: Vec<usize>,
}

/// Runs of two cells in the same blocks.
#[derive(Debug, Clone, Default)]
pub(super) struct Pairs<'a> {
    /// Independent pairs: `a[i]` and `b[i]` are runs in the same block.
    pub(super) a: Vec<&'a RunRecord>,
    pub(super) b: Vec<&'a RunRecord>,
    /// Number of pairs, including those that repeat another one.
    pub(super) all: usize,
    /// Number of different maps of the independent pairs.
    pub(super) maps: usize,
}

#[derive(Debug, Clone)]
pub(super) struct Study {
    /// The text of the plan.
    pub(super) plan: Option<String>,
    pub(super) design: Design,
    pub(super) runs: Vec<RunRecord>,
    /// When and on which map each run was made.
    pub(super) made: Vec<RunMetadata>,
    /// The name of what is compared, such as `controller`.
    pub(super) variant_title: String,
    /// The variants by name, in the order of the plan; the index determines the colour.
    pub(super) variants: Vec<String>,
    /// Axes other than map size, team size, variant and block.
    pub(super) others: Vec<String>,
    /// Conditions that have a run.
    pub(super) conditions: Vec<Condition>,
    cells: BTreeMap<(Condition, usize), RunGroup>,
}

impl Study {
    /// Reads the runs of a folder, and its plan if it has one.
    pub(super) fn read(folder: &Path) -> Result<Self, StudyError> {
        let store = Store::open(folder)?;
        let mut runs = store.stored_runs()?;
        runs.extend(failed(store.failures()?, &runs));
        if runs.is_empty() {
            return Err(StudyError::Empty { folder: folder.to_owned() });
        }
        let plan = if folder.join(PLAN).exists() { Some(store.plan()?) } else { None };
        Ok(Self::new(runs, plan))
    }

    /// Groups runs into cells.
    pub(super) fn new(runs: Vec<StoredRun>, plan: Option<String>) -> Self {
        let design = Design::of(plan.as_deref());
        let (runs, made): (Vec<RunRecord>, Vec<RunMetadata>) = runs.into_iter().map(StoredRun::split).unzip();
        let Variants { compare, title, names, of_run } = Variants::of(&runs, &design);
        let is_set_by = |value: &dyn Fn(&RunRow) -> String, key: &dyn Fn(usize) -> String| {
            let mut values = BTreeMap::new();
            runs.iter().enumerate().all(|(i, run)| {
                let value = value(&run.row);
                *values.entry(key(i)).or_insert_with(|| value.clone()) == value
            })
        };
        let varies = |value: &dyn Fn(&RunRow) -> String| {
            runs.iter().map(|run| value(&run.row)).collect::<BTreeSet<_>>().len() > 1
        };
        let by_variant = |i: usize| of_run[i].to_string();
        let by_map = |i: usize| axis(&runs[i].row, MAP_FILE).to_owned();
        let (size, agents) = (|row: &RunRow| format!("{:?}", row.size), |row: &RunRow| row.agents.to_string());
        let is_size_shared = !varies(&size) || !(is_set_by(&size, &by_variant) || is_set_by(&size, &by_map));
        let is_team_shared = !varies(&agents) || !is_set_by(&agents, &by_variant);
        let keys: BTreeSet<&str> = runs.iter().flat_map(|run| run.row.axes.keys().map(String::as_str)).collect();
        let candidates = keys.into_iter().chain([CONTROLLER, BUILD]).collect::<BTreeSet<_>>();
        let named: [&dyn Fn(usize) -> String; 4] = [
            &by_variant,
            &|i| if is_size_shared { size(&runs[i].row) } else { String::new() },
            &|i| if is_team_shared { agents(&runs[i].row) } else { String::new() },
            &|i| runs[i].row.seed.to_string(),
        ];
        let makes_panels = |key: &&str| {
            let is_named = compare.iter().any(|compared| compared == key) || [VARIANT, MAP_FILE].contains(key);
            !is_named && !named.iter().any(|by| is_set_by(&|row| axis(row, key).to_owned(), by))
        };
        let others: Vec<String> = candidates.into_iter().filter(makes_panels).map(str::to_owned).collect();
        let mut cells: BTreeMap<(Condition, usize), RunGroup> = BTreeMap::new();
        for (i, RunRecord { row, .. }) in runs.iter().enumerate() {
            for others in panels_of(row, &others, &runs) {
                let size = is_size_shared.then_some(row.size);
                let condition = Condition { others, size, agents: is_team_shared.then_some(row.agents) };
                cells.entry((condition, of_run[i])).or_default().runs.push(i);
            }
        }
        for cell in cells.values_mut() {
            cell.runs.sort_by_key(|&i| (block(&runs[i].row), runs[i].row.id.clone()));
            cell.first = evidence::first_of_each(&cell.runs, &runs, &made);
        }
        let conditions: BTreeSet<Condition> = cells.keys().map(|(condition, _)| condition.clone()).collect();
        let conditions = conditions.into_iter().collect();
        Self { plan, design, runs, made, variant_title: title, variants: names, others, conditions, cells }
    }

    /// The runs of a variant under a condition, by block, without those that repeat another one;
    /// may be empty.
    pub(super) fn cell(&self, condition: &Condition, variant: usize) -> Vec<&RunRecord> {
        self.cells.get(&(condition.clone(), variant)).map_or_else(Vec::new, |cell| self.independent(cell))
    }

    fn independent(&self, cell: &RunGroup) -> Vec<&RunRecord> {
        let is_first = |(place, run): (usize, &usize)| (cell.first[place] == place).then(|| &self.runs[*run]);
        cell.runs.iter().enumerate().filter_map(is_first).collect()
    }

    /// All runs of a group, those that repeat another one included.
    pub(super) fn all_of_cell(&self, condition: &Condition, variant: usize) -> Vec<&RunRecord> {
        let cell = self.cells.get(&(condition.clone(), variant));
        cell.into_iter().flat_map(|cell| &cell.runs).map(|&run| &self.runs[run]).collect()
    }

    /// The runs of [`Self::cell`] that have not failed; may be empty.
    pub(super) fn measured(&self, condition: &Condition, variant: usize) -> Vec<&RunRecord> {
        self.cell(condition, variant).into_iter().filter(|run| run.row.failure().is_none()).collect()
    }

    /// Number of runs that have failed.
    pub(super) fn failed(&self) -> usize {
        self.runs.iter().filter(|run| run.row.failure().is_some()).count()
    }

    /// Condition, variant and independent runs of every cell.
    pub(super) fn cells(&self) -> impl Iterator<Item = (&Condition, usize, Vec<&RunRecord>)> {
        self.cells.iter().map(|((condition, variant), cell)| (condition, *variant, self.independent(cell)))
    }

    /// The runs of two variants under a condition, paired by block.
    pub(super) fn pairs(&self, condition: &Condition, a: usize, b: usize) -> Pairs<'_> {
        self.pairs_of(condition, (a, b), |_| true)
    }

    /// The pairs of [`Self::pairs`] of which no run has failed.
    pub(super) fn measured_pairs(&self, condition: &Condition, a: usize, b: usize) -> Pairs<'_> {
        self.pairs_of(condition, (a, b), |run| run.row.failure().is_none())
    }

    fn pairs_of(
        &self,
        condition: &Condition,
        (a, b): (usize, usize),
        counts: impl Fn(&RunRecord) -> bool,
    ) -> Pairs<'_> {
        let cell = |variant: usize| self.cells.get(&(condition.clone(), variant));
        let (Some(a), Some(b)) = (cell(a), cell(b)) else { return Pairs::default() };
        let of_b: BTreeMap<_, _> =
            b.runs.iter().enumerate().map(|(place, &run)| (block(&self.runs[run].row), place)).collect();
        let (mut pairs, mut seen, mut maps) = (Pairs::default(), BTreeSet::new(), BTreeSet::new());
        for (place_a, &run_a) in a.runs.iter().enumerate() {
            let place_b = of_b.get(&block(&self.runs[run_a].row)).filter(|place| {
                let run_b = b.runs[**place];
                counts(&self.runs[run_a]) && counts(&self.runs[run_b])
            });
            if let Some(&place_b) = place_b {
                pairs.all += 1;
                // A pair whose runs both repeat those of another pair is that pair.
                if seen.insert((a.first[place_a], b.first[place_b])) {
                    pairs.a.push(&self.runs[run_a]);
                    pairs.b.push(&self.runs[b.runs[place_b]]);
                    maps.insert(evidence::map_of(&self.runs[run_a].row, &self.made[run_a]));
                }
            }
        }
        pairs.maps = maps.len();
        pairs
    }

    /// The time to which all runs under a condition were observed, or ended before it by
    /// themselves: their least duration, s.
    pub(super) fn horizon_s(&self, condition: &Condition) -> f64 {
        let runs = (0..self.variants.len()).flat_map(|variant| self.all_of_cell(condition, variant));
        runs.map(|run| run.row.duration_s).reduce(f64::min).unwrap_or_default()
    }

    /// Ascending; empty if variants differ in it.
    pub(super) fn team_sizes(&self) -> Vec<u32> {
        let agents: BTreeSet<u32> = self.conditions.iter().filter_map(|condition| condition.agents).collect();
        agents.into_iter().collect()
    }

    /// The environments of all conditions.
    pub(super) fn environments(&self) -> Vec<Environment> {
        let environments: BTreeSet<Environment> = self.conditions.iter().map(Condition::environment).collect();
        environments.into_iter().collect()
    }

    pub(super) fn condition_name(&self, condition: &Condition) -> String {
        let team = condition.agents.map(agents_name);
        let environment = self.environment_name(&condition.environment());
        let parts = team.into_iter().chain((!environment.is_empty()).then_some(environment));
        parts.collect::<Vec<_>>().join(", ")
    }

    /// Empty if there is nothing to tell environments apart.
    pub(super) fn environment_name(&self, environment: &Environment) -> String {
        let size = environment.size.map(size_name);
        let others = self.others.iter().zip(&environment.others).map(|(key, value)| {
            let shown = self.shown(key, value);
            if shown == value.0 { format!("{key} = {shown}") } else { shown }
        });
        size.into_iter().chain(others).collect::<Vec<_>>().join(", ")
    }

    /// The value of an axis for readers.
    pub(super) fn shown(&self, key: &str, Value(value): &Value) -> String {
        let all: BTreeSet<&str> =
            self.runs.iter().filter_map(|run| run.row.axes.get(key)).map(String::as_str).collect();
        short_table(value, &all.into_iter().collect::<Vec<_>>()).unwrap_or_else(|| value.clone())
    }

    pub(super) fn seeds(&self) -> BTreeSet<u64> {
        self.runs.iter().map(|run| run.row.seed).collect()
    }

    /// The names of the map files, if the plan has several.
    pub(super) fn map_files(&self) -> BTreeSet<&str> {
        self.runs.iter().filter_map(|run| run.row.axes.get(MAP_FILE)).map(String::as_str).collect()
    }

    /// The number of blocks: combinations of map file and seed.
    pub(super) fn blocks(&self) -> usize {
        self.runs.iter().map(|run| block(&run.row)).collect::<BTreeSet<_>>().len()
    }

    /// The cells in which blocks of other cells are missing, each with their number.
    pub(super) fn missing(&self) -> Vec<(String, usize)> {
        let blocks = self.blocks();
        let mut missing = Vec::new();
        for condition in &self.conditions {
            for (variant, name) in self.variants.iter().enumerate() {
                let cell = self.all_of_cell(condition, variant);
                let present = cell.iter().map(|run| block(&run.row)).collect::<BTreeSet<_>>().len();
                if present < blocks {
                    missing.push((format!("{name}: {}", self.condition_name(condition)), blocks - present));
                }
            }
        }
        missing
    }

    /// The days on which the runs were executed: the first and the last, if they are known.
    pub(super) fn dates(&self) -> Option<(&str, &str)> {
        let dates: BTreeSet<&str> = self.made.iter().filter_map(|made| made.date.as_deref()).collect();
        Some((dates.first()?, dates.last()?))
    }
}

/// The runs that have failed, with what those on the same map know of it: its size, and the oracle
/// of a team like theirs.
fn failed(failures: Vec<FailedRun>, runs: &[StoredRun]) -> Vec<StoredRun> {
    let complete = |failed: FailedRun| {
        let is_known = failed.size.is_some();
        let mut failed = failed.into_stored();
        let on_map = || runs.iter().filter(|run| run.made.map.is_some() && run.made.map == failed.made.map);
        let like = on_map().find(|run| (run.row.agents, run.row.seed) == (failed.row.agents, failed.row.seed));
        let oracle = like.and_then(|run| run.row.oracle);
        let size = on_map().next().or(runs.first()).map(|run| run.row.size);
        failed.row.oracle = oracle;
        if let (Some(size), false) = (size, is_known) {
            failed.row.size = size;
        }
        failed
    };
    failures.into_iter().map(complete).collect()
}

/// Map file and seed of a run.
fn block(row: &RunRow) -> (String, u64) {
    (axis(row, MAP_FILE).to_owned(), row.seed)
}

/// The values of the axes that make panels, for each panel that a run belongs to: a run without
/// such an axis, because its controller does not have that setting, belongs to all of them.
fn panels_of(row: &RunRow, others: &[String], runs: &[RunRecord]) -> Vec<Vec<Value>> {
    let mut panels = vec![Vec::new()];
    for key in others {
        let values: BTreeSet<&str> = match row.axes.get(key) {
            None if key != BUILD && key != CONTROLLER => {
                runs.iter().filter_map(|run| run.row.axes.get(key)).map(String::as_str).collect()
            }
            _ => BTreeSet::from([axis(row, key)]),
        };
        let with = |panel: Vec<Value>| {
            let values = values.clone();
            values.into_iter().map(move |value| [panel.clone(), vec![Value(value.to_owned())]].concat())
        };
        panels = panels.into_iter().flat_map(with).collect();
    }
    panels
}

/// Treated as an axis if the runs are of several builds.
const BUILD: &str = "build";

fn axis<'a>(row: &'a RunRow, key: &str) -> &'a str {
    match row.axes.get(key) {
        Some(value) => value,
        None if key == BUILD => &row.build,
        None if key == CONTROLLER => &row.controller,
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
mod tests;
