//! No comparison finds a difference between equals more often than it says.

use std::collections::BTreeMap;

use rand_chacha::rand_core::Rng;

use super::super::fixture;
use super::super::verdicts::{Verdict, verdicts};
use super::*;
use experiments::rows::{FailedRun, RunMetadata, StoredRun, ticks};

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

/// A stream of numbers, uniform from 0 to 1.
fn uniform(stream: &str) -> impl FnMut() -> f64 {
    let mut rng = voxels::random_streams::stream(20_261_122, 0, stream);
    move || f64::from(rng.next_u32()) / f64::from(u32::MAX)
}

/// What one controller does on so many maps, three times each: times in seconds, of which some are
/// not reached within 60 s, some are ties on a grid of 2 s, some are early or late together so that
/// the curves of halves of them cross, and some are crashes, which count as not reached.
fn times(blocks: usize, stream: &str) -> Vec<[Option<f64>; 3]> {
    let mut uniform = uniform(stream);
    (0..blocks)
        .map(|_| {
            let (of_map, kind) = (40.0 * uniform(), uniform());
            [(); 3].map(|()| {
                let own = uniform();
                let time = match kind {
                    _ if uniform() < 0.1 => return None,
                    kind if kind < 0.3 => of_map + 4.0 * (5.0 * own).floor(),
                    kind if kind < 0.6 => {
                        if own < 0.5 {
                            0.3 * of_map
                        } else {
                            of_map + 20.0
                        }
                    }
                    _ => of_map + 36.0 * own,
                };
                Some(time).filter(|time| *time < 60.0)
            })
        })
        .collect()
}

#[test]
fn every_exchange_of_labels_gives_false_alarms_at_most_as_often_as_stated() {
    let times = times(8, "censored");
    let mut alarms = [0, 0];
    for exchange in 0..1_usize << times.len() {
        let pair = |block: usize| {
            let [one, other, _] = times[block];
            if exchange >> block & 1 == 1 { (one, other) } else { (other, one) }
        };
        let (a, b) = (0..times.len()).map(pair).unzip();
        let study = study(&[("a", a), ("b", b)], own_map);
        for (alarms, compared) in alarms.iter_mut().zip([Compared::TIME_99, Compared::Unseen]) {
            *alarms += usize::from(finds_difference(&study, compared));
        }
    }
    for alarms in alarms {
        let rate = alarms as f64 / f64::from(1 << times.len());
        assert!(rate > 0.0 && rate <= ALPHA, "{rate}");
    }
}

/// Splits one controller at random into three so many times, and counts the families in which a
/// difference is found, for each measure.
fn false_alarms(maps: &[[Option<f64>; 3]], splits: usize) -> Vec<(Compared, usize)> {
    let mut rng = voxels::random_streams::stream(7, 0, "labels");
    let mut alarms = [Compared::TIME_99, Compared::Unseen].map(|compared| (compared, 0)).to_vec();
    for _ in 0..splits {
        let mut columns = [Vec::new(), Vec::new(), Vec::new()];
        for of_map in maps {
            let mut of_map = *of_map;
            let (first, second) = (rng.next_u32() % 3, rng.next_u32() % 2);
            of_map.swap(0, first as usize);
            of_map.swap(1, 1 + second as usize);
            columns.iter_mut().zip(of_map).for_each(|(column, time)| column.push(time));
        }
        let [a, b, c] = columns;
        let study = study(&[("a", a), ("b", b), ("c", c)], own_map);
        for (compared, alarms) in &mut alarms {
            *alarms += usize::from(finds_difference(&study, *compared));
        }
    }
    alarms
}

/// The share of experiments that find what so many pairs are said to detect: the maps of each are
/// drawn from all, and the claimed effect is put in.
fn power(maps: &[[Option<f64>; 3]], pairs: usize, experiments: u32) -> f64 {
    let restricted = |time: Option<f64>| time.unwrap_or(60.0);
    let all: Vec<f64> = maps.iter().map(|[a, b, _]| restricted(*a) - restricted(*b)).collect();
    let mut uniform = uniform("power");
    let mut draw = || all[((uniform() * all.len() as f64) as usize).min(all.len() - 1)];
    let needed = ALPHA / 3.0;
    let shift = detectable_difference(&all, pairs, needed, POWER, SEED).unwrap().unwrap();
    let shown = (0..experiments).filter(|_| {
        let (a, b): (Vec<f64>, Vec<f64>) = (0..pairs).map(|_| (draw() + shift, 0.0)).unzip();
        exchange_test(&a, &b, Effect::Difference, LEVEL, needed, SEED).unwrap().p_value < needed
    });
    shown.count() as f64 / f64::from(experiments)
}

