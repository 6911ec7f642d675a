//! The exploration stage: the agent grows a tree of viewpoints within its horizon, towards the
//! local frontiers ahead, and follows the branch with the highest gain.
//!
//! Source: Zhu et al., IROS 2021 (see `tree.rs`). It goes to no viewpoint from which a scan did not
//! show what was expected.

use nalgebra::Vector3;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use voxels::Cell;

use super::avoidance::motion_along;
use super::coordination::Coordination;
use super::goal::Goal;
use super::obstacles::Obstacles;
use super::tree::{Tree, vector};
use super::{Dsvp, Plan, by_distance, has_gain_left};
use crate::Ctx;
use agent::abstract_graph::AbstractGraph;
use agent::observation::Observation;
use agent::path::{Neighbours, Path};

impl<C: Coordination> Dsvp<C> {
    /// The exploration stage.
    pub(super) fn explore(&mut self, observation: &Observation, ctx: &Ctx<'_>, obstacles: &Obstacles) -> Plan {
        let Self { graph, gain_estimator, coordination, unproductive, .. } = self;
        let (map, here) = (ctx.map(), ctx.cell());
        let growth = self.params.growth(map.extent().cell_m());
        let moves = ctx.graph(Neighbours::TwentySix);
        let frontiers = local_frontiers(graph, here, growth.horizon);
        if frontiers.is_empty() {
            self.tree = None;
            return Plan::Nothing;
        }
        let ahead = most_ahead(frontiers, here, self.direction, self.params.frontiers as usize, &mut self.rng);
        let mut tree = match self.tree.take() {
            Some(tree) => tree.rerooted_at(here, moves, &growth),
            None => Tree::new(here),
        };
        tree.grow(moves, &growth, &ahead, obstacles, &mut self.rng);
        if has_gain_left(self.goal, here, map, gain_estimator, self.params.gain_min) {
            unproductive.insert(here);
        }
        let utility_factor = |cell: Cell, path_m: f64| {
            if unproductive.contains(&cell) { 0.0 } else { coordination.utility_factor(cell, path_m, observation.tick) }
        };
        let branch = tree.best(map, gain_estimator, &self.params.valuation(), self.direction, &utility_factor);
        self.tree = Some(tree);
        let Some((branch, end)) = branch.and_then(|branch| branch.cells.last().copied().map(|end| (branch, end)))
        else {
            return Plan::Nothing;
        };
        match motion_along(ctx, &Path { cells: branch.cells, cost: 0 }, obstacles, self.params.waypoints) {
            Some(motion) => {
                self.direction = vector(end - here).try_normalize(0.0);
                Plan::Go(Goal::Viewpoint { cell: end, gain: branch.gain }, motion)
            }
            // No body blocks the path: there is none.
            None if obstacles.is_empty() => {
                unproductive.insert(end);
                Plan::Pending
            }
            None => Plan::Blocked,
        }
    }
}

/// For each region within the horizon the frontier nearest to the agent.
fn local_frontiers(graph: &AbstractGraph, here: Cell, horizon: i32) -> Vec<Cell> {
    let nearest = |frontiers: &[Cell]| frontiers.iter().copied().min_by(|a, b| by_distance(here, a, b));
    graph.near(here, horizon).filter_map(|(_, region)| nearest(&region.frontiers)).collect()
}

/// The local frontiers most aligned with the direction of travel; random ones if there is no
/// direction yet.
fn most_ahead(
    mut frontiers: Vec<Cell>,
    here: Cell,
    direction: Option<Vector3<f64>>,
    count: usize,
    rng: &mut ChaCha8Rng,
) -> Vec<Cell> {
    match direction {
        Some(direction) => {
            let ahead = |cell: &Cell| vector(*cell - here).try_normalize(0.0).map_or(1.0, |to| to.dot(&direction));
            frontiers.sort_by(|a, b| ahead(b).total_cmp(&ahead(a)).then(a.cmp(b)));
        }
        None => frontiers.shuffle(rng),
    }
    frontiers.truncate(count);
    frontiers
}
