//! Files that the map commands write.

use std::fs::{self, File};
use std::io::Write;
use std::path::Path;

use clap::Args;
use voxels::{Grid, Terrain, m3dm, packed};

use map_files::export::{floor_plan, octomap, octomap_corner};
use map_files::{ImportSpec, MapWriter};

use super::MapCliError;

/// How a map is written.
#[derive(Debug, Clone, Copy, PartialEq, Args)]
pub(crate) struct Encoding {
    /// Write packed M3DM, which is smaller, even where a plain one would do: up to 127 cells along
    /// an axis, of 1 m.
    #[arg(long)]
    pub(crate) rle: bool,
    /// Write plain M3DM, the format of MAES3D, which holds no length of cells: whoever reads the
    /// file has to give it.
    #[arg(long, conflicts_with = "rle")]
    pub(crate) plain: bool,
    /// Place of the lowest corner of a .yaml in metres, and its turn in radians [default: that of
    /// the map that is read, or 0,0,0].
    #[arg(long, value_name = "X,Y,YAW", value_parser = parse_origin, allow_hyphen_values = true)]
    pub(crate) origin: Option<[f64; 3]>,
}

/// A file to write, checked before there is a map.
pub(super) struct Output<'a> {
    file: &'a Path,
    writer: &'static MapWriter,
    encoding: Encoding,
}

impl<'a> Output<'a> {
    pub(super) fn new(file: &'a Path, encoding: Encoding) -> Result<Self, MapCliError> {
        let in_output = |reason| MapCliError::Format { file: file.to_path_buf(), reason };
        let writer = MapWriter::of(file).map_err(in_output)?;
        for (option, is_given, format) in [
            ("--rle", encoding.rle, "m3dm"),
            ("--plain", encoding.plain, "m3dm"),
            ("--origin", encoding.origin.is_some(), "yaml"),
        ] {
            if is_given && writer.extension != format {
                return Err(MapCliError::NotForOutput { file: file.to_path_buf(), option, format });
            }
        }
        Ok(Self { file, writer, encoding })
    }

    /// Refuses to replace the file that is read, the picture of another map, or a text that is no
    /// map. Maps are replaced.
    pub(super) fn check_replaced(&self, input: Option<&Path>) -> Result<(), MapCliError> {
        let refused = |file: &Path, what| Err(MapCliError::Exists { file: file.to_path_buf(), what });
        let image = (self.writer.extension == "yaml").then(|| self.file.with_extension("pgm"));
        for file in std::iter::once(self.file).chain(image.as_deref()) {
            let is_input = input.is_some_and(|input| is_same(input, file));
            if is_input {
                return refused(file, "it is the file that is read");
            }
        }
        match &image {
            Some(image) if image.exists() && !self.file.exists() => {
                return refused(image, "it is there, and not the picture of the map that is written");
            }
            _ => {}
        }
        let is_map = |text| ImportSpec::new(self.file.display().to_string(), text).read().is_ok();
        if self.writer.extension == "txt" && fs::read(self.file).is_ok_and(|text| !is_map(text)) {
            return refused(self.file, "it is there, and no map");
        }
        Ok(())
    }

