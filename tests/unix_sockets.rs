//! Runs with `execution.unix_sockets`: the same as over ROS 2 alone, observed and disturbed in the
//! same way.

use std::collections::BTreeSet;
use std::fs;
use std::io::Write;
use std::os::linux::net::SocketAddrExt;
use std::os::unix::net::{SocketAddr, UnixStream};

use crate::observers::observers_receive_everything;
use crate::recovery::{self, PACED, assert_undisturbed};
use crate::support::processes::{Process, signal};
use crate::support::recordings::{Recording, refusals};
use crate::support::runs::{Outcome, Run, Site};

const SOCKETS: &str = "--unix-sockets";

/// The run that is compared.
const FIVE: [&str; 10] = ["--agents", "5", "--controller", "dsvp", "--size", "40", "--seed", "7", "--duration", "300"];

/// A run that a test interrupts.
const SLOW: [&str; 12] = [
    "--agents",
    "3",
    "--size",
    "30",
    "--duration",
    "600",
    "--set",
    "stop_when_explored=false",
    "--record",
    "run.mcap",
    "--rtf",
    "10",
];

fn in_memory(arguments: &[&str]) -> Outcome {
    Site::new().record(&[arguments, &["--transport", "memory"]].concat())
}

/// The name of the socket of the server of a run, and how many connections it has.
fn socket_of(run: &mut Run) -> Option<(String, usize)> {
    let server = run.process().member(&["sim_server", "run"]);
    let links = fs::read_dir(format!("/proc/{server}/fd")).expect("the server runs");
    let inodes: BTreeSet<String> = links
        .filter_map(|link| fs::read_link(link.ok()?.path()).ok()?.to_str().map(str::to_owned))
        .filter_map(|target| Some(target.strip_prefix("socket:[")?.strip_suffix(']')?.to_owned()))
        .collect();
    let table = fs::read_to_string(format!("/proc/{server}/net/unix")).expect("Linux lists the sockets");
    // Columns: number, count, protocol, flags, type, state, inode, name.
    let own = table.lines().map(|line| line.split_whitespace().collect::<Vec<_>>());
    let named: Vec<_> = own
        .filter(|columns| columns.len() == 8 && inodes.contains(columns[6]) && columns[7].starts_with("@maes/"))
        .collect();
    let name = named.first()?[7].trim_start_matches('@').to_owned();
    // Accepted connections have the name of the socket that they were accepted from.
    Some((name, named.len() - 1))
}

fn slow(site: &Site, flags: &[&str]) -> Run {
    let mut run = site.start(&mut site.run_sh(&[&SLOW[..], flags].concat()));
    run.is_under_way(&site.path("run.mcap"));
    run
}

/// Fails unless a run is the beginning of the undisturbed one, without refusals.
#[track_caller]
fn assert_undisturbed_so_far(site: &Site, mut run: Run) {
    signal(run.process().pid(), "INT");
    run.ended().with_code(130);
    let recording = site.recording("run.mcap");
    let flags: Vec<&str> = SLOW[..8].to_vec();
    recording.assert_begins(&Recording::from_bytes(&in_memory(&flags).bytes), 1);
    assert_eq!(refusals(&recording.result()).len(), 0, "{:?}", recording.result().counters);
}

#[test]
fn runs_are_those_in_memory() {
    let site = Site::new();
    let reference = in_memory(&FIVE);
    for variant in [
        &[][..],
        &["--agents-per-process", "5"],
        &["--agents-per-process", "2", "--order", "shuffle"],
        &["--chaos-delay-ms", "20"],
        &["--look-ahead", "false", "--threads", "8"],
    ] {
        let run = site.record(&[&FIVE[..], &[SOCKETS], variant].concat());
        run.assert_same(&reference, &format!("{SOCKETS} {}", variant.join(" ")));
    }
}

#[test]
fn every_process_is_connected() {
    let site = Site::new();
    let mut run = slow(&site, &[SOCKETS, "--agents-per-process", "2"]);
    let (_, connections) = socket_of(&mut run).expect("the server has a socket");
    assert_eq!(connections, 2);
    assert_undisturbed_so_far(&site, run);

    let site = Site::new();
    let mut run = slow(&site, &[]);
    assert_eq!(socket_of(&mut run), None, "no sockets were asked for");
    assert_undisturbed_so_far(&site, run);
}

#[test]
fn observers_receive_everything_beside_sockets() {
    observers_receive_everything(&[SOCKETS]);
}

#[test]
fn killed_agent_is_restarted() {
    let site = Site::new();
    let mut run = recovery::started(&site, &[&PACED[..], &[SOCKETS]].concat());
    signal(run.process().member(&["agent_node", "--id 1-1"]), "KILL");
    run.process().says("agent 1 was started again; its observation log is replayed to it");
    assert_eq!(socket_of(&mut run).map(|(_, connections)| connections), Some(3), "the new process is connected, too");
    assert_undisturbed(&site, run);
}

#[test]
fn hanging_agent_is_awaited() {
    let site = Site::new();
    let mut run = recovery::started(&site, &[&PACED[..], &[SOCKETS]].concat());
    let agent = run.process().member(&["agent_node", "--id 1-1"]);
    signal(agent, "STOP");
    run.process().says("the clock is held until they are started again");
    signal(agent, "CONT");
    assert_undisturbed(&site, run);
}

#[test]
fn second_process_for_an_id_is_refused() {
    let site = Site::new();
    let mut run = slow(&site, &[SOCKETS]);
    let second = Process::start(site.binary("agent_node").args(["--id", "1"])).ended().with_code(5);
    assert_eq!(second.stderr, "error: agent 1 was refused by the server: agent 1 is taken by another process");
    let unknown = Process::start(site.binary("agent_node").args(["--id", "1-3"])).ended().with_code(5);
    assert!(unknown.stderr.starts_with("error: agent "), "{unknown}");
    signal(run.process().pid(), "INT");
    run.ended().with_code(130);
    assert_eq!(refusals(&site.recording("run.mcap").result()).into_keys().collect::<Vec<_>>(), ["refused_id_taken"]);
}

/// Another process of the user connects and sends what is no frame, or says nothing.
#[test]
fn strangers_change_nothing() {
    let site = Site::new();
    let mut run = slow(&site, &[SOCKETS]);
    let (name, _) = socket_of(&mut run).expect("the server has a socket");
    let connect = || {
        let address = SocketAddr::from_abstract_name(&name).expect("it is a name");
        UnixStream::connect_addr(&address).expect("the user may connect")
    };
    let mut garbage = connect();
    garbage.write_all(&[0xff; 1000]).expect("the socket takes it");
    let _silent: Vec<_> = (0..20).map(|_| connect()).collect();
    run.process().says("a connection to the Unix socket was ended (1 so far): what it has sent is no frame");
    assert_undisturbed_so_far(&site, run);
}
