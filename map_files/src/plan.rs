//! Floor plans: pictures in grey, and the maps of ROS 2's map server (`map.yaml` with a picture).
//!
//! A pixel is a column of cells of one kind, from floor to ceiling. The first row of the picture
//! has the highest y.

use std::borrow::Cow;
use std::collections::BTreeSet;
use std::ops::RangeInclusive;
use std::path::{Component, Path, PathBuf};

use voxels::{Cell, Extent, Terrain};

use super::bytes::shown;
use super::options::{HEIGHT_CELLS, Kind, THRESHOLD};
use super::picture::{Picture, Pixel, Rows, Summary, White};
use super::{FormatError, ImportSpec, Imported, MapReader, Note, new_grid, surrounded};

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

/// The names of the keys that are read.
const OF_THE_SERVER: [&str; 7] = ["image", "resolution", "origin", "occupied_thresh", "free_thresh", "negate", "mode"];

/// The keys of a `map.yaml` of the map server.
struct Keys {
    image: String,
    resolution_m: f64,
    /// Place of the lower left corner, metres, and the turn about it, radians.
    origin: [f64; 3],
    occupied_thresh: f64,
    free_thresh: f64,
    negate: bool,
    mode: Mode,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Mode {
    Trinary,
    Scale,
    Raw,
}

/// The file with the picture of a `map.yaml`, relative to its folder.
///
/// # Errors
/// If the file is malformed.
pub(super) fn image(bytes: &[u8]) -> Result<PathBuf, FormatError> {
    Ok(PathBuf::from(keys(bytes)?.image))
}

/// The resolution of a `map.yaml`, metres.
pub(super) fn resolution_m(bytes: &[u8]) -> Option<f64> {
    Some(keys(bytes).ok()?.resolution_m)
}

/// A map of a `map.yaml`, whose picture is the companion of the file.
///
/// # Errors
/// If one of the files is malformed, or too large for a map.
pub(super) fn read_yaml(spec: &ImportSpec) -> Result<Imported, FormatError> {
    let keys = keys(&spec.bytes)?;
    let picture = image(&spec.bytes).ok().and_then(|name| spec.companion(&name)).ok_or_else(|| {
        FormatError::Companion { file: shown(keys.image.as_bytes()), reason: "it is not at hand".to_owned() }
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

/// The keys of a file: flat YAML, as the map server and its tools write it. What is indented
/// belongs to another key, save the numbers of `origin`.
fn keys(bytes: &[u8]) -> Result<Keys, FormatError> {
    let text = str::from_utf8(bytes).map_err(|error| FormatError::Utf8(error.valid_up_to()))?;
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let mut image = None;
    let mut resolution_m = None;
    let mut origin: Option<Vec<f64>> = None;
    let (mut occupied_thresh, mut free_thresh, mut negate, mut mode) = (0.65, 0.25, false, Mode::Trinary);
    let mut is_list = false;
    let mut seen = BTreeSet::new();
    let mut least = None;
    let mut lines = in_lines(text).into_iter();
    while let Some((at, line)) = lines.next() {
        let mut line = Cow::Borrowed(without_comment(&line).trim_end());
        if line.is_empty() || line == "---" || line == "..." || line.starts_with('%') {
            continue;
        }
        let indentation = line.len() - line.trim_start().len();
        let is_nested = indentation > *least.get_or_insert(indentation);
        // A list in brackets may go on in the next lines.
        if !is_nested && line.contains('[') && !line.contains(']') {
            let mut joined = line.into_owned();
            for (_, more) in lines.by_ref() {
                let more = without_comment(&more).trim();
                joined.push(' ');
                joined.push_str(more);
                if more.contains(']') {
                    break;
                }
            }
            line = Cow::Owned(joined);
        }
        let line = line.as_ref();
        let wrong = |what: &str, value: &str, expected: &str| {
            FormatError::line(at, format!("{what} is {}, expected {expected}", shown(value.as_bytes())))
        };
        let number = |what: &str, value: &str| {
            let number: Option<f64> = value.trim().parse().ok().filter(|number: &f64| number.is_finite());
            number.ok_or_else(|| wrong(what, value, "a number"))
        };
        if let (true, Some(item)) = (is_list, line.trim_start().strip_prefix('-').filter(|item| item.starts_with(' ')))
        {
            origin.get_or_insert_default().push(number("origin", item)?);
            continue;
        }
        if is_list && is_nested {
            return Err(wrong("origin", line.trim(), "[x, y, yaw] on the line of its key, or an item on each line"));
        }
        // Of other keys, list items need no indentation.
        if is_nested || line.trim_start().starts_with('-') {
            continue;
        }
        is_list = false;
        if line.trim_start().starts_with('{') {
            return Err(FormatError::line(
                at,
                "braces are read around the whole file only; write one key on each line",
            ));
        }
        let (key, value) = line.split_once(':').ok_or_else(|| wrong("a line", line, "KEY: VALUE"))?;
        let (key, plain) = (unquoted(key.trim()), value.trim());
        let value = unquoted(plain);
        if OF_THE_SERVER.contains(&key) && !seen.insert(key.to_owned()) {
            return Err(FormatError::line(at, format!("{key} is given twice; leave out one of them")));
        }
        if OF_THE_SERVER.contains(&key) && plain.starts_with(['>', '|', '&', '*', '!']) {
            return Err(wrong(key, value, "the value itself, on the line of its key"));
        }
        match key {
            "image" => image = Some(value.to_owned()).filter(|value| !value.is_empty()),
            "resolution" => {
                let metres = number("resolution", value)?;
                Extent::new([1; 3], metres).map_err(|reason| FormatError::line(at, reason.to_string()))?;
                resolution_m = Some(metres);
            }
            "origin" if value.is_empty() => is_list = true,
            "origin" => {
                let items = value.strip_prefix('[').and_then(|value| value.strip_suffix(']'));
                let items = items.ok_or_else(|| wrong("origin", value, "[x, y, yaw]"))?;
                // A comma may stand behind the last one.
                let items = items.trim_end().strip_suffix(',').unwrap_or(items);
                origin = Some(items.split(',').map(|item| number("origin", item)).collect::<Result<_, _>>()?);
            }
            "occupied_thresh" => occupied_thresh = number("occupied_thresh", value)?,
            "free_thresh" => free_thresh = number("free_thresh", value)?,
            "negate" => {
                negate = match value {
                    "0" | "false" | "False" | "FALSE" | "no" | "No" | "NO" | "off" | "Off" | "OFF" => false,
                    "1" | "true" | "True" | "TRUE" | "yes" | "Yes" | "YES" | "on" | "On" | "ON" => true,
                    _ => return Err(wrong("negate", value, "0 or 1")),
                }
            }
            "mode" => {
                mode = match value.to_ascii_lowercase().as_str() {
                    "trinary" => Mode::Trinary,
                    "scale" => Mode::Scale,
                    "raw" => Mode::Raw,
                    _ => return Err(wrong("mode", value, "trinary, scale or raw")),
                }
            }
            // The map server ignores others as well, such as those of map_saver's versions.
            _ => {}
        }
    }
    let origin = origin.ok_or(FormatError::Nothing("key origin"))?;
    let count = origin.len();
    let origin: [f64; 3] = origin.try_into().map_err(|_| FormatError::Entry {
        place: "origin".to_owned(),
        reason: format!("{count} numbers, expected [x, y, yaw]"),
    })?;
    if !(0.0..=1.0).contains(&free_thresh) || !(free_thresh..=1.0).contains(&occupied_thresh) {
        return Err(FormatError::Entry {
            place: "occupied_thresh".to_owned(),
            reason: format!(
                "{occupied_thresh}, with free_thresh = {free_thresh}: expected 0 <= free_thresh <= occupied_thresh <= 1"
            ),
        });
    }
    Ok(Keys {
        image: image.ok_or(FormatError::Nothing("key image"))?,
        resolution_m: resolution_m.ok_or(FormatError::Nothing("key resolution"))?,
        origin,
        occupied_thresh,
        free_thresh,
        negate,
        mode,
    })
}

/// The lines of a text with their numbers, a key on each: without the braces around flow style and
/// JSON, and whatever ends a line.
fn in_lines(text: &str) -> Vec<(usize, Cow<'_, str>)> {
    let lines = || text.split('\n').flat_map(|line| line.strip_suffix('\r').unwrap_or(line).split('\r')).zip(1..);
    if !text.trim_start().starts_with('{') || !text.trim_end().ends_with('}') {
        return lines().map(|(line, at)| (at, Cow::Borrowed(line))).collect();
    }
    let (mut depth, mut quote, mut entry) = (0u32, None, String::new());
    let mut entries = Vec::new();
    for (line, at) in lines() {
        // Lines mean nothing here.
        for character in without_comment(line).chars().chain([' ']) {
            let outer = depth;
            match (quote, character) {
                (Some(open), _) if open == character => quote = None,
                (None, '"' | '\'') => quote = Some(character),
                (None, '[' | '{') => depth += 1,
                (None, ']' | '}') => depth = depth.saturating_sub(1),
                _ => {}
            }
            let is_brace = quote.is_none() && outer + depth == 1;
            if is_brace || (quote.is_none() && depth == 1 && character == ',') {
                entries.push((at, Cow::Owned(std::mem::take(&mut entry).trim().to_owned())));
            } else {
                entry.push(character);
            }
        }
    }
    entries
}

/// A line up to its comment, which begins at `#` after a space or at the start of the line.
fn without_comment(line: &str) -> &str {
    let is_start = |&(at, _): &(usize, &str)| at == 0 || line[..at].ends_with([' ', '\t']);
    line.match_indices('#').find(is_start).map_or(line, |(at, _)| &line[..at])
}

fn unquoted(value: &str) -> &str {
    let quoted = |quote: char| value.strip_prefix(quote).and_then(|value| value.strip_suffix(quote));
    quoted('"').or_else(|| quoted('\'')).unwrap_or(value)
}

#[cfg(test)]
mod tests;
