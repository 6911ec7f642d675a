//! Where the agents start.
//!
//! Invariant: every start has room for its body (no wall and no other body within its radius) and lies inside the map.
//!
//! Whether a team fits is found out by placing it: an error says how many bodies found room in the same way.

mod cube;
mod placed_bodies;
mod queue;
mod scatter;

use std::f64::consts::TAU;

use nalgebra::{Point3, Vector3};
use serde::{Deserialize, Serialize};
use thiserror::Error;
use voxels::{Cell, Grid, Terrain};

use self::placed_bodies::PlacedBodies;
use super::body::Pose;
use super::collision::Sphere;
use mapgen::Entrance;

/// How starts are chosen.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(
    tag = "kind",
    rename_all = "snake_case",
    deny_unknown_fields,
    expecting = "{ kind = \"nearest_origin\" } or { kind = \"list\", poses = [...] }, or kind \"scattered\", \"box\" or \"entrances\""
)]
pub enum SpawnSpec {
    /// The reference's way: the cells of the free cube nearest to the origin of the map, one for each agent. The cube has
    /// three cells along each edge, or as many more as the team needs.
    NearestOrigin {
        /// Heading of all agents, radians.
        #[serde(default)]
        yaw_rad: f64,
    },
    /// One start for each agent: `[x, y, z]` in metres, or `[x, y, z, yaw]` with the heading in radians.
    List {
        /// By agent.
        poses: Vec<Vec<f64>>,
    },
    /// Centres of free cells of the whole map, at random.
    Scattered {
        /// Distance between the centres of two bodies at the least, metres.
        #[serde(default)]
        min_distance_m: f64,
        /// Seed of the starts, if it is not that of the run.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        seed: Option<u64>,
        /// Heading of all agents, radians.
        #[serde(default)]
        yaw_rad: f64,
    },
    /// Centres of free cells in a box, packed in the order of [`SpawnSpec::NearestOrigin`]: x slowest, then z, then y.
    Box {
        /// The lowest corner of the box: x, y, z in metres.
        low: [f64; 3],
        /// The highest corner of the box: x, y, z in metres.
        high: [f64; 3],
        /// Heading of all agents, radians.
        #[serde(default)]
        yaw_rad: f64,
    },
    /// At the entrances of a building, in turn, then in line behind them, all of them facing inwards.
    Entrances {},
}

/// A map to start on.
#[derive(Debug, Clone, Copy)]
pub struct Site<'a> {
    /// The true map.
    pub terrain: &'a Grid<Terrain>,
    /// Its entrances.
    pub entrances: &'a [Entrance],
    /// Seed of the run.
    pub seed: u64,
}

/// Why there is no start for the team.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum SpawnError {
    /// No free cube is large enough.
    #[error(
        "spawn: no free cube of {edge} x {edge} x {edge} cells for {agents} agents is in this map, the largest one has room for \
         {fit}; use a map with more room, fewer agents, or another `spawn.kind`"
    )]
    NoCube {
        /// Cells along an edge of the cube.
        edge: i32,
        /// Size of the team.
        agents: usize,
        /// The largest team that there is a cube for.
        fit: usize,
    },
    /// The free space that starts are chosen from is used up.
    #[error("spawn: {fit} of {agents} bodies find room {place}")]
    Full {
        /// Size of the team.
        agents: usize,
        /// Bodies that found room before there was none.
        fit: usize,
        /// Where they were looking for it.
        place: String,
    },
    /// The map is no building, or has no way in.
    #[error(
        "spawn: this map has no entrances; `spawn.kind = \"entrances\"` needs `map.kind = \"building\"` with \
         `map.building.entrances` of 1 or more"
    )]
    NoEntrances,
    /// The list does not fit the team.
    #[error("spawn.poses: {got} poses for {expected} agents")]
    WrongCount {
        /// Poses in the list.
        got: usize,
        /// Agents of the team.
        expected: usize,
    },
    /// An entry of the list is no pose.
    #[error(
        "spawn.poses[{index}]: expected [x, y, z] or [x, y, z, yaw] with finite numbers and a yaw of -2 pi to 2 pi, got {got:?}"
    )]
    NotAPose {
        /// Position in the list.
        index: usize,
        /// The entry.
        got: Vec<f64>,
    },
    /// There is no room for the body at an entry of the list.
    #[error("spawn.poses[{index}]: a body of radius {radius_m} m does not fit at {position:?}: {reason}")]
    NoRoom {
        /// Position in the list.
        index: usize,
        /// Where.
        position: [f64; 3],
        /// Radius of the body.
        radius_m: f64,
        /// What is in the way.
        reason: &'static str,
    },
    /// The bodies are too large for cells.
    #[error(
        "spawn: bodies of radius {radius_m} m do not fit side by side into cells of {cell_m} m; set `body.radius_m` to at most \
         {fits_m}, or `spawn.kind` to \"scattered\"", fits_m = cell_m / 2.0
    )]
    BodyTooLarge {
        /// Radius of the body.
        radius_m: f64,
        /// Edge of a cell.
        cell_m: f64,
    },
}

