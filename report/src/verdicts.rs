//! Verdicts: one sentence for each pair of variants and each panel, about the measure that the plan
//! has named before there were data.
//!
//! The better of the two comes first, with the size of the effect and its interval; then the number
//! of observations, and then the p-value. A second line has the log-rank test stratified by pair,
//! which asks another question: who is first, whatever the distance.

use super::estimates::Estimate;
use super::evidence::PAIRS_MIN;
use super::measure::{Compared, restricted};
use super::metrics::MILESTONES;
use super::pairs::{Comparison, comparisons, failed};
use super::study::{Condition, Study};
use experiments::plan::ALPHA;
use experiments::rows::{RunRecord, ticks};
use statistics::{Effect, Interval, StatisticsError, StratifiedLogRank, holm, stratified_log_rank};

/// The verdicts of a panel.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Verdicts {
    /// The name of the panel; may be empty.
    pub(super) panel: String,
    pub(super) verdicts: Vec<Verdict>,
}

/// The verdict on a pair of variants.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Verdict {
    /// The variants, by index.
    pub(super) variants: [usize; 2],
    /// `None` if no pair of runs can be compared.
    pub(super) comparison: Option<Comparison>,
    /// Number of independent pairs, with those of which a run has failed.
    pub(super) blocks: usize,
    /// Runs of each variant that have failed, among these.
    pub(super) failed: [usize; 2],
    pub(super) sentence: String,
    /// What the log-rank test says, if some run reaches its share.
    pub(super) second: Option<String>,
}

/// The verdicts of each panel that has several variants.
pub(super) fn verdicts(study: &Study) -> Result<Vec<Verdicts>, StatisticsError> {
    let compared = Compared::of(study.design.primary());
    let mut all = Vec::new();
    for condition in &study.conditions {
        let family = comparisons(study, condition, compared)?;
        let seconds = second_lines(study, condition, &family, compared)?;
        let verdict = |(comparison, second): (Comparison, _)| Verdict {
            variants: [comparison.a, comparison.b],
            blocks: comparison.blocks,
            failed: comparison.failed,
            sentence: sentence(study, &comparison, compared),
            second,
            comparison: Some(comparison),
        };
        let mut verdicts: Vec<Verdict> = family.into_iter().zip(seconds).map(verdict).collect();
        verdicts.extend(without_pairs(study, condition, compared));
        if !verdicts.is_empty() {
            all.push(Verdicts { panel: study.condition_name(condition), verdicts });
        }
    }
    Ok(all)
}

/// The verdicts on pairs of variants of which no two runs have a value, or none are on the same map
/// with the same seed.
fn without_pairs(study: &Study, condition: &Condition, compared: Compared) -> Vec<Verdict> {
    let variants = 0..study.variants.len();
    let pairs = variants.clone().flat_map(|a| (a + 1..variants.end).map(move |b| (a, b)));
    let has_runs = |variant: usize| !study.cell(condition, variant).is_empty();
    pairs
        .filter(|&(a, b)| compared.pairs(study, condition, a, b).a.is_empty() && has_runs(a) && has_runs(b))
        .filter_map(|(a, b)| {
            let pairs = study.pairs(condition, a, b);
            let (variants, blocks, failed) = ([a, b], pairs.a.len(), failed(&pairs));
            let sentence = if blocks == 0 {
                let [a, b] = variants.map(|variant| &study.variants[variant]);
                format!("No verdict on {a} and {b}: they have no map and seed in common; run the plan to its end.")
            } else {
                let of = if blocks == pairs.maps { "map" } else { "pair" };
                let failures = failures(study, variants, failed, &plural(blocks, of))?;
                format!("{} No pair of runs is left.", not_compared(study, variants, &failures, compared))
            };
            Some(Verdict { variants, comparison: None, blocks, failed, sentence, second: None })
        })
        .collect()
}

/// What the primary measure of a study is, and that no data have chosen it.
pub(super) fn about(study: &Study) -> String {
    let (measure, said) = (Words::of(Compared::of(study.design.primary())).measure, study.design.names_primary());
    let chosen = if said {
        "the primary measure that the plan names"
    } else {
        "the primary measure unless a plan names another"
    };
    format!("The verdicts are about {measure}, {chosen}; all others are secondary.")
}

