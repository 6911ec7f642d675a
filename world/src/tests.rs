mod presence;
mod seen_agents;
mod suites;

use std::f64::consts::{PI, TAU};

use nalgebra::Vector3;
use proptest::prelude::*;
use voxels::Extent;

use super::body::Motion;
use protocol::agent_message::{AgentMessage, Peer};
use protocol::body_model::{BodyKind, BodyModel};
use protocol::observation::RequestKind;
use protocol::wake_condition::WakeCondition;

use super::comms::{Comms, ContactModel};
use super::lidar::{Pattern, Scanner};
use super::noise::SensorNoise;
use protocol::event_mask::EventMask;
use protocol::limits::AGENT_MESSAGE_BYTES_MAX;

use super::*;

fn workers(threads: usize) -> Arc<Workers> {
    Arc::new(Workers::new(threads).unwrap())
}

/// Contact in line of sight within a range.
fn within(range_m: f64) -> Comms {
    Comms::perfect(ContactModel::LineOfSightAndRange { range_m })
}

fn params() -> WorldParams {
    WorldParams::new(
        BodyModel::default(),
        Scanner::new(Pattern::Lattice { rays: 500 }, f64::INFINITY, TAU),
        within(f64::INFINITY),
    )
}

/// A closed hall of the given inner size.
fn hall(inner: [u32; 3]) -> Grid<Terrain> {
    let extent = Extent::new(inner.map(|cells| cells + 2), 1.0).unwrap();
    let mut terrain = Grid::new(extent, Terrain::Free);
    voxels::close_shell(&mut terrain, 1);
    terrain
}

/// Two rooms with a door (`.` in the middle of the wall).
fn two_rooms() -> Grid<Terrain> {
    let solid = "#########\n#########\n#########\n#########\n#########\n";
    let layer = "#########\n#...#...#\n#.......#\n#...#...#\n#########\n";
    Grid::from_text(&[solid, layer, solid].join("\n")).unwrap()
}

fn at(x: f64, y: f64, z: f64) -> Pose {
    Pose { position: Point3::new(x, y, z), yaw_rad: 0.0 }
}

fn command(motion: Motion) -> Command {
    Command::new(motion, WakeCondition::NEXT_TICK)
}

fn endless(pitch_rad: f64) -> Motion {
    Motion::Move { pitch_rad, distance_m: f64::INFINITY }
}

const A: AgentId = AgentId(0);
const B: AgentId = AgentId(1);

#[test]
fn first_scan_explores_a_hall() {
    let workers = workers(1);
    let mut world = World::new(hall([5, 4, 3]), params(), &[at(3.5, 3.5, 2.5)]);
    assert_eq!(world.coverage().explored(), 0.0);
    assert_eq!(world.coverage().covered(), 1.0 / 60.0);
    world.sense(&workers);
    assert!(world.coverage().is_explored());
    assert_eq!(world.coverage().explored(), 1.0);
    let observation = world.observe(A, RequestKind::Scheduled);
    assert_eq!(observation.seen.free.len(), 60);
    assert!(observation.seen.free.is_sorted() && observation.seen.wall.is_sorted());
    assert_eq!(observation.scan_tick, Some(Tick::ZERO));
    let again = world.observe(A, RequestKind::Scheduled);
    assert!(again.seen.free.is_empty() && again.seen.wall.is_empty());
}

