//! Solids of other programs: the meshes of `files/`, which `files/make.py` writes, in all formats.

use map_files::{ImportSpec, Imported, MapReader, WRITERS, export::floor_plan};
use mapgen::{ImportOptions, Kind, terrain_hash};
use voxels::{Grid, Terrain, free_components};

/// A box by its lowest and highest corner, metres.
type Bounds = ([f64; 3], [f64; 3]);

/// The boxes of the house in `files/make.py`.
const HOUSE: [Bounds; 10] = [
    ([0.0, 0.0, 0.0], [4.0, 3.0, 0.2]),
    ([0.0, 0.0, 2.3], [4.0, 3.0, 2.5]),
    ([0.0, 0.0, 0.0], [0.3, 3.0, 2.5]),
    ([3.7, 0.0, 0.0], [4.0, 3.0, 2.5]),
    ([0.0, 0.0, 0.0], [4.0, 0.3, 2.5]),
    ([0.0, 2.7, 0.0], [4.0, 3.0, 2.5]),
    ([2.0, 0.1, 0.1], [2.2, 1.0, 2.4]),
    ([2.0, 1.8, 0.1], [2.2, 2.9, 2.4]),
    ([2.0, 0.9, 1.9], [2.2, 1.9, 2.4]),
    ([0.2, 0.2, 0.1], [0.8, 0.8, 2.6]),
];

/// The two boxes that overlap.
const BOXES: [Bounds; 2] = [([0.0; 3], [2.0; 3]), ([1.0; 3], [3.0; 3])];

/// The same meshes in all formats.
const EXTENSIONS: [&str; 4] = ["obj", "stl", "ply", "glb"];

fn bytes(name: &str) -> Vec<u8> {
    let file = format!("{}/tests/files/{name}", env!("CARGO_MANIFEST_DIR"));
    std::fs::read(&file).unwrap_or_else(|error| panic!("{file}: {error}"))
}

fn read(name: &str, bytes: Vec<u8>, cell_m: f64) -> Imported {
    let options = ImportOptions { margin_cells: Some(2), ..ImportOptions::default() };
    ImportSpec { options, cell_m: Some(cell_m), ..ImportSpec::new(name, bytes) }.read().expect("it is a mesh")
}

fn note<'a>(imported: &'a Imported, name: &str) -> Option<&'a str> {
    imported.notes.iter().find(|note| note.name == name).map(|note| note.text.as_str())
}

/// Whether each cell is wall exactly where its centre lies in one of the boxes.
#[track_caller]
fn assert_union(imported: &Imported, boxes: &[Bounds]) {
    let terrain = &imported.terrain;
    let (origin, last) = (imported.origin_m.expect("a mesh has an origin"), terrain.extent().size());
    for (cell, &here) in terrain.iter() {
        let at = [cell.x, cell.y, cell.z];
        if (0..3).any(|axis| at[axis] == 0 || at[axis] as u32 == last[axis] - 1) {
            continue;
        }
        let centre = [0, 1, 2].map(|axis| origin[axis] + (f64::from(at[axis]) + 0.5) * terrain.extent().cell_m());
        let is_in = |(low, high): &Bounds| (0..3).all(|axis| low[axis] < centre[axis] && centre[axis] < high[axis]);
        let expected = if boxes.iter().any(is_in) { Terrain::Wall } else { Terrain::Free };
        assert_eq!(here, expected, "at {centre:?}");
    }
}

#[test]
fn house_of_boxes_is_one_map_in_all_formats_and_has_no_leak() {
    let mut hashes = Vec::new();
    for extension in EXTENSIONS {
        let name = format!("house.{extension}");
        let imported = read(&name, bytes(&name), 0.1);
        assert_union(&imported, &HOUSE);
        assert_eq!(free_components(&imported.terrain).sizes.len(), 2, "{name}: the rooms and the outside");
        assert_eq!(note(&imported, "holes"), None, "{name}");
        assert!(note(&imported, "mesh").is_some_and(|text| text.starts_with("120 triangles")), "{name}");
        hashes.push(terrain_hash(&imported.terrain));
    }
    assert!(hashes.iter().all(|hash| *hash == hashes[0]), "{hashes:?}");
}

#[test]
fn overlapping_boxes_are_their_union_in_all_formats() {
    for extension in EXTENSIONS {
        let name = format!("boxes.{extension}");
        assert_union(&read(&name, bytes(&name), 0.25), &BOXES);
    }
}

