//! The table `[sensor]`: how agents err. By default they do not.

use serde::{Deserialize, Serialize};

use super::radio::is_default;
use super::{Checker, ScenarioError};
use crate::world::noise::SensorNoise;

/// `[sensor]`.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SensorSection {
    /// Standard deviation of the distances that the LiDAR measures, metres.
    #[serde(skip_serializing_if = "is_default")]
    pub range_sigma_m: f64,
    /// Probability that a ray that meets a wall brings nothing back.
    #[serde(skip_serializing_if = "is_default")]
    pub missed_returns: f64,
    /// How far at the most the position that an agent is told is from the true one, along each axis, metres.
    #[serde(skip_serializing_if = "is_default")]
    pub pose_bound_m: f64,
    /// How far at the most that error moves along each axis in a tick, metres; a tenth of the bound if nothing is said (reference).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pose_step_m: Option<f64>,
}

impl SensorSection {
    /// As the world has it, with the seed of the run.
    #[must_use]
    pub fn errors(&self, seed: u64) -> SensorNoise {
        SensorNoise {
            range_sigma_m: self.range_sigma_m,
            missed_returns: self.missed_returns,
            pose_bound_m: self.pose_bound_m,
            pose_step_m: self.pose_step_m.unwrap_or(self.pose_bound_m / 10.0),
            seed,
        }
    }

    pub(super) fn check(&self, checker: &Checker<'_>) -> Result<(), ScenarioError> {
        let pose_step_m = self.pose_step_m.unwrap_or(0.0);
        for (key, metres) in [
            ("sensor.range_sigma_m", self.range_sigma_m),
            ("sensor.pose_bound_m", self.pose_bound_m),
            ("sensor.pose_step_m", pose_step_m),
        ] {
            checker.require(key, metres, (0.0..=1e6).contains(&metres), "expected 0 to 1e6")?;
        }
        checker.require(
            "sensor.missed_returns",
            self.missed_returns,
            (0.0..=1.0).contains(&self.missed_returns),
            "expected a probability, 0 to 1",
        )
    }
}