impl SpawnSpec {
    /// The starts of bodies with these radii, by agent.
    ///
    /// # Errors
    /// If there is no room for one of them; the error says how many there is room for.
    pub fn poses(&self, site: &Site<'_>, radii_m: &[f64]) -> Result<Vec<Pose>, SpawnError> {
        let facing = |yaw_rad: f64| move |position| Pose { position, yaw_rad };
        match self {
            Self::NearestOrigin { yaw_rad } => {
                Ok(cube::nearest_origin(site.terrain, radii_m)?.into_iter().map(facing(*yaw_rad)).collect())
            }
            Self::List { poses } => listed(poses, site.terrain, radii_m),
            Self::Scattered { min_distance_m, seed, yaw_rad } => {
                let seed = seed.unwrap_or(site.seed);
                let positions = scatter::scattered(site.terrain, radii_m, *min_distance_m, seed)?;
                Ok(positions.into_iter().map(facing(*yaw_rad)).collect())
            }
            Self::Box { low, high, yaw_rad } => {
                Ok(boxed(site.terrain, radii_m, *low, *high)?.into_iter().map(facing(*yaw_rad)).collect())
            }
            Self::Entrances {} => queue::at_entrances(site, radii_m),
        }
    }
}

/// One cell for each agent, out of those whose centres lie in a box. A cell that is passed over is not looked at again.
fn boxed(
    terrain: &Grid<Terrain>,
    radii_m: &[f64],
    low: [f64; 3],
    high: [f64; 3],
) -> Result<Vec<Point3<f64>>, SpawnError> {
    let extent = terrain.extent();
    let size = extent.size().map(u32::cast_signed);
    let is_inside =
        |axis: usize, cell: &i32| (low[axis]..=high[axis]).contains(&((f64::from(*cell) + 0.5) * extent.cell_m()));
    let along = [0, 1, 2].map(|axis| (0..size[axis]).filter(|cell| is_inside(axis, cell)).collect::<Vec<i32>>());
    let [x, y, z] = &along;
    let mut cells = x.iter().flat_map(|&x| z.iter().flat_map(move |&z| y.iter().map(move |&y| Cell::new(x, y, z))));
    let mut crowd = PlacedBodies::new(terrain, radii_m, 0.0);
    let mut starts = Vec::with_capacity(radii_m.len());
    for &radius_m in radii_m {
        let start = cells.find_map(|cell| crowd.place(cell, radius_m));
        starts.push(start.ok_or_else(|| SpawnError::Full {
            agents: radii_m.len(),
            fit: starts.len(),
            place: format!("in the box from {low:?} to {high:?} m"),
        })?);
    }
    Ok(starts)
}

fn listed(entries: &[Vec<f64>], terrain: &Grid<Terrain>, radii_m: &[f64]) -> Result<Vec<Pose>, SpawnError> {
    let agents = radii_m.len();
    if entries.len() != agents {
        return Err(SpawnError::WrongCount { got: entries.len(), expected: agents });
    }
    let mut poses = Vec::with_capacity(agents);
    let mut bodies: Vec<Sphere> = Vec::with_capacity(agents);
    for (index, (entry, &radius_m)) in entries.iter().zip(radii_m).enumerate() {
        let (position, yaw_rad) = match entry[..] {
            [x, y, z] => (Point3::new(x, y, z), 0.0),
            [x, y, z, yaw_rad] => (Point3::new(x, y, z), yaw_rad),
            _ => {
                return Err(SpawnError::NotAPose { index, got: entry.clone() });
            }
        };
        if !entry.iter().all(|number| number.is_finite()) || yaw_rad.abs() > TAU {
            return Err(SpawnError::NotAPose { index, got: entry.clone() });
        }
        let no_room =
            |reason| SpawnError::NoRoom { index, position: [position.x, position.y, position.z], radius_m, reason };
        check_room(terrain, &bodies, &position, radius_m).map_err(no_room)?;
        bodies.push(Sphere { centre: position, radius_m });
        poses.push(Pose { position, yaw_rad });
    }
    Ok(poses)
}

/// Whether a body can be there.
///
/// # Errors
/// What is in the way.
pub(super) fn check_room<'a>(
    terrain: &Grid<Terrain>,
    others: impl IntoIterator<Item = &'a Sphere>,
    position: &Point3<f64>,
    radius_m: f64,
) -> Result<(), &'static str> {
    if !has_room_from_walls(terrain, position, radius_m) {
        return Err("a wall or the end of the map is too near");
    }
    if others.into_iter().any(|other| (other.centre - position).norm() < radius_m + other.radius_m) {
        return Err("another agent is too near");
    }
    Ok(())
}

/// Whether a sphere at rest keeps clear of every wall and of the end of the map.
fn has_room_from_walls(terrain: &Grid<Terrain>, position: &Point3<f64>, radius_m: f64) -> bool {
    let extent = terrain.extent();
    if terrain.get(extent.cell_of(position)) != Some(&Terrain::Free) {
        return false;
    }
    let reach = Vector3::repeat(radius_m);
    let (low, high) = (extent.cell_of(&(position - reach)), extent.cell_of(&(position + reach)));
    let edge = Vector3::repeat(extent.cell_m());
    (low.z..=high.z).all(|z| {
        (low.y..=high.y).all(|y| {
            (low.x..=high.x).all(|x| {
                let corner = Point3::new(f64::from(x), f64::from(y), f64::from(z)) * extent.cell_m();
                terrain.get(Cell::new(x, y, z)) == Some(&Terrain::Free)
                    || (position - position.sup(&corner).inf(&(corner + edge))).norm() >= radius_m
            })
        })
    })
}

#[cfg(test)]
mod tests;
