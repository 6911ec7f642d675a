//! Comparison of the runs of a plan with stored ones: has a build, or a controller, become worse?
//!
//! Both sides are tables of runs, `runs.csv`, of the same plan. Runs are paired by their axes and
//! their seed, and so by map. A run is a function of its scenario, so runs of equal digests are the
//! same run, and any other difference has a cause. Whether it matters is decided for each variant
//! by the mean of one measure and the permutation test of the [`statistics`], adjusted for the
//! number of variants that have changed (Holm). With fewer pairs than this test needs for any
//! p-value below its level, the mean alone decides, and the result says so.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::path::{Path, PathBuf};

use experiments::plan::ALPHA;
use experiments::rows::ticks;
use experiments::store::{Store, StoreError};
use msgs::ids::Tick;
use simulation::scenario::keys::{self, Kind};
use statistics::{Effect, StatisticsError, exchange_test, holm, mean, pairs_needed};
use thiserror::Error;

use super::estimates::{LEVEL, SEED};

/// What is compared; less is better.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RegressionMeasure {
    /// Mean time until a free cell is seen, restricted to the duration.
    Unseen,
    /// Time to this share in per cent, restricted to the duration.
    TimeTo(u8),
}

impl RegressionMeasure {
    /// The value of a run, in ticks.
    fn value(self, fields: &BTreeMap<String, String>, duration_s: f64, row: &Place) -> Result<f64, RegressionError> {
        Ok(ticks(match self {
            Self::Unseen => duration_s * (1.0 - number(fields, "area_under_explored", Some(1.0), row)?),
            Self::TimeTo(percent) => {
                let name = format!("t{percent}_s");
                match fields.get(&name).is_some_and(String::is_empty) {
                    true => duration_s,
                    false => number(fields, &name, None, row)?.min(duration_s),
                }
            }
        }))
    }
}

impl fmt::Display for RegressionMeasure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unseen => write!(f, "mean time until a cell is seen"),
            Self::TimeTo(percent) => write!(f, "time to {percent} %"),
        }
    }
}

/// Why tables cannot be compared.
#[derive(Debug, Error)]
pub enum RegressionError {
    #[error("{}: {error}; expected a table of runs (runs.csv), or the folder of one", path.display())]
    Read { path: PathBuf, error: csv::Error },
    #[error("{place}: {column} = {value:?}; expected {expected}")]
    Number { place: String, column: String, value: String, expected: String },
    #[error("{place}: a second row of {variant}, {run}; expected one for each run")]
    Twice { place: String, variant: String, run: String },
    #[error("{}: has no run with the axes and the seed of a run of {}; expected results of one plan", new.display(), base.display())]
    OtherPlan { base: PathBuf, new: PathBuf },
    #[error("{} varies {new_axes}, and {} {base_axes}; expected results of one plan", new.display(), base.display())]
    OtherAxes { base: PathBuf, new: PathBuf, base_axes: String, new_axes: String },
    #[error(
        "{variant}, {run}: lasts {base_s} s in {} and {new_s} s in {}; expected results of one plan", base.display(), new.display()
    )]
    OtherDuration { variant: String, run: String, base_s: f64, new_s: f64, base: PathBuf, new: PathBuf },
    #[error(
        "{run}: {column} = {of_base} in {} and {of_new} in {}; expected results on the same maps",
        base.display(), new.display()
    )]
    OtherMap { run: String, column: &'static str, of_base: f64, of_new: f64, base: PathBuf, new: PathBuf },
    #[error(transparent)]
    Store(#[from] StoreError),
    #[error(transparent)]
    Statistics(#[from] StatisticsError),
}

/// A file, and a line of it, from 1.
struct Place<'a>(&'a Path, u64);

impl fmt::Display for Place<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}", self.0.display(), self.1)
    }
}

/// A number of a column, from 0 to `most` if there is such a bound.
fn number(
    fields: &BTreeMap<String, String>,
    column: &str,
    most: Option<f64>,
    row: &Place,
) -> Result<f64, RegressionError> {
    let value = fields.get(column).map_or("", String::as_str);
    let number = value.parse().ok().filter(|number: &f64| (0.0..=most.unwrap_or(f64::MAX)).contains(number));
    let expected = || most.map_or_else(|| "a number, 0 or more".to_owned(), |most| format!("0 to {most}"));
    number.ok_or_else(|| unexpected(column, value, expected(), row))
}

