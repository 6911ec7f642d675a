use nalgebra::Point3;
use proptest::prelude::*;

use super::super::gain::{GainEstimator, Likelihood};
use super::super::relocation::Sight;
use super::super::tasks::{Candidate, Viewpoints};
use super::super::with_team;
use super::*;
use crate::settings::Settings;
use crate::testing::World as SmallWorld;
use agent::abstract_graph::ShortestPaths;
use agent::bodies::BodyKind;
use agent::exploration_map::{CellState, Change, Delta, ExplorationMap, Finding};
use agent::observation::Contact;
use agent::path::{Graph, Moves, Neighbours};
use msgs::ids::AgentId;
use std::collections::BTreeSet;
use voxels::{Cell, Extent};

const RANGE_CELLS: f64 = 5.0;

/// The regions with frontiers of a map, as seen from a cell, and the graph.
fn candidates(map: &ExplorationMap, here: Cell) -> (AbstractGraph, Vec<Candidate>) {
    let extent = map.extent();
    let mut graph = AbstractGraph::new(extent, 0.4);
    graph.update(Graph::new(map, &Moves::new(0.4, extent.cell_m(), Neighbours::TwentySix)));
    let mut paths = ShortestPaths::default();
    let mut found = Vec::new();
    paths.begin(&graph, here);
    while let Some((id, region, _)) = paths.next(&graph) {
        found.extend(Candidate::new(&graph, Sight::everywhere(map), (id, region), here, &BTreeSet::new()));
    }
    (graph, found)
}

fn tasks(viewpoints: &mut Viewpoints, map: &ExplorationMap, here: Cell, expected_min: f64) -> Vec<Task> {
    let mut gain_estimator = GainEstimator::new(100, RANGE_CELLS, 3, Likelihood::new(1.0));
    viewpoints.tasks(map, &mut gain_estimator, &candidates(map, here).1, &|cell| cell == here, expected_min)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn tasks_do_not_depend_on_what_was_seen_before(
        reports in prop::collection::vec((0..30_i32, 0..12_i32, 0..12_i32, 1..6_i32, 0..8_u8), 1..12),
        expected_min in 0.5..6.0_f64,
    ) {
        let extent = Extent::new([30, 12, 12], 1.0).unwrap();
        let here = Cell::new(15, 6, 6);
        let mut map = ExplorationMap::new(extent);
        map.note_free(&[extent.index(here).unwrap() as u32]);
        let mut kept = Viewpoints::new(extent);
        for (x, y, z, side, kind) in reports {
            // A box of free cells or walls.
            let cells = extent.cells().filter(|cell| {
                [cell.x - x, cell.y - y, cell.z - z].iter().all(|by| (0..side).contains(by)) && *cell != here
            });
            let indices: Vec<u32> = cells.map(|cell| extent.index(cell).unwrap() as u32).collect();
            let report =
                |finding| Delta::of(extent, indices.iter().map(|&cell| Change { cell, finding, from: None }));
            match kind {
                0 => map.note_wall(&indices),
                1 => map.merge(&report(Finding::Wall), AgentId(1)),
                2 | 3 => map.merge(&report(Finding::Free), AgentId(1)),
                _ => map.note_free(&indices),
            }
            let found = tasks(&mut kept, &map, here, expected_min);
            prop_assert_eq!(&found, &tasks(&mut Viewpoints::new(extent), &map, here, expected_min));
            // What has been chosen for its gain adds no more than what was chosen before it.
            let gains: Vec<f64> = found.iter().map(|task| task.expected_cells).collect();
            let chosen = gains.iter().take_while(|&&gain| gain > expected_min).count();
            prop_assert!(gains[..chosen].is_sorted_by(|a, b| a >= b), "{gains:?}");
        }
    }
}

