//! WebSocket clients read the live stream and control the run, which stays the same; recordings are
//! served over HTTP.

use std::io::{Read, Write};
use std::net::TcpStream;

use msgs::maes_msgs::Progress;
use msgs::simulation_interfaces::{
    GetSimulationStateRequest, GetSimulationStateResponse, ResetSimulationRequest, ResetSimulationResponse,
    SetSimulationStateRequest, SetSimulationStateResponse, SimulationState, StepSimulationRequest,
    StepSimulationResponse,
};
use msgs::tf2_msgs::TFMessage;
use serde_json::json;

use crate::services::play;
use crate::support::foxglove::Client;
use crate::support::processes::{Process, signal};
use crate::support::python;
use crate::support::recordings::{Recording, counter};
use crate::support::runs::{Run, Site, scenario, text};

const FLAGS: [&str; 8] = ["--agents", "2", "--size", "20", "--duration", "30", "--set", "stop_when_explored=false"];

/// A free port of this machine.
const ANYWHERE: &str = "127.0.0.1:0";

/// Starts a paused run; its Foxglove server's address.
fn begun(site: &Site, flags: &[&str]) -> (Run, String) {
    let shown = ["--view", ANYWHERE, "--paused", "true", "--record", "run.mcap"];
    let mut run = site.start(&mut site.run_sh(&[&FLAGS[..], &shown, flags].concat()));
    let address = run.address();
    (run, address)
}

fn set_state(client: &mut Client, state: u8) -> u8 {
    let request = SetSimulationStateRequest { state: SimulationState { state } };
    client.call::<SetSimulationStateResponse>("/sim_server/set_simulation_state", &request).result.result
}

fn state(client: &mut Client) -> u8 {
    client
        .call::<GetSimulationStateResponse>("/sim_server/get_simulation_state", &GetSimulationStateRequest {})
        .state
        .state
}

/// The response to an HTTP request with these header lines, to `host:port/...`.
pub(crate) fn get(address: &str, path: &str, lines: &str) -> String {
    let host = address.split('/').next().expect("an address");
    let mut stream = TcpStream::connect(host).expect("the server is there");
    let request = format!("GET {path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n{lines}\r\n");
    stream.write_all(request.as_bytes()).expect("it listens");
    let mut answer = Vec::new();
    stream.read_to_end(&mut answer).expect("it answers");
    String::from_utf8_lossy(&answer).into_owned()
}

#[test]
fn live_stream_equals_the_recording() {
    let site = Site::new();
    let (run, address) = begun(&site, &[]);
    let mut client = Client::connect(&address);
    for topic in ["/tf", "/sim/progress", "/sim/unexplored", "/sim/map", "/agent_1/points"] {
        client.subscribe(topic);
    }
    assert_eq!(set_state(&mut client, SimulationState::STATE_PLAYING), 1);
    let session = client.session();
    let live_stream = Recording::from_bytes(&client.live_stream(&session));
    let ended = run.ended().with_code(0);
    let recording = site.recording("run.mcap");
    assert_eq!(live_stream, recording, "{}", live_stream.first_difference(&recording));
    let alone = site.record(&[&["--transport", "memory"][..], &FLAGS].concat());
    assert_eq!(ended.digest(), alone.digest());
    for (topic, messages) in &client.messages {
        assert!(!messages.is_empty(), "{topic}");
    }
    assert_eq!(client.messages.len(), 5, "{:?}", client.messages.keys());
    let last = client.messages["/sim/progress"].last().expect("it was published");
    let progress: Progress = msgs::cdr::decode(last).expect("it is one");
    assert_eq!(progress.tick, recording.of::<Progress>("/sim/progress").last().expect("it was recorded").tick);
    msgs::cdr::decode::<TFMessage>(&client.messages["/tf"][0]).expect("transforms are as over ROS");
}

/// The stamp of a message whose first field is a header, or a sequence of what begins with one, ns.
fn stamp_ns(topic: &str, message: &[u8]) -> u64 {
    let at = if topic == "/tf" { 8 } else { 4 };
    let number = |at: usize| u32::from_le_bytes(message[at..at + 4].try_into().expect("four bytes"));
    u64::from(number(at)) * 1_000_000_000 + u64::from(number(at + 4))
}

