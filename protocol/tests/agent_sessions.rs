//! The protocol of the server, driven step by step without a transport and a clock.

use std::sync::Arc;
use std::time::Duration;

use msgs::ids::{AgentId, Tick};
use msgs::maes_msgs::{Command, Join, JoinReply, Observation, Scenario};
use protocol::limits::PROTOCOL;
use protocol::lockstep::{
    AgentSessions, Event, Inbound, Incoming, JoinPolicy, Notice, ObservationRequest, ReplayPolicy, Replies,
    RunIdentity, SourceId, TimeoutPolicy, Transmit,
};
use protocol::observation::RequestKind;
use protocol::signed::Signed;

const TIMEOUT: Duration = Duration::from_millis(500);

/// Sessions, and the wall time.
struct Driven {
    sessions: AgentSessions,
    run: u64,
    now: Duration,
}

impl Driven {
    /// Agents whose processes have joined, each with these.
    fn of(groups: &[&[u32]]) -> Self {
        let identity = RunIdentity::new(8, [0; 32]);
        let agents = groups.iter().flat_map(|group| group.iter()).count();
        let replays = ReplayPolicy { keeps_log: true, allows_replacement: true };
        let mut sessions = AgentSessions::new(identity, JoinPolicy::default(), agents as u32, replays);
        sessions.announce(&Scenario::default(), false);
        let mut driven = Self { sessions, run: identity.run(), now: Duration::ZERO };
        for (process, group) in (1..).zip(groups) {
            for &agent in *group {
                driven.join(agent, process);
                assert_eq!(driven.joined(), [(agent, JoinReply::NONE)]);
            }
        }
        assert_eq!(driven.sessions.missing(), []);
        driven
    }

    fn receive(&mut self, agent: u32, process: u8, message: Inbound) {
        let incoming = Incoming { topic_agent: AgentId(agent), source: SourceId([process; 16]), message };
        self.sessions.handle(incoming, self.now);
    }

    fn join(&mut self, agent: u32, process: u8) {
        let (run, instance, controller) = (self.run, process.into(), "rbw".to_owned());
        let join = Join { run, agent, instance, protocol: PROTOCOL, controller, last_tick: Join::NONE };
        self.receive(agent, process, Inbound::Join(Signed::unsigned(join)));
    }

    fn answer(&mut self, agent: u32, process: u8, tick: u64) {
        let info = format!("agent {agent}, tick {tick}");
        let command = Command { tick, run: self.run, agent, info, ..Command::default() };
        self.receive(agent, process, Inbound::Command(Signed::unsigned(command)));
    }

    fn request(agent: u32, tick: u64, phase: u8) -> ObservationRequest {
        let fragment = Observation { agent, tick, parts: 1, phase, ..Observation::default() };
        ObservationRequest { agent: AgentId(agent), kind: RequestKind::Scheduled, fragments: Arc::new(vec![fragment]) }
    }

    fn ask(&mut self, tick: u64, agents: &[u32]) {
        self.sessions.enter(Tick(tick));
        for &agent in agents {
            self.sessions.request(&Self::request(agent, tick, Observation::RUNNING));
        }
        self.sessions.await_replies(self.now, TIMEOUT, TimeoutPolicy::Hold);
    }

    fn commit(&mut self, replies: &Replies) {
        for (&agent, reply) in replies {
            let request = Self::request(agent.0, reply.message.tick, Observation::RUNNING);
            self.sessions.append(agent, request.fragments, &reply.message, true);
        }
    }

    /// Executes a tick without disturbance.
    fn tick(&mut self, tick: u64, asked: &[(u32, u8)]) {
        self.ask(tick, &asked.iter().map(|(agent, _)| *agent).collect::<Vec<_>>());
        for &(agent, process) in asked {
            self.answer(agent, process, tick);
        }
        let replies = self.answered().expect("all have answered");
        self.commit(&replies);
        self.sent();
    }

    /// Lets time pass.
    fn pass(&mut self, time: Duration) {
        let end = self.now + time;
        while let Some(at) = self.sessions.poll_timeout().filter(|at| *at <= end) {
            self.now = at;
            self.sessions.handle_timeout(at);
        }
        self.now = end;
    }

    /// The observations that were sent, by agent and tick.
    fn sent(&mut self) -> Vec<(u32, u64)> {
        let transmits = std::iter::from_fn(|| self.sessions.poll_transmit());
        transmits
            .filter_map(|transmit| match transmit {
                Transmit::Observation(agent, signed) => Some((agent.0, signed.claimed().tick)),
                Transmit::JoinReply(_) => None,
            })
            .collect()
    }

