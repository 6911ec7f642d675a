//! The campus: blocks of buildings along streets, of different heights, some about a courtyard with
//! a gateway.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::Canvas;

/// Sides of a lot, and width of a street, metres.
const LOT_M: f64 = 16.0;
const STREET_M: f64 = 6.0;

/// By how much a side of a building stands back from that of its lot, metres.
const SETBACK_MAX_M: f64 = 1.5;

/// Share of the buildings that have a courtyard, the depth of their wings, and the sides of the
/// gateway, metres.
const COURTYARD_CHANCE: f64 = 0.5;
const WING_M: f64 = 4.0;
const GATE_M: f64 = 3.0;

/// Height of the lowest building by that of the space, and of the highest one.
const HEIGHTS: [f64; 2] = [0.4, 0.85];

/// Draws the streets and a building on each lot.
pub(super) fn draw(canvas: &mut Canvas, rng: &mut ChaCha8Rng) {
    let [x_m, y_m, z_m] = canvas.size_m;
    canvas.free([0.0; 3], [x_m, y_m, z_m]);
    let lots = |size_m: f64| ((size_m - STREET_M) / (LOT_M + STREET_M)) as u32;
    for (row, column) in (0..lots(y_m)).flat_map(|row| (0..lots(x_m)).map(move |column| (row, column))) {
        let corner_m = [column, row].map(|lot| STREET_M + f64::from(lot) * (LOT_M + STREET_M));
        let mut setback = || rng.random_range(0.0..SETBACK_MAX_M);
        let low_m = corner_m.map(|low_m| low_m + setback());
        let high_m = corner_m.map(|low_m| low_m + LOT_M - setback());
        let height_m = z_m * rng.random_range(HEIGHTS[0]..HEIGHTS[1]);
        canvas.wall([low_m[0], low_m[1], 0.0], [high_m[0], high_m[1], height_m]);
        if rng.random_bool(COURTYARD_CHANCE) {
            courtyard(canvas, rng, low_m, high_m, height_m);
        }
    }
}

/// Frees the inside of a building up to the sky, and a gateway from the street in front of it or
/// behind it.
fn courtyard(canvas: &mut Canvas, rng: &mut ChaCha8Rng, low_m: [f64; 2], high_m: [f64; 2], height_m: f64) {
    let ([left_m, front_m], [right_m, back_m]) = (low_m.map(|at_m| at_m + WING_M), high_m.map(|at_m| at_m - WING_M));
    canvas.free([left_m, front_m, 0.0], [right_m, back_m, height_m]);
    let gate_m = rng.random_range(left_m..right_m - GATE_M);
    let [from_m, to_m] = if rng.random_bool(0.5) { [low_m[1], front_m] } else { [back_m, high_m[1]] };
    canvas.free([gate_m, from_m, 0.0], [gate_m + GATE_M, to_m, GATE_M.min(height_m)]);
}
