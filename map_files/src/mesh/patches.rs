//! Patches of a mesh: triangles that are connected over edges at which two of them meet.
//!
//! Parts that share an edge, and cells that touch at one, have four triangles or more there, of
//! which two adjacent ones, in the order around the edge, bound the same space. A patch that is
//! closed by itself is a part of its own, whatever else has its edges. All others are turned until
//! adjacent triangles pass the edge in opposite directions, if that closes them.

use std::f64::consts::TAU;

use super::Triangle;
use super::orientation::{Edge, Sets, around, cross};
use super::winding::dot;

/// Angle around an edge within which triangles lie on each other.
const SAME_ANGLE_RAD: f64 = 1e-9;

/// Most triangles at an edge around which patches may close; with more they count as open.
const MEETING_MAX: usize = 64;

/// Two triangles, or two patches, and whether one of them has to turn.
pub(super) type Constraint = (u32, u32, bool);

/// Which of `count` triangles or patches turn so that all constraints hold: in each connected set
/// those that weigh less. A set whose constraints contradict each other stays.
pub(super) fn consistent_turns(count: usize, constraints: &[Constraint], weight: impl Fn(u32) -> f64) -> Vec<bool> {
    let mut turns = vec![false; count];
    let mut constraints: Vec<Constraint> =
        constraints.iter().flat_map(|&(one, other, differ)| [(one, other, differ), (other, one, differ)]).collect();
    constraints.sort_unstable();
    let of = |item: u32| {
        let first = constraints.partition_point(|&(from, ..)| from < item);
        constraints[first..].iter().take_while(move |&&(from, ..)| from == item)
    };
    let mut known = vec![false; count];
    for first in 0..count as u32 {
        if known[first as usize] {
            continue;
        }
        known[first as usize] = true;
        let mut set = vec![first];
        let mut at = 0;
        let mut has_sides = true;
        while at < set.len() {
            let here = set[at];
            at += 1;
            for &(_, next, differ) in of(here) {
                let side = turns[here as usize] ^ differ;
                if !known[next as usize] {
                    known[next as usize] = true;
                    turns[next as usize] = side;
                    set.push(next);
                } else if turns[next as usize] != side {
                    has_sides = false;
                }
            }
        }
        let weight = |is_turned: bool| {
            set.iter().filter(|&&item| turns[item as usize] == is_turned).map(|&item| weight(item)).sum::<f64>()
        };
        let swap = weight(true) > weight(false);
        for &item in &set {
            turns[item as usize] = has_sides && (turns[item as usize] ^ swap);
        }
    }
    turns
}

/// The patches of a mesh.
pub(super) struct Patches {
    /// The patch of each triangle, by its first triangle.
    of: Vec<u32>,
    /// Whether an edge of a patch, by its first triangle, is not passed as often in one direction
    /// as in the other.
    is_open: Vec<bool>,
}

impl Patches {
    /// The patches over these pairs of triangles, which `turned` turns so that they pass their
    /// edges in opposite directions. Turns patches that are not closed by themselves.
    pub(super) fn new(
        triangles: &[Triangle],
        edges: &[Edge],
        pairs: impl Iterator<Item = (u32, u32)>,
        turned: &mut [bool],
    ) -> Self {
        let mut sets = Sets::new(triangles.len());
        pairs.for_each(|(one, other)| sets.join(one, other));
        let of: Vec<u32> = (0..triangles.len() as u32).map(|triangle| sets.root(triangle)).collect();
        let mut patches = Self { is_open: vec![false; triangles.len()], of };
        let mut is_balanced = true;
        for edge in around(edges) {
            for &(.., triangle, _) in edge {
                let patch = patches.of[triangle as usize];
                let own = || edge.iter().filter(|other| patches.of[other.2 as usize] == patch);
                let is_open = edge.len() > MEETING_MAX || sum(own(), turned) != 0;
                patches.is_open[patch as usize] |= is_open;
            }
            is_balanced &= edge.len() % 2 == 1 || sum(edge.iter(), turned) == 0;
        }
        if !is_balanced {
            patches.close(triangles, edges, turned);
        }
        patches
    }

