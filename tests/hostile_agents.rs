//! Illegal commands, foreign senders, floods and undecodable messages: refused, counted, and
//! without effect on the digest.

use std::collections::{BTreeMap, VecDeque};
use std::net::Ipv4Addr;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use agent_node::transport::{Inbound as ToAgents, ServerTransport};
use in_memory::{AgentsEnd, ServerEnd};
use msgs::geometry_msgs::Point;
use msgs::ids::{AgentId, Tick};
use msgs::maes_msgs::{
    self, AgentMessage, Command, Join, Motion, Observation, ScanRequest, Scenario, SignedCommand, SignedObservation,
};
use msgs::shared_bytes::SharedBytes;
use msgs::topics::{self, Topic};
use protocol::limits::{AGENT_MESSAGE_BYTES_MAX, INFO_BYTES_MAX, PATH_POINTS_MAX, PROTOCOL};
use protocol::lockstep::SourceId;
use protocol::signed::{JoinRequest, Signed};
use protocol::signing::NONE;
use rand::RngExt;
use ros2_client::qos::{Durability, QosProfile, Reliability, WhenFull};
use ros2_client::{Context, MessageTypeName, Name, Node, NodeName, NodeOptions, Publisher, Subscription};
use rustdds::DomainParticipantBuilder;
use serde::de::DeserializeOwned;
use serde::ser::{Serialize, SerializeTuple, Serializer};
use sim_server::session::RunError;
use transport::{AgentTransport, Inbound as ToServer, Incoming};

use crate::support::domains::Domain;
use crate::support::interceptor::{Interceptor, intercepted};
use crate::support::memory::{FinishedRun, Play, honest};
use crate::support::processes::signal;
use crate::support::recordings::{Recording, refusals};
use crate::support::runs::{Run, Site};
use crate::support::{HANG, lock};

/// Duration of a run, seconds of sim time.
const DURATION_S: f64 = 4.0;

fn undisturbed_digest() -> String {
    let agents = |mut end: AgentsEnd, ids: Vec<AgentId>, is_over: &AtomicBool| {
        agent_node::host::run(&mut end, &honest(u64::from(ids[0].0), ids), is_over).expect("honest agents are welcome");
    };
    let played = Play::of_two(DURATION_S).with(agents);
    assert_eq!(refusals(&played.outcome().result), BTreeMap::new());
    played.digest()
}

/// Illegal variants of a legal command.
fn illegal(command: &Command) -> Vec<Command> {
    let with = |change: &dyn Fn(&mut Command)| {
        let mut changed = command.clone();
        change(&mut changed);
        changed
    };
    let motion = |motion: Motion| with(&|command| command.motion = motion.clone());
    let point = |x| Point { x, y: 1.0, z: 1.0 };
    let mut commands = vec![
        motion(Motion { kind: 6, ..Motion::default() }),
        motion(Motion { kind: 255, ..Motion::default() }),
        motion(Motion { kind: Motion::PATH, path: Vec::new(), ..Motion::default() }),
        motion(Motion { kind: Motion::PATH, path: vec![point(1.0); PATH_POINTS_MAX + 1], ..Motion::default() }),
        with(&|command| command.lidar = ScanRequest { kind: 4, period_ticks: 1 }),
        with(&|command| command.lidar = ScanRequest { kind: ScanRequest::EVERY, period_ticks: 0 }),
        with(&|command| command.info = "x".repeat(INFO_BYTES_MAX + 1)),
        with(&|command| {
            command.messages =
                vec![AgentMessage { agent: 1, kind: 0, data: vec![0; AGENT_MESSAGE_BYTES_MAX + 1].into() }]
        }),
        with(&|command| command.messages = vec![AgentMessage { agent: 1, kind: 0, data: vec![0; 20_000].into() }; 3]),
        with(&|command| {
            command.messages = vec![AgentMessage { agent: 1, kind: 0, data: SharedBytes::default() }; 10_000]
        }),
        with(&|command| command.messages = vec![AgentMessage { agent: 2, kind: 0, data: vec![1].into() }]),
    ];
    for wrong in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300, -1e300] {
        commands.extend([
            motion(Motion { kind: Motion::MOVE, pitch_rad: wrong, distance_m: 1.0, ..Motion::default() }),
            motion(Motion { kind: Motion::TURN, angle_rad: wrong, ..Motion::default() }),
            motion(Motion { kind: Motion::VELOCITY, yaw_rate_rad_s: wrong, ..Motion::default() }),
            motion(Motion { kind: Motion::PATH, path: vec![point(1.0), point(wrong)], ..Motion::default() }),
        ]);
        let mut velocity = Motion { kind: Motion::VELOCITY, ..Motion::default() };
        velocity.linear_m_s.z = wrong;
        commands.push(motion(velocity));
    }
    for wrong in [f64::NAN, f64::NEG_INFINITY, -0.1] {
        commands.push(motion(Motion { kind: Motion::MOVE, distance_m: wrong, ..Motion::default() }));
    }
    commands
}

