//! No comparison finds a difference between equals more often than it says.

use std::collections::BTreeMap;

use rand_chacha::rand_core::Rng;

use super::super::fixture;
use super::*;
use experiments::rows::{FailedRun, RunMetadata, RunRecord, StoredRun};

/// A study of variants by name, each with its times to 99 % by block: `None` is censored. Runs of
/// equal `map` are on the same map.
fn study(variants: &[(&str, Vec<Option<f64>>)], map: impl Fn(usize) -> String) -> Study {
    let mut runs = Vec::new();
    for (name, times) in variants {
        for (block, time) in times.iter().enumerate() {
            let mut run = fixture::run(name, block as u64, 2);
            run.row.axes = BTreeMap::from([("agents.controller".to_owned(), (*name).to_owned())]);
            (run.row.t99_s, run.row.free_cells) = (*time, 1000);
            run.row.area_under_explored = 1.0 - time.unwrap_or(run.row.duration_s) / run.row.duration_s / 2.0;
            runs.push(StoredRun::new(run, RunMetadata { date: None, map: Some(map(block)) }));
        }
    }
    Study::new(runs, None)
}

fn own_map(block: usize) -> String {
    block.to_string()
}

/// Whether some comparison of a metric is called a difference.
fn finds_difference(study: &Study, compared: Compared) -> bool {
    let family = comparisons(study, &study.conditions[0], compared).unwrap();
    family.iter().any(|comparison| comparison.adjusted.is_some_and(|p| p < ALPHA))
}

/// Times of three variants that depend on the map; about one in six is censored at 60 s.
fn times(blocks: usize, stream: &str) -> Vec<[Option<f64>; 3]> {
    let mut rng = voxels::random_streams::stream(20_261_122, 0, stream);
    let mut uniform = || f64::from(rng.next_u32()) / f64::from(u32::MAX);
    let time = |of_map: f64, own: f64| Some(of_map + 36.0 * own).filter(|time| *time < 60.0);
    (0..blocks)
        .map(|_| {
            let of_map = 48.0 * uniform();
            [0, 1, 2].map(|_| time(of_map, uniform()))
        })
        .collect()
}

#[test]
fn every_exchange_of_labels_gives_false_alarms_at_most_as_often_as_stated() {
    let times = times(8, "censored");
    for (is_censored, expected_test) in [(true, Test::LogRank), (false, Test::Wilcoxon)] {
        let mut alarms = 0;
        for exchange in 0..1_usize << times.len() {
            let pair = |block: usize| {
                let [one, other, _] = times[block].map(|time| if is_censored { time } else { time.or(Some(59.5)) });
                if exchange >> block & 1 == 1 { (one, other) } else { (other, one) }
            };
            let (a, b) = (0..times.len()).map(pair).unzip();
            let study = study(&[("a", a), ("b", b)], own_map);
            let family = comparisons(&study, &study.conditions[0], Compared::Time).unwrap();
            assert_eq!(family[0].test.unwrap().0, expected_test);
            alarms += usize::from(family[0].adjusted.unwrap() < ALPHA);
        }
        let rate = alarms as f64 / f64::from(1 << times.len());
        assert!(rate > 0.0 && rate <= ALPHA, "{expected_test:?}: {rate}");
    }
}

#[test]
fn shuffled_labels_give_false_alarms_at_most_as_often_as_stated() {
    // A family of three comparisons on twelve maps; the labels of each map are shuffled.
    let times = times(12, "family");
    let mut rng = voxels::random_streams::stream(7, 0, "labels");
    let (mut alarms, trials) = ([0, 0], 400);
    for _ in 0..trials {
        let mut columns = [Vec::new(), Vec::new(), Vec::new()];
        for of_map in &times {
            let mut of_map = *of_map;
            let (first, second) = (rng.next_u32() % 3, rng.next_u32() % 2);
            of_map.swap(0, first as usize);
            of_map.swap(1, 1 + second as usize);
            columns.iter_mut().zip(of_map).for_each(|(column, time)| column.push(time));
        }
        let [a, b, c] = columns;
        let study = study(&[("a", a), ("b", b), ("c", c)], own_map);
        alarms[0] += usize::from(finds_difference(&study, Compared::Time));
        alarms[1] += usize::from(finds_difference(&study, Compared::AREA));
    }
    for alarms in alarms {
        assert!(alarms as f64 <= ALPHA * f64::from(trials), "{alarms} of {trials}");
    }
}

#[test]
fn repetitions_of_one_map_are_one_pair() {
    // Ten seeds of one map and controllers that draw nothing: the plan that used to give p = 0.002.
    let study = study(&[("a", vec![Some(30.0); 10]), ("b", vec![Some(31.0); 10])], |_| "the map".to_owned());
    let family = comparisons(&study, &study.conditions[0], Compared::Time).unwrap();
    let [one] = family.as_slice() else { panic!("{family:?}") };
    assert_eq!((one.pairs, one.all_pairs, one.maps, one.test, one.adjusted), (1, 10, 1, None, None));
    assert!(one.ratio.unwrap().interval.is_none());
    // The same on ten maps is evidence.
    let times = |shift: f64| (0..10).map(|i| Some(20.0 + f64::from(i * i) / 10.0 + shift)).collect::<Vec<_>>();
    let study = self::study(&[("a", times(0.0)), ("b", times(1.0))], own_map);
    let family = comparisons(&study, &study.conditions[0], Compared::Time).unwrap();
    assert_eq!((family[0].pairs, family[0].maps), (10, 10));
    assert!(family[0].adjusted.unwrap() < 0.01);
}

