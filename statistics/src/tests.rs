use proptest::collection::vec;
use proptest::prelude::*;
use rand_chacha::rand_core::Rng;

use super::bootstrap::{normal_cdf, normal_quantile};
use super::*;

const LEVEL: f64 = 0.95;

fn reached(time: f64) -> Censored {
    Censored { time, happened: true }
}

fn censored_at(time: f64) -> Censored {
    Censored { time, happened: false }
}

fn too_few<T>(needed: usize, got: usize) -> Result<T, StatisticsError> {
    Err(StatisticsError::TooFew { needed, got })
}

/// Fails unless a sample with NaN or an infinity at index 1 is an error with that index.
#[track_caller]
fn assert_finite_only<T: std::fmt::Debug>(figure: impl Fn(&[f64]) -> Result<T, StatisticsError>) {
    for wrong in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let error = figure(&[1.0, wrong, 2.0]).expect_err("not finite");
        assert!(matches!(error, StatisticsError::NotFinite { place: 1, .. }), "{error}");
    }
}

#[test]
fn mean_by_hand() {
    assert_eq!(mean(&[1.0, 2.0, 6.0]), Ok(3.0));
    assert_eq!(mean(&[4.0]), Ok(4.0));
    assert_eq!(mean(&[]), too_few(1, 0));
    assert_finite_only(mean);
}

#[test]
fn quantiles_are_interpolated() {
    assert_eq!(quantile(&[1.0, 2.0, 3.0, 4.0], 0.5), Ok(2.5));
    assert_eq!(quantile(&[1.0, 2.0, 3.0, 4.0], 0.25), Ok(1.75));
    assert_eq!(quantile(&[7.0], 0.3), Ok(7.0));
    assert_eq!(quantile(&[-1e308, 1e308], 0.5), Ok(0.0));
    assert_eq!(quantile(&[], 0.5), too_few(1, 0));
    assert_eq!(quantile(&[1.0, 3.0, 2.0], 0.5), Err(StatisticsError::NotAscending { place: 2 }));
    for share in [-0.1, 1.1, f64::NAN] {
        assert!(matches!(quantile(&[1.0], share), Err(StatisticsError::OutOfRange { .. })));
    }
    assert_finite_only(|xs| quantile(xs, 0.5));
}

#[test]
fn areas_are_mean_heights() {
    // 0 to 1 over the first half, 1 from there on.
    assert_eq!(area_under(&[(0.0, 0.0), (50.0, 1.0)], 100.0), Ok(0.75));
    // Points after the horizon count only for the line to them.
    assert_eq!(area_under(&[(0.0, 0.0), (200.0, 1.0)], 100.0), Ok(0.25));
    // Constant before the first point.
    assert_eq!(area_under(&[(50.0, 0.5)], 100.0), Ok(0.5));
    assert_eq!(area_under(&[(150.0, 0.5), (160.0, 1.0)], 100.0), Ok(0.5));
    // A jump.
    assert_eq!(area_under(&[(0.0, 0.0), (50.0, 0.0), (50.0, 1.0)], 100.0), Ok(0.5));
}

#[test]
fn invalid_curves_are_refused() {
    assert_eq!(area_under(&[], 10.0), too_few(1, 0));
    assert_eq!(
        area_under(&[(0.0, 0.0), (2.0, 0.0), (1.0, 0.0)], 10.0),
        Err(StatisticsError::NotAscending { place: 2 })
    );
    assert!(matches!(area_under(&[(-1.0, 0.0)], 10.0), Err(StatisticsError::OutOfRange { .. })));
    for horizon in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(area_under(&[(0.0, 0.0)], horizon), Err(StatisticsError::OutOfRange { .. })), "{horizon}");
        assert!(
            matches!(restricted_mean(&[reached(1.0)], horizon), Err(StatisticsError::OutOfRange { .. })),
            "{horizon}"
        );
    }
    assert_finite_only(|heights| area_under(&heights.iter().map(|height| (1.0, *height)).collect::<Vec<_>>(), 10.0));
    assert_finite_only(|times| area_under(&times.iter().map(|time| (*time, 1.0)).collect::<Vec<_>>(), 10.0));
}

