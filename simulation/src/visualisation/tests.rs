use std::collections::BTreeMap;
use std::f64::consts::{FRAC_PI_2, TAU};

use fixedbitset::FixedBitSet;
use msgs::cdr;
use msgs::topics::{self, Topic};
use nalgebra::Vector3;
use protocol::body_model::BodyModel;
use protocol::command::{Command, WakeCondition};
use protocol::limits::VIEW_BYTES_MAX;
use voxels::{Extent, Grid, Terrain};

use super::*;
use world::WorldParams;
use world::body::{Motion, Pose};
use world::comms::{Comms, ContactModel};
use world::lidar::{Pattern, Scanner};

/// A tunnel of 1 x 1 x 8 free cells of 1 m along x, from (1, 1, 1) to (8, 1, 1).
fn tunnel() -> Grid<Terrain> {
    let mut terrain = Grid::new(Extent::new([10, 3, 3], 1.0).unwrap(), Terrain::Wall);
    for x in 1..9 {
        terrain.set(voxels::Cell::new(x, 1, 1), Terrain::Free);
    }
    terrain
}

/// Two bodies in the tunnel, 4 m apart; the first has its heading along y. LiDARs have a range of 1
/// m and scan every 10 ticks.
fn world() -> World {
    let params = WorldParams::new(
        BodyModel { radius_m: 0.1, ..BodyModel::default() },
        Scanner::new(Pattern::Lattice { rays: 1000 }, 1.0, TAU),
        Comms::perfect(ContactModel::LineOfSightAndRange { range_m: 5.0 }),
    );
    let pose = |x, yaw_rad| Pose { position: Point3::new(x, 1.5, 1.5), yaw_rad };
    World::new(tunnel(), params, &[pose(1.5, FRAC_PI_2), pose(5.5, 0.0)])
}

fn step(world: &mut World, actions: impl IntoIterator<Item = (u32, Motion)>) {
    world.sense(&world::workers::Workers::new(1).unwrap());
    let action = |motion| Command::new(motion, WakeCondition::NEXT_TICK);
    world.step(actions.into_iter().map(|(agent, motion)| (AgentId(agent), action(motion))).collect());
}

fn run_status<'a>(lost: &'a BTreeSet<AgentId>, infos: &'a [String]) -> RunStatus<'a> {
    let live = LiveStatus { rtf: Some(7.25), phases_s: &[("scan", 1.5), ("agents", 4.5)] };
    RunStatus { infos, lost, live: Some(live) }
}

fn scheduler(record: Vec<RecordedView>) -> VisualisationScheduler {
    VisualisationScheduler::new(ViewsSection { record, ..ViewsSection::default() }, &all(2), 5)
}

/// All that bodies may have.
fn all(agents: u32) -> Equipment {
    let lidar = LidarTopics { name: None, has_ring: true, has_camera: true };
    Equipment { has_batteries: true, ..Equipment::of_each(agents, lidar) }
}

/// The number of messages of each topic that are published to subscribers.
fn published(
    scheduler: &mut VisualisationScheduler,
    world: &mut World,
    subscribers: &[(VisualisationTopic, u64)],
    wall_ms: u64,
) -> BTreeMap<VisualisationTopic, usize> {
    published_at(scheduler, world, subscribers, PublishTime { wall_ns: wall_ms * 1_000_000, is_paused: true })
}

fn published_at(
    scheduler: &mut VisualisationScheduler,
    world: &mut World,
    subscribers: &[(VisualisationTopic, u64)],
    now: PublishTime,
) -> BTreeMap<VisualisationTopic, usize> {
    let (lost, infos) = (BTreeSet::new(), vec![String::new(); 2]);
    let subscribers = subscribers.iter().copied().collect();
    let mut counts = BTreeMap::new();
    for (topic, _) in scheduler.due_live(world, &run_status(&lost, &infos), &subscribers, now) {
        *counts.entry(topic).or_default() += 1;
    }
    counts
}

#[test]
fn topics_are_distinct_and_known() {
    let topics: BTreeSet<String> = VisualisationTopic::all(&all(3)).map(|topic| topic.topic().to_string()).collect();
    assert_eq!(topics.len(), VisualisationTopic::all(&all(3)).count());
    let known: BTreeSet<String> = topics::all(3).iter().map(Topic::to_string).collect();
    assert!(topics.is_subset(&known));

    let named = |name: &str, has_ring| LidarTopics { name: name.parse().ok(), has_ring, has_camera: !has_ring };
    let several = Equipment { lidars: vec![vec![named("top", true), named("eye", false)]], has_batteries: false };
    let names: Vec<String> = VisualisationTopic::all(&several).map(|topic| topic.topic().name).collect();
    let of_agent = ["odom", "top/points", "eye/points", "path", "top/scan", "eye/depth/image", "eye/depth/camera_info"];
    assert_eq!(names[names.len() - 7..], of_agent.map(|name| format!("/agent_0/{name}")));
    assert!(names.iter().all(|name| topics::named(name).is_some()));
}

