//! The table `[sensor]`: noise of the LiDARs and of the measured positions. The default is none.

use serde::{Deserialize, Serialize};

use super::radio::is_default;
use world::noise::SensorNoise;

/// `[sensor]`.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SensorSection {
    /// Standard deviation of the distances that the LiDAR measures, metres.
    #[serde(skip_serializing_if = "is_default")]
    pub range_sigma_m: f64,
    /// Probability that a ray that meets a wall has no return.
    #[serde(skip_serializing_if = "is_default")]
    pub missed_returns: f64,
    /// Greatest error of the measured position along each axis, metres.
    #[serde(skip_serializing_if = "is_default")]
    pub pose_bound_m: f64,
    /// Greatest change of that error along each axis in a tick, metres; the default is a tenth of
    /// the bound (reference).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pose_step_m: Option<f64>,
}

impl SensorSection {
    /// The noise model of the world, with the seed of the run.
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
}
