//! The simulated network: virtual time, the queue of events, and the links between the server and
//! the agent processes.
//!
//! Invariants: virtual time never goes back; events at the same time happen in the order in which
//! they were made; a message between server and agents may be lost, late, doubled or overtaken, but
//! a link loses only so many in a row; the announcement of a run is only late, as the latched topic
//! that carries it is reliable.
//!
//! It executes nothing: `cluster` takes the events from here.

use std::cell::RefCell;
use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet, BinaryHeap, VecDeque};
use std::fmt;
use std::rc::Rc;
use std::time::{Duration, Instant};

use agent_node::transport::{Inbound as ToAgents, ServerTransport};
use msgs::ids::{AgentId, Tick};
use msgs::maes_msgs::{Command, Scenario};
use protocol::lockstep::SourceId;
use protocol::signed::{JoinRequest, Signed};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use system::wall_clock;
use transport::{Inbound as ToServer, Incoming};

use super::adversary::{Adversary, DELAY_MAX, Mutation, steps, up_to};
use super::messages::{bytes_to_agents, bytes_to_server, described, described_to_server};
use super::scenarios::AGENTS_MAX;
use super::trace::TraceEvent;

/// Virtual time after which a run hangs.
const HANG: Duration = Duration::from_secs(3600);

/// Events after which a run hangs.
const EVENTS_MAX: u64 = 20_000_000;

/// The network of a run; its parties share it.
pub(super) type SharedNetwork = Rc<RefCell<Network>>;

/// The end of a server process, which unwinds its stack.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Killed {
    Process,
    /// With all other processes of its machine; what was not synced may be lost.
    PowerFailure,
    /// The run does not end: the simulation gives up.
    Hangs,
}

/// What happens at some virtual time.
#[derive(Debug)]
pub(super) enum Event {
    ToServer(Incoming),
    ToProcess(u32, ToAgents),
    /// A process has waited for a message until now.
    Wake(u32),
    /// A process of a group of agents is started.
    Start {
        group: usize,
        /// Even if there is one already.
        is_intruder: bool,
    },
}

struct Scheduled {
    at: Duration,
    number: u64,
    event: Event,
}

impl PartialEq for Scheduled {
    fn eq(&self, other: &Self) -> bool {
        self.number == other.number
    }
}

impl Eq for Scheduled {}

impl PartialOrd for Scheduled {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Scheduled {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        (self.at, self.number).cmp(&(other.at, other.number))
    }
}

/// The direction of a link.
#[derive(Debug, Clone, Copy)]
enum Direction {
    ToServer,
    ToProcess,
}

/// The connection of a process.
struct Port {
    agents: Vec<AgentId>,
    inbox: VecDeque<ToAgents>,
    /// Until when the process waits for a message.
    waits_until: Duration,
    /// Until when its link is cut.
    cut_until: Duration,
    /// Messages that were lost in a row, by direction.
    losses: [u32; 2],
    /// Arrival of the last message, by direction.
    last: [Duration; 2],
}

/// What has happened in a run.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Counts {
    pub messages: u64,
    pub lost: u64,
    pub duplicated: u64,
    pub agents_killed: u64,
    pub servers_killed: u64,
    pub power_failures: u64,
    pub disk_failures: u64,
    pub resumed: u64,
    /// Messages that the server refused and counted.
    pub refused: u64,
}

impl Counts {
    pub(super) fn add(&mut self, other: &Self) {
        let Self { messages, lost, duplicated, agents_killed, servers_killed, .. } = self;
        *messages += other.messages;
        *lost += other.lost;
        *duplicated += other.duplicated;
        *agents_killed += other.agents_killed;
        *servers_killed += other.servers_killed;
        self.power_failures += other.power_failures;
        self.disk_failures += other.disk_failures;
        self.resumed += other.resumed;
        self.refused += other.refused;
    }
}

impl fmt::Display for Counts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { messages, lost, duplicated, agents_killed, servers_killed, power_failures, .. } = self;
        let Self { disk_failures, resumed, refused, .. } = self;
        write!(f, "{messages} messages ({lost} lost, {duplicated} duplicated, {refused} refused), ")?;
        write!(f, "{agents_killed} agent processes and {servers_killed} servers killed ")?;
        write!(f, "({power_failures} by power failures), {disk_failures} disk failures, {resumed} runs resumed")
    }
}

