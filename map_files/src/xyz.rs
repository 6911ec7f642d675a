//! Point clouds as text (`.xyz`, `.xyzrgb`, `.xyzn`, `.asc`, `.pts`, `.csv`): a point in each line,
//! its coordinates first, with spaces, commas or semicolons between them.
//!
//! Empty lines, comments (`#`, `//`, `%`), lines with nothing but a number of points and lines
//! before the first one with three numbers are skipped. If one of these names columns x, y and z,
//! the coordinates are these; if it names as many columns as a row has and not these, it is
//! refused. A word with a comma between two digits is a number with a decimal comma if the line has
//! three words or more between spaces or semicolons. Numbers may be in quotes. A coordinate that is
//! empty, or `NA`, is not finite: the point is dropped and counted.

mod header;

use super::bytes::{Bytes, decimal_comma, in_utf8, parse_float, shown};
use super::cloud::{self, Cloud};
use super::{FormatError, ImportSpec, Imported, MapReader, Note};

use header::Header;

/// Points as text.
pub(super) const READER: MapReader =
    MapReader::new("points as text", &["xyz", "xyzrgb", "xyzn", "asc", "pts", "csv"], cloud::OPTIONS, read);

/// The columns of x, y and z, unless a line names others.
const FIRST: [usize; 3] = [0, 1, 2];

/// What stands for a coordinate that is missing.
const MISSING: [&[u8]; 7] = [b"", b"NA", b"N/A", b"null", b"NULL", b"None", b"-"];

/// Most lines before the first point, empty ones and comments not counted.
const TITLE_LINES: usize = 32;

/// A map of a text file of points.
///
/// # Errors
/// If a line is no point, or the points do not fit into a map.
pub(super) fn read(spec: &ImportSpec) -> Result<Imported, FormatError> {
    let mut points: Vec<[f64; 3]> = Vec::new();
    let mut announced = 0;
    let bytes = in_utf8(&spec.bytes);
    let mut text = Bytes::new(&bytes);
    let (mut layout, mut with_commas) = (Layout::default(), 0u64);
    // Lines before the first point: what names the columns, and the last one.
    let (mut header, mut titles, mut last_title) = (None::<Header>, 0, None);
    while let Some((line, content)) = text.line() {
        // A tab at the start stands behind an empty field.
        let row = content.trim_ascii_end();
        let content = row.trim_ascii_start();
        let comment = content.strip_prefix(b"#").or(content.strip_prefix(b"//")).or(content.strip_prefix(b"%"));
        if comment.is_some() || content.iter().all(|byte| b",; \t".contains(byte)) {
            if let Some(comment) = comment.filter(|_| points.is_empty()) {
                header = Header::of(line, comment, true).instead_of(header);
            }
            continue;
        }
        if points.is_empty() && content.get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"ncols")) {
            let reason = "a grid of heights (ESRI ASCII) is no point cloud; save it as points";
            return Err(FormatError::line(line, reason));
        }
        let begun = if points.is_empty() { header.as_ref().map(|header| header.layout(row)) } else { None };
        match point(row, begun.as_ref().and_then(|layout| layout.as_ref().ok()).unwrap_or(&layout)) {
            Some((point, has_commas)) => {
                if let Some(begun) = begun {
                    let place = header.as_ref().filter(|header| !header.is_comment).map_or(line, |header| header.line);
                    layout = begun.map_err(|reason| FormatError::line(place, reason))?;
                }
                points.push(point);
                with_commas += u64::from(has_commas);
            }
            // The number of the points that follow.
            None if content.iter().all(u8::is_ascii_digit) => announced += parse_float(content).unwrap_or(0.0) as u64,
            None if points.is_empty() && titles < TITLE_LINES => {
                (titles, last_title) = (titles + 1, Some((line, content)));
                header = Header::of(line, row, false).instead_of(header);
            }
            None if layout.separator.is_some() || layout.columns != FIRST => {
                let reason = format!("{} has no numbers in the columns x, y and z", shown(content));
                return Err(FormatError::line(line, reason));
            }
            None => return Err(no_numbers(line, content)),
        }
    }
    if let Some((line, content)) = last_title.filter(|_| points.is_empty()) {
        return Err(no_numbers(line, content));
    }
    let columns = layout.columns;
    let mut notes = Vec::new();
    if columns != FIRST {
        let [x, y, z] = columns.map(|column| column + 1);
        notes.push(Note::new("columns", format!("x, y and z are columns {x}, {y} and {z}, as their names say")));
    }
    if with_commas > 0 {
        notes.push(Note::new("commas", format!("{with_commas} points with commas for decimal points")));
    }
    if announced > 0 && announced != points.len() as u64 {
        let text = format!("the file announces {announced} points and has {}: it may be cut", points.len());
        notes.push(Note::warning("count", text));
    }
    let counts = |first: f64| points.iter().zip(0_u32..).all(|(point, number)| point[0] == first + f64::from(number));
    if points.len() > 2 && (counts(0.0) || counts(1.0)) {
        let text = "the first column, taken for x, counts the points; if it is their number, leave it out";
        notes.push(Note::warning("columns", text));
    }
    cloud::map(spec, Cloud { points: points.into(), notes, ..Cloud::default() })
}

