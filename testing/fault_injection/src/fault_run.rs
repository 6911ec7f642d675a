//! The execution of a run with its faults: starts the processes, injects the scheduled faults, and
//! waits for the end of the server.
//!
//! Invariants: every process ends with this one; wall time positions a fault and ends a hang, and
//! decides nothing else; an unexpected exit of an agent is a failure. Expected are exit code 5 (its
//! id is taken) and, after SIGCONT, exit code 1 (the published DDS library does not survive a
//! suspension; the agent is restarted, as `maes run` does).
//!
//! Not done here: the verdict on the recording ([`super::verdict`]).

use std::collections::{BTreeMap, VecDeque};
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use recording::Recording;
use recording::playback::{Horizon, Playback};
use supervisor::child::{ChildGuard, Signal};

use super::plan::{At, Fault, Plan, Timed, Which};
use super::watch::Watch;
use crate::processes::{in_domain, pause};
use system::wall_clock::now;

/// Wall time after which a run hangs.
const HANG: Duration = Duration::from_secs(240);

/// Wall time that agents have to exit once the server has ended.
const AGENT_EXIT_TIMEOUT: Duration = Duration::from_secs(10);

/// Exit code of an agent process after an error.
const FAILED: i32 = 1;

/// Exit code of an agent process whose id is taken.
const REFUSED: i32 = 5;

/// The environment of a run.
#[derive(Debug)]
pub(super) struct Bench<'a> {
    /// The folder of the binaries.
    pub(super) binaries: &'a Path,
    /// The scenario (.toml), with its `[execution]`.
    pub(super) scenario: &'a Path,
    /// The folder for the recording and all logs.
    pub(super) folder: &'a Path,
    pub(super) domain: u32,
    /// Number of agents.
    pub(super) agents: u32,
    /// Real-time factor.
    pub(super) rtf: f64,
    /// Interrupts the run once it is set.
    pub(super) stop: &'a AtomicBool,
}

/// The reason why a run has no end.
#[derive(Debug)]
pub(super) enum Failure {
    /// The stop flag was set.
    Interrupted,
    Failed(String),
}

impl From<std::io::Error> for Failure {
    fn from(error: std::io::Error) -> Self {
        Self::Failed(error.to_string())
    }
}

/// Executes the run of a plan; returns its recording.
pub(super) fn execute(bench: &Bench<'_>, plan: &Plan) -> Result<PathBuf, Failure> {
    let mut run = FaultRun::new(bench, plan)?;
    let ended = run.execute();
    let outcome = match &ended {
        Ok(()) => "the run has ended".to_owned(),
        Err(Failure::Interrupted) => "interrupted".to_owned(),
        Err(Failure::Failed(reason)) => format!("failed: {reason}"),
    };
    run.log(&outcome);
    run.log(&run.state());
    ended.map(|()| run.recording)
}

/// An agent process.
struct Node {
    number: u32,
    agent: u32,
    process: ChildGuard,
    is_suspended: bool,
    /// Whether it was continued after a suspension, which the published DDS library does not
    /// survive.
    is_continued: bool,
}

/// An action that follows a fault.
enum ScheduledFault {
    Start(u32),
    Continue(u32),
    KillServer,
}

struct FaultRun<'a> {
    bench: &'a Bench<'a>,
    recording: PathBuf,
    event_log: File,
    started_at: Instant,
    watch: Watch,
    server: Option<ChildGuard>,
    /// Servers and agent processes started so far.
    servers: u32,
    agents_started: u32,
    /// When the agents of the present server were started.
    agents_since: Option<Instant>,
    nodes: Vec<Node>,
    injectors: Vec<ChildGuard>,
    /// Delays of replies by agent, milliseconds.
    delays_ms: BTreeMap<u32, u32>,
    faults: VecDeque<Timed>,
    due: Vec<(Instant, ScheduledFault)>,
    /// Whether the server has ended the run.
    is_over: bool,
}

impl<'a> FaultRun<'a> {
    fn new(bench: &'a Bench<'a>, plan: &Plan) -> Result<Self, Failure> {
        let recording = bench.folder.join("run.mcap");
        let mut delays_ms = BTreeMap::new();
        for Timed { fault, .. } in &plan.faults {
            if let Fault::LateReplies { agent, up_to_ms } = fault {
                delays_ms.insert(*agent, *up_to_ms);
            }
        }
        Ok(Self {
            watch: Watch::new(&recording, bench.rtf),
            event_log: File::create(bench.folder.join("diary.log"))?,
            started_at: now(),
            bench,
            recording,
            server: None,
            servers: 0,
            agents_started: 0,
            agents_since: None,
            nodes: Vec::new(),
            injectors: Vec::new(),
            delays_ms,
            faults: plan.faults.iter().copied().collect(),
            due: Vec::new(),
            is_over: false,
        })
    }