#[test]
fn scan_schedule_follows_scenario_and_requests() {
    let workers = workers(1);
    let mut world = World::new(hall([5, 4, 3]), params(), &[at(3.5, 3.5, 2.5)]);
    let scan_ticks = |world: &mut World, request: Option<ScanRequest>, ticks: u64| -> Vec<u64> {
        let first = world.tick().0;
        (first..first + ticks)
            .filter(|&tick| {
                world.sense(&workers);
                let scanned = world.observe(A, RequestKind::Scheduled).scan_tick == Some(Tick(tick));
                let lidar = if tick == first { request.unwrap_or_default() } else { ScanRequest::Keep };
                world.step([(A, Command { lidar, ..command(Motion::Keep) })].into());
                scanned
            })
            .collect()
    };
    assert_eq!(scan_ticks(&mut world, None, 21), [0, 10, 20]);
    assert_eq!(scan_ticks(&mut world, Some(ScanRequest::Every(4)), 9), [22, 26]);
    assert_eq!(scan_ticks(&mut world, Some(ScanRequest::Never), 20), [30]);
    assert_eq!(scan_ticks(&mut world, Some(ScanRequest::Once), 20), [51]);
    // The body has not moved: only its first scan had to be cast.
    assert_eq!((world.totals().scans.due(), world.totals().scans.cast()), (7, 1));
}

#[test]
fn one_agent_scans_per_tick_in_turn() {
    let workers = workers(1);
    let turns = WorldParams { schedule: ScanSchedule::TakeTurns, ..params() };
    let mut world = World::new(hall([5, 4, 3]), turns, &[at(1.5, 1.5, 1.5), at(3.5, 3.5, 1.5)]);
    for tick in 0..6 {
        world.sense(&workers);
        let scanned = [A, B].map(|agent| world.observe(agent, RequestKind::Scheduled).scan_tick == Some(Tick(tick)));
        assert_eq!(scanned, [tick % 2 == 0, tick % 2 == 1]);
        world.step([(A, Command { lidar: ScanRequest::Never, ..command(Motion::Keep) })].into());
    }
}

#[test]
fn scans_do_not_depend_on_threads() {
    let starts = [at(1.5, 1.5, 1.5), at(3.5, 2.5, 1.5), at(7.5, 2.5, 1.5)];
    let seen = |threads| {
        let workers = workers(threads);
        let mut world = World::new(two_rooms(), params(), &starts);
        world.sense(&workers);
        [0, 1, 2].map(|agent| world.observe(AgentId(agent), RequestKind::Scheduled))
    };
    assert_eq!(seen(1), seen(2));
    assert_eq!(seen(1), seen(8));
}

#[test]
fn walls_and_range_end_contact() {
    let starts = [at(1.5, 1.5, 1.5), at(6.5, 1.5, 1.5), at(7.5, 3.5, 1.5)];
    let contacts = |range_m| {
        let params = WorldParams { comms: within(range_m), ..params() };
        let mut world = World::new(two_rooms(), params, &starts);
        [0, 1, 2].map(|agent| {
            let contacts = world.observe(AgentId(agent), RequestKind::Scheduled).contacts;
            contacts.into_iter().map(|contact| contact.agent.0).collect::<Vec<_>>()
        })
    };
    // Through the door only the third one is seen from the first.
    assert_eq!(contacts(f64::INFINITY), [vec![2], vec![2], vec![0, 1]]);
    assert_eq!(contacts(3.0), [vec![], vec![2], vec![1]]);
}

#[test]
fn messages_reach_agents_in_contact() {
    let starts = [at(1.5, 1.5, 1.5), at(6.5, 1.5, 1.5), at(7.5, 3.5, 1.5)];
    let mut world = World::new(two_rooms(), params(), &starts);
    let message = |peer, data: &[u8]| AgentMessage { peer, kind: 7, data: data.into() };
    let messages =
        vec![message(Peer::Broadcast, b"all"), message(Peer::One(B), b"one"), message(Peer::One(A), b"self")];
    world.step([(A, Command { messages, ..command(Motion::Keep) })].into());
    assert_eq!(world.observe(B, RequestKind::Scheduled).messages, []);
    let third = world.observe(AgentId(2), RequestKind::Scheduled);
    assert_eq!(third.messages, [message(Peer::One(A), b"all")]);
    assert_eq!(third.events & EventMask::MESSAGE, EventMask::MESSAGE);
    let totals = world.totals();
    assert_eq!((totals.messages_sent, totals.messages_delivered, totals.messages_out_of_contact), (3, 1, 2));
    assert_eq!(totals.message_bytes_delivered, 3);
}

