//! Mixed teams with a controller that decides in place of those of the scenario.

use std::sync::atomic::AtomicBool;

use experiments::in_process::{AgentOptions, InProcessError, run};
use sim_server::session::NullObserver;
use simulation::scenario::Scenario;

fn digest(agents: &str, substitute: Option<&str>) -> Result<[u8; 32], InProcessError> {
    let text = format!(
        "seed = 4\nduration_s = 20.0\nmap = {{ kind = \"spheres\", size = 20 }}\nexecution = {{ threads = 1 }}\n\
         agents = {{ count = 2, {agents} }}\n"
    );
    let scenario = Scenario::parse("the test's scenario", &text, &[]).expect("a legal scenario");
    let options = AgentOptions { substitute: substitute.map(str::to_owned), ..AgentOptions::default() };
    let completed = run(&scenario, &options, &mut NullObserver, &AtomicBool::new(false))?;
    Ok(completed.outcome.result.digest)
}

const MIX: &str = "controller = \"rbw\", mix = [{ share = 0.5, controller = \"lvd\", set = { visit_radius_m = 5.0 } }]";

#[test]
fn substitute_needs_no_settings_of_the_mix() {
    // `nearest-frontier` has no `visit_radius_m`, and gets only the settings of `agents.set`.
    let substituted = digest(MIX, Some("nearest-frontier")).expect("it decides for all agents");
    assert_ne!(substituted, digest(MIX, None).expect("both controllers decide"));
}

#[test]
fn settings_of_the_mix_belong_to_its_controller() {
    let of_all = "controller = \"lvd\", set = { visit_radius_m = 5.0 }, mix = [{ share = 0.5, controller = \"rbw\" }]";
    assert!(digest(of_all, None).is_ok(), "rbw gets no setting of lvd");
    let wrong = MIX.replace("\"lvd\"", "\"rbw\"");
    let refused = digest(&wrong, None).expect_err("rbw has no such setting").to_string();
    assert!(refused.contains("controller rbw: setting `visit_radius_m`: unknown"), "{refused}");
}
