//! Orientation of triangles, and openings of a mesh.
//!
//! Winding numbers need triangles that face outwards together. Two triangles that share an edge
//! should pass it in opposite directions; where they do not, the smaller part is turned, and where
//! more than two meet, adjacent ones count ([`super::patches`]). A closed part whose triangles face
//! the other way than those of most of the mesh is turned as well, unless it lies inside the rest:
//! then it is a cavity, or a pillar of a cave.
//!
//! Corners at the same place are one corner. An edge that is passed more often in one direction is
//! open; open edges that only meet other triangles within a side enclose nothing and are left out.

use std::collections::BTreeMap;

use super::super::FormatError;
use super::bodies;
use super::patches::{self, Constraint, Patches};
use super::winding::{TRIANGLE_STEPS, Winding, solid_angle};
use super::{Triangle, WorkBudget};

/// Triangles of a part at whose middles it is decided whether it lies inside the rest.
const SAMPLES: usize = 16;

/// Area of an opening divided by the square of its length below which it encloses nothing.
const FLAT: f64 = 1e-6;

/// An empty slot of a table of places.
const NO_PLACE: u32 = u32::MAX;

/// Slots looked at for a corner that count as no work: a table that is half full takes fewer.
const PROBES_FREE: usize = 32;

/// Bits without a pattern: those of the golden ratio.
const HASH_FACTOR: u64 = 0x9e37_79b9_7f4a_7c15;

/// A hole in a mesh, in the coordinates of its triangles.
pub(super) struct Opening {
    /// Its middle.
    pub(super) centre: [f64; 3],
    /// The area that it leaves open, at least.
    pub(super) area: f64,
}

/// What was found in a mesh.
pub(super) struct Orientation {
    /// Number of triangles that were turned.
    pub(super) turned: usize,
    /// Parts that share no corner.
    pub(super) parts: usize,
    /// Openings, the largest first.
    pub(super) openings: Vec<Opening>,
    /// Edges at which an odd number of triangles meet, three or more: the rims of surfaces between
    /// solids.
    pub(super) rims: usize,
}

/// Turns triangles, of which `corners` are the places, so that they face outwards together.
/// `vertices` are the numbers that the file gives the corners of a triangle.
///
/// # Errors
/// If no work is left.
pub(super) fn orient(
    triangles: &mut [Triangle],
    corners: Vec<[u32; 3]>,
    vertices: &[[u32; 3]],
    work: &mut WorkBudget,
) -> Result<Orientation, FormatError> {
    let edges = edges(&corners);
    let mut turned = vec![false; triangles.len()];
    let apart = bodies::apart(&corners, &edges, vertices).map(|bodies| (self::edges(&bodies.corners), bodies));
    let (own_edges, own_corners, bodies) = match &apart {
        Some((edges, bodies)) => (edges, &bodies.corners, bodies.of.as_slice()),
        None => (&edges, &corners, [].as_slice()),
    };
    let patches = turn_neighbours(triangles, own_edges, bodies, &mut turned);
    for (triangle, _) in triangles.iter_mut().zip(&turned).filter(|(_, is_turned)| **is_turned) {
        triangle.swap(1, 2);
    }
    turn_parts(triangles, &patches.parts(own_corners), &mut turned, work)?;
    let turned_count = turned.iter().filter(|&&is_turned| is_turned).count();
    let openings = if turned_count == 0 {
        openings(triangles, &corners, &edges)
    } else {
        // Triangles that were turned have their corners in another order.
        let mut corners = corners.clone();
        corners
            .iter_mut()
            .zip(&turned)
            .filter(|(_, is_turned)| **is_turned)
            .for_each(|(corners, _)| corners.swap(1, 2));
        by_first_corner(&mut corners, 3 * triangles.len());
        openings(triangles, &corners, &self::edges(&corners))
    };
    let meeting = around(&edges).map(<[Edge]>::len);
    let rims = meeting.filter(|triangles| triangles % 2 == 1 && *triangles > 1).count();
    Ok(Orientation { turned: turned_count, parts: parts(&corners), openings, rims })
}

