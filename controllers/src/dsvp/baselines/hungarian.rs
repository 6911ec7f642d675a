//! `hungarian`: frontiers are assigned to the agents in contact so that the sum of their paths is
//! least.
//!
//! Source: J. Faigl, M. Kulich, L. Přeučil, "Goal Assignment using Distance Cost in Multi-Robot
//! Exploration", IROS 2012: representatives of the frontiers are the goals, path lengths the costs,
//! and the Hungarian method (Kuhn 1955, Munkres 1957) assigns one goal to each robot.
//!
//! There a central planner assigns goals to all robots at once. Here each agent solves the same
//! problem at each of its plans, with the goals that others have claimed as the places where they
//! will be: one that is under way to a goal so keeps it.

use pathfinding::kuhn_munkres::kuhn_munkres_min;
use pathfinding::matrix::Matrix;

use super::super::coordination::Coordination;
use super::super::obstacles::Obstacles;
use super::super::tasks::{ReachedTask, TaskSearch};
use super::super::{Dsvp, Plan};
use super::{metres, planner, task_search};
use crate::auction::{Auction, AuctionParams, Presence};
use crate::settings::{SettingError, Settings};
use crate::{Controller, Ctx, Setup};
use agent::abstract_graph::PathLengths;
use agent::observation::Observation;

/// Costs are whole millimetres, so that the least sum does not depend on rounding.
const PER_M: f64 = 1000.0;

/// What an agent knows of the others, and the tasks.
#[derive(Debug)]
struct Hungarian {
    auction: Auction,
    search: TaskSearch,
    lengths: PathLengths,
}

/// The planner `hungarian`.
///
/// Settings: those of claims ([`AuctionParams`]), `regions`, `expected_min` (see
/// docs/controllers.md).
///
/// # Errors
/// If a setting is out of range.
pub fn hungarian(settings: &mut Settings, setup: Setup<'_>) -> Result<impl Controller + use<>, SettingError> {
    let Setup { agent, run_info, .. } = &setup;
    let auction = Auction::new(AuctionParams::from_settings(settings)?, &run_info.bodies, *agent, run_info.extent);
    let search = task_search(settings, run_info)?;
    Ok(planner(Hungarian { auction, search, lengths: PathLengths::default() }, setup))
}

impl Coordination for Hungarian {
    fn auction(&self) -> Option<&Auction> {
        Some(&self.auction)
    }

    fn auction_mut(&mut self) -> Option<&mut Auction> {
        Some(&mut self.auction)
    }

    fn first_stage(
        planner: &mut Dsvp<Self>,
        observation: &Observation,
        ctx: &mut Ctx<'_>,
        obstacles: &Obstacles,
    ) -> Plan {
        let (mut at, Self { auction, search, lengths }) = planner.split();
        let tasks = search.tasks(&mut at, ctx);
        let extent = ctx.map().extent();
        let mut costs_m: Vec<Vec<f64>> = vec![tasks.iter().map(|reached| reached.own_m).collect()];
        lengths.renew(at.graph);
        for Presence { cell, free_in_s, speed_m_s, .. } in auction.presences(&observation.contacts, observation.tick) {
            lengths.begin(at.graph, cell, tasks.iter().map(|reached| reached.task.region));
            let rest_m = free_in_s * speed_m_s;
            let to = |reached: &ReachedTask| rest_m + metres(lengths.to(at.graph, reached.task.region), extent);
            costs_m.push(tasks.iter().map(to).collect());
        }
        match assigned_to_first(&costs_m) {
            Some(number) => search.go([&tasks[number].task], &mut at, ctx, obstacles),
            None => Plan::Nothing,
        }
    }
}

/// The task of the first agent where the sum of the costs is least, if it gets one. Each agent gets
/// at most one task, and as many as possible get one; `costs_m` is by agent and task.
fn assigned_to_first(costs_m: &[Vec<f64>]) -> Option<usize> {
    let (agents, tasks) = (costs_m.len(), costs_m.first()?.len());
    let cost = |agent: usize, task: usize| (costs_m[agent][task] * PER_M) as i64;
    if tasks == 0 {
        return None;
    }
    if agents <= tasks {
        let costs = Matrix::from_fn(agents, tasks, |(agent, task)| cost(agent, task));
        return kuhn_munkres_min(&costs).1.first().copied();
    }
    let costs = Matrix::from_fn(tasks, agents, |(task, agent)| cost(agent, task));
    kuhn_munkres_min(&costs).1.iter().position(|&agent| agent == 0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sum_of_paths_is_least_though_the_nearest_goal_is_another() {
        // Both are nearest to the first goal. The other agent would have to go far for the second.
        let costs_m = [vec![4.0, 6.0], vec![5.0, 20.0]];
        assert_eq!(assigned_to_first(&costs_m), Some(1));
        assert_eq!(assigned_to_first(&costs_m[..1]), Some(0));
    }

    #[test]
    fn agents_beyond_the_number_of_goals_get_none() {
        assert_eq!(assigned_to_first(&[vec![9.0], vec![2.0]]), None);
        assert_eq!(assigned_to_first(&[vec![2.0], vec![9.0], vec![9.0]]), Some(0));
        assert_eq!(assigned_to_first(&[vec![], vec![]]), None);
    }

    #[test]
    fn assignment_is_the_least_of_all() {
        let costs_m = [vec![7.0, 5.0, 9.0], vec![6.0, 5.5, 3.0], vec![4.0, 2.5, 8.0]];
        let mut least = (f64::INFINITY, 0);
        for [a, b, c] in [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]] {
            let sum = costs_m[0][a] + costs_m[1][b] + costs_m[2][c];
            if sum < least.0 {
                least = (sum, a);
            }
        }
        assert_eq!(assigned_to_first(&costs_m), Some(least.1));
    }
}
