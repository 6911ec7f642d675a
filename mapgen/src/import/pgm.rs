//! Floor plans as portable grey maps (PGM): P2 in text and P5 in bytes.
//!
//! A pixel is a column of cells of one kind, from floor to ceiling. The first row of the image
//! has the highest y.

use voxels::{Cell, Extent, Terrain};

use super::bytes::{shown, words};
use super::options::{HEIGHT_CELLS, THRESHOLD};
use super::{FormatError, ImportSpec, Imported, Note, new_grid, surrounded};

/// The largest maximum grey value that the format allows.
const MAXIMUM: u32 = 65535;

/// A map of a PGM file.
///
/// # Errors
/// If the file is malformed, or too large for a map.
pub(super) fn read(spec: &ImportSpec) -> Result<Imported, FormatError> {
    let options = &spec.options;
    let height = options.height_cells.unwrap_or(HEIGHT_CELLS);
    let mut tokens = Tokens { bytes: &spec.bytes, at: 0 };
    let is_text = match tokens.next("P2 or P5")? {
        (_, b"P2") => true,
        (_, b"P5") => false,
        (at, word) => {
            return Err(FormatError::byte(at, format!("the file begins with {}, expected P2 or P5", shown(word))));
        }
    };
    let (size_x, size_y) = (tokens.number("the width", u32::MAX)?, tokens.number("the height", u32::MAX)?);
    let maximum = tokens.number("the largest brightness", MAXIMUM)?;
    if maximum == 0 {
        return Err(FormatError::byte(tokens.at, format!("the largest brightness is 0, allowed is 1 to {MAXIMUM}")));
    }
    let extent = Extent::new([size_x, size_y, height + 2], spec.cell_m.unwrap_or(1.0)).map_err(FormatError::Extent)?;
    let pixels = (size_x * size_y) as usize;
    let brightness = if is_text {
        // A number and its separator.
        let room = (spec.bytes.len() - tokens.at).div_ceil(2);
        if room < pixels {
            return Err(FormatError::byte(
                spec.bytes.len(),
                format!("the file ends here, {pixels} pixels do not fit in"),
            ));
        }
        (0..pixels).map(|_| tokens.number("a pixel", maximum)).collect::<Result<Vec<u32>, _>>()?
    } else {
        raster(&spec.bytes, tokens.at + 1, pixels, maximum)?
    };

    let threshold = options.threshold.unwrap_or(THRESHOLD);
    let is_free = |pixel: u32| f64::from(pixel) >= threshold * f64::from(maximum);
    let mut terrain = new_grid(extent, Terrain::Wall, spec.cells_max)?;
    let mut free = 0;
    for (number, &pixel) in brightness.iter().enumerate() {
        if is_free(pixel) {
            free += 1;
            let (x, row) = (number % size_x as usize, number / size_x as usize);
            for z in 1..=height {
                terrain.set(Cell::new(x as i32, size_y as i32 - 1 - row as i32, z as i32), Terrain::Free);
            }
        }
    }
    let text = format!("{free} free, {} wall, as bright as {threshold} of {maximum} is free", pixels - free);
    let mut notes = vec![Note::new("pixels", text)];
    // Floor and ceiling are closed; the sides may be open.
    let (terrain, closed) = surrounded(terrain, spec.cells_max)?;
    notes.extend(closed);
    Ok(Imported { terrain, notes, stores_cell_m: false })
}

/// The pixels of a binary file, of one byte or, beyond 255, two.
fn raster(bytes: &[u8], start: usize, pixels: usize, maximum: u32) -> Result<Vec<u32>, FormatError> {
    let width = if maximum > 255 { 2 } else { 1 };
    let expected = start + pixels * width;
    let Some(data) = bytes.get(start..expected) else {
        return Err(FormatError::byte(bytes.len(), format!("the file ends here, expected length {expected} bytes")));
    };
    let pixel = |bytes: &[u8]| bytes.iter().fold(0, |pixel, &byte| pixel << 8 | u32::from(byte));
    let brightness: Vec<u32> = data.chunks_exact(width).map(pixel).collect();
    match brightness.iter().position(|&pixel| pixel > maximum) {
        Some(place) => {
            let reason = format!("a pixel is {}, allowed is 0 to {maximum}", brightness[place]);
            Err(FormatError::byte(start + place * width, reason))
        }
        None => Ok(brightness),
    }
}

