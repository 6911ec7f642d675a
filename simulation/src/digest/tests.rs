use std::collections::BTreeMap;
use std::f64::consts::TAU;

use msgs::ids::{AgentId, Tick};
use nalgebra::Point3;
use protocol::body_model::BodyModel;
use protocol::command::Command;
use protocol::observation::RequestKind;
use protocol::scan_request::ScanRequest;
use protocol::wake_condition::WakeCondition;
use voxels::{Grid, Terrain};
use world::WorldParams;
use world::body::{Motion, Pose};
use world::collision::Shape;
use world::comms::{Comms, ContactModel};
use world::lidar::{Pattern, Scanner};
use world::moving_obstacles::{ObstacleModel, Repeat};

use super::*;

/// Two rooms with a door (`.` in the middle of the wall), and the bodies of `starts`.
fn two_rooms(starts: &[Pose], late: &[AgentId]) -> World {
    two_rooms_with(starts, late, Vec::new())
}

fn two_rooms_with(starts: &[Pose], late: &[AgentId], obstacles: Vec<ObstacleModel>) -> World {
    let solid = "#########\n#########\n#########\n#########\n#########\n";
    let layer = "#########\n#...#...#\n#.......#\n#...#...#\n#########\n";
    let terrain: Grid<Terrain> = Grid::from_text(&[solid, layer, solid].join("\n")).unwrap();
    let params = WorldParams {
        late: late.iter().copied().collect(),
        obstacles,
        ..WorldParams::new(
            BodyModel::default(),
            Scanner::new(Pattern::Lattice { rays: 500 }, f64::INFINITY, TAU),
            Comms::perfect(ContactModel::LineOfSightAndRange { range_m: f64::INFINITY }),
        )
    };
    World::new(terrain, params, starts)
}

fn at(x: f64, y: f64) -> Pose {
    Pose { position: Point3::new(x, y, 1.5), yaw_rad: 0.0 }
}

const A: AgentId = AgentId(0);
const B: AgentId = AgentId(1);

#[test]
fn moving_obstacles_are_covered() {
    let workers = Arc::new(Workers::new(1).unwrap());
    let digest = |x_m: [f64; 2]| {
        let path = x_m.map(|x| Point3::new(x, 2.5, 1.5)).to_vec();
        let shape = Shape::Sphere { radius_m: 0.3 };
        let obstacle = ObstacleModel { shape, path, speed_m_s: 1.0, repeat: Repeat::Once, start: Tick::ZERO };
        let mut world = two_rooms_with(&[at(1.5, 1.5)], &[], vec![obstacle]);
        let mut chain = Chain::new("a scenario", &world, Arc::clone(&workers));
        for _ in 0..20 {
            world.step(BTreeMap::new());
            chain.close(&world);
        }
        chain.digest()
    };
    assert_ne!(digest([3.5, 5.5]), digest([3.5, 2.5]));
}

#[test]
fn deferred_scans_change_nothing() {
    let run = |threads, is_deferring: bool| {
        let workers = Arc::new(Workers::new(threads).unwrap());
        let mut world = two_rooms(&[at(1.5, 1.5), at(7.5, 1.5), at(3.5, 3.5)], &[]);
        if is_deferring {
            world.defer_scans();
        }
        let mut chain = Chain::new("a scenario", &world, Arc::clone(&workers));
        let mut observed = Vec::new();
        let mut unsettled = 0;
        let walk = |points: &[(f64, f64)], period| {
            let points = points.iter().map(|&(x, y)| Point3::new(x, y, 1.5)).collect();
            Command {
                lidar: ScanRequest::Every(period),
                ..Command::new(Motion::Path(points), WakeCondition::NEXT_TICK)
            }
        };
        world.step([(A, walk(&[(1.5, 2.5), (6.5, 2.5)], 3)), (B, walk(&[(7.5, 3.5)], 4))].into());
        for tick in 0..400 {
            world.sense(&workers);
            unsettled += usize::from(!world.has_no_pending_scans());
            match tick % 31 {
                3 | 18 => observed.push(world.observe(A, RequestKind::Scheduled)),
                7 => observed.push(world.observe(B, RequestKind::Polled)),
                _ => {}
            }
            world.step(BTreeMap::new());
            world.cast_ahead(&workers);
            if tick % 40 < 2 {
                // Long messages are hashed at once where no tick is unsettled.
                chain.message(&[tick as u8; 1 << 14]);
                chain.message(b"short");
            }
            chain.close(&world);
            if !is_deferring || tick % 50 == 49 {
                chain.resolve(&world.flush_scans());
            }
        }
        assert_eq!(unsettled > 0, threads > 1);
        let milestones: Vec<_> = world.coverage().milestones().collect();
        assert!(milestones.len() > 3 && observed.iter().any(|observation| !observation.seen.free.is_empty()));
        (observed, chain.digest(), milestones, world.coverage().explored_by())
    };
    let alone = run(1, false);
    for (threads, is_deferring) in [(1, true), (2, false), (2, true), (4, true)] {
        assert_eq!(run(threads, is_deferring), alone, "{threads} threads, deferring: {is_deferring}");
    }
}

#[test]
fn digests_differ_by_presence_and_radio() {
    let digest = |change: &dyn Fn(&mut World)| {
        let mut world = two_rooms(&[at(1.5, 1.5), at(3.5, 1.5)], &[B]);
        world.join(B);
        change(&mut world);
        Chain::new("", &world, Arc::new(Workers::new(1).unwrap())).digest().0
    };
    let same = digest(&|_| {});
    let others = [digest(&|world| world.break_down(B)), digest(&|world| world.switch_radio(B, false))];
    assert!(others.iter().all(|other| *other != same) && others[0] != others[1]);
}