/// A link that sends illegal commands of two agents in every tick, before and after each true
/// command.
struct IllegalSender {
    inner: AgentsEnd,
    last_tick: [Option<u64>; 2],
    sent: Arc<Mutex<BTreeMap<&'static str, u64>>>,
}

impl IllegalSender {
    fn send_illegal(&mut self, counter: &'static str, command: &Command) {
        *lock(&self.sent).entry(counter).or_default() += 1;
        self.inner.send_command(&Signed::unsigned(command.clone()));
    }

    /// Sends illegal commands before the true one, so that they arrive while it is awaited.
    fn send_all_illegal(&mut self, command: &Command) {
        // Unlike any true command, which may be resent.
        let info = "illegal".to_owned();
        let changed = |tick: u64, agent: u32| Command { tick, agent, info: info.clone(), ..command.clone() };
        let Command { tick, agent, .. } = *command;
        for wrong in [tick.wrapping_sub(1), tick + 1, tick + 1_000_000, u64::MAX] {
            self.send_illegal("refused_wrong_tick", &changed(wrong, agent));
        }
        for unknown in [2, 1000, u32::MAX] {
            self.send_illegal("refused_unknown_agent", &changed(tick, unknown));
        }
        if tick == 100 {
            for _ in 0..10_000 {
                self.send_illegal("refused_wrong_tick", &changed(99, agent));
            }
        }
        for command in illegal(command) {
            self.send_illegal("refused_illegal_command", &command);
        }
    }
}

impl ServerTransport for IllegalSender {
    fn send_join(&mut self, join: &Signed<JoinRequest>) {
        let claimed = &join.claimed().join;
        self.inner.send_join(&Signed::unsigned(Join { protocol: PROTOCOL + 1, ..claimed.clone() }));
        self.inner.send_join(&Signed::unsigned(Join { agent: 7, ..claimed.clone() }));
        let mut sent = lock(&self.sent);
        *sent.entry("refused_wrong_protocol").or_default() += 1;
        *sent.entry("refused_unknown_agent").or_default() += 1;
        drop(sent);
        self.inner.send_join(join);
    }

    fn send_command(&mut self, signed: &Signed<Command>) {
        let command = signed.claimed();
        let last_tick = &mut self.last_tick[command.agent as usize];
        if *last_tick == Some(command.tick) {
            // A resent request must not change the number of illegal commands.
            return self.inner.send_command(signed);
        }
        *last_tick = Some(command.tick);
        self.send_all_illegal(command);
        self.inner.send_command(signed);
        // Agent 1 replies after agent 0, so that the tick is not over yet.
        if command.agent == 0 {
            let stop = Motion { kind: Motion::STOP, ..Motion::default() };
            self.send_illegal("refused_second_answer", &Command { motion: stop, ..command.clone() });
        }
    }

    fn receive(&mut self, timeout: Duration) -> Option<ToAgents> {
        // Drops the refusals of this link's own false joins.
        let is_true = |message: &ToAgents| !matches!(message, ToAgents::JoinReply(reply) if !reply.accepted);
        self.inner.receive(timeout).filter(is_true)
    }
}

