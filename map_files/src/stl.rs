//! Meshes of triangles in the STL format, ascii and binary.
//!
//! A file is binary if it is long enough for its number of triangles, whatever it begins with; a
//! text has a number there that no file is long enough for. If whole triangles of another number
//! follow, as programs that write while they count leave them, the length decides. A text is a
//! sequence of words, in capitals or not, whatever its lines; lines that are none of its own are
//! skipped outside of loops.

use super::bytes::{Bytes, in_utf8, shown, three, words};
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

/// Bytes within which a text has its first key.
const BEGINNING: usize = 4096;

/// Largest coordinate, in size, that the rest of a file is taken for triangles with; letters are
/// larger ones.
const LARGEST: f32 = 1e10;

/// A map of an STL file.
///
/// # Errors
/// If the file is malformed, or its mesh does not fit into a map.
pub(super) fn read(spec: &ImportSpec) -> Result<Imported, FormatError> {
    let (mesh, notes) = parse(&spec.bytes)?;
    mesh::map(spec, mesh, notes)
}

/// The mesh of a file, with notes.
///
/// # Errors
/// If the file is malformed.
pub(super) fn parse(bytes: &[u8]) -> Result<(Mesh, Vec<Note>), FormatError> {
    let bytes = &*in_utf8(bytes);
    let mut notes = Vec::new();
    let mesh = match binary_length(bytes) {
        Some(length) if length <= bytes.len() as u64 && !are_triangles(&bytes[length as usize..]) => {
            let (triangles, rest) = bytes[HEADER..].split_at(length as usize - HEADER);
            if !rest.is_empty() {
                notes.push(Note::new("ignored", format!("{} bytes after the last triangle", rest.len())));
            }
            binary(triangles)
        }
        _ if is_text(bytes) => ascii(bytes)?,
        Some(length) if are_triangles(&bytes[HEADER..]) => {
            let [said, had] = [length - HEADER as u64, (bytes.len() - HEADER) as u64].map(|all| all / TRIANGLE as u64);
            let text = format!("the header announces {said} triangles, and the file has {had}, which are read");
            notes.push(Note::warning("count", text));
            binary(&bytes[HEADER..])
        }
        Some(_) if is_other_text(bytes) => {
            let reason = "a text without a line that begins with solid; save it as STL";
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

/// Whether a file is a text of this format: it may have comments first.
fn is_text(bytes: &[u8]) -> bool {
    let beginning = &bytes[..bytes.len().min(BEGINNING)];
    let mut text = Bytes::new(beginning);
    let mut lines = std::iter::from_fn(|| text.line());
    let begins = |line: &[u8]| {
        let key = words(line).next().unwrap_or_default().to_ascii_lowercase();
        key.starts_with(b"solid") || key == b"facet"
    };
    !beginning.contains(&0) && lines.any(|(_, line)| begins(line))
}

/// Whether the rest of a file is one triangle or more, and not zeros or a text.
fn are_triangles(rest: &[u8]) -> bool {
    let is_number = |bytes: &[u8]| f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]).abs() <= LARGEST;
    rest.len().is_multiple_of(TRIANGLE)
        && rest.iter().any(|&byte| byte != 0)
        && rest.chunks_exact(TRIANGLE).all(|triangle| triangle[..TRIANGLE - 2].chunks_exact(4).all(is_number))
}

/// Whether the header of a binary file is a text to its end: no number of triangles.
fn is_other_text(bytes: &[u8]) -> bool {
    let is_letter = |byte: &u8| byte.is_ascii_graphic() || byte.is_ascii_whitespace();
    bytes[..bytes.len().min(HEADER)].iter().all(is_letter)
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

/// The words of a text, with their lines.
struct Words<'a> {
    text: Bytes<'a>,
    line: usize,
    left: &'a [u8],
}

impl<'a> Iterator for Words<'a> {
    type Item = &'a [u8];

    fn next(&mut self) -> Option<&'a [u8]> {
        loop {
            self.left = self.left.trim_ascii_start();
            if !self.left.is_empty() {
                let end = self.left.iter().position(u8::is_ascii_whitespace).unwrap_or(self.left.len());
                let (word, left) = self.left.split_at(end);
                self.left = left;
                return Some(word);
            }
            (self.line, self.left) = self.text.line()?;
        }
    }
}

impl Words<'_> {
    /// Skips a title or a foreign line: up to the next facet in the line, if it is not its end.
    fn skip_line(&mut self) {
        let lower = self.left.to_ascii_lowercase();
        let is_facet = |at: &usize| lower[at + b"facet".len()..].trim_ascii_start().starts_with(b"normal");
        let facet = memchr::memmem::find_iter(&lower, b"facet").find(is_facet);
        self.left = &self.left[facet.unwrap_or(lower.len())..];
    }
}

