//! The package `visualization_msgs`: things that viewers draw.

use crate::geometry_msgs::{Point, Vector3};
use crate::std_msgs::{ColorRGBA, Header};

include!(concat!(env!("OUT_DIR"), "/visualization_msgs.rs"));

impl Marker {
    /// Cubes with an edge of `edge_m` about these points, in the frame of the header; without
    /// points, no cubes any more.
    #[must_use]
    pub fn cubes(header: Header, ns: &str, id: i32, edge_m: f64, color: ColorRGBA, points: Vec<Point>) -> Self {
        let scale = Vector3 { x: edge_m, y: edge_m, z: edge_m };
        Self::list(Self::CUBE_LIST, header, ns, id, scale, color, points)
    }

    /// A line of this width for each two points, in the frame of the header; without points, no
    /// lines any more.
    #[must_use]
    pub fn lines(header: Header, ns: &str, id: i32, width_m: f64, color: ColorRGBA, points: Vec<Point>) -> Self {
        let scale = Vector3 { x: width_m, ..Vector3::default() };
        Self::list(Self::LINE_LIST, header, ns, id, scale, color, points)
    }

    fn list(
        r#type: i32,
        header: Header,
        ns: &str,
        id: i32,
        scale: Vector3,
        color: ColorRGBA,
        points: Vec<Point>,
    ) -> Self {
        let action = if points.is_empty() { Self::DELETE } else { Self::ADD };
        Self { header, ns: ns.to_owned(), id, r#type, action, scale, color, points, ..Self::default() }
    }
}
