//! The server while it waits for replies: it saves the recording, can be stopped, and tolerates
//! late and repeated replies.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use agent_node::transport::{Inbound, ServerTransport};
use in_memory::{AgentsEnd, ServerEnd};
use msgs::ids::AgentId;
use msgs::maes_msgs::{Command, Observation};
use protocol::signed::{JoinRequest, Signed};
use simulation::scenario::Rtf;
use transport::{AgentTransport, Inbound as ToServer, Incoming};

use crate::support::interceptor::{Interceptor, intercepted};
use crate::support::memory::{FinishedRun, Play, honest};
use crate::support::processes::{Process, signal};
use crate::support::recordings::{OLDER_RECORDING, Recording, refusals};
use crate::support::runs::{Site, scenario};

/// Duration of a run, seconds of sim time.
const DURATION_S: f64 = 1.0;

/// An agent's link that hands each command to a closure.
struct Slow<F> {
    inner: AgentsEnd,
    answer: F,
    /// The last requested tick, and how many times it was requested.
    asked: (u64, u32),
}

impl<F: FnMut(&mut AgentsEnd, &Signed<Command>, u32)> ServerTransport for Slow<F> {
    fn send_join(&mut self, join: &Signed<JoinRequest>) {
        self.inner.send_join(join);
    }

    fn send_command(&mut self, command: &Signed<Command>) {
        (self.answer)(&mut self.inner, command, self.asked.1);
    }

    fn receive(&mut self, timeout: Duration) -> Option<Inbound> {
        let message = self.inner.receive(timeout);
        if let Some(Inbound::Observation(part)) = &message {
            let Observation { tick, .. } = part.claimed();
            self.asked = if self.asked.0 == *tick { (*tick, self.asked.1 + 1) } else { (*tick, 1) };
        }
        message
    }
}

/// A run in which a closure sends the commands of agent 1. Its last argument: how many times the
/// tick was requested.
fn with_answers(
    play: Play,
    answer: impl Fn(&mut AgentsEnd, &Signed<Command>, u32) + Send + Sync + 'static,
) -> FinishedRun {
    play.with(move |inner, ids, is_over| {
        let options = honest(u64::from(ids[0].0), ids.clone());
        let answer = |end: &mut AgentsEnd, command: &Signed<Command>, asked| {
            if ids == [AgentId(1)] { answer(end, command, asked) } else { end.send_command(command) }
        };
        let mut link = Slow { inner, answer, asked: (u64::MAX, 0) };
        agent_node::host::run(&mut link, &options, is_over).expect("agents are welcome");
    })
}

/// Digest and number of refused messages of such a run.
fn run(play: Play, answer: impl Fn(&mut AgentsEnd, &Signed<Command>, u32) + Send + Sync + 'static) -> (String, u64) {
    let played = with_answers(play, answer);
    (played.digest(), refusals(&played.outcome().result).values().sum())
}

#[test]
fn first_reply_may_take_the_join_timeout() {
    let mut impatient = Play::of_two(DURATION_S);
    impatient.scenario.execution.decision_timeout_s = 0.5;
    // Requests are resent after 0.1, 0.3 and 0.7 s.
    let late = run(impatient, |end, command, asked| {
        if command.claimed().tick > 0 || asked >= 4 {
            end.send_command(command);
        }
    });
    assert_eq!(late, run(Play::of_two(DURATION_S), |end, command, _| end.send_command(command)));
}

/// NaN is not equal to itself, so replies are compared by their bytes.
#[test]
fn repeated_reply_with_nan_is_idempotent() {
    let said_once = |end: &mut AgentsEnd, command: &Signed<Command>, _| {
        let mut command = command.claimed().clone();
        command.motion.yaw_rate_rad_s = f64::NAN;
        end.send_command(&Signed::unsigned(command));
    };
    let once = run(Play::of_two(DURATION_S), said_once);
    // At the second request of tick 10 the agent replies twice, and at the third once more.
    let twice = run(Play::of_two(DURATION_S), move |end, command, asked| {
        let times = if command.claimed().tick != 10 { 1 } else { [0, 0, 2, 1][asked.min(3) as usize] };
        (0..times).for_each(|_| said_once(end, command, asked));
    });
    assert_eq!((once.1, &once), (0, &twice));
}

#[test]
fn recording_is_saved_while_a_reply_is_awaited() {
    let site = Site::new();
    let file = site.path("run.mcap");
    let mut recorded = Play::of_two(DURATION_S);
    recorded.record = Some(file.clone());
    recorded.scenario.execution.decision_timeout_s = 1000.0;
    run(recorded, move |end, command, _| {
        while command.claimed().tick == 20 && last_tick(&file) < 20 {
            // Until then only the same request is resent.
            end.receive(Duration::from_millis(20));
        }
        end.send_command(command);
    });
}

/// The tick of the last message that can be read.
fn last_tick(file: &Path) -> u64 {
    Recording::read(file).messages.last().map_or(0, |message| message.tick)
}

/// Set once the server of [`paced_run_can_be_stopped`] receives again after the commands of a tick,
/// which it does only while the pace holds the clock.
static IS_HELD: AtomicBool = AtomicBool::new(false);

/// A server's end that detects when the clock is held.
struct HoldDetector {
    /// Commands of tick 0 so far.
    commands: usize,
}

impl Interceptor for HoldDetector {
    fn receive(&mut self, inner: &mut ServerEnd, timeout: Duration) -> Option<Incoming> {
        if self.commands == 2 {
            IS_HELD.store(true, Ordering::Relaxed);
        }
        let incoming = inner.receive(timeout)?;
        self.commands += usize::from(matches!(incoming.message, ToServer::Command(_)));
        Some(incoming)
    }
}