    fn execute(&mut self) -> Result<(), Failure> {
        self.start_server()?;
        loop {
            if self.bench.stop.load(Ordering::Relaxed) {
                return Err(Failure::Interrupted);
            }
            if self.started_at.elapsed() >= HANG {
                return Err(Failure::Failed(format!("the run hangs: no end after {} s", HANG.as_secs())));
            }
            if self.has_server_ended()? {
                return self.await_agents();
            }
            self.check_agents()?;
            self.start_agents()?;
            if self.execute_due()? || self.inject_due()? {
                // The run had ended before its server was killed.
                return Ok(());
            }
            pause();
        }
    }

    fn ready_file(&self) -> PathBuf {
        self.bench.folder.join(format!("ready-{}", self.servers))
    }

    /// Starts a server: for a new run, or to resume the one under way.
    fn start_server(&mut self) -> Result<(), Failure> {
        self.servers += 1;
        let name = format!("server-{}.log", self.servers);
        let mut command = self.command("sim_server", &name)?;
        command.arg("run").arg(self.bench.scenario);
        // There is no recording until all agents have joined.
        let is_resumed = self.recording.exists();
        command.arg(if is_resumed { "--resume" } else { "--record" }).arg(&self.recording);
        command.arg("--ready").arg(self.ready_file());
        self.log(&format!("server {} is started{}", self.servers, if is_resumed { ", and resumes" } else { "" }));
        self.server = Some(ChildGuard::start(command)?);
        self.agents_since = None;
        Ok(())
    }

    fn command(&self, name: &str, log: &str) -> Result<Command, Failure> {
        let mut command = in_domain(&self.bench.binaries.join(name), self.bench.domain);
        command.env("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST").env_remove("ROS_LOCALHOST_ONLY");
        let file = File::create(self.bench.folder.join(log))?;
        command.stdout(file.try_clone()?).stderr(file);
        Ok(command)
    }

    fn has_server_ended(&mut self) -> Result<bool, Failure> {
        let status = self.server.as_mut().map_or(Ok(None), ChildGuard::ended)?;
        match status {
            None => Ok(false),
            Some(status) if status.success() => Ok(true),
            Some(status) => Err(Failure::Failed(format!("server {} has ended with {status}", self.servers))),
        }
    }

    /// Starts all agents once the server is ready.
    fn start_agents(&mut self) -> Result<(), Failure> {
        if self.agents_since.is_none() && self.ready_file().exists() {
            for agent in 0..self.bench.agents {
                self.start_agent(agent)?;
            }
            self.agents_since = Some(now());
        }
        Ok(())
    }

    fn start_agent(&mut self, agent: u32) -> Result<(), Failure> {
        self.agents_started += 1;
        let number = self.agents_started;
        let mut command = self.command("agent_node", &format!("agent_{agent}-{number}.log"))?;
        command.args(["--id", &agent.to_string(), "--parameters", "false"]);
        if let Some(up_to_ms) = self.delays_ms.get(&agent) {
            command.args(["--chaos-delay-ms", &up_to_ms.to_string()]);
        }
        let process = ChildGuard::start(command)?;
        self.nodes.push(Node { number, agent, process, is_suspended: false, is_continued: false });
        self.log(&format!("process {number} is started as agent {agent}"));
        Ok(())
    }

    fn check_agents(&mut self) -> Result<(), Failure> {
        let mut ended = Vec::new();
        for node in &mut self.nodes {
            if let Some(status) = node.process.ended()? {
                ended.push((node.number, node.agent, status, node.is_continued));
            }
        }
        for (number, agent, status, is_continued) in ended {
            self.log(&format!("process {number}, agent {agent}, has ended: {status}"));
            self.nodes.retain(|node| node.number != number);
            if is_continued && status.code() == Some(FAILED) {
                if !self.is_over {
                    self.start_agent(agent)?;
                }
            } else if !matches!(status.code(), Some(0 | REFUSED)) {
                // Exit code 0 follows the shutdown message.
                return Err(Failure::Failed(format!("process {number}, agent {agent}, has ended with {status}")));
            }
        }
        Ok(())
    }

    /// Executes the actions that are due; returns whether the run is over.
    fn execute_due(&mut self) -> Result<bool, Failure> {
        let now = now();
        let (due, later) = std::mem::take(&mut self.due).into_iter().partition(|(at, _)| *at <= now);
        self.due = later;
        for (_, action) in due {
            match action {
                ScheduledFault::Start(agent) => self.start_agent(agent)?,
                ScheduledFault::Continue(number) => self.continue_process(number)?,
                // The other actions concern processes that are killed as well.
                ScheduledFault::KillServer => return self.kill_server(None),
            }
        }
        Ok(false)
    }

    fn continue_process(&mut self, number: u32) -> Result<(), Failure> {
        if let Some(node) = self.nodes.iter_mut().find(|node| node.number == number) {
            node.is_suspended = false;
            node.is_continued = true;
            node.process.signal(Signal::SIGCONT)?;
            self.log(&format!("process {number} is continued"));
        }
        Ok(())
    }

