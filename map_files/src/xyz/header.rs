//! Lines before the points of a text that may name the columns.

use super::{FIRST, Layout, apart, quoted, words};

/// Names of the columns of x, y and z, in small letters: those of most programs, of VeloView and of
/// ParaView.
const NAMES: [[&str; 3]; 6] = [
    ["x", "y", "z"],
    ["points_m_xyz:0", "points_m_xyz:1", "points_m_xyz:2"],
    ["points_m_xyz_0", "points_m_xyz_1", "points_m_xyz_2"],
    ["points:0", "points:1", "points:2"],
    ["points_0", "points_1", "points_2"],
    ["coordinates_0", "coordinates_1", "coordinates_2"],
];

/// Other names of each of them, of surveys.
const OTHER_NAMES: [&[&str]; 3] =
    [&["x", "easting", "east"], &["y", "northing", "north"], &["z", "height", "elevation", "altitude", "elev", "alt"]];

/// A line that may name the columns.
pub(super) struct Header {
    pub(super) line: usize,
    pub(super) is_comment: bool,
    columns: Option<[usize; 3]>,
    /// Names of a coordinate that two columns have, in small and in capital letters.
    named_twice: Option<String>,
    /// How many of the coordinates are named.
    known: usize,
    separator: Option<u8>,
    /// Number of names.
    count: usize,
    /// Whether all names have letters.
    are_words: bool,
}

impl Header {
    pub(super) fn of(line: usize, text: &[u8], is_comment: bool) -> Self {
        // What announces the names, as in "Columns: x y z".
        let announced = text.windows(2).rposition(|pair| b":=".contains(&pair[0]) && pair[1].is_ascii_whitespace());
        let text = announced.map_or(text, |at| &text[at + 2..]);
        let separator = [b';', b'\t', b'|', b','].into_iter().find(|separator| text.contains(separator));
        let mut as_written: Vec<String> = match separator {
            Some(separator) => text.split(|&byte| byte == separator).map(name).collect(),
            None => words(text, b"").map(name).filter(|name| !name.is_empty()).collect(),
        };
        as_written.pop_if(|name| name.is_empty());
        let names: Vec<String> = as_written.iter().map(|name| name.to_lowercase()).collect();
        let columns = |names: &[&str]| {
            let place = |wanted: &str| names.iter().position(|&name| name == wanted);
            NAMES.into_iter().find_map(|[x, y, z]| Some([place(x)?, place(y)?, place(z)?]))
        };
        let exact: Vec<&str> = names.iter().map(String::as_str).collect();
        let bare: Vec<&str> = exact.iter().map(|name| bare(name)).collect();
        let others =
            OTHER_NAMES.map(|names| names.iter().find_map(|&wanted| bare.iter().position(|&name| name == wanted)));
        let known = others.iter().flatten().count();
        let others = if let [Some(x), Some(y), Some(z)] = others { Some([x, y, z]) } else { None };
        let are_words = names.iter().all(|name| name.contains(char::is_alphabetic));
        // A table may have X, of its row numbers or of another frame, beside x.
        let of_one_case = |[x, y, z]: [&str; 3]| {
            let place = |wanted: &str| as_written.iter().position(|name| name == wanted);
            Some([place(x)?, place(y)?, place(z)?])
        };
        let (small, capital) = (of_one_case(["x", "y", "z"]), of_one_case(["X", "Y", "Z"]));
        let twice =
            ["x", "y", "z"].into_iter().find(|&wanted| exact.iter().filter(|&&name| name == wanted).count() > 1);
        let named_twice = twice.filter(|_| small.is_some() == capital.is_some()).map(|wanted| {
            let both: Vec<&str> =
                as_written.iter().map(String::as_str).filter(|name| name.to_lowercase() == wanted).collect();
            both.join(" and ")
        });
        let columns = small.xor(capital).or_else(|| columns(&exact)).or_else(|| columns(&bare)).or(others);
        Self { line, is_comment, columns, named_twice, known, separator, count: names.len(), are_words }
    }