#[test]
fn normal_distribution_matches_tables() {
    for (z, below) in
        [(0.0, 0.5), (1.0, 0.841_344_746_068_542_9), (1.959_963_984_540_054, 0.975), (-3.0, 0.001_349_898_031_630_095)]
    {
        assert!((normal_cdf(z) / below - 1.0).abs() < 1e-14, "{z}");
        assert!((normal_quantile(below) - z).abs() < 1e-12, "{z}");
    }
}

#[test]
fn interval_is_a_function_of_the_seed() {
    let xs = [3.0, 1.0, 4.0, 1.0, 5.0, 9.0, 2.0, 6.0];
    let interval = |seed| bootstrap_mean(&xs, LEVEL, 1000, seed).unwrap();
    assert_eq!(interval(1), interval(1));
    assert_ne!(interval(1), interval(2));
    // A change here changes the intervals of every report.
    assert_eq!(interval(1), Interval { low: 2.375, high: 6.125 });
}

#[test]
fn intervals_need_two_values() {
    assert_eq!(bootstrap_mean(&[], LEVEL, 1000, 1), too_few(2, 0));
    assert_eq!(bootstrap_mean(&[1.0], LEVEL, 1000, 1), too_few(2, 1));
    // 0.1 is not exact: rounding of sums must not widen the interval.
    assert_eq!(bootstrap_mean(&[0.1; 7], LEVEL, 1000, 1), Ok(Interval { low: 0.1, high: 0.1 }));
    // Two values: half of the resamples have both, a quarter each has only one of them.
    assert_eq!(bootstrap_mean(&[1.0, 3.0], LEVEL, 1000, 1), Ok(Interval { low: 1.0, high: 3.0 }));
    assert_eq!(bootstrap_mean(&[f64::MAX, -f64::MAX], LEVEL, 1000, 1), Err(StatisticsError::TooLarge));
    assert_finite_only(|xs| bootstrap_mean(xs, LEVEL, 1000, 1));
}

#[test]
fn levels_and_resamples_have_bounds() {
    for level in [0.0, 1.0, -0.5, 95.0, f64::NAN] {
        assert!(
            matches!(bootstrap_mean(&[1.0, 2.0], level, 1000, 1), Err(StatisticsError::OutOfRange { .. })),
            "{level}"
        );
    }
    for resamples in [0, 99, 1_000_001, usize::MAX] {
        let refused = Err(StatisticsError::Resamples { got: resamples });
        assert_eq!(bootstrap_mean(&[1.0, 2.0], LEVEL, resamples, 1), refused);
    }
}

#[test]
fn censored_runs_leave_the_risk_set() {
    // By hand: 4/5 at 10, three at risk after the one censored at 15, 2/3 of that at 20, none after
    // 40.
    let runs = [reached(20.0), censored_at(15.0), reached(10.0), censored_at(30.0), reached(40.0)];
    let steps = kaplan_meier(&runs).unwrap();
    assert_eq!(steps.len(), 4);
    for (step, hand) in steps.iter().zip([(0.0, 1.0), (10.0, 0.8), (20.0, 0.8 * 2.0 / 3.0), (40.0, 0.0)]) {
        assert_eq!(step.0, hand.0);
        assert!((step.1 - hand.1).abs() < 1e-15, "{step:?}");
    }
    assert_eq!(median_time(&runs), Ok(Some(40.0)));
    let by_hand = 10.0 + 10.0 * 0.8 + 10.0 * 0.8 * 2.0 / 3.0;
    assert!((restricted_mean(&runs, 30.0).unwrap() - by_hand).abs() < 1e-12);
    assert_eq!(success_fraction(&runs), Ok(0.6));
}

#[test]
fn median_is_missing_if_most_runs_are_censored() {
    assert_eq!(median_time(&[censored_at(1800.0); 3]), Ok(None));
    assert_eq!(restricted_mean(&[censored_at(1800.0); 3], 1800.0), Ok(1800.0));
    assert_eq!(success_fraction(&[censored_at(1800.0); 3]), Ok(0.0));
    assert_eq!(median_time(&[reached(5.0), censored_at(1800.0), censored_at(1800.0)]), Ok(None));
    // Exactly half.
    assert_eq!(median_time(&[reached(5.0), censored_at(1800.0)]), Ok(Some(5.0)));
    // No run is observed until the horizon: the last share is extended.
    assert_eq!(restricted_mean(&[reached(10.0), censored_at(20.0)], 100.0), Ok(10.0 + 90.0 * 0.5));
}

