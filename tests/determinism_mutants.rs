//! Mutation tests of the determinism tests: controllers and servers with an injected source of
//! nondeterminism.
//!
//! A mutant differs from the original in one number, taken from a forbidden source: the order of a
//! hash table, a random stream shared by several agents, the wall clock. One of the comparisons of
//! `determinism.rs` must detect each mutant, with the same function; the original must pass all of
//! them.

use std::hash::{BuildHasher, RandomState};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, LazyLock, Mutex};
use std::time::{Duration, Instant};

use agent_node::command::{Command, Motion, WakeCondition};
use agent_node::controllers::{Controller, Ctx};
use agent_node::observation::Observation;
use in_memory::{AgentsEnd, ServerEnd};
use msgs::ids::{AgentId, Tick};
use msgs::maes_msgs::Observation as Part;
use protocol::signed::Signed;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use recording::Recording;
use sim_server::session::RunError;
use simulation::scenario::OnAgentLoss;
use transport::{AgentTransport, Incoming, Transport};

use crate::agent_replacement::{Mortal, Successor, wait_for};
use crate::support::interceptor::{Interceptor, intercepted};
use crate::support::lock;
use crate::support::memory::{FinishedRun, Play, serve};
use crate::support::runs::{Site, difference};

/// Source of the angle that the controller turns by.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Source {
    /// A random stream of its own: the original.
    Own,
    /// The iteration order of a hash table.
    HashOrder,
    /// A random stream of the process, shared by its agents.
    SharedStream,
    /// The wall clock.
    Clock,
}

/// Turns by a number and wakes seven ticks later. It reads its position, so that tampered
/// observations show.
struct Turner {
    source: Source,
    own: ChaCha8Rng,
    shared: Arc<Mutex<ChaCha8Rng>>,
}

impl Turner {
    fn new(agent: AgentId, source: Source, shared: &Arc<Mutex<ChaCha8Rng>>) -> Self {
        Self { source, own: voxels::random_streams::stream(3, agent.0.into(), "turner"), shared: Arc::clone(shared) }
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
        Command::new(Motion::Turn { angle_rad: heading - 1.5 }, WakeCondition::at(Tick(observation.tick.0 + 7)))
    }
}

/// A variant of the execution of a run.
#[derive(Clone, Copy)]
struct Variant {
    name: &'static str,
    groups: &'static [&'static [u32]],
    threads: u32,
    look_ahead: bool,
    is_delayed: bool,
    server_link: fn(ServerEnd) -> Box<dyn Transport>,
}

const APART: Variant = Variant {
    name: "repeated",
    groups: &[&[0], &[1], &[2]],
    threads: 1,
    look_ahead: true,
    is_delayed: false,
    server_link: |end| Box::new(end),
};

