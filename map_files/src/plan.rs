//! Floor plans: pictures in grey, and the maps of ROS 2's map server (`map.yaml` with a picture).
//!
//! A pixel is a column of cells of one kind, from floor to ceiling. The first row of the picture
//! has the highest y.

mod keys;

use std::ops::RangeInclusive;
use std::path::{Component, Path, PathBuf};

use voxels::{Cell, Extent, Terrain};

use super::bytes::shown;
use super::options::{HEIGHT_CELLS, Kind, THRESHOLD};
use super::picture::{Picture, Pixel, Rows, Summary, White};
use super::{FormatError, ImportSpec, Imported, MapReader, Note, new_grid, surrounded};

use keys::{Keys, Mode};

/// A floor plan as a picture.
pub(super) const READER: MapReader = MapReader::new(
    "floor plan",
    &["pgm", "ppm", "pbm", "png", "bmp", "jpg", "jpeg"],
    &["height_cells", "threshold", "cells_max"],
    read,
);

/// A map of ROS 2's map server, with its picture in another file.
pub(super) const YAML_READER: MapReader = MapReader {
    stored_cell_m: Some(resolution_m),
    companions: Some(|spec| image(&spec.bytes).into_iter().collect()),
    ..MapReader::new("map of the map server", &["yaml", "yml"], &["unknown", "height_cells", "cells_max"], read_yaml)
};

/// Height of a map of the map server, metres, unless an option gives it in cells: that of a room.
const HEIGHT_M: f64 = 2.5;

/// Largest height of a plan, cells.
const HEIGHT_CELLS_MAX: u32 = 1022;

/// The brightness, of 255, that the map server's `map_saver` writes for unknown cells of trinary
/// maps (ROS 1 and nav2's `map_io.cpp`), beside thresholds that do not always tell it from free
/// ones: nav2 writes `free_thresh: 0.25`, and the occupancy of this grey is 0.196.
const GREY_OF_UNKNOWN: f64 = 205.0;

/// The greys that compression with losses makes of that of unknown cells beside occupied and free
/// ones: down to half the way to black, and less up, where free cells ring.
const NEAR_UNKNOWN: Greys = 102.5..=225.0;

/// A picture that is compressed with losses has unknown cells if this share of its pixels is so
/// near to their grey. In pictures of `map_saver`'s greys it is above 0.28 at qualities from 30 on,
/// and at most 0.0012 without unknown cells.
const SHARE_OF_UNKNOWN: f64 = 0.01;
const NEAR: f64 = 4.0;

/// Distance from the grey of unknown cells within which another grey is suspicious: pictures that
/// were scaled or saved again by other programs.
const SUSPICIOUS: f64 = 8.0;

/// Greys of 255.
type Greys = RangeInclusive<f64>;

/// What a pixel says.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Ground {
    Free,
    Unknown,
    Occupied,
}

/// A map of a picture.
///
/// # Errors
/// If the file is malformed, or too large for a map.
pub(super) fn read(spec: &ImportSpec) -> Result<Imported, FormatError> {
    let height = spec.options.height_cells.unwrap_or(HEIGHT_CELLS);
    let extent = |[x, y]: [u32; 2]| Extent::new([x, y, height + 2], spec.length_m()).map_err(FormatError::Extent);
    let picture = Picture::read(&spec.bytes, Rows::Upright, |size| extent(size).map(|_| ()))?;
    let threshold = spec.options.threshold.unwrap_or(THRESHOLD);
    let white = White::of(&Summary::default().and(&picture), threshold)?;
    let ground = |pixel: &Pixel| match pixel.is_bright(threshold, white, picture.maximum) {
        true => Ground::Free,
        false => Ground::Occupied,
    };
    let ground: Vec<Ground> = picture.pixels.iter().map(ground).collect();
    let free = ground.iter().filter(|&&pixel| pixel == Ground::Free).count();
    let text =
        format!("{free} free, {} wall, as bright as {threshold} of {} is free", ground.len() - free, picture.maximum);
    let plan =
        Plan { extent: extent([picture.width, picture.height])?, width: picture.width, pixels_per_cell: 1, ground };
    let notes = [Some(Note::new("pixels", text)), white.note(), picture.note()];
    plan.map(spec, Terrain::Wall, notes.into_iter().flatten().collect())
}