#[test]
fn full_inbox_drops_messages() {
    let mut world = World::new(hall([5, 4, 3]), params(), &[at(1.5, 1.5, 1.5), at(3.5, 3.5, 1.5)]);
    for _ in 0..70 {
        let messages =
            vec![AgentMessage { peer: Peer::One(B), kind: 0, data: vec![0; AGENT_MESSAGE_BYTES_MAX].into() }];
        world.step([(A, Command { messages, ..command(Motion::Keep) })].into());
    }
    assert_eq!((world.totals().messages_delivered, world.totals().messages_inbox_full), (64, 6));
    assert_eq!(world.observe(B, RequestKind::Scheduled).messages.len(), 64);
}

#[test]
fn events_are_reported_once() {
    let workers = workers(1);
    let mut world = World::new(two_rooms(), params(), &[at(1.5, 1.5, 1.5), at(7.5, 1.5, 1.5)]);
    world.observe(A, RequestKind::Scheduled);
    world.step([(A, command(Motion::Path(vec![Point3::new(1.5, 2.5, 1.5)])))].into());
    let mut happened = EventMask::empty();
    for _ in 0..500 {
        world.sense(&workers);
        happened |= world.events(
            A,
            EventMask::TASK_DONE
                | EventMask::COLLISION
                | EventMask::NEW_CELL
                | EventMask::CONTACTS
                | EventMask::MESSAGE,
        );
        world.step(BTreeMap::new());
    }
    assert_eq!(happened, EventMask::TASK_DONE | EventMask::NEW_CELL);
    assert_eq!(world.events(A, EventMask::TASK_DONE), EventMask::TASK_DONE);
    assert_eq!(world.events(A, EventMask::COLLISION), EventMask::empty());
    assert_eq!(world.observe(A, RequestKind::Scheduled).events, EventMask::TASK_DONE | EventMask::NEW_CELL);
    assert_eq!(world.observe(A, RequestKind::Scheduled).events, EventMask::empty());
    // Into the line of the door, then along it.
    world.step([(B, command(Motion::Path(vec![Point3::new(7.5, 2.5, 1.5)])))].into());
    for _ in 0..500 {
        world.step(BTreeMap::new());
    }
    assert_eq!(world.events(A, EventMask::CONTACTS), EventMask::CONTACTS);
    assert_eq!(world.observe(A, RequestKind::Scheduled).contacts.len(), 1);
    assert_eq!(world.events(A, EventMask::CONTACTS), EventMask::empty());
}

#[test]
fn speculative_observations_do_not_commit() {
    let workers = workers(1);
    let mut world = World::new(hall([5, 4, 3]), params(), &[at(1.5, 1.5, 1.5), at(3.5, 3.5, 1.5)]);
    world.sense(&workers);
    let first = world.observe(A, RequestKind::Polled);
    assert_eq!(first.seen.free.len(), 60);
    let message = |data: &[u8]| AgentMessage { peer: Peer::One(A), kind: 0, data: data.into() };
    world.step([(B, Command { messages: vec![message(b"x")], ..command(Motion::Keep) })].into());
    let second = world.observe(A, RequestKind::Polled);
    assert_eq!(
        (second.seen.free.len(), second.messages.len(), second.events & EventMask::MESSAGE),
        (0, 1, EventMask::MESSAGE)
    );
    let third = world.observe(A, RequestKind::Polled);
    assert_eq!((third.messages.len(), third.events & EventMask::MESSAGE), (0, EventMask::empty()));
    let counted = world.observe(A, RequestKind::Scheduled);
    assert_eq!(
        (counted.seen.free.len(), counted.messages.len(), counted.events & EventMask::MESSAGE),
        (60, 1, EventMask::MESSAGE)
    );
}

