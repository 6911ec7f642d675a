//! The tours of a whole team over its tasks, so that much is seen soon and nothing late.
//!
//! Minimised is the mean duration of the tours, plus the weighted mean of the times at which tasks
//! are reached times the latency_weight: tours of least duration alone (the travelling salesman)
//! leave what is worth most for last, and tours of least latency alone (the travelling repairman)
//! pass by what has to be returned for. Tasks are inserted one by one, those of most weight first,
//! where they add least, and moved while that lowers the cost, in a fixed number of rounds.
//!
//! Sources: B. Zhou, H. Xu, S. Shen, "RACER", IEEE T-RO 2023, and C. Cao, H. Zhu, H. Choset, J.
//! Zhang, "TARE", RSS 2021 (tours over viewpoints); Blum et al., STOC 1994 (minimum latency).
//!
//! A tour may have a limit of weight. Then tasks go where they add least among the tours with room.
//!
//! Invariants: every task is in exactly one tour; the result depends on the numbers alone. A time
//! before now counts as now: what an agent has reached in the meantime costs it nothing.

use std::iter::once;

/// Most rounds of moves.
const ROUNDS_MAX: usize = 4;

/// Least change of cost that counts, seconds.
const EPSILON_S: f64 = 1e-9;

/// The tasks of a team.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Division<'l> {
    /// By agent, the time at which it can be at each task, seconds from now.
    pub(super) first_s: Vec<Vec<f64>>,
    /// Duration from task to task, seconds.
    pub(super) between_s: &'l [Vec<f64>],
    /// By task; their sum is 1.
    pub(super) weights: &'l [f64],
    /// What the weighted mean of the times counts beside the mean duration.
    pub(super) latency_weight: f64,
    /// Most weight of one tour, unless all have as much.
    pub(super) load_max: f64,
}

/// The tour of one agent, with what has to be known to insert a task.
#[derive(Debug, Clone, Default)]
struct Tour {
    tasks: Vec<usize>,
    /// When each task is reached, seconds from now; may be before now.
    times_s: Vec<f64>,
    /// By place, the weight of the tasks from there on.
    weights_from: Vec<f64>,
    /// The part of the tour in the cost.
    cost: f64,
}

impl Tour {
    /// The weight of its tasks.
    fn load(&self) -> f64 {
        self.weights_from.first().copied().unwrap_or_default()
    }
}

