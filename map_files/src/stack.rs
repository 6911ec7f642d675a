//! Stacks of pictures: each PNG file of a folder is a layer of cells, as tomography and slicers
//! write them.
//!
//! The last number in a name is that of its layer, the lowest one at the bottom, so that `scan_9`
//! comes before `scan_10`. A pixel is a cell, with the brightness of floor plans; the first row has
//! the highest y.

use voxels::{Cell, Extent, Grid, Terrain};

use super::bytes::shown;
use super::options::THRESHOLD;
use super::picture::{Picture, Rows, Summary, White};
use super::{FormatError, ImportSpec, Imported, MapReader, Note, new_grid, surrounded};

/// A folder of pictures, one for each layer of cells. It is no format of a file.
pub(super) const READER: MapReader =
    MapReader::new("folder of pictures", &["png layer"], &["threshold", "cells_max"], read);

/// A picture with its number and name.
type Layer<'a> = (u64, &'a str, &'a [u8]);

fn error(file: &str, reason: String) -> FormatError {
    FormatError::Layer { file: shown(file.as_bytes()), reason }
}

/// A map of the pictures of a folder.
///
/// # Errors
/// If a name has no number or that of another one, a layer is missing, a picture is malformed or of
/// another size than the first, or the map is too large.
pub(super) fn read(spec: &ImportSpec) -> Result<Imported, FormatError> {
    let mut layers: Vec<Layer<'_>> = Vec::new();
    for (name, bytes) in &spec.layers {
        let number =
            number_of(name).ok_or_else(|| error(name, "expected the number of a layer in its name".to_owned()))?;
        layers.push((number, name, bytes));
    }
    layers.sort();
    check_numbers(&layers)?;
    let threshold = spec.options.threshold.unwrap_or(THRESHOLD);
    let (mut terrain, summary) = terrain_of(spec, &layers, threshold, White::OfFormat)?;
    let white = White::of(&summary, threshold)?;
    if white != White::OfFormat {
        (terrain, _) = terrain_of(spec, &layers, threshold, white)?;
    }
    let free = mapgen::free_cells(&terrain);
    let wall = terrain.extent().volume() as u64 - free;
    let (lowest, highest) = (layers[0].0, layers[layers.len() - 1].0);
    let text = format!(
        "{} from {lowest} to {highest}: {free} free, {wall} wall, as bright as {threshold} is free",
        layers.len()
    );
    let (terrain, closed) = surrounded(terrain)?;
    let notes = [Some(Note::new("layers", text)), white.note(), closed].into_iter().flatten().collect();
    Ok(Imported { terrain, notes, stores_cell_m: false, origin_m: None, yaw_rad: 0.0 })
}

