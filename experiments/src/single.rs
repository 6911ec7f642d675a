//! One run in one process, over the in-memory link.

use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use agent_node::controllers;
use agent_node::host::{Options, RunError as AgentError};
use agent_node::stopwatch::DecisionTimes;
use msgs::ids::AgentId;
use msgs::maes_msgs::Progress;
use sim_server::recorder::RecordError;
use sim_server::session::{Outcome, RunConfig, RunError, RunObserver};
use sim_server::setup::{self, SetupError};
use simulation::scenario::{Origins, Scenario};
use simulation::wire;
use thiserror::Error;

use crate::in_memory;

/// Why a run has no result.
#[derive(Debug, Error)]
pub enum SingleError {
    /// The scenario cannot be set up.
    #[error(transparent)]
    Setup(#[from] SetupError),
    /// Some agents are driven by standard messages, which there are over ROS 2 only.
    #[error("agents.cmd_vel = {0:?}: expected [] without a network; nodes of somebody else take part over ROS 2 only")]
    OverRosOnly(Vec<u32>),
    /// The recording cannot be made.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// The server has given up.
    #[error(transparent)]
    Run(#[from] RunError),
    /// An agent has given up.
    #[error(transparent)]
    Agent(#[from] AgentError),
}

/// How the agents of a run are spread over threads.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Grouping {
    /// A thread for each.
    Apart,
    /// One thread for all.
    Together,
}

/// How the agents of a run are carried out, beside their controllers.
#[derive(Debug, Clone)]
pub struct Team {
    /// On which threads.
    pub grouping: Grouping,
    /// Each waits up to so long, at random, before each answer.
    pub chaos_delay: Duration,
    /// Where to note how long decisions take.
    pub decision_times: Option<DecisionTimes>,
}

/// A run that has come to its end.
#[derive(Debug, Clone)]
pub struct Finished {
    /// What became of it.
    pub outcome: Outcome,
    /// Cells of the map along x, y and z.
    pub size: [u32; 3],
    /// How far it had come, every ten seconds of sim time from the start on and at the end.
    pub progress: Vec<Progress>,
}

/// Carries out a scenario. The recording goes where the scenario says. `stop` ends the run early once it is set, and is set if an
/// agent gives up.
///
/// # Errors
/// If the scenario cannot be set up or carried out; that of an agent comes first.
pub fn run(
    scenario: &Scenario,
    team: &Team,
    observer: &mut dyn RunObserver,
    stop: &AtomicBool,
) -> Result<Finished, SingleError> {
    if !scenario.agents.cmd_vel.is_empty() {
        return Err(SingleError::OverRosOnly(scenario.agents.cmd_vel.clone()));
    }
    let scenario = &setup::resolve(scenario.clone(), &Origins::new("the scenario", "", &[]))?;
    let (world, _report) = setup::build(scenario)?;
    let told = wire::scenario(scenario, &world.terrain().extent(), world.rays());
    // Before a file is made for a run that there cannot be.
    controllers::build(&told.controller, &told.settings, AgentId(0), told.agents_seed).map_err(AgentError::from)?;
    let recorder = match &scenario.execution.record {
        Some(file) => Some(setup::record(file, scenario, &world)?),
        None => None,
    };
    let agents = (0..scenario.agents.count).map(AgentId);
    let groups: Vec<Vec<AgentId>> = match team.grouping {
        Grouping::Apart => agents.map(|agent| vec![agent]).collect(),
        Grouping::Together => vec![agents.collect()],
    };
    let (mut server_end, agents_ends) = in_memory::link(&groups);
    let agents_stop = AtomicBool::new(false);
    let outcome = thread::scope(|scope| -> Result<Outcome, SingleError> {
        let server_ends = SetOnDrop(&agents_stop);
        let nodes: Vec<_> = (0..)
            .zip(groups)
            .zip(agents_ends)
            .map(|((instance, agents), mut end)| {
                let (controller, settings) = (None, Vec::new());
                let Team { chaos_delay, decision_times, .. } = team.clone();
                // Nobody can end the server without the agents.
                let server_timeout = Duration::MAX;
                let options = Options {
                    agents,
                    controller,
                    settings,
                    instance,
                    server_timeout,
                    chaos_delay,
                    // Nobody looks on.
                    map_hz: 1.0,
                    decision_times,
                };
                let agents_stop = &agents_stop;
                scope.spawn(move || {
                    let ended = agent_node::host::run(&mut end, &options, agents_stop);
                    if ended.is_err() {
                        stop.store(true, Ordering::Relaxed);
                    }
                    ended
                })
            })
            .collect();
        let outcome = RunConfig::live(scenario)
            .and_then(|config| sim_server::session::run(config, world, &mut server_end, recorder, observer, stop));
        drop(server_ends);
        for node in nodes {
            node.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))?;
        }
        Ok(outcome?)
    })?;
    Ok(Finished { outcome, size: told.size, progress: server_end.into_progress() })
}

/// Sets a flag at the end of a scope, even if that is a panic.
struct SetOnDrop<'a>(&'a AtomicBool);

impl Drop for SetOnDrop<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}
