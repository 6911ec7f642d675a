//! Buildings: floors with hallways, rooms and doors, joined by staircases and lift shafts.
//!
//! All floors have the same hallways and cores (staircases and lift shafts); the rooms and doors
//! are each floor's own. A floor is planned in two dimensions, and its plan is then carved out of
//! the solid, so that everything between is wall.
//!
//! Invariants: two solid layers stand around the floors, of which entrances take a niche out of the
//! inner one; every room that is carved has a door towards a hallway, the hallways of a floor are
//! connected, and the cores join the floors.

mod assembly;
mod doors;
mod rect;
mod rooms;
mod skeleton;
mod stairs;

use serde::{Deserialize, Serialize};
use voxels::{Cell, Extent};

use super::{Draft, MapError, by, check_sides, in_range};

pub(super) use assembly::{draft, entrances};

/// Solid layers around the floors on the four sides: the shell of the map, and one for the niches
/// of the entrances.
const OUTER_WALL: i32 = 2;

/// Floors that a spec may ask for: what the longest axis of a map has room for, and more than any
/// tower has.
const FLOORS_MAX: u32 = 500;

/// Staircases, lift shafts and entrances that a spec may ask for, each.
const CORES_MAX: u32 = 64;

/// Parameters of a building; the defaults are those of MAES, the two-dimensional predecessor of
/// MAES3D, where it has them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BuildingSpec {
    /// Floors, 1 to as many as the map has room for. Default 3.
    pub floors: u32,
    /// Free cells between the floor and the ceiling of a storey, from 2. Default 3.
    pub floor_height: u32,
    /// Solid cells between two storeys, from 1. Default 1.
    pub slab: u32,
    /// Hallways are added until they have this share of a floor, above 0 and up to 0.9; there is
    /// always one. Default 0.2 (MAES).
    pub hall_share: f64,
    /// Width of a hallway in cells, from 1. Default 4 (MAES).
    pub hall_width: u32,
    /// Shortest side of a room in cells, from 2. Default 6 (MAES).
    pub room_side_min: u32,
    /// Probability that a part of a floor is split once more into rooms, after the first time.
    /// Default 0.85 (MAES).
    pub split_chance: f64,
    /// Width of a door in cells, from 1; with the padding on both sides at most the shortest side
    /// of a room. Default 2 (MAES).
    pub door_width: u32,
    /// Height of a door in cells, 1 to `floor_height`. Default 2.
    pub door_height: u32,
    /// Least number of wall cells on either side of a door, where there is room for them. Default 2
    /// (MAES).
    pub door_padding: u32,
    /// Staircases, each of them through all floors. Default 2.
    pub staircases: u32,
    /// Width of a flight and length of a landing in cells, 1 to `room_side_min`. Default 2.
    pub stair_width: u32,
    /// Lift shafts, each of them through all floors. Default 0.
    pub lift_shafts: u32,
    /// Sides of a lift shaft in cells, 1 to `room_side_min`. Default 2.
    pub lift_width: u32,
    /// Entrances: ends of hallways on the ground floor with a niche in the outer wall. Default 2.
    pub entrances: u32,
}

impl Default for BuildingSpec {
    fn default() -> Self {
        Self {
            floors: 3,
            floor_height: 3,
            slab: 1,
            hall_share: 0.2,
            hall_width: 4,
            room_side_min: 6,
            split_chance: 0.85,
            door_width: 2,
            door_height: 2,
            door_padding: 2,
            staircases: 2,
            stair_width: 2,
            lift_shafts: 0,
            lift_width: 2,
            entrances: 2,
        }
    }
}

/// An entrance of a building, seen from inside: a niche at the end of a hallway, where the door
/// towards the outside would be.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Entrance {
    /// The free cells of the niche, in cell order; beyond each of them is the shell.
    pub cells: Vec<Cell>,
    /// The direction towards the outside: +x, -x, +y or -y, one cell long.
    pub outward: Cell,
}

/// The contents of a building.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Built {
    /// Floors.
    pub floors: u64,
    /// Rooms on all floors, without hallways.
    pub rooms: u64,
    /// Doors of these rooms.
    pub doors: u64,
    /// Staircases.
    pub staircases: u64,
    /// Lift shafts.
    pub lift_shafts: u64,
    /// Niches in the outer wall.
    pub entrances: u64,
}

