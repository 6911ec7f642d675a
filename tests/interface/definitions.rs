//! The `.msg` files against the structs: the same fields in the same order, the same types, the
//! same constants.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use msgs::message::MessageType;

use crate::cases;
use crate::shape::Shapes;

/// A constant: type, name, value.
type Constant = (String, String, u64);

/// What a `.msg` file says.
#[derive(Default)]
struct Definition {
    fields: Vec<(String, String)>,
    constants: Vec<Constant>,
}

fn parse(message: MessageType) -> Definition {
    let mut definition = Definition::default();
    for line in message.definition.lines() {
        let code = line.split('#').next().unwrap().trim();
        let Some((kind, rest)) = code.split_once(' ') else {
            assert!(code.is_empty(), "{message}: {line}");
            continue;
        };
        if let Some((name, value)) = rest.split_once('=') {
            definition.constants.push((
                in_full(kind, message.package),
                name.trim().to_owned(),
                value.trim().parse().unwrap(),
            ));
        } else {
            // After the name comes a default value, if there is one.
            let name = rest.split_whitespace().next().unwrap();
            definition.fields.push((in_full(kind, message.package), name.to_owned()));
        }
    }
    definition
}

/// A type of the same package may stand without the name of the package; a `byte` is eight bits
/// that Rust has no other name for.
fn in_full(kind: &str, package: &str) -> String {
    let own = kind.starts_with(|first: char| first.is_ascii_uppercase());
    if own { format!("{package}/{kind}") } else { kind.replace("byte", "uint8") }
}

/// The constants of each `impl` block in a source text, by the name of the type.
fn constants_in(source: &str) -> BTreeMap<String, Vec<Constant>> {
    let mut found: BTreeMap<String, Vec<Constant>> = BTreeMap::new();
    let mut owner = String::new();
    for line in source.lines().map(str::trim) {
        if let Some(name) = line.strip_prefix("impl ").and_then(|rest| rest.strip_suffix(" {")) {
            owner = name.to_owned();
        }
        let Some(constant) = line.strip_prefix("pub const ") else { continue };
        let (name, rest) = constant.trim_end_matches(';').split_once(": ").unwrap();
        let (kind, value) = rest.split_once(" = ").unwrap();
        let value = match value {
            "u32::MAX" => u64::from(u32::MAX),
            "u64::MAX" => u64::MAX,
            number => number.parse().unwrap(),
        };
        let kind = if kind.starts_with('i') { kind.replace('i', "int") } else { kind.replace('u', "uint") };
        found.entry(owner.clone()).or_default().push((kind, name.to_owned(), value));
    }
    found
}

#[test]
fn fields_are_those_of_the_structs() {
    for case in cases() {
        let mut shapes = Shapes::new();
        (case.record)(&mut shapes);
        let definition = parse(case.message);
        assert!(!definition.fields.is_empty(), "{}: ROS 2 gives an empty message a hidden field", case.name());
        assert_eq!(shapes[&case.name()], definition.fields, "{}", case.name());
    }
}

#[test]
fn constants_are_those_of_the_structs() {
    let mut in_source = constants_in(
        &[
            include_str!("../../msgs/src/maes_msgs.rs"),
            include_str!("../../msgs/src/maes_msgs/changes.rs"),
            include_str!("../../msgs/src/sensor_msgs.rs"),
            include_str!("../../msgs/src/visualization_msgs.rs"),
            include_str!("../../msgs/src/diagnostic_msgs.rs"),
            include_str!("../../msgs/src/rcl_interfaces.rs"),
        ]
        .concat(),
    );
    for case in cases() {
        let in_source = in_source.remove(case.message.name).unwrap_or_default();
        assert_eq!(in_source, parse(case.message).constants, "{}", case.name());
    }
    assert_eq!(in_source, BTreeMap::new());
}

#[test]
fn the_package_builds_every_file_there_is() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../msgs");
    let mut files: Vec<String> = fs::read_dir(folder.join("msg"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    files.sort();
    let cmake = fs::read_to_string(folder.join("CMakeLists.txt")).unwrap();
    let built: Vec<&str> = cmake.lines().filter_map(|line| line.trim().strip_prefix("\"msg/")).collect();
    assert_eq!(built, files.iter().map(|file| format!("{file}\"")).collect::<Vec<_>>());
    let known: Vec<String> = cases()
        .iter()
        .filter(|case| case.message.package == "maes_msgs")
        .map(|case| format!("{}.msg", case.message.name))
        .collect();
    assert_eq!(known, files);
}

#[test]
fn names_are_what_rosidl_accepts() {
    for case in cases() {
        for (_, name) in parse(case.message).fields {
            let legal = name.bytes().all(|byte| byte.is_ascii_lowercase() || byte.is_ascii_digit() || byte == b'_');
            assert!(legal && !name.contains("__") && !name.ends_with('_'), "{}: {name}", case.name());
        }
    }
}
