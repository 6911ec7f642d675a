//! Teams of aerial bodies, and of bodies of several kinds, in whole runs.

use std::sync::atomic::AtomicBool;
use std::time::Duration;

use agent_node::controllers::NAMES;
use experiments::single::{Grouping, Team, run};
use msgs::body_model::{BodyKind, BodyModel};
use msgs::cdr;
use msgs::ids::AgentId;
use msgs::maes_msgs::Result as RunResult;
use sim_server::session::RunObserver;
use sim_server::setup;
use simulation::scenario::Scenario;
use simulation::world::World;

struct Nobody;

impl RunObserver for Nobody {
    fn waiting(&mut self, _missing: &[AgentId]) {}
    fn started(&mut self) {}
    fn progress(&mut self, _world: &World) {}
    fn note(&mut self, _text: &str) {}
}

/// Carries a scenario out, of which nothing that an agent says is refused.
fn result(scenario: &str, grouping: Grouping) -> RunResult {
    let scenario = Scenario::parse("the test's scenario", scenario, &[]).expect("a legal scenario");
    let team = Team { grouping, chaos_delay: Duration::ZERO, decision_times: None };
    let finished = run(&scenario, &team, &mut Nobody, &AtomicBool::new(false)).expect("the run has a result");
    let result = finished.outcome.result;
    let refused = result.counters.iter().filter(|one| one.name.starts_with("refused_") && one.value > 0);
    assert_eq!(refused.count(), 0, "{:?}", result.counters);
    result
}

#[test]
fn every_controller_explores_a_small_cave_with_aerial_bodies() {
    for name in NAMES {
        let scenario = format!(
            "seed = 4\nduration_s = 400.0\nmap = {{ kind = \"spheres\", size = 20 }}\nbody = {{ kind = \"aerial\" }}\n\
             agents = {{ count = 2, controller = \"{name}\" }}\nexecution = {{ threads = 1 }}\n"
        );
        let result = result(&scenario, Grouping::Together);
        let least = if name.starts_with("rbw") { 0.8 } else { 0.999 };
        assert!(result.explored >= least, "{name}: {} after {} ticks", result.explored, result.tick);
    }
}

/// Two submarines and two aerial bodies, one of them small and quick.
fn mixed(controller: &str, execution: &str) -> String {
    format!(
        "seed = 5\nduration_s = 120.0\nmap = {{ kind = \"spheres\", size = 40 }}\n\
         agents = {{ count = 4, controller = \"{controller}\" }}\nexecution = {{ {execution} }}\n\
         [[bodies]]\nagents = [1]\nkind = \"aerial\"\n\
         [[bodies]]\nagents = [2]\nkind = \"aerial\"\nradius_m = 0.2\nspeed_max_m_s = 5.0\nacceleration_m_s2 = 6.0\n"
    )
}

#[test]
fn a_mixed_team_has_the_same_run_however_it_is_run() {
    for controller in ["rbw", "dsvp-auction"] {
        let run = |execution: &str, grouping| result(&mixed(controller, execution), grouping);
        let first = run("threads = 1", Grouping::Apart);
        for (execution, grouping) in [
            ("threads = 1", Grouping::Apart),
            ("threads = 4", Grouping::Together),
            ("threads = 1, look_ahead = false", Grouping::Together),
        ] {
            let again = run(execution, grouping);
            assert_eq!(again.digest, first.digest, "{controller}, {execution}");
        }
        let (submarine_m, aerial_m) = (first.distance_m[0], first.distance_m[1]);
        assert!(aerial_m > submarine_m, "{controller}: {aerial_m} m and {submarine_m} m");
    }
}

#[test]
fn an_agent_learns_of_all_bodies_what_the_scenario_says() {
    let scenario = Scenario::parse("the test's scenario", &mixed("rbw", ""), &[]).expect("a legal scenario");
    let (world, _report) = setup::build(&scenario).expect("there is such a world");
    let told = cdr::encode(&simulation::wire::scenario(&scenario, &world.terrain().extent(), world.rays()));
    let run_info = agent_node::wire::run_info(&cdr::decode(&told).expect("a scenario")).expect("a legal scenario");
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
    // Paces are measured with the submarine of the server's defaults.
    assert_eq!(*run_info.bodies.of(AgentId(0)), BodyModel::SUBMARINE);
}
