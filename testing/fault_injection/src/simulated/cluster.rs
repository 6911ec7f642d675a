//! The processes of a simulated run: one server at a time, its agents, and what starts them again.
//!
//! The session of the server runs on the stack, and each of its waits for a message executes the
//! events up to its timeout: that is where the agents run. A killed server unwinds its stack; the
//! next one finds the recording on the disk, and resumes it as `sim_server run --resume` does.
//!
//! Invariants: one thread; the same seed gives the same events; a process that is killed does
//! nothing more.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::path::Path;
use std::rc::Rc;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use agent_node::controllers::Registry;
use agent_node::host::{AgentProcess, Options, RunError as AgentError};
use agent_node::transport::Inbound as ToAgents;
use msgs::ids::AgentId;
use msgs::maes_msgs::{Command, JoinReply, Observation, Scenario as Announcement};
use msgs::topics;
use protocol::lockstep::Transmit;
use protocol::signed::Signed;
use rand::RngExt;
use recording::playback::{Horizon, Playback};
use recording::recorder::Recorder;
use recording::{Message, Recording};
use sim_server::session::{self, Mode, NullObserver, Outcome, RunConfig, RunError};
use sim_server::setup;
use simulation::scenario::Scenario;
use transport::{AgentTransport, ControlInput, Inbound as ToServer, Incoming, Level, ObserverOutput};

use super::adversary::{Adversary, Mutation, up_to};
use super::disk::{SimulatedDisk, kill};
use super::messages::described;
use super::network::{AgentsEnd, Event, Killed, Network, SharedNetwork};
use super::trace::TraceEvent;

/// What errors call the recording.
const FILE: &str = "run.mcap";

/// Virtual time without messages after which an agent process takes its server to be gone.
const SERVER_TIMEOUT: Duration = Duration::from_secs(30);

/// Longest virtual time until a process is started again.
const RESTART_MAX: Duration = Duration::from_secs(3);

/// Servers of one run; one that needs more does not get on.
const SERVERS_MAX: u32 = 30;

/// An agent process.
struct Process {
    group: usize,
    process: AgentProcess<AgentsEnd>,
    /// Until when it hangs.
    hangs_until: Duration,
    /// Whether its server is gone; another process takes its place.
    is_orphan: bool,
}

/// All processes of a run.
pub(super) struct Cluster<'s> {
    scenario: &'s Scenario,
    pub(super) network: SharedNetwork,
    disk: SimulatedDisk,
    /// The agents of each process.
    groups: Vec<Vec<AgentId>>,
    processes: BTreeMap<u32, Process>,
    /// Processes started so far.
    started: u32,
    /// The last command of an agent, if commands are made stale.
    stale: Option<Command>,
}

/// How the run of a server has ended.
enum Served {
    /// The recording has a result.
    Complete(Vec<u8>),
    /// Its disk has failed, so that it ended the run early.
    DiskFailure,
}

impl<'s> Cluster<'s> {
    pub(super) fn new(seed: u64, scenario: &'s Scenario, mutation: Option<Mutation>, keeps_log: bool) -> Self {
        let adversary = Adversary::of_seed(seed, scenario.faults.on_agent_loss);
        let mut network = Network::new(seed, adversary, mutation, keeps_log);
        let per_process = if network.random.random_bool(0.7) { 1 } else { 2 };
        Self::over(network, scenario, per_process)
    }

    /// The processes with so many agents each.
    pub(super) fn over(mut network: Network, scenario: &'s Scenario, per_process: usize) -> Self {
        network.log_adversary();
        let agents: Vec<AgentId> = (0..scenario.agents.count).map(AgentId).collect();
        let groups = agents.chunks(per_process).map(<[AgentId]>::to_vec).collect();
        let network = Rc::new(RefCell::new(network));
        Self {
            scenario,
            disk: SimulatedDisk::new(Rc::clone(&network)),
            network,
            groups,
            processes: BTreeMap::new(),
            started: 0,
            stale: None,
        }
    }

