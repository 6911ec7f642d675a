//! Start poses of the agents.
//!
//! Invariant: every start has room for its body (no wall and no other body within its radius) and
//! lies inside the map; ground bodies stand on a floor there.
//!
//! Whether a team fits is decided by placing it: the error reports how many bodies found room.

mod cluster;
mod cube;
mod placed_bodies;
mod queue;
mod room;
mod scatter;

use std::f64::consts::TAU;

use nalgebra::{Point3, Vector3};
use protocol::body_model::BodyModel;
use serde::{Deserialize, Serialize};
use thiserror::Error;
use voxels::{Cell, Footing, Grid, Terrain};

use self::placed_bodies::PlacedBodies;
use super::body::{Floors, Pose};
use super::collision::{Sphere, is_touched};
use mapgen::Entrance;

/// The rule by which starts are chosen: the table `[spawn]` of a scenario.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(
    tag = "kind",
    rename_all = "snake_case",
    deny_unknown_fields,
    expecting = "{ kind = \"nearest_origin\" } or { kind = \"list\", poses = [...] }, or kind \"scattered\", \"box\" or \"entrances\""
)]
pub enum SpawnSpec {
    /// The cells of the free cube nearest to the origin of the map, one for each agent (MAES3D).
    /// The cube has three cells along each edge, or more if the team needs them. Bodies wider than
    /// a cell start side by side, the first in the cell with room that is nearest to the origin.
    NearestOrigin {
        /// Heading of all agents, radians.
        #[serde(default)]
        yaw_rad: f64,
    },
    /// One start for each agent: `[x, y, z]` in metres, or `[x, y, z, yaw]` with the heading in
    /// radians, frame `map`.
    List {
        /// The starts, by agent.
        poses: Vec<Vec<f64>>,
    },
    /// Centres of random free cells of the whole map.
    Scattered {
        /// Least distance between the centres of two bodies, metres.
        #[serde(default)]
        min_distance_m: f64,
        /// Seed of the starts; that of the run by default.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        seed: Option<u64>,
        /// Heading of all agents, radians.
        #[serde(default)]
        yaw_rad: f64,
    },
    /// Centres of free cells in a box, packed in the order of [`SpawnSpec::NearestOrigin`]: x
    /// slowest, then z, then y.
    Box {
        /// The lowest corner of the box: x, y, z in metres.
        low: [f64; 3],
        /// The highest corner of the box: x, y, z in metres.
        high: [f64; 3],
        /// Heading of all agents, radians.
        #[serde(default)]
        yaw_rad: f64,
    },
    /// At the entrances of a building in turn, then queued behind them, all facing inwards.
    Entrances {},
}

/// A map with what starts depend on.
#[derive(Debug, Clone, Copy)]
pub struct Site<'a> {
    /// The true map.
    pub terrain: &'a Grid<Terrain>,
    /// Its entrances.
    pub entrances: &'a [Entrance],
    /// Seed of the run.
    pub seed: u64,
}

/// The reason why the team has no starts.
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
        /// The largest team that fits into a free cube.
        fit: usize,
    },
    /// The free space from which starts are chosen is exhausted.
    #[error("spawn: {fit} of {agents} bodies find room {place}")]
    Full {
        /// Size of the team.
        agents: usize,
        /// Number of bodies that found room.
        fit: usize,
        /// The space that was searched, in words.
        place: String,
    },
    /// The map is not a building, or has no entrance.
    #[error(
        "spawn: this map has no entrances; `spawn.kind = \"entrances\"` needs `map.kind = \"building\"` with \
         `map.building.entrances` of 1 or more"
    )]
    NoEntrances,
    /// The list has another length than the team.
    #[error("spawn.poses: {got} poses for {expected} agents")]
    WrongCount {
        /// Number of poses in the list.
        got: usize,
        /// Number of agents of the team.
        expected: usize,
    },
    /// An entry of the list is not a pose.
    #[error(
        "spawn.poses[{index}]: expected [x, y, z] or [x, y, z, yaw] with finite numbers and a yaw of -2 pi to 2 pi, got {got:?}"
    )]
    NotAPose {
        /// Index in the list.
        index: usize,
        /// The numbers of the entry.
        got: Vec<f64>,
    },
    /// The body does not fit at an entry of the list.
    #[error("spawn.poses[{index}]: a body of radius {radius_m} m does not fit at {position:?}: {reason}")]
    NoRoom {
        /// Index in the list.
        index: usize,
        /// Position of the entry, metres, frame `map`.
        position: [f64; 3],
        /// Radius of the body, metres.
        radius_m: f64,
        /// The obstacle, in words.
        reason: &'static str,
    },
}

