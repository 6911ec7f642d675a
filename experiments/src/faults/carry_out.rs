//! A run with its faults: starts the processes, disturbs them as the plan says, and waits for the
//! end of the server.
//!
//! Invariants: every process ends with this; wall time positions a fault and ends a hang, and
//! decides nothing else; whoever ends without having been told to is a failure, but for those who
//! are refused because their id is taken (exit code 5), and those whose connection has not survived
//! that they were stopped (exit code 1), which are started again as the launch script does.
//!
//! Not done here: whether the run was the right one ([`super::verdict`]).

use std::collections::{BTreeMap, VecDeque};
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use sim_server::playback::{Horizon, Playback};
use sim_server::recording::Recording;
use supervisor::child::{ChildGuard, Signal};

use super::plan::{At, Fault, Plan, Timed, Which};
use super::watch::Watch;
use crate::processes::{in_domain, now, pause};

/// Wall time after which a run hangs.
const HANG: Duration = Duration::from_secs(240);

/// Wall time that agents have to go home once the server has ended.
const GOING_HOME: Duration = Duration::from_secs(10);

/// Exit code of an agent process that cannot go on.
const FAILED: i32 = 1;

/// Exit code of an agent process whose id is taken.
const REFUSED: i32 = 5;

/// Where and with what a run is carried out.
#[derive(Debug)]
pub(super) struct Bench<'a> {
    /// The folder of the binaries.
    pub(super) binaries: &'a Path,
    /// The scenario (.toml), with its `[execution]`.
    pub(super) scenario: &'a Path,
    /// For the recording and all logs.
    pub(super) folder: &'a Path,
    /// ROS domain.
    pub(super) domain: u32,
    /// Size of the team.
    pub(super) agents: u32,
    /// Sim seconds for each second of wall time.
    pub(super) pace: f64,
    /// Gives up once it is set.
    pub(super) stop: &'a AtomicBool,
}

/// Why a run has not come to its end.
#[derive(Debug)]
pub(super) enum Failure {
    /// It was given up because somebody asked for it.
    Interrupted,
    /// Something else.
    Failed(String),
}

impl From<std::io::Error> for Failure {
    fn from(error: std::io::Error) -> Self {
        Self::Failed(error.to_string())
    }
}

/// Carries out the run of a plan; returns its recording.
pub(super) fn carry_out(bench: &Bench<'_>, plan: &Plan) -> Result<PathBuf, Failure> {
    let mut stage = Stage::new(bench, plan)?;
    let ended = stage.run();
    let told = match &ended {
        Ok(()) => "the run has ended".to_owned(),
        Err(Failure::Interrupted) => "interrupted".to_owned(),
        Err(Failure::Failed(reason)) => format!("failed: {reason}"),
    };
    stage.note(&told);
    stage.note(&stage.state());
    ended.map(|()| stage.recording)
}

/// A process of an agent.
struct Node {
    number: u32,
    agent: u32,
    process: ChildGuard,
    is_stopped: bool,
    /// It goes on after it was stopped, and ends because its connection does not survive that.
    is_back: bool,
}

/// Something that is to be done later.
enum Deed {
    Start(u32),
    Continue(u32),
    KillServer,
}

struct Stage<'a> {
    bench: &'a Bench<'a>,
    recording: PathBuf,
    diary: File,
    begun: Instant,
    watch: Watch,
    server: Option<ChildGuard>,
    /// How many servers and agents have been started.
    servers: u32,
    started: u32,
    /// When the agents of the present server were started.
    agents_since: Option<Instant>,
    nodes: Vec<Node>,
    liars: Vec<ChildGuard>,
    late: BTreeMap<u32, u32>,
    faults: VecDeque<Timed>,
    due: Vec<(Instant, Deed)>,
    /// Whether the server has ended the run.
    is_over: bool,
}

impl<'a> Stage<'a> {
    fn new(bench: &'a Bench<'a>, plan: &Plan) -> Result<Self, Failure> {
        let recording = bench.folder.join("run.mcap");
        let mut late = BTreeMap::new();
        for Timed { fault, .. } in &plan.faults {
            if let Fault::LateReplies { agent, up_to_ms } = fault {
                late.insert(*agent, *up_to_ms);
            }
        }
        Ok(Self {
            watch: Watch::new(&recording, bench.pace),
            diary: File::create(bench.folder.join("diary.log"))?,
            begun: now(),
            bench,
            recording,
            server: None,
            servers: 0,
            started: 0,
            agents_since: None,
            nodes: Vec::new(),
            liars: Vec::new(),
            late,
            faults: plan.faults.iter().copied().collect(),
            due: Vec::new(),
            is_over: false,
        })
    }

