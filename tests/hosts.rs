//! Runs over several hosts, which are network namespaces with an emulated link between them: a run
//! is the same with delays, losses, reordering and an outage, and a lost host is its agents lost.
//!
//! They need root and TAP devices, and say `NOT TESTED` elsewhere.

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use link_emulator::{Link, Network, NetworkError, Outage};

use crate::support::binaries;
use crate::support::processes::{Ended, signal};
use crate::support::recordings::counter;
use crate::support::runs::{Site, scenario, text};

/// The run of most tests.
pub(crate) const RUN: [&str; 10] =
    ["--agents", "4", "--controller", "rbw", "--size", "40", "--seed", "7", "--duration", "120"];

/// A link that loses, delays and reorders.
pub(crate) fn bad_link() -> Link {
    Link { delay: Duration::from_millis(1), loss: 0.01, reordered: 0.1, outage: None, seed: 20 }
}

/// A network, unless this machine cannot have one.
pub(crate) fn network(hosts: usize, link: Link) -> Option<Network> {
    match Network::create(hosts, link) {
        Ok(network) => Some(network),
        Err(NetworkError::Unavailable(reason)) => {
            eprintln!("NOT TESTED: {reason}; it takes root, iproute2 and /dev/net/tun");
            None
        }
        Err(error) => panic!("{error}"),
    }
}

/// A command of the site on a host.
fn on_host(site: &Site, network: &Network, host: usize, name: &str) -> Command {
    let mut command = network.command(host, &binaries::folder().join(name));
    let of_site = site.binary(name);
    command.current_dir(of_site.get_current_dir().expect("a site has a folder"));
    for (variable, value) in of_site.get_envs() {
        match value {
            Some(value) => drop(command.env(variable, value)),
            None => drop(command.env_remove(variable)),
        }
    }
    command.env("ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET");
    command
}

/// Writes a file of hosts: the server is host 0, and the agents are on the others, in this
/// environment.
fn hosts_file(site: &Site, network: &Network, environment: &str) -> PathBuf {
    let mut file = format!("server = \"{}\"\n", network.address(0));
    for (number, name) in network.hosts().iter().enumerate().skip(1) {
        let command = "[\"ip\", \"netns\", \"exec\", \"{address}\"]";
        write!(file, "[[host]]\nname = \"h{number}\"\naddress = \"{name}\"\ncommand = {command}\n").expect("a text");
        writeln!(file, "environment = {{ {environment} }}").expect("a text");
    }
    site.file("hosts.toml", file)
}

/// `maes run --hosts` on host 0.
fn run_on_hosts(site: &Site, network: &Network, flags: &[&str]) -> Command {
    run_with_environment(site, network, flags, "")
}

/// The same, with entries of TOML for the environment of the agents.
pub(crate) fn run_with_environment(site: &Site, network: &Network, flags: &[&str], environment: &str) -> Command {
    let mut command = on_host(site, network, 0, "maes");
    command.arg("run").args(flags).arg("--hosts").arg(hosts_file(site, network, environment));
    command.arg("--logs").arg(site.path("logs"));
    command
}

#[track_caller]
pub(crate) fn in_memory(site: &Site, flags: &[&str]) -> String {
    let mut command = site.binary("maes");
    site.start(command.args(["run", "--transport", "memory"]).args(flags)).ended().with_code(0).digest()
}