/// The triangles of a box, all facing outwards, or all inwards.
fn faces((low, high): Bounds, outwards: bool) -> Vec<[[f64; 3]; 3]> {
    let corner = |bits: usize| [0, 1, 2].map(|axis| if bits >> axis & 1 == 1 { high[axis] } else { low[axis] });
    let sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = sides.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]);
    triangles.map(|[a, b, c]| if outwards { [a, b, c] } else { [a, c, b] }.map(corner)).collect()
}

/// An OBJ file of triangles.
fn obj(triangles: &[[[f64; 3]; 3]]) -> Vec<u8> {
    let vertices = triangles.iter().flatten().map(|[x, y, z]| format!("v {x} {y} {z}\n"));
    let faces =
        (0..triangles.len()).map(|number| format!("f {} {} {}\n", 3 * number + 1, 3 * number + 2, 3 * number + 3));
    vertices.chain(faces).collect::<String>().into_bytes()
}

#[test]
fn a_mirrored_part_and_turned_triangles_do_not_leak() {
    let mut triangles = faces(BOXES[0], true);
    triangles.extend(faces(BOXES[1], false));
    let imported = read("a.obj", obj(&triangles), 0.25);
    assert_union(&imported, &BOXES);
    assert_eq!(note(&imported, "turned"), Some("12 triangles that did not face outwards with the others"));
    // Every third triangle is turned.
    triangles.iter_mut().step_by(3).for_each(|triangle| triangle.swap(0, 1));
    assert_union(&read("a.obj", obj(&triangles), 0.25), &BOXES);
}

#[test]
fn mirrored_boxes_of_a_house_whose_boxes_share_edges_do_not_leak() {
    for mirrored in 0_u32..1 << 6 {
        // Of two mirror images the larger part counts.
        if mirrored.count_ones() > 2 {
            continue;
        }
        let of_box = |number: usize| faces(HOUSE[number], mirrored >> number & 1 == 0);
        let triangles: Vec<_> = (0..HOUSE.len()).flat_map(of_box).collect();
        let imported = read("a.obj", obj(&triangles), 0.1);
        assert_union(&imported, &HOUSE);
        // An open sheet inside a wall, before all boxes.
        let sheet =
            [[[0.1, 0.1, 0.1], [0.2, 0.1, 0.1], [0.2, 0.2, 0.1]], [[0.1, 0.1, 0.1], [0.2, 0.2, 0.1], [0.1, 0.2, 0.1]]];
        let with_sheet: Vec<_> = sheet.into_iter().chain(triangles).collect();
        assert_union(&read("a.obj", obj(&with_sheet), 0.1), &HOUSE);
        let turned = format!("{} triangles that did not face outwards with the others", 12 * mirrored.count_ones());
        assert_eq!(note(&imported, "turned"), (mirrored > 0).then_some(turned.as_str()), "{mirrored:b}");
    }
}

/// An OBJ file of the boxes of the house with vertices of their own, whose triangles take turns.
fn interleaved(boxes: &[Vec<[[f64; 3]; 3]>]) -> Vec<u8> {
    let mut text = String::new();
    let mut faces = vec![String::new(); 12];
    let mut vertices: Vec<(usize, [f64; 3])> = Vec::new();
    for (number, triangles) in boxes.iter().enumerate() {
        for (triangle, faces) in triangles.iter().zip(&mut faces) {
            let corners = triangle.map(|corner| {
                let known = vertices.iter().position(|vertex| *vertex == (number, corner));
                known.unwrap_or_else(|| {
                    let [x, y, z] = corner;
                    text += &format!("v {x} {y} {z}\n");
                    vertices.push((number, corner));
                    vertices.len() - 1
                }) + 1
            });
            *faces += &format!("f {} {} {}\n", corners[0], corners[1], corners[2]);
        }
    }
    (text + &faces.concat()).into_bytes()
}

/// Turns three of eight triangles, without a pattern.
fn turn_some<'a>(seed: u64, triangles: impl Iterator<Item = &'a mut [[f64; 3]; 3]>) {
    let mut state = seed;
    for triangle in triangles {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        if state >> 61 < 3 {
            triangle.swap(0, 1);
        }
    }
}

