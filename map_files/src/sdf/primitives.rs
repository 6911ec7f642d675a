//! Primitives of SDF as closed meshes, whose triangles face outwards.

use std::f64::consts::{PI, TAU};

use nalgebra::{Matrix4, Unit, UnitQuaternion, Vector3};

use super::super::frame::Bounds;
use super::super::mesh::{Mesh, polygon};
use super::geometry::Geometry;

/// Segments of a circle: they cut off less than 0.13 % of the radius.
const SEGMENTS: usize = 64;

/// The mesh of a shape that needs no file and has an end.
pub(super) fn mesh(shape: &Geometry) -> Mesh {
    match shape {
        Geometry::Box(size) => {
            let [x, y, _] = size.map(|along| along / 2.0);
            prism(&[vec![[-x, -y], [x, -y], [x, y], [-x, y]]], -size[2] / 2.0, size[2] / 2.0)
        }
        Geometry::Cylinder { radius, length } => {
            let corners: Vec<[f64; 2]> =
                (0..SEGMENTS).map(|segment| on_circle(segment).map(|at| at * radius)).collect();
            prism(&[corners], -length / 2.0, length / 2.0)
        }
        Geometry::Cone { radius, length } => turned(&[(*radius, -length / 2.0)], -length / 2.0, length / 2.0),
        Geometry::Ellipsoid(radii) => {
            let mut ball = turned(&arcs(1.0, 0.0), -1.0, 1.0);
            for place in &mut ball.vertices {
                *place = [0, 1, 2].map(|axis| place[axis] * radii[axis]);
            }
            ball
        }
        Geometry::Capsule { radius, length } => {
            turned(&arcs(*radius, length / 2.0), -length / 2.0 - radius, length / 2.0 + radius)
        }
        Geometry::Polyline { loops, height } => prism(&facing(loops), 0.0, *height),
        Geometry::Plane { .. } | Geometry::Mesh { .. } => Mesh::default(),
    }
}

/// A plane as a slab of the thickness of a cell below it, and its place. A level one reaches as far
/// as the bounds of all other shapes, in whatever size it is given; others have their size. `None`
/// if nothing else is there.
pub(super) fn slab(
    normal: [f64; 3],
    size: [f64; 2],
    place: &Matrix4<f64>,
    bounds: Option<Bounds>,
    cell_m: f64,
) -> Option<(Mesh, Matrix4<f64>)> {
    let Bounds { low, high } = bounds?;
    let up = Vector3::z_axis();
    let normal = Unit::try_new(Vector3::from(normal), 0.0)?;
    let in_world = place.transform_vector(&normal);
    if in_world.z > 1.0 - 1e-9 {
        let level = place[(2, 3)];
        let corners = vec![[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]];
        return Some((prism(&[corners], level - cell_m, level), Matrix4::identity()));
    }
    let turn = UnitQuaternion::rotation_between_axis(&up, &normal);
    let turn = turn.unwrap_or_else(|| super::super::placing::turn([1.0, 0.0, 0.0], PI));
    let [x, y] = size.map(|along| along / 2.0);
    let flat = prism(&[vec![[-x, -y], [x, -y], [x, y], [-x, y]]], -cell_m, 0.0);
    Some((flat, place * turn.to_homogeneous()))
}

/// A point of the unit circle.
fn on_circle(segment: usize) -> [f64; 2] {
    let (sine, cosine) = libm::sincos(TAU * segment as f64 / SEGMENTS as f64);
    [cosine, sine]
}

/// Loops that go round counterclockwise, and clockwise within an odd number of others.
fn facing(loops: &[Vec<[f64; 2]>]) -> Vec<Vec<[f64; 2]>> {
    let turned = |(number, corners): (usize, &Vec<[f64; 2]>)| {
        let others = loops.iter().enumerate().filter(|&(other, _)| other != number);
        let depth = others.filter(|(_, other)| is_inside(other, corners[0])).count();
        let is_hole = depth % 2 == 1;
        let mut corners = corners.clone();
        if (area(&corners) < 0.0) != is_hole {
            corners.reverse();
        }
        corners
    };
    loops.iter().enumerate().map(turned).collect()
}

/// Twice the area of a loop, positive if it goes round counterclockwise.
fn area(corners: &[[f64; 2]]) -> f64 {
    let next = corners.iter().cycle().skip(1);
    corners.iter().zip(next).map(|(a, b)| a[0] * b[1] - a[1] * b[0]).sum()
}

/// Whether a loop goes round a point, by the edges that a line from the point to the right crosses.
fn is_inside(corners: &[[f64; 2]], [x, y]: [f64; 2]) -> bool {
    let next = corners.iter().cycle().skip(1);
    let crosses = |(a, b): &(&[f64; 2], &[f64; 2])| {
        (a[1] > y) != (b[1] > y) && x < a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0])
    };
    corners.iter().zip(next).filter(crosses).count() % 2 == 1
}

