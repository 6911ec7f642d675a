use proptest::prelude::*;

use super::*;
use crate::exploration_map::ExplorationMap;
use crate::path::{Graph, Moves, Neighbours};

/// A corridor along x with frontiers all along it, and its graph.
fn corridor(length: u32) -> (Extent, AbstractGraph) {
    let extent = Extent::new([length, 5, 5], 1.0).unwrap();
    let mut map = ExplorationMap::new(extent);
    let cells: Vec<u32> = (0..length as i32).map(|x| extent.index(Cell::new(x, 2, 2)).unwrap() as u32).collect();
    map.note_free(&cells);
    let mut graph = AbstractGraph::new(extent, 0.4);
    graph.update(Graph::new(&map, &Moves::new(0.4, extent.cell_m(), Neighbours::TwentySix)));
    (extent, graph)
}

fn at(x: i32) -> Cell {
    Cell::new(x, 2, 2)
}

fn presence(agent: u32, x: i32, free_in_s: f64, speed_m_s: f64) -> Presence {
    Presence { agent: AgentId(agent), cell: at(x), free_in_s, speed_m_s }
}

/// The cells along the corridor, in steps of a block, that an agent owns.
fn owned(own: u32, here: i32, others: &[Presence]) -> Vec<i32> {
    let (extent, graph) = corridor(100);
    let mut territories = Territories::new(AgentId(own), extent, 6.0);
    territories.divide(&graph, (at(here), 1.0), others);
    (0..20).map(|block| 5 * block + 2).filter(|&x| territories.is_own(&graph, at(x))).collect()
}

#[test]
fn regions_belong_to_the_agent_that_is_there_soonest() {
    let upto = |x: i32| (0..20).map(|block| 5 * block + 2).filter(|&at| at < x).collect::<Vec<_>>();
    assert_eq!(owned(0, 0, &[]), upto(100));
    assert_eq!(owned(0, 2, &[presence(1, 97, 0.0, 1.0)]), upto(50));
    assert_eq!(owned(0, 2, &[presence(1, 97, 40.0, 1.0)]), upto(70), "it is not free yet");
    assert_eq!(owned(0, 2, &[presence(1, 97, 0.0, 4.0)]), upto(21), "it is faster");
}

#[test]
fn clump_is_split_by_bearing() {
    // All at x = 50, with two bearings for three agents: what has one bearing stays together.
    let three: Vec<Presence> = (0..3).map(|agent| presence(agent, 50, 0.0, 1.0)).collect();
    let of = |own: u32| {
        let others: Vec<Presence> = three.iter().filter(|other| other.agent.0 != own).copied().collect();
        owned(own, 50, &others)
    };
    let all: BTreeSet<i32> = (0..3).flat_map(of).collect();
    assert_eq!(all.len(), 20, "everything has an owner");
}

proptest! {
    #[test]
    fn each_region_has_one_owner(
        places in prop::collection::vec((0i32..100, 0.0..60.0f64, 0.2..3.0f64), 1..6),
    ) {
        let (extent, graph) = corridor(100);
        let all: Vec<Presence> =
            (0..).zip(&places).map(|(agent, &(x, _, speed))| presence(agent, x, 0.0, speed)).collect();
        let clump_m = 0.0;
        for block in 0..20 {
            let cell = at(5 * block + 2);
            let owners = all.iter().filter(|own| {
                let others: Vec<Presence> = all.iter().filter(|other| other.agent != own.agent).copied().collect();
                let mut territories = Territories::new(own.agent, extent, clump_m);
                territories.divide(&graph, (own.cell, own.speed_m_s), &others);
                territories.is_own(&graph, cell)
            });
            prop_assert!(owners.count() <= 1);
        }
    }
}