/// A picture as what its pixels say, and the map that it becomes.
struct Plan {
    extent: Extent,
    width: u32,
    /// Pixels along the edge of a cell.
    pixels_per_cell: u32,
    ground: Vec<Ground>,
}

impl Plan {
    /// A cell is free if all of its pixels are, and wall if one of them is.
    fn map(&self, spec: &ImportSpec, unknown: Terrain, mut notes: Vec<Note>) -> Result<Imported, FormatError> {
        let [size_x, size_y, size_z] = self.extent.size();
        let mut terrain = new_grid(self.extent, Terrain::Wall, spec)?;
        let height = self.ground.len() as u32 / self.width;
        let side = self.pixels_per_cell;
        for (y, x) in (0..size_y).flat_map(|y| (0..size_x).map(move |x| (y, x))) {
            let rows = (y * side..((y + 1) * side).min(height)).map(|from_below| height - 1 - from_below);
            let columns = || x * side..((x + 1) * side).min(self.width);
            let pixels = rows.flat_map(|row| columns().map(move |column| row * self.width + column));
            let ground = pixels.map(|pixel| self.ground[pixel as usize]).max().unwrap_or(Ground::Unknown);
            if ground == Ground::Free || (ground == Ground::Unknown && unknown == Terrain::Free) {
                for z in 1..=size_z as i32 - 2 {
                    terrain.set(Cell::new(x as i32, y as i32, z), Terrain::Free);
                }
            }
        }
        // Floor and ceiling are closed; the sides may be open.
        let (terrain, closed) = surrounded(terrain)?;
        notes.extend(closed);
        Ok(Imported { terrain, notes, stores_cell_m: false, origin_m: None, yaw_rad: 0.0 })
    }
}

/// The file with the picture of a `map.yaml`, relative to its folder.
///
/// # Errors
/// If the file is malformed.
pub(super) fn image(bytes: &[u8]) -> Result<PathBuf, FormatError> {
    Ok(PathBuf::from(Keys::read(bytes)?.image))
}

/// The resolution of a `map.yaml`, metres.
pub(super) fn resolution_m(bytes: &[u8]) -> Option<f64> {
    Some(Keys::read(bytes).ok()?.resolution_m)
}

