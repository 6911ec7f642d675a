use super::*;
use controllers::Registry;
use msgs::maes_msgs::SignedObservation;
use protocol::signed::JoinRequest;
use protocol::signing::{Bytes, NONE, Signs};

const OURS: u64 = 7;
const OTHER: u64 = 8;

fn scenario(run: u64) -> Inbound {
    Inbound::Scenario(Scenario {
        protocol: PROTOCOL,
        run,
        size: [4, 4, 4],
        cell_m: 1.0,
        duration_ticks: 10,
        agents: 3,
        bodies: vec![msgs::maes_msgs::Body::default()],
        body_of: vec![0; 3],
        controller: "rbw".to_owned(),
        origin: run,
        ..Scenario::default()
    })
}

/// The first run of a server, after a reset.
fn begun_again(origin: u64, run: u64) -> Inbound {
    let Inbound::Scenario(scenario) = scenario(run) else { unreachable!("it is one") };
    Inbound::Scenario(Scenario { origin, ..scenario })
}

fn observation(run: u64, phase: u8) -> Inbound {
    Inbound::Observation(Signed::unsigned(Part { run, phase, parts: 1, ..Part::default() }))
}

/// A server that sends these messages, and accepts this many joins.
struct Server {
    says: Vec<Inbound>,
    replies: usize,
    joins: Vec<Join>,
    joined_at: Vec<Instant>,
    answers: Vec<Signed<Command>>,
    /// The key in the replies to joins.
    key: Bytes,
    /// Of the agents.
    credentials: Option<Credentials>,
    /// How many agents the process has.
    agents: u32,
    /// Whether the first join is answered with `HELD`.
    is_held: bool,
    /// Silence after which the process ends.
    timeout: Duration,
    /// Passes only while the server is silent, so that a busy machine decides no test.
    now: Instant,
}

#[expect(clippy::disallowed_methods, reason = "any instant will do")]
fn any_instant() -> Instant {
    Instant::now()
}

impl Server {
    fn saying(says: Vec<Inbound>, replies: usize) -> Self {
        let says = says.into_iter().rev().collect();
        let (joins, answers, now) = (Vec::new(), Vec::new(), any_instant());
        let (joined_at, timeout, key) = (Vec::new(), Duration::from_millis(1), NONE);
        let (credentials, agents, is_held) = (None, 1, false);
        Self { says, replies, joins, joined_at, answers, key, credentials, agents, is_held, timeout, now }
    }

    fn runs(&mut self) -> Result<(), RunError> {
        let options = Options {
            agents: (0..self.agents).map(AgentId).collect(),
            registry: Registry::BUILT_IN,
            controller: None,
            settings: Vec::new(),
            instance: 3,
            credentials: self.credentials.clone(),
            server_timeout: self.timeout,
            chaos_delay: Duration::ZERO,
            map_hz: 5.0,
            decision_times: None,
        };
        run(self, &options, &AtomicBool::new(false))
    }
}

impl ServerTransport for Server {
    fn send_join(&mut self, join: &Signed<JoinRequest>) {
        let JoinRequest { join, .. } = join.claimed();
        self.joins.push(join.clone());
        self.joined_at.push(self.now);
        if self.replies > 0 {
            self.replies -= 1;
            let Join { run, agent, instance, .. } = *join;
            let key = self.key;
            let reply = JoinReply { run, agent, instance, accepted: true, key, ..JoinReply::default() };
            self.says.push(Inbound::JoinReply(reply));
        } else if std::mem::take(&mut self.is_held) {
            let Join { run, agent, instance, .. } = *join;
            let reply = JoinReply { run, agent, instance, code: JoinReply::HELD, ..JoinReply::default() };
            self.says.push(Inbound::JoinReply(reply));
        }
    }

    fn send_command(&mut self, command: &Signed<Command>) {
        self.answers.push(command.clone());
    }

    fn now(&self) -> Instant {
        self.now
    }

    fn receive(&mut self, timeout: Duration) -> Option<Inbound> {
        let said = self.says.pop();
        self.now += if said.is_none() { timeout } else { Duration::ZERO };
        said
    }
}

/// A server that does not reply is asked less and less often, so that a large team can start.
#[test]
fn joins_are_repeated_quickly_at_first_only() {
    let mut server = Server::saying(vec![scenario(OURS)], 0);
    server.timeout = Duration::from_secs(10);
    assert!(matches!(server.runs(), Err(RunError::ServerSilent { .. })));
    let gaps: Vec<Duration> = server.joined_at.windows(2).map(|pair| pair[1].duration_since(pair[0])).collect();
    let (quick, slow) = gaps.split_at(QUICK_JOINS as usize - 1);
    let is_about = |period: Duration| move |gap: &Duration| (period..=period + RECEIVE_TIMEOUT).contains(gap);
    assert!(quick.iter().all(is_about(JOIN_PERIOD)), "{gaps:?}");
    assert!(slow.len() > 5 && slow.iter().all(is_about(PROBE_PERIOD)), "{gaps:?}");
}

