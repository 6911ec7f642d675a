use super::super::fixture;
use super::*;
use experiments::rows::{RunMetadata, StoredRun};

fn study() -> Study {
    let run = |controller| StoredRun::new(fixture::run(controller, 1, 2), RunMetadata::default());
    Study::new(vec![run("dsvp"), run("rbw")], None)
}

/// A comparison of two variants; means of 30 s and of `ratio` times that, in ticks.
fn comparison(ratio: f64, (low, high): (f64, f64), pairs: usize, adjusted: Option<f64>) -> Comparison {
    Comparison {
        a: 0,
        b: 1,
        pairs,
        all_pairs: pairs,
        maps: pairs,
        blocks: pairs,
        horizon_s: 60.0,
        failed: [0, 0],
        reached: [pairs; 2],
        is_of_survivors: false,
        mean_a: 1500.0 * ratio,
        mean_b: 1500.0,
        effect: Some(Estimate { mean: ratio, interval: Some(Interval { low, high }) }),
        a12: 0.5,
        p_value: adjusted,
        adjusted,
        comparisons: 1,
        can_be_shown: true,
        detectable: Some(0.153),
    }
}

fn said(comparison: Comparison, compared: Compared) -> String {
    sentence(&study(), &comparison, compared)
}

#[test]
fn effect_comes_before_chance() {
    assert_eq!(
        said(comparison(0.88, (0.80, 0.96), 30, Some(0.003)), Compared::TIME_99),
        "dsvp needs 12 % less time to 99 % than rbw [4.0, 20] (1.14 times as fast), n = 30 maps; p = 0.003."
    );
    // The better one comes first: 1 / 3.37 of the time, and no figure looks like nothing.
    assert_eq!(
        said(comparison(3.37, (1.0003, 5.0), 30, Some(0.0001)), Compared::TIME_99),
        "rbw needs 70 % less time to 99 % than dsvp [0.03, 80] (3.4 times as fast), n = 30 maps; p < 0.001."
    );
    assert_eq!(
        said(comparison(0.6, (0.5, 0.8), 30, Some(0.003)), Compared::Unseen),
        "dsvp is ahead of rbw in the area under the explored share (70.0 against 50.0 %): a cell is seen 40 % sooner on \
         average [20, 50] (1.67 times as fast), n = 30 maps; p = 0.003."
    );
    let points = Comparison { mean_a: 97.0, mean_b: 93.8, ..comparison(3.2, (1.0, 5.12), 30, Some(0.003)) };
    assert_eq!(
        said(points, Compared::Explored),
        "dsvp explores 3.2 points more than rbw [1.0, 5.1] (97.0 against 93.8 %), n = 30 maps; p = 0.003."
    );
    assert_eq!(
        said(comparison(1.25, (1.0, 1.6), 30, Some(0.01)), Compared::Distance),
        "rbw moves 20 % less than dsvp [0.0, 38], n = 30 maps; p = 0.010."
    );
}

#[test]
fn no_difference_is_shown_or_could_be() {
    assert_eq!(
        said(comparison(0.97, (0.90, 1.05), 8, Some(0.4)), Compared::TIME_99),
        "No difference in the time to 99 % is shown between dsvp and rbw: dsvp needed 3.0 % less time to 99 % than rbw \
         [-5.0, 10] (1.03 times as fast), n = 8 maps; p = 0.400. 8 maps that scatter like these show a difference of \
         15 % in four of five cases."
    );
    // Three comparisons on six maps, all in one direction: nothing could have come out.
    let floor = Comparison { comparisons: 3, can_be_shown: false, ..comparison(0.5, (0.4, 0.6), 6, Some(0.094)) };
    assert_eq!(
        said(floor, Compared::TIME_99),
        "No difference in the time to 99 % could be shown between dsvp and rbw: 3 comparisons need 7 maps, and there \
         are 6. dsvp needed 50 % less time to 99 % than rbw [40, 60] (2.0 times as fast), n = 6 maps; p = 0.094."
    );
    let wide = Comparison { detectable: None, ..comparison(0.97, (0.2, 4.0), 8, Some(0.4)) };
    let words = said(wide, Compared::Unseen);
    assert!(words.ends_with("8 maps that scatter like these show no difference in four of five cases, however large."));
}

