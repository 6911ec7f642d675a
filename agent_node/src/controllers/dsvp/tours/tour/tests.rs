use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;

/// Tasks on a line, and agents at these places; one unit takes a second.
fn line(tasks: &[i64], agents: [i64; 2]) -> Problem {
    let apart = |a: i64, b: i64| (a - b).unsigned_abs() as Tenths * 10;
    let between = tasks.iter().map(|&a| tasks.iter().map(|&b| apart(a, b)).collect()).collect();
    let from = agents.map(|agent| tasks.iter().map(|&task| apart(agent, task)).collect());
    let legs = Legs { between, work: vec![10; tasks.len()] };
    Problem { legs, from, neighbours: Vec::new(), cut: 0 }
}

/// The duration of the best open tour, by all orders.
fn least(legs: &Legs, from: &[Tenths], done: &[usize], left: &[usize]) -> u64 {
    if left.is_empty() {
        return legs.duration(from, done);
    }
    let next = |&task: &usize| {
        let rest: Vec<usize> = left.iter().copied().filter(|&other| other != task).collect();
        least(legs, from, &[done, &[task]].concat(), &rest)
    };
    left.iter().map(next).min().unwrap()
}

#[test]
fn tour_visits_the_nearer_end_first() {
    let Problem { legs, from, .. } = line(&[5, 9, -2, 7], [0, 0]);
    let tour = legs.tour(&from[0], &[0, 1, 2, 3]);
    assert_eq!(tour, [2, 0, 3, 1]);
    assert_eq!(legs.duration(&from[0], &tour), 20 + 70 + 20 + 20 + 40);
    assert_eq!(legs.duration(&from[0], &[]), 0);
}

#[test]
fn idle_agent_takes_the_tasks_on_its_side() {
    let problem = line(&[-30, -20, 20, 30], [-10, 10]);
    let present = problem.keeping([&[0, 1, 2, 3], &[]]);
    let divided = problem.divided([&[0, 1, 2, 3], &[]]);
    assert_eq!(divided.tours, [vec![1, 0], vec![2, 3]]);
    assert!(problem.cost(&divided).is_worth_it(problem.cost(&present)));
    let again = problem.divided([&[0, 1], &[2, 3]]);
    assert_eq!(again, divided);
    assert!(!problem.cost(&again).is_worth_it(problem.cost(&divided)), "nothing is left to gain");
}

#[test]
fn neighbours_stay_together_if_a_cut_is_dear() {
    let mut problem = line(&[1, 2], [0, 3]);
    assert_eq!(problem.divided([&[0, 1], &[]]).tours, [[0], [1]]);
    problem.neighbours = vec![(0, 1)];
    problem.cut = 1000;
    let together = problem.divided([&[0, 1], &[]]);
    assert!(together.tours.iter().any(Vec::is_empty), "{together:?}");
}

#[test]
fn division_needs_a_gain() {
    let cost = |sum, makespan| Cost { sum, makespan };
    assert!(cost(90, 60).is_worth_it(cost(100, 60)));
    assert!(cost(120, 90).is_worth_it(cost(100, 100)), "the makespan drops by a tenth");
    assert!(!cost(120, 91).is_worth_it(cost(100, 100)));
    assert!(!cost(100, 60).is_worth_it(cost(100, 60)));
    assert!(!cost(90, 61).is_worth_it(cost(100, 60)));
}

#[test]
fn lengths_follow_adjoining_tasks() {
    let adjoining = vec![vec![(1, 5)], vec![(0, 5), (2, 7)], vec![(1, 7)], vec![]];
    assert_eq!(shortest(&adjoining, 0), [0, 5, 12, UNREACHABLE]);
}

/// The heuristic guarantees no ratio: an end that is dear to reach may be left to the last.
#[test]
fn tours_are_nearly_shortest() {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut ratios = [0.0; 400].map(|_: f64| {
        let tasks: Vec<i64> = (0..rng.random_range(2..7)).map(|_| rng.random_range(-50..50)).collect();
        let Problem { legs, from, .. } = line(&tasks, [0, 0]);
        let all: Vec<usize> = (0..tasks.len()).collect();
        legs.duration(&from[0], &legs.tour(&from[0], &all)) as f64 / least(&legs, &from[0], &[], &all) as f64
    });
    ratios.sort_by(f64::total_cmp);
    let mean = ratios.iter().sum::<f64>() / ratios.len() as f64;
    assert!(ratios[0] >= 1.0 && mean < 1.005 && ratios[399] <= 1.25, "{mean}, {}", ratios[399]);
}

proptest! {
    #[test]
    fn tours_visit_all_tasks(tasks in proptest::collection::vec(-50i64..50, 0..7)) {
        let Problem { legs, from, .. } = line(&tasks, [0, 0]);
        let all: Vec<usize> = (0..tasks.len()).collect();
        let mut tour = legs.tour(&from[0], &all);
        tour.sort_unstable();
        prop_assert_eq!(tour, all);
    }

    #[test]
    fn divisions_hold_each_task_once_and_cost_no_more(
        tasks in proptest::collection::vec(-50i64..50, 0..12),
        agents in [-50i64..50, -50i64..50],
        holders in any::<u16>(),
    ) {
        let problem = line(&tasks, agents);
        let (mine, theirs): (Vec<usize>, Vec<usize>) = (0..tasks.len()).partition(|task| holders >> task & 1 == 1);
        let present = problem.keeping([&mine, &theirs]);
        let divided = problem.divided([&mine, &theirs]);
        prop_assert!(problem.cost(&divided).objective() <= problem.cost(&present).objective());
        let mut all: Vec<usize> = divided.tours.concat();
        all.sort_unstable();
        prop_assert_eq!(all, (0..tasks.len()).collect::<Vec<_>>());
    }
}
