//! Who runs the agents of a scenario: `agent_node` with its controllers, a program of the user
//! (`agents.command`), or nodes that speak standard messages (`agents.cmd_vel`).
//!
//! Nothing is started here.

use super::{AgentsSection, Checker, ScenarioError};

/// Stands for the id of an agent in the arguments of `agents.command`.
pub const ID_MARK: &str = "{id}";

impl AgentsSection {
    /// Whether `command` runs this agent.
    #[must_use]
    pub fn is_commanded(&self, agent: u32) -> bool {
        !self.command.is_empty() && (self.command_ids.is_empty() || self.command_ids.contains(&agent))
    }

    /// Whether `agent_node` runs this agent, with one of its controllers.
    #[must_use]
    pub fn is_built_in(&self, agent: u32) -> bool {
        !self.is_commanded(agent) && !self.cmd_vel.contains(&agent)
    }

    /// The ids of the agents that `command` runs, ascending.
    pub fn with_own_command(&self) -> impl Iterator<Item = u32> + '_ {
        (0..self.count).filter(|&agent| self.is_commanded(agent))
    }

    /// Whether the program of `command` is based on `agent_node`: so that a run in memory can start
    /// it as well. Other programs name the id in their arguments, or do not sign.
    #[must_use]
    pub fn is_command_a_node(&self) -> bool {
        self.command_signs && !self.command.is_empty() && !self.names_id()
    }

    /// Whether the arguments of `command` say where the id goes; otherwise they are those of
    /// `agent_node`.
    #[must_use]
    pub fn names_id(&self) -> bool {
        self.command.iter().any(|word| word.contains(ID_MARK))
    }

    /// The first key that needs ROS 2, and its value; a program based on `agent_node` does not,
    /// where programs may be started.
    #[must_use]
    pub fn of_ros_only(&self, starts_programs: bool) -> Option<(&'static str, String)> {
        if !(self.command.is_empty() || starts_programs && self.is_command_a_node()) {
            Some(("agents.command", format!("{:?}", self.command)))
        } else if !self.cmd_vel.is_empty() {
            Some(("agents.cmd_vel", format!("{:?}", self.cmd_vel)))
        } else {
            None
        }
    }
}

impl AgentsSection {
    /// Checks the lists of ids, and the command.
    pub(super) fn check(&self, checker: &Checker<'_>) -> Result<(), ScenarioError> {
        let Self { count, cmd_vel, reserve, base_stations, command, command_ids, command_signs, .. } = self;
        let lists = [
            ("agents.cmd_vel", cmd_vel),
            ("agents.reserve", reserve),
            ("agents.command_ids", command_ids),
            ("agents.base_stations", base_stations),
        ];
        for (key, ids) in lists {
            for (place, &id) in ids.iter().enumerate() {
                let allowed = format!("expected ids of agents, 0 to {}", count - 1);
                checker.require(key, id, id < *count, &allowed)?;
                checker.require(key, id, !ids[..place].contains(&id), "expected each id once")?;
            }
        }
        let Some(program) = command.first() else {
            let only = "expected only with agents.command: name the program, or leave this key out";
            checker.require("agents.command_ids", format!("{command_ids:?}"), command_ids.is_empty(), only)?;
            return checker.require("agents.command_signs", command_signs, *command_signs, only);
        };
        let is_text = command.iter().all(|word| !word.contains(char::is_control));
        let allowed = "expected a program and its arguments, without control characters";
        checker.require("agents.command", format!("{command:?}"), is_text && !program.is_empty(), allowed)
    }
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde hands out references")]
pub(super) fn is_yes(value: &bool) -> bool {
    *value
}

#[cfg(test)]
mod tests {
    use crate::scenario::{Override, Scenario};

    const TEXT: &str = "seed = 1\nduration_s = 1.0\n[map]\nkind = \"spheres\"\nsize = 20\n[agents]\ncount = 3\n";

    fn parse(keys: &str) -> Result<Scenario, String> {
        Scenario::parse("s.toml", &format!("{TEXT}{keys}"), &[] as &[Override]).map_err(|error| error.to_string())
    }

    #[test]
    fn command_runs_all_agents_or_those_listed() {
        let ids = |keys: &str| parse(keys).unwrap().agents.with_own_command().collect::<Vec<_>>();
        assert!(ids("").is_empty());
        assert_eq!(ids("command = [\"./a\"]"), [0, 1, 2]);
        assert_eq!(ids("command = [\"./a\"]\ncommand_ids = [2, 0]"), [0, 2]);
        let built_in = |keys: &str| {
            let agents = parse(keys).unwrap().agents;
            (0..3).filter(|&agent| agents.is_built_in(agent)).collect::<Vec<_>>()
        };
        assert_eq!((built_in(""), built_in("command = [\"./a\"]\ncommand_ids = [2, 0]")), (vec![0, 1, 2], vec![1]));
        assert_eq!((built_in("command = [\"./a\"]"), built_in("cmd_vel = [0, 2]")), (vec![], vec![1]));
    }

    #[test]
    fn command_is_part_of_the_identity_if_there_is_one() {
        assert!(!parse("").unwrap().identity().contains("command"));
        let identity = parse("command = [\"./a\", \"-x\"]").unwrap().identity();
        assert!(identity.contains("command = [\"./a\", \"-x\"]\n"), "{identity}");
    }

    #[test]
    fn errors_name_the_key() {
        let refused = |keys: &str| parse(keys).unwrap_err();
        assert!(refused("command_ids = [1]").contains("agents.command_ids = [1]: expected only with agents.command"));
        assert!(refused("command_signs = false").contains("agents.command_signs = false: expected only with"));
        assert!(refused("reserve = [1, 1]").contains("agents.reserve = 1: expected each id once"));
        let event = "reserve = [1]\n[[event]]\nat_s = 0.5\nkind = \"leave\"\nagent = 1\n";
        assert!(refused(event).contains("event[0].agent = 1: expected an agent that is not in agents.reserve"));
        let missing = refused("command = [\"a\"]\ncommand_ids = [3]");
        assert!(missing.contains("agents.command_ids = 3: expected ids of agents, 0 to 2"), "{missing}");
        assert!(refused("command = [\"\"]").contains("agents.command = [\"\"]: expected a program"));
        let newline = refused("command = [\"a\", \"b\\nc\"]");
        assert!(newline.contains("without control characters") && !newline.contains('\n'), "{newline}");
        assert!(refused("command = \"a\"").contains("expected a list of texts such as"));
    }
}
