//! The pillars: a hall with round pillars from floor to ceiling, one somewhere in each square of a
//! grid.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::Canvas;

/// Sides of the squares, metres.
const PITCH_M: f64 = 2.5;

/// Radii of the pillars, metres.
const RADII_M: [f64; 2] = [0.2, 0.5];

/// Draws the hall and its pillars.
pub(super) fn draw(canvas: &mut Canvas, rng: &mut ChaCha8Rng) {
    let [x_m, y_m, z_m] = canvas.size_m;
    canvas.free([0.0; 3], [x_m, y_m, z_m]);
    for corner_m in canvas.squares(PITCH_M) {
        let radius_m = rng.random_range(RADII_M[0]..RADII_M[1]);
        // Between two pillars there is room for a body of 0.3 m radius.
        let gap_m = 0.35;
        let within = radius_m + gap_m..PITCH_M - radius_m - gap_m;
        let [x_m, y_m] = corner_m.map(|low_m| low_m + rng.random_range(within.clone()));
        canvas.post([x_m, y_m], radius_m, [0.0, z_m]);
    }
}
