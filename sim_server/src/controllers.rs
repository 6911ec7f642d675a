//! The agents of this build, for the checks of recorded commands, and of what people want to start: the only file of this package that knows them.

use agent_node::agent::{Agent, Reaction};
use agent_node::{controllers, wire};
use msgs::ids::AgentId;
use msgs::maes_msgs::{Command, Observation, Scenario};
use sim_server::verify::controllers::{Controllers, Decider};

/// All controllers that come with the simulator.
pub(crate) struct OfThisBuild;

impl Controllers for OfThisBuild {
    fn agent(&self, told: &Scenario, agent: AgentId, runs: &str) -> Result<Box<dyn Decider>, String> {
        let mut words = runs.split(' ');
        let name = words.next().unwrap_or_default();
        let settings: Vec<String> = words.map(str::to_owned).collect();
        let run_info = wire::run_info(told).map_err(|error| error.to_string())?;
        let controller =
            controllers::build(name, &settings, agent, run_info.agents_seed).map_err(|error| error.to_string())?;
        Ok(Box::new(OfAgent(Agent::new(agent, run_info, controller))))
    }
}

/// Whether there is the controller that a scenario names, with its settings.
#[cfg(feature = "view")]
pub(crate) fn check(scenario: &simulation::scenario::Scenario) -> anyhow::Result<()> {
    let settings = scenario.agents.set.iter().map(|(key, value)| format!("{key}={}", super::word(value)));
    Ok(controllers::check(&scenario.agents.controller, &settings.collect::<Vec<_>>())?)
}

struct OfAgent(Agent);

impl Decider for OfAgent {
    fn take(&mut self, part: Observation) -> Result<Option<Command>, String> {
        match self.0.take(part) {
            Ok(Reaction::Reply(command)) => Ok(Some(command)),
            Ok(Reaction::None | Reaction::Acknowledge(_)) => Ok(None),
            Err(error) => Err(error.to_string()),
        }
    }
}