/// The log-rank tests of a family; `None` where no run reaches the share.
fn second_lines(
    study: &Study,
    condition: &Condition,
    family: &[Comparison],
    compared: Compared,
) -> Result<Vec<Option<String>>, StatisticsError> {
    let milestone = MILESTONES[if let Compared::Time(place) = compared { place } else { 1 }];
    let horizon_s = study.horizon_s(condition);
    let mut tests = Vec::new();
    for comparison in family {
        let pairs = study.pairs(condition, comparison.a, comparison.b);
        let [a, b] = [&pairs.a, &pairs.b].map(|runs: &Vec<&RunRecord>| restricted(runs, milestone, horizon_s));
        tests.push(stratified_log_rank(&a, &b)?);
    }
    let can_test = |test: &StratifiedLogRank| test.first_a + test.first_b >= PAIRS_MIN;
    let p_values: Vec<f64> = tests.iter().filter(|test| can_test(test)).map(|test| test.p_value).collect();
    let mut adjusted = holm(&p_values)?.into_iter();
    let line = |(comparison, test): (&Comparison, &StratifiedLogRank)| {
        let p = if can_test(test) { adjusted.next() } else { None };
        let [first, second] = [comparison.a, comparison.b].map(|variant| &study.variants[variant]);
        let StratifiedLogRank { first_a, first_b, .. } = *test;
        let chance = p.map_or_else(|| "too few for a test".to_owned(), probability);
        (first_a + first_b > 0).then(|| {
            format!(
                "Secondary, log-rank test stratified by pair: {first} reaches {} % first or alone in {first_a} of {} pairs, \
                 {second} in {first_b}; {chance}. It asks who is first, not by how much.",
                milestone.percent, comparison.blocks
            )
        })
    };
    Ok(family.iter().zip(&tests).map(line).collect())
}

