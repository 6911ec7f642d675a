//! Runs over Zenoh, in a build with the feature `zenoh`: the same as over other transports, and
//! seen and controlled by another implementation of the format of rmw_zenoh (`zenoh_observer.py`).
//! The router is `zenoh_router.py`.

use std::process::Command;
use std::sync::OnceLock;
use std::time::Duration;

use crate::hosts;
use crate::services::FLAGS;
use crate::support::processes::{Ended, Process, signal};
use crate::support::recordings::Recording;
use crate::support::runs::{Outcome, Run, Site, scenario, text};
use crate::support::{python, root};

/// The run that is compared.
const FIVE: [&str; 10] = ["--agents", "5", "--controller", "rbw", "--size", "50", "--seed", "7", "--duration", "300"];

/// A ROS domain over Zenoh, with a router of its own.
struct Network {
    site: Site,
    _router: Process,
}

impl Network {
    fn new() -> Self {
        let site = Site::new();
        let router = router(site.command(python::for_zenoh()), &endpoint(&site));
        Self { site, _router: router }
    }

    /// A command with its processes in this network.
    fn over<'a>(&self, command: &'a mut Command) -> &'a mut Command {
        over_zenoh(command, &endpoint(&self.site))
    }

    #[track_caller]
    fn record(&self, arguments: &[&str]) -> Outcome {
        self.site.record_with(self.over(&mut self.site.run_sh(arguments)))
    }

    fn start(&self, arguments: &[&str]) -> Run {
        self.site.start(self.over(&mut self.site.run_sh(arguments)))
    }
}

/// A port that is of this domain alone: below those that Linux hands out at random, and not of DDS.
fn port(site: &Site) -> u16 {
    1700 + site.domain().id()
}

fn endpoint(site: &Site) -> String {
    format!("tcp/127.0.0.1:{}", port(site))
}

/// The router at an endpoint; `python` is the command of the interpreter.
fn router(mut python: Command, endpoint: &str) -> Process {
    let mut router = Process::start(python.arg(root().join("tests/zenoh_router.py")).arg(endpoint));
    router.prints("ready");
    router
}

/// A command whose processes connect to the router at this endpoint.
fn over_zenoh<'a>(command: &'a mut Command, endpoint: &str) -> &'a mut Command {
    let connect = format!("connect/endpoints=[\"{endpoint}\"]");
    command.env("RMW_IMPLEMENTATION", "rmw_zenoh_cpp").env("ZENOH_CONFIG_OVERRIDE", connect)
}

/// The run [`FIVE`] in memory, executed once for all tests.
fn reference() -> &'static Outcome {
    static REFERENCE: OnceLock<Outcome> = OnceLock::new();
    REFERENCE.get_or_init(|| Site::new().record(&[&FIVE[..], &["--transport", "memory"]].concat()))
}

#[test]
fn runs_are_those_in_memory() {
    let network = Network::new();
    for variant in [
        &[][..],
        &["--order", "shuffle"],
        &["--agents-per-process", "2"],
        &["--chaos-delay-ms", "20"],
        &["--look-ahead", "false", "--threads", "8"],
    ] {
        let run = network.record(&[&FIVE[..], variant].concat());
        run.assert_same(reference(), &format!("over Zenoh {}", variant.join(" ")));
    }
}

#[test]
fn killed_agent_is_restarted() {
    let flags = ["--agents", "3", "--size", "30", "--duration", "600", "--set", "stop_when_explored=false"];
    let flags = [&flags[..], &["--controller", "dsvp", "--set", "faults.on_agent_loss=wait"]].concat();
    let network = Network::new();
    let paced = ["--rtf", "60", "--decision-timeout", "2", "--record", "run.mcap"];
    let mut run = network.start(&[&flags[..], &paced].concat());
    run.is_under_way(&network.site.path("run.mcap"));
    signal(run.process().member(&["agent_node", "--id 1-1"]), "KILL");
    run.process().says("agent 1 was started again; its observation log is replayed to it");
    run.ended().with_code(0);
    let undisturbed = network.site.record(&[&flags[..], &["--transport", "memory"]].concat());
    let bytes = std::fs::read(network.site.path("run.mcap")).expect("there is a recording");
    let difference = || Recording::from_bytes(&bytes).first_difference(&Recording::from_bytes(&undisturbed.bytes));
    assert!(bytes == undisturbed.bytes, "{}", difference());
}