#[test]
fn view_is_included_on_request() {
    let workers = workers(1);
    let mut world = World::new(hall([5, 4, 3]), params(), &[at(3.5, 3.5, 2.5)]);
    world.sense(&workers);
    assert_eq!(world.observe(A, RequestKind::Scheduled).view, None);
    world.step([(A, Command { want_view: true, ..command(Motion::Keep) })].into());
    let view = world.observe(A, RequestKind::Scheduled).view.unwrap();
    assert_eq!(view.free.len(), 60);
    world.step([(A, command(Motion::Keep))].into());
    assert_eq!(world.observe(A, RequestKind::Scheduled).view, None);
}

#[test]
fn head_on_bodies_never_overlap() {
    let mut world =
        World::new(hall([20, 3, 3]), params(), &[at(2.5, 2.5, 2.5), Pose { yaw_rad: PI, ..at(19.5, 2.5, 2.5) }]);
    world.step([(A, command(endless(0.0))), (B, command(endless(0.0)))].into());
    for _ in 0..2000 {
        world.step(BTreeMap::new());
        let gap = world.body(A).pose().position - world.body(B).pose().position;
        assert!(gap.norm() >= 0.8 - 1e-12, "{gap}");
    }
    assert!([A, B].iter().all(|&agent| !world.body(agent).is_active()));
    assert!(world.body(A).collision().unwrap().with_agent || world.body(B).collision().unwrap().with_agent);
}

