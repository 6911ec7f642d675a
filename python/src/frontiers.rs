//! The nearest frontiers of a map, again and again while the body moves and the map grows.
//!
//! A search through all frontiers keeps more than are asked for, and how far away the others are at
//! least. As long as the body has not moved by more than the difference, and with the frontiers
//! that have come since, the nearest ones are among those kept.
//!
//! Invariant: the result is that of a search through all frontiers.

use agent_node::exploration_map::ExplorationMap;
use nalgebra::Point3;
use voxels::Cell;

/// Times as many frontiers are kept as are asked for.
const SPARE: usize = 8;

/// Frontiers near a place, by index, and what is known of the others.
#[derive(Debug, Default)]
pub(crate) struct NearFrontiers {
    kept: Vec<u32>,
    /// Where the body was at the search.
    from: Point3<f64>,
    /// All that were not kept had this distance then, or more, metres.
    others_m: f64,
    /// Length of the journal of the map up to which new frontiers are kept.
    journal_len: usize,
}

/// The square of a distance, and the index of a cell.
type Ranked = (f64, u32);

fn order(one: &Ranked, other: &Ranked) -> std::cmp::Ordering {
    one.0.total_cmp(&other.0).then(one.1.cmp(&other.1))
}

impl NearFrontiers {
    /// The nearest `count` frontiers by straight distance; of equal ones those with the lowest
    /// index first.
    pub(crate) fn nearest(&mut self, map: &ExplorationMap, from: &Point3<f64>, count: usize) -> Vec<Cell> {
        self.update(map);
        let mut ranked = self.ranked(map, from);
        // Rounding must not make others seem farther away than they are.
        let others_m = self.others_m - (from - self.from).norm() - 1e-6;
        let is_near = |(far_m2, _): &&Ranked| far_m2.sqrt() < others_m;
        if others_m < f64::INFINITY && ranked.iter().filter(is_near).count() < count {
            self.search(map, from, SPARE * count);
            ranked = self.ranked(map, from);
        }
        if ranked.len() > count {
            ranked.select_nth_unstable_by(count, order);
            ranked.truncate(count);
        }
        ranked.sort_unstable_by(order);
        ranked.into_iter().map(|(_, index)| map.extent().cell_at(index as usize)).collect()
    }

    /// Keeps the near ones of the frontiers that have come, and drops cells that are none any more.
    fn update(&mut self, map: &ExplorationMap) {
        let extent = map.extent();
        let before = self.kept.len();
        let is_near = |cell: &Cell| (extent.centre(*cell) - self.from).norm() < self.others_m;
        for change in map.changes_since(self.journal_len) {
            let cell = extent.cell_at(change.cell as usize);
            let around = cell.neighbours6().into_iter().chain([cell]).filter(is_near);
            let come = around.filter(|&cell| map.is_frontier(cell)).filter_map(|cell| extent.index(cell));
            self.kept.extend(come.map(|index| index as u32));
        }
        self.journal_len = map.journal_len();
        if self.kept.len() > before {
            self.kept.sort_unstable();
            self.kept.dedup();
        }
        self.kept.retain(|&index| map.is_frontier(extent.cell_at(index as usize)));
    }

    /// The kept ones with their distances, in no order.
    fn ranked(&self, map: &ExplorationMap, from: &Point3<f64>) -> Vec<Ranked> {
        let distance = |index: u32| (map.extent().centre(map.extent().cell_at(index as usize)) - from).norm_squared();
        self.kept.iter().map(|&index| (distance(index), index)).collect()
    }

    /// Searches all frontiers and keeps the nearest ones.
    fn search(&mut self, map: &ExplorationMap, from: &Point3<f64>, count: usize) {
        self.kept = map.frontiers().collect();
        self.others_m = f64::INFINITY;
        if self.kept.len() > count {
            let mut ranked = self.ranked(map, from);
            let (near, first_other, _) = ranked.select_nth_unstable_by(count, order);
            self.others_m = first_other.0.sqrt();
            self.kept = near.iter().map(|&(_, index)| index).collect();
        }
        self.from = *from;
    }
}
