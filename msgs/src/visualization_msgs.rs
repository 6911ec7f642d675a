//! The package `visualization_msgs`: things that viewers draw.

use serde::{Deserialize, Serialize};

use crate::builtin_interfaces::Duration;
use crate::geometry_msgs::{Point, Pose, Vector3};
use crate::sensor_msgs::CompressedImage;
use crate::std_msgs::{ColorRGBA, Header};

/// Something to draw, or to draw no more. The same `ns` and `id` mean the same thing: a later
/// marker takes the place of an earlier one.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Marker {
    /// Sim time, and the frame of `pose`.
    pub header: Header,
    /// The group that it belongs to.
    pub ns: String,
    /// Which of the group it is.
    pub id: i32,
    /// What it looks like; one of the constants from `ARROW` on.
    pub r#type: i32,
    /// What to do with it; one of the constants from `ADD` on.
    pub action: i32,
    /// Where its points are counted from.
    pub pose: Pose,
    /// How large it is, metres; of a list of cubes each cube, of lines `x` is the width.
    pub scale: Vector3,
    /// Its colour.
    pub color: ColorRGBA,
    /// For how long it is drawn; zero: until it is deleted.
    pub lifetime: Duration,
    /// Whether it moves with its frame.
    pub frame_locked: bool,
    /// Centres of cubes, or ends of lines.
    pub points: Vec<Point>,
    /// A colour for each point, or none.
    pub colors: Vec<ColorRGBA>,
    /// Not used here.
    pub texture_resource: String,
    /// Not used here.
    pub texture: CompressedImage,
    /// Not used here.
    pub uv_coordinates: Vec<UVCoordinate>,
    /// Not used here.
    pub text: String,
    /// Not used here.
    pub mesh_resource: String,
    /// Not used here.
    pub mesh_file: MeshFile,
    /// Not used here.
    pub mesh_use_embedded_materials: bool,
}

impl Marker {
    /// `type`: an arrow.
    pub const ARROW: i32 = 0;
    /// `type`: a cube.
    pub const CUBE: i32 = 1;
    /// `type`: a sphere.
    pub const SPHERE: i32 = 2;
    /// `type`: a cylinder.
    pub const CYLINDER: i32 = 3;
    /// `type`: a line from point to point.
    pub const LINE_STRIP: i32 = 4;
    /// `type`: a line for each two points.
    pub const LINE_LIST: i32 = 5;
    /// `type`: a cube about each point.
    pub const CUBE_LIST: i32 = 6;
    /// `type`: a sphere about each point.
    pub const SPHERE_LIST: i32 = 7;
    /// `type`: dots.
    pub const POINTS: i32 = 8;
    /// `type`: a text that turns to the viewer.
    pub const TEXT_VIEW_FACING: i32 = 9;
    /// `type`: a mesh from a file.
    pub const MESH_RESOURCE: i32 = 10;
    /// `type`: a triangle for each three points.
    pub const TRIANGLE_LIST: i32 = 11;
    /// `type`: an arrow from point to point.
    pub const ARROW_STRIP: i32 = 12;

    /// `action`: draw it.
    pub const ADD: i32 = 0;
    /// `action`: the same as `ADD`.
    pub const MODIFY: i32 = 0;
    /// `action`: draw it no more.
    pub const DELETE: i32 = 2;
    /// `action`: draw nothing of the group any more.
    pub const DELETEALL: i32 = 3;
}

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

/// Several markers.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MarkerArray {
    /// The markers.
    pub markers: Vec<Marker>,
}

/// A place on a picture, from 0 to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct UVCoordinate {
    /// From the left.
    pub u: f32,
    /// From the top.
    pub v: f32,
}

/// A file with a mesh.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct MeshFile {
    /// Its name.
    pub filename: String,
    /// Its content.
    #[serde(with = "serde_bytes")]
    pub data: Vec<u8>,
}