#[test]
fn log_times_are_stamps_for_clients_of_both_subprotocols() {
    const STAMPED: [&str; 7] =
        ["/tf", "/agent_0/odom", "/agent_1/odom", "/agent_0/points", "/agent_0/path", "/sim/contacts", "/agent_0/map"];
    let site = Site::new();
    let (run, address) = begun(&site, &["--rtf", "20"]);
    let mut clients = ["foxglove.websocket.v1", "foxglove.sdk.v1"].map(|name| Client::connect_as(name, &address));
    for client in &mut clients {
        for topic in STAMPED.into_iter().chain(["/clock", "/rosout", "/sim/result"]) {
            client.subscribe(topic);
        }
    }
    assert_eq!(set_state(&mut clients[0], SimulationState::STATE_PLAYING), 1);
    for mut client in clients {
        client.read_until(|client| client.messages.contains_key("/sim/result"));
        for topic in STAMPED {
            let times = &client.log_times[topic];
            let stamps: Vec<u64> = client.messages[topic].iter().map(|message| stamp_ns(topic, message)).collect();
            assert_eq!(*times, stamps, "{topic}");
        }
        // The transform of each scan comes before it.
        let stamps: Vec<u64> = client.messages["/tf"].iter().map(|message| stamp_ns("/tf", message)).collect();
        for scan in &client.messages["/agent_0/points"] {
            assert!(stamps.contains(&stamp_ns("", scan)), "no transform of {}", stamp_ns("", scan));
        }
        for (clock, time) in client.messages["/clock"].iter().zip(&client.log_times["/clock"]) {
            assert_eq!(stamp_ns("", clock), *time);
        }
        assert!(client.messages["/clock"].len() > 10 && !client.messages["/rosout"].is_empty());
    }
    run.ended().with_code(0);
}

#[test]
fn other_subprotocols_are_refused_with_a_reason() {
    let site = Site::new();
    let (mut run, address) = begun(&site, &[]);
    let path = address.split_once('/').map_or("/".to_owned(), |(_, path)| format!("/{path}"));
    let lines = "Upgrade: websocket\r\nSec-WebSocket-Protocol: rosbridge, foxglove.sdk.v2\r\n";
    let answer = get(&address, &path, lines);
    assert!(answer.starts_with("HTTP/1.1 400 "), "{answer}");
    let reason =
        "expected one of the subprotocols foxglove.sdk.v1, foxglove.websocket.v1, offered: rosbridge, foxglove.sdk.v2";
    assert!(answer.ends_with(reason), "{answer}");
    signal(run.process().pid(), "INT");
    run.ended().with_code(130);
}

#[test]
fn foxglove_clients_control_the_run() {
    let site = Site::new();
    let (run, address) = begun(&site, &[]);
    let mut client = Client::connect(&address);
    assert_eq!(client.said["serverInfo"]["metadata"]["idle"], "false");
    // The address is printed before the topics of the run are advertised.
    client.read_until(|client| client.offered().contains(&"/agent_1/odom"));
    assert_eq!(state(&mut client), SimulationState::STATE_STOPPED);
    let stepped: StepSimulationResponse =
        client.call("/sim_server/step_simulation", &StepSimulationRequest { steps: 7 });
    assert_eq!(stepped.result.result, 1);
    assert_eq!(state(&mut client), SimulationState::STATE_PAUSED);
    assert_eq!(client.parameter("map.size"), json!(20));
    assert_eq!(client.set("execution.rtf", 2.5), json!([{ "name": "execution.rtf", "type": "float64", "value": 2.5 }]));
    assert_eq!(state(&mut client), SimulationState::STATE_PAUSED, "requests are handled in order");
    assert_eq!(client.parameter("execution.rtf"), json!(2.5));
    assert_eq!(client.set("execution.rtf", -1.0), json!([]), "no such factor");
    assert_eq!(client.set("map.size", 30), json!([]), "the map stays as it is");
    let nonsense = client.call_raw("/sim_server/step_simulation", "cdr", &[0, 1, 0, 0, 7]);
    assert!(nonsense.unwrap_err().contains("StepSimulation_Request"));
    let old = client.session();
    assert_eq!(set_state(&mut client, SimulationState::STATE_STOPPED), 1, "reset");
    let new = client.next_session();
    assert_eq!(client.fetch(&format!("maes://run/{old}/0")), Err("gone".to_owned()));
    assert!(client.fetch(&format!("maes://run/{new}/0")).is_ok_and(|bytes| bytes.starts_with(b"\x89MCAP")));
    assert!(client.fetch("maes://run/x").is_err_and(|reason| reason.contains("maes://run/<session>/<offset>")));
    assert_eq!(state(&mut client), SimulationState::STATE_STOPPED);
    assert_eq!(set_state(&mut client, SimulationState::STATE_QUITTING), 1);
    run.ended().with_code(130);
    assert_eq!(site.recording("run.mcap").result().reason, "quit");
}