fn no_numbers(line: usize, content: &[u8]) -> FormatError {
    FormatError::line(line, format!("{} does not begin with three numbers", shown(content)))
}

/// The words of a line between spaces and `separators`.
fn words<'a>(line: &'a [u8], separators: &'a [u8]) -> impl Iterator<Item = &'a [u8]> {
    let is_between = |byte: &u8| byte.is_ascii_whitespace() || separators.contains(byte);
    line.split(is_between).filter(|word| !word.is_empty())
}

/// Where the coordinates stand in a row.
struct Layout {
    columns: [usize; 3],
    /// What alone stands between the fields of a row that has it; fields may be empty then.
    separator: Option<u8>,
    /// Number of fields.
    count: usize,
}

impl Default for Layout {
    fn default() -> Self {
        Self { columns: FIRST, separator: None, count: 0 }
    }
}

/// The point of a line, and whether it has decimal commas.
fn point(line: &[u8], layout: &Layout) -> Option<([f64; 3], bool)> {
    let columns = layout.columns;
    if line.contains(&b'"') {
        let fields = quoted(line, layout.separator);
        let field = |column: usize| fields.get(column).copied();
        let has_commas = columns.iter().any(|&column| field(column).is_some_and(|field| field.contains(&b',')));
        let [x, y, z] = columns.map(|column| field(column).and_then(coordinate));
        return Some(([x?, y?, z?], has_commas));
    }
    if line.contains(&b',') && matches!(layout.separator, None | Some(b',')) {
        let apart = apart(line);
        let has_commas =
            columns.iter().any(|&column| apart.get(column).is_some_and(|word| decimal_comma(word).is_some()));
        let [x, y, z] = columns.map(|column| apart.get(column).and_then(|word| coordinate(word)));
        if let (true, Some(x), Some(y), Some(z)) = (has_commas, x, y, z) {
            return Some(([x, y, z], true));
        }
    }
    let known = layout.separator.filter(|separator| line.contains(separator));
    if let Some(separator) = known.or_else(|| separator_of_empty(line)) {
        let (mut found, mut has_commas) = ([None; 3], false);
        for (at, field) in line.split(|&byte| byte == separator).map(<[u8]>::trim_ascii).enumerate() {
            if let Some(axis) = columns.iter().position(|&column| column == at) {
                has_commas |= field.contains(&b',');
                found[axis] = coordinate(field);
            }
            if at >= layout.count && columns != FIRST && !field.is_empty() {
                return None;
            }
        }
        match found {
            [Some(x), Some(y), Some(z)] => return Some(([x, y, z], has_commas)),
            _ if known.is_some() => return None,
            _ => {}
        }
    }
    let number = |word: &[u8]| parse_float(word).or_else(|| MISSING.contains(&word).then_some(f64::NAN));
    if columns == FIRST {
        // Most files are so, and a list of words for each line takes longer than its numbers.
        let mut words = words(line, b",;");
        let mut next = || words.next().and_then(number);
        return Some(([next()?, next()?, next()?], false));
    }
    let words: Vec<&[u8]> = words(line, b",;").collect();
    let [x, y, z] = columns.map(|column| words.get(column).and_then(|word| number(word)));
    Some(([x?, y?, z?], false))
}