#[test]
fn paced_run_can_be_stopped() {
    let mut paced = Play::of_two(DURATION_S);
    paced.server_link = |inner| intercepted(inner, HoldDetector { commands: 0 });
    // The second tick is hours away.
    paced.scenario.execution.rtf = Rtf::Limit(1e-6);
    let stop = Arc::clone(&paced.stop);
    let played = with_answers(paced, move |end, command, asked| {
        end.send_command(command);
        // The request may be resent on a busy machine; the first reply is enough.
        if asked > 1 {
            return;
        }
        while !IS_HELD.load(Ordering::Relaxed) {
            end.receive(Duration::from_millis(20));
        }
        stop.store(true, Ordering::Relaxed);
    });
    let result = &played.outcome().result;
    assert_eq!((result.reason.as_str(), result.tick), ("interrupted", 1));
}

/// The run is interrupted at an observation that agent 1 replies to after the shutdown message has
/// come, and then acknowledges that, before agent 0 does. If the observation is sent again before,
/// agent 1 has replied to it already.
#[track_caller]
fn assert_crossing_is_not_refused(is_sent_again: bool) {
    let play = Play::of_two(DURATION_S);
    let stop = Arc::clone(&play.stop);
    let has_crossed = AtomicBool::new(false);
    let played = play.with(move |inner, ids, is_over| {
        let options = honest(u64::from(ids[0].0), ids.clone());
        let pause = Duration::from_millis(20);
        let answer = |end: &mut AgentsEnd, command: &Signed<Command>, asked| {
            if ids == [AgentId(1)] && command.claimed().tick == 10 && !stop.load(Ordering::Relaxed) {
                if is_sent_again {
                    if asked < 2 {
                        return;
                    }
                    end.send_command(command);
                }
                stop.store(true, Ordering::Relaxed);
                let ends = |inbound| matches!(inbound, Inbound::Observation(part) if part.claimed().phase == Observation::ENDED);
                while !end.receive(pause).is_some_and(ends) {}
                end.send_command(command);
                let claimed = command.claimed();
                let other = Command { known_free: claimed.known_free + 1, ..claimed.clone() };
                end.send_command(&Signed::unsigned(other));
                has_crossed.store(true, Ordering::Relaxed);
                return;
            }
            let is_held = || command.claimed().tick == 10 || stop.load(Ordering::Relaxed);
            while ids == [AgentId(0)] && is_held() && !has_crossed.load(Ordering::Relaxed) {
                end.receive(pause);
            }
            end.send_command(command);
        };
        let mut link = Slow { inner, answer, asked: (u64::MAX, 0) };
        agent_node::host::run(&mut link, &options, is_over).expect("agents are welcome");
    });
    let result = &played.outcome().result;
    assert_eq!((result.reason.as_str(), refusals(result)), ("interrupted", BTreeMap::new()));
}

#[test]
fn reply_that_crosses_the_shutdown_is_not_refused() {
    assert_crossing_is_not_refused(false);
}

#[test]
fn repeated_reply_that_crosses_the_shutdown_is_not_refused() {
    assert_crossing_is_not_refused(true);
}

#[test]
fn abandoned_tick_keeps_sent_observations() {
    let site = Site::new();
    let long = ["--agents", "2", "--size", "20", "--duration", "600", "--look-ahead", "false", "--rtf", "20"];
    let flags = ["--set", "stop_when_explored=false", "--decision-timeout", "1000", "--record", "run.mcap"];
    let mut run = site.start(&mut site.run_sh(&[&long[..], &flags].concat()));
    run.is_under_way(&site.path("run.mcap"));
    signal(run.process().member(&["agent_node", "--id 1-1"]), "STOP");
    signal(run.process().pid(), "INT");
    run.ended().with_code(130);
    let recording = site.recording("run.mcap");
    for agent in [0, 1] {
        let sent: Vec<Observation> = recording.of(&format!("/agent_{agent}/observation"));
        let answers: Vec<Command> = recording.of(&format!("/agent_{agent}/command"));
        let running: Vec<_> = sent.iter().filter(|part| part.phase == Observation::RUNNING && part.part == 0).collect();
        let [answered, sent] = [answers.len(), running.len()];
        // Equal if the signal came between two ticks, or if no agent was due in this one.
        assert!(sent == answered || sent == answered + 1, "agent {agent}: sent {sent} times, answered {answered}");
    }
}

#[test]
fn failed_start_keeps_the_older_recording() {
    let site = Site::new();
    site.file("run.mcap", OLDER_RECORDING);
    let start = |environment: (&str, &str), flags: &[&str]| {
        let mut server = site.binary("sim_server");
        server.arg("run").arg(scenario("default.toml")).args(["--record", "run.mcap"]).args(flags);
        Process::start(server.env(environment.0, environment.1)).ended()
    };
    start(("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF"), &[]).with_code(1);
    start(("ROS_DOMAIN_ID", "233"), &[]).with_code(2);
    start(("NOTHING", ""), &["--set", "map.spheres.fill_ratio=7"]).with_code(2);
    assert_eq!(std::fs::read(site.path("run.mcap")).expect("it is there"), OLDER_RECORDING);
    let left: Vec<_> = std::fs::read_dir(site.path("")).expect("it is there").collect();
    assert_eq!(left.len(), 1, "{left:?}");
}
