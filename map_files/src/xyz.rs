//! Point clouds as text (`.xyz`): a point in each line, its coordinates first, with spaces, commas
//! or semicolons between them.
//!
//! Empty lines, comments (`#`, `//`) and a first line without three numbers (a header, or the
//! number of points) are skipped.

use super::bytes::{Bytes, shown};
use super::cloud::{self, Sensors};
use super::{FormatError, ImportSpec, Imported, MapReader};

/// Points as text.
pub(super) const READER: MapReader = MapReader::new("points as text", &["xyz"], cloud::OPTIONS, read);

/// A map of a text file of points.
///
/// # Errors
/// If a line is no point, or the points do not fit into a map.
pub(super) fn read(spec: &ImportSpec) -> Result<Imported, FormatError> {
    let mut points = Vec::new();
    let mut text = Bytes::new(&spec.bytes);
    let mut is_first = true;
    while let Some((line, content)) = text.line() {
        let content = content.trim_ascii();
        if content.is_empty() || content.starts_with(b"#") || content.starts_with(b"//") {
            continue;
        }
        match point(content) {
            Some(point) => points.push(point),
            None if is_first => {}
            None => {
                return Err(FormatError::line(line, format!("{} does not begin with three numbers", shown(content))));
            }
        }
        is_first = false;
    }
    cloud::map(spec, &points, &Sensors::None, Vec::new())
}

fn point(line: &[u8]) -> Option<[f64; 3]> {
    let is_between = |byte: &u8| byte.is_ascii_whitespace() || matches!(byte, b',' | b';');
    let mut words = line.split(is_between).filter(|word| !word.is_empty());
    let mut along = || str::from_utf8(words.next()?).ok()?.parse().ok();
    Some([along()?, along()?, along()?])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_points() {
        let text = "x,y,z,red\n# a comment\n0.5,0.5,0.5,9\n\n2.5;0.5; 0.5\n// more\n 0.5\t2.5 0.5 1 2 3\n";
        let terrain = read(&ImportSpec::new("a.xyz", text.into())).unwrap().terrain;
        assert_eq!(terrain.extent().size(), [5, 5, 3]);
        assert_eq!(mapgen::free_cells(&terrain), 9 - 3);
        let error = read(&ImportSpec::new("a.xyz", "1 2 3\n4 5\n".into())).unwrap_err().to_string();
        let marked = format!("\u{feff}{}", text.split_once('\n').unwrap().1);
        assert_eq!(read(&ImportSpec::new("a.xyz", marked.into())).unwrap().terrain, terrain);
        let only = |text: &str| read(&ImportSpec::new("a.xyz", text.into())).unwrap().terrain.extent().size();
        assert_eq!(only("\u{feff}0.5 0.5 0.5\n4.5 0.5 0.5\n"), [7, 3, 3], "the first line counts");
        assert_eq!(error, "line 2: \"4 5\" does not begin with three numbers");
    }
}
