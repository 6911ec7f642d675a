//! Which turns on the spot show a set of directions: the fewest radians, to one side or to both.

use std::f64::consts::TAU;

/// A direction counts as seen within this share of half the field of view, so that the rays at its
/// sides, which reach less far up and down, are not relied on.
pub(super) const REACH: f64 = 0.8;

/// The turns, in radians (positive to the left), that bring all azimuths into a horizontal field of
/// view about the heading; none if they are in it.
pub(super) fn towards(azimuths_rad: &[f64], yaw_rad: f64, horizontal_rad: f64) -> Vec<f64> {
    let half_rad = horizontal_rad / 2.0 * REACH;
    // How far to the left each is, 0 .. 2 pi.
    let mut left_rad: Vec<f64> = azimuths_rad.iter().map(|azimuth_rad| turn_to(azimuth_rad - yaw_rad)).collect();
    left_rad.retain(|&left_rad| left_rad > half_rad && TAU - left_rad > half_rad);
    left_rad.sort_by(f64::total_cmp);
    if left_rad.is_empty() {
        return Vec::new();
    }
    // The first ones by a turn to the left, the others by one to the right.
    let split = |first: usize| {
        let left = first.checked_sub(1).map_or(0.0, |last| left_rad[last] - half_rad);
        let right = left_rad.get(first).map_or(0.0, |next| TAU - next - half_rad);
        (left, right)
    };
    let length = |(left, right): (f64, f64)| left + right + left.min(right);
    let splits = (0..=left_rad.len()).map(split);
    let (left, right) = splits.min_by(|a, b| length(*a).total_cmp(&length(*b))).unwrap_or_default();
    let turns = if left <= right { [left, -left - right] } else { [-right, left + right] };
    turns.into_iter().filter(|&turn_rad| turn_rad != 0.0).collect()
}

/// The same angle from 0 to 2 pi.
fn turn_to(angle_rad: f64) -> f64 {
    angle_rad - TAU * libm::floor(angle_rad / TAU)
}

/// A turn in equal steps of at most so many radians.
pub(super) fn in_steps(turn_rad: f64, step_rad: f64) -> impl Iterator<Item = f64> {
    let steps = libm::ceil(turn_rad.abs() / step_rad).max(1.0);
    std::iter::repeat_n(turn_rad / steps, steps as usize)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use proptest::prelude::*;

    use super::*;

    #[test]
    fn what_is_ahead_needs_no_turn() {
        assert!(towards(&[], 0.0, 1.0).is_empty());
        assert!(towards(&[0.3, -0.3, 0.1], 0.0, 1.0).is_empty());
        assert!(towards(&[PI - 0.2, 0.2 - PI], PI, 1.0).is_empty());
    }

    #[test]
    fn shorter_side_comes_first() {
        let close = |turns: &[f64], expected: &[f64]| {
            assert_eq!(turns.len(), expected.len(), "{turns:?}");
            assert!(turns.iter().zip(expected).all(|(turn, expected)| (turn - expected).abs() < 1e-9), "{turns:?}");
        };
        close(&towards(&[1.0], 0.0, 1.0), &[0.6]);
        close(&towards(&[-1.0], 0.0, 1.0), &[-0.6]);
        close(&towards(&[1.0, -2.0], 0.0, 1.0), &[0.6, -2.2]);
        close(&towards(&[2.0, -1.0], 0.0, 1.0), &[-0.6, 2.2]);
        let all_around: Vec<f64> = (0..60).map(|at| f64::from(at) * TAU / 60.0).collect();
        let [turn_rad] = towards(&all_around, 0.0, 1.4)[..] else { panic!("one turn") };
        assert!((4.0..5.5).contains(&turn_rad.abs()), "{turn_rad}");
    }

    #[test]
    fn steps_add_up() {
        assert_eq!(in_steps(-3.0, 1.0).collect::<Vec<_>>(), [-1.0; 3]);
        assert_eq!(in_steps(2.5, f64::INFINITY).collect::<Vec<_>>(), [2.5]);
    }

    proptest! {
        #[test]
        fn every_azimuth_is_passed(
            azimuths in prop::collection::vec(-PI..PI, 0..12), yaw in -PI..PI, horizontal in 0.2..6.0,
        ) {
            let turns = towards(&azimuths, yaw, horizontal);
            prop_assert!(turns.iter().all(|turn| turn.abs() < 2.0 * TAU) && turns.len() <= 2);
            let mut ends = vec![0.0];
            turns.iter().for_each(|turn| ends.push(ends[ends.len() - 1] + turn));
            let [low, high] = [f64::min, f64::max].map(|of| ends.iter().copied().fold(0.0, of));
            for azimuth in azimuths {
                let left = turn_to(azimuth - yaw);
                let is_passed = |left: f64| (low - horizontal / 2.0..=high + horizontal / 2.0).contains(&left);
                prop_assert!(is_passed(left) || is_passed(left - TAU), "{left} {turns:?}");
            }
        }
    }
}
