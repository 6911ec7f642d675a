//! The odometry of one body: its true motion, measured with noise and biases.
//!
//! For a motion by `d` metres and `a` radians the error of the position grows by noise along each
//! axis of variance `position_noise_m^2 d`, by the bias of the position times the motion, and
//! because the motion is turned by the error of the heading; that one grows by noise of variance
//! `heading_noise_rad^2 d + turn_noise_rad^2 |a|`, and by the biases of the heading times `d` and
//! of turns times `a`. So noise is a random walk, whatever the length of a tick, and the biases
//! stay the same for an agent: each is drawn once from a normal distribution.
//!
//! The covariance is propagated as in an extended Kalman filter, with the biases in the state, so
//! it is that of the errors as long as the error of the heading is small.

use std::f64::consts::FRAC_PI_2;

use msgs::ids::AgentId;
use nalgebra::{SMatrix, Vector3};
use protocol::kinematics::{turned, wrapped};
use protocol::observation::Pose;
use rand_chacha::ChaCha8Rng;

use crate::noise::normal;

/// The noise and the biases of odometry. All 0: it is exact.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct OdometryNoise {
    /// Standard deviation of the position along each axis after 1 m, metres.
    pub position_noise_m: f64,
    /// Standard deviation of the bias of distances over the agents.
    pub position_bias: f64,
    /// Standard deviation of the heading after 1 m, radians.
    pub heading_noise_rad: f64,
    /// Standard deviation of the bias of the heading over the agents, radians per metre.
    pub heading_bias_rad_per_m: f64,
    /// Standard deviation of the heading after a turn of 1 rad, radians.
    pub turn_noise_rad: f64,
    /// Standard deviation of the bias of turns over the agents.
    pub turn_bias: f64,
    /// Seed of the noise.
    pub seed: u64,
}

/// The variables of the covariance: x, y, z, heading, and the three biases in the order of
/// [`Biases`].
const VARIABLES: usize = 7;
const HEADING: usize = 3;
const POSITION_BIAS: usize = 4;
const HEADING_BIAS: usize = 5;
const TURN_BIAS: usize = 6;

/// The biases of one agent.
#[derive(Debug, Clone, Copy)]
struct Biases {
    position: f64,
    heading_rad_per_m: f64,
    turn: f64,
}

/// The odometry of one body.
#[derive(Debug, Clone)]
pub(super) struct Odometry {
    rng: ChaCha8Rng,
    biases: Biases,
    /// The true pose up to which motions are measured.
    measured_to: Pose,
    position_error_m: Vector3<f64>,
    heading_error_rad: f64,
    covariance: SMatrix<f64, VARIABLES, VARIABLES>,
}

/// A motion, as it was and as it was measured.
#[derive(Debug, Clone, Copy)]
pub(super) struct Measured {
    /// The true one, metres, frame `map`.
    pub(super) motion_m: Vector3<f64>,
    /// The measured one, metres, frame of the odometry.
    pub(super) believed_m: Vector3<f64>,
}

impl OdometryNoise {
    /// Whether odometry has no errors.
    #[must_use]
    pub fn is_exact(&self) -> bool {
        let Self {
            position_noise_m,
            position_bias,
            heading_noise_rad,
            heading_bias_rad_per_m,
            turn_noise_rad,
            turn_bias,
            seed: _,
        } = *self;
        [position_noise_m, position_bias, heading_noise_rad, heading_bias_rad_per_m, turn_noise_rad, turn_bias]
            .iter()
            .all(|&deviation| deviation == 0.0)
    }
}

