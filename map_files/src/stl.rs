//! Meshes of triangles in the STL format, ascii and binary.
//!
//! A file is binary if it is long enough for its number of triangles, whatever it begins with; a
//! text has a number there that no file is long enough for. Words of a text may be in capitals.

use super::bytes::{BYTE_ORDER_MARK, Bytes, shown, three, words};
use super::mesh::{self, Mesh};
use super::{FormatError, ImportSpec, Imported, MapReader, Note, cell_length};

/// A mesh of triangles.
pub(super) const READER: MapReader = MapReader {
    stored_cell_m: Some(cell_length::in_title),
    ..MapReader::new("mesh of triangles", &["stl"], mesh::OPTIONS, read)
};

/// Bytes before the triangles of a binary file, and of each triangle.
const HEADER: usize = 84;
const TRIANGLE: usize = 50;

/// A map of an STL file.
///
/// # Errors
/// If the file is malformed, or its mesh does not fit into a map.
pub(super) fn read(spec: &ImportSpec) -> Result<Imported, FormatError> {
    let (mesh, notes) = parse(&spec.bytes)?;
    mesh::map(spec, &mesh, notes)
}

/// The mesh of a file, with notes.
///
/// # Errors
/// If the file is malformed.
pub(super) fn parse(bytes: &[u8]) -> Result<(Mesh, Vec<Note>), FormatError> {
    let text = bytes.strip_prefix(BYTE_ORDER_MARK).unwrap_or(bytes).trim_ascii_start();
    let begins_as_text = text.get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"solid"));
    let is_text = begins_as_text && !bytes[..bytes.len().min(HEADER)].contains(&0);
    let mut notes = Vec::new();
    let mesh = match binary_length(bytes) {
        Some(length) if length <= bytes.len() as u64 => {
            let (triangles, rest) = bytes[HEADER..].split_at(length as usize - HEADER);
            if !rest.is_empty() {
                notes.push(Note::new("ignored", format!("{} bytes after the last triangle", rest.len())));
            }
            binary(triangles)
        }
        _ if is_text => ascii(bytes)?,
        Some(_) if is_other_text(bytes) => {
            let reason = "a text that does not begin with solid; save it as STL, as bytes or as text of UTF-8";
            return Err(FormatError::line(1, reason));
        }
        Some(length) => {
            let reason =
                format!("the file ends here, expected length {length} bytes, or a text that begins with solid");
            return Err(FormatError::byte(bytes.len(), reason));
        }
        None => return Err(FormatError::byte(bytes.len(), "the file ends within its header of 84 bytes")),
    };
    Ok((mesh, notes))
}

/// Whether the header of a binary file is a text to its end, or one of UTF-16: no number of
/// triangles.
fn is_other_text(bytes: &[u8]) -> bool {
    let is_letter = |byte: &u8| byte.is_ascii_graphic() || byte.is_ascii_whitespace();
    let header = &bytes[..bytes.len().min(HEADER)];
    header.iter().all(is_letter) || header.starts_with(&[0xff, 0xfe]) || header.starts_with(&[0xfe, 0xff])
}

/// The length that a binary file with this header has.
fn binary_length(bytes: &[u8]) -> Option<u64> {
    let count = bytes.get(HEADER - 4..HEADER)?;
    let count = u32::from_le_bytes([count[0], count[1], count[2], count[3]]);
    Some(HEADER as u64 + u64::from(count) * TRIANGLE as u64)
}

fn binary(triangles: &[u8]) -> Mesh {
    let mut mesh = Mesh::default();
    for triangle in triangles.chunks_exact(TRIANGLE) {
        let float = |at: usize| f32::from_le_bytes([0, 1, 2, 3].map(|byte| triangle[at + byte]));
        // The normal comes first and is ignored: it follows from the order of the corners.
        let corners = [12, 24, 36].map(|at| [0, 4, 8].map(|along| f64::from(float(at + along))));
        mesh.add(corners);
    }
    mesh
}

