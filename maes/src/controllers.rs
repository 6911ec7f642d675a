//! The controllers of this build: checks what a scenario asks for, and decides again for recorded
//! commands.

use agent_node::agent::{Agent, Reaction};
use agent_node::controllers;
use agent_node::wire;
use msgs::ids::AgentId;
use msgs::maes_msgs::{Command, Observation, Scenario};
use sim_server::verify::controllers::{AgentReplica, ControllerFactory};

/// Whether there are the controllers that a scenario names, with their settings.
pub(crate) fn check(scenario: &simulation::scenario::Scenario) -> anyhow::Result<()> {
    for agents in scenario.phases().into_iter().map(|phase| phase.agents) {
        let settings = agents.set.iter().map(|(key, value)| format!("{key}={}", word(value)));
        controllers::check(&agents.controller, &settings.collect::<Vec<_>>())?;
    }
    Ok(())
}

/// A value as an agent reads it: a text without its quotes.
pub(crate) fn word(value: &toml::Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}

/// All controllers that come with the simulator.
pub(crate) struct BuiltInControllers;

impl ControllerFactory for BuiltInControllers {
    fn agent(&self, told: &Scenario, agent: AgentId, runs: &str) -> Result<Box<dyn AgentReplica>, String> {
        let mut words = runs.split(' ');
        let name = words.next().unwrap_or_default();
        let settings: Vec<String> = words.map(str::to_owned).collect();
        let run_info = wire::run_info(told).map_err(|error| error.to_string())?;
        let controller =
            controllers::build(name, &settings, agent, run_info.agents_seed).map_err(|error| error.to_string())?;
        let successors = controllers::successors(agent, runs == run_info.controller_label(), None);
        Ok(Box::new(BuiltInReplica(Agent::new(agent, run_info, controller).with_successors(successors))))
    }
}

struct BuiltInReplica(Agent);

impl AgentReplica for BuiltInReplica {
    fn take(&mut self, part: Observation) -> Result<Option<Command>, String> {
        match self.0.take(part) {
            Ok(Reaction::Reply(command)) => Ok(Some(command)),
            Ok(Reaction::None | Reaction::Acknowledge(_)) => Ok(None),
            Err(error) => Err(error.to_string()),
        }
    }
}
