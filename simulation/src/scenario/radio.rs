//! The table `[communication]`: contact model, message loss, bandwidth and relays. The default is
//! line of sight without loss.

use msgs::maes_msgs;
use serde::{Deserialize, Serialize};

use super::{Checker, ScenarioError};
use world::comms::{Comms, ContactModel, PathLoss};

/// Default capacity of a send queue.
const QUEUE_BYTES: u64 = 1 << 20;

/// `[communication]`. Keys with their default value are not part of the identity of a run.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CommunicationSection {
    /// Greatest distance between two agents in contact, metres; `inf`: unlimited (reference).
    pub range_m: f64,
    /// When two agents are in contact.
    #[serde(skip_serializing_if = "is_default")]
    pub model: CommunicationModel,
    /// Probability that a message is lost on its way to one receiver.
    #[serde(skip_serializing_if = "is_default")]
    pub loss: f64,
    /// Bandwidth of each agent; `inf`: unlimited.
    #[serde(skip_serializing_if = "is_unlimited")]
    pub bytes_per_s: f64,
    /// Capacity of the send queue of each agent.
    #[serde(skip_serializing_if = "is_queue_default")]
    pub queue_bytes: u64,
    /// Path loss of the model `attenuated`.
    #[serde(skip_serializing_if = "is_default")]
    pub attenuation: PathLoss,
    /// Radio relays.
    #[serde(skip_serializing_if = "is_default")]
    pub relays: RelaySection,
}

/// When two agents are in contact.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CommunicationModel {
    /// No wall lies between the two.
    LineOfSight,
    /// The two are within range.
    Range,
    /// Both.
    #[default]
    LineOfSightAndRange,
    /// Always.
    Global,
    /// The received power is at least the threshold.
    Attenuated,
}

impl CommunicationModel {
    /// The word of the scenario.
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
    /// Relays that each agent carries.
    pub per_agent: u32,
    /// Distance within which a relay in contact can be read and written, metres; `inf`: contact is
    /// enough.
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
    /// The radio model of the world, with the seed of the run.
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

    /// The message that describes their radios to agents.
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
        checker.require(
            "communication.range_m",
            self.range_m,
            has_range || self.range_m == f64::INFINITY,
            "the models \"line_of_sight\", \"global\" and \"attenuated\" have no range: leave this key out",
        )
    }
}

/// Whether a key has its default value and is not written.
pub(super) fn is_default<V: Default + PartialEq>(value: &V) -> bool {
    *value == V::default()
}

fn is_unlimited(bytes_per_s: &f64) -> bool {
    *bytes_per_s == f64::INFINITY
}

fn is_queue_default(bytes: &u64) -> bool {
    *bytes == QUEUE_BYTES
}