#[test]
fn milestones_at_the_start_or_after_the_horizon() {
    assert_eq!(kaplan_meier(&[reached(0.0)]), Ok(vec![(0.0, 1.0), (0.0, 0.0)]));
    assert_eq!(median_time(&[reached(0.0)]), Ok(Some(0.0)));
    assert_eq!(restricted_mean(&[reached(0.0)], 100.0), Ok(0.0));
    assert_eq!(restricted_mean(&[reached(150.0)], 100.0), Ok(100.0));
}

#[test]
fn invalid_times_are_refused() {
    assert_eq!(kaplan_meier(&[]), too_few(1, 0));
    assert_eq!(median_time(&[]), too_few(1, 0));
    assert_eq!(restricted_mean(&[], 10.0), too_few(1, 0));
    assert_eq!(success_fraction(&[]), too_few(1, 0));
    assert!(matches!(kaplan_meier(&[reached(-1.0)]), Err(StatisticsError::OutOfRange { .. })));
    assert_finite_only(|times| success_fraction(&times.iter().map(|time| censored_at(*time)).collect::<Vec<_>>()));
}

#[test]
fn a12_by_hand() {
    // 3 wins and 1 tie in 6 comparisons.
    assert_eq!(a12(&[1.0, 2.0, 3.0], &[1.5, 2.0]), Ok(3.5 / 6.0));
    assert_eq!(a12(&[9.0], &[1.0]), Ok(1.0));
    assert_eq!(a12(&[-0.0], &[0.0]), Ok(0.5));
}

#[test]
fn holm_by_hand() {
    assert_eq!(holm(&[]), Ok(vec![]));
    assert_eq!(holm(&[0.3]), Ok(vec![0.3]));
    // 0.01 * 3; 0.03 * 2; 0.04, but not less than 0.06.
    assert_eq!(holm(&[0.01, 0.04, 0.03]), Ok(vec![0.03, 0.06, 0.06]));
    for wrong in [-0.1, 1.1, f64::NAN] {
        assert!(matches!(holm(&[0.5, wrong]), Err(StatisticsError::OutOfRange { .. })));
    }
}

#[test]
fn errors_are_one_line() {
    let message = |result: Result<Interval, StatisticsError>| result.unwrap_err().to_string();
    assert_eq!(message(bootstrap_mean(&[1.0], LEVEL, 1000, 1)), "2 values or more are needed, there are 1");
    assert_eq!(message(bootstrap_mean(&[1.0, f64::NAN], LEVEL, 1000, 1)), "value 1 is NaN, it must be finite");
    assert_eq!(message(bootstrap_mean(&[1.0, 2.0], LEVEL, 1, 1)), "1 resamples, there must be 100 to 1000000");
    let level = "the level of an interval is 95, it must be between 0 and 1";
    assert_eq!(message(bootstrap_mean(&[1.0, 2.0], 95.0, 1000, 1)), level);
}

/// Typical values, with ties.
fn value() -> impl Strategy<Value = f64> {
    prop_oneof![-1e3..1e3, (-4..5).prop_map(f64::from)]
}

fn censored() -> impl Strategy<Value = Censored> {
    (prop_oneof![0.0..2000.0, (0..8).prop_map(f64::from)], any::<bool>())
        .prop_map(|(time, happened)| Censored { time, happened })
}