#[test]
fn turned_triangles_of_boxes_that_share_edges_do_not_leak() {
    for seed in 0..40 {
        let mut triangles: Vec<_> = HOUSE.iter().flat_map(|&bounds| faces(bounds, true)).collect();
        turn_some(seed, triangles.iter_mut());
        assert_union(&read("a.obj", obj(&triangles), 0.1), &HOUSE);
    }
}

#[test]
fn interleaved_boxes_that_share_edges_do_not_leak() {
    for mirrored in 0_usize..HOUSE.len() {
        let of_box = |number: usize| faces(HOUSE[number], number != mirrored && number != (mirrored + 3) % HOUSE.len());
        let mut boxes: Vec<_> = (0..HOUSE.len()).map(of_box).collect();
        assert_union(&read("a.obj", interleaved(&boxes), 0.1), &HOUSE);
        turn_some(mirrored as u64, boxes.iter_mut().flatten());
        assert_union(&read("a.obj", interleaved(&boxes), 0.1), &HOUSE);
    }
}

#[test]
fn a_cavity_stays() {
    let inner = ([1.0; 3], [2.0; 3]);
    let mut triangles = faces(([0.0; 3], [3.0; 3]), true);
    triangles.extend(faces(inner, false));
    let imported = read("a.obj", obj(&triangles), 0.25);
    assert_eq!(note(&imported, "turned"), None);
    assert_eq!(free_components(&imported.terrain).sizes.into_iter().min(), Some(4 * 4 * 4));
}

#[test]
fn boxes_with_missing_triangles_are_filled_and_their_openings_named() {
    let boxes = [([0.0; 3], [4.0; 3]), ([3.0, 1.0, 1.0], [7.0, 3.0, 3.0])];
    let mut triangles = faces(boxes[0], true);
    triangles.extend(faces(boxes[1], true));
    // One triangle of each of two sides: lines along x and z come through holes.
    triangles.remove(9);
    triangles.remove(2);
    let imported = read("a.obj", obj(&triangles), 0.25);
    let holes = note(&imported, "holes").expect("holes are reported");
    assert!(holes.contains("opening(s): ") && holes.contains("8.000 m2 around ("), "{holes}");
    // The hull is right but for the cells at the openings.
    let wall = |imported: &Imported| imported.terrain.as_slice().iter().filter(|&&cell| cell == Terrain::Wall).count();
    let closed = [faces(boxes[0], true), faces(boxes[1], true)].concat();
    let (open, closed) = (wall(&imported), wall(&read("a.obj", obj(&closed), 0.25)));
    assert!(open.abs_diff(closed) * 20 < closed, "{open} of {closed}");
}

#[test]
fn a_star_that_intersects_itself_has_no_hole_in_its_middle() {
    // A prism over a pentagram, whose sides wind twice around the middle.
    let corner = |number: usize, z: f64| {
        let angle = 0.8 * std::f64::consts::PI * number as f64;
        [5.0 + 4.0 * libm::cos(angle), 5.0 + 4.0 * libm::sin(angle), z]
    };
    let mut triangles = Vec::new();
    for number in 0..5 {
        let (a, b) = (number, (number + 1) % 5);
        triangles.push([corner(a, 0.0), corner(b, 0.0), corner(b, 3.0)]);
        triangles.push([corner(a, 0.0), corner(b, 3.0), corner(a, 3.0)]);
        triangles.push([corner(a, 3.0), corner(b, 3.0), [5.0, 5.0, 3.0]]);
        triangles.push([corner(b, 0.0), corner(a, 0.0), [5.0, 5.0, 0.0]]);
    }
    let imported = read("a.obj", obj(&triangles), 0.5);
    let origin = imported.origin_m.unwrap();
    let cell =
        [5.1, 5.1, 1.1].map(|along: f64| along).into_iter().zip(origin).map(|(at, from)| ((at - from) / 0.5) as i32);
    let cell: Vec<i32> = cell.collect();
    let middle = imported.terrain.get(voxels::Cell::new(cell[0], cell[1], cell[2]));
    assert_eq!(middle, Some(&Terrain::Wall));
    assert_eq!(free_components(&imported.terrain).sizes.len(), 1);
}

