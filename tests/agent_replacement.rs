//! Replacement of lost agent processes under `faults.on_agent_loss = "wait"`: who may replace whom,
//! with the same run.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use agent_node::transport::{Inbound, ServerTransport};
use in_memory::AgentsEnd;
use msgs::ids::AgentId;
use msgs::maes_msgs::{Command, Join};
use protocol::limits::PROTOCOL;
use protocol::signed::{JoinRequest, Signed};
use simulation::scenario::OnAgentLoss;
use system::wall_clock::now;

use crate::support::memory::{FinishedRun, Play, honest};

/// The instance number of a process that joins a second time.
const BACK: u64 = 77;

/// The link of a process that dies after so many replies.
pub(crate) struct Mortal<'a> {
    pub(crate) inner: AgentsEnd,
    pub(crate) answers_left: u32,
    pub(crate) is_gone: &'a AtomicBool,
}

impl ServerTransport for Mortal<'_> {
    fn send_join(&mut self, join: &Signed<JoinRequest>) {
        self.inner.send_join(join);
    }

    fn send_command(&mut self, command: &Signed<Command>) {
        match self.answers_left.checked_sub(1) {
            Some(left) => {
                self.answers_left = left;
                self.inner.send_command(command);
            }
            None => self.is_gone.store(true, Ordering::Relaxed),
        }
    }

    fn receive(&mut self, timeout: Duration) -> Option<Inbound> {
        self.inner.receive(timeout)
    }
}

/// The link of a replacement, which repeats its join until it is accepted.
pub(crate) struct Successor {
    pub(crate) inner: AgentsEnd,
    pub(crate) join: Option<Signed<JoinRequest>>,
    pub(crate) is_accepted: bool,
}

impl ServerTransport for Successor {
    fn send_join(&mut self, join: &Signed<JoinRequest>) {
        self.join = Some(Signed::unsigned(Join { instance: BACK, ..join.claimed().join.clone() }));
    }

    fn send_command(&mut self, command: &Signed<Command>) {
        self.inner.send_command(command);
    }

    fn receive(&mut self, timeout: Duration) -> Option<Inbound> {
        if let Some(join) = self.join.as_ref().filter(|_| !self.is_accepted) {
            self.inner.send_join(join);
        }
        self.inner.receive(timeout).filter(|message| match message {
            Inbound::Scenario(_) => true,
            Inbound::JoinReply(reply) => {
                self.is_accepted |= reply.instance == BACK && reply.accepted;
                false
            }
            Inbound::Observation(_) => self.is_accepted,
        })
    }
}

/// Waits for a flag of another process or the end of the run.
pub(crate) fn wait_for(flag: &AtomicBool, is_over: &AtomicBool) {
    while !flag.load(Ordering::Relaxed) && !is_over.load(Ordering::Relaxed) {
        std::thread::yield_now();
    }
}

/// Two agents, and a second process for agent 1, which comes when the first one is gone.
fn of_three_processes() -> Play {
    let mut play = Play::of_two(4.0);
    play.scenario.faults.on_agent_loss = OnAgentLoss::Wait;
    play.scenario.execution.decision_timeout_s = 0.3;
    play.scenario.execution.join_timeout_s = 2.0;
    play.groups = vec![vec![0], vec![1], vec![1]];
    play
}

fn undisturbed() -> String {
    let mut play = Play::of_two(4.0);
    play.scenario.faults.on_agent_loss = OnAgentLoss::Wait;
    let played = play.with(|mut end, ids, is_over| {
        agent_node::host::run(&mut end, &honest(ids[0].0.into(), ids), is_over).expect("agents are welcome");
    });
    played.digest()
}

/// Serves agents over a link.
fn serve(link: &mut dyn ServerTransport, instance: u64, ids: &[AgentId], is_over: &AtomicBool) {
    agent_node::host::run(link, &honest(instance, ids.to_vec()), is_over).expect("agents are welcome");
}

/// A run in which agent 1 dies after so many replies and is restarted.
fn dying_after(answers_left: u32) -> FinishedRun {
    let (is_taken, is_gone) = (AtomicBool::new(false), AtomicBool::new(false));
    of_three_processes().with(move |mut inner, ids, is_over| {
        if ids == [AgentId(0)] {
            serve(&mut inner, 0, &ids, is_over);
        } else if !is_taken.swap(true, Ordering::Relaxed) {
            serve(&mut Mortal { inner, answers_left, is_gone: &is_gone }, 1, &ids, &is_gone);
        } else {
            wait_for(&is_gone, is_over);
            serve(&mut inner, 2, &ids, is_over);
        }
    })
}

#[test]
fn restarted_agent_gives_the_same_run() {
    let digest = undisturbed();
    for answers in [0, 1, 20] {
        assert_eq!(dying_after(answers).digest(), digest, "died after {answers} answers");
    }
}

/// Replies go to all processes, so that more of them than can be received would keep a large team
/// from its start.
#[test]
fn repeated_joins_are_answered_once() {
    let played = Play::of_two(1.0).with(|mut inner, ids, is_over| {
        if ids == [AgentId(0)] {
            serve(&mut inner, 0, &ids, is_over);
            return;
        }
        let begun = now();
        let mut link = Counting { inner, replies: 0 };
        serve(&mut link, 1, &ids, is_over);
        // One for each second that a busy machine may take.
        let seconds = usize::try_from(begun.elapsed().as_millis() / 900).expect("it is small");
        assert!((1..=1 + seconds).contains(&link.replies), "{} replies in {seconds} s", link.replies);
    });
    played.outcome();
}