impl Division<'_> {
    /// The tours, by agent.
    pub(super) fn tours(&self) -> Vec<Vec<usize>> {
        let mut order: Vec<usize> = (0..self.weights.len()).collect();
        order.sort_by(|&a, &b| self.weights[b].total_cmp(&self.weights[a]).then(a.cmp(&b)));
        let mut tours = vec![Tour::default(); self.first_s.len()];
        let mut holders = vec![0; order.len()];
        for &task in &order {
            let (_, agent, place) = self.cheapest_place(&tours, task);
            self.insert(&mut tours[agent], agent, place, task);
            holders[task] = agent;
        }
        for _ in 0..ROUNDS_MAX {
            let mut has_moved = false;
            for &task in &order {
                has_moved |= self.move_if_cheaper(task, &mut tours, &mut holders);
            }
            if !has_moved {
                break;
            }
        }
        tours.into_iter().map(|tour| tour.tasks).collect()
    }

    /// When an agent would be at the last task of a tour, seconds from now; 0 without tasks.
    pub(super) fn end_s(&self, agent: usize, tour: &[usize]) -> f64 {
        self.timed(agent, tour.iter().copied()).last().map_or(0.0, |(_, end_s)| end_s)
    }

    /// Moves a task to its cheapest place, and whether that is another one.
    fn move_if_cheaper(&self, task: usize, tours: &mut [Tour], holders: &mut [usize]) -> bool {
        let holder = holders[task];
        let Some(place) = tours[holder].tasks.iter().position(|&other| other == task) else { return false };
        let before = tours[holder].cost;
        tours[holder].tasks.remove(place);
        self.time(&mut tours[holder], holder);
        let (added, to, at) = self.cheapest_place(tours, task);
        let is_cheaper = added < before - tours[holder].cost - EPSILON_S;
        let (to, at) = if is_cheaper { (to, at) } else { (holder, place) };
        self.insert(&mut tours[to], to, at, task);
        holders[task] = to;
        is_cheaper
    }

    /// The cheapest place of a task in all tours with room for it: added cost, agent, place.
    fn cheapest_place(&self, tours: &[Tour], task: usize) -> (f64, usize, usize) {
        let has_room = |tour: &Tour| tour.load() + self.weights[task] <= self.load_max;
        let is_any = tours.iter().any(has_room);
        let least = tours.iter().map(Tour::load).fold(f64::INFINITY, f64::min);
        let mut best = (f64::INFINITY, 0, 0);
        for (agent, tour) in tours.iter().enumerate() {
            if !(if is_any { has_room(tour) } else { tour.load() <= least }) {
                continue;
            }
            for place in 0..=tour.tasks.len() {
                let added = self.added(tour, agent, place, task);
                if added < best.0 {
                    best = (added, agent, place);
                }
            }
        }
        best
    }

    /// What a task adds to the cost at a place of a tour.
    fn added(&self, tour: &Tour, agent: usize, place: usize, task: usize) -> f64 {
        let time_s = match place.checked_sub(1) {
            None => self.first_s[agent][task],
            Some(before) => tour.times_s[before] + self.between_s[tour.tasks[before]][task],
        };
        if time_s < 0.0 || tour.times_s.first().is_some_and(|&first_s| first_s < 0.0) {
            // Tasks that have been reached before now cost nothing.
            let (ahead, behind) = tour.tasks.split_at(place);
            let with = ahead.iter().copied().chain(once(task)).chain(behind.iter().copied());
            return self.cost(self.timed(agent, with)) - tour.cost;
        }
        let end_s = tour.times_s.last().copied().unwrap_or_default();
        let (longer_s, weight_from) = match tour.tasks.get(place) {
            Some(&next) => (time_s + self.between_s[task][next] - tour.times_s[place], tour.weights_from[place]),
            None => (time_s - end_s, 0.0),
        };
        let weighted_s = self.weights[task] * time_s + weight_from * longer_s;
        longer_s / self.first_s.len() as f64 + self.latency_weight * weighted_s
    }

    fn insert(&self, tour: &mut Tour, agent: usize, place: usize, task: usize) {
        tour.tasks.insert(place, task);
        self.time(tour, agent);
    }

    /// Renews what is known of a tour whose tasks have changed.
    fn time(&self, tour: &mut Tour, agent: usize) {
        let Tour { tasks, times_s, weights_from, cost } = tour;
        times_s.clear();
        times_s.extend(self.timed(agent, tasks.iter().copied()).map(|(_, time_s)| time_s));
        weights_from.clear();
        weights_from.resize(tasks.len(), 0.0);
        let mut weight = 0.0;
        for (from, &task) in weights_from.iter_mut().zip(tasks.iter()).rev() {
            weight += self.weights[task];
            *from = weight;
        }
        *cost = self.cost(tasks.iter().copied().zip(times_s.iter().copied()));
    }

    /// The part of a tour in the cost, by its tasks and the times at which they are reached.
    fn cost(&self, timed: impl Iterator<Item = (usize, f64)>) -> f64 {
        let (mut end_s, mut weighted_s): (f64, f64) = (0.0, 0.0);
        for (task, time_s) in timed {
            weighted_s += self.weights[task] * time_s.max(0.0);
            end_s = time_s;
        }
        end_s.max(0.0) / self.first_s.len() as f64 + self.latency_weight * weighted_s
    }

    /// The tasks of a tour with the times at which they are reached, seconds from now.
    fn timed(&self, agent: usize, tour: impl Iterator<Item = usize>) -> impl Iterator<Item = (usize, f64)> {
        timed(tour, &self.first_s[agent], self.between_s)
    }
}

