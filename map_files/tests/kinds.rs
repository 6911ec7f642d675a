//! One room in every kind of file that is read: a table of kinds, and the cells of all of them.
//!
//! The room has 12 x 9 x 6 cells of 1 m between walls of one cell, with a wall, a pillar and a beam
//! in it, so that no turn and no mirror image of it is the same. Files of real tools lie in
//! `cases/` and `files/`; the others are made here as such tools write them. Every extension of
//! [`READERS`] and [`WRITERS`] has a row, or a reason in [`LEFT_OUT`].

#![expect(clippy::unwrap_used, reason = "a panic is what this looks for")]

use std::collections::BTreeSet;
use std::io::Cursor;
use std::path::Path;

use map_files::{ImportSpec, Imported, MapReader, READERS, WRITERS};
use mapgen::{ImportOptions, Kind};
use voxels::{Cell, Extent, Grid, Terrain};

/// A box of wall by its lowest and highest corner.
type Bounds = ([i32; 3], [i32; 3]);

const SIZE: [u32; 3] = [14, 11, 8];

/// The boxes of the room, which touch and share edges.
const BOXES: [Bounds; 9] = [
    ([0, 0, 0], [14, 11, 1]),
    ([0, 0, 7], [14, 11, 8]),
    ([0, 0, 0], [1, 11, 8]),
    ([13, 0, 0], [14, 11, 8]),
    ([0, 0, 0], [14, 1, 8]),
    ([0, 10, 0], [14, 11, 8]),
    ([5, 1, 1], [6, 7, 5]),
    ([9, 6, 1], [11, 7, 7]),
    ([11, 1, 6], [13, 3, 7]),
];

/// Extensions that are read and have no row here, with the reason.
const LEFT_OUT: [(&str, &str); 1] =
    [("laz", "compressed_points_of_all_formats_are_one_map (hostile.rs) compares these files with text")];

/// A file of the room: its name, bytes and options, and files that it needs.
struct Case {
    kind: &'static str,
    file: String,
    bytes: Vec<u8>,
    options: ImportOptions,
    companions: Vec<Vec<u8>>,
    /// The lowest corner of the box around the free cells, in coordinates of the file, metres;
    /// `None` if the file has no coordinates.
    corner_m: Option<[f64; 3]>,
}

/// A file whose coordinates begin at the outer corner of the room, or one without any.
fn case(kind: &'static str, file: impl Into<String>, bytes: impl Into<Vec<u8>>) -> Case {
    let file = file.into();
    let corner_m = if NO_COORDINATES.contains(&extension(&file).as_str()) { None } else { Some([1.0; 3]) };
    Case { kind, file, bytes: bytes.into(), options: ImportOptions::default(), companions: Vec::new(), corner_m }
}

/// Extensions of files without coordinates.
const NO_COORDINATES: [&str; 10] = ["m3dm", "txt", "vox", "pgm", "ppm", "pbm", "png", "bmp", "jpg", "jpeg"];

impl Case {
    fn with(self, options: ImportOptions) -> Self {
        Self { options, ..self }
    }

    /// A file whose outer corner of the room lies there, metres.
    fn at(self, place: [f64; 3]) -> Self {
        Self { corner_m: Some(place.map(|along| along + 1.0)), ..self }
    }

    fn extension(&self) -> String {
        extension(&self.file)
    }
}

/// The extension of a file's name, in small letters.
fn extension(file: &str) -> String {
    Path::new(file).extension().unwrap().to_string_lossy().to_lowercase()
}

fn is_wall([x, y, z]: [i32; 3]) -> bool {
    BOXES
        .iter()
        .any(|(low, high)| [x, y, z].into_iter().zip(low.iter().zip(high)).all(|(at, (a, b))| *a <= at && at < *b))
}

fn cells() -> impl Iterator<Item = [i32; 3]> {
    let [x, y, z] = SIZE.map(|cells| cells as i32);
    (0..z).flat_map(move |z| (0..y).flat_map(move |y| (0..x).map(move |x| [x, y, z])))
}