impl Odometry {
    /// Odometry without error at the start of an agent.
    pub(super) fn new(noise: &OdometryNoise, agent: AgentId, start: Pose) -> Self {
        let mut rng = voxels::random_streams::stream(noise.seed, agent.0.into(), "odometry");
        let biases = Biases {
            position: noise.position_bias * normal(&mut rng),
            heading_rad_per_m: noise.heading_bias_rad_per_m * normal(&mut rng),
            turn: noise.turn_bias * normal(&mut rng),
        };
        let mut covariance = SMatrix::zeros();
        covariance[(POSITION_BIAS, POSITION_BIAS)] = noise.position_bias.powi(2);
        covariance[(HEADING_BIAS, HEADING_BIAS)] = noise.heading_bias_rad_per_m.powi(2);
        covariance[(TURN_BIAS, TURN_BIAS)] = noise.turn_bias.powi(2);
        Self { rng, biases, measured_to: start, position_error_m: Vector3::zeros(), heading_error_rad: 0.0, covariance }
    }

    /// Measures the motion of the body to its present true pose; `None` if it is at rest.
    pub(super) fn measure(&mut self, noise: &OdometryNoise, pose: &Pose) -> Option<Measured> {
        if *pose == self.measured_to {
            return None;
        }
        let motion_m = pose.position - self.measured_to.position;
        let (distance_m, turn_rad) = (motion_m.norm(), wrapped(pose.yaw_rad - self.measured_to.yaw_rad));
        self.measured_to = *pose;
        let position_variance = noise.position_noise_m.powi(2) * distance_m;
        let heading_variance =
            noise.heading_noise_rad.powi(2) * distance_m + noise.turn_noise_rad.powi(2) * turn_rad.abs();
        let mut draw = |variance: f64| libm::sqrt(variance) * normal(&mut self.rng);
        let noise_m = Vector3::new(draw(position_variance), draw(position_variance), draw(position_variance));
        let noise_rad = draw(heading_variance);
        let believed_m = turned(&motion_m, self.heading_error_rad) * (1.0 + self.biases.position) + noise_m;
        self.position_error_m += believed_m - motion_m;
        self.heading_error_rad += self.biases.heading_rad_per_m * distance_m + self.biases.turn * turn_rad + noise_rad;
        self.propagate(&motion_m, turn_rad, [position_variance, heading_variance]);
        Some(Measured { motion_m, believed_m })
    }

    fn propagate(&mut self, motion_m: &Vector3<f64>, turn_rad: f64, [position_variance, heading_variance]: [f64; 2]) {
        let sideways = turned(&Vector3::new(motion_m.x, motion_m.y, 0.0), FRAC_PI_2);
        let mut transition = SMatrix::<f64, VARIABLES, VARIABLES>::identity();
        for axis in 0..3 {
            transition[(axis, HEADING)] = sideways[axis];
            transition[(axis, POSITION_BIAS)] = motion_m[axis];
        }
        transition[(HEADING, HEADING_BIAS)] = motion_m.norm();
        transition[(HEADING, TURN_BIAS)] = turn_rad;
        self.covariance = transition * self.covariance * transition.transpose();
        for axis in 0..3 {
            self.covariance[(axis, axis)] += position_variance;
        }
        self.covariance[(HEADING, HEADING)] += heading_variance;
    }

    /// Goes on from a pose at which the body was put, without measuring that as a motion.
    pub(super) fn put(&mut self, pose: Pose) {
        self.measured_to = pose;
    }

    /// The error of the heading, radians, turns not wrapped.
    pub(super) fn heading_error_rad(&self) -> f64 {
        self.heading_error_rad
    }

    /// The pose by odometry alone, in the frame in which the agent started.
    pub(super) fn pose(&self) -> Pose {
        let Pose { position, yaw_rad } = self.measured_to;
        Pose { position: position + self.position_error_m, yaw_rad: wrapped(yaw_rad + self.heading_error_rad) }
    }

