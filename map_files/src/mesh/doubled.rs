//! Surfaces whose faces all stand twice, once facing each way, as modellers draw two-sided walls.
//!
//! The turns of two such faces cancel, so that a room of them would lose its walls: one of each
//! pair is dropped. Two solids that touch have such a pair between them as well, and there it has
//! to stay. Closedness tells these apart: whether one face of each pair, or none, leaves fewer
//! edges with an odd number of faces. A two-sided sheet encloses nothing and stays as well.
//!
//! Faces are triangles, or polygons of two or more that follow each other in the file, because a
//! reversed polygon may be cut along another diagonal.

use std::ops::Range;

use super::orientation::{Sets, by_first_corner, hash};
use super::{Triangle, normal};

/// Most triangles of a face, in the order in which pairs of faces are looked for.
const FACE_TRIANGLES: [usize; 3] = [1, 2, usize::MAX];

/// Share of the area of an open surface, by its border, from which on it is a sheet and no room.
const SHEET: f64 = 0.5;

/// A face and its doubles: ranges of triangles in the order of the file, as many in each
/// orientation.
type Doubles = Vec<Range<usize>>;

/// Drops one of each pair of faces of two-sided surfaces from triangles, of which `corners` are the
/// places and `vertices` the numbers in the file, and returns the number of triangles that this
/// drops.
pub(super) fn drop_backs(
    triangles: &mut Vec<Triangle>,
    vertices: &mut Vec<[u32; 3]>,
    corners: &mut Vec<[u32; 3]>,
) -> usize {
    let mut is_single = vec![true; triangles.len()];
    let mut doubles: Vec<Doubles> = Vec::new();
    for most in FACE_TRIANGLES {
        for found in find(corners, &faces(corners, &is_single, most)) {
            found.iter().cloned().flatten().for_each(|triangle| is_single[triangle] = false);
            doubles.push(found);
        }
    }
    if doubles.is_empty() {
        return 0;
    }
    let mut is_dropped = vec![false; triangles.len()];
    for (faces, is_surface) in doubles.iter().zip(are_surfaces(triangles, corners, &is_single, &doubles)) {
        if is_surface {
            // The first of them are those of one side, if a file has one side after the other.
            let backs = &faces[faces.len() / 2..];
            backs.iter().cloned().flatten().for_each(|triangle| is_dropped[triangle] = true);
        }
    }
    let before = triangles.len();
    let keep = || {
        let mut dropped = is_dropped.iter();
        move || dropped.next() == Some(&false)
    };
    let (mut of_triangles, mut of_vertices, mut of_corners) = (keep(), keep(), keep());
    triangles.retain(|_| of_triangles());
    vertices.retain(|_| of_vertices());
    corners.retain(|_| of_corners());
    by_first_corner(corners, 3 * before);
    before - triangles.len()
}

/// The faces of the triangles that are left, of `most` triangles or fewer: all triangles, or what
/// has two or more.
fn faces(corners: &[[u32; 3]], is_left: &[bool], most: usize) -> Vec<Range<usize>> {
    let mut faces = Vec::new();
    let mut first = 0;
    while first < corners.len() {
        let mut end = first + 1;
        let continues = |end: usize| {
            let [apex, from, _] = corners[end];
            let is_fan = apex == corners[first][0] && from == corners[end - 1][2];
            is_left[end] && (is_fan || (most == 2 && quad(corners[first], corners[end]).is_some()))
        };
        while is_left[first] && end - first < most && end < corners.len() && continues(end) {
            end += 1;
        }
        if is_left[first] && (most == 1 || end - first > 1) {
            faces.push(first..end);
        }
        first = end;
    }
    faces
}

/// The corners around two triangles that share an edge.
fn quad(first: [u32; 3], second: [u32; 3]) -> Option<[u32; 4]> {
    let turns = |[a, b, c]: [u32; 3]| [[a, b, c], [b, c, a], [c, a, b]];
    turns(first).into_iter().find_map(|[a, b, c]| {
        let beside = turns(second).into_iter().find(|&[from, to, _]| (from, to) == (a, c));
        beside.map(|[.., d]| [a, b, c, d])
    })
}

/// The corners around a face.
fn outline(corners: &[[u32; 3]], face: &Range<usize>) -> Vec<u32> {
    let corners = &corners[face.clone()];
    if let &[first, second] = corners
        && let Some(quad) = quad(first, second)
    {
        return quad.to_vec();
    }
    let [first, second, _] = corners[0];
    [first, second].into_iter().chain(corners.iter().map(|&[_, _, last]| last)).collect()
}

