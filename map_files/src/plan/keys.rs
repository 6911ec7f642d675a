//! The keys of a `map.yaml` of the map server.
//!
//! YAML of any style is read, by the crate saphyr-parser, which keeps a hundred bytes for each byte
//! of some files: their length is bounded. References to other values are refused. Looked at:
//! saphyr and serde-saphyr, which build a tree of the whole file on top of it.

use std::collections::BTreeSet;

use saphyr_parser::{Event, Parser};
use voxels::Extent;

use super::super::FormatError;
use super::super::bytes::shown;

/// The keys of a `map.yaml`.
pub(super) struct Keys {
    pub(super) image: String,
    pub(super) resolution_m: f64,
    /// Place of the lower left corner, metres, and the turn about it, radians.
    pub(super) origin: [f64; 3],
    pub(super) occupied_thresh: f64,
    pub(super) free_thresh: f64,
    pub(super) negate: bool,
    pub(super) mode: Mode,
}

/// How pixels become occupancies.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Mode {
    Trinary,
    Scale,
    Raw,
}

/// The names of the keys that are read.
const OF_THE_SERVER: [&str; 7] = ["image", "resolution", "origin", "occupied_thresh", "free_thresh", "negate", "mode"];

/// Longest file, bytes: those of the map server have some hundred.
const BYTES_MAX: usize = 1 << 16;

impl Keys {
    /// The keys of a file; the map server ignores others as well, such as those of map_saver's
    /// versions.
    ///
    /// # Errors
    /// If the file is malformed, or lacks a key that has no default.
    pub(super) fn read(bytes: &[u8]) -> Result<Self, FormatError> {
        if bytes.len() > BYTES_MAX {
            return Err(FormatError::Entry {
                place: "the file".to_owned(),
                reason: format!("{} bytes, allowed are {BYTES_MAX}", bytes.len()),
            });
        }
        let text = str::from_utf8(bytes).map_err(|error| FormatError::Utf8(error.valid_up_to()))?;
        let mut image = None;
        let mut resolution_m = None;
        let mut origin: Option<Vec<f64>> = None;
        let (mut occupied_thresh, mut free_thresh, mut negate, mut mode) = (0.65, 0.25, false, Mode::Trinary);
        let mut seen = BTreeSet::new();
        for Entry { line, key, value } in entries(text.strip_prefix('\u{feff}').unwrap_or(text))? {
            if !OF_THE_SERVER.contains(&key.as_str()) {
                continue;
            }
            if !seen.insert(key.clone()) {
                return Err(FormatError::line(line, format!("{key} is given twice; leave out one of them")));
            }
            let wrong =
                |is: &str, expected: &str| FormatError::line(line, format!("{key} is {is}, expected {expected}"));
            let number = |text: &str| {
                let number: Option<f64> = text.parse().ok().filter(|number: &f64| number.is_finite());
                number.ok_or_else(|| wrong(&shown(text.as_bytes()), "a number"))
            };
            let value = match (key.as_str(), value) {
                ("origin", Value::List(items)) => {
                    origin = Some(items.iter().map(|item| number(item)).collect::<Result<_, _>>()?);
                    continue;
                }
                ("origin", Value::Text(text)) => return Err(wrong(&shown(text.as_bytes()), "[x, y, yaw]")),
                (_, Value::Text(text)) => text,
                (_, Value::List(_)) => return Err(wrong("a list", "one value")),
                (_, Value::Other) => return Err(wrong("a mapping or a reference", "the value itself")),
            };
            match key.as_str() {
                // A block may end with the end of a line.
                "image" => image = Some(value.trim_end().to_owned()).filter(|value| !value.is_empty()),
                "resolution" => {
                    let metres = number(&value)?;
                    Extent::new([1; 3], metres).map_err(|reason| FormatError::line(line, reason.to_string()))?;
                    resolution_m = Some(metres);
                }
                "occupied_thresh" => occupied_thresh = number(&value)?,
                "free_thresh" => free_thresh = number(&value)?,
                "negate" => {
                    negate = match value.as_str() {
                        "0" | "false" | "False" | "FALSE" | "no" | "No" | "NO" | "off" | "Off" | "OFF" => false,
                        "1" | "true" | "True" | "TRUE" | "yes" | "Yes" | "YES" | "on" | "On" | "ON" => true,
                        _ => return Err(wrong(&shown(value.as_bytes()), "0 or 1")),
                    }
                }
                // The map server lowers its letters.
                _ => {
                    mode = match value.to_ascii_lowercase().as_str() {
                        "trinary" => Mode::Trinary,
                        "scale" => Mode::Scale,
                        "raw" => Mode::Raw,
                        _ => return Err(wrong(&shown(value.as_bytes()), "trinary, scale or raw")),
                    }
                }
            }
        }
        let origin = origin.ok_or(FormatError::Nothing("key origin"))?;
        let count = origin.len();
        let origin: [f64; 3] = origin.try_into().map_err(|_| FormatError::Entry {
            place: "origin".to_owned(),
            reason: format!("{count} numbers, expected [x, y, yaw]"),
        })?;
        if !(0.0..=1.0).contains(&free_thresh) || !(free_thresh..=1.0).contains(&occupied_thresh) {
            return Err(FormatError::Entry {
                place: "occupied_thresh".to_owned(),
                reason: format!(
                    "{occupied_thresh}, with free_thresh = {free_thresh}: expected 0 <= free_thresh <= occupied_thresh <= 1"
                ),
            });
        }
        Ok(Self {
            image: image.ok_or(FormatError::Nothing("key image"))?,
            resolution_m: resolution_m.ok_or(FormatError::Nothing("key resolution"))?,
            origin,
            occupied_thresh,
            free_thresh,
            negate,
            mode,
        })
    }
}

