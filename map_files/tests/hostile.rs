//! Hostile files of all formats, with the limits of a run: each is a map within its bounds or an
//! error of one line, takes no more memory than its budget, and none panics.
//!
//! Seeded mutants of real files, and files made by hand whose few bytes ask for a lot. Time is
//! bounded by the steps that a reader counts, so nothing here depends on a clock.

#![expect(clippy::unwrap_used, reason = "a panic is what this looks for")]
#![expect(unsafe_code, reason = "an allocator that counts what each thread has")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::path::Path;

use map_files::{ImportError, ImportSpec, MapReader, WRITERS, export::floor_plan};
use mapgen::import_options::PointFlag;
use mapgen::{Fill, ImportOptions};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use voxels::{Extent, Grid, Terrain, close_shell};

/// Mutants of all real files together.
const MUTANTS: usize = 600;

/// Largest number of cells of a map from a file of less than 16 KiB.
const CELLS_MAX: usize = 1 << 24;

/// The memory of an import and its repair: what the tables of decoders take, bytes for each byte of
/// the file, and bytes for each cell that a map of a short file may have.
const MEMORY_MAX: usize = (16 << 20) + 8 * CELLS_MAX;
const MEMORY_PER_BYTE_MAX: usize = 512;

/// A file with its name, and the picture of a `map.yaml`.
type Named = (String, Vec<u8>, Option<Vec<u8>>);

/// The system's allocator, with the bytes that each thread has and the most that it had.
struct Counting;

thread_local! {
    static HELD: Cell<(usize, usize)> = const { Cell::new((0, 0)) };
}

fn count(more: usize, less: usize) {
    // A thread that ends has no counters any more.
    let _ = HELD.try_with(|held| {
        let (now, most) = held.get();
        let now = (now + more).saturating_sub(less);
        held.set((now, most.max(now)));
    });
}