    /// The covariance of x, y, z (metres) and heading (radians).
    pub(super) fn covariance(&self) -> SMatrix<f64, 4, 4> {
        self.covariance.fixed_view::<4, 4>(0, 0).into_owned()
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;

    use super::*;

    const NOISE: OdometryNoise = OdometryNoise {
        position_noise_m: 0.05,
        position_bias: 0.01,
        heading_noise_rad: 0.002,
        heading_bias_rad_per_m: 0.0005,
        turn_noise_rad: 0.01,
        turn_bias: 0.005,
        seed: 7,
    };

    /// The odometry of an agent after a way along two sides of a square, with a turn between them.
    fn after_the_way(noise: &OdometryNoise, agent: u32) -> Odometry {
        let mut pose = Pose { position: Point3::new(5.0, 5.0, 5.0), yaw_rad: 0.0 };
        let mut odometry = Odometry::new(noise, AgentId(agent), pose);
        for direction in [Vector3::x(), Vector3::y()] {
            for _ in 0..100 {
                pose.position += 0.2 * direction;
                odometry.measure(noise, &pose);
            }
            for _ in 0..50 {
                pose.yaw_rad += FRAC_PI_2 / 50.0;
                odometry.measure(noise, &pose);
            }
        }
        odometry
    }

    #[test]
    fn errors_have_the_covariance_that_is_stated() {
        const AGENTS: u32 = 4000;
        let mut seen = SMatrix::<f64, 4, 4>::zeros();
        for agent in 0..AGENTS {
            let odometry = after_the_way(&NOISE, agent);
            let [x, y, z]: [f64; 3] = odometry.position_error_m.into();
            let errors = nalgebra::Vector4::new(x, y, z, odometry.heading_error_rad);
            seen += errors * errors.transpose() / f64::from(AGENTS);
        }
        let stated = after_the_way(&NOISE, 0).covariance();
        for (row, column) in (0..4).flat_map(|row| (0..4).map(move |column| (row, column))) {
            let scale = libm::sqrt(stated[(row, row)] * stated[(column, column)]);
            let off = (seen[(row, column)] - stated[(row, column)]).abs() / scale;
            assert!(off < 0.08, "{row} {column}: seen {seen} stated {stated}");
        }
    }

    #[test]
    fn each_source_of_error_grows_as_configured() {
        let alone = |change: fn(&mut OdometryNoise)| {
            let mut noise = OdometryNoise { seed: 1, ..OdometryNoise::default() };
            change(&mut noise);
            let covariance = after_the_way(&noise, 3).covariance();
            [covariance[(0, 0)], covariance[(2, 2)], covariance[(HEADING, HEADING)]]
        };
        let is_near = |[x, z, heading]: [f64; 3], expected: [f64; 3]| {
            [x, z, heading].iter().zip(expected).all(|(seen, expected)| (seen - expected).abs() < 1e-9)
        };
        // 20 m along x, 20 m along y, and 180 degrees.
        let pi = std::f64::consts::PI;
        assert!(is_near(alone(|noise| noise.position_noise_m = 0.1), [0.4, 0.4, 0.0]));
        assert!(is_near(alone(|noise| noise.position_bias = 0.1), [4.0, 0.0, 0.0]));
        assert!((alone(|noise| noise.turn_noise_rad = 0.1)[2] - 0.01 * pi).abs() < 1e-9);
        assert!((alone(|noise| noise.turn_bias = 0.1)[2] - 0.01 * pi * pi).abs() < 1e-9);
        assert!((alone(|noise| noise.heading_noise_rad = 0.1)[2] - 0.4).abs() < 1e-9);
        assert!((alone(|noise| noise.heading_bias_rad_per_m = 0.1)[2] - 16.0).abs() < 1e-9);
    }

    #[test]
    fn exact_odometry_has_no_error_and_a_body_that_is_put_makes_none() {
        let exact = OdometryNoise::default();
        assert!(exact.is_exact() && !NOISE.is_exact());
        let odometry = after_the_way(&exact, 0);
        assert!(odometry.position_error_m.norm() < 1e-12 && odometry.heading_error_rad == 0.0);
        let mut odometry = after_the_way(&NOISE, 0);
        let before = odometry.position_error_m;
        let put = Pose { position: Point3::new(1.0, 1.0, 1.0), yaw_rad: 0.0 };
        odometry.put(put);
        assert!(odometry.measure(&NOISE, &put).is_none());
        assert_eq!(odometry.position_error_m, before);
    }
}
