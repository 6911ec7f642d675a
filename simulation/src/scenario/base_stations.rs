//! `agents.base_stations`: agents that stay at their start and need the map of the team.
//!
//! A base station is an agent like all others, with a body, a radio and a map, which runs the
//! controller [`BASE_STATION`]. Results say what base stations know, and a run can end with it.

use std::collections::{BTreeMap, BTreeSet};

use msgs::ids::AgentId;
use protocol::run_info::BASE_STATION;

use super::{AgentsSection, Checker, ControllerChoice, MixEntry, Scenario, ScenarioError};

static NO_SETTINGS: BTreeMap<String, toml::Value> = BTreeMap::new();

/// The controller of base stations, which has no settings.
pub(super) const BASE_STATION_CHOICE: ControllerChoice<'static> =
    ControllerChoice { controller: BASE_STATION, set: &NO_SETTINGS };

impl AgentsSection {
    /// Whether an agent is a base station.
    #[must_use]
    pub fn is_base_station(&self, agent: u32) -> bool {
        self.base_stations.contains(&agent)
    }

    /// The base stations in the label of the team; `None` without any.
    pub(super) fn base_stations_label(&self) -> Option<String> {
        let ids: Vec<String> = self.base_stations.iter().map(u32::to_string).collect();
        (!ids.is_empty()).then(|| format!("agents {} {BASE_STATION}", ids.join(" ")))
    }
}

impl Scenario {
    /// The base stations.
    #[must_use]
    pub fn base_stations(&self) -> BTreeSet<AgentId> {
        self.agents.base_stations.iter().copied().map(AgentId).collect()
    }

    /// Checks what has to do with base stations; that they are agents is checked before.
    pub(super) fn check_base_stations(&self, checker: &Checker<'_>) -> Result<(), ScenarioError> {
        let stations = &self.agents.base_stations;
        for id in stations {
            let allowed = "expected agents that run a controller, and this one is in agents.cmd_vel";
            checker.require("agents.base_stations", id, !self.agents.cmd_vel.contains(id), allowed)?;
        }
        let allowed = format!("expected another controller: agents.base_stations has the agents with {BASE_STATION:?}");
        let agents = &self.agents;
        checker.require("agents.controller", &agents.controller, agents.controller != BASE_STATION, &allowed)?;
        for (number, MixEntry { controller, .. }) in agents.mix.iter().enumerate() {
            let key = format!("agents.mix[{number}].controller");
            checker.require(&key, controller, controller != BASE_STATION, &allowed)?;
        }
        let allowed = "expected only with agents.base_stations, which are to know the map";
        checker.require("stop_when_known_at_base", true, !self.stop_when_known_at_base || !stations.is_empty(), allowed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire;

    const TEXT: &str = "duration_s = 1.0\nseed = 1\nmap = { kind = \"spheres\", size = 20 }\n";

    fn parse(top: &str, agents: &str) -> Result<Scenario, String> {
        let text = format!("{TEXT}{top}\n[agents]\ncount = 5\n{agents}");
        Scenario::parse("s.toml", &text, &[]).map_err(|error| error.to_string())
    }

    #[test]
    fn stations_are_no_part_of_shares() {
        let mix = "base_stations = [0, 2]\ncontroller = \"dsvp\"\n[[agents.mix]]\nshare = 0.34\ncontroller = \"lvd\"\n";
        let agents = parse("", mix).unwrap().agents;
        let names: Vec<&str> = agents.controllers().iter().map(|choice| choice.controller).collect();
        assert_eq!(names, [BASE_STATION, "lvd", BASE_STATION, "dsvp", "dsvp"]);
        assert_eq!(wire::announced_settings(&agents), ["@1:lvd", "@0,2:base-station"]);
        assert_eq!(agents.controllers_label(), "agents 0 2 base-station, 34 % lvd, others dsvp");
        let alone = parse("", "base_stations = [4]").unwrap().agents;
        assert_eq!(alone.controllers_label(), "agents 4 base-station, others rbw");
    }

    #[test]
    fn identity_names_stations_only_if_there_are_any() {
        let without = parse("", "").unwrap().identity();
        assert!(!without.contains("base"), "{without}");
        let with = parse("stop_when_known_at_base = true", "base_stations = [1]").unwrap();
        assert_eq!(Scenario::parse("identity", &with.identity(), &[]).unwrap(), with);
    }

    #[test]
    fn impossible_stations_are_named() {
        let refused = |top: &str, agents: &str| parse(top, agents).unwrap_err();
        let beyond = refused("", "base_stations = [5]");
        assert!(beyond.ends_with("agents.base_stations = 5: expected ids of agents, 0 to 4"), "{beyond}");
        assert!(refused("", "base_stations = [1, 1]").ends_with("expected each id once"));
        assert!(refused("", "base_stations = [1]\ncmd_vel = [1]").ends_with("this one is in agents.cmd_vel"));
        let mixed = refused("", "base_stations = [1]\nmix = [{ controller = \"lvd\", ids = [1] }]");
        assert!(mixed.ends_with("this one is in agents.base_stations"), "{mixed}");
        assert!(refused("stop_when_known_at_base = true", "").contains("expected only with agents.base_stations"));
        let named = refused("", "controller = \"base-station\"");
        assert!(named.contains("agents.controller = base-station: expected another controller"), "{named}");
        let named = refused("", "mix = [{ controller = \"base-station\", ids = [1] }]");
        assert!(named.contains("agents.mix[0].controller = base-station: expected another controller"), "{named}");
    }
}