#[test]
fn hostile_commands_are_refused_without_effect() {
    let sent = Arc::new(Mutex::new(BTreeMap::new()));
    let mut play = Play::of_two(DURATION_S);
    play.groups = vec![vec![0, 1]];
    let shared = Arc::clone(&sent);
    let played = play.with(move |inner, ids, is_over| {
        let mut link = IllegalSender { inner, last_tick: [None; 2], sent: Arc::clone(&shared) };
        agent_node::host::run(&mut link, &honest(0, ids), is_over).expect("refusals do not concern the agent");
    });
    let sent = lock(&sent).clone();
    assert!(sent["refused_illegal_command"] > 10_000 && sent["refused_wrong_tick"] > 10_000, "{sent:?}");
    assert_eq!(refusals(&played.outcome().result), sent);
    assert_eq!(played.digest(), undisturbed_digest());
    assert!(played.notes.iter().any(|note| note.contains("agent 0, tick 0: motion.kind = 6")), "{:?}", played.notes);
    assert!(played.notes.len() < 100, "a flood of illegal commands is no flood of notes: {}", played.notes.len());
}

/// A server's end into which a foreign sender injects messages.
struct ForeignSender {
    waiting: VecDeque<Incoming>,
}

const FOREIGN: SourceId = SourceId([0xee; 16]);

/// The instance number of an agent's process.
fn instance_of(agent: u32) -> u64 {
    u64::from(agent) + 10
}

impl ForeignSender {
    fn say(&mut self, topic: u32, source: SourceId, message: ToServer) {
        self.waiting.push_back(Incoming { topic_agent: AgentId(topic), source, message });
    }

    fn command(&mut self, topic: u32, source: SourceId, command: &Command) {
        self.say(topic, source, ToServer::Command(Signed::unsigned(command.clone())));
    }

    fn join(&mut self, topic: u32, source: SourceId, join: &Join) {
        self.say(topic, source, ToServer::Join(Signed::unsigned(join.clone())));
    }
}

impl Interceptor for ForeignSender {
    fn send(&mut self, inner: &mut ServerEnd, agent: AgentId, part: Signed<Observation>) {
        let stop = Motion { kind: Motion::STOP, ..Motion::default() };
        let &Observation { run, tick, .. } = part.claimed();
        let command = Command { tick, run, agent: agent.0, motion: stop, ..Command::default() };
        let other = 1 - agent.0;
        self.command(agent.0, FOREIGN, &command);
        self.command(other, FOREIGN, &command);
        self.say(agent.0, FOREIGN, ToServer::Undecodable { reason: "noise".to_owned() });
        let controller = "x".to_owned();
        let join = Join { run, agent: agent.0, instance: 1, protocol: PROTOCOL, controller, last_tick: 0 };
        // Messages of a member, with the number of another run.
        let welcome = SourceId(u128::from(agent.0).to_le_bytes());
        self.command(agent.0, welcome, &Command { run: run ^ 1, ..command });
        self.join(agent.0, welcome, &Join { run: 0, ..join.clone() });
        self.join(agent.0, FOREIGN, &join);
        // With the agent's own instance number, which is public: the agent must not receive a
        // refusal.
        let borrowed = Join { instance: instance_of(agent.0), ..join.clone() };
        self.join(agent.0, FOREIGN, &borrowed);
        self.join(agent.0, FOREIGN, &Join { protocol: PROTOCOL + 1, ..borrowed.clone() });
        self.join(other, FOREIGN, &borrowed);
        self.join(other, FOREIGN, &join);
        inner.send(agent, part);
    }

    fn receive(&mut self, inner: &mut ServerEnd, timeout: Duration) -> Option<Incoming> {
        self.waiting.pop_front().or_else(|| inner.receive(timeout))
    }
}

#[test]
fn foreign_senders_are_refused_without_effect() {
    let mut play = Play::of_two(DURATION_S);
    play.server_link = |inner| intercepted(inner, ForeignSender { waiting: VecDeque::new() });
    let played = play.with(|mut end, ids, is_over| {
        // Agents recognise refusals of foreign joins by the instance number.
        agent_node::host::run(&mut end, &honest(instance_of(ids[0].0), ids), is_over).expect("agents are welcome");
    });
    let refusals = refusals(&played.outcome().result);
    let asked = refusals["refused_not_joined"];
    assert!(asked >= 2 * 200, "{refusals:?}");
    let all = [
        "refused_id_taken",
        "refused_not_joined",
        "refused_other_run",
        "refused_undecodable",
        "refused_wrong_protocol",
        "refused_wrong_topic",
    ];
    assert_eq!(refusals.keys().copied().collect::<Vec<_>>(), all);
    for (name, factor) in [
        ("refused_id_taken", 2),
        ("refused_other_run", 2),
        ("refused_undecodable", 1),
        ("refused_wrong_protocol", 1),
        ("refused_wrong_topic", 3),
    ] {
        assert_eq!(refusals[name], factor * asked, "{name} in {refusals:?}");
    }
    assert_eq!(played.digest(), undisturbed_digest());
}

