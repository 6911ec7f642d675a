//! Polygons as triangles that cover them, and nothing beside them.
//!
//! A fan from the first corner covers a convex polygon. Of another one its triangles reach beyond
//! the edges; their turns cancel, but a surface does not end where it should. Such a polygon is cut
//! by the crate earcut (which of those for triangulation has no dependencies of weight, and takes
//! holes and corners on a line). What it cannot cut, such as edges that cross, stays a fan.

use earcut::Earcut;
use earcut::utils3d::project3d_to_2d;

use super::super::frame::Bounds;
use super::normal;

/// Most corners of a polygon that is cut: the work may grow with their square.
const CORNERS_MAX: usize = 1 << 14;

/// Largest difference of the area that is covered, as a share.
const DEVIATION_MAX: f64 = 1e-6;

/// The triangles of a polygon, as places in the list of its corners; `holes` are the places at
/// which the corners of its holes begin. They go round as the polygon does. `None` if they would
/// cover more or less than the polygon.
pub(in super::super) fn triangles(corners: &[[f64; 3]], holes: &[u32]) -> Option<Vec<[u32; 3]>> {
    if holes.is_empty() && is_covered_by_fan(corners) {
        return Some((2..corners.len() as u32).map(|place| [0, place - 1, place]).collect());
    }
    let outer = holes.first().map_or(corners.len(), |&first| first as usize);
    if corners.len() > CORNERS_MAX || !corners.iter().flatten().all(|along| along.is_finite()) {
        return None;
    }
    // Lengths around 1, as far as they go: the projection takes areas below 1e-30 for none.
    let Bounds { low, high } = Bounds::of(corners.iter().copied())?;
    let span = (0..3).map(|axis| high[axis] - low[axis]).fold(f64::MIN_POSITIVE, f64::max);
    let scaled: Vec<[f64; 3]> =
        corners.iter().map(|corner| [0, 1, 2].map(|axis| (corner[axis] - low[axis]) / span)).collect();
    let mut flat = Vec::new();
    if !project3d_to_2d(&scaled, outer, &mut flat) {
        return None;
    }
    let mut cut: Vec<u32> = Vec::new();
    Earcut::new().earcut_slice(&flat, holes, &mut cut);
    if earcut::deviation(flat.iter().copied(), holes, &cut) > DEVIATION_MAX {
        return None;
    }
    let raised = |place: u32| [flat[place as usize][0], flat[place as usize][1], 0.0];
    Some(
        cut.chunks_exact(3)
            .map(|three| {
                let [a, b, c] = [three[0], three[1], three[2]];
                // Its plane has the polygon go round counter-clockwise.
                if normal(&[a, b, c].map(raised))[2] < 0.0 { [a, c, b] } else { [a, b, c] }
            })
            .collect(),
    )
}

/// Whether a fan from the first corner covers a polygon: none of its triangles is turned the other
/// way than the polygon.
fn is_covered_by_fan(corners: &[[f64; 3]]) -> bool {
    let normals: Vec<[f64; 3]> = corners[1..].windows(2).map(|edge| normal(&[corners[0], edge[0], edge[1]])).collect();
    let whole = normals.iter().fold([0.0; 3], |sum, normal| [0, 1, 2].map(|axis| sum[axis] + normal[axis]));
    normals.iter().all(|normal| (0..3).map(|axis| normal[axis] * whole[axis]).sum::<f64>() >= 0.0)
}

#[cfg(test)]
mod tests {
    use super::super::Mesh;
    use super::*;

    fn area_of(corners: &[[f64; 3]], triangles: &[[u32; 3]]) -> f64 {
        let of = |triangle: &[u32; 3]| normal(&triangle.map(|place| corners[place as usize]));
        triangles.iter().map(|triangle| of(triangle).iter().map(|along| along * along).sum::<f64>().sqrt() / 2.0).sum()
    }

    /// An L of area 3 in a plane, from each of its corners and both ways round.
    #[test]
    fn concave_polygons_are_covered_from_each_corner() {
        let outline = [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]];
        for first in 0..6 {
            for is_clockwise in [false, true] {
                let mut corners: Vec<[f64; 3]> =
                    (0..6).map(|at| outline[(first + at) % 6]).map(|[x, y]| [x, 0.6 * y, 0.8 * y]).collect();
                if is_clockwise {
                    corners.reverse();
                }
                let mut mesh = Mesh { vertices: corners.clone(), ..Mesh::default() };
                mesh.add_polygon(&[0, 1, 2, 3, 4, 5]);
                assert!((area_of(&corners, &mesh.triangles) - 3.0).abs() < 1e-12, "{first} {is_clockwise}");
                // All go round as the polygon does.
                let up = if is_clockwise { -1.0 } else { 1.0 };
                let turned = |triangle: &[u32; 3]| normal(&triangle.map(|place| corners[place as usize]))[2] * up < 0.0;
                assert!(!mesh.triangles.iter().any(turned), "{first} {is_clockwise}");
            }
        }
    }

    #[test]
    fn crossing_edges_stay_a_fan() {
        let corners = [[0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.5, 0.0]];
        let mut mesh = Mesh { vertices: corners.to_vec(), ..Mesh::default() };
        mesh.add_polygon(&[0, 1, 2, 3]);
        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
    }
}
