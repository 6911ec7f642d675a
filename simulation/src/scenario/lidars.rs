//! `[[lidars]]`: several LiDARs on a body, in place of `[lidar]`.
//!
//! Each entry is a LiDAR with a name, of all agents or of some of them. Those of a body scan in the
//! same ticks, and a request of their agent is one to all of them.

use std::collections::BTreeMap;

use msgs::ids::AgentId;
use msgs::sensor_name::SensorName;
use serde::{Deserialize, Serialize};
use thiserror::Error;
use world::ScanSchedule;
use world::lidar::{NamedScanner, SensorSuite};

use super::lidar::{GRID_RAYS_MAX, LidarKeys};
use super::{Checker, LidarSchedule, LidarSection, Scenario, ScenarioError, one_line};

/// Most entries, and so most LiDARs of a body.
const LIDARS_MAX: usize = 64;

/// Most LiDARs of all agents together, where bodies have several: their frames, two of each camera,
/// are announced at once.
const TEAM_LIDARS_MAX: usize = 1024;

/// An entry of `[[lidars]]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "toml::Table")]
pub struct LidarEntry {
    /// Its name on the bodies that have it.
    pub name: SensorName,
    /// Ids of the agents that have it; empty: all.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub agents: Vec<u32>,
    /// The LiDAR.
    #[serde(flatten)]
    pub lidar: LidarSection,
}

/// A table that is no entry of `[[lidars]]`.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("an entry of `lidars`: {0}")]
pub struct LidarEntryError(String);

impl TryFrom<toml::Table> for LidarEntry {
    type Error = LidarEntryError;

    fn try_from(mut table: toml::Table) -> Result<Self, LidarEntryError> {
        let wrong = |error: toml::de::Error| LidarEntryError(one_line(error.message()));
        let name = table.remove("name").ok_or_else(|| LidarEntryError("missing field `name`".to_owned()))?;
        let agents = table.remove("agents").map(toml::Value::try_into).transpose().map_err(wrong)?;
        if agents.as_ref().is_some_and(Vec::is_empty) {
            return Err(LidarEntryError(
                "agents = []: expected at least one id of an agent, or no `agents` for all".to_owned(),
            ));
        }
        let keys: LidarKeys = table.try_into().map_err(wrong)?;
        let name: String = name.try_into().map_err(wrong)?;
        let name: SensorName = name.parse().map_err(|error| LidarEntryError(format!("name = {error}")))?;
        let lidar = LidarSection::try_from(keys).map_err(|error| {
            let preset = error.preset;
            LidarEntryError(format!(
                "that of the name \"{name}\" has the preset \"{preset}\" and another pattern; expected no pattern beside a preset"
            ))
        })?;
        Ok(Self { name, agents: agents.unwrap_or_default(), lidar })
    }
}

impl LidarEntry {
    /// Whether an agent has it.
    fn is_of(&self, agent: u32) -> bool {
        self.agents.is_empty() || self.agents.contains(&agent)
    }
}

/// When the LiDARs of a team scan.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ScanTiming {
    /// Who decides when to scan.
    pub schedule: LidarSchedule,
    /// Ticks between two scans until an agent requests otherwise.
    pub period_ticks: u32,
}

impl ScanTiming {
    fn of(lidar: &LidarSection) -> Self {
        Self { schedule: lidar.schedule, period_ticks: lidar.period_ticks }
    }

    /// The schedule of the world.
    #[must_use]
    pub fn schedule(&self) -> ScanSchedule {
        match self.schedule {
            LidarSchedule::OnRequest => ScanSchedule::OnRequest { period_ticks: self.period_ticks },
            LidarSchedule::Maes3d => ScanSchedule::TakeTurns,
        }
    }
}

impl Scenario {
    /// The LiDARs, each once, with their names if there are `[[lidars]]`.
    pub fn lidars(&self) -> impl Iterator<Item = (Option<SensorName>, &LidarSection)> {
        let named = self.lidars.iter().flatten().map(|entry| (Some(entry.name), &entry.lidar));
        self.lidar.iter().map(|only| (None, only)).chain(named)
    }

    /// The LiDARs of an agent, in their order.
    pub fn lidars_of(&self, agent: AgentId) -> impl Iterator<Item = (Option<SensorName>, &LidarSection)> {
        let entries = self.lidars.iter().flatten().filter(move |entry| entry.is_of(agent.0));
        self.lidar.iter().map(|only| (None, only)).chain(entries.map(|entry| (Some(entry.name), &entry.lidar)))
    }

    /// When the LiDARs scan.
    #[must_use]
    pub fn scan_timing(&self) -> ScanTiming {
        let first = self.lidars().next().map(|(_, lidar)| ScanTiming::of(lidar));
        first.unwrap_or_else(|| ScanTiming::of(&LidarSection::default()))
    }