/// Illegal commands of a member in each tick, and half of its illegal joins.
const FLOOD: u64 = 50;

fn join(end: &mut AgentsEnd, join: Join) {
    end.send_join(&Signed::unsigned(join));
}

fn command(end: &mut AgentsEnd, command: Command) {
    end.send_command(&Signed::unsigned(command));
}

/// Agent 1: keeps its position, and with `floods` sends illegal messages beside each reply.
fn stays(mut end: AgentsEnd, floods: bool, is_over: &AtomicBool) {
    let mut run = 0;
    let mut answered = None;
    while !is_over.load(Ordering::Relaxed) {
        match end.receive(Duration::from_millis(20)) {
            Some(ToAgents::Scenario(scenario)) => {
                run = scenario.run;
                join(&mut end, Join { run, agent: 1, instance: 1, protocol: PROTOCOL, ..Join::default() });
            }
            Some(ToAgents::Observation(part)) if part.claimed().is_last() => {
                let &Observation { tick, phase, .. } = part.claimed();
                let answer = Command { tick, run, agent: 1, ..Command::default() };
                let is_first = answered.replace((tick, phase)) != Some((tick, phase));
                if !floods || phase == Observation::ENDED {
                    command(&mut end, answer);
                    continue;
                }
                // A resent request must not change the number of illegal messages.
                for number in 0..if is_first { FLOOD } else { 0 } {
                    command(&mut end, Command { tick: tick + 1 + number, ..answer.clone() });
                    join(&mut end, Join { run, agent: 1, instance: 2 + number, protocol: PROTOCOL, ..Join::default() });
                    join(&mut end, Join { run, agent: 0, instance: tick, protocol: PROTOCOL, ..Join::default() });
                }
                let message = AgentMessage {
                    agent: AgentMessage::BROADCAST,
                    kind: 7,
                    data: vec![7; AGENT_MESSAGE_BYTES_MAX].into(),
                };
                command(&mut end, Command { messages: vec![message], ..answer });
            }
            _ => {}
        }
    }
}

#[test]
fn flooding_member_does_not_affect_others() {
    let result = |floods: bool| {
        let played = Play::of_two(DURATION_S).with(move |mut end, ids, is_over| {
            if ids[0] == AgentId(1) {
                return stays(end, floods, is_over);
            }
            // The flood does not use this instance number.
            agent_node::host::run(&mut end, &honest(u64::MAX, ids), is_over).expect("agent 0 is welcome");
        });
        assert!(played.notes.len() < 20, "a flood of illegal commands is no flood of notes: {:?}", played.notes);
        played.outcome().result.clone()
    };
    let (quiet, flooded) = (result(false), result(true));
    assert_eq!(flooded.tick, quiet.tick);
    assert_eq!(flooded.explored_by, quiet.explored_by);
    assert_eq!(flooded.covered_by, quiet.covered_by);
    assert_eq!(flooded.distance_m, quiet.distance_m);
    let flood = FLOOD * quiet.tick;
    assert_eq!(refusals(&flooded), BTreeMap::from([("refused_id_taken", 2 * flood), ("refused_wrong_tick", flood)]));
    // The inbox of agent 0, which is not due for long, is bounded.
    let count = |result: &maes_msgs::Result, name: &str| {
        result.counters.iter().find(|counter| counter.name == name).expect("it is counted").value
    };
    assert!(count(&flooded, "messages_inbox_full") > 0, "{:?}", flooded.counters);
    assert_eq!(count(&flooded, "messages_sent"), count(&quiet, "messages_sent") + quiet.tick);
}

