//! Open tours: the order in which one agent visits its tasks, and the division of tasks between two
//! agents.
//!
//! A tour starts at the agent, visits all its tasks, and ends at the last one. It is made by
//! cheapest insertion and improved by 2-opt; the division moves single tasks between the two tours
//! while that lowers the cost. Each improvement ends after a fixed number of rounds, so the time of
//! a decision is bounded.
//!
//! Source of the division: B. Zhou, H. Xu, S. Shen, "RACER: Rapid Collaborative Exploration With a
//! Decentralized Multi-UAV System", IEEE T-RO 2023 (a vehicle-routing problem of two agents at each
//! contact); the price of a cut between neighbouring tasks follows C2-Explorer (2026).
//!
//! Durations are whole tenths of a second, so that sums do not depend on their order.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// A duration, tenths of a second.
pub(super) type Tenths = u32;

/// The duration to a task that cannot be reached: more than any tour takes.
pub(super) const UNREACHABLE: Tenths = 1_000_000;

/// Most rounds of improvement of one tour, and of one division.
const ROUNDS_MAX: usize = 4;

/// The durations from one task to all over tasks that adjoin.
pub(super) fn shortest(adjoining: &[Vec<(usize, Tenths)>], from: usize) -> Vec<Tenths> {
    let mut reached = vec![UNREACHABLE; adjoining.len()];
    let mut queue = BinaryHeap::from([Reverse((0, from))]);
    reached[from] = 0;
    while let Some(Reverse((duration, task))) = queue.pop() {
        if duration > reached[task] {
            continue;
        }
        for &(other, leg) in &adjoining[task] {
            let whole = duration + leg;
            if whole < reached[other] {
                reached[other] = whole;
                queue.push(Reverse((whole, other)));
            }
        }
    }
    reached
}

/// Tasks with the durations of the legs between them.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Legs {
    /// From task to task.
    pub(super) between: Vec<Vec<Tenths>>,
    /// In each task.
    pub(super) work: Vec<Tenths>,
}

impl Legs {
    /// Duration of an open tour over `tasks` from a start with these legs.
    pub(super) fn duration(&self, from: &[Tenths], tasks: &[usize]) -> u64 {
        let Some(&first) = tasks.first() else { return 0 };
        let travel: u64 = tasks.windows(2).map(|pair| u64::from(self.between[pair[0]][pair[1]])).sum();
        let work: u64 = tasks.iter().map(|&task| u64::from(self.work[task])).sum();
        u64::from(from[first]) + travel + work
    }

    /// The cheapest place for another task in a tour, and by how much it lengthens the tour.
    fn cheapest_place(&self, from: &[Tenths], tour: &[usize], task: usize) -> (u64, usize) {
        let leg = |place: usize| match place {
            0 => u64::from(from[task]),
            _ => u64::from(self.between[tour[place - 1]][task]),
        };
        let replaced = |place: usize| match place {
            0 => u64::from(from[tour[0]]),
            _ => u64::from(self.between[tour[place - 1]][tour[place]]),
        };
        let added = |place: usize| match tour.get(place) {
            None => leg(place),
            // At least 0, even if the legs violate the triangle inequality.
            Some(&next) => (leg(place) + u64::from(self.between[task][next])).saturating_sub(replaced(place)),
        };
        let (longer, place) = (0..=tour.len()).map(|place| (added(place), place)).min().unwrap_or_default();
        (longer + u64::from(self.work[task]), place)
    }

    /// A short open tour over `tasks`.
    pub(super) fn tour(&self, from: &[Tenths], tasks: &[usize]) -> Vec<usize> {
        let mut tour = Vec::with_capacity(tasks.len());
        for &task in tasks {
            let (_, place) = self.cheapest_place(from, &tour, task);
            tour.insert(place, task);
        }
        self.improve(from, &mut tour);
        tour
    }

    /// 2-opt and moves of single tasks: reverses or moves while that shortens the tour.
    fn improve(&self, from: &[Tenths], tour: &mut Vec<usize>) {
        let mut shortest = self.duration(from, tour);
        for _ in 0..ROUNDS_MAX {
            let before = shortest;
            for start in 0..tour.len() {
                for end in start + 1..tour.len() {
                    tour[start..=end].reverse();
                    let duration = self.duration(from, tour);
                    if duration < shortest {
                        shortest = duration;
                    } else {
                        tour[start..=end].reverse();
                    }
                }
            }
            for place in 0..tour.len() {
                let task = tour.remove(place);
                let (_, better) = self.cheapest_place(from, tour, task);
                tour.insert(better, task);
                let duration = self.duration(from, tour);
                if duration < shortest {
                    shortest = duration;
                } else {
                    tour.remove(better);
                    tour.insert(place, task);
                }
            }
            if shortest == before {
                break;
            }
        }
    }
}

