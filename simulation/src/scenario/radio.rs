//! The table `[communication]`, with its defaults and checks: line of sight, and radios that are perfect.

use msgs::limits::{PARCEL_BYTES_MAX, RELAYS_PER_AGENT_MAX};
use msgs::maes_msgs;
use serde::{Deserialize, Serialize};

use super::{Checker, ScenarioError};
use crate::world::comms::{Comms, ContactModel, PathLoss};

/// Bytes that wait at an agent to be sent, if nothing is said.
const QUEUE_BYTES: u64 = 1 << 20;

/// `[communication]`. Keys that are as by default are not part of what identifies a run.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CommunicationSection {
    /// Greatest distance between two agents in contact; `inf`: unlimited (reference).
    pub range_m: f64,
    /// When two agents are in contact.
    #[serde(skip_serializing_if = "is_default")]
    pub model: CommunicationModel,
    /// Probability that a parcel is lost on its way to one receiver.
    #[serde(skip_serializing_if = "is_default")]
    pub loss: f64,
    /// What each agent can send; `inf`: unlimited.
    #[serde(skip_serializing_if = "is_unlimited")]
    pub bytes_per_s: f64,
    /// What waits at an agent to be sent, at the most.
    #[serde(skip_serializing_if = "is_queue_default")]
    pub queue_bytes: u64,
    /// How a signal grows weaker, for the model `attenuated`.
    #[serde(skip_serializing_if = "is_default")]
    pub attenuation: PathLoss,
    /// What agents can leave behind.
    #[serde(skip_serializing_if = "is_default")]
    pub relays: RelaySection,
}

/// When two agents are in contact.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CommunicationModel {
    /// No wall lies between them.
    LineOfSight,
    /// They are within range.
    Range,
    /// Both.
    #[default]
    LineOfSightAndRange,
    /// Always.
    Global,
    /// The power that is received is enough.
    Attenuated,
}

impl CommunicationModel {
    /// As the scenario has it.
    fn name(self) -> &'static str {
        match self {
            Self::LineOfSight => "line_of_sight",
            Self::Range => "range",
            Self::LineOfSightAndRange => "line_of_sight_and_range",
            Self::Global => "global",
            Self::Attenuated => "attenuated",
        }
    }
}

/// `[communication.relays]`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RelaySection {
    /// Relays that each agent can leave behind.
    pub per_agent: u32,
    /// How near a relay in contact has to be to be read and written, metres; `inf`: contact is enough.
    pub read_range_m: f64,
}

impl Default for CommunicationSection {
    fn default() -> Self {
        Self {
            range_m: f64::INFINITY,
            model: CommunicationModel::default(),
            loss: 0.0,
            bytes_per_s: f64::INFINITY,
            queue_bytes: QUEUE_BYTES,
            attenuation: PathLoss::default(),
            relays: RelaySection::default(),
        }
    }
}

impl Default for RelaySection {
    fn default() -> Self {
        Self { per_agent: 0, read_range_m: f64::INFINITY }
    }
}

impl CommunicationSection {
    /// As the world has it, with the seed of the run.
    #[must_use]
    pub fn comms(&self, seed: u64) -> Comms {
        let range_m = self.range_m;
        Comms {
            contact: match self.model {
                CommunicationModel::LineOfSight | CommunicationModel::LineOfSightAndRange => {
                    ContactModel::LineOfSightAndRange { range_m }
                }
                CommunicationModel::Range => ContactModel::Range { range_m },
                CommunicationModel::Global => ContactModel::Global,
                CommunicationModel::Attenuated => ContactModel::Attenuated(self.attenuation),
            },
            loss: self.loss,
            bytes_per_s: self.bytes_per_s,
            queue_bytes: self.queue_bytes,
            relays_per_agent: self.relays.per_agent,
            relay_read_range_m: self.relays.read_range_m,
            seed,
        }
    }