/// The corners around a face, from the lowest one on to its lower neighbour, and whether the face
/// passes them so.
fn undirected(corners: &[[u32; 3]], face: &Range<usize>) -> (Vec<u32>, bool) {
    let mut around = outline(corners, face);
    let lowest = around.iter().enumerate().min_by_key(|&(_, corner)| corner).map_or(0, |(at, _)| at);
    around.rotate_left(lowest);
    let is_forward = around[1] < around[around.len() - 1];
    if !is_forward {
        around[1..].reverse();
    }
    (around, is_forward)
}

/// The faces that stand as often in one orientation as in the other.
fn find(corners: &[[u32; 3]], faces: &[Range<usize>]) -> Vec<Doubles> {
    let sum =
        |corners: &[u32]| corners.iter().fold(0, |sum: u64, &corner| sum.wrapping_add(hash([u64::from(corner), 0, 0])));
    let key = |face: &Range<usize>| match &corners[face.clone()] {
        [triangle] => sum(triangle),
        _ => sum(&outline(corners, face)),
    };
    let mut by_key: Vec<(u64, u32)> = faces.iter().zip(0..).map(|(face, number)| (key(face), number)).collect();
    by_key.sort_unstable();
    let mut doubles = Vec::new();
    for alike in by_key.chunk_by(|a, b| a.0 == b.0).filter(|alike| alike.len() > 1) {
        let with_outline = |&(_, number): &(u64, u32)| {
            let (around, is_forward) = undirected(corners, &faces[number as usize]);
            (around, number, is_forward)
        };
        let mut alike: Vec<(Vec<u32>, u32, bool)> = alike.iter().map(with_outline).collect();
        alike.sort_unstable();
        for same in alike.chunk_by(|a, b| a.0 == b.0) {
            if same.iter().filter(|(.., is_forward)| *is_forward).count() * 2 == same.len() {
                doubles.push(same.iter().map(|&(_, number, _)| faces[number as usize].clone()).collect());
            }
        }
    }
    doubles
}

/// The triangles of the first half of the faces.
fn fronts(faces: &Doubles) -> impl Iterator<Item = usize> {
    faces[..faces.len() / 2].iter().cloned().flatten()
}

/// An edge: its two corners, the lower first, and which of the doubles it belongs to, if any.
type Edge = (u32, u32, Option<u32>);

/// What is known of doubles that share edges.
#[derive(Default, Clone)]
struct Surface {
    /// Whether other triangles share an edge with it.
    is_joined: bool,
    /// Edges with an odd number of triangles: without its faces, with one of each pair, and of
    /// these alone.
    odd: [usize; 3],
    /// The sum of the normals of its faces, and of their lengths.
    normal: [f64; 3],
    area: f64,
}

/// Which doubles are those of a two-sided surface.
fn are_surfaces(triangles: &[Triangle], corners: &[[u32; 3]], is_single: &[bool], doubles: &[Doubles]) -> Vec<bool> {
    let mut edges: Vec<Edge> = Vec::new();
    let mut add = |triangle: usize, of: Option<u32>| {
        let [a, b, c] = corners[triangle];
        edges.extend([(a, b), (b, c), (c, a)].map(|(from, to)| (from.min(to), from.max(to), of)));
    };
    (0..triangles.len()).filter(|&triangle| is_single[triangle]).for_each(|triangle| add(triangle, None));
    for (faces, number) in doubles.iter().zip(0..) {
        fronts(faces).for_each(|triangle| add(triangle, Some(number)));
    }
    edges.sort_unstable();
    let of_doubles = |edge: &[Edge]| edge.iter().filter_map(|&(.., of)| of).collect::<Vec<u32>>();
    let mut sets = Sets::new(doubles.len());
    for edge in edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
        of_doubles(edge).windows(2).for_each(|pair| sets.join(pair[0], pair[1]));
    }
    let mut surfaces = vec![Surface::default(); doubles.len()];
    for edge in edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
        let here = of_doubles(edge);
        let Some(&first) = here.first() else { continue };
        let surface = &mut surfaces[sets.root(first) as usize];
        let others = edge.len() - here.len();
        surface.is_joined |= others > 0;
        surface.odd[0] += others % 2;
        surface.odd[1] += edge.len() % 2;
        surface.odd[2] += here.len() % 2;
    }
    for (faces, number) in doubles.iter().zip(0..) {
        let surface = &mut surfaces[sets.root(number) as usize];
        for triangle in fronts(faces) {
            surface.area += super::area(&triangles[triangle]);
            let normal = normal(&triangles[triangle]);
            (0..3).for_each(|axis| surface.normal[axis] += normal[axis] / 2.0);
        }
    }
    let is_surface = |&Surface { is_joined, odd: [without, with, alone], normal, area }: &Surface| {
        let border_area = libm::sqrt(normal.iter().map(|along| along * along).sum());
        let is_closed = alone == 0 && with == without;
        with < without || is_closed || (!is_joined && border_area <= SHEET * area)
    };
    (0..doubles.len() as u32).map(|number| is_surface(&surfaces[sets.root(number) as usize])).collect()
}
