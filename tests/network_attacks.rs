//! RTPS packets of strangers at the DDS library of a server and an agent: a few bytes that claim
//! gigabytes take no memory, stop nothing, and leave the run as it is; other addresses of the
//! machine than loopback are closed.

use std::fs;
use std::net::{IpAddr, Ipv4Addr, UdpSocket};

use crate::support::processes::{Process, signal};
use crate::support::rtps::{
    FakeParticipant, PUBLICATIONS_READER, PUBLICATIONS_WRITER, SUBSCRIPTIONS_READER, SUBSCRIPTIONS_WRITER,
    discovery_ports,
};
use crate::support::runs::{Run, Site, scenario, text};

/// Most memory of a process under attack, kB. A run as small as these takes some 30 000.
const MEMORY_MAX_KB: u64 = 300_000;

/// A few seconds of sim time.
const SHORT: [&str; 6] = ["--agents", "2", "--size", "30", "--duration", "20"];

pub(crate) const LOOPBACK: IpAddr = IpAddr::V4(Ipv4Addr::LOCALHOST);

/// A server that waits for agent 1, with agent 0.
pub(crate) struct Waiting {
    pub(crate) site: Site,
    server: Run,
    agent: Process,
}

impl Waiting {
    pub(crate) fn start() -> Self {
        let site = Site::new();
        let agent = Process::start(site.binary("agent_node").args(["--id", "0"]));
        let mut server = site.binary("sim_server");
        // It waits for as long as it is attacked: hours, if it is fuzzed.
        server.arg("run").arg(scenario("default.toml")).args(SHORT).args(["--join-timeout", "1e6"]);
        let mut server = site.start(&mut server);
        server.process().says("waiting for agents: 1");
        Self { site, server, agent }
    }

    /// The discovery ports of both processes.
    #[track_caller]
    pub(crate) fn ports(&self) -> Vec<u16> {
        let ports = discovery_ports(self.site.domain().id());
        assert_eq!(ports.len(), 2, "a server and an agent: {ports:?}");
        ports
    }

    /// Processor time that both have taken, s.
    pub(crate) fn processor_time_s(&mut self) -> f64 {
        let ticks = [self.server.process().pid(), self.agent.pid()].map(|pid| {
            let stat = fs::read_to_string(format!("/proc/{pid}/stat")).expect("the process runs");
            let (_, after_name) = stat.rsplit_once(')').expect("its name is in brackets");
            // Fields 14 and 15, utime and stime; the first one after the name is field 3.
            let times = after_name.split_whitespace().skip(11).take(2);
            times.map(|field| field.parse::<f64>().expect("a number")).sum::<f64>()
        });
        // USER_HZ is 100 on every Linux.
        ticks.iter().sum::<f64>() / 100.0
    }

    /// Fails if one of them has ever taken too much memory.
    #[track_caller]
    pub(crate) fn assert_small(&mut self) {
        for pid in [self.server.process().pid(), self.agent.pid()] {
            let status = fs::read_to_string(format!("/proc/{pid}/status")).expect("the process runs");
            let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).expect("Linux says the peak");
            let peak: u64 = peak.trim_end_matches("kB").trim().parse().expect("a number");
            assert!(peak < MEMORY_MAX_KB, "process {pid} has taken {peak} kB");
        }
    }

    /// Starts agent 1, and fails unless the run is what it is without strangers.
    pub(crate) fn assert_undisturbed(self) {
        let alone = Site::new();
        let mut undisturbed = alone.binary("maes");
        undisturbed.args(["run", "--transport", "memory"]).arg(text(&scenario("default.toml"))).args(SHORT);
        let second = Process::start(self.site.binary("agent_node").args(["--id", "1"]));
        let ended = self.server.ended().with_code(0);
        self.agent.ended().with_code(0);
        second.ended().with_code(0);
        assert_eq!(ended.digest(), alone.start(&mut undisturbed).ended().with_code(0).digest());
    }
}

/// Whether the programs under test have the fixes that a test is about.
pub(crate) fn has_fixes() -> bool {
    let has_fixes = ros_node::has_dds_fixes();
    if !has_fixes {
        eprintln!("NOT TESTED: this build has the published DDS library; launch_scripts/patched_rustdds.sh patches it");
    }
    has_fixes
}

/// All attacks on one process, until it has processed them.
fn attack(port: u16, number: u32) {
    let to = (LOOPBACK, port);
    let stranger = FakeParticipant::new(number);
    stranger.introduce(to);
    for ids in [[PUBLICATIONS_READER, PUBLICATIONS_WRITER], [SUBSCRIPTIONS_READER, SUBSCRIPTIONS_WRITER]] {
        // Sample 1 stays missing, so that the gap is above it.
        stranger.heartbeat(to, ids, [1, 1 << 50], 1);
        stranger.gap(to, ids, 3, 1 << 50);
        for sample in 1..=200 {
            stranger.fragment(to, ids, sample, 1, u32::MAX - 15);
            stranger.fragment(to, ids, sample, 1 << 20, 1 << 24);
        }
        stranger.is_acknowledged(to, ids, 1 << 51);
    }
}

#[test]
fn claimed_sizes_take_no_memory_and_change_nothing() {
    if !has_fixes() {
        return;
    }
    let mut waiting = Waiting::start();
    for (number, port) in (0..).zip(waiting.ports()) {
        for round in 0..10 {
            attack(port, number * 100 + round);
        }
    }
    waiting.assert_small();
    waiting.assert_undisturbed();
}

#[test]
fn attacked_processes_can_be_terminated() {
    if !has_fixes() {
        return;
    }
    let mut waiting = Waiting::start();
    for (number, port) in (0..).zip(waiting.ports()) {
        attack(port, number);
    }
    signal(waiting.agent.pid(), "TERM");
    signal(waiting.server.process().pid(), "TERM");
    waiting.agent.ended().with_code(0);
    waiting.server.ended().with_code(130);
}

/// Under LOCALHOST, with any build.
#[test]
fn other_addresses_of_the_machine_are_closed() {
    // Sends nothing: chooses the local address of a route.
    let route = UdpSocket::bind("0.0.0.0:0").expect("there is a free port");
    let address = route.connect("192.0.2.77:9").and_then(|()| route.local_addr()).map(|address| address.ip());
    let Some(other) = address.ok().filter(|address| !address.is_loopback()) else {
        eprintln!("NOT TESTED: this machine has no address but those of loopback");
        return;
    };
    let waiting = Waiting::start();
    for (number, port) in (0..).step_by(2).zip(waiting.ports()) {
        let (outside, inside) = (FakeParticipant::new(number), FakeParticipant::new(number + 1));
        outside.announce((other, port));
        // What comes later to the same port is answered, so the first packet would have been.
        inside.introduce((LOOPBACK, port));
        assert!(!outside.has_received(), "{other}:{port} is open");
    }
    waiting.assert_undisturbed();
}
