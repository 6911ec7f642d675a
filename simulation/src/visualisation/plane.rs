//! The map projected to the plane, as an occupancy grid.

use msgs::geometry_msgs::Pose;
use msgs::ids::Tick;
use msgs::nav_msgs::{MapMetaData, OccupancyGrid};
use protocol::limits::{MESSAGE_BYTES_BARE, VIEW_BYTES_MAX};
use voxels::projection::project;
use voxels::{Cell, Extent, Terrain};

use crate::wire::header;

/// Most places, of a byte each: 244 x 244. A larger map has longer places.
const PLACES_MAX: usize = VIEW_BYTES_MAX - MESSAGE_BYTES_BARE;

/// A map (frame `map`) of what is known of its cells: free where a free cell lies above a place,
/// occupied by walls beside them, unknown elsewhere.
pub(super) fn occupancy(extent: Extent, tick: Tick, known: impl Fn(Cell) -> Option<Terrain>) -> OccupancyGrid {
    let projection = project(extent, PLACES_MAX, known);
    let value = |place: Option<Terrain>| match place {
        Some(Terrain::Free) => OccupancyGrid::FREE,
        Some(Terrain::Wall) => OccupancyGrid::OCCUPIED,
        None => OccupancyGrid::UNKNOWN,
    };
    let [width, height] = projection.size;
    OccupancyGrid {
        header: header(tick),
        info: MapMetaData {
            map_load_time: tick.into(),
            resolution: (extent.cell_m() * f64::from(projection.side_cells)) as f32,
            width,
            height,
            origin: Pose::default(),
        },
        data: projection.places.into_iter().map(value).collect(),
    }
}

#[cfg(test)]
mod tests {
    use voxels::Grid;

    use super::super::known::surfaces;
    use super::*;

    #[test]
    fn rooms_are_free_and_rock_is_unknown() {
        let mut terrain = Grid::new(Extent::new([6, 4, 3], 0.5).unwrap(), Terrain::Wall);
        terrain.set(Cell::new(1, 1, 1), Terrain::Free);
        let grid = occupancy(terrain.extent(), Tick(3), surfaces(&terrain));
        assert_eq!((grid.info.width, grid.info.height, grid.info.resolution), (6, 4, 0.5));
        let (f, w, u) = (OccupancyGrid::FREE, OccupancyGrid::OCCUPIED, OccupancyGrid::UNKNOWN);
        assert_eq!(grid.data, [[u, w, u, u, u, u], [w, f, w, u, u, u], [u, w, u, u, u, u], [u; 6]].concat());
    }

    #[test]
    fn large_maps_fit_into_a_sample() {
        let terrain = Grid::new(Extent::new([1000, 700, 1], 0.1).unwrap(), Terrain::Free);
        let grid = occupancy(terrain.extent(), Tick(0), surfaces(&terrain));
        assert_eq!((grid.info.width, grid.info.height), (250, 175));
        assert!((grid.info.resolution - 0.4).abs() < 1e-6);
        assert!(msgs::cdr::encode(&grid).len() <= VIEW_BYTES_MAX);
    }
}
