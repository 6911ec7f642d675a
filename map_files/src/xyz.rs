//! Point clouds as text (`.xyz`, `.xyzrgb`, `.xyzn`, `.asc`, `.pts`, `.csv`): a point in each line,
//! its coordinates first, with spaces, commas or semicolons between them.
//!
//! Empty lines, comments (`#`, `//`), lines with nothing but a number of points and a first line
//! without three numbers are skipped. If a comment or this line names columns x, y and z, the
//! coordinates are these; if this line names as many columns as a row has, four or more, and not
//! these, it is refused. A word with a comma between two digits is a number with a decimal comma
//! if the line has three words or more between spaces or semicolons.

use super::bytes::{Bytes, decimal_comma, parse_float, shown};
use super::cloud::{self, Cloud};
use super::{FormatError, ImportSpec, Imported, MapReader, Note};

/// Points as text.
pub(super) const READER: MapReader =
    MapReader::new("points as text", &["xyz", "xyzrgb", "xyzn", "asc", "pts", "csv"], cloud::OPTIONS, read);

/// The columns of x, y and z, unless a line names others.
const FIRST: [usize; 3] = [0, 1, 2];

/// Names of the columns of x, y and z, in small letters: those of most programs, and of VeloView
/// and ParaView.
const NAMES: [[&str; 3]; 3] =
    [["x", "y", "z"], ["points_m_xyz:0", "points_m_xyz:1", "points_m_xyz:2"], ["points:0", "points:1", "points:2"]];

/// A map of a text file of points.
///
/// # Errors
/// If a line is no point, or the points do not fit into a map.
pub(super) fn read(spec: &ImportSpec) -> Result<Imported, FormatError> {
    let mut points: Vec<[f64; 3]> = Vec::new();
    let mut announced = 0;
    let mut text = Bytes::new(&spec.bytes);
    let (mut is_first, mut layout, mut header, mut with_commas) = (true, Layout::default(), None, 0u64);
    while let Some((line, content)) = text.line() {
        // A tab at the start stands behind an empty field.
        let row = content.trim_ascii_end();
        let content = row.trim_ascii_start();
        let comment = content.strip_prefix(b"#").or(content.strip_prefix(b"//"));
        if content.is_empty() || comment.is_some() {
            let named = comment.filter(|_| points.is_empty()).map(Header::of).filter(|named| named.columns.is_some());
            header = named.map(|named| (None, named)).or(header);
            continue;
        }
        if is_first && content.get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"ncols")) {
            let reason = "a grid of heights (ESRI ASCII) is no point cloud; save it as points";
            return Err(FormatError::line(line, reason));
        }
        if let Some((place, named)) = header.take() {
            layout = named.layout(row).map_err(|reason| FormatError::line(place.unwrap_or(line), reason))?;
        }
        match point(row, &layout) {
            Some((point, has_commas)) => {
                points.push(point);
                with_commas += u64::from(has_commas);
            }
            // The number of the points that follow.
            None if content.iter().all(u8::is_ascii_digit) => announced += parse_float(content).unwrap_or(0.0) as u64,
            None if is_first => header = Some((Some(line), Header::of(row))),
            None if layout.separator.is_some() || layout.columns != FIRST => {
                let reason = format!("{} has no numbers in the columns x, y and z", shown(content));
                return Err(FormatError::line(line, reason));
            }
            None => {
                return Err(FormatError::line(line, format!("{} does not begin with three numbers", shown(content))));
            }
        }
        is_first = false;
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
    let either = |word: &[u8]| decimal_comma(word).or_else(|| parse_float(word));
    let pick = |words: &[&[u8]], parse: &dyn Fn(&[u8]) -> Option<f64>| {
        let [x, y, z] = columns.map(|column| words.get(column).and_then(|word| parse(word)));
        Some([x?, y?, z?])
    };
    if line.contains(&b',') && matches!(layout.separator, None | Some(b',')) {
        let apart = apart(line);
        let has_commas =
            columns.iter().any(|&column| apart.get(column).is_some_and(|word| decimal_comma(word).is_some()));
        if let Some(point) = pick(&apart, &either).filter(|_| has_commas) {
            return Some((point, true));
        }
    }
    if let Some(separator) = layout.separator.filter(|separator| line.contains(separator)) {
        let (mut found, mut has_commas) = ([None; 3], false);
        for (at, field) in line.split(|&byte| byte == separator).map(<[u8]>::trim_ascii).enumerate() {
            if let Some(axis) = columns.iter().position(|&column| column == at) {
                has_commas |= field.contains(&b',');
                found[axis] = either(field);
            }
            if at >= layout.count && columns != FIRST && !field.is_empty() {
                return None;
            }
        }
        let [x, y, z] = found;
        return Some(([x?, y?, z?], has_commas));
    }
    if columns == FIRST {
        // Most files are so, and a list of words for each line takes longer than its numbers.
        let mut words = words(line, b",;");
        let mut next = || words.next().and_then(parse_float);
        return Some(([next()?, next()?, next()?], false));
    }
    pick(&words(line, b",;").collect::<Vec<_>>(), &parse_float).map(|point| (point, false))
}