#[test]
fn new_subscriber_waits_for_the_next_tick() {
    let mut world = world();
    let mut scheduler = scheduler(Vec::new());
    let mut count = |world: &mut World, arrivals, is_paused| {
        let transforms = [(VisualisationTopic::Transforms, arrivals)];
        published_at(&mut scheduler, world, &transforms, PublishTime { wall_ns: 0, is_paused }).values().sum::<usize>()
    };
    assert_eq!(count(&mut world, 1, false), 1);
    assert_eq!(count(&mut world, 2, false), 0, "the second reader waits for the next tick");
    step(&mut world, []);
    assert_eq!(count(&mut world, 2, false), 1);
    assert_eq!(count(&mut world, 3, true), 1, "the third one would wait forever");
}

#[test]
fn odometry_pose_is_in_map_and_twist_in_body() {
    let mut world = world();
    let ahead =
        Motion::Velocity { linear_in_body_m_s: Vector3::new(0.5, 0.0, 0.0), yaw_rate_rad_s: 0.25, path: Vec::new() };
    for _ in 0..10 {
        step(&mut world, [(0, ahead.clone())]);
    }
    let odometry = odometry(&world, AgentId(0));
    assert_eq!(odometry.header, msgs::std_msgs::Header { stamp: Tick(10).into(), frame_id: "map".to_owned() });
    assert_eq!(odometry.child_frame_id, "agent_0/base_link");
    // It accelerates by 0.5 m/s^2 for a fifth of a second, with its heading along y of the map.
    assert!((odometry.twist.twist.linear.x - 0.1).abs() < 1e-9, "{odometry:?}");
    assert_eq!(odometry.twist.twist.linear.y, 0.0);
    assert!(odometry.pose.pose.position.y > 1.5 && odometry.pose.pose.position.x < 1.5, "{odometry:?}");
}

#[test]
fn path_is_the_remaining_task() {
    let mut world = world();
    let waypoints: Vec<Point3<f64>> = [6.0, 7.0].map(|x| Point3::new(x, 1.5, 1.5)).into();
    step(&mut world, [(1, Motion::Path(waypoints.clone()))]);
    assert_eq!(world.body(AgentId(1)).waypoints(), waypoints);
    let mut scheduler = scheduler(Vec::new());
    let path = [(VisualisationTopic::Path(AgentId(1)), 1)];
    assert_eq!(published(&mut scheduler, &mut world, &path, 0).len(), 1);
    // An unchanged path is not repeated.
    (0..19).for_each(|_| step(&mut world, []));
    assert_eq!(published(&mut scheduler, &mut world, &path, 1000).len(), 0);
    (0..100).for_each(|_| step(&mut world, []));
    assert_eq!(world.body(AgentId(1)).waypoints(), waypoints[1..]);
    assert_eq!(published(&mut scheduler, &mut world, &path, 2000).len(), 1);
}

#[test]
fn cloud_has_the_stamp_of_its_scan() {
    let mut world = world();
    let mut scheduler = scheduler(Vec::new());
    let points = [(VisualisationTopic::Points(SensorId::only(AgentId(0))), 1)];
    assert_eq!(published(&mut scheduler, &mut world, &points, 0).len(), 0);
    step(&mut world, []);
    let cloud = super::points(&world, SensorId::only(AgentId(0)), &[]).unwrap();
    assert_eq!((cloud.header.stamp, cloud.header.frame_id.as_str()), (Tick(0).into(), "agent_0/base_link"));
    let returns = world.returns(AgentId(0), 0, &world.sensors(AgentId(0)).lidars()[0].scanner);
    let hits: Vec<_> = returns.iter().filter_map(world::lidar::RayReturn::point).collect();
    // Walls are half a metre away on five sides.
    assert!(hits.len() > 800 && hits.iter().all(|hit| (hit - Point3::new(1.5, 1.5, 1.5)).norm() < 1.0 + 1e-9));
    assert_eq!(cloud.width as usize, hits.len());
    assert_eq!(published(&mut scheduler, &mut world, &points, 1000).len(), 1);
    (0..9).for_each(|_| step(&mut world, []));
    assert_eq!(published(&mut scheduler, &mut world, &points, 2000).len(), 0, "the next scan is in tick 10");
    step(&mut world, []);
    assert_eq!(published(&mut scheduler, &mut world, &points, 3000).len(), 1);
}