    /// The LiDARs of the first agent, and those of the agents that have others.
    ///
    /// # Panics
    /// Never: each agent of a scenario has a LiDAR.
    #[must_use]
    pub fn sensors(&self) -> (SensorSuite, BTreeMap<AgentId, SensorSuite>) {
        let entries = self.lidars.as_deref().unwrap_or_default();
        let suite = |has: &[bool]| {
            let has = has.iter().copied().chain(std::iter::repeat(true));
            let own = self.lidars().zip(has).filter(|(_, is_own)| *is_own);
            let lidars = own.map(|((name, lidar), _)| NamedScanner { name, scanner: lidar.scanner() });
            SensorSuite::new(lidars.collect()).expect("each agent has a LiDAR")
        };
        let has = |agent: u32| entries.iter().map(|entry| entry.is_of(agent)).collect::<Vec<bool>>();
        let first = suite(&has(0));
        let mut known = vec![(has(0), first.clone())];
        let mut others = BTreeMap::new();
        for agent in 1..self.agents.count {
            let has = has(agent);
            let index = known.iter().position(|(other, _)| *other == has).unwrap_or_else(|| {
                known.push((has.clone(), suite(&has)));
                known.len() - 1
            });
            if index > 0 {
                others.insert(AgentId(agent), known[index].1.clone());
            }
        }
        (first, others)
    }

    /// Fills in the LiDAR of a scenario that declares none.
    pub(super) fn complete_lidars(&mut self) {
        if self.lidars.is_none() {
            self.lidar.get_or_insert_default();
        }
    }

    pub(super) fn check_lidars(&self, checker: &Checker<'_>) -> Result<(), ScenarioError> {
        let radii_m: Vec<f64> = self.bodies_by_agent().into_iter().map(|body| body.radius_m).collect();
        let smallest_m = |is_of: &dyn Fn(u32) -> bool| {
            let own = (0..).zip(&radii_m).filter(|(agent, _)| is_of(*agent));
            own.map(|(_, radius_m)| *radius_m).fold(f64::INFINITY, f64::min)
        };
        if let Some(only) = &self.lidar {
            Self::check_lidar(checker, "lidar", only, smallest_m(&|_| true))?;
        }
        let Some(entries) = &self.lidars else { return Ok(()) };
        let count = format!("{} entries", entries.len());
        checker.require("lidars", &count, self.lidar.is_none(), "expected [lidar] or [[lidars]], not both")?;
        let allowed = format!("expected 1 to {LIDARS_MAX} entries, or [lidar] instead");
        checker.require("lidars", &count, (1..=LIDARS_MAX).contains(&entries.len()), &allowed)?;
        let last = self.agents.count - 1;
        for (number, entry) in entries.iter().enumerate() {
            let key = format!("lidars[{number}]");
            for (place, &id) in entry.agents.iter().enumerate() {
                let agents = format!("{key}.agents");
                checker.require(&agents, id, id <= last, &format!("expected ids of agents, 0 to {last}"))?;
                let is_first = !entry.agents[..place].contains(&id);
                checker.require(&agents, id, is_first, "expected each agent once")?;
            }
            let same = entries[..number].iter().position(|other| other.name == entry.name);
            let shared = same.and_then(|other| {
                let has_both = |&agent: &u32| entry.is_of(agent) && entries[other].is_of(agent);
                Some((other, (0..=last).find(has_both)?))
            });
            if let Some((other, agent)) = shared {
                let allowed = format!("expected another name, as agent {agent} has that of lidars[{other}] already");
                checker.require(&format!("{key}.name"), format!("\"{}\"", entry.name), false, &allowed)?;
            }
            Self::check_lidar(checker, &key, &entry.lidar, smallest_m(&|agent| entry.is_of(agent)))?;
            self.check_timing(checker, &key, &entry.lidar)?;
        }
        let rays: u64 = entries.iter().map(|entry| u64::from(entry.lidar.rays())).sum();
        let allowed = format!("expected at most {GRID_RAYS_MAX} rays of all entries together");
        checker.require("lidars", format!("{rays} rays"), rays <= GRID_RAYS_MAX.into(), &allowed)?;
        let of_agent = |agent: u32| entries.iter().filter(|entry| entry.is_of(agent)).count();
        let without = (0..=last).find(|&agent| of_agent(agent) == 0);
        let allowed = "expected at least one LiDAR of each agent: an entry without `agents` is one of all";
        let value = without.map_or_else(String::new, |agent| format!("none of agent {agent}"));
        checker.require("lidars", value, without.is_none(), allowed)?;
        let team: usize = (0..=last).map(of_agent).sum();
        let allowed = format!("expected at most {TEAM_LIDARS_MAX} LiDARs of all agents together");
        checker.require("lidars", format!("{team} LiDARs"), team <= TEAM_LIDARS_MAX, &allowed)
    }

    /// Refuses an entry that scans at other times than the first one.
    fn check_timing(&self, checker: &Checker<'_>, key: &str, lidar: &LidarSection) -> Result<(), ScenarioError> {
        let (first, own) = (self.scan_timing(), ScanTiming::of(lidar));
        let allowed = format!("expected {}, as lidars[0] has: LiDARs scan together", first.period_ticks);
        let holds = own.period_ticks == first.period_ticks;
        checker.require(&format!("{key}.period_ticks"), own.period_ticks, holds, &allowed)?;
        let allowed = "expected that of lidars[0]: LiDARs scan together";
        let word = match own.schedule {
            LidarSchedule::OnRequest => "\"on_request\"",
            LidarSchedule::Maes3d => "\"maes3d\"",
        };
        checker.require(&format!("{key}.schedule"), word, own.schedule == first.schedule, allowed)
    }
}

#[cfg(test)]
mod tests;