    /// Injects the faults that are due; returns whether the run is over.
    fn inject_due(&mut self) -> Result<bool, Failure> {
        while let Some(Timed { at, fault }) = self.faults.front().copied() {
            let is_time = match at {
                At::Joining(ms) => self.agents_since.is_some_and(|since| since.elapsed() >= millis(ms)),
                At::Running(s) => self.watch.position_s().is_some_and(|position| position >= s),
            };
            // Without agents there is nothing to disturb: the known position is from before the
            // resume.
            if !is_time || self.agents_since.is_none() {
                return Ok(false);
            }
            self.faults.pop_front();
            let position = self.watch.position_s().unwrap_or_default();
            self.log(&format!("{}; the run is at about {position:.1} s", Timed { at, fault }));
            if self.inject(fault)? {
                return Ok(true);
            }
        }
        Ok(false)
    }

    fn inject(&mut self, fault: Fault) -> Result<bool, Failure> {
        match fault {
            Fault::KillAgent { agent, which, restart_ms } => {
                if let Some(place) = self.place_of(agent, which) {
                    // Dropping it kills it.
                    let Node { number, .. } = self.nodes.remove(place);
                    self.log(&format!("process {number} is killed"));
                }
                self.later(restart_ms, ScheduledFault::Start(agent));
            }
            Fault::KillServer { again_ms } => return self.kill_server(again_ms),
            Fault::Hang { agent, which, for_ms, successor_ms } => {
                let Some(place) = self.place_of(agent, which) else { return Ok(false) };
                let node = &mut self.nodes[place];
                node.is_suspended = true;
                node.process.signal(Signal::SIGSTOP)?;
                let number = node.number;
                self.log(&format!("process {number} is suspended"));
                self.later(for_ms, ScheduledFault::Continue(number));
                if let Some(ms) = successor_ms {
                    self.later(ms, ScheduledFault::Start(agent));
                }
            }
            Fault::Duplicate { agent } => self.start_agent(agent)?,
            Fault::Garbage { messages } => {
                let mut command = self.command("maes", &format!("garbage-{}.log", self.injectors.len()))?;
                command.args(["faults", "inject-garbage", "--agents", &self.bench.agents.to_string()]);
                command.args(["--messages", &messages.to_string()]);
                self.injectors.push(ChildGuard::start(command)?);
            }
            // Applies from the start.
            Fault::LateReplies { .. } => {}
        }
        Ok(false)
    }

    /// Kills the server with all of its agents, and restarts them; returns whether it had just
    /// ended the run.
    fn kill_server(&mut self, again_ms: Option<u32>) -> Result<bool, Failure> {
        self.server = None;
        self.nodes.clear();
        self.due.clear();
        self.log(&format!("server {} is killed with all agents", self.servers));
        if let Ok(recording) = Recording::open(&self.recording) {
            let playback = Playback::new(&recording).map_err(|error| Failure::Failed(error.to_string()))?;
            if let Horizon::Ended(tick) = playback.horizon() {
                self.log(&format!("it had ended the run in tick {tick}"));
                return Ok(true);
            }
        }
        self.start_server()?;
        if let Some(ms) = again_ms {
            self.later(ms, ScheduledFault::KillServer);
        }
        Ok(false)
    }

    fn later(&mut self, ms: u32, action: ScheduledFault) {
        self.due.push((now() + millis(ms), action));
    }

    /// The index of an agent process that is not suspended.
    fn place_of(&self, agent: u32, which: Which) -> Option<usize> {
        let mut places = self.nodes.iter().enumerate().filter(|(_, node)| node.agent == agent && !node.is_suspended);
        let place = match which {
            Which::Oldest => places.next(),
            Which::Newest => places.next_back(),
        };
        place.map(|(place, _)| place)
    }

    /// Waits for the agents to exit; those that take too long are killed when this is dropped.
    fn await_agents(&mut self) -> Result<(), Failure> {
        self.is_over = true;
        let ended = now();
        while self.nodes.iter().any(|node| !node.is_suspended) && ended.elapsed() < AGENT_EXIT_TIMEOUT {
            self.check_agents()?;
            pause();
        }
        Ok(())
    }

    fn log(&mut self, text: &str) {
        // A log line that is lost does no harm: the plan has the faults.
        drop(writeln!(self.event_log, "{:8.3} s: {text}", self.started_at.elapsed().as_secs_f64()));
    }

    /// The processes that are left, as text.
    fn state(&self) -> String {
        let nodes: Vec<String> = self
            .nodes
            .iter()
            .map(|node| {
                format!(
                    "process {} (agent {}{})",
                    node.number,
                    node.agent,
                    if node.is_suspended { ", suspended" } else { "" }
                )
            })
            .collect();
        format!("still there: [{}]; {} faults were not reached", nodes.join(", "), self.faults.len())
    }
}

fn millis(ms: u32) -> Duration {
    Duration::from_millis(ms.into())
}
