//! Hostile files of all formats, with the limits of a run: each is a map within its bounds or an
//! error of one line, and none panics.
//!
//! Seeded mutants of real files, and files made by hand whose few bytes ask for a lot. Time is
//! bounded by the steps that a reader counts, so nothing here depends on a clock.

#![expect(clippy::unwrap_used, reason = "a panic is what this looks for")]

use std::path::Path;

use mapgen::{Fill, ImportOptions, ImportSpec, MapError, MapFormat};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use voxels::{Extent, Grid, Terrain, close_shell};

/// Mutants of all real files together.
const MUTANTS: usize = 600;

/// Largest number of cells of a map from a file of less than 16 KiB.
const CELLS_MAX: usize = 1 << 24;

/// A file with its name, and the picture of a `map.yaml`.
type Named = (String, Vec<u8>, Option<Vec<u8>>);

/// Real files of all formats, and the corpus of the fuzz targets, whose files may be faulty.
fn real_files() -> Vec<Named> {
    let read = |folder: &Path| {
        let mut files: Vec<_> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
        files.sort();
        files.into_iter().map(|file| (file.clone(), std::fs::read(file).unwrap()))
    };
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut files: Vec<Named> = Vec::new();
    for (file, bytes) in read(&root.join("tests/files")) {
        if MapFormat::of(&file).is_ok() {
            files.push((file.file_name().unwrap().to_string_lossy().into_owned(), bytes, None));
        }
    }
    for (target, extension) in
        [("pcd", "pcd"), ("ply", "ply"), ("vox", "vox"), ("pgm", "pgm"), ("las", "las"), ("ot", "ot")]
    {
        for (_, bytes) in read(&root.join("../fuzz/corpus").join(target)) {
            files.push((format!("corpus.{extension}"), bytes, None));
        }
    }
    let mut room = Grid::new(Extent::new([9, 8, 7], 0.5).unwrap(), Terrain::Free);
    close_shell(&mut room, 1);
    for format in MapFormat::ALL.into_iter().filter(|&format| format.is_written() && format != MapFormat::Yaml) {
        files.push((format!("room.{}", format.extension()), format.write(&room, false).unwrap(), None));
    }
    let plan = mapgen::export::floor_plan(&room, "room.pgm", [1.0, 2.0, 0.0]);
    files.push(("room.png".to_owned(), picture(9, 8), None));
    files.push(("room.xyz".to_owned(), b"x y z\n1 2 3\n4 5 6\n2.5 0 1\n".to_vec(), None));
    files.push(("room.yaml".to_owned(), plan.yaml.clone(), Some(picture(9, 8))));
    files.push(("room.yaml".to_owned(), plan.yaml, Some(plan.image)));
    files
}

fn picture(width: u32, height: u32) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(png::ColorType::Grayscale);
    let mut writer = encoder.write_header().unwrap();
    writer.write_image_data(&vec![254; (width * height) as usize]).unwrap();
    writer.finish().unwrap();
    bytes
}

/// Reads a file; the result is a map within its bounds or an error of one line.
#[track_caller]
fn read((name, bytes, companion): Named, options: ImportOptions) -> Option<String> {
    let spec = ImportSpec { companion, options, ..ImportSpec::new(name.clone(), bytes) };
    match spec.read() {
        Ok(imported) => {
            assert!(imported.terrain.extent().volume() <= CELLS_MAX, "{name}: {:?}", imported.terrain.extent());
            None
        }
        Err(error) => {
            assert!(matches!(error, MapError::Import { .. }), "{name}: {error}");
            let error = error.to_string();
            assert!(!error.contains('\n') && error.starts_with(&name), "{name}: {error:?}");
            Some(error)
        }
    }
}

fn mutate(bytes: &mut Vec<u8>, rng: &mut ChaCha8Rng) {
    for _ in 0..rng.random_range(1..6) {
        if bytes.is_empty() {
            return;
        }
        let at = rng.random_range(0..bytes.len());
        match rng.random_range(0..6) {
            0 => bytes[at] = rng.random(),
            1 => bytes[at] ^= 1 << rng.random_range(0..8),
            2 => bytes.truncate(at),
            3 => {
                let end = bytes.len().min(at + rng.random_range(1..64));
                let piece: Vec<u8> = bytes[at..end].to_vec();
                let to = rng.random_range(0..=bytes.len());
                bytes.splice(to..to, piece);
            }
            4 => {
                let end = bytes.len().min(at + rng.random_range(1..64));
                bytes.drain(at..end);
            }
            _ => {
                let end = bytes.len().min(at + 8);
                let extreme = [0u8, 0x7f, 0x80, 0xff, b'9', b'-'][rng.random_range(0..6)];
                bytes[at..end].fill(extreme);
            }
        }
    }
}