#[track_caller]
fn logged(site: &Site, name: &str) -> String {
    let path = site.path("logs").join(name);
    std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// Without `maes run --hosts`: multicast alone brings server and agents together.
#[test]
fn hosts_in_one_subnet_find_each_other() {
    let Some(network) = network(2, bad_link()) else { return };
    let site = Site::new();
    let mut server = on_host(&site, &network, 0, "sim_server");
    let server = site.start(server.arg("run").arg(scenario("default.toml")).args(RUN));
    let mut agents = on_host(&site, &network, 1, "agent_node");
    let agents = site.start(agents.args(["--id", "0-3"]));
    let digest = server.ended().with_code(0).digest();
    agents.ended().with_code(0);
    assert_eq!(digest, in_memory(&site, &RUN));
    let counts = network.counts();
    assert!(counts.lost > 0 && counts.held_back > 0, "{counts:?}");
}

#[test]
fn lossy_link_changes_nothing() {
    let Some(network) = network(2, bad_link()) else { return };
    let site = Site::new();
    let ended = site.start(&mut run_on_hosts(&site, &network, &RUN)).ended().with_code(0);
    assert_eq!(ended.digest(), in_memory(&site, &RUN));
    let counts = network.counts();
    assert!(counts.lost > 0 && counts.held_back > 0, "{counts:?}");
}

/// Three hosts, and 5 s in which nothing arrives.
#[test]
fn outage_changes_nothing() {
    let outage = Some(Outage { after_frames: 600, lasts: Duration::from_secs(5) });
    let Some(network) = network(3, Link { outage, ..bad_link() }) else { return };
    let site = Site::new();
    let flags = [&RUN[..], &["--agents-per-process", "2"]].concat();
    let ended = site.start(&mut run_on_hosts(&site, &network, &flags)).ended().with_code(0);
    assert_eq!(ended.digest(), in_memory(&site, &RUN));
    assert!(network.counts().cut > 0, "{:?}", network.counts());
}

/// A script that stands for `maes` of another build on a host.
fn other_build(site: &Site) -> PathBuf {
    let folder = site.path("other");
    std::fs::create_dir(&folder).expect("the folder is new");
    let script = "#!/bin/sh\necho '{\"hello\":{\"build\":\"0.0.1+0123456789ab\",\"cores\":1}}'\nread -r end\n";
    site.file("other/maes", script);
    let status = Command::new("chmod").arg("755").arg(folder.join("maes")).status();
    assert!(status.expect("chmod runs").success());
    folder
}

fn local_host(site: &Site, lines: &str) -> PathBuf {
    site.file(
        "local.toml",
        format!("server = \"127.0.0.1\"\n[[host]]\nname = \"here\"\nlauncher = \"local\"\n{lines}\n"),
    )
}

#[track_caller]
fn refused(site: &Site, hosts: &Path, code: i32) -> Ended {
    let mut command = site.binary("maes");
    command.arg("run").args(RUN).arg("--hosts").arg(hosts).arg("--logs").arg(site.path("logs"));
    site.start(&mut command).ended().with_code(code)
}

#[test]
fn another_build_is_refused() {
    let site = Site::new();
    let folder = other_build(&site);
    let ended = refused(&site, &local_host(&site, &format!("binaries = \"{}\"", text(&folder))), 2);
    assert!(ended.stderr.contains("error: host \"here\": its build is 0.0.1+0123456789ab, and this is "), "{ended}");
    assert!(!site.path("logs").join("server.log").exists(), "the server was not started");
    let nowhere = local_host(&site, "binaries = \"/nowhere\"");
    let ended = refused(&site, &nowhere, 1);
    assert!(ended.stderr.contains("error: /nowhere/maes: No such file or directory"), "{ended}");
    let ended = refused(&site, &local_host(&site, "agents = \"0-7\""), 2);
    assert!(ended.stderr.contains("local.toml: host \"here\": agent 4 takes no part"), "{ended}");
}

/// An agent that cannot join ends the run, and its output is reported here.
#[test]
fn logs_and_exit_codes_come_back() {
    let Some(network) = network(1, Link::default()) else { return };
    let site = Site::new();
    let hosts = local_host(&site, "environment = { MAES_JOIN_SECRET = \"short\" }");
    let mut command = on_host(&site, &network, 0, "maes");
    command.arg("run").args(RUN).arg("--hosts").arg(hosts).arg("--logs").arg(site.path("logs"));
    let ended = site.start(&mut command).ended().with_code(2);
    let reason = "error: MAES_JOIN_SECRET: a join secret has 16 to 4096 bytes";
    assert!(ended.stderr.lines().any(|line| line.starts_with(reason)), "{ended}");
    assert!(logged(&site, "agent_0.log").starts_with(reason));
    assert!(!ended.stderr.contains("is lost"), "{ended}");
}

/// Kills all that runs on a host, as a loss of power would.
fn kill_host(network: &Network, host: usize) {
    let pids = Command::new("ip").args(["netns", "pids", &network.hosts()[host]]).output().expect("ip runs");
    for pid in String::from_utf8_lossy(&pids.stdout).lines().filter_map(|line| line.parse().ok()) {
        signal(pid, "KILL");
    }
}

#[track_caller]
fn with_a_killed_host(rule: &str) -> Option<(Site, Ended)> {
    let network = network(3, Link::default())?;
    let site = Site::new();
    let rule = format!("faults.on_agent_loss=\"{rule}\"");
    let recording = site.path("killed.mcap");
    let flags = [&RUN[..], &["--set", &rule, "--set", "execution.decision_timeout_s=2.0", "--rtf", "30"]].concat();
    let mut run = site.start(run_on_hosts(&site, &network, &flags).arg("--record").arg(&recording));
    run.is_under_way(&recording);
    kill_host(&network, 2);
    let ended = run.ended();
    Some((site, ended))
}

#[test]
fn lost_host_aborts_the_run() {
    let Some((_site, ended)) = with_a_killed_host("abort") else { return };
    let ended = ended.with_code(4);
    assert!(ended.stderr.contains("host h2 is lost: its launcher ended with exit code 137"), "{ended}");
}

#[test]
fn run_continues_without_a_lost_host() {
    let Some((site, ended)) = with_a_killed_host("drop") else { return };
    ended.with_code(0);
    assert_eq!(counter(&site.recording("killed.mcap").result(), "agents_dropped"), 2);
}

/// The launcher is started again, and the agents take up what they were.
#[test]
fn lost_host_comes_back() {
    let Some((site, ended)) = with_a_killed_host("wait") else { return };
    let ended = ended.with_code(0);
    let flags =
        [&RUN[..], &["--set", "faults.on_agent_loss=\"wait\"", "--set", "execution.decision_timeout_s=2.0"]].concat();
    assert_eq!(ended.digest(), in_memory(&site, &flags));
}