fn room() -> Grid<Terrain> {
    let cells = cells().map(|cell| if is_wall(cell) { Terrain::Wall } else { Terrain::Free });
    Grid::from_vec(Extent::new(SIZE, 1.0).unwrap(), cells.collect()).unwrap()
}

/// The lowest corner of the box around the free cells, and the free cells from there.
fn free(terrain: &Grid<Terrain>) -> ([i32; 3], BTreeSet<[i32; 3]>) {
    let free = || terrain.iter().filter(|&(_, &here)| here == Terrain::Free).map(|(Cell { x, y, z, .. }, _)| [x, y, z]);
    let low = [0, 1, 2].map(|axis| free().map(|cell| cell[axis]).min().unwrap_or_default());
    (low, free().map(|cell| [0, 1, 2].map(|axis| cell[axis] - low[axis])).collect())
}

/// The place of a corner of cells in coordinates of the file, metres.
fn place_m(imported: &Imported, corner: [i32; 3]) -> Option<[f64; 3]> {
    let [x, y, z] = corner.map(|along| f64::from(along) * imported.terrain.extent().cell_m());
    let (sine, cosine) = libm::sincos(imported.yaw_rad);
    let [from_x, from_y, from_z] = imported.origin_m?;
    Some([from_x + cosine * x - sine * y, from_y + sine * x + cosine * y, from_z + z])
}

/// The corners of a box, and its sides as quads that face outwards.
fn corners((low, high): Bounds) -> [[f64; 3]; 8] {
    [0, 1, 2, 3, 4, 5, 6, 7]
        .map(|bits| [0, 1, 2].map(|axis| f64::from(if bits >> axis & 1 == 1 { high } else { low }[axis])))
}
const SIDES: [[usize; 4]; 6] = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];

fn vertices() -> impl Iterator<Item = [f64; 3]> {
    BOXES.into_iter().flat_map(corners)
}

fn triangles() -> Vec<[usize; 3]> {
    let of_box = |number| {
        SIDES.iter().flat_map(move |&[a, b, c, d]| [[a, b, c], [a, c, d]].map(|of| of.map(|at| 8 * number + at)))
    };
    (0..BOXES.len()).flat_map(of_box).collect()
}

/// The file of quads, after a first line, with each place as `to` has it.
fn obj(first: &str, to: impl Fn([f64; 3]) -> [f64; 3]) -> String {
    let vertices = vertices().map(to).map(|[x, y, z]| format!("v {x} {y} {z}\n"));
    let quads = (0..BOXES.len()).flat_map(|number| SIDES.map(|side| side.map(|at| 8 * number + at + 1)));
    let faces = quads.map(|[a, b, c, d]| format!("f {a} {b} \\\n {c} {d}\n"));
    first.to_owned() + &vertices.chain(faces).collect::<String>()
}

fn stl(title: &[u8], shift: f32, rest: &[u8]) -> Vec<u8> {
    let (vertices, triangles): (Vec<_>, _) = (vertices().collect(), triangles());
    let mut bytes = title.to_vec();
    bytes.resize(80, b' ');
    bytes.extend((triangles.len() as u32).to_le_bytes());
    for triangle in triangles {
        let places = triangle.into_iter().flat_map(|corner| vertices[corner]).map(|along| along as f32 + shift);
        bytes.extend([0.0; 3].into_iter().chain(places).flat_map(f32::to_le_bytes).chain([0; 2]));
    }
    [&bytes, rest].concat()
}

fn stl_text() -> String {
    let vertices: Vec<_> = vertices().collect();
    let mut text = String::new();
    for of_box in triangles().chunks(12) {
        text += "solid a box\n";
        for triangle in of_box {
            let corners = triangle.map(|corner| vertices[corner]).map(|[x, y, z]| format!("vertex {x} {y} {z}\n"));
            text += &format!("facet normal 0 0 0\nouter loop\n{}endloop\nendfacet\n", corners.concat());
        }
        text += "endsolid a box\n";
    }
    text
}

/// A header of PLY whose vertices are floats.
fn ply_header(format: &str, vertices: usize, rest: &str) -> String {
    format!(
        "ply\nformat {format} 1.0\nelement vertex {vertices}\nproperty float x\nproperty float y\nproperty float z\n{rest}end_header\n"
    )
}