/// The link of a process that sends each join ten times, and counts the replies.
struct Counting {
    inner: AgentsEnd,
    replies: usize,
}

impl ServerTransport for Counting {
    fn send_join(&mut self, join: &Signed<JoinRequest>) {
        (0..10).for_each(|_| self.inner.send_join(join));
    }

    fn send_command(&mut self, command: &Signed<Command>) {
        self.inner.send_command(command);
    }

    fn receive(&mut self, timeout: Duration) -> Option<Inbound> {
        let received = self.inner.receive(timeout);
        self.replies += usize::from(matches!(&received, Some(Inbound::JoinReply(reply)) if reply.instance == 1));
        received
    }
}

/// The first process joins and dies before the clock starts, when its loss cannot have been
/// noticed.
#[test]
fn agent_lost_before_the_start_is_replaced() {
    let (is_taken, is_gone, is_back) =
        (AtomicBool::new(false), AtomicBool::new(false), Arc::new(AtomicBool::new(false)));
    let played = of_three_processes().with(move |mut inner, ids, is_over| {
        if ids == [AgentId(0)] {
            // Agent 0 joins only after the replacement has sent its join.
            wait_for(&is_back, is_over);
            serve(&mut inner, 0, &ids, is_over);
        } else if !is_taken.swap(true, Ordering::Relaxed) {
            let run = loop {
                if let Some(Inbound::Scenario(scenario)) = inner.receive(Duration::from_millis(20)) {
                    break scenario.run;
                }
            };
            let join = Join {
                run,
                agent: 1,
                instance: 1,
                protocol: PROTOCOL,
                controller: "rbw".to_owned(),
                last_tick: Join::NONE,
            };
            inner.send_join(&Signed::unsigned(join));
            while !matches!(inner.receive(Duration::from_millis(20)), Some(Inbound::JoinReply(reply)) if reply.accepted)
            {
            }
            is_gone.store(true, Ordering::Relaxed);
        } else {
            wait_for(&is_gone, is_over);
            let mut link = Claiming { inner, has_claimed: &is_back };
            serve(&mut link, 2, &ids, is_over);
        }
    });
    assert_eq!(played.digest(), undisturbed());
}

/// A link that sets a flag when it has sent a join.
struct Claiming<'a> {
    inner: AgentsEnd,
    has_claimed: &'a AtomicBool,
}

impl ServerTransport for Claiming<'_> {
    fn send_join(&mut self, join: &Signed<JoinRequest>) {
        self.inner.send_join(join);
        self.has_claimed.store(true, Ordering::Relaxed);
    }

    fn send_command(&mut self, command: &Signed<Command>) {
        self.inner.send_command(command);
    }

    fn receive(&mut self, timeout: Duration) -> Option<Inbound> {
        self.inner.receive(timeout)
    }
}

/// A link that pauses, after so many replies, until a join was refused.
struct Holding<'a> {
    inner: AgentsEnd,
    answers_left: u32,
    is_held: &'a AtomicBool,
    is_refused: &'a AtomicBool,
    is_over: &'a AtomicBool,
}

impl ServerTransport for Holding<'_> {
    fn send_join(&mut self, join: &Signed<JoinRequest>) {
        self.inner.send_join(join);
    }

    fn send_command(&mut self, command: &Signed<Command>) {
        self.answers_left = self.answers_left.saturating_sub(1);
        if self.answers_left == 0 {
            self.is_held.store(true, Ordering::Relaxed);
            wait_for(self.is_refused, self.is_over);
        }
        self.inner.send_command(command);
    }

    fn receive(&mut self, timeout: Duration) -> Option<Inbound> {
        self.inner.receive(timeout)
    }
}

/// It has replied to the observations that a replacement is sent again, and would occupy the id.
#[test]
fn replaced_process_cannot_rejoin() {
    let [is_taken, is_gone, is_held, is_refused] = [const { AtomicBool::new(false) }; 4];
    let played = of_three_processes().with(move |mut inner, ids, is_over| {
        if ids == [AgentId(0)] {
            serve(&mut inner, 0, &ids, is_over);
        } else if !is_taken.swap(true, Ordering::Relaxed) {
            let mut mortal = Mortal { inner, answers_left: 10, is_gone: &is_gone };
            serve(&mut mortal, 1, &ids, &is_gone);
            wait_for(&is_held, is_over);
            let mut run = 0;
            // The number of the run is in the observations.
            while !is_over.load(Ordering::Relaxed) {
                match mortal.receive(Duration::from_millis(20)) {
                    Some(Inbound::Observation(part)) => run = part.claimed().run,
                    Some(Inbound::JoinReply(reply)) if reply.instance == BACK => {
                        assert!(!reply.accepted, "it has replied already");
                        break;
                    }
                    _ => {}
                }
                let (controller, protocol) = ("rbw".to_owned(), PROTOCOL);
                let join = Join { run, agent: 1, instance: BACK, protocol, controller, last_tick: 9 };
                mortal.send_join(&Signed::unsigned(join));
            }
            is_refused.store(true, Ordering::Relaxed);
        } else {
            wait_for(&is_gone, is_over);
            let mut link = Holding { inner, answers_left: 20, is_held: &is_held, is_refused: &is_refused, is_over };
            serve(&mut link, 2, &ids, is_over);
        }
    });
    assert_eq!(played.digest(), undisturbed());
}
