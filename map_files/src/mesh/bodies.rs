//! Bodies of a mesh: closed sets of triangles that touch others at edges.
//!
//! At an edge that boxes share, four triangles or more meet, and the mesh alone does not say which
//! of them belong together. Two things do: vertices of their own, in the formats that number
//! vertices, and the order of the file, as programs write one object after the other. A body that
//! either tells from the others gets corners of its own, so that it is oriented by itself.

use std::collections::BTreeMap;

use super::orientation::{Edge, Sets, around};

/// The corners of triangles, apart for each body; `None` if nothing has to be told apart, because
/// two triangles meet at each edge. `vertices` are the numbers that the file gives the corners of a
/// triangle.
///
/// A corner is the first one of its body at its place.
pub(super) fn apart(
    corners: &[[u32; 3]],
    edges: &[Edge],
    vertices: impl Fn(usize) -> [u32; 3],
) -> Option<Vec<[u32; 3]>> {
    if around(edges).all(|edge| edge.len() == 2) {
        return None;
    }
    let bodies = bodies(corners.len(), edges, vertices);
    let mut own: BTreeMap<(u32, u32), u32> = BTreeMap::new();
    let mut apart = corners.to_vec();
    let corners =
        apart.iter_mut().zip(&bodies).flat_map(|(corners, body)| corners.iter_mut().map(move |at| (at, body)));
    for ((corner, &body), number) in corners.zip(0..) {
        *corner = *own.entry((*corner, body)).or_insert(number);
    }
    Some(apart)
}

/// The body of each triangle.
fn bodies(count: usize, edges: &[Edge], vertices: impl Fn(usize) -> [u32; 3]) -> Vec<u32> {
    let mut bodies = by_vertices(count, edges, vertices);
    let by_order = by_order(edges, &bodies);
    let closed = bodies.iter().filter_map(|body| *body).max().map_or(0, |last| last + 1);
    bodies.iter_mut().zip(by_order).map(|(body, of_order)| body.unwrap_or(closed + of_order)).collect()
}

/// The bodies of triangles that share numbered vertices and pass each of their edges an even number
/// of times; `None` of other triangles.
fn by_vertices(count: usize, edges: &[Edge], vertices: impl Fn(usize) -> [u32; 3]) -> Vec<Option<u32>> {
    let vertices_end = (0..count).flat_map(&vertices).max().map_or(0, |last| last as usize + 1);
    let mut sets = Sets::new(vertices_end);
    for [a, b, c] in (0..count).map(&vertices) {
        sets.join(a, b);
        sets.join(a, c);
    }
    let components: Vec<u32> = (0..count).map(|triangle| sets.root(vertices(triangle)[0])).collect();
    let mut is_open = vec![false; vertices_end];
    for edge in around(edges) {
        let mut here: Vec<u32> = edge.iter().map(|&(.., triangle, _)| components[triangle as usize]).collect();
        here.sort_unstable();
        for same in here.chunk_by(|a, b| a == b).filter(|same| same.len() % 2 == 1) {
            is_open[same[0] as usize] = true;
        }
    }
    components.into_iter().map(|component| (!is_open[component as usize]).then_some(component)).collect()
}

/// The bodies of the triangles without one: a body ends, in the order of the file, where every edge
/// of its triangles is passed an even number of times. Edges of open sheets, which the whole file
/// passes an odd number of times, end nothing.
fn by_order(edges: &[Edge], known: &[Option<u32>]) -> Vec<u32> {
    let mut edges_of: Vec<[Option<u32>; 3]> = vec![[None; 3]; known.len()];
    for (edge, number) in around(edges).zip(0..).filter(|(edge, _)| edge.len() % 2 == 0) {
        for &(_, _, triangle, _) in edge.iter().filter(|&&(_, _, triangle, _)| known[triangle as usize].is_none()) {
            let free = edges_of[triangle as usize].iter_mut().find(|edge| edge.is_none());
            *free.expect("a triangle has three edges") = Some(number);
        }
    }
    let mut is_odd = vec![false; edges.len()];
    let (mut odd, mut body) = (0, 0);
    let of_triangle = |(edges, known): ([Option<u32>; 3], &Option<u32>)| {
        let here = body;
        for edge in edges.into_iter().flatten() {
            let is_odd = &mut is_odd[edge as usize];
            *is_odd ^= true;
            odd += if *is_odd { 1 } else { -1 };
        }
        body += u32::from(odd == 0 && known.is_none());
        here
    };
    edges_of.into_iter().zip(known).map(of_triangle).collect()
}