fn ply(is_big: bool) -> Vec<u8> {
    let triangles = triangles();
    let faces = format!(
        "element face {}\nproperty uchar flags\nproperty list uchar int vertex_indices\nproperty short part\n",
        triangles.len()
    );
    let format = if is_big { "binary_big_endian" } else { "binary_little_endian" };
    let mut bytes = ply_header(format, 8 * BOXES.len(), &faces).into_bytes();
    let word = |bytes: [u8; 4]| if is_big { bytes.into_iter().rev().collect::<Vec<u8>>() } else { bytes.to_vec() };
    bytes.extend(vertices().flatten().flat_map(|along| word((along as f32).to_le_bytes())));
    for triangle in triangles {
        bytes.extend([9, 3]);
        bytes.extend(triangle.into_iter().flat_map(|corner| word((corner as u32).to_le_bytes())));
        bytes.extend([0; 2]);
    }
    bytes
}

fn ply_strips() -> String {
    let places = vertices().map(|[x, y, z]| format!("{x} {y} {z}\n")).collect::<String>();
    let strips: Vec<String> = (0..BOXES.len())
        .flat_map(|number| SIDES.map(|[a, b, c, d]| [b, c, a, d].map(|at| (8 * number + at).to_string()).join(" ")))
        .collect();
    let list = strips.join(" -1 ");
    let header = "element tristrips 1\nproperty list int int vertex_indices\n";
    ply_header("ascii", 8 * BOXES.len(), header) + &places + &format!("{} {list}\n", list.split(' ').count())
}

fn sdf() -> String {
    let three = |numbers: [f64; 3]| numbers.map(|number| number.to_string()).join(" ");
    let shape = |(low, high): Bounds| {
        let middle = three([0, 1, 2].map(|axis| f64::from(low[axis] + high[axis]) / 2.0));
        let size = three([0, 1, 2].map(|axis| f64::from(high[axis] - low[axis])));
        format!(
            "<collision name='c'><pose>{middle} 0 0 0</pose><geometry><box><size>{size}</size></box></geometry></collision>"
        )
    };
    let shapes: String = BOXES.into_iter().map(shape).collect();
    format!(
        "<sdf version='1.9'><world name='w'><frame name='f'><pose>3 4 5 0 0 0</pose></frame><model name='m'>\
         <pose relative_to='f'>0 0 0 0 0 0</pose><model name='n'><pose>1 0 0 0 0 0</pose><link name='l'>{shapes}</link></model>\
         </model></world></sdf>"
    )
}

/// The centres of all walls, metres, so far from the origin.
fn points(shift: f64) -> Vec<[f64; 3]> {
    cells().filter(|&cell| is_wall(cell)).map(|cell| cell.map(|along| f64::from(along) + 0.5 + shift)).collect()
}

fn lines(points: &[[f64; 3]], separator: &str) -> String {
    points.iter().map(|point| point.map(|along| along.to_string()).join(separator) + "\n").collect()
}

fn pcd(keys: &str, data: &str, body: &[u8], points: usize) -> Vec<u8> {
    let header = format!(
        "VERSION 0.7\n{keys} x normal y z\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 2 1 1\nWIDTH {points}\nHEIGHT 1\nDATA {data}\n"
    );
    [header.as_bytes(), body].concat()
}

/// Fields of points as floats: one point after the other, or one field after the other.
fn fields(points: &[[f64; 3]], are_columns: bool) -> Vec<u8> {
    let bytes = |numbers: &[f64]| numbers.iter().flat_map(|number| (*number as f32).to_le_bytes()).collect::<Vec<u8>>();
    if !are_columns {
        return points.iter().flat_map(|&[x, y, z]| bytes(&[x, 7.0, 7.0, y, z])).collect();
    }
    let column = |axis: usize| bytes(&points.iter().map(|point| point[axis]).collect::<Vec<f64>>());
    [column(0), bytes(&vec![7.0; 2 * points.len()]), column(1), column(2)].concat()
}

