//! What the LiDAR of an agent sees of its surroundings, if that is not all.
//!
//! The message is `maes_msgs/FieldOfView`, the data of a message of the server to an agent.

use std::f64::consts::{FRAC_PI_2, TAU};

use msgs::ids::Tick;
use msgs::shared_bytes::SharedBytes;
use msgs::{cdr, maes_msgs};
use nalgebra::Vector3;

use crate::server_message::{check, decode};
use crate::wire_error::WireError;

/// The field of view of a LiDAR with a band of elevations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FieldOfView {
    /// Full angle about the heading, above 0, up to 2 pi, at which a turn shows nothing more.
    pub horizontal_rad: f64,
    /// Lowest elevation, radians.
    pub lowest_rad: f64,
    /// Highest elevation, radians.
    pub highest_rad: f64,
    /// Greatest angle between neighbouring rays, radians.
    pub spacing_rad: f64,
    /// A wall up to this distance is not seen, metres.
    pub min_range_m: f64,
}

impl FieldOfView {
    /// Whether a direction (any length) is seen with some heading.
    #[must_use]
    pub fn holds(&self, direction: &Vector3<f64>) -> bool {
        let elevation_rad = libm::atan2(direction.z, libm::hypot(direction.x, direction.y));
        (self.lowest_rad..=self.highest_rad).contains(&elevation_rad)
    }

    /// Whether the LiDAR sees the same with every heading.
    #[must_use]
    pub fn is_all_around(&self) -> bool {
        self.horizontal_rad >= TAU
    }

    /// The distance up to which no cell of this edge lies between two rays, metres.
    #[must_use]
    pub fn dense_range_m(&self, cell_m: f64) -> f64 {
        cell_m / self.spacing_rad
    }

    /// What several LiDARs of one body see together, at least: the widest band without a gap that
    /// their bands of elevations make, as far as a turn is needed for the narrowest, and as densely
    /// and as near as all of them do; `None` without any.
    #[must_use]
    pub fn together(views: &[Self]) -> Option<Self> {
        let mut bands: Vec<[f64; 2]> = views.iter().map(|view| [view.lowest_rad, view.highest_rad]).collect();
        bands.sort_by(|one, other| one[0].total_cmp(&other[0]));
        let mut joined: Vec<[f64; 2]> = Vec::new();
        for [lowest_rad, highest_rad] in bands {
            match joined.last_mut().filter(|below| lowest_rad <= below[1]) {
                Some(below) => below[1] = below[1].max(highest_rad),
                None => joined.push([lowest_rad, highest_rad]),
            }
        }
        let width_rad = |band: &[f64; 2]| band[1] - band[0];
        // The lowest of several that are as wide.
        let widest = joined.iter().rev().max_by(|one, other| width_rad(one).total_cmp(&width_rad(other)));
        let &[lowest_rad, highest_rad] = widest?;
        let greatest = |number: fn(&Self) -> f64| views.iter().map(number).fold(0.0, f64::max);
        Some(Self {
            horizontal_rad: views.iter().map(|view| view.horizontal_rad).fold(TAU, f64::min),
            lowest_rad,
            highest_rad,
            spacing_rad: greatest(|view| view.spacing_rad),
            min_range_m: greatest(|view| view.min_range_m),
        })
    }

    /// The data of the message of the server.
    #[must_use]
    pub fn to_data(&self) -> SharedBytes {
        let Self { horizontal_rad, lowest_rad, highest_rad, spacing_rad, min_range_m } = *self;
        let message = maes_msgs::FieldOfView { horizontal_rad, lowest_rad, highest_rad, spacing_rad, min_range_m };
        SharedBytes::from(cdr::encode(&message))
    }

    /// The field of view that the data of a message of the server in the observation of a tick
    /// holds.
    ///
    /// # Errors
    /// If it is no `maes_msgs/FieldOfView`, or a number in it is none that a run can have.
    pub fn from_data(data: &[u8], tick: Tick) -> Result<Self, WireError> {
        let message = decode(data, tick, "a maes_msgs/FieldOfView of kind FIELD_OF_VIEW")?;
        let maes_msgs::FieldOfView { horizontal_rad, lowest_rad, highest_rad, spacing_rad, min_range_m } = message;
        let numbers = [
            ("field_of_view.horizontal_rad", horizontal_rad, f64::MIN_POSITIVE, TAU),
            ("field_of_view.highest_rad", highest_rad, -FRAC_PI_2, FRAC_PI_2),
            ("field_of_view.lowest_rad", lowest_rad, -FRAC_PI_2, highest_rad),
            ("field_of_view.spacing_rad", spacing_rad, f64::MIN_POSITIVE, f64::MAX),
            ("field_of_view.min_range_m", min_range_m, 0.0, f64::MAX),
        ];
        check(tick, numbers)?;
        Ok(Self { horizontal_rad, lowest_rad, highest_rad, spacing_rad, min_range_m })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CAMERA: FieldOfView =
        FieldOfView { horizontal_rad: 1.4, lowest_rad: -0.5, highest_rad: 0.5, spacing_rad: 0.02, min_range_m: 0.3 };

    #[test]
    fn message_round_trips() {
        assert_eq!(FieldOfView::from_data(&CAMERA.to_data(), Tick(3)), Ok(CAMERA));
    }

    #[test]
    fn several_are_told_as_what_all_of_them_show() {
        let ring = FieldOfView { horizontal_rad: TAU, lowest_rad: -0.2, highest_rad: 0.2, ..CAMERA };
        let up = FieldOfView { lowest_rad: 0.4, highest_rad: 1.3, spacing_rad: 0.04, min_range_m: 0.1, ..CAMERA };
        assert_eq!(FieldOfView::together(&[ring]), Some(ring));
        let apart = FieldOfView { horizontal_rad: 1.4, spacing_rad: 0.04, ..up };
        assert_eq!(FieldOfView::together(&[ring, up]), Some(FieldOfView { min_range_m: 0.3, ..apart }));
        let whole = FieldOfView { lowest_rad: -0.5, min_range_m: 0.3, ..apart };
        assert_eq!(FieldOfView::together(&[up, ring, CAMERA]), Some(whole));
        assert_eq!(FieldOfView::together(&[]), None);
    }

    #[test]
    fn impossible_numbers_are_refused() {
        let refused = |view: FieldOfView| FieldOfView::from_data(&view.to_data(), Tick(3)).unwrap_err().to_string();
        let upside_down = refused(FieldOfView { lowest_rad: 0.6, ..CAMERA });
        assert!(upside_down.starts_with("observation of tick 3: field_of_view.lowest_rad = 0.6: expected"));
        assert!(upside_down.ends_with(" to 0.5"), "{upside_down}");
        assert!(refused(FieldOfView { horizontal_rad: 0.0, ..CAMERA }).contains("horizontal_rad = 0"));
        assert!(refused(FieldOfView { min_range_m: f64::NAN, ..CAMERA }).contains("min_range_m = NaN"));
        assert!(FieldOfView::from_data(&CAMERA.to_data()[..9], Tick(3)).is_err());
    }

    #[test]
    fn directions_are_held_by_their_elevation() {
        let holds = |x, y, z| CAMERA.holds(&Vector3::new(x, y, z));
        assert!(holds(1.0, 0.0, 0.5) && holds(0.0, -2.0, -1.0) && !holds(1.0, 0.0, 0.6) && !holds(0.0, 0.0, -1.0));
        assert!((CAMERA.dense_range_m(0.2) - 10.0).abs() < 1e-12);
    }
}
