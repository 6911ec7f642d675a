//! What is known of a map in standard messages: an occupancy grid, a tree of OctoMap, and points.
//!
//! The server shows what the team knows in them, and agents what they know themselves.
//!
//! Invariant: no message is larger than [`VIEW_BYTES_MAX`]; what does not fit becomes coarser.

use msgs::geometry_msgs::Pose;
use msgs::ids::Tick;
use msgs::nav_msgs::{MapMetaData, OccupancyGrid};
use msgs::octomap_msgs::Octomap;
use msgs::sensor_msgs::{PointCloud2, PointField};
use msgs::std_msgs::Header;
use nalgebra::Point3;
use voxels::octree::binary_tree_within;
use voxels::projection::project;
use voxels::{Cell, Extent, Terrain};

use crate::geometry::header;
use crate::limits::{MESSAGE_BYTES_BARE, VIEW_BYTES_MAX};

/// Most bytes of the content of a message: of the places of a grid, 244 x 244, and of the nodes of
/// a tree.
pub const CONTENT_BYTES_MAX: usize = VIEW_BYTES_MAX - MESSAGE_BYTES_BARE;

/// Bytes of a coordinate, and of a point.
const COORDINATE_BYTES: u32 = 4;
const POINT_BYTES: u32 = 3 * COORDINATE_BYTES;

/// Largest number of points in a cloud: 4957.
pub const POINTS_MAX: usize = CONTENT_BYTES_MAX / POINT_BYTES as usize;

/// The map projected to the plane (frame `map`), of what is known of its cells: free where a free
/// cell lies above a place, occupied by walls beside them, unknown elsewhere. A map with too many
/// places for a message has longer ones.
pub fn occupancy(extent: Extent, tick: Tick, known: impl Fn(Cell) -> Option<Terrain>) -> OccupancyGrid {
    let projection = project(extent, CONTENT_BYTES_MAX, known);
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

/// The known cells of a map (frame `map`), whose lowest corner is at the origin. Cells are as long
/// as those of the map, or 2, 4, 8 times as long if the tree is too large for a message.
pub fn octomap(extent: Extent, tick: Tick, known: impl Fn(Cell) -> Option<Terrain>) -> Octomap {
    let tree = binary_tree_within(CONTENT_BYTES_MAX, extent, known);
    Octomap {
        header: header(tick),
        binary: true,
        id: Octomap::OC_TREE.to_owned(),
        resolution: extent.cell_m() * f64::from(tree.step),
        data: tree.nodes.into_iter().map(u8::cast_signed).collect(),
    }
}

/// The centres of the walls that are known, metres, in the frame `map`.
pub fn wall_points(extent: Extent, tick: Tick, known: impl Fn(Cell) -> Option<Terrain>) -> PointCloud2 {
    let walls = extent.cells().filter(|&cell| known(cell) == Some(Terrain::Wall));
    let centres: Vec<Point3<f64>> = walls.map(|cell| extent.centre(cell)).collect();
    cloud(header(tick), centres.len(), |number| centres[number].into())
}

/// `count` points, metres; more than [`POINTS_MAX`] are thinned evenly.
#[must_use]
pub fn cloud(header: Header, count: usize, point: impl Fn(usize) -> [f64; 3]) -> PointCloud2 {
    cloud_with(header, count, &[], |number| (point(number), Vec::new()))
}

/// A field of points beside their coordinates.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ExtraField {
    /// Its name.
    pub name: &'static str,
    /// Its type, a constant of [`PointField`].
    pub datatype: u8,
    /// Bytes of a value.
    pub bytes: u32,
}

/// `count` points, metres, with further fields without gaps behind their coordinates. `point` gives
/// the bytes of these, too. Points that do not fit into a message are thinned evenly.
#[must_use]
pub fn cloud_with(
    header: Header,
    count: usize,
    extra: &[ExtraField],
    point: impl Fn(usize) -> ([f64; 3], Vec<u8>),
) -> PointCloud2 {
    let point_step = POINT_BYTES + extra.iter().map(|field| field.bytes).sum::<u32>();
    let width = count.min(CONTENT_BYTES_MAX / point_step as usize);
    let mut data = Vec::with_capacity(width * point_step as usize);
    for number in 0..width {
        let (coordinates, others) = point(number * count / width);
        for coordinate in coordinates {
            data.extend((coordinate as f32).to_le_bytes());
        }
        data.extend(others);
    }
    let coordinate = |name| ExtraField { name, datatype: PointField::FLOAT32, bytes: COORDINATE_BYTES };
    let mut offset = 0;
    let field = |field: ExtraField| {
        let before = offset;
        offset += field.bytes;
        PointField { name: field.name.to_owned(), offset: before, datatype: field.datatype, count: 1 }
    };
    let fields = ["x", "y", "z"].map(coordinate).into_iter().chain(extra.iter().copied()).map(field).collect();
    let width = width as u32;
    PointCloud2 {
        header,
        height: 1,
        width,
        fields,
        is_bigendian: false,
        point_step,
        row_step: point_step * width,
        data,
        is_dense: true,
    }
}