/// The words of a measure.
struct Words {
    /// As in `no difference in ...`.
    measure: &'static str,
    /// What the better variant does, today and in a sample: `needs`, `needed`.
    verbs: [&'static str; 2],
    /// Of what a failed run counts as.
    failed: &'static str,
}

impl Words {
    fn of(compared: Compared) -> Self {
        let (measure, verbs) = match compared {
            Compared::Time(0) => ("the time to 90 %", ["needs", "needed"]),
            Compared::Time(1) => ("the time to 99 %", ["needs", "needed"]),
            Compared::Time(_) => ("the time to 100 %", ["needs", "needed"]),
            Compared::Unseen => ("the area under the explored share", ["is", "was"]),
            Compared::Explored => ("the explored share at the end", ["explores", "explored"]),
            Compared::Distance => ("the distance of the team", ["moves", "moved"]),
        };
        let failed = match compared {
            Compared::Time(_) => "a failed run counts as not reached",
            Compared::Unseen | Compared::Explored => "a failed run counts as nothing explored",
            Compared::Distance => "pairs with a failed run are left out, which may be those on harder maps",
        };
        Self { measure, verbs, failed }
    }
}

/// The verdict on a pair of variants; names the runs that have failed.
fn sentence(study: &Study, comparison: &Comparison, compared: Compared) -> String {
    let Comparison { a, b, pairs, maps, .. } = *comparison;
    let blocks = plural(comparison.blocks, if pairs == maps { "map" } else { "pair" });
    match failures(study, [a, b], comparison.failed, &blocks) {
        Some(failures) if comparison.is_of_survivors => {
            let left = effect(study, comparison, compared);
            format!("{} Of the others: {left}", not_compared(study, [a, b], &failures, compared))
        }
        Some(failures) if comparison.failed == [comparison.blocks; 2] => {
            not_compared(study, [a, b], &failures, compared)
        }
        Some(failures) => {
            format!("{} {failures}: {}.", reached(study, comparison, compared), Words::of(compared).failed)
        }
        None => reached(study, comparison, compared),
    }
}

/// The effect, and how many runs have reached the share whose time is compared, if not all have.
fn reached(study: &Study, comparison: &Comparison, compared: Compared) -> String {
    let &Comparison { a, b, pairs, maps, horizon_s, .. } = comparison;
    let Compared::Time(place) = compared else { return effect(study, comparison, compared) };
    if !comparison.is_censored() {
        return effect(study, comparison, compared);
    }
    let [a, b] = [a, b].map(|variant| &study.variants[variant]);
    let percent = MILESTONES[place].percent;
    let of = plural(pairs, if pairs == maps { "map" } else { "pair" });
    match comparison.reached {
        [0, 0] => format!(
            "No verdict on {a} and {b}: neither reaches {percent} % on any of {of} within {horizon_s} s, so that there are \
             no times to compare."
        ),
        [of_a, of_b] => format!(
            "{} {a} reached {percent} % on {of_a} of {of}, {b} on {of_b}: a time that is not reached counts as the \
             {horizon_s} s of the run, on which the figure depends.",
            effect(study, comparison, compared)
        ),
    }
}

/// Which variants have failed on how many of the blocks, such as `rbw failed on 2 of 7 maps`.
fn failures(study: &Study, variants: [usize; 2], failed: [usize; 2], blocks: &str) -> Option<String> {
    let failure = |(variant, count): (usize, usize)| {
        (count > 0).then(|| format!("{} failed on {count} of {blocks}", study.variants[variant]))
    };
    let failures: Vec<String> = variants.into_iter().zip(failed).filter_map(failure).collect();
    (!failures.is_empty()).then(|| failures.join(", "))
}

fn not_compared(study: &Study, [a, b]: [usize; 2], failures: &str, compared: Compared) -> String {
    let Words { measure, failed, .. } = Words::of(compared);
    format!("No verdict on {} and {} in {measure}: {failures}; {failed}.", study.variants[a], study.variants[b])
}

fn effect(study: &Study, comparison: &Comparison, compared: Compared) -> String {
    let Comparison { pairs, maps, mean_a, mean_b, .. } = *comparison;
    let is_a_better = comparison.is_a_better(compared);
    let (first, second) = if is_a_better { (comparison.a, comparison.b) } else { (comparison.b, comparison.a) };
    let (first, second) = (&study.variants[first], &study.variants[second]);
    let words = Words::of(compared);
    let of = if pairs == maps { "map" } else { "pair" };
    let sample = if pairs == maps {
        format!("n = {}", plural(maps, "map"))
    } else {
        format!("n = {} on {}", plural(pairs, "pair"), plural(maps, "map"))
    };
    let repeated = if comparison.all_pairs > pairs {
        format!(" ({} pairs of runs, {} of them repetitions)", comparison.all_pairs, comparison.all_pairs - pairs)
    } else {
        String::new()
    };
    let sample = sample + &repeated;
    if mean_a == mean_b {
        return format!("{first} and {second} are equal in {} on average, {sample}.", words.measure);
    }
    let gain = Gain::of(comparison, compared, is_a_better);
    let [is, was] = words.verbs.map(|verb| format!("{first} {verb} {}", gain.than(comparison, compared, second)));
    let needed = comparison.needed();
    match comparison.adjusted {
        Some(p) if p < ALPHA => format!("{is}, {sample}; {}.", probability(p)),
        Some(p) if !comparison.can_be_shown => format!(
            "No difference in {} could be shown between {first} and {second}: {} need {}, and there are {pairs}. {was}, \
             {sample}; {}.",
            words.measure,
            plural(comparison.comparisons, "comparison"),
            plural(needed, of),
            probability(p)
        ),
        Some(p) => {
            let could = match comparison.detectable {
                Some(share) => {
                    let size = match compared.effect() {
                        Effect::Ratio => format!("{} %", figure(100.0 * share)),
                        Effect::Difference => format!("{} points", figure(share)),
                    };
                    format!(
                        "{} that scatter like these show a difference of {size} in four of five cases",
                        plural(pairs, of)
                    )
                }
                None => format!(
                    "{} that scatter like these show no difference in four of five cases, however large",
                    plural(pairs, of)
                ),
            };
            format!(
                "No difference in {} is shown between {first} and {second}: {was}, {sample}; {}. {could}.",
                words.measure,
                probability(p)
            )
        }
        None if comparison.is_of_survivors => format!("{was}, {sample}."),
        None if pairs == 1 => format!("{was} in one observation, {sample}: no evidence about other maps."),
        None => format!("{was}, {sample}: too few for a test, which needs {needed}."),
    }
}

/// The size of an effect, seen from the better variant.
struct Gain {
    /// With its unit and its interval, such as `12 % [4.0, 20]`.
    size: String,
    interval: String,
    /// Such as `1.7 times as fast`, of a ratio that is neither 0 nor 1.
    times: Option<String>,
}

impl Gain {
    fn of(comparison: &Comparison, compared: Compared, is_a_better: bool) -> Self {
        let Some(Estimate { mean, interval }) = comparison.effect else {
            return Self { size: "100 %".to_owned(), interval: String::new(), times: None };
        };
        // Less is a gain in a ratio, which is that of the better one over the other one.
        let size = |effect: f64| match (compared.effect(), is_a_better) {
            (Effect::Ratio, true) => 100.0 * (1.0 - effect),
            (Effect::Ratio, false) => 100.0 * (1.0 - 1.0 / effect),
            (Effect::Difference, true) => effect,
            (Effect::Difference, false) => -effect,
        };
        let unit = if compared.effect() == Effect::Ratio { " %" } else { " points" };
        let interval = interval.filter(|ends| compared.effect() == Effect::Difference || ends.low > 0.0);
        let interval = interval.map_or_else(String::new, |Interval { low, high }| {
            let ends = [size(low), size(high)];
            format!(" [{}, {}]", figure(ends[0].min(ends[1])), figure(ends[0].max(ends[1])))
        });
        let over = if is_a_better { 1.0 / mean } else { mean };
        let has_times = compared.effect() == Effect::Ratio && over.is_finite() && !comparison.is_censored();
        let times = has_times.then(|| if over < 1.995 { format!("{over:.2}") } else { figure(over) });
        Self { size: format!("{}{unit}", figure(size(mean))), interval, times }
    }