/// The network of a run.
pub(super) struct Network {
    /// Virtual time since the beginning.
    pub(super) clock: Duration,
    /// The instant of its beginning.
    origin: Instant,
    queue: BinaryHeap<Reverse<Scheduled>>,
    scheduled: u64,
    pub(super) random: ChaCha8Rng,
    pub(super) adversary: Adversary,
    pub(super) mutation: Option<Mutation>,
    pub(super) server_inbox: VecDeque<Incoming>,
    pub(super) is_server_up: bool,
    /// Actions of the server until it is killed.
    server_kill_in: Option<u64>,
    /// Messages to agents until the receiver of one is killed.
    agent_kill_in: Option<u64>,
    announced: Option<Scenario>,
    ports: BTreeMap<u32, Port>,
    /// Messages so far, if repeated ones are lost.
    sent: BTreeSet<Vec<u8>>,
    pub(super) counts: Counts,
    /// `None` if no log is kept.
    log: Option<Vec<String>>,
    /// `None` if no trace is kept.
    pub(super) trace: Option<Vec<TraceEvent>>,
    /// When the present server was started.
    pub(super) server_began: Duration,
    /// The first tick that the recording lacks which the present server resumes.
    pub(super) resumes_at: Option<Tick>,
}

impl Network {
    pub(super) fn new(seed: u64, adversary: Adversary, mutation: Option<Mutation>, keeps_log: bool) -> Self {
        let mut random = voxels::random_streams::stream(seed, 0, "simulated.network");
        let agent_kill_in = (adversary.agent_kills > 0).then(|| steps(&mut random));
        Self {
            clock: Duration::ZERO,
            origin: wall_clock::now(),
            queue: BinaryHeap::new(),
            scheduled: 0,
            random,
            adversary,
            mutation,
            server_inbox: VecDeque::new(),
            is_server_up: false,
            server_kill_in: None,
            agent_kill_in,
            announced: None,
            ports: BTreeMap::new(),
            sent: BTreeSet::new(),
            counts: Counts::default(),
            log: keeps_log.then(Vec::new),
            trace: None,
            server_began: Duration::ZERO,
            resumes_at: None,
        }
    }

    /// Adds a line to the event log.
    pub(super) fn log(&mut self, line: impl FnOnce() -> String) {
        if let Some(log) = &mut self.log {
            log.push(format!("{:12.6} {}", self.clock.as_secs_f64(), line()));
        }
    }

    pub(super) fn log_adversary(&mut self) {
        let adversary = self.adversary.clone();
        self.log(|| format!("{adversary:?}"));
    }

    pub(super) fn take_log(&mut self) -> Vec<String> {
        self.log.take().unwrap_or_default()
    }

    /// The present instant.
    pub(super) fn now(&self) -> Instant {
        self.origin + self.clock
    }

    /// Schedules an event.
    pub(super) fn schedule(&mut self, after: Duration, event: Event) {
        self.scheduled += 1;
        self.queue.push(Reverse(Scheduled { at: self.clock + after, number: self.scheduled, event }));
    }

    /// The next event up to `deadline`. The clock advances to it, or to `deadline` if there is
    /// none.
    pub(super) fn next_event(&mut self, deadline: Duration) -> Option<Event> {
        if self.queue.peek().is_some_and(|Reverse(next)| next.at <= deadline) {
            let Reverse(Scheduled { at, event, .. }) = self.queue.pop()?;
            self.clock = self.clock.max(at);
            return Some(event);
        }
        self.clock = self.clock.max(deadline);
        None
    }

    /// Whether the run has taken too long.
    pub(super) fn hangs(&self) -> bool {
        self.clock >= HANG || self.scheduled >= EVENTS_MAX
    }

    /// Starts a server process, which may be killed after some actions.
    pub(super) fn start_server(&mut self) {
        self.is_server_up = true;
        self.server_began = self.clock;
        self.server_kill_in = (self.adversary.server_kills > 0).then(|| steps(&mut self.random));
    }

    /// Ends the server process: later processes hear nothing of its run.
    pub(super) fn end_server(&mut self) {
        self.note(|| TraceEvent::ServerEnded);
        self.is_server_up = false;
        self.server_inbox.clear();
        self.announced = None;
    }

