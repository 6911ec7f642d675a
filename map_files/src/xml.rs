//! Documents of XML, with errors that name the line.

use std::fmt::Display;
use std::str::FromStr;

use roxmltree::{Document, Error, Node, ParsingOptions};

use super::FormatError;
use super::bytes::{BYTE_ORDER_MARK, shown};

/// Largest number of elements, attributes and texts of a document; each takes about 100 bytes.
const NODES_MAX: u32 = 1 << 22;

/// The text of a file.
///
/// # Errors
/// If it is not in UTF-8.
pub(super) fn text(bytes: &[u8]) -> Result<&str, FormatError> {
    let bytes = bytes.strip_prefix(BYTE_ORDER_MARK).unwrap_or(bytes);
    str::from_utf8(bytes).map_err(|error| FormatError::Utf8(error.valid_up_to()))
}

/// The document of a text.
///
/// # Errors
/// If it is malformed, or too large.
pub(super) fn parse(text: &str) -> Result<Document<'_>, FormatError> {
    let options = ParsingOptions { nodes_limit: NODES_MAX, ..ParsingOptions::default() };
    Document::parse_with_options(text, options).map_err(|error| {
        let reason = error.to_string();
        let reason = reason.split(" at ").next().unwrap_or_default().escape_debug().to_string();
        if matches!(error, Error::DtdDetected) {
            let line = text.find("<!DOCTYPE").map_or(1, |at| text[..at].matches('\n').count() + 1);
            return FormatError::line(line, "no XML: a document type is not read; remove <!DOCTYPE ...>");
        }
        FormatError::line(error.pos().row as usize, format!("no XML: {reason}"))
    })
}

/// The children of an element with a name, whatever their namespace.
pub(super) fn children<'a, 'i>(parent: Node<'a, 'i>, name: &'static str) -> impl Iterator<Item = Node<'a, 'i>> {
    parent.children().filter(move |child| child.is_element() && child.tag_name().name() == name)
}

/// The first of [`children`].
pub(super) fn child<'a, 'i>(parent: Node<'a, 'i>, name: &'static str) -> Option<Node<'a, 'i>> {
    children(parent, name).next()
}

/// Whether an attribute is there and says yes.
pub(super) fn is_true(element: Node<'_, '_>, attribute: &'static str) -> bool {
    element.attribute(attribute).is_some_and(|value| matches!(value.trim(), "true" | "1"))
}

/// The numbers in the text of an element, between spaces.
///
/// # Errors
/// If there are more than `most`, or a word is no number.
pub(super) fn numbers<T: FromStr>(element: Node<'_, '_>, most: usize) -> Result<Vec<T>, FormatError> {
    let words = element.children().filter_map(|text| text.text()).flat_map(str::split_ascii_whitespace);
    let mut numbers = Vec::new();
    for word in words {
        let number = word.parse().map_err(|_| {
            fault(element, format_args!("{} is not a number that may stand there", shown(word.as_bytes())))
        })?;
        if numbers.len() == most {
            return Err(fault(element, format_args!("it has more than {most} numbers")));
        }
        numbers.push(number);
    }
    Ok(numbers)
}

/// A fault of an element.
pub(super) fn fault(element: Node<'_, '_>, reason: impl Display) -> FormatError {
    let line = element.document().text_pos_at(element.range().start).row;
    FormatError::line(line as usize, format!("<{}>: {reason}", element.tag_name().name().escape_debug()))
}
