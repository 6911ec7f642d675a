//! The forest: trees with crowns that touch here and there, on level ground under an open sky.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::Canvas;

/// Sides of the squares with a tree each, metres.
const PITCH_M: f64 = 4.0;

/// Radii of trunks and of crowns, metres.
const TRUNKS_M: [f64; 2] = [0.15, 0.35];
const CROWNS_M: [f64; 2] = [0.8, 1.8];

/// Greatest height of a tree, metres; the sky is above it.
const HEIGHT_MAX_M: f64 = 10.0;

/// Draws ground, sky and trees.
pub(super) fn draw(canvas: &mut Canvas, rng: &mut ChaCha8Rng) {
    let [x_m, y_m, z_m] = canvas.size_m;
    canvas.free([0.0; 3], [x_m, y_m, z_m]);
    let highest_m = HEIGHT_MAX_M.min(z_m - 1.0);
    for corner_m in canvas.squares(PITCH_M) {
        let trunk_m = rng.random_range(TRUNKS_M[0]..TRUNKS_M[1]);
        let [x_m, y_m] = corner_m.map(|low_m| low_m + rng.random_range(trunk_m..PITCH_M - trunk_m));
        let height_m = highest_m * rng.random_range(0.6..1.0);
        // Low trees have small crowns, which leave room below.
        let crown_m = rng.random_range(CROWNS_M[0]..CROWNS_M[1]).min(height_m / 3.0);
        canvas.post([x_m, y_m], trunk_m, [0.0, height_m - crown_m]);
        canvas.ball([x_m, y_m, height_m - crown_m], crown_m);
    }
}