/// A run in which agent 1 joins and then sends the commands for its run number, over and over.
fn with_commands_of_agent_1(commands: impl Fn(u64) -> Vec<Command> + Send + Sync + 'static) -> FinishedRun {
    let mut play = Play::of_two(DURATION_S);
    play.scenario.execution.decision_timeout_s = 2.0;
    play.scenario.execution.join_timeout_s = 2.0;
    play.with(move |mut end, ids, is_over| {
        if ids[0] == AgentId(0) {
            agent_node::host::run(&mut end, &honest(0, ids), is_over).expect("agent 0 is welcome");
            return;
        }
        let Some(ToAgents::Scenario(Scenario { run, .. })) = end.receive(HANG) else {
            panic!("the scenario comes first")
        };
        join(&mut end, Join { run, agent: 1, instance: 1, protocol: PROTOCOL, ..Join::default() });
        let commands = commands(run);
        while !is_over.load(Ordering::Relaxed) {
            commands.iter().for_each(|sent| command(&mut end, sent.clone()));
            end.receive(Duration::from_millis(1));
        }
    })
}

/// A stream of messages delays neither the timeout nor the end of a run.
#[test]
fn flooding_without_reply_times_out() {
    let flood = |run| vec![Command { tick: u64::MAX, run, agent: 1, ..Command::default() }; 100];
    match with_commands_of_agent_1(flood).outcome {
        Err(RunError::AgentsLost { lost, tick: Tick(0), .. }) => assert_eq!(lost, [AgentId(1)]),
        other => panic!("{other:?}"),
    }
}

#[test]
fn agent_with_illegal_replies_is_lost_for_that_reason() {
    let motion = Motion { kind: Motion::MOVE, distance_m: f64::NAN, ..Motion::default() };
    let reply = move |run| vec![Command { tick: 0, run, agent: 1, motion: motion.clone(), ..Command::default() }];
    let error = with_commands_of_agent_1(reply).outcome.expect_err("agent 1 never replies");
    let text = error.to_string();
    assert!(text.contains("from: 1; the answer of agent 1 was refused: ") && text.contains("NaN"), "{text}");
}

/// Raw bytes, whatever the type of the topic.
#[derive(Debug)]
struct Noise(Vec<u8>);

impl Serialize for Noise {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut bytes = serializer.serialize_tuple(self.0.len())?;
        self.0.iter().try_for_each(|byte| bytes.serialize_element(byte))?;
        bytes.end()
    }
}

/// A DDS participant in the domain of a run that is no member of it.
struct Rogue {
    node: Node,
    _context: Context,
}

impl Rogue {
    fn new(domain: &Domain) -> Self {
        let participant = DomainParticipantBuilder::new(domain.id()).with_only_networks([Ipv4Addr::LOCALHOST]);
        let participant = participant.build().expect("the domain has room");
        let context = Context::from_domain_participant(participant).expect("the domain has room");
        let name = NodeName::new("/", "rogue").expect("a legal name");
        let options = NodeOptions::new().enable_rosout(false).start_parameter_services(false);
        let node = context.new_node(name, options).expect("the domain has room");
        Self { node, _context: context }
    }

    fn topic(&self, topic: &Topic, durability: Durability) -> rustdds::Topic {
        let qos = QosProfile::publisher_default().reliability(Reliability::Reliable { when_full: WhenFull::Fail });
        let name = Name::parse(&topic.name).expect("a legal name");
        let kind = MessageTypeName::new(topic.message.package, topic.message.name);
        self.node.create_topic(&name, kind, &qos.durability(durability)).expect("a topic")
    }

    fn publisher<M: Serialize>(&mut self, topic: &Topic) -> Publisher<M> {
        let topic = self.topic(topic, Durability::Volatile);
        self.node.create_publisher(&topic, None).expect("a publisher")
    }

    /// Subscribes to a latched topic.
    fn subscription<M: DeserializeOwned + 'static>(&mut self, topic: &Topic) -> Subscription<M> {
        let topic = self.topic(topic, Durability::TransientLocal);
        self.node.create_subscription(&topic, None).expect("a subscription")
    }
}

