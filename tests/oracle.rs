//! The tests of determinism find what is not: controllers and servers with a fault of that kind are told from those without.
//!
//! A mutant decides as its original does, but for one number that comes from where no number may come from: the order of a hash,
//! a random stream that several agents share, the wall clock. Each must be found by one of the comparisons that
//! `determinism.rs` makes, with the same function; the original must pass all of them.

use std::hash::{BuildHasher, RandomState};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, LazyLock, Mutex};
use std::time::{Duration, Instant};

use agent_node::command::{Command, Motion, Trigger};
use agent_node::controllers::{Controller, Ctx};
use agent_node::observation::Observation;
use experiments::in_memory::{AgentsEnd, ServerEnd};
use msgs::ids::{AgentId, Tick};
use msgs::maes_msgs::{JoinReply, Observation as Part, Progress, Scenario};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use sim_server::recording::Recording;
use sim_server::session::RunError;
use sim_server::transport::{AgentTransport, ControlInput, Incoming, ObserverOutput, Transport};
use simulation::scenario::OnAgentLoss;

use crate::lost_processes::{Mortal, Successor, wait_for};
use crate::support::lock;
use crate::support::memory::{Play, Played, serve};
use crate::support::runs::{Site, difference};

/// Where a controller has the number from that it turns by.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Source {
    /// A random stream of its own, as it should.
    Own,
    /// The order in which a hash table would go through its headings.
    HashOrder,
    /// A random stream of the process, whoever of its agents draws from it.
    SharedStream,
    /// The wall clock.
    Clock,
}

/// Turns by some number, and asks to be asked a little later. It looks where it is, so that it finds out about lies.
struct Turner {
    source: Source,
    own: ChaCha8Rng,
    shared: Arc<Mutex<ChaCha8Rng>>,
}

impl Turner {
    fn new(agent: AgentId, source: Source, shared: &Arc<Mutex<ChaCha8Rng>>) -> Self {
        Self { source, own: random_streams::stream(3, agent.0.into(), "turner"), shared: Arc::clone(shared) }
    }

    fn heading(&mut self) -> u32 {
        match self.source {
            Source::Own => self.own.random_range(0..1000),
            Source::HashOrder => {
                let hasher = RandomState::new();
                (0..1000).min_by_key(|heading| hasher.hash_one(heading)).unwrap_or_default()
            }
            Source::SharedStream => lock(&self.shared).random_range(0..1000),
            Source::Clock => BEGUN.elapsed().subsec_nanos() % 1000,
        }
    }
}

#[expect(clippy::disallowed_methods, reason = "that a controller reads the clock is what has to be found")]
static BEGUN: LazyLock<Instant> = LazyLock::new(Instant::now);

impl Controller for Turner {
    fn decide(&mut self, observation: &Observation, _ctx: &mut Ctx<'_>) -> Command {
        let heading = f64::from(self.heading()) * 0.003 + observation.pose.position.x * 0.01;
        Command::new(Motion::Turn { angle_rad: heading - 1.5 }, Trigger::at(Tick(observation.tick.0 + 7)))
    }
}

/// How a run is carried out.
#[derive(Clone, Copy)]
struct Way {
    name: &'static str,
    groups: &'static [&'static [u32]],
    threads: u32,
    look_ahead: bool,
    is_delayed: bool,
    server_link: fn(ServerEnd) -> Box<dyn Transport>,
}

const APART: Way = Way {
    name: "again",
    groups: &[&[0], &[1], &[2]],
    threads: 1,
    look_ahead: true,
    is_delayed: false,
    server_link: |end| Box::new(end),
};

/// As in `determinism.rs`: again, in one process, in several, in another order, late, on more threads, asked at every tick.
const WAYS: [Way; 7] = [
    APART,
    Way { name: "together", groups: &[&[0, 1, 2]], ..APART },
    Way { name: "two processes", groups: &[&[1, 2], &[0]], ..APART },
    Way { name: "another order", groups: &[&[2], &[1], &[0]], ..APART },
    Way { name: "late", is_delayed: true, ..APART },
    Way { name: "threads", threads: 4, ..APART },
    Way { name: "no look-ahead", look_ahead: false, ..APART },
];

