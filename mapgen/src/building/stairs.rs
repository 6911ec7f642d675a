//! Staircases and lift shafts: the free cells of a core, and its doors to the hallway.
//!
//! The flights of a staircase lie above each other. From a landing at one end of the core the steps
//! go up, one cell for each cell along the hallway, to a landing at the other end, which is as high
//! as the next floor. Above each step there are as many free cells as on a floor, and the next
//! flight is as thick as the slab between two floors.

use super::BuildingSpec;
use super::rect::{Block, Rect, Side};
use super::skeleton::{Core, CoreKind};

/// All free cells of a core and of the wall between it and the hallway.
pub(super) fn carve(spec: &BuildingSpec, core: &Core) -> Vec<Block> {
    match core.kind {
        CoreKind::Stairs { up_to } => stairs(spec, core, up_to),
        CoreKind::Lift => lift(spec, core),
    }
}

fn stairs(spec: &BuildingSpec, core: &Core, up_to: usize) -> Vec<Block> {
    let along = 1 - core.hall.axis;
    let (bottom, top) = (Side { axis: along, end: 1 - up_to }, Side { axis: along, end: up_to });
    let landing = spec.stair_width as i32;
    let doors = core.rect.beyond(core.hall);
    let mut blocks = Vec::new();
    let mut lower: Option<i32> = None;
    for base in spec.bases() {
        if let Some(lower) = lower {
            blocks.extend(flight(spec, core.rect, bottom, lower));
            blocks.push(core.rect.nearest(bottom, landing).raised(lower, spec.floor_height as i32));
            blocks.push(doors.nearest(bottom, landing).raised(lower, spec.door_height as i32));
            blocks.push(core.rect.nearest(top, landing).raised(base, spec.floor_height as i32));
            blocks.push(doors.nearest(top, landing).raised(base, spec.door_height as i32));
        }
        lower = Some(base);
    }
    blocks
}

/// The free cells above the steps from one floor to the next one, without the landings.
fn flight(spec: &BuildingSpec, rect: Rect, bottom: Side, base: i32) -> impl Iterator<Item = Block> {
    let (landing, height) = (spec.stair_width as i32, spec.floor_height as i32);
    let top = Side { end: 1 - bottom.end, ..bottom };
    (1..spec.rise()).map(move |step| {
        let up_to_here = rect.nearest(bottom, landing + step);
        up_to_here.nearest(top, 1).raised(base + step, height)
    })
}

fn lift(spec: &BuildingSpec, core: &Core) -> Vec<Block> {
    let height = (spec.floors as i32 - 1) * spec.rise() + spec.floor_height as i32;
    let mut blocks: Vec<Block> = spec.bases().take(1).map(|base| core.rect.raised(base, height)).collect();
    let along = 1 - core.hall.axis;
    let width = spec.door_width.min(spec.lift_width) as i32;
    let wall = core.rect.beyond(core.hall);
    let low = wall.low[along] + (wall.along(along) - width) / 2;
    let door = wall.between(along, low, low + width);
    blocks.extend(spec.bases().map(|base| door.raised(base, spec.door_height as i32)));
    blocks
}