#[test]
fn failures_are_named() {
    let failing = Comparison { failed: [24, 0], ..comparison(1.25, (1.0, 1.6), 40, Some(0.003)) };
    let words = said(failing, Compared::TIME_99);
    assert!(words.ends_with("p = 0.003. dsvp failed on 24 of 40 maps: a failed run counts as not reached."), "{words}");
    let both = Comparison { failed: [1, 2], maps: 5, ..comparison(0.5, (0.2, 0.8), 7, Some(0.02)) };
    let words = said(both, Compared::Unseen);
    let end = "dsvp failed on 1 of 7 pairs, rbw failed on 2 of 7 pairs: a failed run counts as nothing explored.";
    assert!(words.ends_with(end), "{words}");
    // Of pairs that have survived there is no verdict.
    let effect = Some(Estimate { mean: 0.5, interval: None });
    let left_out = Comparison {
        reached: [7, 7],
        failed: [3, 0],
        blocks: 10,
        is_of_survivors: true,
        effect,
        ..comparison(0.5, (0.2, 0.8), 7, None)
    };
    assert_eq!(
        said(left_out, Compared::Distance),
        "No verdict on dsvp and rbw in the distance of the team: dsvp failed on 3 of 10 maps; pairs with a failed run are \
         left out, which may be those on harder maps. Of the others: dsvp moved 50 % less than rbw, \
         n = 7 maps."
    );
}

/// What happened to few runs, or to none, is no time of all.
#[test]
fn times_that_were_not_reached_are_named() {
    let some = Comparison { reached: [3, 0], ..comparison(0.75, (0.34, 1.0), 8, Some(0.004)) };
    assert_eq!(
        said(some, Compared::TIME_99),
        "dsvp needs 25 % less time to 99 % than rbw [0.0, 66], n = 8 maps; p = 0.004. dsvp reached 99 % on 3 of 8 maps, \
         rbw on 0: a time that is not reached counts as the 60 s of the run, on which the figure depends."
    );
    let none = Comparison { reached: [0, 0], mean_a: 3000.0, mean_b: 3000.0, ..comparison(1.0, (1.0, 1.0), 8, None) };
    let neither = "No verdict on dsvp and rbw: neither reaches 99 % on any of 8 maps within 60 s, so that there are no \
                   times to compare.";
    assert_eq!(said(none.clone(), Compared::TIME_99), neither);
    // One crashes, the other one does not get there.
    let failing = Comparison { failed: [0, 8], ..none.clone() };
    let with_failures = format!("{neither} rbw failed on 8 of 8 maps: a failed run counts as not reached.");
    assert_eq!(said(failing, Compared::TIME_99), with_failures);
    // Nothing has run: there is nothing equal about it.
    for compared in [Compared::TIME_99, Compared::Unseen, Compared::Explored] {
        let words = said(Comparison { failed: [8, 8], ..none.clone() }, compared);
        let failures = ": dsvp failed on 8 of 8 maps, rbw failed on 8 of 8 maps; a failed run counts as n";
        assert!(words.starts_with("No verdict on dsvp and rbw in ") && words.contains(failures), "{words}");
    }
}

#[test]
fn variants_without_a_common_map_have_no_verdict() {
    let run = |controller, seed| StoredRun::new(fixture::run(controller, seed, 2), RunMetadata::default());
    let study = Study::new(vec![run("dsvp", 1), run("dsvp", 2), run("rbw", 3)], None);
    let all: Vec<Verdict> = verdicts(&study).unwrap().into_iter().flat_map(|panel| panel.verdicts).collect();
    let words: Vec<&str> = all.iter().map(|verdict| verdict.sentence.as_str()).collect();
    assert_eq!(words, ["No verdict on dsvp and rbw: they have no map and seed in common; run the plan to its end."]);
}

#[test]
fn few_observations_are_no_evidence() {
    let few = Comparison { comparisons: 3, ..comparison(0.5, (0.4, 0.6), 3, None) };
    assert_eq!(
        said(few.clone(), Compared::TIME_99),
        "dsvp needed 50 % less time to 99 % than rbw [40, 60] (2.0 times as fast), n = 3 maps: too few for a test, \
         which needs 7."
    );
    let one = Comparison { all_pairs: 10, pairs: 1, maps: 1, blocks: 1, reached: [1; 2], ..few.clone() };
    let words = said(one, Compared::TIME_99);
    assert!(words.ends_with("n = 1 map (10 pairs of runs, 9 of them repetitions): no evidence about other maps."));
    let shared = Comparison { pairs: 8, all_pairs: 8, maps: 2, reached: [8; 2], adjusted: Some(0.01), ..few };
    assert!(said(shared, Compared::TIME_99).contains("n = 8 pairs on 2 maps; p = 0.010"));
}
