//! Tunnels with junctions, as those of the DARPA Subterranean Challenge: junctions on a grid,
//! joined by a random tree of tunnels and some more, with slopes between those at different
//! heights.

use rand::RngExt;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;

use super::Canvas;

/// From a junction to the next, metres.
const PITCH_M: f64 = 20.0;

/// Width and height of a tunnel, metres.
const WIDTH_M: f64 = 3.0;
const HEIGHT_M: f64 = 3.0;

/// Steepest slope of a tunnel.
const SLOPE_MAX: f64 = 0.25;

/// Probability that two neighbours that the tree does not join are joined all the same.
const LOOP_CHANCE: f64 = 0.25;

/// A junction: the middle of its floor, metres.
type Junction = [f64; 3];

/// Draws the junctions and the tunnels between them.
pub(super) fn draw(canvas: &mut Canvas, rng: &mut ChaCha8Rng) {
    let [x_m, y_m, z_m] = canvas.size_m;
    let along = |size_m: f64| ((size_m - WIDTH_M) / PITCH_M) as usize + 1;
    let (columns, rows) = (along(x_m), along(y_m));
    let rise_m = (z_m - HEIGHT_M).clamp(0.0, SLOPE_MAX * PITCH_M);
    let at = |index: usize, height_m: f64| {
        let [column, row] = [index % columns, index / columns].map(|along| along as f64);
        [WIDTH_M / 2.0 + column * PITCH_M, WIDTH_M / 2.0 + row * PITCH_M, height_m]
    };
    let junctions: Vec<Junction> =
        (0..columns * rows).map(|index| at(index, rng.random_range(0.0..=1.0) * rise_m)).collect();
    let mut pairs: Vec<(usize, usize)> = Vec::new();
    for index in 0..junctions.len() {
        if index % columns + 1 < columns {
            pairs.push((index, index + 1));
        }
        if index + columns < junctions.len() {
            pairs.push((index, index + columns));
        }
    }
    pairs.shuffle(rng);
    // Kruskal's algorithm: a pair whose ends are joined already makes a loop.
    let mut groups: Vec<usize> = (0..junctions.len()).collect();
    for (from, to) in pairs {
        let (group, other) = (groups[from], groups[to]);
        let is_loop = group == other;
        if is_loop && !rng.random_bool(LOOP_CHANCE) {
            continue;
        }
        groups.iter_mut().filter(|member| **member == other).for_each(|member| *member = group);
        tunnel(canvas, junctions[from], junctions[to]);
    }
}

/// Frees a tunnel between two junctions along one axis.
fn tunnel(canvas: &mut Canvas, from: Junction, to: Junction) {
    let steps = (PITCH_M / canvas.cell_m()).ceil();
    for step in 0..=steps as u32 {
        let share = f64::from(step) / steps;
        let [x_m, y_m, z_m] = [0, 1, 2].map(|axis| from[axis] + (to[axis] - from[axis]) * share);
        let half_m = WIDTH_M / 2.0;
        canvas.free([x_m - half_m, y_m - half_m, z_m], [x_m + half_m, y_m + half_m, z_m + HEIGHT_M]);
    }
}