/// The seed of a run: of all 63 bits, which a float does not hold; tools that take columns with
/// gaps for floats write smaller ones as `7.0`.
fn seed(fields: &BTreeMap<String, String>, row: &Place) -> Result<u64, RegressionError> {
    let value = fields.get("seed").map_or("", String::as_str);
    let whole = value.strip_suffix(".0").unwrap_or(value);
    whole.parse().map_err(|_| unexpected("seed", value, "a whole number".to_owned(), row))
}

/// The value of an axis: a number has one text, also where a tool has taken `1` for `1.0`. Names of
/// variants and of files may look like numbers, and stay as they are.
fn axis_value((key, text): (&str, &str)) -> String {
    let is_number = keys::find(key)
        .is_some_and(|key| matches!(key.kind, Kind::Integer(_) | Kind::Number(_) | Kind::NumberOrMax | Kind::Size));
    let is_float = (is_number || key.starts_with("agents.set.")) && text.parse::<i128>().is_err();
    let number = text.parse().ok().filter(|number: &f64| is_float && number.is_finite());
    number.map_or_else(|| text.to_owned(), |number| number.to_string())
}

fn unexpected(column: &str, value: &str, expected: String, row: &Place) -> RegressionError {
    RegressionError::Number { place: row.to_string(), column: column.to_owned(), value: value.to_owned(), expected }
}

/// A run of a table, or one that has failed.
struct Row {
    value: f64,
    duration_s: f64,
    outcome: Outcome,
    /// What its table says of the map, by column; of a failed run nothing.
    map: BTreeMap<&'static str, f64>,
}

/// The columns in which two maps differ.
const OF_MAPS: [&str; 4] = ["size_x", "size_y", "size_z", "free_cells"];

/// What a run is, to compare it with another one.
#[derive(PartialEq, Eq)]
enum Outcome {
    /// It has ended, with this digest.
    Digest(String),
    /// It has failed, for this reason.
    Failed(String),
}

impl Row {
    fn is_failed(&self) -> bool {
        matches!(self.outcome, Outcome::Failed(_))
    }
}

/// The runs of a table by variant (values of the axes, or the controller), then by seed and map.
type Runs = BTreeMap<String, BTreeMap<String, Row>>;

/// A table of runs.
struct Table {
    /// Keys of the scenario that its plan varies.
    axes: BTreeSet<String>,
    runs: Runs,
}

impl Table {
    /// The axes for an error.
    fn axes(&self) -> String {
        match self.axes.is_empty() {
            true => "no key of the scenario".to_owned(),
            false => self.axes.iter().map(String::as_str).collect::<Vec<_>>().join(", "),
        }
    }
}

/// The table that a path names: a file, or `runs.csv` in a folder.
fn read(path: &Path, measure: RegressionMeasure) -> Result<Table, RegressionError> {
    let file = if path.is_dir() { path.join("runs.csv") } else { path.to_owned() };
    let unreadable = |error| RegressionError::Read { path: file.clone(), error };
    let mut reader = csv::Reader::from_path(&file).map_err(unreadable)?;
    let header = reader.headers().map_err(unreadable)?.clone();
    let axes = header.iter().filter_map(|name| name.strip_prefix("axis.")).map(str::to_owned).collect();
    let mut table = Table { axes, runs: Runs::new() };
    for (index, record) in reader.records().enumerate() {
        let record = record.map_err(unreadable)?;
        let fields: BTreeMap<String, String> =
            header.iter().zip(&record).map(|(name, field)| (name.to_owned(), field.to_owned())).collect();
        let place = Place(&file, index as u64 + 2);
        let axes = fields.iter().filter_map(|(name, value)| Some((name.strip_prefix("axis.")?, value.as_str())));
        let controller = fields.get("controller").map_or("", String::as_str);
        let (variant, key) = names(axes.collect(), controller, seed(&fields, &place)?);
        let digest = fields.get("digest").cloned().unwrap_or_default();
        let duration_s = number(&fields, "duration_s", None, &place)?;
        let value = measure.value(&fields, duration_s, &place)?;
        let of_map = |column| Some((column, fields.get(column)?.parse().ok()?));
        let map = OF_MAPS.into_iter().filter_map(of_map).collect();
        let row = Row { value, duration_s, outcome: Outcome::Digest(digest), map };
        if table.runs.entry(variant.clone()).or_default().insert(key.clone(), row).is_some() {
            return Err(RegressionError::Twice { place: place.to_string(), variant, run: key });
        }
    }
    if path.is_dir() && path.join("runs").is_dir() {
        add_failures(&mut table, path)?;
    }
    Ok(table)
}

