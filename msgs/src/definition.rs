//! Interface definitions of ROS 2, as `.msg` files and the parts of `.srv` and `.action` files have
//! them: constants and fields with their comments.
//!
//! The grammar is that of rosidl, without strings as constants and as defaults, and without arrays
//! as defaults. The build script makes structs of what is read here, [`crate::type_hash`] and
//! [`crate::schema`] read it again for hashes and for recordings.

use std::fmt;

/// The primitive types, with their numbers in `type_description_interfaces/msg/FieldType` and what
/// they are in Rust. In ROS 2 a `char` of a message is a number of eight bits; a `byte` is one that
/// Rust has no other name for.
pub(crate) const PRIMITIVES: [(&str, u32, &str); 15] = [
    ("int8", 2, "i8"),
    ("uint8", 3, "u8"),
    ("int16", 4, "i16"),
    ("uint16", 5, "u16"),
    ("int32", 6, "i32"),
    ("uint32", 7, "u32"),
    ("int64", 8, "i64"),
    ("uint64", 9, "u64"),
    ("float32", 10, "f32"),
    ("float64", 11, "f64"),
    ("char", 3, "u8"),
    ("bool", 15, "bool"),
    ("byte", 16, "u8"),
    ("string", 17, "std::string::String"),
    ("wstring", 18, "std::string::String"),
];

/// What stands between the parts of a `.srv` or `.action` file.
pub(crate) const PART_SEPARATOR: &str = "---";

/// How many elements a field has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Length {
    /// One.
    One,
    /// As many as this.
    Array(usize),
    /// At most as many as this.
    Bounded(usize),
    /// Any number.
    Unbounded,
}

/// The type of a field.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Type<'a> {
    /// The type of an element: a primitive type, or a message as the definition names it.
    pub(crate) element: &'a str,
    /// Most characters of a bounded string.
    pub(crate) string_bound: Option<usize>,
    /// The number of elements.
    pub(crate) length: Length,
}

/// What stands after a name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Value<'a> {
    /// Nothing: a field.
    None,
    /// A default value of a field.
    Default(&'a str),
    /// The value of a constant.
    Constant(&'a str),
}

/// A field or a constant.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Item<'a> {
    /// The number of its line, from 1 on.
    pub(crate) line: usize,
    /// The line without its comment.
    pub(crate) code: &'a str,
    /// The type.
    pub(crate) of_type: Type<'a>,
    /// The name.
    pub(crate) name: &'a str,
    /// Default or constant.
    pub(crate) value: Value<'a>,
    /// The lines of its comment.
    pub(crate) comment: Vec<&'a str>,
}

/// A definition.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Definition<'a> {
    /// The comment that it begins with, by lines.
    pub(crate) comment: Vec<&'a str>,
    items: Vec<Item<'a>>,
}

/// Why a text is no definition.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct DefinitionError {
    /// The number of the line, from 1 on.
    pub(crate) line: usize,
    problem: String,
}

impl fmt::Display for DefinitionError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.problem)
    }
}

impl<'a> Definition<'a> {
    /// Reads a definition. A comment at its beginning belongs to the whole; one beside an item, or
    /// indented below it, to the item; one above an item to that.
    pub(crate) fn parse(text: &'a str) -> Result<Self, DefinitionError> {
        let mut definition = Self::default();
        let mut above = Vec::new();
        let mut is_beside = false;
        for (line, content) in (1..).zip(text.lines()) {
            let (code, comment) = content.split_once('#').map_or((content, None), |(code, rest)| (code, Some(rest)));
            let (code, comment) = (code.trim(), comment.map(str::trim));
            match (code, comment, definition.items.last_mut()) {
                ("", None, None) if definition.comment.is_empty() => definition.comment = std::mem::take(&mut above),
                ("", None, _) => (above, is_beside) = (Vec::new(), false),
                ("", Some(comment), Some(item)) if is_beside && content.starts_with(' ') => item.comment.push(comment),
                ("", Some(comment), _) => above.push(comment),
                _ => {
                    let mut item = Item::parse(line, code)?;
                    item.comment = std::mem::take(&mut above);
                    item.comment.extend(comment);
                    if definition.items.iter().any(|other| other.name == item.name) {
                        return Err(item.wrong(format!("there is another {}", item.name)));
                    }
                    definition.items.push(item);
                    is_beside = true;
                }
            }
        }
        if definition.items.is_empty() && definition.comment.is_empty() {
            definition.comment = above;
        }
        Ok(definition)
    }

    /// The fields, in order.
    pub(crate) fn fields(&self) -> impl Iterator<Item = &Item<'a>> {
        self.items.iter().filter(|item| !item.is_constant())
    }

    /// The constants, in order.
    #[cfg_attr(not(test), allow(dead_code, reason = "the build script has use for it"))]
    pub(crate) fn constants(&self) -> impl Iterator<Item = &Item<'a>> {
        self.items.iter().filter(|item| item.is_constant())
    }
}