/// A ground plan of loops between two heights, those within an odd number of others being holes.
/// The triangles of one that goes round clockwise face inwards, which the import of meshes mends.
fn prism(loops: &[Vec<[f64; 2]>], low: f64, high: f64) -> Mesh {
    let count = loops.iter().map(Vec::len).sum::<usize>() as u32;
    let mut mesh = Mesh::default();
    for z in [low, high] {
        mesh.vertices.extend(loops.iter().flatten().map(|&[x, y]| [x, y, z]));
    }
    for [a, b, c] in covers(loops).unwrap_or_else(|| fan(loops)) {
        mesh.triangles.extend([[a, c, b], [count + a, count + b, count + c]]);
    }
    let mut first = 0;
    for corners in loops {
        let length = corners.len() as u32;
        for at in 0..length {
            let [from, to] = [first + at, first + (at + 1) % length];
            mesh.add_polygon(&[from, to, to + count, from + count]);
        }
        first += length;
    }
    mesh
}

/// Triangles that cover a plan, of the numbers of its corners; `None` of one whose loops cross.
fn covers(loops: &[Vec<[f64; 2]>]) -> Option<Vec<[u32; 3]>> {
    let firsts: Vec<u32> = loops
        .iter()
        .scan(0, |next, corners| {
            let first = *next;
            *next += corners.len() as u32;
            Some(first)
        })
        .collect();
    let (outer, holes): (Vec<usize>, Vec<usize>) = (0..loops.len()).partition(|&number| area(&loops[number]) >= 0.0);
    // A hole belongs to the smallest loop around it.
    let around = |hole: usize| {
        let around = outer.iter().copied().filter(|&outer| is_inside(&loops[outer], loops[hole][0]));
        around.min_by(|&a, &b| area(&loops[a]).total_cmp(&area(&loops[b])))
    };
    let around: Vec<Option<usize>> = holes.iter().map(|&hole| around(hole)).collect();
    let mut triangles = Vec::new();
    for &outline in &outer {
        let of_outline = holes.iter().zip(&around).filter(|(_, around)| **around == Some(outline));
        let mut corners: Vec<(u32, [f64; 2])> = Vec::new();
        let mut begins = Vec::new();
        for number in std::iter::once(outline).chain(of_outline.map(|(&hole, _)| hole)) {
            begins.push(corners.len() as u32);
            corners.extend((firsts[number]..).zip(loops[number].iter().copied()));
        }
        let places: Vec<[f64; 3]> = corners.iter().map(|&(_, [x, y])| [x, y, 0.0]).collect();
        let cut = polygon::triangles(&places, &begins[1..])?;
        triangles.extend(cut.into_iter().map(|triangle| triangle.map(|place| corners[place as usize].0)));
    }
    Some(triangles)
}

/// Triangles between the first corner of all and each edge: outside of the plan they overlap, and
/// their turns cancel.
fn fan(loops: &[Vec<[f64; 2]>]) -> Vec<[u32; 3]> {
    let mut first = 0;
    let mut triangles = Vec::new();
    for corners in loops {
        let length = corners.len() as u32;
        let edges = (0..length).map(|at| [first + at, first + (at + 1) % length]);
        triangles.extend(edges.filter(|[from, to]| *from != 0 && *to != 0).map(|[from, to]| [0, from, to]));
        first += length;
    }
    triangles
}

/// Rings of a ball of a radius that is cut in half, the halves so far from the origin.
fn arcs(radius: f64, apart: f64) -> Vec<(f64, f64)> {
    let quarter = SEGMENTS / 4;
    let ring = |step: usize| {
        let (sine, cosine) = libm::sincos(PI * step as f64 / (2 * quarter) as f64);
        (radius * sine, -radius * cosine)
    };
    let lower = (1..=quarter).map(|step| (ring(step).0, ring(step).1.min(0.0) - apart));
    let upper = (0..quarter).rev().filter(|&step| step > 0).map(|step| (ring(step).0, -ring(step).1 + apart));
    let middle = (apart > 0.0).then_some((radius, apart));
    lower.chain(middle).chain(upper).collect()
}

/// A body around z: rings of radii and heights from below, between two tips.
fn turned(rings: &[(f64, f64)], low: f64, high: f64) -> Mesh {
    let count = SEGMENTS as u32;
    let mut mesh = Mesh::default();
    for &(radius, z) in rings {
        mesh.vertices.extend((0..SEGMENTS).map(|segment| {
            let [x, y] = on_circle(segment);
            [radius * x, radius * y, z]
        }));
    }
    let bottom = mesh.vertices.len() as u32;
    mesh.vertices.extend([[0.0, 0.0, low], [0.0, 0.0, high]]);
    let last = bottom - count;
    for at in 0..count {
        let next = (at + 1) % count;
        mesh.triangles.push([bottom, next, at]);
        for ring in (0..last).step_by(SEGMENTS) {
            mesh.add_polygon(&[ring + at, ring + next, ring + next + count, ring + at + count]);
        }
        mesh.triangles.push([bottom + 1, last + at, last + next]);
    }
    mesh
}