proptest! {
    #[test]
    fn quantiles_are_within_range_and_ascend(mut xs in vec(value(), 1..40), p in 0.0..=1.0, q in 0.0..=1.0) {
        xs.sort_by(f64::total_cmp);
        let (less, more) = (quantile(&xs, f64::min(p, q)).unwrap(), quantile(&xs, f64::max(p, q)).unwrap());
        prop_assert!(xs[0] <= less && less <= more && more <= xs[xs.len() - 1]);
    }

    #[test]
    fn areas_are_within_the_heights(mut times in vec(0.0..200.0, 1..20), heights in vec(0.0..=1.0, 20)) {
        times.sort_by(f64::total_cmp);
        let points: Vec<_> = times.into_iter().zip(heights).collect();
        let area = area_under(&points, 100.0).unwrap();
        let lowest = points.iter().map(|point| point.1).fold(f64::INFINITY, f64::min);
        let highest = points.iter().map(|point| point.1).fold(0.0, f64::max);
        prop_assert!(lowest - 1e-12 <= area && area <= highest + 1e-12);
    }

    #[test]
    fn intervals_of_symmetric_samples_hold_the_mean(half in vec(0.1..100.0, 3..12), centre in -50.0..50.0, seed: u64) {
        let xs: Vec<f64> = half.iter().flat_map(|off| [centre - off, centre + off]).collect();
        let interval = bootstrap_mean(&xs, LEVEL, 500, seed).unwrap();
        prop_assert!(interval.low < centre && centre < interval.high, "{interval:?}");
    }

    #[test]
    fn intervals_are_within_the_values(xs in vec(value(), 2..20), seed: u64) {
        let interval = bootstrap_mean(&xs, LEVEL, 100, seed).unwrap();
        let lowest = xs.iter().copied().fold(f64::INFINITY, f64::min);
        let highest = xs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        prop_assert!(lowest - 1e-9 <= interval.low && interval.low <= interval.high && interval.high <= highest + 1e-9);
    }

    #[test]
    fn intervals_grow_with_their_level(xs in vec(value(), 2..20), seed: u64) {
        let interval = |level| bootstrap_mean(&xs, level, 200, seed).unwrap();
        let (narrow, wide) = (interval(0.5), interval(0.9));
        prop_assert!(wide.low <= narrow.low && narrow.high <= wide.high);
    }

    #[test]
    fn intervals_scale_with_the_values(xs in vec(-100.0..100.0, 3..12), seed: u64) {
        let doubled: Vec<f64> = xs.iter().map(|x| x * 2.0).collect();
        let (once, twice) =
            (bootstrap_mean(&xs, LEVEL, 200, seed).unwrap(), bootstrap_mean(&doubled, LEVEL, 200, seed).unwrap());
        prop_assert_eq!(twice, Interval { low: once.low * 2.0, high: once.high * 2.0 });
    }

    #[test]
    fn survival_never_grows(runs in vec(censored(), 1..30), horizon in 1.0..3000.0) {
        let steps = kaplan_meier(&runs).unwrap();
        prop_assert_eq!(steps[0], (0.0, 1.0));
        prop_assert!(steps.windows(2).all(|pair| pair[0].0 <= pair[1].0 && pair[1].1 < pair[0].1));
        prop_assert!(steps[steps.len() - 1].1 >= 0.0);
        let restricted = restricted_mean(&runs, horizon).unwrap();
        prop_assert!((0.0..=horizon).contains(&restricted));
        if let Some(median) = median_time(&runs).unwrap() {
            prop_assert!(runs.contains(&reached(median)));
        }
    }

    #[test]
    fn uncensored_times_have_plain_mean_and_median(times in vec(0.0..1000.0, 1..30)) {
        let runs: Vec<Censored> = times.iter().map(|time| reached(*time)).collect();
        let restricted = restricted_mean(&runs, 1000.0).unwrap();
        prop_assert!((restricted - mean(&times).unwrap()).abs() < 1e-9);
        let mut sorted = times.clone();
        sorted.sort_by(f64::total_cmp);
        prop_assert_eq!(median_time(&runs).unwrap(), Some(sorted[(times.len() - 1) / 2]));
    }

    #[test]
    fn a12_of_both_orders_sums_to_one(a in vec(value(), 1..20), b in vec(value(), 1..20)) {
        let sum = a12(&a, &b).unwrap() + a12(&b, &a).unwrap();
        prop_assert!((sum - 1.0).abs() < 1e-12);
    }

    #[test]
    fn holm_is_monotonic_and_lowers_nothing(p_values in vec(0.0..=1.0, 1..20)) {
        let adjusted = holm(&p_values).unwrap();
        for (&p, &after) in p_values.iter().zip(&adjusted) {
            prop_assert!(p <= after && after <= 1.0);
            for (&q, &other) in p_values.iter().zip(&adjusted) {
                prop_assert!(p > q || after <= other);
            }
        }
    }
}