/// The tasks of a tour with the times at which they are reached, by the times to each task as the
/// first one and the durations from task to task; seconds.
fn timed(
    tour: impl Iterator<Item = usize>,
    first_s: &[f64],
    between_s: &[Vec<f64>],
) -> impl Iterator<Item = (usize, f64)> {
    let mut last: Option<(usize, f64)> = None;
    tour.map(move |task| {
        let time_s = match last {
            None => first_s[task],
            Some((from, time_s)) => time_s + between_s[from][task],
        };
        last = Some((task, time_s));
        (task, time_s)
    })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Tasks and agents on a line, at 1 m/s.
    fn tours(agents: &[f64], tasks: &[f64], weights: &[f64], latency_weight: f64) -> Vec<Vec<usize>> {
        let to = |from: f64| tasks.iter().map(|task| (task - from).abs()).collect::<Vec<f64>>();
        let between_s: Vec<Vec<f64>> = tasks.iter().map(|&task| to(task)).collect();
        let whole: f64 = weights.iter().sum();
        let weights: Vec<f64> = weights.iter().map(|weight| weight / whole).collect();
        let first_s = agents.iter().map(|&agent| to(agent)).collect();
        Division { first_s, between_s: &between_s, weights: &weights, latency_weight, load_max: f64::INFINITY }.tours()
    }

    #[test]
    fn agents_take_what_is_on_their_side() {
        let line = [-20.0, -10.0, 10.0, 20.0];
        assert_eq!(tours(&[-1.0, 1.0], &line, &[1.0; 4], 1.0), [[1, 0], [2, 3]]);
    }

    #[test]
    fn latency_weight_ranks_near_against_valuable() {
        let tasks = [3.0, -10.0];
        assert_eq!(tours(&[0.0], &tasks, &[1.0, 100.0], 0.0), [[0, 1]]);
        assert_eq!(tours(&[0.0], &tasks, &[1.0, 100.0], 50.0), [[1, 0]]);
        assert_eq!(tours(&[0.0], &tasks, &[1.0, 1.0], 50.0), [[0, 1]]);
    }

    #[test]
    fn a_crowded_agent_leaves_tasks_to_one_that_is_farther_away() {
        let tasks = [10.0, 12.0, -10.0, -12.0];
        let shared = tours(&[0.0, -30.0], &tasks, &[1.0; 4], 10.0);
        assert_eq!(shared, [vec![0, 1], vec![3, 2]]);
    }

    #[test]
    fn what_others_have_reached_by_now_is_left_to_them() {
        let division = Division {
            first_s: vec![vec![5.0, 5.0], vec![-40.0, 60.0]],
            between_s: &[vec![0.0, 100.0], vec![100.0, 0.0]],
            weights: &[0.5, 0.5],
            latency_weight: 5.0,
            load_max: f64::INFINITY,
        };
        assert_eq!(division.tours(), [[1], [0]]);
    }

    #[test]
    fn limit_of_weight_divides_what_one_agent_is_nearer_to() {
        let (first_s, line) = (vec![vec![1.0, 2.0, 3.0, 4.0], vec![9.0, 8.0, 7.0, 6.0]], [0.0_f64, 1.0, 2.0, 3.0]);
        let between_s: Vec<Vec<f64>> = line.map(|from| line.map(|to| (to - from).abs()).into()).into();
        let tours = |load_max: f64| {
            let division = Division {
                first_s: first_s.clone(),
                between_s: &between_s,
                weights: &[0.25; 4],
                latency_weight: 0.0,
                load_max,
            };
            let tours = division.tours();
            assert!((division.end_s(0, &tours[0]) - if load_max < 1.0 { 2.0 } else { 4.0 }).abs() < 1e-9);
            tours
        };
        assert_eq!(tours(f64::INFINITY), [vec![0, 1, 2, 3], vec![]]);
        assert_eq!(tours(0.5), [[0, 1], [3, 2]]);
    }

    proptest! {
        #[test]
        fn what_a_task_adds_is_the_difference_of_costs(
            first_s in prop::collection::vec(-20.0..60.0, 6),
            between_s in prop::collection::vec(prop::collection::vec(0.0..60.0, 6), 6),
            weights in prop::collection::vec(0.0..1.0, 6),
            count in 0..6_usize,
        ) {
            let division = Division {
                first_s: vec![first_s; 2],
                between_s: &between_s,
                weights: &weights,
                latency_weight: 5.0,
                load_max: f64::INFINITY,
            };
            let mut tour = Tour { tasks: (0..count).collect(), ..Tour::default() };
            division.time(&mut tour, 1);
            for place in 0..=count {
                let mut with = tour.clone();
                division.insert(&mut with, 1, place, 5);
                let added = division.added(&tour, 1, place, 5);
                prop_assert!((with.cost - tour.cost - added).abs() < 1e-9, "{} {} {added}", with.cost, tour.cost);
            }
        }

        #[test]
        fn each_task_is_in_one_tour(
            agents in prop::collection::vec(-50.0..50.0, 1..5),
            tasks in prop::collection::vec((-50.0..50.0, 0.1..9.0), 1..12),
            latency_weight in 0.0..20.0,
        ) {
            let (places, weights): (Vec<f64>, Vec<f64>) = tasks.into_iter().unzip();
            let tours = tours(&agents, &places, &weights, latency_weight);
            let mut all: Vec<usize> = tours.into_iter().flatten().collect();
            all.sort_unstable();
            prop_assert_eq!(all, (0..places.len()).collect::<Vec<_>>());
        }
    }
}