fn ascii(bytes: &[u8]) -> Result<Mesh, FormatError> {
    let mut mesh = Mesh::default();
    let mut corners = Vec::new();
    let mut text = Bytes::new(bytes);
    while let Some((line, content)) = text.line() {
        let mut words = words(content);
        let key = words.next().map(<[u8]>::to_ascii_lowercase);
        match key.as_deref() {
            Some(b"vertex") => corners.push(three(line, &mut words, "a coordinate")?),
            Some(b"endloop") => {
                let corners = std::mem::take(&mut corners);
                let count = corners.len();
                let triangle = corners.try_into();
                mesh.add(
                    triangle.map_err(|_| FormatError::line(line, format!("a loop of {count} vertices, expected 3")))?,
                );
            }
            None | Some(b"solid" | b"facet" | b"outer" | b"endfacet" | b"endsolid" | b"end") => {}
            Some(word) => return Err(FormatError::line(line, format!("{} is no key of an STL file", shown(word)))),
        }
        if corners.len() > 3 {
            return Err(FormatError::line(line, "a loop of more than 3 vertices, expected 3"));
        }
    }
    Ok(mesh)
}

#[cfg(test)]
mod tests {
    use super::*;

    const TRIANGLE_TEXT: &str = "solid of no use\n facet normal 0 0 1\n  outer loop\n   vertex 0 0 0.5\n   vertex 2 0 0.5\n   \
                                 vertex 0 2e0 0.5\n  endloop\n endfacet\nendsolid\n";

    fn shell(bytes: Vec<u8>) -> ImportSpec {
        let options = super::super::ImportOptions { fill: Some(crate::options::Fill::Shell), ..Default::default() };
        ImportSpec { options, ..ImportSpec::new("a.stl", bytes) }
    }

    #[test]
    fn both_kinds_say_the_same() {
        let ascii = read(&shell(TRIANGLE_TEXT.into())).unwrap();
        let floats = [0.0f32, 0.0, 1.0, 0.0, 0.0, 0.5, 2.0, 0.0, 0.5, 0.0, 2.0, 0.5];
        let triangle: Vec<u8> = floats.iter().flat_map(|float| float.to_le_bytes()).chain([0, 0]).collect();
        let mut header = b"solid, and binary all the same".to_vec();
        header.resize(80, b' ');
        let binary_file = [header, vec![1, 0, 0, 0], triangle].concat();
        let binary = read(&shell(binary_file.clone())).unwrap();
        assert_eq!(ascii, binary);
        let trailing = read(&shell([binary_file, b"\nendsolid".to_vec()].concat())).unwrap();
        assert_eq!(trailing.terrain, binary.terrain);
        assert!(trailing.notes.iter().any(|note| note.text == "9 bytes after the last triangle"));
        let capitals = TRIANGLE_TEXT.to_ascii_uppercase();
        for text in [
            capitals.clone(),
            capitals.replace("ENDSOLID", "END SOLID"),
            format!("\u{feff}{capitals}"),
            format!("\r\n  {TRIANGLE_TEXT}"),
        ] {
            assert_eq!(read(&shell(text.into())).unwrap(), ascii);
        }
        assert!(mapgen::free_cells(&ascii.terrain) < ascii.terrain.extent().volume() as u64);
    }

    #[test]
    fn errors_name_the_place() {
        let refuse = |bytes: &[u8]| read(&shell(bytes.to_vec())).unwrap_err().to_string();
        assert_eq!(refuse(b"x"), "byte 1: the file ends within its header of 84 bytes");
        assert!(
            refuse(&[1; 90]).starts_with("byte 90: the file ends here, expected length 842150534 bytes, or a text")
        );
        let other = "line 1: a text that does not begin with solid; save it";
        assert!(refuse(format!("; a comment\n{TRIANGLE_TEXT}").as_bytes()).starts_with(other));
        let wide: Vec<u8> = format!("\u{feff}{TRIANGLE_TEXT}").encode_utf16().flat_map(u16::to_le_bytes).collect();
        assert!(refuse(&wide).starts_with(other));
        assert_eq!(refuse(b"solid\nvertex 1 2\n"), "line 2: a coordinate is missing");
        assert_eq!(refuse(b"solid\nvertex 1 2 3\nendloop\n"), "line 3: a loop of 1 vertices, expected 3");
        assert_eq!(refuse(b"solid\nvortex\n"), "line 2: \"vortex\" is no key of an STL file");
        assert_eq!(refuse(b"solid\nendsolid\n"), "the file has no triangle");
    }
}
