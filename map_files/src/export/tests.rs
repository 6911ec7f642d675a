use super::surface::{Rectangle, rectangles};
use super::*;
use crate::{ImportOptions, ImportSpec, Imported, MapReader};
use mapgen::{Kind, free_cells};
use proptest::prelude::*;
use std::collections::BTreeMap;
use voxels::{Extent, is_wall_at};

/// A closed map with cells of some length.
fn closed_map() -> impl Strategy<Value = Grid<Terrain>> {
    let cell_m = prop_oneof![Just(1.0), Just(0.1), Just(0.3), 0.05f64..3.0];
    (prop::array::uniform3(3u32..9), cell_m).prop_flat_map(|(size, cell_m)| {
        let extent = Extent::new(size, cell_m).unwrap();
        let cell = prop_oneof![Just(Terrain::Free), Just(Terrain::Wall)];
        prop::collection::vec(cell, extent.volume()).prop_map(move |cells| {
            let mut terrain = Grid::from_vec(extent, cells).unwrap();
            voxels::close_shell(&mut terrain, 1);
            terrain
        })
    })
}

/// The free cells, each with the lowest coordinates of any as the origin.
fn free_from_lowest(terrain: &Grid<Terrain>) -> Vec<[i32; 3]> {
    let free = || terrain.iter().filter(|&(_, &here)| here == Terrain::Free).map(|(cell, _)| [cell.x, cell.y, cell.z]);
    let low = [0, 1, 2].map(|axis| free().map(|cell| cell[axis]).min().unwrap_or_default());
    free().map(|cell| [0, 1, 2].map(|axis| cell[axis] - low[axis])).collect()
}

fn as_a_cave(file: &str, bytes: Vec<u8>, cell_m: f64) -> Imported {
    let options = ImportOptions { inside: Some(Kind::Free), ..ImportOptions::default() };
    ImportSpec { options, cell_m: Some(cell_m), ..ImportSpec::new(file, bytes) }.read().unwrap()
}

#[test]
fn a_room_has_six_rectangles() {
    let mut room = Grid::new(Extent::new([6, 5, 4], 0.5).unwrap(), Terrain::Free);
    voxels::close_shell(&mut room, 1);
    assert_eq!(rectangles(&room).len(), 6);
    let text = String::from_utf8(obj(&room)).unwrap();
    assert_eq!(text.lines().filter(|line| line.starts_with("v ")).count(), 8);
    assert!(text.contains("v 2.5 2 1.5\n"), "{text}");
    assert_eq!(stl(&room).len(), 84 + 12 * 50);
}

#[test]
fn faces_look_at_the_wall() {
    let room = Grid::from_text("###\n###\n###\n\n###\n#.#\n###\n\n###\n###\n###\n").unwrap();
    for rectangle in rectangles(&room) {
        let [a, b, c, _] = rectangle.corners().map(|corner| corner.map(f64::from));
        let to = |corner: [f64; 3]| [0, 1, 2].map(|axis| corner[axis] - a[axis]);
        let (b, c) = (to(b), to(c));
        let cross = [b[1] * c[2] - b[2] * c[1], b[2] * c[0] - b[0] * c[2], b[0] * c[1] - b[1] * c[0]];
        assert_eq!(cross, rectangle.normal().map(f64::from));
        let middle = [0, 1, 2].map(|axis| 1.5 - a[axis]);
        assert!((0..3).map(|axis| cross[axis] * middle[axis]).sum::<f64>() < 0.0);
    }
}

#[test]
fn a_map_of_every_written_format_comes_back() {
    let drawn = "#####\n#####\n#####\n#####\n\n#####\n#..##\n#.#.#\n#####\n\n#####\n#####\n#####\n#####\n";
    let terrain = Grid::from_text(drawn).unwrap();
    let written = WRITERS.iter().map(|writer| (writer.extension, writer.write(&terrain)));
    for (extension, bytes) in written.chain([("m3dm", Ok(packed::write(&terrain)))]) {
        let Ok(bytes) = bytes else {
            assert_eq!(extension, "yaml");
            continue;
        };
        let file = format!("a.{extension}");
        if extension == "pcd" {
            continue;
        }
        let is_mesh = MapReader::of(Path::new(&file)).unwrap().options.contains(&"inside");
        let options = ImportOptions { inside: is_mesh.then_some(Kind::Free), ..ImportOptions::default() };
        let spec = ImportSpec { options, ..ImportSpec::new(file, bytes) };
        assert_eq!(spec.read().unwrap().terrain, terrain, "{extension}");
    }
}

