//! Meshes in Wavefront's OBJ format: vertices and faces, of all objects and groups; everything else
//! is ignored.

use std::borrow::Cow;

use super::bytes::{Bytes, digits, in_utf8, number, shown, three, words};
use super::mesh::{self, Mesh};
use super::options::Up;
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
    let bytes = in_utf8(&spec.bytes);
    let Parsed { mesh, notes } = parse(&bytes)?;
    if let Some(up) = up_by_comment(&bytes) {
        return mesh::map_up(spec, mesh, (up, "as a comment of the file says"), notes);
    }
    match writer_of_y(&bytes) {
        Some(writer) => {
            let reason = format!("as {writer} writes it by default{}", mesh.advice_on_up(Up::Y));
            mesh::map_up(spec, mesh, (Up::Y, &reason), notes)
        }
        None => mesh::map(spec, mesh, notes),
    }
}

/// The mesh of a file, as its coordinates are.
pub(super) struct Parsed {
    pub(super) mesh: Mesh,
    notes: Vec<Note>,
}

/// The mesh of a file.
///
/// # Errors
/// If the file is malformed.
pub(super) fn parse(bytes: &[u8]) -> Result<Parsed, FormatError> {
    let mut mesh = Mesh::default();
    let mut groups = 0u64;
    let bytes = in_utf8(bytes);
    let mut text = Bytes::new(&bytes);
    // Faces may come before their vertices: the highest vertex that they need, and their line.
    let mut awaited: Option<(u32, usize)> = None;
    // Such polygons, with the number of their first triangle: they are cut when all is there.
    let mut uncut: Vec<(usize, Vec<u32>)> = Vec::new();
    let mut skipped = 0u64;
    let mut corners: Vec<u32> = Vec::new();
    while let Some((line, content)) = whole_line(&mut text) {
        let mut words = words(&content);
        match words.next() {
            Some(b"v") => mesh.vertices.push(three(line, &mut words, "a coordinate")?),
            // Of old, faces are "fo".
            Some(b"f" | b"fo") => {
                corners.clear();
                for word in words.take_while(|word| !word.starts_with(b"#")) {
                    let corner = corner(line, word, mesh.vertices.len())?;
                    if corner as usize >= mesh.vertices.len() && awaited.is_none_or(|(highest, _)| highest < corner) {
                        awaited = Some((corner, line));
                    }
                    corners.push(corner);
                }
                if corners.len() < 3 {
                    skipped += 1;
                } else {
                    if corners.iter().any(|&corner| corner as usize >= mesh.vertices.len()) {
                        uncut.push((mesh.triangles.len(), corners.clone()));
                        mesh.triangles.extend(std::iter::repeat_n([0; 3], corners.len() - 2));
                    } else {
                        mesh.add_polygon(&corners);
                    }
                    mesh.check_count()?;
                }
            }
            Some(kind @ (b"o" | b"g")) => {
                groups += 1;
                let name = String::from_utf8_lossy(content.trim_ascii_start().get(kind.len()..).unwrap_or_default());
                mesh.begin_part(name.trim());
            }
            _ => {}
        }
    }
    let count = mesh.vertices.len();
    if let Some((highest, line)) = awaited.filter(|&(highest, _)| highest as usize >= count) {
        return Err(FormatError::line(line, format!("\"{}\" is none of the {count} vertices", u64::from(highest) + 1)));
    }
    for (first, corners) in uncut {
        let cut = mesh.cut(&corners);
        mesh.triangles[first..first + cut.len()].copy_from_slice(&cut);
    }
    let note = (groups > 0).then(|| Note::new("groups", format!("{groups}, which come out as their union")));
    let notes = note.into_iter().chain(mesh::note_of_skipped(skipped)).collect();
    Ok(Parsed { mesh, notes })
}

