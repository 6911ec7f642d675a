//! Attacks on the page and the WebSocket: other doors, foreign pages, clients without the token,
//! paths in requests, and clients that use up connections, memory or files.

use std::fs;
use std::io::{ErrorKind, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::Command;
use std::time::Duration;

use serde_json::{Value, json};
use tungstenite::Message;

use crate::foxglove_server::get;
use crate::support::HANG;
use crate::support::foxglove::{Client, handshake};
use crate::support::processes::Process;
use crate::support::recordings::Recording;
use crate::support::runs::{Run, Site, text};

const FOXGLOVE: (&str, &str) = ("sec-websocket-protocol", "foxglove.sdk.v1");

/// Connections and clients that a server has at most.
const CONNECTIONS_MAX: usize = 128;
const CLIENTS_MAX: usize = 32;

/// An idle server, and its address with the token.
fn idle(site: &Site, flags: &[&str]) -> (Run, String) {
    let mut server = site.binary("sim_server");
    server.args(["run", "--idle", "--view", "127.0.0.1:0", "--ready"]).arg(site.path("ready")).args(flags);
    let mut server = site.start(&mut server);
    let address = server.address();
    (server, address)
}

fn host(address: &str) -> &str {
    address.split('/').next().expect("an address")
}

fn token(address: &str) -> &str {
    address.split_once("?token=").expect("a token").1
}

fn connect(address: &str) -> TcpStream {
    let stream = TcpStream::connect(host(address)).expect("the server is there");
    stream.set_read_timeout(Some(HANG)).expect("a stream has time-outs");
    stream
}

/// Whether the other end closes a connection, after what it may have sent.
fn is_closed(stream: &mut TcpStream) -> bool {
    match stream.read_to_end(&mut Vec::new()) {
        Ok(_) => true,
        Err(error) => error.kind() == ErrorKind::ConnectionReset,
    }
}

fn open_files(pid: u32) -> usize {
    fs::read_dir(format!("/proc/{pid}/fd")).map_or(0, Iterator::count)
}

/// Resident memory in kB.
fn memory_kb(pid: u32) -> u64 {
    let status = fs::read_to_string(format!("/proc/{pid}/status")).expect("it runs");
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).expect("a process has memory");
    line.trim_end_matches("kB").trim().parse().expect("a number")
}

/// The TCP ports at which a process listens.
fn listening_ports(pid: u32) -> Vec<u16> {
    let links = fs::read_dir(format!("/proc/{pid}/fd"))
        .expect("it runs")
        .filter_map(|entry| fs::read_link(entry.ok()?.path()).ok());
    let own: Vec<String> = links.map(|link| link.display().to_string()).collect();
    let mut ports = Vec::new();
    for table in ["tcp", "tcp6"] {
        let table = fs::read_to_string(format!("/proc/{pid}/net/{table}")).unwrap_or_default();
        for line in table.lines().skip(1) {
            let fields: Vec<&str> = line.split_whitespace().collect();
            if fields[3] == "0A" && own.contains(&format!("socket:[{}]", fields[9])) {
                let (_, port) = fields[1].rsplit_once(':').expect("a port");
                ports.push(u16::from_str_radix(port, 16).expect("a number"));
            }
        }
    }
    ports
}

fn start(client: &mut Client, request: &Value) -> Value {
    let answer = client.call_raw("/sim_server/start_run", "json", request.to_string().as_bytes());
    serde_json::from_slice(&answer.expect("it answers")).expect("an answer is JSON")
}

fn cave(rest: &str) -> String {
    format!("seed = 1\nduration_s = 1\n[map]\nkind = \"spheres\"\nsize = 20\n[agents]\ncount = 1\n{rest}")
}

#[test]
fn view_has_one_door() {
    let site = Site::new();
    let (mut server, address) = idle(&site, &[]);
    let _client = Client::connect(&address);
    let (_, port) = host(&address).rsplit_once(':').expect("a port");
    assert_eq!(listening_ports(server.process().pid()), [port.parse::<u16>().expect("a number")]);
}