    /// Executes the run, with as many servers as it takes; returns its recording.
    ///
    /// # Errors
    /// What must not happen, as a line of text.
    pub(super) fn run(&mut self) -> Result<Vec<u8>, String> {
        self.start_agents();
        for number in 1..=SERVERS_MAX {
            self.note(|| format!("server {number} is started"));
            self.network.borrow_mut().start_server();
            let served = catch_unwind(AssertUnwindSafe(|| self.serve()));
            self.network.borrow_mut().end_server();
            let killed = match served {
                Ok(Ok(Served::Complete(recording))) => return Ok(recording),
                Ok(Ok(Served::DiskFailure)) => Killed::Process,
                Ok(Err(reason)) => return Err(reason),
                Err(payload) => match payload.downcast::<Killed>() {
                    Ok(killed) => *killed,
                    Err(panic) => resume_unwind(panic),
                },
            };
            self.note(|| format!("server {number} has ended: {killed:?}"));
            match killed {
                Killed::Hangs => return Err("the run hangs".to_owned()),
                Killed::PowerFailure => self.disk.fail_power(),
                Killed::Process => {}
            }
            if self.network.borrow().mutation == Some(Mutation::ForgottenTick) {
                self.forget_a_tick();
            }
            self.abandon_agents(killed);
            let pause = up_to(&mut self.network.borrow_mut().random, RESTART_MAX);
            self.execute_for(pause);
        }
        Err(format!("no end after {SERVERS_MAX} servers"))
    }

    /// Serves the run as a process of the server does: a new one, or the one of the recording.
    fn serve(&mut self) -> Result<Served, String> {
        let recording = match self.disk.published() {
            Some(bytes) => Some(Recording::from_bytes(FILE.to_owned(), bytes).map_err(|error| error.to_string())?),
            None => None,
        };
        let scenario = self.scenario;
        let (mode, built) = match &recording {
            Some(recording) => {
                let playback = Playback::new(recording).map_err(|error| error.to_string())?;
                let horizon = playback.horizon();
                let tick = match horizon {
                    Horizon::Open(tick) => tick,
                    Horizon::Ended(tick) => {
                        self.note(|| format!("the recording has a result in tick {tick}"));
                        return Ok(Served::Complete(self.disk.published().unwrap_or_default()));
                    }
                };
                self.note(|| format!("the run is resumed: {horizon:?}"));
                self.network.borrow_mut().counts.resumed += 1;
                self.network.borrow_mut().resumes_at = Some(tick);
                if recording.scenario() != scenario.identity() {
                    return Err("the recording has another scenario".to_owned());
                }
                (Mode::Resume(playback), setup::rebuild(recording, scenario))
            }
            None => {
                self.network.borrow_mut().resumes_at = None;
                (Mode::Live, setup::build(scenario))
            }
        };
        let (world, _) = built.map_err(|error| error.to_string())?;
        let file = self.disk.create();
        let recorder =
            setup::with_documents(scenario, &world, |documents| Recorder::create_in(file, Path::new(FILE), documents));
        let recorder = match recorder {
            Ok(recorder) => recorder,
            Err(_) => return Ok(Served::DiskFailure),
        };
        let config = RunConfig::new(scenario, mode).map_err(|error| error.to_string())?;
        let never = AtomicBool::new(false);
        match session::run(config, world, self, Some(recorder.into()), &mut NullObserver, &never) {
            Ok(Outcome { result, .. }) => {
                self.note(|| format!("the run has ended: {}", result.reason));
                self.disk.published().map(Served::Complete).ok_or_else(|| "a run without a recording".to_owned())
            }
            Err(RunError::Record(error)) => {
                self.note(|| error.to_string());
                Ok(Served::DiskFailure)
            }
            Err(error) => Err(error.to_string()),
        }
    }

    fn note(&self, line: impl FnOnce() -> String) {
        self.network.borrow_mut().log(line);
    }

    /// Has a process started for each group, and second ones.
    fn start_agents(&mut self) {
        let mut network = self.network.borrow_mut();
        for group in 0..self.groups.len() {
            let delay = up_to(&mut network.random, RESTART_MAX);
            network.schedule(delay, Event::Start { group, is_intruder: false });
        }
        for _ in 0..std::mem::take(&mut network.adversary.intruders) {
            let group = network.random.random_range(0..self.groups.len());
            let delay = up_to(&mut network.random, 8 * RESTART_MAX);
            network.schedule(delay, Event::Start { group, is_intruder: true });
        }
    }

    /// After the end of a server: some of its agents are killed, the others notice later. All are
    /// started again.
    fn abandon_agents(&mut self, killed: Killed) {
        let mut network = self.network.borrow_mut();
        self.processes.retain(|&number, process| {
            let ends = killed == Killed::PowerFailure || network.random.random_bool(0.5);
            if ends {
                network.disconnect(number);
            }
            process.is_orphan = true;
            !ends
        });
        drop(network);
        self.start_agents();
    }

