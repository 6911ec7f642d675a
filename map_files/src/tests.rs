use super::*;
use mapgen::{MapSpec, SpheresSpec};
use proptest::prelude::*;

/// Garbage that begins as a file of each format does.
const BEGINNINGS: [(&str, &[u8]); 12] = [
    ("a.m3dm", b"\0M3DMRLE\x01\0\0\0"),
    ("a.txt", b"##\n"),
    ("a.bt", b"# Octomap OcTree binary file\nid OcTree\nres 0.5\ndata\n"),
    ("a.pcd", b"FIELDS x y z\nPOINTS 3\nDATA ascii\n1 2 3\n"),
    ("a.pcd", b"FIELDS x y z\nPOINTS 3\nDATA binary_compressed\n\x10\0\0\0\x24\0\0\0"),
    ("a.ply", b"ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\nend_header\n1 2 3\n"),
    ("a.ply", b"ply\nformat binary_big_endian 1.0\nelement vertex 2\nproperty list char int x\nend_header\n"),
    ("a.obj", b"v 0 0 0\nv 9 0 0\nv 0 9 0\nv 0 0 9\nf 1 2 3\nf 1 2 4\n"),
    ("a.stl", b"solid\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 3 0 0\nvertex 0 3 0\nendloop\n"),
    ("a.vox", b"VOX \x96\0\0\0MAIN\0\0\0\0\0\0\0\0SIZE\x0c\0\0\0\0\0\0\0\x03\0\0\0\x02\0\0\0\x01\0\0\0"),
    ("a.pgm", b"P2 2 2 9\n"),
    ("a.pgm", b"P5 2 2 300\n"),
];

#[test]
fn an_import_that_does_not_fit_names_the_file() {
    let import = |file: &str, text: &str| ImportSpec::new(file, text.as_bytes().to_vec());
    let message = |spec: ImportSpec| spec.read().unwrap_err().to_string();
    let known = "known are .m3dm, .txt, .bt, .ot, .pcd, .ply, .obj, .stl, .gltf, .glb, .dae, .sdf, .world, .vox, \
                 .pgm, .ppm, .pbm, .png, .bmp, .jpg, .jpeg, .yaml, .yml, .xyz, .xyzrgb, .xyzn, .asc, .pts, .csv, .las, .laz and .e57";
    assert_eq!(message(import("a.tga", "")), format!("a.tga: the file's extension is \"tga\", {known}"));
    assert_eq!(message(import("cave", "")), format!("cave: the file's extension is missing, {known}"));
    for (name, way) in
        [("a.usdz", "save the stage as .glb"), ("a.USD", "USD is not read"), ("a.off", "save it as .stl")]
    {
        assert!(message(import(name, "")).contains(way), "{name}");
    }
    assert!(message(import("a.m3dm", "x")).starts_with("a.m3dm: byte 1: "));
    assert!(message(import("a.TXT", "..\n.x\n")).starts_with("a.TXT: line 2, column 2: 'x'"));
    assert_eq!(message(ImportSpec::new("b.txt", vec![b'.', 0xff])), "b.txt: byte 1: not UTF-8 text");
}

#[test]
fn what_an_option_is_not_for_is_refused() {
    let refuse = |file: &str, options: ImportOptions| {
        ImportSpec { options, ..ImportSpec::new(file, Vec::new()) }.read().unwrap_err().to_string()
    };
    let threshold = |share| ImportOptions { threshold: Some(share), ..ImportOptions::default() };
    assert_eq!(
        refuse("a.m3dm", threshold(0.5)),
        "a.m3dm: threshold is not an option for .m3dm files, which have cells_max"
    );
    assert_eq!(
        refuse("a.obj", threshold(0.5)),
        "a.obj: threshold is not an option for .obj files, which have fill, inside, up, scale, margin_cells, crop, free_from, \
         gap_cells, cells_max, steps_max"
    );
    assert_eq!(refuse("a.pgm", threshold(1.5)), "a.pgm: threshold = 1.5, allowed is 0 to 1");
    let place = ImportOptions { free_from: Some([0.0, f64::NAN, 1.0]), ..ImportOptions::default() };
    assert_eq!(refuse("a.pcd", place), "a.pcd: free_from = 0,NaN,1, allowed is three finite numbers");
}

#[test]
fn a_cell_length_is_that_of_the_file_or_that_of_the_user() {
    let terrain = Grid::new(Extent::new([3, 3, 3], 0.5).unwrap(), Terrain::Wall);
    let packed = voxels::packed::write(&terrain);
    let written = MapWriter::of(Path::new("a.m3dm")).unwrap().write(&terrain).unwrap();
    assert_eq!(written, packed, "a plain file would lose the length");
    let plain = voxels::m3dm::write(&terrain).unwrap();
    let read = |bytes: &[u8], cell_m| ImportSpec { cell_m, ..ImportSpec::new("a.m3dm", bytes.to_vec()) }.read();
    let cell_m = |bytes: &[u8], asked| read(bytes, asked).unwrap().terrain.extent().cell_m();
    assert_eq!([cell_m(&packed, None), cell_m(&packed, Some(0.5))], [0.5, 0.5]);
    assert_eq!([cell_m(&plain, None), cell_m(&plain, Some(0.2))], [1.0, 0.2]);
    assert_eq!(
        read(&packed, Some(0.2)).unwrap_err().to_string(),
        "a.m3dm: the file has cells of 0.5 m, asked for are cells of 0.2 m; leave cell_m out, or let them agree"
    );
    assert_eq!(ImportSpec::new("a.m3dm", packed).stored_cell_m(), Some(0.5));
    assert_eq!(ImportSpec::new("a.m3dm", plain).stored_cell_m(), None);
    assert!(read(b"x", Some(f64::NAN)).is_err());
}