const SCENARIO: &str = "
seed = 7
duration_s = 40.0
stop_when_explored = false
[map]
kind = \"spheres\"
size = 20
[agents]
count = 3
";

fn prepare(site: &Site, way: Way) -> Play {
    let mut play = Play::new(SCENARIO);
    play.scenario.execution.look_ahead = way.look_ahead;
    play.scenario.execution.threads = way.threads;
    play.groups = way.groups.iter().map(|group| group.to_vec()).collect();
    play.server_link = way.server_link;
    play.record = Some(site.path("run.mcap"));
    play
}

fn carry_out(play: Play, source: Source, is_delayed: bool) -> Played {
    play.with(move |end: AgentsEnd, ids: Vec<AgentId>, is_over: &AtomicBool| {
        let shared = Arc::new(Mutex::new(random_streams::stream(3, 0, "shared")));
        let controller = |id| Box::new(Turner::new(id, source, &shared)) as Box<dyn Controller>;
        let mut rng = random_streams::stream(3, ids[0].0.into(), "delays");
        let pause = || {
            if is_delayed {
                disturb(Duration::from_micros(rng.random_range(0..2000)));
            }
        };
        serve(end, &ids, controller, pause, is_over);
    })
}

#[expect(clippy::disallowed_methods, reason = "disturbing the wall time is what this is for")]
fn disturb(delay: Duration) {
    std::thread::sleep(delay);
}

/// The digest and the bytes of a run.
fn run(source: Source, way: Way) -> (String, Vec<u8>) {
    let site = Site::new();
    let digest = carry_out(prepare(&site, way), source, way.is_delayed).digest();
    (digest, std::fs::read(site.path("run.mcap")).expect("there is a recording"))
}

/// The ways in which such a run is another one than the first.
fn found_by(source: Source, server_link: fn(ServerEnd) -> Box<dyn Transport>) -> Vec<&'static str> {
    let (digest, bytes) = run(source, Way { server_link, ..APART });
    let differs = |way: &Way| {
        let (other_digest, other_bytes) = run(source, Way { server_link, ..*way });
        difference((&digest, &bytes), (&other_digest, &other_bytes)).is_some()
    };
    WAYS.iter().filter(|way| differs(way)).map(|way| way.name).collect()
}

#[test]
fn the_original_is_the_same_in_every_way() {
    assert_eq!(found_by(Source::Own, |end| Box::new(end)), [""; 0]);
}

#[test]
fn the_order_of_a_hash_is_found() {
    assert_eq!(found_by(Source::HashOrder, |end| Box::new(end)), WAYS.map(|way| way.name));
}

#[test]
fn the_wall_clock_is_found() {
    assert_eq!(found_by(Source::Clock, |end| Box::new(end)), WAYS.map(|way| way.name));
}

#[test]
fn a_random_stream_that_agents_share_is_found_where_they_share_a_process() {
    // Apart it is the same every time: that is why they are put together.
    assert_eq!(found_by(Source::SharedStream, |end| Box::new(end)), ["together", "two processes"]);
}

/// A server's end that hands answers on in another order, or tells agents something that hangs on a hash.
struct Tampered {
    inner: ServerEnd,
    waiting: Vec<Incoming>,
    is_liar: bool,
}

impl AgentTransport for Tampered {
    fn announce(&mut self, scenario: &Scenario) {
        self.inner.announce(scenario);
    }

    fn reply_join(&mut self, reply: &JoinReply) {
        self.inner.reply_join(reply);
    }

    fn send(&mut self, agent: AgentId, part: &Part) {
        let mut part = part.clone();
        if self.is_liar && part.phase == Part::RUNNING {
            part.position.x += (RandomState::new().hash_one(part.tick) % 1000) as f64 * 1e-6;
        }
        self.inner.send(agent, &part);
    }