    /// This one, or one before it that says more.
    pub(super) fn instead_of(self, before: Option<Self>) -> Option<Self> {
        let names = |header: &Self| header.columns.is_some() || header.known > 1;
        let says_more = names(&self) || (!self.is_comment && !before.as_ref().is_some_and(names));
        if says_more { Some(self) } else { before }
    }

    /// Where the coordinates stand in the rows, of which `row` is the first.
    ///
    /// # Errors
    /// If this names the columns of the row and they are not known.
    pub(super) fn layout(&self, row: &[u8]) -> Result<Layout, String> {
        let &Self { columns, known, separator, count, are_words, .. } = self;
        let fields_of_row: Vec<&[u8]> = match separator.filter(|separator| row.contains(separator)) {
            Some(separator) => row.split(|&byte| byte == separator).map(<[u8]>::trim_ascii).collect(),
            None => words(row, b",;").collect(),
        };
        let all = if row.contains(&b'"') { quoted(row, separator).len() } else { fields_of_row.len() };
        let ends_empty = separator.is_some_and(|separator| row.ends_with(&[separator]));
        let fields = all - usize::from(ends_empty);
        // A sentence may contain these letters, too.
        let is_row = fields == count || all == count || apart(row).len() == count;
        // R and pandas write the names or the numbers of rows, and no name of their column.
        let is_quoted = row.first() == Some(&b'"') && row.iter().filter(|&&b| b == b'"').count() == 2;
        let is_number = |field: &[u8]| !field.is_empty() && field.iter().all(u8::is_ascii_digit);
        let [begins_with_number, all_are_numbers] = match fields_of_row.as_slice() {
            [first, rest @ ..] => [is_number(first), rest.iter().take(3).all(|field| is_number(field))],
            [] => [false; 2],
        };
        let has_row_names = all == count + 1 && (is_quoted || (begins_with_number && !all_are_numbers));
        let differs = || {
            format!(
                "the names of the columns are {count}, the fields of the first row {fields}; give each column a name"
            )
        };
        if let (true, Some(names)) = (is_row || has_row_names, &self.named_twice) {
            return Err(format!("the header has the columns {names}; leave one set of x, y and z, in one case"));
        }
        match columns {
            Some(columns) if is_row => Ok(Layout { columns, separator, count }),
            Some(columns) if has_row_names => {
                Ok(Layout { columns: columns.map(|column| column + 1), separator, count: count + 1 })
            }
            Some(columns) if separator.is_some() && columns != FIRST => Err(differs()),
            // The row may begin with its number, or end with a value that is not named.
            Some(_) if all == count + 1 && begins_with_number => Err(differs()),
            None if fields == count
                && (count > FIRST.len() || known > 0 || (count == FIRST.len() && separator.is_some() && are_words)) =>
            {
                Err("the header names no columns x, y and z; name those of the coordinates so".to_owned())
            }
            _ => Ok(Layout::default()),
        }
    }
}

/// The name of a column.
fn name(word: &[u8]) -> String {
    let trimmed = |character: char| character.is_whitespace() || ['"', '\'', '/', '#'].contains(&character);
    String::from_utf8_lossy(word).trim_matches(trimmed).to_owned()
}

/// A name without what programs put around it: of ROS, of poses, and the unit metre.
fn bare(name: &str) -> &str {
    let mut bare = name;
    for prefix in ["field.", "point.", "point_", "position.", "position_", "pos_", "pos.", "coord_"] {
        bare = bare.strip_prefix(prefix).unwrap_or(bare);
    }
    let unit = ["[m]", "(m)", "_m"].iter().find_map(|unit| bare.strip_suffix(unit));
    let bare = unit.unwrap_or(bare).trim_end_matches([' ', '_']);
    ["_coordinate", "_coord", "coordinate", "coord"].iter().find_map(|kind| bare.strip_suffix(kind)).unwrap_or(bare)
}
