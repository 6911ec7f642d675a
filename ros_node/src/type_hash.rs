//! Type hashes of messages, by which ROS 2 tells whether two sides mean the same by a type.
//!
//! REP-2016, version RIHS01: SHA-256 of the description of a type and of all types that it refers
//! to, as JSON in one form. The descriptions follow from the `.msg` files alone: names and types of
//! fields, without constants, defaults and comments.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::sync::OnceLock;

use msgs::message::{ALL, MessageType};
use sha2::{Digest, Sha256};

/// Numbers of the primitive types (`type_description_interfaces/msg/FieldType`).
const TYPE_IDS: [(&str, u32); 16] = [
    ("int8", 2),
    ("uint8", 3),
    ("int16", 4),
    ("uint16", 5),
    ("int32", 6),
    ("uint32", 7),
    ("int64", 8),
    ("uint64", 9),
    ("float32", 10),
    ("float64", 11),
    // In ROS 2 a `char` of a message is a number of eight bits.
    ("char", 3),
    ("bool", 15),
    ("byte", 16),
    ("string", 17),
    ("wstring", 18),
    (BOUNDED_STRING, 21),
];

/// What a bounded string is called here.
const BOUNDED_STRING: &str = "string<=";

/// The number of a type that has a description of its own.
const NESTED: u32 = 1;

/// What is added to the number of an element for arrays, bounded and unbounded sequences.
const ARRAY: u32 = 48;
const BOUNDED_SEQUENCE: u32 = 96;
const UNBOUNDED_SEQUENCE: u32 = 144;

/// Lets all endpoints that this process makes from now on announce the hashes of their types.
///
/// The DDS library can do that with the fixes of `contrib/rustdds` only.
pub(super) fn announce() {
    /// What the published library does, which has no such function: a glob import shadows it.
    #[allow(dead_code, reason = "the copy with the fixes has the function")]
    fn set_type_user_data(_of_type: fn(&str) -> Option<Vec<u8>>) {}
    {
        #[allow(
            unused_imports,
            clippy::wildcard_imports,
            reason = "only the copy with the fixes has the function"
        )]
        use rustdds::discovery::*;
        set_type_user_data(user_data);
    }
}

/// The user data of an endpoint by the name that DDS has for its type, such as
/// `std_msgs::msg::dds_::Header_` (REP-2016).
fn user_data(dds_name: &str) -> Option<Vec<u8>> {
    static HASHES: OnceLock<BTreeMap<String, String>> = OnceLock::new();
    let hashes = HASHES.get_or_init(|| {
        let named = |message: &MessageType| format!("{}::msg::dds_::{}_", message.package, message.name);
        ALL.iter().map(|message| (named(message), of(*message))).collect()
    });
    hashes.get(dds_name).map(|hash| format!("typehash={hash};").into_bytes())
}

/// The hash of a type: `RIHS01_` and 64 hexadecimal digits.
fn of(message: MessageType) -> String {
    let digest = Sha256::digest(text(message));
    let hex: String = digest.iter().map(|byte| format!("{byte:02x}")).collect();
    format!("RIHS01_{hex}")
}

/// What is hashed.
fn text(message: MessageType) -> String {
    let mut referred = BTreeSet::new();
    collect(message, &mut referred);
    let mut names: Vec<(String, MessageType)> = referred.into_iter().map(|of| (of.to_string(), of)).collect();
    names.sort();
    let referred: Vec<String> = names.into_iter().map(|(_, message)| description(message)).collect();
    let (own, referred) = (description(message), referred.join(", "));
    format!("{{\"type_description\": {own}, \"referenced_type_descriptions\": [{referred}]}}")
}

fn collect(message: MessageType, referred: &mut BTreeSet<MessageType>) {
    for field in fields(message) {
        if let Some(nested) = field.nested
            && referred.insert(nested)
        {
            collect(nested, referred);
        }
    }
}

fn description(message: MessageType) -> String {
    let fields: Vec<String> = fields(message).map(|field| field.to_string()).collect();
    format!("{{\"type_name\": \"{message}\", \"fields\": [{}]}}", fields.join(", "))
}

/// A field of a message.
struct Field {
    name: &'static str,
    number: u32,
    /// Of an array or a bounded sequence.
    capacity: &'static str,
    /// Of a bounded string.
    string_capacity: &'static str,
    nested: Option<MessageType>,
}

