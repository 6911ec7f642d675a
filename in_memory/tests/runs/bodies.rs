//! Complete runs of teams of aerial bodies, and of bodies of several kinds.

use std::sync::atomic::AtomicBool;

use agent_node::controllers::NAMES;
use in_memory::in_process::{AgentOptions, ThreadLayout, run};
use msgs::cdr;
use msgs::ids::AgentId;
use msgs::maes_msgs::Result as RunResult;
use protocol::body_model::{BodyKind, BodyModel};
use sim_server::session::NullObserver;
use sim_server::setup;
use simulation::scenario::Scenario;

/// The result of a scenario; fails if the server refuses a message of an agent.
fn result(scenario: &str, threads: ThreadLayout) -> RunResult {
    let scenario = Scenario::parse("the test's scenario", scenario, &[]).expect("a legal scenario");
    let options = AgentOptions { threads, ..AgentOptions::default() };
    let completed = run(&scenario, &options, &mut NullObserver, &AtomicBool::new(false)).expect("the run has a result");
    let result = completed.outcome.result;
    let refused = result.counters.iter().filter(|one| one.is_refusal() && one.value > 0);
    assert_eq!(refused.count(), 0, "{:?}", result.counters);
    result
}

#[test]
fn every_controller_explores_with_aerial_bodies() {
    for name in NAMES {
        let scenario = format!(
            "seed = 4\nduration_s = 400.0\nmap = {{ kind = \"spheres\", size = 20 }}\nbody = {{ kind = \"aerial\" }}\n\
             agents = {{ count = 2, controller = \"{name}\" }}\nexecution = {{ threads = 1 }}\n"
        );
        let result = result(&scenario, ThreadLayout::Together);
        let least = if name.starts_with("rbw") { 0.8 } else { 0.999 };
        assert!(result.explored >= least, "{name}: {} after {} ticks", result.explored, result.tick);
    }
}

/// Two submarines and two aerial bodies, one of which is small and fast.
fn mixed(controller: &str, execution: &str) -> String {
    format!(
        "seed = 5\nduration_s = 120.0\nmap = {{ kind = \"spheres\", size = 40 }}\n\
         agents = {{ count = 4, controller = \"{controller}\" }}\nexecution = {{ {execution} }}\n\
         [[bodies]]\nagents = [1]\nkind = \"aerial\"\n\
         [[bodies]]\nagents = [2]\nkind = \"aerial\"\nradius_m = 0.2\nspeed_max_m_s = 5.0\nacceleration_m_s2 = 6.0\n"
    )
}

#[test]
fn result_of_a_mixed_team_does_not_depend_on_threads() {
    for controller in ["rbw", "dsvp-auction"] {
        let run = |execution: &str, threads| result(&mixed(controller, execution), threads);
        let first = run("threads = 1", ThreadLayout::PerAgent);
        for (execution, threads) in [
            ("threads = 1", ThreadLayout::PerAgent),
            ("threads = 4", ThreadLayout::Together),
            ("threads = 4", ThreadLayout::Team),
            ("threads = 1, look_ahead = false", ThreadLayout::Together),
        ] {
            let repeated = run(execution, threads);
            assert_eq!(repeated.digest, first.digest, "{controller}, {execution}");
        }
        let (submarine_m, aerial_m) = (first.distance_m[0], first.distance_m[1]);
        assert!(aerial_m > submarine_m, "{controller}: {aerial_m} m and {submarine_m} m");
    }
}

#[test]
fn agents_get_the_bodies_of_the_scenario() {
    let scenario = Scenario::parse("the test's scenario", &mixed("rbw", ""), &[]).expect("a legal scenario");
    let (world, _report) = setup::build(&scenario).expect("there is such a world");
    let message = cdr::encode(&simulation::wire::scenario(&scenario, &world.terrain().extent(), world.rays()));
    let message = cdr::decode(&message).expect("a scenario");
    let run_info = protocol::run_info::RunInfo::from_message(&message, AgentId(0)).expect("a legal scenario");
    let others = scenario.other_bodies();
    for agent in (0..4).map(AgentId) {
        let (body, model) = (run_info.bodies.of(agent), others.get(&agent).unwrap_or(&scenario.body));
        assert_eq!(body.kind == BodyKind::Aerial, model.kind == BodyKind::Aerial);
        let numbers = [
            body.radius_m,
            body.speed_max_m_s,
            body.acceleration_m_s2,
            body.deceleration_m_s2,
            body.turn_rate_max_rad_s,
            body.turn_acceleration_rad_s2,
            body.turn_deceleration_rad_s2,
        ];
        assert_eq!(numbers, model.numbers().map(|(_, number)| number));
    }
    // Travel times are measured with the default submarine of the server.
    assert_eq!(*run_info.bodies.of(AgentId(0)), BodyModel::SUBMARINE);
}
