//! The office: rows of cubicles, back to back, with an aisle along each row and around them all.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::Canvas;

/// Sides of a cubicle, metres.
const CUBICLE_M: f64 = 3.0;

/// Width of an aisle, metres.
const AISLE_M: f64 = 1.6;

/// Width of the way into a cubicle, metres.
const DOOR_M: f64 = 1.2;

/// Height of a partition, metres, under a higher ceiling.
const PARTITION_M: f64 = 1.8;

/// Thickness of a partition, metres.
const THICK_M: f64 = 0.1;

/// Height of a storey, metres: an office that is high enough has several, each its own ceiling.
const STOREY_M: f64 = 3.0;

/// Thickness of a ceiling, metres.
const SLAB_M: f64 = 0.3;

/// Sides of the shaft that joins the storeys, metres.
const SHAFT_M: f64 = 1.6;

/// Draws as many storeys as fit, with a shaft at a corner of the outer aisle.
pub(super) fn draw(canvas: &mut Canvas, rng: &mut ChaCha8Rng) {
    let [x_m, y_m, z_m] = canvas.size_m;
    let slab_m = canvas.thick_m(SLAB_M);
    let storeys = (((z_m + slab_m) / (STOREY_M + slab_m)) as u32).max(1);
    for storey in 0..storeys {
        let floor_m = f64::from(storey) * (STOREY_M + slab_m);
        let ceiling_m = if storeys == 1 { z_m } else { floor_m + STOREY_M };
        canvas.free([0.0, 0.0, floor_m], [x_m, y_m, ceiling_m]);
        let top_m = (floor_m + PARTITION_M).min(ceiling_m);
        let mut low_m = AISLE_M;
        while low_m + 2.0 * CUBICLE_M + AISLE_M <= y_m {
            row(canvas, rng, low_m, -1.0, [floor_m, top_m]);
            row(canvas, rng, low_m + CUBICLE_M, 1.0, [floor_m, top_m]);
            low_m += 2.0 * CUBICLE_M + AISLE_M;
        }
        if storey > 0 {
            canvas.free([0.0, 0.0, floor_m - slab_m], [SHAFT_M, SHAFT_M, floor_m]);
        }
    }
}

/// A row of cubicles from y = `low_m` on, open towards -y or +y.
fn row(canvas: &mut Canvas, rng: &mut ChaCha8Rng, low_m: f64, side: f64, [floor_m, top_m]: [f64; 2]) {
    let (x_m, thick_m) = (canvas.size_m[0], canvas.thick_m(THICK_M));
    let high_m = low_m + CUBICLE_M;
    let count = ((x_m - 2.0 * AISLE_M) / CUBICLE_M) as u32;
    let (back_m, front_m) = if side < 0.0 { (high_m - thick_m, low_m) } else { (low_m, high_m - thick_m) };
    let end_m = AISLE_M + f64::from(count) * CUBICLE_M;
    canvas.wall([AISLE_M, back_m, floor_m], [end_m, back_m + thick_m, top_m]);
    canvas.wall([AISLE_M, front_m, floor_m], [end_m, front_m + thick_m, top_m]);
    for cubicle in 0..=count {
        let left_m = (AISLE_M + f64::from(cubicle) * CUBICLE_M).min(end_m - thick_m);
        canvas.wall([left_m, low_m, floor_m], [left_m + thick_m, high_m, top_m]);
        if cubicle < count {
            let room_m = CUBICLE_M - DOOR_M - 2.0 * thick_m;
            let door_m = left_m + thick_m + rng.random_range(0.0..=1.0) * room_m.max(0.0);
            canvas.free([door_m, front_m, floor_m], [door_m + DOOR_M, front_m + thick_m, top_m]);
        }
    }
}
