//! Generalised winding numbers of points in a soup of triangles.
//!
//! The winding number is the signed solid angle of all triangles, divided by 4 pi: 1 inside a
//! closed surface that faces outwards, 0 outside, 2 where two solids overlap, and a fraction near
//! holes (A. Jacobson, L. Kavan, O. Sorkine-Hornung, "Robust inside-outside segmentation using
//! generalized winding numbers", 2013). Triangles that are far away count together, as a dipole (G.
//! Barill and others, "Fast winding numbers for soups and clouds", 2018).

use std::f64::consts::PI;

use super::super::FormatError;
use super::{Triangle, WorkBudget, normal};

/// Most triangles of a leaf.
const LEAF: usize = 8;

/// Steps of work for the solid angle of a triangle.
pub(super) const TRIANGLE_STEPS: usize = 8;

/// Distance from which a part of the mesh counts as a dipole, in its radii; 2 in the paper.
const FAR: f64 = 2.5;

/// A part of the mesh: a range of `order`, and two children unless it is a leaf.
struct Part {
    first: usize,
    end: usize,
    centre: [f64; 3],
    radius: f64,
    /// The sum of the normals, each as long as the area of its triangle.
    dipole: [f64; 3],
    children: Option<[usize; 2]>,
}

/// A hierarchy over triangles.
pub(super) struct Winding<'a> {
    triangles: &'a [Triangle],
    order: Vec<u32>,
    parts: Vec<Part>,
}

impl<'a> Winding<'a> {
    /// A hierarchy over all triangles.
    pub(super) fn new(triangles: &'a [Triangle]) -> Self {
        let centre = |index: u32| {
            let [a, b, c] = triangles[index as usize];
            [0, 1, 2].map(|axis| (a[axis] + b[axis] + c[axis]) / 3.0)
        };
        let mut order: Vec<u32> = (0..triangles.len() as u32).collect();
        let mut parts: Vec<Part> = Vec::new();
        let mut open = vec![(0, triangles.len(), None)];
        while let Some((first, end, parent)) = open.pop() {
            let number = parts.len();
            if let Some((parent, side)) = parent {
                let parent: &mut Part = &mut parts[parent];
                parent.children.get_or_insert([0; 2])[side] = number;
            }
            parts.push(part(triangles, &order[first..end], first));
            if end - first > LEAF {
                let mut low = [f64::INFINITY; 3];
                let mut high = [f64::NEG_INFINITY; 3];
                for at in order[first..end].iter().map(|&index| centre(index)) {
                    for axis in 0..3 {
                        (low[axis], high[axis]) = (low[axis].min(at[axis]), high[axis].max(at[axis]));
                    }
                }
                let longest = (1..3).fold(0, |a, b| if high[b] - low[b] > high[a] - low[a] { b } else { a });
                order[first..end]
                    .sort_unstable_by(|&a, &b| centre(a)[longest].total_cmp(&centre(b)[longest]).then(a.cmp(&b)));
                let middle = usize::midpoint(first, end);
                open.push((middle, end, Some((number, 1))));
                open.push((first, middle, Some((number, 0))));
            }
        }
        Self { triangles, order, parts }
    }

    /// The winding number at a point.
    ///
    /// # Errors
    /// If no work is left.
    pub(super) fn at(&self, point: [f64; 3], work: &mut WorkBudget) -> Result<f64, FormatError> {
        let mut angle = 0.0;
        let mut open = vec![0];
        while let Some(number) = open.pop() {
            let part = &self.parts[number];
            let to = [0, 1, 2].map(|axis| part.centre[axis] - point[axis]);
            let distance = libm::sqrt(dot(to, to));
            work.spend(1)?;
            if distance > FAR * part.radius && distance > 0.0 {
                angle += dot(part.dipole, to) / (distance * distance * distance);
            } else if let Some(children) = part.children {
                open.extend(children);
            } else {
                work.spend(TRIANGLE_STEPS * (part.end - part.first))?;
                angle += self.order[part.first..part.end]
                    .iter()
                    .map(|&index| solid_angle(&self.triangles[index as usize], point))
                    .sum::<f64>();
            }
        }
        Ok(angle / (4.0 * PI))
    }
}

fn part(triangles: &[Triangle], order: &[u32], first: usize) -> Part {
    let (mut area, mut centre, mut dipole) = (0.0, [0.0; 3], [0.0; 3]);
    for triangle in order.iter().map(|&index| &triangles[index as usize]) {
        let normal = normal(triangle).map(|along| along / 2.0);
        let size = libm::sqrt(dot(normal, normal));
        area += size;
        for axis in 0..3 {
            dipole[axis] += normal[axis];
            centre[axis] += size * (triangle[0][axis] + triangle[1][axis] + triangle[2][axis]) / 3.0;
        }
    }
    // Triangles have an area; the sum may still be too small for a quotient.
    let centre = if area > 0.0 { centre.map(|along| along / area) } else { triangles[order[0] as usize][0] };
    let square = order.iter().flat_map(|&index| triangles[index as usize]).fold(0.0f64, |most, corner| {
        let to = [0, 1, 2].map(|axis| corner[axis] - centre[axis]);
        most.max(dot(to, to))
    });
    Part { first, end: first + order.len(), centre, radius: libm::sqrt(square), dipole, children: None }
}

/// The signed solid angle of a triangle, positive if it faces away from the point (A. van Oosterom,
/// J. Strackee, "The solid angle of a plane triangle", 1983).
pub(super) fn solid_angle(triangle: &Triangle, point: [f64; 3]) -> f64 {
    let [a, b, c] = triangle.map(|corner| [0, 1, 2].map(|axis| corner[axis] - point[axis]));
    let [la, lb, lc] = [a, b, c].map(|corner| libm::sqrt(dot(corner, corner)));
    let volume =
        a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0]);
    2.0 * libm::atan2(volume, la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb)
}

pub(super) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