/// A file of LAS 1.2 with the points, and one in the room that is withheld.
fn las() -> Vec<u8> {
    const WITHHELD: u8 = 0x80;
    let points = points(0.0).into_iter().map(|point| (point, 2)).chain([([3.5; 3], 2 | WITHHELD)]);
    let records: Vec<u8> = points
        .flat_map(|(point, class)| {
            let place = point.map(|along| ((along * 1000.0) as i32).to_le_bytes()).concat();
            [&place[..], &[0, 0, 0, class, 0, 0, 0, 0]].concat()
        })
        .collect();
    let mut bytes = vec![0; 227];
    let mut put = |at: usize, content: &[u8]| bytes[at..at + content.len()].copy_from_slice(content);
    put(0, b"LASF");
    put(24, &[1, 2]);
    put(94, &227u16.to_le_bytes());
    put(96, &227u32.to_le_bytes());
    put(105, &20u16.to_le_bytes());
    put(107, &(records.len() as u32 / 20).to_le_bytes());
    put(131, &[0.001f64; 3].map(f64::to_le_bytes).concat());
    [bytes, records].concat()
}

/// A full tree of OctoMap with all cells of the room, whose corner is the origin of the file.
fn octomap() -> Vec<u8> {
    const MIDDLE: i32 = 1 << 15;
    /// Appends a node with its children, and returns how many nodes that are.
    fn append(nodes: &mut Vec<u8>, corner: [i32; 3], edge: i32) -> usize {
        let log_odds: f32 = if edge == 1 && !is_wall(corner) { -2.0 } else { 3.5 };
        nodes.extend(log_odds.to_le_bytes());
        if edge == 1 {
            nodes.push(0);
            return 1;
        }
        let half = edge / 2;
        let child = |number: i32| [0, 1, 2].map(|axis| corner[axis] + half * (number >> axis & 1));
        let is_known =
            |corner: [i32; 3]| (0..3).all(|axis| corner[axis] < SIZE[axis] as i32 && corner[axis] + half > 0);
        let known: Vec<i32> = (0..8).filter(|&number| is_known(child(number))).collect();
        nodes.push(known.iter().map(|number| 1 << number).sum());
        1 + known.into_iter().map(|number| append(nodes, child(number), half)).sum::<usize>()
    }
    let mut nodes = Vec::new();
    let count = append(&mut nodes, [-MIDDLE; 3], 2 * MIDDLE);
    [format!("# Octomap OcTree file\nid OcTree\nsize {count}\nres 1\ndata\n").into_bytes(), nodes].concat()
}

/// A survey with the points in one scan.
fn survey(points: &[[f64; 3]]) -> Vec<u8> {
    use e57::{E57Writer, Record, RecordValue};
    let mut file = Cursor::new(Vec::new());
    let mut writer = E57Writer::new(&mut file, "survey").unwrap();
    let axes = vec![Record::CARTESIAN_X_F64, Record::CARTESIAN_Y_F64, Record::CARTESIAN_Z_F64];
    let mut scan = writer.add_pointcloud("scan", axes).unwrap();
    for point in points {
        scan.add_point(point.map(RecordValue::Double).to_vec()).unwrap();
    }
    scan.finalize().unwrap();
    drop(scan);
    writer.finalize().unwrap();
    drop(writer);
    file.into_inner()
}

/// The document of a `.glb` and its buffer, as the two files of a `.gltf`.
fn parted(glb: &[u8]) -> [Vec<u8>; 2] {
    let length = u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize;
    let (document, buffer) = (&glb[20..20 + length], &glb[28 + length..]);
    let mut document: serde_json::Value = serde_json::from_slice(document).unwrap();
    document["buffers"][0]["uri"] = "a.bin".into();
    [document.to_string().into_bytes(), buffer.to_vec()]
}

