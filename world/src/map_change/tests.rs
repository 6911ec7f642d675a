use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::TAU;
use std::sync::Arc;

use msgs::ids::Tick;
use proptest::prelude::*;
use protocol::body_model::BodyModel;
use protocol::command::Command;
use protocol::observation::RequestKind;
use protocol::scan_request::ScanRequest;
use protocol::wake_condition::WakeCondition;
use voxels::Grid;

use super::super::WorldParams;
use super::super::body::{Motion, Pose};
use super::super::comms::{Comms, ContactModel};
use super::super::lidar::{Pattern, Scanner};
use super::*;
use crate::workers::Workers;

const A: AgentId = AgentId(0);
const B: AgentId = AgentId(1);

/// Two rooms of 3 x 3 x 1 cells with a door at (4, 2, 1).
fn two_rooms() -> Grid<Terrain> {
    let solid = "#########\n#########\n#########\n#########\n#########\n";
    let layer = "#########\n#...#...#\n#.......#\n#...#...#\n#########\n";
    Grid::from_text(&[solid, layer, solid].join("\n")).unwrap()
}

fn params(rays: u32) -> WorldParams {
    WorldParams::new(
        BodyModel::default(),
        Scanner::new(Pattern::Lattice { rays }, f64::INFINITY, TAU),
        Comms::perfect(ContactModel::LineOfSightAndRange { range_m: f64::INFINITY }),
    )
}

fn at(x: f64, y: f64) -> Pose {
    Pose { position: Point3::new(x, y, 1.5), yaw_rad: 0.0 }
}

fn change(terrain: Terrain, low: [f64; 3], high: [f64; 3]) -> MapChange {
    MapChange { terrain, low: low.into(), high: high.into(), trigger: None }
}

/// A change of the door of [`two_rooms`].
fn door(terrain: Terrain) -> MapChange {
    change(terrain, [4.0, 2.0, 1.0], [5.0, 3.0, 2.0])
}

fn index(world: &World, cell: [i32; 3]) -> u32 {
    world.terrain().extent().index(Cell::new(cell[0], cell[1], cell[2])).unwrap() as u32
}

fn go(world: &mut World, agent: AgentId, to: Pose) {
    let motion = Motion::Path(vec![to.position]);
    let action = Command::new(motion, WakeCondition::NEXT_TICK);
    world.step([(agent, action)].into());
    while world.body(agent).is_active() {
        world.step(BTreeMap::new());
    }
}

/// Changes the map; returns how many cells have changed.
fn apply(world: &mut World, change: &MapChange) -> u32 {
    change.cells(world.terrain().extent()).map_or(0, |cells| world.change_map(cells, change.terrain))
}

/// Sets the cells of a box.
fn set_cells(terrain: &mut Grid<Terrain>, cells: CellBox, kind: Terrain) {
    cells.cells().for_each(|cell| {
        terrain.set(cell, kind);
    });
}

#[test]
fn box_has_the_cells_with_their_centres_in_it() {
    let extent = Extent::new([10, 8, 5], 0.5).unwrap();
    let cells = |low, high| change(Terrain::Wall, low, high).cells(extent);
    let found = cells([1.2, 0.25, 0.7], [1.8, 1.3, 0.8]).unwrap();
    assert_eq!((found.low, found.high), (Cell::new(2, 1, 1), Cell::new(3, 2, 1)));
    assert_eq!(found.cells().count(), 4);
    let all = cells([-1e9; 3], [f64::INFINITY; 3]).unwrap();
    assert_eq!((all.low, all.high), (Cell::new(1, 1, 1), Cell::new(8, 6, 3)), "without the outermost layer");
    assert_eq!(cells([0.0; 3], [0.5; 3]), None);
    assert_eq!(cells([1.3; 3], [1.7, 1.2, 1.7]), None);
}

#[test]
fn closed_door_is_seen_counted_and_seen_open_again() {
    let workers = Workers::new(1).unwrap();
    let mut world = World::new(two_rooms(), params(2000), &[at(2.5, 2.5)]);
    world.sense(&workers);
    assert!(world.observe(A, RequestKind::Scheduled).seen.free.contains(&index(&world, [4, 2, 1])));
    let before = world.coverage().explored_count();
    assert!(before > 10 && world.coverage().free_cells() == 19);

    world.step(BTreeMap::new());
    assert!(world.is_due(&door(Terrain::Wall)));
    assert_eq!(apply(&mut world, &door(Terrain::Wall)), 1);
    assert_eq!(apply(&mut world, &door(Terrain::Wall)), 0, "it is closed already");
    assert_eq!((world.coverage().free_cells(), world.coverage().explored_count()), (18, before - 1));
    assert_eq!(world.coverage().explored_by(), [(before - 1) as f64 / 18.0]);
    assert_eq!(world.events(A, EventMask::empty()), EventMask::empty(), "no message announces it");
    for _ in 0..10 {
        world.step(BTreeMap::new());
        world.sense(&workers);
    }
    assert_eq!(world.events(A, EventMask::empty()), EventMask::REVISED, "the next scan of the resting body sees it");
    let observation = world.observe(A, RequestKind::Scheduled);
    assert_eq!(observation.seen.wall, [index(&world, [4, 2, 1])]);
    assert!(observation.seen.free.is_empty() && observation.events.contains(EventMask::REVISED));

    world.step(BTreeMap::new());
    apply(&mut world, &door(Terrain::Free));
    assert_eq!(world.coverage().explored_count(), before - 1, "it counts once it is seen");
    for _ in 0..10 {
        world.step(BTreeMap::new());
        world.sense(&workers);
    }
    let observation = world.observe(A, RequestKind::Scheduled);
    assert_eq!(observation.seen.free, [index(&world, [4, 2, 1])], "what is behind it was seen before");
    assert_eq!((world.coverage().free_cells(), world.coverage().explored_count()), (19, before));
    assert_eq!(world.map_revision(), 2);
}