    /// What agents may know of it, which is all.
    #[must_use]
    pub fn message(&self) -> maes_msgs::Radio {
        let PathLoss {
            tx_dbm,
            threshold_dbm,
            reference_loss_db,
            reference_m,
            free_exponent,
            wall_exponent,
            wall_reference_m,
        } = self.attenuation;
        maes_msgs::Radio {
            model: self.model.name().to_owned(),
            tx_dbm,
            threshold_dbm,
            reference_loss_db,
            reference_m,
            free_exponent,
            wall_exponent,
            wall_reference_m,
            loss: self.loss,
            bytes_per_s: self.bytes_per_s,
            queue_bytes: self.queue_bytes,
            relays_per_agent: self.relays.per_agent,
            relay_read_range_m: self.relays.read_range_m,
        }
    }

    pub(super) fn check(&self, checker: &Checker<'_>) -> Result<(), ScenarioError> {
        let has_range = matches!(self.model, CommunicationModel::Range | CommunicationModel::LineOfSightAndRange);
        checker.require("communication.range_m", self.range_m, self.range_m >= 0.0, "expected at least 0, or inf")?;
        checker.require(
            "communication.range_m",
            self.range_m,
            has_range || self.range_m == f64::INFINITY,
            "the models \"line_of_sight\", \"global\" and \"attenuated\" have no range: leave this key out",
        )?;
        checker.require(
            "communication.loss",
            self.loss,
            (0.0..=1.0).contains(&self.loss),
            "expected a probability, 0 to 1",
        )?;
        checker.require(
            "communication.bytes_per_s",
            self.bytes_per_s,
            self.bytes_per_s >= 1.0,
            "expected at least 1, or inf",
        )?;
        let queue_min = 2 * PARCEL_BYTES_MAX as u64;
        checker.require(
            "communication.queue_bytes",
            self.queue_bytes,
            (queue_min..=1 << 30).contains(&self.queue_bytes),
            &format!("expected {queue_min} (two full parcels) to 1073741824"),
        )?;
        checker.require(
            "communication.relays.per_agent",
            self.relays.per_agent,
            self.relays.per_agent <= RELAYS_PER_AGENT_MAX,
            &format!("expected 0 to {RELAYS_PER_AGENT_MAX}"),
        )?;
        checker.require(
            "communication.relays.read_range_m",
            self.relays.read_range_m,
            self.relays.read_range_m >= 0.0,
            "expected at least 0, or inf",
        )?;
        let PathLoss { free_exponent, wall_exponent, reference_m, wall_reference_m, .. } = self.attenuation;
        for (key, dbm) in [
            ("communication.attenuation.tx_dbm", self.attenuation.tx_dbm),
            ("communication.attenuation.threshold_dbm", self.attenuation.threshold_dbm),
        ] {
            checker.require(key, dbm, (-200.0..=100.0).contains(&dbm), "expected -200 to 100")?;
        }
        let loss_db = self.attenuation.reference_loss_db;
        checker.require(
            "communication.attenuation.reference_loss_db",
            loss_db,
            (0.0..=300.0).contains(&loss_db),
            "expected 0 to 300",
        )?;
        checker.positive("communication.attenuation.reference_m", reference_m)?;
        checker.positive("communication.attenuation.wall_reference_m", wall_reference_m)?;
        checker.require(
            "communication.attenuation.free_exponent",
            free_exponent,
            free_exponent > 0.0 && free_exponent <= 20.0,
            "expected a number above 0 and at most 20",
        )?;
        checker.require(
            "communication.attenuation.wall_exponent",
            wall_exponent,
            (0.0..=1000.0).contains(&wall_exponent),
            "expected 0 to 1000",
        )
    }
}

/// Whether a key is as by default, and so not written.
pub(super) fn is_default<V: Default + PartialEq>(value: &V) -> bool {
    *value == V::default()
}

fn is_unlimited(bytes_per_s: &f64) -> bool {
    *bytes_per_s == f64::INFINITY
}

fn is_queue_default(bytes: &u64) -> bool {
    *bytes == QUEUE_BYTES
}
