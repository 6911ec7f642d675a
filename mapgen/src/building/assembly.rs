//! Assembly of a building from the plans of its floors.

use rand::RngExt;
use voxels::{Cell, Extent, Grid, Terrain};

use super::rect::{Rect, Side};
use super::skeleton::Skeleton;
use super::{BuildingSpec, Built, Draft, Entrance, MapError, doors, out_of_range, rooms, stairs};

/// Plans and carves a building.
pub(crate) fn draft(spec: &BuildingSpec, extent: Extent, seed: u64) -> Result<(Draft, Built, Vec<Entrance>), MapError> {
    let (skeleton, entrances) = plan(spec, extent, seed)?;
    let mut terrain = Grid::new(extent, Terrain::Wall);
    let mut built = Built {
        floors: spec.floors.into(),
        rooms: 0,
        doors: 0,
        staircases: spec.staircases_built().into(),
        lift_shafts: spec.lift_shafts.into(),
        entrances: spec.entrances.into(),
    };
    let (height, door_height) = (spec.floor_height as i32, spec.door_height as i32);
    for (floor, base) in (0..).zip(spec.bases()) {
        let mut rng = voxels::random_streams::stream(seed, floor, "map.building.floor");
        let planned: Vec<Rect> =
            skeleton.regions.iter().flat_map(|&region| rooms::split(spec, region, &mut rng)).collect();
        let connected = doors::connect(spec, extent, &skeleton.halls, &planned, &mut rng);
        built.rooms += connected.rooms.len() as u64;
        built.doors += connected.doors.len() as u64;
        for rect in skeleton.halls.iter().chain(&connected.rooms) {
            rect.raised(base, height).carve(&mut terrain);
        }
        for door in connected.doors {
            door.raised(base, door_height).carve(&mut terrain);
        }
    }
    for block in skeleton.cores.iter().flat_map(|core| stairs::carve(spec, core)) {
        block.carve(&mut terrain);
    }
    for &cell in entrances.iter().flat_map(|entrance| &entrance.cells) {
        terrain.set(cell, Terrain::Free);
    }
    Ok((Draft { terrain, carved: None, shell_cells_closed: 0 }, built, entrances))
}

/// The entrances of the building that [`draft`] makes of the same arguments.
pub(crate) fn entrances(spec: &BuildingSpec, extent: Extent, seed: u64) -> Result<Vec<Entrance>, MapError> {
    plan(spec, extent, seed).map(|(_, entrances)| entrances)
}

/// The plan that all floors share, and the entrances.
fn plan(spec: &BuildingSpec, extent: Extent, seed: u64) -> Result<(Skeleton, Vec<Entrance>), MapError> {
    spec.check(extent)?;
    let mut rng = voxels::random_streams::stream(seed, 0, "map.building");
    let skeleton = Skeleton::draw(spec, extent, &mut rng);
    let mut mouths = skeleton.mouths.clone();
    if spec.entrances as usize > mouths.len() {
        let allowed = format!("at most {}: so many ends of hallways of this seed are at the outer wall", mouths.len());
        return Err(out_of_range("entrances", spec.entrances, allowed));
    }
    let mut entrances = Vec::new();
    for _ in 0..spec.entrances {
        let (end, side) = mouths.swap_remove(rng.random_range(0..mouths.len()));
        entrances.push(entrance(spec, end, side));
    }
    entrances.sort_by_key(|entrance| entrance.cells[0]);
    Ok((skeleton, entrances))
}

/// A niche in the middle of the end of a hallway.
fn entrance(spec: &BuildingSpec, end: Rect, side: Side) -> Entrance {
    let along = 1 - side.axis;
    let (width, height) = (spec.door_width as i32, spec.door_height as i32);
    let low = end.low[along] + (end.along(along) - width) / 2;
    let ground = spec.bases().next().expect("a checked spec has a floor");
    let niche = end.beyond(side).between(along, low, low + width).raised(ground, height);
    let [x, y] = side.outward();
    Entrance { cells: niche.cells().collect(), outward: Cell::new(x, y, 0) }
}