/// A key of the file with its value.
struct Entry {
    line: usize,
    key: String,
    value: Value,
}

/// What a key has.
enum Value {
    Text(String),
    /// Texts alone.
    List(Vec<String>),
    /// A mapping, a list with something else in it, or a reference.
    Other,
}

/// The entries of the first document of a file, which is a mapping.
///
/// # Errors
/// Where and why the text is no YAML, or that it is no mapping.
fn entries(text: &str) -> Result<Vec<Entry>, FormatError> {
    let mut parser = Parser::new_from_str(text);
    let mut next = || match parser.next() {
        Some(Ok((event, span))) => Ok((event, span.start.line())),
        Some(Err(error)) => Err(FormatError::line(error.marker().line(), format!("no YAML: {}", error.info()))),
        None => Err(FormatError::Nothing("end of its YAML")),
    };
    let mut entries = Vec::new();
    loop {
        match next()? {
            (Event::StreamStart | Event::DocumentStart(_), _) => {}
            (Event::MappingStart(..), _) => break,
            (Event::StreamEnd | Event::DocumentEnd, _) => return Ok(entries),
            (Event::Scalar(text, ..), line) => {
                let reason = format!("a line is {}, expected KEY: VALUE", shown(text.as_bytes()));
                return Err(FormatError::line(line, reason));
            }
            (_, line) => return Err(FormatError::line(line, "a list, expected KEY: VALUE".to_owned())),
        }
    }
    loop {
        let (line, key) = match next()? {
            (Event::MappingEnd, _) => break,
            (Event::Scalar(key, ..), line) => (line, key.into_owned()),
            (_, line) => return Err(FormatError::line(line, "a key is no text, expected KEY: VALUE".to_owned())),
        };
        let value = match next()?.0 {
            Event::Scalar(text, ..) => Value::Text(text.into_owned()),
            Event::Alias(_) => Value::Other,
            start => {
                let mut items = matches!(start, Event::SequenceStart(..)).then(Vec::new);
                let mut depth = 1;
                while depth > 0 {
                    match next()?.0 {
                        Event::Scalar(text, ..) if depth == 1 => {
                            items.iter_mut().for_each(|items| items.push(text.to_string()))
                        }
                        Event::SequenceStart(..) | Event::MappingStart(..) => (depth, items) = (depth + 1, None),
                        Event::SequenceEnd | Event::MappingEnd => depth -= 1,
                        Event::Alias(_) => items = None,
                        _ => {}
                    }
                }
                items.map_or(Value::Other, Value::List)
            }
        };
        entries.push(Entry { line, key, value });
    }
    // What follows the mapping has to be YAML as well.
    next()?;
    Ok(entries)
}