#[test]
fn real_time_factor_is_shared_with_ros() {
    let site = Site::new();
    python::prepare_ros();
    let (run, address) = begun(&site, &[]);
    let mut client = Client::connect(&address);
    client.set("execution.rtf", 2.5);
    play(&site, &["pace", "2.5"]);
    assert_eq!(client.parameter("execution.rtf"), json!(3.0));
    client.call::<StepSimulationResponse>("/sim_server/step_simulation", &StepSimulationRequest { steps: 1 });
    assert_eq!(set_state(&mut client, SimulationState::STATE_STOPPED), 1);
    client.next_session();
    assert_eq!(state(&mut client), SimulationState::STATE_STOPPED);
    assert_eq!(client.parameter("execution.rtf"), json!(3.0), "a reset keeps it");
    set_state(&mut client, SimulationState::STATE_QUITTING);
    run.ended().with_code(130);
}

#[test]
fn slow_client_does_not_block_the_run() {
    let site = Site::new();
    let (run, address) = begun(&site, &[]);
    let mut slow = Client::connect(&address);
    for topic in ["/tf", "/sim/unexplored", "/agent_0/points", "/agent_1/points", "/sim/info"] {
        slow.subscribe(topic);
    }
    let mut client = Client::connect(&address);
    set_state(&mut client, SimulationState::STATE_PLAYING);
    let session = client.session();
    let live_stream = Recording::from_bytes(&client.live_stream(&session));
    // The slow client is still connected and has read nothing.
    run.ended().with_code(0);
    assert_eq!(counter(&live_stream.result(), "agents_dropped"), 0);
    drop(slow);
}