/// Adds the failed runs of a folder, which have seen nothing until the end of their time.
fn add_failures(table: &mut Table, folder: &Path) -> Result<(), RegressionError> {
    for failed in Store::open(folder)?.failures()? {
        let axes = failed.axes.iter().map(|(key, value)| (key.as_str(), value.as_str()));
        let (variant, key) = names(axes.collect(), &failed.controller, failed.seed);
        let (value, duration_s) = (ticks(failed.duration_s), failed.duration_s);
        let row = Row { value, duration_s, outcome: Outcome::Failed(failed.reason.clone()), map: BTreeMap::new() };
        table.axes.extend(failed.axes.keys().cloned());
        table.runs.entry(variant).or_default().insert(key, row);
    }
    Ok(())
}

/// The variant of a run, by its axes, and what the run is found by among those of its variant.
fn names(mut axes: BTreeMap<&str, &str>, controller: &str, seed: u64) -> (String, String) {
    let map = axes.remove("map.file").unwrap_or_default();
    let variant = match axes.is_empty() {
        true => controller.to_owned(),
        false => axes.into_iter().map(axis_value).collect::<Vec<_>>().join(", "),
    };
    (variant, format!("seed {seed} {map}").trim_end().to_owned())
}

/// How a variant has changed.
#[derive(Debug, Clone, PartialEq)]
pub struct Change {
    pub variant: String,
    pub measure: RegressionMeasure,
    pub pairs: usize,
    /// Pairs that are the same run, byte for byte.
    pub same: usize,
    /// Stored runs without a new one.
    pub missing: usize,
    /// Stored runs, and new ones, that have failed; they count as nothing seen.
    pub failed: [usize; 2],
    /// Why the first of the new ones has.
    pub reason: Option<String>,
    /// Means in ticks.
    pub base: f64,
    pub new: f64,
    /// Whether chance explains the change.
    pub test: ChangeTest,
}

/// The test of a change.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ChangeTest {
    /// There is none: every pair is the same run.
    Unchanged,
    /// The variant has fewer pairs than any p-value below the level takes with so many variants.
    Undecided { needed: usize, variants: usize },
    /// The p-value, adjusted for the number of variants.
    Decided { p_value: f64 },
}

impl Change {
    /// Whether the variant is worse by more than a share of the stored mean, unless a test says
    /// that it may be by chance; a run that is missing is worse than any.
    #[must_use]
    pub fn is_regression(&self, tolerance: f64) -> bool {
        let is_chance = matches!(self.test, ChangeTest::Decided { p_value } if p_value >= ALPHA);
        let [failed_before, failed_now] = self.failed;
        self.missing > 0 || failed_now > failed_before || (self.new > self.base * (1.0 + tolerance) && !is_chance)
    }
}

impl fmt::Display for Change {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { variant, measure, pairs, same, missing, failed, reason, base, new, test } = self;
        if *pairs == 0 {
            return write!(f, "{variant}: none of its {missing} stored runs has a new one");
        }
        let seconds = |ticks: f64| ticks * Tick::TICK_S;
        write!(f, "{variant}: {measure} {:.1} s, was {:.1} s", seconds(*new), seconds(*base))?;
        if *base > 0.0 {
            write!(f, " ({:+.1} %)", 100.0 * (new / base - 1.0))?;
        }
        write!(f, ", n = {pairs}, {same} of them the same run")?;
        match test {
            ChangeTest::Unchanged => {}
            ChangeTest::Decided { p_value } => write!(f, "; p = {p_value:.3}")?,
            ChangeTest::Undecided { needed, variants } => {
                let plural = if *variants == 1 { "" } else { "s" };
                write!(
                    f,
                    "; chance cannot be ruled out: that takes at least {needed} maps with {variants} variant{plural}"
                )?;
            }
        }
        if *failed != [0; 2] {
            let reason = reason.as_ref().map_or_else(String::new, |reason| format!(" ({reason})"));
            write!(f, "; failed on {} of {pairs}{reason}, {} before", failed[1], failed[0])?;
        }
        if *missing > 0 {
            write!(f, "; {missing} stored runs have no new one")?;
        }
        Ok(())
    }
}

