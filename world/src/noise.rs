//! The sensor noise model: Gaussian noise and missed returns of the LiDARs, and drift of the
//! measured position. All of it is off by default.
//!
//! Every random stream is named by seed, agent and tick, so scans depend neither on each other nor
//! on threads.

use msgs::ids::{AgentId, Tick};
use nalgebra::{Point3, Vector3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::Rng;
use voxels::Extent;

/// The parameters of the sensor noise.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SensorNoise {
    /// Standard deviation of measured distances, metres.
    pub range_sigma_m: f64,
    /// Probability that a ray which hits a wall has no return, 0 ..= 1.
    pub missed_returns: f64,
    /// Bound of the position error along each axis, metres.
    pub pose_bound_m: f64,
    /// Largest change of the position error along each axis in a tick, metres.
    pub pose_step_m: f64,
    /// Seed of the noise.
    pub seed: u64,
}

/// The drift of one agent's measured position: a bounded random walk along each axis.
#[derive(Debug, Clone)]
pub(super) struct Drift {
    rng: ChaCha8Rng,
    offset_m: Vector3<f64>,
}

impl SensorNoise {
    /// Whether scans have noise or missed returns.
    #[must_use]
    pub fn affects_scans(&self) -> bool {
        self.range_sigma_m > 0.0 || self.missed_returns > 0.0
    }

    fn affects_poses(&self) -> bool {
        self.pose_bound_m > 0.0 && self.pose_step_m > 0.0
    }

    /// The random stream of the scan of an agent in a tick with one of its LiDARs, which are
    /// numbered from 0.
    pub(super) fn scan_stream(&self, agent: AgentId, lidar: usize, tick: Tick) -> ChaCha8Rng {
        let purpose = if lidar == 0 { "sensor.scan".to_owned() } else { format!("sensor.scan.{lidar}") };
        let mut rng = voxels::random_streams::stream(self.seed, agent.0.into(), &purpose);
        rng.set_stream(tick.0);
        rng
    }

    /// Draws the noise of one return: `None` if it is missed, else the error of its distance,
    /// metres.
    pub(super) fn sample_return(&self, rng: &mut ChaCha8Rng) -> Option<f64> {
        // Both are always drawn, so that the number of draws per ray does not depend on the
        // parameters.
        let (miss, deviation) = (uniform(rng), normal(rng));
        (miss >= self.missed_returns).then_some(deviation * self.range_sigma_m)
    }
}

impl Drift {
    /// The drift at the start: no error.
    pub(super) fn new(noise: &SensorNoise, agent: AgentId) -> Self {
        Self {
            rng: voxels::random_streams::stream(noise.seed, agent.0.into(), "sensor.pose"),
            offset_m: Vector3::zeros(),
        }
    }

    /// Advances the drift by one tick.
    pub(super) fn advance(&mut self, noise: &SensorNoise) {
        if !noise.affects_poses() {
            return;
        }
        let bound_m = noise.pose_bound_m;
        for along in self.offset_m.iter_mut() {
            let step_m = (2.0 * uniform(&mut self.rng) - 1.0) * noise.pose_step_m;
            *along = (*along + step_m).clamp(-bound_m, bound_m);
        }
    }

    /// The measured position for a true one (metres, frame `map`), clamped to the map.
    pub(super) fn measured(&self, position: &Point3<f64>, extent: Extent) -> Point3<f64> {
        if self.offset_m == Vector3::zeros() {
            return *position;
        }
        within(&(position + self.offset_m), extent)
    }
}

/// The nearest point (metres, frame `map`) in the map, at least half a cell below its upper
/// boundary, so that rounding cannot leave the map.
pub(super) fn within(point: &Point3<f64>, extent: Extent) -> Point3<f64> {
    let (edge, size) = (extent.cell_m(), extent.size());
    Point3::from([0, 1, 2].map(|axis: usize| point[axis].clamp(0.0, (f64::from(size[axis]) - 0.5) * edge)))
}

/// A number of the normal distribution with mean 0 and variance 1, of two draws.
pub(super) fn normal(rng: &mut ChaCha8Rng) -> f64 {
    let [one, other] = [uniform(rng), uniform(rng)];
    // Box-Muller transform; 1 - one is never 0.
    let radius = libm::sqrt(-2.0 * libm::log(1.0 - one));
    radius * libm::cos(std::f64::consts::TAU * other)
}

/// A uniform number in [0, 1).
fn uniform(rng: &mut ChaCha8Rng) -> f64 {
    const BITS: u32 = 53;
    (rng.next_u64() >> (u64::BITS - BITS)) as f64 / (1_u64 << BITS) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn returns_have_the_given_noise() {
        let noise = SensorNoise { range_sigma_m: 0.5, missed_returns: 0.25, ..SensorNoise::default() };
        let mut rng = noise.scan_stream(AgentId(3), 0, Tick(7));
        let returns: Vec<f64> = (0..40_000).filter_map(|_| noise.sample_return(&mut rng)).collect();
        let number = returns.len() as f64;
        let mean = returns.iter().sum::<f64>() / number;
        let variance = returns.iter().map(|noise| (noise - mean) * (noise - mean)).sum::<f64>() / number;
        assert!((number / 40_000.0 - 0.75).abs() < 0.01, "{number}");
        assert!(mean.abs() < 0.01 && (variance - 0.25).abs() < 0.01, "{mean} {variance}");
    }

    #[test]
    fn scan_stream_depends_on_agent_lidar_and_tick() {
        let noise = SensorNoise { seed: 1, ..SensorNoise::default() };
        let first = |agent, lidar, tick| noise.scan_stream(AgentId(agent), lidar, Tick(tick)).next_u64();
        assert_eq!(first(0, 0, 5), first(0, 0, 5));
        assert_ne!(first(0, 0, 5), first(0, 0, 6));
        assert_ne!(first(0, 0, 5), first(1, 0, 5));
        assert_ne!(first(0, 0, 5), first(0, 1, 5));
    }

    #[test]
    fn measured_position_drifts_within_bounds_and_map() {
        let noise = SensorNoise { pose_bound_m: 0.5, pose_step_m: 0.05, ..SensorNoise::default() };
        let mut drift = Drift::new(&noise, AgentId(0));
        let extent = Extent::new([4, 4, 4], 1.0).unwrap();
        let (middle, corner) = (Point3::new(2.0, 2.0, 2.0), Point3::new(0.1, 3.9, 0.1));
        assert_eq!(drift.measured(&middle, extent), middle);
        let mut farthest: f64 = 0.0;
        for _ in 0..5000 {
            let before = drift.measured(&middle, extent);
            drift.advance(&noise);
            let now = drift.measured(&middle, extent);
            assert!((now - before).amax() <= 0.05 + 1e-12);
            farthest = farthest.max((now - middle).amax());
            assert!(extent.contains(extent.cell_of(&drift.measured(&corner, extent))));
        }
        assert!(farthest > 0.45 && farthest <= 0.5 + 1e-12, "{farthest}");
    }
}