    /// The triangles of each part: a patch that is closed by itself, or others that share corners.
    pub(super) fn parts(&self, corners: &[[u32; 3]]) -> Vec<Vec<u32>> {
        let has_open = self.is_open.contains(&true);
        let mut sets = Sets::new(corners.len());
        let mut last_at: Vec<Option<u32>> = vec![None; if has_open { 3 * corners.len() } else { 0 }];
        for (corners, triangle) in corners.iter().zip(0..).filter(|&(_, triangle)| self.is_open(triangle)) {
            for &corner in corners {
                if let Some(before) = last_at[corner as usize].replace(triangle) {
                    sets.join(before, triangle);
                }
            }
        }
        let mut by_part: Vec<(bool, u32, u32)> = Vec::with_capacity(corners.len());
        for triangle in 0..corners.len() as u32 {
            let is_open = self.is_open(triangle);
            let part = if is_open { sets.root(triangle) } else { self.of[triangle as usize] };
            by_part.push((is_open, part, triangle));
        }
        by_part.sort_unstable();
        let same = by_part.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1));
        same.map(|part| part.iter().map(|&(.., triangle)| triangle).collect()).collect()
    }

    /// Whether the patch of a triangle is not closed by itself.
    fn is_open(&self, triangle: u32) -> bool {
        self.is_open[self.of[triangle as usize] as usize]
    }

    /// Turns open patches where that balances all edges at which they meet.
    fn close(&self, triangles: &[Triangle], edges: &[Edge], turned: &mut [bool]) {
        let mut area = vec![0.0; triangles.len()];
        for (triangle, &patch) in triangles.iter().zip(&self.of) {
            area[patch as usize] += super::area(triangle);
        }
        let meeting = |edge: &[Edge]| edge.iter().copied().filter(|edge| self.is_open(edge.2)).collect::<Vec<Edge>>();
        let mut constraints = Vec::new();
        let mut groups = Sets::new(triangles.len());
        for edge in around(edges).filter(|edge| edge.len() > 2) {
            for (one, other) in adjacent(triangles, &meeting(edge)) {
                let [a, b] = [one, other].map(|(.., triangle, is_forward)| is_forward ^ turned[triangle as usize]);
                let [one, other] = [one, other].map(|edge| self.of[edge.2 as usize]);
                constraints.push((one, other, a == b));
                groups.join(one, other);
            }
        }
        let turns = consistent_turns(triangles.len(), &constraints, |patch| area[patch as usize]);
        // Groups whose edges are balanced already stay, and those whose edges still are not.
        let (mut was_balanced, mut is_balanced) = (vec![true; triangles.len()], vec![true; triangles.len()]);
        let mut after = turned.to_vec();
        for (is_turned, &patch) in after.iter_mut().zip(&self.of) {
            *is_turned ^= turns[patch as usize];
        }
        for edge in around(edges).filter(|edge| edge.len() > 2) {
            let meeting = meeting(edge);
            let (before, then) = (sum(meeting.iter(), turned) == 0, sum(meeting.iter(), &after) == 0);
            for &(.., triangle, _) in &meeting {
                let group = groups.root(self.of[triangle as usize]) as usize;
                was_balanced[group] &= before;
                is_balanced[group] &= then;
            }
        }
        for ((is_turned, after), &patch) in turned.iter_mut().zip(after).zip(&self.of) {
            let group = groups.root(patch) as usize;
            if is_balanced[group] && !was_balanced[group] {
                *is_turned = after;
            }
        }
    }
}

/// How much more often an edge is passed forwards than backwards.
fn sum<'a>(passages: impl Iterator<Item = &'a Edge>, turned: &[bool]) -> i64 {
    passages.map(|&(.., triangle, is_forward)| if is_forward ^ turned[triangle as usize] { 1 } else { -1 }).sum()
}

/// The pairs of triangles at an edge that are adjacent in the order around it, and those that lie
/// on each other; none if their number is odd.
fn adjacent(triangles: &[Triangle], edge: &[Edge]) -> Vec<(Edge, Edge)> {
    let Some(&(from, to, ..)) = edge.first() else { return Vec::new() };
    let [from, to] = [from, to].map(|corner| triangles[corner as usize / 3][corner as usize % 3]);
    let axis = to_from(to, from);
    // Across the edge, to the corner of a triangle that is farthest from the edge's line.
    let across = |&(.., triangle, _): &Edge| {
        let corners = triangles[triangle as usize].map(|corner| to_from(corner, from));
        let part = |corner: [f64; 3]| {
            let share = dot(corner, axis) / dot(axis, axis);
            [0, 1, 2].map(|along| corner[along] - share * axis[along])
        };
        let parts = corners.map(part);
        parts.into_iter().max_by(|a, b| dot(*a, *a).total_cmp(&dot(*b, *b))).unwrap_or(axis)
    };
    let length = libm::sqrt(dot(axis, axis));
    let first = across(&edge[0]);
    let beside = cross(axis, first).map(|along| along / length);
    let angle = |edge: &Edge| {
        let to = across(edge);
        let angle = libm::atan2(dot(to, beside), dot(to, first));
        if angle < -SAME_ANGLE_RAD { angle + TAU } else { angle.max(0.0) }
    };
    let mut by_angle: Vec<(f64, Edge)> = edge.iter().map(|edge| (angle(edge), *edge)).collect();
    by_angle.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut pairs = Vec::new();
    let mut single = Vec::new();
    for same in by_angle.chunk_by(|a, b| b.0 - a.0 < SAME_ANGLE_RAD) {
        match *same {
            [(_, edge)] => single.push(edge),
            [(_, one), (_, other)] => pairs.push((one, other)),
            _ => return Vec::new(),
        }
    }
    match *single {
        [one, other] => pairs.push((one, other)),
        [first, .., last] if single.len() % 2 == 0 => {
            pairs.extend(single.windows(2).map(|pair| (pair[0], pair[1])));
            pairs.push((last, first));
        }
        _ => {}
    }
    pairs
}

fn to_from(to: [f64; 3], from: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|axis| to[axis] - from[axis])
}
