//! Verdicts: one sentence for each pair of variants and each panel.
//!
//! The sentence is about the time to 99 % if some run of the panel reaches it, and else about the
//! area under the curve; which of the two does not depend on the variants, so the choice favours
//! none. The better of the two comes first, with the size of the effect and its interval; then the
//! number of observations, and then the p-value.

use super::metrics::MILESTONES;
use super::pairs::{ALPHA, Compared, Comparison, comparisons};
use super::study::{Condition, Study};
use statistics::{Interval, StatisticsError};

/// The verdicts of a panel.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Verdicts {
    /// The name of the panel; may be empty.
    pub(super) panel: String,
    pub(super) sentences: Vec<String>,
}

/// The verdicts of each panel that has several variants.
pub(super) fn verdicts(study: &Study) -> Result<Vec<Verdicts>, StatisticsError> {
    let mut all = Vec::new();
    for condition in &study.conditions {
        let compared = metric(study, condition);
        let family = comparisons(study, condition, compared)?;
        if !family.is_empty() {
            let sentences = family.iter().map(|comparison| sentence(study, comparison, compared)).collect();
            all.push(Verdicts { panel: study.condition_name(condition), sentences });
        }
    }
    Ok(all)
}

fn metric(study: &Study, condition: &Condition) -> Compared {
    let runs = (0..study.variants.len()).flat_map(|variant| study.cell(condition, variant));
    let mut reached = runs.filter(|run| (MILESTONES[1].time_s)(&run.row).is_some());
    if reached.next().is_some() { Compared::Time } else { Compared::AREA }
}

/// The verdict on a pair of variants; names the runs that have failed, which count as not reached.
fn sentence(study: &Study, comparison: &Comparison, compared: Compared) -> String {
    let Comparison { a, b, pairs, maps, failed, .. } = *comparison;
    let of = if pairs == maps { "map" } else { "pair" };
    let failure = |(variant, count): (usize, usize)| {
        let plural = if pairs == 1 { "" } else { "s" };
        (count > 0).then(|| format!("{} failed on {count} of {pairs} {of}{plural}", study.variants[variant]))
    };
    let failures: Vec<String> = [(a, failed[0]), (b, failed[1])].into_iter().filter_map(failure).collect();
    let verdict = effect(study, comparison, compared);
    if failures.is_empty() {
        return verdict;
    }
    let counts = match compared {
        Compared::Time => "not reached",
        Compared::Metric(..) => "nothing explored",
    };
    format!("{verdict} {}: a failed run counts as {counts}.", failures.join(", "))
}

fn effect(study: &Study, comparison: &Comparison, compared: Compared) -> String {
    let Comparison { pairs, maps, mean_a, mean_b, .. } = *comparison;
    let (better, what) = match compared {
        Compared::Time => ("faster to 99 %", "the time to 99 %"),
        Compared::Metric(..) => ("ahead", "the area under the curve"),
    };
    // `A is faster to 99 % than B by ...`, `A is ahead of B in the area under the curve by ...`
    let (than, by) = match compared {
        Compared::Time => ("than", "by"),
        Compared::Metric(..) => ("of", "in the area under the curve by"),
    };
    let is_a_better = comparison.is_a_better(compared);
    let (first, second) = if is_a_better { (comparison.a, comparison.b) } else { (comparison.b, comparison.a) };
    let (first, second) = (&study.variants[first], &study.variants[second]);
    let plural = |count: usize, name: &str| format!("{count} {name}{}", if count == 1 { "" } else { "s" });
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
        return format!("{first} and {second} are equal in {what} on average, {sample}.");
    }
    let gain = gain(comparison, compared, is_a_better);
    match comparison.adjusted {
        Some(p) if p < ALPHA => {
            format!("{first} is {better} {than} {second} {by} {gain}, {sample}; {}.", probability(p))
        }
        Some(p) => {
            let could = comparison.detectable.map_or_else(String::new, |share| {
                format!(" {pairs} pairs would show a difference of {} % in four of five cases.", figure(100.0 * share))
            });
            format!(
                "No difference in {what} is shown between {first} and {second}: {first} is {better} by {gain}, \
                 {sample}; {}.{could}",
                probability(p)
            )
        }
        None if pairs == 1 => format!(
            "{first} was {better} {than} {second} {by} {gain} in one observation, {sample}: no evidence about other maps."
        ),
        None => format!(
            "{first} was {better} {than} {second} {by} {gain}, {sample}: too few for a test, which needs {}.",
            super::evidence::PAIRS_MIN
        ),
    }
}

