//! Dynamic time warping: how much a branch differs from the direction of exploration.
//!
//! Source: the DTW term of the branch gain of DSVP (see [`super::tree`]); the classic dynamic
//! programme over two series.

use nalgebra::Vector3;

/// The DTW distance between a path (its points, relative to its start) and equally many, equally
/// spaced points of the same total length along `direction` (a unit vector): the least sum of
/// distances of matched points, in the unit of the points. A point may match several points of the
/// other series, in order.
pub(super) fn difference(path: &[Vector3<f64>], direction: Vector3<f64>) -> f64 {
    let mut length = 0.0;
    let mut last = Vector3::zeros();
    for point in path {
        length += (point - last).norm();
        last = *point;
    }
    let spacing = length / path.len().max(1) as f64;
    let ahead: Vec<Vector3<f64>> = (1..=path.len()).map(|number| direction * (spacing * number as f64)).collect();
    // The least sums that match all points of the path so far with 0, 1, 2 ... points ahead.
    let mut sums = vec![f64::INFINITY; ahead.len() + 1];
    sums[0] = 0.0;
    for point in path {
        let mut diagonal = std::mem::replace(&mut sums[0], f64::INFINITY);
        for (number, other) in ahead.iter().enumerate() {
            let least = diagonal.min(sums[number]).min(sums[number + 1]);
            diagonal = std::mem::replace(&mut sums[number + 1], (point - other).norm() + least);
        }
    }
    sums.last().copied().filter(|sum| sum.is_finite()).unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(direction: Vector3<f64>) -> Vec<Vector3<f64>> {
        (1..=4).map(|step| direction * f64::from(step)).collect()
    }

    #[test]
    fn difference_grows_from_straight_on_to_reverse() {
        let (x, y) = (Vector3::x(), Vector3::y());
        assert_eq!(difference(&[], x), 0.0);
        assert!(difference(&line(x), x) < 1e-12);
        let aside = difference(&line(y), x);
        let back = difference(&line(-x), x);
        assert!(0.0 < aside && aside < back, "{aside} {back}");
        // Points match one to one: 2 + 4 + 6 + 8.
        assert!((back - 20.0).abs() < 1e-12, "{back}");
    }

    #[test]
    fn detour_differs_less_than_another_direction() {
        let detour = [Vector3::new(1.0, 0.5, 0.0), Vector3::new(2.0, 0.5, 0.0), Vector3::new(3.0, 0.0, 0.0)];
        assert!(difference(&detour, Vector3::x()) < difference(&detour, Vector3::y()));
    }
}