/// The number of the place of each corner, by triangle: that of the first corner there. `places`
/// are those of the vertices, whose numbers `triangles` have.
///
/// # Errors
/// If no work is left, because the hashes of too many places are alike.
pub(super) fn corners(
    places: &[[f64; 3]],
    triangles: &[[u32; 3]],
    work: &mut WorkBudget,
) -> Result<Vec<[u32; 3]>, FormatError> {
    // A table with open addressing, at most half full, of the first vertex at each place.
    let slots = (2 * places.len()).next_power_of_two();
    let mut table = vec![NO_PLACE; slots];
    // Adding 0 leaves one zero.
    let key = |place: &[f64; 3]| place.map(|along| (along + 0.0).to_bits());
    let mut first_vertex: Vec<u32> = Vec::with_capacity(places.len());
    for (place, vertex) in places.iter().zip(0..) {
        let key_here = key(place);
        let mut slot = hash(key_here) as usize & (slots - 1);
        let mut probes = 0;
        first_vertex.push(loop {
            let other = table[slot];
            if other == NO_PLACE {
                table[slot] = vertex;
                break vertex;
            }
            if key(&places[other as usize]) == key_here {
                break other;
            }
            slot = (slot + 1) & (slots - 1);
            probes += 1;
        });
        if probes > PROBES_FREE {
            work.spend(probes)?;
        }
    }
    let mut corners: Vec<[u32; 3]> =
        triangles.iter().map(|triangle| triangle.map(|vertex| first_vertex[vertex as usize])).collect();
    by_first_corner(&mut corners, places.len());
    Ok(corners)
}

/// Replaces the numbers of places, all below `end`, by those of the first corners there.
pub(super) fn by_first_corner(corners: &mut [[u32; 3]], end: usize) {
    let mut first = vec![NO_PLACE; end];
    for (corner, number) in corners.iter_mut().flatten().zip(0..) {
        let known = &mut first[*corner as usize];
        if *known == NO_PLACE {
            *known = number;
        }
        *corner = *known;
    }
}

/// Mixes the bits of a place.
pub(super) fn hash(key: [u64; 3]) -> u64 {
    let mix = |state: u64, part: u64| {
        let product = u128::from(state ^ part) * u128::from(HASH_FACTOR);
        (product >> 64) as u64 ^ product as u64
    };
    key.into_iter().fold(HASH_FACTOR, mix)
}

/// An edge of a triangle: its two corners, the lower first, the triangle, and whether it is passed
/// from the lower to the higher one.
pub(super) type Edge = (u32, u32, u32, bool);

/// All edges in order.
fn edges(corners: &[[u32; 3]]) -> Vec<Edge> {
    let of_triangle = |(triangle, corners): (usize, &[u32; 3])| {
        let ends = [[0, 1], [1, 2], [2, 0]].map(|edge| edge.map(|corner| corners[corner]));
        ends.map(|[from, to]| (from.min(to), from.max(to), triangle as u32, from < to))
    };
    let all = || corners.iter().enumerate().flat_map(of_triangle);
    // Few edges begin at a corner: where its edges begin is counted, and only those are sorted.
    let mut starts = vec![0; 3 * corners.len() + 1];
    all().for_each(|edge| starts[edge.0 as usize + 1] += 1);
    for corner in 1..starts.len() {
        starts[corner] += starts[corner - 1];
    }
    let mut edges: Vec<Edge> = vec![(0, 0, 0, false); 3 * corners.len()];
    let mut next: Vec<u32> = starts.clone();
    for edge in all() {
        let at = &mut next[edge.0 as usize];
        edges[*at as usize] = edge;
        *at += 1;
    }
    starts.windows(2).for_each(|range| edges[range[0] as usize..range[1] as usize].sort_unstable());
    edges
}

/// The passages of each edge.
pub(super) fn around(edges: &[Edge]) -> impl Iterator<Item = &[Edge]> {
    edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1))
}

/// Turns triangles until neighbours pass their common edge in opposite directions: in each
/// connected part those with the smaller area. A part without an outside, as a Moebius strip,
/// stays.
fn turn_neighbours(triangles: &[Triangle], edges: &[Edge], bodies: &[u32], turned: &mut [bool]) -> Patches {
    let crossed = Crossed::of(triangles, edges, bodies);
    let pairs = || {
        around(edges).filter(|edge| edge.len() == 2 && edge[0].2 != edge[1].2 && !crossed.contains(triangles, edge[0]))
    };
    if pairs().any(|edge| edge[0].3 == edge[1].3) {
        let constraints: Vec<Constraint> = pairs().map(|edge| (edge[0].2, edge[1].2, edge[0].3 == edge[1].3)).collect();
        let area = |triangle: u32| super::area(&triangles[triangle as usize]);
        turned.copy_from_slice(&patches::consistent_turns(triangles.len(), &constraints, area));
    }
    Patches::new(triangles, edges, pairs().map(|edge| (edge[0].2, edge[1].2)), turned)
}