/// The room as a model, and another one in it whose group is hidden.
fn vox() -> Vec<u8> {
    let numbers = |numbers: &[u32]| numbers.iter().flat_map(|number| number.to_le_bytes()).collect::<Vec<u8>>();
    let chunk = |name: &str, content: &[u8]| [name.as_bytes(), &numbers(&[content.len() as u32, 0]), content].concat();
    let model = |cells: &[[i32; 3]]| {
        let voxels: Vec<u8> = cells.iter().flat_map(|&[x, y, z]| [x as u8, y as u8, z as u8, 1]).collect();
        let content = [numbers(&[cells.len() as u32]), voxels].concat();
        [chunk("SIZE", &numbers(&SIZE)), chunk("XYZI", &content)].concat()
    };
    let walls: Vec<[i32; 3]> = cells().filter(|&cell| is_wall(cell)).collect();
    let hidden = [&numbers(&[1, 7])[..], b"_hidden", &numbers(&[1]), b"1"].concat();
    let content = [
        model(&walls),
        model(&[[3, 3, 3], [4, 3, 3]]),
        chunk("nTRN", &numbers(&[0, 0, 1, u32::MAX, 0, 1, 0])),
        chunk("nGRP", &numbers(&[1, 0, 2, 2, 4])),
        chunk("nTRN", &numbers(&[2, 0, 3, u32::MAX, 0, 1, 0])),
        chunk("nSHP", &numbers(&[3, 0, 1, 0, 0])),
        chunk("nTRN", &[numbers(&[4]), hidden, numbers(&[5, u32::MAX, 0, 1, 0])].concat()),
        chunk("nSHP", &numbers(&[5, 0, 1, 1, 0])),
    ];
    [b"VOX \x96\0\0\0".to_vec(), chunk("MAIN", &[]), content.concat()].concat()
}

fn in_repository(file: &str) -> Vec<u8> {
    std::fs::read(format!("{}/tests/{file}", env!("CARGO_MANIFEST_DIR"))).unwrap()
}

fn meshes() -> Vec<Case> {
    let up_y = |[x, y, z]: [f64; 3]| [x, z, -y];
    let millimetres = ImportOptions { scale: Some(0.001), ..ImportOptions::default() };
    let mut cases = vec![
        case("binary STL that says solid, with more bytes", "a.stl", stl(b"solid a box", 0.0, b"\0\x01endsolid")),
        case("STL text in capitals, of several solids", "A.STL", stl_text().to_uppercase()),
        case("faces through the centres of cells", "a.stl", stl(b"", 0.5, b"")).at([0.0; 3]),
        case("OBJ with a byte order mark", "a.obj", obj("\u{feff}o room\n", |place| place)),
        case("OBJ of Blender", "a.obj", obj("# Blender 3.4.1\n", up_y)),
        case("OBJ that says its axis", "a.obj", obj("# walls, Y up\n", up_y)),
        case("OBJ in millimetres", "a.obj", obj("", |place| place.map(|along| along * 1000.0))).with(millimetres),
        case("PLY, little-endian", "a.ply", ply(false)),
        case("PLY, big-endian", "a.ply", ply(true)),
        case("PLY of strips", "a.ply", ply_strips()),
        case("world of Gazebo", "a.world", sdf()).at([4.0, 4.0, 5.0]),
        case("SDF", "a.sdf", sdf()).at([4.0, 4.0, 5.0]),
    ];
    for name in ["room_assimp.dae", "room_trimesh.dae"] {
        cases.push(case("COLLADA", "a.dae", in_repository(&format!("files/{name}"))));
    }
    for (kind, name) in [
        ("glTF, quantized by gltfpack", "gltfpack_quantized.glb"),
        ("glTF, packed by gltfpack", "gltfpack_meshopt.glb"),
        ("glTF, quantized by glTF-Transform", "gltf_transform_quantized.glb"),
        ("glTF, packed by glTF-Transform", "gltf_transform_meshopt.glb"),
    ] {
        cases.push(case(kind, "a.glb", in_repository(&format!("cases/{name}"))));
    }
    let [document, buffer] = parted(&in_repository("cases/gltf_transform_quantized.glb"));
    cases.push(Case { companions: vec![buffer], ..case("glTF in two files", "a.gltf", document) });
    cases
}