// SAFETY: all is the system's allocator, and counting allocates nothing.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(layout.size(), 0);
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count(layout.size(), 0);
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, place: *mut u8, layout: Layout) {
        count(0, layout.size());
        unsafe { System.dealloc(place, layout) }
    }

    unsafe fn realloc(&self, place: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // Both may be there while it is moved.
        count(size, 0);
        count(0, layout.size());
        unsafe { System.realloc(place, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// The most memory that an action has taken at once, bytes.
fn memory_of<T>(action: impl FnOnce() -> T) -> (T, usize) {
    let before = HELD.with(|held| {
        let (now, _) = held.get();
        held.set((now, now));
        now
    });
    let done = action();
    (done, HELD.with(Cell::get).1 - before)
}

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
        if MapReader::of(&file).is_ok() {
            files.push((file.file_name().unwrap().to_string_lossy().into_owned(), bytes, None));
        }
    }
    for (target, extension) in
        [("pcd", "pcd"), ("ply", "ply"), ("vox", "vox"), ("pgm", "pgm"), ("las", "las"), ("ot", "ot"), ("sdf", "sdf")]
    {
        for (_, bytes) in read(&root.join("../testing/fuzz/corpus").join(target)) {
            files.push((format!("corpus.{extension}"), bytes, None));
        }
    }
    let mut room = Grid::new(Extent::new([9, 8, 7], 0.5).unwrap(), Terrain::Free);
    close_shell(&mut room, 1);
    for writer in WRITERS.iter().filter(|writer| writer.extension != "yaml") {
        files.push((format!("room.{}", writer.extension), writer.write(&room).unwrap(), None));
    }
    let plan = floor_plan(&room, "room.pgm", [1.0, 2.0, 0.0]);
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

/// Reads a file and repairs it, as a run does; the result is a map within its bounds or an error of
/// one line, and takes no more memory than it may.
#[track_caller]
fn read((name, bytes, companion): Named, options: ImportOptions) -> Option<String> {
    let length = bytes.len() + companion.as_ref().map_or(0, Vec::len);
    assert_within_bounds(
        name.clone(),
        length,
        ImportSpec { options, ..ImportSpec::new(name, bytes) }.with_companions(companion.into_iter().collect()),
    )
}

#[track_caller]
fn assert_within_bounds(name: String, length: usize, spec: ImportSpec) -> Option<String> {
    let (read, memory) = memory_of(|| -> Result<Extent, ImportError> {
        let terrain = spec.read()?.terrain;
        let extent = terrain.extent();
        // A map without a free cell is refused only now.
        let _is_sound = mapgen::repair(&name, terrain, 0).is_ok();
        Ok(extent)
    });
    let memory_max = MEMORY_MAX + MEMORY_PER_BYTE_MAX * length;
    assert!(memory <= memory_max, "{name}: {memory} bytes of memory for {length} of the file, {memory_max} allowed");
    match read {
        Ok(extent) => {
            assert!(extent.volume() <= CELLS_MAX, "{name}: {extent:?}");
            None
        }
        Err(error) => {
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
    let mut files = real_files();
    files.extend(compressed_files());
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
        let is_mesh = MapReader::of(Path::new(&name)).unwrap().options.contains(&"fill");
        let fill = (is_mesh && number % 3 == 0).then_some(Fill::Shell);
        let options = ImportOptions { fill, ..ImportOptions::default() };
        maps += usize::from(read((name, bytes, companion), options).is_none());
    }
    assert!((MUTANTS / 20..MUTANTS * 19 / 20).contains(&maps), "{maps} mutants are maps: the test tests little");
}

/// A LAS file of a point format, compressed by the crate that decompresses it.
fn compressed(format: u8, points: &[[i32; 3]]) -> Vec<u8> {
    let vlr = laz::LazVlrBuilder::default().with_point_format(format, 2).unwrap().with_fixed_chunk_size(50).build();
    let mut record = Vec::new();
    vlr.write_to(&mut record).unwrap();
    let (length, start) = (vlr.items_size() as u16, 227 + 54 + record.len() as u32);
    let mut file = vec![0; 227];
    file[..4].copy_from_slice(b"LASF");
    (file[24], file[25], file[94], file[100]) = (1, 2, 227, 1);
    file[96..100].copy_from_slice(&start.to_le_bytes());
    file[104] = format | 0x80;
    file[105..107].copy_from_slice(&length.to_le_bytes());
    file[107..111].copy_from_slice(&(points.len() as u32).to_le_bytes());
    for axis in 0..3 {
        file[131 + 8 * axis..][..8].copy_from_slice(&0.25f64.to_le_bytes());
    }
    let mut header = vec![0; 54];
    header[2..16].copy_from_slice(b"laszip encoded");
    header[18..20].copy_from_slice(&22204u16.to_le_bytes());
    header[20..22].copy_from_slice(&(record.len() as u16).to_le_bytes());
    file.extend(header);
    file.extend(record);
    let mut data = std::io::Cursor::new(file);
    data.set_position(start.into());
    let mut compressor = laz::LasZipCompressor::new(&mut data, vlr).unwrap();
    for (number, point) in points.iter().enumerate() {
        let mut bytes = vec![number as u8; usize::from(length)];
        bytes[..12].copy_from_slice(&point.map(i32::to_le_bytes).concat());
        compressor.compress_one(&bytes).unwrap();
    }
    compressor.done().unwrap();
    drop(compressor);
    data.into_inner()
}

/// Places of a wavy sheet.
fn sheet() -> Vec<[i32; 3]> {
    (0..180).map(|number| [number % 15 * 4, number / 15 * 4, (number * number) % 23]).collect()
}

/// Compressed clouds of all point formats.
fn compressed_files() -> Vec<Named> {
    (0..=10).map(|format| (format!("sheet{format}.laz"), compressed(format, &sheet()), None)).collect()
}

#[test]
fn compressed_points_of_all_formats_are_one_map() {
    let line = |point: [i32; 3]| point.map(|along| (f64::from(along) / 4.0).to_string()).join(" ") + "\n";
    let points_of = |is_kept: &dyn Fn(usize) -> bool| {
        let kept = sheet().into_iter().enumerate().filter(|&(number, _)| is_kept(number));
        let text: String = kept.map(|(_, point)| line(point)).collect();
        ImportSpec::new("sheet.xyz", text.into_bytes()).read().unwrap().terrain
    };
    for (format, (name, bytes, _)) in compressed_files().into_iter().enumerate() {
        let read = |drop_flags| {
            let options = ImportOptions { drop_flags, ..ImportOptions::default() };
            let spec = ImportSpec { options, ..ImportSpec::new(name.clone(), bytes.clone()) };
            spec.read().unwrap_or_else(|error| panic!("{error}"))
        };
        let imported = read(Some(vec![PointFlag::None]));
        assert!(imported.terrain == points_of(&|_| true), "{name}");
        assert!(imported.notes[0].text.ends_with("180 points, compressed"), "{:?}", imported.notes[0]);
        // All bytes of a point but its coordinates are its number.
        let withheld = if format < 6 { 0x80 } else { 4 };
        assert!(read(None).terrain == points_of(&|number| number & withheld == 0), "{name}");
    }
}

#[test]
fn mutants_of_stacks_stay_within_bounds() {
    let mut rng = ChaCha8Rng::seed_from_u64(24);
    let mut maps = 0;
    for _ in 0..100 {
        let mut layers: Vec<_> = (0..4).map(|z| (format!("z{z}.png"), picture(9, 8))).collect();
        mutate(&mut layers[rng.random_range(0..4)].1, &mut rng);
        let length = layers.iter().map(|(_, bytes)| bytes.len()).sum();
        let spec = ImportSpec::stack("scan", layers);
        maps += usize::from(assert_within_bounds("scan".to_owned(), length, spec).is_none());
    }
    assert!(maps < 100, "a mutant is refused");
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
    let mut laz = compressed(6, &sheet());
    laz[107..111].copy_from_slice(&u32::MAX.to_le_bytes());
    // The size of a layer, behind the first point and the number of points.
    let mut layer = compressed(6, &sheet());
    let start = u32::from_le_bytes([layer[96], layer[97], layer[98], layer[99]]) as usize;
    layer[start + 8 + 32 + 4..][..4].copy_from_slice(&u32::MAX.to_le_bytes());
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
        (file("a.laz", &laz), "allowed are 8 points for each of its bytes, and it has 4294967295"),
        (file("a.laz", &layer), "the chunk that begins here is damaged: the file ends within it"),
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