/// The axis upwards that the comments at the beginning of a file name: `z up` or `up: y`, in any
/// spelling of these words.
fn up_by_comment(bytes: &[u8]) -> Option<Up> {
    let mut text = Bytes::new(bytes);
    std::iter::from_fn(|| text.line()).map_while(|(_, line)| line.strip_prefix(b"#")).find_map(|comment| {
        let comment = String::from_utf8_lossy(comment).to_lowercase();
        // A comma ends what belongs together, as in "walls lined up, y is north".
        comment.split([',', ';', '.']).find_map(|part| {
            let words: Vec<&str> =
                part.split(|letter: char| !letter.is_alphanumeric()).filter(|word| !word.is_empty()).collect();
            words.windows(2).find_map(|pair| match pair {
                ["z", "up"] | ["up", "z"] => Some(Up::Z),
                ["y", "up"] | ["up", "y"] => Some(Up::Y),
                _ => None,
            })
        })
    })
}

/// The next line, with those that it continues on after a `\` at its end.
fn whole_line<'a>(text: &mut Bytes<'a>) -> Option<(usize, Cow<'a, [u8]>)> {
    let (line, content) = text.line()?;
    let Some(mut begun) = content.strip_suffix(b"\\").map(<[u8]>::to_vec) else {
        return Some((line, Cow::Borrowed(content)));
    };
    while let Some((_, more)) = text.line() {
        begun.push(b' ');
        match more.strip_suffix(b"\\") {
            Some(more) => begun.extend(more),
            None => {
                begun.extend(more);
                break;
            }
        }
    }
    Some((line, Cow::Owned(begun)))
}

/// The program that has written a file, by its first line, if it has y upwards unless its user
/// changes that: Blender, from the exporter in Python (`# Blender v2.79 ... OBJ File`) to that of
/// 3.3 and later (`# Blender 3.4.1`).
fn writer_of_y(bytes: &[u8]) -> Option<String> {
    let (_, first) = Bytes::new(bytes).line()?;
    let mut words = words(first.strip_prefix(b"#")?);
    (words.next() == Some(b"Blender")).then(|| match words.next().map(shown) {
        Some(version) => format!("Blender {}", version.trim_matches('"')),
        None => "Blender".to_owned(),
    })
}