fn clouds() -> Vec<Case> {
    let walls = points(0.0);
    let voxels = cells().filter(|&cell| is_wall(cell)).map(|cell| cell.map(|along| along.to_string()).join(" ") + "\n");
    let grid = "element origin 1\nproperty double x\nproperty double y\nproperty double z\nelement voxel_size 1\nproperty double val\n";
    let ply_grid = ply_header("ascii", walls.len(), "").replacen("element", &format!("{grid}element"), 1)
        + "3 4 5\n1\n"
        + &voxels.collect::<String>();
    // With rays without return, at 0 0 0 and in words of Windows.
    let ascii: String = points(9.0).iter().map(|[x, y, z]| format!("{x} 7 7 {y} {z}\n")).collect();
    let ascii = ascii + &"0 7 7 0 0\n".repeat(5) + &"-nan(ind) 7 7 1.#QNAN nan\n".repeat(5);
    let columns = fields(&walls, true);
    let stored = [[columns.len() as u32; 2].map(u32::to_le_bytes).concat(), columns].concat();
    let commas = lines(&walls, ";").replace('.', ",");
    vec![
        case("PCD text with rays without return", "a.pcd", pcd("FIELDS", "ascii", ascii.as_bytes(), walls.len() + 10))
            .at([9.0; 3]),
        case("PCD of bytes with COLUMNS", "a.pcd", pcd("COLUMNS", "binary", &fields(&walls, false), walls.len())),
        case("PCD stored, of several counts", "a.pcd", pcd("COLUMNS", "binary_compressed", &stored, walls.len())),
        case("PCD stored, of pypcd4", "a.pcd", pcd("FIELDS", "binaryscompressed", &stored, walls.len())),
        case("PLY of points", "a.ply", ply_header("ascii", walls.len(), "") + &lines(&walls, " ")),
        case("PLY of Open3D's voxels", "a.ply", ply_grid).at([3.0, 4.0, 5.0]),
        case("text with decimal commas", "a.csv", format!("X;Y;Z\n{commas}")),
        case("text with a byte order mark", "a.xyz", format!("\u{feff}{}", lines(&walls, " "))),
        case("text with colours", "a.xyzrgb", lines(&walls, " ").replace('\n', " 0.1 0.2 0.3\n")),
        case("text with normals", "a.xyzn", lines(&walls, " ").replace('\n', " 0 0 1\n")),
        case("text with a comment", "a.asc", format!("# x y z\n{}", lines(&walls, " "))),
        case("text with a count", "a.pts", format!("{}\n{}", walls.len(), lines(&walls, " "))),
        case("LAS with a withheld point", "a.las", las()),
        case("survey of one scan", "a.e57", survey(&walls)),
        case("MagicaVoxel with a hidden group", "a.vox", vox()),
        case("full tree of OctoMap", "a.ot", octomap()),
    ]
}

/// What this project writes, all but floor plans, which show one layer of the room.
fn written() -> Vec<Case> {
    let of_writer = |writer: &map_files::MapWriter| {
        let file = format!("a.{}", writer.extension);
        let is_mesh = MapReader::of(file.as_ref()).unwrap().options.contains(&"inside");
        let options = ImportOptions { inside: is_mesh.then_some(Kind::Free), ..ImportOptions::default() };
        case("written here", file, writer.write(&room()).unwrap()).with(options)
    };
    WRITERS.iter().filter(|writer| writer.extension != "yaml").map(of_writer).collect()
}

#[track_caller]
fn assert_free(Case { kind, file, bytes, options, companions, corner_m }: Case, expected: &BTreeSet<[i32; 3]>) {
    let kind = format!("{kind}, {file}");
    let spec =
        ImportSpec { options, cell_m: Some(1.0), ..ImportSpec::new(file.as_str(), bytes) }.with_companions(companions);
    let imported = spec.read().unwrap_or_else(|error| panic!("{kind}: {error}"));
    let repaired = mapgen::repair(&file, imported.terrain.clone(), 0).unwrap_or_else(|error| panic!("{kind}: {error}"));
    let (low, found) = free(&repaired.terrain);
    let differ = found.symmetric_difference(expected).count();
    assert_eq!(differ, 0, "{kind}: {} free cells of {}, {:#?}", found.len(), expected.len(), imported.notes);
    let place = place_m(&imported, low);
    assert_eq!(place.is_some(), corner_m.is_some(), "{kind}: {place:?}");
    let differ = place.into_iter().flatten().zip(corner_m.into_iter().flatten()).map(|(a, b)| (a - b).abs());
    assert!(differ.fold(0.0, f64::max) < 1e-9, "{kind}: free cells begin at {place:?}, not at {corner_m:?}");
}