/// The division of tasks between two agents.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Division {
    /// The tour of each agent.
    pub(super) tours: [Vec<usize>; 2],
}

/// The cost of a division.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Cost {
    /// Duration of both tours, and the price of the cuts between neighbouring tasks.
    pub(super) sum: u64,
    /// Duration of the longer tour.
    pub(super) makespan: u64,
}

impl Cost {
    /// Whether a division of this cost is worth an exchange: it costs less than the present one, or
    /// its makespan is shorter by a tenth.
    pub(super) fn is_worth_it(self, present: Self) -> bool {
        self.sum < present.sum && self.makespan <= present.makespan || 10 * self.makespan <= 9 * present.makespan
    }

    /// What a division minimises: the makespan counts for as much as the sum of both tours if they
    /// are equal.
    fn objective(self) -> u64 {
        self.sum + 2 * self.makespan
    }
}

/// Tasks to be divided between two agents.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Problem {
    pub(super) legs: Legs,
    /// From each agent to each task.
    pub(super) from: [Vec<Tenths>; 2],
    /// Pairs of neighbouring tasks.
    pub(super) neighbours: Vec<(usize, usize)>,
    /// Price of two neighbouring tasks with different agents.
    pub(super) cut: Tenths,
}

impl Problem {
    /// The cost of a division.
    pub(super) fn cost(&self, division: &Division) -> Cost {
        let durations = [0, 1].map(|agent| self.legs.duration(&self.from[agent], &division.tours[agent]));
        let mut holder = vec![None; self.legs.work.len()];
        for (agent, tour) in division.tours.iter().enumerate() {
            for &task in tour {
                holder[task] = Some(agent);
            }
        }
        let is_cut = |&&(a, b): &&(usize, usize)| holder[a].is_some() && holder[b].is_some() && holder[a] != holder[b];
        let cuts = self.neighbours.iter().filter(is_cut).count() as u64;
        Cost { sum: durations[0] + durations[1] + cuts * u64::from(self.cut), makespan: durations[0].max(durations[1]) }
    }

    /// The division with the tasks where they are, in short tours.
    pub(super) fn keeping(&self, tasks: [&[usize]; 2]) -> Division {
        Division { tours: [0, 1].map(|agent| self.legs.tour(&self.from[agent], tasks[agent])) }
    }

    /// A cheap division of the tasks of both agents: the better one of two that are improved from
    /// the present one and from none.
    pub(super) fn divided(&self, tasks: [&[usize]; 2]) -> Division {
        let kept = self.keeping(tasks);
        let mut anew = Division::default();
        let mut all: Vec<usize> = tasks.concat();
        // The farthest ones first: they decide which agent goes where.
        all.sort_by_key(|&task| (Reverse(self.from[0][task].min(self.from[1][task])), task));
        self.insert_all(&mut anew, &all);
        let mut divisions = [kept, anew];
        for division in &mut divisions {
            self.improve(division);
        }
        let [kept, anew] = divisions;
        if self.cost(&anew).objective() < self.cost(&kept).objective() { anew } else { kept }
    }

    fn insert_all(&self, division: &mut Division, tasks: &[usize]) {
        for &task in tasks {
            let mut best: Option<(u64, usize, usize)> = None;
            for agent in 0..2 {
                let (_, place) = self.legs.cheapest_place(&self.from[agent], &division.tours[agent], task);
                division.tours[agent].insert(place, task);
                let objective = self.cost(division).objective();
                division.tours[agent].remove(place);
                if best.is_none_or(|(least, ..)| objective < least) {
                    best = Some((objective, agent, place));
                }
            }
            if let Some((_, agent, place)) = best {
                division.tours[agent].insert(place, task);
            }
        }
    }

    /// Moves single tasks to the other agent while that lowers the objective, then improves both
    /// tours.
    fn improve(&self, division: &mut Division) {
        let mut least = self.cost(division).objective();
        for _ in 0..ROUNDS_MAX {
            let before = least;
            for agent in 0..2 {
                let mut place = 0;
                while place < division.tours[agent].len() {
                    let task = division.tours[agent].remove(place);
                    let other = &mut division.tours[1 - agent];
                    let (_, there) = self.legs.cheapest_place(&self.from[1 - agent], other, task);
                    other.insert(there, task);
                    let objective = self.cost(division).objective();
                    if objective < least {
                        least = objective;
                    } else {
                        division.tours[1 - agent].remove(there);
                        division.tours[agent].insert(place, task);
                        place += 1;
                    }
                }
            }
            for agent in 0..2 {
                self.legs.improve(&self.from[agent], &mut division.tours[agent]);
            }
            least = self.cost(division).objective();
            if least == before {
                break;
            }
        }
    }
}

#[cfg(test)]
mod tests;
