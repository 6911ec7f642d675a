use std::f64::consts::TAU;
use std::sync::{Arc, Mutex};

use super::*;
use crate::testing::{World, flat};

/// A camera that looks 80 degrees wide and 60 degrees high.
const CAMERA: FieldOfView =
    FieldOfView { horizontal_rad: 1.4, lowest_rad: -0.5, highest_rad: 0.5, spacing_rad: 0.02, min_range_m: 0.0 };

/// Notes what it observes, and rests.
struct Resting(Arc<Mutex<Vec<Observation>>>);

impl Controller for Resting {
    fn decide(&mut self, observation: &Observation, _: &mut Ctx<'_>) -> Command {
        self.0.lock().unwrap().push(observation.clone());
        Command::new(Motion::Stop, WakeCondition::on(EventMask::MESSAGE)).with_stage(Stage::Waiting)
    }
}

/// Waits for a body in its way.
struct Blocked;

impl Controller for Blocked {
    fn decide(&mut self, _: &Observation, _: &mut Ctx<'_>) -> Command {
        Command::new(Motion::Stop, WakeCondition::on(EventMask::MESSAGE)).with_stage(Stage::Waiting)
    }

    fn is_blocked(&self) -> bool {
        true
    }
}

/// A world with a field of view, a wrapped controller, and what that has observed.
fn wrapped(map: &str, start: Cell, view: FieldOfView) -> (World, LookAround, Arc<Mutex<Vec<Observation>>>) {
    let mut world = World::known(map, start);
    world.run_info.field_of_view = Some(view);
    world.run_info.lidar_range_m = 20.0;
    world.observation.scan_tick = Some(Tick::ZERO);
    let seen = Arc::<Mutex<Vec<Observation>>>::default();
    let controller = LookAround::around(Box::new(Resting(Arc::clone(&seen))), world.setup().rng);
    (world, controller, seen)
}

#[test]
fn looks_at_what_is_unexplored_before_its_controller_decides() {
    let (mut world, mut controller, seen) = wrapped("##########\n?........#\n##########\n", flat(5, 1), CAMERA);
    world.observation.events = EventMask::NEW_CELL;
    let turn = world.ask(&mut controller);
    let Motion::Turn { angle_rad } = turn.motion else { panic!("{turn:?}") };
    assert!((2.0..3.0).contains(&angle_rad.abs()), "{angle_rad}");
    assert!(matches!(turn.lidar, ScanRequest::Every(10)) && seen.lock().unwrap().is_empty());
    world.wait(50);
    world.arrive(&turn.motion);
    let scan = world.ask(&mut controller);
    assert_eq!((scan.motion.clone(), scan.lidar), (Motion::Keep, ScanRequest::Every(10)));
    world.wait(1);
    world.observation.scan_tick = Some(world.observation.tick);
    world.ask(&mut controller);
    let [observation] = &seen.lock().unwrap()[..] else { panic!("it has decided once") };
    assert!(observation.events.contains(EventMask::NEW_CELL | EventMask::TASK_DONE));
    assert_eq!(observation.tick, Tick(51));
}

#[test]
fn what_is_in_view_needs_no_turn() {
    let (mut world, mut controller, seen) = wrapped("##########\n#........?\n##########\n", flat(5, 1), CAMERA);
    assert_eq!(world.ask(&mut controller).motion, Motion::Stop);
    assert_eq!(seen.lock().unwrap().len(), 1);
}

#[test]
fn rings_are_not_turned() {
    let ring = FieldOfView { horizontal_rad: TAU, ..CAMERA };
    let (mut world, mut controller, seen) = wrapped("##########\n?........#\n##########\n", flat(5, 1), ring);
    assert_eq!(world.ask(&mut controller).motion, Motion::Stop);
    assert_eq!(seen.lock().unwrap().len(), 1);
}

#[test]
fn viewpoints_that_its_controller_leaves_out_are_gone_to() {
    let ring = FieldOfView { horizontal_rad: TAU, ..CAMERA };
    let map = "##########\n#........#\n#####.####\n#####.####\n#####...?#\n##########\n";
    let (mut world, mut controller, _) = wrapped(map, flat(1, 4), ring);
    let rests = world.ask(&mut controller);
    assert_eq!(rests.wake.at, Tick(REST_TICKS));
    world.wait(REST_TICKS);
    let go = world.ask(&mut controller);
    assert!(go.info.starts_with("goes to the viewpoint ") && go.info.ends_with(" 1 0"), "{go:?}");
    world.arrive(&go.motion);
    world.map.note_wall(&[18]);
    world.ask(&mut controller);
    world.wait(2 * REST_TICKS);
    assert!(!world.ask(&mut controller).info.contains("viewpoint"), "nothing is left");
}

#[test]
fn without_a_field_of_view_its_controller_is_alone() {
    let (mut world, mut controller, seen) = wrapped("##########\n?........#\n##########\n", flat(5, 1), CAMERA);
    world.run_info.field_of_view = None;
    let command = world.ask(&mut controller);
    assert_eq!(command, Command::new(Motion::Stop, WakeCondition::on(EventMask::MESSAGE)).with_stage(Stage::Waiting));
    assert_eq!(seen.lock().unwrap().len(), 1);
}

/// A ring LiDAR in a world with something unexplored round a corner.
const CORNER: &str = "##########\n#........#\n#####.####\n#####.####\n#####...?#\n##########\n";
const RING: FieldOfView = FieldOfView { horizontal_rad: TAU, ..CAMERA };

#[test]
fn a_controller_that_waits_for_a_body_is_left_alone() {
    let (mut world, mut resting, _) = wrapped(CORNER, flat(1, 4), RING);
    let mut blocked = LookAround::around(Box::new(Blocked), world.setup().rng);
    assert_eq!(world.ask(&mut blocked).wake.at, Tick(u64::MAX));
    world.wait(10 * REST_TICKS);
    assert_eq!(world.ask(&mut blocked).motion, Motion::Keep);
    assert!(blocked.is_blocked() && !resting.is_blocked());
    assert_eq!(world.ask(&mut resting).wake.at, world.observation.tick.after(REST_TICKS));
}

#[test]
fn a_body_in_the_way_to_a_viewpoint_is_waited_for() {
    let (mut world, mut controller, _) = wrapped(CORNER, flat(4, 4), RING);
    let position = world.map.extent().centre(flat(5, 4));
    world.observation.contacts.push(protocol::observation::Contact { agent: msgs::ids::AgentId(2), position });
    world.ask(&mut controller);
    world.wait(REST_TICKS);
    assert!(world.ask(&mut controller).info.starts_with("goes to the viewpoint "));
    let waits = (0..30).any(|_| {
        world.wait(500);
        world.collide();
        let command = world.ask(&mut controller);
        let has_given_up = command.info == "waits for agent 2 to move";
        if !has_given_up && command.info == "makes way" {
            world.wait(400);
            world.ask(&mut controller);
            world.wait(2 * REST_TICKS);
            world.ask(&mut controller);
        }
        has_given_up
    });
    assert!(waits && controller.is_blocked());
}