#[test]
fn change_waits_for_bodies_in_its_cells() {
    let mut world = World::new(two_rooms(), params(100), &[at(4.5, 2.5), at(2.5, 2.5)]);
    assert!(!world.is_due(&door(Terrain::Wall)), "a body is in the door");
    assert!(world.is_due(&door(Terrain::Free)));
    go(&mut world, A, at(5.3, 2.5));
    assert!(!world.is_due(&door(Terrain::Wall)), "a part of it is");
    go(&mut world, A, at(6.5, 2.5));
    assert!(world.is_due(&door(Terrain::Wall)));
    apply(&mut world, &door(Terrain::Wall));
    go(&mut world, A, at(2.5, 2.5));
    assert!(world.body(A).collision().is_some() && world.body(A).pose().position.x > 5.3);
    assert!(world.in_contact_with(A).is_empty(), "radios do not see through it");
    apply(&mut world, &door(Terrain::Free));
    go(&mut world, A, at(6.5, 2.5));
    assert_eq!(world.in_contact_with(A), [B]);
}

#[test]
fn change_waits_for_an_agent_to_come_near() {
    let mut world = World::new(two_rooms(), params(100), &[at(1.5, 1.5), at(7.5, 3.5)]);
    let near = |within_m, agent| MapChange { trigger: Some(Proximity { within_m, agent }), ..door(Terrain::Wall) };
    assert!(!world.is_due(&near(1.0, None)));
    assert!(world.is_due(&near(2.6, Some(B))), "its cells begin 2.5 m from the body");
    go(&mut world, A, at(3.5, 2.5));
    assert!(world.is_due(&near(1.0, None)) && world.is_due(&near(1.0, Some(A))));
    assert!(!world.is_due(&near(1.0, Some(B))));
}

#[test]
fn what_a_collapse_cuts_off_cannot_be_attained() {
    let workers = Workers::new(1).unwrap();
    let mut world = World::new(two_rooms(), params(100), &[at(1.5, 1.5)]);
    assert!(world.attainable().is_none(), "thin bodies get everywhere");
    assert!(world.is_anything_left());
    apply(&mut world, &door(Terrain::Wall));
    assert_eq!(world.attainable().unwrap().seen().len(), 9);
    let look = |world: &mut World| {
        world.sense(&workers);
        for to in [at(2.5, 2.5), at(3.5, 3.5), at(1.5, 3.5), at(3.5, 1.5)] {
            go(world, A, to);
            while !world.tick().0.is_multiple_of(10) {
                world.step(BTreeMap::new());
            }
            world.sense(&workers);
        }
    };
    look(&mut world);
    assert!(!world.is_anything_left() && !world.coverage().is_explored());
    apply(&mut world, &door(Terrain::Free));
    assert!(world.is_anything_left());
}

#[test]
fn milestone_that_is_no_longer_reached_is_open_again() {
    let workers = Workers::new(1).unwrap();
    let mut terrain = two_rooms();
    let extent = terrain.extent();
    set_cells(&mut terrain, door(Terrain::Wall).cells(extent).unwrap(), Terrain::Wall);
    let rooms = change(Terrain::Wall, [5.0, 1.0, 1.0], [8.0, 4.0, 2.0]);
    set_cells(&mut terrain, rooms.cells(extent).unwrap(), Terrain::Wall);
    let mut world = World::new(terrain, params(2000), &[at(2.5, 2.5)]);
    world.sense(&workers);
    assert!(world.coverage().is_explored() && world.coverage().milestones().count() == 5);
    apply(&mut world, &MapChange { terrain: Terrain::Free, ..rooms });
    assert_eq!((world.coverage().free_cells(), world.coverage().milestones().count()), (18, 1));
    apply(&mut world, &rooms);
    let reached: Vec<_> = world.coverage().milestones().collect();
    assert_eq!((reached.len(), reached[4]), (5, (1000, Tick::ZERO)));
}

/// Cells by index, with the state in which a sensor found them last.
type Known = BTreeMap<u32, Terrain>;

fn with_state(cells: Vec<u32>, terrain: Terrain) -> impl Iterator<Item = (u32, Terrain)> {
    cells.into_iter().map(move |cell| (cell, terrain))
}

