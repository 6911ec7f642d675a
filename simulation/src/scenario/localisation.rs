//! The table `[localisation]`: noise and biases of odometry. The default is none, and agents know
//! where they are.

use serde::{Deserialize, Serialize};

use super::radio::is_default;
use world::localisation::{LoopClosures, OdometryNoise};

/// `[localisation]`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LocalisationSection {
    /// Standard deviation of the position along each axis after 1 m, metres.
    #[serde(skip_serializing_if = "is_default")]
    pub position_noise_m: f64,
    /// Standard deviation over the agents of the bias of distances.
    #[serde(skip_serializing_if = "is_default")]
    pub position_bias: f64,
    /// Standard deviation of the heading after 1 m, radians.
    #[serde(skip_serializing_if = "is_default")]
    pub heading_noise_rad: f64,
    /// Standard deviation over the agents of the bias of the heading, radians per metre.
    #[serde(skip_serializing_if = "is_default")]
    pub heading_bias_rad_per_m: f64,
    /// Standard deviation of the heading after a turn of 1 rad, radians.
    #[serde(skip_serializing_if = "is_default")]
    pub turn_noise_rad: f64,
    /// Standard deviation over the agents of the bias of turns.
    #[serde(skip_serializing_if = "is_default")]
    pub turn_bias: f64,
    /// Greatest distance at which a place or an agent closes a loop, metres; 0: none does.
    #[serde(skip_serializing_if = "is_default")]
    pub closure_range_m: f64,
    /// Least length by which a closure shortens the odometry on which a position rests, metres.
    #[serde(skip_serializing_if = "is_default_gain")]
    pub closure_gain_m: f64,
}

/// The default of `closure_gain_m`.
const GAIN_M: f64 = 20.0;

fn is_default_gain(gain_m: &f64) -> bool {
    *gain_m == GAIN_M
}

impl Default for LocalisationSection {
    fn default() -> Self {
        Self {
            position_noise_m: 0.0,
            position_bias: 0.0,
            heading_noise_rad: 0.0,
            heading_bias_rad_per_m: 0.0,
            turn_noise_rad: 0.0,
            turn_bias: 0.0,
            closure_range_m: 0.0,
            closure_gain_m: GAIN_M,
        }
    }
}

impl LocalisationSection {
    /// When loops are closed; `None`: never.
    #[must_use]
    pub fn closures(&self) -> Option<LoopClosures> {
        let Self { closure_range_m: range_m, closure_gain_m: gain_min_m, .. } = *self;
        (range_m > 0.0).then_some(LoopClosures { range_m, gain_min_m })
    }

    /// The noise model of the world, with the seed of the run.
    #[must_use]
    pub fn noise(&self, seed: u64) -> OdometryNoise {
        OdometryNoise {
            position_noise_m: self.position_noise_m,
            position_bias: self.position_bias,
            heading_noise_rad: self.heading_noise_rad,
            heading_bias_rad_per_m: self.heading_bias_rad_per_m,
            turn_noise_rad: self.turn_noise_rad,
            turn_bias: self.turn_bias,
            seed,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::Scenario;

    const TEXT: &str = "seed = 1\nduration_s = 1.0\nmap = { kind = \"spheres\", size = 20 }\nagents = { count = 2 }\n";

    fn parse(keys: &str) -> Result<Scenario, String> {
        Scenario::parse("s.toml", &format!("{TEXT}{keys}"), &[]).map_err(|error| error.to_string())
    }

    #[test]
    fn identity_names_localisation_only_if_it_drifts() {
        let without = parse("").unwrap();
        assert!(!without.identity().contains("localisation"));
        assert_eq!(parse("[localisation]\nturn_bias = 0.0").unwrap().identity(), without.identity());
        let with = parse("[localisation]\nposition_noise_m = 0.05\nturn_bias = 0.01").unwrap();
        assert_eq!(Scenario::parse("identity", &with.identity(), &[]).unwrap(), with);
        let noise = with.localisation.noise(7);
        assert_eq!((noise.position_noise_m, noise.turn_bias, noise.seed), (0.05, 0.01, 7));
        assert_eq!(with.localisation.closures(), None);
        let closing = parse("[localisation]\nclosure_range_m = 2.0").unwrap().localisation;
        assert_eq!(closing.closures(), Some(LoopClosures { range_m: 2.0, gain_min_m: 20.0 }));
    }

    #[test]
    fn impossible_values_are_named() {
        let refused = |keys: &str| parse(&format!("[localisation]\n{keys}")).unwrap_err();
        assert!(refused("position_noise_m = -0.1").contains("localisation.position_noise_m = -0.1: expected"));
        assert!(refused("turn_bias = 2.0").contains("localisation.turn_bias = 2: expected"));
        assert!(refused("noise_m = 0.1").contains("noise_m"));
    }
}
