//! The length of a cell in formats that have no field for it: `cell_m = 0.5` in the first lines of
//! a file, in a comment where the format has comments.
//!
//! A text map has it as its first line, an OBJ or PCD file in a comment among its first bytes, a
//! binary STL file in its title. For a mesh or a cloud it is a default: points and triangles can be
//! divided into cells of any length.

use std::borrow::Cow;

use voxels::Extent;

use super::FormatError;
use super::bytes::{BYTE_ORDER_MARK, shown};

/// What stands before the number, with an equals sign or a colon between them.
const KEY: &str = "cell_m";

/// Bytes of a file that are searched.
const SEARCHED: usize = 160;

/// Length of the title of a binary STL file.
const STL_TITLE: usize = 80;

/// The length in the first line of a text map, metres; `None` if it has none that is legal.
pub(super) fn in_first_line(bytes: &[u8]) -> Option<f64> {
    after(bytes, KEY.len() + 40, |before| before.trim_matches([' ', '\t']).is_empty())
}

/// The length in a comment that begins a file, metres; `None` if it has none that is legal.
pub(super) fn in_comment(bytes: &[u8]) -> Option<f64> {
    after(bytes, SEARCHED, |before| before.starts_with('#') && !before.contains('\n'))
}

/// The length in the title of a binary STL file, metres; `None` if it has none that is legal.
pub(super) fn in_title(bytes: &[u8]) -> Option<f64> {
    after(bytes, STL_TITLE, |before| !before.contains('\n'))
}

/// The length in the first `searched` bytes, if it stands behind what it may stand behind.
fn after(bytes: &[u8], searched: usize, is_placed: impl Fn(&str) -> bool) -> Option<f64> {
    let bytes = bytes.strip_prefix(BYTE_ORDER_MARK).unwrap_or(bytes);
    let beginning = String::from_utf8_lossy(&bytes[..bytes.len().min(searched)]);
    let (before, after) = beginning.split_once(KEY)?;
    let after = after.trim_start_matches([' ', '\t']).strip_prefix(['=', ':'])?.trim_start_matches([' ', '\t']);
    let number = after.split(|character: char| character.is_whitespace() || [',', ';'].contains(&character)).next()?;
    let length_m = number.parse().ok().filter(|_| is_placed(before))?;
    Extent::new([1; 3], length_m).ok()?;
    Some(length_m)
}

/// A text map without the length in its first line, which stays as an empty one.
///
/// # Errors
/// If the first line is meant to hold a length and holds none that is legal.
pub(super) fn skip(text: &str) -> Result<Cow<'_, str>, FormatError> {
    let (first, rest) = text.split_once('\n').unwrap_or((text, ""));
    let Some(value) = first.trim_start().strip_prefix(KEY) else { return Ok(Cow::Borrowed(text)) };
    if in_first_line(text.as_bytes()).is_none() {
        let value = value.trim().trim_start_matches(['=', ':']).trim_start();
        let reason = format!(
            "cell_m is {}, allowed are finite lengths in metres above 0, written as {KEY} = 0.5",
            shown(value.as_bytes())
        );
        return Err(FormatError::line(1, reason));
    }
    Ok(Cow::Owned(format!("\n{rest}")))
}

/// The first line of a text map: empty for cells of 1 m, which need none.
pub(super) fn line(extent: Extent) -> String {
    let cell_m = extent.cell_m();
    if cell_m == 1.0 { String::new() } else { format!("{KEY} = {cell_m:?}\n") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_legal_lengths_in_their_place_are_read() {
        assert_eq!(in_first_line(b"cell_m = 0.25\n##"), Some(0.25));
        assert_eq!(in_first_line(b"#cell_m = 0.25\n##"), None);
        for first in ["cell_m=0.5", "cell_m =0.5", "cell_m= 0.5 m", "cell_m\t=\t0.5", " cell_m = 0.5\r", "cell_m: 0.5"]
        {
            assert_eq!(in_first_line(format!("{first}\n##\n").as_bytes()), Some(0.5), "{first}");
            assert_eq!(skip(&format!("{first}\n##\n")).unwrap(), "\n##\n", "{first}");
        }
        assert_eq!(in_comment(b"# cell_m=0.5, walls\n"), Some(0.5));
        assert_eq!(in_comment(b"# walls, cell_m = 1e-3\nv 0 0 0"), Some(0.001));
        assert_eq!(in_comment(b"# walls\nv 0 0 0 cell_m = 2"), None);
        assert_eq!(in_title(b"solid walls cell_m = 2.0  "), Some(2.0));
        for wrong in ["-1", "0", "inf", "NaN", "x"] {
            assert_eq!(in_first_line(format!("cell_m = {wrong}\n").as_bytes()), None, "{wrong}");
        }
        assert_eq!(skip("cell_m = 2\n##\n").unwrap(), "\n##\n");
        assert_eq!(skip("##\n").unwrap(), "##\n");
        for (line, value) in [("cell_m = 0", "0"), ("cell_m = -1\r", "-1"), ("cell_m=NaN", "NaN"), ("cell_m", "")] {
            let error = skip(&format!("{line}\n##\n")).unwrap_err().to_string();
            assert!(
                error.starts_with(&format!("line 1: cell_m is \"{value}\", allowed are finite lengths")),
                "{line}: {error}"
            );
        }
        assert_eq!(in_first_line("\u{feff}cell_m = 2\n##\n".as_bytes()), Some(2.0));
    }
}
