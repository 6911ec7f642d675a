//! Visits by sight: marks the cells seen from nearby as covered, on the agent's own map.

use voxels::{Cell, bits};

use super::places::squared;
use crate::Ctx;

/// Cells farther away than this stay unvisited, whatever the radius in metres: it bounds the cost.
const REACH_MAX_CELLS: f64 = 24.0;

/// Marks the free cells within `radius_m` (centre to centre) of the agent's cell and in line of
/// sight over free cells as covered. The agent must be inside the map.
pub(crate) fn mark_visited(ctx: &mut Ctx<'_>, radius_m: f64) {
    let own = ctx.cell();
    let extent = ctx.map().extent();
    let radius_cells = (radius_m / extent.cell_m()).min(REACH_MAX_CELLS);
    let reach = radius_cells as i32;
    let map = ctx.map();
    let mut seen = Vec::new();
    for (z, y) in (-reach..=reach).flat_map(|z| (-reach..=reach).map(move |y| (z, y))) {
        let first = own + Cell::new(-reach, y, z);
        for by in bits(map.unvisited_row(first, (2 * reach + 1).cast_unsigned())) {
            let cell = Cell::new(first.x + by.cast_signed(), first.y, first.z);
            if f64::from(squared(cell - own)) <= radius_cells * radius_cells && map.is_in_sight(own, cell) {
                seen.push(cell);
            }
        }
    }
    ctx.mark_all_covered(&seen);
}