/// Edges along an axis that no other edge balances, by their line.
///
/// Where four sides of boxes meet, as in maps of cells that touch at an edge, and some sides are
/// longer than others, two triangles of different boxes share an edge, and pass it as they like:
/// the longer ones balance it. Such triangles are no neighbours. Bodies that are told apart cross
/// nothing of each other.
struct Crossed<'a> {
    lines: BTreeMap<Line, Vec<[f64; 2]>>,
    /// The body of each triangle; empty if all are of one.
    bodies: &'a [u32],
}

/// A body, the axis of a line, and the bits of its other two coordinates.
type Line = (u32, usize, [u64; 2]);

impl<'a> Crossed<'a> {
    fn of(triangles: &[Triangle], edges: &[Edge], bodies: &'a [u32]) -> Self {
        let mut lines: BTreeMap<Line, Vec<[f64; 2]>> = BTreeMap::new();
        for edge in around(edges) {
            if edge.iter().filter(|passage| passage.3).count() * 2 != edge.len()
                && let Some((line, ends)) = Self::line(triangles, edge[0], bodies)
            {
                lines.entry(line).or_default().push(ends);
            }
        }
        lines.retain(|_, edges| edges.len() > 1);
        Self { lines, bodies }
    }

    /// Whether other edges without balance overlap with this one.
    fn contains(&self, triangles: &[Triangle], edge: Edge) -> bool {
        if self.lines.is_empty() {
            return false;
        }
        let Some((line, here)) = Self::line(triangles, edge, self.bodies) else { return false };
        // The edge overlaps with itself, too.
        let overlaps = |other: &&[f64; 2]| other[0].max(here[0]) < other[1].min(here[1]);
        self.lines.get(&line).is_some_and(|edges| edges.iter().filter(overlaps).nth(1).is_some())
    }

    /// The line of an edge along an axis, and where on it the edge lies.
    fn line(triangles: &[Triangle], (from, to, triangle, _): Edge, bodies: &[u32]) -> Option<(Line, [f64; 2])> {
        let body = bodies.get(triangle as usize).copied().unwrap_or_default();
        let [from, to] = [from, to].map(|corner| triangles[corner as usize / 3][corner as usize % 3]);
        let axis = (0..3).find(|&axis| from[axis] != to[axis])?;
        let others = [(axis + 1) % 3, (axis + 2) % 3];
        let is_along = others.iter().all(|&other| from[other] == to[other]);
        let key = others.map(|other| (from[other] + 0.0).to_bits());
        is_along.then(|| ((body, axis, key), [from[axis].min(to[axis]), from[axis].max(to[axis])]))
    }
}

/// The number of parts that share no corner with the others.
fn parts(corners: &[[u32; 3]]) -> usize {
    let mut sets = Sets::new(3 * corners.len());
    for corners in corners {
        sets.join(corners[0], corners[1]);
        sets.join(corners[0], corners[2]);
    }
    let mut is_root = |(&corner, number): (&u32, u32)| corner == number && sets.root(corner) == corner;
    corners.iter().flatten().zip(0..).map(&mut is_root).filter(|&is_root| is_root).count()
}

/// Turns parts that face the other way than most of the mesh and do not lie inside the rest of it.
fn turn_parts(
    triangles: &mut [Triangle],
    parts: &[Vec<u32>],
    turned: &mut [bool],
    work: &mut WorkBudget,
) -> Result<(), FormatError> {
    let volumes: Vec<f64> = parts.iter().map(|part| volume(triangles, part)).collect();
    let total: f64 = volumes.iter().sum();
    // Of two mirror images one has to be the first.
    let total = if total < 0.0 { -1.0 } else { 1.0 };
    let others: Vec<&Vec<u32>> =
        parts.iter().zip(&volumes).filter(|&(_, &volume)| volume * total < 0.0).map(|(part, _)| part).collect();
    if others.is_empty() {
        return Ok(());
    }
    let mut to_turn: Vec<u32> = Vec::new();
    let winding = Winding::new(triangles);
    for part in others {
        let step = part.len().div_ceil(SAMPLES);
        let mut is_nested = true;
        for &triangle in part.iter().step_by(step) {
            // In a corner the parts might touch.
            let [a, b, c] = triangles[triangle as usize];
            let point = [0, 1, 2].map(|axis| (a[axis] + b[axis] + c[axis]) / 3.0);
            work.spend(TRIANGLE_STEPS * part.len())?;
            let own: f64 = part.iter().map(|&triangle| solid_angle(&triangles[triangle as usize], point)).sum();
            let rest = winding.at(point, work)? - own / (4.0 * std::f64::consts::PI);
            is_nested &= rest.abs() >= 0.5;
        }
        if !is_nested {
            to_turn.extend(part);
        }
    }
    for triangle in to_turn {
        triangles[triangle as usize].swap(1, 2);
        turned[triangle as usize] ^= true;
    }
    Ok(())
}

