//! A run in one process: the server and its agents, connected by [`crate::link`].

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use agent_node::controllers::Registry;
use agent_node::host::{Options, RunError as AgentError};
use agent_node::stopwatch::DecisionTimes;
use msgs::ids::{AgentId, Tick};
use recording::Recording;
use recording::playback::Playback;
use recording::recorder::{RecordError, RunRecorder};
use sim_server::session::{Mode, Outcome, RunConfig, RunError, RunObserver};
use sim_server::setup::{self, SetupError};
use simulation::scenario::{ControllerChoice, Origins, Scenario};
use simulation::wire;
use thiserror::Error;
use transport::Level;
use world::World;
use world::workers::Workers;

#[cfg(unix)]
use crate::own_program::{self, OwnProgram, OwnProgramError};
use crate::{Course, Team};

/// Why a run has no result.
#[derive(Debug, Error)]
pub enum InProcessError {
    #[error(transparent)]
    Setup(#[from] SetupError),
    /// Some agents are run by other programs, which exist over ROS 2 only.
    #[error("{key} = {value}: expected [] over memory, which has no other nodes; use --transport ros2")]
    OverRosOnly { key: &'static str, value: String },
    /// A program that runs agents has failed.
    #[cfg(unix)]
    #[error(transparent)]
    OwnProgram(#[from] OwnProgramError),
    #[error(transparent)]
    Record(#[from] RecordError),
    /// The server has stopped with an error.
    #[error(transparent)]
    Run(#[from] RunError),
    /// An agent has stopped with an error.
    #[error(transparent)]
    Agent(#[from] AgentError),
}

/// The distribution of agents over threads. The result of a run does not depend on it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ThreadLayout {
    /// One thread per agent, besides that of the server.
    PerAgent,
    /// The thread of the server, and as many others as cast scans; see
    /// [`execution.threads`](simulation::scenario::ExecutionSection::threads).
    Team,
    /// The thread of the server alone.
    Together,
}

/// How agents are executed, whatever their controllers.
#[derive(Debug, Clone)]
pub struct AgentOptions {
    pub threads: ThreadLayout,
    /// Upper bound of the random delay before each reply.
    pub chaos_delay: Duration,
    /// Collects the wall time of decisions.
    pub decision_times: Option<DecisionTimes>,
    /// The controllers that the agents know.
    pub registry: Registry,
    /// The controller that runs in place of the one that the scenario names, with the same
    /// settings. The scenario, and with it recording and digest, keeps the name.
    pub substitute: Option<String>,
    /// Whether the program that the scenario names may be started: the folder from which it is
    /// looked for, the present one if that is empty. It has to be based on `agent_node`.
    pub programs_from: Option<PathBuf>,
}

impl Default for AgentOptions {
    /// A thread for each agent, and the built-in controllers.
    fn default() -> Self {
        Self {
            threads: ThreadLayout::PerAgent,
            chaos_delay: Duration::ZERO,
            decision_times: None,
            registry: Registry::BUILT_IN,
            substitute: None,
            programs_from: None,
        }
    }
}

/// A run with its result.
#[derive(Debug, Clone)]
pub struct CompletedRun {
    pub outcome: Outcome,
    /// Cells of the map along x, y and z.
    pub size: [u32; 3],
    /// Edge of a cell, metres.
    pub cell_m: f64,
    pub course: Course,
}

/// Runs a scenario, and records it to the file that the scenario names. `stop` ends the run early;
/// it is also set when an agent fails.
///
/// # Errors
/// If the scenario cannot be set up, or the server or an agent fails; the error of an agent is
/// reported first.
pub fn run(
    scenario: &Scenario,
    options: &AgentOptions,
    observer: &mut dyn RunObserver,
    stop: &AtomicBool,
) -> Result<CompletedRun, InProcessError> {
    check(scenario, options)?;
    let scenario = &setup::resolve(scenario.clone(), &Origins::new("the scenario", "", &[]))?;
    let (world, map) = setup::build(scenario)?;
    for warning in &map.warnings {
        observer.note(Level::Warn, warning);
    }
    // Checked before a recording is created for a run that cannot start.
    for agents in scenario.phases().iter().map(|phase| &phase.agents) {
        let choices = match &options.substitute {
            // It decides for all agents, with the settings of the team.
            Some(controller) => vec![ControllerChoice { controller, set: &agents.set }],
            // A program knows its own.
            None => agents.controllers_of(|agent| !agents.is_commanded(agent)),
        };
        for choice in choices {
            options.registry.check(choice.controller, &wire::settings(choice.set)).map_err(AgentError::from)?;
        }
    }
    let recorder = recorder(scenario, &world)?;
    run_in(scenario, world, recorder, options, observer, stop)
}

/// Forks a recorded run at a tick: its recorded commands are executed up to there, and `scenario`
/// (see [`setup::fork`]) from there on.
///
/// # Errors
/// See [`run`]; also if the recording is not that of another run of this build.
pub fn fork(
    recording: &Recording,
    at: Tick,
    scenario: &Scenario,
    options: &AgentOptions,
    observer: &mut dyn RunObserver,
    stop: &AtomicBool,
) -> Result<CompletedRun, InProcessError> {
    check(scenario, options)?;
    let (world, _report) = setup::rebuild(recording, scenario)?;
    let playback = Playback::new(recording).map_err(RunError::from)?.until(at);
    let recorder = recorder(scenario, &world)?;
    run_mode(scenario, Mode::Resume(playback), world, recorder, options, observer, stop)
}

/// Checks what can be known before a world is made.
fn check(scenario: &Scenario, options: &AgentOptions) -> Result<(), InProcessError> {
    if let Some((key, value)) = scenario.agents.of_ros_only(cfg!(unix) && options.programs_from.is_some()) {
        return Err(InProcessError::OverRosOnly { key, value });
    }
    Ok(setup::check_destination(scenario)?)
}

/// The recorder of the file that a scenario names, if it names one.
fn recorder(scenario: &Scenario, world: &World) -> Result<Option<RunRecorder>, InProcessError> {
    let file = scenario.execution.record.as_deref();
    Ok(file.map(|file| setup::record(file, scenario, world)).transpose()?)
}

/// Runs a checked scenario in its world, and records it with this recorder; see [`run`].
///
/// # Errors
/// If the server or an agent fails; the error of an agent is reported first.
pub fn run_in(
    scenario: &Scenario,
    world: World,
    recorder: Option<RunRecorder>,
    options: &AgentOptions,
    observer: &mut dyn RunObserver,
    stop: &AtomicBool,
) -> Result<CompletedRun, InProcessError> {
    run_mode(scenario, Mode::Live, world, recorder, options, observer, stop)
}

fn run_mode<'a>(
    scenario: &'a Scenario,
    mode: Mode<'a>,
    world: World,
    recorder: Option<RunRecorder>,
    options: &AgentOptions,
    observer: &mut dyn RunObserver,
    stop: &AtomicBool,
) -> Result<CompletedRun, InProcessError> {
    let (size, cell_m) = (world.terrain().extent().size(), world.terrain().extent().cell_m());
    let of_threads = |groups: Vec<Vec<AgentId>>| {
        (0..).zip(groups).map(|(instance, agents)| process(scenario, instance, agents, options)).collect::<Vec<_>>()
    };
    #[cfg(unix)]
    if let Some(folder) = options.programs_from.as_deref().filter(|_| scenario.agents.is_command_a_node()) {
        let agents = &scenario.agents;
        let program = |ids| Node::Program(OwnProgram::new(&agents.command, folder, ids));
        let built_in = (0..agents.count).filter(|&agent| !agents.is_commanded(agent)).map(|agent| vec![AgentId(agent)]);
        let nodes = of_threads(built_in.collect()).into_iter().map(Node::Thread);
        let nodes = nodes.chain(own_program::ranges(agents.with_own_command()).into_iter().map(program));
        return run_on_threads(scenario, mode, world, recorder, nodes.collect(), observer, stop);
    }
    let agents = (0..scenario.agents.count).map(AgentId);
    let processes = of_threads(match options.threads {
        ThreadLayout::PerAgent | ThreadLayout::Team => agents.map(|agent| vec![agent]).collect(),
        ThreadLayout::Together => vec![agents.collect()],
    });
    let threads = match options.threads {
        ThreadLayout::PerAgent => {
            let nodes = processes.into_iter().map(Node::Thread).collect();
            return run_on_threads(scenario, mode, world, recorder, nodes, observer, stop);
        }
        ThreadLayout::Team => setup::threads(scenario),
        ThreadLayout::Together => 1,
    };
    let workers = Workers::new(threads).map_err(RunError::from)?;
    let mut team = Team::new(processes, workers, stop);
    let config = RunConfig::new(scenario, mode)?;
    let outcome = sim_server::session::run(config, world, &mut team, recorder, observer, stop);
    let course = team.into_course()?;
    Ok(CompletedRun { outcome: outcome?, size, cell_m, course })
}

/// The options of a process of some agents.
fn process(scenario: &Scenario, instance: u64, agents: Vec<AgentId>, options: &AgentOptions) -> Options {
    // Those of the scenario are for the controller that it names.
    let settings = options.substitute.as_ref().map(|_| wire::settings(&scenario.agents.set));
    Options {
        agents,
        registry: options.registry,
        controller: options.substitute.clone(),
        settings: settings.unwrap_or_default(),
        instance,
        // The link is private to this process.
        credentials: None,
        // The server and the agents share a process, so the server cannot vanish alone.
        server_timeout: Duration::MAX,
        chaos_delay: options.chaos_delay,
        // Has no effect: this link publishes no maps.
        map_hz: 1.0,
        decision_times: options.decision_times.clone(),
    }
}

/// What runs some agents.
enum Node {
    /// A thread of this process.
    Thread(Options),
    /// A process of its own.
    #[cfg(unix)]
    Program(OwnProgram),
}

impl Node {
    fn agents(&self) -> &[AgentId] {
        match self {
            Self::Thread(options) => &options.agents,
            #[cfg(unix)]
            Self::Program(program) => program.agents(),
        }
    }
}

/// Runs each node on a thread of its own.
fn run_on_threads<'a>(
    scenario: &'a Scenario,
    mode: Mode<'a>,
    world: World,
    recorder: Option<RunRecorder>,
    nodes: Vec<Node>,
    observer: &mut dyn RunObserver,
    stop: &AtomicBool,
) -> Result<CompletedRun, InProcessError> {
    let (size, cell_m) = (world.terrain().extent().size(), world.terrain().extent().cell_m());
    let groups: Vec<Vec<AgentId>> = nodes.iter().map(|node| node.agents().to_vec()).collect();
    let (mut server_end, agents_ends) = crate::link(&groups);
    let agents_stop = AtomicBool::new(false);
    let outcome = thread::scope(|scope| -> Result<Outcome, InProcessError> {
        let stop_agents = SetOnDrop(&agents_stop);
        let nodes: Vec<_> = nodes
            .into_iter()
            .zip(agents_ends)
            .map(|(node, mut end)| {
                let agents_stop = &agents_stop;
                scope.spawn(move || {
                    let ended = match node {
                        Node::Thread(options) => {
                            agent_node::host::run(&mut end, &options, agents_stop).map_err(InProcessError::from)
                        }
                        #[cfg(unix)]
                        Node::Program(program) => program.run(end, scope, agents_stop).map_err(InProcessError::from),
                    };
                    if ended.is_err() {
                        stop.store(true, Ordering::Relaxed);
                    }
                    ended
                })
            })
            .collect();
        let outcome = RunConfig::new(scenario, mode)
            .and_then(|config| sim_server::session::run(config, world, &mut server_end, recorder, observer, stop));
        drop(stop_agents);
        for node in nodes {
            node.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))?;
        }
        Ok(outcome?)
    })?;
    Ok(CompletedRun { outcome, size, cell_m, course: server_end.into_course() })
}

/// Sets a flag at the end of a scope, also when the scope panics.
struct SetOnDrop<'a>(&'a AtomicBool);

impl Drop for SetOnDrop<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

#[cfg(test)]
mod tests;
