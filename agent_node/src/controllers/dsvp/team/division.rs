//! The tours of a whole team over its tasks, so that much is seen soon and nothing late.
//!
//! Minimised is the mean duration of the tours, plus the weighted mean of the times at which tasks
//! are reached times the urgency: tours of least duration alone (the travelling salesman) leave
//! what is worth most for last, and tours of least latency alone (the travelling repairman) pass by
//! what has to be returned for. Tasks are inserted one by one, those of most weight first, where
//! they add least, and moved while that lowers the cost, in a fixed number of rounds.
//!
//! Sources: B. Zhou, H. Xu, S. Shen, "RACER", IEEE T-RO 2023, and C. Cao, H. Zhu, H. Choset, J.
//! Zhang, "TARE", RSS 2021 (tours over viewpoints); Blum et al., STOC 1994 (minimum latency).
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
    pub(super) urgency: f64,
}

impl Division<'_> {
    /// The tours, by agent.
    pub(super) fn tours(&self) -> Vec<Vec<usize>> {
        let mut order: Vec<usize> = (0..self.weights.len()).collect();
        order.sort_by(|&a, &b| self.weights[b].total_cmp(&self.weights[a]).then(a.cmp(&b)));
        let mut tours = vec![Vec::new(); self.first_s.len()];
        let mut costs = vec![0.0; tours.len()];
        let mut holders = vec![0; order.len()];
        for &task in &order {
            let (_, agent, place) = self.cheapest_place(&tours, &costs, task);
            tours[agent].insert(place, task);
            costs[agent] = self.cost(agent, tours[agent].iter().copied());
            holders[task] = agent;
        }
        for _ in 0..ROUNDS_MAX {
            let mut has_moved = false;
            for &task in &order {
                has_moved |= self.move_if_cheaper(task, &mut tours, &mut costs, &mut holders);
            }
            if !has_moved {
                break;
            }
        }
        tours
    }

    /// Moves a task to its cheapest place, and whether that is another one.
    fn move_if_cheaper(&self, task: usize, tours: &mut [Vec<usize>], costs: &mut [f64], holders: &mut [usize]) -> bool {
        let holder = holders[task];
        let Some(place) = tours[holder].iter().position(|&other| other == task) else { return false };
        let before = costs[holder];
        tours[holder].remove(place);
        costs[holder] = self.cost(holder, tours[holder].iter().copied());
        let (added, to, at) = self.cheapest_place(tours, costs, task);
        let is_cheaper = added < before - costs[holder] - EPSILON_S;
        let (to, at) = if is_cheaper { (to, at) } else { (holder, place) };
        tours[to].insert(at, task);
        costs[to] = self.cost(to, tours[to].iter().copied());
        holders[task] = to;
        is_cheaper
    }

    /// The cheapest place of a task in all tours: added cost, agent, place.
    fn cheapest_place(&self, tours: &[Vec<usize>], costs: &[f64], task: usize) -> (f64, usize, usize) {
        let mut best = (f64::INFINITY, 0, 0);
        for (agent, tour) in tours.iter().enumerate() {
            for place in 0..=tour.len() {
                let (ahead, behind) = tour.split_at(place);
                let with = ahead.iter().copied().chain(once(task)).chain(behind.iter().copied());
                let added = self.cost(agent, with) - costs[agent];
                if added < best.0 {
                    best = (added, agent, place);
                }
            }
        }
        best
    }

    /// The part of a tour in the cost.
    fn cost(&self, agent: usize, tour: impl Iterator<Item = usize>) -> f64 {
        let (mut from, mut time_s, mut weighted_s): (Option<usize>, f64, f64) = (None, 0.0, 0.0);
        for task in tour {
            time_s = match from {
                None => self.first_s[agent][task],
                Some(from) => time_s + self.between_s[from][task],
            };
            weighted_s += self.weights[task] * time_s.max(0.0);
            from = Some(task);
        }
        time_s.max(0.0) / self.first_s.len() as f64 + self.urgency * weighted_s
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Tasks and agents on a line, at 1 m/s.
    fn tours(agents: &[f64], tasks: &[f64], weights: &[f64], urgency: f64) -> Vec<Vec<usize>> {
        let to = |from: f64| tasks.iter().map(|task| (task - from).abs()).collect::<Vec<f64>>();
        let between_s: Vec<Vec<f64>> = tasks.iter().map(|&task| to(task)).collect();
        let whole: f64 = weights.iter().sum();
        let weights: Vec<f64> = weights.iter().map(|weight| weight / whole).collect();
        let first_s = agents.iter().map(|&agent| to(agent)).collect();
        Division { first_s, between_s: &between_s, weights: &weights, urgency }.tours()
    }

    #[test]
    fn agents_take_what_is_on_their_side() {
        let line = [-20.0, -10.0, 10.0, 20.0];
        assert_eq!(tours(&[-1.0, 1.0], &line, &[1.0; 4], 1.0), [[1, 0], [2, 3]]);
    }

    #[test]
    fn urgency_decides_between_what_is_near_and_what_is_worth_most() {
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
            urgency: 5.0,
        };
        assert_eq!(division.tours(), [[1], [0]]);
    }

    proptest! {
        #[test]
        fn each_task_is_in_one_tour(
            agents in prop::collection::vec(-50.0..50.0, 1..5),
            tasks in prop::collection::vec((-50.0..50.0, 0.1..9.0), 1..12),
            urgency in 0.0..20.0,
        ) {
            let (places, weights): (Vec<f64>, Vec<f64>) = tasks.into_iter().unzip();
            let tours = tours(&agents, &places, &weights, urgency);
            let mut all: Vec<usize> = tours.into_iter().flatten().collect();
            all.sort_unstable();
            prop_assert_eq!(all, (0..places.len()).collect::<Vec<_>>());
        }
    }
}
