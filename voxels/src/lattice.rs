//! Directions spread evenly over the sphere: the Fibonacci lattice.
//!
//! As in the LiDAR of MAES3D, the pole is a horizontal axis, here x (docs/reference-model.md,
//! "LiDAR").

use std::f64::consts::TAU;

use nalgebra::Vector3;

/// (1 + sqrt 5) / 2.
const GOLDEN_RATIO: f64 = 1.618_033_988_749_895;

/// Direction number `index` of `count`, a vector of length 1. The first ones look along x, the last
/// ones against it.
#[must_use]
pub fn direction(index: u32, count: u32) -> Vector3<f64> {
    let azimuth = TAU * f64::from(index) / GOLDEN_RATIO;
    let along = 1.0 - 2.0 * (f64::from(index) + 0.5) / f64::from(count);
    let aside = (1.0 - along * along).sqrt();
    Vector3::new(along, libm::cos(azimuth) * aside, libm::sin(azimuth) * aside)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn is_even_and_of_length_one() {
        let count = 500;
        let sum: Vector3<f64> = (0..count).map(|index| direction(index, count)).sum();
        assert!(sum.norm() < 1.0, "{sum}");
        let nearest = |a: u32| {
            let apart = |b: u32| (direction(a, count) - direction(b, count)).norm();
            (0..count).filter(|&b| b != a).map(apart).fold(f64::INFINITY, f64::min)
        };
        let spacing = (4.0 * std::f64::consts::PI / f64::from(count)).sqrt();
        for index in 0..count {
            assert!((direction(index, count).norm() - 1.0).abs() < 1e-12);
            assert!((0.5 * spacing..1.5 * spacing).contains(&nearest(index)), "{index}");
        }
    }
}