/// Adds the observation of an agent to what it knows.
fn learn(known: &mut Known, world: &mut World, agent: AgentId) {
    let observation = world.observe(agent, RequestKind::Scheduled);
    known.extend(with_state(observation.seen.free, Terrain::Free));
    known.extend(with_state(observation.seen.wall, Terrain::Wall));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// With culling (from 1000 rays on), scans ahead and helpers, an agent knows after every change
    /// what one knows whose sensor casts every ray of every scan and keeps no memory; and what
    /// counts as explored is what a recount counts.
    #[test]
    fn scans_after_changes_are_those_of_a_naive_sensor(
        walls in prop::collection::vec(prop::bool::weighted(0.25), 8 * 7 * 4),
        rays in prop_oneof![Just(300_u32), Just(1200)],
        threads in 1_usize..3,
        steps in prop::collection::vec(
            (any::<bool>(), prop::array::uniform3(1.0..8.0), prop::array::uniform3(0.0..4.0), prop::array::uniform3(1.1..7.9)),
            1..12,
        ),
    ) {
        let extent = Extent::new([10, 9, 6], 1.0).unwrap();
        let mut terrain = Grid::new(extent, Terrain::Wall);
        let inner = change(Terrain::Free, [0.0; 3], [10.0; 3]).cells(extent).unwrap();
        for (cell, is_wall) in inner.cells().zip(walls) {
            terrain.set(cell, if is_wall { Terrain::Wall } else { Terrain::Free });
        }
        let starts = [at(1.5, 1.5), at(8.5, 7.5)];
        starts.iter().for_each(|start| { terrain.set(extent.cell_of(&start.position), Terrain::Free); });
        let params = params(rays);
        let scanner = params.sensors.lidars()[0].scanner.clone();
        let workers = Arc::new(Workers::new(threads).unwrap());
        let mut world = World::new(terrain, params, &starts);
        world.defer_scans();
        let [mut known, mut naive, mut naive_pending]: [[Known; 2]; 3] = Default::default();
        let mut explored: [BTreeSet<u32>; 2] = Default::default();
        for (is_wall, low, size, goal) in steps {
            for (agent, goal) in [(A, goal), (B, [goal[1], goal[0], goal[2]])] {
                let motion = Motion::Path(vec![Point3::new(goal[0], goal[1], goal[2].min(4.9))]);
                let action = Command { lidar: ScanRequest::Every(3), ..Command::new(motion, WakeCondition::NEXT_TICK) };
                world.step([(agent, action)].into());
            }
            world.cast_ahead(&workers);
            for _ in 0..40 {
                world.sense(&workers);
                for (agent, naive) in [A, B].into_iter().zip(&mut naive_pending) {
                    if let Some((pose, tick)) = world.last_scan(agent) && tick == world.tick() {
                        let fresh = crate::lidar::SensorMemory::new(world.terrain());
                        let view = scanner.view(&fresh, &pose);
                        explored[agent.index()].extend(&view.free);
                        naive.extend(with_state(view.free, Terrain::Free));
                        naive.extend(with_state(view.wall, Terrain::Wall));
                    }
                }
                world.step(BTreeMap::new());
            }
            let terrain = if is_wall { Terrain::Wall } else { Terrain::Free };
            let high = [0, 1, 2].map(|axis: usize| low[axis] + size[axis]);
            let box_of_cells = change(terrain, low, high);
            // One of them has its observation before the change, the other one later.
            let informed = if is_wall { A } else { B };
            learn(&mut known[informed.index()], &mut world, informed);
            naive[informed.index()].append(&mut naive_pending[informed.index()]);
            world.flush_scans();
            if world.is_due(&box_of_cells) {
                let before = world.terrain().clone();
                apply(&mut world, &box_of_cells);
                let is_changed = |cell: &u32| before[*cell as usize] != world.terrain()[*cell as usize];
                explored.iter_mut().for_each(|cells| cells.retain(|cell| !is_changed(cell)));
                naive_pending.iter_mut().for_each(|cells| cells.retain(|cell, _| !is_changed(cell)));
            }
            let team: BTreeSet<u32> = explored.iter().flatten().copied().collect();
            prop_assert_eq!(world.coverage().explored_count(), team.len());
            let free = world.terrain().as_slice().iter().filter(|&&cell| cell == Terrain::Free).count();
            prop_assert_eq!(world.coverage().free_cells(), free);
            let by: Vec<f64> = explored.iter().map(|cells| cells.len() as f64 / free as f64).collect();
            prop_assert_eq!(world.coverage().explored_by(), by);
            for agent in [A, B] {
                let cell = extent.cell_of(&world.body(agent).pose().position);
                prop_assert_eq!(world.terrain().get(cell), Some(&Terrain::Free), "a body is inside a wall");
            }
        }
        for agent in [A, B] {
            let at = agent.index();
            learn(&mut known[at], &mut world, agent);
            naive[at].append(&mut naive_pending[at]);
            prop_assert_eq!(&known[at], &naive[at]);
        }
    }
}
