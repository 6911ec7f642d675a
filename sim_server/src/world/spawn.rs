//! Where the agents start.
//!
//! Invariant: every start has room for the body (no wall and no other body within its radius) and lies inside the map.

use std::f64::consts::TAU;

use nalgebra::{Point3, Vector3};
use serde::{Deserialize, Serialize};
use thiserror::Error;
use voxels::{Cell, Grid, Terrain};

use super::body::Pose;
use super::collision::Sphere;

/// How starts are chosen.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(
    tag = "kind",
    rename_all = "snake_case",
    deny_unknown_fields,
    expecting = "{ kind = \"nearest_origin\" } or { kind = \"list\", poses = [...] }"
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
}

/// Why there is no start for the team.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum SpawnError {
    /// No free cube is large enough.
    #[error(
        "spawn: no free cube of {edge} x {edge} x {edge} cells for {agents} agents is in this map; \
         use a map with more room, fewer agents, or `spawn.kind = \"list\"`"
    )]
    NoCube {
        /// Cells along an edge of the cube.
        edge: i32,
        /// Size of the team.
        agents: usize,
    },
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
    #[error("spawn: bodies of radius {radius_m} m do not fit side by side into cells of {cell_m} m")]
    BodyTooLarge {
        /// Radius of the body.
        radius_m: f64,
        /// Edge of a cell.
        cell_m: f64,
    },
}

impl SpawnSpec {
    /// The starts of bodies with these radii (metres), by agent.
    ///
    /// # Errors
    /// If there is no room for one of them.
    pub fn poses(&self, terrain: &Grid<Terrain>, radii_m: &[f64]) -> Result<Vec<Pose>, SpawnError> {
        match self {
            Self::NearestOrigin { yaw_rad } => {
                let cell_m = terrain.extent().cell_m();
                if let Some(&radius_m) = radii_m.iter().find(|&radius_m| 2.0 * radius_m > cell_m) {
                    return Err(SpawnError::BodyTooLarge { radius_m, cell_m });
                }
                let cells = nearest_cube(terrain, radii_m.len())?;
                Ok(cells
                    .into_iter()
                    .map(|cell| Pose { position: terrain.extent().centre(cell), yaw_rad: *yaw_rad })
                    .collect())
            }
            Self::List { poses } => listed(poses, terrain, radii_m),
        }
    }
}

/// One cell for each agent, out of the free cube whose lowest corner is nearest to cell (0, 0, 0).
///
/// Order as in the reference, with its axes x, y (up), z: x slowest, then up, then the other horizontal axis.
fn nearest_cube(terrain: &Grid<Terrain>, agents: usize) -> Result<Vec<Cell>, SpawnError> {
    let mut edge = 3_i32;
    while (edge.unsigned_abs() as usize).pow(3) < agents {
        edge += 1;
    }
    let is_free = |cell: Cell| terrain.get(cell) == Some(&Terrain::Free);
    let cube = |corner: Cell| {
        (0..edge).flat_map(move |x| (0..edge).flat_map(move |z| (0..edge).map(move |y| corner + Cell::new(x, y, z))))
    };
    let [size_x, size_y, size_z] = terrain.extent().size().map(u32::cast_signed);
    let mut nearest: Option<(i64, Cell)> = None;
    for x in 0..=size_x - edge {
        for z in 0..=size_z - edge {
            for y in 0..=size_y - edge {
                let square = i64::from(x).pow(2) + i64::from(y).pow(2) + i64::from(z).pow(2);
                let corner = Cell::new(x, y, z);
                if nearest.is_none_or(|(least, _)| square < least) && cube(corner).all(is_free) {
                    nearest = Some((square, corner));
                }
            }
        }
    }
    let (_, corner) = nearest.ok_or(SpawnError::NoCube { edge, agents })?;
    Ok(cube(corner).take(agents).collect())
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
mod tests {
    use super::*;

    fn hall() -> Grid<Terrain> {
        let layer = "#######\n#.....#\n#.....#\n#.....#\n#######\n";
        let solid = "#######\n#######\n#######\n#######\n#######\n";
        Grid::from_text(&[solid, layer, layer, layer, solid].join("\n")).unwrap()
    }

    #[test]
    fn cube_nearest_to_the_origin_is_filled_x_slowest_then_up() {
        let spec = SpawnSpec::NearestOrigin { yaw_rad: 0.5 };
        let poses = spec.poses(&hall(), &[0.4; 4]).unwrap();
        let positions: Vec<_> = poses.iter().map(|pose| pose.position).collect();
        assert_eq!(
            positions,
            [
                Point3::new(1.5, 1.5, 1.5),
                Point3::new(1.5, 2.5, 1.5),
                Point3::new(1.5, 3.5, 1.5),
                Point3::new(1.5, 1.5, 2.5),
            ]
        );
        assert!(poses.iter().all(|pose| pose.yaw_rad == 0.5));
    }

    #[test]
    fn a_team_that_does_not_fit_is_told_so() {
        let spec = SpawnSpec::NearestOrigin { yaw_rad: 0.0 };
        assert_eq!(spec.poses(&hall(), &[0.4; 28]), Err(SpawnError::NoCube { edge: 4, agents: 28 }));
    }

    #[test]
    fn a_list_is_checked_entry_by_entry() {
        let spec = |poses: Vec<Vec<f64>>| SpawnSpec::List { poses };
        let hall = hall();
        assert!(matches!(spec(vec![vec![1.5, 1.5, 1.5]]).poses(&hall, &[0.4; 2]), Err(SpawnError::WrongCount { .. })));
        assert!(matches!(spec(vec![vec![1.5, 1.5]]).poses(&hall, &[0.4]), Err(SpawnError::NotAPose { index: 0, .. })));
        assert!(matches!(
            spec(vec![vec![1.5, f64::NAN, 1.0]]).poses(&hall, &[0.4]),
            Err(SpawnError::NotAPose { index: 0, .. })
        ));
        assert!(matches!(
            spec(vec![vec![1.2, 1.5, 1.5]]).poses(&hall, &[0.4]),
            Err(SpawnError::NoRoom { index: 0, .. })
        ));
        assert!(matches!(
            spec(vec![vec![1.5, 1.5, 1.5], vec![2.0, 1.5, 1.5]]).poses(&hall, &[0.4; 2]),
            Err(SpawnError::NoRoom { index: 1, .. })
        ));
        let side_by_side = spec(vec![vec![1.5, 2.5, 2.5], vec![2.45, 2.5, 2.5]]);
        assert!(side_by_side.poses(&hall, &[0.4, 0.4]).is_ok());
        assert!(matches!(side_by_side.poses(&hall, &[0.4, 0.6]), Err(SpawnError::NoRoom { index: 1, .. })));
        let poses = spec(vec![vec![1.5, 1.5, 1.5], vec![3.0, 1.5, 1.5, 2.0]]).poses(&hall, &[0.4; 2]).unwrap();
        assert_eq!(poses[1].yaw_rad, 2.0);
    }
}
