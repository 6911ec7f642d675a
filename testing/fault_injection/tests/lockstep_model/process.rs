//! An agent process as the protocol sees it: it joins as its lowest agent first, answers each
//! observation once, and repeats an answer that is asked for again. What it decides is a function
//! of all that it has observed, as that of a real controller.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use msgs::maes_msgs::JoinReply;

/// A message in the network. Messages stay in it: each may come late, twice, or never.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) enum Message {
    /// The join of an agent, with the last tick that its process has answered.
    Join { agent: u32, instance: u8, last_tick: Option<u64> },
    /// A command; `info` is what the agent has observed so far, `wake` when it is due next.
    Command { agent: u32, instance: u8, tick: u64, info: String, wake: u64 },
    /// The reply to a join.
    Reply { agent: u32, instance: u8, code: u8, accepted: bool },
    /// An observation, which all processes of an agent receive.
    Observation { agent: u32, tick: u64, has_ended: bool },
}

pub(crate) type Network = BTreeSet<Message>;

/// What the agents decide.
#[derive(Debug, Clone)]
pub(crate) enum Decisions {
    /// To be asked after one or two ticks.
    Counted,
    /// By agent, the ticks in which it was due in a recorded run.
    Recorded(Arc<BTreeMap<u32, BTreeSet<u64>>>),
}

impl Decisions {
    /// When an agent wants to be asked after a tick.
    pub(crate) fn next_due(&self, agent: u32, tick: u64) -> u64 {
        match self {
            Self::Counted => tick + 1 + u64::from(agent % 2),
            Self::Recorded(due) => due[&agent].range(tick.saturating_add(1)..).next().copied().unwrap_or(u64::MAX),
        }
    }

    /// What an undisturbed agent tells in a tick in which it is due: what it has observed so far.
    pub(crate) fn undisturbed(&self, agent: u32, tick: u64) -> String {
        let ticks = std::iter::successors(Some(0), |&tick| Some(self.next_due(agent, tick)));
        told(&ticks.take_while(|&due| due <= tick).collect::<Vec<_>>())
    }
}

/// Longest history that is told tick by tick.
const TOLD_MAX: usize = 8;

/// What an agent has observed, as its commands tell it.
fn told(history: &[u64]) -> String {
    if history.len() <= TOLD_MAX {
        return history.iter().map(u64::to_string).collect::<Vec<_>>().join(" ");
    }
    let hash = history.iter().fold(0_u64, |hash, tick| hash.wrapping_mul(0x9E37_79B9_7F4A_7C15).wrapping_add(tick + 1));
    format!("{} ticks: {hash:x}", history.len())
}

#[derive(Debug, Clone, PartialEq, Eq, Hash)]
struct Hosted {
    agent: u32,
    is_accepted: bool,
    is_held: bool,
    has_ended: bool,
    history: Vec<u64>,
    due: u64,
    last: Option<Message>,
}

impl Hosted {
    fn last_tick(&self) -> Option<u64> {
        match &self.last {
            Some(Message::Command { tick, .. }) => Some(*tick),
            _ => None,
        }
    }
}

/// A process of some agents.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(crate) struct Process {
    pub(crate) instance: u8,
    pub(crate) group: usize,
    agents: Vec<Hosted>,
}

impl Process {
    pub(crate) fn new(instance: u8, group: usize, agents: &[u32]) -> Self {
        let hosted = |&agent| Hosted {
            agent,
            is_accepted: false,
            is_held: false,
            has_ended: false,
            history: Vec::new(),
            due: 0,
            last: None,
        };
        Self { instance, group, agents: agents.iter().map(hosted).collect() }
    }

    pub(crate) fn hosts(&self, agent: u32) -> bool {
        self.agents.iter().any(|hosted| hosted.agent == agent)
    }

    /// Sends the joins that it may send now; once all agents are accepted these are probes.
    pub(crate) fn join(&self, network: &mut Network) {
        let is_first_decided = self.agents[0].is_accepted || self.agents[0].is_held;
        let addressed = if is_first_decided { self.agents.len() } else { 1 };
        for hosted in self.agents.iter().take(addressed).filter(|hosted| !hosted.has_ended) {
            let (agent, last_tick) = (hosted.agent, hosted.last_tick());
            network.insert(Message::Join { agent, instance: self.instance, last_tick });
        }
    }

    /// Whether a message for it, which has come before, changes nothing any more.
    pub(crate) fn ignores(&self, message: &Message) -> bool {
        let of = |agent| self.agents.iter().find(|hosted| hosted.agent == agent);
        match *message {
            Message::Reply { agent, code, accepted, .. } => of(agent).is_none_or(|hosted| {
                let is_known = if code == JoinReply::HELD { hosted.is_held } else { hosted.is_accepted };
                is_known && (accepted || code == JoinReply::HELD)
            }),
            Message::Observation { agent, tick, has_ended } => of(agent).is_none_or(|hosted| {
                let is_answered = hosted.last_tick().is_some_and(|last| tick <= last);
                !hosted.is_accepted || hosted.has_ended || (is_answered && !has_ended)
            }),
            Message::Join { .. } | Message::Command { .. } => true,
        }
    }

    /// Handles a message for it. Returns whether the process ends.
    pub(crate) fn handle(&mut self, message: &Message, decisions: &Decisions, network: &mut Network) -> bool {
        let instance = self.instance;
        match *message {
            Message::Reply { agent, code, accepted, .. } => {
                let Some(hosted) = self.agents.iter_mut().find(|hosted| hosted.agent == agent) else { return false };
                if code == JoinReply::HELD {
                    hosted.is_held = true;
                } else if accepted {
                    hosted.is_accepted = true;
                } else {
                    return true;
                }
                self.join(network);
                false
            }
            Message::Observation { agent, tick, has_ended } => {
                let Some(hosted) = self.agents.iter_mut().find(|hosted| hosted.agent == agent) else { return false };
                if !hosted.is_accepted || hosted.has_ended {
                    return false;
                }
                if has_ended {
                    hosted.has_ended = true;
                    network.insert(Message::Command { agent, instance, tick, info: String::new(), wake: 0 });
                    return self.agents.iter().all(|hosted| hosted.has_ended);
                }
                match hosted.last_tick() {
                    Some(last) if tick < last => return false,
                    Some(last) if tick == last => {}
                    _ => {
                        // Between its wake-up conditions an agent learns nothing.
                        let is_due = tick >= hosted.due;
                        if is_due {
                            hosted.history.push(tick);
                            hosted.due = decisions.next_due(agent, tick);
                        }
                        let info = if is_due { told(&hosted.history) } else { String::new() };
                        hosted.last = Some(Message::Command { agent, instance, tick, info, wake: hosted.due });
                    }
                }
                network.extend(hosted.last.clone());
                false
            }
            Message::Join { .. } | Message::Command { .. } => false,
        }
    }
}