#[test]
fn undecodable_messages_are_refused_without_effect() {
    let site = Site::new();
    let flags = ["--agents", "2", "--size", "20", "--duration", "600", "--set", "stop_when_explored=false"];
    let whole = site.record(&[&flags[..], &["--transport", "memory"]].concat());
    let whole = Recording::from_bytes(&whole.bytes);

    let mut run = site.start(&mut site.run_sh(&[&flags[..], &["--rtf", "4", "--record", "run.mcap"]].concat()));
    run.is_under_way(&site.path("run.mcap"));
    let mut rogue = Rogue::new(site.domain());
    let noise_on_commands = rogue.publisher(&topics::signed_command(AgentId(0)));
    let noise_on_joins = rogue.publisher(&topics::signed_join(AgentId(1)));
    let mut rng = voxels::random_streams::stream(1, 0, "noise");
    let mut noise = || Noise((0..rng.random_range(0..200)).map(|_| rng.random()).collect());
    publish_until(&mut run, "a message on a topic of agent 0 cannot be decoded", || {
        noise_on_commands.publish(noise()).is_ok()
    });
    publish_until(&mut run, "a message on a topic of agent 1 cannot be decoded", || {
        noise_on_joins.publish(noise()).is_ok()
    });

    let commands = rogue.publisher(&topics::signed_command(AgentId(0)));
    let stop = Motion { kind: Motion::STOP, ..Motion::default() };
    let command = SignedCommand { command: Command { motion: stop, ..Command::default() }, mac: NONE };
    publish_until(&mut run, "a message on a topic of agent 0 is of another run", || {
        commands.publish(command.clone()).is_ok()
    });

    signal(run.process().pid(), "INT");
    run.ended().with_code(130);
    let recording = site.recording("run.mcap");
    let result = recording.result();
    let names: Vec<_> = refusals(&result).into_keys().collect();
    assert_eq!(names, ["refused_other_run", "refused_undecodable"]);
    recording.assert_begins(&whole, 1);
}

/// Any participant in the network can publish on the server's topics.
#[test]
fn agent_ignores_other_servers() {
    let site = Site::new();
    let flags = ["--agents", "2", "--size", "20", "--duration", "600", "--set", "stop_when_explored=false"];
    let whole = site.record(&[&flags[..], &["--transport", "memory"]].concat());
    let whole = Recording::from_bytes(&whole.bytes);

    let mut run = site.start(&mut site.run_sh(&[&flags[..], &["--rtf", "4", "--record", "run.mcap"]].concat()));
    run.is_under_way(&site.path("run.mcap"));
    let mut rogue = Rogue::new(site.domain());
    let scenarios = rogue.subscription::<Scenario>(&topics::scenario());
    let observations = rogue.publisher(&topics::signed_observation(AgentId(0)));
    let mut number = None;
    let log = site.path("logs/agent_0.log");
    let is_ignored = || std::fs::read_to_string(&log).is_ok_and(|log| log.contains("is not the server"));
    let pause = Duration::from_millis(50);
    let mut pauses_left = HANG.as_millis() / pause.as_millis();
    while !is_ignored() {
        pauses_left = pauses_left.checked_sub(1).expect("the agent receives a message of the rogue");
        run.process().says_within("x real time", pause);
        number = number.or_else(|| scenarios.take().ok().flatten().map(|(scenario, _)| scenario.run));
        if let Some(run) = number {
            let end = Observation { run, parts: 1, phase: Observation::ENDED, tick: 1, ..Observation::default() };
            let signed = SignedObservation { observation: end, mac: NONE };
            observations.publish(signed).expect("a rogue can publish");
        }
    }
    signal(run.process().pid(), "INT");
    run.ended().with_code(130);
    let recording = site.recording("run.mcap");
    assert_eq!(refusals(&recording.result()), BTreeMap::new());
    recording.assert_begins(&whole, 1);
}

/// Publishes repeatedly, because discovery takes time, until the server prints `text`.
#[track_caller]
fn publish_until(run: &mut Run, text: &str, mut publish: impl FnMut() -> bool) {
    let pause = Duration::from_millis(50);
    for _ in 0..HANG.as_millis() / pause.as_millis() {
        assert!(publish(), "a rogue can publish");
        if run.process().says_within(text, pause) {
            return;
        }
    }
    panic!("the server never printed: {text}");
}
