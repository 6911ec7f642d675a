//! The geometries of SDF.

use std::path::{Path, PathBuf};

use roxmltree::Node;

use super::super::{FormatError, xml};
use super::path_of;

/// Largest number of corners of a polyline.
const CORNERS_MAX: usize = 1 << 16;

/// A shape in its own frame, lengths in metres.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Geometry {
    /// Around the origin.
    Box([f64; 3]),
    /// Radii.
    Ellipsoid([f64; 3]),
    /// Around z.
    Cylinder { radius: f64, length: f64 },
    /// Around z, its tip upwards.
    Cone { radius: f64, length: f64 },
    /// A cylinder with two half spheres at its ends.
    Capsule { radius: f64, length: f64 },
    /// A wall of a ground plan from z = 0 upwards.
    Polyline { corners: Vec<[f64; 2]>, height: f64 },
    /// The upper side of what is below it.
    Plane { normal: [f64; 3], size: [f64; 2] },
    /// A mesh of a file.
    Mesh { file: PathBuf, scale: [f64; 3] },
}

impl Geometry {
    /// The shape of an element; `None` of an empty one.
    ///
    /// # Errors
    /// If it is malformed, or of a kind that is not read.
    pub(super) fn of(element: Node<'_, '_>, folder: &Path) -> Result<Option<Self>, FormatError> {
        let Some(shape) = element.children().find(Node::is_element) else { return Ok(None) };
        let optional = |name: &'static str, count: usize| {
            let Some(child) = xml::child(shape, name) else { return Ok(None) };
            let numbers = xml::numbers::<f64>(child, count)?;
            let is_right = numbers.len() == count && numbers.iter().all(|number| number.is_finite());
            if is_right {
                Ok(Some(numbers))
            } else {
                Err(xml::fault(child, format_args!("expected {count} finite numbers")))
            }
        };
        let positive = |name: &'static str, count: usize| {
            let numbers = optional(name, count)?.ok_or_else(|| xml::fault(shape, format_args!("it has no {name}")))?;
            let is_right = numbers.iter().all(|&number| number > 0.0);
            if is_right { Ok(numbers) } else { Err(xml::fault(shape, format_args!("{name} is not above 0"))) }
        };
        let one = |name| positive(name, 1).map(|numbers| numbers[0]);
        let three = |numbers: Vec<f64>| [numbers[0], numbers[1], numbers[2]];
        Ok(Some(match shape.tag_name().name() {
            "empty" => return Ok(None),
            "box" => Self::Box(three(positive("size", 3)?)),
            "sphere" => Self::Ellipsoid([one("radius")?; 3]),
            "ellipsoid" => Self::Ellipsoid(three(positive("radii", 3)?)),
            "cylinder" => Self::Cylinder { radius: one("radius")?, length: one("length")? },
            "cone" => Self::Cone { radius: one("radius")?, length: one("length")? },
            "capsule" => Self::Capsule { radius: one("radius")?, length: one("length")? },
            "polyline" => {
                let mut corners = Vec::new();
                for point in xml::children(shape, "point") {
                    let numbers = xml::numbers::<f64>(point, 2)?;
                    if numbers.len() != 2 || !numbers.iter().all(|number| number.is_finite()) {
                        return Err(xml::fault(point, "expected 2 finite numbers"));
                    }
                    corners.push([numbers[0], numbers[1]]);
                }
                if xml::children(element, "polyline").count() > 1 || !(3..=CORNERS_MAX).contains(&corners.len()) {
                    let reason = "polylines with holes, of less than 3 points or of many are not read; save a mesh";
                    return Err(xml::fault(shape, reason));
                }
                Self::Polyline { corners, height: one("height")? }
            }
            "plane" => {
                let normal = optional("normal", 3)?.map_or([0.0, 0.0, 1.0], three);
                if normal == [0.0; 3] {
                    return Err(xml::fault(shape, "its normal has no length"));
                }
                let size = optional("size", 2)?.map_or([1.0; 2], |size| [size[0], size[1]]);
                Self::Plane { normal, size }
            }
            "mesh" => {
                let uri = xml::child(shape, "uri").and_then(|uri| uri.text()).map(str::trim).unwrap_or_default();
                let file = path_of(uri, folder);
                let file = file.map_err(|reason| xml::fault(shape, format_args!("uri {uri:?} {reason}")))?;
                if xml::child(shape, "submesh").is_some() {
                    return Err(xml::fault(shape, "submesh is not read; save the part as a file of its own"));
                }
                Self::Mesh { file, scale: optional("scale", 3)?.map_or([1.0; 3], three) }
            }
            "heightmap" => {
                let reason = "height maps are not read; export the terrain as a mesh (.dae, .obj, .stl)";
                return Err(xml::fault(shape, reason));
            }
            name => {
                let reason = format!("geometries of kind {} are not read; export them as a mesh", name.escape_debug());
                return Err(xml::fault(shape, reason));
            }
        }))
    }
}