/// A coordinate, maybe with a decimal comma; not finite if it is missing.
fn coordinate(field: &[u8]) -> Option<f64> {
    let missing = || MISSING.contains(&field).then_some(f64::NAN);
    decimal_comma(field).or_else(|| parse_float(field)).or_else(missing)
}

/// What stands between the fields of a line, if one of them is empty.
fn separator_of_empty(line: &[u8]) -> Option<u8> {
    let mut is_empty = true;
    memchr::memchr2(b',', b';', line)?;
    for &byte in line.iter().filter(|byte| !byte.is_ascii_whitespace()) {
        match byte {
            b',' | b';' if is_empty => return Some(byte),
            _ => is_empty = matches!(byte, b',' | b';'),
        }
    }
    None
}

/// The fields of a line with quotes, without these, between `separator` or what stands between
/// them outside of quotes.
fn quoted(line: &[u8], separator: Option<u8>) -> Vec<&[u8]> {
    let mut is_inside = false;
    let outside: Vec<bool> = line
        .iter()
        .map(|&byte| {
            is_inside ^= byte == b'"';
            !is_inside
        })
        .collect();
    let has = |separator: &u8| line.iter().zip(&outside).any(|(byte, is_outside)| byte == separator && *is_outside);
    let separator = separator.filter(has).or_else(|| [b';', b'\t', b','].into_iter().find(has));
    let mut fields = Vec::new();
    let mut first = 0;
    for at in 0..=line.len() {
        let is_end = line.get(at).is_none_or(|&byte| {
            outside[at] && separator.map_or(byte.is_ascii_whitespace(), |separator| byte == separator)
        });
        if is_end {
            let field = line[first..at].trim_ascii();
            if separator.is_some() || !field.is_empty() {
                let bare = field.strip_prefix(b"\"").and_then(|field| field.strip_suffix(b"\""));
                fields.push(bare.unwrap_or(field).trim_ascii());
            }
            first = at + 1;
        }
    }
    fields
}