    /// Counts an action of the server: how it is killed now, if it is.
    pub(super) fn server_acts(&mut self) -> Option<Killed> {
        if !self.is_server_up {
            return None;
        }
        if self.hangs() {
            self.is_server_up = false;
            return Some(Killed::Hangs);
        }
        let left = self.server_kill_in.as_mut()?;
        *left -= 1;
        if *left > 0 {
            return None;
        }
        self.server_kill_in = None;
        self.adversary.server_kills -= 1;
        self.is_server_up = false;
        self.counts.servers_killed += 1;
        let fails = self.random.random_bool(self.adversary.power_failure);
        self.counts.power_failures += u64::from(fails);
        Some(if fails { Killed::PowerFailure } else { Killed::Process })
    }

    /// Counts a message that reaches an agent process: whether that is killed now.
    pub(super) fn agent_is_killed(&mut self) -> bool {
        let Some(left) = &mut self.agent_kill_in else { return false };
        *left -= 1;
        if *left > 0 {
            return false;
        }
        self.adversary.agent_kills -= 1;
        self.agent_kill_in = (self.adversary.agent_kills > 0).then(|| steps(&mut self.random));
        self.counts.agents_killed += 1;
        true
    }

    /// Connects a new process; it hears of a run that was announced before.
    pub(super) fn connect(&mut self, process: u32, agents: Vec<AgentId>) {
        let port = Port {
            agents,
            inbox: VecDeque::new(),
            waits_until: self.clock,
            cut_until: Duration::ZERO,
            losses: [0; 2],
            last: [Duration::ZERO; 2],
        };
        let agents = port.agents.clone();
        self.ports.insert(process, port);
        self.note(|| TraceEvent::ProcessStarted { process, agents });
        if let Some(scenario) = self.announced.clone() {
            self.announce_to(process, scenario);
        }
    }

    pub(super) fn disconnect(&mut self, process: u32) {
        self.ports.remove(&process);
        self.note(|| TraceEvent::ProcessEnded { process });
    }

    pub(super) fn announce(&mut self, scenario: &Scenario) {
        let resumes_at = self.resumes_at;
        self.note(|| TraceEvent::ServerStarted { run: scenario.run, resumes_at });
        self.announced = Some(scenario.clone());
        let processes: Vec<u32> = self.ports.keys().copied().collect();
        for process in processes {
            self.announce_to(process, scenario.clone());
        }
    }

    fn announce_to(&mut self, process: u32, mut scenario: Scenario) {
        if self.mutation == Some(Mutation::OtherDecisions) && process >= AGENTS_MAX {
            scenario.agents_seed ^= 1;
        }
        let cut = self.ports[&process].cut_until.saturating_sub(self.clock);
        let delay = cut + self.delay();
        self.schedule(delay, Event::ToProcess(process, ToAgents::Scenario(scenario)));
    }

    /// The processes with an agent, or all.
    pub(super) fn processes_of(&self, agent: Option<AgentId>) -> Vec<u32> {
        let has = |port: &Port| agent.is_none_or(|agent| port.agents.contains(&agent));
        self.ports.iter().filter(|(_, port)| has(port)).map(|(&process, _)| process).collect()
    }

    pub(super) fn send_to_process(&mut self, process: u32, message: &ToAgents) {
        let what = || described(message);
        for delay in self.fates(process, Direction::ToProcess, what, || bytes_to_agents(message)) {
            self.schedule(delay, Event::ToProcess(process, message.clone()));
        }
    }

    fn send_to_server(&mut self, process: u32, topic_agent: AgentId, message: ToServer) {
        self.note(|| TraceEvent::ProcessSent { process, message: message.clone() });
        let source = SourceId(u128::from(process).to_le_bytes());
        let incoming = Incoming { topic_agent, source, message };
        let what = || described_to_server(&incoming);
        for delay in self.fates(process, Direction::ToServer, what, || bytes_to_server(&incoming.message)) {
            self.schedule(delay, Event::ToServer(incoming.clone()));
        }
    }