#[test]
fn log_rank_by_hand() {
    // At 1: 1 of 2 of a, of 4 at risk; at 2: 1 of b, of 3 at risk, of which 1 is of a; a censored
    // run of each is left.
    let (a, b) = ([reached(1.0), censored_at(5.0)], [reached(2.0), censored_at(5.0)]);
    let result = log_rank(&a, &b).unwrap();
    assert!((result.observed_less_expected - (1.0 - 0.5 - 1.0 / 3.0)).abs() < 1e-12);
    assert!((result.variance - (0.25 + 2.0 / 9.0)).abs() < 1e-12);
    let other = log_rank(&b, &a).unwrap();
    assert!((other.observed_less_expected + result.observed_less_expected).abs() < 1e-12);
    // No run reaches it: the samples do not differ.
    let none = log_rank(&[censored_at(5.0)], &[censored_at(5.0)]).unwrap();
    assert_eq!((none.observed_less_expected, none.variance, none.chi_squared()), (0.0, 0.0, 0.0));
    assert_eq!(log_rank(&[], &b), too_few(1, 0));
}

#[test]
fn strata_of_two_are_who_is_first() {
    // `a` is first twice, once because `b` never reaches it; a tie and a pair of which none reaches
    // it say nothing.
    let a = [reached(1.0), reached(2.0), reached(7.0), reached(3.0), censored_at(9.0)];
    let b = [reached(4.0), censored_at(9.0), reached(5.0), reached(3.0), censored_at(9.0)];
    let result = stratified_log_rank(&a, &b).unwrap();
    assert_eq!((result.first_a, result.first_b, result.p_value), (2, 1, 1.0));
    assert!((result.chi_squared() - 1.0 / 3.0).abs() < 1e-12);
    assert_eq!(stratified_log_rank(&a, &b[1..]), Err(StatisticsError::Unpaired { left: 5, right: 4 }));
    assert_eq!(stratified_log_rank(&[], &[]), too_few(1, 0));
    let never = stratified_log_rank(&[censored_at(9.0); 4], &[censored_at(9.0); 4]).unwrap();
    assert_eq!((never.first_a, never.first_b, never.p_value, never.chi_squared()), (0, 0, 1.0, 0.0));
    // Twice one in 2^2000, which is no number any more, and not an error.
    let all = stratified_log_rank(&[reached(1.0); 2000], &[reached(2.0); 2000]).unwrap();
    assert_eq!(all.p_value, 0.0);
}

fn difference(a: &[f64], b: &[f64]) -> Exchange {
    exchange_test(a, b, Effect::Difference, LEVEL, 0.05, 1).unwrap()
}

fn ratio(a: &[f64], b: &[f64]) -> Exchange {
    exchange_test(a, b, Effect::Ratio, LEVEL, 0.05, 1).unwrap()
}

#[test]
fn exchanges_by_hand() {
    // Of the eight orders of three pairs the sums are 6, 4, 2, 0 and their opposites: two are as
    // far.
    let three = difference(&[1.0, 2.0, 3.0], &[0.0; 3]);
    assert_eq!((three.effect, three.p_value, three.least_p_value, three.interval), (Some(2.0), 0.25, 0.25, None));
    // Six in one direction: 2 / 64. The second lowest of the lower effects in a part and the rest:
    // that of 1 alone is the lowest, then that of 2 alone.
    let six = difference(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0], &[0.0; 6]);
    assert_eq!(six.p_value, 2.0 / 64.0);
    assert_eq!(six.interval, Some(Interval { low: 1.0, high: 6.0 }));
    // Equal in all pairs, and on average.
    assert_eq!(difference(&[1.0, 2.0], &[1.0, 2.0]).p_value, 1.0);
    assert_eq!(difference(&[1.0, 2.0], &[2.0, 1.0]).p_value, 1.0);
    assert_eq!(
        exchange_test(&[1.0], &[1.0, 2.0], Effect::Ratio, LEVEL, 0.05, 1),
        Err(StatisticsError::Unpaired { left: 1, right: 2 })
    );
    assert_eq!(exchange_test(&[], &[], Effect::Ratio, LEVEL, 0.05, 1), too_few(1, 0));
    assert_finite_only(|xs| exchange_test(xs, &[1.0; 3], Effect::Difference, LEVEL, 0.05, 1));
    let negative = exchange_test(&[1.0], &[-1.0], Effect::Ratio, LEVEL, 0.05, 1);
    assert!(matches!(negative, Err(StatisticsError::OutOfRange { .. })));
}