impl fmt::Display for Field {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { name, number, capacity, string_capacity, nested } = self;
        let nested = nested.map(|nested| nested.to_string()).unwrap_or_default();
        write!(
            f,
            "{{\"name\": \"{name}\", \"type\": {{\"type_id\": {number}, \"capacity\": {capacity}, \"string_capacity\": \
             {string_capacity}, \"nested_type_name\": \"{nested}\"}}}}"
        )
    }
}

fn fields(message: MessageType) -> impl Iterator<Item = Field> {
    message.definition.lines().filter_map(move |line| field(line, message.package))
}

/// The field of a line; nothing for constants and comments.
fn field(line: &'static str, package: &str) -> Option<Field> {
    let code = line.split('#').next().unwrap_or_default();
    let mut words = code.split_whitespace();
    let (kind, name) = (words.next()?, words.next()?);
    let is_constant = name.contains('=') || words.next().is_some_and(|word| word.starts_with('='));
    if is_constant {
        return None;
    }
    let (element, collection) = match kind.split_once('[') {
        Some((element, length)) => (element, Some(length.trim_end_matches(']'))),
        None => (kind, None),
    };
    let (added, capacity) = match collection {
        None => (0, "0"),
        Some("") => (UNBOUNDED_SEQUENCE, "0"),
        Some(length) => match length.strip_prefix("<=") {
            Some(bound) => (BOUNDED_SEQUENCE, bound),
            None => (ARRAY, length),
        },
    };
    let (element, string_capacity) = match element.strip_prefix(BOUNDED_STRING) {
        Some(bound) => (BOUNDED_STRING, bound),
        None => (element, "0"),
    };
    let primitive = TYPE_IDS.iter().find(|(name, _)| *name == element);
    let nested = match primitive {
        Some(_) => None,
        None => Some(find(element, package)?),
    };
    let number = primitive.map_or(NESTED, |(_, number)| *number) + added;
    Some(Field { name, number, capacity, string_capacity, nested })
}

/// The type that a field of a message in `package` calls `reference`.
fn find(reference: &str, package: &str) -> Option<MessageType> {
    let (package, name) = reference.split_once('/').unwrap_or((package, reference));
    ALL.iter().copied().find(|message| message.package == package && message.name == name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_have_number_capacity_and_name() {
        let of = |line: &'static str| field(line, "geometry_msgs").unwrap().to_string();
        let expected = |number: u32, capacity: u32, string: u32, nested: &str| {
            format!(
                "{{\"name\": \"a\", \"type\": {{\"type_id\": {number}, \"capacity\": {capacity}, \"string_capacity\": \
                 {string}, \"nested_type_name\": \"{nested}\"}}}}"
            )
        };
        assert_eq!(of("float64[36] a"), expected(59, 36, 0, ""));
        assert_eq!(of("uint8[] a # comment"), expected(147, 0, 0, ""));
        assert_eq!(of("string[<=3] a"), expected(113, 3, 0, ""));
        assert_eq!(of("string<=22 a"), expected(21, 0, 22, ""));
        assert_eq!(of("Point[] a"), expected(145, 0, 0, "geometry_msgs/msg/Point"));
        assert_eq!(of("std_msgs/Header a"), expected(1, 0, 0, "std_msgs/msg/Header"));
        assert_eq!(of("float64 a 1.0"), expected(11, 0, 0, ""));
        for none in ["", "# comment", "uint8 A=1", "uint8 A = 1", "string A=\"x y\""] {
            assert!(field(none, "geometry_msgs").is_none(), "{none}");
        }
    }

    #[test]
    fn every_type_has_a_hash() {
        let hashes: BTreeSet<String> = ALL.iter().map(|&message| of(message)).collect();
        assert_eq!(hashes.len(), ALL.len());
        assert!(hashes.iter().all(|hash| hash.len() == 71));
        let known = "typehash=RIHS01_b106235e25a4c5ed35098aa0a61a3ee9c9b18d197f398b0e4206cea9acf9c197;";
        assert_eq!(user_data("builtin_interfaces::msg::dds_::Time_").unwrap(), known.as_bytes());
        assert_eq!(user_data("std_msgs::msg::dds_::Unknown_"), None);
    }
}
