//! Targets of foreign map formats and the packed one: what is read is a map, and writing and
//! reading it gives the same map.

use map_files::{ImportSpec, export};
use mapgen::{Fill, ImportOptions, Kind};
use voxels::{Grid, Terrain, packed as format};

/// Most cells of a map in ordinary tests, which take many inputs; libFuzzer runs with the limits of
/// a run.
const CELLS_MAX: usize = if cfg!(feature = "libfuzzer") { 1 << 27 } else { 1 << 16 };

/// A packed map.
pub(crate) fn packed(bytes: &[u8]) {
    if let Ok(terrain) = format::read(bytes, CELLS_MAX) {
        assert_eq!(format::extent(bytes), Ok(terrain.extent()));
        assert_eq!(format::read(&format::write(&terrain), CELLS_MAX), Ok(terrain));
    }
}

/// An OctoMap tree: writing and reading it gives the same map, unless the layer of wall around it
/// has made it too large.
pub(crate) fn octomap(bytes: &[u8]) {
    let read_back = read("fuzz.bt", bytes, ImportOptions::default());
    if let Some(terrain) = read_back.filter(|terrain| terrain.extent().volume() <= CELLS_MAX) {
        let again = export::octomap(&terrain, [0; 3]);
        assert_eq!(read("fuzz.bt", &again, ImportOptions::default()), Some(terrain));
    }
    read("fuzz.bt", bytes, ImportOptions { unknown: Some(Kind::Free), ..ImportOptions::default() });
}

/// A point cloud of the Point Cloud Library.
pub(crate) fn pcd(bytes: &[u8]) {
    read("fuzz.pcd", bytes, ImportOptions::default());
}

/// A point cloud in the Polygon File Format.
pub(crate) fn ply(bytes: &[u8]) {
    read("fuzz.ply", bytes, ImportOptions::default());
}

/// A mesh in Wavefront's format.
pub(crate) fn obj(bytes: &[u8]) {
    mesh("fuzz.obj", bytes);
}

/// A mesh of triangles.
pub(crate) fn stl(bytes: &[u8]) {
    mesh("fuzz.stl", bytes);
}

/// A model of MagicaVoxel.
pub(crate) fn vox(bytes: &[u8]) {
    read("fuzz.vox", bytes, ImportOptions::default());
}

/// A floor plan.
pub(crate) fn pgm(bytes: &[u8]) {
    read("fuzz.pgm", bytes, ImportOptions::default());
}

/// A scene of meshes.
pub(crate) fn gltf(bytes: &[u8]) {
    mesh("fuzz.glb", bytes);
}

/// Points of a laser scanner.
pub(crate) fn las(bytes: &[u8]) {
    read("fuzz.las", bytes, ImportOptions::default());
    read("fuzz.las", bytes, ImportOptions { sensor: Some([0.0; 3]), ..ImportOptions::default() });
}

/// A full OctoMap tree.
pub(crate) fn full_octomap(bytes: &[u8]) {
    read("fuzz.ot", bytes, ImportOptions::default());
}

/// A map of the map server, and after a zero its picture.
pub(crate) fn yaml(bytes: &[u8]) {
    let mut parts = bytes.splitn(2, |&byte| byte == 0);
    let (yaml, image) = (parts.next().unwrap_or_default(), parts.next().map(<[u8]>::to_vec));
    read_spec(ImportSpec::new("fuzz.yaml", yaml.to_vec()).with_companions(image.into_iter().collect()));
}

/// A scene of COLLADA.
pub(crate) fn collada(bytes: &[u8]) {
    mesh("fuzz.dae", bytes);
}

/// A world of Gazebo, all of whose files are the world itself.
pub(crate) fn world(bytes: &[u8]) {
    let mut spec = ImportSpec::new("fuzz.sdf", bytes.to_vec());
    // Each of them may name others.
    for _ in 0..4 {
        let contents = vec![bytes.to_vec(); spec.missing().len()];
        spec = spec.with_companions(contents);
    }
    read_spec(spec);
}

/// Scans of a survey.
pub(crate) fn survey(bytes: &[u8]) {
    read("fuzz.e57", bytes, ImportOptions::default());
}

/// Points as text.
pub(crate) fn text_cloud(bytes: &[u8]) {
    read("fuzz.xyz", bytes, ImportOptions::default());
}

/// A floor plan in each format of pictures, and as a layer of a stack.
pub(crate) fn picture(bytes: &[u8]) {
    for file in ["fuzz.png", "fuzz.bmp", "fuzz.jpg"] {
        read(file, bytes, ImportOptions::default());
    }
    read_spec(ImportSpec::stack("fuzz", vec![("1.png".to_owned(), bytes.to_vec())]));
}

/// Positions of a sensor, for a cloud with times.
pub(crate) fn trajectory(bytes: &[u8]) {
    let cloud = b"FIELDS x y z t\nPOINTS 2\nDATA ascii\n0.5 0.5 0.5 1\n4.5 3.5 2.5 2\n";
    let options = ImportOptions { trajectory: Some("fuzz.txt".into()), ..ImportOptions::default() };
    let spec = ImportSpec { options, trajectory: Some(bytes.to_vec()), ..ImportSpec::new("fuzz.pcd", cloud.to_vec()) };
    read_spec(spec);
}

/// A mesh, filled as a solid and as a shell.
fn mesh(file: &str, bytes: &[u8]) {
    for fill in [Fill::Solid, Fill::Shell] {
        read(file, bytes, ImportOptions { fill: Some(fill), inside: Some(Kind::Free), ..ImportOptions::default() });
    }
}

/// Reads a map; an error has to be one line that names the file.
fn read(file: &str, bytes: &[u8], options: ImportOptions) -> Option<Grid<Terrain>> {
    read_spec(ImportSpec { options, ..ImportSpec::new(file, bytes.to_vec()) })
}

fn read_spec(spec: ImportSpec) -> Option<Grid<Terrain>> {
    let spec = ImportSpec { cells_max: spec.cells_max.min(CELLS_MAX), ..spec };
    match spec.read() {
        Ok(imported) => {
            // A layer of wall around an open map is none of the cells that a file may have.
            let inside = imported.terrain.extent().size().map(|cells| cells.saturating_sub(2) as usize);
            assert!(inside.iter().product::<usize>() <= CELLS_MAX);
            Some(imported.terrain)
        }
        Err(error) => {
            let error = error.to_string();
            assert!(error.starts_with(&spec.file), "an error that does not name the file: {error}");
            assert!(!error.contains('\n'), "an error of several lines: {error}");
            None
        }
    }
}