/// The run in this place of a failed one.
fn failed(RunRecord { row, .. }: RunRecord, made: RunMetadata) -> StoredRun {
    let (id, build, controller, seed, size) = (row.id, row.build, row.controller, row.seed, Some(row.size));
    let reason = "exit code 4".to_owned();
    let (agents, axes, duration_s) = (row.agents, row.axes, row.duration_s);
    FailedRun { id, build, controller, seed, size, agents, axes, duration_s, reason, made }.into_stored()
}

/// A variant that is fast on 16 maps and fails on 24, and one that reaches 99 % on all 40. The
/// means are those of lifelines 0.30 (`restricted_mean_survival_time` up to 60 s); 2000 exchanges
/// within pairs in Python give p = 0.0005.
#[test]
fn variant_that_fails_does_not_win() {
    let mut runs = Vec::new();
    for block in 0..40 {
        let time = f64::from(block) / 4.0;
        for (name, t99_s) in [("crashes", (block < 16).then_some(20.0 + time)), ("steady", Some(30.0 + time))] {
            let mut run = fixture::run(name, block as u64, 2);
            run.row.axes = BTreeMap::from([("agents.controller".to_owned(), name.to_owned())]);
            (run.row.t99_s, run.row.area_under_explored) = (t99_s, 0.7);
            let made = RunMetadata { date: None, map: Some(block.to_string()) };
            runs.push(if t99_s.is_some() { StoredRun::new(run, made) } else { failed(run, made) });
        }
    }
    let study = Study::new(runs, None);
    let of = |compared| comparisons(&study, &study.conditions[0], compared).unwrap().remove(0);
    let time = of(Compared::Time);
    assert_eq!((time.pairs, time.maps, time.failed), (40, 40, [24, 0]));
    assert!((time.mean_a - 44.75).abs() < 1e-9 && (time.mean_b - 34.875).abs() < 1e-9, "{time:?}");
    assert!(!time.is_a_better(Compared::Time));
    assert!(matches!(time.test, Some((Test::LogRank, p)) if p < 0.002), "{time:?}");
    let area = of(Compared::AREA);
    assert!((area.mean_a - 70.0 * 16.0 / 40.0).abs() < 1e-9 && !area.is_a_better(Compared::AREA), "{area:?}");
    // How far it would have moved is not known: those pairs are left out, and counted.
    let distance = of(Compared::Metric(DISTANCE, false));
    assert_eq!((distance.pairs, distance.maps, distance.all_pairs, distance.failed), (16, 16, 16, [24, 0]));
    let table = tables(&study).unwrap().remove(3);
    assert!(table.columns.iter().any(|(_, key)| key == "failed_a"));
    let said = super::super::verdicts::verdicts(&study).unwrap().remove(0).sentences.remove(0);
    assert!(said.contains("steady is faster to 99 %") && said.contains("crashes failed on 24 of 40 maps"), "{said}");
}

#[test]
fn failures_on_one_map_do_not_repeat_each_other() {
    let runs = (0..8).flat_map(|seed| {
        let made = || RunMetadata { date: None, map: Some("the map".to_owned()) };
        let mut runs = ["a", "b"].map(|name| fixture::run(name, seed, 2));
        runs.iter_mut().for_each(|run| run.row.free_cells = 1000);
        let [a, b] = runs;
        [failed(a, made()), StoredRun::new(b, made())]
    });
    let study = Study::new(runs.collect(), None);
    assert_eq!([0, 1].map(|variant| study.cell(&study.conditions[0], variant).len()), [8, 1]);
    let family = comparisons(&study, &study.conditions[0], Compared::AREA).unwrap();
    assert_eq!((family[0].pairs, family[0].maps, family[0].failed), (8, 1, [8, 0]));
}

#[test]
fn five_pairs_have_no_p_value() {
    for (pairs, has) in [(5, false), (6, true)] {
        let times = |shift: f64| (0..pairs).map(|i| Some(20.0 + f64::from(i) + shift)).collect::<Vec<_>>();
        let study = study(&[("a", times(0.0)), ("b", times(3.0))], own_map);
        let family = comparisons(&study, &study.conditions[0], Compared::Time).unwrap();
        assert_eq!((family[0].test.is_some(), family[0].adjusted.is_some()), (has, has), "{pairs}");
    }
}

#[test]
fn comparison_without_common_blocks_has_no_rows() {
    let stored = |controller, seed| StoredRun::new(fixture::run(controller, seed, 2), RunMetadata::default());
    let study = Study::new(vec![stored("dsvp", 1), stored("lvd", 2)], None);
    assert!(tables(&study).unwrap().iter().all(|table| table.rows.is_empty()));
}

/// It has the base of the effect beside it, whichever of the two is first in the plan.
#[test]
fn detectable_difference_is_in_per_cent_of_the_worse_variant() {
    let fast: Vec<_> = (0..8).map(|block| Some(10.0 + f64::from(block % 3))).collect();
    let slow: Vec<_> = (0..8).map(|block| Some(20.0 + f64::from(block))).collect();
    let of = |a: &[Option<f64>], b: &[Option<f64>], compared| {
        let study = study(&[("a", a.to_vec()), ("b", b.to_vec())], own_map);
        comparisons(&study, &study.conditions[0], compared).unwrap()[0].clone()
    };
    for compared in [Compared::Time, Compared::AREA] {
        let (first, second) = (of(&fast, &slow, compared), of(&slow, &fast, compared));
        assert!(first.is_a_better(compared) && !second.is_a_better(compared));
        assert!(first.detectable.is_some_and(|share| share > 0.0));
        assert_eq!(first.detectable, second.detectable);
    }
}