#[test]
fn every_kind_of_file_is_the_room() {
    let (_, expected) = free(&room());
    assert_eq!(expected.len(), 608);
    for case in rooms() {
        assert_free(case, &expected);
    }
}

fn rooms() -> impl Iterator<Item = Case> {
    meshes().into_iter().chain(clouds()).chain(written())
}

#[test]
fn every_extension_has_a_row_or_a_reason() {
    let rows: BTreeSet<String> = rooms().chain(plans()).map(|case| case.extension()).collect();
    let read = || READERS.iter().flat_map(|reader| reader.extensions).copied();
    let is_left_out = |extension: &str| LEFT_OUT.iter().any(|&(left_out, _)| left_out == extension);
    for extension in read().chain(WRITERS.iter().map(|writer| writer.extension)) {
        assert_ne!(rows.contains(extension), is_left_out(extension), "{extension}");
    }
    for extension in rows.iter().map(String::as_str).chain(LEFT_OUT.map(|(extension, _)| extension)) {
        assert!(read().any(|known| known == extension), "{extension}");
    }
}

/// The layer of the room that plans show.
const LAYER: i32 = 2;

/// The lowest pixel of the plans of nav2 and their turn: metres, radians.
const PLAN_AT: [f64; 2] = [-3.0, 4.0];
const PLAN_YAW_RAD: f64 = 0.5;

/// One layer of the room: as `map_saver` of nav2 writes it, with unknown cells around and a
/// threshold that alone would make them free, in the spellings of YAML; and as pictures.
fn plans() -> Vec<Case> {
    let [columns, rows, _] = SIZE.map(|cells| cells as i32);
    let is_inside = |x: i32, y: i32| (0..columns).contains(&x) && (0..rows).contains(&y);
    // With two pixels around, from the top.
    let around = || (-2..rows + 2).rev().flat_map(move |y| (-2..columns + 2).map(move |x| (x, y)));
    let (width, height) = (columns as u32 + 4, rows as u32 + 4);
    let greys = |unknown: u8| -> Vec<u8> {
        around()
            .map(|(x, y)| match is_inside(x, y) {
                true if is_wall([x, y, LAYER]) => 0,
                true => 254,
                false => unknown,
            })
            .collect()
    };
    let pgm = |grey: &[u8]| [format!("P5\n# saved\n{width} {height}\n255\n").into_bytes(), grey.to_vec()].concat();
    let negative: Vec<u8> = greys(205).into_iter().map(|grey| 255 - grey).collect();
    let wide: Vec<u8> = greys(205).into_iter().flat_map(|grey| [grey, grey]).collect();
    let words = |word: &dyn Fn(u8) -> String| greys(0).into_iter().map(word).collect::<Vec<String>>().join(" ");
    let text = words(&|grey| grey.to_string());
    let colours = words(&|grey| format!("{grey} {grey} {grey}"));
    // In a bitmap 1 is black.
    let bits = words(&|grey| u8::from(grey == 0).to_string());
    let yaml = |rest: &str| {
        let [x, y] = PLAN_AT;
        format!("image: a.pgm\nresolution: 1\norigin: [{x}, {y}, {PLAN_YAW_RAD}]\noccupied_thresh: 0.65\n{rest}")
    };
    let two = || ImportOptions { height_cells: Some(2), ..ImportOptions::default() };
    // Between the lowest pixel and the free ones lie two pixels and the wall.
    let with_turn = |kind, file: &str, text: String, picture: Vec<u8>, yaw_rad: f64| {
        let (sine, cosine) = libm::sincos(yaw_rad);
        let corner_m = Some([PLAN_AT[0] + 3.0 * (cosine - sine), PLAN_AT[1] + 3.0 * (sine + cosine), 0.0]);
        Case { companions: vec![picture], corner_m, ..case(kind, file, text).with(two()) }
    };
    let with = |kind, rest: &str, picture| with_turn(kind, "a.yaml", yaml(rest), picture, PLAN_YAW_RAD);
    let (saved, plain) = ("negate: 0\nfree_thresh: 0.25\nmode: trinary\n", "negate: 0\nfree_thresh: 0.196\n");
    let flow = "\u{feff}{image: a.pgm,\r\n resolution: 1.0, origin: [-3,\r\n 4, 0],\r\n negate: 0, occupied_thresh: 0.65,\r\n free_thresh: 0.25}\r\n";
    let plan = map_files::export::floor_plan(&one_layer(), "a.pgm", [PLAN_AT[0] + 2.0, PLAN_AT[1] + 2.0, 0.0]);
    let own = with_turn("written here", "a.yaml", String::from_utf8(plan.yaml).unwrap(), plan.image, 0.0);
    let picture = |kind, file: &str, bytes: Vec<u8>| case(kind, file, bytes).with(two());
    vec![
        with("map of nav2", saved, pgm(&greys(205))),
        with("map of older thresholds", plain, pgm(&greys(205))),
        with("negated map", "negate: 1\nfree_thresh: 0.25\n", pgm(&negative)),
        with_turn("map over several lines", "a.yml", flow.to_owned(), pgm(&greys(205)), 0.0),
        with("raw map", "negate: 0\nfree_thresh: 0.25\nmode: raw\n", pgm(&raw(&greys(205)))),
        own,
        picture("picture", "a.pgm", pgm(&greys(0))),
        picture("picture as text", "a.pgm", format!("P2 {width} {height} 255 {text}").into_bytes()),
        picture("picture of 16 bits", "a.pgm", [format!("P5 {width} {height} 65535\n").into_bytes(), wide].concat()),
        picture("picture in colours", "a.ppm", format!("P3 {width} {height} 255 {colours}").into_bytes()),
        picture("bitmap", "a.pbm", format!("P1 {width} {height} {bits}").into_bytes()),
        picture("PNG", "a.png", png(&greys(0), width, height)),
        picture("BMP", "a.bmp", bmp(&greys(0), width, height)),
        picture("JPEG", "a.jpg", jpeg(&greys(0), width, height)),
        picture("JPEG", "a.jpeg", jpeg(&greys(0), width, height)),
    ]
}

