//! The agent processes of a run: which agents each runs, and in which order they start.

use std::collections::BTreeSet;
use std::num::NonZero;
use std::thread;

use serde::{Deserialize, Serialize};
use simulation::scenario::Scenario;

use crate::SupervisorError;

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

/// Up to this many agents always have processes of their own, if the team is spread automatically.
const PROCESSES_MIN: u32 = 20;
/// Beyond, a core gets this many processes: more cost switches between them, and gain nothing.
const PROCESSES_PER_CORE: u32 = 5;
/// Agents of larger teams do not offer ROS parameters unless asked to: these take twelve endpoints
/// for each agent, which every participant has to discover.
const PARAMETERS_AGENTS_MAX: u32 = 20;

/// How the agents of a run are spread over processes. The result of a run does not depend on it.
#[derive(Debug, Clone, Default)]
pub struct Team {
    /// Agents in each process. If nothing is said: one, or more if the team is too large for the
    /// cores of this machine.
    pub per_process: Option<NonZero<u32>>,
    pub order: Order,
    /// Agents that start elsewhere. Those of the scenario's `agents.cmd_vel` are among them.
    pub third_party: BTreeSet<u32>,
    /// The longest random delay before each reply of an agent, ms.
    pub chaos_delay_ms: Option<u64>,
    /// Whether agents offer ROS parameters; decided by the size of the team, and by `agent_node`,
    /// if nothing is said.
    pub parameters: Option<bool>,
}

/// The agents of one process: the first and the last id.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub(crate) struct Group {
    pub(crate) first: u32,
    pub(crate) last: u32,
}

impl Group {
    /// The group of one agent.
    pub(crate) fn of(agent: u32) -> Self {
        Self { first: agent, last: agent }
    }

    /// The agents of the group that none of the others has, as groups, ascending.
    pub(crate) fn without<'g>(self, others: impl Iterator<Item = &'g Self> + Clone) -> Vec<Self> {
        let mut left: Vec<Self> = Vec::new();
        for agent in self.first..=self.last {
            if others.clone().any(|other| (other.first..=other.last).contains(&agent)) {
                continue;
            }
            match left.last_mut() {
                Some(group) if group.last + 1 == agent => group.last = agent,
                _ => left.push(Self::of(agent)),
            }
        }
        left
    }
}