#[test]
fn splits_of_one_controller_give_false_alarms_at_most_as_often_as_stated() {
    for (compared, alarms) in false_alarms(&times(12, "family"), 200) {
        assert!(alarms <= 10, "{compared:?}: {alarms} of 200");
    }
}

#[test]
fn power_is_as_claimed() {
    let share = power(&times(400, "power"), 20, 1000);
    assert!((share - POWER).abs() <= 0.03, "{share}");
}

/// The long run: more maps and splits, in every mixture of outcomes.
#[test]
#[ignore = "takes minutes: launch_scripts/long_tests.sh verdicts_hold"]
fn verdicts_hold_in_many_splits_of_one_controller() {
    for (maps, stream) in [(7, "few"), (12, "family"), (20, "some"), (30, "many"), (45, "drawn")] {
        for (compared, alarms) in false_alarms(&times(maps, stream), 2000) {
            eprintln!("{maps} maps, {compared:?}: {alarms} false alarms of 2000");
            // 5 % and two standard errors.
            assert!(alarms <= 120, "{maps} maps, {compared:?}: {alarms} of 2000");
        }
    }
    for pairs in [8, 12, 20, 30, 45] {
        let share = power(&times(2000, "power"), pairs, 4000);
        eprintln!("{pairs} maps: {share} of what is claimed to be detectable with {POWER} is found");
        assert!((share - POWER).abs() <= 0.03, "{pairs} maps: {share}");
    }
}