proptest! {
    #[test]
    fn a_tree_is_read_as_it_was_written(terrain in closed_map()) {
        let imported = ImportSpec::new("a.bt", octomap(&terrain, [0; 3])).read().unwrap();
        prop_assert_eq!(&imported.terrain, &terrain);
        prop_assert!(imported.stores_cell_m);
    }

    #[test]
    fn the_cave_in_a_mesh_is_that_of_the_map(terrain in closed_map()) {
        prop_assume!(free_cells(&terrain) > 0);
        let cell_m = terrain.extent().cell_m();
        for (file, bytes) in [("a.obj", obj(&terrain)), ("a.stl", stl(&terrain))] {
            let imported = as_a_cave(file, bytes, cell_m);
            prop_assert_eq!(free_from_lowest(&imported.terrain), free_from_lowest(&terrain), "{}", file);
            prop_assert!(imported.notes.iter().all(|note| note.name != "holes"), "{:?}", imported.notes);
        }
    }

    #[test]
    fn surface_is_watertight_and_has_the_volume_of_the_free_space(terrain in closed_map()) {
        let mut edges: BTreeMap<[[u32; 3]; 2], u32> = BTreeMap::new();
        let mut volume = 0;
        for triangle in triangles(&terrain) {
            let [a, b, c] = triangle.corners;
            for edge in [[a, b], [b, c], [c, a]] {
                *edges.entry(edge).or_default() += 1;
            }
            let [a, b, c] = [a, b, c].map(|corner| corner.map(i64::from));
            let cross = [b[1] * c[2] - b[2] * c[1], b[2] * c[0] - b[0] * c[2], b[0] * c[1] - b[1] * c[0]];
            volume += (0..3).map(|axis| a[axis] * cross[axis]).sum::<i64>();
        }
        // Each edge is gone along once, and back once.
        prop_assert!(edges.iter().all(|(&[from, to], &count)| count == 1 && edges.contains_key(&[to, from])));
        // Six volumes, in half cells.
        prop_assert_eq!(volume, 6 * 8 * free_cells(&terrain) as i64);
    }

    #[test]
    fn rectangles_cover_every_face_once(terrain in closed_map()) {
        let area: u32 = rectangles(&terrain).iter().map(area).sum();
        let faces = terrain.iter().filter(|&(_, &here)| here == Terrain::Free).map(|(cell, _)| {
            voxels::FACES.iter().filter(|&&face| is_wall_at(&terrain, cell + face)).count() as u32
        });
        prop_assert_eq!(area, faces.sum::<u32>());
    }
}

/// Faces of cells in a rectangle.
fn area(rectangle: &Rectangle) -> u32 {
    let [a, _, c, _] = rectangle.corners();
    (0..3).map(|axis| a[axis].abs_diff(c[axis]).max(1)).product()
}

#[test]
fn a_tree_keeps_the_place_of_its_map() {
    let mut room = Grid::new(Extent::new([6, 5, 4], 0.3).unwrap(), Terrain::Free);
    voxels::close_shell(&mut room, 1);
    for corner in [[-7, 3, 0], [-32768, 32763, 100]] {
        let place = corner.map(|along| f64::from(along) * 0.3);
        assert_eq!(octomap_corner(&room, place, 0.0), Some(corner));
        let read = ImportSpec::new("a.bt", octomap(&room, corner)).read().unwrap();
        assert_eq!((read.terrain, read.origin_m), (room.clone(), Some(place)));
    }
    assert_eq!(octomap_corner(&room, [0.1, 0.0, 0.0], 0.0), None);
    assert_eq!(octomap_corner(&room, [0.0; 3], 0.5), None);
    assert_eq!(octomap_corner(&room, [9829.2, 0.0, 0.0], 0.0), None, "beyond the tree");
}

#[test]
fn a_cloud_of_the_surface_is_the_same_cave() {
    let drawn = "#######\n#######\n#######\n#######\n\n#######\n#..##.#\n#.##..#\n#######\n\n#######\n#.....#\n#..#..#\n#######\n\n\
                 #######\n#######\n#######\n#######\n";
    let drawn = Grid::from_text(drawn).unwrap();
    let extent = Extent::new(drawn.extent().size(), 0.25).unwrap();
    let cave = Grid::from_vec(extent, drawn.into_vec()).unwrap();
    let spec = ImportSpec::new("a.pcd", pcd(&cave));
    assert_eq!(spec.stored_cell_m(), Some(0.25));
    let options = ImportOptions { free_from: Some([0.375, 0.375, 0.375]), ..ImportOptions::default() };
    let read = ImportSpec { options, ..spec }.read().unwrap();
    assert_eq!(free_from_lowest(&read.terrain), free_from_lowest(&cave));
    assert_eq!(read.origin_m, Some([-0.25; 3]));
}

#[test]
fn a_scene_has_y_upwards_and_its_bounds() {
    let mut room = Grid::new(Extent::new([6, 5, 4], 0.5).unwrap(), Terrain::Free);
    voxels::close_shell(&mut room, 1);
    let bytes = glb(&room);
    assert_eq!(bytes.len() as u32, u32::from_le_bytes([bytes[8], bytes[9], bytes[10], bytes[11]]));
    let text = String::from_utf8_lossy(&bytes).into_owned();
    assert!(text.contains("\"max\":[2.5,1.5,-0.5],\"min\":[0.5,0.5,-2.0]"), "{text}");
    let solid = Grid::new(Extent::new([3; 3], 1.0).unwrap(), Terrain::Wall);
    let refused = ImportSpec::new("a.glb", glb(&solid)).read().unwrap_err().to_string();
    assert_eq!(refused, "a.glb: the file has no triangle");
}