impl<'a> Item<'a> {
    fn parse(line: usize, code: &'a str) -> Result<Self, DefinitionError> {
        let wrong = |problem: String| DefinitionError { line, problem: format!("`{code}`: {problem}") };
        let (of_type, rest) = code
            .split_once([' ', '\t'])
            .map(|(of_type, rest)| (of_type, rest.trim()))
            .ok_or_else(|| wrong("expected TYPE NAME, TYPE NAME DEFAULT or TYPE NAME=VALUE".to_owned()))?;
        let (name, value) = match (rest.split_once('='), rest.split_once([' ', '\t'])) {
            (Some((name, value)), _) => (name.trim(), Value::Constant(value.trim())),
            (None, Some((name, value))) => (name, Value::Default(value.trim())),
            (None, None) => (rest, Value::None),
        };
        let of_type = Type::parse(of_type).map_err(wrong)?;
        let item = Self { line, code, of_type, name, value, comment: Vec::new() };
        let legal = |letter: fn(&u8) -> bool| {
            let mut bytes = name.bytes();
            bytes.next().is_some_and(|first| letter(&first))
                && bytes.all(|byte| letter(&byte) || byte.is_ascii_digit() || byte == b'_')
                && !name.contains("__")
                && !name.ends_with('_')
        };
        match item.is_constant() {
            true if !legal(u8::is_ascii_uppercase) => {
                Err(item.wrong(format!("name {name}: expected capitals, digits and single underscores")))
            }
            false if !legal(u8::is_ascii_lowercase) => {
                Err(item.wrong(format!("name {name}: expected small letters, digits and single underscores")))
            }
            _ => item.check_value(),
        }
    }

    /// Whether it is a constant, and no field.
    pub(crate) fn is_constant(&self) -> bool {
        matches!(self.value, Value::Constant(_))
    }

    fn wrong(&self, problem: String) -> DefinitionError {
        DefinitionError { line: self.line, problem: format!("`{}`: {problem}", self.code) }
    }

    fn check_value(self) -> Result<Self, DefinitionError> {
        let (Value::Default(value) | Value::Constant(value)) = self.value else { return Ok(self) };
        let Type { element, length, .. } = self.of_type;
        let is_legal = match element {
            _ if length != Length::One => false,
            "bool" => matches!(value, "true" | "false"),
            "float32" | "float64" => value.parse::<f64>().is_ok_and(f64::is_finite),
            "int8" => value.parse::<i8>().is_ok(),
            "uint8" | "char" | "byte" => value.parse::<u8>().is_ok(),
            "int16" => value.parse::<i16>().is_ok(),
            "uint16" => value.parse::<u16>().is_ok(),
            "int32" => value.parse::<i32>().is_ok(),
            "uint32" => value.parse::<u32>().is_ok(),
            "int64" => value.parse::<i64>().is_ok(),
            "uint64" => value.parse::<u64>().is_ok(),
            _ => false,
        };
        match is_legal {
            true => Ok(self),
            false => Err(self.wrong(format!("value {value}: expected one number or boolean of this type"))),
        }
    }
}

impl<'a> Type<'a> {
    fn parse(text: &'a str) -> Result<Self, String> {
        let expected = "expected a primitive type or a message, such as uint8, Point, geometry_msgs/Point, string<=22, \
                        then nothing, [], [3] or [<=3]";
        let wrong = || format!("type {text}: {expected}");
        let number = |digits: &str| digits.parse().ok().filter(|&number: &usize| number > 0).ok_or_else(wrong);
        let (element, length) = match text.split_once('[') {
            None => (text, Length::One),
            Some((element, length)) => match length.strip_suffix(']').ok_or_else(wrong)? {
                "" => (element, Length::Unbounded),
                length => (
                    element,
                    match length.strip_prefix("<=") {
                        Some(bound) => Length::Bounded(number(bound)?),
                        None => Length::Array(number(length)?),
                    },
                ),
            },
        };
        let (element, string_bound) = match element.split_once("<=") {
            None => (element, None),
            Some((element @ ("string" | "wstring"), bound)) => (element, Some(number(bound)?)),
            Some(_) => return Err(wrong()),
        };
        let of_type = Self { element, string_bound, length };
        let is_word =
            |word: &str| !word.is_empty() && word.bytes().all(|byte| byte.is_ascii_alphanumeric() || byte == b'_');
        let name = element.rsplit('/').next().unwrap_or_default();
        let is_message = name.starts_with(|first: char| first.is_ascii_uppercase())
            && element.split('/').all(is_word)
            && element.matches('/').count() <= 2;
        if of_type.primitive().is_some() || is_message { Ok(of_type) } else { Err(wrong()) }
    }

    /// The number and the Rust name of the element, if it is primitive.
    pub(crate) fn primitive(&self) -> Option<(u32, &'static str)> {
        PRIMITIVES.iter().find(|(name, ..)| *name == self.element).map(|(_, number, rust)| (*number, *rust))
    }

    /// Package and name of the message that an element is, in a definition of `package`.
    pub(crate) fn message<'b>(&self, package: &'b str) -> (&'b str, &'b str)
    where
        'a: 'b,
    {
        let (package, name) = self.element.split_once('/').unwrap_or((package, self.element));
        (package, name.strip_prefix("msg/").unwrap_or(name))
    }
}

#[cfg(test)]
#[path = "definition/tests.rs"]
mod tests;