#[test]
fn ratio_of_constant_factor_has_no_width() {
    let b = [100.0, 250.0, 400.0, 800.0, 120.0, 640.0, 90.0];
    let half = ratio(&b.map(|value| value / 2.0), &b);
    assert_eq!((half.effect, half.interval), (Some(0.5), Some(Interval { low: 0.5, high: 0.5 })));
    // A mean of 0 below, or in a part of the pairs.
    assert_eq!((ratio(&[1.0; 7], &[0.0; 7]).effect, ratio(&[0.0; 7], &[0.0; 7]).effect), (None, None));
    let sparse = ratio(&[1.0; 7], &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
    assert_eq!((sparse.effect, sparse.interval, sparse.p_value), (Some(7.0), None, 2.0 / 64.0));
}

#[test]
fn ties_count_on_the_grid_of_ticks() {
    // Differences of 0.02 s that differ in their last digits: as ticks they are ties.
    let ticks: [(f64, f64); 8] = [
        (501.0, 500.0),
        (12.0, 11.0),
        (1007.0, 1006.0),
        (43.0, 44.0),
        (71.0, 70.0),
        (333.0, 332.0),
        (9.0, 8.0),
        (650.0, 649.0),
    ];
    let (a, b): (Vec<f64>, Vec<f64>) = ticks.into_iter().unzip();
    // Nine of 256 orders have at most one pair in the other direction, and as many the opposite.
    assert_eq!(difference(&a, &b).p_value, 18.0 / 256.0);
}

#[test]
fn more_pairs_are_exact_and_then_drawn() {
    let shifted = |pairs: usize| (0..pairs).map(|i| 1.0 + (i % 7) as f64).collect::<Vec<_>>();
    // 2^33 orders.
    assert_eq!(difference(&shifted(33), &[0.0; 33]).p_value, libm::exp2(-32.0));
    // Drawn: the given order counts, so no p-value is 0; more where a correction needs more.
    let drawn = |needed| exchange_test(&shifted(41), &[0.0; 41], Effect::Difference, LEVEL, needed, 1).unwrap();
    assert_eq!((drawn(0.05).p_value, drawn(0.05).least_p_value), (1e-4, 1e-4));
    // 33 variants are 528 comparisons.
    let many = drawn(0.05 / 528.0);
    assert!(many.p_value * 528.0 < 0.05 && many.p_value == many.least_p_value, "{many:?}");
    let interval = many.interval.unwrap();
    assert!(interval.low > 3.0 && interval.high < 5.0 && interval.low < interval.high, "{interval:?}");
}

#[test]
fn pairs_that_a_correction_needs() {
    // 1, 3, 10 and 28 comparisons, of 2, 3, 5 and 8 variants.
    assert_eq!([1, 3, 10, 28].map(|comparisons| pairs_needed(comparisons, 0.05)), [6, 7, 9, 11]);
    assert_eq!(pairs_needed(0, 0.05), 6);
    assert_eq!([1, 6, 40].map(|pairs| least_p_value(pairs, 0.05)), [1.0, 2.0 / 64.0, libm::exp2(-39.0)]);
}

/// Share of experiments, each of so many pairs drawn by `draw` and shifted, with a p-value below
/// `needed`.
fn power(pairs: usize, needed: f64, shift: f64, mut draw: impl FnMut() -> f64) -> f64 {
    let trials = 2000;
    let shown = (0..trials).filter(|_| {
        let a: Vec<f64> = (0..pairs).map(|_| draw() + shift).collect();
        difference(&a, &vec![0.0; pairs]).p_value < needed
    });
    shown.count() as f64 / f64::from(trials)
}

#[test]
fn detectable_difference_is_shown_as_often_as_stated() {
    let mut rng = voxels::random_streams::stream(3, 0, "power");
    let mut uniform = move || (f64::from(rng.next_u32()) + 0.5) / (f64::from(u32::MAX) + 1.0);
    // Both kinds of test, with and without a correction; eight pairs and three comparisons are the
    // case in which a normal approximation claims 80 % for 53 %.
    for (pairs, comparisons) in [(8, 3), (12, 1), (20, 10), (24, 1)] {
        let needed = 0.05 / f64::from(comparisons);
        // Quantiles of a normal distribution scatter as that distribution does.
        let unit: Vec<f64> = (0..pairs).map(|i| normal_quantile((i as f64 + 0.5) / pairs as f64)).collect();
        let deviation = (unit.iter().map(|x| x * x).sum::<f64>() / (pairs as f64 - 1.0)).sqrt();
        let shift = detectable_difference(&unit, pairs, needed, 0.8, 1).unwrap().unwrap() / deviation;
        let share = power(pairs, needed, shift, || normal_quantile(uniform()));
        assert!((0.77..0.83).contains(&share), "{pairs} pairs, {comparisons} comparisons: {share}");
    }
    // So few pairs can show nothing, whatever the difference.
    assert_eq!(detectable_difference(&[1.0, 2.0, 3.0, 4.0, 5.0, 7.0], 6, 0.05 / 3.0, 0.8, 1), Ok(None));
    assert_eq!(detectable_difference(&[1.0], 8, 0.05, 0.8, 1), too_few(2, 1));
    assert!(matches!(detectable_difference(&[1.0, 2.0], 8, 0.0, 0.8, 1), Err(StatisticsError::OutOfRange { .. })));
}

#[test]
fn intervals_hold_the_effect_as_often_as_stated() {
    let mut rng = voxels::random_streams::stream(4, 0, "coverage");
    let mut normal = || normal_quantile((f64::from(rng.next_u32()) + 0.5) / (f64::from(u32::MAX) + 1.0));
    let trials = 1500;
    let held = (0..trials).filter(|_| {
        let b: Vec<f64> = (0..8).map(|_| 100.0 + 20.0 * normal()).collect();
        let a: Vec<f64> = b.iter().map(|b| 0.7 * b + 8.0 * normal()).collect();
        let interval = ratio(&a, &b).interval.unwrap();
        interval.low <= 0.7 && 0.7 <= interval.high
    });
    let share = held.count() as f64 / f64::from(trials);
    assert!((0.94..0.97).contains(&share), "{share}");
}

proptest! {
    /// Effect, interval and p-value never point to different sides, whichever of the two is first.
    #[test]
    fn interval_and_p_value_agree(pairs in vec((0.0..50.0, 0.0..50.0), 1..60), shift in 0.0..20.0) {
        let (a, b): (Vec<f64>, Vec<f64>) = pairs.into_iter().map(|(a, b)| (a, b + shift)).unzip();
        for (effect, none) in [(Effect::Difference, 0.0), (Effect::Ratio, 1.0)] {
            let result = exchange_test(&a, &b, effect, LEVEL, 0.05, 1).unwrap();
            prop_assert!(result.p_value >= result.least_p_value && result.p_value <= 1.0);
            let opposite = exchange_test(&b, &a, effect, LEVEL, 0.05, 1).unwrap();
            prop_assert!((opposite.p_value - result.p_value).abs() < 0.02);
            if let (Some(estimate), Some(interval)) = (result.effect, result.interval) {
                prop_assert!(interval.low <= estimate && estimate <= interval.high, "{result:?}");
                let excludes = interval.low > none || interval.high < none;
                prop_assert!(!excludes || result.p_value <= 0.05 + 1e-12, "{result:?}");
                let spans = interval.low < none && none < interval.high;
                prop_assert!(!spans || result.p_value > 0.05 - 1e-12, "{result:?}");
            }
        }
    }
}