#[test]
fn repetitions_of_one_map_are_one_pair() {
    // Ten seeds of one map and controllers that draw nothing: the plan that used to give p = 0.002.
    let study = study(&[("a", vec![Some(30.0); 10]), ("b", vec![Some(31.0); 10])], |_| "the map".to_owned());
    let family = comparisons(&study, &study.conditions[0], Compared::TIME_99).unwrap();
    let [one] = family.as_slice() else { panic!("{family:?}") };
    assert_eq!((one.pairs, one.all_pairs, one.maps, one.p_value, one.adjusted), (1, 10, 1, None, None));
    assert!(one.effect.unwrap().interval.is_none());
    // The same on ten maps is evidence.
    let times = |shift: f64| (0..10).map(|i| Some(20.0 + f64::from(i * i) / 10.0 + shift)).collect::<Vec<_>>();
    let study = self::study(&[("a", times(0.0)), ("b", times(1.0))], own_map);
    let family = comparisons(&study, &study.conditions[0], Compared::TIME_99).unwrap();
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
/// means are those of lifelines 0.30 (`restricted_mean_survival_time` up to 60 s); two million
/// exchanges within pairs in NumPy give p = 0.0008.
#[test]
fn variant_that_fails_does_not_win() {
    let mut runs = Vec::new();
    for block in 0..40 {
        let time = f64::from(block) * 0.26;
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
    let time = of(Compared::TIME_99);
    assert_eq!((time.pairs, time.maps, time.failed), (40, 40, [24, 0]));
    let [mean_a, mean_b] = [time.mean_a, time.mean_b].map(|mean| mean / ticks(1.0));
    assert!((mean_a - 44.78).abs() < 1e-9 && (mean_b - 35.07).abs() < 1e-9, "{time:?}");
    assert!(!time.is_a_better(Compared::TIME_99));
    assert!(time.p_value.is_some_and(|p| p < 0.002), "{time:?}");
    let area = of(Compared::Unseen);
    let unseen = ticks(60.0) * (1.0 - 0.7 * 16.0 / 40.0);
    assert!((area.mean_a - unseen).abs() < 1e-6 && !area.is_a_better(Compared::Unseen), "{area:?}");
    // How far it would have moved is not known: those pairs are left out, and counted.
    let distance = of(Compared::Distance);
    assert_eq!((distance.pairs, distance.maps, distance.all_pairs, distance.failed), (16, 16, 16, [24, 0]));
    assert_eq!(distance.blocks, 40);
    assert!(distance.is_of_survivors && distance.p_value.is_none(), "{distance:?}");
    assert!(distance.effect.as_ref().is_some_and(|effect| effect.interval.is_none()), "{distance:?}");
    let table = tables(&study).unwrap().remove(3);
    assert!(table.columns.iter().any(|(_, key)| key == "failed_a"));
    let Verdict { sentence, second, .. } = verdicts(&study).unwrap().remove(0).verdicts.remove(0);
    assert!(sentence.starts_with("steady is ahead of crashes in the area under the explored share"), "{sentence}");
    assert!(sentence.contains("crashes failed on 24 of 40 maps"), "{sentence}");
    // Who is first: the sixteen on which it does not crash.
    let second = second.unwrap();
    assert!(
        second.contains("crashes reaches 99 % first or alone in 16 of 40 pairs, steady in 24; p = 0.268"),
        "{second}"
    );
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
    let family = comparisons(&study, &study.conditions[0], Compared::Unseen).unwrap();
    assert_eq!((family[0].pairs, family[0].maps, family[0].failed), (8, 1, [8, 0]));
}

#[test]
fn five_pairs_have_no_p_value() {
    for (pairs, has) in [(5, false), (6, true)] {
        let times = |shift: f64| (0..pairs).map(|i| Some(20.0 + f64::from(i) + shift)).collect::<Vec<_>>();
        let study = study(&[("a", times(0.0)), ("b", times(3.0))], own_map);
        let family = comparisons(&study, &study.conditions[0], Compared::TIME_99).unwrap();
        assert_eq!((family[0].p_value.is_some(), family[0].adjusted.is_some()), (has, has), "{pairs}");
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
    for compared in [Compared::TIME_99, Compared::Unseen] {
        let (first, second) = (of(&fast, &slow, compared), of(&slow, &fast, compared));
        assert!(first.is_a_better(compared) && !second.is_a_better(compared));
        assert!(first.detectable.is_some_and(|share| share > 0.0));
        assert_eq!(first.detectable, second.detectable);
    }
}

#[test]
fn measure_is_chosen_before_the_data() {
    // One run of many reaches 99 %: verdicts stay about the area, and about a time if a plan says
    // so.
    let times = |first| (0..8).map(|block| (block == 0).then_some(first)).collect::<Vec<_>>();
    let runs = study(&[("a", times(30.0)), ("b", times(31.0))], own_map);
    let said = |plan: Option<&str>| {
        let stored = runs.runs.iter().zip(&runs.made).map(|(run, made)| StoredRun::new(run.clone(), made.clone()));
        let study = Study::new(stored.collect(), plan.map(str::to_owned));
        let tables = tables(&study).unwrap();
        assert!(tables[0].caption.starts_with("Primary measure of the plan"));
        assert!(tables[1..].iter().all(|table| table.caption.starts_with("Secondary measure")));
        (tables[0].name, verdicts(&study).unwrap().remove(0).verdicts.remove(0).sentence)
    };
    let (table, sentence) = said(None);
    assert!(table == "pairs-area" && sentence.contains("the area under the explored share"), "{table}: {sentence}");
    let (table, sentence) = said(Some("primary = \"time-99\""));
    assert!(table == "pairs-time-99" && sentence.contains("the time to 99 %"), "{table}: {sentence}");
    let (table, _) = said(Some("primary = \"time-90\""));
    assert_eq!(table, "pairs-time-90");
}

#[test]
fn effect_and_p_value_never_point_to_different_sides() {
    // Curves that cross: `steady` is behind on most maps, and ahead on average.
    let steady: Vec<_> = (0..20).map(|block| Some(30.0 + f64::from(block) / 10.0)).collect();
    let mixed: Vec<_> =
        (0..20).map(|block| if block % 3 == 0 { None } else { Some(25.0 + f64::from(block) / 10.0) }).collect();
    let study = study(&[("steady", steady), ("mixed", mixed)], own_map);
    let time = comparisons(&study, &study.conditions[0], Compared::TIME_99).unwrap().remove(0);
    assert_eq!((study.variants[time.a].as_str(), time.is_a_better(Compared::TIME_99)), ("mixed", false));
    let interval = time.effect.unwrap().interval.unwrap();
    assert_eq!(time.adjusted.unwrap() < ALPHA, interval.low > 1.0, "{time:?}");
    let Verdict { second, .. } = verdicts(&study).unwrap().remove(0).verdicts.remove(0);
    assert!(second.unwrap().contains("mixed reaches 99 % first or alone in 13 of 20 pairs, steady in 7"));
}

#[test]
fn variants_with_other_durations_are_compared_to_the_shorter_one() {
    // The one that may run for 120 s reaches 99 % at 80 s on all maps, the other one not within 60
    // s.
    let mut study = study(&[("long", vec![Some(80.0); 8]), ("short", vec![None; 8])], own_map);
    for run in study.runs.iter_mut().filter(|run| run.row.controller == "long") {
        (run.row.duration_s, run.row.area_under_explored) = (120.0, 0.825);
    }
    let of = |compared| comparisons(&study, &study.conditions[0], compared).unwrap().remove(0);
    let (time, area) = (of(Compared::TIME_99), of(Compared::Unseen));
    assert_eq!((time.mean_a, time.mean_b), (ticks(60.0), ticks(60.0)));
    // Of 60 s: 0.25 and 0.7 on average for 10 s each, and 0.9 for 40 s.
    assert!((area.mean_a - ticks(60.0) * (1.0 - 45.5 / 60.0)).abs() < 1e-6, "{area:?}");
}