#[test]
fn foreign_pages_and_strangers_see_nothing() {
    let site = Site::new();
    let (_server, address) = idle(&site, &["--view-allow-origin", "https://app.foxglove.dev"]);
    let refused = |address: &str, headers: &[(&'static str, &str)]| {
        let headers = [&[FOXGLOVE][..], headers].concat();
        handshake(address, &headers).err().map(|status| status.as_u16())
    };
    let bare = host(&address);
    let own = format!("http://{bare}");
    assert_eq!(refused(&address, &[("origin", "https://example.org")]), Some(403));
    assert_eq!(refused(&address, &[("origin", "http://127.0.0.1:1")]), Some(403));
    assert_eq!(refused(&address, &[("host", "rebound.example.org")]), Some(403));
    assert_eq!(refused(bare, &[]), Some(401));
    assert_eq!(refused(bare, &[("origin", &own)]), Some(401));
    assert_eq!(refused(bare, &[("origin", "https://app.foxglove.dev")]), Some(401));
    assert_eq!(refused(&format!("{bare}/?token=0123456789abcdef"), &[]), Some(401));
    assert_eq!(refused(&address, &[("origin", &own)]), None);
    assert_eq!(refused(&address, &[("origin", "https://app.foxglove.dev")]), None);
    let offered = format!("maes.token.{}, foxglove.sdk.v1", token(&address));
    assert!(handshake(bare, &[("sec-websocket-protocol", &offered)]).is_ok());
    for (path, status) in [("/", "401"), ("/index.html", "401"), ("/assets/none.js", "401"), ("/?token=x", "401")] {
        let answer = get(&address, path, "");
        assert!(answer.starts_with(&format!("HTTP/1.1 {status}")), "{path}: {answer}");
        for line in [
            "frame-ancestors 'self'",
            "x-frame-options: SAMEORIGIN",
            "x-content-type-options: nosniff",
            "referrer-policy: no-referrer",
        ] {
            assert!(answer.contains(line), "{line}: {answer}");
        }
        assert!(!answer.contains("script>") && !answer.contains(token(&address)), "{answer}");
    }
}

#[test]
fn token_of_the_environment_is_checked() {
    let site = Site::new();
    let mut server = site.binary("sim_server");
    server.args(["run", "--idle", "--view", "127.0.0.1:0"]);
    let ended = site.start(server.env("MAES_VIEW_TOKEN", "short")).ended().with_code(2);
    assert!(ended.stderr.contains("MAES_VIEW_TOKEN: expected 16 to 256"), "{ended}");
    let log = site.path("server.log");
    let mut server = site.binary("sim_server");
    server.args(["run", "--idle", "--view", "127.0.0.1:0", "--log"]).arg(&log);
    let mut server = site.start(server.env("MAES_VIEW_TOKEN", "a-token_of-this-test"));
    let address = server.address();
    assert_eq!(token(&address), "a-token_of-this-test");
    Client::connect(&address);
    let logged = fs::read_to_string(&log).expect("there is a log");
    assert!(logged.contains(host(&address)) && !logged.contains("a-token"), "others may read the log: {logged}");
}

#[test]
fn requested_runs_touch_no_other_files() {
    let site = Site::new();
    let victim = site.file("authorized_keys", "mine\n");
    let [records, maps] = ["records", "maps"].map(|name| site.path(name));
    fs::create_dir(&maps).expect("a new folder");
    std::os::unix::fs::symlink(&victim, maps.join("link.txt")).expect("a new link");
    let (mut server, address) = idle(&site, &["--record-dir", text(&records), "--map-dir", text(&maps)]);
    let mut client = Client::connect(&address);
    let names = |file: &Path| json!({ "scenario": cave(&format!("[execution]\nrecord = \"{}\"\n", file.display())) });
    for file in [victim.clone(), site.path("new.mcap"), "x.mcap".into(), "../x.mcap".into()] {
        let answer = start(&mut client, &names(&file));
        assert_eq!(answer["started"], false, "{}", file.display());
        assert!(answer["message"].as_str().is_some_and(|message| message.contains("execution.record")), "{answer}");
    }
    assert_eq!(fs::read_to_string(&victim).expect("it is there"), "mine\n");
    assert!(!site.path("new.mcap").exists() && !site.path("x.mcap").exists() && !records.exists());
    // Missing and forbidden files have the same answer.
    let mut reasons = Vec::new();
    for file in [text(&victim), "/none/at/all", "link.txt", "none.txt", "../authorized_keys"] {
        let scenario = cave("").replace("\"spheres\"\nsize = 20", &format!("\"file\"\nfile = \"{file}\""));
        let answer = start(&mut client, &json!({ "scenario": scenario }));
        assert_eq!(answer["started"], false, "{file}");
        reasons.push(answer["message"].as_str().expect("a reason").replace(file, "FILE"));
    }
    reasons.dedup();
    assert_eq!(reasons.len(), 1, "{reasons:?}");
    // A recording is asked for, and named by the server.
    let answer = start(&mut client, &json!({ "scenario": cave(""), "record": true }));
    assert_eq!(answer["started"], true, "{answer}");
    let name = answer["recording"].as_str().expect("a name").to_owned();
    let session = client.next_session();
    let mut team = site.binary("agent_node");
    let team = Process::start(team.args(["--id", "0"]));
    let stream = Recording::from_bytes(&client.live_stream(&session));
    team.ended().with_code(0);
    server.process().prints("digest: ");
    assert!(!name.contains('/') && name.ends_with(".mcap"), "{name}");
    let recorded = Recording::from_bytes(&fs::read(records.join(&name)).expect("it was recorded"));
    assert_eq!(stream, recorded);
}

#[test]
fn idle_connections_are_dropped() {
    let site = Site::new();
    let (_server, address) = idle(&site, &[]);
    let mut silent = connect(&address);
    let mut slow = connect(&address);
    slow.write_all(b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nX: ").expect("it listens");
    let mut kept = connect(&address);
    let request = format!("GET /none?token={} HTTP/1.1\r\nHost: {}\r\n\r\n", token(&address), host(&address));
    kept.write_all(request.as_bytes()).expect("it listens");
    for stream in [&mut silent, &mut slow, &mut kept] {
        assert!(is_closed(stream), "nothing waits for ever");
    }
}

#[test]
fn connections_and_clients_are_bounded() {
    let site = Site::new();
    let (mut server, address) = idle(&site, &[]);
    let pid = server.process().pid();
    let before = open_files(pid);
    for _ in 0..8 {
        let mut many: Vec<TcpStream> = (0..400).map(|_| connect(&address)).collect();
        assert!(is_closed(many.last_mut().expect("there are some")), "there are too many");
        assert!(open_files(pid) <= before + CONNECTIONS_MAX + 1);
    }
    server.process().waits_until(|| open_files(pid) <= before);
    let clients: Vec<_> = (0..CLIENTS_MAX).map(|_| Client::connect(&address)).collect();
    assert_eq!(handshake(&address, &[FOXGLOVE]).err().map(|status| status.as_u16()), Some(503));
    drop(clients);
    server.process().waits_until(|| handshake(&address, &[FOXGLOVE]).is_ok());
}

#[test]
fn large_messages_and_unread_replies_are_bounded() {
    let site = Site::new();
    let (mut server, address) = idle(&site, &[]);
    let pid = server.process().pid();
    let mut large = handshake(&address, &[FOXGLOVE]).expect("it has the token");
    // The connection may end before all of it was written.
    let _ = large.send(Message::text("x".repeat(2 << 20)));
    while large.read().is_ok() {}
    let before = memory_kb(pid);
    let mut greedy = handshake(&address, &[FOXGLOVE]).expect("it has the token");
    greedy.get_mut().set_write_timeout(Some(Duration::from_secs(1))).expect("a stream has time-outs");
    // Each is answered with an error as long as itself, which is not read.
    let request = json!({ "op": "fetchAsset", "uri": "x".repeat(900_000), "requestId": 1 }).to_string();
    let sent = (0..400).take_while(|_| greedy.send(Message::text(request.clone())).is_ok()).count();
    assert!(memory_kb(pid) < before + 65_536, "{sent} requests, {} kB", memory_kb(pid));
    assert!(Client::connect(&address).session().starts_with("idle-"), "others are served");
}

#[test]
fn exhausted_files_are_recovered() {
    let site = Site::new();
    let (mut server, address) = idle(&site, &[]);
    let pid = server.process().pid();
    let limit = open_files(pid) + 4;
    let limited = Command::new("prlimit").args(["--pid", &pid.to_string(), &format!("--nofile={limit}")]).status();
    assert!(limited.expect("prlimit is part of util-linux").success());
    let many: Vec<TcpStream> = (0..40).map(|_| connect(&address)).collect();
    server.process().waits_until(|| open_files(pid) >= limit);
    drop(many);
    server.process().waits_until(|| open_files(pid) < limit);
    assert!(Client::connect(&address).session().starts_with("idle-"));
}