#[cfg(test)]
mod tests {
    use voxels::Grid;

    use super::*;

    #[test]
    fn rooms_are_free_and_rock_is_unknown() {
        let extent = Extent::new([6, 4, 3], 0.5).unwrap();
        let free = Cell::new(1, 1, 1);
        let known = |cell: Cell| match free.neighbours6().contains(&cell) {
            true => Some(Terrain::Wall),
            false => (cell == free).then_some(Terrain::Free),
        };
        let grid = occupancy(extent, Tick(3), known);
        assert_eq!((grid.info.width, grid.info.height, grid.info.resolution), (6, 4, 0.5));
        let (f, w, u) = (OccupancyGrid::FREE, OccupancyGrid::OCCUPIED, OccupancyGrid::UNKNOWN);
        assert_eq!(grid.data, [[u, w, u, u, u, u], [w, f, w, u, u, u], [u, w, u, u, u, u], [u; 6]].concat());
    }

    #[test]
    fn large_maps_fit_into_a_sample() {
        let terrain = Grid::new(Extent::new([1000, 700, 1], 0.1).unwrap(), Terrain::Free);
        let grid = occupancy(terrain.extent(), Tick(0), |cell| terrain.get(cell).copied());
        assert_eq!((grid.info.width, grid.info.height), (250, 175));
        assert!((grid.info.resolution - 0.4).abs() < 1e-6);
        assert!(msgs::cdr::encode(&grid).len() <= VIEW_BYTES_MAX);
    }

    #[test]
    fn trees_fit_into_a_sample() {
        // Every other cell is wall: nothing of it is alike.
        let extent = Extent::new([64, 64, 64], 0.25).unwrap();
        let kind = |cell: Cell| if (cell.x + cell.y + cell.z) % 2 == 0 { Terrain::Wall } else { Terrain::Free };
        let terrain = Grid::from_vec(extent, extent.cells().map(kind).collect()).unwrap();
        let tree = octomap(extent, Tick(3), |cell| terrain.get(cell).copied());
        assert_eq!((tree.resolution, tree.binary, tree.id.as_str()), (0.5, true, "OcTree"));
        assert!(msgs::cdr::encode(&tree).len() <= VIEW_BYTES_MAX);
        // All of it is wall then: a cube in the highest corner of the root.
        assert!(tree.data.len() < 40, "{}", tree.data.len());
    }

    #[test]
    fn large_clouds_are_thinned_evenly() {
        let cloud = cloud(header(Tick(3)), 2 * POINTS_MAX, |number| [number as f64, 0.0, 0.0]);
        assert_eq!(POINTS_MAX, 4957);
        assert_eq!((cloud.width as usize, cloud.row_step as usize), (POINTS_MAX, 12 * POINTS_MAX));
        assert!(msgs::cdr::encode(&cloud).len() <= VIEW_BYTES_MAX);
        assert_eq!(cloud.data[12..16], 2.0_f32.to_le_bytes());
    }

    #[test]
    fn further_fields_take_room_of_points() {
        let ring = ExtraField { name: "ring", datatype: PointField::UINT16, bytes: 2 };
        let time = ExtraField { name: "time", datatype: PointField::FLOAT32, bytes: 4 };
        let point = |number: usize| ([number as f64, 0.0, 0.0], [&[number as u8, 0][..], &[0; 4]].concat());
        let cloud = cloud_with(header(Tick(3)), 10_000, &[ring, time], point);
        assert_eq!((cloud.width, cloud.point_step, cloud.row_step), (3304, 18, 18 * 3304));
        assert!(msgs::cdr::encode(&cloud).len() <= VIEW_BYTES_MAX);
        let offsets: Vec<_> = cloud.fields.iter().map(|field| (field.name.as_str(), field.offset)).collect();
        assert_eq!(offsets, [("x", 0), ("y", 4), ("z", 8), ("ring", 12), ("time", 14)]);
        assert_eq!((cloud.data[18..22].to_vec(), cloud.data[30]), (3.0_f32.to_le_bytes().to_vec(), 3));
    }
}
