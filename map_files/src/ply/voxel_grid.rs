//! Grids of voxels as Open3D writes them: before the vertices, which are indices of voxels, stand
//! their origin and size and, since 0.20, how they are turned.

use voxels::Extent;

use super::super::Note;
use super::super::bytes::Bytes;
use super::{header, positions, read_values};

/// Part of a voxel by which its centre is moved upwards, so that all voxels of a grid fall into
/// cells of their own whose boundaries are exactly where the centres are.
pub(super) const NUDGE: f64 = 1e-6;

/// What Open3D writes before the indices of voxels.
pub(super) struct VoxelGrid {
    /// The lowest corner of voxel 0 0 0, in units of the file.
    origin: [f64; 3],
    /// The edge of a voxel.
    pub(super) size: f64,
    /// The rows of the matrix that turns the grid about its lowest corner.
    rotation: [[f64; 3]; 3],
}

/// The matrix of a grid along the axes, which files before Open3D 0.20 do not name.
const UNTURNED: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

impl VoxelGrid {
    /// The grid whose voxels are the vertices of a file; `None` if they are none.
    pub(super) fn of(bytes: &[u8]) -> Option<Self> {
        let mut bytes = Bytes::new(bytes);
        let (order, elements) = header(&mut bytes).ok()?;
        let (mut origin, mut size, mut rotation) = (None, None, UNTURNED);
        for element in elements.iter().take_while(|element| element.name != b"vertex") {
            // Only elements of one piece stand before the vertices of such a file.
            if element.count != 1 || element.properties.is_empty() {
                return None;
            }
            let at = bytes.at();
            let mut values = Vec::new();
            read_values(&mut bytes, order, element, 0, &mut values, None).ok()?;
            match element.name.as_slice() {
                b"origin" => {
                    origin = Some(positions(element, ["x", "y", "z"], at).ok()?.map(|property| values[property]))
                }
                b"voxel_size" => size = values.first().copied(),
                b"rotation" => {
                    for (row, names) in
                        rotation.iter_mut().zip([["r00", "r01", "r02"], ["r10", "r11", "r12"], ["r20", "r21", "r22"]])
                    {
                        *row = positions(element, names, at).ok()?.map(|property| values[property]);
                    }
                }
                _ => {}
            }
        }
        let (origin, size) = (origin?, size?);
        Extent::new([1; 3], size).ok()?;
        let is_finite = origin.iter().chain(rotation.as_flattened()).all(|number| number.is_finite());
        is_finite.then_some(Self { origin, size, rotation })
    }

    /// The centre of the voxel with these indices, in units of the file, and a little above it.
    pub(super) fn centre(&self, voxel: [f64; 3]) -> [f64; 3] {
        let Self { origin, size, rotation } = self;
        let centre = voxel.map(|index| (index + 0.5) * size);
        [0, 1, 2].map(|axis| {
            let turned: f64 = rotation[axis].iter().zip(centre).map(|(part, along)| part * along).sum();
            origin[axis] + turned + NUDGE * size
        })
    }

    /// That the points of a file are such voxels.
    pub(super) fn note(&self) -> Note {
        let Self { origin: [x, y, z], size, rotation } = self;
        let turned = if *rotation == UNTURNED { "" } else { ", turned as the file says" };
        Note::new("voxels", format!("indices of voxels of {size} from ({x}, {y}, {z}) on{turned}"))
    }
}

#[cfg(test)]
mod tests {
    use crate::{ImportSpec, Imported};

    #[test]
    fn voxels_of_open3d_have_their_size_and_place() {
        let grid = |voxels: &[[i32; 3]], cell_m| {
            let values: String = voxels.iter().map(|[x, y, z]| format!("{x} {y} {z} 9 9 9\n")).collect();
            let text = format!(
                "ply\nformat ascii 1.0\ncomment Created by Open3D\nelement origin 1\nproperty double x\nproperty double y\n\
                 property double z\nelement voxel_size 1\nproperty double val\nelement vertex {}\nproperty double x\n\
                 property double y\nproperty double z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n\
                 end_header\n-0.15 0.25 1.05\n0.1\n{values}",
                voxels.len()
            );
            ImportSpec { cell_m, ..ImportSpec::new("a.ply", text.into_bytes()) }.read()
        };
        // Every voxel of a row is a cell, though their centres lie on boundaries of cells.
        let row: Vec<[i32; 3]> = (0..40).map(|x| [x, 0, 0]).collect();
        let Imported { terrain, stores_cell_m, notes, origin_m, .. } = grid(&row, None).unwrap();
        assert_eq!((terrain.extent().size(), terrain.extent().cell_m()), ([42, 3, 3], 0.1));
        assert!(stores_cell_m);
        assert_eq!(mapgen::free_cells(&terrain), 0);
        assert!(notes.iter().any(|note| note.name == "voxels"));
        let origin = origin_m.unwrap();
        assert!((origin[0] + 0.2).abs() < 1e-9 && (origin[2] - 1.0).abs() < 1e-9, "{origin:?}");
        assert_eq!(grid(&row, Some(0.5)).unwrap().terrain.extent().size(), [11, 3, 3]);
        let error = grid(&row, Some(0.05)).unwrap_err().to_string();
        assert!(error.contains("the file has cells of 0.1 m, asked for are cells of 0.05 m"), "{error}");
    }

    /// A quarter turn about x, as `VoxelGrid.rotate` of Open3D 0.20 leaves it in a file.
    #[test]
    fn turned_voxels_of_open3d_are_turned() {
        let properties =
            |names: &[&str]| names.iter().map(|name| format!("property double {name}\n")).collect::<String>();
        let rotation = properties(&["r00", "r01", "r02", "r10", "r11", "r12", "r20", "r21", "r22"]);
        let place = properties(&["x", "y", "z"]);
        let text = format!(
            "ply\nformat ascii 1.0\nelement origin 1\n{place}element rotation 1\n{rotation}element voxel_size 1\n\
             property double val\nelement vertex 3\n{place}end_header\n0 0 0\n1 0 0 0 6e-17 -1 0 1 6e-17\n0.5\n\
             0 0 0\n0 0 9\n3 0 0\n"
        );
        let Imported { terrain, origin_m, notes, .. } = ImportSpec::new("a.ply", text.into_bytes()).read().unwrap();
        // What was upwards points along -y.
        assert_eq!(terrain.extent().size(), [6, 12, 3]);
        let expected = [-0.5, -5.5, -0.5];
        let origin = origin_m.unwrap();
        assert!(origin.iter().zip(expected).all(|(is, was): (&f64, f64)| (is - was).abs() < 1e-9), "{origin:?}");
        assert!(notes.iter().all(|note| note.name != "ignored"), "{notes:?}");
    }
}