/// Refuses sorted layers with equal numbers or a gap. Every second slice of a scan is a stack, and
/// every second but for one is not.
fn check_numbers(layers: &[Layer<'_>]) -> Result<(), FormatError> {
    let step = layers.windows(2).map(|pair| pair[1].0 - pair[0].0).min().unwrap_or(1);
    for pair in layers.windows(2) {
        let [(below, one, _), (number, other, _)] = [pair[0], pair[1]];
        if below == number {
            return Err(error(other, format!("layer {number} is {} as well", shown(one.as_bytes()))));
        }
        if step > 0 && number - below != step {
            let missing = below + step.min(number - below - 1);
            return Err(error(
                other,
                format!(
                    "layer {missing}, after {}, is missing; add it, or number all in equal steps",
                    shown(one.as_bytes())
                ),
            ));
        }
    }
    Ok(())
}

/// The terrain of sorted layers, and what decides which of their pixels are bright.
fn terrain_of(
    spec: &ImportSpec,
    layers: &[Layer<'_>],
    threshold: f64,
    white: White,
) -> Result<(Grid<Terrain>, Summary), FormatError> {
    let size_z = u32::try_from(layers.len()).unwrap_or(u32::MAX);
    let mut summary = Summary::default();
    let mut map = None;
    for (z, &(_, name, bytes)) in layers.iter().enumerate() {
        let first = map.as_ref().map(|terrain: &Grid<Terrain>| terrain.extent().size());
        let picture = Picture::read(bytes, Rows::AsStored, |[x, y]| match first {
            Some([size_x, size_y, _]) if [size_x, size_y] != [x, y] => {
                Err(FormatError::byte(0, format!("the picture is {x} x {y}, the lowest one {size_x} x {size_y}")))
            }
            Some(_) => Ok(()),
            None => Extent::new([x, y, size_z], spec.length_m()).map(|_| ()).map_err(FormatError::Extent),
        })
        .map_err(|reason| error(name, reason.to_string()))?;
        summary = summary.and(&picture);
        let terrain = match &mut map {
            Some(terrain) => terrain,
            None => {
                let size = [picture.width, picture.height, size_z];
                let extent = Extent::new(size, spec.length_m()).map_err(FormatError::Extent)?;
                map.insert(new_grid(extent, Terrain::Wall, spec)?)
            }
        };
        for (y, row) in picture.pixels.chunks_exact(picture.width as usize).rev().enumerate() {
            for (x, pixel) in row.iter().enumerate() {
                if pixel.is_bright(threshold, white, picture.maximum) {
                    terrain.set(Cell::new(x as i32, y as i32, z as i32), Terrain::Free);
                }
            }
        }
    }
    Ok((map.ok_or(FormatError::Nothing("picture"))?, summary))
}

/// The last number in a name, without its extension.
fn number_of(name: &str) -> Option<u64> {
    let stem = name.rsplit_once('.').map_or(name, |(stem, _)| stem);
    let end = stem.rfind(|character: char| character.is_ascii_digit())? + 1;
    let begin = stem[..end].rfind(|character: char| !character.is_ascii_digit());
    let begin = begin.map_or(0, |at| at + stem[at..].chars().next().map_or(1, char::len_utf8));
    stem[begin..end].parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ImportOptions;

    fn layer(name: &str, pixels: [u8; 4]) -> (String, Vec<u8>) {
        (name.to_owned(), [b"P5 2 2 255 ".as_slice(), &pixels].concat())
    }

    #[test]
    fn layers_are_in_the_order_of_their_numbers() {
        let layers = vec![layer("b_10.png", [0, 0, 0, 255]), layer("c_x9.png", [255, 0, 0, 0])];
        let imported = ImportSpec::stack("scan", layers).read().unwrap();
        let text = imported.terrain.to_text();
        let wall = "####\n".repeat(4);
        assert_eq!(text, format!("{wall}\n####\n#.##\n####\n####\n\n####\n####\n##.#\n####\n\n{wall}"));
        assert_eq!(imported.notes[0].text, "2 from 9 to 10: 2 free, 6 wall, as bright as 0.9 is free");
        assert_eq!(number_of("9é_007.png"), Some(7));
    }

    #[test]
    fn gap_is_refused_and_equal_steps_are_a_stack() {
        let read = |numbers: &[u64]| {
            let layers = numbers.iter().map(|number| layer(&format!("l{number}.png"), [255; 4])).collect();
            ImportSpec::stack("scan", layers).read().map(|imported| imported.terrain.extent().size()[2])
        };
        for whole in [&[0, 1, 2][..], &[7], &[3, 9], &[0, 5, 10, 15]] {
            assert_eq!(read(whole).unwrap() as usize, whole.len() + 2, "{whole:?}");
        }
        for (gap, missing) in [
            (&[0, 1, 3, 4][..], "2, after \"l1.png\""),
            (&[0, 10, 20, 40], "30, after \"l20.png\""),
            (&[0, 10, 11, 12], "1, after \"l0.png\""),
            (&[0, 2, 5], "4, after \"l2.png\""),
        ] {
            let refused = read(gap).unwrap_err().to_string();
            assert!(refused.contains(&format!("layer {missing}, is missing; ")), "{refused}");
        }
    }

    #[test]
    fn brightest_pixel_of_all_layers_is_white() {
        let layers = vec![layer("1.png", [0; 4]), layer("2.png", [0, 1, 1, 0]), layer("3.png", [0; 4])];
        let imported = ImportSpec::stack("scan", layers).read().unwrap();
        assert_eq!(imported.notes[0].text, "3 from 1 to 3: 2 free, 10 wall, as bright as 0.9 is free");
        assert!(imported.notes[1].is_warning, "{:?}", imported.notes);
        let black = ImportSpec::stack("scan", vec![layer("1.png", [0; 4])]).read().unwrap_err().to_string();
        assert_eq!(black, "scan: the file has no pixel that is not black");
    }

    #[test]
    fn errors_name_the_picture() {
        let refuse = |layers| ImportSpec::stack("scan", layers).read().unwrap_err().to_string();
        let one = || layer("1.png", [0; 4]);
        assert_eq!(refuse(vec![layer("a.png", [0; 4])]), "scan: \"a.png\": expected the number of a layer in its name");
        assert_eq!(refuse(vec![one(), layer("a01.png", [0; 4])]), "scan: \"a01.png\": layer 1 is \"1.png\" as well");
        let other = ("2.png".to_owned(), b"P5 1 2 255 aa".to_vec());
        assert_eq!(refuse(vec![one(), other]), "scan: \"2.png\": byte 0: the picture is 1 x 2, the lowest one 2 x 2");
        let cut = ("2.png".to_owned(), b"P5 2 2 255 a".to_vec());
        assert!(refuse(vec![one(), cut]).starts_with("scan: \"2.png\": byte 12: the file ends here"));
        let options = ImportOptions { height_cells: Some(3), ..ImportOptions::default() };
        let error = ImportSpec { options, ..ImportSpec::stack("scan", vec![one()]) }.read().unwrap_err().to_string();
        assert!(error.contains("height_cells is not an option"), "{error}");
    }
}
