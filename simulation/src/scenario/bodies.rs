//! `[[bodies]]`: agents with another body than that of `[body]`.
//!
//! This module checks nothing: see [`super::Scenario::parse`].

use std::collections::BTreeMap;

use msgs::ids::AgentId;
use protocol::body_model::{BodyKeys, BodyModel};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::{Scenario, one_line};

/// An entry of `[[bodies]]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "toml::Table")]
pub struct BodyEntry {
    /// Ids of the agents with this body.
    pub agents: Vec<u32>,
    /// The body; keys that are left out are those of `[body]`, or those of the kind if `[body]` is
    /// of another kind.
    #[serde(flatten)]
    pub keys: BodyKeys,
}

/// A table that is no entry of `[[bodies]]`.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("an entry of `bodies`: {0}")]
pub struct EntryError(String);

impl TryFrom<toml::Table> for BodyEntry {
    type Error = EntryError;

    fn try_from(mut table: toml::Table) -> Result<Self, EntryError> {
        let wrong = |error: toml::de::Error| EntryError(one_line(error.message()));
        let agents = table.remove("agents").ok_or_else(|| EntryError("missing field `agents`".to_owned()))?;
        Ok(Self { agents: agents.try_into().map_err(wrong)?, keys: table.try_into().map_err(wrong)? })
    }
}

impl Scenario {
    /// The bodies that differ from `[body]`, by agent.
    #[must_use]
    pub fn other_bodies(&self) -> BTreeMap<AgentId, BodyModel> {
        let of_entry = |entry: &BodyEntry| {
            let body = entry.keys.over(&self.body);
            entry.agents.iter().map(move |&agent| (AgentId(agent), body)).collect::<Vec<_>>()
        };
        self.bodies.iter().flat_map(of_entry).collect()
    }

    /// The bodies by agent.
    #[must_use]
    pub fn bodies_by_agent(&self) -> Vec<BodyModel> {
        let others = self.other_bodies();
        let body = |agent: u32| others.get(&AgentId(agent)).unwrap_or(&self.body);
        (0..self.agents.count).map(|agent| *body(agent)).collect()
    }

    /// Fills in the keys that the entries leave out.
    pub(super) fn complete_bodies(&mut self) {
        for entry in &mut self.bodies {
            entry.keys = BodyKeys::all(entry.keys.over(&self.body));
        }
    }
}
