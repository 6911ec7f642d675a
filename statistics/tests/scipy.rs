//! The statistics agree with SciPy: `scipy/reference.py` writes SciPy's results to
//! `scipy/reference.json`.

use serde_json::Value;
use statistics::{
    Censored, Effect, a12, area_under, bootstrap_mean, exchange_test, holm, kaplan_meier, log_rank, median_time,
    quantile, restricted_mean, stratified_log_rank, success_fraction,
};

/// Maximum distance of the end of an interval from the mean of SciPy's, in standard deviations of
/// these. Both have the same Monte-Carlo error, and there are some two dozen ends.
const SPREADS_MAX: f64 = 5.0;

fn reference() -> Value {
    serde_json::from_str(include_str!("scipy/reference.json")).expect("the reference is JSON")
}

/// The cases with this name; fails if there are none.
fn cases(of: &str) -> Vec<Value> {
    let cases = reference()[of].as_array().expect("cases are a list").clone();
    assert!(!cases.is_empty(), "{of}");
    cases
}

#[track_caller]
fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is a number"))
}

#[track_caller]
fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().expect("numbers are a list").iter().map(number).collect()
}

#[track_caller]
fn points(value: &Value) -> Vec<(f64, f64)> {
    value.as_array().expect("points are a list").iter().map(|point| (number(&point[0]), number(&point[1]))).collect()
}

/// Fails unless two numbers differ by rounding at most.
#[track_caller]
fn assert_same(ours: f64, scipy: f64, case: &Value) {
    let scale = scipy.abs().max(1e-3);
    assert!((ours - scipy).abs() <= 1e-11 * scale, "{ours} is not SciPy's {scipy}: {case}");
}

#[test]
fn quantiles() {
    for case in cases("quantiles") {
        let ours = quantile(&numbers(&case["values"]), number(&case["share"])).unwrap();
        assert_same(ours, number(&case["quantile"]), &case);
    }
}

#[test]
fn areas() {
    for case in cases("areas") {
        let ours = area_under(&points(&case["points"]), number(&case["horizon"])).unwrap();
        assert_same(ours, number(&case["area"]), &case);
    }
}

#[test]
fn exchanges() {
    for case in cases("exchanges") {
        let effect = if case["effect"] == "ratio" { Effect::Ratio } else { Effect::Difference };
        let (a, b) = (numbers(&case["a"]), numbers(&case["b"]));
        let ours = exchange_test(&a, &b, effect, number(&reference()["level"]), 0.05, 1).unwrap();
        assert_same(ours.p_value, number(&case["p_value"]), &case);
        assert_same(ours.effect.expect("a defined ratio"), number(&case["estimate"]), &case);
        if let Some(ends) = case["ends"].as_array() {
            let interval = ours.interval.expect("six pairs or more");
            for (ours, theirs) in [interval.low, interval.high].into_iter().zip(ends) {
                // They are found by bisection.
                assert!((ours - number(theirs)).abs() < 1e-6, "{ours} is not {theirs}: {case}");
            }
        }
    }
}

#[test]
fn effect_sizes() {
    for case in cases("effect_sizes") {
        assert_same(a12(&numbers(&case["a"]), &numbers(&case["b"])).unwrap(), number(&case["a12"]), &case);
    }
}

#[test]
fn corrections() {
    for case in cases("corrections") {
        let ours = holm(&numbers(&case["p_values"])).unwrap();
        let theirs = numbers(&case["adjusted"]);
        assert_eq!(ours.len(), theirs.len(), "{case}");
        ours.iter().zip(theirs).for_each(|(ours, theirs)| assert_same(*ours, theirs, &case));
    }
}

#[test]
fn survivals() {
    for case in cases("survivals") {
        let happened = case["happened"].as_array().unwrap().iter().map(|value| value.as_bool().unwrap());
        let runs: Vec<Censored> = numbers(&case["times"])
            .into_iter()
            .zip(happened)
            .map(|(time, happened)| Censored { time, happened })
            .collect();
        let (ours, theirs) = (kaplan_meier(&runs).unwrap(), points(&case["steps"]));
        assert_eq!(ours.len(), theirs.len(), "{case}");
        for (ours, theirs) in ours.into_iter().zip(theirs) {
            assert_same(ours.0, theirs.0, &case);
            assert_same(ours.1, theirs.1, &case);
        }
        assert_eq!(median_time(&runs).unwrap(), case["median"].as_f64(), "{case}");
        assert_same(restricted_mean(&runs, number(&case["horizon"])).unwrap(), number(&case["restricted_mean"]), &case);
        assert_same(success_fraction(&runs).unwrap(), number(&case["success_fraction"]), &case);
    }
}

#[test]
fn intervals() {
    let reference = reference();
    let level = number(&reference["level"]);
    let resamples = reference["resamples"].as_u64().unwrap() as usize;
    for (case, seed) in cases("intervals").iter().zip(7..) {
        let ours = bootstrap_mean(&numbers(&case["a"]), level, resamples, seed).unwrap();
        for (ours, end, spread) in [(ours.low, "low", "low_spread"), (ours.high, "high", "high_spread")] {
            let (theirs, spread) = (number(&case[end]), number(&case[spread]));
            // With whole numbers all of SciPy's intervals may be equal.
            let off = (ours - theirs) / spread.max(1e-9);
            assert!(off.abs() <= SPREADS_MAX, "{end} is {ours}, {off:.1} spreads from SciPy's {theirs}: {case}");
        }
    }
}

/// The times of a case under this key.
fn times(case: &Value, key: &str) -> Vec<Censored> {
    let happened = case[format!("{key}_happened")].as_array().expect("a list").iter();
    let happened = happened.map(|did| did.as_bool().expect("true or false"));
    let times = numbers(&case[key]).into_iter();
    times.zip(happened).map(|(time, happened)| Censored { time, happened }).collect()
}

#[test]
fn log_ranks() {
    for case in cases("log_ranks") {
        let ours = log_rank(&times(&case, "a"), &times(&case, "b")).unwrap();
        // SciPy's sign is that of the second sample.
        assert_same(ours.chi_squared(), number(&case["z"]).powi(2), &case);
    }
}

#[test]
fn strata() {
    for case in cases("strata") {
        let ours = stratified_log_rank(&times(&case, "a"), &times(&case, "b")).unwrap();
        assert_same(ours.chi_squared(), number(&case["chi_squared"]), &case);
        assert_same(ours.p_value, number(&case["p_value"]), &case);
    }
}