#[test]
fn live_topics_are_rate_limited_and_repeated_for_new_subscribers() {
    let mut world = world();
    let mut scheduler = scheduler(Vec::new());
    let all = |arrivals| {
        [
            (VisualisationTopic::Transforms, arrivals),
            (VisualisationTopic::Map, arrivals),
            (VisualisationTopic::Unexplored, arrivals),
        ]
    };
    let map_and_all = published(&mut scheduler, &mut world, &all(1), 0);
    assert_eq!(map_and_all.len(), 3);
    step(&mut world, []);
    (0..9).for_each(|_| step(&mut world, []));
    assert_eq!(published(&mut scheduler, &mut world, &all(1), 10).len(), 0, "30 Hz of wall time");
    let again = published(&mut scheduler, &mut world, &all(1), 40);
    assert_eq!(
        again.into_keys().collect::<Vec<_>>(),
        [VisualisationTopic::Transforms],
        "walls stay, and unexplored cells are not due"
    );
    (0..40).for_each(|_| step(&mut world, []));
    let changed = published(&mut scheduler, &mut world, &all(1), 80);
    assert_eq!(
        changed.into_keys().collect::<Vec<_>>(),
        [VisualisationTopic::Transforms, VisualisationTopic::Unexplored]
    );
    assert_eq!(published(&mut scheduler, &mut world, &all(1), 200).len(), 0, "the world stands still");
    assert_eq!(published(&mut scheduler, &mut world, &all(2), 201), map_and_all, "a new subscriber");
}

#[test]
fn unexplored_marker_shrinks_until_deleted() {
    let mut terrain = tunnel();
    terrain.set(voxels::Cell::new(1, 1, 1), Terrain::Wall);
    let free: Vec<usize> = (2..9).map(|x| terrain.extent().index(voxels::Cell::new(x, 1, 1)).unwrap()).collect();
    let mut explored = FixedBitSet::with_capacity(terrain.extent().volume());
    let mut unexplored = Unexplored::new(&terrain);
    let first = unexplored.next(&terrain, &explored, Tick(1)).unwrap();
    assert_eq!((first.points.len(), first.action, first.id), (7, Marker::ADD, 0));
    assert_eq!(first.points[0], msgs::geometry_msgs::Point { x: 2.5, y: 1.5, z: 1.5 });
    explored.insert(free[0]);
    unexplored.update(&explored);
    assert_eq!(unexplored.next(&terrain, &explored, Tick(2)).unwrap().points, first.points[1..]);
    for &cell in &free {
        explored.insert(cell);
    }
    unexplored.update(&explored);
    assert_eq!(unexplored.next(&terrain, &explored, Tick(3)).unwrap().action, Marker::DELETE);
    unexplored.update(&explored);
    assert_eq!(unexplored.next(&terrain, &explored, Tick(4)), None);
}

