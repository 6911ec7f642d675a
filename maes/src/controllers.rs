//! The controllers of this build: checks what a scenario asks for, and decides again for recorded
//! commands.

use agent_node::agent::{Agent, Reaction};
use agent_node::controllers::{self, ControllerError};
use agent_node::wire;
use anyhow::anyhow;
use msgs::ids::AgentId;
use msgs::maes_msgs::{Command, Observation, Scenario};
use sim_server::verify::controllers::{Controllers, Decider};

/// Least likeness of a name that is suggested, from 0 to 1.
const LIKENESS_MIN: f64 = 0.6;

/// Whether there is the controller that a scenario names, with its settings.
pub(crate) fn check(scenario: &simulation::scenario::Scenario) -> anyhow::Result<()> {
    let settings = scenario.agents.set.iter().map(|(key, value)| format!("{key}={}", word(value)));
    let checked = controllers::check(&scenario.agents.controller, &settings.collect::<Vec<_>>());
    checked.map_err(|error| match error {
        ControllerError::Unknown { ref name } => match nearest(name) {
            Some(nearest) => anyhow!("{error}; did you mean {nearest}?"),
            None => error.into(),
        },
        other => other.into(),
    })
}

/// The controller whose name is most like this one.
fn nearest(name: &str) -> Option<&'static str> {
    let likeness = controllers::NAMES.iter().map(|known| (strsim::normalized_damerau_levenshtein(name, known), *known));
    let nearest = likeness.max_by(|one, two| one.0.total_cmp(&two.0))?;
    (nearest.0 > LIKENESS_MIN).then_some(nearest.1)
}

/// A value as an agent reads it: a text without its quotes.
pub(crate) fn word(value: &toml::Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}

/// All controllers that come with the simulator.
pub(crate) struct OfThisBuild;

impl Controllers for OfThisBuild {
    fn agent(&self, told: &Scenario, agent: AgentId, runs: &str) -> Result<Box<dyn Decider>, String> {
        let mut words = runs.split(' ');
        let name = words.next().unwrap_or_default();
        let settings: Vec<String> = words.map(str::to_owned).collect();
        let briefing = wire::briefing(told).map_err(|error| error.to_string())?;
        let controller =
            controllers::build(name, &settings, agent, briefing.agents_seed).map_err(|error| error.to_string())?;
        Ok(Box::new(OfAgent(Agent::new(agent, briefing, controller))))
    }
}

struct OfAgent(Agent);

impl Decider for OfAgent {
    fn take(&mut self, part: Observation) -> Result<Option<Command>, String> {
        match self.0.take(part) {
            Ok(Reaction::Answer(command)) => Ok(Some(command)),
            Ok(Reaction::None | Reaction::Farewell(_)) => Ok(None),
            Err(error) => Err(error.to_string()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_name_is_suggested() {
        for (typed, suggested) in [
            ("dspv", Some("dsvp")),
            ("rwb", Some("rbw")),
            ("LVD", None),
            ("nearest_frontier", Some("nearest-frontier")),
            ("dsvp-maes", Some("dsvp-maes3d")),
            ("x", None),
        ] {
            assert_eq!(nearest(typed), suggested, "{typed}");
        }
    }
}