/// The words of a line whose commas are decimal ones, save for one that ends a word.
fn apart(line: &[u8]) -> Vec<&[u8]> {
    words(line, b";").map(|word| word.strip_suffix(b",").unwrap_or(word)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(file: &str, text: &str) -> Imported {
        ImportSpec::new(file, text.into()).read().unwrap()
    }

    #[test]
    fn counts_that_do_not_fit_and_numbered_points_are_said() {
        let notes = |file: &str, text: &str| {
            let notes = of(file, text).notes.into_iter().filter(|note| note.text.contains("points"));
            notes.map(|note| note.name).collect::<Vec<_>>()
        };
        let points = "0.5 0.5 0.5 1\n2.5 0.5 0.5 1\n4.5 0.5 0.5 1\n";
        assert!(!notes("a.pts", &format!("3\n{points}")).contains(&"count"));
        assert!(notes("a.pts", &format!("9\n{points}")).contains(&"count"));
        assert!(!notes("a.xyz", points).contains(&"columns"));
        assert!(notes("a.xyz", "1 0.5 0.5 0.5\n2 2.5 0.5 0.5\n3 4.5 0.5 0.5\n").contains(&"columns"));
    }

    #[test]
    fn lines_are_points() {
        let text = "x,y,z,red\n# a comment\n0.5,0.5,0.5,9\n\n2.5;0.5; 0.5\n// more\n 0.5\t2.5 0.5 1 2 3\n";
        let terrain = of("a.xyz", text).terrain;
        assert_eq!(terrain.extent().size(), [5, 5, 3]);
        assert_eq!(mapgen::free_cells(&terrain), 9 - 3);
        let error = read(&ImportSpec::new("a.xyz", "1 2 3\n4 5\n".into())).unwrap_err().to_string();
        let marked = format!("\u{feff}{}", text.split_once('\n').unwrap().1);
        assert_eq!(of("a.xyz", &marked).terrain, terrain);
        let only = |text: &str| of("a.xyz", text).terrain.extent().size();
        assert_eq!(only("\u{feff}0.5 0.5 0.5\n4.5 0.5 0.5\n"), [7, 3, 3], "the first line counts");
        assert_eq!(error, "line 2: \"4 5\" does not begin with three numbers");
    }

    #[test]
    fn all_extensions_and_spellings_give_the_same_map() {
        let spaces = "0.5 0.5 0.5\n2.5 0.5 0.5\n0.5 2.5 0.5\n";
        let terrain = of("a.xyz", spaces).terrain;
        let pts = spaces.replace('\n', " -120 9 9 9\n");
        let second = format!("1\n{}", "0.5 0.5 0.5\n");
        let commas = spaces.replace('.', ",");
        for (file, text) in [
            ("a.xyzrgb", spaces.to_owned()),
            ("a.asc", format!("//X Y Z\n{spaces}")),
            ("a.asc", format!("# points with x, y and z\n# x y z\n{spaces}")),
            ("a.asc", format!("# points with x, y and z\n{spaces}")),
            ("a.pts", format!("3\n{pts}")),
            ("a.pts", format!("3\n{spaces}{second}")),
            ("a.csv", format!("\"X\",\"Y\",\"Z\"\n{}", spaces.replace(' ', ","))),
            ("a.csv", "Intensity;X;Y;Z\n7;0.5;0.5;0.5\n7;2.5;0.5;0.5\n7;0.5;2.5;0.5\n".to_owned()),
            ("a.csv", "id,y,x,z\n7,0.5,0.5,0.5\n8,0.5,2.5,0.5\n9,2.5,0.5,0.5\n".to_owned()),
            ("a.csv", commas.replace(' ', ";")),
            ("a.asc", commas.clone()),
            ("a.xyz", commas.replace(' ', "\t")),
        ] {
            assert_eq!(of(file, &text).terrain, terrain, "{file}: {text}");
        }
        let notes = of("a.xyz", &commas).notes;
        assert_eq!(notes[0].text, "3 points with commas for decimal points");
        assert_eq!(of("a.csv", "1,2,3\n4,5,6\n").terrain, of("a.csv", "1, 2, 3\n4, 5, 6\n").terrain);
        let refuse = |text: &str| ImportSpec::new("a.asc", text.into()).read().unwrap_err().to_string();
        assert!(refuse("ncols 4\nnrows 3\n").contains("line 1: a grid of heights (ESRI ASCII) is no point cloud"));
        assert!(
            refuse("i x y z\n1 2 3 4\n5 6 7\n").contains("line 3: \"5 6 7\" has no numbers in the columns x, y and z")
        );
    }

    /// R and pandas write row numbers under no name, or under the name X.
    #[test]
    fn row_numbers_are_no_coordinates() {
        let points = [["0.5", "0.5", "0.5"], ["2.5", "0.5", "0.5"], ["0.5", "2.5", "0.5"]];
        let rows = |separator: &str, numbers: [&str; 3]| -> String {
            let row = |(number, point): (&str, [&str; 3])| format!("{number}{separator}{}\n", point.join(separator));
            numbers.into_iter().zip(points).map(row).collect()
        };
        let terrain = of("a.xyz", "0.5 0.5 0.5\n2.5 0.5 0.5\n0.5 2.5 0.5\n").terrain;
        for separator in [" ", "\t", ",", ";", "|"] {
            let rows = rows(separator, ["129", "7", "30"]);
            for header in ["x y z", "X x y z"] {
                let text = format!("{}\n{rows}", header.replace(' ', separator));
                assert_eq!(of("a.csv", &text).terrain, terrain, "{text}");
            }
        }
        // In quotes they are names, whatever they are.
        let quoted = format!("x y z\n{}", rows(" ", ["\"a\"", "\"b\"", "\"c\""]));
        assert_eq!(of("a.csv", &quoted).terrain, terrain);
        let refuse = |text: &str| ImportSpec::new("a.csv", text.into()).read().unwrap_err().to_string();
        // A number of the row, or a value behind the others?
        assert!(refuse("x y z\n1 2 3 4\n").contains("the names of the columns are 3, the fields of the first row 4"));
        // A value behind the others.
        assert_eq!(of("a.csv", "x y z\n0.5 0.5 0.5 9\n2.5 0.5 0.5 9\n0.5 2.5 0.5 8\n").terrain, terrain);
        // Two sets of coordinates, or none that is whole.
        for header in ["X,Y,Z,x,y,z", "X,x,Y,Z,y,z"] {
            let error = refuse(&format!("{header}\n1,2,3,4,5,6\n"));
            assert!(error.contains("the header has the columns X and x"), "{error}");
        }
        assert!(refuse("X,x,y,Z\n1,2,3,4\n").contains("the columns X and x; leave one set"));
    }

    #[test]
    fn columns_are_found_by_their_names_and_unknown_ones_are_refused() {
        let terrain = of("a.xyz", "0.5 0.5 0.5\n2.5 0.5 0.5\n0.5 2.5 0.5\n").terrain;
        for header in [
            ",x,y,z",
            "\"Unnamed: 0\",x,y,z",
            "scan number,x,y,z",
            "timestamp,pos_x,pos_y,pos_z",
            "intensity,X [m],Y [m],Z (m)",
            "id,x_m,y_m,z_m",
            "%time,field.point.x,field.point.y,field.point.z",
            "# Columns: intensity, x, y, z",
            "ID,X_COORD,Y_COORD,Z_COORD",
            "id,easting,northing,elevation",
            "\"intensity\",\"Points_0\",\"Points_1\",\"Points_2\"",
            "Survey of a hall\n\nid,x,y,z\n-,[m],[m],[m]",
            "% written by a program\n% id, x, y, z",
            "id,x,y,z,",
        ] {
            let text = format!("{header}\n7,0.5,0.5,0.5\n3,2.5,0.5,0.5\n,0.5,2.5,0.5\n");
            assert_eq!(of("a.csv", &text).terrain, terrain, "{header}");
            let other = text.replace(',', "\t");
            assert_eq!(of("a.csv", &other).terrain, terrain, "{other}");
        }
        let refuse = |text: &str| ImportSpec::new("a.csv", text.into()).read().unwrap_err().to_string();
        let unknown = "line 1: the header names no columns x, y and z";
        assert!(refuse("id,lon,lat,height\n1,2,3,4\n").contains(unknown));
        assert!(refuse("id row column height\n1 2 3 4\n").contains(unknown));
        for three in
            ["height,x,row", "lat,lon,height", "time;range;angle", "# height,x,row", "height x row", "# y x row"]
        {
            assert!(refuse(&format!("{three}\n1,2,3\n")).contains("the header names no columns x, y and z"), "{three}");
        }
        assert!(refuse("id,x [mm],y [mm],z [mm]\n1,2,3,4\n").contains(unknown));
        assert!(refuse("n,x,y,z\n\"a\",1,2,3\n\"a, b\",1,b,3\n").contains("line 3: "));
        assert!(refuse("n,x,y,z\n1,9,2,3,4,5\n").contains("the names of the columns are 4"));
        assert_eq!(of("a.xyz", "a room of the house\n0.5 0.5 0.5\n2.5 0.5 0.5\n0.5 2.5 0.5\n").terrain, terrain);
    }

    #[test]
    fn rows_of_tables_are_points_in_all_spellings() {
        let terrain = of("a.xyz", "0.5 0.5 0.5\n2.5 0.5 0.5\n0.5 2.5 0.5\n").terrain;
        let rows = "0.5,0.5,0.5\n2.5,0.5,0.5\n0.5,2.5,0.5\n";
        let all_quoted = rows.replace(',', "\",\"").replace("\n", "\"\n\"");
        let all_quoted = format!("\"{}", &all_quoted[..all_quoted.len() - 1]);
        let with_row_names = "\"x\" \"y\" \"z\"\n\"1\" 0.5 0.5 0.5\n\"2\" 2.5 0.5 0.5\n\"3\" 0.5 2.5 0.5\n";
        for text in [
            all_quoted.clone(),
            format!("\"x\",\"y\",\"z\"\n{all_quoted}"),
            all_quoted.replace("\",\"", "\";\"").replace('.', ","),
            all_quoted.replace('.', ","),
            with_row_names.to_owned(),
            format!("sep=;\nx;y;z\n{}", rows.replace(',', ";")),
            format!("# Unit: m\n# Columns: x y z intensity\n{}", rows.replace(',', " ").replace('\n', " 1\n")),
            format!("% a\n% b\n{rows}"),
            rows.replace(".5", ".5D+00"),
            "height,x,y\n0.5,0.5,0.5\n0.5,2.5,0.5\n0.5,0.5,2.5\n".to_owned(),
            "northing,easting,height\n0.5,0.5,0.5\n0.5,2.5,0.5\n2.5,0.5,0.5\n".to_owned(),
            "y x alt\n0.5 0.5 0.5\n0.5 2.5 0.5\n2.5 0.5 0.5\n".to_owned(),
        ] {
            assert_eq!(of("a.csv", &text).terrain, terrain, "{text}");
        }
        let wide = rows.encode_utf16().fold(vec![0xff, 0xfe], |bytes, unit| [&bytes[..], &unit.to_le_bytes()].concat());
        assert_eq!(ImportSpec::new("a.csv", wide).read().unwrap().terrain, terrain);
        // Rows without a complete point.
        let header = "x,y,z,i\n";
        for (header, rest) in [
            ("", ",,3.5,255,9\n1.5,,2.5,200,9\n"),
            ("", "; ; 3.5; 255\n"),
            (header, ",,,7\n"),
            (header, "NA,NA,NA,1\nnull,1,2,3\n"),
            ("", "NA NA NA\n"),
            ("", "\"\",\"1\",\"2\"\n"),
        ] {
            let imported = of("a.csv", &format!("{header}{}{rest}", rows.replace('\n', ",7\n")));
            assert_eq!(imported.terrain, terrain, "{rest}");
            let dropped = format!("{} dropped because they are not finite", rest.lines().count());
            assert!(imported.notes.iter().any(|note| note.text.contains(&dropped)), "{:?}", imported.notes);
        }
        let refuse = |text: &str| ImportSpec::new("a.csv", text.into()).read().unwrap_err().to_string();
        assert!(refuse("8\nwater\nNa 0 0 0\nH 1 0 0\n").contains("line 4: \"H 1 0 0\" does not begin with three"));
    }

    #[test]
    fn decimal_commas_may_have_commas_between_them() {
        let terrain = of("a.xyz", "0.5 0.5 0.5\n2.5 0.5 0.5\n0.5 2.5 0.5\n").terrain;
        let text = "0,5, 0,5, 0,5\n2,5, 0,5, 0,5\n0,5, 2,5, 0,5\n";
        let imported = of("a.csv", text);
        assert_eq!(imported.terrain, terrain);
        assert_eq!(imported.notes[0].text, "3 points with commas for decimal points");
        assert_eq!(of("a.csv", &format!("x, y, z\n{text}")).terrain, terrain);
        assert!(of("a.csv", "1, 2, 3\n4, 5, 6\n").notes.iter().all(|note| note.name != "commas"));
    }
}