    /// What follows the verb: `70 % less time to 99 % than lvd [60, 78] (3.4 times as fast)`.
    fn than(&self, comparison: &Comparison, compared: Compared, second: &str) -> String {
        let Self { size, interval, times } = self;
        let means = [comparison.mean_a, comparison.mean_b];
        let [more, less] = if means[0] >= means[1] { means } else { [means[1], means[0]] };
        let times = |what: &str| times.as_ref().map_or_else(String::new, |times| format!(" ({times} times as {what})"));
        match compared {
            Compared::Time(place) => {
                format!("{size} less time to {} % than {second}{interval}{}", MILESTONES[place].percent, times("fast"))
            }
            Compared::Unseen => {
                let horizon = ticks(comparison.horizon_s);
                let area = |unseen: f64| 100.0 * (1.0 - unseen / horizon);
                format!(
                    "ahead of {second} in the area under the explored share ({:.1} against {:.1} %): a cell is seen {size} \
                     sooner on average{interval}{}",
                    area(less),
                    area(more),
                    times("fast")
                )
            }
            Compared::Explored => {
                format!("{size} more than {second}{interval} ({more:.1} against {less:.1} %)")
            }
            Compared::Distance => format!("{size} less than {second}{interval}"),
        }
    }
}

fn plural(count: usize, name: &str) -> String {
    format!("{count} {name}{}", if count == 1 { "" } else { "s" })
}

/// Two digits for small numbers; no number but 0 looks like 0.
fn figure(number: f64) -> String {
    let decimals = match number.abs() {
        size if size >= 9.95 => 0,
        size if size >= 0.05 || size == 0.0 => 1,
        size if size >= 0.005 => 2,
        _ => 3,
    };
    let text = format!("{number:.decimals$}");
    match text.strip_prefix('-') {
        Some(zero) if zero.bytes().all(|byte| matches!(byte, b'0' | b'.')) => "0.0".to_owned(),
        _ => text,
    }
}

fn probability(p: f64) -> String {
    if p < 0.001 { "p < 0.001".to_owned() } else { format!("p = {p:.3}") }
}

#[cfg(test)]
mod tests;