/// How the variants of `new` have changed since `base`; each is a `runs.csv` or its folder.
///
/// # Errors
/// If a table cannot be read, or the two have other axes or no run in common.
pub fn changes(base: &Path, new: &Path, measure: RegressionMeasure) -> Result<Vec<Change>, RegressionError> {
    let (stored, present) = (read(base, measure)?, read(new, measure)?);
    // Values alone would pair runs of two agents with those of a range of two metres.
    if stored.axes != present.axes {
        let (base, new) = (base.to_owned(), new.to_owned());
        let (base_axes, new_axes) = (stored.axes(), present.axes());
        return Err(RegressionError::OtherAxes { base, new, base_axes, new_axes });
    }
    let mut changes: Vec<Change> = Vec::new();
    // By the place of the variant: the values of the pairs of those that have changed.
    let mut changed: Vec<(usize, Vec<f64>, Vec<f64>)> = Vec::new();
    for (variant, stored) in &stored.runs {
        let nothing = BTreeMap::new();
        let present = present.runs.get(variant).unwrap_or(&nothing);
        let named = stored.iter().filter_map(|(key, row)| Some((key, row, present.get(key)?)));
        if let Some((run, one, other)) = named.clone().find(|(_, one, other)| one.duration_s != other.duration_s) {
            return Err(RegressionError::OtherDuration {
                variant: variant.clone(),
                run: run.clone(),
                base_s: one.duration_s,
                new_s: other.duration_s,
                base: base.to_owned(),
                new: new.to_owned(),
            });
        }
        let other_map = |(run, one, other): (&String, &Row, &Row)| {
            let (column, of_base, of_new) = one.map.iter().find_map(|(column, of_base)| {
                other.map.get(column).filter(|of_new| *of_new != of_base).map(|of_new| (*column, *of_base, *of_new))
            })?;
            let (base, new) = (base.to_owned(), new.to_owned());
            let run = format!("{variant}, {run}");
            Some(RegressionError::OtherMap { run, column, of_base, of_new, base, new })
        };
        if let Some(error) = named.clone().find_map(other_map) {
            return Err(error);
        }
        let pairs: Vec<(&Row, &Row)> = named.map(|(_, one, other)| (one, other)).collect();
        let side = |of: fn(&(&Row, &Row)) -> f64| pairs.iter().map(of).collect::<Vec<f64>>();
        let [a, b] = [side(|(base, _)| base.value), side(|(_, new)| new.value)];
        let same = pairs.iter().filter(|(base, new)| base.outcome == new.outcome).count();
        let failed_of = |of: fn(&(&Row, &Row)) -> bool| pairs.iter().filter(|pair| of(pair)).count();
        let failed = [failed_of(|(base, _)| base.is_failed()), failed_of(|(_, new)| new.is_failed())];
        let reason = pairs.iter().find_map(|(_, new)| match &new.outcome {
            Outcome::Failed(reason) => Some(reason.clone()),
            Outcome::Digest(_) => None,
        });
        let mean_of = |values: &[f64]| if values.is_empty() { Ok(0.0) } else { mean(values) };
        changes.push(Change {
            variant: variant.clone(),
            measure,
            pairs: pairs.len(),
            same,
            missing: stored.len() - pairs.len(),
            failed,
            reason,
            base: mean_of(&a)?,
            new: mean_of(&b)?,
            test: ChangeTest::Unchanged,
        });
        if same < pairs.len() {
            changed.push((changes.len() - 1, a, b));
        }
    }
    if changes.iter().all(|change| change.pairs == 0) {
        return Err(RegressionError::OtherPlan { base: base.to_owned(), new: new.to_owned() });
    }
    let variants = changed.len();
    let needed = pairs_needed(variants, ALPHA);
    let (mut tested, mut p_values) = (Vec::new(), Vec::new());
    for (place, a, b) in &changed {
        if a.len() < needed {
            changes[*place].test = ChangeTest::Undecided { needed, variants };
            continue;
        }
        tested.push(*place);
        p_values.push(exchange_test(b, a, Effect::Difference, LEVEL, ALPHA / variants as f64, SEED)?.p_value);
    }
    for (place, p_value) in tested.into_iter().zip(holm(&p_values)?) {
        changes[place].test = ChangeTest::Decided { p_value };
    }
    Ok(changes)
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    /// A table of one controller in which run `i` takes `times_s[i]`; empty: it does not get there.
    fn table(times_s: &[&str]) -> String {
        let mut text = "seed,controller,duration_s,area_under_explored,t99_s,digest\n".to_owned();
        for (seed, time_s) in times_s.iter().enumerate() {
            text += &format!("{seed},dsvp,100,0.5,{time_s},{time_s}\n");
        }
        text
    }

    fn change(base: &[&str], new: &[&str]) -> Change {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("base.csv"), table(base)).unwrap();
        fs::create_dir(folder.path().join("new")).unwrap();
        fs::write(folder.path().join("new/runs.csv"), table(new)).unwrap();
        let changes =
            changes(&folder.path().join("base.csv"), &folder.path().join("new"), RegressionMeasure::TimeTo(99));
        changes.unwrap().pop().unwrap()
    }

    #[test]
    fn same_runs_are_no_regression() {
        let times = ["10", "20", "30", "40", "50", ""];
        let change = change(&times, &times);
        assert_eq!((change.pairs, change.same, change.test), (6, 6, ChangeTest::Unchanged));
        assert!(!change.is_regression(0.0));
        assert_eq!(change.to_string(), "dsvp: time to 99 % 41.7 s, was 41.7 s (+0.0 %), n = 6, 6 of them the same run");
    }

    #[test]
    fn slower_runs_are_one_unless_it_is_little_or_chance() {
        let base = ["10", "20", "30", "40", "50", "60"];
        let slower = change(&base, &["12", "24", "36", "48", "60", ""]);
        assert!(slower.is_regression(0.05) && slower.is_regression(0.25), "{slower}");
        assert!(!change(&base, &["10.2", "20.4", "30.6", "40.8", "51", "61.2"]).is_regression(0.05));
        // One map of six decides nothing, but with fewer the mean does.
        assert!(!change(&base, &["10", "20", "30", "40", "50", ""]).is_regression(0.05));
        assert!(change(&base[..2], &["10", "90"]).is_regression(0.05));
        assert!(!change(&base, &["5", "10", "15", "20", "25", "30"]).is_regression(0.0));
    }

    /// The changes of so many variants that are seven times slower on each of so many maps.
    fn seven_times_slower(variants: usize, maps: usize) -> Vec<Change> {
        let folder = tempfile::tempdir().unwrap();
        let written = |name: &str, factor: usize| {
            let mut text = "seed,controller,duration_s,area_under_explored,t99_s,digest\n".to_owned();
            for (variant, seed) in (0..variants).flat_map(|variant| (0..maps).map(move |seed| (variant, seed))) {
                text += &format!("{seed},v{variant},1000,0.5,{},{name}\n", (10 + seed) * factor);
            }
            fs::write(folder.path().join(name), text).unwrap();
            folder.path().join(name)
        };
        changes(&written("base", 1), &written("new", 7), RegressionMeasure::TimeTo(99)).unwrap()
    }

    #[test]
    fn mean_decides_where_no_p_value_can() {
        for (variants, needed) in [(1, 6), (2, 7), (3, 7), (5, 8), (8, 9)] {
            for maps in needed - 2..=needed + 1 {
                let changes = seven_times_slower(variants, maps);
                assert_eq!(changes.len(), variants);
                for change in changes {
                    assert!(change.is_regression(0.05), "{variants} variants, {maps} maps: {change}");
                    let is_decided = matches!(change.test, ChangeTest::Decided { p_value } if p_value < ALPHA);
                    assert_eq!(is_decided, maps >= needed, "{variants} variants, {maps} maps: {change}");
                    let says = "chance cannot be ruled out: that takes at least";
                    assert_eq!(change.to_string().contains(says), maps < needed, "{change}");
                }
            }
        }
        let change = seven_times_slower(2, 6).remove(0).to_string();
        assert!(
            change.ends_with("; chance cannot be ruled out: that takes at least 7 maps with 2 variants"),
            "{change}"
        );
    }

    #[test]
    fn seeds_have_all_their_bits_and_runs_of_two_plans_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let written = |name: &str, rows: &str| {
            let file = folder.path().join(name);
            let head = "seed,controller,duration_s,area_under_explored,t99_s,digest\n";
            fs::write(&file, format!("{head}{rows}")).unwrap();
            file
        };
        let between = |base: &Path, new: &Path| changes(base, new, RegressionMeasure::TimeTo(99));
        let near = written("near.csv", "9007199254740992,dsvp,100,0.5,10,a\n9007199254740993,dsvp,100,0.5,20,b\n");
        assert_eq!(between(&near, &near).unwrap()[0].pairs, 2);
        let base = written("base.csv", "1,dsvp,100,0.5,10,a\n");
        let longer = written("longer.csv", "1,dsvp,200,0.5,10,a\n");
        let refused = between(&base, &longer).unwrap_err().to_string();
        assert!(
            refused.starts_with("dsvp, seed 1: lasts 100 s in ") && refused.contains(" and 200 s in "),
            "{refused}"
        );
        let endless = written("endless.csv", "1,dsvp,NaN,0.5,10,a\n");
        let refused = between(&base, &endless).unwrap_err().to_string();
        assert!(refused.ends_with("endless.csv:2: duration_s = \"NaN\"; expected a number, 0 or more"), "{refused}");
        let twice = written("twice.csv", "1,dsvp,100,0.5,10,a\n1,dsvp,100,0.5,90,b\n");
        let refused = between(&base, &twice).unwrap_err().to_string();
        assert!(refused.ends_with("twice.csv:3: a second row of dsvp, seed 1; expected one for each run"), "{refused}");
        let much = written("much.csv", "1,dsvp,100,1.5,10,a\n");
        let refused = changes(&base, &much, RegressionMeasure::Unseen).unwrap_err().to_string();
        assert!(refused.ends_with("much.csv:2: area_under_explored = \"1.5\"; expected 0 to 1"), "{refused}");
    }

    #[test]
    fn variant_without_runs_has_no_times() {
        let folder = tempfile::tempdir().unwrap();
        let [base, new] = ["base.csv", "new.csv"].map(|name| folder.path().join(name));
        let other = table(&["10"]).lines().nth(1).unwrap().replace("dsvp", "lvd");
        fs::write(&base, format!("{}{other}\n", table(&["10"]))).unwrap();
        fs::write(&new, table(&["10"])).unwrap();
        let changes = changes(&base, &new, RegressionMeasure::Unseen).unwrap();
        assert_eq!(changes[1].to_string(), "lvd: none of its 1 stored runs has a new one");
        assert!(changes[1].is_regression(10.0));
    }

    #[test]
    fn missing_run_is_a_regression() {
        let change = change(&["10", "20"], &["10"]);
        assert!(change.missing == 1 && change.is_regression(1.0));
    }

    #[test]
    fn failed_run_is_an_outcome() {
        let folder = tempfile::tempdir().unwrap();
        // A folder of a plan of two runs, of which those with these seeds have failed.
        let of = |name: &str, failed: &[u64]| {
            let path = folder.path().join(name);
            fs::create_dir_all(path.join("runs")).unwrap();
            fs::create_dir(path.join("failures")).unwrap();
            let lines: Vec<String> = (0..2)
                .filter(|seed| !failed.contains(seed))
                .map(|seed| format!("{seed},dsvp,100,0.5,50,same\n"))
                .collect();
            let header = "seed,controller,duration_s,area_under_explored,t99_s,digest\n";
            fs::write(path.join("runs.csv"), header.to_owned() + &lines.concat()).unwrap();
            for seed in failed {
                let run = format!(
                    r#"{{"id":"{seed}","build":"","controller":"dsvp","seed":{seed},"agents":2,"axes":{{}},
                    "duration_s":100.0,"reason":"agent 0 has panicked","made":{{"date":"2026-11-29","map":"a"}}}}"#
                );
                fs::write(path.join(format!("failures/{seed}.json")), run).unwrap();
            }
            path
        };
        let (whole, half, none) = (of("whole", &[]), of("half", &[1]), of("none", &[0, 1]));
        let change =
            |base: &Path, new: &Path| changes(base, new, RegressionMeasure::TimeTo(99)).unwrap().pop().unwrap();
        let worse = change(&whole, &half);
        assert!(worse.is_regression(10.0), "{worse}");
        assert_eq!(
            worse.to_string(),
            "dsvp: time to 99 % 75.0 s, was 50.0 s (+50.0 %), n = 2, 1 of them the same run; chance cannot be ruled \
             out: that takes at least 6 maps with 1 variant; failed on 1 of 2 (agent 0 has panicked), 0 before"
        );
        assert_eq!(change(&whole, &none).failed, [0, 2]);
        for same in [&half, &none] {
            let change = change(same, same);
            assert!(change.same == 2 && !change.is_regression(0.0), "{change}");
        }
        assert!(!change(&half, &whole).is_regression(0.0));
    }

    #[test]
    fn tables_of_different_plans_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let [base, new] = ["base.csv", "new.csv"].map(|name| folder.path().join(name));
        fs::write(&base, table(&["10"])).unwrap();
        fs::write(&new, table(&["10"]).replace("dsvp", "lvd")).unwrap();
        let error = changes(&base, &new, RegressionMeasure::Unseen).unwrap_err();
        assert!(matches!(error, RegressionError::OtherPlan { .. }), "{error}");
        fs::write(&new, table(&["soon"])).unwrap();
        let error = changes(&base, &new, RegressionMeasure::TimeTo(99)).unwrap_err().to_string();
        assert!(error.ends_with("new.csv:2: t99_s = \"soon\"; expected a number, 0 or more"), "{error}");
        let of_axis = |axis: &str| {
            let text = table(&["10"]).replace("digest\n", &format!("digest,axis.{axis}\n"));
            text.replace(",10,10\n", ",10,10,2\n")
        };
        fs::write(&base, of_axis("agents.count")).unwrap();
        fs::write(&new, of_axis("lidar.range_m")).unwrap();
        let error = changes(&base, &new, RegressionMeasure::Unseen).unwrap_err().to_string();
        assert!(
            error.contains("new.csv varies lidar.range_m, and ") && error.contains("base.csv agents.count;"),
            "{error}"
        );
        // Floats, as other tools write columns with gaps.
        let with_value = |value: &str| of_axis("agents.count").replace(",2\n", &format!(",{value}\n"));
        for (one, other) in [("2", "2.0"), ("2.0", "2"), ("0.00001", "1e-05"), ("-1", "-1.0")] {
            fs::write(&base, with_value(one)).unwrap();
            fs::write(&new, with_value(other)).unwrap();
            assert_eq!(changes(&base, &new, RegressionMeasure::Unseen).unwrap()[0].pairs, 1, "{one} and {other}");
        }
        let named = |value: &str| of_axis("variant").replace(",2\n", &format!(",{value}\n"));
        let second = named("1.1").lines().nth(1).unwrap().to_owned();
        fs::write(&base, format!("{}{second}\n", named("1.10"))).unwrap();
        assert_eq!(changes(&base, &base, RegressionMeasure::Unseen).unwrap().len(), 2, "names are no numbers");
        fs::write(&base, with_value("2")).unwrap();
        fs::write(&new, with_value("2.5")).unwrap();
        assert!(changes(&base, &new, RegressionMeasure::Unseen).is_err());
        for column in OF_MAPS {
            let of_map = |value: &str| {
                let text = table(&["10", "10"]).replace("digest\n", &format!("digest,{column}\n"));
                text.replace(",10,10\n", &format!(",10,10,{value}\n"))
            };
            fs::write(&base, of_map("30")).unwrap();
            fs::write(&new, of_map("30.0")).unwrap();
            assert_eq!(changes(&base, &new, RegressionMeasure::Unseen).unwrap()[0].pairs, 2);
            fs::write(&new, of_map("40")).unwrap();
            let error = changes(&base, &new, RegressionMeasure::Unseen).unwrap_err().to_string();
            assert!(error.starts_with(&format!("dsvp, seed 0: {column} = 30 in ")), "{error}");
            assert!(error.ends_with("new.csv; expected results on the same maps"), "{error}");
        }
        fs::write(&base, table(&["10"])).unwrap();
        fs::write(&new, "a,b\n1,2\n").unwrap();
        assert!(changes(&base, &new, RegressionMeasure::Unseen).unwrap_err().to_string().contains(":2: seed = "));
    }
}