    /// Writes the map, whose lowest corner has this place (metres) and turn (radians) in the file
    /// that it comes from; returns what to say about the file.
    pub(super) fn write(
        &self,
        terrain: &Grid<Terrain>,
        place: [f64; 3],
        yaw_rad: f64,
    ) -> Result<Vec<(&'static str, String)>, MapCliError> {
        let in_output = |reason| MapCliError::Format { file: self.file.to_path_buf(), reason };
        let cell_m = terrain.extent().cell_m();
        if self.writer.extension == "yaml" {
            let [x, y, yaw] = self.encoding.origin.unwrap_or([place[0], place[1], yaw_rad]);
            let image = self.file.with_extension("pgm");
            let name = image.file_name().unwrap_or_default().to_string_lossy().into_owned();
            let plan = floor_plan(terrain, &name, [x, y, yaw]);
            write_file(&image, &plan.image)?;
            write_file(self.file, &plan.yaml)?;
            let layer =
                format!("layer z = {} in {name}, with its origin at ({x}, {y}) m, turned by {yaw} rad", plan.layer);
            return Ok(vec![("image", layer)]);
        }
        if self.writer.extension == "bt" {
            let corner = octomap_corner(terrain, place, yaw_rad);
            write_file(self.file, &octomap(terrain, corner.unwrap_or_default()))?;
            let [x, y, z] = corner.map_or([0.0; 3], |corner| corner.map(|along| f64::from(along) * cell_m));
            let why = if corner.is_some() { "" } else { ", as it was not between cells of the tree there" };
            return Ok(vec![("corner", format!("the lowest one of the map is at ({x}, {y}, {z}) m of the file{why}"))]);
        }
        if self.encoding.plain {
            let bytes = m3dm::write(terrain).map_err(|error| in_output(error.into()))?;
            write_file(self.file, &bytes)?;
            let lost = format!("the file does not hold the length of cells: read it with --cell-m {cell_m}");
            return Ok(if cell_m == 1.0 { Vec::new() } else { vec![("plain", lost)] });
        }
        let packed = self.encoding.rle.then(|| Ok(packed::write(terrain)));
        let bytes = packed.unwrap_or_else(|| self.writer.write(terrain)).map_err(in_output)?;
        write_file(self.file, &bytes)?;
        Ok(Vec::new())
    }
}

/// Whether two paths are of one file that is there.
fn is_same(one: &Path, other: &Path) -> bool {
    matches!((one.canonicalize(), other.canonicalize()), (Ok(one), Ok(other)) if one == other)
}

/// Three numbers: x and y in metres, and a turn in radians.
fn parse_origin(text: &str) -> Result<[f64; 3], String> {
    let numbers: Vec<f64> = text.split(',').filter_map(|number| number.trim().parse().ok()).collect();
    let numbers = numbers.try_into().ok().filter(|numbers: &[f64; 3]| numbers.iter().all(|number| number.is_finite()));
    numbers.ok_or_else(|| "an origin is three numbers, as in -10,-5.5,0".to_owned())
}

/// Writes a file under a temporary name beside it and then renames it, so that there is never half
/// a file.
pub(super) fn write_file(file: &Path, bytes: &[u8]) -> Result<(), MapCliError> {
    let mut name = std::ffi::OsString::from(".");
    name.push(file.file_name().unwrap_or_default());
    name.push(format!(".{}.tmp", std::process::id()));
    let temporary = file.with_file_name(name);
    let write = || {
        let mut handle = File::create_new(&temporary)?;
        let written = handle.write_all(bytes).and_then(|()| handle.sync_all());
        let moved = written.and_then(|()| fs::rename(&temporary, file));
        if moved.is_err() {
            // What matters to the user is why the file could not be written.
            let _ = fs::remove_file(&temporary);
        }
        moved
    };
    write().map_err(|reason| MapCliError::Write { file: file.to_path_buf(), reason })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_read_and_what_is_no_map_is_not_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let encoding = Encoding { rle: false, plain: false, origin: None };
        let path = |name: &str| folder.path().join(name);
        let check = |name: &str, input: Option<&str>| {
            let file = path(name);
            let output = Output::new(&file, encoding).unwrap();
            output.check_replaced(input.map(path).as_deref()).map_err(|error| error.to_string())
        };
        for (name, text) in [
            ("mine.obj", "v 0 0 0"),
            ("plan.txt", "seeds = 1"),
            ("map.txt", "##\n#.\n"),
            ("long.txt", "cell_m = 0.5\n##\n#.\n"),
            ("m.pgm", "P5"),
        ] {
            fs::write(path(name), text).unwrap();
        }
        assert!(
            check("mine.obj", Some("mine.obj"))
                .unwrap_err()
                .contains("it is the file that is read; nothing was written")
        );
        assert!(check("plan.txt", None).unwrap_err().contains("no map"));
        assert!(check("m.yaml", None).unwrap_err().contains("m.pgm: it is there"));
        let others = ["map.txt", "long.txt", "new.yaml", "new.m3dm"].map(|name| (name, None));
        for (name, input) in others.into_iter().chain([("mine.obj", Some("map.txt"))]) {
            assert_eq!(check(name, input), Ok(()), "{name}");
        }
        fs::write(path("m.yaml"), "image: m.pgm").unwrap();
        assert_eq!(check("m.yaml", None), Ok(()));
        assert!(check("m.yaml", Some("m.yaml")).is_err());
    }
}