    /// The replies to joins that were sent, by agent and code.
    fn joined(&mut self) -> Vec<(u32, u8)> {
        let transmits = std::iter::from_fn(|| self.sessions.poll_transmit());
        transmits
            .filter_map(|transmit| match transmit {
                Transmit::JoinReply(reply) => Some((reply.agent, reply.code)),
                Transmit::Observation(..) => None,
            })
            .collect()
    }

    fn events(&mut self) -> Vec<Event> {
        std::iter::from_fn(|| self.sessions.poll_event()).collect()
    }

    fn answered(&mut self) -> Option<Replies> {
        self.events().into_iter().find_map(|event| match event {
            Event::Answered(replies) => Some(replies),
            _ => None,
        })
    }
}

#[test]
fn unanswered_observations_are_resent() {
    let mut driven = Driven::of(&[&[0], &[1]]);
    driven.ask(0, &[0, 1]);
    assert_eq!(driven.sent(), [(0, 0), (1, 0)]);
    driven.answer(0, 1, 0);
    driven.pass(Duration::from_millis(99));
    assert_eq!(driven.sent(), []);
    driven.pass(Duration::from_millis(1));
    assert_eq!(driven.sent(), [(1, 0)]);
    driven.answer(1, 2, 0);
    assert_eq!(driven.answered().expect("both have answered").len(), 2);
    assert_eq!(driven.sessions.poll_timeout(), None);
    // A second answer is excused, because the observation was resent; a third one is not.
    driven.answer(1, 2, 0);
    assert_eq!(driven.events(), []);
    driven.answer(1, 2, 0);
    assert!(matches!(driven.events()[..], [Event::Notice(Notice::Refused { .. })]));
}

#[test]
fn a_lost_process_is_replaced_and_replayed_to() {
    let mut driven = Driven::of(&[&[0]]);
    driven.tick(0, &[(0, 1)]);
    driven.tick(3, &[(0, 1)]);
    driven.ask(4, &[0]);
    driven.join(0, 2);
    assert_eq!(driven.joined(), [(0, JoinReply::HELD)]);
    driven.pass(TIMEOUT);
    assert!(matches!(driven.events()[..], [Event::Notice(Notice::Silent { .. })]));
    driven.sent();
    driven.join(0, 2);
    assert_eq!(driven.sent(), [(0, 0)]);
    driven.answer(0, 2, 0);
    assert_eq!(driven.sent(), [(0, 3)]);
    driven.answer(0, 2, 3);
    assert_eq!(driven.sent(), [(0, 4)]);
    // The first process is back, and is not heard.
    let before = driven.sessions.fingerprint();
    driven.answer(0, 1, 4);
    assert_eq!(driven.sessions.fingerprint(), before);
    assert_eq!(driven.answered(), None);
    driven.answer(0, 2, 4);
    assert_eq!(driven.answered().expect("it has answered").len(), 1);
}

/// A process takes over the second agent of a lost one between two ticks. The dismissal of another
/// agent leaves its replay alone.
#[test]
fn dismissal_ends_no_other_replay() {
    let mut driven = Driven::of(&[&[0], &[1, 2]]);
    driven.tick(0, &[(0, 1), (1, 2), (2, 2)]);
    driven.ask(1, &[1, 2]);
    driven.answer(2, 2, 1);
    driven.pass(TIMEOUT);
    driven.join(1, 3);
    driven.answer(1, 3, 0);
    driven.answer(1, 3, 1);
    let replies = driven.answered().expect("agent 2 has answered before its process was lost");
    driven.commit(&replies);
    driven.sessions.enter(Tick(2));
    driven.join(2, 3);
    driven.sent();
    driven.sessions.shut_down(Tick(2), &[Driven::request(0, 2, Observation::ENDED)], driven.now, TIMEOUT);
    assert_eq!(driven.sent(), [(0, 2)]);
    driven.answer(0, 1, 2);
    assert!(driven.answered().is_some(), "no replay is awaited");
    driven.ask(2, &[2]);
    assert_eq!(driven.sent(), [(2, 0)]);
    for (tick, next) in [(0, 1), (1, 2)] {
        driven.answer(2, 3, tick);
        assert_eq!(driven.sent(), [(2, next)]);
    }
}

#[test]
fn suspension_of_the_server_loses_no_agent() {
    let mut driven = Driven::of(&[&[0]]);
    driven.ask(0, &[0]);
    driven.now += Duration::from_secs(3600);
    driven.sessions.handle_timeout(driven.now);
    assert_eq!(driven.events(), []);
    driven.answer(0, 1, 0);
    assert!(driven.answered().is_some());
}