impl BuildingSpec {
    pub(super) fn check(&self, extent: Extent) -> Result<(), MapError> {
        check_sides(extent)?;
        self.check_storeys(extent)?;
        let most = Extent::AXIS_MAX;
        in_range("hall_width", self.hall_width, 1..=most)?;
        in_range("room_side_min", self.room_side_min, 2..=most)?;
        in_range("split_chance", self.split_chance, 0.0..=1.0)?;
        if !(self.hall_share > 0.0 && self.hall_share <= 0.9) {
            return Err(out_of_range("hall_share", self.hall_share, "more than 0 and at most 0.9".to_owned()));
        }
        in_range("door_padding", self.door_padding, 0..=(self.room_side_min - 1) / 2)?;
        let beside_padding = self.room_side_min - 2 * self.door_padding;
        in_range("door_width", self.door_width, 1..=beside_padding.min(self.hall_width))?;
        in_range("stair_width", self.stair_width, 1..=self.room_side_min)?;
        in_range("lift_width", self.lift_width, 1..=self.room_side_min)?;
        in_range("entrances", self.entrances, 0..=CORES_MAX)?;
        self.check_floor_plan(extent)?;
        self.check_cores(extent)
    }

    /// Whether the floors fit on top of each other.
    fn check_storeys(&self, extent: Extent) -> Result<(), MapError> {
        let [.., size_z] = extent.size();
        in_range("floor_height", self.floor_height, 2..=size_z - 2)?;
        in_range("slab", self.slab, 1..=Extent::AXIS_MAX)?;
        in_range("door_height", self.door_height, 1..=self.floor_height)?;
        let fit = ((size_z - 2 + self.slab) / (self.floor_height + self.slab)).min(FLOORS_MAX);
        if !(1..=fit).contains(&self.floors) {
            let Self { floor_height, slab, .. } = self;
            let allowed =
                format!("1 to {fit}: floors of {floor_height} cells with {slab} between them, in {size_z} along z");
            return Err(out_of_range("floors", self.floors, allowed));
        }
        Ok(())
    }

    /// Whether a hallway has room for rooms on both sides.
    fn check_floor_plan(&self, extent: Extent) -> Result<(), MapError> {
        if skeleton::spine_axis(self, extent).is_some() {
            return Ok(());
        }
        let [x, y] = inside(extent);
        let beside_hall = |long: i32, short: i32| ((long - self.hall_width as i32 - 2) / 2).min(short);
        let fit = beside_hall(x, y).max(beside_hall(y, x));
        let allowed = if fit >= 2 {
            format!("2 to {fit} on a map of {} cells with a hallway {} wide", by(extent.size()), self.hall_width)
        } else {
            let needed = self.hall_width as i32 + 2 * (2 + 1 + OUTER_WALL);
            format!(
                "none on a map of {} cells: a hallway {} wide needs {needed} along x or y",
                by(extent.size()),
                self.hall_width
            )
        };
        Err(out_of_range("room_side_min", self.room_side_min, allowed))
    }

    /// Whether the floors are joined, and the first hallway is long enough for what joins them.
    fn check_cores(&self, extent: Extent) -> Result<(), MapError> {
        let least = u32::from(self.floors > 1 && self.lift_shafts == 0);
        in_range("staircases", self.staircases, least..=CORES_MAX)?;
        in_range("lift_shafts", self.lift_shafts, 0..=CORES_MAX)?;
        let (stairs, lifts) = skeleton::cores_that_fit(self, extent);
        let asked = [("staircases", self.staircases_built(), stairs), ("lift_shafts", self.lift_shafts, lifts)];
        for (key, asked, fit) in asked {
            if asked > fit {
                let allowed = format!("at most {fit}: no more find room along the first hallway");
                return Err(out_of_range(key, asked, allowed));
            }
        }
        Ok(())
    }

    /// A single floor has no stairs.
    fn staircases_built(&self) -> u32 {
        if self.floors > 1 { self.staircases } else { 0 }
    }

    /// Cells from a floor to the next one.
    fn rise(&self) -> i32 {
        (self.floor_height + self.slab) as i32
    }

    /// The lowest free layer of each floor.
    fn bases(&self) -> impl Iterator<Item = i32> + use<> {
        let rise = self.rise();
        (0..self.floors as i32).map(move |floor| 1 + floor * rise)
    }
}

/// Cells along x and y inside the outer walls.
fn inside(extent: Extent) -> [i32; 2] {
    let [x, y, _] = extent.size();
    [x, y].map(|cells| cells as i32 - 2 * OUTER_WALL)
}

fn out_of_range(key: &'static str, value: impl ToString, allowed: String) -> MapError {
    MapError::OutOfRange { key, value: value.to_string(), allowed }
}

#[cfg(test)]
mod tests;