impl Team {
    /// Whether the team can run this scenario.
    ///
    /// # Errors
    /// If an third-party agent is not in the run, or would share a process.
    pub fn check(&self, scenario: &Scenario) -> Result<(), SupervisorError> {
        let count = scenario.agents.count;
        if let Some(&agent) = self.third_party.iter().find(|&&agent| agent >= count) {
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
    fn all_third_party(&self, scenario: &Scenario) -> BTreeSet<u32> {
        let agents = &scenario.agents;
        let unstarted = agents.cmd_vel.iter().filter(|&&agent| !agents.is_commanded(agent));
        self.third_party.iter().chain(unstarted).copied().collect()
    }

    /// Whether some agents cannot share a process with the next ones.
    fn has_processes_of_one(&self, scenario: &Scenario) -> bool {
        let agents = &scenario.agents;
        let is_whole_team = agents.command_ids.is_empty() && agents.cmd_vel.is_empty();
        let has_mixed_programs = !(agents.command.is_empty() || is_whole_team && agents.command_signs);
        has_mixed_programs || agents.names_id() || !self.all_third_party(scenario).is_empty()
    }

    /// Whether agents offer ROS parameters, if that is decided here.
    pub(crate) fn parameters(&self, scenario: &Scenario) -> Option<bool> {
        self.parameters.or_else(|| (scenario.agents.count > PARAMETERS_AGENTS_MAX).then_some(false))
    }

    /// The agents that are started here.
    pub(crate) fn agents(&self, scenario: &Scenario) -> BTreeSet<u32> {
        let third_party = self.all_third_party(scenario);
        (0..scenario.agents.count).filter(|agent| !third_party.contains(agent)).collect()
    }

    /// The processes to start, in order.
    pub(crate) fn groups(&self, scenario: &Scenario) -> Vec<Group> {
        self.groups_on(scenario, thread::available_parallelism().map_or(1, NonZero::get))
    }

    /// The agents in each process on a machine with so many cores that runs so many agents.
    pub(crate) fn process_size(&self, scenario: &Scenario, agents: u32, cores: usize) -> u32 {
        if let Some(size) = self.per_process {
            return size.get();
        }
        // Programs from outside may know one id only.
        if !scenario.agents.command.is_empty() || self.has_processes_of_one(scenario) {
            return 1;
        }
        let cores = u32::try_from(cores).unwrap_or(u32::MAX);
        let processes = PROCESSES_PER_CORE.saturating_mul(cores).max(PROCESSES_MIN);
        agents.div_ceil(processes).max(1)
    }

    fn groups_on(&self, scenario: &Scenario, cores: usize) -> Vec<Group> {
        let count = scenario.agents.count;
        let size = self.process_size(scenario, count, cores);
        let third_party = self.all_third_party(scenario);
        let first_ids = (0..count).step_by(size as usize).filter(|first| !third_party.contains(first));
        let mut groups: Vec<Group> =
            first_ids.map(|first| Group { first, last: (count - 1).min(first + size - 1) }).collect();
        self.arrange(&mut groups);
        groups
    }

    /// Puts processes into the order in which they start.
    pub(crate) fn arrange<T>(&self, processes: &mut [T]) {
        match self.order {
            Order::Forward => {}
            Order::Reverse => processes.reverse(),
            // Without random numbers the order stays; no run depends on it.
            Order::Shuffle => processes.sort_by_cached_key(|_| getrandom::u64().unwrap_or_default()),
        }
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
    fn large_teams_share_processes() {
        let groups = |count: u32, cores| Team::default().groups_on(&scenario(&format!("count = {count}")), cores);
        let sizes = |count, cores| {
            let groups = groups(count, cores);
            let agents: Vec<u32> = groups.iter().flat_map(|group| group.first..=group.last).collect();
            assert_eq!(agents, (0..count).collect::<Vec<_>>(), "each agent has one process");
            (groups.len(), groups.iter().map(|group| group.last + 1 - group.first).max())
        };
        assert_eq!(sizes(20, 1), (20, Some(1)));
        assert_eq!(sizes(21, 2), (11, Some(2)));
        assert_eq!(sizes(100, 2), (20, Some(5)));
        assert_eq!(sizes(100, 64), (100, Some(1)));
        assert_eq!(sizes(1000, 2), (20, Some(50)));
        let alone = scenario("count = 100\ncmd_vel = [3]");
        assert_eq!(Team::default().groups_on(&alone, 2).len(), 99);
    }

    #[test]
    fn what_others_have_is_left_out_of_a_group() {
        let group = |first, last| Group { first, last };
        let without = |others: &[Group]| group(0, 4).without(others.iter());
        assert_eq!(without(&[group(5, 9)]), [group(0, 4)]);
        assert_eq!(without(&[group(0, 0), group(3, 3)]), [group(1, 2), group(4, 4)]);
        assert_eq!(without(&[group(0, 9)]), []);
    }

    #[test]
    fn large_teams_offer_no_parameters_unless_asked_to() {
        let of = |count: u32, parameters| {
            Team { parameters, ..Team::default() }.parameters(&scenario(&format!("count = {count}")))
        };
        assert_eq!(of(20, None), None);
        assert_eq!(of(21, None), Some(false));
        assert_eq!(of(21, Some(true)), Some(true));
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
        let team = Team { third_party: BTreeSet::from([1]), ..Team::default() };
        assert_eq!(ids(&team, "count = 4\ncmd_vel = [3]"), [(0, 0), (2, 2)]);
        let error = team.check(&scenario("count = 1")).unwrap_err();
        assert_eq!(error.to_string(), "--external 1: agent 1 is not in the run: ids are 0 to 0");
        let shared = Team { per_process: NonZero::new(2), ..Team::default() };
        assert!(shared.check(&scenario("count = 4")).is_ok());
        let error = shared.check(&scenario("count = 4\ncmd_vel = [3]")).unwrap_err();
        assert_eq!(
            error.to_string(),
            "--agents-per-process 2: expected 1 if some agents are third-party, or have a program of their own"
        );
    }
}
