//! Territories: the Voronoi decomposition of the abstract graph by travel time, in which each
//! region belongs to the agent that can be there soonest.
//!
//! One search starts at once from where each agent that this one knows of is expected to be free
//! for another goal ([`Presence`]); the edges of the graph count in seconds at the speed of the
//! agent, so that rock and slow bodies count. An agent that is not heard of lapses with the lease
//! of its claim, and its regions fall to the others.
//!
//! Agents that start close together, a *clump*, would leave all regions to the lowest id. They
//! search as one, and share what they reach by bearing: the regions with frontiers, sorted by their
//! bearing from the middle of the clump, in equal parts, in the order of the ids.
//!
//! Invariants: every region that an agent can reach has one owner; agents with the same map and the
//! same presences agree on all owners. This module plans no motions.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet, BinaryHeap};

use msgs::ids::AgentId;
use voxels::{Cell, Extent};

use crate::abstract_graph::{AbstractGraph, Region, RegionId};
use crate::controllers::auction::Presence;

/// Search times are whole multiples of this fraction of a second, so that they have a total order.
const PER_S: f64 = 1024.0;

/// The regions of a map by owner, as one agent knows them.
#[derive(Debug)]
pub(super) struct Territories {
    own: AgentId,
    extent: Extent,
    /// Distance between agents within which they are a clump, metres.
    clump_m: f64,
    /// The regions of this agent.
    regions: BTreeSet<RegionId>,
}

/// How agents at one place share what is around them.
#[derive(Debug, Clone, PartialEq)]
struct Clump {
    /// The sum of their cells.
    sum: Cell,
    /// Their number.
    count: i32,
    /// The bearings at which the part of this agent begins and ends.
    part: (f64, f64),
}

impl Clump {
    /// The bearing of a cell from the middle of the clump, radians.
    fn bearing(&self, cell: Cell) -> f64 {
        let along = |at: i32, sum: i32| f64::from(at * self.count - sum);
        libm::atan2(along(cell.y, self.sum.y), along(cell.x, self.sum.x))
    }

    /// Whether a cell lies in the part of this agent.
    fn is_own(&self, cell: Cell) -> bool {
        let bearing = self.bearing(cell);
        self.part.0 <= bearing && bearing < self.part.1
    }
}

impl Territories {
    pub(super) fn new(own: AgentId, extent: Extent, clump_m: f64) -> Self {
        Self { own, extent, clump_m, regions: BTreeSet::new() }
    }

    /// Divides the map between this agent, which is at a cell and has a planning speed, and others.
    /// The graph must be up to date.
    pub(super) fn divide(&mut self, graph: &AbstractGraph, (here, speed_m_s): (Cell, f64), others: &[Presence]) {
        let own = Presence { agent: self.own, cell: here, free_in_s: 0.0, speed_m_s };
        let beside = |other: &&Presence| other.cell.distance(here) * self.extent.cell_m() <= self.clump_m;
        let mut clump: Vec<Presence> = others.iter().filter(beside).copied().chain([own]).collect();
        clump.sort_by_key(|presence| presence.agent);
        let lowest = clump.iter().map(|presence| presence.agent).min().unwrap_or(self.own);
        let sources = others.iter().chain([&own]).map(|presence| {
            let is_in_clump = clump.iter().any(|member| member.agent == presence.agent);
            (if is_in_clump { lowest } else { presence.agent }, presence)
        });
        let owners = self.search(graph, sources);
        let territory = owners.into_iter().filter(|&(_, owner)| owner == lowest);
        let territory: Vec<(RegionId, &Region)> = territory.filter_map(|(id, _)| Some((id, graph.get(id)?))).collect();
        self.regions = if clump.len() > 1 {
            let clump = self.part_of(&territory, &clump);
            let own = territory.into_iter().filter(|(_, region)| clump.is_own(region.centre));
            own.map(|(id, _)| id).collect()
        } else {
            territory.into_iter().map(|(id, _)| id).collect()
        };
    }

    /// The owners of all regions that can be reached.
    fn search<'p>(
        &self,
        graph: &AbstractGraph,
        sources: impl Iterator<Item = (AgentId, &'p Presence)>,
    ) -> BTreeMap<RegionId, AgentId> {
        // Time, owner, region, and the speed of the owner.
        let mut queue: BinaryHeap<Reverse<(u64, AgentId, RegionId, u64)>> = BinaryHeap::new();
        for (owner, presence) in sources {
            if let Some(region) = graph.region_of(presence.cell) {
                let free_at = (presence.free_in_s * PER_S) as u64;
                queue.push(Reverse((free_at, owner, region, presence.speed_m_s.to_bits())));
            }
        }
        let mut owners = BTreeMap::new();
        while let Some(Reverse((time, owner, id, speed))) = queue.pop() {
            let Some(region) = graph.get(id) else { continue };
            if owners.contains_key(&id) {
                continue;
            }
            owners.insert(id, owner);
            for beside in graph.adjacent(id) {
                if owners.contains_key(&beside) {
                    continue;
                }
                let Some(next) = graph.get(beside) else { continue };
                let length_m = region.centre.distance(next.centre) * self.extent.cell_m();
                let leg = (length_m / f64::from_bits(speed) * PER_S) as u64;
                queue.push(Reverse((time + leg, owner, beside, speed)));
            }
        }
        owners
    }

    /// The part of this agent in the territory of its clump.
    fn part_of(&self, territory: &[(RegionId, &Region)], members: &[Presence]) -> Clump {
        let sum = members.iter().fold(Cell::default(), |sum, member| sum + member.cell);
        let mut clump = Clump { sum, count: members.len() as i32, part: (f64::NEG_INFINITY, f64::INFINITY) };
        let open = territory.iter().filter(|(_, region)| !region.frontiers.is_empty());
        let mut bearings: Vec<f64> = open.map(|(_, region)| clump.bearing(region.centre)).collect();
        bearings.sort_by(f64::total_cmp);
        let place = members.iter().take_while(|member| member.agent < self.own).count();
        let cut = |place: usize| bearings.get(place * bearings.len() / members.len()).copied();
        let begins = if place == 0 { f64::NEG_INFINITY } else { cut(place).unwrap_or(f64::INFINITY) };
        let ends = if place + 1 == members.len() { f64::INFINITY } else { cut(place + 1).unwrap_or(f64::INFINITY) };
        clump.part = (begins, ends);
        clump
    }

    /// Whether a region belongs to this agent.
    pub(super) fn owns(&self, region: RegionId) -> bool {
        self.regions.contains(&region)
    }

    /// Whether the region of a cell belongs to this agent.
    pub(super) fn is_own(&self, graph: &AbstractGraph, cell: Cell) -> bool {
        graph.region_listing(cell).is_some_and(|region| self.owns(region))
    }
}

#[cfg(test)]
mod tests;
