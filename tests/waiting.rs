//! What holds while the server waits for agents: the recording is saved, the run can be stopped, words said twice are known again.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

use agent_node::transport::{Inbound, ServerTransport};
use experiments::in_memory::AgentsEnd;
use msgs::ids::AgentId;
use msgs::maes_msgs::{Command, Join, Observation};
use simulation::scenario::Rtf;

use crate::support::memory::{Play, Played, honest};
use crate::support::processes::{Process, signal};
use crate::support::recordings::{Recording, refusals};
use crate::support::runs::{Site, scenario};

/// How long a run lasts, seconds of sim time.
const DURATION_S: f64 = 1.0;

/// The link of an agent with a way of its own to answer.
struct Slow<F> {
    inner: AgentsEnd,
    answer: F,
    /// How often each tick has been asked.
    asked: (u64, u32),
}

impl<F: FnMut(&mut AgentsEnd, &Command, u32)> ServerTransport for Slow<F> {
    fn send_join(&mut self, join: &Join) {
        self.inner.send_join(join);
    }

    fn send_command(&mut self, command: &Command) {
        (self.answer)(&mut self.inner, command, self.asked.1);
    }

    fn receive(&mut self, timeout: Duration) -> Option<Inbound> {
        let message = self.inner.receive(timeout);
        if let Some(Inbound::Observation(Observation { tick, .. })) = &message {
            self.asked = if self.asked.0 == *tick { (*tick, self.asked.1 + 1) } else { (*tick, 1) };
        }
        message
    }
}

/// A run whose agent 1 answers in this way: it is given the answer, and how often the tick has been asked.
fn with_answers(play: Play, answer: impl Fn(&mut AgentsEnd, &Command, u32) + Send + Sync + 'static) -> Played {
    play.with(move |inner, ids, is_over| {
        let options = honest(u64::from(ids[0].0), ids.clone());
        let answer = |end: &mut AgentsEnd, command: &Command, asked| {
            if ids == [AgentId(1)] { answer(end, command, asked) } else { end.send_command(command) }
        };
        let mut link = Slow { inner, answer, asked: (u64::MAX, 0) };
        agent_node::host::run(&mut link, &options, is_over).expect("agents are welcome");
    })
}

/// The digest of such a run, and how many messages were refused.
fn play(play: Play, answer: impl Fn(&mut AgentsEnd, &Command, u32) + Send + Sync + 'static) -> (String, u64) {
    let played = with_answers(play, answer);
    (played.digest(), refusals(&played.outcome().result).values().sum())
}

#[test]
fn the_first_answers_may_take_as_long_as_joining() {
    let mut impatient = Play::of_two(DURATION_S);
    impatient.scenario.execution.decision_timeout_s = 0.2;
    // It is asked for the third time after 0.3 s at the earliest.
    let late = play(impatient, |end, command, asked| {
        if command.tick > 0 || asked >= 3 {
            end.send_command(command);
        }
    });
    assert_eq!(late, play(Play::of_two(DURATION_S), |end, command, _| end.send_command(command)));
}

#[test]
fn words_said_twice_are_known_again_though_a_number_is_none() {
    let said_once = |end: &mut AgentsEnd, command: &Command, _| {
        let mut command = command.clone();
        command.task.yaw_rate_rad_s = f64::NAN;
        end.send_command(&command);
    };
    let once = play(Play::of_two(DURATION_S), said_once);
    // Asked again, it says the same twice: once more than the server needs.
    let twice = play(Play::of_two(DURATION_S), move |end, command, asked| {
        let times = if command.tick != 10 { 1 } else { [0, 0, 2, 1][asked.min(3) as usize] };
        (0..times).for_each(|_| said_once(end, command, asked));
    });
    assert_eq!((once.1, &once), (0, &twice));
}

#[test]
fn the_recording_is_saved_while_an_answer_is_awaited() {
    let site = Site::new();
    let file = site.path("run.mcap");
    let mut recorded = Play::of_two(DURATION_S);
    recorded.record = Some(file.clone());
    recorded.scenario.execution.decision_timeout_s = 1000.0;
    play(recorded, move |end, command, _| {
        while command.tick == 20 && last_tick(&file) < 20 {
            // What comes meanwhile is the same question again.
            end.receive(Duration::from_millis(20));
        }
        end.send_command(command);
    });
}

/// The tick of the last message that can be read.
fn last_tick(file: &Path) -> u64 {
    Recording::read(file).messages.last().map_or(0, |message| message.tick)
}

#[test]
fn a_run_that_is_held_back_for_hours_can_be_stopped() {
    let mut held_back = Play::of_two(DURATION_S);
    held_back.scenario.execution.rtf = Rtf::Limit(1e-6);
    let stop = Arc::clone(&held_back.stop);
    let played = with_answers(held_back, move |end, command, _| {
        end.send_command(command);
        // Until nothing comes, because the next tick is hours away.
        while end.receive(Duration::from_millis(300)).is_some() {}
        stop.store(true, Ordering::Relaxed);
    });
    let result = &played.outcome().result;
    assert_eq!((result.reason.as_str(), result.tick), ("interrupted", 1));
}

#[test]
fn a_tick_that_is_given_up_leaves_what_agents_were_told() {
    let site = Site::new();
    let long = ["--agents", "2", "--size", "20", "--duration", "600", "--look-ahead", "false", "--rtf", "20"];
    let flags = ["--set", "stop_when_explored=false", "--decision-timeout", "1000", "--record", "run.mcap"];
    let mut run = site.start(&mut site.run_sh(&[&long[..], &flags].concat()));
    run.is_under_way();
    signal(run.process().member(&["agent_node", "--id 1-1"]), "STOP");
    signal(run.process().pid(), "INT");
    run.ended().with_code(130);
    let recording = site.recording("run.mcap");
    for agent in [0, 1] {
        let told: Vec<Observation> = recording.of(&format!("/agent_{agent}/observation"));
        let answers: Vec<Command> = recording.of(&format!("/agent_{agent}/command"));
        let running: Vec<_> = told.iter().filter(|part| part.phase == Observation::RUNNING && part.part == 0).collect();
        let [answered, told] = [answers.len(), running.len()];
        // Not if the signal came between two ticks, or no one was due in this one.
        assert!(told == answered || told == answered + 1, "agent {agent}: told {told} times, answered {answered}");
    }
}

#[test]
fn a_run_that_cannot_begin_leaves_the_older_recording_alone() {
    let site = Site::new();
    site.file("run.mcap", "an older recording");
    let run = |environment: (&str, &str), flags: &[&str]| {
        let mut server = site.binary("sim_server");
        server.arg("run").arg(scenario("default.toml")).args(["--record", "run.mcap"]).args(flags);
        Process::start(server.env(environment.0, environment.1)).ended()
    };
    run(("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF"), &[]).with_code(1);
    run(("ROS_DOMAIN_ID", "233"), &[]).with_code(2);
    run(("NOTHING", ""), &["--set", "map.spheres.fill_ratio=7"]).with_code(2);
    assert_eq!(std::fs::read_to_string(site.path("run.mcap")).expect("it is there"), "an older recording");
    let left: Vec<_> = std::fs::read_dir(site.path("")).expect("it is there").collect();
    assert_eq!(left.len(), 1, "{left:?}");
}
