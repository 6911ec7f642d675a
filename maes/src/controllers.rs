//! The controllers of this build: checks what a scenario asks for, and decides again for recorded
//! commands.

use std::collections::BTreeSet;

use agent_node::control_loop::{Agent, Reaction};
use agent_node::controllers::{self, Registry};
use msgs::ids::AgentId;
use msgs::maes_msgs::{Command, Observation, Scenario};
use protocol::run_info::RunInfo;
use protocol::signed::Signed;
use recording::Recording;
use sim_server::verify::controllers::{AgentReplica, ControllerFactory};
use simulation::scenario::AgentsSection;

/// Whether there are the controllers that a scenario names, with their settings, as far as they
/// have an agent that is not run by another program; `elsewhere` are agents that start elsewhere.
pub(crate) fn check(scenario: &simulation::scenario::Scenario, elsewhere: &BTreeSet<u32>) -> anyhow::Result<()> {
    for agents in scenario.phases().into_iter().map(|phase| phase.agents) {
        for choice in agents.controllers_of(|agent| agents.is_built_in(agent) && !elsewhere.contains(&agent)) {
            controllers::check(choice.controller, &simulation::wire::settings(choice.set))?;
        }
    }
    Ok(())
}

/// All controllers that come with the simulator, for the agents of a recording that they have run.
pub(crate) struct BuiltInControllers {
    /// Of the recording, if it is legal.
    agents: Option<AgentsSection>,
}

impl BuiltInControllers {
    pub(crate) fn of(recording: &Recording) -> Self {
        let scenario = simulation::scenario::Scenario::parse(recording.file(), &recording.scenario(), &[]);
        Self { agents: scenario.ok().map(|scenario| scenario.agents) }
    }
}

impl ControllerFactory for BuiltInControllers {
    fn agent(&self, announced: &Scenario, agent: AgentId, runs: &str) -> Result<Box<dyn AgentReplica>, String> {
        if self.agents.as_ref().is_some_and(|agents| agents.cmd_vel.contains(&agent.0)) {
            return Err("teleoperated (agents.cmd_vel): no controller has decided".to_owned());
        }
        // Whatever the program calls its controller, even if it is the name of one of ours.
        if let Some(agents) = self.agents.as_ref().filter(|agents| agents.is_commanded(agent.0)) {
            return Err(format!(
                "agents.command = {:?} has decided, as \"{runs}\", and is no part of this build: its commands were \
                 taken as recorded; to decide again, run the recording with that program, and compare with `maes diff`",
                agents.command
            ));
        }
        let mut words = runs.split(' ');
        let name = words.next().unwrap_or_default();
        let settings: Vec<String> = words.map(str::to_owned).collect();
        let run_info = RunInfo::from_message(announced, agent).map_err(|error| error.to_string())?;
        let controller = controllers::build(name, &settings, agent, &run_info).map_err(|error| error.to_string())?;
        let successors = Registry::BUILT_IN.successors(agent, runs == run_info.controller_label(), None);
        Ok(Box::new(BuiltInReplica(Agent::new(agent, run_info, controller).with_successors(successors))))
    }
}

struct BuiltInReplica(Agent);

impl AgentReplica for BuiltInReplica {
    fn take(&mut self, part: Observation) -> Result<Option<Command>, String> {
        match self.0.take(Signed::unsigned(part).trusted()) {
            Ok(Reaction::Reply(command)) => Ok(Some(command)),
            Ok(Reaction::None | Reaction::Acknowledge(_)) => Ok(None),
            Err(error) => Err(error.to_string()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn controllers_that_only_agents_elsewhere_run_may_be_unknown() {
        let text = "seed = 1\nduration_s = 1.0\n[map]\nkind = \"spheres\"\nsize = 20\n[agents]\ncount = 2\ncontroller = \"Zigzag\"\n";
        let scenario = simulation::scenario::Scenario::parse("s.toml", text, &[]).unwrap();
        assert!(check(&scenario, &BTreeSet::from([0, 1])).is_ok());
        let refused = check(&scenario, &BTreeSet::from([0])).unwrap_err().to_string();
        assert!(refused.starts_with("controller Zigzag: unknown"), "{refused}");
    }
}