    fn receive(&mut self, timeout: Duration) -> Option<Incoming> {
        if self.waiting.is_empty() {
            self.waiting.extend(self.inner.receive(timeout));
            while let Some(next) = self.inner.receive(Duration::ZERO) {
                self.waiting.push(next);
            }
        }
        // The last comes first.
        self.waiting.pop()
    }
}

impl ObserverOutput for Tampered {
    fn clock(&mut self, tick: Tick) {
        self.inner.clock(tick);
    }

    fn progress(&mut self, progress: &Progress) {
        self.inner.progress(progress);
    }
}

impl ControlInput for Tampered {}

#[test]
fn a_server_that_tells_what_hangs_on_a_hash_is_found() {
    let liar = |inner| Box::new(Tampered { inner, waiting: Vec::new(), is_liar: true }) as Box<dyn Transport>;
    assert_eq!(found_by(Source::Own, liar), WAYS.map(|way| way.name));
}

#[test]
fn answers_in_another_order_are_no_other_run() {
    let upside_down = |inner| Box::new(Tampered { inner, waiting: Vec::new(), is_liar: false }) as Box<dyn Transport>;
    assert_eq!(found_by(Source::Own, upside_down), [""; 0]);
}

/// The server goes on with a part of a recorded run.
fn resumed(source: Source) -> (Played, Vec<u8>, Vec<u8>) {
    let site = Site::new();
    carry_out(prepare(&site, APART), source, false).outcome();
    let whole = std::fs::read(site.path("run.mcap")).expect("there is a recording");
    let half = whole[..whole.len() / 2].to_vec();
    let mut play = prepare(&site, APART);
    play.resumed = Some(Recording::from_bytes("half".to_owned(), half).expect("it begins as a recording"));
    let played = carry_out(play, source, false);
    (played, whole, std::fs::read(site.path("run.mcap")).expect("there is a recording"))
}

#[track_caller]
fn assert_diverged(played: Played) {
    match played.outcome {
        Err(RunError::Diverged { agent, tick, what }) => {
            assert!(agent.0 < 3 && tick.0.is_multiple_of(7), "agent {agent}, tick {tick}");
            assert!(what.starts_with("task.angle_rad was ") && what.contains(" and is "), "{what}");
        }
        other => panic!("{other:?}\n{}", played.notes.join("\n")),
    }
}

#[test]
fn a_run_goes_on_with_agents_that_decide_the_same_again() {
    let (played, whole, completed) = resumed(Source::Own);
    let digest = played.digest();
    assert_eq!(difference((&digest, &whole), (&digest, &completed)), None);
}

#[test]
fn a_run_does_not_go_on_with_agents_that_do_not() {
    for source in [Source::HashOrder, Source::Clock] {
        assert_diverged(resumed(source).0);
    }
}

#[test]
fn an_agent_that_is_started_again_and_decides_otherwise_is_named() {
    let site = Site::new();
    let mut play = prepare(&site, APART);
    play.scenario.faults.on_agent_loss = OnAgentLoss::Wait;
    play.scenario.execution.decision_timeout_s = 0.3;
    play.scenario.execution.join_timeout_s = 0.3;
    // The last one is to take the place of agent 1.
    play.groups = vec![vec![0], vec![1], vec![2], vec![1]];
    let (is_taken, is_gone) = (AtomicBool::new(false), AtomicBool::new(false));
    let played = play.with(move |inner: AgentsEnd, ids: Vec<AgentId>, is_over: &AtomicBool| {
        let shared = Arc::new(Mutex::new(random_streams::stream(3, 0, "shared")));
        let controller = |id| Box::new(Turner::new(id, Source::HashOrder, &shared)) as Box<dyn Controller>;
        if ids != [AgentId(1)] {
            serve(inner, &ids, controller, || {}, is_over);
        } else if !is_taken.swap(true, Ordering::Relaxed) {
            serve(Mortal { inner, answers_left: 5, is_gone: &is_gone }, &ids, controller, || {}, &is_gone);
        } else {
            wait_for(&is_gone, is_over);
            serve(Successor { inner, join: None, is_accepted: false }, &ids, controller, || {}, is_over);
        }
    });
    assert_diverged(played);
}