/// The words of the header and of ascii data, without comments.
struct Tokens<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Tokens<'a> {
    /// The next word and its position.
    fn next(&mut self, what: &str) -> Result<(usize, &'a [u8]), FormatError> {
        loop {
            let rest = &self.bytes[self.at..];
            self.at += rest.iter().take_while(|byte| byte.is_ascii_whitespace()).count();
            let rest = &self.bytes[self.at..];
            if rest.first() == Some(&b'#') {
                self.at += rest.iter().take_while(|&&byte| byte != b'\n').count();
                continue;
            }
            let end = rest.iter().position(|byte| byte.is_ascii_whitespace()).unwrap_or(rest.len());
            let Some(word) = words(&rest[..end]).next() else {
                return Err(FormatError::byte(self.at, format!("the file ends here, before {what}")));
            };
            let at = self.at;
            self.at += end;
            return Ok((at, word));
        }
    }

    /// The next word as a number.
    fn number(&mut self, what: &str, largest: u32) -> Result<u32, FormatError> {
        let (at, word) = self.next(what)?;
        let number = str::from_utf8(word).ok().and_then(|word| word.parse().ok());
        number.filter(|&number| number <= largest).ok_or_else(|| {
            FormatError::byte(at, format!("{what} is {}, allowed is a number up to {largest}", shown(word)))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ImportOptions;

    fn spec(bytes: &[u8], height: u32, threshold: Option<f64>) -> ImportSpec {
        let options = ImportOptions { height_cells: Some(height), threshold, ..ImportOptions::default() };
        ImportSpec { options, ..ImportSpec::new("a.pgm", bytes.to_vec()) }
    }

    #[test]
    fn a_pixel_is_a_column_and_the_first_row_is_the_farthest() {
        let text = b"P2 # a plan\n# of two rows\n3 2\n10\n0 9 0\n8 10 0\n";
        let Imported { terrain, notes, .. } = read(&spec(text, 2, None)).unwrap();
        let (wall, layer) = ("#####\n#####\n#####\n#####\n", "#####\n##.##\n##.##\n#####\n");
        // The sides were open; floor and ceiling are there twice then.
        let expected = [wall, wall, layer, layer, wall, wall].join("\n");
        assert_eq!(terrain.to_text(), expected);
        assert_eq!(notes[0].text, "2 free, 4 wall, as bright as 0.9 of 10 is free");
        assert_eq!(notes.len(), 2);
    }
    #[test]
    fn binary_and_ascii_give_the_same_map() {
        let text = read(&spec(b"P2 2 2 255 0 255 127 254", 1, Some(0.5))).unwrap();
        let bytes = read(&spec(b"P5\n2 2 # plan\n255\n\x00\xff\x7f\xfe, and more", 1, Some(0.5))).unwrap();
        let wide = read(&spec(b"P5 2 2 65535 \x00\xff\xff\xff\x7f\x00\xfe\x00", 1, Some(0.5))).unwrap();
        assert_eq!(text, bytes);
        assert_eq!(text.terrain, wide.terrain);
        assert_eq!(crate::free_cells(&text.terrain), 2);
    }

    #[test]
    fn errors_name_the_byte() {
        let refuse = |bytes: &[u8]| read(&spec(bytes, 1, None)).unwrap_err().to_string();
        assert_eq!(refuse(b""), "byte 0: the file ends here, before P2 or P5");
        assert_eq!(refuse(b"P6 1 1"), "byte 0: the file begins with \"P6\", expected P2 or P5");
        assert_eq!(refuse(b"P2 x"), "byte 3: the width is \"x\", allowed is a number up to 4294967295");
        assert_eq!(refuse(b"P2 2000 1 9"), "map size along x is 2000 cells, allowed are 1 to 1024");
        assert_eq!(refuse(b"P2 1 1 0 0"), "byte 8: the largest brightness is 0, allowed is 1 to 65535");
        assert_eq!(refuse(b"P2 1 1 9 10"), "byte 9: a pixel is \"10\", allowed is a number up to 9");
        assert_eq!(refuse(b"P2 1000 1000 9 1"), "byte 16: the file ends here, 1000000 pixels do not fit in");
        assert_eq!(refuse(b"P5 2 1 9 12"), "byte 9: a pixel is 49, allowed is 0 to 9");
        assert_eq!(refuse(b"P5 2 2 9 \x01"), "byte 10: the file ends here, expected length 13 bytes");
    }
}