/// A map of a `map.yaml`, whose picture is the companion of the file.
///
/// # Errors
/// If one of the files is malformed, or too large for a map.
pub(super) fn read_yaml(spec: &ImportSpec) -> Result<Imported, FormatError> {
    let keys = Keys::read(&spec.bytes)?;
    let picture = spec.companion(Path::new(&keys.image)).ok_or_else(|| FormatError::Companion {
        file: shown(keys.image.as_bytes()),
        reason: "it is not at hand".to_owned(),
    })?;
    let cell_m = spec.cell_m.unwrap_or(keys.resolution_m);
    let times = libm::round(cell_m / keys.resolution_m);
    if !(times >= 1.0 && (cell_m - times * keys.resolution_m).abs() <= 1e-9 * cell_m) {
        return Err(FormatError::CellLength { stored: keys.resolution_m, asked: cell_m });
    }
    let pixels_per_cell = times as u32;
    let height_cells = libm::round(HEIGHT_M / cell_m).clamp(1.0, f64::from(HEIGHT_CELLS_MAX)) as u32;
    let height = spec.options.height_cells.unwrap_or(height_cells);
    let extent = |[x, y]: [u32; 2]| {
        let size = [x.div_ceil(pixels_per_cell), y.div_ceil(pixels_per_cell), height + 2];
        Extent::new(size, cell_m).map_err(|reason| match reason {
            reason @ voxels::ExtentError::Size { .. } => {
                let advice = format!("choose longer ones, a multiple of {} m (--cell-m)", keys.resolution_m);
                FormatError::Box { reason, cell_m, advice }
            }
            reason => FormatError::Extent(reason),
        })
    };
    let picture = Picture::read(picture, Rows::AsStored, |size| extent(size).map(|_| ()))
        .map_err(|reason| FormatError::Companion { file: shown(keys.image.as_bytes()), reason: reason.to_string() })?;
    let unknown_greys = keys.unknown_greys(&picture);
    let ground: Vec<Ground> =
        picture.pixels.iter().map(|&pixel| keys.ground(pixel, &picture, &unknown_greys)).collect();
    let count = |wanted: Ground| ground.iter().filter(|&&pixel| pixel == wanted).count();
    let unknown = spec.options.unknown.unwrap_or(Kind::Wall);
    let (unknown, becomes) = match unknown {
        Kind::Wall => (Terrain::Wall, "wall"),
        Kind::Free => (Terrain::Free, "free"),
    };
    let text = format!(
        "{} occupied, {} free, {} unknown, which become {becomes}",
        count(Ground::Occupied),
        count(Ground::Free),
        count(Ground::Unknown)
    );
    let mut notes = vec![Note::new("pixels", text)];
    let image = Path::new(&keys.image);
    if image.components().any(|part| !matches!(part, Component::Normal(_) | Component::CurDir)) {
        let text = format!("{}, which does not lie below the folder of the file", shown(keys.image.as_bytes()));
        notes.push(Note::new("image", text));
    }
    notes.extend(keys.note_of_grey(&picture, &unknown_greys));
    notes.extend(keys.warning_of_greys(&picture, &unknown_greys));
    notes.extend(picture.note());
    notes.push(Note::new("height", format!("{height} cells from floor to ceiling")));
    let plan = Plan { extent: extent([picture.width, picture.height])?, width: picture.width, pixels_per_cell, ground };
    let closed = plan.extent;
    let mut imported = plan.map(spec, unknown, notes)?;
    // A layer around an open map moves its corner.
    let layers = f64::from((imported.terrain.extent().size()[0] - closed.size()[0]) / 2);
    let [x, y, yaw_rad] = keys.origin;
    let origin = if layers > 0.0 { [x - layers * cell_m, y - layers * cell_m] } else { [x, y] };
    imported.origin_m = Some([origin[0], origin[1], -(1.0 + layers) * cell_m]);
    imported.yaw_rad = yaw_rad;
    let turned = if yaw_rad == 0.0 { String::new() } else { format!(", turned by {yaw_rad} rad about it") };
    let text = format!("the map begins at ({}, {}, 0) m of the file{turned}", origin[0], origin[1]);
    imported.notes.push(Note::new("origin", text));
    imported.stores_cell_m = cell_m == keys.resolution_m;
    Ok(imported)
}

impl Keys {
    /// What a pixel says, as the map server reads it, save for the grey of unknown cells.
    fn ground(&self, pixel: Pixel, picture: &Picture, unknown_greys: &Greys) -> Ground {
        if unknown_greys.contains(&self.grey(pixel, picture)) {
            Ground::Unknown
        } else {
            self.by_thresholds(pixel, picture)
        }
    }

    /// The greys of unknown cells: the one that `map_saver` writes, and those that compression
    /// makes of it.
    fn unknown_greys(&self, picture: &Picture) -> Greys {
        let is_near = |pixel: &&Pixel| (self.grey(**pixel, picture) - GREY_OF_UNKNOWN).abs() <= NEAR;
        let least = SHARE_OF_UNKNOWN * picture.pixels.len() as f64;
        let has_unknown = || picture.pixels.iter().filter(is_near).count() as f64 >= least;
        match self.mode {
            Mode::Trinary if picture.is_lossy && has_unknown() => NEAR_UNKNOWN,
            Mode::Trinary => GREY_OF_UNKNOWN..=GREY_OF_UNKNOWN,
            // No grey is in it.
            Mode::Scale | Mode::Raw => 1.0..=0.0,
        }
    }

    /// The grey of a pixel, of 255, or its negative in a negated picture.
    fn grey(&self, pixel: Pixel, picture: &Picture) -> f64 {
        let maximum = f64::from(picture.maximum);
        let brightness = f64::from(pixel.brightness);
        (if self.negate { maximum - brightness } else { brightness }) * 255.0 / maximum
    }

