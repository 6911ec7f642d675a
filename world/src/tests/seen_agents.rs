//! LiDARs whose rays end at the bodies of others.

use super::lidar::{Measured, RayReturn};
use super::*;

const RADIUS_M: f64 = 0.4;

fn params_of(sees_agents: bool, noise: SensorNoise) -> WorldParams {
    let body = BodyModel { radius_m: RADIUS_M, ..BodyModel::default() };
    let scanner = Scanner::new(Pattern::Lattice { rays: 4000 }, f64::INFINITY, TAU).seeing_agents(sees_agents);
    WorldParams { body, sensors: scanner.into(), noise, ..params() }
}

/// Two bodies in a tunnel of 12 x 1 x 1 cells, at 1.5 m and 4.5 m.
fn in_tunnel(sees_agents: bool, noise: SensorNoise) -> World {
    World::new(hall([12, 1, 1]), params_of(sees_agents, noise), &[at(1.5, 1.5, 1.5), at(4.5, 1.5, 1.5)])
}

/// What the rays of the only LiDAR of an agent measure.
fn returns(world: &World) -> Vec<RayReturn> {
    world.returns(A, 0, &world.sensors(A).lidars()[0].scanner)
}

#[test]
fn rays_end_at_bodies_of_others_which_are_nothing_of_the_map() {
    let workers = workers(1);
    let mut seen = Vec::new();
    for sees_agents in [false, true] {
        let mut world = in_tunnel(sees_agents, SensorNoise::default());
        world.sense(&workers);
        let returns = returns(&world);
        let ahead = returns.iter().max_by(|one, other| one.direction.x.total_cmp(&other.direction.x)).unwrap();
        let Measured::Surface { point, incidence_cos } = ahead.measured else { panic!("{ahead:?}") };
        let expected_m = if sees_agents { 4.5 - RADIUS_M } else { 13.0 };
        assert!((point.x - expected_m).abs() < 0.01 && incidence_cos > 0.95, "{ahead:?}");
        world.step([(A, Command { want_view: true, ..command(Motion::Keep) })].into());
        let observation = world.observe(A, RequestKind::Scheduled);
        assert_eq!(observation.view.as_ref(), Some(&observation.seen), "one scan sees what there is");
        seen.push(observation.seen);
    }
    let is_wall = |world: &World, cell: u32| world.terrain().as_slice()[cell as usize] == Terrain::Wall;
    let world = in_tunnel(true, SensorNoise::default());
    let [without, with] = &seen[..] else { unreachable!("two runs") };
    assert_eq!(without.free.len(), 12);
    // Rays pass beside the body, which leaves a tenth of a metre on each side.
    assert!(with.free.len() >= 4 && with.wall.len() < without.wall.len(), "{with:?}");
    assert!(with.wall.iter().all(|&cell| is_wall(&world, cell)), "a body is no wall");
    assert!(with.free.iter().all(|cell| without.free.contains(cell)));
}

#[test]
fn bodies_at_rest_see_what_another_one_has_uncovered() {
    let workers = workers(1);
    let mut world = in_tunnel(true, SensorNoise::default());
    let mut walls = Vec::new();
    for tick in 0..400 {
        world.sense(&workers);
        walls.extend(world.observe(A, RequestKind::Scheduled).seen.wall);
        let leave = (tick == 0).then(|| (B, command(Motion::Path(vec![at(11.5, 1.5, 1.5).position]))));
        world.step(leave.into_iter().collect());
    }
    let mut reference = in_tunnel(false, SensorNoise::default());
    reference.sense(&workers);
    let all = reference.observe(A, RequestKind::Scheduled).seen.wall.len();
    assert!(walls.len() > all * 3 / 4, "{} of {all} walls", walls.len());
    assert_eq!(world.totals().scans.not_cast(NotCast::SamePose), 0);
}

#[test]
fn bodies_in_the_way_depend_neither_on_threads_nor_on_speculation() {
    for noise in [SensorNoise::default(), SensorNoise { range_sigma_m: 0.1, seed: 3, ..SensorNoise::default() }] {
        let starts = [at(1.5, 1.5, 1.5), at(3.5, 2.5, 1.5), at(7.5, 2.5, 1.5)];
        let observed = |threads, is_asked_between: bool| {
            let workers = workers(threads);
            let mut world = World::new(two_rooms(), params_of(true, noise), &starts);
            for tick in 0..200 {
                world.sense(&workers);
                world.cast_ahead(&workers);
                if is_asked_between {
                    world.observe(A, RequestKind::Polled);
                }
                let goes = (tick == 0).then(|| (AgentId(2), command(Motion::Path(vec![at(5.5, 2.5, 1.5).position]))));
                world.step(goes.into_iter().collect());
            }
            [A, B, AgentId(2)].map(|agent| world.observe(agent, RequestKind::Scheduled))
        };
        assert_eq!(observed(1, false), observed(4, true));
    }
}

#[test]
fn bodies_seem_farther_or_nearer_with_noise() {
    let noise = SensorNoise { range_sigma_m: 0.2, seed: 1, ..SensorNoise::default() };
    let mut world = in_tunnel(true, noise);
    world.sense(&workers(1));
    let returns = returns(&world);
    let on_body = returns.iter().filter(|ray| ray.direction.x > 0.995).filter_map(|ray| ray.point());
    let errors_m: Vec<f64> = on_body.map(|point| point.x - (4.5 - RADIUS_M)).collect();
    assert!(errors_m.iter().all(|error_m| error_m.abs() < 1.2), "{errors_m:?}");
    assert!(errors_m.iter().any(|error_m| *error_m < 0.0) && errors_m.iter().any(|error_m| *error_m > 0.0));
}

#[test]
fn bodies_that_are_too_near_are_not_seen() {
    let mount = crate::lidar::Mount { min_range_m: 3.0, ..Default::default() };
    let params = params_of(true, SensorNoise::default());
    let scanner = params.sensors.lidars()[0].scanner.clone().on(mount);
    let mut world = World::new(
        hall([12, 1, 1]),
        WorldParams { sensors: scanner.into(), ..params },
        &[at(1.5, 1.5, 1.5), at(4.5, 1.5, 1.5)],
    );
    world.sense(&workers(1));
    let returns = returns(&world);
    let ahead = returns.iter().max_by(|one, other| one.direction.x.total_cmp(&other.direction.x)).unwrap();
    assert_eq!(ahead.measured, Measured::TooNear);
}