#[test]
fn one_viewpoint_is_enough_for_what_it_sees() {
    // An open space of which one layer is known: all of its frontiers see the same cells.
    let extent = Extent::new([9, 9, 5], 1.0).unwrap();
    let mut map = ExplorationMap::new(extent);
    let layer: Vec<u32> = (0..81).collect();
    map.note_free(&layer);
    let (_, regions) = candidates(&map, Cell::new(0, 0, 0));
    // The centre of each region sees more than that.
    const EXPECTED_MIN: f64 = 20.0;
    let of = |regions: &[Candidate]| {
        let mut gain_estimator = GainEstimator::new(100, RANGE_CELLS, 3, Likelihood::new(1.0));
        let mut viewpoints = Viewpoints::new(extent);
        let tasks = viewpoints.tasks(&map, &mut gain_estimator, regions, &|_| false, EXPECTED_MIN);
        tasks.iter().filter(|task| task.expected_cells >= EXPECTED_MIN).count()
    };
    assert!(regions.len() > 1 && regions.iter().all(|&region| of(&[region]) == 1));
    assert_eq!(of(&regions), 1);
}

/// A corridor with an unexplored opening at each end, and what an agent in its middle says.
fn choice(contacts: &[(u32, f64)]) -> String {
    let mut drawing = vec!["#".repeat(45); 3];
    drawing[1] = format!("?????{}?????", ".".repeat(35));
    let middle = Cell::new(21, 1, 0);
    let mut world = SmallWorld::known(&drawing.join("\n"), middle);
    world.observation.scan_tick = Some(world.observation.tick);
    let contact = |&(agent, x)| Contact { agent: AgentId(agent), position: Point3::new(x, 1.5, 0.5) };
    world.observation.contacts = contacts.iter().map(contact).collect();
    let mut controller = with_team(&mut Settings::default(), world.setup()).unwrap();
    world.ask(&mut controller).info
}

#[test]
fn leaves_to_others_what_they_are_nearer_to() {
    let [low, high] = [choice(&[(1, 38.5)]), choice(&[(1, 6.5)])];
    assert!(low.contains("to (5, 1, 0)"), "the other agent is at the high end: {low}");
    assert!(high.contains("to (39, 1, 0)"), "the other agent is at the low end: {high}");
}

#[test]
fn settings_are_checked() {
    let built = |setting: &str| {
        let mut settings = Settings::parse(&[setting.to_owned()]).unwrap();
        with_team(&mut settings, SmallWorld::empty().setup()).map(drop)
    };
    let allowed =
        ["regions=1", "tasks=1", "exponent=0", "latency_weight=0", "memory_s=0", "scan_start_m=0", "scan_stop_m=0"];
    assert!(allowed.into_iter().all(|setting| built(setting).is_ok()));
    let refused = ["regions=0", "tasks=0", "exponent=-1", "leg_s=101", "scan_start_m=-1", "scan_stop_m=-1"];
    assert!(refused.into_iter().all(|setting| built(setting).is_err()));
}

#[test]
fn explores_with_one_task_or_region_at_a_time() {
    let rooms = "
################
#......#.......#
#......#.......#
#..............#
#......#.......#
################";
    for setting in ["tasks=1", "regions=1"] {
        let mut world = SmallWorld::new(rooms.trim_start(), Cell::new(1, 1, 0));
        let mut settings = Settings::parse(&[setting.to_owned()]).unwrap();
        let mut controller = with_team(&mut settings, world.setup()).unwrap();
        world.run(&mut controller, 2000);
        assert_eq!(world.left(&[CellState::Free, CellState::Covered]), [], "{setting}");
    }
}

#[test]
fn aerial_bodies_have_settings_of_their_own() {
    let texts = ["leg_s=9".to_owned(), "aerial_leg_s=2".to_owned()];
    let params = TeamParams::from_settings(&mut Settings::parse(&texts).unwrap()).unwrap();
    let of = |kind| (params.of(kind).leg_s, params.of(kind).latency_weight, params.of(kind).tasks);
    assert_eq!([of(BodyKind::Submarine), of(BodyKind::Aerial)], [(9.0, 5.0, 40), (2.0, 0.5, 90)]);
}