#[test]
fn a_packed_cave_takes_less_than_15_percent_of_a_plain_one() {
    for seed in 1..=2 {
        let spec = MapSpec::Spheres(SpheresSpec::default());
        let cave = mapgen::generate(&spec, Extent::new([100; 3], 1.0).unwrap(), seed).unwrap().terrain;
        let plain = MapWriter::of(Path::new("a.m3dm")).unwrap().write(&cave).unwrap().len();
        let packed = voxels::packed::write(&cave).len();
        assert_eq!(plain, 125_003);
        assert!(packed * 100 < plain * 15, "seed {seed}: {packed} bytes");
    }
}

#[test]
fn maps_are_as_large_as_allowed() {
    let bytes = [b"P2 5 5 1 ".as_slice(), &b"1 ".repeat(25)].concat();
    let error = ImportSpec { cells_max: 99, ..ImportSpec::new("a.pgm", bytes) }.read().unwrap_err().to_string();
    assert_eq!(
        error,
        "a.pgm: the map has 175 cells, allowed are 99; choose longer cells, or raise map.import.cells_max (--cells-max)"
    );
}

/// A tree of two leaves, which are wall and 512 cells wide.
fn large_tree() -> Vec<u8> {
    let header = b"# Octomap OcTree binary file\nid OcTree\nres 1\ndata\n";
    // Down to level 6 at opposite corners of the cube in the middle.
    let path = |child: u16| [0b11 << (2 * child)].repeat(5).into_iter().chain([0b10 << (2 * child)]);
    let tree = [0b11 | 0b11 << 14].into_iter().chain(path(7)).chain(path(0));
    [&header[..], &tree.flat_map(u16::to_le_bytes).collect::<Vec<u8>>()].concat()
}

#[test]
fn short_file_is_no_large_map() {
    let short = ImportSpec::new("a.bt", large_tree());
    assert!(short.bytes.len() < 261);
    let refused = "a.bt: the map has 1073741824 cells, allowed are 16777216; choose longer cells, or raise \
                   map.import.cells_max (--cells-max)";
    assert_eq!(short.clone().read().unwrap_err().to_string(), refused);
    assert_eq!(short.allowing(99).cells_max, 1 << 24);
    let cells_max = |bytes| ImportSpec::new("a.bt", vec![0; bytes]).cells_max;
    assert_eq!([cells_max(0), cells_max(1 << 15), cells_max(1 << 18)], [1 << 24, 1 << 25, 1 << 27]);
}

#[test]
fn a_map_is_surrounded_if_it_is_open_and_there_is_room() {
    let open = Grid::from_text("#.\n##\n").unwrap();
    let (around, note) = surrounded(open).unwrap();
    let wall = "####\n".repeat(4);
    assert_eq!(around.to_text(), format!("{wall}\n####\n##.#\n####\n####\n\n{wall}"));
    assert!(note.is_some());
    assert_eq!(surrounded(around.clone()), Ok((around, None)));
    let long = Grid::new(Extent::new([1023, 1, 1], 1.0).unwrap(), Terrain::Free);
    assert_eq!(surrounded(long.clone()), Ok((long, None)));
}

proptest! {
    #[test]
    fn garbage_is_refused_or_a_map(
        which in 0..BEGINNINGS.len(), keep in any::<prop::sample::Index>(), rest in prop::collection::vec(any::<u8>(), 0..80),
    ) {
        let (file, beginning) = BEGINNINGS[which];
        let whole = [beginning, &rest].concat();
        let cut = beginning[..keep.index(beginning.len())].to_vec();
        for bytes in [whole, cut, rest] {
            let spec = ImportSpec { cells_max: 1 << 16, ..ImportSpec::new(file, bytes) };
            match spec.read() {
                Ok(imported) => prop_assert!(imported.terrain.extent().volume() <= 1 << 16),
                Err(error) => prop_assert!(!error.to_string().contains('\n')),
            }
        }
    }

    #[test]
    fn any_words_are_refused_or_a_map(
        which in 0..BEGINNINGS.len(), words in prop::collection::vec("[-0-9.ef#v /]{1,9}", 0..30),
    ) {
        let (file, beginning) = BEGINNINGS[which];
        let bytes = [beginning, words.join("\n").as_bytes()].concat();
        let spec = ImportSpec { cells_max: 1 << 16, ..ImportSpec::new(file, bytes) };
        if let Err(error) = spec.read() {
            prop_assert!(!error.to_string().contains('\n'));
        }
    }
}
