//! Bodies of a mesh: closed sets of triangles that touch others at edges.
//!
//! At an edge that boxes share, four triangles or more meet, and the mesh alone does not say which
//! of them belong together. Two things do: vertices of their own, in the formats that number
//! vertices, and the order of the file, as programs write one object after the other. A body that
//! either tells from the others gets corners of its own, so that it is oriented by itself.

use super::orientation::{Edge, Sets, around};

/// Triangles with their bodies.
pub(super) struct Bodies {
    /// The corners of each triangle; a corner is the first one of its body at its place.
    pub(super) corners: Vec<[u32; 3]>,
    /// The body of each triangle.
    pub(super) of: Vec<u32>,
}

/// The bodies of triangles; `None` if nothing has to be told apart, because two triangles meet at
/// each edge or there is one body. `vertices` are the numbers that the file gives the corners of a
/// triangle.
pub(super) fn apart(corners: &[[u32; 3]], edges: &[Edge], vertices: &[[u32; 3]]) -> Option<Bodies> {
    if around(edges).all(|edge| edge.len() == 2) {
        return None;
    }
    let bodies = bodies(edges, vertices);
    if bodies.iter().all(|body| *body == bodies[0]) {
        return None;
    }
    let of_triangle = |(corners, body): (&[u32; 3], u32)| corners.map(|corner| (corner, body));
    let places = corners.iter().zip(bodies.iter().copied()).flat_map(of_triangle);
    let mut places: Vec<(u32, u32, u32)> =
        places.zip(0..).map(|((place, body), number)| (place, body, number)).collect();
    places.sort_unstable();
    let mut apart = vec![[0; 3]; corners.len()];
    for same in places.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
        for &(.., number) in same {
            apart[number as usize / 3][number as usize % 3] = same[0].2;
        }
    }
    Some(Bodies { corners: apart, of: bodies })
}

/// The body of each triangle.
fn bodies(edges: &[Edge], vertices: &[[u32; 3]]) -> Vec<u32> {
    let bodies = by_vertices(edges, vertices);
    let by_order = by_order(edges, &bodies);
    let closed = bodies.iter().flatten().max().map_or(0, |last| last + 1);
    bodies.into_iter().zip(by_order).map(|(body, of_order)| body.unwrap_or(closed + of_order)).collect()
}

/// The bodies of triangles that share numbered vertices and pass each of their edges an even number
/// of times; `None` of other triangles.
fn by_vertices(edges: &[Edge], vertices: &[[u32; 3]]) -> Vec<Option<u32>> {
    let end = vertices.iter().flatten().max().map_or(0, |last| *last as usize + 1);
    let mut sets = Sets::new(end);
    for &[a, b, c] in vertices {
        sets.join(a, b);
        sets.join(a, c);
    }
    let components: Vec<u32> = vertices.iter().map(|&[a, ..]| sets.root(a)).collect();
    let mut is_open = vec![false; end];
    let mut here: Vec<u32> = Vec::new();
    for edge in around(edges) {
        here.clear();
        here.extend(edge.iter().map(|&(.., triangle, _)| components[triangle as usize]));
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