    fn start(&mut self, group: usize, is_intruder: bool) {
        let is_there = self.processes.values().any(|process| process.group == group && !process.is_orphan);
        if is_there && !is_intruder {
            return;
        }
        let number = self.started;
        self.started += 1;
        let agents = self.groups[group].clone();
        self.note(|| format!("process {number} is started for group {group}"));
        self.network.borrow_mut().connect(number, agents.clone());
        let options = Options {
            agents,
            registry: Registry::BUILT_IN,
            controller: None,
            settings: Vec::new(),
            instance: u64::from(number),
            server_timeout: SERVER_TIMEOUT,
            chaos_delay: Duration::ZERO,
            map_hz: 1.0,
            decision_times: None,
            credentials: None,
        };
        let end = AgentsEnd { process: number, network: Rc::clone(&self.network) };
        let process = AgentProcess::new(end, options);
        self.processes.insert(number, Process { group, process, hangs_until: Duration::ZERO, is_orphan: false });
        self.step(number);
    }

    /// Executes a process until it waits for a message.
    fn step(&mut self, number: u32) {
        let Some(process) = self.processes.get_mut(&number) else { return };
        let clock = self.network.borrow().clock;
        if process.hangs_until > clock {
            self.network.borrow_mut().schedule(process.hangs_until - clock, Event::Wake(number));
            return;
        }
        let ended = loop {
            match process.process.step() {
                Ok(ControlFlow::Continue(())) if self.network.borrow().has_mail(number) => {}
                Ok(ControlFlow::Continue(())) => return,
                Ok(ControlFlow::Break(())) => break None,
                Err(error) => break Some(error),
            }
        };
        // The number of a run is random.
        let why = match &ended {
            None => "the run is over".to_owned(),
            Some(AgentError::ServerSilent { .. }) => "its server is silent".to_owned(),
            Some(AgentError::Superseded { .. }) => "its server is silent, and there is another one".to_owned(),
            Some(error) => error.to_string(),
        };
        self.note(|| format!("process {number} ends: {why}"));
        self.remove(number, ended.is_some());
    }

    fn remove(&mut self, number: u32, is_restarted: bool) {
        let Some(process) = self.processes.remove(&number) else { return };
        let mut network = self.network.borrow_mut();
        network.disconnect(number);
        if is_restarted && !process.is_orphan {
            let delay = up_to(&mut network.random, RESTART_MAX);
            network.schedule(delay, Event::Start { group: process.group, is_intruder: false });
        }
    }

    /// Executes the events of a span of time.
    fn execute_for(&mut self, span: Duration) {
        let deadline = self.network.borrow().clock + span;
        while let Some(event) = self.next_event(deadline) {
            self.execute(event);
        }
    }

    fn next_event(&self, deadline: Duration) -> Option<Event> {
        self.network.borrow_mut().next_event(deadline)
    }

    fn execute(&mut self, event: Event) {
        match event {
            Event::ToServer(incoming) => {
                let incoming = self.falsified(incoming);
                let mut network = self.network.borrow_mut();
                if network.is_server_up {
                    network.server_inbox.push_back(incoming);
                }
            }
            Event::ToProcess(number, message) => self.deliver(number, message),
            Event::Wake(number) => {
                if self.network.borrow().is_wake_due(number) {
                    self.step(number);
                }
            }
            Event::Start { group, is_intruder } => self.start(group, is_intruder),
        }
    }

    fn deliver(&mut self, number: u32, message: ToAgents) {
        let Some(process) = self.processes.get_mut(&number) else { return };
        let mut network = self.network.borrow_mut();
        network.log(|| format!("process {number} receives {}", described(&message)));
        network.deliver(number, message);
        let is_killed = network.agent_is_killed();
        let dies_first = is_killed && network.random.random_bool(0.5);
        if network.adversary.hang > 0.0 && process.hangs_until <= network.clock {
            let (chance, longest) = (network.adversary.hang, network.adversary.hang_max);
            if network.random.random_bool(chance) {
                let span = up_to(&mut network.random, longest);
                process.hangs_until = network.clock + span;
                network.log(|| format!("process {number} hangs for {:.3} s", span.as_secs_f64()));
            }
        }
        drop(network);
        if !dies_first {
            self.step(number);
        }
        if is_killed {
            self.note(|| format!("process {number} is killed"));
            self.remove(number, true);
        }
    }

