use msgs::std_msgs::Header;
use protocol::body_model::BodyModel;
use voxels::{Grid, Terrain};

use super::*;
use world::WorldParams;
use world::comms::{Comms, ContactModel};
use world::lidar::{Pattern, Scanner};

const RADIUS_M: f64 = 0.4;

/// A room with agents 0, 1 and 2 in a row, two metres apart.
fn world() -> World {
    let layer = "#########\n#.......#\n#.......#\n#########\n";
    let solid = "#########\n#########\n#########\n#########\n";
    let terrain: Grid<Terrain> = Grid::from_text(&[solid, layer, layer, solid].join("\n")).unwrap();
    let params = WorldParams::new(
        BodyModel { radius_m: RADIUS_M, ..BodyModel::default() },
        Scanner::new(Pattern::Lattice { rays: 16 }, f64::INFINITY, std::f64::consts::TAU),
        Comms::perfect(ContactModel::LineOfSightAndRange { range_m: f64::INFINITY }),
    );
    let start = |x| Pose { position: Point3::new(x, 1.5, 1.5), yaw_rad: 0.5 };
    World::new(terrain, params, &[start(1.5), start(3.5), start(5.5)])
}

fn with_team<T>(has_left: [bool; 3], check: impl FnOnce(&Team<'_>) -> T) -> T {
    let world = world();
    let controllers = ["rbw", "lvd", "rbw"].map(str::to_owned);
    check(&Team { world: &world, controllers: &controllers, has_left: &has_left, answer_bytes_max: BYTES_MAX })
}

/// As much as three agents need.
const BYTES_MAX: usize = 1000;

#[test]
fn responses_that_are_too_long_are_refused() {
    with_team([false; 3], |team| {
        let all = EntityFilters::default();
        assert_eq!(team.states(&all).states.len(), 3);
        let short = Team { answer_bytes_max: 200, ..*team };
        let refused = short.states(&all);
        assert_eq!((refused.states.len(), refused.result.result), (0, Outcome::RESULT_OPERATION_FAILED));
        assert!(refused.result.error_message.contains("states of 3 entities do not fit"), "{:?}", refused.result);
        assert_eq!(short.entities(&all).entities.len(), 3);
    });
}

fn found(filters: &EntityFilters) -> Result<Vec<u32>, u8> {
    with_team([false; 3], |team| {
        let agents = team.filtered(filters).map_err(|outcome| outcome.result)?;
        Ok(agents.into_iter().map(|agent| agent.0).collect())
    })
}

fn bounds(r#type: u8, points: &[[f64; 3]]) -> EntityFilters {
    let points = points.iter().map(|&[x, y, z]| Triple { x, y, z }).collect();
    EntityFilters { bounds: Bounds { r#type, points }, ..EntityFilters::default() }
}

#[test]
fn names_match_regular_expressions() {
    let named = |filter: &str| found(&EntityFilters { filter: filter.to_owned(), ..EntityFilters::default() });
    assert_eq!(named(""), Ok(vec![0, 1, 2]));
    assert_eq!(named("agent_[12]"), Ok(vec![1, 2]));
    assert_eq!(named("^agent_1$|_0"), Ok(vec![0, 1]));
    assert_eq!(named("agent_x"), Ok(vec![]));
    assert_eq!(named("("), Err(Outcome::RESULT_OPERATION_FAILED));
    assert_eq!(named(&"a".repeat(FILTER_BYTES_MAX + 1)), Err(Outcome::RESULT_OPERATION_FAILED));
    assert_eq!(named("((a{99}){99}){99}"), Err(Outcome::RESULT_OPERATION_FAILED));
}

#[test]
fn tags_and_categories_are_filtered() {
    let tagged = |tags: &[&str], filter_mode| {
        let tags = TagsFilter { tags: tags.iter().map(ToString::to_string).collect(), filter_mode };
        found(&EntityFilters { tags, ..EntityFilters::default() })
    };
    assert_eq!(tagged(&["rbw", "dsvp"], TagsFilter::FILTER_MODE_ANY), Ok(vec![0, 2]));
    assert_eq!(tagged(&["rbw", "dsvp"], TagsFilter::FILTER_MODE_ALL), Ok(vec![]));
    assert_eq!(tagged(&[], TagsFilter::FILTER_MODE_ALL), Ok(vec![0, 1, 2]));
    assert_eq!(tagged(&[], 2), Err(Outcome::RESULT_OPERATION_FAILED));
    let of = |categories: &[u8]| {
        let categories = categories.iter().map(|&category| EntityCategory { category }).collect();
        found(&EntityFilters { categories, ..EntityFilters::default() })
    };
    assert_eq!(of(&[0, 1]), Ok(vec![0, 1, 2]));
    assert_eq!(of(&[0, 5]), Ok(vec![]));
}

#[test]
fn bounds_select_touching_bodies() {
    assert_eq!(found(&bounds(Bounds::TYPE_SPHERE, &[[1.5, 1.5, 1.5], [1.7, 0.0, 0.0]])), Ok(vec![0, 1]));
    assert_eq!(found(&bounds(Bounds::TYPE_SPHERE, &[[1.5, 1.5, 1.5], [1.5, 0.0, 0.0]])), Ok(vec![0]));
    assert_eq!(found(&bounds(Bounds::TYPE_BOX, &[[9.0, 9.0, 9.0], [3.8, 0.0, 0.0]])), Ok(vec![1, 2]));
    assert_eq!(found(&bounds(Bounds::TYPE_BOX, &[[4.0, 0.0, 0.0], [5.0, 9.0, 9.0]])), Ok(vec![]));
    assert_eq!(found(&bounds(Bounds::TYPE_CONVEX_HULL, &[])), Err(Outcome::RESULT_FEATURE_UNSUPPORTED));
    for wrong in [
        bounds(Bounds::TYPE_BOX, &[[0.0; 3]]),
        bounds(Bounds::TYPE_SPHERE, &[]),
        bounds(Bounds::TYPE_SPHERE, &[[f64::NAN; 3], [1.0; 3]]),
        bounds(Bounds::TYPE_SPHERE, &[[0.0; 3], [f64::NAN; 3]]),
        bounds(9, &[]),
    ] {
        assert_eq!(found(&wrong), Err(Outcome::RESULT_OPERATION_FAILED), "{wrong:?}");
    }
}

#[test]
fn removed_agents_are_no_entities() {
    with_team([false, true, false], |team| {
        assert_eq!(team.entities(&EntityFilters::default()).entities, ["agent_0", "agent_2"]);
        assert_eq!(team.state("agent_1").result.result, Outcome::RESULT_NOT_FOUND);
        assert_eq!(team.info("agent_1").result.result, Outcome::RESULT_NOT_FOUND);
        assert_eq!(team.info("agent_2").info.tags, ["rbw"]);
        assert_eq!(team.bounds("agent_2").bounds.points[1].z, -RADIUS_M);
        let state = team.state("agent_2").state;
        assert_eq!((state.pose.position.x, state.header.frame_id.as_str()), (5.5, "map"));
        assert_eq!(team.states(&EntityFilters::default()).states[1], state);
    });
}

#[test]
fn agents_of_the_reserve_join_under_their_names() {
    let free = PoseStamped {
        pose: msgs::geometry_msgs::Pose {
            position: Point { x: 7.5, y: 1.5, z: 1.5 },
            orientation: Quaternion { x: 0.0, y: 0.0, z: 0.0, w: 1.0 },
        },
        ..PoseStamped::default()
    };
    let request =
        SpawnEntityRequest { name: "agent_2".to_owned(), initial_pose: free, ..SpawnEntityRequest::default() };
    let found = |waiting: &[AgentId], change: &dyn Fn(&mut SpawnEntityRequest)| {
        let mut request = request.clone();
        change(&mut request);
        let has_left = [false, true, true];
        let found = with_team(has_left, |team| team.to_spawn(&request, waiting).map_err(|outcome| outcome.result));
        found.map(|(agent, pose)| (agent.0, pose.position.x))
    };
    let both = [AgentId(1), AgentId(2)];
    let of = |change: &dyn Fn(&mut SpawnEntityRequest)| found(&both, change);
    assert_eq!(of(&|_| {}), Ok((2, 7.5)));
    assert_eq!(of(&|request| request.initial_pose = PoseStamped::default()), Ok((2, 5.5)), "its start pose");
    assert_eq!(of(&|request| request.entity_namespace = "/agent_2".to_owned()), Ok((2, 7.5)));
    assert_eq!(of(&|request| request.name = "robot".to_owned()), Err(SpawnEntityResponse::NAME_INVALID));
    assert_eq!(of(&|request| request.name = "agent_0".to_owned()), Err(SpawnEntityResponse::NAME_NOT_UNIQUE));
    let renamed = |request: &mut SpawnEntityRequest| {
        (request.name, request.allow_renaming) = ("robot".to_owned(), true);
    };
    assert_eq!(of(&renamed), Ok((1, 7.5)), "the first that waits");
    assert_eq!(found(&[], &renamed), Err(Outcome::RESULT_FEATURE_UNSUPPORTED));
    assert_eq!(
        of(&|request| request.entity_resource.uri = "a.urdf".to_owned()),
        Err(SpawnEntityResponse::UNSUPPORTED_FORMAT)
    );
    assert_eq!(
        of(&|request| request.entity_namespace = "other".to_owned()),
        Err(SpawnEntityResponse::NAMESPACE_INVALID)
    );
    let wrong = |request: &mut SpawnEntityRequest| request.initial_pose.header.frame_id = "odom".to_owned();
    assert_eq!(of(&wrong), Err(SpawnEntityResponse::INVALID_POSE));
    let wrong = |request: &mut SpawnEntityRequest| request.initial_pose.pose.position.y = f64::NAN;
    assert_eq!(of(&wrong), Err(SpawnEntityResponse::INVALID_POSE));
}

#[test]
fn only_finite_upright_poses_are_accepted() {
    let request = SetEntityStateRequest {
        entity: "agent_1".to_owned(),
        state: EntityState::default(),
        set_pose: true,
        set_twist: false,
        set_acceleration: false,
    };
    let placed = |change: &dyn Fn(&mut SetEntityStateRequest)| {
        let mut request = request.clone();
        change(&mut request);
        with_team([false; 3], |team| team.placement(&request).map_err(|outcome| outcome.result))
    };
    let turned = |yaw_rad: f64| Quaternion { x: 0.0, y: 0.0, z: libm::sin(yaw_rad / 2.0), w: libm::cos(yaw_rad / 2.0) };
    let (agent, pose) = placed(&|request| request.state.pose.orientation = turned(-2.5)).unwrap();
    assert_eq!((agent, pose.position), (AgentId(1), Point3::origin()));
    assert!((pose.yaw_rad + 2.5).abs() < 1e-12);
    assert!(
        placed(&|request| request.state.header = Header { frame_id: "map".to_owned(), ..Header::default() }).is_ok()
    );
    let code = |change: &dyn Fn(&mut SetEntityStateRequest)| placed(change).unwrap_err();
    assert_eq!(code(&|request| request.entity = "agent_9".to_owned()), Outcome::RESULT_NOT_FOUND);
    assert_eq!(code(&|request| request.set_pose = false), Outcome::RESULT_OPERATION_FAILED);
    assert_eq!(code(&|request| request.set_twist = true), Outcome::RESULT_FEATURE_UNSUPPORTED);
    assert_eq!(
        code(&|request| request.state.header.frame_id = "odom".to_owned()),
        SetEntityStateResponse::INVALID_POSE
    );
    assert_eq!(code(&|request| request.state.pose.position.z = f64::NAN), SetEntityStateResponse::INVALID_POSE);
    assert_eq!(code(&|request| request.state.pose.orientation.w = f64::NAN), SetEntityStateResponse::INVALID_POSE);
    assert_eq!(code(&|request| request.state.pose.orientation.w = 0.0), SetEntityStateResponse::INVALID_POSE);
    let lying = Quaternion { x: 0.6, y: 0.0, z: 0.0, w: 0.8 };
    assert_eq!(code(&|request| request.state.pose.orientation = lying), SetEntityStateResponse::INVALID_POSE);
}
