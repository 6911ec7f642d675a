//! A model of the lock-step protocol, checked in all orders of events: the sessions of the server
//! with the agents of a small team, over a network that loses, repeats and reorders messages, while
//! processes and the server crash.
//!
//! The server is the real one: [`AgentSessions`](protocol::lockstep::AgentSessions) with its
//! membership and barriers, driven by a loop as in the session. Messages stay in the network, so
//! that each may arrive late, again, or never.
//!
//! *Safety:* no tick is committed with a command missing; each committed command is that of the
//! undisturbed run; nothing of a process that does not hold an id is accepted for it; a refused
//! message changes nothing; no replay diverges.
//!
//! *Progress:* from every state the run ends, if all that is on its way is lost, and from then on
//! messages arrive. Stateright's `eventually` does not see that a path closes a cycle; so this is
//! checked in each state, by following one fair course of events to its end.
//!
//! *Traces:* what real servers and agent processes receive and send in simulated faulty runs is
//! replayed in the model, step by step ([`replay`]).
//!
//! Bounds: crashes (of a process, of the server, or a second process for the same agents),
//! processes in all, and expired timers.

mod process;
mod replay;
mod server;

use std::hash::{Hash, Hasher};
use std::sync::Arc;
use std::time::{Duration, Instant};

use process::{Decisions, Message, Network, Process};
use server::{Phase, Plan, Polls, Server, Timeouts};
use stateright::{Checker, Model, Property};

/// A broken server.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Mutant {
    /// A process that takes over gets no replay.
    NoReplay,
    /// A command is accepted whatever process it comes from.
    AnyProcess,
    /// A tick is committed at the timeout with the commands that have come.
    EarlyCommit,
    /// Nothing is resent.
    NoResends,
}

/// Rounds of a fair course of events within which a run ends.
const ROUNDS_MAX: usize = 200;

#[derive(Debug, Clone)]
struct LockStep {
    plan: Plan,
    /// The agents of each process.
    groups: Vec<Vec<u32>>,
    crashes: u8,
    servers: u8,
    processes: u8,
    timers: u8,
    /// Whether the first processes have joined already.
    starts_joined: bool,
}

#[derive(Debug, Clone)]
struct State {
    server: Arc<Server>,
    processes: Arc<Vec<Process>>,
    network: Arc<Network>,
    crashes: u8,
    servers: u8,
    timers: u8,
    /// Processes so far.
    started: u8,
}

impl State {
    /// What the future depends on.
    fn key(&self) -> impl Hash + PartialEq + '_ {
        let Self { server, processes, network, crashes, servers, timers, started } = self;
        ((&server.fingerprint, server.rest(), processes, network), (crashes, servers, timers, started))
    }
}

impl Hash for State {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.key().hash(state);
    }
}

impl PartialEq for State {
    fn eq(&self, other: &Self) -> bool {
        self.key() == other.key()
    }
}

#[derive(Debug, Clone, PartialEq)]
enum Action {
    ToServer(Message),
    /// To the process of this instance.
    ToProcess(u8, Message),
    /// A timer of the server expires.
    Elapse,
    /// The pause between two ticks ends.
    Proceed,
    /// A process is killed, and started again.
    Crash(u8),
    /// A second process is started for the agents of a group.
    Twin(usize),
    /// The server is killed with all processes, and the run is resumed.
    CrashServer,
}

impl LockStep {
    fn start(&self, state: &mut State, group: usize) {
        state.started += 1;
        let process = Process::new(state.started, group, &self.groups[group]);
        process.join(Arc::make_mut(&mut state.network));
        Arc::make_mut(&mut state.processes).push(process);
    }

    fn start_all(&self, server: Server, started: u8, crashes: u8, servers: u8, timers: u8) -> State {
        let (processes, network) = (Arc::default(), Arc::default());
        let mut state = State { server: Arc::new(server), processes, network, crashes, servers, timers, started };
        (0..self.groups.len()).for_each(|group| self.start(&mut state, group));
        state
    }

    /// A process handles a message. One that ends is started again, unless the run is ending or
    /// another process has its agents.
    fn deliver(&self, state: &mut State, instance: u8, message: &Message, may_start: bool) {
        let Some(at) = state.processes.iter().position(|process| process.instance == instance) else { return };
        let State { processes, network, .. } = state;
        let processes = Arc::make_mut(processes);
        if processes[at].handle(message, &self.plan.decisions, Arc::make_mut(network)) {
            let group = processes.remove(at).group;
            let is_over = matches!(message, Message::Observation { .. });
            if !is_over && may_start && !state.processes.iter().any(|process| process.group == group) {
                self.start(state, group);
            }
        }
    }