/// The effect in per cent of the other one's mean, with its interval.
fn gain(comparison: &Comparison, compared: Compared, is_a_better: bool) -> String {
    let Some(ratio) = comparison.ratio.filter(|ratio| ratio.mean > 0.0) else {
        return "all there is".to_owned();
    };
    // Over the other one: A / B if A is better, and B / A otherwise.
    let over = |ratio: f64| if is_a_better { ratio } else { 1.0 / ratio };
    // Less time is a gain.
    let percent = |ratio: f64| match compared {
        Compared::Time => 100.0 * (1.0 - over(ratio)),
        Compared::Metric(..) => 100.0 * (over(ratio) - 1.0),
    };
    let effect = format!("{} %", figure(percent(ratio.mean)));
    match ratio.interval.filter(|interval| interval.low > 0.0) {
        Some(Interval { low, high }) => {
            let ends = [percent(low), percent(high)];
            format!("{effect} [{}, {}]", figure(ends[0].min(ends[1])), figure(ends[0].max(ends[1])))
        }
        None => effect,
    }
}

/// Two digits for small numbers.
fn figure(number: f64) -> String {
    let text = if number.abs() < 9.95 { format!("{number:.1}") } else { format!("{number:.0}") };
    if text == "-0.0" { "0.0".to_owned() } else { text }
}

fn probability(p: f64) -> String {
    if p < 0.001 { "p < 0.001".to_owned() } else { format!("p = {p:.3}") }
}

#[cfg(test)]
mod tests {
    use super::super::estimates::Estimate;
    use super::super::fixture;
    use super::*;
    use experiments::rows::{RunMetadata, StoredRun};

    fn study() -> Study {
        let run = |controller| StoredRun::new(fixture::run(controller, 1, 2), RunMetadata::default());
        Study::new(vec![run("dsvp"), run("rbw")], None)
    }

    fn comparison(ratio: f64, (low, high): (f64, f64), pairs: usize, adjusted: Option<f64>) -> Comparison {
        Comparison {
            a: 0,
            b: 1,
            pairs,
            all_pairs: pairs,
            maps: pairs,
            failed: [0, 0],
            mean_a: ratio,
            mean_b: 1.0,
            ratio: Some(Estimate { mean: ratio, interval: Some(Interval { low, high }) }),
            a12: 0.5,
            test: None,
            adjusted,
            detectable: Some(0.153),
        }
    }

    #[test]
    fn effect_comes_before_chance() {
        let said = |comparison: Comparison, compared| sentence(&study(), &comparison, compared);
        assert_eq!(
            said(comparison(0.88, (0.80, 0.96), 30, Some(0.003)), Compared::Time),
            "dsvp is faster to 99 % than rbw by 12 % [4.0, 20], n = 30 maps; p = 0.003."
        );
        // The better one comes first: 1 / 1.25, 1 / 1.6 and 1 / 1.0.
        assert_eq!(
            said(comparison(1.25, (1.0, 1.6), 30, Some(0.0001)), Compared::Time),
            "rbw is faster to 99 % than dsvp by 20 % [0.0, 38], n = 30 maps; p < 0.001."
        );
        assert_eq!(
            said(comparison(0.97, (0.90, 1.05), 8, Some(0.4)), Compared::Time),
            "No difference in the time to 99 % is shown between dsvp and rbw: dsvp is faster to 99 % by 3.0 % [-5.0, \
             10], n = 8 maps; p = 0.400. 8 pairs would show a difference of 15 % in four of five cases."
        );
        assert_eq!(
            said(comparison(1.5, (1.2, 2.0), 7, Some(0.02)), Compared::AREA),
            "dsvp is ahead of rbw in the area under the curve by 50 % [20, 100], n = 7 maps; p = 0.020."
        );
    }

    #[test]
    fn failures_are_named() {
        let failing = Comparison { failed: [24, 0], ..comparison(1.25, (1.0, 1.6), 40, Some(0.003)) };
        assert_eq!(
            sentence(&study(), &failing, Compared::Time),
            "rbw is faster to 99 % than dsvp by 20 % [0.0, 38], n = 40 maps; p = 0.003. dsvp failed on 24 of 40 maps: \
             a failed run counts as not reached."
        );
        let both = Comparison { failed: [1, 2], maps: 5, ..comparison(1.5, (1.2, 2.0), 7, Some(0.02)) };
        let said = sentence(&study(), &both, Compared::AREA);
        let words = "dsvp failed on 1 of 7 pairs, rbw failed on 2 of 7 pairs: a failed run counts as nothing explored.";
        assert!(said.ends_with(words), "{said}");
    }

    #[test]
    fn few_observations_are_no_evidence() {
        let few = comparison(0.5, (0.4, 0.6), 3, None);
        assert_eq!(
            sentence(&study(), &few, Compared::Time),
            "dsvp was faster to 99 % than rbw by 50 % [40, 60], n = 3 maps: too few for a test, which needs 6."
        );
        let one = Comparison { all_pairs: 10, pairs: 1, maps: 1, ..few.clone() };
        let said = sentence(&study(), &one, Compared::Time);
        assert!(said.ends_with("n = 1 map (10 pairs of runs, 9 of them repetitions): no evidence about other maps."));
        let shared = Comparison { pairs: 8, all_pairs: 8, maps: 2, adjusted: Some(0.01), ..few };
        assert!(sentence(&study(), &shared, Compared::Time).contains("n = 8 pairs on 2 maps; p = 0.010"));
    }
}