impl SpawnSpec {
    /// The starts of bodies, by agent. Ground bodies of a list are put on the floor below.
    ///
    /// # Errors
    /// If one of them has no room; the error reports how many have.
    pub fn poses(&self, site: &Site<'_>, bodies: &[BodyModel]) -> Result<Vec<Pose>, SpawnError> {
        let cell_m = site.terrain.extent().cell_m();
        let team: Vec<Candidate> =
            bodies.iter().map(|body| Candidate { radius_m: body.radius_m, footing: body.footing(cell_m) }).collect();
        let facing = |yaw_rad: f64| move |position| Pose { position, yaw_rad };
        match self {
            Self::NearestOrigin { yaw_rad } => {
                Ok(cube::nearest_origin(site.terrain, &team)?.into_iter().map(facing(*yaw_rad)).collect())
            }
            Self::List { poses } => listed(poses, site.terrain, bodies),
            Self::Scattered { min_distance_m, seed, yaw_rad } => {
                let seed = seed.unwrap_or(site.seed);
                let positions = scatter::scattered(site.terrain, &team, *min_distance_m, seed)?;
                Ok(positions.into_iter().map(facing(*yaw_rad)).collect())
            }
            Self::Box { low, high, yaw_rad } => {
                Ok(boxed(site.terrain, &team, *low, *high)?.into_iter().map(facing(*yaw_rad)).collect())
            }
            Self::Entrances {} => queue::at_entrances(site, &team),
        }
    }
}

/// A body that is looking for a start.
#[derive(Debug)]
struct Candidate {
    radius_m: f64,
    /// That of a ground body.
    footing: Option<Footing>,
}

impl Candidate {
    fn radii_m(team: &[Self]) -> Vec<f64> {
        team.iter().map(|body| body.radius_m).collect()
    }
}

/// One cell for each agent among those with their centres in a box. A skipped cell is not tried
/// again for later bodies.
fn boxed(
    terrain: &Grid<Terrain>,
    team: &[Candidate],
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
    let mut placed = PlacedBodies::new(terrain, &Candidate::radii_m(team), 0.0);
    let mut starts = Vec::with_capacity(team.len());
    for body in team {
        let start = cells.find_map(|cell| placed.place(cell, body));
        starts.push(start.ok_or_else(|| SpawnError::Full {
            agents: team.len(),
            fit: starts.len(),
            place: format!("in the box from {low:?} to {high:?} m"),
        })?);
    }
    Ok(starts)
}

fn listed(entries: &[Vec<f64>], terrain: &Grid<Terrain>, team: &[BodyModel]) -> Result<Vec<Pose>, SpawnError> {
    let agents = team.len();
    if entries.len() != agents {
        return Err(SpawnError::WrongCount { got: entries.len(), expected: agents });
    }
    let mut poses = Vec::with_capacity(agents);
    let mut bodies: Vec<Sphere> = Vec::with_capacity(agents);
    for (index, (entry, body)) in entries.iter().zip(team).enumerate() {
        let radius_m = body.radius_m;
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
        let position = room(terrain, &bodies, &position, body).map_err(no_room)?;
        bodies.push(Sphere { centre: position, radius_m });
        poses.push(Pose { position, yaw_rad });
    }
    Ok(poses)
}

/// Where a body is that is put at a position (metres, frame `map`): a ground body on the floor
/// below.
///
/// # Errors
/// The obstacle, in words, if it does not fit there.
pub(super) fn room<'a>(
    terrain: &Grid<Terrain>,
    others: impl IntoIterator<Item = &'a Sphere>,
    position: &Point3<f64>,
    body: &BodyModel,
) -> Result<Point3<f64>, &'static str> {
    let position = Floors::rest(terrain, body, position).ok_or(NO_ROOM)?;
    check_room(terrain, others, &position, body.radius_m)?;
    Ok(position)
}

const NO_ROOM: &str = "a wall or the end of the map is too near";

/// Checks that a body fits at a position (metres, frame `map`).
///
/// # Errors
/// The obstacle, in words.
pub(super) fn check_room<'a>(
    terrain: &Grid<Terrain>,
    others: impl IntoIterator<Item = &'a Sphere>,
    position: &Point3<f64>,
    radius_m: f64,
) -> Result<(), &'static str> {
    if !has_room_from_walls(terrain, position, radius_m) {
        return Err(NO_ROOM);
    }
    if others.into_iter().any(|other| (other.centre - position).norm() < radius_m + other.radius_m) {
        return Err("another agent is too near");
    }
    Ok(())
}

/// Whether a sphere at rest is clear of every wall and of the boundary of the map.
fn has_room_from_walls(terrain: &Grid<Terrain>, position: &Point3<f64>, radius_m: f64) -> bool {
    let extent = terrain.extent();
    if terrain.get(extent.cell_of(position)) != Some(&Terrain::Free) {
        return false;
    }
    let reach = Vector3::repeat(radius_m);
    let (low, high) = (extent.cell_of(&(position - reach)), extent.cell_of(&(position + reach)));
    (low.z..=high.z).all(|z| {
        (low.y..=high.y).all(|y| {
            (low.x..=high.x).all(|x| {
                let cell = Cell::new(x, y, z);
                terrain.get(cell) == Some(&Terrain::Free) || !is_touched(extent, cell, position, radius_m)
            })
        })
    })
}

#[cfg(test)]
mod tests;