    /// Whether the run ends if everything on its way is lost, and messages arrive from now on.
    fn ends(&self, state: &State) -> bool {
        let mut state = state.clone();
        state.network = Arc::default();
        for round in 0..ROUNDS_MAX {
            if state.server.phase == Phase::Over || state.server.violation.is_some() {
                return true;
            }
            let is_silent = self.exchange(&mut state);
            let State { server, network, .. } = &mut state;
            let (server, network) = (Arc::make_mut(server), Arc::make_mut(network));
            // A process that is held repeats its join, and is answered.
            if (is_silent && network.is_empty()) || round % 5 == 4 {
                server.elapse(&self.plan, network);
                server.pass_time();
            }
            if server.phase == Phase::Paced {
                server.proceed(&self.plan, network);
            }
            for group in 0..self.groups.len() {
                if !state.processes.iter().any(|process| process.group == group) {
                    self.start(&mut state, group);
                }
            }
        }
        false
    }

    /// All messages arrive, once. Returns whether the server has sent none.
    fn exchange(&self, state: &mut State) -> bool {
        let State { server, processes, network, .. } = state;
        let (server, network) = (Arc::make_mut(server), Arc::make_mut(network));
        processes.iter().for_each(|process| process.join(network));
        let is_to_server = |message: &Message| matches!(message, Message::Join { .. } | Message::Command { .. });
        let (to_server, to_processes) = std::mem::take(network).into_iter().partition(is_to_server);
        *network = to_processes;
        for message in Network::into_iter(to_server) {
            server.handle(&self.plan, &message, network);
        }
        let sent = Arc::unwrap_or_clone(std::mem::take(&mut state.network));
        for message in &sent {
            let instances: Vec<u8> = self.receivers(state, message).map(|process| process.instance).collect();
            for instance in instances {
                self.deliver(state, instance, message, true);
            }
        }
        sent.is_empty()
    }

    fn receivers<'a>(&self, state: &'a State, message: &'a Message) -> impl Iterator<Item = &'a Process> {
        let receives = move |process: &&Process| match message {
            Message::Reply { instance, .. } => process.instance == *instance,
            Message::Observation { agent, .. } => process.hosts(*agent),
            Message::Join { .. } | Message::Command { .. } => false,
        };
        state.processes.iter().filter(receives)
    }
}

impl Model for LockStep {
    type State = State;
    type Action = Action;

    fn init_states(&self) -> Vec<State> {
        let server = Server::start(&self.plan, None);
        let mut state = self.start_all(server, 0, self.crashes, self.servers, self.timers);
        while self.starts_joined && state.server.phase == Phase::Admission {
            self.exchange(&mut state);
        }
        vec![state]
    }

    fn actions(&self, state: &State, actions: &mut Vec<Action>) {
        if state.server.phase == Phase::Over || state.server.violation.is_some() {
            return;
        }
        for message in state.network.iter() {
            match message {
                Message::Join { .. } | Message::Command { .. } => actions.push(Action::ToServer(message.clone())),
                Message::Reply { .. } | Message::Observation { .. } => {
                    let is_new = |process: &&Process| !process.ignores(message);
                    let to = |process: &Process| Action::ToProcess(process.instance, message.clone());
                    actions.extend(self.receivers(state, message).filter(is_new).map(to));
                }
            }
        }
        if state.server.phase == Phase::Paced {
            actions.push(Action::Proceed);
        }
        if state.timers > 0 && state.server.has_timer() {
            actions.push(Action::Elapse);
        }
        if state.crashes > 0 && state.started < self.processes {
            actions.extend(state.processes.iter().map(|process| Action::Crash(process.instance)));
            actions.extend((0..self.groups.len()).map(Action::Twin));
        }
        if state.servers > 0 {
            actions.push(Action::CrashServer);
        }
    }

    fn next_state(&self, before: &State, action: Action) -> Option<State> {
        let mut state = before.clone();
        match action {
            Action::ToServer(message) => {
                let (mut server, mut network) = (Server::clone(&state.server), Network::new());
                if !server.handle(&self.plan, &message, &mut network) && network.is_subset(&state.network) {
                    return None;
                }
                state.server = Arc::new(server);
                Arc::make_mut(&mut state.network).extend(network);
            }
            Action::ToProcess(instance, message) => {
                let may_start = state.started < self.processes;
                self.deliver(&mut state, instance, &message, may_start);
            }
            Action::Elapse => {
                state.timers -= 1;
                let State { server, network, .. } = &mut state;
                if !Arc::make_mut(server).elapse(&self.plan, Arc::make_mut(network)) {
                    return None;
                }
            }
            Action::Proceed => {
                let State { server, network, .. } = &mut state;
                Arc::make_mut(server).proceed(&self.plan, Arc::make_mut(network));
            }
            Action::Crash(instance) => {
                state.crashes -= 1;
                let at = state.processes.iter().position(|process| process.instance == instance)?;
                let group = Arc::make_mut(&mut state.processes).remove(at).group;
                self.start(&mut state, group);
            }
            Action::Twin(group) => {
                state.crashes -= 1;
                self.start(&mut state, group);
            }
            Action::CrashServer => {
                let server = Server::start(&self.plan, Some(&state.server));
                state = self.start_all(server, state.started, state.crashes, state.servers - 1, state.timers);
            }
        }
        Some(state)
    }