#[test]
fn mutants_of_real_files_stay_within_bounds() {
    let mut rng = ChaCha8Rng::seed_from_u64(23);
    let files = real_files();
    for file in files.iter().filter(|file| !file.0.starts_with("corpus.")) {
        assert_eq!(read(file.clone(), ImportOptions::default()), None, "{}", file.0);
    }
    let mut maps = 0;
    for number in 0..MUTANTS {
        let (name, mut bytes, mut companion) = files[number % files.len()].clone();
        match &mut companion {
            Some(companion) if rng.random_bool(0.5) => mutate(companion, &mut rng),
            _ => mutate(&mut bytes, &mut rng),
        }
        let is_mesh = MapFormat::of(Path::new(&name)).unwrap().options().contains(&"fill");
        let fill = (is_mesh && number % 3 == 0).then_some(Fill::Shell);
        let options = ImportOptions { fill, ..ImportOptions::default() };
        maps += usize::from(read((name, bytes, companion), options).is_none());
    }
    assert!((MUTANTS / 20..MUTANTS * 19 / 20).contains(&maps), "{maps} mutants are maps: the test tests little");
}

#[test]
fn few_bytes_that_ask_for_much_are_refused() {
    let file = |name: &str, bytes: &[u8]| (name.to_owned(), bytes.to_vec(), None);
    let stl = [[b' '; 80].as_slice(), &u32::MAX.to_le_bytes(), &[0; 50]].concat();
    let ply = "ply\nformat binary_little_endian 1.0\nelement vertex 18446744073709551615\nproperty uchar x\nproperty uchar y\n\
               property uchar z\nelement face 18446744073709551615\nproperty list uchar uint vertex_indices\nend_header\n";
    let mut png = picture(1, 1);
    png[16..24].copy_from_slice(&[0x7f, 0xff, 0xff, 0xff, 0x7f, 0xff, 0xff, 0xff]);
    let glb = [b"glTF\x02\0\0\0\xff\xff\xff\xff\xff\xff\xff\xffJSON".as_slice(), b"{}"].concat();
    let nested = "[".repeat(100_000);
    // Two leaves at opposite corners of a cube of 1024 cells.
    let path = |child: u16| [0b11 << (2 * child)].repeat(5).into_iter().chain([0b10 << (2 * child)]);
    let tree = [0b11 | 0b11 << 14].into_iter().chain(path(7)).chain(path(0)).flat_map(u16::to_le_bytes);
    let bt =
        [b"# Octomap OcTree binary file\nid OcTree\nres 1\ndata\n".as_slice(), &tree.collect::<Vec<u8>>()].concat();
    assert!(bt.len() < 261);
    let deep = [b"# Octomap OcTree file\nid OcTree\nres 1\ndata\n".as_slice(), &[0xff; 4000]].concat();
    for (hostile, reason) in [
        (file("a.stl", &stl), "byte 134: the file ends here, expected length"),
        (file("a.obj", b"v 0 0 0\nv 1e30 0 0\nv 0 1e30 0\nf 1 2 3\n"), "map size along x is 4294967295 cells"),
        (
            file("a.obj", b"v 0 0 0\nv 900 0 0\nv 0 900 900\nf 1 2 3\n"),
            "allowed are 16777216; choose longer cells, or raise map.import",
        ),
        (file("a.ply", ply.as_bytes()), "the file ends here, a property takes 1 bytes"),
        (file("a.png", &png), "the PNG file is damaged"),
        (file("a.glb", &glb), "byte 20: the file ends here, the document takes 4294967295 bytes"),
        (file("a.gltf", nested.as_bytes()), "line 1: "),
        (file("a.bt", &bt), "the map has 1073741824 cells, allowed are 16777216"),
        (file("a.ot", &deep), "a node of level 16 has children"),
        (file("a.xyz", b"0 0 0\n1023 1023 1023\n"), "cells, allowed are"),
        (file("a.yaml", b"image: x\nresolution: 1e-300\norigin: [0, 0, 0]\n"), "it is not at hand"),
        (
            (
                "a.yaml".to_owned(),
                b"image: x\nresolution: 1\norigin: [0, 0, 0]\n".to_vec(),
                Some(b"P5 1024 1024 255 ".to_vec()),
            ),
            "the file ends here, expected length",
        ),
    ] {
        let name = hostile.0.clone();
        let error = read(hostile, ImportOptions::default()).unwrap_or_else(|| panic!("{name}: a map"));
        assert!(error.contains(reason), "{error}");
    }
}

#[test]
fn a_mesh_of_large_triangles_is_refused_by_its_work() {
    // Five thousand sheets through the whole of a map of 250 cells along each axis.
    let vertices = "v 0 0 0\nv 250 0 0\nv 0 250 250\nv 250 250 250\n";
    let bytes = [vertices.to_owned(), "f 1 2 4 3\n".repeat(5_000)].concat().into_bytes();
    for fill in [Fill::Solid, Fill::Shell] {
        let options = ImportOptions { fill: Some(fill), ..ImportOptions::default() };
        let error = read(("a.obj".to_owned(), bytes.clone(), None), options).expect("it takes too much work");
        assert!(error.contains("more than 268435456 steps of work"), "{error}");
    }
}
