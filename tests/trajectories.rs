//! The bodies of the server do what the trajectories of the agents say, bit by bit.

use agent_node::exploration_map::ExplorationMap;
use agent_node::path::{BodyState, Trajectory};
use msgs::ids::Tick;
use nalgebra::Point3;
use protocol::body_model::BodyModel;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use voxels::Extent;
use world::body::{Body, Motion, Pose};
use world::collision::Obstacles;

/// The edge of the open space, cells.
const SIZE: u32 = 40;

fn drive(body: &mut Body, trajectory: &Trajectory, ticks: u64) {
    for tick in 0..ticks {
        if tick.is_multiple_of(Trajectory::STEP_TICKS) {
            let (held, _) = trajectory.step((tick / Trajectory::STEP_TICKS) as usize).expect("it lasts longer");
            body.set_task(Motion::Velocity {
                linear_in_body_m_s: held.linear_in_body_m_s,
                yaw_rate_rad_s: held.yaw_rate_rad_s,
                path: Vec::new(),
            });
        }
        assert!(!body.advance(&Obstacles::none(), Tick::TICK_S).collided);
        let expected = trajectory.state_after(tick + 1, body.model()).expect("it lasts longer");
        let state = BodyState {
            velocity_in_body_m_s: body.velocity_in_body_m_s(),
            yaw_rate_rad_s: body.yaw_rate_rad_s(),
            ..BodyState::at_rest(body.pose().position, body.pose().yaw_rad)
        };
        assert_eq!(state, expected, "after {} of {} ticks", tick + 1, trajectory.ticks());
    }
}

#[test]
fn bodies_follow_trajectories_bit_by_bit() {
    let extent = Extent::new([SIZE; 3], 1.0).expect("an extent");
    let mut map = ExplorationMap::new(extent);
    map.note_free(&(0..extent.volume() as u32).collect::<Vec<_>>());
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let mut point = || Point3::from([(); 3].map(|()| rng.random_range(10.0..30.0)));
    let model = BodyModel::SUBMARINE;
    let mut is_driven = 0;
    for _ in 0..50 {
        let start = BodyState::at_rest(point(), 2.5);
        let Some(first) = Trajectory::along(&[point(), point(), point()], &map, &model, &start) else { continue };
        let mut body = Body::at_rest(model, Pose { position: start.position, yaw_rad: start.yaw_rad });
        // Another one from the middle of a step.
        let ticks = first.ticks() / 2 + 3;
        drive(&mut body, &first, ticks);
        let on_the_way = first.state_after(ticks, &model).expect("it lasts longer");
        let Some(second) = Trajectory::along(&[point(), point()], &map, &model, &on_the_way) else { continue };
        drive(&mut body, &second, second.ticks());
        is_driven += 1;
    }
    assert!(is_driven > 25, "only {is_driven} of 50 ways have trajectories");
}