    fn properties(&self) -> Vec<Property<Self>> {
        vec![
            Property::always("safe", |_, state: &State| state.server.violation.is_none()),
            Property::always("progress", |model: &Self, state| model.ends(state)),
            Property::sometimes("the run ends", |_, state: &State| state.server.phase == Phase::Over),
        ]
    }
}

/// Two agents in processes of their own.
const TWO: &[&[u32]] = &[&[0], &[1]];

/// Three agents, of which two are in one process.
const THREE: &[&[u32]] = &[&[0], &[1, 2]];

/// A run of two ticks with so many crashes, and one timer that expires.
fn model(groups: &[&[u32]], crashes: u8) -> LockStep {
    let agents = groups.iter().map(|group| group.len() as u32).sum();
    let plan = Plan {
        agents,
        last: 1,
        polls: Polls::Never,
        decisions: Decisions::Counted,
        // Shorter than any interval between two resends.
        timeouts: Timeouts::all(Duration::from_millis(7)),
        leaves: None,
        is_paced: false,
        has_shutdown: false,
        mutant: None,
    };
    let groups = groups.iter().map(|group| group.to_vec()).collect();
    LockStep { plan, groups, crashes, servers: 0, processes: 4, timers: 1, starts_joined: true }
}

#[expect(clippy::disallowed_methods, reason = "the time is printed, and decides nothing")]
fn now() -> Instant {
    Instant::now()
}

/// Checks all states. Returns what is violated, if anything is, with the actions that lead there.
fn explore(name: &str, model: LockStep) -> Option<String> {
    let begun = now();
    let checker = model.checker().threads(2).spawn_bfs().join();
    let (states, depth) = (checker.unique_state_count(), checker.max_depth());
    eprintln!("{name}: {states} states, depth {depth}, {:.1} s", begun.elapsed().as_secs_f64());
    let violated = ["safe", "progress"].into_iter().find_map(|property| Some((property, checker.discovery(property)?)));
    let Some((property, path)) = violated else {
        checker.assert_any_discovery("the run ends");
        return None;
    };
    let violation = path.last_state().server.violation.clone();
    Some(format!("not {property}: {}: {:?}", violation.unwrap_or_default(), path.into_actions()))
}

#[track_caller]
fn check(name: &str, model: LockStep) {
    assert_eq!(explore(name, model), None);
}

/// What is found must be what is broken.
#[track_caller]
fn assert_found(mutant: Mutant, mut model: LockStep, expected: &str) {
    model.plan.mutant = Some(mutant);
    let found = explore(&format!("{mutant:?}"), model);
    assert!(found.as_ref().is_some_and(|found| found.contains(expected)), "{mutant:?}: {found:?}");
}

#[test]
fn two_agents_survive_two_crashes() {
    check("two agents, two crashes", model(TWO, 2));
}

#[test]
fn three_agents_survive_two_crashes() {
    let patient = LockStep { timers: 0, ..model(THREE, 2) };
    check("three agents, two crashes, timers expire at the end", patient);
}

#[test]
fn a_killed_server_is_resumed() {
    let mut resumed = LockStep { servers: 1, ..model(TWO, 1) };
    resumed.plan.has_shutdown = true;
    check("two agents, a crash, the server killed", resumed);
}

#[test]
fn ids_are_given_once() {
    let mut admission = LockStep { starts_joined: false, ..model(TWO, 1) };
    admission.plan.last = 0;
    check("two agents, admission, a crash", admission);
}

#[test]
fn an_agent_leaves_between_two_ticks() {
    let mut leaving = model(TWO, 1);
    (leaving.plan.is_paced, leaving.plan.leaves) = (true, Some((1, 1)));
    check("two agents, a crash, one leaves", leaving);
}

#[test]
fn polled_agents_change_nothing() {
    let mut polled = model(TWO, 1);
    polled.plan.polls = Polls::In(1);
    check("two agents, a crash, without look-ahead", polled);
}

#[test]
fn broken_servers_are_found() {
    assert_found(Mutant::NoReplay, model(TWO, 1), "agent 0 has told \"1\" in tick 1");
    assert_found(Mutant::AnyProcess, model(TWO, 1), "that does not hold the id was accepted");
    assert_found(Mutant::EarlyCommit, model(TWO, 0), "with a command missing");
    assert_found(Mutant::NoResends, model(TWO, 0), "not progress");
}