/// A prism of 2 x 3 x 4 m about the origin as a glTF file, upright along y, under a node that
/// mirrors and moves it.
#[test]
fn nodes_of_a_scene_place_and_mirror_meshes() {
    let corners: Vec<u8> = faces(([0.0; 3], [2.0, 4.0, 3.0]), true)
        .iter()
        .flatten()
        .flatten()
        .flat_map(|&along| (along as f32).to_le_bytes())
        .collect();
    let document = format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0,2]}}],"nodes":[{{"children":[1],"translation":[10,0,0]}},
        {{"mesh":0,"scale":[-1,1,1]}},{{"mesh":0,"translation":[9,0,0]}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}}}}]}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"type":"VEC3","count":36}}],
        "bufferViews":[{{"buffer":0,"byteLength":{0}}}],"buffers":[{{"byteLength":{0}}}]}}"#,
        corners.len()
    );
    let chunk = |kind: &[u8; 4], bytes: &[u8]| [&(bytes.len() as u32).to_le_bytes(), &kind[..], bytes].concat();
    let chunks = [chunk(b"JSON", document.as_bytes()), chunk(b"BIN\0", &corners)].concat();
    let glb = [b"glTF\x02\0\0\0".as_slice(), &(chunks.len() as u32 + 12).to_le_bytes(), &chunks].concat();
    let imported = read("a.glb", glb, 0.5);
    // Mirrored from x = 10 to 8, and from 9 to 11; y has become z, and -z y.
    assert_union(&imported, &[([8.0, -3.0, 0.0], [10.0, 0.0, 4.0]), ([9.0, -3.0, 0.0], [11.0, 0.0, 4.0])]);
    assert_eq!(note(&imported, "up"), Some("y, as glTF has it; the option up changes that"));
}

#[test]
fn points_without_faces_are_no_mesh() {
    let cloud = b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n1 2 3\n";
    let options = ImportOptions { inside: Some(Kind::Free), ..ImportOptions::default() };
    let error = ImportSpec { options, ..ImportSpec::new("a.ply", cloud.to_vec()) }.read().unwrap_err().to_string();
    assert_eq!(error, "a.ply: inside is an option for meshes, and the file has no faces, only points");
}

#[test]
fn work_is_bounded_and_the_error_names_the_key() {
    let options = ImportOptions { steps_max: Some(1000), ..ImportOptions::default() };
    let spec = ImportSpec { options, cell_m: Some(0.1), ..ImportSpec::new("house.obj", bytes("house.obj")) };
    let error = spec.read().unwrap_err().to_string();
    assert_eq!(
        error,
        "house.obj: the file takes more than 1000 steps of work; choose longer cells, or raise map.import.steps_max \
         (--steps-max)"
    );
}

/// The length of cells comes back from every written format, for every length.
#[test]
fn no_format_loses_the_length_of_a_cell() {
    for cell_m in [0.05, 0.1, 0.25, 0.3, 0.5, 1.0 / 3.0, 1.0, 2.0, 2.5, 10.0, 1e-3, 123.456] {
        let mut terrain = Grid::new(voxels::Extent::new([6, 5, 4], cell_m).unwrap(), Terrain::Free);
        voxels::close_shell(&mut terrain, 1);
        let written = WRITERS.iter().map(|writer| (writer.extension, writer.write(&terrain)));
        for (extension, written) in written.chain([("m3dm", Ok(voxels::packed::write(&terrain)))]) {
            // A cloud of the surface is not the whole map.
            if extension == "pcd" {
                continue;
            }
            let name = format!("a.{extension}");
            let plan = floor_plan(&terrain, "a.pgm", [-3.7, 1.0 / 3.0, 0.5]);
            let (bytes, companion) = written.map_or((plan.yaml, Some(plan.image)), |bytes| (bytes, None));
            let is_mesh = MapReader::of(name.as_ref()).unwrap().options.contains(&"inside");
            let options = ImportOptions {
                inside: is_mesh.then_some(Kind::Free),
                height_cells: companion.is_some().then_some(2),
                ..ImportOptions::default()
            };
            let spec = ImportSpec { options, ..ImportSpec::new(name.clone(), bytes) };
            let spec = spec.with_companions(companion.into_iter().collect());
            let read = spec.read().unwrap_or_else(|error| panic!("{name}: {error}"));
            assert_eq!(read.terrain, terrain, "{name}, cells of {cell_m} m");
            assert_eq!(read.stores_cell_m, cell_m != 1.0 || spec.stored_cell_m().is_some(), "{name}");
            if !spec.companions.is_empty() {
                assert_eq!((read.origin_m.map(|[x, y, _]| [x, y]), read.yaw_rad), (Some([-3.7, 1.0 / 3.0]), 0.5));
            }
        }
    }
}