/// Runs a scene of `zenoh_observer.py` on a run of two agents that starts paused, and returns its
/// end.
#[track_caller]
fn observed(network: &Network, flags: &[&str], scene: &str) -> Ended {
    let run = network.start(&[flags, &["--paused", "true", "--record", "run.mcap"]].concat());
    let mut observer = network.site.command(python::for_zenoh());
    observer.arg(root().join("tests/zenoh_observer.py")).arg(port(&network.site).to_string()).arg(scene);
    let observer = Process::start(&mut observer).ended().with_code(0);
    assert!(observer.stdout.contains("done"), "{observer}");
    run.ended()
}

#[test]
fn another_implementation_observes_and_controls_a_run() {
    let network = Network::new();
    let flags = [&FLAGS[..], &["--duration", "60"]].concat();
    let ended = observed(&network, &flags, "whole").with_code(0);
    let undisturbed = network.site.record(&[&flags[..], &["--transport", "memory"]].concat());
    assert_eq!(ended.digest(), undisturbed.digest());
}

#[test]
fn steps_are_an_action() {
    // Longer than it takes to cancel a goal.
    observed(&Network::new(), &[&FLAGS[..], &["--duration", "36000"]].concat(), "action").with_code(130);
}

#[test]
fn router_may_start_after_the_run() {
    let site = Site::new();
    let flags = ["--agents", "2", "--size", "20", "--duration", "10"];
    let mut run = site.start(over_zenoh(&mut site.run_sh(&flags), &endpoint(&site)));
    run.process().says("no Zenoh router is connected");
    let _router = router(site.command(python::for_zenoh()), &endpoint(&site));
    let ended = run.ended().with_code(0);
    assert_eq!(ended.digest(), site.record(&[&flags[..], &["--transport", "memory"]].concat()).digest());
}

/// With 0 as the number of attempts, the start has no limit.
#[test]
fn start_may_wait_for_a_router() {
    let site = Site::new();
    let flags = ["--agents", "2", "--size", "20", "--duration", "10"];
    let mut run_sh = site.run_sh(&flags);
    over_zenoh(&mut run_sh, &endpoint(&site)).env("ZENOH_ROUTER_CHECK_ATTEMPTS", "0").env("MAES_START_LIMIT_S", "1");
    let mut run = site.start(&mut run_sh);
    assert!(!run.process().says_within("waiting for agents", Duration::from_secs(5)), "no endpoints without a router");
    let _router = router(site.command(python::for_zenoh()), &endpoint(&site));
    run.ended().with_code(0);
}

/// Three hosts with a router on that of the server, whose clients the agents are.
#[test]
fn hosts_meet_at_one_router() {
    let Some(network) = hosts::network(3, hosts::bad_link()) else { return };
    let site = Site::new();
    let endpoint = format!("tcp/{}:7447", network.address(0));
    let _router = router(network.command(0, python::for_zenoh()), &endpoint);
    let environment = format!("ZENOH_CONFIG_OVERRIDE = 'mode=\"client\";connect/endpoints=[\"{endpoint}\"]'");
    let flags = [&hosts::RUN[..], &["--agents-per-process", "2"]].concat();
    let mut command = hosts::run_with_environment(&site, &network, &flags, &environment);
    let ended = site.start(over_zenoh(&mut command, &endpoint)).ended().with_code(0);
    assert_eq!(ended.digest(), hosts::in_memory(&site, &hosts::RUN));
    let counts = network.counts();
    assert!(counts.lost > 0 && counts.held_back > 0, "{counts:?}");
}

#[test]
fn bad_settings_are_named() {
    let site = Site::new();
    let file = site.file("session.json5", "{ mode: 7 }");
    for (variable, value) in [
        ("ZENOH_ROUTER_CHECK_ATTEMPTS", "often"),
        ("ZENOH_CONFIG_OVERRIDE", "mode"),
        ("ZENOH_SESSION_CONFIG_URI", text(&file)),
    ] {
        let mut server = site.binary("sim_server");
        server.arg("run").arg(scenario("default.toml")).env("RMW_IMPLEMENTATION", "rmw_zenoh_cpp").env(variable, value);
        let ended: Ended = Process::start(&mut server).ended();
        assert!(ended.stderr.contains(&format!("over Zenoh: {variable}")), "{variable}: {ended}");
        assert_eq!(ended.code, Some(1), "{ended}");
    }
}
