//! Visits by sight: marks the cells seen from nearby as covered, on the agent's own map.

use voxels::Cell;

use super::places::squared;
use crate::Ctx;
use agent::exploration_map::CellState;

/// Cells farther away than this stay unvisited, whatever the radius in metres: it bounds the cost.
const REACH_MAX_CELLS: f64 = 24.0;

/// Marks the free cells within `radius_m` (centre to centre) of the agent's cell and in line of
/// sight over free cells as covered. The agent must be inside the map.
pub(crate) fn mark_visited(ctx: &mut Ctx<'_>, radius_m: f64) {
    let own = ctx.cell();
    let extent = ctx.map().extent();
    let radius_cells = (radius_m / extent.cell_m()).min(REACH_MAX_CELLS);
    let reach = radius_cells as i32;
    for z in -reach..=reach {
        for y in -reach..=reach {
            for x in -reach..=reach {
                let offset = Cell::new(x, y, z);
                let cell = own + offset;
                if f64::from(squared(offset)) <= radius_cells * radius_cells
                    && ctx.map().state(cell) == CellState::Free
                    && ctx.map().is_in_sight(own, cell)
                {
                    ctx.mark_covered(cell);
                }
            }
        }
    }
}
