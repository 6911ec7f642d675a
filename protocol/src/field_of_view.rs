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