fn png(greys: &[u8], width: u32, height: u32) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.write_header().unwrap().write_image_data(greys).unwrap();
    bytes
}

fn bmp(greys: &[u8], width: u32, height: u32) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = image::codecs::bmp::BmpEncoder::new(&mut bytes);
    encoder.encode(greys, width, height, image::ExtendedColorType::L8).unwrap();
    bytes
}

fn jpeg(greys: &[u8], width: u32, height: u32) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = image::codecs::jpeg::JpegEncoder::new_with_quality(&mut bytes, 100);
    encoder.encode(greys, width, height, image::ExtendedColorType::L8).unwrap();
    bytes
}

/// The layer of the room that plans show, as a map of one layer.
fn one_layer() -> Grid<Terrain> {
    let cells = cells().filter(|&[.., z]| z == LAYER);
    let cells = cells.map(|cell| if is_wall(cell) { Terrain::Wall } else { Terrain::Free });
    Grid::from_vec(Extent::new([SIZE[0], SIZE[1], 1], 1.0).unwrap(), cells.collect()).unwrap()
}

#[test]
fn every_kind_of_plan_is_the_layer() {
    let is_free = |x: i32, y: i32| !is_wall([x, y, LAYER]);
    let expected: BTreeSet<[i32; 3]> =
        cells().filter(|&[x, y, z]| z < 2 && is_free(x, y)).map(|[x, y, z]| [x - 1, y - 1, z]).collect();
    for case in plans() {
        assert_free(case, &expected);
    }
}

/// Greys as occupancies in percent, which mode `raw` has.
fn raw(greys: &[u8]) -> Vec<u8> {
    greys
        .iter()
        .map(|grey| match grey {
            254 => 0,
            0 => 100,
            _ => 255,
        })
        .collect()
}
