//! `[[agents.mix]]`: teams in which some agents run another controller than `agents.controller`.
//!
//! Invariants: each agent has one controller; shares are cut along the ascending ids of the agents
//! that run controllers, so that the numbers of agents differ from the shares by less than one and
//! add up to the team.
//!
//! Whether there are such controllers, and whether they have these settings, is checked where they
//! are built.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::base_stations::BASE_STATION_CHOICE;
use super::{AgentsSection, Checker, ScenarioError};

/// Rounding errors of shares that add up to 1.
const SHARES_TOLERANCE: f64 = 1e-9;

/// An entry of `[[agents.mix]]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MixEntry {
    /// Controller of these agents.
    pub controller: String,
    /// Which part of the agents, 0 to 1; `None`: those of `ids`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub share: Option<f64>,
    /// Ids of the agents; empty: as many as `share` says.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub ids: Vec<u32>,
    /// Settings of the controller.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub set: BTreeMap<String, toml::Value>,
}

/// The controller of an agent with its settings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ControllerChoice<'a> {
    /// Name of the controller.
    pub controller: &'a str,
    /// Its settings that are not defaults.
    pub set: &'a BTreeMap<String, toml::Value>,
}

impl AgentsSection {
    /// The controller of each agent, by id. Those of agents that are externally controlled have no
    /// effect.
    #[must_use]
    pub fn controllers(&self) -> Vec<ControllerChoice<'_>> {
        let choice = |entry: Option<&'_ usize>| match entry {
            Some(&entry) => ControllerChoice { controller: &self.mix[entry].controller, set: &self.mix[entry].set },
            None => ControllerChoice { controller: &self.controller, set: &self.set },
        };
        let entries = self.entry_of_each();
        let of = |agent| if self.is_base_station(agent) { BASE_STATION_CHOICE } else { choice(entries.get(&agent)) };
        (0..self.count).map(of).collect()
    }

    /// The different controllers, with their settings, of those agents for which `counts` holds.
    pub fn controllers_of(&self, counts: impl Fn(u32) -> bool) -> Vec<ControllerChoice<'_>> {
        let mut different = Vec::new();
        for (agent, choice) in (0..).zip(self.controllers()) {
            if counts(agent) && !different.contains(&choice) {
                different.push(choice);
            }
        }
        different
    }

    /// The ids of the agents of each entry of the mix, ascending.
    #[must_use]
    pub fn mixed_ids(&self) -> Vec<Vec<u32>> {
        let mut ids = vec![Vec::new(); self.mix.len()];
        for (agent, entry) in self.entry_of_each() {
            ids[entry].push(agent);
        }
        ids
    }

    /// The controllers of the team in one line, such as `40 % lvd, others rbw`.
    #[must_use]
    pub fn controllers_label(&self) -> String {
        let part = |entry: &MixEntry| {
            let set: String = entry.set.iter().map(|(key, value)| format!(" {key}={value}")).collect();
            let whose = match entry.share {
                Some(share) => format!("{} %", (share * 1e4).round() / 1e2),
                None => format!("agents {}", entry.ids.iter().map(u32::to_string).collect::<Vec<_>>().join(" ")),
            };
            format!("{whose} {}{set}", entry.controller)
        };
        if self.mix.is_empty() && self.base_stations.is_empty() {
            return self.controller.clone();
        }
        let parts: Vec<String> = self.base_stations_label().into_iter().chain(self.mix.iter().map(part)).collect();
        let elsewhere = self.entry_of_each().len() + self.cmd_vel.len() + self.base_stations.len();
        let has_others = elsewhere < self.count as usize;
        let others = if has_others { format!(", others {}", self.controller) } else { String::new() };
        parts.join(", ") + &others
    }

    /// By agent, the index of its entry in the mix.
    fn entry_of_each(&self) -> BTreeMap<u32, usize> {
        let deciding: Vec<u32> = (0..self.count).filter(|&agent| self.runs_controller(agent)).collect();
        let mut entries = BTreeMap::new();
        let mut before = 0.0;
        let place = |share: f64| (libm::round(share * deciding.len() as f64) as usize).min(deciding.len());
        for (number, entry) in self.mix.iter().enumerate() {
            match entry.share {
                Some(share) => {
                    let end = before + share;
                    entries.extend(deciding[place(before)..place(end)].iter().map(|&agent| (agent, number)));
                    before = end;
                }
                None => entries.extend(entry.ids.iter().map(|&agent| (agent, number))),
            }
        }
        entries
    }

    fn runs_controller(&self, agent: u32) -> bool {
        (self.is_commanded(agent) || !self.cmd_vel.contains(&agent)) && !self.is_base_station(agent)
    }

    /// Checks the mix; `count` is checked before.
    pub(super) fn check_mix(&self, checker: &Checker<'_>) -> Result<(), ScenarioError> {
        // Where they are announced, a key with this sign stands for other agents.
        for key in self.set.keys() {
            let allowed = "expected a key that does not begin with @";
            checker.require(&format!("agents.set.{key}"), key, !key.starts_with('@'), allowed)?;
        }
        let mut entry_of: BTreeMap<u32, usize> = BTreeMap::new();
        let mut shares = 0.0;
        for (number, entry) in self.mix.iter().enumerate() {
            let of = |name: &str| format!("agents.mix[{number}].{name}");
            let name = &entry.controller;
            let is_word = |byte: u8| byte.is_ascii_alphanumeric() || b"-_".contains(&byte);
            let is_name = !name.is_empty() && name.bytes().all(is_word);
            let allowed = "expected the name of a controller: letters, digits, - and _";
            checker.require(&of("controller"), format!("\"{name}\""), is_name, allowed)?;
            let is_of_one_kind = entry.share.is_some() == self.mix[0].share.is_some();
            let (Some(share), true) = (entry.share, entry.ids.is_empty() && is_of_one_kind) else {
                if entry.share.is_some() || entry.ids.is_empty() || !is_of_one_kind {
                    let allowed = "expected either a share or a list of ids, the same in all entries";
                    let value = match entry.share {
                        Some(share) => format!("{share}, ids = {:?}", entry.ids),
                        None => format!("nothing, ids = {:?}", entry.ids),
                    };
                    return Err(checker.error_from(&format!("agents.mix[{number}]"), &of("share"), value, allowed));
                }
                for &agent in &entry.ids {
                    let last = self.count - 1;
                    let ids = format!("expected ids of agents, 0 to {last}");
                    checker.require(&of("ids"), agent, agent <= last, &ids)?;
                    let list = if self.is_base_station(agent) { "agents.base_stations" } else { "agents.cmd_vel" };
                    let runs = format!("expected agents that run a controller, and this one is in {list}");
                    checker.require(&of("ids"), agent, self.runs_controller(agent), &runs)?;
                    if let Some(other) = entry_of.insert(agent, number) {
                        let once = format!("expected each agent once, and it is in agents.mix[{other}] already");
                        checker.require(&of("ids"), agent, false, &once)?;
                    }
                }
                continue;
            };
            shares += share;
            let allowed = format!("expected shares of at most 1 taken together, here {shares}");
            checker.require(&of("share"), share, shares <= 1.0 + SHARES_TOLERANCE, &allowed)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use crate::scenario::{Override, Scenario};
    use crate::wire;

    const TEXT: &str = "seed = 1\nduration_s = 1.0\n[map]\nkind = \"spheres\"\nsize = 20\n[agents]\n";

    fn parse(keys: &str) -> Result<Scenario, String> {
        Scenario::parse("s.toml", &format!("{TEXT}{keys}"), &[] as &[Override]).map_err(|error| error.to_string())
    }

    fn controllers(keys: &str) -> String {
        let scenario = parse(keys).unwrap();
        scenario.agents.controllers().iter().map(|choice| choice.controller).collect::<Vec<_>>().join(" ")
    }

    #[test]
    fn shares_are_cut_along_the_ids() {
        let of = |count: u32, shares: &str| {
            let entries = shares.split(' ').zip(["a", "b"]);
            let entries = entries.map(|(share, name)| format!("{{ share = {share}, controller = \"{name}\" }}"));
            let mix = entries.collect::<Vec<_>>().join(", ");
            controllers(&format!("count = {count}\ncontroller = \"c\"\nmix = [{mix}]"))
        };
        assert_eq!(of(5, "0.4"), "a a c c c");
        assert_eq!(of(3, "0.5 0.5"), "a a b");
        assert_eq!(of(1, "0.5 0.5"), "a");
        assert_eq!(of(4, "0 1"), "b b b b");
        assert_eq!(of(10, "0.1 0.2"), "a b b c c c c c c c");
        assert_eq!(
            controllers("count = 3\ncmd_vel = [0]\nmix = [{ share = 0.5, controller = \"a\" }]"),
            "rbw a rbw",
            "agents without a controller do not count"
        );
    }

    #[test]
    fn listed_agents_run_their_controller() {
        let keys = "count = 4\nmix = [{ ids = [3, 1], controller = \"a\" }, { ids = [0], controller = \"b\" }]";
        assert_eq!(controllers(keys), "b a rbw a");
        let scenario = parse(keys).unwrap();
        assert_eq!(scenario.agents.mixed_ids(), [vec![1, 3], vec![0]]);
        assert_eq!(scenario.agents.controllers_of(|agent| agent != 0).len(), 2);
        assert_eq!(scenario.agents.controllers_label(), "agents 3 1 a, agents 0 b, others rbw");
    }

    #[test]
    fn uniform_team_keeps_its_identity() {
        let identity = parse("count = 2").unwrap().identity();
        assert!(!identity.contains("mix"), "{identity}");
        let mixed = parse("count = 2\n[[agents.mix]]\nshare = 0.5\ncontroller = \"lvd\"\nset.k = 2").unwrap();
        assert_eq!(Scenario::parse("identity", &mixed.identity(), &[]).unwrap().agents, mixed.agents);
        assert_eq!(mixed.agents.controllers_label(), "50 % lvd k=2, others rbw");
    }

    #[test]
    fn errors_name_the_key() {
        let refused = |mix: &str| parse(&format!("count = 3\ncmd_vel = [2]\nmix = [{mix}]")).unwrap_err();
        for (mix, expected) in [
            ("{ share = 0.5 }", "missing key `agents.mix[0].controller`: expected a text in quotes"),
            ("{ share = 1.5, controller = \"a\" }", "agents.mix[0].share = 1.5: expected 0 to 1"),
            ("{ controller = \"a\" }", "agents.mix[0].share = nothing, ids = []: expected either a share or a list"),
            ("{ share = 0.5, ids = [1], controller = \"a\" }", "agents.mix[0].share = 0.5, ids = [1]: expected"),
            ("{ share = 0.5, controller = \"a b\" }", "agents.mix[0].controller = \"a b\": expected the name"),
            ("{ ids = [3], controller = \"a\" }", "agents.mix[0].ids = 3: expected ids of agents, 0 to 2"),
            ("{ ids = [2], controller = \"a\" }", "agents.mix[0].ids = 2: expected agents that run a controller"),
            ("{ ids = [1, 1], controller = \"a\" }", "agents.mix[0].ids = 1: expected each agent once"),
            (
                "{ share = 0.6, controller = \"a\" }, { share = 0.5, controller = \"b\" }",
                "agents.mix[1].share = 0.5: expected shares of at most 1 taken together, here 1.1",
            ),
            (
                "{ share = 0.6, controller = \"a\" }, { ids = [1], controller = \"b\" }",
                "agents.mix[1].share = nothing, ids = [1]: expected either a share or a list",
            ),
            ("{ shares = 0.6, controller = \"a\" }", "unknown key `agents.mix[0].shares`; did you mean"),
        ] {
            let error = refused(mix);
            assert!(error.contains(expected), "{mix}: {error}");
        }
        let wrong = parse("count = 3\nmix = \"lvd\"").unwrap_err();
        assert!(wrong.contains("agents.mix = \"lvd\": expected a list of tables: [[agents.mix]]"), "{wrong}");
        let reserved = parse("count = 3\nset = { \"@0\" = 1 }").unwrap_err();
        assert!(reserved.contains("expected a key that does not begin with @"), "{reserved}");
    }

    #[test]
    fn mix_is_announced_and_may_change() {
        let keys = "count = 5\nset.k = 1\nmix = [{ ids = [0, 1, 2, 4], controller = \"lvd\", set = { t = \"x y\" } }]";
        let scenario = parse(keys).unwrap();
        assert_eq!(wire::announced_settings(&scenario.agents), ["k=1", "@0-2,4:lvd", "@0-2,4:t=x y"]);
        let event = "\n[[event]]\nat_s = 0.5\nkind = \"set\"\n[event.set]\n\"agents.mix\" = ";
        let phases = |mix: &str| parse(&format!("{keys}{event}{mix}")).map(|scenario| scenario.phases());
        assert_eq!(phases("[]").unwrap()[1].agents.controllers_label(), "rbw");
        assert!(phases("[{ share = 2.0, controller = \"a\" }]").unwrap_err().contains("expected 0 to 1"));
    }
}