#[test]
fn idle_server_starts_requested_runs() {
    let site = Site::new();
    let ready = site.path("ready");
    let mut server = site.binary("sim_server");
    server.args(["run", "--idle", "--view", ANYWHERE, "--ready"]).arg(&ready);
    let mut server = site.start(&mut server);
    let address = server.address();
    let mut client = Client::connect(&address);
    assert_eq!(client.said["serverInfo"]["metadata"]["idle"], "true");
    assert!(client.session().starts_with("idle-"));
    let start = |client: &mut Client, scenario: &str| -> serde_json::Value {
        let request = json!({ "scenario": scenario }).to_string();
        let answer = client.call_raw("/sim_server/start_run", "json", request.as_bytes()).expect("it answers");
        serde_json::from_slice(&answer).expect("an answer is JSON")
    };
    let cave = |duration: &str, rest: &str| {
        format!(
            "seed = 1\nduration_s = {duration}\nstop_when_explored = false\n[map]\nkind = \"spheres\"\nsize = 20\n[agents]\n{rest}"
        )
    };
    for (wrong, reason) in [
        (cave("-1", "count = 1"), "duration_s"),
        ("seed = ".to_owned(), "the scenario:1"),
        (cave("1", "count = 1\ncontroller = \"x\""), "rbw"),
        (cave("1", "count = 1").replace("\"spheres\"\nsize = 20", "\"file\"\nfile = \"none.m3dm\""), "none.m3dm"),
    ] {
        let answer = start(&mut client, &wrong);
        assert_eq!(answer["started"], false, "{wrong}");
        assert!(answer["message"].as_str().is_some_and(|message| message.contains(reason)), "{answer}");
    }
    for (body, reason) in [("{}", "scenario"), (r#"{"scenario": "", "recording": true}"#, "`recording`")] {
        let refused = client.call_raw("/sim_server/start_run", "json", body.as_bytes());
        assert!(refused.is_err_and(|said| said.contains(reason)), "{body}");
    }
    for agents in 1..=2 {
        let scenario = cave("2", &format!("count = {agents}"));
        let answer = start(&mut client, &scenario);
        assert_eq!(answer, json!({ "started": true, "message": "" }));
        let session = client.next_session();
        let file = std::fs::read_to_string(&ready).expect("it says which agents may start");
        assert!(std::fs::read_to_string(file.trim()).expect("a scenario").contains(&format!("count = {agents}")));
        assert_eq!(start(&mut client, &scenario)["message"], "a run is under way; end it first");
        let mut team = site.binary("agent_node");
        let team = Process::start(team.args(["--id", &format!("0-{}", agents - 1)]));
        let live_stream = Recording::from_bytes(&client.live_stream(&session));
        team.ended().with_code(0);
        assert_eq!(live_stream.result().explored_by.len(), agents);
        server.process().prints("digest: ");
    }
    // Only time and state together are the run again; there is nothing else that could be removed.
    for (scope, result) in [(1, 0), (2, 0), (4, 1)] {
        let answer: ResetSimulationResponse =
            client.call("/sim_server/reset_simulation", &ResetSimulationRequest { scope });
        assert_eq!(answer.result.result, result, "scope {scope}");
    }
    signal(server.process().pid(), "TERM");
    server.ended().with_code(0);
}

#[test]
fn recording_is_served_in_ranges_to_local_pages() {
    let site = Site::new();
    let bytes = site.record(&[&["--transport", "memory"][..], &FLAGS].concat()).bytes;
    let file = site.file("some.mcap", &bytes);
    site.file("index.html", "a page");
    let page = site.path(".");
    let mut shown = site.binary("maes");
    shown.arg("view").arg(&file).args(["--address", ANYWHERE, "--browser", "false", "--page"]).arg(&page);
    let mut shown = site.start(&mut shown);
    let url = shown.process().prints("http://");
    let address = url.trim().trim_start_matches("http://").to_owned();
    let path = address.split_once('/').map(|(_, path)| format!("/{path}")).expect("a path");
    assert!(path.starts_with("/?token=") && path.ends_with("&recording=recording/some.mcap"), "{path}");
    assert!(get(&address, "/", "").starts_with("HTTP/1.1 401"));
    assert!(get(&address, "/recording/some.mcap", "").starts_with("HTTP/1.1 401"));
    // The token is exchanged for a cookie, and leaves the address.
    let admitted = get(&address, &path, "");
    assert!(admitted.starts_with("HTTP/1.1 303"), "{admitted}");
    assert!(admitted.contains("location: /?recording=recording/some.mcap\r\n"), "{admitted}");
    let cookie = admitted.lines().find_map(|line| line.strip_prefix("set-cookie: ")).expect("a cookie");
    assert!(cookie.ends_with("; Path=/; HttpOnly; SameSite=Strict"), "{cookie}");
    let cookie = format!("Cookie: {}\r\n", cookie.split(';').next().expect("a value"));
    let get = |path: &str, lines: &str| get(&address, path, &format!("{cookie}{lines}"));
    let part = get("/recording/some.mcap", "Range: bytes=0-4\r\n");
    assert!(part.starts_with("HTTP/1.1 206") && part.contains(&format!("0-4/{}", bytes.len())), "{part}");
    assert!(get("/", "").ends_with("a page"));
    assert!(get("/nothing.js", "").starts_with("HTTP/1.1 404"));
    assert!(get("/", "Origin: https://example.org\r\n").starts_with("HTTP/1.1 403"));
    assert!(get("/", "Upgrade: websocket\r\n").starts_with("HTTP/1.1 404"));
    signal(shown.process().pid(), "INT");
    shown.ended().with_code(0);
}

#[test]
fn view_errors_are_reported_at_start() {
    let site = Site::new();
    let taken = std::net::TcpListener::bind(ANYWHERE).expect("a port is free");
    let address = taken.local_addr().expect("it has one").to_string();
    let scenario = scenario("default.toml");
    let refused = |arguments: &[&str], code: i32, words: &str| {
        let ended = site.start(site.binary("sim_server").args(arguments)).ended().with_code(code);
        assert!(ended.stderr.contains(words), "{ended}");
    };
    refused(&["run", text(&scenario), "--view", &address], 1, &address);
    refused(&["run", text(&scenario), "--view", "nowhere"], 1, "nowhere");
    refused(&["run", "--idle"], 2, "--view");
    let no_recording = site.file("text.mcap", "no recording");
    let no_page = site.start(site.binary("maes").args(["view", text(&no_recording)])).ended().with_code(2);
    assert!(no_page.stderr.contains("text.mcap"), "{no_page}");
    for (shown, words) in [("default.toml", "expected two recordings"), ("text.mcap", "text.mcap")] {
        let file = if shown == "default.toml" { scenario.clone() } else { site.path(shown) };
        let view = ["view", text(&file), "--beside", text(&no_recording)];
        let refused = site.start(site.binary("maes").args(view)).ended().with_code(2);
        assert!(refused.stderr.contains(words), "{refused}");
    }
    refused(&["run", text(&scenario), "--view", ANYWHERE, "--page", "/nowhere"], 2, "/nowhere");
    // `maes view` names its own flag, also where a server of its own would bind the address.
    for file in [None, Some(&scenario)] {
        let mut view = site.binary("maes");
        let view = view.args(["view", "--address", &address, "--browser", "false"]).args(file);
        let refused = site.start(view).ended().with_code(1);
        assert!(refused.stderr.starts_with(&format!("error: --address {address}: ")), "{refused}");
    }
}

#[test]
fn an_open_address_is_printed_as_that_of_this_machine() {
    let site = Site::new();
    let bytes = site.record(&[&["--transport", "memory"][..], &FLAGS].concat()).bytes;
    let file = site.file("some.mcap", &bytes);
    site.file("index.html", "a page");
    let mut view = site.binary("maes");
    view.arg("view").arg(&file).args(["--address", "0.0.0.0:0", "--browser", "false", "--page", "."]);
    let mut shown = site.start(&mut view);
    assert!(shown.process().prints("http://").starts_with("http://127.0.0.1:"));
    shown.process().says("from other hosts, use the name or address of this machine instead of 127.0.0.1");
    signal(shown.process().pid(), "INT");
    shown.ended().with_code(0);
}