/// The words of a line whose commas are decimal ones, save for one that ends a word.
fn apart(line: &[u8]) -> Vec<&[u8]> {
    words(line, b";").map(|word| word.strip_suffix(b",").unwrap_or(word)).collect()
}

/// A line that may name the columns.
struct Header {
    columns: Option<[usize; 3]>,
    separator: Option<u8>,
    /// Number of names.
    count: usize,
}

impl Header {
    fn of(line: &[u8]) -> Self {
        let separator = [b';', b'\t', b','].into_iter().find(|separator| line.contains(separator));
        let names: Vec<String> = match separator {
            Some(separator) => line.split(|&byte| byte == separator).map(name).collect(),
            None => words(line, b"").map(name).filter(|name| !name.is_empty()).collect(),
        };
        let columns = |names: &[&str]| {
            let place = |wanted: &str| names.iter().position(|&name| name == wanted);
            NAMES.into_iter().find_map(|[x, y, z]| Some([place(x)?, place(y)?, place(z)?]))
        };
        let exact: Vec<&str> = names.iter().map(String::as_str).collect();
        let bare: Vec<&str> = exact.iter().map(|name| bare(name)).collect();
        Self { columns: columns(&exact).or_else(|| columns(&bare)), separator, count: names.len() }
    }

    /// Where the coordinates stand in the rows, of which `row` is the first.
    ///
    /// # Errors
    /// If this names the columns of the row and they are not known.
    fn layout(self, row: &[u8]) -> Result<Layout, String> {
        let Self { columns, separator, count } = self;
        let fields = match separator.filter(|separator| row.contains(separator)) {
            Some(separator) => row.strip_suffix(&[separator]).unwrap_or(row).split(|&byte| byte == separator).count(),
            None => words(row, b",;").count(),
        };
        // A sentence may contain these letters, too.
        let is_row = fields == count || fields + 1 == count || apart(row).len() == count;
        match columns {
            Some(columns) if is_row => Ok(Layout { columns, separator, count }),
            Some(columns) if separator.is_some() && columns != FIRST => Err(format!(
                "the names of the columns are {count}, the fields of the first row {fields}; give each column a name"
            )),
            None if fields == count && count > FIRST.len() => {
                Err("the header names no columns x, y and z; name those of the coordinates so".to_owned())
            }
            _ => Ok(Layout::default()),
        }
    }
}

/// The name of a column, in small letters.
fn name(word: &[u8]) -> String {
    let trimmed = |character: char| character.is_whitespace() || ['"', '\'', '/', '#'].contains(&character);
    String::from_utf8_lossy(word).trim_matches(trimmed).to_lowercase()
}

/// A name without what programs put around it: of ROS, of poses, and the unit metre.
fn bare(name: &str) -> &str {
    let mut bare = name;
    for prefix in ["field.", "point.", "position.", "pos_", "pos."] {
        bare = bare.strip_prefix(prefix).unwrap_or(bare);
    }
    let unit = ["[m]", "(m)", "_m"].iter().find_map(|unit| bare.strip_suffix(unit));
    unit.unwrap_or(bare).trim_end_matches([' ', '_'])
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
        ] {
            let text = format!("{header}\n7,0.5,0.5,0.5\n3,2.5,0.5,0.5\n,0.5,2.5,0.5\n");
            assert_eq!(of("a.csv", &text).terrain, terrain, "{header}");
            let other = text.replace(',', "\t");
            assert_eq!(of("a.csv", &other).terrain, terrain, "{other}");
        }
        let refuse = |text: &str| ImportSpec::new("a.csv", text.into()).read().unwrap_err().to_string();
        let unknown = "line 1: the header names no columns x, y and z";
        assert!(refuse("id,easting,northing,height\n1,2,3,4\n").contains(unknown));
        assert!(refuse("id easting northing height\n1 2 3 4\n").contains(unknown));
        assert!(refuse("id,x [mm],y [mm],z [mm]\n1,2,3,4\n").contains(unknown));
        assert!(refuse("n,x,y,z\n\"a\",1,2,3\n\"a, b\",1,2,3\n").contains("line 3: "));
        assert!(refuse("n,x,y,z\n1,9,2,3,4,5\n").contains("the names of the columns are 4"));
        assert_eq!(of("a.xyz", "a room of the house\n0.5 0.5 0.5\n2.5 0.5 0.5\n0.5 2.5 0.5\n").terrain, terrain);
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
