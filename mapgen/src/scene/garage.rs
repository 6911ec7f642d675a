//! The garage: open floors with pillars, each joined with the next one by a straight ramp, along
//! one long side and the other in turn.

use super::Canvas;

/// Clear height of a floor, and thickness of a slab, metres.
const HEIGHT_M: f64 = 3.0;
const SLAB_M: f64 = 0.3;

/// From pillar to pillar, and sides of a pillar, metres.
const PITCH_M: f64 = 5.0;
const PILLAR_M: f64 = 0.5;

/// Width of a ramp, and its rise for each metre along it.
const RAMP_M: f64 = 4.0;
const GRADIENT: f64 = 0.15;

/// Way before and behind a ramp, metres.
const LANDING_M: f64 = 3.0;

/// Draws as many floors as fit.
pub(super) fn draw(canvas: &mut Canvas) {
    let [x_m, y_m, z_m] = canvas.size_m;
    let slab_m = canvas.thick_m(SLAB_M);
    let pitch_m = HEIGHT_M + slab_m;
    let floors = (((z_m + slab_m) / pitch_m) as u32).max(1);
    for floor in 0..floors {
        let low_m = f64::from(floor) * pitch_m;
        let high_m = low_m + HEIGHT_M;
        canvas.free([0.0, 0.0, low_m], [x_m, y_m, high_m]);
        let pillar_m = canvas.thick_m(PILLAR_M);
        // None stands on a ramp.
        let last_m = y_m - RAMP_M - pillar_m;
        let columns = (0..).map(|number| PITCH_M * (f64::from(number) + 1.0)).take_while(|at_m| *at_m < x_m);
        for left_m in columns {
            let rows =
                (0..).map(|number| RAMP_M + PITCH_M * (f64::from(number) + 0.5)).take_while(|at_m| *at_m < last_m);
            for front_m in rows {
                canvas.wall([left_m, front_m, low_m], [left_m + pillar_m, front_m + pillar_m, high_m]);
            }
        }
    }
    for floor in 1..floors {
        let front_m = if floor % 2 == 1 { 0.0 } else { y_m - RAMP_M };
        ramp(canvas, front_m, f64::from(floor - 1) * pitch_m, pitch_m);
    }
}

/// A ramp along x, from y = `front_m` on, from a floor at `low_m` to the next one, `pitch_m`
/// higher.
fn ramp(canvas: &mut Canvas, front_m: f64, low_m: f64, pitch_m: f64) {
    let (x_m, cell_m) = (canvas.size_m[0], canvas.cell_m());
    let length_m = (pitch_m / GRADIENT).min(x_m - 2.0 * LANDING_M);
    let back_m = front_m + RAMP_M;
    for step in 0..(length_m / cell_m).ceil() as u32 {
        let along_m = f64::from(step) * cell_m;
        let (left_m, height_m) = (LANDING_M + along_m, low_m + pitch_m * (along_m / length_m));
        // First the way through the slab above it, then its body.
        canvas.free([left_m, front_m, height_m], [left_m + cell_m, back_m, height_m + HEIGHT_M]);
        canvas.wall([left_m, front_m, low_m], [left_m + cell_m, back_m, height_m]);
    }
}