    /// The message as it arrives: changed only by a mutation.
    fn falsified(&mut self, mut incoming: Incoming) -> Incoming {
        if self.network.borrow().mutation == Some(Mutation::StaleCommands)
            && let ToServer::Command(signed) = &mut incoming.message
            && signed.claimed().agent == 0
        {
            let command = signed.claimed();
            let before = self.stale.replace(command.clone());
            if let Some(before) = before.filter(|before| before.tick < command.tick) {
                *signed = Signed::unsigned(Command { tick: command.tick, run: command.run, ..before });
            }
        }
        incoming
    }

    /// Removes the commands of the last tick that the recording has completely.
    fn forget_a_tick(&self) {
        let Some(bytes) = self.disk.published() else { return };
        let Ok(recording) = Recording::from_bytes(FILE.to_owned(), bytes) else { return };
        let is_command = |message: &Message| matches!(message.of_agent(), Some((_, "command")));
        let last = recording.messages().map(|message| message.tick()).max();
        let asked = recording.messages().filter(|message| is_command(message) && Some(message.tick()) < last);
        let Some(forgotten) = asked.last().map(|message| message.tick()) else { return };
        let file = super::memory_file::MemoryFile::default();
        let documents = recording.attachments().iter();
        let documents: Vec<_> =
            documents.map(|(name, data)| recording::recorder::Document { name, media_type: "", data }).collect();
        let Ok(mut recorder) = Recorder::create_in(file.clone(), Path::new(FILE), &documents) else { return };
        let types = topics::all(self.scenario.agents.count);
        for message in recording.messages() {
            let is_forgotten = is_command(&message) && message.tick() == forgotten;
            if let Some(topic) = types.iter().find(|topic| topic.name == message.channel.topic)
                && !is_forgotten
            {
                // Memory can be written.
                drop(recorder.write(topic, message.tick(), &message.data));
            }
        }
        drop(recorder.save_provisionally());
        drop(recorder);
        self.disk.replace(file.bytes());
    }

    /// Counts an action of the server, which may be its last.
    fn act(&self) {
        let killed = self.network.borrow_mut().server_acts();
        if let Some(killed) = killed {
            kill(killed);
        }
    }
}

impl AgentTransport for Cluster<'_> {
    fn announce(&mut self, scenario: &Announcement) {
        self.act();
        self.network.borrow_mut().announce(scenario);
    }

    fn reply_join(&mut self, reply: &JoinReply) {
        self.act();
        let mut network = self.network.borrow_mut();
        network.note(|| TraceEvent::ServerSent(Transmit::JoinReply(reply.clone())));
        for process in network.processes_of(None) {
            network.send_to_process(process, &ToAgents::JoinReply(reply.clone()));
        }
    }

    fn send(&mut self, agent: AgentId, fragment: Signed<Observation>) {
        self.act();
        let mut network = self.network.borrow_mut();
        network.note(|| TraceEvent::ServerSent(Transmit::Observation(agent, fragment.clone())));
        for process in network.processes_of(Some(agent)) {
            network.send_to_process(process, &ToAgents::Observation(fragment.clone()));
        }
    }

    fn receive(&mut self, timeout: Duration) -> Option<Incoming> {
        self.act();
        let hang = {
            let mut network = self.network.borrow_mut();
            let (chance, longest) = (network.adversary.server_hang, network.adversary.hang_max);
            let hangs = chance > 0.0 && network.random.random_bool(chance);
            hangs.then(|| up_to(&mut network.random, longest))
        };
        if let Some(span) = hang {
            self.note(|| format!("the server hangs for {:.3} s", span.as_secs_f64()));
            self.execute_for(span);
        }
        let deadline = self.network.borrow().clock + timeout;
        let received = loop {
            if let Some(incoming) = self.network.borrow_mut().server_inbox.pop_front() {
                break Some(incoming);
            }
            let Some(event) = self.next_event(deadline) else { break None };
            self.execute(event);
        };
        self.network.borrow_mut().note_received(received.as_ref());
        received
    }

    fn now(&self) -> Instant {
        self.network.borrow().now()
    }
}

impl ObserverOutput for Cluster<'_> {
    fn log(&mut self, _level: Level, text: &str) {
        self.note(|| format!("the server says: {text}"));
    }
}

impl ControlInput for Cluster<'_> {}