    /// The delays of the copies of a message that arrive.
    fn fates(
        &mut self,
        process: u32,
        direction: Direction,
        what: impl Fn() -> String,
        bytes: impl FnOnce() -> Vec<u8>,
    ) -> Vec<Duration> {
        self.counts.messages += 1;
        if self.mutation == Some(Mutation::NoResends) {
            let mut key = bytes();
            key.extend(process.to_le_bytes());
            if !self.sent.insert(key) {
                self.counts.lost += 1;
                self.log(|| format!("process {process}: {} is lost, as it repeats an earlier one", what()));
                return Vec::new();
            }
        }
        let index = direction as usize;
        if self.adversary.cut > 0.0 && self.random.random_bool(self.adversary.cut) {
            let duration = up_to(&mut self.random, self.adversary.cut_max);
            let until = self.clock + duration;
            self.log(|| format!("process {process}: cut off for {:.3} s", duration.as_secs_f64()));
            if let Some(port) = self.ports.get_mut(&process) {
                port.cut_until = until;
            }
        }
        let (clock, losses_max) = (self.clock, self.adversary.losses_max);
        let is_lost = self.adversary.loss > 0.0 && self.random.random_bool(self.adversary.loss);
        let Some(port) = self.ports.get_mut(&process) else { return Vec::new() };
        if port.cut_until > clock || (is_lost && port.losses[index] < losses_max) {
            port.losses[index] += 1;
            self.counts.lost += 1;
            self.log(|| format!("process {process}: {} is lost", what()));
            return Vec::new();
        }
        port.losses[index] = 0;
        let mut delays = vec![self.delay()];
        if self.adversary.duplication > 0.0 && self.random.random_bool(self.adversary.duplication) {
            self.counts.duplicated += 1;
            delays.push(self.delay());
        }
        if !self.adversary.reorders
            && let Some(port) = self.ports.get_mut(&process)
        {
            for delay in &mut delays {
                let at = (clock + *delay).max(port.last[index]);
                port.last[index] = at;
                *delay = at - clock;
            }
        }
        let times = delays.len();
        self.log(|| {
            let again = if times > 1 { ", twice" } else { "" };
            let way = if matches!(direction, Direction::ToServer) { "sends" } else { "is sent" };
            format!("process {process} {way} {}{again}", what())
        });
        delays
    }

    fn delay(&mut self) -> Duration {
        let usual = up_to(&mut self.random, DELAY_MAX);
        if self.adversary.hold_up > 0.0 && self.random.random_bool(self.adversary.hold_up) {
            return usual + up_to(&mut self.random, self.adversary.hold_up_max);
        }
        usual
    }

    /// Puts a message into the inbox of a process; false if there is no such process.
    pub(super) fn deliver(&mut self, process: u32, message: ToAgents) -> bool {
        match self.ports.get_mut(&process) {
            Some(port) => {
                port.inbox.push_back(message);
                true
            }
            None => false,
        }
    }

    pub(super) fn has_mail(&self, process: u32) -> bool {
        self.ports.get(&process).is_some_and(|port| !port.inbox.is_empty())
    }

    /// Whether a process waits for messages until now, and not for longer.
    pub(super) fn is_wake_due(&self, process: u32) -> bool {
        self.ports.get(&process).is_some_and(|port| port.waits_until <= self.clock)
    }
}

/// The end of an agent process.
pub(super) struct AgentsEnd {
    pub(super) process: u32,
    pub(super) network: SharedNetwork,
}

impl ServerTransport for AgentsEnd {
    fn send_join(&mut self, join: &Signed<JoinRequest>) {
        let agent = AgentId(join.claimed().join.agent);
        self.network.borrow_mut().send_to_server(self.process, agent, ToServer::Join(join.clone()));
    }

    fn send_command(&mut self, command: &Signed<Command>) {
        let agent = AgentId(command.claimed().agent);
        self.network.borrow_mut().send_to_server(self.process, agent, ToServer::Command(command.clone()));
    }

    fn now(&self) -> Instant {
        self.network.borrow().now()
    }

    /// Returns at once: without a message, the process is woken after the timeout.
    fn receive(&mut self, timeout: Duration) -> Option<ToAgents> {
        let mut network = self.network.borrow_mut();
        let waits_until = network.clock + timeout;
        let port = network.ports.get_mut(&self.process)?;
        let message = port.inbox.pop_front();
        port.waits_until = waits_until;
        if let Some(message) = &message {
            let process = self.process;
            network.note(|| TraceEvent::ProcessReceived { process, message: message.clone() });
        }
        network.schedule(timeout, Event::Wake(self.process));
        message
    }
}
