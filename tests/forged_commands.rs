//! Forged, replayed and unsigned messages of strangers who know everything that is sent: refused,
//! counted, and without effect on the digest.

use std::collections::{BTreeMap, VecDeque};
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use agent_node::host::{Credentials, Options};
use in_memory::{AgentsEnd, ServerEnd};
use msgs::ids::AgentId;
use msgs::maes_msgs::{Command, Join, Motion, SignedCommand, SignedJoin};
use protocol::lockstep::SourceId;
use protocol::signed::{JoinRequest, Signed};
use protocol::signing::{JOIN_SECRET, JoinContext, JoinSecret, NONE, SessionKey, Signs};
use sim_server::session::JoinPolicy;
use transport::{AgentTransport, Inbound, Incoming, Transport};

use crate::support::interceptor::{Interceptor, intercepted};
use crate::support::memory::{FinishedRun, Play, honest};
use crate::support::processes::Process;
use crate::support::recordings::refusals;
use crate::support::runs::{Site, scenario};

/// Duration of a run, seconds of sim time.
const DURATION_S: f64 = 2.0;

/// A server's end over which a stranger sends under the GUID of the agents.
struct Attacked {
    /// Whether others than the agents can send.
    is_open: bool,
    /// What the stranger sends for each message of an agent, before it.
    attack: fn(&Incoming, &[Incoming]) -> Vec<Inbound>,
    /// What agents have sent.
    heard: Vec<Incoming>,
    waiting: VecDeque<Incoming>,
}

impl Attacked {
    fn over(inner: ServerEnd, is_open: bool, attack: fn(&Incoming, &[Incoming]) -> Vec<Inbound>) -> Box<dyn Transport> {
        intercepted(inner, Self { is_open, attack, heard: Vec::new(), waiting: VecDeque::new() })
    }
}

impl Interceptor for Attacked {
    fn is_open(&self) -> bool {
        self.is_open
    }

    fn receive(&mut self, inner: &mut ServerEnd, timeout: Duration) -> Option<Incoming> {
        if self.waiting.is_empty() {
            let incoming = inner.receive(timeout)?;
            let Incoming { topic_agent, source, .. } = incoming;
            let forged = (self.attack)(&incoming, &self.heard);
            self.waiting.extend(forged.into_iter().map(|message| Incoming { topic_agent, source, message }));
            self.heard.push(incoming.clone());
            self.waiting.push_back(incoming);
        }
        self.waiting.pop_front()
    }
}

fn nothing(_: &Incoming, _: &[Incoming]) -> Vec<Inbound> {
    Vec::new()
}

fn stopped(command: &Command) -> Command {
    Command { motion: Motion { kind: Motion::STOP, ..Motion::default() }, want_view: true, ..command.clone() }
}

/// A command without a code, with the code of the true command, and with a code by a key that the
/// stranger has made up.
fn forge(incoming: &Incoming, _: &[Incoming]) -> Vec<Inbound> {
    let Inbound::Command(signed) = &incoming.message else { return Vec::new() };
    let SignedCommand { command, mac } = signed.clone().into();
    let command = stopped(&command);
    let repeated = SignedCommand { command: command.clone(), mac };
    let own = Signed::sign(command.clone(), &SessionKey::new([7; 32]));
    [Signed::unsigned(command), repeated.into(), own].map(Inbound::Command).into()
}

/// All that the agent has sent before.
fn replay(incoming: &Incoming, heard: &[Incoming]) -> Vec<Inbound> {
    if !matches!(incoming.message, Inbound::Command(_)) {
        return Vec::new();
    }
    // The joins and the last commands.
    let of_agent = |other: &&Incoming| other.source == incoming.source;
    heard.iter().rev().filter(of_agent).take(3).map(|other| other.message.clone()).collect()
}

/// Joins under the GUID of the agent, and its true join from another process.
fn join(incoming: &Incoming, _: &[Incoming]) -> Vec<Inbound> {
    let Inbound::Join(true_join) = &incoming.message else { return Vec::new() };
    let guess = JoinSecret::new(b"a guess of the stranger").expect("it is long enough");
    let guessed = Signed::sign(true_join.claimed().clone(), &guess.join_key(&NONE, &incoming.source.0));
    let true_join = SignedJoin::from(true_join.clone());
    let other = Join { instance: 99, ..true_join.join.clone() };
    let forged = [SignedJoin { join: other.clone(), ..true_join.clone() }, SignedJoin { nonce: [9; 32], ..true_join }];
    let forged = forged.map(Signed::from).into_iter();
    forged.chain([Signed::unsigned(other), guessed]).map(Inbound::Join).collect()
}

fn secret() -> JoinSecret {
    JoinSecret::new(b"the secret of this run").expect("it is long enough")
}

/// Runs two agents, with this secret on both sides.
fn played(secret: Option<JoinSecret>, link: fn(ServerEnd) -> Box<dyn Transport>) -> FinishedRun {
    let mut play = Play::of_two(DURATION_S);
    play.policy = JoinPolicy { secret: secret.clone(), ..JoinPolicy::default() };
    play.server_link = link;
    play.with(move |mut end: AgentsEnd, ids: Vec<AgentId>, is_over: &AtomicBool| {
        let nonce = [ids[0].0 as u8 + 1; 32];
        let credentials = Some(Credentials { secret: secret.clone(), nonce, starts: 1 });
        let options = Options { credentials, ..honest(u64::from(ids[0].0) + 10, ids) };
        agent_node::host::run(&mut end, &options, is_over).expect("honest agents are welcome");
    })
}

