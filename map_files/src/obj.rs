//! Meshes in Wavefront's OBJ format: vertices and faces, of all objects and groups; everything else
//! is ignored.

use super::bytes::{Bytes, number, shown, three, words};
use super::mesh::{self, Mesh};
use super::{FormatError, ImportSpec, Imported, MapReader, Note, cell_length};

/// A mesh in Wavefront's format.
pub(super) const READER: MapReader = MapReader {
    stored_cell_m: Some(cell_length::in_comment),
    ..MapReader::new("mesh of Wavefront", &["obj"], mesh::OPTIONS, read)
};

/// A map of an OBJ file.
///
/// # Errors
/// If the file is malformed, or its mesh does not fit into a map.
pub(super) fn read(spec: &ImportSpec) -> Result<Imported, FormatError> {
    let mut mesh = Mesh::default();
    let mut groups = 0u64;
    let mut text = Bytes::new(&spec.bytes);
    while let Some((line, content)) = text.line() {
        let mut words = words(content);
        match words.next() {
            Some(b"v") => mesh.vertices.push(three(line, &mut words, "a coordinate")?),
            Some(b"f") => {
                let corners: Result<Vec<u32>, FormatError> =
                    words.map(|word| corner(line, word, mesh.vertices.len())).collect();
                let corners = corners?;
                if corners.len() < 3 {
                    return Err(FormatError::line(
                        line,
                        format!("a face of {} corners, expected 3 or more", corners.len()),
                    ));
                }
                mesh.add_polygon(&corners);
                mesh.check_count()?;
            }
            Some(b"o" | b"g") => groups += 1,
            _ => {}
        }
    }
    let note = (groups > 0).then(|| Note::new("groups", format!("{groups}, which come out as their union")));
    mesh::map(spec, &mesh, note.into_iter().collect())
}

/// The vertex of a corner such as `7`, `7/1/3` or, counted from the last one, `-2`.
fn corner(line: usize, word: &[u8], vertices: usize) -> Result<u32, FormatError> {
    let before = word.split(|&byte| byte == b'/').next();
    let number: i64 = number(line, before, "a corner of a face")?;
    let from_0 = if number < 0 { (vertices as i64).checked_add(number) } else { number.checked_sub(1) };
    let is_vertex = |index: &i64| (0..vertices as i64).contains(index);
    from_0
        .filter(is_vertex)
        .and_then(|index| u32::try_from(index).ok())
        .ok_or_else(|| FormatError::line(line, format!("{} is none of the {vertices} vertices before it", shown(word))))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ImportOptions, options::Kind};

    #[test]
    fn faces_name_vertices_from_the_first_and_from_the_last() {
        // The unit cube, scaled to two cells: quads with and without normals, and one of triangles.
        let text = "# a cube\no cube\nv 0 0 0\nv 2 0 0\nv 2 2 0\nv 0 2 0\nv 0 0 2\nv 2 0 2\nv 2 2 2\nv 0 2 2\nvn 0 0 1\n\
                    f 1 4 3 2\nf 5//1 6//1 7//1 8//1\nf -8 -7 -3 -4\nf 2 3 7 6\nf 3 4 8\nf 3 8 7\ns off\nf 4/1/1 1/1/1 5/1/1 8/1/1\n";
        let options = ImportOptions { inside: Some(Kind::Free), ..ImportOptions::default() };
        let spec = ImportSpec { options, ..ImportSpec::new("a.obj", text.into()) };
        let Imported { terrain, notes, .. } = read(&spec).unwrap();
        assert_eq!(terrain.extent().size(), [4; 3]);
        assert_eq!(mapgen::free_cells(&terrain), 8);
        assert_eq!(notes[0].text, "12 triangles in 1 part(s), 0 dropped because they have no area or are not finite");
    }

    #[test]
    fn errors_name_the_line() {
        let refuse = |text: &str| read(&ImportSpec::new("a.obj", text.into())).unwrap_err().to_string();
        assert_eq!(refuse("v 1 2\n"), "line 1: a coordinate is missing");
        assert_eq!(refuse("v 1 2 3\nf 1 1\n"), "line 2: a face of 2 corners, expected 3 or more");
        assert_eq!(refuse("v 1 2 3\nf 1 1 2\n"), "line 2: \"2\" is none of the 1 vertices before it");
        assert_eq!(refuse("v 1 2 3\nf 1 0 1\n"), "line 2: \"0\" is none of the 1 vertices before it");
        assert_eq!(
            refuse("v 1 2 3\nf 1 1 -9223372036854775808\n"),
            "line 2: \"-9223372036854775808\" is none of the 1 vertices before it"
        );
        assert_eq!(refuse("hello\n"), "the file has no triangle");
    }
}