/// As in `determinism.rs`: repeated, grouped in processes, in another order, delayed, with threads,
/// without look-ahead.
const VARIANTS: [Variant; 7] = [
    APART,
    Variant { name: "together", groups: &[&[0, 1, 2]], ..APART },
    Variant { name: "two processes", groups: &[&[1, 2], &[0]], ..APART },
    Variant { name: "another order", groups: &[&[2], &[1], &[0]], ..APART },
    Variant { name: "delayed", is_delayed: true, ..APART },
    Variant { name: "threads", threads: 4, ..APART },
    Variant { name: "no look-ahead", look_ahead: false, ..APART },
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

fn prepare(site: &Site, variant: Variant) -> Play {
    let mut play = Play::new(SCENARIO);
    play.scenario.execution.look_ahead = variant.look_ahead;
    play.scenario.execution.threads = variant.threads;
    play.groups = variant.groups.iter().map(|group| group.to_vec()).collect();
    play.server_link = variant.server_link;
    play.record = Some(site.path("run.mcap"));
    play
}

fn carry_out(play: Play, source: Source, is_delayed: bool) -> FinishedRun {
    play.with(move |end: AgentsEnd, ids: Vec<AgentId>, is_over: &AtomicBool| {
        let shared = Arc::new(Mutex::new(voxels::random_streams::stream(3, 0, "shared")));
        let controller = |id| Box::new(Turner::new(id, source, &shared)) as Box<dyn Controller>;
        let mut rng = voxels::random_streams::stream(3, ids[0].0.into(), "delays");
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

/// Digest and recording of a run.
fn run(source: Source, variant: Variant) -> (String, Vec<u8>) {
    let site = Site::new();
    let digest = carry_out(prepare(&site, variant), source, variant.is_delayed).digest();
    (digest, std::fs::read(site.path("run.mcap")).expect("there is a recording"))
}

/// The variants whose run differs from the first one.
fn found_by(source: Source, server_link: fn(ServerEnd) -> Box<dyn Transport>) -> Vec<&'static str> {
    let (digest, bytes) = run(source, Variant { server_link, ..APART });
    let differs = |variant: &Variant| {
        let (other_digest, other_bytes) = run(source, Variant { server_link, ..*variant });
        difference((&digest, &bytes), (&other_digest, &other_bytes)).is_some()
    };
    VARIANTS.iter().filter(|variant| differs(variant)).map(|variant| variant.name).collect()
}

#[test]
fn deterministic_controller_passes() {
    assert_eq!(found_by(Source::Own, |end| Box::new(end)), [""; 0]);
}

#[test]
fn hash_order_is_detected() {
    assert_eq!(found_by(Source::HashOrder, |end| Box::new(end)), VARIANTS.map(|variant| variant.name));
}

#[test]
fn wall_clock_is_detected() {
    assert_eq!(found_by(Source::Clock, |end| Box::new(end)), VARIANTS.map(|variant| variant.name));
}

#[test]
fn shared_random_stream_is_detected() {
    // With one process for each agent the fault does not show.
    assert_eq!(found_by(Source::SharedStream, |end| Box::new(end)), ["together", "two processes"]);
}

/// A server's end that reverses the order of replies, or sends positions with an error from a hash.
struct Tampered {
    waiting: Vec<Incoming>,
    is_tampering: bool,
}

impl Interceptor for Tampered {
    fn send(&mut self, inner: &mut ServerEnd, agent: AgentId, part: Signed<Part>) {
        let mut part = part.trusted().into_inner();
        if self.is_tampering && part.phase == Part::RUNNING {
            part.position.x += (RandomState::new().hash_one(part.tick) % 1000) as f64 * 1e-6;
        }
        inner.send(agent, Signed::unsigned(part));
    }

    fn receive(&mut self, inner: &mut ServerEnd, timeout: Duration) -> Option<Incoming> {
        if self.waiting.is_empty() {
            self.waiting.extend(inner.receive(timeout));
            while let Some(next) = inner.receive(Duration::ZERO) {
                self.waiting.push(next);
            }
        }
        // The agent that was last comes first; each keeps its own order, as on its topic.
        let agent = self.waiting.last()?.topic_agent;
        let first = self.waiting.iter().position(|incoming| incoming.topic_agent == agent)?;
        Some(self.waiting.remove(first))
    }
}

#[test]
fn hash_order_in_observations_is_detected() {
    let tampering = |inner| intercepted(inner, Tampered { waiting: Vec::new(), is_tampering: true });
    assert_eq!(found_by(Source::Own, tampering), VARIANTS.map(|variant| variant.name));
}

#[test]
fn reply_order_is_irrelevant() {
    let upside_down = |inner| intercepted(inner, Tampered { waiting: Vec::new(), is_tampering: false });
    assert_eq!(found_by(Source::Own, upside_down), [""; 0]);
}

/// Resumes the first half of a recorded run.
fn resumed(source: Source) -> (FinishedRun, Vec<u8>, Vec<u8>) {
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
fn assert_diverged(played: FinishedRun) {
    match played.outcome {
        Err(RunError::Diverged { agent, tick, what }) => {
            assert!(agent.0 < 3 && tick.0.is_multiple_of(7), "agent {agent}, tick {tick}");
            assert!(what.starts_with("motion.angle_rad was ") && what.contains(" and is "), "{what}");
        }
        other => panic!("{other:?}\n{}", played.notes.join("\n")),
    }
}

#[test]
fn resumed_run_is_the_same() {
    let (played, whole, completed) = resumed(Source::Own);
    let digest = played.digest();
    assert_eq!(difference((&digest, &whole), (&digest, &completed)), None);
}

#[test]
fn resumed_run_detects_divergence() {
    for source in [Source::HashOrder, Source::Clock] {
        assert_diverged(resumed(source).0);
    }
}

#[test]
fn restarted_agent_divergence_is_named() {
    let site = Site::new();
    let mut play = prepare(&site, APART);
    play.scenario.faults.on_agent_loss = OnAgentLoss::Wait;
    play.scenario.execution.decision_timeout_s = 0.3;
    play.scenario.execution.join_timeout_s = 2.0;
    // The last process replaces the one of agent 1.
    play.groups = vec![vec![0], vec![1], vec![2], vec![1]];
    let (is_taken, is_gone) = (AtomicBool::new(false), AtomicBool::new(false));
    let played = play.with(move |inner: AgentsEnd, ids: Vec<AgentId>, is_over: &AtomicBool| {
        let shared = Arc::new(Mutex::new(voxels::random_streams::stream(3, 0, "shared")));
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