#[test]
fn messages_of_another_run_are_ignored() {
    let refusal = JoinReply { run: OTHER, instance: 3, ..JoinReply::default() };
    let mut server = Server::saying(
        vec![
            scenario(Scenario::NO_RUN),
            observation(Scenario::NO_RUN, Part::RUNNING),
            scenario(OURS),
            scenario(Scenario::NO_RUN),
            observation(Scenario::NO_RUN, Part::ENDED),
            Inbound::JoinReply(refusal),
            observation(OTHER, Part::ENDED),
            scenario(OTHER),
            observation(OTHER, Part::RUNNING),
            observation(OURS, Part::RUNNING),
            observation(OURS, Part::ENDED),
        ],
        1,
    );
    // Messages of the other run are ignored at once.
    server.runs().unwrap_or_else(|error| panic!("{error}"));
    assert!(server.joins.iter().all(|join| join.run == OURS));
    assert_eq!(server.answers.iter().map(|command| command.claimed().run).collect::<Vec<_>>(), [OURS; 2]);
}

#[test]
fn unsigned_observations_are_ignored() {
    let key = SessionKey::new([7; 32]);
    let signed = |phase, tick| Signed::sign(Part { run: OURS, phase, tick, parts: 1, ..Part::default() }, &key);
    let tampered = |change: fn(&mut SignedObservation)| {
        let mut signed = signed(Part::ENDED, 1).into();
        change(&mut signed);
        Inbound::Observation(signed.into())
    };
    let mut server = Server::saying(
        vec![
            scenario(OURS),
            tampered(|signed| signed.observation.tick = 2),
            tampered(|signed| signed.observation.position.x = 1.0),
            tampered(|signed| signed.mac = NONE),
            tampered(|signed| signed.mac = SessionKey::new([8; 32]).signature(&signed.observation)),
            observation(OURS, Part::ENDED),
            Inbound::Observation(signed(Part::RUNNING, 3)),
            Inbound::Observation(signed(Part::ENDED, 4)),
        ],
        1,
    );
    server.key = [7; 32];
    server.runs().unwrap_or_else(|error| panic!("{error}"));
    let verified = server.answers.into_iter().map(|command| command.verify(&key).map(|command| command.tick));
    assert_eq!(verified.collect::<Vec<_>>(), [Ok(3), Ok(4)]);
}

/// A refusal by a stranger does not end the process; silence after it is explained.
#[test]
fn replies_without_proof_are_ignored() {
    let refusal = JoinReply { run: OURS, instance: 3, reason: "go away".to_owned(), ..JoinReply::default() };
    let mut server = Server::saying(vec![scenario(OURS), Inbound::JoinReply(refusal)], 0);
    let secret = protocol::signing::JoinSecret::new(b"the secret of the run").unwrap();
    server.credentials = Some(Credentials { secret: Some(secret), nonce: [1; 32], starts: 1 });
    let error = server.runs().unwrap_err().to_string();
    assert!(error.starts_with("agent 0: the server does not prove the join secret; it says: go away;"), "{error}");
}

#[test]
fn server_of_another_version_is_refused() {
    let Inbound::Scenario(of_ours) = scenario(OURS) else { unreachable!("it is one") };
    let mut server = Server::saying(vec![Inbound::Scenario(Scenario { protocol: 3, ..of_ours })], 1);
    let error = server.runs().unwrap_err();
    assert!(matches!(error, RunError::WrongProtocol { got: 3 }), "{error}");
}

#[test]
fn reset_run_is_joined_again() {
    let mut server = Server::saying(
        vec![
            scenario(OURS),
            observation(OURS, Part::RUNNING),
            begun_again(OURS, OURS + 5),
            observation(OURS, Part::RUNNING),
            // A message from before the reset, late.
            begun_again(OURS, OURS + 4),
            observation(OURS + 5, Part::RUNNING),
            observation(OURS + 5, Part::ENDED),
        ],
        1,
    );
    server.replies = 2;
    server.runs().unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(
        server.joins.iter().map(|join| (join.run, join.last_tick)).collect::<Vec<_>>(),
        [(OURS, Join::NONE), (OURS + 5, Join::NONE)]
    );
    let answers: Vec<u64> = server.answers.iter().map(|command| command.claimed().run).collect();
    assert_eq!(answers, [OURS, OURS + 5, OURS + 5]);
}

#[test]
fn silent_server_ends_the_process() {
    let mut server = Server::saying(vec![scenario(OURS), observation(OURS, Part::RUNNING)], 1);
    let error = server.runs().unwrap_err();
    assert!(matches!(error, RunError::ServerSilent { run: OURS, .. }), "{error}");
    let mut server = Server::saying(vec![scenario(OURS), scenario(OTHER)], 1);
    let error = server.runs().unwrap_err();
    assert!(matches!(error, RunError::Superseded { run: OURS, other: OTHER }), "{error}");
}

/// So that of two processes with the same agents one gets all of them.
#[test]
fn lowest_agent_joins_first() {
    for is_held in [false, true] {
        let mut server = Server::saying(vec![scenario(OURS), observation(OURS, Part::RUNNING)], 0);
        server.is_held = is_held;
        server.agents = 3;
        assert!(matches!(server.runs(), Err(RunError::ServerSilent { .. })));
        let joined: Vec<u32> = server.joins.iter().map(|join| join.agent).collect();
        // A slow machine may repeat joins.
        match is_held {
            true => assert!(joined.starts_with(&[0, 0, 1, 2]), "{joined:?}"),
            false => assert!(joined.iter().all(|&agent| agent == 0), "{joined:?}"),
        }
    }
}