    fn run(&mut self) -> Result<(), Failure> {
        self.start_server()?;
        loop {
            if self.bench.stop.load(Ordering::Relaxed) {
                return Err(Failure::Interrupted);
            }
            if self.begun.elapsed() >= HANG {
                return Err(Failure::Failed(format!("the run hangs: no end after {} s", HANG.as_secs())));
            }
            if self.has_server_ended()? {
                return self.go_home();
            }
            self.look_after_agents()?;
            self.begin_agents()?;
            if self.do_what_is_due()? || self.disturb()? {
                // Nothing is left of the run but its recording, and that has an end.
                return Ok(());
            }
            pause();
        }
    }

    fn ready_file(&self) -> PathBuf {
        self.bench.folder.join(format!("ready-{}", self.servers))
    }

    /// Starts a server: for a new run, or to go on with the one that has begun.
    fn start_server(&mut self) -> Result<(), Failure> {
        self.servers += 1;
        let name = format!("server-{}.log", self.servers);
        let mut command = self.command("sim_server", &name)?;
        command.arg("run").arg(self.bench.scenario);
        // There is no recording until all agents have joined.
        let is_resumed = self.recording.exists();
        command.arg(if is_resumed { "--resume" } else { "--record" }).arg(&self.recording);
        command.arg("--ready").arg(self.ready_file());
        self.note(&format!("server {} is started{}", self.servers, if is_resumed { ", to go on" } else { "" }));
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

    /// Starts all agents, once the server is there.
    fn begin_agents(&mut self) -> Result<(), Failure> {
        if self.agents_since.is_none() && self.ready_file().exists() {
            for agent in 0..self.bench.agents {
                self.start_agent(agent)?;
            }
            self.agents_since = Some(now());
        }
        Ok(())
    }

    fn start_agent(&mut self, agent: u32) -> Result<(), Failure> {
        self.started += 1;
        let number = self.started;
        let mut command = self.command("agent_node", &format!("agent_{agent}-{number}.log"))?;
        command.args(["--id", &agent.to_string(), "--parameters", "false"]);
        if let Some(up_to_ms) = self.late.get(&agent) {
            command.args(["--chaos-delay-ms", &up_to_ms.to_string()]);
        }
        let process = ChildGuard::start(command)?;
        self.nodes.push(Node { number, agent, process, is_stopped: false, is_back: false });
        self.note(&format!("process {number} is started as agent {agent}"));
        Ok(())
    }

    fn look_after_agents(&mut self) -> Result<(), Failure> {
        let mut ended = Vec::new();
        for node in &mut self.nodes {
            if let Some(status) = node.process.ended()? {
                ended.push((node.number, node.agent, status, node.is_back));
            }
        }
        for (number, agent, status, is_back) in ended {
            self.note(&format!("process {number}, agent {agent}, has ended: {status}"));
            self.nodes.retain(|node| node.number != number);
            if is_back && status.code() == Some(FAILED) {
                if !self.is_over {
                    self.start_agent(agent)?;
                }
            } else if !matches!(status.code(), Some(0 | REFUSED)) {
                // With 0 they have been told that the run is over.
                return Err(Failure::Failed(format!("process {number}, agent {agent}, has ended with {status}")));
            }
        }
        Ok(())
    }

    /// Does what was put off until now; whether the run has turned out to be over.
    fn do_what_is_due(&mut self) -> Result<bool, Failure> {
        let now = now();
        let (due, later) = std::mem::take(&mut self.due).into_iter().partition(|(at, _)| *at <= now);
        self.due = later;
        for (_, deed) in due {
            match deed {
                Deed::Start(agent) => self.start_agent(agent)?,
                Deed::Continue(number) => self.continue_process(number)?,
                // Whatever else was due is of the processes that are gone then.
                Deed::KillServer => return self.kill_server(None),
            }
        }
        Ok(false)
    }

    fn continue_process(&mut self, number: u32) -> Result<(), Failure> {
        if let Some(node) = self.nodes.iter_mut().find(|node| node.number == number) {
            node.is_stopped = false;
            node.is_back = true;
            node.process.signal(Signal::SIGCONT)?;
            self.note(&format!("process {number} goes on"));
        }
        Ok(())
    }

    /// Does what the plan says of now; the same.
    fn disturb(&mut self) -> Result<bool, Failure> {
        while let Some(Timed { at, fault }) = self.faults.front().copied() {
            let is_time = match at {
                At::Joining(ms) => self.agents_since.is_some_and(|since| since.elapsed() >= millis(ms)),
                At::Running(s) => self.watch.position_s().is_some_and(|position| position >= s),
            };
            // Without agents there is nobody to disturb: what is known of the run is from before it
            // was resumed.
            if !is_time || self.agents_since.is_none() {
                return Ok(false);
            }
            self.faults.pop_front();
            let position = self.watch.position_s().unwrap_or_default();
            self.note(&format!("{}; the run is at about {position:.1} s", Timed { at, fault }));
            if self.carry_out(fault)? {
                return Ok(true);
            }
        }
        Ok(false)
    }

    fn carry_out(&mut self, fault: Fault) -> Result<bool, Failure> {
        match fault {
            Fault::KillAgent { agent, which, restart_ms } => {
                if let Some(place) = self.place_of(agent, which) {
                    // Dropping it kills it.
                    let Node { number, .. } = self.nodes.remove(place);
                    self.note(&format!("process {number} is killed"));
                }
                self.later(restart_ms, Deed::Start(agent));
            }
            Fault::KillServer { again_ms } => return self.kill_server(again_ms),
            Fault::Hang { agent, which, for_ms, successor_ms } => {
                let Some(place) = self.place_of(agent, which) else { return Ok(false) };
                let node = &mut self.nodes[place];
                node.is_stopped = true;
                node.process.signal(Signal::SIGSTOP)?;
                let number = node.number;
                self.note(&format!("process {number} is stopped"));
                self.later(for_ms, Deed::Continue(number));
                if let Some(ms) = successor_ms {
                    self.later(ms, Deed::Start(agent));
                }
            }
            Fault::Duplicate { agent } => self.start_agent(agent)?,
            Fault::Garbage { messages } => {
                let mut command = self.command("maes", &format!("garbage-{}.log", self.liars.len()))?;
                command.args(["faults", "inject-garbage", "--agents", &self.bench.agents.to_string()]);
                command.args(["--messages", &messages.to_string()]);
                self.liars.push(ChildGuard::start(command)?);
            }
            // From the start on.
            Fault::LateReplies { .. } => {}
        }
        Ok(false)
    }

    /// Kills the server with all of its agents, and starts them anew; whether it had just ended the
    /// run.
    fn kill_server(&mut self, again_ms: Option<u32>) -> Result<bool, Failure> {
        self.server = None;
        self.nodes.clear();
        self.due.clear();
        self.note(&format!("server {} is killed with all agents", self.servers));
        if let Ok(recording) = Recording::open(&self.recording) {
            let playback = Playback::new(&recording).map_err(|error| Failure::Failed(error.to_string()))?;
            if let Horizon::Ended(tick) = playback.horizon() {
                self.note(&format!("it had ended the run in tick {tick}"));
                return Ok(true);
            }
        }
        self.start_server()?;
        if let Some(ms) = again_ms {
            self.later(ms, Deed::KillServer);
        }
        Ok(false)
    }

    fn later(&mut self, ms: u32, deed: Deed) {
        self.due.push((now() + millis(ms), deed));
    }

    /// A process of an agent that is not stopped, in the list of processes.
    fn place_of(&self, agent: u32, which: Which) -> Option<usize> {
        let mut places = self.nodes.iter().enumerate().filter(|(_, node)| node.agent == agent && !node.is_stopped);
        let place = match which {
            Which::Oldest => places.next(),
            Which::Newest => places.next_back(),
        };
        place.map(|(place, _)| place)
    }

    /// Lets the agents go home. Who is not told in time is ended; the run is over.
    fn go_home(&mut self) -> Result<(), Failure> {
        self.is_over = true;
        let ended = now();
        while self.nodes.iter().any(|node| !node.is_stopped) && ended.elapsed() < GOING_HOME {
            self.look_after_agents()?;
            pause();
        }
        Ok(())
    }

    fn note(&mut self, text: &str) {
        // What was done is in the plan as well.
        drop(writeln!(self.diary, "{:8.3} s: {text}", self.begun.elapsed().as_secs_f64()));
    }

    /// Who is still there, for people.
    fn state(&self) -> String {
        let nodes: Vec<String> = self
            .nodes
            .iter()
            .map(|node| {
                format!(
                    "process {} (agent {}{})",
                    node.number,
                    node.agent,
                    if node.is_stopped { ", stopped" } else { "" }
                )
            })
            .collect();
        format!("still there: [{}]; {} faults were not reached", nodes.join(", "), self.faults.len())
    }
}

fn millis(ms: u32) -> Duration {
    Duration::from_millis(ms.into())
}