    /// What a pixel says by the thresholds.
    fn by_thresholds(&self, pixel: Pixel, picture: &Picture) -> Ground {
        let [brightness, alpha] =
            [pixel.brightness, pixel.alpha].map(|part| f64::from(part) / f64::from(picture.maximum));
        let occupied = |shade: f64| if self.negate { shade } else { 1.0 - shade };
        let occupied = match self.mode {
            // Transparency counts as one more colour.
            Mode::Trinary if picture.has_alpha => occupied((3.0 * brightness + alpha) / 4.0),
            Mode::Trinary => occupied(brightness),
            Mode::Scale if alpha < 1.0 => return Ground::Unknown,
            Mode::Scale => occupied(brightness),
            // Values of 0 to 100 are the occupancy itself, others are unknown, and nothing is
            // negated.
            Mode::Raw => match libm::round(brightness * 255.0) {
                percent if percent <= 100.0 => percent / 100.0,
                _ => return Ground::Unknown,
            },
        };
        if occupied > self.occupied_thresh {
            Ground::Occupied
        } else if occupied < self.free_thresh || (self.mode == Mode::Raw && occupied == 0.0) {
            Ground::Free
        } else if self.mode == Mode::Scale {
            self.between_thresholds(occupied)
        } else {
            Ground::Unknown
        }
    }

    /// What the map server makes of an occupancy between the thresholds in mode `scale`: whole
    /// percent of the way, of which the first and the last are free and occupied.
    fn between_thresholds(&self, occupied: f64) -> Ground {
        let share = (occupied - self.free_thresh) / (self.occupied_thresh - self.free_thresh);
        match libm::rint(share * 100.0) {
            0.0 => Ground::Free,
            100.0 => Ground::Occupied,
            _ => Ground::Unknown,
        }
    }

    /// A note on pixels of the grey of unknown cells that the thresholds take for something else.
    fn note_of_grey(&self, picture: &Picture, unknown_greys: &Greys) -> Option<Note> {
        let greys = picture.pixels.iter().filter(|&&pixel| unknown_greys.contains(&self.grey(pixel, picture)));
        let grounds = greys.map(|&pixel| self.by_thresholds(pixel, picture));
        let (mut count, mut becomes) = (0, "free");
        for ground in grounds.filter(|&ground| ground != Ground::Unknown) {
            count += 1;
            if ground == Ground::Occupied {
                becomes = "occupied";
            }
        }
        let grey = if self.negate { 255.0 - GREY_OF_UNKNOWN } else { GREY_OF_UNKNOWN };
        let near = if picture.is_lossy { " or near it, as JPEG makes it" } else { "" };
        let text = format!(
            "{count} pixels of grey {grey}{near}, which map_saver writes for unknown cells; the thresholds alone would make \
             them {becomes}, and do with mode: scale"
        );
        (count > 0).then(|| Note::new("unknown", text))
    }

    /// A warning of greys almost that of unknown cells, of many pixels that the thresholds make
    /// free.
    fn warning_of_greys(&self, picture: &Picture, unknown_greys: &Greys) -> Option<Note> {
        let is_suspicious = |&&pixel: &&Pixel| {
            let grey = self.grey(pixel, picture);
            (grey - GREY_OF_UNKNOWN).abs() <= SUSPICIOUS
                && !unknown_greys.contains(&grey)
                && self.by_thresholds(pixel, picture) == Ground::Free
        };
        let greys = picture.pixels.iter().filter(is_suspicious).map(|&pixel| self.grey(pixel, picture));
        let (count, lightest) = greys.fold((0_u64, 0.0), |(count, lightest), grey| (count + 1, grey.max(lightest)));
        let is_much = self.mode == Mode::Trinary && count as f64 > SHARE_OF_UNKNOWN * picture.pixels.len() as f64;
        is_much.then(|| {
            // Whole percent below the occupancy of the lightest, which is rounded either way.
            let thresh = libm::floor((254.999 - lightest) / 2.55) / 100.0;
            let text = format!(
                "{count} pixels are free whose grey is almost that of unknown cells ({GREY_OF_UNKNOWN}): if the picture was \
                 scaled or edited, free_thresh: {thresh} in the file makes them unknown"
            );
            Note::warning("grey", text)
        })
    }
}

#[cfg(test)]
mod tests;
