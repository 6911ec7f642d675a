//! What an agent sees by its own map: cells that it has visited by seeing them from near.

use std::ops::ControlFlow;

use voxels::{Cell, walk_segment};

use super::places::squared;
use crate::controllers::Ctx;
use crate::exploration_map::{CellState, ExplorationMap};

/// Cells farther away than this count as not visited, whatever the radius in metres is: it bounds the effort.
const REACH_MAX_CELLS: f64 = 24.0;

/// Marks, for an agent inside the map, the free cells within `radius_m` (from centre to centre) of the agent's cell that it sees over free cells as covered.
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
                    && is_in_sight(ctx.map(), own, cell)
                {
                    ctx.mark_covered(cell);
                }
            }
        }
    }
}

/// Whether the line between the centres of two cells crosses cells known to be free only.
pub(crate) fn is_in_sight(map: &ExplorationMap, one: Cell, other: Cell) -> bool {
    let extent = map.extent();
    let end = walk_segment(extent, &extent.centre(one), &extent.centre(other), |cell| {
        if matches!(map.state(cell), CellState::Free | CellState::Covered) {
            ControlFlow::Continue(())
        } else {
            ControlFlow::Break(())
        }
    });
    end.is_continue()
}
