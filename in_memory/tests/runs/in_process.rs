//! Runs in one process: a controller that decides in place of those of the scenario, and one that
//! fails.

use std::sync::atomic::AtomicBool;

use agent_node::command::{Command, WakeCondition};
use agent_node::controllers::{Controller, Ctx, Failure, Registration, Registry};
use agent_node::observation::Observation;
use in_memory::in_process::{AgentOptions, InProcessError, ThreadLayout, run};
use msgs::ids::AgentId;
use sim_server::session::{NullObserver, RunObserver};
use simulation::scenario::Scenario;
use world::World;

fn scenario(agents: &str) -> Scenario {
    let text = format!(
        "seed = 4\nduration_s = 20.0\nmap = {{ kind = \"spheres\", size = 20 }}\nexecution = {{ threads = 1 }}\n\
         agents = {{ count = 2, {agents} }}\n"
    );
    Scenario::parse("the test's scenario", &text, &[]).expect("a legal scenario")
}

fn digest(agents: &str, substitute: Option<&str>) -> Result<[u8; 32], InProcessError> {
    let scenario = scenario(agents);
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

/// Fails at its first decision, as a controller in Python does that raises an exception.
struct Failing;

impl Controller for Failing {
    fn decide(&mut self, _observation: &Observation, _ctx: &mut Ctx<'_>) -> Command {
        Command::keep(WakeCondition::TASK_DONE)
    }

    fn failure(&mut self) -> Option<Failure> {
        Some("no plan".into())
    }
}

const OWN: &[Registration] = &[Registration {
    name: "failing",
    description: "fails: for tests",
    stream: "failing",
    construct: &|_, _| Ok(Box::new(Failing)),
}];

/// The lines for people.
#[derive(Default)]
struct Notes(Vec<String>);

impl RunObserver for Notes {
    fn waiting(&mut self, _missing: &[AgentId]) {}
    fn started(&mut self) {}
    fn progress(&mut self, _world: &World) {}
    fn note(&mut self, _level: transport::Level, text: &str) {
        self.0.push(text.to_owned());
    }
}

/// The server waited two seconds for the answer of an agent that had ended.
#[test]
fn agents_that_have_failed_are_not_waited_for() {
    for threads in [ThreadLayout::Team, ThreadLayout::Together] {
        let registry = Registry::with(OWN).expect("a new name");
        let options = AgentOptions { registry, threads, ..AgentOptions::default() };
        let mut notes = Notes::default();
        let ended = run(&scenario("controller = \"failing\""), &options, &mut notes, &AtomicBool::new(false));
        let error = ended.expect_err("the agents fail").to_string();
        assert!(error.contains("no plan"), "{error}");
        let unanswered: Vec<&String> = notes.0.iter().filter(|note| note.contains("no acknowledgement")).collect();
        assert!(unanswered.is_empty(), "{threads:?}: {unanswered:?}");
    }
}

/// As over ROS 2: a cave that was read with its inside as wall is explored from outside.
#[test]
fn warnings_about_a_map_file_are_notes_of_the_run() {
    let folder = tempfile::tempdir().expect("a folder");
    let mesh = folder.path().join("cave.obj");
    let corners: String =
        (0..8).map(|bits| format!("v {} {} {}\n", 20 * (bits & 1), 10 * (bits & 2), 5 * (bits & 4))).collect();
    let faces = "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n";
    std::fs::write(&mesh, format!("{corners}{faces}")).expect("a file");
    let text = format!(
        "seed = 1\nduration_s = 0.2\nexecution = {{ threads = 1 }}\nagents = {{ count = 1 }}\n\
         map = {{ kind = \"file\", file = {:?}, import = {{ margin_cells = 6 }} }}\n",
        mesh.display().to_string()
    );
    let scenario = Scenario::parse("the test's scenario", &text, &[]).expect("a legal scenario");
    let mut notes = Notes::default();
    run(&scenario, &AgentOptions::default(), &mut notes, &AtomicBool::new(false)).expect("it runs");
    assert!(notes.0.iter().any(|note| note.starts_with("the inside of the mesh is wall")), "{:?}", notes.0);
}