#[test]
fn contacts_are_lines_from_body_to_body() {
    let mut world = world();
    let line = poses::contacts(&mut world);
    assert_eq!((line.action, line.r#type), (Marker::ADD, Marker::LINE_LIST));
    assert_eq!(line.points.iter().map(|end| end.x).collect::<Vec<_>>(), [1.5, 5.5]);
}

#[test]
fn status_covers_the_run_and_each_agent() {
    let world = world();
    let infos = vec!["looking around".to_owned(), "x".repeat(1000)];
    let lost = BTreeSet::from([AgentId(1)]);
    let messages = status::info(&world, &run_status(&lost, &infos));
    let statuses = &messages[0].status;
    let names: Vec<_> = statuses.iter().map(|status| status.name.as_str()).collect();
    assert_eq!(names, ["run", "loop", "agent_0", "agent_1"]);
    assert_eq!(statuses[2].message, "looking around");
    assert_eq!((statuses[3].message.as_str(), statuses[3].level), ("lost", 2));
    let of_loop: Vec<_> = statuses[1].values.iter().map(|value| (value.key.as_str(), value.value.as_str())).collect();
    assert_eq!((statuses[1].message.as_str(), of_loop), ("agents 75 %", vec![("scan", "1.500"), ("agents", "4.500")]));
    let rtf = statuses[0].values.iter().find(|value| value.key == "rtf").unwrap();
    assert_eq!(rtf.value, "7.2");
}

#[test]
fn recorded_topics_depend_on_sim_time_and_fit_into_samples() {
    let every = || {
        use RecordedView::{Contacts, Info, Map, Odom, Path, Points, TfStatic, Unexplored};
        vec![TfStatic, Odom, Points, Path, Map, Unexplored, Contacts, Info]
    };
    let run = |live: Option<LiveStatus<'_>>| {
        let mut world = world();
        let mut scheduler = scheduler(every());
        let (lost, infos) = (BTreeSet::new(), vec!["busy".to_owned(), String::new()]);
        let mut recorded = Vec::new();
        for _ in 0..60 {
            let run_status = RunStatus { live, ..run_status(&lost, &infos) };
            for (topic, message) in scheduler.due_for_recording(&mut world, &run_status) {
                let bytes = cdr::encode(&message);
                assert!(bytes.len() <= VIEW_BYTES_MAX, "{topic:?}");
                recorded.push((world.tick(), topic, bytes));
            }
            step(&mut world, [(0, Motion::Turn { angle_rad: 1.0 })]);
        }
        recorded
    };
    let recorded = run(Some(LiveStatus { rtf: Some(1.0), phases_s: &[("scan", 1.0)] }));
    assert_eq!(recorded, run(None));
    let ticks = |wanted: VisualisationTopic| -> Vec<u64> {
        recorded.iter().filter(|(_, topic, _)| *topic == wanted).map(|(tick, _, _)| tick.0).collect()
    };
    assert_eq!(ticks(VisualisationTopic::Odometry(AgentId(1))), (0..60).step_by(5).collect::<Vec<_>>());
    assert_eq!(ticks(VisualisationTopic::Points(SensorId::only(AgentId(1)))), [1, 11, 21, 31, 41, 51]);
    assert_eq!(ticks(VisualisationTopic::Map), [0]);
    assert_eq!(ticks(VisualisationTopic::Info), [0, 50]);
}

#[test]
fn one_word_records_every_topic() {
    for word in RecordedView::WORDS {
        serde_json::from_value::<RecordedView>((*word).into()).unwrap();
    }
    let topics = |record| scheduler(record).recorded_topics;
    let words = RecordedView::WORDS.iter().filter(|word| **word != "all");
    let each = words.map(|word| serde_json::from_value((*word).into()).unwrap()).collect();
    assert_eq!(topics(vec![RecordedView::All]), topics(each));
    assert_eq!(topics(vec![]), []);
}

/// What an observer knows of poses, as tf2 does, and what it looks up when a message arrives.
#[derive(Default)]
struct Listener {
    /// Position by agent and stamp in ns.
    positions: BTreeMap<(String, u64), [f64; 3]>,
    looked_up: usize,
    /// The latest stamp of each frame.
    latest: BTreeMap<String, u64>,
    /// Transforms with a stamp before one that came earlier.
    late: usize,
}

fn stamp_ns(header: &msgs::std_msgs::Header) -> u64 {
    header.stamp.sec as u64 * 1_000_000_000 + u64::from(header.stamp.nanosec)
}

impl Listener {
    /// `poses` are the true ones, by agent and stamp.
    fn take(&mut self, message: &VisualisationMessage, poses: &BTreeMap<(String, u64), [f64; 3]>) {
        let looked_up = match message {
            VisualisationMessage::Transforms(TFMessage { transforms }) => {
                for transform in transforms {
                    let at = transform.transform.translation;
                    let key = (transform.child_frame_id.clone(), stamp_ns(&transform.header));
                    let latest = self.latest.entry(key.0.clone()).or_default();
                    self.late += usize::from(key.1 < *latest);
                    *latest = key.1.max(*latest);
                    assert_eq!(self.positions.insert(key.clone(), [at.x, at.y, at.z]), None, "{key:?} comes twice");
                }
                return;
            }
            VisualisationMessage::Points(cloud) if cloud.header.frame_id != "map" => {
                (cloud.header.frame_id.clone(), stamp_ns(&cloud.header))
            }
            VisualisationMessage::Odometry(odometry) => (odometry.child_frame_id.clone(), stamp_ns(&odometry.header)),
            VisualisationMessage::Path(path) => ("agent_0/base_link".to_owned(), stamp_ns(&path.header)),
            _ => return,
        };
        assert_eq!(self.positions.get(&looked_up), Some(&poses[&looked_up]), "{looked_up:?}");
        self.looked_up += 1;
    }
}

/// Executes ticks of two moving agents, and passes the world at the start of each to `publish`.
fn with_moving_agents(mut publish: impl FnMut(&mut World, &BTreeMap<(String, u64), [f64; 3]>)) {
    let mut world = world();
    let mut poses = BTreeMap::new();
    let motion = |x| Motion::Velocity {
        linear_in_body_m_s: Vector3::new(x, 0.0, 0.0),
        yaw_rate_rad_s: 0.25,
        path: vec![Point3::new(2.0, 1.5, 1.5 + x)],
    };
    for tick in 0..400 {
        for agent in world.agents() {
            let at = world.body(agent).pose().position;
            poses.insert((crate::wire::body_frame(agent), world.tick().time_ns()), [at.x, at.y, at.z]);
        }
        publish(&mut world, &poses);
        step(&mut world, [(0, motion(0.1 + f64::from(tick % 3) * 0.01)), (1, motion(-0.1))]);
    }
}

#[test]
fn transforms_of_a_stamp_precede_what_has_it_at_every_speed() {
    let subscribers: Subscribers =
        VisualisationTopic::all(&Equipment::of_each(2, LidarTopics::default())).map(|topic| (topic, 1)).collect();
    for rtf in [1, 7, 20, 100] {
        let mut scheduler = scheduler(Vec::new());
        let (mut listener, mut ticks) = (Listener::default(), 0);
        with_moving_agents(|world, poses| {
            ticks += 1;
            let now = PublishTime { wall_ns: ticks * 20_000_000 / rtf, is_paused: false };
            let (lost, infos) = (BTreeSet::new(), vec![String::new(); 2]);
            for (_, message) in scheduler.due_live(world, &run_status(&lost, &infos), &subscribers, now) {
                listener.take(&message, poses);
            }
        });
        let wall_s = 8.0 / rtf as f64;
        assert!(listener.looked_up as f64 > 30.0 * wall_s, "{} messages at {rtf} x", listener.looked_up);
        // A reader of both topics may take a scan before the transform sent just before it.
        assert_eq!(listener.late, 0, "transforms after later ones at {rtf} x");
    }
}

#[test]
fn externally_controlled_agents_have_their_transform_before_their_sensors() {
    let mut scheduler = scheduler(Vec::new());
    let subscribers = Subscribers::from([(VisualisationTopic::Transforms, 1)]);
    let (lost, infos) = (BTreeSet::new(), vec![String::new(); 2]);
    let mut sent = BTreeSet::new();
    with_moving_agents(|world, _| {
        let now = PublishTime { wall_ns: world.tick().time_ns() / 50, is_paused: false };
        let messages = scheduler.due_live(world, &run_status(&lost, &infos), &subscribers, now);
        let transform = scheduler.due_before_sensors(world, AgentId(1), &subscribers);
        for message in messages.into_iter().map(|(_, message)| message).chain(transform) {
            let VisualisationMessage::Transforms(TFMessage { transforms }) = message else { unreachable!("of /tf") };
            let of_agent = transforms.iter().filter(|transform| transform.child_frame_id == "agent_1/base_link");
            of_agent.for_each(|transform| assert!(sent.insert(stamp_ns(&transform.header)), "twice"));
        }
        assert!(sent.contains(&world.tick().time_ns()));
    });
    let unsubscribed = scheduler.due_before_sensors(&world(), AgentId(1), &Subscribers::new());
    assert_eq!(unsubscribed, [], "without subscribers nothing is made");
}

#[test]
fn recorded_transforms_of_a_stamp_precede_what_has_it() {
    use RecordedView::{Odom, Path, Points};
    for period in [0, 5, 10, 7] {
        let settings = ViewsSection { record: vec![Odom, Points, Path], ..ViewsSection::default() };
        let mut scheduler =
            VisualisationScheduler::new(settings, &Equipment::of_each(2, LidarTopics::default()), period);
        let mut listener = Listener::default();
        let (lost, infos) = (BTreeSet::new(), vec![String::new(); 2]);
        with_moving_agents(|world, poses| {
            if period > 0 && world.tick().0.is_multiple_of(period.into()) {
                listener.take(&VisualisationMessage::Transforms(crate::wire::transforms(world)), poses);
            }
            for (_, message) in scheduler.due_for_recording(world, &run_status(&lost, &infos)) {
                listener.take(&message, poses);
            }
        });
        assert!(listener.looked_up > 2 * 80, "{} messages", listener.looked_up);
    }
}