fn ascii(bytes: &[u8]) -> Result<Mesh, FormatError> {
    let mut mesh = Mesh::default();
    let mut corners: Vec<[f64; 3]> = Vec::new();
    let mut words = Words { text: Bytes::new(bytes), line: 0, left: &[] };
    let (mut is_in_loop, mut is_after_end, mut line) = (false, false, 0);
    while let Some(word) = words.next() {
        let is_first = std::mem::replace(&mut line, words.line) != line;
        let key = word.to_ascii_lowercase();
        let ends = std::mem::take(&mut is_after_end);
        match key.as_slice() {
            b"vertex" => {
                let at = words.line;
                corners.push(three(at, &mut words, "a coordinate")?);
                line = words.line;
                if corners.len() > 3 {
                    return Err(FormatError::line(at, "a loop of more than 3 vertices, expected 3"));
                }
            }
            b"loop" if !ends => is_in_loop = true,
            b"endloop" | b"loop" => {
                is_in_loop = false;
                let count = corners.len();
                let triangle = std::mem::take(&mut corners).try_into();
                let wrong = |_| FormatError::line(line, format!("a loop of {count} vertices, expected 3"));
                mesh.add(triangle.map_err(wrong)?);
            }
            b"end" => is_after_end = true,
            b"outer" | b"facet" | b"endfacet" => {}
            _ if word.starts_with(b"#") => words.skip_line(),
            _ if is_in_loop => {
                return Err(FormatError::line(line, format!("{} is no key of an STL file", shown(word))));
            }
            b"solid" | b"endsolid" => words.skip_line(),
            _ if is_first => words.skip_line(),
            _ => {}
        }
    }
    if !corners.is_empty() {
        let reason = format!("the file ends in a loop of {} vertices, expected 3 and endloop", corners.len());
        return Err(FormatError::line(words.line, reason));
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
            format!("; a comment\n# another\n{TRIANGLE_TEXT}"),
            TRIANGLE_TEXT.replace('\n', " "),
            TRIANGLE_TEXT.replace(' ', "\n"),
            TRIANGLE_TEXT.replace("use\n", "use\nmade by a vertex\ncolor 0.5 0.5 0.5\n"),
            TRIANGLE_TEXT.replace("end", "end ").replace("facet normal", "color 1 0 0\nfacet normal"),
            TRIANGLE_TEXT.replace("outer loop", "outer loop # of three"),
        ] {
            assert_eq!(read(&shell(text.into())).unwrap(), ascii);
        }
        let wide = format!("\u{feff}{TRIANGLE_TEXT}").encode_utf16().flat_map(u16::to_le_bytes).collect();
        assert_eq!(read(&shell(wide)).unwrap(), ascii);
        assert!(mapgen::free_cells(&ascii.terrain) < ascii.terrain.extent().volume() as u64);
    }

    #[test]
    fn errors_name_the_place() {
        let refuse = |bytes: &[u8]| read(&shell(bytes.to_vec())).unwrap_err().to_string();
        assert_eq!(refuse(b"x"), "byte 1: the file ends within its header of 84 bytes");
        assert!(
            refuse(&[1; 90]).starts_with("byte 90: the file ends here, expected length 842150534 bytes, or a text")
        );
        let other = "line 1: a text without a line that begins with solid; save it";
        assert!(
            refuse(TRIANGLE_TEXT.replace("solid", "object").replace("facet", "face").as_bytes()).starts_with(other)
        );
        assert_eq!(refuse(b"solid\nvertex 1 2\n"), "line 2: a coordinate is missing");
        assert_eq!(refuse(b"solid\nvertex 1 2 3\nendloop\n"), "line 3: a loop of 1 vertices, expected 3");
        assert_eq!(refuse(b"solid\nouter loop\nvortex\n"), "line 3: \"vortex\" is no key of an STL file");
        assert_eq!(refuse(b"solid\nendsolid\n"), "the file has no triangle");
        let cut = TRIANGLE_TEXT.split("  endloop").next().unwrap();
        assert_eq!(refuse(cut.as_bytes()), "line 6: the file ends in a loop of 3 vertices, expected 3 and endloop");
    }

    #[test]
    fn length_decides_where_the_count_is_another() {
        let triangle = |z: f32| {
            let floats = [0.0, 0.0, 1.0, 0.0, 0.0, z, 2.0, 0.0, z, 0.0, 2.0, z];
            floats.iter().flat_map(|float| float.to_le_bytes()).chain([7, 0]).collect::<Vec<u8>>()
        };
        let triangles = [triangle(0.5), triangle(1.5), triangle(4.5)].concat();
        let file = |count: u32, rest: &[u8]| [&[b' '; 80], count.to_le_bytes().as_slice(), &triangles, rest].concat();
        let right = read(&shell(file(3, &[]))).unwrap();
        let warns = |imported: &Imported| imported.notes.iter().any(|note| note.name == "count" && note.is_warning);
        assert!(!warns(&right));
        for count in [0, 1, 2, 4, u32::MAX] {
            let read = read(&shell(file(count, &[]))).unwrap();
            assert_eq!((&read.terrain, warns(&read)), (&right.terrain, true), "{count}");
        }
        let named = [b"solid of triangles".as_slice(), &[b' '; 62], &[0xff; 4], &triangles].concat();
        assert_eq!(read(&shell(named)).unwrap().terrain, right.terrain);
        // Neither padding nor a text is a triangle.
        for rest in [[0; 50], [b'a'; 50]] {
            let read = read(&shell(file(3, &rest))).unwrap();
            assert_eq!((&read.terrain, warns(&read)), (&right.terrain, false));
        }
        for count in [4, u32::MAX] {
            let refused = read(&shell(file(count, b"x"))).unwrap_err().to_string();
            assert!(refused.starts_with("byte 235: the file ends here, expected length "), "{refused}");
        }
    }
}
