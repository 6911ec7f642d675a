//! Comparison of the runs of a plan with stored ones: has a build, or a controller, become worse?
//!
//! Both sides are tables of runs, `runs.csv`, of the same plan. Runs are paired by their axes and
//! their seed, and so by map. A run is a function of its scenario, so runs of equal digests are the
//! same run, and any other difference has a cause. Whether it matters is decided for each variant
//! by the mean of one measure, and with six pairs or more by the permutation test of the
//! [`statistics`], adjusted for the number of variants (Holm).

use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};

use experiments::plan::ALPHA;
use experiments::rows::ticks;
use msgs::ids::Tick;
use statistics::{Effect, StatisticsError, exchange_test, holm, mean};
use thiserror::Error;

use super::estimates::{LEVEL, SEED};
use super::evidence::PAIRS_MIN;

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
    fn value(self, fields: &BTreeMap<String, String>, row: &Place) -> Result<f64, RegressionError> {
        let duration_s = number(fields, "duration_s", row)?;
        Ok(ticks(match self {
            Self::Unseen => duration_s * (1.0 - number(fields, "area_under_explored", row)?),
            Self::TimeTo(percent) => {
                let name = format!("t{percent}_s");
                match fields.get(&name).is_some_and(String::is_empty) {
                    true => duration_s,
                    false => number(fields, &name, row)?.min(duration_s),
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
    #[error("{place}: {column} = {value:?}; expected a number")]
    Number { place: String, column: String, value: String },
    #[error("{}: has no run with the axes and the seed of a run of {}; expected results of one plan", new.display(), base.display())]
    OtherPlan { base: PathBuf, new: PathBuf },
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

fn number(fields: &BTreeMap<String, String>, column: &str, row: &Place) -> Result<f64, RegressionError> {
    let value = fields.get(column).map_or("", String::as_str);
    value.parse().map_err(|_| RegressionError::Number {
        place: row.to_string(),
        column: column.to_owned(),
        value: value.to_owned(),
    })
}

/// A run of a table.
struct Row {
    value: f64,
    digest: String,
}

/// The runs of a table by variant (values of the axes, or the controller), then by seed and map.
type Runs = BTreeMap<String, BTreeMap<String, Row>>;

/// The table that a path names: a file, or `runs.csv` in a folder.
fn read(path: &Path, measure: RegressionMeasure) -> Result<Runs, RegressionError> {
    let file = if path.is_dir() { path.join("runs.csv") } else { path.to_owned() };
    let unreadable = |error| RegressionError::Read { path: file.clone(), error };
    let mut reader = csv::Reader::from_path(&file).map_err(unreadable)?;
    let header = reader.headers().map_err(unreadable)?.clone();
    let mut runs = Runs::new();
    for (index, record) in reader.records().enumerate() {
        let record = record.map_err(unreadable)?;
        let fields: BTreeMap<String, String> =
            header.iter().zip(&record).map(|(name, field)| (name.to_owned(), field.to_owned())).collect();
        let place = Place(&file, index as u64 + 2);
        let axes = fields.iter().filter_map(|(name, value)| Some((name.strip_prefix("axis.")?, value)));
        let map = fields.get("axis.map.file").map_or("", String::as_str);
        let names: Vec<&str> = axes.filter(|(key, _)| *key != "map.file").map(|(_, value)| &**value).collect();
        let variant = match names.as_slice() {
            [] => fields.get("controller").cloned().unwrap_or_default(),
            names => names.join(", "),
        };
        let seed = number(&fields, "seed", &place)?;
        let row =
            Row { value: measure.value(&fields, &place)?, digest: fields.get("digest").cloned().unwrap_or_default() };
        runs.entry(variant).or_default().insert(format!("seed {seed} {map}").trim_end().to_owned(), row);
    }
    Ok(runs)
}

/// How a variant has changed.
#[derive(Debug, Clone, PartialEq)]
pub struct Change {
    pub variant: String,
    pub measure: RegressionMeasure,
    pub pairs: usize,
    /// Pairs that are the same run, byte for byte.
    pub same: usize,
    /// Stored runs without a new one, which has failed or is not there.
    pub missing: usize,
    /// Means in ticks.
    pub base: f64,
    pub new: f64,
    /// Adjusted; `None` below six pairs, and if all pairs are the same.
    pub p_value: Option<f64>,
}

impl Change {
    /// Whether the variant is worse by more than a share of the stored mean, and not by chance; a
    /// run that is missing is worse than any.
    #[must_use]
    pub fn is_regression(&self, tolerance: f64) -> bool {
        let is_chance = self.p_value.is_some_and(|p| p >= ALPHA);
        self.missing > 0 || (self.new > self.base * (1.0 + tolerance) && !is_chance)
    }
}

impl fmt::Display for Change {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { variant, measure, pairs, same, missing, base, new, p_value } = self;
        let seconds = |ticks: f64| ticks * Tick::TICK_S;
        write!(f, "{variant}: {measure} {:.1} s, was {:.1} s", seconds(*new), seconds(*base))?;
        if *base > 0.0 {
            write!(f, " ({:+.1} %)", 100.0 * (new / base - 1.0))?;
        }
        write!(f, ", n = {pairs}, {same} of them the same run")?;
        if let Some(p) = p_value {
            write!(f, "; p = {p:.3}")?;
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
/// If a table cannot be read, or the two have no run in common.
pub fn changes(base: &Path, new: &Path, measure: RegressionMeasure) -> Result<Vec<Change>, RegressionError> {
    let (stored, present) = (read(base, measure)?, read(new, measure)?);
    let mut changes = Vec::new();
    for (variant, stored) in &stored {
        let nothing = BTreeMap::new();
        let present = present.get(variant).unwrap_or(&nothing);
        let pairs: Vec<(&Row, &Row)> = stored.iter().filter_map(|(key, row)| Some((row, present.get(key)?))).collect();
        let side = |of: fn(&(&Row, &Row)) -> f64| pairs.iter().map(of).collect::<Vec<f64>>();
        let [a, b] = [side(|(base, _)| base.value), side(|(_, new)| new.value)];
        let same = pairs.iter().filter(|(base, new)| base.digest == new.digest).count();
        let p_value = (pairs.len() >= PAIRS_MIN && same < pairs.len())
            .then(|| exchange_test(&b, &a, Effect::Difference, LEVEL, ALPHA, SEED).map(|test| test.p_value))
            .transpose()?;
        let mean_of = |values: &[f64]| if values.is_empty() { Ok(0.0) } else { mean(values) };
        changes.push(Change {
            variant: variant.clone(),
            measure,
            pairs: pairs.len(),
            same,
            missing: stored.len() - pairs.len(),
            base: mean_of(&a)?,
            new: mean_of(&b)?,
            p_value,
        });
    }
    if changes.iter().all(|change| change.pairs == 0) {
        return Err(RegressionError::OtherPlan { base: base.to_owned(), new: new.to_owned() });
    }
    let p_values: Vec<f64> = changes.iter().filter_map(|change| change.p_value).collect();
    let mut adjusted = holm(&p_values)?.into_iter();
    for change in changes.iter_mut().filter(|change| change.p_value.is_some()) {
        change.p_value = adjusted.next();
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
        assert_eq!((change.pairs, change.same, change.p_value), (6, 6, None));
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

    #[test]
    fn missing_run_is_a_regression() {
        let change = change(&["10", "20"], &["10"]);
        assert!(change.missing == 1 && change.is_regression(1.0));
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
        assert!(error.ends_with("new.csv:2: t99_s = \"soon\"; expected a number"), "{error}");
        fs::write(&new, "a,b\n1,2\n").unwrap();
        assert!(changes(&base, &new, RegressionMeasure::Unseen).unwrap_err().to_string().contains(":2: seed = "));
    }
}
