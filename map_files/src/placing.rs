//! Turns and places of the parts of a scene, the same on every machine.

use nalgebra::{Matrix4, Quaternion, Unit, UnitQuaternion, Vector3};

use super::FormatError;
use super::mesh::{Mesh, TRIANGLES_MAX};

/// The turn about an axis by an angle in radians; none about an axis without length.
pub(super) fn turn(axis: [f64; 3], radians: f64) -> UnitQuaternion<f64> {
    let Some(axis) = Unit::try_new(Vector3::from(axis), 0.0) else { return UnitQuaternion::identity() };
    let (sine, cosine) = libm::sincos(radians / 2.0);
    let [x, y, z] = [axis.x, axis.y, axis.z].map(|along| along * sine);
    UnitQuaternion::from_quaternion(Quaternion::new(cosine, x, y, z))
}

/// The turn by roll, pitch and yaw about the fixed axes x, y and z, in this order, in radians.
pub(super) fn turn_rpy([roll, pitch, yaw]: [f64; 3]) -> UnitQuaternion<f64> {
    turn([0.0, 0.0, 1.0], yaw) * turn([0.0, 1.0, 0.0], pitch) * turn([1.0, 0.0, 0.0], roll)
}

impl Mesh {
    /// Adds a mesh at a place. If the place mirrors it, its triangles go round the other way.
    ///
    /// # Errors
    /// If there are too many triangles.
    pub(super) fn add_placed(&mut self, other: &Self, place: &Matrix4<f64>) -> Result<(), FormatError> {
        // Without triangles, vertices count.
        if self.vertices.len() + other.vertices.len() > 3 * TRIANGLES_MAX {
            return Err(FormatError::TooManyTriangles { triangles_max: TRIANGLES_MAX });
        }
        let first = self.vertices.len() as u32;
        self.vertices.extend(other.vertices.iter().map(|&[x, y, z]| {
            let placed = place * nalgebra::Vector4::new(x, y, z, 1.0);
            [placed.x, placed.y, placed.z]
        }));
        let is_mirror = place.fixed_view::<3, 3>(0, 0).determinant() < 0.0;
        self.triangles.extend(other.triangles.iter().map(|&[a, b, c]| {
            let [b, c] = if is_mirror { [c, b] } else { [b, c] };
            [a, b, c].map(|corner| corner + first)
        }));
        self.check_count()
    }
}
