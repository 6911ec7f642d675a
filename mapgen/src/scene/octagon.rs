//! The octagonal maze: lanes between octagons around one centre. Each octagon has one gap, and each
//! lane one barrier across it, so that every lane is a way with two dead ends.

use std::f64::consts::{FRAC_1_SQRT_2, TAU};

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use voxels::{Cell, Terrain};

use super::Canvas;

/// Width of a lane, metres.
const LANE_M: f64 = 2.5;

/// Thickness of a wall, metres.
const THICK_M: f64 = 0.2;

/// Width of a gap, metres.
const GAP_M: f64 = 1.5;

/// Draws as many octagons as fit.
pub(super) fn draw(canvas: &mut Canvas, rng: &mut ChaCha8Rng) {
    let [x_m, y_m, z_m] = canvas.size_m;
    canvas.free([0.0, 0.0, 0.0], [x_m, y_m, z_m]);
    let (cell_m, extent) = (canvas.cell_m(), canvas.terrain.extent());
    // The walls of a square lattice are closed over faces if they are this thick.
    let thick_m = canvas.thick_m(THICK_M).max(1.5 * cell_m);
    let pitch_m = LANE_M + thick_m;
    // A lane is left around the outermost one.
    let rings = ((x_m.min(y_m) / 2.0 - LANE_M) / pitch_m) as usize;
    let mut angle = || rng.random_range(0.0..TAU);
    let gaps: Vec<f64> = (0..rings).map(|_| angle()).collect();
    let barriers: Vec<f64> = (0..=rings).map(|_| angle()).collect();
    let [size_x, size_y, size_z] = extent.size().map(|cells| cells as i32);
    for (y, x) in (1..size_y - 1).flat_map(|y| (1..size_x - 1).map(move |x| (y, x))) {
        let along = [(x, x_m), (y, y_m)].map(|(at, size_m)| (f64::from(at) - 0.5) * cell_m - size_m / 2.0);
        let [right_m, up_m] = along;
        // The distance of the octagon through this cell from the centre.
        let octagon_m = right_m.abs().max(up_m.abs()).max((right_m.abs() + up_m.abs()) * FRAC_1_SQRT_2);
        let ring = (octagon_m / pitch_m) as usize;
        let is_near = |angle: f64, width_m: f64| {
            let (sin, cos) = libm::sincos(angle);
            let (ahead_m, beside_m) = (right_m * cos + up_m * sin, up_m * cos - right_m * sin);
            ahead_m > 0.0 && beside_m.abs() <= width_m / 2.0
        };
        let is_octagon = ring >= 1 && ring <= rings && octagon_m - ring as f64 * pitch_m < thick_m;
        let is_wall = if is_octagon {
            !is_near(gaps[ring - 1], GAP_M)
        } else {
            // Not where a gap leads into the lane on either side of the barrier.
            let is_beside_gap = |gap: Option<&f64>| gap.is_some_and(|&gap| is_near(gap, GAP_M + 2.0 * thick_m));
            (1..rings).contains(&ring)
                && is_near(barriers[ring], thick_m)
                && !is_beside_gap(gaps.get(ring - 1))
                && !is_beside_gap(gaps.get(ring))
        };
        if is_wall {
            for z in 1..size_z - 1 {
                canvas.terrain.set(Cell::new(x, y, z), Terrain::Wall);
            }
        }
    }
}