fn undisturbed() -> String {
    let played = played(None, |inner| Attacked::over(inner, false, nothing));
    assert_eq!(refusals(&played.outcome().result), BTreeMap::new());
    played.digest()
}

#[test]
fn signed_runs_have_the_digest_of_unsigned_ones() {
    for secret in [None, Some(secret())] {
        let signed = played(secret, |inner| Attacked::over(inner, true, nothing));
        assert_eq!(refusals(&signed.outcome().result), BTreeMap::new());
        assert_eq!(signed.digest(), undisturbed());
    }
}

#[test]
fn forged_commands_are_refused() {
    for secret in [None, Some(secret())] {
        let attacked = played(secret, |inner| Attacked::over(inner, true, forge));
        let refusals = refusals(&attacked.outcome().result);
        assert_eq!(refusals.keys().copied().collect::<Vec<_>>(), ["refused_forged_command"]);
        // Of two agents in each tick and at the end; more if a busy machine has resent something.
        assert!(refusals["refused_forged_command"] >= 3 * 2 * 100, "{refusals:?}");
        assert_eq!(attacked.digest(), undisturbed());
        let note = "refused: a command of agent 0, tick 0, is not signed by the process that has joined";
        assert!(attacked.notes.iter().any(|said| said == note), "{:?}", attacked.notes);
    }
    // The attack works where nothing is signed.
    let unsigned = played(None, |inner| Attacked::over(inner, false, forge));
    assert_ne!(unsigned.digest(), undisturbed());
}

#[test]
fn replayed_messages_have_no_effect() {
    let attacked = played(Some(secret()), |inner| Attacked::over(inner, true, replay));
    let refusals = refusals(&attacked.outcome().result);
    // A busy machine resends observations, and then a command may also be a second one.
    let expected = ["refused_second_answer", "refused_wrong_tick"];
    assert!(refusals.keys().all(|name| expected.contains(name)), "{refusals:?}");
    assert!(refusals["refused_wrong_tick"] >= 2 * 2 * 90, "{refusals:?}");
    assert_eq!(attacked.digest(), undisturbed());
}

#[test]
fn joins_without_the_secret_are_refused() {
    let attacked = played(Some(secret()), |inner| Attacked::over(inner, true, join));
    let refusals = refusals(&attacked.outcome().result);
    assert_eq!(refusals.keys().copied().collect::<Vec<_>>(), ["refused_unproven_join"]);
    assert!(refusals["refused_unproven_join"] >= 2 * 4, "{refusals:?}");
    assert_eq!(attacked.digest(), undisturbed());
}

/// A command of an earlier run, with the number of the present one.
#[test]
fn keys_are_renewed_by_each_join() {
    let request = JoinRequest { join: Join { run: 7, ..Join::default() }, nonce: [1; 32], starts: 1 };
    let (join, later) = (request.clone(), JoinRequest { nonce: [2; 32], ..request });
    let (join, later) = (Signed::<JoinRequest>::unsigned(join), Signed::<JoinRequest>::unsigned(later));
    let source = SourceId([3; 16]).0;
    let context = JoinContext { announcement: &NONE, source: &source, join: &join };
    let command = Command { run: 7, tick: 5, ..Command::default() };
    let code = |context, nonce: u8| secret().session_key(context, &[nonce; 32]).signature(&command);
    assert_ne!(code(context, 1), code(context, 2), "the server draws another nonce");
    assert_ne!(code(context, 1), code(JoinContext { join: &later, ..context }, 1));
}

/// Over ROS 2: an agent without the secret of the run is refused, and one with it is accepted.
#[test]
fn agent_without_the_secret_is_refused() {
    let site = Site::new();
    let mut server = site.binary("sim_server");
    server.arg("run").arg(scenario("default.toml")).args(["--agents", "1", "--size", "20", "--duration", "20"]);
    server.args(["--record", "run.mcap", "--log", "server.log"]);
    let mut run = site.start(&mut server);
    run.process().says("waiting for agents: 0");
    let stranger = Process::start(site.binary("agent_node").args(["--id", "0"]).env_remove(JOIN_SECRET));
    let stranger = stranger.ended().with_code(5);
    assert!(stranger.stderr.contains("a join as agent 0 does not prove the join secret of this run"), "{stranger}");
    run.process().says("refused: a join as agent 0 does not prove the join secret of this run");
    let secret_file = site.file("secret", "the join secret of the tests\n");
    let agent = || {
        let mut agent = site.binary("agent_node");
        agent.args(["--id", "0", "--join-secret-file"]).arg(&secret_file).env_remove(JOIN_SECRET);
        agent
    };
    let readable = Process::start(&mut agent()).ended().with_code(2);
    assert!(readable.stderr.contains("expected 600: chmod 600 "), "{readable}");
    std::fs::set_permissions(&secret_file, std::os::unix::fs::PermissionsExt::from_mode(0o600)).expect("it is ours");
    let agent = Process::start(&mut agent());
    let ended = run.ended().with_code(0);
    agent.ended().with_code(0);
    let secret = b"the join secret of the tests";
    let is_in = |bytes: &[u8]| bytes.windows(secret.len()).any(|window| window == secret);
    assert!(is_in(&std::fs::read(&secret_file).expect("it is there")), "the search finds it");
    for name in ["run.mcap", "server.log"] {
        assert!(!is_in(&std::fs::read(site.path(name)).expect("it is there")), "{name}");
    }
    assert!(!is_in(ended.stdout.as_bytes()) && !is_in(ended.stderr.as_bytes()));
}