fn any_motion() -> impl Strategy<Value = Motion> {
    let point = prop::array::uniform3(-5.0..15.0_f64).prop_map(Point3::from);
    prop_oneof![
        Just(Motion::Keep),
        Just(Motion::Stop),
        (-1.6..1.6_f64, prop_oneof![Just(f64::INFINITY), 0.0..9.0_f64])
            .prop_map(|(pitch_rad, distance_m)| Motion::Move { pitch_rad, distance_m }),
        (-TAU..TAU).prop_map(|angle_rad| Motion::Turn { angle_rad }),
        prop::collection::vec(point, 1..5).prop_map(Motion::Path),
        (prop::array::uniform3(-9.0..9.0_f64), -9.0..9.0_f64).prop_map(|(linear, yaw_rate_rad_s)| {
            Motion::Velocity { linear_in_body_m_s: Vector3::from(linear), yaw_rate_rad_s, path: Vec::new() }
        }),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn no_command_moves_a_body_out_of_free_space(
        commands in prop::collection::vec((any_motion(), any_motion(), 1..200_usize), 1..30),
    ) {
        let terrain = two_rooms();
        let mut world = World::new(terrain.clone(), params(), &[at(1.5, 1.5, 1.5), at(7.5, 3.5, 1.5)]);
        for (of_a, of_b, ticks) in commands {
            world.step([(A, command(of_a)), (B, command(of_b))].into());
            for _ in 0..ticks {
                world.step(BTreeMap::new());
                let positions = [A, B].map(|agent| world.body(agent).pose().position);
                prop_assert!((positions[0] - positions[1]).norm() >= 0.8 - 1e-9);
                for position in positions {
                    for (cell, &state) in terrain.iter() {
                        if state == Terrain::Wall {
                            let low = Point3::new(cell.x.into(), cell.y.into(), cell.z.into());
                            let nearest = position.sup(&low).inf(&(low + Vector3::repeat(1.0)));
                            prop_assert!((position - nearest).norm() >= 0.4 - 1e-9, "{position} is too near to {cell:?}");
                        }
                    }
                }
            }
        }
    }
}

#[test]
fn place_needs_room_and_reports_task_done() {
    let mut world = World::new(two_rooms(), params(), &[at(1.5, 1.5, 1.5), at(6.5, 1.5, 1.5)]);
    world.step(BTreeMap::from([(A, command(endless(0.0)))]));
    assert!(world.body(A).is_active());
    let moved = world.body(A).pose().position;
    for (x, y) in [(4.5, 1.5), (3.7, 1.5), (6.0, 1.5), (100.0, 1.5), (f64::MAX, 1.5)] {
        assert!(world.place(A, at(x, y, 1.5)).is_err(), "{x}, {y}");
    }
    assert_eq!(world.body(A).pose().position, moved);
    world.observe(A, RequestKind::Scheduled);
    let pairs = world.pairs_in_contact();
    world.place(A, at(2.5, 1.5, 1.5)).unwrap();
    assert_eq!((world.body(A).is_active(), world.body(A).pose().position.x), (false, 2.5));
    assert_eq!(world.events(A, EventMask::TASK_DONE | EventMask::NEW_CELL), EventMask::TASK_DONE | EventMask::NEW_CELL);
    assert_eq!((pairs, world.pairs_in_contact()), (0, 0));
    world.place(B, at(5.5, 2.5, 1.5)).unwrap();
    world.place(A, at(2.5, 2.5, 1.5)).unwrap();
    assert_eq!(world.pairs_in_contact(), 1, "they see each other through the door");
}

#[test]
fn mixed_bodies_touch_at_the_sum_of_their_radii() {
    let small = BodyModel { radius_m: 0.2, ..BodyModel::AERIAL };
    let params = WorldParams { other_bodies: [(B, small)].into(), ..params() };
    let facing = [at(2.5, 2.5, 2.5), Pose { yaw_rad: PI, ..at(19.5, 2.5, 2.5) }];
    let mut world = World::new(hall([20, 3, 3]), params, &facing);
    world.step([(A, command(endless(0.0))), (B, command(endless(0.0)))].into());
    for _ in 0..2000 {
        world.step(BTreeMap::new());
    }
    let [a, b] = [A, B].map(|agent| world.body(agent).pose().position);
    let gap_m = (a - b).norm();
    assert!((0.6 - 1e-9..0.7).contains(&gap_m), "{gap_m}");
    assert!(world.place(B, at(a.x, a.y, a.z - 0.59)).is_err());
    assert!(world.place(B, at(a.x, a.y, a.z - 0.61)).is_ok());
    assert_eq!(world.body(B).model(), &small, "it stays what it is");
}

#[test]
fn noise_depends_neither_on_threads_nor_on_speculation() {
    let noise = SensorNoise { range_sigma_m: 0.3, missed_returns: 0.1, pose_bound_m: 0.5, pose_step_m: 0.05, seed: 3 };
    let starts = [at(1.5, 1.5, 1.5), at(3.5, 2.5, 1.5), at(7.5, 2.5, 1.5)];
    let observed = |threads, is_asked_between: bool| {
        let workers = workers(threads);
        let mut world = World::new(two_rooms(), WorldParams { noise, ..params() }, &starts);
        for _ in 0..100 {
            world.sense(&workers);
            if is_asked_between {
                world.observe(B, RequestKind::Polled);
            }
            world.step(BTreeMap::new());
        }
        [A, B].map(|agent| world.observe(agent, RequestKind::Scheduled))
    };
    let first = observed(1, false);
    assert_eq!(first, observed(4, true));
    assert_ne!(first[0].pose.position, starts[0].position, "it has drifted");
    assert!((first[0].pose.position - starts[0].position).amax() <= 0.5);
    // B is where it says it is.
    assert_eq!(
        first[0].contacts.iter().find(|contact| contact.agent == B).map(|contact| contact.position),
        Some(first[1].pose.position)
    );
}

#[test]
fn walls_seen_as_free_are_not_explored() {
    let noise = SensorNoise { range_sigma_m: 2.0, ..SensorNoise::default() };
    let workers = workers(1);
    let mut world = World::new(two_rooms(), WorldParams { noise, ..params() }, &[at(1.5, 1.5, 1.5)]);
    for _ in 0..100 {
        world.sense(&workers);
        world.step(BTreeMap::new());
    }
    let seen = world.observe(A, RequestKind::Scheduled).seen.free;
    let truly_free = seen.iter().filter(|&&cell| world.terrain().as_slice()[cell as usize] == Terrain::Free).count();
    assert!(truly_free < seen.len());
    let score = world.coverage().explored() * world.coverage().free_cells() as f64;
    assert_eq!(score.round() as usize, truly_free);
    // Bodies that keep still scan again all the same.
    assert_eq!(world.totals().scans.cast(), 10);
}
