//! The agent processes of a run: which agents each runs, and in which order they start.

use std::collections::BTreeSet;
use std::num::NonZero;

use simulation::scenario::Scenario;

use crate::{SupervisorError, outside};

/// The order in which agent processes start.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Order {
    /// By ascending id.
    #[default]
    Forward,
    /// By descending id.
    Reverse,
    /// At random.
    Shuffle,
}

/// How the agents of a run are spread over processes.
#[derive(Debug, Clone, Default)]
pub struct Team {
    /// Agents in each process; one if nothing is said.
    pub per_process: Option<NonZero<u32>>,
    pub order: Order,
    /// Agents that start elsewhere. Those of the scenario's `agents.cmd_vel` are among them.
    pub external: BTreeSet<u32>,
    /// The longest random delay before each reply of an agent, ms.
    pub chaos_delay_ms: Option<u64>,
    /// Whether agents offer ROS parameters; decided by `agent_node` if nothing is said.
    pub parameters: Option<bool>,
}

/// The agents of one process: the first and the last id.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Group {
    pub(crate) first: u32,
    pub(crate) last: u32,
}

impl Team {
    /// Whether the team can run this scenario.
    ///
    /// # Errors
    /// If an external agent does not take part, or would share a process.
    pub fn check(&self, scenario: &Scenario) -> Result<(), SupervisorError> {
        let count = scenario.agents.count;
        if let Some(&agent) = self.external.iter().find(|&&agent| agent >= count) {
            return Err(SupervisorError::UnknownExternal { agent, count });
        }
        match self.per_process {
            Some(shared) if shared.get() > 1 && self.has_processes_of_one(scenario) => {
                Err(SupervisorError::SharedProcess(shared.get()))
            }
            _ => Ok(()),
        }
    }

    /// The agents that are started elsewhere.
    fn all_external(&self, scenario: &Scenario) -> BTreeSet<u32> {
        let agents = &scenario.agents;
        let unstarted = agents.cmd_vel.iter().filter(|&&agent| !agents.is_commanded(agent));
        self.external.iter().chain(unstarted).copied().collect()
    }

    /// Whether some agents cannot share a process with the next ones.
    fn has_processes_of_one(&self, scenario: &Scenario) -> bool {
        let agents = &scenario.agents;
        let is_whole_team = agents.command_ids.is_empty() && agents.cmd_vel.is_empty();
        let has_mixed_programs = !(agents.command.is_empty() || is_whole_team && agents.command_signs);
        has_mixed_programs || outside::names_id(agents) || !self.all_external(scenario).is_empty()
    }

    /// The processes to start, in order.
    pub(crate) fn groups(&self, scenario: &Scenario) -> Vec<Group> {
        let count = scenario.agents.count;
        let size = self.per_process.map_or(1, NonZero::get);
        let external = self.all_external(scenario);
        let first_ids = (0..count).step_by(size as usize).filter(|first| !external.contains(first));
        let mut groups: Vec<Group> =
            first_ids.map(|first| Group { first, last: (count - 1).min(first + size - 1) }).collect();
        match self.order {
            Order::Forward => {}
            Order::Reverse => groups.reverse(),
            // Without random numbers the order stays; no run depends on it.
            Order::Shuffle => groups.sort_by_cached_key(|_| getrandom::u64().unwrap_or_default()),
        }
        groups
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scenario(agents: &str) -> Scenario {
        let text = format!("seed = 1\nduration_s = 1.0\n[map]\nkind = \"spheres\"\nsize = 20\n[agents]\n{agents}\n");
        Scenario::parse("s.toml", &text, &[]).unwrap()
    }

    fn ids(team: &Team, agents: &str) -> Vec<(u32, u32)> {
        team.groups(&scenario(agents)).into_iter().map(|group| (group.first, group.last)).collect()
    }

    #[test]
    fn agents_are_spread_over_processes() {
        let by_two = Team { per_process: NonZero::new(2), ..Team::default() };
        assert_eq!(ids(&Team::default(), "count = 3"), [(0, 0), (1, 1), (2, 2)]);
        assert_eq!(ids(&by_two, "count = 5"), [(0, 1), (2, 3), (4, 4)]);
        let reverse = Team { order: Order::Reverse, ..by_two.clone() };
        assert_eq!(ids(&reverse, "count = 5"), [(4, 4), (2, 3), (0, 1)]);
        let mut shuffled = ids(&Team { order: Order::Shuffle, ..by_two }, "count = 5");
        shuffled.sort_unstable();
        assert_eq!(shuffled, [(0, 1), (2, 3), (4, 4)]);
    }

    #[test]
    fn programs_from_outside_are_started() {
        let alone = Team::default();
        assert_eq!(ids(&alone, "count = 3\ncmd_vel = [1]\ncommand = [\"a\", \"{id}\"]"), [(0, 0), (1, 1), (2, 2)]);
        assert_eq!(ids(&alone, "count = 2\ncmd_vel = [1]\ncommand = [\"a\"]\ncommand_ids = [0]"), [(0, 0)]);
        let shared = Team { per_process: NonZero::new(2), ..Team::default() };
        assert!(shared.check(&scenario("count = 4\ncommand = [\"./a\"]")).is_ok());
        for own in ["command = [\"a\", \"{id}\"]", "command = [\"a\"]\ncommand_ids = [1]"] {
            assert!(shared.check(&scenario(&format!("count = 4\n{own}"))).is_err(), "{own}");
        }
    }

    #[test]
    fn external_agents_are_not_started() {
        let team = Team { external: BTreeSet::from([1]), ..Team::default() };
        assert_eq!(ids(&team, "count = 4\ncmd_vel = [3]"), [(0, 0), (2, 2)]);
        let error = team.check(&scenario("count = 1")).unwrap_err();
        assert_eq!(error.to_string(), "--external 1: agent 1 does not take part: ids are 0 to 0");
        let shared = Team { per_process: NonZero::new(2), ..Team::default() };
        assert!(shared.check(&scenario("count = 4")).is_ok());
        let error = shared.check(&scenario("count = 4\ncmd_vel = [3]")).unwrap_err();
        assert_eq!(
            error.to_string(),
            "--agents-per-process 2: expected 1 if some agents are external, or have a program of their own"
        );
    }
}
