//! Agents that join late, break down or leave, and radios that are switched off.

use super::*;

/// Two agents in contact in a hall; the second one joins late.
fn with_late_agent() -> World {
    let params = WorldParams { late: [B].into(), ..params() };
    World::new(hall([6, 3, 3]), params, &[at(1.5, 1.5, 1.5), at(3.5, 1.5, 1.5)])
}

#[test]
fn late_agents_are_not_there_before() {
    let workers = workers(1);
    let mut world = with_late_agent();
    assert_eq!(world.coverage().covered(), 1.0 / 54.0);
    world.sense(&workers);
    assert!(world.observe(B, RequestKind::Scheduled).scan_tick.is_none() && world.in_contact_with(A).is_empty());
    // Through its place, and into it.
    world.step([(A, command(Motion::Path(vec![Point3::new(3.5, 1.5, 1.5)])))].into());
    while world.body(A).is_active() {
        world.step(BTreeMap::new());
    }
    assert_eq!((world.totals().collisions, world.presence(B)), (0, Presence::Absent));
    assert!(!world.join(B), "another body is in its place");
    world.step([(A, command(Motion::Path(vec![Point3::new(1.5, 1.5, 1.5)])))].into());
    while !world.join(B) {
        world.step(BTreeMap::new());
    }
    let apart_m = (world.body(A).pose().position - world.body(B).pose().position).norm();
    assert!(apart_m >= 2.0 * BodyModel::default().radius_m, "{apart_m}");
    world.sense(&workers);
    assert_eq!(world.observe(B, RequestKind::Scheduled).scan_tick, Some(world.tick()), "it scans at once");
    assert_eq!((world.in_contact_with(A), world.presence(B)), (vec![B], Presence::Active));
}

#[test]
fn late_agents_may_join_elsewhere() {
    let workers = workers(1);
    let mut world = with_late_agent();
    assert!(world.join_at(B, at(1.5, 1.5, 1.5)).is_err(), "another body is there");
    assert!(world.join_at(B, at(-1.0, 1.5, 1.5)).is_err(), "outside the map");
    assert_eq!(world.presence(B), Presence::Absent, "what fails changes nothing");
    assert_eq!(world.body(B).pose().position.x, 3.5);
    world.join_at(B, at(4.5, 1.5, 1.5)).expect("there is room");
    assert_eq!((world.presence(B), world.body(B).pose().position.x), (Presence::Active, 4.5));
    assert_eq!(world.coverage().covered(), 2.0 / 54.0, "the cell where it joined counts, its start does not");
    world.sense(&workers);
    assert_eq!(world.observe(B, RequestKind::Scheduled).pose.position.x, 4.5);
    assert_eq!(world.in_contact_with(A), vec![B]);
}

/// The floor below the place of an agent goes while it is not there.
#[test]
fn bodies_that_are_not_there_do_not_fall() {
    let workers = workers(1);
    let mut terrain = hall([6, 3, 5]);
    let floor = Cell { x: 4, y: 2, z: 2 };
    let index = terrain.extent().index(floor).unwrap();
    terrain[index] = Terrain::Wall;
    let ground = BodyModel { radius_m: 0.3, ..BodyModel::of(BodyKind::Ground) };
    let params = WorldParams { late: [B].into(), body: ground, ..params() };
    let mut world = World::new(terrain, params, &[at(1.5, 1.5, 1.5), at(4.5, 2.5, 3.5)]);
    let start = world.body(B).pose().position;
    world.sense(&workers);
    world.flush_scans();
    assert_eq!(world.change_map(map_change::CellBox { low: floor, high: floor }, Terrain::Free), 1);
    for _ in 0..100 {
        world.step(BTreeMap::new());
    }
    assert_eq!((world.body(B).pose().position, world.distance_m()[1]), (start, 0.0));
    assert!(world.join(B), "it stands on the floor that is there now");
    let joined = world.body(B).pose().position;
    assert_eq!((joined.x, joined.y), (start.x, start.y));
    assert!(joined.z < start.z - 1.0, "{joined}");
}

#[test]
fn broken_bodies_are_silent_obstacles_and_those_that_left_are_none() {
    let workers = workers(1);
    let towards = |world: &mut World| {
        world.step([(A, command(endless(0.0)))].into());
        while world.body(A).is_active() {
            world.step(BTreeMap::new());
        }
        (world.body(A).pose().position.x, world.body(A).collision().expect("it has met something").with_agent)
    };
    let mut world = with_late_agent();
    assert!(world.join(B));
    world.step([(B, command(Motion::Turn { angle_rad: 3.0 }))].into());
    world.break_down(B);
    assert!(!world.body(B).is_active() && world.in_contact_with(A).is_empty() && !world.is_on_air(B));
    let (x, is_agent) = towards(&mut world);
    assert!(is_agent && x < 3.5, "{x}");
    world.sense(&workers);
    assert!(world.observe(B, RequestKind::Scheduled).scan_tick.is_none());
    world.leave(B);
    let (x, is_agent) = towards(&mut world);
    assert!(!is_agent && x > 5.0, "{x}");
}

#[test]
fn silent_radios_have_no_contacts() {
    let mut world = with_late_agent();
    assert!(world.join(B));
    let send = |world: &mut World| {
        let message = |peer| AgentMessage { peer, kind: 7, data: vec![1].into() };
        let messages = vec![message(Peer::One(B)), message(Peer::Broadcast)];
        world.step([(A, Command { messages, ..command(Motion::Keep) })].into());
        world.observe(B, RequestKind::Scheduled).messages.len()
    };
    assert_eq!(send(&mut world), 2);
    for silent in [A, B] {
        world.switch_radio(silent, false);
        assert_eq!((send(&mut world), world.in_contact_with(A), world.in_contact_with(B)), (0, vec![], vec![]));
        world.switch_radio(silent, true);
    }
    assert_eq!(send(&mut world), 2);
}