/// The vertex of a corner such as `7`, `7/1/3` or, counted from the last one, `-2`. Only the former
/// may come later.
fn corner(line: usize, word: &[u8], vertices: usize) -> Result<u32, FormatError> {
    let before = word.split(|&byte| byte == b'/').next();
    let number: i64 = match before.and_then(digits) {
        Some(number) => number,
        None => number(line, before, "a corner of a face")?,
    };
    let from_0 = if number < 0 { (vertices as i64).checked_add(number) } else { number.checked_sub(1) };
    let is_vertex = |index: &i64| *index >= 0 && (number > 0 || *index < vertices as i64);
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
    fn axis_upwards_is_that_of_the_writer() {
        let up = |first: &str, [x, y, z]: [i32; 3], option| {
            let faces = "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n";
            let corner = |at: i32| format!("v {} {} {}\n", (at & 1) * x, (at >> 1 & 1) * y, (at >> 2) * z);
            let text = format!("{first}\n{}{faces}", (0..8).map(corner).collect::<String>());
            let options = ImportOptions { up: option, ..ImportOptions::default() };
            let imported = read(&ImportSpec { options, ..ImportSpec::new("a.obj", text.into_bytes()) }).unwrap();
            let note = imported.notes.iter().find(|note| note.name == "up").unwrap().text.clone();
            (imported.terrain.extent().size(), note)
        };
        for (first, writer) in [("# Blender 3.4.1", "3.4.1"), ("# Blender v2.79 (sub 0) OBJ File: ''", "v2.79")] {
            let note = format!("y, as Blender {writer} writes it by default; the option up changes that");
            assert_eq!(up(first, [6, 4, 5], None), ([8, 7, 6], note));
        }
        assert_eq!(up("# Blender 3.4.1", [6, 4, 5], Some(Up::Z)), ([8, 6, 7], "z, by the option up".to_owned()));
        let said = "as a comment of the file says; the option up changes that";
        assert_eq!(up("# walls, Y-up", [6, 4, 5], None), ([8, 7, 6], format!("y, {said}")));
        assert_eq!(up("# Blender 3.4.1\n# up: Z", [6, 4, 5], None).1, format!("z, {said}"));
        let open = "z, as the format leaves it open";
        assert!(up("# walls lined up, y is north", [6, 4, 5], None).1.starts_with(open));
        assert_eq!(up("# walls", [6, 4, 5], None).1, format!("{open}; the option up changes that"));
        assert!(up("# a hall", [24, 5, 10], None).1.contains("y is by far the shortest side"));
        assert!(up("# Blender 3.4.1", [24, 10, 5], None).1.contains("z is by far the shortest side"));
    }

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
        // With comments behind faces, the old word for them, faces first, and in UTF-16.
        let (vertices, faces) = text.split_at(text.find("f 1 4").unwrap());
        let wide = format!("\u{feff}{text}").encode_utf16().flat_map(u16::to_be_bytes).collect();
        let first = faces.replace("-8 -7 -3 -4", "1 2 6 5");
        for bytes in [
            text.replace(" 3 2\n", " 3 2 # the floor, 9\n").replace("5//1\n", "5//1 #\n").into(),
            text.replace("\nf ", "\nfo ").into(),
            format!("{first}{vertices}").into_bytes(),
            wide,
        ] {
            let read = read(&ImportSpec { bytes, ..spec.clone() }).unwrap();
            assert_eq!((&read.terrain, &read.notes[0]), (&terrain, &notes[0]));
        }
        // In lines that go on, and with faces that are none.
        let broken = text.replace(" 3 2\n", " \\\r\n  3 \\\n2\n").replace("s off\n", "f 1 2\nf 3\nf 1 1 2\n");
        let continued = read(&ImportSpec { bytes: broken.into(), ..spec }).unwrap();
        assert_eq!(continued.terrain, terrain);
        assert!(
            continued.notes.iter().any(|note| note.text == "2 faces of less than 3 corners"),
            "{:?}",
            continued.notes
        );
    }

    #[test]
    fn errors_name_the_line() {
        let refuse = |text: &str| read(&ImportSpec::new("a.obj", text.into())).unwrap_err().to_string();
        assert_eq!(refuse("v 1 2\n"), "line 1: a coordinate is missing");
        assert_eq!(refuse("v 1 2 3\nf 1 1\n"), "the file has no triangle");
        assert_eq!(
            refuse("v 1 2 3\nf 1 \\\n1 \\\r\n2\nf x\n"),
            "line 5: a corner of a face is \"x\", expected a number"
        );
        assert_eq!(refuse("v 1 2 3\nf 1 1 2\n"), "line 2: \"2\" is none of the 1 vertices");
        assert_eq!(refuse("f 1 4 3\nf 2 9 1\nv 1 2 3\nv 1 2 3\n"), "line 2: \"9\" is none of the 2 vertices");
        assert_eq!(refuse("v 1 2 3\nf 1 1 9999999999\n"), "line 2: \"9999999999\" is none of the 1 vertices before it");
        assert_eq!(refuse("f -1 -1 -1\nv 1 2 3\n"), "line 1: \"-1\" is none of the 0 vertices before it");
        assert_eq!(refuse("v 1 2 3\nf 1 0 1\n"), "line 2: \"0\" is none of the 1 vertices before it");
        assert_eq!(
            refuse("v 1 2 3\nf 1 1 -9223372036854775808\n"),
            "line 2: \"-9223372036854775808\" is none of the 1 vertices before it"
        );
        assert_eq!(refuse("hello\n"), "the file has no triangle");
    }
}
