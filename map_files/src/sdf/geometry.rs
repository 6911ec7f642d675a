//! The geometries of SDF.

use std::path::{Path, PathBuf};

use roxmltree::Node;

use super::super::{FormatError, xml};
use super::path_of;

/// Largest number of corners of a polyline.
const CORNERS_MAX: usize = 1 << 16;

/// Distance of the last corner of a loop from the first one within which they are the same, metres;
/// that of gz-common.
const CLOSED_M: f64 = 1e-4;

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
    /// A wall of a ground plan from z = 0 upwards. Loops within others are holes, and islands in
    /// these.
    Polyline { loops: Vec<Vec<[f64; 2]>>, height: f64 },
    /// The upper side of what is below it.
    Plane { normal: [f64; 3], size: [f64; 2] },
    /// A mesh of a file, or parts of it.
    Mesh { file: PathBuf, scale: [f64; 3], part: Option<Part> },
}

/// The parts of a mesh that have a name.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Part {
    pub(super) name: String,
    /// Whether its middle is to be at the origin.
    pub(super) is_centred: bool,
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
                let loops: Result<Vec<_>, _> = xml::children(element, "polyline").map(corners).collect();
                let loops = loops?;
                if loops.iter().map(Vec::len).sum::<usize>() > CORNERS_MAX {
                    return Err(xml::fault(shape, format_args!("polylines have at most {CORNERS_MAX} points")));
                }
                // That of the first loop counts for all.
                let height = optional("height", 1)?.map_or(1.0, |height| height[0]);
                if height <= 0.0 {
                    return Err(xml::fault(shape, "height is not above 0"));
                }
                Self::Polyline { loops, height }
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
                let part = xml::child(shape, "submesh").map(part).transpose()?;
                Self::Mesh { file, scale: optional("scale", 3)?.map_or([1.0; 3], three), part }
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

/// The corners of a loop, of which the last one may be the first again.
fn corners(polyline: Node<'_, '_>) -> Result<Vec<[f64; 2]>, FormatError> {
    let mut corners = Vec::new();
    for point in xml::children(polyline, "point") {
        let numbers = xml::numbers::<f64>(point, 2)?;
        if numbers.len() != 2 || !numbers.iter().all(|number| number.is_finite()) {
            return Err(xml::fault(point, "expected 2 finite numbers"));
        }
        corners.push([numbers[0], numbers[1]]);
    }
    if let (Some(first), Some(last)) = (corners.first(), corners.last())
        && (0..2).all(|axis| (last[axis] - first[axis]).abs() <= CLOSED_M)
    {
        corners.pop();
    }
    let enough = corners.len() >= 3;
    if enough { Ok(corners) } else { Err(xml::fault(polyline, "a polyline has at least 3 points")) }
}

/// The part that a submesh names.
fn part(submesh: Node<'_, '_>) -> Result<Part, FormatError> {
    let text = |name| xml::child(submesh, name).and_then(|child| child.text()).map(str::trim).unwrap_or_default();
    let name = text("name").to_owned();
    let is_centred = match text("center") {
        "" | "0" | "false" => false,
        "1" | "true" => true,
        other => {
            let reason = format!("center is {:?}, expected true or false", other.escape_debug().to_string());
            return Err(xml::fault(submesh, reason));
        }
    };
    if name.is_empty() {
        return Err(xml::fault(submesh, "it has no name; name the part of the mesh, or leave it out"));
    }
    Ok(Part { name, is_centred })
}