/// Six times the signed volume of a part, positive if it faces outwards.
fn volume(triangles: &[Triangle], part: &[u32]) -> f64 {
    let origin = triangles[part[0] as usize][0];
    let to = |corner: [f64; 3]| [0, 1, 2].map(|axis| corner[axis] - origin[axis]);
    part.iter()
        .map(|&triangle| {
            let [a, b, c] = triangles[triangle as usize].map(to);
            let normal = cross(b, c);
            a[0] * normal[0] + a[1] * normal[1] + a[2] * normal[2]
        })
        .sum()
}

/// The openings that enclose an area.
fn openings(triangles: &[Triangle], corners: &[[u32; 3]], edges: &[Edge]) -> Vec<Opening> {
    let place = |corner: u32| triangles[corner as usize / 3][corner as usize % 3];
    // Edges with the passages that nothing balances. Two triangles close an edge, whichever way
    // they face: of a part without an outside they face the same way. Crossed edges balance longer
    // ones.
    let crossed = Crossed::of(triangles, edges, &[]);
    let open: Vec<(u32, u32, i64)> = around(edges)
        .filter(|edge| edge.len() != 2 || crossed.contains(triangles, edge[0]))
        .filter(|edge| edge.iter().filter(|passage| passage.3).count() * 2 != edge.len())
        .map(|edge| (edge[0].0, edge[0].1, edge.iter().map(|passage| if passage.3 { 1 } else { -1 }).sum()))
        .collect();
    let mut sets = Sets::new(3 * corners.len());
    open.iter().for_each(|&(from, to, _)| sets.join(from, to));
    let mut by_set: Vec<(u32, usize)> =
        open.iter().enumerate().map(|(index, edge)| (sets.root(edge.0), index)).collect();
    by_set.sort_unstable();
    let mut openings: Vec<Opening> = by_set
        .chunk_by(|a, b| a.0 == b.0)
        .filter_map(|edges| {
            let origin = place(open[edges[0].1].0);
            let (mut area, mut centre, mut length) = ([0.0; 3], [0.0; 3], 0.0);
            for &(from, to, passages) in edges.iter().map(|&(_, index)| &open[index]) {
                let [a, b] = [from, to].map(place);
                let [from, to] = [a, b].map(|corner| [0, 1, 2].map(|axis| corner[axis] - origin[axis]));
                let part = cross(from, to).map(|along| along * passages as f64 / 2.0);
                let edge = libm::sqrt((0..3).map(|axis| (b[axis] - a[axis]) * (b[axis] - a[axis])).sum());
                length += edge;
                for axis in 0..3 {
                    area[axis] += part[axis];
                    centre[axis] += edge * (a[axis] + b[axis]) / 2.0;
                }
            }
            let area = libm::sqrt(area.iter().map(|along| along * along).sum());
            let is_open = area > FLAT * length * length && length > 0.0;
            is_open.then(|| Opening { centre: centre.map(|along| along / length), area })
        })
        .collect();
    openings.sort_by(|a, b| b.area.total_cmp(&a.area));
    openings
}

pub(super) fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Disjoint sets of numbers.
pub(super) struct Sets(Vec<u32>);

impl Sets {
    pub(super) fn new(count: usize) -> Self {
        Self((0..count as u32).collect())
    }

    /// The lowest number of the set.
    pub(super) fn root(&mut self, of: u32) -> u32 {
        let mut at = of;
        while self.0[at as usize] != at {
            let above = self.0[self.0[at as usize] as usize];
            self.0[at as usize] = above;
            at = above;
        }
        at
    }

    pub(super) fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        self.0[a.max(b) as usize] = a.min(b);
    }
}
